"""Every benchmark is a case of one of three tables: accuracy, speed, soak.

    python -m benchmarks                        # what there is
    python -m benchmarks accuracy speed         # every case of these tables
    python -m benchmarks hits 36 880031         # one case, with other arguments than the table's
    python -m benchmarks quick accuracy         # every case of a table with few draws: does it run?

A case is a function of this package that prints a short table, and gives what was wrong, if anything. Its arguments are
counts, seeds and words.
"""

import importlib
import sys
import time
import traceback
from collections.abc import Sequence
from typing import NamedTuple


class Case(NamedTuple):
    """A function by its module, what it measures, and its arguments in the table and in a quick run."""

    name: str
    module: str
    measures: str
    arguments: str = ""
    quick: str = ""


TABLES = {
    "accuracy": (
        Case("hits", "hits", "hits judged: good ones thrown away, bad ones missed, beside pyFRF", quick="3"),
        Case("made_hits", "made_hits", "bad hits of 17 kinds that bias an FRF: missed; good ones refused", quick="2"),
        Case(
            "calibrate_hits",
            "calibrate_hits",
            "weights of the hits' probability, reliability, worth of each number",
            quick="4",
        ),
        Case("hits_habits", "hits", "good hits under the habits of instruments and hands", quick="1"),
        Case("hits_accuracy", "hits", "FRFs of hits against exact ones, variance, damping under windows", quick="1 4"),
        Case("hits_damping", "hits", "from hits to a0 and a1", quick="2"),
        Case("identification", "identification", "bias and scatter of f and ζ, beside sdypy-EMA", quick="2"),
        Case("calibrate", "calibrate", "the probability of a pole on made FRFs: its weights, reliability, modes lost"),
        Case("real_bodies", "updates", "one deviation of the body at a time", "table", "table nothing"),
        Case("real_bodies", "updates", "intervals where everything is other than stated", "drawn 60", "drawn 2"),
        Case("wooden_plates", "updates", "updates of plates from a handbook's constants", quick="1"),
        Case("laboratories", "updates", "structures, tours, bands, damping and faults at random", quick="2"),
        Case("independent", "updates", "bodies of solid elements by CalculiX", quick="1"),
        Case("structures", "structures", "shells in space: published shells, joints against solids, CalculiX's S8R"),
        Case("structures_drawn", "structures_drawn", "profiles drawn at random, solids by CalculiX, updated by `{}`"),
        Case("structures_solids", "structures_solids", "joints of walls of unlike thickness, by CalculiX's solids"),
        Case("campaigns", "updates", "several tests of one material: intervals", "coverage 3 1", "coverage 1 1"),
        Case("campaigns", "updates", "the same with bodies by CalculiX", "solids 2 1", "solids 1 1"),
        Case(
            "contradictions", "contradictions", "the wrong source of a joint update: named, first, cleared", quick="1"
        ),
        Case("zones", "zones", "stretches of another stiffness: false zones, found ones, intervals", quick="1"),
        Case("planned", "plans", "what plans predict beside what the update finds once they are made", quick="1"),
        Case("campaigns", "updates", "which points to hit", "plans 12 17", "plans 1 17"),
        Case("cards", "core", "decks of updated models by CalculiX", quick="1"),
        Case("trend", "trend", "false alarms and delays of control charts", quick="2"),
        Case("uff_damage", "uff_damage", "verdicts on damaged UFF files", quick="100"),
    ),
    "speed": (
        Case("forward", "core", "the forward model beside scikit-fem, pyfe3d and CalculiX", quick="3"),
        Case("updating", "core", "the default update by step, beside scipy's least_squares", quick="400"),
        Case("mixed_deck", "mixed_deck", "a deck of 8,000 mixed elements from file to update", quick="20"),
        Case(
            "measurements",
            "database",
            "imports, spectra over HTTP, lists, beside pyuff and PostgreSQL",
            quick="100 801",
        ),
        Case("many_hits", "database", "10,000 hits: import and processing, beside reading and COPY", quick="200"),
        Case("recordings", "recordings", "a long wav and TDMS: hits found and cut, memory", quick="1"),
        Case("live_hits", "database", "the judgement of one hit after another over HTTP", quick="2"),
        Case("search", "search", "the questions of search and an import as the database grows", quick="20"),
        Case("fleet", "fleet", "monitors' reruns by one worker and two, and what they share", quick="1 4"),
        Case("jobs", "jobs", "what the queue costs, cancelling, two workers over one", quick="20 2 2"),
        Case("pages", "screen", "figure, report and page of a result", quick="3 1 1"),
        Case("start", "screen", "modalbase up on an existing data folder", quick="1"),
    ),
    "soak": (
        Case("soak_fuzz", "soak", "requests drawn from the OpenAPI document", quick="0"),
        Case("soak_bombs", "soak", "files of every format that are made to cost", quick="1"),
        Case("soak_load", "soak_load", "500 clients and 400 streams of events", quick="10"),
        Case("soak_kills", "soak_kills", "100 kills under imports, updates and messages", quick="4"),
        Case("soak_small", "soak", "every figure and report of campaigns of few FRFs", quick="1"),
        Case("soak_backup", "soak_backup", "a backup of jobs that wait and run, restored", quick="1"),
        Case("jobs_outage", "jobs_outage", "a worker cut off from the database for a minute", quick="5"),
    ),
}


def run(case: Case, arguments: Sequence[str]) -> bool:
    """Run a case; whether it succeeded."""
    print(f"\n=== {case.name} {' '.join(arguments)}", flush=True)
    start = time.perf_counter()
    try:
        module = importlib.import_module(f"benchmarks.{case.module}")
        function = getattr(module, case.name, None) or module.main
        wrong = function(*(int(word) if word.isdigit() else word for word in arguments)) or []
    except Exception:  # noqa: BLE001 - one case's failure must not hide the others' figures
        wrong = [traceback.format_exc()]
    print(
        *wrong,
        f"=== {case.name}: {time.perf_counter() - start:.1f} s{', FAILED' if wrong else ''}",
        sep="\n",
        flush=True,
    )
    return not wrong


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
            print(f"\n{table}")
            print("\n".join(f"  {f'{case.name} {case.arguments}':28} {case.measures}" for case in cases))
        sys.exit()
    sys.exit(sum(not run(case, arguments) for case, arguments in wanted(sys.argv[1:])))
