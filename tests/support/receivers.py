"""Receivers of messages on loopback: a webhook's HTTP server, and a server that takes mail."""

import base64
import hashlib
import hmac
import json
import socket
import ssl
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from aiosmtpd.controller import Controller
from aiosmtpd.smtp import AuthResult, Envelope, LoginPassword, Session

from tests.support.waiting import until

ACCOUNT = LoginPassword(b"modalbase", b"secret")
"""Who may send mail."""


class Receiver(ThreadingHTTPServer):
    """Keeps what was posted. Answers the statuses of `answers` one after the other, then 204."""

    def __init__(self) -> None:
        self.got: list[tuple[dict[str, str], bytes]] = []
        self.answers: list[int] = []
        super().__init__(("127.0.0.1", 0), _Handler)

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}/hook"

    def events(self) -> list[dict[str, Any]]:
        return [json.loads(body) for _, body in self.got]

    def wait_for(self, count: int) -> None:
        until(lambda: len(self.got) >= count, f"{count} messages", self.events)


class _Handler(BaseHTTPRequestHandler):
    def do_POST(self) -> None:
        server = self.server
        assert isinstance(server, Receiver)
        body = self.rfile.read(int(self.headers["Content-Length"]))
        server.got.append(({k.lower(): v for k, v in self.headers.items()}, body))
        status = server.answers.pop(0) if server.answers else 204
        self.send_response(status)
        if status == 302:
            self.send_header("Location", "/elsewhere")
        self.send_header("Content-Length", "0")
        self.end_headers()

    def log_message(self, *_: Any) -> None:
        pass


@contextmanager
def receiver() -> Iterator[Receiver]:
    server = Receiver()
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
    thread.start()
    try:
        yield server
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


@contextmanager
def dripping() -> Iterator[tuple[int, threading.Event]]:
    """A server that answers a line of its head now and then, and never comes to its end: its port,
    and who has come.
    """
    connected, end, lines = threading.Event(), threading.Event(), list[socket.socket]()

    def drip() -> None:
        while not end.wait(0.1):
            for line in lines:
                with suppress(OSError):
                    line.sendall(b"X-More: 1\r\n")

    def accept() -> None:
        with suppress(OSError):
            while True:
                line, _ = server.accept()
                line.sendall(b"HTTP/1.1 200 OK\r\n")
                lines.append(line)
                connected.set()

    with socket.create_server(("127.0.0.1", 0)) as server:
        threads = [threading.Thread(target=work, daemon=True) for work in (drip, accept)]
        for thread in threads:
            thread.start()
        yield server.getsockname()[1], connected
        end.set()
        server.shutdown(socket.SHUT_RDWR)
    for thread in threads:
        thread.join()
    for line in lines:
        line.close()


def signature_holds(secret: str, headers: dict[str, str], body: bytes) -> bool:
    """As a receiver checks it, by the text of Standard Webhooks."""
    key = base64.b64decode(secret.removeprefix("whsec_"))
    signed = f"{headers['webhook-id']}.{headers['webhook-timestamp']}.{body.decode()}"
    expected = base64.b64encode(hmac.new(key, signed.encode(), hashlib.sha256).digest()).decode()
    fresh = abs(time.time() - int(headers["webhook-timestamp"])) < 300
    return fresh and f"v1,{expected}" in headers["webhook-signature"].split(" ")


class MailServer(Controller):
    """aiosmtpd on a free port of loopback, which keeps the mails that it takes."""

    def __init__(self, account: LoginPassword | None, **options: Any) -> None:
        self.account, self.mails, self.senders = account, list[bytes](), list[LoginPassword]()
        super().__init__(self, hostname="127.0.0.1", port=0, authenticator=self._let_in, **options)

    async def handle_DATA(self, _server: Any, session: Session, envelope: Envelope) -> str:
        if self.account is not None and not session.authenticated:
            return "530 5.7.0 log in first"
        self.mails.append(envelope.original_content or b"")
        return "250 kept"

    def _let_in(
        self, _server: Any, _session: Any, _envelope: Any, _mechanism: str, who: LoginPassword
    ) -> AuthResult:
        self.senders.append(who)
        return AuthResult(success=who == self.account, handled=False)

    def _trigger_server(self) -> None:
        self.port = self.server.sockets[0].getsockname()[1]
        super()._trigger_server()


@contextmanager
def mail_server(
    security: str = "none", certificate: ssl.SSLContext | None = None
) -> Iterator[MailServer]:
    """One that talks plainly, or that takes mail of `ACCOUNT` alone: after STARTTLS, or over TLS
    from the first byte.
    """
    options: dict[str, Any] = {
        "none": {},
        "starttls": {"tls_context": certificate, "require_starttls": True},
        # it takes only STARTTLS for TLS
        "tls": {"ssl_context": certificate, "auth_require_tls": False},
    }[security]
    server = MailServer(None if security == "none" else ACCOUNT, **options)
    server.start()
    try:
        yield server
    finally:
        server.stop()
