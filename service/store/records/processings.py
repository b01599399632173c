"""Processings: a job that judges a campaign's hits and keeps the FRFs of the good ones."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any
from uuid import UUID

from sqlalchemy import Select, select
from sqlalchemy.orm import Session

from fecore.body.laminate import section
from fecore.errors import InputError
from fecore.signal import Averages, Strip
from service.access import Lookup, User, audit
from service.compute.hits import BlockRow, Place, by_sensors, whole
from service.compute.processing import PointFile, ProcessingInputs, ProcessingOutput, process_records
from service.jobs.kinds import CORE_LIBRARIES, JobKind
from service.jobs.queue import enqueue
from service.jobs.state import job_state
from service.jobs.tables import Job
from service.store.campaigns.operations import campaign_for, campaign_of
from service.store.frfs.measured_campaign import specimen_points
from service.store.frfs.operations import ProcessedFrfs, store_processed
from service.store.records.operations import block_rows, sample_bytes
from service.store.records.overrules import decisions
from service.store.records.schemas import ProcessingIn, ProcessingOut
from service.store.records.tables import Processing
from service.store.storage import require_room
from service.store.structures.operations import present_structure

_STRIP = 1 / 3  # width over length up to which a body is a strip


def _load(session: Session, job_id: UUID, workspace: Path) -> ProcessingInputs:
    row = session.get_one(Processing, job_id)
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
    processing = replace(
        options.processing(),
        overrules=decisions(options.overrules, _hits(stored.values())),
        strip=_strip(session, campaign_id),
        positions=positions,
    )
    return ProcessingInputs(tuple(points), processing, tuple(left))


def _hits(rows: Iterable[Sequence[BlockRow]]) -> Iterator[tuple[Place, int]]:
    """Place and number of each hit, also of those of which a block was deleted."""
    return ((row.place, row.hit) for group in rows for row in group)


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


def _store(session: Session, job_id: UUID, items: Iterator[Averages | str]) -> None:
    row = session.get_one(Processing, job_id)
    keys: list[UUID] = []
    for item in items:
        if isinstance(item, Averages):
            keys += _store_frfs(session, row, item)
        else:
            row.document = _with_keys(json.loads(item), keys)


def _store_frfs(session: Session, row: Processing, found: Averages) -> list[UUID]:
    hits = tuple(int(n) for n in found.hits)
    new = ProcessedFrfs(found.frfs, found.coherence, hits, found.rate_per_s)
    return store_processed(session, row.campaign_id, row.id, new)


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
    row.document = _with_keys(output.document, _store_frfs(session, row, output.processed))
    return row.document


PROCESS = JobKind("processing", load=_load, compute=process_records, store=_store, libraries=CORE_LIBRARIES)


def start_processing(session: Session, user: User, campaign_id: UUID, body: ProcessingIn) -> Processing:
    """Queue a processing of a campaign's records, in the caller's transaction.

    Args:
        session: the request's transaction.
        user: who asks; an editor of the project at least.
        campaign_id: whose records.
        body: the choices; `{}` will do.

    Raises:
        InputError: the band is empty, or an overrule means no hit.
        NotFound: there is no such campaign, or it is other people's.
        Forbidden: the user's role is too low.
        QuotaExceeded: the project has no room for FRFs.
    """
    campaign = campaign_for(session, user, campaign_id, "editor")
    body.processing()  # a wrong choice is refused before it is queued
    if body.overrules:
        decisions(body.overrules, _hits(block_rows(session, campaign.id).values()))
    project_id = campaign_for.project_of(session, campaign)
    require_room(session, project_id)
    job = enqueue(session, kind=PROCESS, project_id=project_id)
    row = Processing(id=job.id, campaign_id=campaign.id, options=body.model_dump(mode="json"))
    session.add(row)
    session.flush()
    audit(session, user, "processing.create", "processing", row.id, project_id)
    return row


def query_of(campaign_id: UUID) -> Select[Processing]:
    """The query of a campaign's processings."""
    return select(Processing).where(Processing.campaign_id == campaign_id)


processing_for = Lookup(Processing, "processing", "campaign_id", campaign_for)
"""The processing, if the user has at least a role in its project."""


def newest_document(session: Session, campaign_id: UUID) -> Processing | None:
    """The newest processing of a campaign that has judged its hits."""
    query = select(Processing).where(Processing.campaign_id == campaign_id, Processing.document.is_not(None))
    return session.scalars(query.order_by(Processing.id.desc()).limit(1)).one_or_none()


def describe(session: Session, row: Processing) -> ProcessingOut:
    """A processing as clients see it: the state of its job as it is now, and what it did when it has succeeded."""
    job = session.get_one(Job, row.id, populate_existing=True)
    session.refresh(row)
    return ProcessingOut(
        **job_state(job),
        campaign_id=row.campaign_id,
        options=ProcessingIn.model_validate(row.options),
        result=row.document,
    )
