"""Messages: signed, sent again until they arrive, recognised by their id; never to addresses that
are not allowed.
"""

import base64
import json
import ssl
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from email import message_from_bytes, policy
from pathlib import Path
from typing import Any
from uuid import UUID

import httpx
import pytest
import trustme
from sqlalchemy import select

import service.app.composition  # noqa: F401  imports every table
from service.nouns.notifications import sender as attempts
from service.nouns.notifications.channels.channel import Receiver as To
from service.nouns.notifications.channels.webhook import new_secret, send
from service.nouns.notifications.messages import EVENTS
from service.nouns.notifications.sender import ATTEMPTS, Sender
from service.nouns.notifications.tables import Delivery, Webhook
from service.platform.access import Project
from service.platform.db.engine import Sessions
from service.platform.settings import Settings
from tests.support.receivers import (
    ACCOUNT,
    MailServer,
    Receiver,
    dripping,
    mail_server,
    receiver,
    signature_holds,
)
from tests.support.waiting import completed, until

LOOPBACK = Settings(
    webhook_networks="127.0.0.0/8", webhook_ports="1-65535", delivery_pause_seconds=0.05
)
ALARM = {
    "type": "alarm.raised",
    "timestamp": "2026-01-02T03:04:05+00:00",
    "data": {
        "structure": {"id": "s", "name": "bridge\nBcc: all"},
        "monitor": {"id": "m", "name": "stringer", "state": "alarm"},
        "alarm": {
            "parameter": "Ex",
            "unit": "Pa",
            "campaign_id": "c",
            "details": {
                "performed_at": "2026-01-01T00:00:00+00:00",
                "value": 32.1e9,
                "standard_deviation": 4e6,
                "baseline": 33.0e9,
                "baseline_sd": 2e6,
            },
        },
        "note": "by campaign c",
    },
}


@pytest.fixture
def hook() -> Iterator[Receiver]:
    with receiver() as server:
        yield server


@pytest.fixture
def project(api: httpx.Client) -> str:
    return str(api.post("projects", json={"name": "p"}).raise_for_status().json()["id"])


def made(api: httpx.Client, project: str, url: str, **fields: Any) -> dict[str, Any]:
    answer = api.post("webhooks", json={"project": project, "url": url, **fields})
    assert answer.status_code == 201, answer.text
    return dict(answer.json())


def planted(sessions: Sessions, url: str, **fields: Any) -> Delivery:
    """A waiting message in a database where no worker is."""
    with sessions.begin() as session:
        project = Project(name="p")
        session.add(project)
        session.flush()
        common = {
            "project_id": project.id,
            "message_id": "msg_1",
            "event": "alarm.raised",
            "body": json.dumps(ALARM),
        }
        fields["channel"] = "mail" if "recipient" in fields else "webhook"
        if "recipient" not in fields:
            row = Webhook(project_id=project.id, url=url, secret=new_secret(), events=[])
            session.add(row)
            session.flush()
            fields["webhook_id"] = row.id
        delivery = Delivery(**common, **fields)
        session.add(delivery)
    return delivery


def sent(
    sessions: Sessions, settings: Settings, far_enough: Callable[[Delivery], bool]
) -> Delivery:
    """The one message of the database, once the sender has brought it so far."""

    def look() -> Delivery:
        with sessions() as session:
            return session.scalars(select(Delivery)).one()

    def state() -> str:
        return f"{look().state} after {look().attempts} attempts: {look().last_error}"

    with Sender(sessions, settings):
        return until(
            lambda: delivery if far_enough(delivery := look()) else None, "the message", state
        )


def test_a_message_arrives_signed_and_once(api: httpx.Client, project: str, hook: Receiver) -> None:
    webhook = made(api, project, hook.url)
    assert webhook["events"] == list(EVENTS)
    assert len(base64.b64decode(webhook["secret"].removeprefix("whsec_"))) == 32
    (listed,) = api.get("webhooks").json()["items"]
    assert "secret" not in listed
    delivery = api.post(f"webhooks/{webhook['id']}/test").json()
    hook.wait_for(1)
    headers, body = hook.got[0]
    assert signature_holds(webhook["secret"], headers, body)
    assert not signature_holds(webhook["secret"], headers, body + b" ")
    assert headers["webhook-id"] == delivery["message_id"]
    assert headers["host"] == httpx.URL(hook.url).netloc.decode()
    assert json.loads(body) == {**json.loads(delivery["body"]), "type": "webhook.test"}


