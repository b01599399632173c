"""Messages: signed, sent again until they arrive, recognised by their id; never to addresses that are not allowed."""

import asyncio
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
from service.access import Project
from service.db.engine import Sessions
from service.monitoring.notifications import sender as attempts
from service.monitoring.notifications.addresses import AddressError, parse_url, resolve
from service.monitoring.notifications.messages import EVENTS
from service.monitoring.notifications.sender import ATTEMPTS, Sender, new_secret, post, sign
from service.monitoring.notifications.tables import Delivery, Webhook
from service.settings import Settings
from tests.support.receivers import ACCOUNT, MailServer, Receiver, dripping, mail_server, receiver, signature_holds
from tests.support.waiting import until

LOOPBACK = Settings(webhook_networks="127.0.0.0/8", webhook_ports="1-65535", delivery_pause_seconds=0.05)
ANYWHERE = Settings()
REGISTERED = [
    "0.255.255.255", "10.255.255.255", "100.64.0.0", "100.127.255.255", "127.255.255.255", "169.254.255.255", "172.16.0.0",
    "172.31.255.255", "192.0.0.0", "192.0.0.8", "192.0.0.9", "192.0.0.10", "192.0.0.170", "192.0.0.192", "192.0.0.255",
    "192.0.2.255", "192.31.196.1", "192.52.193.1", "192.88.99.1", "192.168.255.255", "192.175.48.1", "198.18.0.0",
    "198.19.255.255", "198.51.100.1", "203.0.113.255", "239.255.255.255", "240.0.0.1", "255.255.255.255",
    "[::ffff:1.1.1.1]", "[64:ff9b::1.1.1.1]", "[64:ff9b:1::101:101]", "[100::1]", "[100:0:0:1::1]", "[2001::1]",
    "[2001:1::1]", "[2001:1::2]", "[2001:2::1]", "[2001:3::1]", "[2001:4:112::1]", "[2001:10::1]", "[2001:20::1]",
    "[2001:30::1]", "[2001:1ff::1]", "[2001:db8::1]", "[2002:101:101::1]", "[2620:4f:8000::1]", "[3fff::1]", "[5f00::1]",
    "[fdff::1]", "[febf::1]", "[fec0::1]", "[ff02::1]", "[4000::1]", "[1fff::1]",
]  # fmt: skip
"""Of every network of the registries an address, ends of some, and what is no unicast or not assigned."""
PUBLIC = [
    "1.0.0.0", "9.255.255.255", "11.0.0.0", "100.63.255.255", "100.128.0.0", "126.255.255.255", "128.0.0.0", "169.253.255.255",
    "169.255.0.0", "172.15.255.255", "172.32.0.0", "192.0.1.0", "192.0.3.0", "192.167.255.255", "192.169.0.0",
    "198.17.255.255", "198.20.0.0", "223.255.255.255", "[2001:200::1]", "[2003::1]", "[2606:4700::1111]", "[2a00::1]",
    "[2620:4f:8001::1]", "[3ffe::1]",
]  # fmt: skip
"""What lies beside them."""
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
        common = {"project_id": project.id, "message_id": "msg_1", "event": "alarm.raised", "body": json.dumps(ALARM)}
        if "recipient" not in fields:
            row = Webhook(project_id=project.id, url=url, secret=new_secret(), events=[])
            session.add(row)
            session.flush()
            fields["webhook_id"] = row.id
        delivery = Delivery(**common, **fields)
        session.add(delivery)
    return delivery


def sent(sessions: Sessions, settings: Settings, far_enough: Callable[[Delivery], bool]) -> Delivery:
    """The one message of the database, once the sender has brought it so far."""

    def look() -> Delivery:
        with sessions() as session:
            return session.scalars(select(Delivery)).one()

    def state() -> str:
        return f"{look().state} after {look().attempts} attempts: {look().last_error}"

    with Sender(sessions, settings):
        return until(lambda: delivery if far_enough(delivery := look()) else None, "the message", state)


def test_signature_is_that_of_standard_webhooks() -> None:
    """The example that the specification's own libraries test themselves with."""
    signature = sign(
        "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw", "msg_p5jXN8AQM9LWM0D4loKWxJek", 1614265330, b'{"test": 2432232314}'
    )
    assert signature == "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE="


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
    assert (latest()["state"], latest()["attempts"], latest()["last_status"]) == ("delivered", 3, 204)
    api.post(f"deliveries/{latest()['id']}/replay").raise_for_status()
    hook.wait_for(4)
    assert hook.got[3][0]["webhook-id"] == hook.got[0][0]["webhook-id"]
    assert len(api.get(deliveries).json()["items"]) == 2


