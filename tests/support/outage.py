"""A worker cut off from the database in the middle of its work: it comes back by itself, and no
result is there twice.

The worker reaches PostgreSQL through a proxy on loopback, which is taken away for a while:
connections break, new ones are refused. Once the worker is alone, so that its finished work waits
for the database; once another worker, which is not cut off, takes its work over, and what the first
one brings comes too late. The other worker then ends, and the first one gets work of its own.
"""

import select
import socket
import subprocess
import threading
from collections import Counter
from contextlib import closing, suppress
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path

from sqlalchemy import URL, make_url

from tests.support.floor import Floor, floor

LEASE_SECONDS = 3.0


class Proxy:
    """Passes connections from a port of loopback on to a Unix socket or another port, as long as
    it is not cut.

    Attributes:
        port: where it listens; the same after a cut, which is `close` and ended by `restore`.
    """

    def __init__(self, target: Path | int) -> None:
        self._target = target
        self.port = 0
        self._ends: list[socket.socket] = []
        self.restore()

    def restore(self) -> None:
        """Listen."""
        self._listener = socket.create_server(("127.0.0.1", self.port))
        self.port = self._listener.getsockname()[1]
        threading.Thread(target=self._accept, args=(self._listener,), daemon=True).start()

    def close(self) -> None:
        """Break every connection, and refuse new ones."""
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        for end in self._ends:
            with suppress(OSError):  # closed by itself
                end.shutdown(socket.SHUT_RDWR)
        self._ends.clear()

    def _accept(self, listener: socket.socket) -> None:
        with suppress(OSError):  # cut
            while True:
                near, _ = listener.accept()
                threading.Thread(target=self._pass_on, args=(near,), daemon=True).start()

    def _pass_on(self, near: socket.socket) -> None:
        of_a_port = isinstance(self._target, int)
        kind = socket.AF_INET if of_a_port else socket.AF_UNIX
        with suppress(OSError), near, socket.socket(kind) as far:
            far.connect(("127.0.0.1", self._target) if of_a_port else str(self._target))
            self._ends += [near, far]
            while True:
                for source in select.select([near, far], [], [])[0]:
                    data = source.recv(65536)
                    if not data:
                        return
                    (far if source is near else near).sendall(data)


@dataclass
class Outage:
    """What came of a cut."""

    # jobs, succeeded, results, doubled: what there is at the end
    jobs: int
    succeeded: int
    results: int
    doubled: int
    attempts: int  # begun, over all jobs
    works_again: bool  # the worker that was cut off has ended a job after it
    same_worker: bool  # it is still the process that was started


def outage(
    seconds: float, *, others: bool, jobs: int = 6, database_url: str | None = None
) -> Outage:
    """Cut a worker off while it works on jobs of a second each.

    Args:
        seconds: how long; with another worker from when that one has done all there is.
        others: another worker is there, which is not cut off.
        jobs: queued before the cut.
        database_url: of a migrated database on a server of this machine; one of its own by default.
    """
    with floor(database_url) as here, closing(Proxy(_socket(make_url(here.url)))) as proxy:
        database = make_url(here.url)
        through = database.set(host="127.0.0.1", port=proxy.port, query={}).render_as_string(
            hide_password=False
        )
        here.put("idle", jobs)
        worker = here.worker(through, job_lease_seconds=LEASE_SECONDS)
        here.wait(1)
        here.until(lambda: _computing(here, worker), "the second job's computation")
        proxy.close()
        if others:
            other = here.worker(job_lease_seconds=LEASE_SECONDS)
            here.wait(jobs)  # what the first worker held is taken over when its lease has lapsed
        since = here.now()
        here.until(lambda: here.now() - since > timedelta(seconds=seconds), "the end of the cut")
        restored = here.now()
        proxy.restore()
        if others:
            other.terminate()
            other.wait()
            here.put("idle", 2)  # for the worker that comes back, and nobody else
            jobs += 2
        here.wait(jobs)
        rows, results = here.jobs(), Counter(here.results())
        mine = [job for job in rows if f":{worker.pid}:" in (job.worker or "")]
        return Outage(
            jobs=jobs,
            succeeded=sum(job.state == "succeeded" for job in rows),
            results=results.total(),
            doubled=sum(count > 1 for count in results.values()),
            attempts=sum(job.attempt for job in rows),
            works_again=any(job.finished_at > restored for job in mine),
            same_worker=worker.poll() is None,
        )


def _socket(database: URL) -> Path:
    """The Unix socket of a database's server."""
    return Path(str(database.query["host"])) / ".s.PGSQL.5432"


def _computing(here: Floor, worker: subprocess.Popen[bytes]) -> bool:
    """Is the worker in the middle of a job?"""
    return any(
        job.state == "running"
        and f":{worker.pid}:" in (job.worker or "")
        and "step" in (job.stage or "")
        for job in here.jobs()
    )
