"""Users: found by name or key, entered under a name before they have a key, disabled; and the audit
trail of what they do.
"""

from collections.abc import Collection, Iterable, Sequence
from contextlib import suppress
from datetime import datetime
from typing import Any
from uuid import UUID

from sqlalchemy import ColumnElement, func, or_, select, text
from sqlalchemy.dialects.postgresql import array, insert
from sqlalchemy.orm import Session

from service.platform.access.tables import ApiKey, AuditEvent, User
from service.platform.db.base import transaction_time
from service.platform.errors import Conflict, Forbidden, NotFound
from service.platform.logs import current_request_id


def audit(
    session: Session,
    user: User | None,
    action: str,
    subject_type: str,
    subject_id: UUID | None,
    project_id: UUID | None = None,
    **detail: Any,
) -> None:
    """Record an act in the caller's transaction, so that the act and its record stand or fall
    together.

    Args:
        session: the transaction of the act.
        user: who; None for the operator at the command line and for the service itself.
        action: what, as `thing.verb`, such as `campaign.create`.
        subject_type: kind of thing, such as `campaign`.
        subject_id: which thing.
        project_id: the project it belongs to; its members see the event.
        detail: JSON values worth keeping.
    """
    session.add(
        AuditEvent(
            user_id=user.id if user else None,
            project_id=project_id,
            action=action,
            subject_type=subject_type,
            subject_id=subject_id,
            detail=detail,
            request_id=current_request_id(),
        )
    )


def first_event(
    session: Session,
    action: str,
    subjects: Collection[UUID],
    after: datetime,
    project_id: UUID,
    members: Sequence[str] = (),
) -> datetime | None:
    """When an act was first done with one of some things of a project after a moment, or changed
    one of these members of it; None where it was not.
    """
    acts = [
        AuditEvent.project_id == project_id,
        AuditEvent.action == action,
        AuditEvent.subject_id.in_(subjects),
    ]
    if members:
        acts.append(AuditEvent.detail["now"].has_any(array(members)))
    first: datetime | None = session.scalar(
        select(func.min(AuditEvent.created_at)).where(*acts, AuditEvent.created_at > after)
    )
    return first


_SOME_TIME_AGO = text(
    "uuidv7(-random() * (now() - coalesce((SELECT min(created_at) FROM users), now())))"
)
"""A key like that of a user who came at any time since the first one: one made now would show that
the user is new.
"""


def find_user(session: Session, name_or_id: str) -> User:
    """A user by name or id.

    Raises:
        NotFound: there is none.
    """
    condition: ColumnElement[bool] = User.name == name_or_id
    with suppress(ValueError):  # not an id, so a name
        condition = or_(condition, User.id == UUID(name_or_id))
    user = (
        session.scalars(select(User).where(condition)).first() if "\0" not in name_or_id else None
    )
    if user is None:
        raise NotFound("user", name_or_id)
    return user


def expected_user(session: Session, name_or_id: str) -> User:
    """A user by name or id; under a name that nobody has, one is entered who waits for a first key.

    So who adds members does not learn which users there are.

    Raises:
        NotFound: it is an id, and nobody has it.
    """
    with suppress(ValueError):
        UUID(name_or_id)
        return find_user(session, name_or_id)
    session.execute(
        insert(User).values(name=name_or_id, id=_SOME_TIME_AGO).on_conflict_do_nothing()
    )
    return session.scalars(select(User).where(User.name == name_or_id)).one()


def names_of(session: Session, user_ids: Iterable[UUID | None]) -> dict[UUID | None, str]:
    """Names of users by key."""
    query = select(User.id, User.name).where(User.id.in_(user_ids))
    return dict(session.execute(query).all())


def require_administrator(user: User) -> None:
    """Refuse who may not look after other users.

    Raises:
        Forbidden: the user is no administrator.
    """
    if not user.administrator:
        raise Forbidden(
            "this is for administrators; the operator makes one: `modalbase users promote NAME`"
        )


def set_disabled(session: Session, by: User, user: User, *, disabled: bool) -> None:
    """Have an administrator disable a locked user, whose keys then open nothing, or enable them
    again.

    Raises:
        Conflict: administrators would disable themselves.
    """
    if disabled and by.id == user.id:
        raise Conflict(
            "administrators cannot disable themselves; another administrator or the operator can"
        )
    if (user.disabled_at is not None) == disabled:
        return
    user.disabled_at = transaction_time(session) if disabled else None
    audit(
        session, by, "user.disable" if disabled else "user.enable", "user", user.id, name=user.name
    )


def user_of_id(session: Session, user_id: UUID, *, locked: bool = False) -> User:
    """A user by key; `locked`, nobody else edits the row until the transaction ends.

    Raises:
        NotFound: there is none.
    """
    user = session.get(User, user_id, with_for_update={"key_share": True} if locked else None)
    if user is None:
        raise NotFound("user", user_id)
    return user


def valid_key_counts(session: Session, user_ids: Iterable[UUID]) -> dict[UUID, int]:
    """How many keys of each user are neither revoked nor expired; users without any are left
    out.
    """
    query = (
        select(ApiKey.user_id, func.count())
        .where(ApiKey.user_id.in_(user_ids), ApiKey.revoked_at.is_(None))
        .where(or_(ApiKey.expires_at.is_(None), ApiKey.expires_at > func.now()))
        .group_by(ApiKey.user_id)
    )
    return dict(session.execute(query).all())