def test_a_deleted_webhook_gets_nothing(api: httpx.Client, project: str, hook: Receiver) -> None:
    webhook = made(api, project, hook.url)
    assert api.delete(f"webhooks/{webhook['id']}").status_code == 204
    assert api.get("webhooks").json()["items"] == []
    assert api.post(f"webhooks/{webhook['id']}/test").status_code == 404


@pytest.mark.parametrize(
    ("body", "pointer"),
    [
        ({"url": "ftp://example.org/"}, "/url"),
        ({"url": "http://user:word@example.org/"}, "/url"),
        ({"url": "http://10.0.0.1/"}, "/url"),
        ({"url": "http://[::1]/"}, "/url"),
        ({"url": "http://192.0.0.192/"}, "/url"),
        ({"url": "http://[64:ff9b::1.1.1.1]/"}, "/url"),
        ({"url": "http://no-such-name.invalid/"}, "/url"),
        ({"url": "http://127.0.0.1/", "events": []}, "/events"),
        ({"url": "http://127.0.0.1/", "events": ["alarm.silenced"]}, "/events/0"),
    ],
)
def test_a_webhook_that_makes_no_sense_is_refused(api: httpx.Client, project: str, body: Any, pointer: str) -> None:
    answer = api.post("webhooks", json={"project": project, **body})
    assert answer.status_code == 422, answer.text
    assert answer.json()["errors"][0]["pointer"] == pointer


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
    """One that sends a line of its head now and then once held up another project's message for two minutes."""
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


def test_a_project_of_many_slow_receivers_delays_no_other(sessions: Sessions, hook: Receiver) -> None:
    with dripping() as (port, connected), Sender(sessions, LOOPBACK):
        with sessions.begin() as session:
            first = planted(sessions, f"http://127.0.0.1:{port}/")
            for i in range(100):
                row = Webhook(
                    project_id=first.project_id, url=f"http://127.0.0.1:{port}/{i}", secret=new_secret(), events=[]
                )
                session.add(row)
                session.flush()
                common = {
                    "project_id": first.project_id,
                    "message_id": f"msg_{i}",
                    "event": "alarm.raised",
                    "body": "{}",
                }
                session.add(Delivery(**common, webhook_id=row.id))
        assert connected.wait(60)
        planted(sessions, hook.url)
        hook.wait_for(1)


def test_ports_are_the_operators() -> None:
    with pytest.raises(AddressError, match="port 22"):
        resolve("http://1.1.1.1:22/", ANYWHERE)
    some = Settings(webhook_ports="443, 8000-8999")
    assert resolve("http://1.1.1.1:8123/", some).url.port == 8123
    with pytest.raises(AddressError, match="port 80"):
        resolve("http://1.1.1.1/", some)
    with pytest.raises(ValueError, match="is no port"):
        Settings(webhook_ports="https")


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
        "service.monitoring.notifications.addresses.socket.getaddrinfo",
        lambda *_, **__: [(2, 1, 6, "", (next(answers), 0))],
    )
    port = httpx.URL(hook.url).port
    delivery = planted(sessions, f"http://receiver.example:{port}/hook")
    with sessions() as session:
        webhook = session.scalars(select(Webhook)).one()
    assert asyncio.run(post(delivery, webhook, LOOPBACK)).error is None
    assert hook.got[0][0]["host"] == f"receiver.example:{port}"


@pytest.mark.parametrize(
    "url",
    [
        "http://127.0.0.1/",
        "http://0.0.0.0/",
        "http://10.1.2.3/",
        "http://169.254.169.254/latest/meta-data",
        "http://[::1]/",
        "http://[::ffff:127.0.0.1]/",
        "http://[fe80::1]/",
        "http://224.0.0.1/",
        "http://[64:ff9b::7f00:1]/",
        "http://[64:ff9b::10.0.0.1]/",
        "http://[64:ff9b:1::7f00:1]/",
        "http://[2002:7f00:1::]/",
        "http://[2002:a9fe:a9fe::1]/",
        "http://[2001:0:7f00:1::1]/",
        "http://[2001:0:0808:0808::80ff:fffe]/",
        "http://[::7f00:1]/",
        "http://[::169.254.169.254]/",
        "http://[::ffff:0:127.0.0.1]/",
        "http://[2606:4700::5efe:10.0.0.1]/",
        "http://[2606:4700::200:5efe:10.0.0.1]/",
        "http://[::]/",
        "http://[fd00::1]/",
        "http://0x7f.1/",
        "http://2130706433/",
        "http://localhost/",
        *(f"http://{address}/" for address in REGISTERED),
    ],
)
def test_addresses_that_are_not_public_are_refused(url: str) -> None:
    with pytest.raises(AddressError, match="not a public address"):
        resolve(url, ANYWHERE)


