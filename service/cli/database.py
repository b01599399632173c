"""Commands on the schema of a service's database."""

from __future__ import annotations

import typer

from service.cli.options import Data, settings_of_running

db = typer.Typer(help="The database's schema.", no_args_is_help=True)


@db.command("upgrade")
def db_upgrade(data: Data = None) -> None:
    """Bring the database's schema to this version's."""
    from service.db.engine import make_engine
    from service.db.opening import open_database
    from service.db.schema import current_revision, upgrade

    with open_database(settings_of_running(data)) as opened:
        engine = make_engine(opened.database_url or "")
        upgrade(engine)
        typer.echo(f"the schema is at {current_revision(engine)}")
        engine.dispose()


@db.command("current")
def db_current(data: Data = None) -> None:
    """Print the revision that the database is at; exit 1 where it is not this version's."""
    from service.db.engine import make_engine
    from service.db.opening import open_database
    from service.db.schema import current_revision, require_head

    with open_database(settings_of_running(data)) as opened:
        engine = make_engine(opened.database_url or "")
        typer.echo(current_revision(engine) or "empty")
        try:
            require_head(engine)
        finally:
            engine.dispose()
