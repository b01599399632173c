"""Routes of webhooks and of what was sent to them, with what a client sends and gets."""

from datetime import datetime
from functools import partial
from typing import Annotated, Literal
from uuid import UUID

from fastapi import Query, Response
from pydantic import ConfigDict, Field, field_validator
from sqlalchemy import ColumnElement, select
from sqlalchemy.orm import Session

from service.nouns.notifications.addresses import AddressError, parse_url
from service.nouns.notifications.channels.webhook import WEBHOOK, new_secret
from service.nouns.notifications.messages import EVENTS, Event, trial_message
from service.nouns.notifications.tables import Delivery, Webhook
from service.platform.access import (
    CurrentUser,
    Lookup,
    Role,
    SessionDep,
    SettingsDep,
    User,
    api_router,
    project_for,
    projects_of,
)
from service.platform.errors import Conflict, Invalid, NotFound
from service.platform.web import (
    Cursor,
    Id,
    Limit,
    LongList,
    Page,
    RequestModel,
    StrictModel,
    example,
    paged,
    wrong,
)
from service.platform.web.bodies import SOME_ID

router = api_router(tags=["webhooks"])


class WebhookIn(RequestModel):
    """Where to post a project's events."""

    model_config = example(
        project=SOME_ID, url="https://lab.example.org/hooks/modalbase", events=["alarm.raised"]
    )

    project: Id
    url: str = Field(max_length=2000, description="http:// or https://")
    events: LongList[Event] = Field(
        default_factory=lambda: list(EVENTS), min_length=1, description="default: all of them"
    )

    @field_validator("url")
    @classmethod
    def _is_url(cls, url: str) -> str:
        try:
            parse_url(url)
        except AddressError as error:
            raise wrong(str(error)) from None
        return url


class WebhookOut(StrictModel):
    """A webhook, without its secret."""

    model_config = ConfigDict(from_attributes=True, extra="ignore")

    id: UUID
    created_at: datetime
    project_id: UUID
    url: str
    events: list[str]


class NewWebhookOut(WebhookOut):
    """A webhook just made; `secret` is shown this once."""

    secret: str


class DeliveryOut(StrictModel):
    """A message to a receiver, and how far it got."""

    model_config = ConfigDict(from_attributes=True, extra="ignore")

    id: UUID
    created_at: datetime
    webhook_id: UUID | None
    recipient: str | None = Field(description="address in its channel, such as mail")
    monitor_id: UUID | None
    message_id: str = Field(
        description="the `webhook-id` that the receiver sees, the same in every attempt and replay"
    )
    event: str
    body: str
    state: Literal["waiting", "delivered", "failed"]
    attempts: int
    due_at: datetime = Field(description="when it is sent next, while it waits")
    last_status: int | None
    last_error: str | None
    delivered_at: datetime | None


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


def deliveries(
    session: Session, condition: ColumnElement[bool], cursor: Cursor, limit: Limit
) -> Page[DeliveryOut]:
    """A page of the deliveries that fulfil a condition, such as `Delivery.webhook_id == id`; newest
    first.

    Raises:
        Invalid: the cursor is not one of this list.
    """
    shown = partial(map, DeliveryOut.model_validate)
    return paged(
        session, select(Delivery).where(condition), cursor, limit, shown, newest_first=True
    )


def deliveries_of_monitor(
    session: Session, monitor_id: UUID, cursor: Cursor, limit: Limit
) -> Page[DeliveryOut]:
    """What was sent about a monitor, or waits to be, as `deliveries`."""
    return deliveries(session, Delivery.monitor_id == monitor_id, cursor, limit)


@router.post("/webhooks", status_code=201)
def create_webhook(
    body: WebhookIn,
    session: SessionDep,
    user: CurrentUser,
    settings: SettingsDep,
    response: Response,
) -> NewWebhookOut:
    """Have a project's events posted to a URL, signed as Standard Webhooks says. The answer alone
    shows the secret.
    """
    project = project_for(session, user, body.project, "owner")
    try:
        WEBHOOK.check(body.url, settings)
    except AddressError as error:
        raise Invalid("/url", str(error)) from None
    row = Webhook(project_id=project.id, url=body.url, secret=new_secret(), events=body.events)
    session.add(row)
    session.flush()
    session.refresh(row)
    _any_webhook_for.note(session, user, row, "create", url=body.url)
    response.headers["Location"] = f"/api/v1/webhooks/{row.id}"
    response.headers["Cache-Control"] = "no-store"
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
    return paged(session, query, cursor, limit, partial(map, WebhookOut.model_validate))


@router.delete("/webhooks/{webhook_id}", status_code=204)
def delete_webhook(webhook_id: UUID, session: SessionDep, user: CurrentUser) -> None:
    """Post nothing there any more; what waits is given up, what was sent stays listed with the
    monitor.
    """
    row = webhook_for(session, user, webhook_id, "owner")
    row.active = False
    waiting = (
        select(Delivery)
        .where(Delivery.webhook_id == row.id, Delivery.state == "waiting")
        .with_for_update()
    )
    for delivery in session.scalars(waiting):
        delivery.state, delivery.last_error = "failed", "the webhook was deleted"
    _any_webhook_for.note(session, user, row, "delete")


@router.post("/webhooks/{webhook_id}/test", status_code=202)
def test_webhook(webhook_id: UUID, session: SessionDep, user: CurrentUser) -> DeliveryOut:
    """Send a message without an event, to try the webhook."""
    row = webhook_for(session, user, webhook_id, "editor")
    return _sent(session, trial_message(row))


@router.get("/webhooks/{webhook_id}/deliveries")
def list_deliveries(
    webhook_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    cursor: Cursor = None,
    limit: Limit = 100,
) -> Page[DeliveryOut]:
    """What was sent to a webhook, or waits to be, newest first."""
    row = webhook_for(session, user, webhook_id, "viewer")
    return deliveries(session, Delivery.webhook_id == row.id, cursor, limit)


@router.post("/deliveries/{delivery_id}/replay", status_code=202)
def replay_delivery(delivery_id: UUID, session: SessionDep, user: CurrentUser) -> DeliveryOut:
    """Send a message again, under the same `webhook-id`: a receiver that has it already recognises
    it.
    """
    row = delivery_for(session, user, delivery_id, "editor")
    if row.state == "waiting":
        raise Conflict(
            f"the message has not been given up: it is sent again at {row.due_at.isoformat()}"
        )
    if row.webhook_id is not None and not session.get_one(Webhook, row.webhook_id).active:
        raise Conflict("the webhook was deleted")
    copied = (
        *("project_id", "monitor_id", "channel", "webhook_id", "recipient"),
        *("message_id", "event", "body"),
    )
    delivery_for.note(session, user, row, "replay")
    return _sent(session, Delivery(**{name: getattr(row, name) for name in copied}))


def _sent(session: Session, delivery: Delivery) -> DeliveryOut:
    session.add(delivery)
    session.flush()
    session.refresh(delivery)
    return DeliveryOut.model_validate(delivery)
