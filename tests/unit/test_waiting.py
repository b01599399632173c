"""Tests wait for events: a sleep, or a time that is measured, stands in no test."""

import re

from tests.support.places import ROOT

TIME = re.compile(r"(?<!def )\b(sleep|monotonic|perf_counter|process_time|time\.time)\((?!0\))")
"""`sleep(0)` lets others run, and a `def` is a clock of the test's own."""
ALLOWED = {
    "support/waiting.py",  # looks again and again
    "support/computations.py",  # a job that is held
    "support/receivers.py",  # a signature must be fresh
    "support/bombs.py",  # benchmarks print what the health check took
    "support/heavy_load.py",  # they print what answers took
    "support/kills.py",  # kills come at random moments
    "unit/test_waiting.py",
}


def test_no_test_knows_a_clock() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()}"
        for path in sorted((ROOT / "tests").rglob("*.py"))
        if str(path.relative_to(ROOT / "tests")) not in ALLOWED
        for number, line in enumerate(path.read_text().splitlines(), start=1)
        if TIME.search(line)
    ]
    assert not found, "\n".join(found)
