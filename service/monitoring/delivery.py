"""Sending what is in the outbox: claimed, sent outside any transaction, then noted; tried again later where it failed.

A worker that dies between sending and noting sends the message again: receivers see at least one copy, and tell copies by
their `webhook-id`, which a message keeps through all its attempts and replays. Signatures are those of Standard Webhooks
(standardwebhooks.com), which has verifiers in most languages:

    webhook-signature: v1,base64(HMAC-SHA256(secret, "{webhook-id}.{webhook-timestamp}.{body}"))
"""

from __future__ import annotations

import base64
import hashlib
import hmac
import random
import secrets
import smtplib
import ssl
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from email.message import EmailMessage
from types import TracebackType
from typing import Self

import httpx
import structlog
from sqlalchemy import select
from sqlalchemy.exc import SQLAlchemyError

from fecore import __version__
from service.db.engine import Sessions
from service.monitoring.addresses import AddressError, resolve
from service.monitoring.messages import as_mail
from service.monitoring.tables import Delivery, Webhook
from service.settings import Settings

ATTEMPTS = 8
GROWTH = 4.0  # of the pause between attempts
TIMEOUT_SECONDS = 10.0
CLAIM_SECONDS = 60.0  # after which a message that somebody took and did not note is sent again
LOOK_SECONDS = 1.0
SENDERS = 4  # at a time, so that one slow receiver does not hold up the others
KEPT_CHARACTERS = 300  # of a receiver's answer
PREFIX = "whsec_"

log = structlog.stdlib.get_logger("modalbase.delivery")


def new_secret() -> str:
    """A webhook's secret, as Standard Webhooks writes it."""
    return PREFIX + base64.b64encode(secrets.token_bytes(32)).decode()


def sign(secret: str, message_id: str, timestamp: int, body: bytes) -> str:
    """The `webhook-signature` of a message; see the module's docstring."""
    key = base64.b64decode(secret.removeprefix(PREFIX))
    signed = f"{message_id}.{timestamp}.".encode() + body
    return "v1," + base64.b64encode(hmac.new(key, signed, hashlib.sha256).digest()).decode()


@dataclass(frozen=True)
class Outcome:
    """What became of an attempt.

    Attributes:
        status: HTTP status, where there was one.
        error: why it failed; None where it was delivered.
    """

    status: int | None
    error: str | None


