"""Make what is made from code: the client's tables of routes and units, and the pages of the reference. A test
compares them.
"""

import json
import re
from collections import Counter
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import typer
from fastapi import FastAPI

from fecore.quantities import SHOWN
from modalbase.commands.options import NAMED
from service.app.composition import ROUTERS
from service.nouns.campaigns.climate import CLIMATE
from service.platform.web.openapi import describe_problems
from service.platform.web.routing import API, serve
from tools import findings, formats

METHODS = ("get", "post", "put", "patch", "delete")


class Described(NamedTuple):
    """A route of the OpenAPI document: the client's method, HTTP's, the path below the prefix, the
    query's parameters, what it does by the first paragraph on one line, and its tag.
    """

    name: str
    method: str
    path: str
    query: tuple[str, ...]
    summary: str
    tag: str


@cache
def document() -> dict[str, Any]:
    """The OpenAPI document of everything under the prefix; no database is needed for it."""
    api = FastAPI()
    for router in ROUTERS:
        serve(api, router)
    describe_problems(api)
    return api.openapi()


def described(openapi: dict[str, Any]) -> list[Described]:
    """The routes of a document, named after their functions."""
    found = [
        (path, m, each[m]) for path, each in openapi["paths"].items() for m in METHODS if m in each
    ]
    routes = []
    for whole, method, operation in found:
        path = whole.removeprefix(API).lstrip("/")
        query = tuple(
            one["name"] for one in operation.get("parameters", ()) if one["in"] == "query"
        )
        text = operation.get("description") or operation["summary"]
        summary, tag = (
            " ".join(text.split("\n\n")[0].split()),
            next(iter(operation.get("tags", ["other"]))),
        )
        name = operation["operationId"]
        routes.append(Described(name, method.upper(), path, query, summary, tag))
    return routes


def units() -> str:
    """The text of `modalbase/client/units.json`: factor and unit in which the library shows values
    of an SI unit.
    """
    rows = {unit: shown for unit, shown in SHOWN.items() if unit != "1"}
    return json.dumps(rows, ensure_ascii=False, indent=1) + "\n"


def table() -> str:
    """The text of `modalbase/client/routes.json`: a line for each call, for diffs that can be
    read.
    """
    rows = (
        {route.name: [route.method, route.path, route.query, route.summary]}
        for route in described(document())
    )
    return "{\n" + ",\n".join(json.dumps(row, ensure_ascii=False)[1:-1] for row in rows) + "\n}\n"


def fields() -> str:
    """The text of `modalbase/client/fields.json`: what a campaign may state of its climate."""
    rows = {
        name: {"label": one.label, "unit": one.unit, "meaning": one.meaning}
        for name, one in CLIMATE.items()
    }
    return json.dumps({"climate": rows}, ensure_ascii=False, indent=1) + "\n"


MARK = "<!-- made by python -m tools.reference -->"
PLAIN = re.compile("(create|list|search|get|change|delete|restore|purge|cancel|watch)_")
"""Names of routes that the page explains once."""
OFTEN, NEARLY_ALL = 2, 15
"""Commands with the same option, from which on it is explained once at the top, and from which on
it is named there only.
"""


def rest_page() -> str:
    """`docs/reference-rest.md`: every route with what it takes and answers."""
    lines = [
        "# REST, route by route", "", MARK, "",
        "Paths are below `/api/v1`. `/openapi.json` has all parameters and fields, `/docs` is the page to try them.",
        "Each route is a method of [`lab.rest`](library.md) by the name before it, which mostly says what it does:",
        "`list_…` and [`search_…`](search.md) answer pages; `delete_…` hides what has a `restore_…`, and removes the rest;",
        "`purge_…` removes for good; `cancel_…` asks for a job's end; `watch_…` streams its state as server-sent events.", "",
    ]  # fmt: skip
    by_tag: dict[str, list[Described]] = {}
    for route in described(document()):
        by_tag.setdefault(route.tag, []).append(route)
    for tag, found in by_tag.items():
        lines += [f"## {tag.capitalize()}", "", *map(_route, found), ""]
    return "\n".join(lines)


def _route(route: Described) -> str:
    call = f"- `{route.name}` `{route.method} /{route.path}`"
    return call if PLAIN.match(route.name) else f"{call}: {_brief(route.summary)}"


def _brief(text: str) -> str:
    """The first clause: what the OpenAPI document and `--help` say after it is not said again."""
    return re.match(r"(`[^`]*`|[.;:](?! |$)|[^`.;:])*", text)[0]  # type: ignore[index]  # matches nothing, too


def cli_page() -> str:
    """`docs/reference-cli.md`: every command with its arguments and options; what several have is
    explained once.
    """
    from service.app.cli.command import app  # its options are of the fields that are made first

    commands = list(_commands(typer.main.get_command(app), "modalbase"))
    rows = {
        words: [_parameter(each) for each in one.params if _shown(each)] for words, one in commands
    }
    count = Counter(row for found in rows.values() for row in found)
    common = [row for row, times in count.items() if times >= OFTEN]
    everywhere = [row for row, times in count.items() if times >= NEARLY_ALL]
    how = (
        f"[How to use it](command-line.md); `--help` has more. Things are named by {NAMED}. Nearly"
        " all commands have"
    )
    lines = ["# The command, word by word", "", MARK, "", how, "", *everywhere, ""]
    lines += [
        "Others name these behind what they do:",
        "",
        *(row for row in common if row not in everywhere),
        "",
    ]
    for words, one in commands:
        own = [row for row in rows[words] if row not in common]
        others = " ".join(
            row.split(":")[0][2:] for row in rows[words] if row in common and row not in everywhere
        )
        said = f"{_plain(one.help or '')} {others}".strip()
        lines += [
            f"## {words.removeprefix('modalbase ')}",
            "",
            said,
            "",
            *own,
            *([""] if own else []),
        ]
    return "\n".join(lines)


def _commands(command: Any, words: str) -> Iterator[tuple[str, Any]]:
    for name, one in command.commands.items():
        if hasattr(one, "commands"):
            yield from _commands(one, f"{words} {name}")
        else:
            yield f"{words} {name}", one


def _shown(parameter: Any) -> bool:
    return not getattr(parameter, "hidden", False) and parameter.name != "help"


def _parameter(parameter: Any) -> str:
    names = parameter.opts + parameter.secondary_opts
    shown = names if names[0].startswith("-") else [parameter.name.strip("_").upper()]
    means = _plain(getattr(parameter, "help", None) or "").split("; ")[0].replace(f": {NAMED}", "")
    return f"- {', '.join(f'`{name}`' for name in shown)}{means and ': '}{means}"


def _plain(text: str) -> str:
    return re.sub(r"\s+", " ", text).strip()


ROOT = Path(__file__).resolve().parent.parent
MADE: dict[str, Callable[[], str]] = {
    "modalbase/client/fields.json": fields,
    "modalbase/client/routes.json": table,
    "modalbase/client/units.json": units,
    "docs/reference-rest.md": rest_page,
    "docs/reference-cli.md": cli_page,
    formats.PAGE: formats.page,
    findings.PAGE: findings.page,
}


if __name__ == "__main__":
    for made, make in MADE.items():
        (ROOT / made).write_text(make(), encoding="utf-8")
