"""One attempt at a job: load, compute in the child, store. Runs in a thread of the worker, and
lives through the database's
absence: errors pass that do so by themselves, and a result is kept so that it can be stored again.
"""

import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import structlog
from sqlalchemy.exc import DBAPIError

from service.platform.db.engine import Sessions
from service.platform.errors import NotFinite
from service.platform.queue import queue
from service.platform.queue.background import AGAIN_SECONDS
from service.platform.queue.child import Checkpoint, Failure, Item, Order, Progress, failure_of
from service.platform.queue.kinds import JobKind
from service.platform.queue.process import Child, ChildEnded
from service.platform.queue.tables import Job
from service.platform.settings import Settings

KEPT_BYTES = 32 * 1024 * 1024
PROGRESS_SECONDS = 0.1
RECORD_SECONDS = 120.0  # for which the end of an attempt is kept in hand while the database is away

log = structlog.stdlib.get_logger("modalbase.jobs")

PASSING = ("08", "40", "53", "57P", "55P03")
"""SQLSTATEs of lost connections, rollbacks that ask for another try, exhausted resources,
shutdowns, lock time-outs.
"""


def passes(error: DBAPIError) -> bool:
    """Is this an error of the moment, which another try later may not meet? A connection refused
    has no SQLSTATE.
    """
    state = getattr(error.orig, "sqlstate", None)
    return error.connection_invalidated or (
        state.startswith(PASSING)
        if state
        else type(error.orig).__name__ in ("OperationalError", "InterfaceError")
    )


class Replay:
    """Items that can be gone through again from the first one on, as long as they are small.

    Attributes:
        complete: nothing has been dropped; another `iter` gives every item.
    """

    def __init__(self, source: Iterator[Item]) -> None:
        self._source = source
        self._kept: list[Item] = []
        self._bytes = 0
        self.complete = True

    def __iter__(self) -> Iterator[Any]:
        """What the items hold, from the first one on. Only the last iterator may be used."""
        if not self.complete:
            raise RuntimeError("the first items are gone")
        yield from [item.value for item in self._kept]
        for item in self._source:
            self._bytes += item.size
            self.complete = self._bytes <= KEPT_BYTES
            self._kept.append(item)
            if not self.complete:
                self._kept.clear()
            yield item.value


