"""Hits are judged: one by one by hand, where a person decides, says why, and each later processing
keeps to it; all that are stored as they are looked at; and by a processing, which keeps the FRFs of
the good ones.
"""

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from datetime import datetime
from itertools import islice
from pathlib import Path
from typing import Any
from uuid import UUID

from sqlalchemy import JSON, CompoundSelect, ForeignKey, Index, Select, func, select
from sqlalchemy.dialects.postgresql import distinct_on
from sqlalchemy.orm import Mapped, Session, mapped_column

from fecore import signal
from fecore.body.sections import section
from fecore.errors import InputError
from fecore.frf import Dof
from service.compute.hits import BlockRow, Place, by_sensors, describe_verdict, hits_of, whole
from service.compute.processing import (
    PointFile,
    ProcessingInputs,
    ProcessingOutput,
)
from service.nouns.campaigns.operations import campaign_for, campaign_of
from service.nouns.frfs.data import specimen_points
from service.nouns.frfs.operations import (
    processings_of,
    processings_present,
    store_processed,
    supersede,
)
from service.nouns.records.operations import Record, block_rows, describe, sample_bytes, samples_of
from service.nouns.records.schemas import (
    HitDecisionIn,
    HitDecisionOut,
    HitNamed,
    OverruleIn,
    ProcessingIn,
    StoredHit,
    StoredRecords,
)
from service.nouns.structures.operations import present_structure
from service.platform.access import Lookup, User
from service.platform.access.users import first_event
from service.platform.db.base import Base, Big, Identified, one_at_a_time
from service.platform.queue.resource import ENDED
from service.platform.queue.tables import Job
from service.platform.web import shown_as


class HitDecision(Identified, Base):
    """What a person decided of one hit; of several decisions the last one counts."""

    __tablename__ = "hit_decisions"
    __table_args__ = (Index(None, "campaign_id", "id"),)

    campaign_id: Mapped[UUID] = mapped_column(ForeignKey("campaigns.id", ondelete="CASCADE"))
    point: Mapped[Big]
    direction: Mapped[int]
    hit: Mapped[Big]
    good: Mapped[bool | None]
    why: Mapped[str]
    by: Mapped[str]


def decide(session: Session, user: User, campaign_id: UUID, body: HitDecisionIn) -> HitDecision:
    """Keep a decision, for every later processing.

    Raises:
        InputError: the campaign has no such hit, or several.
    """
    campaign = campaign_for(session, user, campaign_id, "editor")
    there = set(hits_in(block_rows(session, campaign.id, {body.point}).values()))
    direction = _meant(body, there, "").direction
    stated = body.model_dump(exclude={"direction"})
    row = HitDecision(campaign_id=campaign.id, direction=direction, by=user.name, **stated)
    session.add(row)
    session.flush()
    campaign_for.note(session, user, campaign, "hit.judge", direction=direction, **stated)
    return row


def decisions_of(campaign_id: UUID) -> Select[HitDecision]:
    """The query of all decisions about a campaign's hits."""
    return select(HitDecision).where(HitDecision.campaign_id == campaign_id)


def current_decisions(session: Session, campaign_id: UUID) -> dict[tuple[Dof, int], HitDecision]:
    """The last decision about each hit that is neither taken back nor older than the hit, which may
    have been measured anew.
    """
    place = HitDecision.point, HitDecision.direction, HitDecision.hit
    first_block = (
        select(Record.id)
        .where(Record.campaign_id == campaign_id, Record.force_point == HitDecision.point)
        .where(Record.force_direction == HitDecision.direction, Record.hit == HitDecision.hit)
        .order_by(Record.id)
        .limit(1)
        .scalar_subquery()
    )
    last = (
        select(HitDecision)
        .where(HitDecision.campaign_id == campaign_id, HitDecision.id > first_block)
        .ext(distinct_on(*place))
        .order_by(*place, HitDecision.id.desc())
    )
    decided = (row for row in session.scalars(last) if row.good is not None)
    return {(Dof(row.point, row.direction), row.hit): row for row in decided}


