"""Rules of access that a database holds: keys, browser's sessions, users, and rows that are found
with a role.
"""

from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from typing import Any
from uuid import uuid4

import pytest
from sqlalchemy import delete, select, text, update
from sqlalchemy.exc import OperationalError
from sqlalchemy.orm import Session

from service.nouns.campaigns.operations import Campaign
from service.nouns.imports.operations import Import
from service.nouns.storage.originals import Original
from service.nouns.structures.operations import Structure, structure_for
from service.platform.access import routes
from service.platform.access.keys import (
    LIFETIME,
    USED_RESOLUTION,
    authenticated_key,
    close_session,
    create_key,
    is_session_token,
    key_of_session,
    open_session,
    user_named,
)
from service.platform.access.lookup import Lookup, Role, projects
from service.platform.access.tables import ApiKey, AuditEvent, BrowserSession, Member, Project, User
from service.platform.access.users import (
    expected_user,
    find_user,
    names_of,
    require_administrator,
    set_disabled,
    user_of_id,
    valid_key_counts,
)
from service.platform.db.engine import Sessions
from service.platform.errors import Conflict, Forbidden, Invalid, NotFound, Unauthorized
from service.platform.queue.tables import Job

ALL = ["read", "write", "jobs", "admin"]


def with_key(session: Session, name: str = "ada", **how: Any) -> tuple[ApiKey, str, User]:
    user = user_named(session, name)
    return *create_key(session, user, "k", **how), user


def refused(
    kind: type[Exception], words: str, act: Callable[..., object], *given: Any, **how: Any
) -> None:
    with pytest.raises(kind, match=words):
        act(*given, **how)


def test_what_a_new_key_is(sessions: Sessions) -> None:
    with sessions.begin() as session:
        row, key, user = with_key(session)
        assert row.id is not None  # it is stored, so its maker can name it
        assert (row.scopes, row.expires_at, row.name, row.user_id) == (ALL, None, "k", user.id)
        scheme, prefix, secret = key.split("_", 2)
        assert (scheme, prefix, len(prefix)) == ("mb", row.prefix, 12)
        assert len(secret) == 43  # 32 random bytes
        narrow = with_key(session, scopes=("read",), expires_at=datetime(2999, 1, 1, tzinfo=UTC))[0]
        assert (narrow.scopes, narrow.expires_at) == (["read"], datetime(2999, 1, 1, tzinfo=UTC))


def test_a_key_opens_until_it_ends_is_revoked_or_its_user_disabled(sessions: Sessions) -> None:
    with sessions.begin() as session:
        row, key, user = with_key(session)
        token = open_session(session, row)[1]
        now = datetime.now(UTC)
        for wrong in (
            f"xx_{key[3:]}",
            f"mb_é_{key[-43:]}",
            f"mb_{row.prefix}_",
            f"mb_{row.prefix[:-1]}._x",
            "mb_\udc80_x",
        ):
            refused(
                Unauthorized,
                "the API key is not valid; make one with",
                authenticated_key,
                session,
                wrong,
            )
        refused(
            Unauthorized,
            "the session has ended; sign in again",
            authenticated_key,
            session,
            "mbs_x",
        )
        for place, name, value, opens in (
            (row, "expires_at", now + timedelta(hours=1), True),
            (row, "expires_at", now - timedelta(seconds=1), False),
            (row, "revoked_at", now, False),
            (user, "disabled_at", now, False),
        ):
            setattr(place, name, value)
            for shown in (key, token):
                if opens:
                    assert authenticated_key(session, shown) == (row, user)
                else:
                    refused(Unauthorized, "valid|ended", authenticated_key, session, shown)
            setattr(place, name, None)
        assert authenticated_key(session, key)[1] is user


