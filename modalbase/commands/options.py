"""What the commands have in common: the laboratory, JSON out, names and JSON files in."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from modalbase import objects
from modalbase.client.display import print_json, print_table
from modalbase.client.errors import ClientError, Exit
from modalbase.objects.finding import CAMPAIGN, LATEST, PROJECT, STRUCTURE, Kind

Url = Annotated[
    str | None,
    typer.Option(
        "--url",
        envvar="MODALBASE_URL",
        help="Address of the service; else that of the profile, or which runs here",
    ),
]
Reuse = Annotated[
    bool,
    typer.Option("--reuse", help="With --new: take the one of that name if there is one"),
]
Confirm = Annotated[bool, typer.Option("--confirm", help="Take unusual numbers as they are")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON alone on standard output")]


def laboratory_at(url: str | None) -> objects.Laboratory:
    """The laboratory of the service that is stated or found.

    Raises:
        ClientError: no service or no key is found.
    """
    from modalbase.client.endpoint import find_endpoint

    place = find_endpoint(url)
    return objects.Laboratory.at(place.url, place.key)


def names_of(noun: Kind) -> Callable[[str], list[str]]:
    """Completes names in a shell, where a service answers."""

    def complete(incomplete: str) -> list[str]:
        try:
            with laboratory_at(os.environ.get("MODALBASE_URL")) as lab:
                names = [LATEST, *lab.names(noun)]
        except ClientError:
            return []  # a shell that completes has no place for a message
        return [name for name in dict.fromkeys(names) if name.startswith(incomplete)]

    return complete


NAMED = "id, name, names from the project down with / between, or latest"
OfCampaign = Annotated[
    str,
    typer.Argument(
        help=f"Campaign: {NAMED}", show_default=False, autocompletion=names_of(CAMPAIGN)
    ),
]
ToCampaign = Annotated[
    str,
    typer.Option("--campaign", "-c", help=f"Campaign: {NAMED}", autocompletion=names_of(CAMPAIGN)),
]
OfProject = Annotated[
    str | None,
    typer.Option("--project", help="Project: id, name or latest", autocompletion=names_of(PROJECT)),
]
OfStructure = Annotated[
    str | None,
    typer.Option("--structure", help=f"Structure: {NAMED}", autocompletion=names_of(STRUCTURE)),
]
OfJob = Annotated[str, typer.Argument(help="Id of the update job, or latest")]


def show(
    content: Any,
    columns: Sequence[str] | Mapping[str, str],
    as_json: bool,
    rows: Sequence[Sequence[Any]] | None = None,
    title: str = "",
) -> None:
    """What a command found: its JSON, or a table of it.

    Args:
        content: things as REST describes them.
        columns: the members that are shown; of a mapping, by their headings.
        as_json: print all of it.
        rows: what the columns hold, where that is not members of the things.
        title: of the table.
    """
    if as_json:
        print_json(content)
        return
    members = columns.values() if isinstance(columns, Mapping) else columns
    print_table(
        title,
        list(columns),
        rows if rows is not None else [[one[name] for name in members] for one in content],
    )


def say_next(*commands: str) -> None:
    """What one may do next, on standard error, out of the way of scripts."""
    for command in commands:
        typer.echo(f"next: modalbase {command}", err=True)


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
