"""The command `modalbase`, put together; and how it ends."""

from __future__ import annotations

import errno
import os
import signal
import sys
from importlib.util import find_spec
from types import FrameType
from typing import Annotated, NoReturn

import typer

from modalbase.client.app import add_commands
from service.cli import care, database, people, running
from service.cli.options import stop_with

# What a command needs is imported when it runs: a child of the worker imports this module too, and must start fast.

app = typer.Typer(
    name="modalbase",
    help="Structural test campaigns, and finite element models updated to them.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)
app.add_typer(running.commands)
app.add_typer(care.commands)
app.add_typer(database.db, name="db")
app.add_typer(people.keys, name="keys")
app.add_typer(people.users, name="users")
add_commands(app)


def main() -> None:
    """Run the command; what goes wrong on purpose is one line on standard error."""
    signal.signal(signal.SIGTERM, _leave)
    try:
        app()
    except Exception as error:
        if (known := _known(error)) is None:
            raise
        stop_with(*known)


def _known(error: Exception) -> tuple[str, int] | None:
    """The line and the exit code of an error that is raised on purpose; None of any other."""
    from modalbase.client.errors import ClientError

    if isinstance(error, ClientError):
        return str(error), error.code
    if isinstance(error, OSError) and error.errno == errno.ENOSPC:
        _forget_output()
        return f"cannot write{f' {error.filename}' if error.filename else ''}: no space left", 2

    if find_spec("sqlalchemy") is None:  # modalbase alone, without its extra `server`
        lacks = isinstance(error, ModuleNotFoundError)
        return ("this command runs the service: pip install 'modalbase[server]'", 2) if lacks else None

    from sqlalchemy.exc import OperationalError

    from service.backup.archive import BackupError
    from service.db.engine import DatabaseUrlError
    from service.db.opening import DataFolderError
    from service.db.schema import SchemaError
    from service.errors import ServiceError
    from service.supervisor import StartError

    if isinstance(error, BackupError | DatabaseUrlError | DataFolderError | SchemaError | StartError | ServiceError):
        return str(error), 1
    if isinstance(error, OperationalError):
        return f"the database does not answer: {error.orig}", 1
    return None


def _forget_output() -> None:
    """Keep the interpreter from writing the rest when it ends: it would report the full disk a second time."""
    with open(os.devnull, "wb") as nothing:
        os.dup2(nothing.fileno(), sys.stdout.fileno())


def _leave(_signal: int, _frame: FrameType | None) -> NoReturn:
    """SIGTERM unwinds as an error does, so that everything opened is closed."""
    sys.exit(0)


def _version(wanted: bool) -> None:
    if wanted:
        from fecore import __version__

        typer.echo(f"modalbase {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    _: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version")] = False,
) -> None:
    """Structural test campaigns, and finite element models updated to them."""