def test_the_use_of_a_key_is_noted_once_a_minute_and_waits_for_nobody(sessions: Sessions) -> None:
    assert timedelta(minutes=1) == USED_RESOLUTION
    with sessions.begin() as session:
        row, key, _ = with_key(session)
        token = open_session(session, row)[1]

    def used(shown: str, seconds_ago: float | None) -> float:
        """Seconds since the last use, after this one."""
        ago = None if seconds_ago is None else datetime.now(UTC) - timedelta(seconds=seconds_ago)
        with sessions.begin() as session:
            session.execute(update(ApiKey).values(last_used_at=ago))
        with sessions.begin() as session:
            authenticated_key(session, shown)
        with sessions() as session:
            noted = session.scalars(select(ApiKey.last_used_at)).one()
        return (datetime.now(UTC) - noted).total_seconds()

    assert used(key, None) < 25  # the test may be slow, but not by half a minute
    assert 30 <= used(key, 30) < 60
    assert used(key, 61) < 55
    assert used(token, 61) < 55
    with sessions.begin() as session:
        session.execute(update(ApiKey).values(last_used_at=None))
    with sessions.begin() as other, sessions.begin() as session:
        other.execute(select(ApiKey).with_for_update())
        # the lock stays for as long as `other` is open
        session.execute(text("SET LOCAL lock_timeout = '1ms'"))
        assert authenticated_key(session, key)[0].prefix == row.prefix


def test_a_session_ends_with_its_time_its_key_and_by_itself(sessions: Sessions) -> None:
    assert timedelta(hours=12) == LIFETIME
    soon = datetime.now(UTC) + timedelta(hours=1)
    with sessions.begin() as session:
        now = session.execute(text("SELECT now()")).scalar_one()
        row, key, user = with_key(session)
        brief, _, _ = with_key(session, expires_at=soon)
        lasting, _, _ = with_key(session, expires_at=soon + timedelta(days=1))
        assert [open_session(session, one)[0].expires_at for one in (row, brief, lasting)] == [
            now + LIFETIME,
            soon,
            now + LIFETIME,
        ]
        (first, one), (second, two) = open_session(session, row), open_session(session, row)
        assert is_session_token(one)
        assert not is_session_token(key)
        assert len(one) == len("mbs_") + 43
        assert first.token_sha256 != second.token_sha256
        assert one.encode() not in first.token_sha256
        assert key_of_session(session, one) == (row, user)
        close_session(session, one)
        close_session(session, one)  # again is fine
        assert key_of_session(session, one) is None
        assert key_of_session(session, two) == (row, user)
        session.execute(update(BrowserSession).values(expires_at=now))
        assert key_of_session(session, two) is None
        kept = open_session(session, brief)[0]  # clears away what is over of this key alone
        assert kept.id, "it is stored, and the audit can name it"
        left = session.execute(select(BrowserSession.key_id, BrowserSession.expires_at)).all()
        assert (kept.key_id, kept.expires_at) in left
        assert sorted(key_id for key_id, _ in left) == sorted(
            [row.id, row.id, brief.id, lasting.id]
        )


def test_users_are_found_by_name_or_key_and_entered_by_name_alone(sessions: Sessions) -> None:
    with sessions.begin() as session:
        ada, bob = user_named(session, "ada"), user_named(session, "bob")
        assert find_user(session, "bob") is find_user(session, str(bob.id)) is bob
        assert expected_user(session, str(ada.id)) is expected_user(session, "ada") is ada
        for act in (find_user, expected_user):
            refused(NotFound, "user", act, session, str(uuid4()))
        for name in ("eve", "bob\0"):
            refused(NotFound, "user", find_user, session, name)
        eve = expected_user(session, "eve")
        assert (eve.name, expected_user(session, "eve") is eve) == ("eve", True)
        assert names_of(session, [ada.id, eve.id, None]) == {ada.id: "ada", eve.id: "eve"}
        assert user_of_id(session, bob.id, locked=True) is bob
        refused(NotFound, "user", user_of_id, session, uuid4())


def test_only_administrators_and_never_themselves(sessions: Sessions) -> None:
    with sessions.begin() as session:
        chief, ada = user_named(session, "chief"), user_named(session, "ada")
        chief.administrator = True
        session.flush()
        require_administrator(chief)
        refused(
            Forbidden,
            "this is for administrators; the operator makes one",
            require_administrator,
            ada,
        )
        refused(
            Conflict,
            "cannot disable themselves",
            set_disabled,
            session,
            chief,
            chief,
            disabled=True,
        )
        for disabled in (False, True, True, False, False):
            set_disabled(session, chief, ada, disabled=disabled)
            assert (ada.disabled_at is not None) is disabled
        chief.disabled_at = datetime.now(UTC)
        set_disabled(session, chief, chief, disabled=False)
        session.flush()
        events = session.scalars(select(AuditEvent).order_by(AuditEvent.id)).all()
        assert [(event.action, event.subject_id, event.detail) for event in events] == [
            ("user.disable", ada.id, {"name": "ada"}),  # what is so already is no act
            ("user.enable", ada.id, {"name": "ada"}),
            ("user.enable", chief.id, {"name": "chief"}),
        ]
        assert {(event.user_id, event.subject_type) for event in events} == {(chief.id, "user")}


