"""The steward: sees to it that monitors are what their campaigns say. One in every worker process.

It looks when a job has ended or somebody has asked for something, and at every monitor now and then, so that a lost
notice, a late campaign or a schedule's time is seen too. It holds no state: what it finds undone, it does, under a lock on
the monitor's row. It is a thread and not a periodic task of the queue, since a task waits for a free place in a worker,
and a long job may hold that for an hour.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime, timedelta
from uuid import UUID

import structlog
from croniter import croniter
from sqlalchemy import func, or_, select
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from service.campaigns.tables import Campaign, Import
from service.db.engine import Sessions, make_engine, make_sessions
from service.jobs import Job
from service.jobs.notices import Listener
from service.jobs.tables import CHANGED
from service.monitoring import runs
from service.monitoring.assessment import judge_if_changed
from service.monitoring.delivery import Postman
from service.monitoring.tables import AT_WORK, Monitor, MonitorAssessment, MonitorRun, MonitorSeries
from service.settings import Settings

ASKED = "modalbase_monitor_asked"
"""Channel that tells the id of a monitor that has changed through the API."""

PAUSE_SECONDS = 0.1  # between two looks, so that a burst of notices is one look
ENDED = ("succeeded", "failed", "cancelled")

log = structlog.stdlib.get_logger("modalbase.steward")


def ask(session: Session, monitor_id: UUID) -> None:
    """Have a monitor looked at as soon as the transaction is committed."""
    session.execute(select(func.pg_notify(ASKED, str(monitor_id))))


@contextlib.contextmanager
def steward(settings: Settings) -> Iterator[None]:
    """Look after all monitors, and send what they have to tell, while the block runs."""
    engine = make_engine(settings.database_url or "", pool_size=3, name="modalbase steward")
    sessions = make_sessions(engine)
    try:
        with Postman(sessions, settings) as postman, _Steward(sessions, settings, postman):
            yield
    finally:
        engine.dispose()


class _Steward:
    def __init__(self, sessions: Sessions, settings: Settings, postman: Postman) -> None:
        self._sessions, self._settings, self._postman = sessions, settings, postman
        self._settle = timedelta(seconds=settings.campaign_settle_seconds)
        self._heard: set[UUID] = set()
        self._lock = threading.Lock()
        self._end, self._wake = threading.Event(), threading.Event()
        self._listener = Listener(settings.database_url or "", [CHANGED, ASKED], self._hear)
        self._thread = threading.Thread(target=self._run, daemon=True, name="steward")

    def __enter__(self) -> None:
        self._listener.__enter__()
        self._thread.start()

    def __exit__(self, *error: object) -> None:
        self._end.set()
        self._wake.set()
        self._thread.join()
        self._listener.__exit__(None, None, None)

    def _hear(self, key: str) -> None:
        with self._lock:
            self._heard.add(UUID(key))
        self._wake.set()

    def _run(self) -> None:
        sweep_at = 0.0
        while not self._end.is_set():
            with self._lock:
                heard, self._heard = list(self._heard), set()
            self._wake.clear()
            try:
                if time.monotonic() >= sweep_at:
                    sweep_at = time.monotonic() + self._settings.monitor_sweep_seconds
                    self._sweep()
                elif heard:
                    self._look_after(self._concerned(heard))
            except SQLAlchemyError as error:
                log.warning("the database does not answer; trying again", error=str(error).split("\n", 1)[0])
            self._wake.wait(max(0.0, sweep_at - time.monotonic()))
            self._end.wait(PAUSE_SECONDS)

    def _sweep(self) -> None:
        with self._sessions() as session:
            everyone = session.scalars(select(Monitor.id).where(AT_WORK).order_by(Monitor.id)).all()
        self._look_after(everyone)

    def _concerned(self, heard: Sequence[UUID]) -> Sequence[UUID]:
        """Monitors that were asked for, or that an ended job among these means something to."""
        with self._sessions() as session:
            of_import = select(Campaign.structure_id).join(Import).join(Job, Job.id == Import.id)
            of_run = select(MonitorSeries.monitor_id).join(MonitorRun).join(Job, Job.id == MonitorRun.update_job_id)
            of_judgement = (
                select(MonitorSeries.monitor_id).join(MonitorAssessment).join(Job, Job.id == MonitorAssessment.id)
            )
            ended = (Job.id.in_(heard), Job.state.in_(ENDED))
            wanted = or_(
                Monitor.id.in_(heard),
                Monitor.structure_id.in_(of_import.where(*ended)),
                Monitor.id.in_(of_run.where(*ended)),
                Monitor.id.in_(of_judgement.where(*ended)),
            )
            return session.scalars(select(Monitor.id).where(AT_WORK, wanted)).all()

    def _look_after(self, monitors: Sequence[UUID]) -> None:
        for key in monitors:
            if self._end.is_set():
                return
            try:
                with self._sessions.begin() as session:
                    attend(session, key, self._settle)
            except SQLAlchemyError:
                raise
            except Exception:
                log.exception("a monitor could not be looked after; the others go on", monitor=str(key))
        if monitors:
            self._postman.look()


def attend(session: Session, monitor_id: UUID, settle: timedelta) -> None:
    """Do what is to be done for one monitor, unless somebody else is at it."""
    monitor = session.scalars(
        select(Monitor).where(Monitor.id == monitor_id, AT_WORK).with_for_update(skip_locked=True)
    ).one_or_none()
    if monitor is None:
        return
    now = datetime.now(UTC)
    series = runs.newest_series(session, monitor)
    runs.collect(session, series)
    if _runs_by_itself(monitor, now):
        runs.bring_up_to_date(session, monitor, runs.Moment(now, settle))
    judge_if_changed(session, monitor, series, now)


def _runs_by_itself(monitor: Monitor, now: datetime) -> bool:
    if monitor.runs_on == "schedule" and monitor.schedule is not None:
        due = monitor.next_run_at is not None and monitor.next_run_at <= now
        if due or monitor.next_run_at is None:
            monitor.next_run_at = next_time(monitor.schedule, now)
        return due
    return monitor.runs_on == "campaign"


def next_time(schedule: str, now: datetime) -> datetime:
    """The next time of a cron schedule, UTC."""
    upcoming: datetime = croniter(schedule, now).get_next(datetime)
    return upcoming