def test_what_fails_is_sent_again_under_the_same_id_and_can_be_replayed(
    api: httpx.Client, project: str, hook: Receiver
) -> None:
    hook.answers = [500, 302, 204]
    webhook = made(api, project, hook.url)
    api.post(f"webhooks/{webhook['id']}/test").raise_for_status()
    hook.wait_for(3)
    assert len({headers["webhook-id"] for headers, _ in hook.got}) == 1
    deliveries = f"webhooks/{webhook['id']}/deliveries"

    def latest() -> dict[str, Any]:
        return dict(api.get(deliveries).json()["items"][0])

    until(lambda: latest()["state"] != "waiting", "the note that the message was taken")
    assert (latest()["state"], latest()["attempts"], latest()["last_status"]) == (
        "delivered",
        3,
        204,
    )
    api.post(f"deliveries/{latest()['id']}/replay").raise_for_status()
    hook.wait_for(4)
    assert hook.got[3][0]["webhook-id"] == hook.got[0][0]["webhook-id"]
    assert len(api.get(deliveries).json()["items"]) == 2


def test_a_deleted_webhook_gets_nothing(api: httpx.Client, project: str, hook: Receiver) -> None:
    webhook = made(api, project, hook.url)
    assert api.delete(f"webhooks/{webhook['id']}").status_code == 204
    assert api.get("webhooks").json()["items"] == []
    assert api.post(f"webhooks/{webhook['id']}/test").status_code == 404


def test_a_receiver_that_never_takes_it_is_given_up(sessions: Sessions, hook: Receiver) -> None:
    hook.answers = [500] * 20
    planted(sessions, hook.url)
    fast = LOOPBACK.model_copy(update={"delivery_pause_seconds": 1e-6})
    delivery = sent(sessions, fast, lambda d: d.state != "waiting")
    assert (delivery.state, delivery.attempts, len(hook.got)) == ("failed", ATTEMPTS, ATTEMPTS)
    assert delivery.last_error == "the receiver answered 500: "


