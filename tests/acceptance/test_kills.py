"""The service under kills, in short; `make soak` kills a hundred times and prints what came of it."""

from benchmarks.soak_kills import soak


def test_kills_of_every_process_lose_nothing_and_are_no_internal_error() -> None:
    tally = soak(kills=4, workers=1)
    assert tally.killed == {"worker": 1, "fork server": 1, "API": 1, "PostgreSQL": 1}
    assert all(tally.acknowledged.values()), tally
    assert tally.lost == []
    assert tally.reasons == {}
    assert tally.states.keys() == {"succeeded"}
    assert tally.attempts == tally.states.total() + tally.losses  # nothing was computed again but what was lost