def hits_in(rows: Iterable[Sequence[BlockRow]]) -> Iterator[tuple[Place, int]]:
    """Place and number of each hit, also of those of which a block was deleted."""
    return ((row.place, row.hit) for group in rows for row in group)


def decisions(
    overrules: Sequence[OverruleIn], hits: Iterable[tuple[Place, int]]
) -> dict[tuple[Dof, int], bool]:
    """Which hits are used, whatever the criteria say.

    Args:
        overrules: as the user stated them; without a direction, the one is meant in which the point
            was hit.
        hits: place and number of each hit that there is.

    Raises:
        InputError: one means no hit, may mean several, or contradicts another.
    """
    if not overrules:
        return {}
    there = set(hits)
    decided: dict[tuple[Dof, int], bool] = {}
    for number, one in enumerate(overrules):
        field = f"overrules.{number}"
        if decided.setdefault((_meant(one, there, field), one.hit), one.use) != one.use:
            raise InputError(
                field, f"contradicts another about {_named(one)}: use it, or leave it out"
            )
    return decided


_MOST_PLACES = 8  # that a message names


def _meant(one: HitNamed, there: set[tuple[Place, int]], field: str) -> Dof:
    """Where the hit is that is meant; `field` names it in an error."""
    own = sorted(
        {direction for (point, direction), hit in there if (point, hit) == (one.point, one.hit)}
    )
    if one.direction is None and len(own) > 1:
        listed = ", ".join(map(str, own))
        where = f"{field}.direction".lstrip(".")
        raise InputError(where, f"is missing: there is {_named(one)} in directions {listed}")
    if not own or one.direction not in (None, *own):
        raise InputError(
            field or "hit", f"means {_named(one)}, which does not exist; there are {_listed(there)}"
        )
    return Dof(one.point, own[0] if one.direction is None else one.direction)


def _named(one: HitNamed) -> str:
    way = "" if one.direction is None else f" in direction {one.direction}"
    return f"hit {one.hit} of point {one.point}{way}"


def _listed(there: set[tuple[Place, int]]) -> str:
    numbers: dict[Place, list[int]] = {}
    for place, hit in sorted(there):
        numbers.setdefault(place, []).append(hit)
    places = [
        f"point {point}, direction {direction}: hits {min(own)} to {max(own)}"
        for (point, direction), own in numbers.items()
    ]
    more = f"; and {len(places) - _MOST_PLACES} other places" if len(places) > _MOST_PLACES else ""
    return ("; ".join(places[:_MOST_PLACES]) or "no hits at all") + more


MOST_LOOKED_AT = 64
"""Blocks of the points concerned above which an answer does not judge their hits; a processing
does.
"""


def judged(session: Session, campaign_id: UUID, stored: Sequence[Record]) -> StoredRecords:
    """Blocks as clients see them, with the judgement of all hits of their points where these are
    not too many.

    A hit of which a block was deleted is no reason to refuse later ones: it is named instead of
    judged.
    """
    answer = StoredRecords(
        items=[describe(row) for row in stored], hits=[], coherence={}, incomplete=[]
    )
    known = block_rows(session, campaign_id, {row.force_point for row in stored})
    places = [whole(rows) for rows in known.values()]
    answer.incomplete = [sentence for _, sentences in places for sentence in sentences]
    if not 0 < sum(len(rows) for rows, _ in places) <= MOST_LOOKED_AT:
        return answer
    alike = [of_sensors for rows, _ in places for of_sensors in by_sensors(rows)]
    # the coherence of a place is that of its newest hits
    alike.sort(key=lambda rows: max(row.id for row in rows))
    by_hand = current_decisions(session, campaign_id)
    overrules = {hit: bool(decision.good) for hit, decision in by_hand.items()}
    inspection = signal.inspect(
        [hits_of(rows, samples_of(session, rows)) for rows in alike],
        signal.Processing(overrules=overrules),
    )
    answer.hits = [
        _stored(verdict, by_hand.get((verdict.force, verdict.number)))
        for verdict in inspection.verdicts
    ]
    answer.coherence = {str(dof.point): value for dof, value in inspection.coherence.items()}
    return answer