def test_a_receiver_that_drips_delays_nobody_else(
    sessions: Sessions, hook: Receiver, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that sends a line of its head now and then once held up another project's message for two
    minutes.
    """
    monkeypatch.setattr(attempts, "TOTAL_SECONDS", 4.0)
    with dripping() as (port, connected), Sender(sessions, LOOPBACK):
        slow = planted(sessions, f"http://127.0.0.1:{port}/").id
        assert connected.wait(60)
        planted(sessions, hook.url)
        hook.wait_for(1)
        hopeless = until(lambda: attempted(sessions, slow), "the end of the slow attempt")
    assert "took longer than 4 s" in hopeless


def attempted(sessions: Sessions, key: UUID) -> str | None:
    """Why the last attempt failed."""
    with sessions() as session:
        return session.get_one(Delivery, key).last_error


def test_a_project_of_many_slow_receivers_delays_no_other(
    sessions: Sessions, hook: Receiver
) -> None:
    with dripping() as (port, connected), Sender(sessions, LOOPBACK):
        with sessions.begin() as session:
            first = planted(sessions, f"http://127.0.0.1:{port}/")
            for i in range(100):
                row = Webhook(
                    project_id=first.project_id,
                    url=f"http://127.0.0.1:{port}/{i}",
                    secret=new_secret(),
                    events=[],
                )
                session.add(row)
                session.flush()
                common = {
                    "project_id": first.project_id,
                    "message_id": f"msg_{i}",
                    "event": "alarm.raised",
                    "body": "{}",
                    "channel": "webhook",
                }
                session.add(Delivery(**common, webhook_id=row.id))
        assert connected.wait(60)
        planted(sessions, hook.url)
        hook.wait_for(1)


def test_a_sender_that_died_is_made_up_for(sessions: Sessions, hook: Receiver) -> None:
    """It had claimed the message a minute ago and noted nothing."""
    planted(sessions, hook.url, attempts=1, due_at=datetime.now(UTC) - timedelta(seconds=1))
    assert sent(sessions, LOOPBACK, lambda d: d.state == "delivered").attempts == 2


def test_the_connection_goes_to_the_address_that_was_checked(
    sessions: Sessions, hook: Receiver, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A name that changes what it stands for between check and connection gains nothing."""
    answers = iter(["127.0.0.1", "192.0.2.1"])
    monkeypatch.setattr(
        "service.nouns.notifications.addresses.socket.getaddrinfo",
        lambda *_, **__: [(2, 1, 6, "", (next(answers), 0))],
    )
    port = httpx.URL(hook.url).port
    delivery = planted(sessions, f"http://receiver.example:{port}/hook")
    with sessions() as session:
        webhook = session.scalars(select(Webhook)).one()
    assert completed(send(delivery, To(webhook.url, webhook.secret), LOOPBACK)).error is None
    assert hook.got[0][0]["host"] == f"receiver.example:{port}"


@pytest.mark.parametrize("now", ["192.0.0.192", "10.1.2.3", "64:ff9b::7f00:1"])
def test_a_name_that_has_come_to_stand_for_a_special_address_gets_nothing(
    sessions: Sessions, monkeypatch: pytest.MonkeyPatch, now: str
) -> None:
    """It was public when the webhook was made; each attempt looks again."""
    monkeypatch.setattr(
        "service.nouns.notifications.addresses.socket.getaddrinfo",
        lambda *_, **__: [(2, 1, 6, "", (now, 0))],
    )
    planted(sessions, "http://receiver.example/hook")
    delivery = sent(sessions, Settings(), lambda d: d.last_error is not None)
    assert f"receiver.example leads to {now}" in (delivery.last_error or "")
    assert delivery.state == "waiting"


@pytest.fixture(scope="module")
def authority() -> trustme.CA:
    """A laboratory's own certificate authority."""
    return trustme.CA()


@pytest.fixture(scope="module")
def certificate(authority: trustme.CA) -> ssl.SSLContext:
    """What a mail server called localhost shows."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    authority.issue_cert("localhost").configure_cert(context)
    return context


@pytest.fixture
def trusted(authority: trustme.CA, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The authority is one that this machine knows."""
    authority.cert_pem.write_to_path(str(tmp_path / "ca.pem"))
    monkeypatch.setenv("SSL_CERT_FILE", str(tmp_path / "ca.pem"))


def mail_settings(
    server: MailServer, security: str, host: str = "localhost", password: str = "secret"
) -> Settings:
    return LOOPBACK.model_copy(
        update={
            "smtp_host": host,
            "smtp_port": server.port,
            "smtp_security": security,
            "smtp_user": None if security == "none" else "modalbase",
            "smtp_password": password,
            "smtp_from": "mb@lab.example",
        }
    )


@pytest.mark.usefixtures("trusted")
@pytest.mark.parametrize("security", ["none", "starttls", "tls"])
def test_mail(sessions: Sessions, certificate: ssl.SSLContext, security: str) -> None:
    with mail_server(security, certificate) as server:
        planted(sessions, "", recipient="engineer@lab.example")
        sent(sessions, mail_settings(server, security), lambda d: d.state == "delivered")
    assert server.senders == ([] if security == "none" else [ACCOUNT])
    (text,) = server.mails
    mail = message_from_bytes(text, policy=policy.default)
    assert mail["To"] == "engineer@lab.example"
    assert mail["Subject"] == "[modalbase] alarm.raised: Ex of bridge Bcc: all"
    assert mail["Message-ID"] == "<msg_1@modalbase>"
    assert mail["Bcc"] is None
    assert "value       3.21e+10 ± 4e+06 Pa" in mail.get_content()


@pytest.mark.parametrize("security", ["starttls", "tls"])
def test_a_mail_server_that_nobody_vouches_for_gets_nothing(
    sessions: Sessions, certificate: ssl.SSLContext, security: str
) -> None:
    with mail_server(security, certificate) as server:
        planted(sessions, "", recipient="engineer@lab.example")
        delivery = sent(
            sessions, mail_settings(server, security), lambda d: d.last_error is not None
        )
    assert "CERTIFICATE_VERIFY_FAILED" in (delivery.last_error or "")
    assert (delivery.state, server.mails, server.senders) == ("waiting", [], [])


@pytest.mark.usefixtures("trusted")
@pytest.mark.parametrize(
    ("server_security", "changes", "says"),
    [
        # the certificate is of another name
        ("tls", {"host": "127.0.0.1"}, "CERTIFICATE_VERIFY_FAILED"),
        ("starttls", {"password": "wrong"}, "SMTPAuthenticationError"),
        ("none", {}, "STARTTLS extension not supported"),  # and nothing is sent in the clear
    ],
)
def test_mail_that_cannot_be_handed_over_says_why(
    sessions: Sessions,
    certificate: ssl.SSLContext,
    server_security: str,
    changes: dict[str, str],
    says: str,
) -> None:
    security = "tls" if server_security == "tls" else "starttls"
    with mail_server(server_security, certificate) as server:
        planted(sessions, "", recipient="engineer@lab.example")
        delivery = sent(
            sessions, mail_settings(server, security, **changes), lambda d: d.last_error is not None
        )
    assert says in (delivery.last_error or "")
    assert (delivery.state, server.mails) == ("waiting", [])


def test_mail_without_a_server_says_so(sessions: Sessions) -> None:
    planted(sessions, "", recipient="engineer@lab.example")
    delivery = sent(sessions, LOOPBACK, lambda d: d.last_error is not None)
    assert delivery.last_error == "no SMTP server is set (MODALBASE_SMTP_HOST)"
