"""Every benchmark is a case of one of three tables: accuracy, speed, soak.

    python -m benchmarks                        # what there is, with its arguments
    python -m benchmarks accuracy speed         # every case of these tables
    python -m benchmarks hits 36 880031         # one case, with other arguments than the table's
    python -m benchmarks quick accuracy         # every case of a table with few draws: does it run?

A case is a function of this package that prints a short table, and gives what was wrong, if
anything. Its arguments are counts, seeds and words; the first line of its docstring says what it
measures.
"""

import ast
import importlib
import shutil
import sys
import time
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple


class Case(NamedTuple):
    """A function by its module, its arguments in the table and in a quick run, and the program that
    it cannot do without.
    """

    name: str
    module: str
    arguments: str = ""
    quick: str = ""
    needs: str = ""


TABLES = {
    "accuracy": (
        Case("hits", "hits", quick="3"),
        Case("made_hits", "made_hits", quick="2"),
        Case("calibrate_hits", "calibrate_hits", quick="4"),
        Case("hits_habits", "hits", quick="1"),
        Case("hits_accuracy", "hits", quick="1 4"),
        Case("hits_damping", "hits", quick="2"),
        Case("hits_windows", "hits", quick="2"),
        Case("identification", "identification", quick="2"),
        Case("output_only", "output_only", quick="2"),
        Case("ambient", "ambient", quick="none 1"),
        Case("measured_loads", "measured_loads", quick="1"),
        Case("calibrate", "calibrate"),
        Case("real_bodies", "updates", "table", "table nothing"),
        Case("real_bodies", "updates", "drawn 60", "drawn 2"),
        Case("wooden_plates", "updates", quick="1"),
        Case("laboratories", "updates", quick="2"),
        Case("independent", "updates", quick="1", needs="ccx"),
        Case("structures", "structures"),
        Case("panel_decks", "structures_solids"),
        Case("structures_drawn", "structures_solids", needs="ccx"),
        Case("structures_solids", "structures_solids", needs="ccx"),
        Case("campaigns", "updates", "coverage 3 1", "coverage 1 1"),
        Case("campaigns", "updates", "solids 2 1", "solids 1 1", needs="ccx"),
        Case("contradictions", "contradictions", quick="1"),
        Case("zones", "zones", quick="1"),
        Case("planned", "plans", quick="1"),
        Case("campaigns", "updates", "plans 12 17", "plans 1 17"),
        Case("cards", "core", quick="1", needs="ccx"),
        Case("trend", "trend", quick="2"),
        Case("tracks", "tracks", quick="2"),
    ),
    "speed": (
        Case("forward", "core", quick="3"),
        Case("updating", "core", quick="400"),
        Case("mixed_deck", "mixed_deck", quick="20"),
        Case("measurements", "database", quick="100 801"),
        Case("backup", "database", quick="200 801"),
        Case("many_hits", "database", quick="200"),
        Case("recordings", "recordings", quick="1"),
        Case("live_hits", "database", quick="2"),
        Case("search", "search", quick="20"),
        Case("fleet", "fleet", quick="1 4"),
        Case("hourly", "fleet", quick="3 60"),
        Case("jobs", "jobs", quick="20 2 2"),
        Case("pages", "screen", quick="3 1 1"),
        Case("start", "screen", quick="1"),
        Case("ten_years", "ten_years", quick="200 2"),
    ),
    "soak": (
        Case("uff_damage", "soak", quick="100"),
        Case("soak_bombs", "soak", quick="1"),
        Case("soak_load", "soak", quick="10"),
        Case("soak_kills", "soak", quick="4"),
    ),
}


def run(case: Case, arguments: Sequence[str]) -> bool:
    """Run a case; whether it succeeded."""
    print(f"\n=== {case.name} {' '.join(arguments)}", flush=True)
    if case.needs and not shutil.which(case.needs):
        print(f"  ({case.needs} is not installed)")
        return True
    start = time.perf_counter()
    try:
        function = getattr(importlib.import_module(f"benchmarks.{case.module}"), case.name)
        wrong = function(*(int(word) if word.isdigit() else word for word in arguments)) or []
    except Exception:  # noqa: BLE001 - one case's failure must not hide the others' figures
        wrong = [traceback.format_exc()]
    end = f"=== {case.name}: {time.perf_counter() - start:.1f} s{', FAILED' if wrong else ''}"
    print(*wrong, end, sep="\n", flush=True)
    return not wrong


def described(case: Case) -> str:
    """A case with its arguments and what it measures, as its source has them: to import them all
    takes long.
    """
    tree = ast.parse(Path(__file__).with_name(f"{case.module}.py").read_text(encoding="utf-8"))
    (function,) = (
        node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == case.name
    )
    for argument in ast.walk(function.args):
        argument.annotation = None  # type: ignore[attr-defined]  # of those that have one
    summary = (ast.get_docstring(function) or "").partition("\n")[0]
    return (
        f"  {f'{case.name} {case.arguments}'.strip()} ({ast.unparse(function.args)})\n     "
        f" {summary}"
    )


def wanted(words: Sequence[str]) -> list[tuple[Case, Sequence[str]]]:
    """The cases that a command line names, with their arguments."""
    quick, words = words[0] == "quick", words[words[0] == "quick" :]
    if set(words) <= set(TABLES):
        every = [case for name in words for case in TABLES[name]]
        return [(case, (case.quick if quick else case.arguments).split()) for case in every]
    cases = {case.name: case for table in TABLES.values() for case in reversed(table)}
    if words[0] not in cases:
        sys.exit(f"no benchmark named {words[0]}; there are {', '.join([*TABLES, *cases])}")
    case = cases[words[0]]
    return [(case, words[1:] or (case.quick if quick else case.arguments).split())]


if __name__ == "__main__":
    if len(sys.argv) == 1:
        for table, cases in TABLES.items():
            print(f"\n{table}", *map(described, cases), sep="\n")
        sys.exit()
    sys.exit(sum(not run(case, arguments) for case, arguments in wanted(sys.argv[1:])))
