"""Pages of the reference, made from code: every route, every command."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import typer

from service.app.cli.command import app
from tools.routes import Described, described, document

MADE = "<!-- made by python -m tools.reference -->"


def rest_page() -> str:
    """`docs/reference-rest.md`: every route with what it takes and answers."""
    openapi = document()
    lines = [
        "# REST, route by route", "", MADE, "",
        "Paths are below `/api/v1`. `/openapi.json` is the document with all fields, `/docs` the page to try them.",
        "Each route is a method of [`lab.rest`](library.md) by the name in the last column.", "",
    ]  # fmt: skip
    by_tag: dict[str, list[Described]] = {}
    for route in described(openapi):
        by_tag.setdefault(next(iter(route.operation.get("tags", ["other"]))), []).append(route)
    for tag, found in by_tag.items():
        lines += [f"## {tag.capitalize()}", "", "| call | does | query | body | method |", "|---|---|---|---|---|"]
        lines += [_route(route) for route in found] + [""]
    return "\n".join(lines)


def _route(route: Described) -> str:
    query = ", ".join(f"`{name}`" for name in route.query if name not in ("cursor", "limit"))
    body = ", ".join(f"`{kind}`" for kind in route.operation.get("requestBody", {}).get("content", {}))
    summary = route.summary.replace("|", "\\|")
    return f"| `{route.method} /{route.path}` | {summary} | {query} | {body} | `{route.name}` |"


def cli_page() -> str:
    """`docs/reference-cli.md`: every command with its arguments and options."""
    command: Any = typer.main.get_command(app)
    lines = [
        "# The command, word by word",
        "",
        MADE,
        "",
        "[How to use it](command-line.md). `modalbase --install-completion` completes.",
        "",
    ]
    for words, one in _commands(command, "modalbase"):
        lines += [f"## {words}", "", _plain(one.help or ""), ""]
        given = [parameter for parameter in one.params if not getattr(parameter, "hidden", False)]
        given = [parameter for parameter in given if parameter.name != "help"]
        if given:
            lines += ["| | does |", "|---|---|", *map(_parameter, given), ""]
    return "\n".join(lines)


def _commands(command: Any, words: str) -> Iterator[tuple[str, Any]]:
    for name, one in command.commands.items():
        if hasattr(one, "commands"):
            yield from _commands(one, f"{words} {name}")
        else:
            yield f"{words} {name}", one


def _parameter(parameter: Any) -> str:
    names = parameter.opts + parameter.secondary_opts
    shown = (
        ", ".join(f"`{name}`" for name in names)
        if names[0].startswith("-")
        else f"`{parameter.name.strip('_').upper()}`"
    )
    return f"| {shown} | {_plain(getattr(parameter, 'help', None) or '').replace('|', chr(92) + '|')} |"


def _plain(text: str) -> str:
    return re.sub(r"\s+", " ", text).strip()
