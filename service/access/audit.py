"""The audit trail."""

from __future__ import annotations

from typing import Any
from uuid import UUID

from sqlalchemy.orm import Session

from service.access.tables import AuditEvent, User
from service.request_id import current_request_id


def audit(
    session: Session,
    user: User | None,
    action: str,
    subject_type: str,
    subject_id: UUID | None,
    project_id: UUID | None = None,
    **detail: Any,
) -> None:
    """Record an act in the caller's transaction, so that the act and its record stand or fall together.

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
