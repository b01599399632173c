"""Tables of monitors: their series, runs, assessments, alarms; webhooks and deliveries."""

from datetime import datetime
from typing import Any
from uuid import UUID

from sqlalchemy import (
    JSON,
    CheckConstraint,
    ColumnElement,
    ForeignKey,
    Index,
    UniqueConstraint,
    and_,
    func,
    text,
)
from sqlalchemy.dialects.postgresql import JSONB
from sqlalchemy.orm import Mapped, mapped_column

from service.platform.db.base import Base, Identified


class CampaignCompletion(Base):
    """Somebody said that everything of a campaign is in."""

    __tablename__ = "campaign_completions"

    campaign_id: Mapped[UUID] = mapped_column(
        ForeignKey("campaigns.id", ondelete="CASCADE"), primary_key=True
    )
    user_id: Mapped[UUID] = mapped_column(ForeignKey("users.id"))
    completed_at: Mapped[datetime] = mapped_column(server_default=func.now())


class Monitor(Identified, Base):
    """What is watched, how and by whom. `state` is the judged series' worst; `series` is its
    number, 0 before any.
    """

    __tablename__ = "monitors"
    __table_args__ = (
        Index(None, "structure_id", "id"),
        Index(None, "state_rank", "id"),
        CheckConstraint(
            "state IN ('no data', 'normal', 'pending', 'alarm', 'acknowledged')", "state"
        ),
        CheckConstraint("watches IN ('update', 'modes')", "watches"),
    )

    structure_id: Mapped[UUID] = mapped_column(ForeignKey("structures.id", ondelete="CASCADE"))
    structure_version_id: Mapped[UUID] = mapped_column(
        ForeignKey("structure_versions.id", deferrable=True)
    )
    user_id: Mapped[UUID] = mapped_column(ForeignKey("users.id"))
    name: Mapped[str]
    watches: Mapped[str] = mapped_column(server_default="update")  # or `modes`
    boundary: Mapped[str | None]
    recipe: Mapped[dict[str, Any]]
    modes: Mapped[str]
    priors: Mapped[str]
    watch: Mapped[dict[str, Any]]
    since: Mapped[datetime | None]
    expected_interval_days: Mapped[float | None]
    runs_on: Mapped[str]
    schedule: Mapped[str | None]
    next_run_at: Mapped[datetime | None]
    receivers: Mapped[dict[str, Any]]  # addresses by the names of their channels
    active: Mapped[bool] = mapped_column(server_default=text("true"))
    series: Mapped[int] = mapped_column(server_default="0")
    state: Mapped[str] = mapped_column(server_default="no data")
    state_rank: Mapped[int]
    state_since: Mapped[datetime] = mapped_column(server_default=func.now())
    updated_at: Mapped[datetime] = mapped_column(server_default=func.now(), onupdate=func.now())
    deleted_at: Mapped[datetime | None]


AT_WORK = and_(Monitor.active, Monitor.deleted_at.is_(None))
"""Monitors that run and judge by themselves."""


def hidden(deleted: bool) -> ColumnElement[bool]:
    """The condition of a list: the monitors that are there, or the deleted ones instead."""
    return Monitor.deleted_at.is_not(None) if deleted else Monitor.deleted_at.is_(None)


class MonitorSeries(Identified, Base):
    """One version of a monitor's series. A rerun makes the next one; those before it stay as they
    were.
    """

    __tablename__ = "monitor_series"
    __table_args__ = (UniqueConstraint("monitor_id", "number"),)

    monitor_id: Mapped[UUID] = mapped_column(ForeignKey("monitors.id", ondelete="CASCADE"))
    number: Mapped[int]
    software: Mapped[str]
    reason: Mapped[str]
    digest: Mapped[str | None]
    assessed_at: Mapped[datetime | None]
    document: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True), deferred=True)


class MonitorRun(Identified, Base):
    """The recipe on one campaign in one series; a corrected campaign gets another revision. The
    latest one counts.
    """

    __tablename__ = "monitor_runs"
    __table_args__ = (
        UniqueConstraint("series_id", "campaign_id", "revision"),
        CheckConstraint("state IN ('running', 'succeeded', 'failed', 'refused')", "state"),
        Index(
            "ix_monitor_runs_running", "update_job_id", postgresql_where=text("state = 'running'")
        ),
        Index(
            "ix_monitor_runs_of_modes_running",
            "job_id",
            postgresql_where=text("state = 'running'"),
        ),
    )

    series_id: Mapped[UUID] = mapped_column(ForeignKey("monitor_series.id", ondelete="CASCADE"))
    campaign_id: Mapped[UUID] = mapped_column(ForeignKey("campaigns.id", ondelete="CASCADE"))
    revision: Mapped[int]
    fingerprint: Mapped[str]
    state: Mapped[str]
    message: Mapped[str | None]
    update_job_id: Mapped[UUID | None] = mapped_column(
        ForeignKey("update_jobs.id", deferrable=True)
    )
    # of a monitor of modes: the processing, or the identification that made its values
    job_id: Mapped[UUID | None] = mapped_column(ForeignKey("jobs.id", ondelete="SET NULL"))
    software: Mapped[str | None]
    values: Mapped[dict[str, Any] | None] = mapped_column(JSONB(none_as_null=True))
    finished_at: Mapped[datetime | None]


