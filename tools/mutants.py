"""Whether the tests would notice: `python -m tools.mutants MODULE.py TEST... [--only N,N]` changes one thing at a time in a
module and runs the tests that should see it.

Each mutant is one small fault: a comparison turned or its bound moved, `and` for `or`, a `not` left out, a condition that
always or never holds, an operator or a constant changed, a call, a `raise` or a `return` left out. The tests run in a copy of
the project, one process a mutant. What survives is printed with its line: a test is missing, the code is more than it need
be, or the two mean the same.
"""

from __future__ import annotations

import ast
import copy
import importlib
import os
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

OURS = ("fecore", "modalbase", "service", "migrations", "benchmarks", "tests", "tools", "examples")
COPIED = (*OURS, "pyproject.toml", "alembic.ini", "docs", "README.md", "CHANGELOG.md", "CONTRIBUTING.md")
QUIET = ("-W", "ignore::pytest.PytestAssertRewriteWarning")  # what was imported beforehand is not ours
PATIENCE = 10.0  # times as long as the unchanged module may a mutant take; then it hangs, which is noticed too

_COMPARISONS = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}
_OPERATORS = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Pow: ast.Mult,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
}


def mutants(source: str) -> Iterator[tuple[int, str, str]]:
    """Every mutant of a module: its line, what was changed into what, and its whole text."""
    tree = ast.parse(source)
    types = {id(part) for node in ast.walk(tree) for kind in _annotations(node) for part in ast.walk(kind)}
    for number, node in enumerate(ast.walk(tree)):
        for changed in _changes(node) if id(node) not in types else ():
            other = copy.deepcopy(tree)
            target = list(ast.walk(other))[number]
            before = ast.unparse(node)
            if isinstance(node, ast.stmt):
                target.__class__, target.__dict__ = changed.__class__, {**target.__dict__, **changed.__dict__}
            else:
                other = _Replace(target, changed).visit(other)
            after = ast.unparse(changed)
            text = ast.unparse(ast.fix_missing_locations(other))
            yield getattr(node, "lineno", 0), f"{_short(before)}  →  {_short(after)}", text


def _changes(node: ast.AST) -> Iterator[ast.AST]:
    match node:
        case ast.Compare(left=left, ops=[operator, *rest], comparators=others):
            for turned in _COMPARISONS[type(operator)]:
                yield ast.Compare(left, [turned(), *rest], others)
        case ast.BoolOp(op=ast.And(), values=values):
            yield ast.BoolOp(ast.Or(), values)
        case ast.BoolOp(op=ast.Or(), values=values):
            yield ast.BoolOp(ast.And(), values)
        case ast.UnaryOp(op=ast.Not() | ast.USub(), operand=operand):
            yield operand
        case ast.BinOp(left=left, op=operator, right=right) if type(operator) in _OPERATORS:
            yield ast.BinOp(left, _OPERATORS[type(operator)](), right)
        case ast.Constant(value=bool() as value):
            yield ast.Constant(not value)
        case ast.Constant(value=int() | float() as value):
            yield ast.Constant(value + 1)
        case ast.IfExp(test=_, body=body, orelse=orelse):
            yield body
            yield orelse
        case ast.If(test=_, body=body, orelse=orelse):
            yield ast.If(ast.Constant(value=False), body, orelse)
            yield ast.If(ast.Constant(value=True), body, orelse)
        case ast.Expr(value=ast.Call()) | ast.Raise() | ast.Continue() | ast.Break() | ast.AugAssign():
            yield ast.Pass()
        case ast.Return(value=value) if value is not None and not _is_none(value):
            yield ast.Return(ast.Constant(value=None))


def _annotations(node: ast.AST) -> Iterator[ast.AST]:
    """Types that a node states: nothing of them happens."""
    match node:
        case ast.arg(annotation=kind) | ast.AnnAssign(annotation=kind) | ast.FunctionDef(returns=kind) if kind:
            yield kind


def _is_none(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and node.value is None


class _Replace(ast.NodeTransformer):
    def __init__(self, target: ast.AST, by: ast.AST) -> None:
        self._target, self._by = target, by

    def visit(self, node: ast.AST) -> ast.AST:
        """The tree with one node replaced."""
        return self._by if node is self._target else super().visit(node)


def _short(text: str) -> str:
    return " ".join(text.split())[:90]


def preload() -> None:
    """Import what the tests need of other people, once for all mutants, and forget what is ours."""
    import pytest  # noqa: F401

    importlib.import_module("tests.conftest")
    for name in [name for name in sys.modules if name.split(".")[0] in OURS]:
        del sys.modules[name]


def killed(folder: Path, tests: Sequence[str], seconds: float) -> bool:
    """Whether the tests fail, or do not end, in this copy of the project."""
    child = os.fork()
    if child == 0:
        os.setsid()
        _run(folder, tests)
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            return status != 0
        time.sleep(0.02)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return True


def _run(folder: Path, tests: Sequence[str]) -> None:
    import pytest

    os.chdir(folder)
    os.environ["PYTHONPATH"] = str(folder)  # for the processes that the tests start
    sys.path[:] = [str(folder), *(place for place in sys.path if Path(place or ".").resolve() != _HERE)]
    with Path(os.devnull).open("w") as silent:
        os.dup2(silent.fileno(), 1)
        os.dup2(silent.fileno(), 2)
        os._exit(int(pytest.main(["-x", "-q", "-p", "no:cacheprovider", "--no-header", *QUIET, *tests])))


_HERE = Path(__file__).resolve().parents[1]


def copied(folder: Path) -> None:
    """A copy of the project, without what was compiled."""
    for name in COPIED:
        place = _HERE / name
        if place.is_dir():
            shutil.copytree(place, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(place, folder / name)


def try_all(folder: Path, module: str, tests: Sequence[str], only: Sequence[int] = ()) -> None:
    """Try every mutant of a module, or some by number; print those that survive, and the counts."""
    source, began = (folder / module).read_text(), time.monotonic()
    if killed(folder, tests, 3600):
        raise SystemExit("the tests fail on the module as it is")
    seconds = PATIENCE * (time.monotonic() - began) + 10
    survived = tried = 0
    for number, (line, what, text) in enumerate(mutants(source)):
        if only and number not in only:
            continue
        (folder / module).write_text(text)
        tried += 1
        if not killed(folder, tests, seconds):
            survived += 1
            print(f"{number}  {module}:{line}  {what}", flush=True)
    (folder / module).write_text(source)
    print(f"{module}: {tried} mutants, {tried - survived} killed, {survived} survived", flush=True)


def main(words: Sequence[str]) -> None:
    """The command: a module, tests, and `--only=NUMBERS`."""
    chosen = [word.partition("=")[2] for word in words if word.startswith("--only=")]
    module, *tests = [word for word in words if not word.startswith("--only=")]
    preload()
    sys.dont_write_bytecode = True  # two mutants of one second would share it
    with tempfile.TemporaryDirectory(prefix="mutants-") as place:
        copied(Path(place))
        try_all(Path(place), module, tests, [int(n) for numbers in chosen for n in numbers.split(",")])


if __name__ == "__main__":
    main(sys.argv[1:])
