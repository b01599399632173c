"""Every operation of the OpenAPI document: who gets in where, what is drawn from the document, and
junk.

The operations are taken from the service's own document, so a new one is tested from its first day.
`make soak` asks for longer.
"""

import os
from collections.abc import Callable, Iterator

import pytest

from service.app.supervisor import LocalService
from tests.support import access, furnished
from tests.support.fuzz import fuzz
from tests.support.rest import ASKED_FREELY

LONG = "MODALBASE_TEST_LONG" in os.environ


@pytest.fixture(scope="module")
def service(new_service: Callable[..., LocalService]) -> Iterator[LocalService]:
    """One that is asked freely, and runs no jobs."""
    with new_service(worker=False, **ASKED_FREELY) as running:
        yield running


@pytest.fixture(scope="module")
def asked(service: LocalService) -> Iterator[access.Round]:
    """Every kind of caller, with own, foreign and random ids."""
    with access.asking_of(service) as asked:
        yield asked


def test_nothing_leaks_and_every_operation_is_judged(asked: access.Round) -> None:
    found = asked.run(long=LONG)
    assert found.leaks == []
    assert min(found.calls.values()) > 0
    assert {200, 401, 403, 404} <= found.statuses.keys()


def test_a_wrong_judgement_and_a_missing_one_are_found(
    asked: access.Round, monkeypatch: pytest.MonkeyPatch
) -> None:
    judged = furnished.judgements()
    judged["GET /projects/{project_id}"] = ("read", "editor")
    judged["GET /structures/{structure_id}"] = ("write", "viewer")
    del judged["GET /alarms"]
    monkeypatch.setattr(furnished, "judgements", lambda: judged)
    only = ["GET /projects/{project_id}", "GET /structures/{structure_id}"]
    leaks = asked.run(only=only).leaks
    assert any(leak.startswith("GET /alarms: nobody has judged") for leak in leaks)
    assert any(
        leak.startswith("GET /projects/{project_id}, viewer, own id: should be 403; it is 200")
        for leak in leaks
    )
    assert any(
        leak.startswith("GET /structures/{structure_id}, owner, read alone, own id")
        for leak in leaks
    )


def test_no_request_that_the_document_allows_or_forbids_is_an_error_or_an_undocumented_answer(
    service: LocalService,
) -> None:
    found = fuzz(service, rounds=10 if LONG else 1, examples=10 if LONG else 1)
    assert found.faults == {}
    assert len(found.answered) > 30  # else nothing got anywhere
    assert {200, 201, 404, 422} <= found.statuses.keys()
