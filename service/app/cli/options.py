"""What several commands take, and the settings that follow from it."""

from pathlib import Path
from typing import Annotated, Any

import typer

from service.app.cli.ending import stop_with

Data = Annotated[Path | None, typer.Option(help="Folder of the embedded database [MODALBASE_DATA]")]
Host = Annotated[str | None, typer.Option(help="Address to listen on [MODALBASE_HOST]")]
Port = Annotated[
    int | None, typer.Option(help="Port to listen on; 0: any free one [MODALBASE_PORT]")
]


def settings_of(**given: Any) -> Any:
    """Settings of the environment, with what the command line says instead."""
    from pydantic import ValidationError

    from service.platform.settings import Settings, SettingsFileError

    try:
        return Settings(**{name: value for name, value in given.items() if value is not None})
    except ValidationError as error:
        faults = "; ".join(
            f"{'.'.join(map(str, fault['loc']))}: {fault['msg']}" for fault in error.errors()
        )
        stop_with(f"settings: {faults}")
    except SettingsFileError as error:
        stop_with(f"settings: {error}")


def settings_of_running(data: Path | None) -> Any:
    """Settings for a command that works on a service's database: where none is named, of the
    service that runs here.
    """
    from service.app.running import running_services

    settings = settings_of(data=data)
    if settings.database_url is not None or "data" in settings.model_fields_set:
        return settings
    running = running_services()
    if not running:
        return settings
    if len(running) > 1:
        stop_with(
            f"{len(running)} services run here; say which with --data:"
            f" {', '.join(str(one.data) for one in running)}"
        )
    if running[0].data is None:
        stop_with(
            f"the service at {running[0].url} has a database server of its own; set"
            " MODALBASE_DATABASE_URL as there"
        )
    return settings.model_copy(update={"data": Path(running[0].data)})
