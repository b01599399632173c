"""Sending what is in the outbox: claimed, sent outside any transaction, then noted; tried again
later where it failed.

A worker that dies between sending and noting sends the message again: receivers see at least one
copy, and recognise copies by their `webhook-id`, which a message keeps through all its attempts and
replays.

Each receiver is sent to on its own, one message at a time, and each project has a share: a receiver
that is slow delays nobody's messages but its own.

An attempt to deliver a message is a webhook's post, signed, or a mail. Every attempt ends within a
time that is fixed.

Signatures are those of Standard Webhooks (standardwebhooks.com), which has verifiers in most
languages:

    webhook-signature: v1,base64(HMAC-SHA256(secret, "{webhook-id}.{webhook-timestamp}.{body}"))
"""

import asyncio
import base64
import hashlib
import hmac
import random
import secrets
import smtplib
import ssl
import threading
import time
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from email.message import EmailMessage
from typing import Self
from uuid import UUID

import structlog
from anyio import to_thread
from sqlalchemy import Text, cast, func, select
from sqlalchemy.dialects.postgresql import distinct_on
from sqlalchemy.exc import SQLAlchemyError

from fecore import __version__
from service.db.engine import Sessions
from service.monitoring.notifications.addresses import AddressError, resolve
from service.monitoring.notifications.messages import as_mail
from service.monitoring.notifications.tables import Delivery, Webhook
from service.settings import Settings

log = structlog.stdlib.get_logger("modalbase.delivery")

STEP_SECONDS = 10.0  # to connect, or until the next bytes of an answer
TOTAL_SECONDS = 20.0  # of an attempt, whatever the receiver does
KEPT_CHARACTERS = 300  # of a receiver's answer
PREFIX = "whsec_"
ATTEMPTS = 8
GROWTH = 4.0  # of the pause between attempts
# after which a message that somebody took and did not note is sent again
CLAIM_SECONDS = 1.5 * TOTAL_SECONDS
LOOK_SECONDS = 1.0  # between two looks at what others have put into the outbox
AT_ONCE = 64  # attempts of a process
OF_A_PROJECT = 8  # of them
PATIENCE_SECONDS = 5.0  # that attempts under way get when the process ends


def new_secret() -> str:
    """A new secret of a webhook, 32 random bytes as Standard Webhooks writes them: `whsec_` and
    base64.
    """
    return PREFIX + base64.b64encode(secrets.token_bytes(32)).decode()


def sign(secret: str, message_id: str, timestamp: int, body: bytes) -> str:
    """The `webhook-signature` of a message by Standard Webhooks, version 1; see the module's
    docstring. The example is the specification's.

    >>> secret = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw"
    >>> sign(secret, "msg_p5jXN8AQM9LWM0D4loKWxJek", 1614265330, b'{"test": 2432232314}')
    'v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE='

    Args:
        secret: of the webhook.
        message_id: sent as `webhook-id`.
        timestamp: sent as `webhook-timestamp`, seconds since 1970.
        body: the bytes that are sent.
    """
    key = base64.b64decode(secret.removeprefix(PREFIX))
    signed = f"{message_id}.{timestamp}.".encode() + body
    return "v1," + base64.b64encode(hmac.new(key, signed, hashlib.sha256).digest()).decode()


@dataclass(frozen=True)
class Outcome:
    """What became of an attempt."""

    status: int | None  # HTTP status, where there was one
    error: str | None  # why it failed; None where it was delivered


async def deliver(delivery: Delivery, hook: Webhook | None, settings: Settings) -> Outcome:
    """Try once to bring a message to its receiver."""
    try:
        async with asyncio.timeout(TOTAL_SECONDS):
            return await (
                _mail(delivery, settings) if hook is None else post(delivery, hook, settings)
            )
    except TimeoutError:
        return Outcome(None, f"the receiver took longer than {TOTAL_SECONDS:g} s")