def test_public_addresses_are_taken() -> None:
    for address in PUBLIC:
        assert resolve(f"http://{address}/", ANYWHERE).name in address


def test_what_an_allowed_network_carries_must_be_allowed_too() -> None:
    by_nat64 = Settings(webhook_networks="64:ff9b::/96")
    assert resolve("http://[64:ff9b::1.1.1.1]/", by_nat64).name == "64:ff9b::1.1.1.1"
    with pytest.raises(AddressError, match=r"leads to 10\.0\.0\.1 \(private\)"):
        resolve("http://[64:ff9b::10.0.0.1]/", by_nat64)
    both = Settings(webhook_networks="64:ff9b::/96, 10.0.0.0/8")
    assert resolve("http://[64:ff9b::10.0.0.1]/", both).name == "64:ff9b::10.0.0.1"


@pytest.mark.parametrize("now", ["192.0.0.192", "10.1.2.3", "64:ff9b::7f00:1"])
def test_a_name_that_has_come_to_stand_for_a_special_address_gets_nothing(
    sessions: Sessions, monkeypatch: pytest.MonkeyPatch, now: str
) -> None:
    """It was public when the webhook was made; each attempt looks again."""
    monkeypatch.setattr(
        "service.monitoring.notifications.addresses.socket.getaddrinfo", lambda *_, **__: [(2, 1, 6, "", (now, 0))]
    )
    planted(sessions, "http://receiver.example/hook")
    delivery = sent(sessions, Settings(), lambda d: d.last_error is not None)
    assert f"receiver.example leads to {now}" in (delivery.last_error or "")
    assert delivery.state == "waiting"


def test_an_operator_allows_networks() -> None:
    assert resolve("http://127.0.0.9:8080/x?y=1", LOOPBACK).url == "http://127.0.0.9:8080/x?y=1"
    assert resolve("https://1.1.1.1/", ANYWHERE).name == "1.1.1.1"
    with pytest.raises(ValueError, match=r"10\.0\.0\.1/8"):
        Settings(webhook_networks="10.0.0.1/8")
    with pytest.raises(AddressError):
        parse_url("http://")


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


def mail_settings(server: MailServer, security: str, host: str = "localhost", password: str = "secret") -> Settings:
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
        delivery = sent(sessions, mail_settings(server, security), lambda d: d.last_error is not None)
    assert "CERTIFICATE_VERIFY_FAILED" in (delivery.last_error or "")
    assert (delivery.state, server.mails, server.senders) == ("waiting", [], [])


@pytest.mark.usefixtures("trusted")
@pytest.mark.parametrize(
    ("server_security", "changes", "says"),
    [
        ("tls", {"host": "127.0.0.1"}, "CERTIFICATE_VERIFY_FAILED"),  # the certificate is of another name
        ("starttls", {"password": "wrong"}, "SMTPAuthenticationError"),
        ("none", {}, "STARTTLS extension not supported"),  # and nothing is sent in the clear
    ],
)
def test_mail_that_cannot_be_handed_over_says_why(
    sessions: Sessions, certificate: ssl.SSLContext, server_security: str, changes: dict[str, str], says: str
) -> None:
    asked = "tls" if server_security == "tls" else "starttls"
    with mail_server(server_security, certificate) as server:
        planted(sessions, "", recipient="engineer@lab.example")
        delivery = sent(sessions, mail_settings(server, asked, **changes), lambda d: d.last_error is not None)
    assert says in (delivery.last_error or "")
    assert (delivery.state, server.mails) == ("waiting", [])


def test_mail_without_a_server_says_so(sessions: Sessions) -> None:
    planted(sessions, "", recipient="engineer@lab.example")
    delivery = sent(sessions, LOOPBACK, lambda d: d.last_error is not None)
    assert delivery.last_error == "no SMTP server is set (MODALBASE_SMTP_HOST)"
