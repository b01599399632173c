"""A reader of a call sees what each value is: beyond six arguments, they go by name."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.places import ROOT

MOST_BY_PLACE = 6


def long_calls(path: Path) -> Iterator[str]:
    """Calls of classes and functions of ours; a command line's words are a list, and stay one."""
    for node in ast.walk(ast.parse(path.read_text())):
        if not isinstance(node, ast.Call) or len(node.args) <= MOST_BY_PLACE or isinstance(node.args[0], ast.Constant):
            continue
        if not any(isinstance(value, ast.Starred) for value in node.args):
            yield f"{path.relative_to(ROOT)}:{node.lineno}: {ast.unparse(node.func)} with {len(node.args)} arguments by place"


@pytest.mark.parametrize("package", ["fecore", "modalbase", "service"])
def test_many_arguments_go_by_name(package: str) -> None:
    found = [call for path in sorted((ROOT / package).rglob("*.py")) for call in long_calls(path)]
    assert not found, "\n".join(found)
