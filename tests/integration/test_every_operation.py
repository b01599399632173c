"""Every operation of the OpenAPI document: who gets in where, what is drawn from the document, and
junk.

The operations are taken from the service's own document, so a new one is tested from its first day.
The long runs ask for longer.
"""

from collections.abc import Iterator
from itertools import chain

import pytest

from service.app.composition import ROUTERS
from service.app.supervisor import LocalService
from service.platform.access.keys import require_scope
from service.platform.access.tables import ApiKey
from service.platform.errors import Forbidden
from service.platform.web.routing import StrictRoute
from tests.support import access, furnished
from tests.support.fuzz import fuzz
from tests.support.lengths import long


@pytest.fixture(scope="module")
def asked(idle: LocalService) -> Iterator[access.Round]:
    """Every kind of caller, with own, foreign and random ids."""
    with access.asking_of(idle) as asked:
        yield asked


@pytest.mark.parametrize("every_role", [False, long(True)])
def test_nothing_leaks_and_every_operation_is_judged(asked: access.Round, every_role: bool) -> None:
    """Asks each operation as each kind of caller, so that a new one is judged from its first day."""
    found = asked.run(long=every_role)
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
    leaks = asked.run(long=True, only=only).leaks
    assert any(leak.startswith("GET /alarms: nobody has judged") for leak in leaks)
    assert any(
        leak.startswith("GET /projects/{project_id}, viewer, own id: should be 403; it is 200")
        for leak in leaks
    )
    assert any(
        leak.startswith("GET /structures/{structure_id}, owner, read alone, own id")
        for leak in leaks
    )


def test_each_route_asks_for_the_scope_that_it_is_judged_to() -> None:
    """`require_scope` is asked before any route; here it says what each asks for."""
    judged = furnished.judgements()
    for route in chain.from_iterable(router.routes for router in ROUTERS):
        assert isinstance(route, StrictRoute)
        for method in route.methods - {"HEAD"}:
            scope, _ = judged[f"{method} {route.label}"]
            with pytest.raises(Forbidden, match=f"a key of the scope {scope};"):
                require_scope(ApiKey(scopes=[]), {"route": route, "method": method})


@pytest.mark.filterwarnings("ignore:Glyph")  # which a print lacks; it is drawn as a box
@pytest.mark.parametrize(("times", "among"), [(1, 4), long(10, 1)])
def test_no_request_that_the_document_allows_or_forbids_is_an_error_or_an_undocumented_answer(
    idle: LocalService, times: int, among: int
) -> None:
    """Finds the request that nobody thought of, which the service answers with an error of its own."""
    found = fuzz(idle, rounds=times, examples=times, among=among)
    assert found.faults == {}
    assert len(found.answered) > 30 // among  # else nothing got anywhere
    assert {200, 201, 404, 422} <= found.statuses.keys()
