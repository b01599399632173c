"""Everything on one machine: embedded PostgreSQL, API process and worker process, started and ended
together.

    with LocalService(Settings(data=folder, port=0)) as service:
        key = service.new_key("me")
        httpx.get(service.url + "/api/v1/projects", headers={"Authorization": f"Bearer {key}"})

`modalbase up`, the demonstration and the tests all use this. The processes that it starts end with
it, also when it is
killed: their standard input is a pipe that closes with it. The API loads its libraries while
PostgreSQL starts, and waits
for a byte on that pipe before it looks for the database: a start that fails is reported once, here.
Each of them is in on the embedded server, so whoever leaves last stops PostgreSQL. What ends by
itself is started again by `tend`; the socket that the API listens on is kept here, so that requests
wait meanwhile instead of being refused.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from functools import cached_property, partial
from http import HTTPStatus
from http.client import HTTPConnection, HTTPException
from pathlib import Path
from selectors import EVENT_READ, DefaultSelector
from typing import TYPE_CHECKING, Self

from service.platform.settings import Settings

if TYPE_CHECKING:
    from sqlalchemy import Engine

PAUSES = (0.5, 1.0, 2.0, 5.0, 10.0, 30.0)
"""Seconds before each start; a part that ends once more after the last is given up."""
STEADY_SECONDS = 60.0  # what has run for so long has started well: its next end counts as the first


class RestartLimitError(Exception):
    """A part ended again and again; the message names it and how it ended."""


class NotStartedError(Exception):
    """This start failed; the next one may not."""


class Component:
    """One component of a service.

    Attributes:
        name: how messages call it.
    """

    def __init__(
        self,
        name: str,
        start: Callable[[], None],
        ended: Callable[[], str | None],
        pauses: Sequence[float] = PAUSES,
    ) -> None:
        """Watch a part that runs already.

        Args:
            name: how messages call it.
            start: starts it again; `NotStartedError` of it counts as one more end.
            ended: how it ended, such as `ended with status 1`; None while it runs.
            pauses: seconds before each start.
        """
        self.name, self._start, self._ended, self._pauses = name, start, ended, pauses
        self._began = time.monotonic()
        self._ends = 0
        self._again_at: float | None = None

    @property
    def runs(self) -> bool:
        """Whether it is neither ended nor waiting for its next start."""
        return self._again_at is None and self._ended() is None

    def tend(self) -> str | None:
        """Start it again where it ended and the pause is over; a line for the operator where
        something happened.

        Raises:
            RestartLimitError: it ended once more than there are pauses.
        """
        if self._again_at is not None and time.monotonic() >= self._again_at:
            return self._begin()
        if self._again_at is None and (how := self._ended()) is not None:
            return self._wait(how)
        return None

    def _begin(self) -> str:
        try:
            self._start()
        except NotStartedError as error:
            return self._wait(f"does not start: {error}")
        self._again_at, self._began = None, time.monotonic()
        return f"{self.name} runs again"

    def _wait(self, how: str) -> str:
        now = time.monotonic()
        if self._again_at is None and now - self._began > STEADY_SECONDS:
            self._ends = 0
        if self._ends == len(self._pauses):
            raise RestartLimitError(
                f"{self.name} {how}, {self._ends + 1} times in a row; it is not started again"
            )
        pause = self._pauses[self._ends]
        self._ends += 1
        self._again_at = now + pause
        return f"{self.name} {how}; it is started again in {pause:g} s"


def how_it_ended(process: subprocess.Popen[bytes]) -> str | None:
    """How a process ended, None while it runs."""
    status = process.poll()
    if status is None:
        return None
    if status == -signal.SIGKILL:
        return "was killed, perhaps for lack of memory"
    if status < 0:
        return f"was ended by {signal.Signals(-status).name}"
    return f"ended with status {status}"


# What reaches the database is imported where it is used, in which time the API loads too;
# SQLAlchemy by those alone who need it after the start.

START_SECONDS = 120.0
# the socket listens before the API answers: ask again, and see whether the API still runs
ANSWER_SECONDS = 2.0
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

    def __init__(
        self,
        settings: Settings,
        *,
        log_file: Path | None = None,
        worker: bool = True,
        pauses: Sequence[float] = PAUSES,
    ) -> None:
        """Prepare; nothing runs before `with`.

        Args:
            settings: with `port=0` any free port is taken.
            log_file: where the processes write their log; standard error by default.
            worker: start a worker too.
            pauses: seconds before what ended is started again, for each time that it ends in a row.
        """
        self.given, self.log_file, self.worker, self.pauses = settings, log_file, worker, pauses
        self.settings = settings
        self.url = ""
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self._parts: list[Component] = []
        self._open = False  # the database is
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        if os.name == "nt":
            raise StartError(
                "the service does not run on Windows itself; run it in WSL 2 or on a server"
            )
        with ExitStack() as stack:
            listener = stack.enter_context(listening_socket(self.given.host, self.given.port))
            self._port = listener.getsockname()[1]
            self.url = f"http://{_bracketed(self.given.host)}:{self._port}"
            log = (
                stack.enter_context(self.log_file.open("ab")).fileno()
                if self.log_file
                else STANDARD_ERROR
            )
            stack.callback(self._end_processes)  # where the database does not open
            self._run("api", "serve", log, listener.fileno())
            self._open_database(stack)
            stack.callback(self._end_processes)  # before the database is closed
            if self.worker:
                reading, writing = os.pipe()  # each worker writes to it when it takes jobs
                stack.callback(os.close, reading)
                stack.callback(os.close, writing)
                self._run("worker", "worker", log, writing)
                self._wait_until("the worker takes no jobs", partial(_has_come, reading))
            self._wait_until(f"the API does not answer at {self.url}", self._answers)
            self._stack = stack.pop_all()
        return self

    def _open_database(self, stack: ExitStack) -> None:
        """Have the database answer until the stack is closed, and let those who wait for that
        begin.
        """
        from service.platform.db.opening import open_database
        from service.platform.db.schema import require_fit, revision_at

        self.settings = stack.enter_context(open_database(self.given, migrate_embedded=True))
        require_fit(revision_at(self._address()))
        if self.given.database_url is None:
            self._parts.insert(
                0,
                Component(
                    "PostgreSQL", self._start_postgresql, self._postgresql_ended, self.pauses
                ),
            )
        self._open = True
        for process in self.processes.values():
            _let_begin(process)

    def _address(self) -> str:
        """Where psycopg finds the open database."""
        if self.given.database_url is None:
            return self.settings.database_url or ""
        from service.platform.db.engine import psycopg_url

        return psycopg_url(self.given.database_url)

    @cached_property
    def _engine(self) -> Engine:
        """The open database for operations; disposed of when the service ends."""
        from service.platform.db.engine import make_engine

        engine = make_engine(self.settings.database_url or "", pool_size=1)
        self._stack.callback(engine.dispose)
        return engine

    def __exit__(self, *_error: object) -> None:
        self._stack.close()

    def new_key(self, name: str, *, administrator: bool = False) -> str:
        """A new API key of the user of that name, who is made when absent, and made an
        administrator where wanted.
        """
        from service.platform.access.keys import create_key, user_named
        from service.platform.db.engine import make_sessions

        with make_sessions(self._engine).begin() as session:
            user = user_named(session, name)
            user.administrator |= administrator
            return create_key(session, user, name)[1]

    def has_keys(self) -> bool:
        """Is there any API key that opens something?"""
        import psycopg

        with psycopg.connect(self._address(), autocommit=True) as connection:
            row = connection.execute(
                "SELECT EXISTS (SELECT FROM api_keys WHERE revoked_at IS NULL)"
            ).fetchone()
        return row is not None and bool(row[0])

    def ended(self) -> str | None:
        """Name of a process that ended by itself, which none should; None while all run."""
        return next(
            (name for name, process in self.processes.items() if process.poll() is not None), None
        )

    def tend(self) -> list[str]:
        """Start again what ended by itself, after a pause; a line for the operator of each thing
        that happened.

        Raises:
            StartError: one of them ended again and again.
        """
        lines = []
        for part in self._parts:  # PostgreSQL first: without it the others cannot start
            try:
                lines += [line] if (line := part.tend()) else []
            except RestartLimitError as error:
                raise StartError(f"{error}; the log above says why") from error
            if part.name == "PostgreSQL" and not part.runs:
                break
        return lines

    def _start_postgresql(self) -> None:
        from service.platform.db.opening import keep_running
        from service.platform.db.postgres import PostgresError

        try:
            keep_running(self.given.data)
        except PostgresError as error:
            raise NotStartedError(str(error)) from error

    def _postgresql_ended(self) -> str | None:
        from service.platform.db.opening import runs

        return None if runs(self.given.data) else "ended by itself"

    def _run(self, name: str, command: str, log: int, descriptor: int) -> None:
        """Start a process that runs as long as the service does, and has this descriptor; see
        `service.app.attached`.
        """

        def start() -> None:
            if (old := self.processes.get(name)) is not None and old.stdin is not None:
                old.stdin.close()
            self.processes[name] = subprocess.Popen(
                # -P and its variable, for its children: no module of the folder that it is started
                # in is imported.
                [sys.executable, "-P", "-m", "service.app.attached", command, str(descriptor)],
                env=environment(self.given),
                stdin=subprocess.PIPE,
                stdout=log,
                stderr=log,
                pass_fds=(descriptor,),
                start_new_session=True,  # Ctrl-C is ours, and ends them through us
            )
            if self._open:
                _let_begin(self.processes[name])

        start()
        self._parts.append(
            Component(f"the {name}", start, lambda: how_it_ended(self.processes[name]), self.pauses)
        )

    def _wait_until(self, otherwise: str, ready: Callable[[], bool]) -> None:
        deadline = time.monotonic() + START_SECONDS
        while not ready():
            if name := self.ended():
                raise StartError(f"the {name} ended while starting; its log says why")
            if time.monotonic() > deadline:
                raise StartError(f"{otherwise} after {START_SECONDS:g} s")
            time.sleep(0.01)

    def _answers(self) -> bool:
        connection = HTTPConnection(self.given.host, self._port, timeout=ANSWER_SECONDS)
        try:
            connection.request("GET", "/readyz")
            return connection.getresponse().status == HTTPStatus.OK
        except (OSError, HTTPException):
            return False  # not listening yet
        finally:
            connection.close()

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


def _let_begin(process: subprocess.Popen[bytes]) -> None:
    """Let a process know that the database is open."""
    assert process.stdin is not None
    with suppress(BrokenPipeError):  # it has ended, which whoever waits for it sees
        os.write(process.stdin.fileno(), b"1")


def _has_come(pipe: int) -> bool:
    """Whether something has been written to a pipe."""
    with DefaultSelector() as selector:
        selector.register(pipe, EVENT_READ)
        return bool(selector.select(0))


def environment(settings: Settings) -> dict[str, str]:
    """The environment of a process with the same settings, which imports nothing from the folder it
    is started in.
    """
    values = settings.model_dump(mode="json", exclude_none=True)
    others = {
        name: value for name, value in os.environ.items() if not name.startswith("MODALBASE_")
    }
    ours = {f"MODALBASE_{name.upper()}": str(value) for name, value in values.items()}
    return others | ours | {"PYTHONSAFEPATH": "1"}


def listening_socket(host: str, port: int) -> socket.socket:
    """A socket that listens there.

    Raises:
        StartError: something else does already, or the address is not this machine's.
    """
    try:
        family, _, _, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        made = socket.create_server((str(address[0]), port), family=family, backlog=2048)
        # With its protocol, which asyncio asks of a connection before it sends small parts at once.
        return socket.socket(fileno=made.detach())
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno and error.errno > 0 else str(error)
        raise StartError(
            f"cannot listen on {host} port {port}: {reason}; choose another with --port"
        ) from error


def _bracketed(host: str) -> str:
    return f"[{host}]" if ":" in host else host
