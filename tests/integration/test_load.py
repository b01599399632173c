"""Load in short; `make soak` has it in long and prints what came of it."""

from __future__ import annotations

from collections.abc import Callable

from benchmarks.soak_load import load


def test_many_clients_and_streams_at_once_get_answers(new_database: Callable[[], str]) -> None:
    found = load(seconds=2, clients=40, streams=40, keys=4, pause=1, database_url=new_database())
    assert found.bare_errors == []
    assert found.streams == 40
    assert found.events >= 40
    assert found.statuses["list"].keys() <= {200, 503}
    assert found.statuses["list"][200] > 0
    assert found.statuses["healthz"].keys() == {200}
