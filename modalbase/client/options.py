"""What the commands have in common: the service's address, JSON out, ids and JSON files in."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any
from uuid import UUID

import typer

from modalbase.client.errors import ClientError, Exit

HERE = "http://127.0.0.1:8000"

Url = Annotated[str, typer.Option("--url", envvar="MODALBASE_URL", help="Address of the service")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON alone on standard output")]
Campaign = Annotated[str, typer.Argument(help="Id of the campaign")]


def json_file(path: Path) -> dict[str, Any]:
    """The JSON object in a file, with or without a byte order mark.

    Raises:
        ClientError: the file cannot be read, is not JSON, or holds something other than an object.
    """
    try:
        value = json.loads(path.read_text(encoding="utf-8-sig"))
    except (ValueError, OSError) as error:
        raise ClientError(f"{path} is not JSON: {error}", Exit.USAGE) from None
    if not isinstance(value, dict):
        raise ClientError(f"{path} holds no JSON object", Exit.USAGE)
    return value


def an_id(text: str) -> str:
    """An id in the form that a path takes.

    Raises:
        ClientError: the text is no UUID. It is refused here because `../projects` in its place would be another path.
    """
    try:
        return str(UUID(text))
    except ValueError:
        raise ClientError(
            f"{text!r} is no id, expected one such as 0198c6a2-…; the lists print them", Exit.USAGE
        ) from None
