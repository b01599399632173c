"""Every benchmark is a case of one of three tables: accuracy, speed, soak.

    python -m benchmarks                        # what there is
    python -m benchmarks accuracy speed         # every case of these tables
    python -m benchmarks hits 36 880031         # one case, with other arguments than the table's

A case is a module of this package whose `main` prints a short table. Its arguments are counts, seeds and words.
"""

from __future__ import annotations

import importlib
import runpy
import sys
import time
import traceback
from collections.abc import Sequence
from typing import NamedTuple


class Case(NamedTuple):
    """A module, its arguments in the table, and what it measures."""

    module: str
    measures: str
    arguments: tuple[str, ...] = ()


TABLES = {
    "accuracy": (
        Case("hits", "hits judged: good ones thrown away, bad ones missed, beside pyFRF"),
        Case("hits_habits", "good hits under the habits of instruments and hands"),
        Case("hits_accuracy", "FRFs of hits against exact ones, variance, damping under windows"),
        Case("hits_damping", "from hits to a0 and a1"),
        Case("identification", "bias and scatter of f and ζ, beside sdypy-EMA"),
        Case("real_identification", "modes lost and invented in FRFs with the faults of measured ones"),
        Case("real_bodies", "one deviation of the body at a time", ("table",)),
        Case("real_bodies", "intervals where everything is other than stated", ("drawn", "60")),
        Case("wooden_plates", "updates of plates from a handbook's constants"),
        Case("laboratories", "structures, tours, bands, damping and faults at random"),
        Case("independent", "bodies of solid elements by CalculiX"),
        Case("structures", "shells in space: published shells, joints against solids, size, CalculiX's S8R"),
        Case("structures_solids", "joints of walls of unlike thickness, by CalculiX's solids"),
        Case("campaigns", "several tests of one material: intervals", ("coverage", "3", "1")),
        Case("campaigns", "the same with bodies by CalculiX", ("solids", "2", "1")),
        Case("campaigns", "which points to hit", ("plans", "12", "17")),
        Case("cards", "decks of updated models by CalculiX"),
        Case("trend", "false alarms and delays of control charts"),
        Case("uff_damage", "verdicts on damaged UFF files"),
    ),
    "speed": (
        Case("forward", "the forward model beside scikit-fem, pyfe3d and CalculiX"),
        Case("updating", "the default update by step, beside scipy's least_squares"),
        Case("measurements", "imports, spectra over HTTP, lists, beside pyuff and PostgreSQL"),
        Case("many_hits", "10,000 hits: import and processing, beside reading and COPY"),
        Case("live_hits", "the judgement of one hit after another over HTTP"),
        Case("jobs", "what the queue costs, cancelling, two workers over one"),
        Case("pages", "figure, report and page of a result"),
        Case("start", "modalbase up on an existing data folder"),
    ),
    "soak": (
        Case("access_matrix", "every operation as every kind of caller", ("long",)),
        Case("soak_fuzz", "requests drawn from the OpenAPI document"),
        Case("soak_bombs", "files of every format that are made to cost"),
        Case("soak_load", "500 clients and 400 streams of events"),
        Case("soak_kills", "100 kills under imports, updates and messages"),
        Case("soak_small", "every figure and report of campaigns of few FRFs"),
        Case("soak_backup", "a backup of jobs that wait and run, restored"),
        Case("jobs_outage", "a worker cut off from the database for a minute"),
    ),
}


def run(case: Case, arguments: Sequence[str]) -> bool:
    """Run a case; whether it succeeded."""
    print(f"\n=== {case.module} {' '.join(arguments)}", flush=True)
    start, good = time.perf_counter(), True
    try:
        main = getattr(importlib.import_module(f"benchmarks.{case.module}"), "main", None)
        if main is not None:
            main(*(int(word) if word.isdigit() else word for word in arguments))
        else:
            sys.argv = [case.module, *arguments]
            runpy.run_module(f"benchmarks.{case.module}", run_name="__main__")
    except SystemExit as end:
        good = not end.code
    except Exception:  # noqa: BLE001 - one case's failure must not hide the others' figures
        traceback.print_exc()
        good = False
    print(f"=== {case.module}: {time.perf_counter() - start:.1f} s{'' if good else ', FAILED'}", flush=True)
    return good


def wanted(words: Sequence[str]) -> list[tuple[Case, Sequence[str]]]:
    """The cases that a command line names, with their arguments."""
    if set(words) <= set(TABLES):
        return [(case, case.arguments) for name in words for case in TABLES[name]]
    cases = {case.module: case for table in TABLES.values() for case in reversed(table)}
    if words[0] not in cases:
        sys.exit(f"no benchmark named {words[0]}; there are {', '.join([*TABLES, *cases])}")
    return [(cases[words[0]], words[1:] or cases[words[0]].arguments)]


if __name__ == "__main__":
    if len(sys.argv) == 1:
        for table, cases in TABLES.items():
            print(f"\n{table}")
            print("\n".join(f"  {' '.join([case.module, *case.arguments]):28} {case.measures}" for case in cases))
        sys.exit()
    sys.exit(sum(not run(case, arguments) for case, arguments in wanted(sys.argv[1:])))
