"""What can be done with monitors themselves: make, change, list, run, show the series."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Sequence
from dataclasses import asdict
from datetime import UTC, datetime, timedelta
from typing import Any
from uuid import UUID

from sqlalchemy import ColumnElement, func, select, tuple_
from sqlalchemy.orm import Session, undefer

from fecore import __version__
from fecore.updating.parameters import parametrise
from service.access import Member, Role, User, audit, bring_back, hide
from service.campaigns.tables import Campaign
from service.coupons.operations import batch_for
from service.db.clock import transaction_time
from service.monitoring import runs
from service.monitoring.assessment import rank
from service.monitoring.schemas import CONSTANT, BaselineIn, ChartIn, MonitorIn, MonitorOut, MonitorPatch, WatchedIn
from service.monitoring.steward import ask, next_time
from service.monitoring.tables import AT_WORK, Alarm, CampaignCompletion, Monitor, MonitorRun, MonitorSeries
from service.problems import Conflict, Invalid, NotFound, not_found_as
from service.settings import Settings
from service.structures.operations import current_version, describe_version, structure_for
from service.structures.tables import Structure
from service.updating.loading import nominal_specimen

NOW = timedelta(0)


def monitor_for(
    session: Session,
    user: User,
    monitor_id: UUID,
    role: Role = "viewer",
    *,
    lock: bool = False,
    deleted: bool = False,
) -> Monitor:
    """The monitor, if the user has at least this role in its project.

    Args:
        session: the request's transaction.
        user: who asks.
        monitor_id: which one.
        role: what the act needs.
        lock: keep the steward, judgements and other edits off it until the transaction ends.
        deleted: find a deleted monitor too.

    Raises:
        NotFound: there is none, it is other people's, or it is deleted.
        Forbidden: the user's role is too low.
    """
    monitor = session.get(Monitor, monitor_id)
    if monitor is None:
        raise NotFound("monitor", monitor_id)
    with not_found_as("monitor", monitor_id):
        structure_for(session, user, monitor.structure_id, role)
    if lock:
        session.refresh(monitor, with_for_update=True)
    if monitor.deleted_at is not None and not deleted:
        raise NotFound("monitor", monitor_id)
    return monitor


def create_monitor(session: Session, user: User, structure_id: UUID, body: MonitorIn, settings: Settings) -> Monitor:
    """A new monitor, frozen on the structure's present version. Campaigns that are there are run in time order.

    Raises:
        Invalid: the recipe names what no later campaign has, a parameter is watched that it does not update, or mail is
            wanted and no SMTP server is set.
    """
    structure = structure_for(session, user, structure_id, "editor")
    version = current_version(session, structure)
    _check_recipe(session, user, structure, body, describe_version(version, structure.name))
    _check_mail(body.mail_to, settings)
    now = datetime.now(UTC)
    monitor = Monitor(
        structure_id=structure.id,
        structure_version_id=version.id,
        user_id=user.id,
        name=body.name,
        boundary=body.boundary,
        recipe=body.recipe.model_dump(mode="json"),
        modes=body.modes,
        priors=body.priors,
        watch=_frozen_watch(body),
        since=body.baseline.since,
        expected_interval_days=body.expected_interval_days,
        runs_on=body.runs_on,
        schedule=body.schedule,
        next_run_at=None if body.schedule is None else next_time(body.schedule, now),
        mail_to=body.mail_to,
        state_rank=rank("no data"),
    )
    session.add(monitor)
    session.flush()
    session.refresh(monitor)
    runs.newest_series(session, monitor)
    audit(session, user, "monitor.create", "monitor", monitor.id, structure.project_id, name=body.name)
    ask(session, monitor.id)
    return monitor


def _frozen_watch(body: MonitorIn) -> dict[str, Any]:
    watch = asdict(body.to_watch())
    del watch["expected_interval_days"]
    return {**watch, "covariates": list(body.covariates)}


def _check_recipe(session: Session, user: User, structure: Structure, body: MonitorIn, described: Any) -> None:
    recipe = body.recipe
    if recipe.mode_set is not None:
        raise Invalid(
            "/recipe/mode_set", "a mode set is of one campaign; say with `modes` where each run takes its from"
        )
    if recipe.prior_from_coupon_batch is not None:
        try:
            batch = batch_for(session, user, recipe.prior_from_coupon_batch)
        except NotFound as error:
            raise Invalid("/recipe/prior_from_coupon_batch", str(error)) from None
        if batch.structure_id != structure.id:
            raise Invalid("/recipe/prior_from_coupon_batch", f"{batch.id} belongs to another structure")
    specimen = nominal_specimen(described, body.boundary or "cantilever")
    free = parametrise(specimen, recipe.to_core().parameters).names
    for i, watched in enumerate(body.parameters):
        if CONSTANT.fullmatch(watched.name) and watched.name not in free:
            raise Invalid(
                f"/parameters/{i}/name", f"{watched.name} is not updated by the recipe, which updates {', '.join(free)}"
            )


def _check_mail(addresses: Sequence[str], settings: Settings) -> None:
    if addresses and settings.smtp_host is None:
        raise Invalid("/mail_to", "the operator has set no SMTP server (MODALBASE_SMTP_HOST); use a webhook")


def change_monitor(session: Session, user: User, monitor: Monitor, patch: MonitorPatch, settings: Settings) -> None:
    """Apply a patch to a locked monitor."""
    if patch.mail_to:
        _check_mail(patch.mail_to, settings)
    now = patch.model_dump(exclude_unset=True)
    was = {field: getattr(monitor, field) for field in now}
    for field, value in now.items():
        setattr(monitor, field, value)
    monitor.updated_at = transaction_time(session)
    session.flush()
    audit(session, user, "monitor.change", "monitor", monitor.id, _project_of(session, monitor), was=was, now=now)
    ask(session, monitor.id)


def delete_monitor(session: Session, user: User, monitor: Monitor) -> None:
    """Hide a locked monitor with its series and alarms, and run and judge nothing more; everything stays stored.

    Runs under way end, since their updates are results of their own; a judgement under way changes and tells nothing.
    """
    hide(session, user, monitor, "monitor", _project_of(session, monitor))


def restore_monitor(session: Session, user: User, monitor: Monitor) -> None:
    """Bring a locked monitor back; campaigns that came in between are run, and the series is judged anew.

    Raises:
        Conflict: the monitor is not deleted.
    """
    bring_back(session, user, monitor, "monitor", _project_of(session, monitor))
    ask(session, monitor.id)


def _project_of(session: Session, monitor: Monitor) -> UUID:
    return session.get_one(Structure, monitor.structure_id).project_id


def run_by_hand(session: Session, user: User, monitor: Monitor, campaign_id: UUID | None) -> list[MonitorRun]:
    """Run one campaign, or all that have not been run as they are now; complete or not.

    Raises:
        Conflict: the monitor is at rest.
        Invalid: the campaign is none of this structure's, or has no date.
    """
    if not monitor.active:
        raise Conflict("the monitor is at rest; set `active` first")
    if campaign_id is not None:
        _check_campaign(session, monitor, campaign_id)
    project = _project_of(session, monitor)
    runs.collect(session, runs.newest_series(session, monitor))
    started = runs.bring_up_to_date(
        session, monitor, runs.Moment(datetime.now(UTC), NOW), by_hand=True, only=campaign_id
    )
    audit(session, user, "monitor.run", "monitor", monitor.id, project, runs=[str(run.id) for run in started])
    ask(session, monitor.id)
    return started


def _check_campaign(session: Session, monitor: Monitor, campaign_id: UUID) -> None:
    campaign = session.get(Campaign, campaign_id)
    if campaign is None or campaign.deleted_at is not None or campaign.structure_id != monitor.structure_id:
        raise Invalid("/campaign", f"{campaign_id} is no campaign of this monitor's structure")
    if campaign.performed_at is None:
        raise Invalid("/campaign", "the campaign states no performed_at, so it has no place in a series")
    if monitor.since is not None and campaign.performed_at < monitor.since:
        raise Invalid("/campaign", f"the campaign was performed before the series begins, {monitor.since.isoformat()}")


def rerun(session: Session, user: User, monitor: Monitor, reason: str) -> list[MonitorRun]:
    """All campaigns anew, as the next version of the series. The one before stays, and is shown until this is judged."""
    if not monitor.active:
        raise Conflict("the monitor is at rest; set `active` first")
    before = runs.newest_series(session, monitor)
    runs.next_series(session, monitor, before.number + 1, reason or f"rerun with version {__version__}")
    return run_by_hand(session, user, monitor, None)


def complete_campaign(session: Session, user: User, campaign: Campaign) -> tuple[CampaignCompletion, list[MonitorRun]]:
    """Note that everything of a campaign is in, and let the monitors of its structure run it.

    Raises:
        Conflict: the campaign states no date.
    """
    if campaign.performed_at is None:
        raise Conflict("the campaign states no performed_at, so it has no place in a series; state it first")
    row = session.get(CampaignCompletion, campaign.id)
    project = session.get_one(Structure, campaign.structure_id).project_id
    if row is None:
        row = CampaignCompletion(campaign_id=campaign.id, user_id=user.id)
        session.add(row)
        session.flush()
        session.refresh(row)
        audit(session, user, "campaign.complete", "campaign", campaign.id, project)
    monitors = session.scalars(
        select(Monitor)
        .where(Monitor.structure_id == campaign.structure_id, AT_WORK, Monitor.runs_on == "campaign")
        .order_by(Monitor.id)
        .with_for_update()
    ).all()
    started: list[MonitorRun] = []
    for monitor in monitors:
        runs.collect(session, runs.newest_series(session, monitor))
        started += runs.bring_up_to_date(session, monitor, runs.Moment(datetime.now(UTC), NOW), only=campaign.id)
        ask(session, monitor.id)
    return row, started


def hidden(deleted: bool) -> ColumnElement[bool]:
    """The condition of a list: the monitors that are there, or the deleted ones instead."""
    return Monitor.deleted_at.is_not(None) if deleted else Monitor.deleted_at.is_(None)


def page_worst_first(
    session: Session, user: User, state: str | None, deleted: bool, cursor: str | None, limit: int
) -> tuple[list[Monitor], str | None]:
    """One's monitors by the attention that their state asks for, then by age."""
    mine = select(Member.project_id).where(Member.user_id == user.id)
    query = select(Monitor).join(Structure).where(Structure.project_id.in_(mine), hidden(deleted))
    if state is not None:
        query = query.where(Monitor.state == state)
    if cursor is not None:
        query = query.where(tuple_(Monitor.state_rank, Monitor.id) > _decode(cursor))
    rows = session.scalars(query.order_by(Monitor.state_rank, Monitor.id).limit(limit + 1)).all()
    page = list(rows[:limit])
    if len(rows) <= limit:
        return page, None
    return page, base64.urlsafe_b64encode(bytes([page[-1].state_rank]) + page[-1].id.bytes).decode()