def _stored(verdict: signal.HitVerdict, decision: HitDecision | None) -> StoredHit:
    by_hand = None if decision is None else shown_as(HitDecisionOut, decision)
    return StoredHit.model_validate({**describe_verdict(verdict), "decision": by_hand})


class Processing(Base):
    """One processing of a campaign's records; its key is its job's."""

    __tablename__ = "processings"
    __table_args__ = (Index(None, "campaign_id", "id"),)

    id: Mapped[UUID] = mapped_column(ForeignKey("jobs.id", deferrable=True), primary_key=True)
    campaign_id: Mapped[UUID] = mapped_column(ForeignKey("campaigns.id", ondelete="CASCADE"))
    options: Mapped[dict[str, Any]]
    document: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))


_STRIP = 1 / 3  # width over length up to which a body is a strip


def load_records(
    session: Session, campaign_id: UUID, workspace: Path, options: ProcessingIn
) -> ProcessingInputs | None:
    """A campaign's hits, ready to be processed; None where it has no time blocks.

    The samples are put on the worker's disk, a file for each place and its sensors, as the server
    sends them: memory holds one block at a time.
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
    by_hand = {
        hit: bool(decision.good)
        for hit, decision in current_decisions(session, campaign_id).items()
    }
    processing = replace(
        options.processing(),
        overrules={**by_hand, **decisions(options.overrules, hits_in(stored.values()))},
        strip=_strip(session, campaign_id),
        positions=positions,
    )
    return ProcessingInputs(tuple(points), processing, tuple(left))


def _strip(session: Session, campaign_id: UUID) -> signal.Strip | None:
    """The body of a campaign, where its structure says that it is a strip of known mass and
    stiffness.
    """
    structure_id = campaign_of(session, campaign_id).structure_id
    _, structure = present_structure(session, structure_id)
    geometry, density = structure.geometry, structure.density_kg_m3
    if geometry is None or density is None or geometry.width_m > _STRIP * geometry.length_m:
        return None
    area = geometry.width_m * geometry.thickness_m
    if structure.laminate is not None:
        stack = section([ply.to_core(density) for ply in structure.laminate.plies])
        return signal.Strip(density * area, stack.bending_stiffness(geometry.width_m))
    if structure.material is None:
        return None
    return signal.Strip(
        density * area, structure.material.Ex_Pa * area * geometry.thickness_m**2 / 12
    )


def _supersede_earlier(session: Session, row: Processing) -> None:
    """FRFs of earlier processings leave where a time block of theirs was looked at anew, be it that
    no hit was good.
    """
    one_at_a_time(session, f"processings of {row.campaign_id}")
    blocks = {
        str(block.id) for rows in block_rows(session, row.campaign_id).values() for block in rows
    }
    earlier = processings_present(session, row.campaign_id) - {row.id}
    documents = session.scalars(_judged(row.campaign_id).where(Processing.id.in_(earlier)))
    made = [frf for one in documents for frf in (one.document or {})["frfs"]]
    remade = {
        UUID(frf["id"]) for frf in made if any(block["id"] in blocks for block in frf["records"])
    }
    supersede(session, row.campaign_id, row.id, remade)


def in_use(campaigns: Select[UUID]) -> CompoundSelect[UUID]:
    """Keys of those of some campaigns whose time blocks are processed now, or have come after their
    last processing; as part of a query.
    """
    under_way = (
        select(Processing.campaign_id)
        .join(Job, Job.id == Processing.id)
        .where(Processing.campaign_id.in_(campaigns), Job.state.not_in(ENDED))
    )
    seen = select(Processing.id).where(
        Processing.campaign_id == Record.campaign_id,
        Processing.document.is_not(None),
        Processing.id > Record.id,
    )
    unseen = select(Record.campaign_id).where(
        Record.campaign_id.in_(campaigns), Record.bytes_deleted_at.is_(None), ~seen.exists()
    )
    return under_way.union(unseen)


def old_samples(
    session: Session, campaigns: Select[UUID], before: datetime, most: int
) -> Sequence[UUID]:
    """Keys of those of some campaigns that have time blocks of before a moment, all of which a
    processing has seen.
    """
    query = (
        select(Record.campaign_id)
        .where(
            Record.campaign_id.in_(campaigns),
            Record.bytes_deleted_at.is_(None),
            Record.created_at < before,
            Record.campaign_id.not_in(in_use(campaigns)),
        )
        .distinct()
    )
    return session.scalars(query.limit(most)).all()


def new_processing(campaign_id: UUID, options: ProcessingIn) -> Processing:
    """A row without its key, which is its job's."""
    return Processing(campaign_id=campaign_id, options=options.model_dump(mode="json"))


