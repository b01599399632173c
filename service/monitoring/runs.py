"""Runs: from campaigns that are complete to update jobs, and from their ends to values.

`bring_up_to_date` compares what has been run with what should have been and starts the difference,
so it may be called as often as one likes, by anyone, in any transaction that holds the monitor's
row.

A run takes from an update's result watched values with the part of their uncertainty that differs
from one campaign to the next, and the laboratory's inputs, which all campaigns share, held at what
was stated.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import TYPE_CHECKING, Any
from uuid import UUID

from pydantic import ValidationError
from sqlalchemy import func, select
from sqlalchemy.dialects.postgresql import distinct_on
from sqlalchemy.orm import Session

from fecore import __version__
from fecore.dynamics.damping_laws import CaugheySeries
from fecore.errors import FecoreError
from fecore.quantities import quantity_of
from fecore.updating.parameters import constant_of, parametrise
from service.compute.judging import ModeEffects
from service.monitoring.campaigns import Candidate, candidates_of
from service.monitoring.tables import Monitor, MonitorRun, MonitorSeries
from service.nouns.campaigns.operations import campaign_of
from service.nouns.modes.operations import modes_of
from service.nouns.structures.operations import (
    describe_version,
    structure_for,
    structure_of,
    version_of,
)
from service.nouns.updating.bodies import usual_boundary
from service.nouns.updating.loading import body_for
from service.nouns.updating.operations import arrays_of, result_documents, start_update
from service.nouns.updating.schemas import ParameterIn, RecipeIn
from service.platform.access import Lookup, User
from service.platform.errors import ServiceError
from service.platform.queue.tables import Job

if TYPE_CHECKING:
    from service.nouns.modes.operations import Mode

monitor_for = Lookup(Monitor, "monitor", "structure_id", structure_for)
"""The monitor, if the user has at least a role in its project."""


def watched_values(session: Session, document: dict[str, Any]) -> dict[str, Any]:
    """Values of a result document.

    Returns:
        `parameters`: name to [estimate, noise-only standard deviation], both with the inputs held:
            a model error or a wrong
        thickness that all campaigns share does not move them; `modes`: (f, sd, ζ, sd) of each
        measured mode, `kinds`: of its motion; None where not known.
    """
    compared = {row["name"]: row["comparable"] for row in document["parameters"]}
    parameters = {
        name: [constant["estimate"], constant["standard_deviation"]]
        for name, constant in compared.items()
    }
    stated: dict[int, Mode] = {}
    if mode_set := document["provenance"].get("mode_set"):
        key = UUID(mode_set)
        stated = {mode.number: mode for mode in modes_of(session, [key])[key]}
    modes = []
    for row in document["modes"]:
        mode = stated.get(row["number"])
        sds = (None, None) if mode is None else (mode.frequency_sd_hz, mode.damping_sd)
        modes.append([row["measured_hz"], sds[0], row["measured_damping"], sds[1]])
    return {
        "parameters": parameters,
        "modes": modes,
        "kinds": [row.get("kind") for row in document["modes"]],
    }


def _scale(session: Session, key: UUID) -> float | None:
    """Scale of a run's FRFs to its model's; None where it had none."""
    arrays = arrays_of(session, key)
    if arrays is None or "frf_scale" not in arrays or not len(arrays["frf_scale"]):
        return None
    return float(arrays["frf_scale"][0])


def mode_effects_of(session: Session, run: MonitorRun) -> ModeEffects | None:
    """What would move a run's frequencies; None of a run of a version that did not keep it."""
    arrays = None if run.update_job_id is None else arrays_of(session, run.update_job_id)
    if arrays is None or "mass_effects" not in arrays:
        return None
    stiffness, support = (
        dict(zip(arrays[f"{kind}_names"].tolist(), arrays[f"{kind}_effects"], strict=True))
        for kind in ("stiffness", "support")
    )
    return ModeEffects(
        str(run.campaign_id), stiffness, support, arrays["mass_sites_m"], arrays["mass_effects"]
    )


