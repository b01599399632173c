"""Every member of every request is used, or refused by name: none is accepted and ignored.

The members are those of the service's own OpenAPI document; one without a row in
`tests/support/member_rows.py` fails.
"""

from collections.abc import Iterator
from uuid import uuid4

import httpx
import pytest

from service.app.supervisor import LocalService
from service.platform.access.keys import user_named
from service.platform.db.engine import make_engine, make_sessions
from tests.support.lengths import long
from tests.support.member_lab import furnished
from tests.support.member_rows import MEMBERS
from tests.support.member_rows_within import WITHOUT_ROW
from tests.support.members import JSON, Lab, Node, faults, walk, within
from tests.support.receivers import receiver
from tests.support.rest import client_of


@pytest.fixture(scope="module")
def lab(service: LocalService) -> Iterator[Lab]:
    engine, (name, member) = (
        make_engine(service.settings.database_url),
        (f"member {uuid4()}" for _ in range(2)),
    )
    clients = client_of(service, name), client_of(service, member)
    with clients[0] as api, clients[1] as chief, receiver() as hook:
        with make_sessions(engine).begin() as session:
            user_named(session, member).administrator = True
        lab = furnished(api, name, chief, member, make_sessions(engine), hook.url)
        yield lab
        # so that its monitors and messages give nobody who comes after it any work
        api.delete(f"projects/{lab.ids['project_id']}").raise_for_status()
    engine.dispose()


@pytest.fixture(scope="module")
def document(service: LocalService) -> Node:
    document: Node = httpx.get(f"{service.url}/openapi.json", trust_env=False, timeout=120).json()
    return document


IN_SHORT = [name for name, body in MEMBERS.items() if body.short is not None]
UPDATES = [f"POST {path}update-jobs" for path in ("/campaigns/{campaign_id}/", "/")]


def named(operation: str, kind: str) -> str:
    return operation if kind in ("", JSON) else f"{operation} {kind}"


def test_every_operation_with_members_has_its_rows(document: Node) -> None:
    assert {named(operation, kind) for operation, kind, _ in walk(document)} == MEMBERS.keys()


@pytest.mark.parametrize(
    ("name", "whole"),
    [*((name, False) for name in MEMBERS), *(long(name, True) for name in IN_SHORT + UPDATES)],
)
def test_each_member_has_its_effect_or_is_refused_by_name(
    document: Node, lab: Lab, name: str, whole: bool
) -> None:
    """The only test that sees a member which is accepted and ignored. A short run tries, of
    operations that are dear, a member of each kind: `Body.short`.
    """
    operation, kind, members = next(one for one in walk(document) if named(*one[:2]) == name)
    inner = within(document).get((operation, kind))
    assert faults(lab, operation, kind, members, MEMBERS[name], inner, whole=whole) == []


def test_the_members_within_members_that_have_no_row_become_fewer(document: Node) -> None:
    """Each is listed once, by its schema, wherever it can be sent; a row in one operation is
    enough.
    """
    inner = {named(*key): members for key, members in within(document).items()}
    there = {one for members in inner.values() for names in members.values() for one in names}
    with_row = {
        one
        for name, members in inner.items()
        for path in members
        if path in MEMBERS[name].members
        for one in members[path]
    }
    assert there - with_row == WITHOUT_ROW
