"""Count the house: rooms at the top of `service`, circles of imports, lines of files and functions,
arguments by place.

`python -m tools.house` prints the figures and ends with 1 where one is over its limit;
`make check` runs it.
"""

import ast
import re
import subprocess
import sys
from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from statistics import median

import grimp

PACKAGES = ("fecore", "modalbase", "service")
ROOMS = 10  # folders at the top of `service`
# Docstrings and comments are not counted. A function whose docstring numbers its steps may be long: it reads
# whole.
FILE_LINES, FUNCTION_LINES, STEPS_LINES = 400, 60, 150
MOST_BY_PLACE = 6  # arguments of a call; more go by name
WIDTHS = {".html": 120, ".js": 100, ".css": 100}
WIDE = 0.005  # share of lines that may be wider: addresses and strings that nothing breaks
_STEPS = re.compile(r"^\s*1\. .*^\s*2\. ", re.MULTILINE | re.DOTALL)


def code_lines(text: str, tree: ast.Module) -> list[int]:
    """Numbers of the lines that are neither empty, nor of a comment, nor of a docstring."""
    prose = {
        line
        for each in ast.walk(tree)
        if isinstance(each, ast.Expr)
        and isinstance(each.value, ast.Constant)
        and isinstance(each.value.value, str)
        for line in range(each.lineno, (each.end_lineno or 0) + 1)
    }
    lines = enumerate(text.split("\n"), 1)
    return [n for n, line in lines if n not in prose and line.strip()[:1] not in ("", "#")]


def functions(path: Path, tree: ast.Module, code: list[int]) -> Iterator[tuple[str, int, int]]:
    """Name, lines of code below the signature, and lines allowed, of each function of a module."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            lines = bisect_right(code, node.end_lineno or 0) - bisect_left(
                code, node.body[0].lineno
            )
            steps = _STEPS.search(ast.get_docstring(node, clean=False) or "")
            yield (
                f"{path}:{node.lineno} {node.name}",
                lines,
                STEPS_LINES if steps else FUNCTION_LINES,
            )


def by_place(path: Path, tree: ast.Module) -> Iterator[str]:
    """Calls with many arguments that have no names; a command line's words are a list, and stay
    one.
    """
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.Call)
            and len(node.args) > MOST_BY_PLACE
            and not any(isinstance(value, ast.Starred) for value in node.args)
            and not isinstance(node.args[0], ast.Constant)
        ):
            yield f"{path}:{node.lineno}: {ast.unparse(node.func)} with {len(node.args)} arguments by place"


def circle() -> list[str]:
    """Modules that import one another in a circle, imports for type checking aside."""
    graph = grimp.build_graph(*PACKAGES, exclude_type_checking_imports=True)
    needs = {each: graph.find_modules_directly_imported_by(each) for each in graph.modules}
    try:
        TopologicalSorter(needs).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def too_wide() -> Iterator[str]:
    """Kinds of files of which more lines than `WIDE` are over their width."""
    tracked = subprocess.run(
        ["git", "ls-files", *PACKAGES], capture_output=True, text=True, check=True
    ).stdout.splitlines()
    for suffix, width in WIDTHS.items():
        files = [Path(each) for each in tracked if each.endswith(suffix) and "/vendor/" not in each]
        lines = [line for path in files for line in path.read_text(encoding="utf-8").split("\n")]
        wide = sum(len(line) > width for line in lines)
        if wide > WIDE * len(lines):
            yield f"{suffix}: {wide} of {len(lines)} lines are over {width} characters"


def main() -> int:
    """Print the figures, and what is over its limit."""
    sources = [path for package in PACKAGES for path in sorted(Path(package).rglob("*.py"))]
    text = {path: path.read_text(encoding="utf-8") for path in sources}
    trees = {path: ast.parse(each) for path, each in text.items()}
    code = {path: code_lines(each, trees[path]) for path, each in text.items()}
    lines = {path: len(each) for path, each in code.items()}
    sizes = [row for path in sources for row in functions(path, trees[path], code[path])]
    rooms = [path for path in Path("service").iterdir() if (path / "__init__.py").exists()]
    faults = [
        f"{path}: {n} lines, at most {FILE_LINES}" for path, n in lines.items() if n > FILE_LINES
    ]
    faults += [f"{name}: {n} lines, at most {most}" for name, n, most in sizes if n > most]
    faults += [call for path, tree in trees.items() for call in by_place(path, tree)]
    faults += too_wide()
    if modules := circle():
        faults.append(f"modules import one another: {', '.join(modules)}")
    if len(rooms) > ROOMS:
        faults.append(f"service has {len(rooms)} rooms, at most {ROOMS}")
    print(
        f"{sum(lines.values())} lines of code in {len(lines)} files "
        f"(median {median(lines.values()):g}), {len(sizes)} functions "
        f"(median {median(n for _, n, _ in sizes):g}), {len(rooms)} rooms in service"
    )
    print("\n".join(faults))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