def unit_of(parameter: str) -> str | None:
    """SI unit of a watched value; None of a spring's stiffness, whose name is the recipe's."""
    if (quantity := quantity_of(parameter)) is not None:
        return quantity.unit
    if parameter.startswith("frequency_"):
        return "Hz"
    if re.fullmatch(r"damping_ratio_\d+|zeta\d+", parameter):
        return "1"
    if parameter.startswith("g_"):
        return "1/s"
    if power := re.fullmatch(r"a(\d)", parameter):
        return CaugheySeries("", (int(power[1]),)).coefficient_units[0]
    return None


@dataclass(frozen=True)
class Moment:
    """When, and how long a campaign must have been left alone to count as complete."""

    now: datetime
    settle: timedelta


def newest_series(session: Session, monitor: Monitor) -> MonitorSeries:
    """The version of the series that new runs go into; the first one is made here. The transaction
    holds the monitor's row.
    """
    newest = session.scalars(
        select(MonitorSeries)
        .where(MonitorSeries.monitor_id == monitor.id)
        .order_by(MonitorSeries.number.desc())
        .limit(1)
    ).one_or_none()
    return newest or next_series(session, monitor, 1, "first series")


def next_series(session: Session, monitor: Monitor, number: int, reason: str) -> MonitorSeries:
    """Open a version of the series, one more than the newest; those before it stay as they are. The
    transaction holds the monitor's row.
    """
    row = MonitorSeries(monitor_id=monitor.id, number=number, software=__version__, reason=reason)
    session.add(row)
    session.flush()
    session.refresh(row)
    return row


def latest_runs(session: Session, series: MonitorSeries) -> dict[UUID, MonitorRun]:
    """The run that counts of each campaign, which is the one with the highest revision, by
    campaign.
    """
    rows = session.scalars(
        select(MonitorRun)
        .where(MonitorRun.series_id == series.id)
        .ext(distinct_on(MonitorRun.campaign_id))
        .order_by(MonitorRun.campaign_id, MonitorRun.revision.desc())
    )
    return {row.campaign_id: row for row in rows}


def collect(session: Session, series: MonitorSeries) -> None:
    """Take over the values of update jobs that have ended since: a run becomes `succeeded` with its
    values, or `failed` with the reason.
    """
    ended = session.execute(
        select(MonitorRun, Job)
        .join(Job, Job.id == MonitorRun.update_job_id)
        .where(
            MonitorRun.series_id == series.id,
            MonitorRun.state == "running",
            Job.state.in_(("succeeded", "failed", "cancelled")),
        )
        .execution_options(populate_existing=True)
    ).all()
    documents = result_documents(session, [job.id for _, job in ended])
    for run, job in ended:
        document = documents.get(job.id)
        run.finished_at = job.finished_at
        if document is None:
            run.state, run.message = "failed", job.message or f"the update job was {job.state}"
        else:
            run.state, run.software = "succeeded", document["provenance"]["software"]["modalbase"]
            run.values = watched_values(session, document) | {"frf_scale": _scale(session, job.id)}
    session.flush()


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
    candidates = candidates_of(session, monitor, moment.now, moment.settle)
    runs = latest_runs(session, series)
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
        run = _run(session, series, one, latest)
        if objection is not None:
            run.state, run.message, run.finished_at = "refused", objection, moment.now
        else:
            _start(session, monitor, run, one, runs)
        session.flush()
        runs[one.campaign.id] = run
        started.append(run)
    return started


def counted(
    candidates: Sequence[Candidate], runs: dict[UUID, MonitorRun]
) -> list[tuple[Candidate, MonitorRun]]:
    """The campaigns that make the series, in time order, each with its run: those without an
    objection whose latest run has succeeded.
    """
    pairs = ((one, runs.get(one.campaign.id)) for one in candidates if one.objection is None)
    return [(one, run) for one, run in pairs if run is not None and run.state == "succeeded"]


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
    structure = structure_of(session, monitor.structure_id)
    frozen = version_of(session, monitor.structure_version_id)
    if structure.version != frozen.number:
        return (
            f"the structure is now in version {structure.version}, this monitor's series is of"
            f" version {frozen.number}; make a new monitor for the changed structure"
        )
    return None


def _run(
    session: Session, series: MonitorSeries, one: Candidate, latest: MonitorRun | None
) -> MonitorRun:
    run = MonitorRun(
        series_id=series.id,
        campaign_id=one.campaign.id,
        revision=1 if latest is None else latest.revision + 1,
        fingerprint=one.fingerprint,
        state="running",
    )
    session.add(run)
    return run


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
