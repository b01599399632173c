"""The command `modalbase`, put together; and how it ends."""

import sys
from typing import Annotated

import typer

from modalbase.commands.app import add_commands
from service.app.cli import care, people, running
from service.app.cli.ending import ending

# What a command needs is imported when it runs: a child of the worker imports this module too, and
# must start fast.

app = typer.Typer(
    name="modalbase",
    help="Structural test campaigns, and finite element models updated to them.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)
app.add_typer(running.commands)
app.add_typer(care.commands)
app.add_typer(care.db, name="db")
app.add_typer(people.keys, name="keys")
app.add_typer(people.users, name="users")
add_commands(app)

STARTS = (["up"], ["serve"], ["worker"])
"""First words with which the command begins whose start is waited for: the others are not put
together then.
"""


def main() -> None:
    """Run the command; what goes wrong on purpose is one line on standard error."""
    with ending():
        (running.commands if sys.argv[1:2] in STARTS else app)()


def _version(requested: bool) -> None:
    if requested:
        from fecore import __version__

        typer.echo(f"modalbase {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    _: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version")
    ] = False,
) -> None:
    """Structural test campaigns, and finite element models updated to them."""
