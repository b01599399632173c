"""Every operation of the OpenAPI document, asked by every kind of caller with own, foreign and random ids."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from benchmarks import access_matrix


@pytest.fixture(scope="module")
def asked(new_database: Callable[[], str]) -> Iterator[access_matrix.Round]:
    with access_matrix.asking(new_database()) as asked:
        yield asked


def test_nothing_leaks_and_every_operation_is_judged(asked: access_matrix.Round) -> None:
    found = asked.run()
    assert found.leaks == []
    assert min(found.calls.values()) > 0
    assert {200, 401, 403, 404} <= found.statuses.keys()


def test_a_wrong_judgement_and_a_missing_one_are_found(
    asked: access_matrix.Round, monkeypatch: pytest.MonkeyPatch
) -> None:
    judged = access_matrix.judgements()
    judged["GET /projects/{project_id}"] = ("read", "editor")
    judged["GET /structures/{structure_id}"] = ("write", "viewer")
    del judged["GET /alarms"]
    monkeypatch.setattr(access_matrix, "judgements", lambda: judged)
    only = ["GET /projects/{project_id}", "GET /structures/{structure_id}"]
    leaks = asked.run(only=only).leaks
    assert any(leak.startswith("GET /alarms: nobody has judged") for leak in leaks)
    assert any(
        leak.startswith("GET /projects/{project_id}, viewer, own id: should be 403; it is 200") for leak in leaks
    )
    assert any(leak.startswith("GET /structures/{structure_id}, owner, read alone, own id") for leak in leaks)
