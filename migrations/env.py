"""Alembic's entry: runs on the connection that `service.platform.db.schema` hands over, or, for a
developer's `alembic revision --autogenerate`, on the database of `MODALBASE_DATABASE_URL`.
"""

from alembic import context
from sqlalchemy import Connection

from service.platform.db.base import Base
from service.platform.db.engine import make_engine
from service.platform.settings import Settings


def theirs(name: str | None, kind: str) -> bool:
    """The queue's own tables are its library's business, not part of our models."""
    return kind == "table" and (name or "").startswith("procrastinate_")


def run(connection: Connection) -> None:
    """Run the migrations asked for in one transaction."""
    context.configure(
        connection=connection,
        target_metadata=Base.metadata,
        include_name=lambda name, kind, _parents: not theirs(name, kind),
        compare_server_default=True,
    )
    with context.begin_transaction():
        context.run_migrations()


handed_over = context.config.attributes.get("connection")
if handed_over is not None:
    run(handed_over)
else:
    import service.app.composition  # noqa: F401  imports every table

    url = Settings().database_url
    if url is None:
        raise SystemExit("set MODALBASE_DATABASE_URL to the database to compare with")
    with make_engine(url).connect() as own:
        run(own)
        own.commit()
