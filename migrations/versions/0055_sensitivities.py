"""The schema as it was when the steps before it became one. A database of an older revision is
upgraded with `service.platform.db.schema.LAST_WITH_OLDER`.
"""

from pathlib import Path

from alembic import op

from migrations import procrastinate_schema

revision = "0055_sensitivities"
down_revision = None
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Make every table, and those of the queue."""
    statements = Path(__file__).with_suffix(".sql").read_text(encoding="utf-8")
    connection = op.get_bind()
    connection.exec_driver_sql(statements.replace("%", "%%"))
    procrastinate_schema.apply(connection, procrastinate_schema.FIRST)


def downgrade() -> None:
    """Nothing: a database without tables has no revision."""
