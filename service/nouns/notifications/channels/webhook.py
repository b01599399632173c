"""Webhooks: messages are posted, signed as Standard Webhooks says (standardwebhooks.com), which has
verifiers in most languages:

    webhook-signature: v1,base64(HMAC-SHA256(secret, "{webhook-id}.{webhook-timestamp}.{body}"))
"""

import base64
import hashlib
import hmac
import secrets
import time

from anyio import to_thread

from fecore import __version__
from service.nouns.notifications.addresses import AddressError, resolve
from service.nouns.notifications.channels.channel import (
    KEPT_CHARACTERS,
    STEP_SECONDS,
    Channel,
    Outcome,
    Receiver,
)
from service.nouns.notifications.messages import OF_WEBHOOKS
from service.nouns.notifications.tables import Delivery
from service.platform.settings import Settings

PREFIX = "whsec_"


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


def check(url: str, settings: Settings) -> None:
    """Refuse a URL that the operator does not allow.

    Raises:
        AddressError: as of `resolve`.
    """
    resolve(url, settings)


async def send(delivery: Delivery, receiver: Receiver, settings: Settings) -> Outcome:
    """Post a message to a webhook, signed."""
    body, now = delivery.body.encode(), int(time.time())
    headers = {
        "Content-Type": "application/json",
        "webhook-id": delivery.message_id,
        "webhook-timestamp": str(now),
        "webhook-signature": sign(receiver.secret or "", delivery.message_id, now, body),
    }
    return await post(receiver.address, body, headers, settings)


async def post(url: str, body: bytes, headers: dict[str, str], settings: Settings) -> Outcome:
    """Post bytes. The connection goes to the address that was checked; redirects are not followed,
    for they could lead anywhere.

    Args:
        url: where to.
        body: what.
        headers: beside those of every message.
        settings: which networks and ports are allowed.

    Returns:
        What became of it; nothing is raised for a receiver that fails.
    """
    import httpx  # see `addresses`

    try:
        target = await to_thread.run_sync(resolve, url, settings, abandon_on_cancel=True)
        headers = {"Host": target.host, "User-Agent": f"modalbase/{__version__}", **headers}
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
        return Outcome.of(error)


def _printable(text: str) -> str:
    return "".join(c if c.isprintable() else " " for c in text[:KEPT_CHARACTERS])


WEBHOOK = Channel(OF_WEBHOOKS, check, send)