async def post(delivery: Delivery, hook: Webhook, settings: Settings) -> Outcome:
    """Post a message to a webhook, signed. The connection goes to the address that was checked;
    redirects are not followed, for they could lead anywhere.

    Args:
        delivery: the message.
        hook: where it goes, and the secret that signs it.
        settings: which networks and ports are allowed.

    Returns:
        What became of it; nothing is raised for a receiver that fails.
    """
    import httpx  # see `addresses`

    body, now = delivery.body.encode(), int(time.time())
    try:
        target = await to_thread.run_sync(resolve, hook.url, settings, abandon_on_cancel=True)
        headers = {
            "Host": target.host,
            "Content-Type": "application/json",
            "User-Agent": f"modalbase/{__version__}",
            "webhook-id": delivery.message_id,
            "webhook-timestamp": str(now),
            "webhook-signature": sign(hook.secret, delivery.message_id, now, body),
        }
        extensions = {"sni_hostname": target.name}
        async with (
            httpx.AsyncClient(
                trust_env=False, timeout=STEP_SECONDS, follow_redirects=False
            ) as client,
            client.stream(
                "POST", target.url, content=body, headers=headers, extensions=extensions
            ) as answer,
        ):
            if answer.is_success:
                return Outcome(answer.status_code, None)
            reply = await anext(answer.aiter_text(KEPT_CHARACTERS), "")
            return Outcome(
                answer.status_code,
                f"the receiver answered {answer.status_code}: {_printable(reply)}",
            )
    except (AddressError, httpx.HTTPError) as error:
        return Outcome(None, f"{type(error).__name__}: {error}"[:KEPT_CHARACTERS])


async def _mail(delivery: Delivery, settings: Settings) -> Outcome:
    if settings.smtp_host is None:
        return Outcome(None, "no SMTP server is set (MODALBASE_SMTP_HOST)")
    try:
        mail = as_mail(delivery, settings.smtp_from)
        await to_thread.run_sync(send_mail, mail, settings, abandon_on_cancel=True)
    except (OSError, smtplib.SMTPException) as error:
        return Outcome(None, f"{type(error).__name__}: {error}"[:KEPT_CHARACTERS])
    return Outcome(None, None)


def send_mail(mail: EmailMessage, settings: Settings) -> None:
    """Hand a mail to the operator's server.

    Raises:
        OSError, smtplib.SMTPException: it does not take it.
    """
    assert settings.smtp_host is not None
    context = ssl.create_default_context()
    if settings.smtp_security == "tls":
        server: smtplib.SMTP = smtplib.SMTP_SSL(
            settings.smtp_host, settings.smtp_port, timeout=STEP_SECONDS, context=context
        )
    else:
        server = smtplib.SMTP(settings.smtp_host, settings.smtp_port, timeout=STEP_SECONDS)
    with server:
        if settings.smtp_security == "starttls":
            server.starttls(context=context)
        if settings.smtp_user is not None:
            server.login(settings.smtp_user, settings.smtp_password or "")
        server.send_message(mail)


def _printable(text: str) -> str:
    return "".join(c if c.isprintable() else " " for c in text[:KEPT_CHARACTERS])


_RECEIVER = func.coalesce(cast(Delivery.webhook_id, Text), Delivery.recipient)


