"""Tables of webhooks and of the outbox."""

from datetime import datetime
from typing import Any
from uuid import UUID

from sqlalchemy import CheckConstraint, ForeignKey, Index, func, text
from sqlalchemy.orm import Mapped, mapped_column

from service.platform.db.base import Base, Identified


class Webhook(Identified, Base):
    """Where a project's events are posted. The secret is kept as it is: signing needs it."""

    __tablename__ = "webhooks"
    __table_args__ = (Index(None, "project_id", "id"),)

    project_id: Mapped[UUID] = mapped_column(ForeignKey("projects.id", ondelete="CASCADE"))
    url: Mapped[str]
    secret: Mapped[str]
    events: Mapped[list[Any]]
    active: Mapped[bool] = mapped_column(server_default=text("true"))


class Delivery(Identified, Base):
    """One message to one receiver: written with its event, sent afterwards, as often as it takes.

    `message_id` is what the receiver knows it by; a replay has another row and the same message.
    """

    __tablename__ = "deliveries"
    __table_args__ = (
        Index(None, "webhook_id", "id"),
        Index(None, "monitor_id", "id"),
        Index("ix_deliveries_due", "due_at", postgresql_where=text("state = 'waiting'")),
        CheckConstraint("state IN ('waiting', 'delivered', 'failed')", "state"),
        CheckConstraint("(webhook_id IS NULL) = (recipient IS NOT NULL)", "receiver"),
    )

    project_id: Mapped[UUID] = mapped_column(ForeignKey("projects.id", ondelete="CASCADE"))
    monitor_id: Mapped[UUID | None] = mapped_column(ForeignKey("monitors.id", ondelete="CASCADE"))
    webhook_id: Mapped[UUID | None] = mapped_column(ForeignKey("webhooks.id", ondelete="CASCADE"))
    channel: Mapped[str]
    recipient: Mapped[str | None]
    message_id: Mapped[str]
    event: Mapped[str]
    body: Mapped[str]
    state: Mapped[str] = mapped_column(server_default="waiting")
    attempts: Mapped[int] = mapped_column(server_default="0")
    due_at: Mapped[datetime] = mapped_column(server_default=func.now())
    last_status: Mapped[int | None]
    last_error: Mapped[str | None]
    delivered_at: Mapped[datetime | None]
