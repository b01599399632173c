"""The worker: runs the job that a ticket names in a child, drains when it is asked to end.

The event loop never computes and never waits for the database: both happen in threads, the numbers
in children.

Attempts have folders below one of the worker's own; what a killed worker left is cleared away by
the next one. That a worker lives is known by its lock on a file, which the operating system drops
however the worker dies.
"""

import asyncio
import getpass
import os
import shutil
import signal
import socket
import tempfile
import time
from collections.abc import Callable, Coroutine, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any
from uuid import uuid4

import structlog
from fasteners import InterProcessLock
from procrastinate import App
from procrastinate.job_context import AbortReason, JobContext

from service.platform.db.engine import Sessions, make_engine, make_sessions
from service.platform.db.schema import require_head
from service.platform.queue import queue_adapter
from service.platform.queue.attempt import Attempt
from service.platform.queue.child import CANCELLED, DRAINED, Failure
from service.platform.queue.kinds import JobKind
from service.platform.queue.manager import Manager
from service.platform.queue.process import ChildEnded, dismiss_children, prepare_children
from service.platform.settings import Settings

PREFIX = "modalbase-worker-"

LOCK = ".alive"

GATE = "modalbase-workers-{}.lock"  # a user each: files in a shared folder belong to who made them

log = structlog.stdlib.get_logger("modalbase.worker")


@contextmanager
def worker_folder() -> Iterator[Path]:
    """A folder for the workspaces of this worker while the block runs; those of dead workers are
    removed first.
    """
    everyones = Path(tempfile.gettempdir())
    with InterProcessLock(everyones / GATE.format(getpass.getuser())):
        for folder in everyones.glob(f"{PREFIX}*"):
            _clear_if_dead(folder)
        own = Path(tempfile.mkdtemp(prefix=PREFIX))
        alive = InterProcessLock(own / LOCK)
        alive.acquire()
    try:
        yield own
    finally:
        alive.release()
        shutil.rmtree(own, ignore_errors=True)


@contextmanager
def workspace(folder: Path) -> Iterator[Path]:
    """A folder of one attempt."""
    with tempfile.TemporaryDirectory(dir=folder, ignore_cleanup_errors=True) as own:
        yield Path(own)


def _clear_if_dead(folder: Path) -> None:
    """Remove a dead worker's folder. The caller holds the gate, so no worker is between making and
    locking one.
    """
    try:
        if folder.is_symlink() or not os.access(folder, os.W_OK):
            return
        lock = InterProcessLock(folder / LOCK)
        if lock.acquire(blocking=False):
            shutil.rmtree(folder, ignore_errors=True)
            lock.release()
    except OSError as error:
        log.warning(
            "a dead worker's folder could not be removed", folder=str(folder), error=str(error)
        )


LOOK_SECONDS = 1.0  # for tickets and aborts whose notice did not come
LEFT_SECONDS = 5.0  # for tasks that go on when the worker is done
# after which a dead worker's name is forgotten; its jobs are recovered long before
FORGET_SECONDS = 86400.0


def run_worker(
    settings: Settings,
    kinds: Sequence[JobKind],
    queues: Iterable[str] | None = None,
    ready: Callable[[], None] | None = None,
) -> None:
    """Work until SIGTERM or SIGINT: then take no more jobs, give running ones `job_drain_seconds`,
    put the rest back.

    Args:
        settings: with `database_url`.
        kinds: every kind of job that this worker knows.
        queues: names of the queues to serve; all of them by default.
        ready: is called once, when it takes jobs.

    Raises:
        SchemaError: the database's schema is not this version's.
    """
    if settings.database_url is None:
        raise ValueError(
            "settings.database_url is not set; `service.platform.db.opening.open_database` gives the"
            " embedded one"
        )
    engine = make_engine(
        settings.database_url,
        pool_size=2 * settings.worker_concurrency + 4,
        name="modalbase worker",
    )
    try:
        require_head(engine)
        prepare_children(kinds, settings.job_threads)
        with worker_folder() as folder:
            sessions = make_sessions(engine, project_quota_bytes=settings.project_quota_bytes)
            worker = _Worker(settings, kinds, sessions, folder)
            run_to_end(worker.run(list(queues) if queues else None, ready))
    finally:
        dismiss_children()
        engine.dispose()


def run_to_end(work: Coroutine[Any, Any, None]) -> None:
    """`asyncio.run`, without its endless wait for tasks that go on when cancelled, as that of a
    pool may which connects anew while its server starts.
    """
    loop = asyncio.new_event_loop()
    try:
        loop.run_until_complete(work)
    finally:
        left = asyncio.all_tasks(loop)
        for task in left:
            task.cancel()
        if left:
            loop.run_until_complete(asyncio.wait(left, timeout=LEFT_SECONDS))
        loop.run_until_complete(loop.shutdown_asyncgens())
        loop.close()


