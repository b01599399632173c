"""What can be done with monitors themselves: make, change, list, show the series."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any
from uuid import UUID

from sqlalchemy import func, select, tuple_
from sqlalchemy.orm import Session, undefer

from fecore.quantities import quantity_of
from fecore.updating.parameters import parametrise, usual_per_k
from service.nouns.campaigns.operations import campaign_for
from service.nouns.monitors.alarms import rank
from service.nouns.monitors.runs import monitor_for, newest_series
from service.nouns.monitors.schemas import (
    BaselineIn,
    ChartIn,
    MonitorIn,
    MonitorOut,
    MonitorPatch,
    WatchedIn,
)
from service.nouns.monitors.tables import (
    AT_WORK,
    Alarm,
    CampaignCompletion,
    Monitor,
    MonitorSeries,
    hidden,
)
from service.nouns.monitors.watching import next_time, request_check
from service.nouns.notifications.addresses import AddressError
from service.nouns.notifications.channels import OF_MONITORS
from service.nouns.structures.operations import (
    current_version,
    describe_version,
    structure_for,
    structures_in,
    structures_of,
)
from service.nouns.updates.bodies import body_for, check_prior_batch, usual_boundary
from service.platform.access import User, projects_of
from service.platform.db.base import transaction_time
from service.platform.errors import Conflict, Invalid, NotFound
from service.platform.settings import Settings
from service.platform.web import shown_as

if TYPE_CHECKING:
    from service.nouns.campaigns.operations import Campaign
    from service.nouns.structures.operations import Structure


def create_monitor(
    session: Session, user: User, structure_id: UUID, body: MonitorIn, settings: Settings
) -> Monitor:
    """Make a monitor, frozen on the structure's present version. Campaigns that are there are run
    in time order; the updates run in the name of who asks, an editor of the project at least.

    Raises:
        Invalid: the recipe names what no later campaign has, a parameter is watched that it does
            not update, or an address is one that its channel refuses.
        NotFound: there is no such structure, or it is other people's.
        Forbidden: the user's role is too low.
    """
    structure = structure_for(session, user, structure_id, "editor")
    receivers = _receivers(body, settings)
    version = current_version(session, structure)
    _check_chart(body.chart)
    watched, per_kelvin = (
        (body.watched(()), {})
        if body.watch == "modes"
        else _checked(session, user, structure, body, describe_version(version, structure.name))
    )
    stated = body.model_dump(mode="json", include=_AS_STATED)
    if body.watch == "modes":
        stated["recipe"] = {}
    now = datetime.now(UTC)
    monitor = Monitor(
        structure_id=structure.id,
        structure_version_id=version.id,
        user_id=user.id,
        watches=body.watch,
        **stated,
        receivers=receivers,
        watch=_frozen_watch(body, watched, per_kelvin),
        since=body.baseline.since,
        next_run_at=None if body.schedule is None else next_time(body.schedule, now),
        state_rank=rank("no data"),
    )
    session.add(monitor)
    session.flush()
    session.refresh(monitor)
    newest_series(session, monitor)
    monitor_for.note(session, user, monitor, "create", name=body.name)
    request_check(session, monitor.id)
    return monitor


PerKelvin = Mapping[str, tuple[float, float]]
"""Of watched parameters, mean and standard deviation of their relative change per kelvin."""

_AS_STATED = {
    *("name", "boundary", "recipe", "modes", "priors"),
    *("expected_interval_days", "runs_on", "schedule", "active"),
}
"""What a monitor's row has as the body states it."""


def _frozen_watch(
    body: MonitorIn, watched: Sequence[WatchedIn], per_kelvin: PerKelvin
) -> dict[str, Any]:
    watch = asdict(body.to_watch(watched, per_kelvin))
    del watch["expected_interval_days"]
    return {**watch, "covariates": list(body.covariates)}


