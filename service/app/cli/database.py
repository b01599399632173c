"""Commands on the schema of a service's database."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import typer

from service.app.cli.options import Data, settings_of_running

if TYPE_CHECKING:
    from pathlib import Path

    from sqlalchemy import Engine

db = typer.Typer(help="The database's schema.", no_args_is_help=True)


@db.command("upgrade")
def db_upgrade(data: Data = None) -> None:
    """Bring the database's schema to this version's."""
    from service.db.schema import current_revision, upgrade

    with _engine(data) as engine:
        upgrade(engine)
        typer.echo(f"the schema is at {current_revision(engine)}")


@db.command("current")
def db_current(data: Data = None) -> None:
    """Print the revision that the database is at; exit 1 where it is not this version's."""
    from service.db.schema import current_revision, require_head

    with _engine(data) as engine:
        typer.echo(current_revision(engine) or "empty")
        require_head(engine)


@contextmanager
def _engine(data: Path | None) -> Iterator[Engine]:
    """On the database that the settings mean, or that of the service which runs."""
    from service.db.engine import make_engine
    from service.db.opening import open_database

    with open_database(settings_of_running(data)) as opened:
        engine = make_engine(opened.database_url or "")
        try:
            yield engine
        finally:
            engine.dispose()
