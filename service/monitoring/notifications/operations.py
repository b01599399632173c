"""What can be done with webhooks and deliveries besides sending: find them, list what was sent."""

from __future__ import annotations

from uuid import UUID

from sqlalchemy import ColumnElement, select
from sqlalchemy.orm import Session

from service.access import Lookup, Role, User
from service.errors import NotFound
from service.monitoring.notifications.schemas import DeliveryOut
from service.monitoring.notifications.tables import Delivery, Webhook
from service.web import Cursor, Limit, Page, paged

delivery_for = Lookup(Delivery, "delivery", "project_id")
"""The delivery, if the user has at least a role in its project."""

_any_webhook_for = Lookup(Webhook, "webhook", "project_id")


def webhook_for(session: Session, user: User, webhook_id: UUID, role: Role) -> Webhook:
    """The webhook, if the user has at least this role in its project.

    Raises:
        NotFound: there is none, it is other people's, or it was deleted.
        Forbidden: the user's role is too low.
    """
    row = _any_webhook_for(session, user, webhook_id, role)
    if not row.active:
        raise NotFound("webhook", webhook_id)
    return row


def deliveries(session: Session, wanted: ColumnElement[bool], cursor: Cursor, limit: Limit) -> Page[DeliveryOut]:
    """A page of deliveries, newest first.

    Args:
        session: the request's transaction.
        wanted: the condition, such as `Delivery.webhook_id == id`.
        cursor: of the page before; None for the first.
        limit: rows in a page.

    Raises:
        Invalid: the cursor is not one of this list.
    """
    rows, following = paged(session, select(Delivery).where(wanted), Delivery.id, cursor, limit, newest_first=True)
    return Page(items=[DeliveryOut.model_validate(row) for row in rows], next_cursor=following)


def deliveries_of_monitor(session: Session, monitor_id: UUID, cursor: Cursor, limit: Limit) -> Page[DeliveryOut]:
    """A page of what was sent about a monitor, or waits to be sent, newest first; otherwise as `deliveries`."""
    return deliveries(session, Delivery.monitor_id == monitor_id, cursor, limit)
