"""Identifications: a job that finds the modes of a campaign in its FRFs and keeps them as a mode set."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal
from uuid import UUID

from pydantic import Field
from sqlalchemy import select
from sqlalchemy.orm import Session

from fecore.errors import InputError
from fecore.frf import FrfSet
from fecore.identification import Options, identify
from fecore.modes import MeasuredModes
from service.access import User, audit
from service.campaigns.identification_document import describe_identification
from service.campaigns.measurement import load_measurement
from service.campaigns.mode_sets import store_identified
from service.campaigns.operations import campaign_for, frame_of, project_of
from service.campaigns.tables import Campaign, Identification, ModeSet
from service.jobs import Job, JobKind, enqueue, job_state
from service.jobs.kinds import Report
from service.problems import Name, NotFound, StrictModel, example, not_found_as

Frequency = Annotated[float, Field(ge=0, le=1e7, description="Hz")]


class IdentificationIn(StrictModel):
    """How to identify; `{}` will do."""

    model_config = example()

    name: Name = "identified"
    band_hz: tuple[Frequency, Frequency] | None = Field(None, description="lines to use; default: all")
    highest_order: int = Field(40, ge=4, le=200, description="of the linear stage")
    most_modes: int = Field(40, ge=1, le=200)

    def options(self) -> Options:
        """The core's options.

        Raises:
            InputError: the band is empty.
        """
        if self.band_hz is not None and not self.band_hz[0] < self.band_hz[1]:
            raise InputError("band_hz", f"is ({self.band_hz[0]:g}, {self.band_hz[1]:g}), expected low < high")
        return Options(self.band_hz, self.highest_order, self.most_modes)


class IdentificationOut(StrictModel):
    """An identification: how far it is, and what it found."""

    id: UUID
    campaign_id: UUID
    options: IdentificationIn
    status: Literal["queued", "running", "succeeded", "failed", "cancelled"]
    stage: str | None
    progress: float
    attempt: int
    message: str | None
    error: dict[str, Any] | None
    created_at: Any
    started_at: Any
    finished_at: Any
    mode_set: UUID | None = Field(description="the modes that it found")
    result: dict[str, Any] | None = Field(description="quality of the modes, what was left out, stabilisation diagram")


@dataclass(frozen=True)
class IdentificationInputs:
    """FRFs by quantity and axis, in the specimen's frame, and how to identify."""

    frfs: tuple[FrfSet, ...]
    options: Options
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class IdentificationOutput:
    """Modes in the specimen's frame, and the document about them."""

    modes: MeasuredModes
    document: dict[str, Any]


def _load(session: Session, job_id: UUID, _workspace: Path) -> IdentificationInputs:
    row = session.get_one(Identification, job_id)
    campaign = load_measurement(session, row.campaign_id)
    if not campaign.frf_sets:
        raise InputError("campaign", "has no FRFs; import a UFF file first")
    options = IdentificationIn.model_validate(row.options).options()
    return IdentificationInputs(tuple(used.frfs for used in campaign.frf_sets), options, campaign.warnings)


def _compute(inputs: IdentificationInputs, report: Report) -> Iterator[IdentificationOutput]:
    report("identifying the modes", 0.1)
    found = identify(inputs.frfs, inputs.options)
    document = describe_identification(found)
    document["warnings"] = [*inputs.warnings, *document["warnings"]]
    yield IdentificationOutput(found.modes, document)


def _store(session: Session, job_id: UUID, items: Iterator[IdentificationOutput]) -> None:
    row = session.get_one(Identification, job_id)
    name = IdentificationIn.model_validate(row.options).name
    for output in items:
        row.document = output.document
        keep_identified(session, row.campaign_id, name, output.modes, job_id=job_id)


IDENTIFY = JobKind("identification", load=_load, compute=_compute, store=_store)


def keep_identified(session: Session, campaign_id: UUID, name: str, modes: MeasuredModes, *, job_id: UUID) -> ModeSet:
    """Store modes that a job found in the specimen's frame, with directions in the file's coordinates."""
    frame = frame_of(session.get_one(Campaign, campaign_id))
    in_file = replace(modes, dofs=tuple(frame.file_dof(dof) for dof in modes.dofs))
    return store_identified(session, campaign_id, name, in_file, job_id=job_id, details={})


def start_identification(session: Session, user: User, campaign_id: UUID, body: IdentificationIn) -> Identification:
    """Queue an identification, in the caller's transaction."""
    campaign = campaign_for(session, user, campaign_id, "editor")
    body.options()  # a wrong band is refused at the door
    project_id = project_of(session, campaign)
    job = enqueue(session, kind=IDENTIFY, project_id=project_id)
    row = Identification(id=job.id, campaign_id=campaign.id, options=body.model_dump(mode="json"))
    session.add(row)
    session.flush()
    audit(session, user, "identification.create", "identification", row.id, project_id)
    return row


def identification_for(session: Session, user: User, identification_id: UUID) -> Identification:
    """The identification, if the user may see its campaign.

    Raises:
        NotFound: there is none, or it is other people's.
    """
    row = session.get(Identification, identification_id)
    if row is None:
        raise NotFound("identification", identification_id)
    with not_found_as("identification", identification_id):
        campaign_for(session, user, row.campaign_id)
    return row


def describe(session: Session, row: Identification) -> IdentificationOut:
    """An identification as clients see it."""
    job = session.get_one(Job, row.id, populate_existing=True)
    session.refresh(row)
    return IdentificationOut(
        **job_state(job),
        campaign_id=row.campaign_id,
        options=IdentificationIn.model_validate(row.options),
        mode_set=session.scalars(select(ModeSet.id).where(ModeSet.job_id == row.id)).one_or_none(),
        result=row.document,
    )
