"""The worker: takes tickets from the queue, runs each job in a child, drains when told to end.

The event loop never computes and never waits for the database: both happen in threads, the numbers in children.
"""

from __future__ import annotations

import asyncio
import os
import signal
import socket
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta
from pathlib import Path
from uuid import UUID, uuid4

import structlog
from procrastinate.job_context import JobContext
from sqlalchemy.exc import DBAPIError

from service.db.engine import Sessions, make_engine, make_sessions
from service.db.schema import require_head
from service.jobs import attempt as ends
from service.jobs import ledger
from service.jobs.attempt import Attempt
from service.jobs.child import Failure
from service.jobs.claims import claim
from service.jobs.kinds import JobKind
from service.jobs.process import dismiss_children, prepare_children
from service.jobs.queue import top_up
from service.jobs.tables import Job
from service.jobs.tickets import Tickets
from service.jobs.watch import Watch
from service.jobs.workspaces import worker_folder, workspace
from service.settings import Settings

log = structlog.stdlib.get_logger("modalbase.worker")


def run_worker(settings: Settings, kinds: Sequence[JobKind], queues: Iterable[str] | None = None) -> None:
    """Work until SIGTERM or SIGINT: then take no more jobs, give running ones `job_drain_seconds`, put the rest back.

    Args:
        settings: with `database_url`.
        kinds: every kind of job that this worker knows.
        queues: names of the queues to serve; all of them by default.

    Raises:
        SchemaError: the database's schema is not this version's.
    """
    if settings.database_url is None:
        raise ValueError("settings.database_url is not set; `service.db.opening.open_database` gives the embedded one")
    engine = make_engine(settings.database_url, pool_size=2 * settings.worker_concurrency + 2, name="modalbase worker")
    try:
        require_head(engine)
        prepare_children(kinds, settings.job_threads)
        with worker_folder() as folder:
            worker = _Worker(settings, kinds, make_sessions(engine), folder)
            asyncio.run(worker.run(list(queues) if queues else None))
    finally:
        dismiss_children()
        engine.dispose()


class _Worker:
    def __init__(self, settings: Settings, kinds: Sequence[JobKind], sessions: Sessions, folder: Path) -> None:
        self.settings, self.sessions, self.folder = settings, sessions, folder
        self.kinds = {kind.name: kind for kind in kinds}
        self.name = f"{socket.gethostname()}:{os.getpid()}:{uuid4().hex[:8]}"
        self.lease = timedelta(seconds=settings.job_lease_seconds)
        self.told_to_end = asyncio.Event()
        self.running: dict[UUID, Attempt] = {}
        self.slots = asyncio.Semaphore(settings.worker_concurrency)
        self.threads = ThreadPoolExecutor(settings.worker_concurrency, thread_name_prefix="job")
        self.work: set[asyncio.Future[None]] = set()

    async def run(self, queues: list[str] | None) -> None:
        for name in (signal.SIGTERM, signal.SIGINT):
            asyncio.get_running_loop().add_signal_handler(name, self._end)
        tickets = Tickets(self.settings, self.name, queues, self._job)
        with Watch(self.settings, self.sessions, self.name, self.running):
            taking = asyncio.create_task(tickets.serve(self.told_to_end))
            log.info("worker ready", worker=self.name, kinds=sorted(self.kinds), queues=queues or "all")
            ended = asyncio.create_task(self.told_to_end.wait())
            await asyncio.wait([taking, ended], return_when=asyncio.FIRST_COMPLETED)
            ended.cancel()
            taking.cancel()
            await asyncio.gather(taking, self._drain(), return_exceptions=True)
        self.threads.shutdown()
        if not self.told_to_end.is_set():
            taking.result()  # raises what ended it

    def _end(self) -> None:
        """A signal to end. Told twice, it does not wait for running jobs."""
        if self.told_to_end.is_set():
            self._put_back()
        self.told_to_end.set()

    def _put_back(self) -> None:
        for running in list(self.running.values()):
            running.stop(ends.DRAINED)

    async def _drain(self) -> None:
        """Let running jobs end; put back those that do not."""
        log.info("worker draining", jobs=len(self.running), seconds=self.settings.job_drain_seconds)
        if self.work:
            await asyncio.wait(self.work, timeout=self.settings.job_drain_seconds)
        self._put_back()
        if self.work:
            await asyncio.wait(self.work)
        log.info("worker drained", worker=self.name)

    async def _job(self, ticket: JobContext, job_id: str | None = None) -> None:
        """What a ticket of the queue starts: the job whose turn it is, which need not be the one on the ticket.

        The work goes on when this is cancelled, as it is when the queue is connected anew: `slots` limits the work.
        """
        del job_id
        await self.slots.acquire()
        if self.told_to_end.is_set():
            self.slots.release()
            return
        work = asyncio.get_running_loop().run_in_executor(self.threads, self._run, ticket.job.queue)
        self.work.add(work)
        work.add_done_callback(self._done)
        await asyncio.shield(work)

    def _done(self, work: asyncio.Future[None]) -> None:
        self.work.discard(work)
        self.slots.release()
        if (error := work.exception()) is not None:
            log.error("a job could not be begun", error=str(error), exc_info=error)

    def _run(self, queue: str) -> None:
        structlog.contextvars.clear_contextvars()
        limit = self.settings.project_job_limit
        with self.sessions.begin() as session:
            job = claim(session, queue, self.name, self.lease, limit)
        if job is None:
            return
        ids = {"job_id": str(job.id), "attempt": job.attempt, "kind": job.kind, "request_id": job.request_id}
        structlog.contextvars.bind_contextvars(**ids)
        kind = self.kinds.get(job.kind)
        if kind is None:
            failure = Failure("internal", "UnknownKind", f"this version's workers know no job of kind {job.kind!r}")
            with self.sessions.begin() as session:
                ledger.fail(session, job.id, job.attempt, failure)
        else:
            self._attempt(job, kind)
        if limit is not None:
            self._free(limit)

    def _attempt(self, job: Job, kind: JobKind) -> None:
        began = time.perf_counter()
        attempt = self.running[job.id] = Attempt(self.sessions, self.settings, kind, job.id, job.attempt)
        outcome = "abandoned"
        try:
            with workspace(self.folder) as folder:
                outcome = attempt.run(folder)
        finally:
            if self.running.get(job.id) is attempt:  # else it was tried again at this moment, here
                del self.running[job.id]
            log.info("job ended", outcome=outcome, seconds=round(time.perf_counter() - began, 3))

    def _free(self, limit: int) -> None:
        """A job that its project's limit held back may start now; its ticket is used up."""
        try:
            with self.sessions.begin() as session:
                top_up(session, limit)
        except DBAPIError as error:
            log.warning("the database does not answer; the reaper makes up for the tickets", error=str(error.orig))
