"""The scheduler starts the runs and judgements that monitors are due, and applies retention rules.
Each worker process has one.

It looks when a job has ended or somebody has asked for something, and at every monitor now and
then, so that a lost notice, a late campaign or a schedule's time is seen too. It holds no state:
what it finds undone, it does, under a lock on the monitor's row. It is a thread and not a periodic
task of the queue, since a task waits for a free place in a worker, and a long job may hold that for
an hour.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING
from uuid import UUID

import structlog
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from service.monitoring.runs import Moment, bring_up_to_date, take_over
from service.nouns.imports.retention import apply_rules
from service.nouns.monitors.runs import newest_series
from service.nouns.monitors.watching import REQUESTED, held, next_time, watching
from service.nouns.notifications.sender import Sender
from service.platform.db.engine import Sessions, make_engine, make_sessions
from service.platform.queue.background import Background, Listener
from service.platform.queue.tables import CHANGED
from service.platform.settings import Settings
from service.tasks.judge.task import judge_if_changed

if TYPE_CHECKING:
    from service.nouns.monitors.tables import Monitor

WHOLE_SECONDS = 86400.0
"""Between two looks at all campaigns of a long series; what came lately is looked at each time."""

PAUSE_SECONDS = 0.1  # between two looks, so that a burst of notices is one look

log = structlog.stdlib.get_logger("modalbase.scheduler")


@contextlib.contextmanager
def scheduler(settings: Settings) -> Iterator[None]:
    """Check all monitors, and send their messages, while the block runs."""
    engine = make_engine(settings.database_url or "", pool_size=3, name="modalbase scheduler")
    sessions = make_sessions(engine)
    try:
        with Sender(sessions, settings) as sender, _Scheduler(sessions, settings, sender):
            yield
    finally:
        engine.dispose()


class _Scheduler:
    def __init__(self, sessions: Sessions, settings: Settings, sender: Sender) -> None:
        self._sessions, self._settings, self._sender = sessions, settings, sender
        self._settle = timedelta(seconds=settings.campaign_settle_seconds)
        self._sweep_at = self._retention_at = 0.0
        self._whole_at: dict[UUID, float] = {}  # when all campaigns are due to be looked at
        self._changed: set[UUID] = set()
        self._lock = threading.Lock()
        self._listener = Listener(settings.database_url or "", [CHANGED, REQUESTED], self._note)
        self._thread = Background("scheduler", self._round)

    def __enter__(self) -> None:
        self._listener.__enter__()
        self._thread.__enter__()

    def __exit__(self, *error: object) -> None:
        self._thread.__exit__(*error)
        self._listener.__exit__(*error)

    def _note(self, key: str) -> None:
        with self._lock:
            self._changed.add(UUID(key))
        self._thread.wake()

    def _round(self) -> float:
        self._thread.ending.wait(PAUSE_SECONDS)
        with self._lock:
            changed, self._changed = list(self._changed), set()
        try:
            if time.monotonic() >= self._sweep_at:
                self._sweep_at = time.monotonic() + self._settings.monitor_sweep_seconds
                self._sweep()
            elif changed:
                self._check_all(self._concerned(changed))
            if time.monotonic() >= self._retention_at:
                self._retention_at = time.monotonic() + self._settings.retention_sweep_seconds
                self._apply_retention()
        except SQLAlchemyError as error:
            log.warning(
                "the database does not answer; trying again", error=str(error).split("\n", 1)[0]
            )
        return max(0.0, min(self._sweep_at, self._retention_at) - time.monotonic())

    def _apply_retention(self) -> None:
        left = True
        try:
            while left and not self._thread.ending.is_set():
                with self._sessions.begin() as session:
                    left = apply_rules(session, datetime.now(UTC)) > 0
        except SQLAlchemyError:
            raise
        except Exception:
            log.exception("retention rules could not be applied; they are tried again later")

    def _sweep(self) -> None:
        with self._sessions() as session:
            everyone = watching(session)
        self._check_all(everyone)

    def _concerned(self, changed: Sequence[UUID]) -> Sequence[UUID]:
        with self._sessions() as session:
            return watching(session, changed)

    def _check_all(self, monitors: Sequence[UUID]) -> None:
        for key in monitors:
            if self._thread.ending.is_set():
                return
            try:
                recent = time.monotonic() < self._whole_at.get(key, 0.0)
                with self._sessions.begin() as session:
                    check(session, key, self._settle, recent=recent)
                if not recent:
                    self._whole_at[key] = time.monotonic() + WHOLE_SECONDS
            except SQLAlchemyError:
                raise
            except Exception:
                log.exception("a monitor could not be checked; the others go on", monitor=str(key))
        if monitors:
            self._sender.wake()


def check(session: Session, monitor_id: UUID, settle: timedelta, *, recent: bool = False) -> None:
    """Start what one monitor is due, unless another scheduler is at it.

    Args:
        session: the transaction; it holds the monitor's row.
        monitor_id: of the monitor.
        settle: how long a campaign must have been left alone to count as complete.
        recent: of a long series of modes, look only at campaigns to which something came lately.
    """
    monitor = held(session, monitor_id)
    if monitor is None:
        return
    now = datetime.now(UTC)
    series = newest_series(session, monitor)
    take_over(session, monitor, series)
    if _runs_by_itself(monitor, now):
        bring_up_to_date(session, monitor, Moment(now, settle, recent))
    judge_if_changed(session, monitor, series, now)


def _runs_by_itself(monitor: Monitor, now: datetime) -> bool:
    if monitor.runs_on == "schedule" and monitor.schedule is not None:
        due = monitor.next_run_at is not None and monitor.next_run_at <= now
        if due or monitor.next_run_at is None:
            monitor.next_run_at = next_time(monitor.schedule, now)
        return due
    return monitor.runs_on == "campaign"