def _decode(cursor: str) -> tuple[int, UUID]:
    try:
        raw = base64.urlsafe_b64decode(cursor)
        return raw[0], UUID(bytes=raw[1:])
    except (ValueError, IndexError, binascii.Error):
        raise Invalid("cursor", "is not a cursor of this list; take `next_cursor` of a page") from None


def describe_all(session: Session, monitors: Sequence[Monitor]) -> list[MonitorOut]:
    """Monitors as clients see them."""
    ids = [monitor.id for monitor in monitors]
    query = select(Monitor.id, Structure, User.name).join(Structure, Structure.id == Monitor.structure_id)
    around = {key: (s, name) for key, s, name in session.execute(query.join(User).where(Monitor.id.in_(ids)))}
    open_alarms = select(Alarm.monitor_id, func.count()).where(Alarm.monitor_id.in_(ids), Alarm.state == "alarm")
    alarms: dict[UUID, int] = dict(session.execute(open_alarms.group_by(Alarm.monitor_id)).tuples().all())
    return [_described(m, *around[m.id], alarms.get(m.id, 0)) for m in monitors]


def _described(monitor: Monitor, structure: Structure, maker: str, open_alarms: int) -> MonitorOut:
    watch = monitor.watch
    same = {name: getattr(monitor, name) for name in MonitorOut.model_fields if hasattr(monitor, name)}
    frozen = {name: watch[name] for name in ("covariates", "false_alarm_rate", "horizon", "pending")}
    return MonitorOut(
        **same,
        **frozen,
        structure_name=structure.name,
        project_id=structure.project_id,
        acts_for=maker,
        parameters=[WatchedIn(name=name, direction=direction) for name, direction in watch["directions"].items()],
        baseline=BaselineIn(campaigns=watch["baseline"], since=monitor.since),
        chart=ChartIn(**watch["chart"]),
        open_alarms=open_alarms,
    )


def series_for(session: Session, monitor: Monitor, number: int | None) -> MonitorSeries:
    """A version of the series; by default the one that is judged, or the first one while none is.

    Raises:
        NotFound: there is no such version.
    """
    wanted = number if number is not None else max(monitor.series, 1)
    found = session.execute(
        select(MonitorSeries, Monitor)  # at one moment: a judgement changes both
        .join(Monitor, Monitor.id == MonitorSeries.monitor_id)
        .where(Monitor.id == monitor.id, MonitorSeries.number == wanted)
        .options(undefer(MonitorSeries.document))
        .execution_options(populate_existing=True)
    ).one_or_none()
    if found is None:
        raise NotFound("version of this series", wanted)
    return found[0]
