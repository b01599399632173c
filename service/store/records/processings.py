"""Processings: a job that judges a campaign's hits and keeps the FRFs of the good ones."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any
from uuid import UUID

from sqlalchemy import JSON, ForeignKey, Index, Select, select
from sqlalchemy.orm import Mapped, Session, mapped_column

from fecore.body.sections import section
from fecore.errors import InputError
from fecore.signal import Averages, Strip
from service.access import Lookup, User
from service.compute.hits import by_sensors, whole
from service.compute.processing import PointFile, ProcessingInputs, ProcessingOutput, process_records
from service.db.base import Base
from service.jobs.kinds import CORE_LIBRARIES
from service.jobs.resource import JobNoun
from service.store.campaigns.operations import campaign_for, campaign_of
from service.store.frfs.data import specimen_points
from service.store.frfs.operations import store_processed
from service.store.records.decisions import decisions, hits_in, standing
from service.store.records.operations import block_rows, sample_bytes
from service.store.records.schemas import ProcessingIn
from service.store.storage import require_room
from service.store.structures.operations import present_structure


class Processing(Base):
    """One processing of a campaign's records; its key is its job's."""

    __tablename__ = "processings"
    __table_args__ = (Index(None, "campaign_id", "id"),)

    id: Mapped[UUID] = mapped_column(ForeignKey("jobs.id", deferrable=True), primary_key=True)
    campaign_id: Mapped[UUID] = mapped_column(ForeignKey("campaigns.id", ondelete="CASCADE"))
    options: Mapped[dict[str, Any]]
    document: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))


_STRIP = 1 / 3  # width over length up to which a body is a strip


def _load(session: Session, row: Processing, workspace: Path) -> ProcessingInputs:
    inputs = load_records(session, row.campaign_id, workspace, ProcessingIn.model_validate(row.options))
    if inputs is None:
        raise InputError("campaign", "has no time blocks; POST records first")
    return inputs


def load_records(
    session: Session, campaign_id: UUID, workspace: Path, options: ProcessingIn
) -> ProcessingInputs | None:
    """A campaign's hits, ready to be processed; None where it has no time blocks.

    The samples are put on the worker's disk, a file for each place and its sensors, as the server sends them: memory
    holds one block at a time.
    """
    stored = block_rows(session, campaign_id)
    known = [whole(rows) for rows in stored.values()]
    places = [alike for rows, _ in known for alike in by_sensors(rows)]
    if not places:
        return None
    left = [f"{sentence}; it was left out" for _, sentences in known for sentence in sentences]
    points = []
    # One query, however many of them there are.
    samples = sample_bytes(session, [row for rows in places for row in rows])
    for number, rows in enumerate(places):
        path = workspace / f"{number}.blocks"
        with path.open("wb") as file:
            file.writelines(islice(samples, len(rows)))
        points.append(PointFile(tuple(rows), path))
    assert next(samples, None) is None, "as many blocks as rows; and the query is at its end"
    positions = specimen_points(session, campaign_of(session, campaign_id))
    by_hand = {hit: bool(decision.good) for hit, decision in standing(session, campaign_id).items()}
    processing = replace(
        options.processing(),
        overrules={**by_hand, **decisions(options.overrules, hits_in(stored.values()))},
        strip=_strip(session, campaign_id),
        positions=positions,
    )
    return ProcessingInputs(tuple(points), processing, tuple(left))


def _strip(session: Session, campaign_id: UUID) -> Strip | None:
    """The body of a campaign, where its structure says that it is a strip of known mass and stiffness."""
    structure_id = campaign_of(session, campaign_id).structure_id
    _, structure = present_structure(session, structure_id)
    geometry, density = structure.geometry, structure.density_kg_m3
    if geometry is None or density is None or geometry.width_m > _STRIP * geometry.length_m:
        return None
    area = geometry.width_m * geometry.thickness_m
    if structure.laminate is not None:
        stack = section([ply.to_core(density) for ply in structure.laminate.plies])
        return Strip(density * area, stack.bending_stiffness(geometry.width_m))
    if structure.material is None:
        return None
    return Strip(density * area, structure.material.Ex_Pa * area * geometry.thickness_m**2 / 12)


def _store(session: Session, row: Processing, items: Iterator[Averages | str]) -> None:
    keys: list[UUID] = []
    for item in items:
        if isinstance(item, Averages):
            keys += store_processed(session, row.campaign_id, row.id, item)
        else:
            row.document = _with_keys(json.loads(item), keys)


def _with_keys(document: dict[str, Any], keys: Sequence[UUID]) -> dict[str, Any]:
    """The document with the keys of its FRFs."""
    shown = [{**frf, "id": str(key)} for frf, key in zip(document["frfs"], keys, strict=True)]
    return {**document, "frfs": shown}


def keep_processing(
    session: Session, job_id: UUID, campaign_id: UUID, options: ProcessingIn, output: ProcessingOutput
) -> dict[str, Any]:
    """Keep what a job of another kind processed on its way, as a processing of the same key with its FRFs.

    Returns:
        The processing's document.
    """
    row = Processing(id=job_id, campaign_id=campaign_id, options=options.model_dump(mode="json"))
    session.add(row)
    session.flush()
    row.document = _with_keys(output.document, store_processed(session, campaign_id, job_id, output.processed))
    return row.document


processing_for = Lookup(Processing, "processing", "campaign_id", campaign_for)
PROCESSINGS = JobNoun("processings", processing_for, _load, process_records, _store, libraries=CORE_LIBRARIES)


def start_processing(session: Session, user: User, campaign_id: UUID, body: ProcessingIn) -> Processing:
    """Queue a processing of a campaign's records, in the caller's transaction.

    Raises:
        InputError: the band is empty, or an overrule means no hit.
        QuotaExceeded: the project has no room for FRFs.
    """
    campaign = campaign_for(session, user, campaign_id, "editor")
    body.processing()  # a wrong choice is refused before it is queued
    if body.overrules:
        decisions(body.overrules, hits_in(block_rows(session, campaign.id).values()))
    require_room(session, campaign_for.project_of(session, campaign))
    row = Processing(campaign_id=campaign.id, options=body.model_dump(mode="json"))
    return PROCESSINGS.start(session, user, row)


def newest_document(session: Session, campaign_id: UUID) -> Processing | None:
    """The newest processing of a campaign that has judged its hits."""
    return session.scalars(_judged(campaign_id).order_by(Processing.id.desc()).limit(1)).one_or_none()


def documents_of(session: Session, campaign_id: UUID) -> Sequence[Processing]:
    """All of those, oldest first."""
    return session.scalars(_judged(campaign_id).order_by(Processing.id)).all()


def _judged(campaign_id: UUID) -> Select[Processing]:
    return select(Processing).where(Processing.campaign_id == campaign_id, Processing.document.is_not(None))