def keep_document(
    session: Session, row: Processing, document: dict[str, Any], keys: Sequence[UUID]
) -> dict[str, Any]:
    """Keep the document of a processing with the keys of its FRFs; those of earlier ones leave that
    were made anew.

    Returns:
        The document that is kept.
    """
    shown = [{**frf, "id": str(key)} for frf, key in zip(document["frfs"], keys, strict=True)]
    row.document = {**document, "frfs": shown}
    _supersede_earlier(session, row)
    return row.document


def keep_processing(
    session: Session,
    job_id: UUID,
    campaign_id: UUID,
    options: ProcessingIn,
    output: ProcessingOutput,
) -> dict[str, Any]:
    """Keep what a job of another kind processed on its way, as a processing of the same key with
    its FRFs.

    Returns:
        The processing's document.
    """
    row = new_processing(campaign_id, options)
    row.id = job_id
    session.add(row)
    session.flush()
    keys = store_processed(session, campaign_id, job_id, output.processed)
    return keep_document(session, row, output.document, keys)


processing_for = Lookup(Processing, "processing", "campaign_id", campaign_for)


def hits_changed(
    session: Session, campaign_id: UUID, frfs: Collection[UUID], after: datetime
) -> datetime | None:
    """When the hits that some FRFs were made of changed first after a moment: by new time blocks,
    one deleted, or a decision.

    None where they did not, or where no processing made the FRFs.
    """
    made_by = processings_of(session, frfs)
    if not made_by:
        return None
    documents = session.scalars(select(Processing.document).where(Processing.id.in_(made_by)))
    blocks = {
        UUID(block["id"])
        for one in documents
        for frf in (one or {})["frfs"]
        for block in frf["records"]
    }
    times = [
        session.scalar(
            select(func.min(table.created_at)).where(
                table.campaign_id == campaign_id, table.created_at > after
            )
        )
        for table in (Record, HitDecision)
    ]
    project_id = campaign_for.project_of(session, campaign_of(session, campaign_id))
    times.append(first_event(session, "record.delete", blocks, after, project_id))
    return min((at for at in times if at is not None), default=None)


def newest_document(session: Session, campaign_id: UUID) -> Processing | None:
    """The newest processing of a campaign that has judged its hits."""
    return session.scalars(
        _judged(campaign_id).order_by(Processing.id.desc()).limit(1)
    ).one_or_none()


def documents_of(session: Session, campaign_id: UUID) -> Sequence[Processing]:
    """All of those, oldest first."""
    return session.scalars(_judged(campaign_id).order_by(Processing.id)).all()


def _judged(campaign_id: UUID) -> Select[Processing]:
    return select(Processing).where(
        Processing.campaign_id == campaign_id, Processing.document.is_not(None)
    )
