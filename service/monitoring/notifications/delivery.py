"""One attempt to deliver a message: a webhook's post, signed, or a mail. Every attempt ends within a time that is fixed.

Signatures are those of Standard Webhooks (standardwebhooks.com), which has verifiers in most languages:

    webhook-signature: v1,base64(HMAC-SHA256(secret, "{webhook-id}.{webhook-timestamp}.{body}"))
"""

from __future__ import annotations

import asyncio
import base64
import hashlib
import hmac
import secrets
import smtplib
import ssl
import time
from dataclasses import dataclass
from email.message import EmailMessage

from anyio import to_thread

from fecore import __version__
from service.monitoring.notifications.addresses import AddressError, destinations, resolve
from service.monitoring.notifications.messages import as_mail
from service.monitoring.notifications.tables import Delivery, Webhook
from service.settings import Settings

STEP_SECONDS = 10.0  # to connect, or until the next bytes of an answer
TOTAL_SECONDS = 20.0  # of an attempt, whatever the receiver does
KEPT_CHARACTERS = 300  # of a receiver's answer
PREFIX = "whsec_"


def new_secret() -> str:
    """A new secret of a webhook, 32 random bytes as Standard Webhooks writes them: `whsec_` and base64."""
    return PREFIX + base64.b64encode(secrets.token_bytes(32)).decode()


def sign(secret: str, message_id: str, timestamp: int, body: bytes) -> str:
    """The `webhook-signature` of a message by Standard Webhooks, version 1; see the module's docstring. The example is
    the specification's.

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
    """What became of an attempt.

    Attributes:
        status: HTTP status, where there was one.
        error: why it failed; None where it was delivered.
    """

    status: int | None
    error: str | None


async def deliver(delivery: Delivery, hook: Webhook | None, settings: Settings) -> Outcome:
    """Try once to bring a message to its receiver."""
    try:
        async with asyncio.timeout(TOTAL_SECONDS):
            return await (_mail(delivery, settings) if hook is None else post(delivery, hook, settings))
    except TimeoutError:
        return Outcome(None, f"the receiver took longer than {TOTAL_SECONDS:g} s")


async def post(delivery: Delivery, hook: Webhook, settings: Settings) -> Outcome:
    """Post a message to a webhook, signed. The connection goes to the address that was checked; redirects are not
    followed, for they could lead anywhere.

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
        target = await to_thread.run_sync(resolve, hook.url, destinations(settings), abandon_on_cancel=True)
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
            httpx.AsyncClient(trust_env=False, timeout=STEP_SECONDS, follow_redirects=False) as client,
            client.stream("POST", target.url, content=body, headers=headers, extensions=extensions) as answer,
        ):
            if answer.is_success:
                return Outcome(answer.status_code, None)
            said = await anext(answer.aiter_text(KEPT_CHARACTERS), "")
            return Outcome(answer.status_code, f"the receiver answered {answer.status_code}: {_printable(said)}")
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