def test_keys_that_open_something_are_counted(sessions: Sessions) -> None:
    now = datetime.now(UTC)
    with sessions.begin() as session:
        ada = with_key(session)[2]
        with_key(session, expires_at=now + timedelta(hours=1))
        with_key(session, expires_at=now - timedelta(hours=1))
        with_key(session)[0].revoked_at = now
        bob = with_key(session, "bob", expires_at=now - timedelta(hours=1))[2]
        cat = with_key(session, "cat")[2]
        session.flush()
        assert valid_key_counts(session, [ada.id, bob.id]) == {ada.id: 2}
        assert valid_key_counts(session, [cat.id]) == {cat.id: 1}


CAMPAIGN: Lookup[Campaign] = Lookup(Campaign, "campaign", "structure_id", structure_for)
LINEAGE: Lookup[Campaign] = Lookup(
    Campaign, "campaign", "structure_id", structure_for, deleted_owner=True
)


@pytest.fixture
def house(sessions: Sessions) -> Iterator[tuple[Session, User, Project, Structure, Campaign]]:
    """A campaign of a structure of a project that ada owns; her colleague cat is an editor, bob
    only looks on.
    """
    with sessions() as session:
        users = [user_named(session, name) for name in ("ada", "cat", "bob")]
        project = Project(name="p")
        session.add(project)
        session.flush()
        roles = ("owner", "editor", "viewer")
        session.add_all(
            Member(project_id=project.id, user_id=u.id, role=r)
            for u, r in zip(users, roles, strict=True)
        )
        structure = Structure(project_id=project.id, name="s")
        session.add(structure)
        session.flush()
        campaign = Campaign(structure_id=structure.id, name="c", boundary="free", instruments={})
        session.add(campaign)
        session.flush()
        yield session, users[0], project, structure, campaign


House = tuple[Session, User, Project, Structure, Campaign]


def test_a_row_is_found_with_the_role_that_the_act_needs(house: House) -> None:
    session, ada, project, structure, campaign = house
    for name, roles in (("ada", 3), ("cat", 2), ("bob", 1), ("eve", 0)):
        user = user_named(session, name)
        needed: tuple[Role, ...] = ("viewer", "editor", "owner")
        for place, role in enumerate(needed):
            if place < roles:
                assert CAMPAIGN(session, user, campaign.id, role) is campaign
                assert structure_for(session, user, structure.id, role, lock=True) is structure
            else:
                refused(
                    Forbidden if roles else NotFound,
                    f"needs the role {role} in" if roles else f"no campaign {campaign.id}",
                    CAMPAIGN,
                    session,
                    user,
                    campaign.id,
                    role,
                )
    refused(NotFound, "no campaign", CAMPAIGN, session, ada, structure.id)
    assert CAMPAIGN.named(session, ada, campaign.id, "/c") is campaign
    with pytest.raises(Invalid) as fault:
        CAMPAIGN.named(session, ada, structure.id, "/c")
    assert (fault.value.faults[0].pointer, str(structure.id) in fault.value.faults[0].detail) == (
        "/c",
        True,
    )
    assert (
        CAMPAIGN.project_of(session, campaign)
        == structure_for.project_of(session, structure)
        == project.id
    )


