"""Messages are written to the outbox in the transaction of the event, one row for each receiver,
and sent afterwards.
"""

import json
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any, Literal, get_args
from uuid import UUID, uuid4

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.nouns.notifications.tables import Delivery, Webhook

Event = Literal[
    "alarm.raised", "alarm.acknowledged", "alarm.cleared", "alarm.withdrawn", "monitor.no_data"
]
EVENTS: tuple[Event, ...] = get_args(Event)
TEST, OF_WEBHOOKS = "webhook.test", "webhook"


def announce(
    session: Session,
    event: str,
    data: dict[str, Any],
    *,
    project_id: UUID,
    monitor_id: UUID | None = None,
    receivers: Mapping[str, Sequence[str]] | None = None,
) -> None:
    """Put an event in the outbox, for every webhook of the project that wants it and these
    receivers.

    Args:
        session: the transaction of what has happened.
        event: one of `EVENTS`.
        data: what the message says; `in_words` says which fields people read.
        project_id: whose webhooks are sent to.
        monitor_id: the monitor that the deliveries are listed with.
        receivers: addresses by the names of their channels.
    """
    hooks = session.scalars(
        select(Webhook).where(Webhook.project_id == project_id, Webhook.active).order_by(Webhook.id)
    ).all()
    each: list[dict[str, Any]] = [
        {"channel": OF_WEBHOOKS, "webhook_id": hook.id} for hook in hooks if event in hook.events
    ]
    each += [
        {"channel": channel, "recipient": address}
        for channel, addresses in (receivers or {}).items()
        for address in addresses
    ]
    common = {"project_id": project_id, "monitor_id": monitor_id}
    session.add_all(_message(event, data, **common, **receiver) for receiver in each)


def trial_message(webhook: Webhook) -> Delivery:
    """A message without an event, which tries a webhook."""
    about = {"webhook_id": str(webhook.id)}
    common = {"project_id": webhook.project_id, "channel": OF_WEBHOOKS}
    return _message(TEST, about, webhook_id=webhook.id, **common)


def _message(event: str, data: dict[str, Any], **receiver: Any) -> Delivery:
    """A message with a new id, by which a receiver recognises it when it comes again."""
    body = {"type": event, "timestamp": datetime.now(UTC).isoformat(), "data": data}
    return Delivery(**receiver, event=event, body=json.dumps(body), message_id=f"msg_{uuid4().hex}")


def in_words(delivery: Delivery) -> tuple[str, str]:
    """Subject and text of a message, for channels that people read."""
    data = json.loads(delivery.body)["data"]
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
    what = f"{data['alarm']['parameter']} of " if "alarm" in data else ""
    subject = f"[modalbase] {delivery.event}: {what}{data['structure']['name']}"
    return " ".join(subject.split()), "\n".join(lines) + "\n"
