"""Routes of users and their keys, for administrators. None of them makes a key, so nobody acts in another's name."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated
from uuid import UUID

from fastapi import Depends, Query
from sqlalchemy import select
from sqlalchemy.orm import Session

from service.access.audit import audit
from service.access.dependencies import CurrentUser, SessionDep
from service.access.schemas import KeyEnd, KeyOut, UserOut
from service.access.tables import ApiKey, User
from service.access.users import locked_user, require_administrator, set_disabled, valid_key_counts
from service.db.clock import transaction_time
from service.errors import Conflict, Invalid, NotFound
from service.web import Page, api_router
from service.web.paging import Cursor, Limit, paged

router = api_router(tags=["access"])


def _administrator(user: CurrentUser) -> None:
    require_administrator(user)


ADMINISTRATORS = [Depends(_administrator)]


@router.get("/users", dependencies=ADMINISTRATORS)
def list_users(
    session: SessionDep,
    name: Annotated[str | None, Query(max_length=200, description="only the user of this name")] = None,
    cursor: Cursor = None,
    limit: Limit = 100,
) -> Page[UserOut]:
    """All users; for administrators, with a key of the scope `admin`."""
    query = select(User) if name is None else select(User).where(User.name == name.replace("\0", ""))
    rows, following = paged(session, query, User.id, cursor, limit)
    return Page(items=_shown(session, rows), next_cursor=following)


@router.get("/users/{user_id}", dependencies=ADMINISTRATORS)
def get_user(user_id: UUID, session: SessionDep) -> UserOut:
    """One user; for administrators."""
    return _shown(session, [_found(session, user_id)])[0]


@router.post("/users/{user_id}/disable", dependencies=ADMINISTRATORS)
def disable_user(user_id: UUID, session: SessionDep, user: CurrentUser) -> UserOut:
    """Disable a user: from now on none of their keys opens anything; for administrators."""
    found = locked_user(session, user_id)
    set_disabled(session, user, found, disabled=True)
    return _shown(session, [found])[0]


@router.post("/users/{user_id}/enable", dependencies=ADMINISTRATORS)
def enable_user(user_id: UUID, session: SessionDep, user: CurrentUser) -> UserOut:
    """Enable a user who was disabled; for administrators."""
    found = locked_user(session, user_id)
    set_disabled(session, user, found, disabled=False)
    return _shown(session, [found])[0]


@router.get("/users/{user_id}/api-keys", dependencies=ADMINISTRATORS)
def list_keys_of_user(user_id: UUID, session: SessionDep, cursor: Cursor = None, limit: Limit = 100) -> Page[KeyOut]:
    """A user's keys, without their secrets; for administrators."""
    query = select(ApiKey).where(ApiKey.user_id == _found(session, user_id).id)
    rows, following = paged(session, query, ApiKey.id, cursor, limit)
    return Page(items=[KeyOut.model_validate(row) for row in rows], next_cursor=following)


@router.patch("/users/{user_id}/api-keys/{key_id}", dependencies=ADMINISTRATORS)
def end_key_of_user(user_id: UUID, key_id: UUID, body: KeyEnd, session: SessionDep, user: CurrentUser) -> KeyOut:
    """Have a user's key expire, never later than it does already; for administrators."""
    key = _locked_key(session, user_id, key_id)
    if key.revoked_at is not None:
        raise Conflict("the key is revoked")
    if body.expires_at <= transaction_time(session):
        raise Invalid("/expires_at", "is over already; DELETE revokes the key at once")
    if key.expires_at is not None and body.expires_at > key.expires_at:
        raise Invalid("/expires_at", f"is later than the key's end now, {key.expires_at.isoformat()}")
    key.expires_at = body.expires_at
    audit(session, user, "api_key.expire", "api_key", key.id, expires_at=body.expires_at.isoformat())
    return KeyOut.model_validate(key)


@router.delete("/users/{user_id}/api-keys/{key_id}", status_code=204, dependencies=ADMINISTRATORS)
def revoke_key_of_user(user_id: UUID, key_id: UUID, session: SessionDep, user: CurrentUser) -> None:
    """Revoke a user's key: from now on it opens nothing; for administrators."""
    key = _locked_key(session, user_id, key_id)
    if key.revoked_at is None:
        key.revoked_at = transaction_time(session)
        audit(session, user, "api_key.revoke", "api_key", key.id)


def _found(session: Session, user_id: UUID) -> User:
    found = session.get(User, user_id)
    if found is None:
        raise NotFound("user", user_id)
    return found


def _locked_key(session: Session, user_id: UUID, key_id: UUID) -> ApiKey:
    query = select(ApiKey).where(ApiKey.id == key_id, ApiKey.user_id == _found(session, user_id).id)
    key = session.scalars(query.with_for_update()).one_or_none()
    if key is None:
        raise NotFound("API key", key_id)
    return key


def _shown(session: Session, users: Sequence[User]) -> list[UserOut]:
    counts = valid_key_counts(session, [user.id for user in users])
    return [UserOut(**user.__dict__, valid_keys=counts.get(user.id, 0)) for user in users]
