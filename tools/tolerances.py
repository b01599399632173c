"""The numbers that the core decides by: every constant of `fecore` with its value and its meaning, from the code."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby, takewhile
from pathlib import Path

from fecore import __file__ as core

_NAME = re.compile(r"_?[A-Z][A-Z0-9_]*$")
_COMMENT = re.compile(r"#\s*(.*)$")

_INTRODUCTION = """# Tolerances

The constants by which `fecore` decides, room by room. A constant stands beside the code that uses it, with its reason; this
page is made from there by `python -m tools.reference`. One meaning has one constant: who needs another file's value imports
it.
"""


@dataclass(frozen=True)
class Constant:
    """A number, or several, with a name in a module of the core.

    Attributes:
        room: package or module of `fecore` that it belongs to.
        module: the module's dotted path below `fecore`.
        name: as in the code.
        value: as written there.
        meaning: the comment or docstring beside it; empty where there is none.
    """

    room: str
    module: str
    name: str
    value: str
    meaning: str


def constants() -> list[Constant]:
    """Every constant of the core that is made of numbers, by module and line."""
    folder = Path(core).parent
    return [one for path in sorted(folder.rglob("*.py")) for one in _of(path, path.relative_to(folder))]


def page() -> str:
    """Markdown: a table a room."""
    parts = [_INTRODUCTION]
    for room, found in groupby(sorted(constants(), key=lambda one: one.room), key=lambda one: one.room):
        rows = [f"| `{one.module}` | `{one.name}` | {one.value} | {one.meaning} |" for one in found]
        parts.append(
            "\n".join([f"## {room}\n", "| Module | Constant | Value | Meaning |", "|---|---|---|---|", *rows]) + "\n"
        )
    return "\n".join(parts)


def _of(path: Path, below: Path) -> Iterator[Constant]:
    text = path.read_text(encoding="utf-8")
    lines, body = text.splitlines(), ast.parse(text).body
    module = ".".join(below.with_suffix("").parts)
    for node, after in zip(body, [*body[1:], None], strict=True):
        name, value = _named(node)
        if name and value is not None and _NAME.match(name) and _numeric(value):
            meaning = _docstring(after) or _beside(lines, node)
            written = ast.unparse(value).replace("|", "\\|")
            yield Constant(below.parts[0].removesuffix(".py"), module, name, written, meaning)


def _named(node: ast.stmt) -> tuple[str, ast.expr | None]:
    if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
        return node.targets[0].id, node.value
    if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
        return node.target.id, node.value
    return "", None


def _numeric(value: ast.expr) -> bool:
    """Whether a value is a number, or made of numbers."""
    leaves = [one for one in ast.walk(value) if isinstance(one, ast.Constant)]
    return bool(leaves) and all(isinstance(one.value, int | float) for one in leaves) and not _calls(value)


def _calls(value: ast.expr) -> bool:
    return any(isinstance(one, ast.Call | ast.Subscript | ast.Attribute) for one in ast.walk(value))


def _docstring(node: ast.stmt | None) -> str:
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
        return " ".join(node.value.value.split())
    return ""


def _beside(lines: list[str], node: ast.stmt) -> str:
    """The comments on a statement's own lines, or those above it."""
    own = [found.group(1) for line in lines[node.lineno - 1 : node.end_lineno] if (found := _COMMENT.search(line))]
    above = takewhile(lambda line: line.startswith("#"), reversed(lines[: node.lineno - 1]))
    return " ".join(own or [line.lstrip("# ") for line in above][::-1])
