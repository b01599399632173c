"""What is killed, overloaded or damaged for long. The tests have each in a short form, and more in
a long one.
"""

import time
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.service import served
from benchmarks.tables import Table
from tests.support import bombs, heavy_load, kills
from tests.support import uff_damage as uff
from tests.support.rest import ASKED_FREELY

RATIO = 20.0  # of the lists' 95th percentile under load over that of one client alone


def soak_kills(count: int = 100) -> list[str]:
    """Kills under imports, updates and messages; gives what was lost."""
    began, tally = time.monotonic(), kills.soak(count)
    several = sum(n > 1 for n in Counter(tally.received).values())
    table = Table("", "what:44", "found:80")
    table.row("killed", _counts(tally.killed))
    table.row(
        "acknowledged", ", ".join(f"{len(ids)} {kind}s" for kind, ids in tally.acknowledged.items())
    )
    table.row("of these lost", "; ".join(tally.lost) or "none")
    table.row("jobs ended as", _counts(tally.states))
    table.row("reasons of failed jobs", _counts(tally.reasons) or "none")
    table.row("attempts begun / lost and recovered", f"{tally.attempts} / {tally.losses}")
    table.row("messages received / of these more than once", f"{len(tally.received)} / {several}")
    table.row("seconds", f"{time.monotonic() - began:.0f}")
    return [*tally.lost, *tally.reasons]


def soak_load(seconds: int = 60) -> list[str]:
    """500 clients and 400 streams of events; gives what was too much."""
    with served(access_log=False) as service:
        found = heavy_load.load(service, seconds)
    table = Table("", "request:8", "answers:32", "p50 ms:.1f", "p95 ms:.1f", "p99 ms:.1f")
    for kind in ("alone", *sorted(found.statuses)):
        each = found.alone if kind == "alone" else found.seconds[kind]
        answers = ", ".join(f"{n} × {status}" for status, n in sorted(found.statuses[kind].items()))
        table.row(
            kind, answers, *(1000 * np.percentile(each, [50, 95, 99]) if each else [None] * 3)
        )
    sizes = " / ".join(f"{size / 2**20:.0f}" for size in found.memory)
    print(f"{found.streams} streams open at the same time, {found.events} events")
    print(
        f"/healthz took {found.health * 1000:.0f} ms at most; memory of the API {sizes} MiB before"
        " / most / after"
    )
    ratio = float(np.percentile(found.seconds["list"], 95) / np.percentile(found.alone, 95))
    slow = [f"ratio {ratio:.1f} or /healthz too slow"] * (ratio > RATIO or found.health > 1)
    return found.bare_errors[:10] + slow


def soak_bombs(count: int = 10) -> list[str]:
    """Files of each format that are made to cost, all at once; gives what was too much."""
    # as much as a small machine has
    with served(job_memory_bytes=1024 * bombs.MIB, **ASKED_FREELY) as service:
        found = bombs.throw(service, count)
    print(
        f"API memory grew by {found.growth / 1e6:.0f} MB, /healthz took {1e3 * found.slowest:.0f}"
        " ms at most"
    )
    print("\n".join(f"{n} × {end}" for end, n in sorted(found.ends.items())))
    most, longest = bombs.MOST_GROWTH, bombs.MOST_SECONDS
    too_much = found.growth > most or found.slowest > longest
    return found.faults + [f"more than {most / 1e6:.0f} MB or {longest:g} s"] * too_much


def uff_damage(count: int = 2000, seed: int = 2015) -> list[str]:
    """Verdicts on damaged UFF files, and memory of floods; gives the silent changes."""
    with TemporaryDirectory() as name:
        table, silent = uff.run(count, seed, Path(name))
        verdicts = Table(
            f"{count} damaged UFF files, seed {seed}",
            "damage:16",
            "n:d",
            *(f"{verdict}:d" for verdict in uff.VERDICTS),
        )
        for kind, counts in {**table, "all": sum(table.values(), Counter())}.items():
            verdicts.row(kind, counts.total(), *(counts[verdict] for verdict in uff.VERDICTS))
        floods = Table("", "flood:36", "MiB more:.0f", "outcome:90")
        files = {kind: make() for kind, make in uff.FLOODS.items()}
        for kind, (more, outcome) in uff.flood(files, Path(name)).items():
            floods.row(kind, more, outcome[:90])
    return [f"silent change: {kind} of {name}" for name, kind, _ in silent]


def _counts(counter: Counter[str]) -> str:
    return ", ".join(f"{n} {what}" for what, n in sorted(counter.items()))
