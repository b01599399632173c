"""Alarms and the state of a monitor: raised once, acknowledged by somebody, and cleared or withdrawn
by a later judgement. Each step is announced.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any
from uuid import UUID

from sqlalchemy import Select, select
from sqlalchemy.orm import Session

from fecore.trend import State
from fecore.trend.states import WORST_FIRST
from service.nouns.monitors.runs import monitor_for, unit_of
from service.nouns.monitors.tables import Alarm, AlarmEvent, Monitor, hidden
from service.nouns.notifications.messages import announce
from service.nouns.structures.operations import structure_of, structures_in
from service.platform.access import Lookup, User, audit, project_for, projects_of
from service.platform.errors import Conflict, NotFound

if TYPE_CHECKING:
    from service.nouns.monitors.tables import MonitorSeries
    from service.nouns.structures.operations import Structure
    from service.tasks.judge.compute import Episode


def acknowledged(session: Session, monitor: Monitor) -> list[Alarm]:
    """Alarms of a monitor that somebody has seen, in the order in which they were."""
    return list(
        session.scalars(
            select(Alarm)
            .where(
                Alarm.monitor_id == monitor.id,
                Alarm.acknowledged_at.is_not(None),
                Alarm.state != "withdrawn",
            )
            .order_by(Alarm.acknowledged_at)
        )
    )


def alarms_seen(
    session: Session, user: User, state: str | None, monitor: UUID | None, project: UUID | None
) -> Select[Alarm]:
    """The query of one's alarms, of monitors that are there: in a state, of a monitor, of a
    project.
    """
    query = (
        select(Alarm)
        .join(Monitor)
        .where(Monitor.structure_id.in_(structures_in(projects_of(user))), hidden(deleted=False))
    )
    if state is not None:
        query = query.where(Alarm.state == state)
    if monitor is not None:
        query = query.where(Alarm.monitor_id == monitor_for(session, user, monitor).id)
    if project is not None:
        query = query.where(
            Monitor.structure_id.in_(structures_in([project_for(session, user, project).id]))
        )
    return query


def set_state(session: Session, monitor: Monitor, state: str) -> None:
    """Set a monitor's state, and announce it where nothing else does."""
    if monitor.state == state:
        return
    before, monitor.state, monitor.state_rank = monitor.state, state, rank(state)
    monitor.state_since = datetime.now(UTC)
    state_changed(session, monitor, before)
    session.flush()


def rank(state: str) -> int:
    """0 for the state that asks most for attention."""
    return WORST_FIRST.index(State(state))


alarm_for = Lookup(Alarm, "alarm", "monitor_id", monitor_for)
"""The alarm, if the user has at least a role in its project; none of a deleted monitor."""


def update_alarms(
    session: Session,
    monitor: Monitor,
    series: MonitorSeries,
    episodes: Sequence[Episode],
    within: tuple[datetime | None, datetime | None] = (None, None),
    rebased: Mapping[str, str] | None = None,
) -> None:
    """Bring a monitor's alarms to what its series now says.

    An episode is the alarm that its campaign raised before, whichever series said so; else the
    oldest one of its parameter that has lost its campaign to a late or corrected one; else it is
    new. An alarm of a campaign within what was judged that no episode is left for is withdrawn.

    Args:
        session: the transaction, which holds the monitor's row.
        monitor: whose.
        series: the version that was judged.
        episodes: what it says.
        within: after which campaign, and up to which one, alarms were judged; None: all.
        rebased: by parameter, in words, which campaigns its baseline has gained and lost by this
            judgement.
    """
    rebased = rebased or {}
    rows = session.scalars(
        select(Alarm)
        .where(Alarm.monitor_id == monitor.id, Alarm.state != "withdrawn")
        .order_by(Alarm.id)
    ).all()
    known = {(alarm.parameter, str(alarm.campaign_id)): alarm for alarm in rows}
    alarmed = {(e.parameter, e.campaign) for e in episodes}
    orphans = [
        alarm for key, alarm in known.items() if key not in alarmed and _is_within(alarm, *within)
    ]
    for episode in episodes:
        alarm = known.get((episode.parameter, episode.campaign)) or _adopt(
            session, orphans, episode, rebased.get(episode.parameter, "")
        )
        if alarm is None and episode.details is None:
            continue
        if alarm is None:
            _raise(session, monitor, series, episode)
        else:
            alarm.details, alarm.series = episode.details or alarm.details, series.number
            if alarm.state == "acknowledged" and episode.state == "cleared":
                _step(session, monitor, alarm, "cleared", "the parameter came back")
            elif alarm.state == "cleared" and episode.state != "cleared":
                alarm.state = "acknowledged"
                session.add(
                    AlarmEvent(
                        alarm_id=alarm.id, event="reopened", note="late or corrected campaigns"
                    )
                )
    for alarm in orphans:
        if alarm.state != "cleared":
            why = f"series {series.number} as it stands now does not confirm it"
            why += rebased.get(alarm.parameter, "")
            _step(session, monitor, alarm, "withdrawn", why)
    session.flush()


