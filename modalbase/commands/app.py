"""The commands that talk to a service, ready to be added to the application, and `modalbase login`.

This much is imported by every process that starts as `modalbase`, a job's child among them; httpx
and rich are imported by a command when it runs.
"""

from typing import Annotated

import typer

from modalbase import objects
from modalbase.commands.exporting import cards, export, figure, import_archive, report
from modalbase.commands.inventory import campaigns, coupons, model, projects, structures
from modalbase.commands.measuring import frfs, hits, import_files, modes, points
from modalbase.commands.options import say_next
from modalbase.commands.searching import search
from modalbase.commands.updating import alarms, jobs, monitors, result, update
from modalbase.commands.watching import watch


def login(
    url: Annotated[str, typer.Argument(help="Address of the service")] = "http://127.0.0.1:8000",
    key: Annotated[
        str,
        typer.Option(
            envvar="MODALBASE_API_KEY",
            prompt="API key",
            hide_input=True,
            help="API key; asked for by default",
        ),
    ] = "",
) -> None:
    """Keep address and key of a service for this user's commands and scripts, once it has accepted
    them.
    """
    from modalbase.client.endpoint import save_profile

    with objects.Laboratory.at(url, key) as lab:
        lab.check()
    typer.echo(f"saved in {save_profile(url, key)}, which only you can read")
    say_next("projects")


COMMANDS = (
    login, import_archive, projects, structures, model, campaigns, points, hits, frfs, modes, coupons,
    update, jobs, result, figure, report, export, cards, monitors, alarms, watch,
)  # fmt: skip


def add_commands(app: typer.Typer) -> None:
    """Add these commands to an application."""
    app.command("import")(import_files)
    app.command("find")(search)
    for command in COMMANDS:
        app.command()(command)
