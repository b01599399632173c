"""Messages are written to the outbox in the transaction of the event, one row for each receiver,
and sent afterwards.
"""

import json
from collections.abc import Sequence
from datetime import UTC, datetime
from email.message import EmailMessage
from typing import Any, Literal, get_args
from uuid import UUID, uuid4

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.monitoring.notifications.tables import Delivery, Webhook

Event = Literal[
    "alarm.raised", "alarm.acknowledged", "alarm.cleared", "alarm.withdrawn", "monitor.no_data"
]
EVENTS: tuple[Event, ...] = get_args(Event)
TEST = "webhook.test"


def announce(
    session: Session,
    event: str,
    data: dict[str, Any],
    *,
    project_id: UUID,
    monitor_id: UUID | None = None,
    mail_to: Sequence[str] = (),
) -> None:
    """Put an event in the outbox, for every webhook of the project that wants it and these mail
    addresses.

    Args:
        session: the transaction of what has happened.
        event: one of `EVENTS`.
        data: what the message says; `as_mail` says which fields a mail shows.
        project_id: whose webhooks are sent to.
        monitor_id: the monitor that the deliveries are listed with.
        mail_to: mail addresses.
    """
    hooks = session.scalars(
        select(Webhook).where(Webhook.project_id == project_id, Webhook.active).order_by(Webhook.id)
    ).all()
    receivers: list[dict[str, Any]] = [
        {"webhook_id": hook.id} for hook in hooks if event in hook.events
    ]
    receivers += [{"recipient": address} for address in mail_to]
    common = {"project_id": project_id, "monitor_id": monitor_id}
    session.add_all(_message(event, data, **common, **receiver) for receiver in receivers)


def trial_message(webhook: Webhook) -> Delivery:
    """A message without an event, which tries a webhook."""
    about = {"webhook_id": str(webhook.id)}
    return _message(TEST, about, project_id=webhook.project_id, webhook_id=webhook.id)


def _message(event: str, data: dict[str, Any], **receiver: Any) -> Delivery:
    """A message with a new id, by which a receiver recognises it when it comes again."""
    body = {"type": event, "timestamp": datetime.now(UTC).isoformat(), "data": data}
    return Delivery(**receiver, event=event, body=json.dumps(body), message_id=f"msg_{uuid4().hex}")


def as_mail(delivery: Delivery, sender: str) -> EmailMessage:
    """A message as mail, in plain text. Its Message-ID is the message's id, so that a mail that is
    sent twice is seen as one.

    Args:
        delivery: the message; its recipient is the mail's.
        sender: the mail's From.
    """
    message = json.loads(delivery.body)
    data = message["data"]
    mail = EmailMessage()
    mail["From"], mail["To"] = sender, delivery.recipient
    mail["Subject"] = _subject(delivery.event, data)
    mail["Message-ID"] = f"<{delivery.message_id}@modalbase>"
    mail["Date"] = datetime.fromisoformat(message["timestamp"])
    lines = [
        f"structure   {data['structure']['name']} ({data['structure']['id']})",
        f"monitor     {data['monitor']['name']} ({data['monitor']['id']})",
        f"state       {data['monitor']['state']}",
    ]
    if alarm := data.get("alarm"):
        details, unit = (
            alarm["details"],
            f" {alarm['unit']}" if alarm.get("unit") not in (None, "1") else "",
        )
        lines += [
            f"parameter   {alarm['parameter']}",
            f"campaign    {alarm['campaign_id']} of {details['performed_at']}",
            f"value       {details['value']:.6g} ± {details['standard_deviation']:.2g}{unit}",
            f"baseline    {details['baseline']:.6g} ± {details['baseline_sd']:.2g}{unit}",
            f"note        {data['note']}",
        ]
        if explained := details.get("explanations"):
            lines.append(f"causes      {explained['text']}")
    mail.set_content("\n".join(lines) + "\n")
    return mail


def _subject(event: str, data: dict[str, Any]) -> str:
    what = f"{data['alarm']['parameter']} of " if "alarm" in data else ""
    return " ".join(f"[modalbase] {event}: {what}{data['structure']['name']}".split())
