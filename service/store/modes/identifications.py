"""Identifications: a job that finds the modes of a campaign in its FRFs and keeps them as a mode set."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any
from uuid import UUID

from pydantic import Field
from sqlalchemy import select
from sqlalchemy.orm import Session

from fecore.errors import InputError
from fecore.modal import Options
from fecore.modes import MeasuredModes
from service.access import Lookup, User, audit
from service.compute.identification_document import up_to_date
from service.compute.identifying import IdentificationInputs, IdentificationOutput, find_modes
from service.jobs.kinds import CORE_LIBRARIES, JobKind
from service.jobs.queue import enqueue, request_cancel
from service.jobs.state import JobOut, job_state
from service.jobs.tables import Job
from service.store.campaigns.operations import campaign_for, campaign_of, frame_of
from service.store.frfs.measured_campaign import load_measured_campaign
from service.store.modes.operations import EVIDENCE, store_identified
from service.store.modes.tables import Identification, ModeSet
from service.store.storage import require_room
from service.web import Name, StrictModel, example

Frequency = Annotated[float, Field(ge=0, le=1e7, description="Hz")]


class IdentificationIn(StrictModel):
    """How to identify; `{}` will do."""

    model_config = example()

    name: Name = "identified"
    band_hz: tuple[Frequency, Frequency] | None = Field(None, description="lines to use; default: all")
    highest_order: int = Field(40, ge=4, le=200, description="of the linear stage")
    most_modes: int = Field(100, ge=1, le=200, description="poles of the fitted series")
    threshold: float = Field(
        0.9, ge=0.1, le=1, description="probability from which a pole is a mode; below, it is uncertain"
    )
    include_doubtful: bool = Field(
        False, description="keep the uncertain poles, from probability 0.1 on, in the mode set too"
    )

    def options(self) -> Options:
        """The core's options.

        Raises:
            InputError: the band is empty.
        """
        if self.band_hz is not None and not self.band_hz[0] < self.band_hz[1]:
            raise InputError("band_hz", f"is ({self.band_hz[0]:g}, {self.band_hz[1]:g}), expected low < high")
        return Options(self.band_hz, self.highest_order, self.most_modes, self.threshold)


class IdentificationOut(JobOut):
    """An identification: how far it is, and what it found."""

    campaign_id: UUID
    options: IdentificationIn
    mode_set: UUID | None = Field(description="the modes that it found")
    result: dict[str, Any] | None = Field(description="quality of the modes, what was left out, stabilisation diagram")


def _load(session: Session, job_id: UUID, _workspace: Path) -> IdentificationInputs:
    row = session.get_one(Identification, job_id)
    campaign = load_measured_campaign(session, row.campaign_id)
    if not campaign.frf_sets:
        raise InputError("campaign", "has no FRFs; import a UFF file first")
    asked = IdentificationIn.model_validate(row.options)
    frfs = tuple(used.frfs for used in campaign.frf_sets)
    windows = [remark for used in campaign.frf_sets for remark in used.window_remark]
    return IdentificationInputs(
        frfs, asked.options(), asked.include_doubtful, (*campaign.warnings, *dict.fromkeys(windows))
    )


def _store(session: Session, job_id: UUID, items: Iterator[IdentificationOutput]) -> None:
    row = session.get_one(Identification, job_id)
    name = IdentificationIn.model_validate(row.options).name
    for output in items:
        row.document = output.document
        keep_identified(session, row.campaign_id, name, output.modes, output.document, job_id=job_id)


IDENTIFY = JobKind("identification", load=_load, compute=find_modes, store=_store, libraries=CORE_LIBRARIES)


DETAILS = ("warnings", "doubtful", "refused", "refused_poles")
"""What of the document about an identification its mode set has too, so that nobody sees the modes without it."""


def keep_identified(
    session: Session, campaign_id: UUID, name: str, modes: MeasuredModes, document: dict[str, Any], *, job_id: UUID
) -> ModeSet:
    """Store modes that a job found in the specimen's frame, with their directions in the file's coordinates, as all
    stored shapes are.

    Args:
        session: the job's transaction.
        campaign_id: whose modes; its frame is used.
        name: of the mode set.
        modes: in the specimen's frame.
        document: about their identification, as `describe_identification` gives it.
        job_id: the job that found them.
    """
    frame = frame_of(campaign_of(session, campaign_id))
    in_file = replace(modes, dofs=tuple(frame.file_dof(dof) for dof in modes.dofs))
    details = {part: document[part] for part in DETAILS}
    said = {row["frequency_hz"]: row for row in (*document["modes"], *document["doubtful"])}
    details["evidence"] = [{part: said[float(hz)][part] for part in EVIDENCE} for hz in modes.frequency_hz]
    return store_identified(session, campaign_id, name, in_file, job_id=job_id, details=details)


def start_identification(session: Session, user: User, campaign_id: UUID, body: IdentificationIn) -> Identification:
    """Queue an identification of a campaign's modes, in the caller's transaction.

    Args:
        session: the request's transaction.
        user: who asks; an editor of the project at least.
        campaign_id: whose FRFs.
        body: name of the mode set and options; `{}` will do.

    Raises:
        InputError: the band is empty.
        NotFound: there is no such campaign, or it is other people's.
        Forbidden: the user's role is too low.
        QuotaExceeded: the project has no room for modes.
    """
    campaign = campaign_for(session, user, campaign_id, "editor")
    body.options()  # a wrong band is refused before it is queued
    project_id = campaign_for.project_of(session, campaign)
    require_room(session, project_id)
    job = enqueue(session, kind=IDENTIFY, project_id=project_id)
    row = Identification(id=job.id, campaign_id=campaign.id, options=body.model_dump(mode="json"))
    session.add(row)
    session.flush()
    audit(session, user, "identification.create", "identification", row.id, project_id)
    return row


identification_for = Lookup(Identification, "identification", "campaign_id", campaign_for)
"""The identification, if the user has at least a role in its project."""


def cancel_identification(session: Session, user: User, row: Identification) -> None:
    """Ask for an identification's end, in the caller's transaction."""
    campaign = campaign_for(session, user, row.campaign_id, "editor")
    project_id = campaign_for.project_of(session, campaign)
    request_cancel(session, row.id)
    audit(session, user, "identification.cancel", "identification", row.id, project_id)


def describe(session: Session, row: Identification) -> IdentificationOut:
    """An identification as clients see it: the state of its job as it is now, and its mode set and result when it has
    succeeded.
    """
    job = session.get_one(Job, row.id, populate_existing=True)
    session.refresh(row)
    return IdentificationOut(
        **job_state(job),
        campaign_id=row.campaign_id,
        options=IdentificationIn.model_validate(row.options),
        mode_set=session.scalars(select(ModeSet.id).where(ModeSet.job_id == row.id)).one_or_none(),
        result=row.document and up_to_date(row.document),
    )
