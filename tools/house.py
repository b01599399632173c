"""Count the house: rooms at the top of `service`, circles of imports, lines of files and functions.

`python -m tools.house` prints the figures and ends with 1 where one is over its limit; `make check`
runs it.
"""

import ast
import sys
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from statistics import median

import grimp

PACKAGES = ("fecore", "modalbase", "service")
ROOMS = 10  # folders at the top of `service`
FILE_LINES, FUNCTION_LINES, MEDIAN_FUNCTION = 400, 60, 8  # a function's docstring is not counted


def functions(path: Path) -> Iterator[tuple[str, int]]:
    """Name and lines, without the docstring, of each function of a module."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            documented = (ast.get_docstring(node, clean=False) or "").count("\n") + 1
            yield (
                f"{path}:{node.lineno} {node.name}",
                (node.end_lineno or 0) - node.lineno + 2 - documented,
            )


def circle() -> list[str]:
    """Modules that import one another in a circle, imports for type checking aside; the first that
    is found.
    """
    graph = grimp.build_graph(*PACKAGES, exclude_type_checking_imports=True)
    try:
        TopologicalSorter(
            {each: graph.find_modules_directly_imported_by(each) for each in graph.modules}
        ).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def main() -> int:
    """Print the figures, and what is over its limit."""
    sources = [path for package in PACKAGES for path in sorted(Path(package).rglob("*.py"))]
    lines = {path: path.read_text(encoding="utf-8").count("\n") for path in sources}
    sizes = dict(pair for path in lines for pair in functions(path))
    rooms = [path for path in Path("service").iterdir() if (path / "__init__.py").exists()]
    faults = [
        f"{path}: {n} lines, at most {FILE_LINES}" for path, n in lines.items() if n > FILE_LINES
    ]
    faults += [
        f"{name}: {n} lines, at most {FUNCTION_LINES}"
        for name, n in sizes.items()
        if n > FUNCTION_LINES
    ]
    if found := circle():
        faults.append(f"modules import one another: {', '.join(found)}")
    if len(rooms) > ROOMS:
        faults.append(f"service has {len(rooms)} rooms, at most {ROOMS}")
    if median(sizes.values()) > MEDIAN_FUNCTION:
        faults.append(
            f"the median function has {median(sizes.values())} lines, at most {MEDIAN_FUNCTION}"
        )
    print(
        f"{sum(lines.values())} lines in {len(lines)} files (median {median(lines.values()):g}), "
        f"{len(sizes)} functions (median {median(sizes.values()):g}), {len(rooms)} rooms in service"
    )
    print("\n".join(faults))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
