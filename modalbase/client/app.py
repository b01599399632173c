"""The client's commands, ready to be added to the application.

This much is imported by every process that starts as `modalbase`, a job's child among them; what talks HTTP and draws
bars is imported by a command when it runs.
"""

from __future__ import annotations

import typer

from modalbase.client.coupons import coupons
from modalbase.client.exporting import cards, export
from modalbase.client.hits import hits
from modalbase.client.inventory import campaigns, projects, structures
from modalbase.client.login import login
from modalbase.client.measuring import frfs, import_files
from modalbase.client.modes import modes
from modalbase.client.points import points
from modalbase.client.reporting import report
from modalbase.client.updating import figure, result, update
from modalbase.client.watching import alarms, jobs, monitors

COMMANDS = (
    login, projects, structures, campaigns, points, hits, frfs, modes, coupons,
    update, jobs, result, figure, report, export, cards, monitors, alarms,
)  # fmt: skip


def add_commands(app: typer.Typer) -> None:
    """Add the client's commands to an application."""
    app.command("import")(import_files)
    for command in COMMANDS:
        app.command()(command)
