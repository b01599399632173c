"""Mail of alarms, in plain text, by the operator's server."""

import json
import re
import smtplib
import ssl
from datetime import datetime
from email.message import EmailMessage

from anyio import to_thread

from service.nouns.notifications.addresses import AddressError
from service.nouns.notifications.channels.channel import (
    STEP_SECONDS,
    Channel,
    Outcome,
    Receiver,
)
from service.nouns.notifications.messages import in_words
from service.nouns.notifications.tables import Delivery
from service.platform.settings import Settings

_ADDRESS = re.compile(r"[^@\s,;<>]+@[^@\s,;<>]+\.[^@\s,;<>]+")


def check(address: str, settings: Settings) -> None:
    """Refuse what is no mail address, and all where no server takes mail.

    Raises:
        AddressError: it says which.
    """
    if not _ADDRESS.fullmatch(address):
        raise AddressError(f"{address} is no mail address")
    if settings.smtp_host is None:
        raise AddressError(
            "the operator has set no SMTP server (MODALBASE_SMTP_HOST); use a webhook"
        )


async def send(delivery: Delivery, receiver: Receiver, settings: Settings) -> Outcome:
    """Hand a message to the operator's server."""
    if settings.smtp_host is None:
        return Outcome(None, "no SMTP server is set (MODALBASE_SMTP_HOST)")
    try:
        mail = as_mail(delivery, receiver.address, settings.smtp_from)
        await to_thread.run_sync(send_mail, mail, settings, abandon_on_cancel=True)
    except (OSError, smtplib.SMTPException) as error:
        return Outcome.of(error)
    return Outcome(None, None)


def as_mail(delivery: Delivery, to: str, sender: str) -> EmailMessage:
    """A message as mail. Its Message-ID is the message's id, so that a mail that is sent twice is
    seen as one.

    Args:
        delivery: the message.
        to: address of its receiver.
        sender: the mail's From.
    """
    mail = EmailMessage()
    mail["From"], mail["To"] = sender, to
    mail["Subject"], text = in_words(delivery)
    mail["Message-ID"] = f"<{delivery.message_id}@modalbase>"
    mail["Date"] = datetime.fromisoformat(json.loads(delivery.body)["timestamp"])
    mail.set_content(text)
    return mail


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


MAIL = Channel("mail", check, send, "mail_to", "addresses that get mail of alarms")