def _check_chart(chart: ChartIn) -> None:
    """Refuse what is of another kind of chart.

    Raises:
        Invalid: it is stated.
    """
    for name, kind in (("weight", "ewma"), ("reference", "cusum")):
        if chart.kind != kind and getattr(chart, name) != ChartIn.model_fields[name].default:
            raise Invalid(
                f"/chart/{name}",
                f"is of the chart {kind}, and the chart is {chart.kind}: leave it out",
            )


def _checked(
    session: Session, user: User, structure: Structure, body: MonitorIn, described: Any
) -> tuple[list[WatchedIn], PerKelvin]:
    """What is watched, once the recipe is one that any later campaign can have, and its changes by
    temperature.
    """
    recipe = body.recipe
    if recipe.mode_set is not None:
        raise Invalid(
            "/recipe/mode_set",
            "a mode set is of one campaign; say with `modes` where each run takes its from",
        )
    if recipe.reference_temperature_c is not None:
        why = (
            "every campaign of a monitor is judged at its own temperature, of which `covariates`"
            " takes the effect out"
        )
        raise Invalid("/recipe/reference_temperature_c", f"{why}: leave it out")
    check_prior_batch(session, user, recipe, structure.id, "/recipe/prior_from_coupon_batch")
    recipe.inputs.to_core()
    specimen = body_for(session, described, body.boundary or usual_boundary(described), recipe)
    parameters = recipe.parameters_of(specimen)
    free = parametrise(specimen, parameters).names
    watched = body.watched(free)
    for i, each in enumerate(watched):
        if quantity_of(each.name) is not None and each.name not in free:
            raise Invalid(
                f"/parameters/{i}/name",
                f"{each.name} is not updated by the recipe, which updates {', '.join(free)}",
            )
    stated = {each.name: (each.prior_mean, each.prior_sd) for each in parameters}
    known = {each.name: usual_per_k(each.name, specimen.nominal, stated) for each in watched}
    return watched, {
        name: per_kelvin for name, per_kelvin in known.items() if per_kelvin is not None
    }


def _receivers(stated: MonitorIn | MonitorPatch, settings: Settings) -> dict[str, list[str]]:
    """The addresses that a body states, by the names of their channels.

    Raises:
        Invalid: a channel refuses one.
    """
    receivers = {}
    for member, channel in OF_MONITORS.items():
        if member in stated.model_fields_set:
            receivers[channel.name] = addresses = list(getattr(stated, member))
            for address in addresses:
                try:
                    channel.check(address, settings)
                except AddressError as error:
                    raise Invalid(f"/{member}", str(error)) from None
    return receivers


def _addresses(monitor: Monitor) -> dict[str, list[str]]:
    """The addresses of a monitor, by the members that state them."""
    return {
        member: monitor.receivers.get(channel.name, []) for member, channel in OF_MONITORS.items()
    }


def change_monitor(
    session: Session, user: User, monitor: Monitor, patch: MonitorPatch, settings: Settings
) -> None:
    """Apply a patch to a locked monitor; the audit trail keeps the fields as they were and as they
    are now. The recipe cannot change.

    Raises:
        Invalid: an address is one that its channel refuses.
    """
    receivers = {**monitor.receivers, **_receivers(patch, settings)}
    now = patch.model_dump(exclude_unset=True)
    before = _addresses(monitor)
    was = {field: before[field] if field in before else getattr(monitor, field) for field in now}
    for field in now.keys() - before.keys():
        setattr(monitor, field, now[field])
    monitor.receivers = receivers
    monitor.updated_at = transaction_time(session)
    session.flush()
    monitor_for.note(session, user, monitor, "change", was=was, now=now)
    request_check(session, monitor.id)


def note_complete(
    session: Session, user: User, campaign: Campaign, *, dated_by_file: bool = False
) -> CampaignCompletion:
    """Note that everything of a campaign is in; the first call makes the note.

    Args:
        session: the transaction.
        user: who says so.
        campaign: which.
        dated_by_file: a file that is on its way states the date.

    Raises:
        Conflict: the campaign states no date, and no file does.
    """
    if campaign.performed_at is None and not dated_by_file:
        raise Conflict(
            "the campaign states no performed_at, so it has no place in a series; state it first"
        )
    row = session.get(CampaignCompletion, campaign.id)
    if row is None:
        row = CampaignCompletion(campaign_id=campaign.id, user_id=user.id)
        session.add(row)
        session.flush()
        session.refresh(row)
        campaign_for.note(session, user, campaign, "complete")
    return row


