"""An algorithm that numbers its steps does them in that order."""

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

STEP = re.compile(r"^(\d+)\. ")
WHOLE = ("identify", "fit_elastic", "update_from_several_starts", "fit_damping", "update")


def algorithms() -> Iterator[tuple[str, ast.FunctionDef, str]]:
    """Name, function and module's text of every function of the core whose docstring has steps."""
    for path in sorted(Path("fecore").rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        if not re.search(r"^ *2\. ", text, re.MULTILINE):
            continue
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef) and len(stated(node)) > 1:
                yield node.name, node, text


def stated(function: ast.FunctionDef) -> list[int]:
    """Numbers of the steps of a docstring."""
    lines = (ast.get_docstring(function) or "").split("\n")
    return [int(step[1]) for line in lines if (step := STEP.match(line))]


def done(function: ast.FunctionDef, text: str) -> list[tuple[int, int]]:
    """Numbers of the steps of a body, by the comments that begin them, and the lines of these."""
    inside = range(function.lineno, (function.end_lineno or 0) + 1)
    return [
        (int(step[1]), token.start[0])
        for token in tokenize.generate_tokens(io.StringIO(text).readline)
        if token.type == tokenize.COMMENT
        and token.start[0] in inside
        and (step := STEP.match(token.string.removeprefix("# ")))
    ]


ALGORITHMS = list(algorithms())


def test_the_algorithms_of_the_core_state_their_steps() -> None:
    assert {name for name, *_ in ALGORITHMS} >= set(WHOLE)


@pytest.mark.parametrize(
    ("function", "text"), [each[1:] for each in ALGORITHMS], ids=[name for name, *_ in ALGORITHMS]
)
def test_a_body_follows_the_steps_of_its_docstring(function: ast.FunctionDef, text: str) -> None:
    steps = stated(function)
    begun = done(function, text)
    assert steps == list(range(1, len(steps) + 1))
    assert [number for number, _ in begun] == steps
    ends = [line for _, line in begun] + [(function.end_lineno or 0) + 1]
    lines = {node.lineno for node in ast.walk(function) if isinstance(node, ast.stmt)}
    for (number, _), (first, last) in zip(begun, pairwise(ends), strict=True):
        assert lines & set(range(first, last)), f"step {number} of {function.name} does nothing"
