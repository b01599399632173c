"""Identifications: a job that finds the modes of a campaign in its FRFs and keeps them as a mode set."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from uuid import UUID

from pydantic import Field
from sqlalchemy.orm import Session

from fecore.errors import InputError
from fecore.modes import MeasuredModes
from service.access import Lookup, User
from service.compute.identifying import IdentificationInputs, IdentificationOutput, find_modes
from service.jobs.kinds import CORE_LIBRARIES
from service.jobs.resource import JobNoun
from service.store.campaigns.operations import campaign_for, campaign_of, frame_of
from service.store.frfs.data import load_measured_campaign
from service.store.modes.operations import EVIDENCE, Identification, ModeSet, store_identified
from service.store.modes.schemas import PolesIn
from service.store.storage import require_room
from service.web import Name, example


class IdentificationIn(PolesIn):
    """How to identify; `{}` will do."""

    model_config = example()

    name: Name = "identified"
    include_doubtful: bool = Field(
        False, description="keep the uncertain poles, from probability 0.1 on, in the mode set too"
    )


def _load(session: Session, row: Identification, _workspace: Path) -> IdentificationInputs:
    campaign = load_measured_campaign(session, row.campaign_id)
    if not campaign.frf_sets:
        raise InputError("campaign", "has no FRFs; import a UFF file first")
    asked = IdentificationIn.model_validate(row.options)
    frfs = tuple(used.frfs for used in campaign.frf_sets)
    windows = [remark for used in campaign.frf_sets for remark in used.window_remark]
    return IdentificationInputs(
        frfs, asked.options(), asked.include_doubtful, (*campaign.warnings, *dict.fromkeys(windows))
    )


def _store(session: Session, row: Identification, items: Iterator[IdentificationOutput]) -> None:
    name = IdentificationIn.model_validate(row.options).name
    for output in items:
        row.document = output.document
        keep_identified(session, row.campaign_id, name, output.modes, output.document, job_id=row.id)


identification_for = Lookup(Identification, "identification", "campaign_id", campaign_for)
IDENTIFICATIONS = JobNoun("identifications", identification_for, _load, find_modes, _store, libraries=CORE_LIBRARIES)


DETAILS = ("warnings", "doubtful", "refused", "refused_poles")
"""What of the document about an identification its mode set has too, so that nobody sees the modes without it."""


def keep_identified(
    session: Session, campaign_id: UUID, name: str, modes: MeasuredModes, document: dict[str, Any], *, job_id: UUID
) -> ModeSet:
    """Store modes that a job found in the specimen's frame, with their directions in the file's coordinates, as all
    stored shapes are.
    """
    frame = frame_of(campaign_of(session, campaign_id))
    in_file = replace(modes, dofs=tuple(frame.file_dof(dof) for dof in modes.dofs))
    details = {part: document[part] for part in DETAILS}
    said = {row["frequency_hz"]: row for row in (*document["modes"], *document["doubtful"])}
    details["evidence"] = [{part: said[float(hz)][part] for part in EVIDENCE} for hz in modes.frequency_hz]
    return store_identified(session, campaign_id, name, in_file, job_id=job_id, details=details)


def start_identification(session: Session, user: User, campaign_id: UUID, body: IdentificationIn) -> Identification:
    """Queue an identification of a campaign's modes, in the caller's transaction.

    Raises:
        InputError: the band is empty.
        QuotaExceeded: the project has no room for modes.
    """
    campaign = campaign_for(session, user, campaign_id, "editor")
    body.options()  # a wrong band is refused before it is queued
    require_room(session, campaign_for.project_of(session, campaign))
    row = Identification(campaign_id=campaign.id, options=body.model_dump(mode="json"))
    return IDENTIFICATIONS.start(session, user, row)
