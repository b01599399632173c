"""A shop floor for tests and benchmarks of jobs: a real PostgreSQL, a real API, real workers that
can be killed.

Its own workers know the tests' kinds of job, among them the service's `update` with another
computation, whose result is an audit event, so that a result stored twice can be seen.
"""

import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from datetime import datetime
from pathlib import Path
from typing import Any
from uuid import UUID

import httpx
import psutil
from sqlalchemy import func, select

from service.app.supervisor import environment, listening_socket
from service.platform.access.keys import create_key, user_named
from service.platform.access.tables import AuditEvent
from service.platform.db.engine import make_engine, make_sessions
from service.platform.db.opening import embedded_server
from service.platform.db.schema import upgrade
from service.platform.queue.tables import Job
from service.platform.settings import Settings
from tests.support import working
from tests.support.job_kinds import ITEM
from tests.support.places import ROOT
from tests.support.rest import client_at
from tests.support.waiting import PATIENCE, until


class Floor:
    """A database, and processes on it.

    Attributes:
        url: the database.
        folder: of the embedded server.
        sessions: on the database.
        log: where the processes write.
    """

    def __init__(self, url: str, folder: Path, log: Path) -> None:
        self.url, self.folder, self.log = url, folder, log
        self.engine = make_engine(url, name="floor")
        self.sessions = make_sessions(self.engine)
        self.processes: list[subprocess.Popen[bytes]] = []
        self._servers = ExitStack()

    def worker(self, url: str | None = None, **settings: Any) -> subprocess.Popen[bytes]:
        """Start a worker of the tests' kinds."""
        command = [sys.executable, "-c", "from tests.support.job_kinds import work; work()"]
        return self._start(command, url, settings)

    def modalbase(self, *command: str, **settings: Any) -> subprocess.Popen[bytes]:
        """Start the command `modalbase`."""
        return self._start([sys.executable, "-m", "service", *command], None, settings)

    def api(self, port: int, **settings: Any) -> subprocess.Popen[bytes]:
        """Start an API process and wait until it answers."""
        process = self.modalbase("serve", port=port, **settings)
        with httpx.Client(trust_env=False) as client:

            def answers() -> bool:
                if process.poll() is not None:
                    raise RuntimeError(f"the API did not start: {self.log.read_text()[-2000:]}")
                try:
                    return client.get(f"http://127.0.0.1:{port}/readyz").is_success
                except httpx.TransportError:
                    return False

            self.until(answers, "the API's first answer")
        return process

    def client(self, user: str, **settings: Any) -> httpx.Client:
        """A client with a new key of an API that this starts."""
        with listening_socket("127.0.0.1", 0) as free:
            port = free.getsockname()[1]
        self.api(port, **settings)
        with self.sessions.begin() as session:
            key = create_key(session, user_named(session, user), user)[1]
        return client_at(f"http://127.0.0.1:{port}", key)

    def kill(self, process: subprocess.Popen[bytes]) -> None:
        """SIGKILL, without a word."""
        process.kill()
        process.wait()
        self.processes.remove(process)

    def crash_database(self) -> None:
        """End PostgreSQL at once, as a crash would, and start it again."""
        postmaster = psutil.Process(
            int((self.folder / "postgres" / "postmaster.pid").read_text().split("\n", 1)[0])
        )
        postmaster.send_signal(signal.SIGQUIT)
        postmaster.wait(PATIENCE)
        self._servers.enter_context(embedded_server(self.folder))

    def put(self, kind: str, count: int) -> list[UUID]:
        """Queue jobs of the tests' kinds in a new project."""
        return working.put(self.sessions, kind, count)

    def now(self) -> datetime:
        """The database's clock."""
        with self.sessions() as session:
            return session.execute(select(func.clock_timestamp())).scalar_one()

    def jobs(self) -> list[Job]:
        """Every job's row."""
        with self.sessions() as session:
            return list(session.scalars(select(Job).order_by(Job.id)))

    def results(self) -> list[UUID | None]:
        """The job of every stored result."""
        with self.sessions() as session:
            return list(
                session.scalars(select(AuditEvent.subject_id).where(AuditEvent.action == ITEM))
            )

    def wait(self, count: int) -> None:
        """Until so many jobs have ended."""
        self.until(
            lambda: sum(job.finished_at is not None for job in self.jobs()) >= count,
            f"the end of {count} jobs",
        )

    def until(self, condition: Callable[[], object], what: str) -> None:
        """Look often until it is so; the failure says what the processes wrote last."""
        until(condition, what, lambda: self.log.read_text()[-2000:], seldom=0.05)

    def close(self) -> None:
        """End every process."""
        for process in self.processes:
            process.terminate()
        for process in self.processes:
            try:
                process.wait(60)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        self.engine.dispose()
        self._servers.close()

    def _start(
        self, command: list[str], url: str | None, settings: dict[str, Any]
    ) -> subprocess.Popen[bytes]:
        given = environment(Settings(database_url=url or self.url, log_level="warning", **settings))
        # the tests too, whose folder is not taken from where a process is started
        given["PYTHONPATH"] = str(ROOT)
        with self.log.open("ab") as log:
            process = subprocess.Popen(
                command, cwd=ROOT, env=os.environ | given, stdout=log, stderr=log
            )
        self.processes.append(process)
        return process


@contextmanager
def floor(database_url: str | None = None) -> Iterator[Floor]:
    """A floor with a database of its own, which nothing outlives; or on one that is there, whose
    server goes on.
    """
    with tempfile.TemporaryDirectory(prefix="mb-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        folder.chmod(0o755)  # the server may run as a user of its own
        with embedded_server(folder) if database_url is None else nullcontext(database_url) as url:
            made = Floor(url, folder, folder / "log")
            if database_url is None:
                upgrade(made.engine)
            try:
                yield made
            finally:
                made.close()