def test_what_is_deleted_is_not_found_with_all_that_is_in_it(house: House) -> None:
    session, ada, project, structure, campaign = house
    key = campaign.id
    refused(Conflict, "the campaign is not deleted", CAMPAIGN.restore, session, ada, campaign)
    refused(
        Conflict,
        "not deleted; delete it first, and purge it",
        CAMPAIGN.purge,
        session,
        ada,
        campaign,
    )
    CAMPAIGN.hide(session, ada, campaign)
    now = session.execute(text("SELECT now()")).scalar_one()
    assert (campaign.deleted_at, campaign.updated_at) == (now, now)
    refused(NotFound, "no campaign", CAMPAIGN, session, ada, key)
    assert CAMPAIGN(session, ada, key, deleted=True) is campaign
    CAMPAIGN.restore(session, ada, campaign)
    assert CAMPAIGN(session, ada, key).deleted_at is None
    structure_for.hide(session, ada, structure)
    for deleted in (False, True):
        refused(NotFound, f"no campaign {key}", CAMPAIGN, session, ada, key, deleted=deleted)
    assert LINEAGE(session, ada, key) is campaign  # a result keeps its lineage
    project.deleted_at = now
    session.flush()
    refused(NotFound, f"no campaign {key}", LINEAGE, session, ada, key)
    project.deleted_at = None
    structure_for.purge(session, ada, structure)
    assert session.get(Structure, structure.id) is None
    for gone in (LINEAGE, CAMPAIGN):
        refused(NotFound, "no campaign", gone, session, ada, key, deleted=True)
    events = session.scalars(select(AuditEvent).order_by(AuditEvent.id)).all()
    assert [(e.action, e.subject_type, e.subject_id, e.detail) for e in events] == [
        ("campaign.delete", "campaign", key, {}),
        ("campaign.restore", "campaign", key, {}),
        ("structure.delete", "structure", structure.id, {}),
        ("structure.purge", "structure", structure.id, {"name": "s"}),
    ]
    assert {(event.user_id, event.project_id) for event in events} == {(ada.id, project.id)}


def test_a_project_has_so_many_members_and_no_more(
    house: House, monkeypatch: pytest.MonkeyPatch
) -> None:
    session, ada, project, _, _ = house
    eve = user_named(session, "eve")
    # as many as there are: a role of theirs can be changed
    monkeypatch.setattr(routes, "MOST_MEMBERS", 3)
    routes._require_place(session, project.id, ada)
    refused(Conflict, "the project has 3 members", routes._require_place, session, project.id, eve)
    monkeypatch.setattr(routes, "MOST_MEMBERS", 4)
    routes._require_place(session, project.id, eve)


def test_a_project_goes_with_all_that_is_in_it_in_whatever_order(house: House) -> None:
    session, ada, project, _, campaign = house
    job = Job(project_id=project.id, kind="import", queue="imports")
    session.add_all([job, Original(sha256=b"1", size=1)])
    session.flush()
    session.add(
        Import(id=job.id, campaign_id=campaign.id, filename="a.uff", sha256=b"1", dry_run=False)
    )
    project.deleted_at = datetime.now(UTC)
    session.flush()
    projects.purge(session, ada, project)
    left = [
        session.execute(select(table.id)).all()
        for table in (Project, Structure, Campaign, Job, Import)
    ]
    assert left == [[], [], [], [], []]


def test_a_row_is_read_again_under_its_lock(
    house: House, sessions: Sessions, monkeypatch: pytest.MonkeyPatch
) -> None:
    session, ada, _, _, campaign = house
    session.commit()
    assert CAMPAIGN(session, ada, campaign.id).name == "c"
    with sessions.begin() as other:
        other.execute(update(Campaign).values(name="new"))
    assert CAMPAIGN(session, ada, campaign.id).name == "c"
    assert CAMPAIGN(session, ada, campaign.id, lock=True).name == "new"
    with sessions() as other:
        other.execute(text("SET LOCAL lock_timeout = '1ms'"))
        other.execute(select(Structure).with_for_update())  # what it belongs to is not locked
        # rows that refer to it come in
        other.execute(text("SELECT 1 FROM campaigns FOR KEY SHARE"))
        with pytest.raises(OperationalError, match="lock timeout"):
            other.execute(select(Campaign).with_for_update(key_share=True))
    with sessions() as edits, sessions() as other:
        user_of_id(edits, ada.id, locked=True)
        other.execute(text("SET LOCAL lock_timeout = '1ms'"))
        # keys and memberships of theirs still come in
        other.execute(text("SELECT 1 FROM users FOR KEY SHARE"))
        with pytest.raises(OperationalError, match="lock timeout"):
            other.execute(select(User).where(User.id == ada.id).with_for_update(key_share=True))

    def removed_before(row: Campaign, **how: Any) -> None:
        with sessions.begin() as other:
            other.execute(delete(Campaign))
        Session.refresh(session, row, **how)

    session.commit()
    monkeypatch.setattr(session, "refresh", removed_before)
    refused(NotFound, "no campaign", CAMPAIGN, session, ada, campaign.id, lock=True)
