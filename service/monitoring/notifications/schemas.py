"""What a client sends and gets about webhooks and deliveries."""

from __future__ import annotations

from datetime import datetime
from typing import Literal
from uuid import UUID

from pydantic import ConfigDict, Field, field_validator
from pydantic_core import PydanticCustomError

from service.monitoring.notifications.addresses import AddressError, parse_url
from service.monitoring.notifications.messages import EVENTS, Event
from service.web import StrictModel, Text


class WebhookIn(StrictModel):
    """Where to post a project's events."""

    project: UUID
    url: Text = Field(max_length=2000, description="http:// or https://")
    events: list[Event] = Field(default_factory=lambda: list(EVENTS), min_length=1, description="default: all of them")

    @field_validator("url")
    @classmethod
    def _is_url(cls, url: str) -> str:
        try:
            parse_url(url)
        except AddressError as error:
            raise PydanticCustomError("url", "{why}", {"why": str(error)}) from None
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
    recipient: str | None = Field(description="mail address")
    monitor_id: UUID | None
    message_id: str = Field(description="the `webhook-id` that the receiver sees, the same in every attempt and replay")
    event: str
    body: str
    state: Literal["waiting", "delivered", "failed"]
    attempts: int
    due_at: datetime = Field(description="when it is sent next, while it waits")
    last_status: int | None
    last_error: str | None
    delivered_at: datetime | None
