"""Everything on one machine: embedded PostgreSQL, API process and worker process, started and ended together.

    with LocalService(Settings(data=folder, port=0)) as service:
        key = service.new_key("me")
        httpx.get(service.url + "/api/v1/projects", headers={"Authorization": f"Bearer {key}"})

`modalbase up`, the demonstration and the tests all use this. The processes that it starts end with it, also when it is
killed: their standard input is a pipe that closes with it. Each of them is in on the embedded server, so whoever
leaves last stops PostgreSQL.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Self

import httpx
from sqlalchemy import func, select

from service.access.keys import create_key, user_named
from service.access.tables import ApiKey
from service.db.embedded import keep_running
from service.db.engine import make_engine, make_sessions
from service.db.opening import open_database
from service.db.schema import require_head
from service.settings import Settings

START_SECONDS = 60.0
ANSWER_SECONDS = 2.0  # the socket listens before the API answers: ask again, and see whether the API still runs
STOP_SECONDS = 10.0
STANDARD_ERROR = 2


class StartError(Exception):
    """The service could not be started; the message says why and what to do."""


class LocalService:
    """A running modalbase; a context manager.

    Attributes:
        url: where the API is, such as `http://127.0.0.1:8000`.
        processes: the API and the worker, by name.
    """

    def __init__(self, settings: Settings, *, log_file: Path | None = None, worker: bool = True) -> None:
        """Prepare; nothing runs before `with`.

        Args:
            settings: with `port=0` any free port is taken.
            log_file: where the processes write their log; standard error by default.
            worker: start a worker too.
        """
        self.given, self.log_file, self.worker = settings, log_file, worker
        self.settings = settings
        self.url = ""
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self._stack = ExitStack()
        self._lost_at: float | None = None  # since when PostgreSQL does not start again

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            listener = stack.enter_context(listening_socket(self.given.host, self.given.port))
            self.settings = stack.enter_context(open_database(self.given, migrate_embedded=True))
            self._engine = make_engine(self.settings.database_url or "", pool_size=1)
            stack.callback(self._engine.dispose)
            require_head(self._engine)
            port = listener.getsockname()[1]
            self.url = f"http://{_bracketed(self.given.host)}:{port}"
            log = stack.enter_context(self.log_file.open("ab")).fileno() if self.log_file else STANDARD_ERROR
            stack.callback(self._end_processes)
            self._spawn("api", ["serve", "--listener", str(listener.fileno())], log, listener.fileno())
            if self.worker:
                self._spawn("worker", ["worker"], log)
            self._wait_until_ready()
            listener.close()
            self._stack = stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.close()

    def new_key(self, name: str) -> str:
        """A new API key of the user of that name, who is made when absent."""
        with make_sessions(self._engine).begin() as session:
            return create_key(session, user_named(session, name), name)[1]

    def has_keys(self) -> bool:
        """Is there any API key that opens something?"""
        with make_sessions(self._engine)() as session:
            return bool(session.scalar(select(func.count()).where(ApiKey.revoked_at.is_(None)).select_from(ApiKey)))

    def ended(self) -> str | None:
        """Name of a process that ended by itself, which none should; None while all run."""
        return next((name for name, process in self.processes.items() if process.poll() is not None), None)

    def keep_database(self) -> bool:
        """Start the embedded PostgreSQL again where it died by itself, for lack of memory say. Whether it had.

        Raises:
            StartError: it has not come back for a minute.
        """
        if self.given.database_url is not None:
            return False
        try:
            restarted = keep_running(self.given.data)
        except subprocess.SubprocessError as error:
            self._lost_at = self._lost_at or time.monotonic()
            if time.monotonic() - self._lost_at > START_SECONDS:
                raise StartError(f"PostgreSQL died and does not start again: {error}") from error
            return False
        self._lost_at = None
        return restarted

    def _spawn(self, name: str, command: list[str], log: int, *fds: int) -> None:
        self.processes[name] = subprocess.Popen(
            [sys.executable, "-m", "service", *command, "--attached"],
            env=os.environ | environment(self.given),
            stdin=subprocess.PIPE,
            stdout=log,
            stderr=log,
            pass_fds=fds,
            start_new_session=True,  # Ctrl-C is ours; they are told by us
        )

    def _wait_until_ready(self) -> None:
        deadline = time.monotonic() + START_SECONDS
        with httpx.Client(trust_env=False, timeout=ANSWER_SECONDS) as client:
            while time.monotonic() < deadline:
                if name := self.ended():
                    raise StartError(f"the {name} ended while starting; its log says why")
                try:
                    if client.get(f"{self.url}/readyz").is_success:
                        return
                except httpx.TransportError:
                    pass  # not listening yet
                time.sleep(0.05)
        raise StartError(f"the API did not answer at {self.url} within {START_SECONDS:g} s")

    def _end_processes(self) -> None:
        for process in self.processes.values():
            process.terminate()
        deadline = time.monotonic() + self.given.job_drain_seconds + STOP_SECONDS
        for process in self.processes.values():
            try:
                process.wait(max(0.0, deadline - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            if process.stdin is not None:
                process.stdin.close()
        self.processes.clear()


def environment(settings: Settings) -> dict[str, str]:
    """The environment variables that give another process the same settings."""
    values = settings.model_dump(mode="json", exclude_none=True)
    return {f"MODALBASE_{name.upper()}": str(value) for name, value in values.items()}


def listening_socket(host: str, port: int) -> socket.socket:
    """A socket that listens there.

    Raises:
        StartError: something else does already, or the address is not this machine's.
    """
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
        return socket.create_server((str(address[0]), port), family=family, backlog=2048)
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno and error.errno > 0 else str(error)
        raise StartError(f"cannot listen on {host} port {port}: {reason}; choose another with --port") from error


def _bracketed(host: str) -> str:
    return f"[{host}]" if ":" in host else host
