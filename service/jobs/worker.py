"""The worker: takes job ids from the queue, runs each in a child, keeps leases alive, drains when told to end.

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
from uuid import UUID, uuid4

import structlog
from procrastinate import App, PsycopgConnector
from procrastinate.app import WorkerOptions
from procrastinate.exceptions import ConnectorException
from sqlalchemy.exc import SQLAlchemyError

from service.db.engine import Sessions, make_engine, make_sessions, psycopg_url
from service.db.schema import require_head
from service.jobs import attempt as ends
from service.jobs import ledger
from service.jobs.attempt import Attempt
from service.jobs.child import Failure
from service.jobs.kinds import JobKind
from service.jobs.process import dismiss_children, prepare_children
from service.jobs.queue import TASK
from service.jobs.reaper import reap
from service.settings import Settings

TICK_SECONDS = 0.25
RECONNECT_SECONDS = 1.0
POLL_SECONDS = 5.0  # for dispatches whose notification was lost with a connection

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
        prepare_children(kinds)
        asyncio.run(_Worker(settings, kinds, make_sessions(engine)).run(list(queues) if queues else None))
    finally:
        dismiss_children()
        engine.dispose()


class _Worker:
    def __init__(self, settings: Settings, kinds: Sequence[JobKind], sessions: Sessions) -> None:
        self.settings, self.sessions = settings, sessions
        self.kinds = {kind.name: kind for kind in kinds}
        self.name = f"{socket.gethostname()}:{os.getpid()}:{uuid4().hex[:8]}"
        self.lease = timedelta(seconds=settings.job_lease_seconds)
        self.told_to_end = asyncio.Event()
        self.running: dict[UUID, Attempt] = {}
        self.threads = ThreadPoolExecutor(settings.worker_concurrency + 2, thread_name_prefix="job")

    async def run(self, queues: list[str] | None) -> None:
        for name in (signal.SIGTERM, signal.SIGINT):
            asyncio.get_running_loop().add_signal_handler(name, self._end)
        url = psycopg_url(self.settings.database_url or "")
        queue = App(connector=PsycopgConnector(conninfo=url, min_size=1, max_size=3))
        queue.task(name=TASK)(self._job)
        options = WorkerOptions(
            name=self.name,
            concurrency=self.settings.worker_concurrency,
            fetch_job_polling_interval=POLL_SECONDS,
            delete_jobs="always",
            install_signal_handlers=False,
        )
        if queues:
            options["queues"] = queues
        async with queue.open_async():
            work = asyncio.create_task(self._take_jobs(queue, options))
            watch = asyncio.create_task(self._watch())
            end = asyncio.create_task(self._drain_when_told(work))
            log.info("worker ready", worker=self.name, kinds=sorted(self.kinds), queues=queues or "all")
            try:
                await work
            except asyncio.CancelledError:
                log.info("worker drained", worker=self.name)
            finally:
                watch.cancel()
                end.cancel()
        self.threads.shutdown()

    async def _take_jobs(self, queue: App, options: WorkerOptions) -> None:
        """Serve the queue, also when the database goes away and comes back."""
        while True:
            try:
                await queue.run_worker_async(**options)
            except ConnectorException as error:
                log.warning("the queue does not answer", error=str(error))
            log.warning("connecting to the queue again", seconds=RECONNECT_SECONDS)
            await asyncio.sleep(RECONNECT_SECONDS)

    def _end(self) -> None:
        """A signal to end. Told twice, it does not wait for running jobs."""
        if self.told_to_end.is_set():
            self._put_back()
        self.told_to_end.set()

    def _put_back(self) -> None:
        for running in list(self.running.values()):
            running.stop(ends.DRAINED)

    async def _drain_when_told(self, work: asyncio.Task[None]) -> None:
        await self.told_to_end.wait()
        log.info("worker draining", jobs=len(self.running), seconds=self.settings.job_drain_seconds)
        work.cancel()  # takes no more jobs, and waits for those that run
        await asyncio.sleep(self.settings.job_drain_seconds)
        self._put_back()

    async def _job(self, job_id: str) -> None:
        """The queue's only task."""
        await asyncio.get_running_loop().run_in_executor(self.threads, self._run, UUID(job_id))

    def _run(self, job_id: UUID) -> None:
        structlog.contextvars.clear_contextvars()
        with self.sessions.begin() as session:
            job = ledger.claim(session, job_id, self.name, self.lease)
        if job is None:
            return
        structlog.contextvars.bind_contextvars(job_id=str(job_id), attempt=job.attempt, kind=job.kind)
        kind = self.kinds.get(job.kind)
        if kind is None:
            failure = Failure("internal", "UnknownKind", f"this version's workers know no job of kind {job.kind!r}")
            with self.sessions.begin() as session:
                ledger.fail(session, job_id, job.attempt, failure)
            return
        began = time.perf_counter()
        attempt = self.running[job_id] = Attempt(self.sessions, self.settings, kind, job_id, job.attempt)
        try:
            outcome = attempt.run()
        finally:
            del self.running[job_id]
        log.info("job ended", outcome=outcome, seconds=round(time.perf_counter() - began, 3))

    async def _watch(self) -> None:
        """Leases, limits, cancellations, and other workers' deaths."""
        loop = asyncio.get_running_loop()
        renewal = reaping = 0.0
        while True:
            await asyncio.sleep(TICK_SECONDS)
            now = time.monotonic()
            try:
                if self.running:
                    await loop.run_in_executor(self.threads, self._stop_unwanted)
                if self.running and now >= renewal:
                    renewal = now + self.settings.job_lease_seconds / 3
                    await loop.run_in_executor(self.threads, self._renew)
                if now >= reaping:
                    reaping = now + self.settings.job_lease_seconds / 2
                    await loop.run_in_executor(self.threads, self._reap)
            except SQLAlchemyError as error:
                log.warning("the database does not answer; trying again", error=str(error))

    def _stop_unwanted(self) -> None:
        running = dict(self.running)
        for attempt in running.values():
            if time.monotonic() > attempt.deadline:
                attempt.out_of_time()
        with self.sessions.begin() as session:
            for job_id in ledger.cancel_requests(session, list(running)):
                running[job_id].stop(ends.CANCELLED)

    def _renew(self) -> None:
        running = dict(self.running)
        with self.sessions.begin() as session:
            mine = ledger.renew(session, self.name, list(running), self.lease)
        for job_id in running.keys() - mine:
            running[job_id].stop(ends.SUPERSEDED)

    def _reap(self) -> None:
        with self.sessions.begin() as session:
            for job_id, action in reap(session, self.lease):
                log.warning("job without a worker", job_id=job_id, action=action)
