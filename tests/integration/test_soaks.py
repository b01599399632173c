"""Fuzzing and load in short; `make soak` has both in long and prints what came of them."""

from __future__ import annotations

from collections.abc import Callable

from benchmarks.soak_fuzz import fuzz
from benchmarks.soak_load import load


def test_no_request_that_the_document_allows_or_forbids_is_an_error_or_an_undocumented_answer(
    new_database: Callable[[], str],
) -> None:
    found = fuzz(examples=1, database_url=new_database(), worker=False)
    assert found.faults == {}
    assert len(found.answered) > 30  # else nothing got anywhere
    assert {200, 201, 404, 422} <= found.statuses.keys()


def test_many_clients_and_streams_at_once_get_answers(new_database: Callable[[], str]) -> None:
    found = load(seconds=1, clients=40, streams=40, keys=4, database_url=new_database())
    assert found.bare_errors == []
    assert found.streams == 40
    assert found.events >= 40
    assert found.statuses["list"].keys() <= {200, 503}
    assert found.statuses["list"][200] > 0
    assert found.statuses["healthz"].keys() == {200}
