"""Commands that take care of what a service stores: back up, restore, verify, bring the schema to
this version, and say what is wrong.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from modalbase.client.display import transfer
from service.app.cli.ending import stop_with
from service.app.cli.options import Data, settings_of_running

if TYPE_CHECKING:
    from service.platform.settings import Settings

commands = typer.Typer()
db = typer.Typer(help="The database's schema.", no_args_is_help=True)


@commands.command()
def backup(
    file: Annotated[Path, typer.Argument(help="File to write; it must not exist")],
    data: Data = None,
) -> None:
    """Write everything that is stored to one file, as it is at this moment. The service may run
    meanwhile.
    """
    from service.app.backup.archive import write_backup
    from service.platform.db.opening import opened_engine

    with opened_engine(_existing(data), migrate_new=False) as engine, transfer(file.name) as watch:
        manifest = write_backup(engine, file, watch)
    rows = sum(table.rows for table in manifest.tables)
    typer.echo(
        f"{file}: {rows} rows of {len(manifest.tables)} tables, schema {manifest.revision}; read"
        " back whole"
    )
    if manifest.damaged:
        stop_with(
            "the backup is written, and so is this damage of the database:"
            f" {'; '.join(manifest.damaged)}"
        )


@commands.command()
def restore(
    file: Annotated[Path, typer.Argument(help="What `modalbase backup` wrote")], data: Data = None
) -> None:
    """Fill an empty database from a backup, also an earlier version's. What fails leaves
    nothing.
    """
    from service.app.backup.restoring import restore_backup
    from service.platform.db.opening import opened_engine

    with (
        opened_engine(settings_of_running(data), migrate_new=False) as engine,
        transfer(file.name) as watch,
    ):
        manifest = restore_backup(engine, file, watch)
    rows = sum(table.rows for table in manifest.tables)
    typer.echo(
        f"restored {rows} rows of {manifest.created_at}; every spectrum, curve and file has its"
        " SHA-256"
    )
    if manifest.damaged:
        stop_with(
            f"but for this damage, which the backup already had: {'; '.join(manifest.damaged)}"
        )


@commands.command()
def verify(data: Data = None) -> None:
    """Compare every stored spectrum, curve and original file with its SHA-256; exit 1 where one is
    damaged.
    """
    from service.app.backup.verification import deleted_by_rules, find_damage
    from service.platform.db.opening import opened_engine
    from service.platform.db.schema import require_known

    with (
        opened_engine(_existing(data), migrate_new=False) as engine,
        engine.connect() as connection,
    ):
        require_known(connection)
        damaged, deleted = find_damage(connection), deleted_by_rules(connection)
    if deleted:
        typer.echo(deleted)
    if damaged:
        stop_with("\n  ".join([f"{len(damaged)} damaged; restore them from a backup:", *damaged]))
    typer.echo("every spectrum, curve and file has its SHA-256")


@commands.command()
def doctor(
    data: Data = None,
    quick: Annotated[bool, typer.Option("--quick", help="Do not read everything stored")] = False,
) -> None:
    """Say what is wrong with the service: folder, disk, database, schema, workers, jobs, stored
    data.
    """
    from service.app.doctor import examine

    faults = 0
    for finding in examine(settings_of_running(data), stored=not quick):
        typer.echo(f"{finding.level:8} {finding.subject}: {finding.words}")
        faults += finding.level == "fault"
    if faults:
        raise typer.Exit(1)


def _existing(data: Path | None) -> Settings:
    """Settings of a database that is there: nothing is made just to find it empty."""
    settings: Settings = settings_of_running(data)
    if settings.database_url is None and not settings.data.expanduser().is_dir():
        stop_with(
            f"there is no data folder {settings.data}; name the service's with --data or"
            " MODALBASE_DATA"
        )
    return settings


@db.command("upgrade")
def db_upgrade(data: Data = None) -> None:
    """Bring the database's schema to this version's."""
    from service.platform.db.opening import opened_engine
    from service.platform.db.schema import current_revision, upgrade

    with opened_engine(settings_of_running(data)) as engine:
        upgrade(engine)
        typer.echo(f"the schema is at {current_revision(engine)}")


@db.command("current")
def db_current(data: Data = None) -> None:
    """Print the revision that the database is at; exit 1 where it is not this version's."""
    from service.platform.db.opening import opened_engine
    from service.platform.db.schema import current_revision, require_head

    with opened_engine(settings_of_running(data)) as engine:
        typer.echo(current_revision(engine) or "empty")
        require_head(engine)
