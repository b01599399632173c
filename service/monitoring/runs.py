"""Runs: from campaigns that are complete to update jobs, or to modes.

`bring_up_to_date` compares what has been run with what should have been and starts the difference,
so it may be called as often as one likes, by anyone, in any transaction that holds the monitor's
row.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any
from uuid import UUID

from pydantic import ValidationError
from sqlalchemy import func
from sqlalchemy.orm import Session

from fecore import __version__
from fecore.errors import FecoreError
from fecore.updating.parameters import constant_of, parametrise
from service.monitoring.of_modes import begin, collect_modes
from service.nouns.campaigns.operations import campaign_of, campaigns_of
from service.nouns.monitors.candidates import Candidate, candidates_of
from service.nouns.monitors.operations import note_complete, running_on
from service.nouns.monitors.runs import (
    collect,
    latest_runs,
    monitor_for,
    new_run,
    newest_series,
    next_series,
)
from service.nouns.monitors.watching import request_check
from service.nouns.structures.operations import describe_version, structure_of, version_of
from service.nouns.updates.bodies import body_for, usual_boundary
from service.nouns.updates.schemas import ParameterIn, RecipeIn
from service.platform.access import User
from service.platform.errors import Conflict, Invalid, ServiceError
from service.tasks.update.task import start_update

if TYPE_CHECKING:
    from service.nouns.campaigns.operations import Campaign
    from service.nouns.monitors.tables import CampaignCompletion, Monitor, MonitorRun, MonitorSeries


@dataclass(frozen=True)
class Moment:
    """When, and how long a campaign must have been left alone to count as complete."""

    now: datetime
    settle: timedelta
    # whether of a long series only campaigns are looked at to which something came lately
    recent: bool = False


def bring_up_to_date(
    session: Session,
    monitor: Monitor,
    moment: Moment,
    *,
    by_hand: bool = False,
    only: UUID | None = None,
) -> list[MonitorRun]:
    """Start what should be run and is not. The transaction holds the monitor's row.

    Args:
        session: the transaction.
        monitor: which.
        moment: now.
        by_hand: run campaigns whether they are complete or not, and try failed ones again.
        only: this campaign alone.

    Returns:
        The new runs; refused ones too.
    """
    series = newest_series(session, monitor)
    of_modes = monitor.watches == "modes"
    candidates = candidates_of(
        session, monitor, moment.now, moment.settle, recent=of_modes and moment.recent
    )
    # a run with priors that are handed on looks at all before it
    among = [one.campaign.id for one in candidates] if of_modes else None
    runs = latest_runs(session, series, among)
    outdated = _outdated(session, monitor)
    started: list[MonitorRun] = []
    for one in candidates:
        latest = runs.get(one.campaign.id)
        if only is not None and one.campaign.id != only:
            continue
        if not (one.complete or by_hand) or not _is_due(one, latest, outdated, by_hand):
            continue
        if monitor.priors == "last" and not _may_follow(one, candidates, runs):
            break
        objection = one.objection or _held_otherwise(one, monitor) or outdated
        run = new_run(session, series, one, latest)
        if objection is not None:
            run.state, run.message, run.finished_at = "refused", objection, moment.now
        elif monitor.watches == "modes":
            begin(session, monitor, run, one)
        else:
            _start(session, monitor, run, one, runs)
        session.flush()
        runs[one.campaign.id] = run
        started.append(run)
    return started


def take_over(session: Session, monitor: Monitor, series: MonitorSeries) -> None:
    """Take over what the jobs of runs have brought since."""
    if monitor.watches == "modes":
        collect_modes(session, monitor, series)
    else:
        collect(session, series)


def _is_due(one: Candidate, latest: MonitorRun | None, outdated: str | None, by_hand: bool) -> bool:
    """Is there a run to start, or a refusal to note?"""
    if latest is None:
        return True
    if latest.state == "running":
        return False
    current = latest.fingerprint == one.fingerprint
    objection = one.objection or (None if current and latest.state == "succeeded" else outdated)
    if objection is not None:
        return latest.state != "refused" or latest.message != objection
    if latest.state == "succeeded":
        return not current
    return latest.state == "refused" or not current or by_hand


def _may_follow(
    one: Candidate, candidates: Sequence[Candidate], runs: dict[UUID, MonitorRun]
) -> bool:
    """With priors that are handed on, a run waits for the end of every earlier one."""
    earlier = [
        other.campaign.id
        for other in candidates
        if other.campaign.performed_at < one.campaign.performed_at  # type: ignore[operator]
    ]
    return not any(key in runs and runs[key].state == "running" for key in earlier)


def _held_otherwise(one: Candidate, monitor: Monitor) -> str | None:
    """A campaign that was seen before the monitor knew its boundary."""
    if monitor.boundary is None:
        monitor.boundary = one.campaign.boundary
    if one.campaign.boundary != monitor.boundary:
        return (
            f"the specimen was held {one.campaign.boundary!r}; this monitor compares campaigns held"
            f" {monitor.boundary!r}"
        )
    return None


def _outdated(session: Session, monitor: Monitor) -> str | None:
    """Why the monitor can start nothing any more, if that is so."""
    if monitor.watches == "modes":
        return None  # modes are of the structure, whatever is known of it
    structure = structure_of(session, monitor.structure_id)
    frozen = version_of(session, monitor.structure_version_id)
    if structure.version != frozen.number:
        return (
            f"the structure is now in version {structure.version}, this monitor's series is of"
            f" version {frozen.number}; make a new monitor for the changed structure"
        )
    return None


def _start(
    session: Session,
    monitor: Monitor,
    run: MonitorRun,
    one: Candidate,
    runs: dict[UUID, MonitorRun],
) -> None:
    """Queue the update in the name of the monitor's maker. A recipe that is refused makes a refused
    run with the reason.
    """
    user = session.get_one(User, monitor.user_id)
    try:
        with session.begin_nested():
            recipe = _recipe(session, monitor, one, runs)
            run.update_job_id = start_update(session, user, one.campaign.id, recipe).id
    except (ServiceError, FecoreError) as error:
        run.state, run.message, run.finished_at = "failed", str(error), func.now()
    except ValidationError as error:
        why = (
            f"this version does not take the frozen recipe: {error.errors()[0]['msg']}; make a new"
            " monitor"
        )
        run.state, run.message, run.finished_at = "failed", why, func.now()


def _recipe(
    session: Session, monitor: Monitor, one: Candidate, runs: dict[UUID, MonitorRun]
) -> RecipeIn:
    """The monitor's recipe for a campaign. Coefficients of temperature are its regression's: a
    campaign has one temperature.
    """
    kept = [
        each for each in monitor.recipe.get("parameters") or () if constant_of(each["name"]) is None
    ]
    own = {
        "mode_set": None if one.mode_set is None else str(one.mode_set),
        "parameters": kept or None,
    }
    recipe = RecipeIn.model_validate({**monitor.recipe, **own})
    if monitor.priors == "baseline":
        return recipe
    before = _run_before(session, one, runs)
    return recipe if before is None else _with_priors(session, monitor, recipe, before)


def _run_before(
    session: Session, one: Candidate, runs: dict[UUID, MonitorRun]
) -> dict[str, Any] | None:
    """Values of the last campaign before this one."""
    done = [
        run
        for run in runs.values()
        if run.state == "succeeded" and run.campaign_id != one.campaign.id
    ]
    dated = [(campaign_of(session, run.campaign_id).performed_at, run) for run in done]
    earlier = [(at, run) for at, run in dated if at is not None and at < one.campaign.performed_at]  # type: ignore[operator]
    return max(earlier, key=lambda pair: pair[0])[1].values if earlier else None


def _with_priors(
    session: Session, monitor: Monitor, recipe: RecipeIn, values: dict[str, Any]
) -> RecipeIn:
    """The recipe with the last estimates as prior means; widths stay, so that a prior never narrows
    down on the past.
    """
    version = version_of(session, monitor.structure_version_id)
    structure = structure_of(session, monitor.structure_id)
    described = describe_version(version, structure.name)
    specimen = body_for(session, described, monitor.boundary or usual_boundary(described), recipe)
    core = recipe.parameters_of(specimen)
    free = parametrise(specimen, core)
    widths = dict(zip(free.names, free.prior_sd.tolist(), strict=True))
    carried = []
    for parameter in core:
        last = values["parameters"].get(parameter.name)
        carried.append(
            ParameterIn(
                name=parameter.name,
                prior_mean=(
                    parameter.prior_mean
                    if parameter.name not in widths or last is None
                    else last[0]
                ),
                prior_sd=widths.get(parameter.name, parameter.prior_sd),
                fixed=parameter.fixed,
                tied_to=parameter.tied_to,
            )
        )
    return recipe.model_copy(update={"parameters": carried})


NOW = timedelta(0)


def run_by_hand(
    session: Session, user: User, monitor: Monitor, campaign_id: UUID | None
) -> list[MonitorRun]:
    """Run one campaign, or all that have not been run as they are now, whether they are complete or
    not.

    Returns:
        The new runs; refused ones too.

    Raises:
        Conflict: the monitor, which the transaction holds, is at rest.
        Invalid: the campaign is none of this structure's, or has no date.
    """
    if not monitor.active:
        raise Conflict("the monitor is at rest; set `active` first")
    if campaign_id is not None:
        _check_campaign(session, monitor, campaign_id)
    take_over(session, monitor, newest_series(session, monitor))
    started = bring_up_to_date(
        session, monitor, Moment(datetime.now(UTC), NOW), by_hand=True, only=campaign_id
    )
    monitor_for.note(session, user, monitor, "run", runs=[str(run.id) for run in started])
    request_check(session, monitor.id)
    return started


def _check_campaign(session: Session, monitor: Monitor, campaign_id: UUID) -> None:
    campaign = campaigns_of(session, [campaign_id]).get(campaign_id)
    if (
        campaign is None
        or campaign.deleted_at is not None
        or campaign.structure_id != monitor.structure_id
    ):
        raise Invalid("/campaign", f"{campaign_id} is no campaign of this monitor's structure")
    if campaign.performed_at is None:
        raise Invalid(
            "/campaign", "the campaign states no performed_at, so it has no place in a series"
        )
    if monitor.since is not None and campaign.performed_at < monitor.since:
        raise Invalid(
            "/campaign",
            f"the campaign was performed before the series begins, {monitor.since.isoformat()}",
        )


def rerun(session: Session, user: User, monitor: Monitor, reason: str) -> list[MonitorRun]:
    """Run all campaigns anew, as the next version of the series, with the software's version as the
    default reason. The one before stays, and is shown until this one is judged.

    Raises:
        Conflict: the monitor, which the transaction holds, is at rest.
    """
    before = newest_series(session, monitor)
    next_series(session, monitor, before.number + 1, reason or f"rerun with version {__version__}")
    return run_by_hand(session, user, monitor, None)


def complete_campaign(
    session: Session, user: User, campaign: Campaign
) -> tuple[CampaignCompletion, list[MonitorRun]]:
    """Note that everything of a campaign is in, and let the monitors of its structure run it.

    Returns:
        The note, which the first call makes, and the runs that were started.

    Raises:
        Conflict: the campaign states no date.
    """
    row = note_complete(session, user, campaign)
    started: list[MonitorRun] = []
    for monitor in running_on(session, campaign):
        take_over(session, monitor, newest_series(session, monitor))
        started += bring_up_to_date(
            session, monitor, Moment(datetime.now(UTC), NOW, recent=True), only=campaign.id
        )
        request_check(session, monitor.id)
    return row, started