def _is_within(alarm: Alarm, after: datetime | None, end: datetime | None) -> bool:
    at = datetime.fromisoformat(alarm.details["performed_at"])
    return (after is None or at > after) and (end is None or at <= end)


def _adopt(session: Session, orphans: list[Alarm], episode: Episode, rebased: str) -> Alarm | None:
    for alarm in orphans:
        if alarm.parameter == episode.parameter and alarm.state != "cleared":
            orphans.remove(alarm)
            before = f"before it was {alarm.campaign_id}"
            note = f"campaign {episode.campaign} raises it now; {before}{rebased}"
            alarm.campaign_id = UUID(episode.campaign)
            session.add(AlarmEvent(alarm_id=alarm.id, event="moved", note=note))
            session.flush()
            return alarm
    return None


def _raise(session: Session, monitor: Monitor, series: MonitorSeries, episode: Episode) -> None:
    alarm = Alarm(
        monitor_id=monitor.id,
        parameter=episode.parameter,
        campaign_id=UUID(episode.campaign),
        series=series.number,
        state="alarm",
        details=episode.details,
    )
    session.add(alarm)
    session.flush()
    session.refresh(alarm)
    _record(session, monitor, alarm, "raised", None, f"by campaign {episode.campaign}")


def _step(
    session: Session,
    monitor: Monitor,
    alarm: Alarm,
    state: str,
    note: str,
    user: User | None = None,
) -> None:
    alarm.state = state
    _record(session, monitor, alarm, state, user, note)


def _record(
    session: Session, monitor: Monitor, alarm: Alarm, event: str, user: User | None, note: str
) -> None:
    """Write a step into the history, the audit trail and the outbox."""
    structure = structure_of(session, monitor.structure_id)
    session.add(AlarmEvent(alarm_id=alarm.id, event=event, user_id=user and user.id, note=note))
    audit(
        session,
        user,
        f"alarm.{event}",
        "alarm",
        alarm.id,
        structure.project_id,
        parameter=alarm.parameter,
        note=note,
    )
    data = {"alarm": _summary(alarm), "note": note, "by": user and user.name}
    _announce(session, monitor, structure, f"alarm.{event}", data)


def _announce(
    session: Session, monitor: Monitor, structure: Structure, event: str, data: dict[str, Any]
) -> None:
    project_id = structure.project_id
    about = {
        "project_id": str(project_id),
        "structure": {"id": str(structure.id), "name": structure.name},
        "monitor": {"id": str(monitor.id), "name": monitor.name, "state": monitor.state},
    }
    data = {**about, **data}
    announce(
        session,
        event,
        data,
        project_id=project_id,
        monitor_id=monitor.id,
        receivers=monitor.receivers,
    )


def _summary(alarm: Alarm) -> dict[str, Any]:
    return {
        "id": str(alarm.id),
        "parameter": alarm.parameter,
        "unit": unit_of(alarm.parameter),
        "campaign_id": str(alarm.campaign_id),
        "series": alarm.series,
        "state": alarm.state,
        "details": alarm.details,
    }


def state_changed(session: Session, monitor: Monitor, before: str) -> None:
    """Announce that data stopped coming: silence would look like health."""
    if monitor.state == "no data":
        structure = structure_of(session, monitor.structure_id)
        _announce(session, monitor, structure, "monitor.no_data", {"before": before})


def acknowledge(session: Session, user: User, alarm: Alarm, note: str) -> None:
    """Note that somebody has seen an alarm. The monitor is judged anew with it.

    Raises:
        Conflict: it is no alarm, or no longer one.
        NotFound: its monitor has been deleted in between.
    """
    monitor = session.get_one(Monitor, alarm.monitor_id)
    # a judgement changes alarms too; first the monitor's row, always
    session.refresh(monitor, with_for_update=True)
    if monitor.deleted_at is not None:
        raise NotFound("alarm", alarm.id)
    session.refresh(alarm, with_for_update=True)
    if alarm.state != "alarm":
        raise Conflict(f"the alarm is {alarm.state}; only one that is open can be acknowledged")
    alarm.acknowledged_at, alarm.acknowledged_by, alarm.note = datetime.now(UTC), user.id, note
    _step(session, monitor, alarm, "acknowledged", note, user)
    session.flush()


def raised_with(session: Session, alarm: Alarm) -> Sequence[Alarm]:
    """The other open alarms of a monitor that the same campaign raised."""
    query = select(Alarm).where(
        Alarm.monitor_id == alarm.monitor_id,
        Alarm.campaign_id == alarm.campaign_id,
        Alarm.state == "alarm",
        Alarm.id != alarm.id,
    )
    return session.scalars(query.order_by(Alarm.id)).all()