class _Worker:
    def __init__(
        self, settings: Settings, kinds: Sequence[JobKind], sessions: Sessions, folder: Path
    ) -> None:
        self.settings, self.sessions, self.folder = settings, sessions, folder
        self.kinds = {kind.name: kind for kind in kinds}
        self.name = f"{socket.gethostname()}:{os.getpid()}:{uuid4().hex[:8]}"
        self.manager = Manager(settings, sessions, self.name)
        self.app = App(connector=self.manager.connector)
        self.app.job_manager = self.manager
        self.app.task(name=queue_adapter.TASK, pass_context=True)(self._job)
        self.places = settings.worker_concurrency + 1  # one of them for what requests wait for
        self.threads = ThreadPoolExecutor(self.places, thread_name_prefix="job")
        self.work: set[asyncio.Future[str]] = set()

    async def run(self, queues: list[str] | None, ready: Callable[[], None] | None = None) -> None:
        async with self.app.open_async():
            serving = asyncio.create_task(self._serve(queues))
            for name in (signal.SIGTERM, signal.SIGINT):
                asyncio.get_running_loop().add_signal_handler(name, self._end, serving)
            log.info(
                "worker ready", worker=self.name, kinds=sorted(self.kinds), queues=queues or "all"
            )
            if ready is not None:
                ready()
            with suppress(asyncio.CancelledError):
                await serving
                raise RuntimeError("the queue's worker has stopped by itself; the log says why")
        self.threads.shutdown()
        log.info("worker drained", worker=self.name)

    async def _serve(self, queues: list[str] | None) -> None:
        await self.app.run_worker_async(
            queues=queues,  # type: ignore[arg-type]  # None, for all, is its default
            name=self.name,
            concurrency=self.places,
            fetch_job_polling_interval=LOOK_SECONDS,
            abort_job_polling_interval=LOOK_SECONDS,
            shutdown_graceful_timeout=0,  # the worker has waited for what runs
            update_heartbeat_interval=self.settings.job_lease_seconds / 3,
            stalled_worker_timeout=FORGET_SECONDS,
            install_signal_handlers=False,
        )

    def _end(self, serving: asyncio.Task[None]) -> None:
        """A signal to end: no new jobs. Running ones get some time, and none at the second
        signal.
        """
        if self.manager.draining:
            _stop(serving)
        else:
            self.manager.draining = True
            self.draining = asyncio.create_task(self._drain(serving))

    async def _drain(self, serving: asyncio.Task[None]) -> None:
        seconds = self.settings.job_drain_seconds
        log.info("worker draining", jobs=len(self.work), seconds=seconds)
        if self.work:
            await asyncio.wait(self.work, timeout=seconds)
        _stop(serving)

    async def _job(self, ticket: JobContext, job_id: str) -> None:
        """Run the job that a ticket names. An abort by the engine stops the attempt, whose end this
        waits for.
        """
        assert ticket.job.id is not None
        self.manager.abortable.add(ticket.job.id)
        job = self.manager.running[ticket.job.id]
        assert str(job.id) == job_id
        attempt = Attempt(
            self.sessions, self.settings, self.kinds.get(job.kind) or _unknown(job.kind), job
        )
        work = asyncio.get_running_loop().run_in_executor(self.threads, self._run, attempt)
        self.work.add(work)
        while not work.done():
            try:
                await asyncio.wait([work], timeout=attempt.seconds_left)
                if not work.done():
                    attempt.out_of_time()
            except asyncio.CancelledError:
                drained = ticket.abort_reason() is AbortReason.SHUTDOWN
                attempt.stop(DRAINED if drained else CANCELLED)
        self.work.discard(work)
        self.manager.abortable.discard(ticket.job.id)
        del self.manager.running[ticket.job.id]
        if (error := work.exception()) is not None:
            log.error(
                "a job could not be carried out", job_id=job_id, error=str(error), exc_info=error
            )
        self.manager.unsure |= error is not None or work.result() == "abandoned"

    def _run(self, attempt: Attempt) -> str:
        """Carry an attempt out, in a thread."""
        job, began = attempt.job, time.perf_counter()
        structlog.contextvars.clear_contextvars()
        ids = {
            "job_id": str(job.id),
            "attempt": job.attempt,
            "kind": job.kind,
            "request_id": job.request_id,
        }
        structlog.contextvars.bind_contextvars(**ids)
        with workspace(self.folder) as folder:
            outcome = attempt.run(folder)
        log.info("job ended", outcome=outcome, seconds=round(time.perf_counter() - began, 3))
        return outcome


def _unknown(name: str) -> JobKind:
    """A kind of job that this version does not know: its jobs fail."""

    def fail(*_: Any) -> Any:
        raise ChildEnded(
            Failure(
                "internal", "UnknownKind", f"this version's workers know no job of kind {name!r}"
            )
        )

    return JobKind(name, load=fail, compute=fail, store=fail)


def _stop(serving: asyncio.Task[None]) -> None:
    """Stop the engine: it aborts what still runs, which is put back."""
    if not serving.cancelling():
        serving.cancel()