class Attempt:
    """One attempt. `run` in one thread; `stop` from any other."""

    def __init__(self, sessions: Sessions, settings: Settings, kind: JobKind, job: Job) -> None:
        self.sessions, self.settings, self.kind, self.job = sessions, settings, kind, job
        self._deadline = time.monotonic() + (kind.wall_seconds or settings.job_wall_seconds)
        self._child: Child | None = None
        self._stopped: Failure | None = None
        self._stop_requested = threading.Event()
        self._lock = threading.Lock()
        self._write_at = 0.0
        self._last: Progress | None = None

    def stop(self, why: Failure) -> None:
        """End the attempt as soon as can be: a running child at once, else before the child is
        started.
        """
        with self._lock:
            self._stopped = self._stopped or why
            self._stop_requested.set()
            if self._child is not None:
                self._child.kill(why)

    @property
    def seconds_left(self) -> float | None:
        """Until it is out of time; None where it is being stopped already."""
        return (
            None if self._stop_requested.is_set() else max(0.0, self._deadline - time.monotonic())
        )

    def out_of_time(self) -> None:
        """End the attempt because its time is over."""
        seconds = self.kind.wall_seconds or self.settings.job_wall_seconds
        self.stop(
            Failure(
                "time",
                "TimeLimit",
                f"the job took longer than the {seconds:g} s that a job may take",
            )
        )

    def run(self, workspace: Path) -> str:
        """Carry the attempt out and put its outcome in the row.

        Args:
            workspace: a folder of this attempt alone.

        Returns:
            The outcome: `succeeded`, `failed`, `cancelled`, `queued again`, `superseded` or
            `abandoned`.
        """
        try:
            self._store(self._start(*self._load(workspace)))
        except queue.SupersededError:
            return "superseded"
        except DBAPIError as error:
            if not passes(error):
                return self._record(failure_of(error))
            log.exception("the database went away; the job is given back when it answers again")
            return "abandoned"
        except ChildEnded as ended:
            return self._record(ended.failure)
        except Exception as error:  # noqa: BLE001  whatever load or store raise is this job's failure, not the worker's
            return self._record(failure_of(error))
        finally:
            if self._child is not None:
                self._child.close()
        return "succeeded"

    def _load(self, workspace: Path) -> tuple[Any, bytes | None]:
        with self.sessions.begin() as session:
            return self.kind.load(session, self.job.id, workspace), queue.load_checkpoint(
                session, self.job.id
            )

    def _start(self, inputs: Any, restored: bytes | None) -> Child:
        order = Order(
            self.kind.compute,
            inputs,
            restored,
            self.kind.memory_bytes or self.settings.job_memory_bytes,
        )
        with self._lock:
            if self._stopped is not None:
                raise ChildEnded(self._stopped)
            self._child = Child(order)
            return self._child

    def _store(self, child: Child) -> None:
        """Store what the child yields, with the state `succeeded`, in one transaction; in another
        one, from the first item on, where the database went away in between.
        """
        items = Replay(self._items(child))
        while True:
            try:
                with self.sessions.begin() as session:
                    stream = iter(items)
                    self.kind.store(session, self.job.id, stream)
                    # what it left; the child must have come to its end before the job has
                    for _ in stream:
                        pass
                    if self._last is not None:
                        self._write(self._last)
                    queue.succeed(session, queue.locked(session, self.job))
            except DBAPIError as error:
                if not (passes(error) and items.complete):
                    raise
                log.warning(
                    "the database does not take the result; trying again", error=str(error.orig)
                )
                self._pause()
            else:
                return

    def _pause(self) -> None:
        if self._stop_requested.wait(AGAIN_SECONDS) and self._stopped is not None:
            raise ChildEnded(self._stopped)

    def _items(self, child: Child) -> Iterator[Item]:
        """The child's items; its progress and its checkpoints go to the database on the way."""
        for message in child.messages():
            match message:
                case Item():
                    yield message
                case Checkpoint(data):
                    self._try_write(
                        lambda session, data=data: queue.save_checkpoint(session, self.job, data)
                    )
                case Progress():
                    self._progress(message)

    def _progress(self, progress: Progress) -> None:
        if (
            time.monotonic() >= self._write_at
            or self._last is None
            or progress.stage != self._last.stage
        ):
            self._write(progress)
        self._last = progress

    def _write(self, progress: Progress) -> None:
        self._write_at = time.monotonic() + PROGRESS_SECONDS
        self._try_write(
            lambda session: queue.advance(session, self.job, progress.stage, progress.share)
        )

    def _try_write(self, write: Any) -> None:
        """Write in a transaction of its own what the work can do without, should the database be
        away.
        """
        try:
            with self.sessions.begin() as session:
                write(session)
        except DBAPIError as error:
            if not passes(error):
                raise
            self._write_at = time.monotonic() + AGAIN_SECONDS
            log.warning("the database does not answer; the work goes on", error=str(error.orig))

    def _record(self, failure: Failure) -> str:
        """Put the end of an attempt that did not succeed in the row; one that has lost its job
        leaves no trace in the log.
        """
        outcome = self._write_on(failure)
        if failure.trace and outcome != "superseded":
            log.error("internal error in a job", trace=failure.trace)
        return outcome

    def _write_on(self, failure: Failure) -> str:
        """Write the end as soon as the database takes it."""
        end = time.monotonic() + RECORD_SECONDS
        while True:
            try:
                with self.sessions.begin() as session:
                    return queue.end(session, queue.locked(session, self.job), failure)
            except queue.SupersededError:
                return "superseded"
            except NotFinite as error:
                log.warning("an error's details are left out", error=str(error))
                failure = replace(failure, extra=None)
            except DBAPIError as error:
                if time.monotonic() > end or not passes(error) or failure.reason == "drained":
                    log.exception(
                        "the job's end could not be written; it is given back when the database"
                        " answers again"
                    )
                    return "abandoned"
                time.sleep(AGAIN_SECONDS)
