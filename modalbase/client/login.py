"""`modalbase login`."""

from __future__ import annotations

from typing import Annotated

import typer

from modalbase.client.options import say_next


def login(
    url: Annotated[str, typer.Argument(help="Address of the service")] = "http://127.0.0.1:8000",
    key: Annotated[
        str,
        typer.Option(
            envvar="MODALBASE_API_KEY", prompt="API key", hide_input=True, help="API key; asked for by default"
        ),
    ] = "",
) -> None:
    """Keep address and key of a service for this user's commands and scripts, once it has accepted them."""
    from modalbase.client.connection import Connection
    from modalbase.client.place import save_profile

    with Connection(url, key) as service:
        service.get("projects", limit=1)
    typer.echo(f"saved in {save_profile(url, key)}, which only you can read")
    say_next("projects")
