"""Pages of the reference, made from code: every route, every command."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from typing import Any

import typer

from service.app.cli.command import app
from tools.routes import Described, described, document

MADE = "<!-- made by python -m tools.reference -->"
OFTEN = 10  # commands with the same option, from which on it stands once at the top


def rest_page() -> str:
    """`docs/reference-rest.md`: every route with what it takes and answers."""
    openapi = document()
    lines = [
        "# REST, route by route", "", MADE, "",
        "Paths are below `/api/v1`. `/openapi.json` is the document with all fields, `/docs` the page to try them.",
        "Each route is a method of [`lab.rest`](library.md) by the name in brackets.",
        "Bodies are JSON; other media types are named.", "",
    ]  # fmt: skip
    by_tag: dict[str, list[Described]] = {}
    for route in described(openapi):
        by_tag.setdefault(next(iter(route.operation.get("tags", ["other"]))), []).append(route)
    for tag, found in by_tag.items():
        lines += [f"## {tag.capitalize()}", "", *map(_route, found), ""]
    return "\n".join(lines)


def _route(route: Described) -> str:
    query = "&".join(f"{name}=" for name in route.query if name not in ("cursor", "limit"))
    kinds = [kind for kind in route.operation.get("requestBody", {}).get("content", {}) if kind != "application/json"]
    summary = route.summary + "".join(f" `{kind}`" for kind in kinds)
    call = f"{route.method} /{route.path}" + (f"?{query}" if query else "")
    return f"- `{call}` (`{route.name}`): {summary}"


def cli_page() -> str:
    """`docs/reference-cli.md`: every command with its arguments and options; what many have stands once."""
    commands = list(_commands(typer.main.get_command(app), "modalbase"))
    rows = {words: [_parameter(parameter) for parameter in _shown(one)] for words, one in commands}
    count = Counter(row for found in rows.values() for row in found)
    common = [row for row, times in count.items() if times >= OFTEN]
    head = "[How to use it](command-line.md). Many commands have these options:"
    lines = ["# The command, word by word", "", MADE, "", head, "", *common, ""]
    for words, one in commands:
        own = [row for row in rows[words] if row not in common]
        lines += [f"## {words}", "", _plain(one.help or ""), "", *own, *([""] if own else [])]
    return "\n".join(lines)


def _shown(command: Any) -> list[Any]:
    return [one for one in command.params if not getattr(one, "hidden", False) and one.name != "help"]


def _commands(command: Any, words: str) -> Iterator[tuple[str, Any]]:
    for name, one in command.commands.items():
        if hasattr(one, "commands"):
            yield from _commands(one, f"{words} {name}")
        else:
            yield f"{words} {name}", one


def _parameter(parameter: Any) -> str:
    names = parameter.opts + parameter.secondary_opts
    shown = names if names[0].startswith("-") else [parameter.name.strip("_").upper()]
    return f"- {', '.join(f'`{name}`' for name in shown)}: {_plain(getattr(parameter, 'help', None) or '')}"


def _plain(text: str) -> str:
    return re.sub(r"\s+", " ", text).strip()
