"""Whether the tests would notice: `python -m tools.mutants MODULE.py[,MODULE.py] TEST...` changes one thing at a time in a
module and runs the tests that should see it. `--only=N,N` tries the mutants of these numbers, `--sample=N --seed=S` N of them
drawn by a seed, `--within=NAME,NAME` those within these functions, where a name of a class stands for its methods.

Each mutant is one small fault: a comparison turned or its bound moved, `and` for `or`, a `not` left out, a condition that
always or never holds, an operator or a constant changed, a call, a `raise` or a `return` left out. The tests run in a copy of
the project; `tools/mutant_runs.py` says how. What survives is printed with its line: a test is missing, the code is more than
it need be, or the two mean the same.
"""

from __future__ import annotations

import ast
import copy
import os
import random
import shutil
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import ModuleType

from tools.mutant_runs import cold, database_server, load, put, warm

OURS = ("fecore", "modalbase", "service", "migrations", "benchmarks", "tests", "tools", "examples")
COPIED = (*OURS, "pyproject.toml", "alembic.ini", "docs", "README.md", "CHANGELOG.md", "CONTRIBUTING.md")
PATIENCE = 10.0  # times as long as the unchanged module may a mutant take; then it hangs, which is noticed too
FIRST = 3600.0  # seconds for the unchanged module

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


def mutants(module: str, source: str) -> Iterator[Mutant]:
    """Every mutant of a module, one change each."""
    tree = ast.parse(source)
    types = {id(part) for node in ast.walk(tree) for kind in _annotations(node) for part in ast.walk(kind)}
    functions = dict(_bodies(tree))
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
            line, what = getattr(node, "lineno", 0), f"{_short(before)}  →  {_short(after)}"
            yield Mutant(module, line, what, text, functions.get(id(node)))


def _bodies(tree: ast.AST, prefix: str = "") -> Iterator[tuple[int, str]]:
    """The nodes within the bodies of functions and methods, each with the qualified name of the outermost one."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.ClassDef):
            yield from _bodies(node, f"{prefix}{node.name}.")
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield from ((id(part), prefix + node.name) for line in node.body for part in ast.walk(line))
        elif not isinstance(node, ast.expr):
            yield from _bodies(node, prefix)


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


_HERE = Path(__file__).resolve().parents[1]


def copied(folder: Path) -> None:
    """A copy of the project, without what was compiled."""
    for name in COPIED:
        place = _HERE / name
        if place.is_dir():
            shutil.copytree(place, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(place, folder / name)


@dataclass(frozen=True)
class Mutant:
    """One small fault: where it is, what was changed into what, the module's whole text, and the function that it is in."""

    module: str
    line: int
    what: str
    text: str
    function: str | None

    def within(self, names: Collection[str]) -> bool:
        """Whether it is in one of these functions, or in a method of one of these classes; `<module>` is outside of all."""
        own = self.function or "<module>"
        return own in names or own.partition(".")[0] in names


class Trial:
    """The tests that should see the mutants of some modules, and how long they take."""

    def __init__(self, folder: Path, tests: Sequence[str], loaded: tuple[dict[str, ModuleType], set[str]]) -> None:
        """Run the tests on the modules as they are, with what is loaded and anew."""
        self._tests, self._folder = tests, folder
        self._loaded, self._called = loaded
        self._warm = self._patience(lambda: warm(tests, FIRST, lambda: True))
        self._cold = self._patience(lambda: cold(folder, tests, FIRST))

    def _patience(self, fails: Callable[[], bool | None]) -> float:
        """Seconds that a mutant may take where the unchanged modules take what they do."""
        began = time.monotonic()
        if fails():
            raise SystemExit("the tests fail on the modules as they are")
        return PATIENCE * max(1.0, time.monotonic() - began)

    def notices(self, mutant: Mutant) -> bool:
        """Whether the tests notice a mutant."""
        file, name = self._folder / mutant.module, mutant.function
        unchanged = file.read_text()
        file.write_text(mutant.text)
        try:
            noticed = None
            if name is not None and f"{mutant.module}:{name}" not in self._called:
                change = partial(put, self._loaded[mutant.module], name, mutant.text)
                noticed = warm(self._tests, self._warm, change)
            return cold(self._folder, self._tests, self._cold) if noticed is None else noticed
        finally:
            file.write_text(unchanged)


def try_all(trial: Trial, every: Sequence[Mutant], chosen: Callable[[int], Collection[int]]) -> None:
    """Try the chosen ones of these mutants; print those that survive, and the counts."""
    tried, survived = Counter[str](), Counter[str]()
    try:
        for number in sorted(chosen(len(every))):
            mutant = every[number]
            noticed = trial.notices(mutant)
            tried[mutant.module] += 1
            if not noticed:
                survived[mutant.module] += 1
                print(f"{number}  {mutant.module}:{mutant.line}  {mutant.what}", flush=True)
    finally:  # also where somebody has seen enough
        for module, count in Counter(mutant.module for mutant in every).items():
            _print_counts(module, count, tried[module], survived[module])


def _print_counts(module: str, count: int, tried: int, survived: int) -> None:
    print(f"{module}: {count} mutants, {tried} tried, {tried - survived} killed, {survived} survived", flush=True)


def choice(only: str, sample: str, seed: str) -> Callable[[int], Collection[int]]:
    """The numbers that are tried of so many: those named, a sample of this size, or all."""
    if only:
        return lambda count: {number for number in map(int, only.split(",")) if number < count}
    if sample:
        return lambda count: random.Random(int(seed or 0)).sample(range(count), min(int(sample), count))
    return range


def main(words: Sequence[str]) -> None:
    """The command: modules, tests, and options."""
    options = dict.fromkeys(("only", "sample", "seed", "within"), "")
    rest = []
    for word in words:
        name, _, value = word.removeprefix("--").partition("=")
        if word.startswith("--") and name in options:
            options[name] = value
        else:
            rest.append(word)
    modules, tests = rest[0].split(","), rest[1:]
    names = options.pop("within")
    sys.dont_write_bytecode = True  # two mutants of one second would share it
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="mutants-")))
        copied(folder)
        every = [mutant for module in modules for mutant in mutants(module, (folder / module).read_text())]
        with_database = not all(test.startswith(("tests/unit", "-")) for test in tests)
        loaded = load(folder, _HERE, modules, tests, http=with_database)
        if with_database:
            stack.enter_context(database_server(folder / "db"))
        asked = [mutant for mutant in every if not names or mutant.within(names.split(","))]
        try_all(Trial(folder, tests, loaded), asked, choice(**options))
        os.chdir(_HERE)


if __name__ == "__main__":
    main(sys.argv[1:])