class Sender:
    """Sends what is due, in a thread of its own; a context manager. Any number may run."""

    def __init__(self, sessions: Sessions, settings: Settings) -> None:
        self._sessions, self._settings = sessions, settings
        self._loop = asyncio.new_event_loop()
        self._woken, self._ending = asyncio.Event(), False
        # receivers that are being sent to, and whose they are
        self._under_way: dict[str, UUID] = {}
        self._thread = threading.Thread(target=self._run, daemon=True, name="sender")

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_error: object) -> None:
        self._ending = True
        self.wake()
        self._thread.join()

    def wake(self) -> None:
        """Look at the outbox now, for there may be something to send."""
        with suppress(RuntimeError):  # the thread has ended
            self._loop.call_soon_threadsafe(self._woken.set)

    def _run(self) -> None:
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            runner.run(self._serve())

    async def _serve(self) -> None:
        attempts: set[asyncio.Task[None]] = set()
        while not self._ending:
            self._woken.clear()
            for delivery, hook in await self._claimed():
                attempt = asyncio.create_task(self._attempt(delivery, hook))
                attempts.add(attempt)
                attempt.add_done_callback(attempts.discard)
            with suppress(TimeoutError):
                async with asyncio.timeout(LOOK_SECONDS):
                    await self._woken.wait()
        if attempts:
            await asyncio.wait(attempts, timeout=PATIENCE_SECONDS)

    async def _claimed(self) -> list[tuple[Delivery, Webhook | None]]:
        try:
            claimed = await to_thread.run_sync(self._claim)
        except SQLAlchemyError as error:
            log.warning(
                "the database does not answer; trying again", error=str(error).split("\n", 1)[0]
            )
            return []
        for delivery, _ in claimed:
            self._under_way[_receiver(delivery)] = delivery.project_id
        return claimed

    def _claim(self) -> list[tuple[Delivery, Webhook | None]]:
        """Take the oldest due message of each receiver that is free: nobody else takes it while it
        is being sent.
        """
        with self._sessions.begin() as session:
            now = datetime.now(UTC)
            first = _RECEIVER.label("receiver"), Delivery.id, Delivery.project_id, Delivery.due_at
            heads = (
                select(*first)
                .ext(distinct_on(_RECEIVER))
                .where(
                    Delivery.state == "waiting",
                    Delivery.due_at <= now,
                    _RECEIVER.not_in(list(self._under_way)),
                )
                .order_by(_RECEIVER, Delivery.due_at, Delivery.id)
                .subquery()
            )
            rows = session.execute(
                select(heads.c.id, heads.c.project_id).order_by(heads.c.due_at)
            ).all()
            chosen = self._fair([(row.id, row.project_id) for row in rows])
            due = session.scalars(
                select(Delivery)
                .where(Delivery.id.in_(chosen), Delivery.state == "waiting", Delivery.due_at <= now)
                .with_for_update(skip_locked=True)
            ).all()
            for delivery in due:
                delivery.attempts += 1
                delivery.due_at = now + timedelta(seconds=CLAIM_SECONDS)
            hooks = [
                None if d.webhook_id is None else session.get_one(Webhook, d.webhook_id)
                for d in due
            ]
        return list(zip(due, hooks, strict=True))

    def _fair(self, heads: list[tuple[UUID, UUID]]) -> list[UUID]:
        """As many as may be sent now, no project more than its share."""
        busy, chosen = Counter(self._under_way.values()), list[UUID]()
        for key, project_id in heads:
            if busy[project_id] < OF_A_PROJECT and busy.total() < AT_ONCE:
                busy[project_id] += 1
                chosen.append(key)
        return chosen

    async def _attempt(self, delivery: Delivery, hook: Webhook | None) -> None:
        try:
            outcome = await deliver(delivery, hook, self._settings)
            again = await to_thread.run_sync(self._note, delivery, outcome)
            if again is not None:
                self._loop.call_later(again, self._woken.set)
        except SQLAlchemyError as error:
            log.warning(
                "a delivery could not be noted; it is sent again",
                error=str(error).split("\n", 1)[0],
            )
        except Exception:
            log.exception(
                "a delivery met an unexpected error; it is tried again", delivery=str(delivery.id)
            )
        finally:
            self._under_way.pop(_receiver(delivery), None)
            self._woken.set()

    def _note(self, delivery: Delivery, outcome: Outcome) -> float | None:
        """Write down what became of an attempt. Seconds until the next one, where there is one."""
        pause = None
        with self._sessions.begin() as session:
            row = session.get(Delivery, delivery.id, with_for_update=True)
            if row is None or row.attempts != delivery.attempts:
                # the webhook is gone, or somebody else took the message because this took too long
                return None
            row.last_status, row.last_error = outcome.status, outcome.error
            if outcome.error is None:
                row.state, row.delivered_at = "delivered", datetime.now(UTC)
            elif row.attempts >= ATTEMPTS:
                row.state = "failed"
            else:
                pause = (
                    self._settings.delivery_pause_seconds
                    * GROWTH ** (row.attempts - 1)
                    * random.uniform(1.0, 1.2)
                )
                row.due_at = datetime.now(UTC) + timedelta(seconds=pause)
        log.info(
            "delivery",
            delivery=str(row.id),
            event_type=row.event,
            state=row.state,
            attempt=row.attempts,
            error=outcome.error,
        )
        return pause


def _receiver(delivery: Delivery) -> str:
    return str(delivery.webhook_id) if delivery.webhook_id is not None else str(delivery.recipient)
