"""A monitor's series of runs as rows, and the values that runs take of updates.

A run takes from an update's result watched values with the part of their uncertainty that differs
from one campaign to the next, and the laboratory's inputs, which all campaigns share, held at what
was stated. A run of a monitor of modes takes the modes of a mode set.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any
from uuid import UUID

from sqlalchemy import Select, select
from sqlalchemy.dialects.postgresql import distinct_on
from sqlalchemy.orm import InstrumentedAttribute, Session

from fecore import __version__
from fecore.dynamics.damping_laws import CaugheySeries
from fecore.quantities import quantity_of
from service.nouns.modes.operations import amplitude_of, modes_of
from service.nouns.monitors.candidates import Candidate
from service.nouns.monitors.tables import Monitor, MonitorRun, MonitorSeries
from service.nouns.structures.operations import structure_for
from service.nouns.updates.operations import arrays_of, result_documents
from service.platform.access import Lookup
from service.platform.queue.tables import Job

if TYPE_CHECKING:
    from service.nouns.campaigns.operations import Campaign
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


def values_of_modes(session: Session, mode_set: UUID) -> dict[str, Any]:
    """The same of a mode set: no parameters, (f, sd, ζ, sd) of each of its modes, its key, by
    which a judgement reads the shapes, and the amplitude of its recordings among `covariates`.
    """
    modes = [
        [mode.frequency_hz, mode.frequency_sd_hz, mode.damping_ratio, mode.damping_sd]
        for mode in modes_of(session, [mode_set])[mode_set]
    ]
    measured = {"covariates": amplitude_of(session, mode_set)}
    return {"parameters": {}, "modes": modes, "mode_set": str(mode_set), **measured}


def _scale(session: Session, key: UUID) -> float | None:
    """Scale of a run's FRFs to its model's; None where it had none."""
    arrays = arrays_of(session, key)
    if arrays is None or "frf_scale" not in arrays or not len(arrays["frf_scale"]):
        return None
    return float(arrays["frf_scale"][0])


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


def latest_runs(
    session: Session, series: MonitorSeries, campaigns: Sequence[UUID] | None = None
) -> dict[UUID, MonitorRun]:
    """The run that counts of each campaign, or of each of these, which is the one with the highest
    revision, by campaign.
    """
    query = select(MonitorRun).where(MonitorRun.series_id == series.id)
    if campaigns is not None:
        query = query.where(MonitorRun.campaign_id.in_(campaigns))
    rows = session.scalars(
        query.ext(distinct_on(MonitorRun.campaign_id)).order_by(
            MonitorRun.campaign_id, MonitorRun.revision.desc()
        )
    )
    return {row.campaign_id: row for row in rows}


def covariates_of(run: MonitorRun | None, campaign: Campaign) -> dict[str, float]:
    """What is not climate: covariates as a campaign states them, before those that a run measured."""
    own = {} if run is None or run.values is None else run.values.get("covariates", {})
    return {**own, **campaign.covariates}


def collect(session: Session, series: MonitorSeries) -> None:
    """Take over the values of update jobs that have ended since: a run becomes `succeeded` with its
    values, or `failed` with the reason.
    """
    ended = _ended(session, series, MonitorRun.update_job_id)
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


def ended_jobs(session: Session, series: MonitorSeries) -> Sequence[tuple[MonitorRun, Job]]:
    """Runs of modes that are under way, each with its job, which has ended."""
    return _ended(session, series, MonitorRun.job_id)


def _ended(
    session: Session, series: MonitorSeries, of_run: InstrumentedAttribute[UUID | None]
) -> list[tuple[MonitorRun, Job]]:
    """Runs that are under way, each with the job that a column of theirs names, which has ended."""
    rows = session.execute(
        select(MonitorRun, Job)
        .join(Job, Job.id == of_run)
        .where(
            MonitorRun.series_id == series.id,
            MonitorRun.state == "running",
            Job.state.in_(("succeeded", "failed", "cancelled")),
        )
        .execution_options(populate_existing=True)
    )
    return [(run, job) for run, job in rows]


def new_run(
    session: Session, series: MonitorSeries, one: Candidate, latest: MonitorRun | None
) -> MonitorRun:
    """The next run of a campaign, which is under way."""
    run = MonitorRun(
        series_id=series.id,
        campaign_id=one.campaign.id,
        revision=1 if latest is None else latest.revision + 1,
        fingerprint=one.fingerprint,
        state="running",
    )
    session.add(run)
    return run


def arrival_of(
    session: Session, series: MonitorSeries, campaigns: Sequence[UUID]
) -> dict[UUID, UUID]:
    """Key of each of these campaigns' first run: the order in which they came in."""
    rows = session.execute(
        select(MonitorRun.campaign_id, MonitorRun.id)
        .where(MonitorRun.series_id == series.id, MonitorRun.campaign_id.in_(campaigns))
        .ext(distinct_on(MonitorRun.campaign_id))
        .order_by(MonitorRun.campaign_id, MonitorRun.id)
    )
    return dict(rows.all())


def runs_of(monitor: Monitor, series: int | None) -> Select[MonitorRun]:
    """The query of a monitor's runs, of one version of its series or of all."""
    query = select(MonitorRun).join(MonitorSeries).where(MonitorSeries.monitor_id == monitor.id)
    return query if series is None else query.where(MonitorSeries.number == series)
