"""Time blocks in the database: take in, list, delete; and the hits that they are."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any
from uuid import UUID

import numpy as np
from sqlalchemy import ARRAY, Select, Uuid, any_, delete, func, literal, select
from sqlalchemy.orm import Session

from fecore.arrays import FloatArray
from fecore.signal import look
from modalbase.formats.records import TimeBlock
from service.access import Lookup, User, audit
from service.compute.hits import BlockRow, Place, by_sensors, describe_verdict, hits_of, whole
from service.compute.spectra import encode
from service.db.bytea import copy_rows, new_keys, stream_rows
from service.errors import Conflict, Damaged, verified
from service.store.campaigns.operations import campaign_for, campaign_of
from service.store.records.schemas import UNITS, HitOut, RecordOut, StoredRecords
from service.store.records.tables import Record
from service.store.storage import StorageOwner, book

MOST_LOOKED_AT = 64
"""Blocks of the points concerned above which an answer does not judge their hits; a processing does."""

COLUMNS = {
    **dict.fromkeys(("id", "campaign_id", "import_id"), "uuid"),
    **dict.fromkeys(("label", "filename", "quantity"), "text"),
    **dict.fromkeys(("point", "force_point", "hit"), "int8"),
    **dict.fromkeys(("direction", "force_direction", "samples"), "int4"),
    **dict.fromkeys(("sample_rate_hz", "sensitivity", "window_rate_per_s", "full_scale"), "float8"),
    "dtype": "text",
    "sha256": "bytea",
    "data": "bytea",
}
"""What is stated of a time block, and its type in the database."""

_STATED = tuple(name for name in COLUMNS if name in TimeBlock.__dataclass_fields__ and name not in ("hit", "samples"))
_SHOWN = tuple(name for name in RecordOut.model_fields if name not in ("unit", "sha256", "dtype"))
_TYPES = {name: str(np.dtype(name)) for name in ("<f4", "<f8")}

record_for = Lookup(Record, "record", "campaign_id", campaign_for)
"""The record, if the user has at least a role in its project."""


def store_records(
    session: Session, user: User, campaign_id: UUID, filename: str, blocks: Sequence[TimeBlock], *, counted: bool
) -> list[Record]:
    """Store time blocks of a script, all or none, each with the SHA-256 of its samples.

    Args:
        session: the request's transaction.
        user: who asks; an editor of the project at least.
        campaign_id: the campaign that takes them.
        filename: where they come from.
        blocks: of whole hits.
        counted: hit numbers were only counted, so they go on behind those that a place has already.

    Raises:
        Conflict: the campaign has a hit of that number there already.
        NotFound: there is no such campaign, or it is other people's.
        Forbidden: the user's role is too low.
        QuotaExceeded: the project has no room for them.
    """
    campaign = campaign_for(session, user, campaign_id, "editor", lock=True)
    if not counted:
        require_new(session, campaign.id, blocks)
    keys = write_records(session, NewRecords(campaign.id, blocks, len(blocks), counted, filename))
    written = Record.id == any_(literal(keys, ARRAY(Uuid)))  # one parameter, however many blocks there are
    stored = list(session.scalars(select(Record).where(written).order_by(Record.id)))
    project = campaign_for.project_of(session, campaign)
    audit(session, user, "record.create", "campaign", campaign.id, project, count=len(blocks), filename=filename)
    return stored


@dataclass(frozen=True)
class NewRecords:
    """Time blocks on their way to the database.

    Attributes:
        campaign_id: the campaign that takes them.
        blocks: one at a time.
        count: how many.
        counted: hit numbers go on behind those that a place has already.
        filename: where they come from.
        import_id: the import that brings them.
    """

    campaign_id: UUID
    blocks: Iterable[TimeBlock]
    count: int
    counted: bool
    filename: str = ""
    import_id: UUID | None = None


def write_records(session: Session, new: NewRecords) -> list[UUID]:
    """Write time blocks, one at a time, and return their keys.

    Raises:
        QuotaExceeded: the project has no room for them.
    """
    last = _last_hits(session, new.campaign_id) if new.counted else {}
    keys, size = new_keys(session, new.count), 0
    with copy_rows(session, Record.__tablename__, COLUMNS) as write:
        # The server stores one while the next is hashed.
        for key, block in zip(keys, new.blocks, strict=True):
            samples = encode(block.samples)
            size += len(samples.data)
            row = {
                "id": key,
                "campaign_id": new.campaign_id,
                "import_id": new.import_id,
                "filename": new.filename,
                **{name: getattr(block, name) for name in _STATED},
                "hit": block.hit + last.get((block.force_point, block.force_direction), 0),
                "samples": samples.count,
                "dtype": samples.dtype,
                "sha256": samples.sha256,
                "data": samples.data,
            }
            write([row[name] for name in COLUMNS])
    project = campaign_for.project_of(session, campaign_of(session, new.campaign_id))
    book(session, StorageOwner(project, new.campaign_id), "records", size)
    return keys


def records_of_import(session: Session, import_id: UUID) -> Sequence[Record]:
    """The time blocks that an import brought, in the order of its file."""
    return session.scalars(select(Record).where(Record.import_id == import_id).order_by(Record.id)).all()


def _last_hits(session: Session, campaign_id: UUID) -> dict[Place, int]:
    """The highest hit number of each place."""
    query = (
        select(Record.force_point, Record.force_direction, func.max(Record.hit))
        .where(Record.campaign_id == campaign_id)
        .group_by(Record.force_point, Record.force_direction)
    )
    return {(point, direction): last for point, direction, last in session.execute(query)}


def require_new(session: Session, campaign_id: UUID, blocks: Sequence[TimeBlock]) -> None:
    """Raise `Conflict` where the campaign has one of these blocks already, or they hold one twice; samples are not read."""
    points = {block.force_point for block in blocks}
    key_of = (Record.force_point, Record.force_direction, Record.hit, Record.quantity, Record.point, Record.direction)
    query = select(*key_of).where(Record.campaign_id == campaign_id, Record.force_point.in_(points))
    known = {tuple(row) for row in session.execute(query)}
    seen: set[tuple[Any, ...]] = set()
    for block in blocks:
        place = block.force_point, block.force_direction, block.hit
        key = (*place, block.quantity, block.point, block.direction)
        if key in known or key in seen:
            where = "twice in what was sent" if key in seen else "in the campaign already"
            raise Conflict(
                f"hit {block.hit} of point {block.force_point} is {where} ({block.quantity} at point {block.point}); "
                "delete it there, number the hits anew, or leave the numbers out"
            )
        seen.add(key)


def remove_record(session: Session, user: User, record_id: UUID) -> None:
    """Delete a time block; FRFs that rest on it stay, and their processing names its SHA-256.

    Raises:
        NotFound: there is none, or it is other people's.
        Forbidden: the user's role is too low.
    """
    row = record_for(session, user, record_id, "editor", lock=True)  # of two at once, one deletes
    campaign = campaign_for(session, user, row.campaign_id, "editor")
    project = campaign_for.project_of(session, campaign)
    audit(session, user, "record.delete", "record", row.id, project, sha256=row.sha256.hex(), hit=row.hit)
    (size,) = session.execute(delete(Record).where(Record.id == row.id).returning(func.octet_length(Record.data))).one()
    book(session, StorageOwner(project, campaign.id), "records", -size)


def query_of(campaign_id: UUID, point: int | None = None, hit: int | None = None) -> Select[Record]:
    """The query of a campaign's records, of one force point or hit number where wanted."""
    query = select(Record).where(Record.campaign_id == campaign_id)
    if point is not None:
        query = query.where(Record.force_point == point)
    return query if hit is None else query.where(Record.hit == hit)


