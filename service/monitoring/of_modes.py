"""Runs of monitors of modes: from a campaign to a mode set.

A campaign whose modes are stated gives them at once. From FRFs or half spectra they are identified,
and from time blocks or recordings these are made first; each is a job like one that a person
starts, in the name of the monitor's maker.
"""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING

from sqlalchemy import func
from sqlalchemy.orm import Session

from fecore import __version__
from fecore.errors import FecoreError
from service.nouns.modes.operations import identified_by
from service.nouns.monitors.candidates import candidates_of
from service.nouns.monitors.runs import ended_jobs, values_of_modes
from service.nouns.records.schemas import CampaignProcessingIn
from service.platform.access import User
from service.platform.errors import ServiceError
from service.tasks.identify.task import IdentificationIn, start_identification
from service.tasks.process.task import PROCESSINGS, start_processing

if TYPE_CHECKING:
    from uuid import UUID

    from service.nouns.monitors.candidates import Candidate
    from service.nouns.monitors.tables import Monitor, MonitorRun, MonitorSeries


def begin(session: Session, monitor: Monitor, run: MonitorRun, one: Candidate) -> None:
    """Take the modes of a campaign, or queue what finds them. What is refused makes a failed run
    with the reason.
    """
    if one.mode_set is not None:
        _succeed(session, run, one.mode_set)
    else:
        _queue(session, monitor, run, process=one.unprocessed)


def collect_modes(session: Session, monitor: Monitor, series: MonitorSeries) -> None:
    """Take over the mode sets of identifications that have ended since, and identify what was
    processed.
    """
    ended = ended_jobs(session, series)
    identified = identified_by(session, [job.id for _, job in ended])
    for run, job in ended:
        if job.id in identified:
            _succeed(session, run, identified[job.id])
        elif job.state == "succeeded" and job.kind == PROCESSINGS.kind.name:
            _queue(session, monitor, run, process=False)
            # what it is of now has the FRFs that were made of its time blocks
            run.fingerprint = _fingerprint(session, monitor, run)
        else:
            run.state, run.finished_at = "failed", job.finished_at
            run.message = job.message or f"the {job.kind} was {job.state} and gave no modes"
    session.flush()


def _fingerprint(session: Session, monitor: Monitor, run: MonitorRun) -> str:
    now = datetime.now(UTC)
    present = candidates_of(session, monitor, now, timedelta(0), only=run.campaign_id)
    return present[0].fingerprint if present else run.fingerprint


def _succeed(session: Session, run: MonitorRun, mode_set: UUID) -> None:
    run.state, run.software, run.finished_at = "succeeded", __version__, func.now()
    run.values = values_of_modes(session, mode_set)


def _queue(session: Session, monitor: Monitor, run: MonitorRun, *, process: bool) -> None:
    user = session.get_one(User, monitor.user_id)
    try:
        with session.begin_nested():
            if process:
                body = CampaignProcessingIn.model_validate({})
                run.job_id = start_processing(session, user, run.campaign_id, body).id
            else:
                request = IdentificationIn.model_validate({})
                run.job_id = start_identification(session, user, run.campaign_id, request).id
    except (ServiceError, FecoreError) as error:
        run.state, run.message, run.finished_at = "failed", str(error), func.now()