class Postman:
    """Sends what is due, in threads of its own; a context manager. Any number may run."""

    def __init__(self, sessions: Sessions, settings: Settings) -> None:
        self._sessions, self._settings = sessions, settings
        self._end, self._look = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True, name="postman")
        self._senders = ThreadPoolExecutor(SENDERS, thread_name_prefix="sender")

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end.set()
        self._look.set()
        self._thread.join()
        self._senders.shutdown(cancel_futures=True)

    def look(self) -> None:
        """There may be something to send."""
        self._look.set()

    def _run(self) -> None:
        while not self._end.is_set():
            self._look.clear()
            try:
                claimed = self._claim()
            except SQLAlchemyError as error:
                log.warning("the database does not answer; trying again", error=str(error).split("\n", 1)[0])
                claimed = []
            for future in [self._senders.submit(self._send, delivery, hook) for delivery, hook in claimed]:
                future.result()
            if not claimed:
                self._look.wait(min(LOOK_SECONDS, self._settings.delivery_pause_seconds))

    def _claim(self) -> list[tuple[Delivery, Webhook | None]]:
        """Take some due messages: nobody else takes them while they are being sent."""
        with self._sessions.begin() as session:
            now = datetime.now(UTC)
            due = session.scalars(
                select(Delivery)
                .where(Delivery.state == "waiting", Delivery.due_at <= now)
                .order_by(Delivery.due_at)
                .limit(SENDERS)
                .with_for_update(skip_locked=True)
            ).all()
            for delivery in due:
                delivery.attempts += 1
                delivery.due_at = now + timedelta(seconds=CLAIM_SECONDS)
            hooks = [None if d.webhook_id is None else session.get_one(Webhook, d.webhook_id) for d in due]
        return list(zip(due, hooks, strict=True))

    def _send(self, delivery: Delivery, hook: Webhook | None) -> None:
        try:
            outcome = self._mail(delivery) if hook is None else post(delivery, hook, self._settings)
            self._note(delivery, outcome)
        except SQLAlchemyError as error:
            log.warning("a delivery could not be noted; it is sent again", error=str(error).split("\n", 1)[0])
        except Exception:
            log.exception("a delivery met an unexpected error; it is tried again", delivery=str(delivery.id))

    def _mail(self, delivery: Delivery) -> Outcome:
        if self._settings.smtp_host is None:
            return Outcome(None, "no SMTP server is set (MODALBASE_SMTP_HOST)")
        try:
            send_mail(as_mail(delivery, self._settings.smtp_from), self._settings)
        except (OSError, smtplib.SMTPException) as error:
            return Outcome(None, f"{type(error).__name__}: {error}"[:KEPT_CHARACTERS])
        return Outcome(None, None)

    def _note(self, delivery: Delivery, outcome: Outcome) -> None:
        with self._sessions.begin() as session:
            row = session.get(Delivery, delivery.id, with_for_update=True)
            if row is None or row.attempts != delivery.attempts:
                return  # the webhook is gone, or somebody else took the message because this took too long
            row.last_status, row.last_error = outcome.status, outcome.error
            if outcome.error is None:
                row.state, row.delivered_at = "delivered", datetime.now(UTC)
            elif row.attempts >= ATTEMPTS:
                row.state = "failed"
            else:
                pause = self._settings.delivery_pause_seconds * GROWTH ** (row.attempts - 1)
                row.due_at = datetime.now(UTC) + timedelta(seconds=pause * random.uniform(1.0, 1.2))
        log.info(
            "delivery",
            delivery=str(row.id),
            event_type=row.event,
            state=row.state,
            attempt=row.attempts,
            error=outcome.error,
        )


def post(delivery: Delivery, hook: Webhook, settings: Settings) -> Outcome:
    """Post a message to a webhook, signed. Redirects are not followed: they could lead anywhere."""
    body, now = delivery.body.encode(), int(time.time())
    try:
        target = resolve(hook.url, settings.allowed_networks)
        headers = {
            "Host": target.host,
            "Content-Type": "application/json",
            "User-Agent": f"modalbase/{__version__}",
            "webhook-id": delivery.message_id,
            "webhook-timestamp": str(now),
            "webhook-signature": sign(hook.secret, delivery.message_id, now, body),
        }
        with (
            httpx.Client(trust_env=False, timeout=TIMEOUT_SECONDS, follow_redirects=False) as client,
            client.stream(
                "POST", target.url, content=body, headers=headers, extensions={"sni_hostname": target.name}
            ) as answer,
        ):
            if answer.is_success:
                return Outcome(answer.status_code, None)
            said = next(answer.iter_text(KEPT_CHARACTERS), "")
            return Outcome(answer.status_code, f"the receiver answered {answer.status_code}: {_printable(said)}")
    except (AddressError, httpx.HTTPError) as error:
        return Outcome(None, f"{type(error).__name__}: {error}"[:KEPT_CHARACTERS])


def send_mail(mail: EmailMessage, settings: Settings) -> None:
    """Hand a mail to the operator's server.

    Raises:
        OSError, smtplib.SMTPException: it does not take it.
    """
    assert settings.smtp_host is not None
    context = ssl.create_default_context()
    if settings.smtp_security == "tls":
        server: smtplib.SMTP = smtplib.SMTP_SSL(
            settings.smtp_host, settings.smtp_port, timeout=TIMEOUT_SECONDS, context=context
        )
    else:
        server = smtplib.SMTP(settings.smtp_host, settings.smtp_port, timeout=TIMEOUT_SECONDS)
    with server:
        if settings.smtp_security == "starttls":
            server.starttls(context=context)
        if settings.smtp_user is not None:
            server.login(settings.smtp_user, settings.smtp_password or "")
        server.send_message(mail)


def _printable(text: str) -> str:
    return "".join(c if c.isprintable() else " " for c in text[:KEPT_CHARACTERS])