def block_rows(session: Session, campaign_id: UUID, points: set[int] | None = None) -> dict[Place, list[BlockRow]]:
    """What is said of a campaign's blocks, by place, in the order in which places were first hit; also of blocks whose
    hit is not `whole`.
    """
    names = BlockRow.__dataclass_fields__
    query = select(*(getattr(Record, name) for name in names)).where(Record.campaign_id == campaign_id)
    if points is not None:
        query = query.where(Record.force_point.in_(points))
    found: dict[Place, list[BlockRow]] = {}
    for values in session.execute(query.order_by(Record.id)):
        row = BlockRow(*values)
        found.setdefault(row.place, []).append(row)
    return found


def sample_bytes(session: Session, rows: Sequence[BlockRow]) -> Iterator[bytes]:
    """The stored bytes of blocks, one at a time, in their order, after their SHA-256 has been verified.

    Raises:
        Damaged: the bytes are not the ones that were stored.
    """
    query = (
        "SELECT data FROM unnest(%s::uuid[]) WITH ORDINALITY AS wanted (id, place)"
        " JOIN records USING (id) ORDER BY place"
    )
    stored = stream_rows(session, query, [[row.id for row in rows]], ["bytea"])
    for row, (data,) in zip(rows, stored, strict=True):
        if len(data) != row.samples * np.dtype(row.dtype).itemsize:
            raise Damaged("record", row.sha256)
        yield verified(data, row.sha256, "record")


def samples_of(session: Session, rows: Sequence[BlockRow]) -> Iterator[FloatArray]:
    """The samples of blocks, one at a time, read-only, after their SHA-256 has been verified.

    Raises:
        Damaged: the bytes are not the ones that were stored.
    """
    for row, data in zip(rows, sample_bytes(session, rows), strict=True):
        yield np.frombuffer(data, row.dtype)


def judged(session: Session, campaign_id: UUID, stored: Sequence[Record]) -> StoredRecords:
    """Blocks as clients see them, with the judgement of all hits of their points where these are not too many.

    A hit of which a block was deleted is no reason to refuse later ones: it is named instead of judged.
    """
    answer = StoredRecords(items=[describe(row) for row in stored], hits=[], coherence={}, incomplete=[])
    known = block_rows(session, campaign_id, {row.force_point for row in stored})
    places = [whole(rows) for rows in known.values()]
    answer.incomplete = [sentence for _, sentences in places for sentence in sentences]
    if sum(len(rows) for rows, _ in places) > MOST_LOOKED_AT:
        return answer
    alike = [of_sensors for rows, _ in places for of_sensors in by_sensors(rows)]
    alike.sort(key=lambda rows: max(row.id for row in rows))  # the coherence of a place is that of its newest hits
    found = look([hits_of(rows, samples_of(session, rows)) for rows in alike])
    answer.hits = [HitOut.model_validate(describe_verdict(verdict)) for verdict in found.verdicts]
    answer.coherence = {str(dof.point): value for dof, value in found.coherence.items()}
    return answer


def describe(row: Record) -> RecordOut:
    """A time block as clients see it. The samples are not read."""
    shown = {name: getattr(row, name) for name in _SHOWN}
    return RecordOut(**shown, unit=UNITS[row.quantity], sha256=row.sha256.hex(), dtype=_TYPES[row.dtype])