def running_on(session: Session, campaign: Campaign) -> Sequence[Monitor]:
    """The monitors that run each campaign of its structure; their rows are held."""
    return session.scalars(
        select(Monitor)
        .where(
            Monitor.structure_id == campaign.structure_id, AT_WORK, Monitor.runs_on == "campaign"
        )
        .order_by(Monitor.id)
        .with_for_update()
    ).all()


def monitors_of(session: Session, structure_id: UUID) -> Sequence[Monitor]:
    """The monitors of a structure that are there, oldest first."""
    query = select(Monitor).where(Monitor.structure_id == structure_id, hidden(deleted=False))
    return session.scalars(query.order_by(Monitor.id)).all()


def page_worst_first(
    session: Session, user: User, state: str | None, deleted: bool, cursor: str | None, limit: int
) -> tuple[list[Monitor], str | None]:
    """A page of one's monitors, in this state where one is given, ordered by the attention that it
    asks for, then by age; and the cursor of the next page, None at the end. `deleted` lists the
    deleted ones instead of those that are there.

    Raises:
        Invalid: the cursor is not one of this list.
    """
    query = select(Monitor).where(
        Monitor.structure_id.in_(structures_in(projects_of(user))), hidden(deleted)
    )
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
        raise Invalid(
            "cursor", "is not a cursor of this list; take `next_cursor` of a page"
        ) from None


def describe_all(session: Session, monitors: Sequence[Monitor]) -> list[MonitorOut]:
    """Monitors as clients see them, in the order given, each with its structure, its maker and the
    number of its open alarms; two queries for all.
    """
    ids = [monitor.id for monitor in monitors]
    structures = structures_of(session, [monitor.structure_id for monitor in monitors])
    made = select(Monitor.id, User.name).join(User).where(Monitor.id.in_(ids))
    makers: dict[UUID, str] = dict(session.execute(made).all())
    open_alarms = select(Alarm.monitor_id, func.count()).where(
        Alarm.monitor_id.in_(ids), Alarm.state == "alarm"
    )
    alarms: dict[UUID, int] = dict(session.execute(open_alarms.group_by(Alarm.monitor_id)).all())
    return [
        _described(m, structures[m.structure_id], makers[m.id], alarms.get(m.id, 0))
        for m in monitors
    ]


def _described(monitor: Monitor, structure: Structure, maker: str, open_alarms: int) -> MonitorOut:
    watch = monitor.watch
    frozen = {
        name: watch[name] for name in ("covariates", "false_alarm_rate", "horizon", "pending")
    }
    return shown_as(
        MonitorOut,
        monitor,
        **frozen,
        **_addresses(monitor),
        watch=monitor.watches,
        structure_name=structure.name,
        project_id=structure.project_id,
        acts_for=maker,
        parameters=[
            WatchedIn(name=name, direction=direction)
            for name, direction in watch["directions"].items()
        ],
        baseline=BaselineIn(campaigns=watch["baseline"], since=monitor.since),
        chart=ChartIn(**watch["chart"]),
        open_alarms=open_alarms,
    )


def series_for(session: Session, monitor: Monitor, number: int | None) -> MonitorSeries:
    """A version of the series; by default the one that is judged, or the first one while none is.

    Raises:
        NotFound: there is no such version.
    """
    version = number if number is not None else max(monitor.series, 1)
    row = session.execute(
        select(MonitorSeries, Monitor)  # at one moment: a judgement changes both
        .join(Monitor, Monitor.id == MonitorSeries.monitor_id)
        .where(Monitor.id == monitor.id, MonitorSeries.number == version)
        .options(undefer(MonitorSeries.document))
        .execution_options(populate_existing=True)
    ).one_or_none()
    if row is None:
        raise NotFound("version of this series", version)
    return row[0]
