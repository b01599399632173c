"""One attempt at a job: load, compute in the child, store. Runs in a thread of the worker."""

from __future__ import annotations

import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from uuid import UUID

import structlog
from sqlalchemy.exc import DBAPIError

from service.db.engine import Sessions
from service.jobs import ledger
from service.jobs.child import Failure, Item, Progress, failure_of
from service.jobs.kinds import JobKind
from service.jobs.process import Child, ChildEnded
from service.settings import Settings

PROGRESS_SECONDS = 0.1

CANCELLED = Failure("cancelled", "Cancelled", "cancelled on request")
DRAINED = Failure("drained", "Drained", "the worker was told to end")
SUPERSEDED = Failure("superseded", "Superseded", "another attempt has the job")

log = structlog.stdlib.get_logger("modalbase.jobs")


class Attempt:
    """One attempt. `run` in one thread; `stop` from any other."""

    def __init__(self, sessions: Sessions, settings: Settings, kind: JobKind, job_id: UUID, number: int) -> None:
        self.sessions, self.settings, self.kind = sessions, settings, kind
        self.job_id, self.number = job_id, number
        self.deadline = time.monotonic() + (kind.wall_seconds or settings.job_wall_seconds)
        self._child: Child | None = None
        self._stopped: Failure | None = None
        self._lock = threading.Lock()
        self._last_written = -PROGRESS_SECONDS
        self._last: Progress | None = None

    def stop(self, why: Failure) -> None:
        """End the attempt as soon as can be: a running child at once, else before the child is started."""
        with self._lock:
            self._stopped = self._stopped or why
            if self._child is not None:
                self._child.kill(why)

    def out_of_time(self) -> None:
        """End the attempt because its time is over."""
        seconds = self.kind.wall_seconds or self.settings.job_wall_seconds
        self.stop(Failure("time", "TimeLimit", f"the job took longer than the {seconds:g} s that a job may take"))

    def run(self) -> str:
        """Carry the attempt out and put its outcome in the row.

        Returns:
            The outcome: `succeeded`, `failed`, `cancelled`, `drained`, `superseded` or `abandoned`.
        """
        try:
            with tempfile.TemporaryDirectory(prefix="modalbase-") as folder:
                self._compute(Path(folder))
        except ledger.SupersededError:
            return "superseded"
        except DBAPIError as error:
            if not error.connection_invalidated:
                return self._record(failure_of(error))
            log.exception("the database went away; the job is left to whoever finds its lease lapsed")
            return "abandoned"
        except ChildEnded as ended:
            return self._record(ended.failure)
        except Exception as error:  # noqa: BLE001  whatever load or store raise is this job's failure, not the worker's
            return self._record(failure_of(error))
        finally:
            if self._child is not None:
                self._child.close()
        return "succeeded"

    def _compute(self, workspace: Path) -> None:
        with self.sessions.begin() as session:
            inputs = self.kind.load(session, self.job_id, workspace)
        child = self._start(inputs)
        del inputs
        with self.sessions.begin() as session:
            items = self._items(child)
            self.kind.store(session, self.job_id, items)
            for _ in items:  # what it left; the child must have come to its end before the job has
                pass
            if self._last is not None:
                self._write(self._last)
            ledger.succeed(session, self.job_id, self.number)

    def _start(self, inputs: Any) -> Child:
        with self._lock:
            if self._stopped is not None:
                raise ChildEnded(self._stopped)
            self._child = Child(self.kind.compute, inputs, self.kind.memory_bytes or self.settings.job_memory_bytes)
            return self._child

    def _items(self, child: Child) -> Iterator[Any]:
        """The child's items; its progress goes to the row on the way."""
        for message in child.messages():
            if isinstance(message, Item):
                yield message.value
            else:
                self._progress(message)

    def _progress(self, progress: Progress) -> None:
        due = time.monotonic() - self._last_written >= PROGRESS_SECONDS
        if due or self._last is None or progress.stage != self._last.stage:
            self._write(progress)
        self._last = progress

    def _write(self, progress: Progress) -> None:
        self._last_written = time.monotonic()
        with self.sessions.begin() as session:
            ledger.advance(session, self.job_id, self.number, progress.stage, progress.share)

    def _record(self, failure: Failure) -> str:
        """Put the end of an attempt that did not succeed in the row."""
        outcome = failure.reason if failure.reason in ("cancelled", "drained", "superseded") else "failed"
        if failure.trace:
            log.error("internal error in a job", trace=failure.trace)
        try:
            with self.sessions.begin() as session:
                if outcome == "cancelled":
                    ledger.cancelled(session, self.job_id, self.number)
                elif outcome == "drained":
                    ledger.give_back(session, ledger.locked(session, self.job_id, self.number), failure.detail)
                elif outcome == "failed":
                    ledger.fail(session, self.job_id, self.number, failure)
        except ledger.SupersededError:
            return "superseded"
        except DBAPIError:
            log.exception("the database went away; the job is left to whoever finds its lease lapsed")
            return "abandoned"
        return outcome
