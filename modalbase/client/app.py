"""The client's commands, ready to be added to the application.

This much is imported by every process that starts as `modalbase`, a job's child among them; what talks HTTP and draws
bars is imported by a command when it runs.
"""

from __future__ import annotations

import typer

from modalbase.client.coupons import coupons
from modalbase.client.exporting import export
from modalbase.client.measuring import campaigns, frfs, import_files, structures
from modalbase.client.updating import result, update


def add_commands(app: typer.Typer) -> None:
    """Add the client's commands to an application."""
    app.command("import")(import_files)
    for command in (structures, campaigns, frfs, coupons, update, result, export):
        app.command()(command)
