"""Clients that open a line and then say little."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator

import pytest
import uvicorn
from fastapi import FastAPI

from service.web import middleware


@pytest.fixture
def port(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """An application behind the server's protocol, which waits half a second for a head."""
    monkeypatch.setattr(middleware, "HEAD_SECONDS", 0.5)
    app = FastAPI()

    @app.get("/")
    def root() -> str:
        return "here"

    config = uvicorn.Config(app, http=middleware.PatientProtocol, log_config=None)
    with socket.create_server(("127.0.0.1", 0)) as listener:
        running = uvicorn.Server(config)
        thread = threading.Thread(target=running.run, kwargs={"sockets": [listener]})
        thread.start()
        yield listener.getsockname()[1]
        running.should_exit = True
        thread.join()


@pytest.mark.parametrize("sent", [b"", b"GET / HTT", b"GET / HTTP/1.1\r\nHost: x\r\n"])
def test_a_head_that_does_not_come_ends_the_connection(port: int, sent: bytes) -> None:
    with socket.create_connection(("127.0.0.1", port), timeout=30) as line:
        line.sendall(sent)
        assert line.recv(1000) == b""


def test_after_an_answer_too(port: int) -> None:
    with socket.create_connection(("127.0.0.1", port), timeout=30) as line:
        line.sendall(b"GET / HTTP/1.1\r\nHost: x\r\n\r\n")
        answer = b""
        while more := line.recv(1000):
            answer += more
            if answer.endswith(b'"here"'):
                break
        assert answer.startswith(b"HTTP/1.1 200"), "the line was closed before there was an answer"
        line.sendall(b"GET / HTTP/1.1\r\n")
        assert line.recv(1000) == b""
