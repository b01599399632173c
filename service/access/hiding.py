"""Deletion that loses nothing: what is deleted is hidden, with the moment, and can be brought back."""

from __future__ import annotations

from datetime import datetime
from typing import Protocol
from uuid import UUID

from sqlalchemy.orm import Session

from service.access.audit import audit
from service.access.tables import User
from service.db.clock import transaction_time
from service.problems.errors import Conflict


class Hideable(Protocol):
    """A row that knows when it was deleted."""

    id: UUID
    updated_at: datetime
    deleted_at: datetime | None


def hide(session: Session, user: User, row: Hideable, kind: str, project_id: UUID) -> None:
    """Mark a locked row of some kind, such as `campaign`, as deleted."""
    row.deleted_at = row.updated_at = transaction_time(session)
    session.flush()
    audit(session, user, f"{kind}.delete", kind, row.id, project_id)


def bring_back(session: Session, user: User, row: Hideable, kind: str, project_id: UUID) -> None:
    """Undo `hide`.

    Raises:
        Conflict: the row is not deleted.
    """
    if row.deleted_at is None:
        raise Conflict(f"the {kind} is not deleted")
    row.deleted_at, row.updated_at = None, transaction_time(session)
    session.flush()
    audit(session, user, f"{kind}.restore", kind, row.id, project_id)
