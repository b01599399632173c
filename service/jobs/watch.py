"""The worker's watch over what it runs, in a thread that no numerics and no waiting job can hold up: leases, limits,
cancellations, and other workers' deaths.
"""

from __future__ import annotations

import threading
import time
from datetime import timedelta
from types import TracebackType
from typing import Self
from uuid import UUID

import structlog
from sqlalchemy.exc import SQLAlchemyError

from service.db.engine import Sessions
from service.jobs import attempt as ends
from service.jobs import ledger
from service.jobs.attempt import Attempt
from service.jobs.notices import Listener
from service.jobs.reaper import Reaped, disown, reap
from service.jobs.tables import CANCEL
from service.settings import Settings

TICK_SECONDS = 0.1
AGAIN_SECONDS = 1.0  # between two tries to reach the database
LOOK_SECONDS = 0.5  # for cancellations whose notice did not come

log = structlog.stdlib.get_logger("modalbase.worker")


class Watch:
    """Watches the attempts of one worker; a context manager."""

    def __init__(self, settings: Settings, sessions: Sessions, worker: str, running: dict[UUID, Attempt]) -> None:
        """Prepare.

        Args:
            settings: with `database_url`.
            sessions: where the rows are.
            worker: name of the worker.
            running: its attempts by job; others change it.
        """
        self._settings, self._sessions, self._worker, self._running = settings, sessions, worker, running
        self._lease = timedelta(seconds=settings.job_lease_seconds)
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True, name="watch")
        self._listener = Listener(settings.database_url or "", [CANCEL], self._cancel_noticed)
        self._consult_at = self._look_at = self._renew_at = self._reap_at = 0.0

    def __enter__(self) -> Self:
        self._listener.__enter__()
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end.set()
        self._thread.join()
        self._listener.__exit__(kind, error, trace)

    def _run(self) -> None:
        while not self._end.wait(TICK_SECONDS):
            self._stop_overdue()
            if time.monotonic() < self._consult_at:
                continue
            try:
                self._consult(time.monotonic())
            except SQLAlchemyError as error:
                # When it comes back, every worker first renews what it holds, before anyone takes it for dead.
                self._renew_at, self._reap_at = 0.0, time.monotonic() + self._settings.job_lease_seconds
                self._consult_at = time.monotonic() + AGAIN_SECONDS
                log.warning("the database does not answer; trying again", error=str(error).split("\n", 1)[0])

    def _consult(self, now: float) -> None:
        """What the database has to say, each question in its own rhythm."""
        if now >= self._renew_at:
            self._renew()
            self._renew_at = now + self._settings.job_lease_seconds / 3
        if self._running and now >= self._look_at:
            self._stop_cancelled()
            self._look_at = now + LOOK_SECONDS
        if now >= self._reap_at:
            self._reap()
            self._reap_at = now + self._settings.job_lease_seconds / 2

    def _stop_overdue(self) -> None:
        for attempt in list(self._running.values()):
            if time.monotonic() > attempt.deadline:
                attempt.out_of_time()

    def _cancel_noticed(self, job_id: str) -> None:
        attempt = self._running.get(UUID(job_id))
        if attempt is not None:
            attempt.stop(ends.CANCELLED)

    def _stop_cancelled(self) -> None:
        running = dict(self._running)
        with self._sessions.begin() as session:
            for job_id in ledger.cancel_requests(session, list(running)):
                running[job_id].stop(ends.CANCELLED)

    def _renew(self) -> None:
        running = dict(self._running)
        with self._sessions.begin() as session:
            mine = ledger.renew(session, self._worker, list(running), self._lease)
            strays = disown(session, self._worker, list(running))
        for job_id in running.keys() - mine:
            running[job_id].stop(ends.SUPERSEDED)
        _tell(strays)

    def _reap(self) -> None:
        with self._sessions.begin() as session:
            found = reap(session, self._settings.project_job_limit)
        _tell(found)


def _tell(reaped: Reaped) -> None:
    for job_id, action in reaped:
        log.warning("job without a worker", job_id=job_id, action=action)
