"""What is killed, overloaded or damaged for long. The tests have each in a short form, and more in a long one."""

import time
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

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
    for name, value in {
        "killed": _counts(tally.killed),
        "acknowledged": ", ".join(f"{len(ids)} {kind}s" for kind, ids in tally.acknowledged.items()),
        "of these lost": "; ".join(tally.lost) or "none",
        "jobs ended as": _counts(tally.states),
        "reasons of failed jobs": _counts(tally.reasons) or "none",
        "attempts begun / lost and recovered": f"{tally.attempts} / {tally.losses}",
        "messages received / of these more than once": f"{len(tally.received)} / {several}",
        "seconds": f"{time.monotonic() - began:.0f}",
    }.items():
        print(f"  {name:<44} {value}")
    return [*tally.lost, *tally.reasons]


def soak_load(seconds: int = 60) -> list[str]:
    """500 clients and 400 streams of events; gives what was too much."""
    with served(access_log=False) as service:
        found = heavy_load.load(service, seconds)
    print("\n".join(found.lines()))
    slow = [f"ratio {found.ratio:.1f} or /healthz too slow"] * (found.ratio > RATIO or found.health > 1)
    return found.bare_errors[:10] + slow


def soak_bombs(count: int = 10) -> list[str]:
    """Files of each format that are made to cost, all at once; gives what was too much."""
    with served(job_memory_bytes=1024 * bombs.MIB, **ASKED_FREELY) as service:  # as much as a small machine has
        found = bombs.throw(service, count)
    print(f"API memory grew by {found.growth / 1e6:.0f} MB, /healthz took {1e3 * found.slowest:.0f} ms at most")
    print("\n".join(f"{n} × {end}" for end, n in sorted(found.ends.items())))
    most, longest = bombs.MOST_GROWTH, bombs.MOST_SECONDS
    too_much = found.growth > most or found.slowest > longest
    return found.faults + [f"more than {most / 1e6:.0f} MB or {longest:g} s"] * too_much


def uff_damage(count: int = 2000, seed: int = 2015) -> list[str]:
    """Verdicts on damaged UFF files, and memory and time of floods; gives the silent changes."""
    with TemporaryDirectory() as name:
        table, longest, silent = uff.run(count, seed, Path(name))
        title = f"{count} damaged UFF files, seed {seed}; longest reading {longest:.2f} s"
        verdicts = Table(title, "damage:16", "n:d", *(f"{verdict}:d" for verdict in uff.VERDICTS))
        for kind, counts in {**table, "all": sum(table.values(), Counter())}.items():
            verdicts.row(kind, counts.total(), *(counts[verdict] for verdict in uff.VERDICTS))
        floods = Table("", "flood:36", "MiB more:.0f", "s:.2f", "outcome:90")
        files = {kind: make() for kind, make in uff.FLOODS.items()}
        for kind, (more, seconds, outcome) in uff.flood(files, Path(name)).items():
            floods.row(kind, more, seconds, outcome[:90])
    return [f"silent change: {kind} of {name}" for name, kind, _ in silent]


def _counts(counter: Counter[str]) -> str:
    return ", ".join(f"{n} {what}" for what, n in sorted(counter.items()))