class MonitorTracks(Base):
    """Which tracks the modes of a run are, as they were followed.

    `chain` is a digest of the run and of all that were followed before it: while it is what it was,
    so are the tracks.
    """

    __tablename__ = "monitor_tracks"
    __table_args__ = (Index(None, "series_id", "performed_at"),)

    run_id: Mapped[UUID] = mapped_column(
        ForeignKey("monitor_runs.id", ondelete="CASCADE"), primary_key=True
    )
    series_id: Mapped[UUID] = mapped_column(ForeignKey("monitor_series.id", ondelete="CASCADE"))
    performed_at: Mapped[datetime]
    chain: Mapped[bytes]
    numbers: Mapped[list[Any]]  # of each mode's track
    identity_sd: Mapped[list[Any]]
    # what is known after the run (`fecore.trend.Following`), of some runs and of the last
    state: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True), deferred=True)


class MonitorPoint(Base):
    """A campaign's value of a parameter in a series, and how it was judged."""

    __tablename__ = "monitor_points"

    series_id: Mapped[UUID] = mapped_column(
        ForeignKey("monitor_series.id", ondelete="CASCADE"), primary_key=True
    )
    parameter: Mapped[str] = mapped_column(primary_key=True)
    performed_at: Mapped[datetime] = mapped_column(primary_key=True)
    campaign_id: Mapped[UUID]  # no foreign key: a campaign's end would look for it everywhere
    raw: Mapped[float]
    standard_deviation: Mapped[float]
    corrected: Mapped[float | None]
    in_baseline: Mapped[bool]
    judged: Mapped[dict[str, Any] | None] = mapped_column(JSONB(none_as_null=True))
    # from then on, with the campaign that raised the alarm that stands; None in the baseline
    condition: Mapped[dict[str, Any] | None] = mapped_column(JSONB(none_as_null=True))


class MonitorJudgement(Base):
    """One judgement of a series; its key is its job's, and so is its status."""

    __tablename__ = "monitor_assessments"
    __table_args__ = (Index(None, "series_id", "id"),)

    id: Mapped[UUID] = mapped_column(ForeignKey("jobs.id", deferrable=True), primary_key=True)
    series_id: Mapped[UUID] = mapped_column(ForeignKey("monitor_series.id", ondelete="CASCADE"))
    digest: Mapped[str]


class Alarm(Identified, Base):
    """An alarm of a parameter, raised by a campaign; raised once, whichever series confirms it."""

    __tablename__ = "alarms"
    __table_args__ = (
        Index(None, "monitor_id", "id"),
        Index(
            "ix_alarms_raised_once",
            "monitor_id",
            "parameter",
            "campaign_id",
            unique=True,
            postgresql_where=text("state <> 'withdrawn'"),
        ),
        CheckConstraint("state IN ('alarm', 'acknowledged', 'cleared', 'withdrawn')", "state"),
    )

    monitor_id: Mapped[UUID] = mapped_column(ForeignKey("monitors.id", ondelete="CASCADE"))
    parameter: Mapped[str]
    campaign_id: Mapped[UUID] = mapped_column(ForeignKey("campaigns.id", ondelete="CASCADE"))
    series: Mapped[int]
    state: Mapped[str]
    acknowledged_at: Mapped[datetime | None]
    acknowledged_by: Mapped[UUID | None] = mapped_column(ForeignKey("users.id"))
    note: Mapped[str | None]
    details: Mapped[dict[str, Any]]


class AlarmEvent(Identified, Base):
    """A step in an alarm's history."""

    __tablename__ = "alarm_events"
    __table_args__ = (Index(None, "alarm_id", "id"),)

    alarm_id: Mapped[UUID] = mapped_column(ForeignKey("alarms.id", ondelete="CASCADE"))
    event: Mapped[str]
    user_id: Mapped[UUID | None] = mapped_column(ForeignKey("users.id"))
    note: Mapped[str]
