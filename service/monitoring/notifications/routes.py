"""Routes of webhooks and of what was sent to them."""

from __future__ import annotations

from typing import Annotated
from uuid import UUID

from fastapi import Query, Response
from sqlalchemy import select
from sqlalchemy.orm import Session

from service.access import CurrentUser, SessionDep, SettingsDep, audit, project_for, projects_of
from service.errors import Conflict, Invalid
from service.monitoring.notifications.addresses import AddressError, destinations, resolve
from service.monitoring.notifications.delivery import new_secret
from service.monitoring.notifications.messages import trial_message
from service.monitoring.notifications.operations import deliveries, delivery_for, webhook_for
from service.monitoring.notifications.schemas import DeliveryOut, NewWebhookOut, WebhookIn, WebhookOut
from service.monitoring.notifications.tables import Delivery, Webhook
from service.web import Cursor, Limit, Page, api_router, paged

router = api_router(tags=["webhooks"])


@router.post("/webhooks", status_code=201)
def create_webhook(
    body: WebhookIn, session: SessionDep, user: CurrentUser, settings: SettingsDep, response: Response
) -> NewWebhookOut:
    """Have a project's events posted to a URL, signed as Standard Webhooks says. The answer alone shows the secret."""
    project = project_for(session, user, body.project, "owner")
    try:
        resolve(body.url, destinations(settings))
    except AddressError as error:
        raise Invalid("/url", str(error)) from None
    row = Webhook(project_id=project.id, url=body.url, secret=new_secret(), events=body.events)
    session.add(row)
    session.flush()
    session.refresh(row)
    audit(session, user, "webhook.create", "webhook", row.id, project.id, url=body.url)
    response.headers["Location"] = f"/api/v1/webhooks/{row.id}"
    return NewWebhookOut.model_validate(row)


@router.get("/webhooks")
def list_webhooks(
    session: SessionDep,
    user: CurrentUser,
    project: Annotated[UUID | None, Query(description="of this project only")] = None,
    cursor: Cursor = None,
    limit: Limit = 100,
) -> Page[WebhookOut]:
    """Webhooks of one's projects."""
    query = select(Webhook).where(Webhook.project_id.in_(projects_of(user)), Webhook.active)
    if project is not None:
        query = query.where(Webhook.project_id == project_for(session, user, project).id)
    rows, following = paged(session, query, Webhook.id, cursor, limit)
    return Page(items=[WebhookOut.model_validate(row) for row in rows], next_cursor=following)


@router.delete("/webhooks/{webhook_id}", status_code=204)
def delete_webhook(webhook_id: UUID, session: SessionDep, user: CurrentUser) -> None:
    """Post nothing there any more; what waits is given up, what was sent stays listed with the monitor."""
    row = webhook_for(session, user, webhook_id, "owner")
    row.active = False
    waiting = select(Delivery).where(Delivery.webhook_id == row.id, Delivery.state == "waiting").with_for_update()
    for delivery in session.scalars(waiting):
        delivery.state, delivery.last_error = "failed", "the webhook was deleted"
    audit(session, user, "webhook.delete", "webhook", row.id, row.project_id)


@router.post("/webhooks/{webhook_id}/test", status_code=202)
def test_webhook(webhook_id: UUID, session: SessionDep, user: CurrentUser) -> DeliveryOut:
    """Send a message without an event, to try the webhook."""
    row = webhook_for(session, user, webhook_id, "editor")
    return _sent(session, trial_message(row))


@router.get("/webhooks/{webhook_id}/deliveries")
def list_deliveries(
    webhook_id: UUID, session: SessionDep, user: CurrentUser, cursor: Cursor = None, limit: Limit = 100
) -> Page[DeliveryOut]:
    """What was sent to a webhook, or waits to be, newest first."""
    row = webhook_for(session, user, webhook_id, "viewer")
    return deliveries(session, Delivery.webhook_id == row.id, cursor, limit)


@router.post("/deliveries/{delivery_id}/replay", status_code=202)
def replay_delivery(delivery_id: UUID, session: SessionDep, user: CurrentUser) -> DeliveryOut:
    """Send a message again, under the same `webhook-id`: a receiver that has it already recognises it."""
    row = delivery_for(session, user, delivery_id, "editor")
    if row.state == "waiting":
        raise Conflict(f"the message has not been given up: it is sent again at {row.due_at.isoformat()}")
    if row.webhook_id is not None and not session.get_one(Webhook, row.webhook_id).active:
        raise Conflict("the webhook was deleted")
    copied = ("project_id", "monitor_id", "webhook_id", "recipient", "message_id", "event", "body")
    audit(session, user, "delivery.replay", "delivery", row.id, row.project_id)
    return _sent(session, Delivery(**{name: getattr(row, name) for name in copied}))


def _sent(session: Session, delivery: Delivery) -> DeliveryOut:
    session.add(delivery)
    session.flush()
    session.refresh(delivery)
    return DeliveryOut.model_validate(delivery)
