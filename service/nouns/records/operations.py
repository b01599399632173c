"""Time blocks in the database: their table; list, find, store, delete; what a file brings of
them.
"""

from __future__ import annotations

import pickle
import tempfile
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from datetime import datetime
from typing import Any
from uuid import UUID

import numpy as np
from sqlalchemy import (
    ARRAY,
    ForeignKey,
    Index,
    LargeBinary,
    Select,
    Uuid,
    any_,
    delete,
    func,
    literal,
    select,
    update,
)
from sqlalchemy.orm import Mapped, Session, mapped_column

from fecore.arrays import FloatArray
from modalbase.formats.records import TimeBlock
from service.compute.hits import BlockRow, Place
from service.compute.spectra import encode
from service.nouns.campaigns.operations import campaign_for, campaign_of
from service.nouns.records.schemas import UNITS, RecordOut
from service.nouns.storage import book
from service.platform.access import Lookup, User
from service.platform.db.base import Base, Big, Identified
from service.platform.db.bytea import copy_rows, new_keys, stream_rows
from service.platform.errors import Conflict, Damaged, verified
from service.platform.web import shown_as


class Record(Identified, Base):
    """One channel's time block of one hit, in SI; its samples lie out of line and are loaded only
    when asked for.
    """

    __tablename__ = "records"
    __table_args__ = (
        Index(None, "campaign_id", "id"),
        Index(
            "ix_records_hit",
            "campaign_id",
            "force_point",
            "force_direction",
            "hit",
            "quantity",
            "point",
            "direction",
            unique=True,
        ),
        Index(None, "import_id"),
    )

    campaign_id: Mapped[UUID] = mapped_column(ForeignKey("campaigns.id", ondelete="CASCADE"))
    import_id: Mapped[UUID | None] = mapped_column(ForeignKey("imports.id", deferrable=True))
    label: Mapped[str]
    filename: Mapped[str]
    quantity: Mapped[str]
    point: Mapped[Big]
    direction: Mapped[int]
    force_point: Mapped[Big]
    force_direction: Mapped[int]
    hit: Mapped[Big]
    sample_rate_hz: Mapped[float]
    samples: Mapped[int]
    sensitivity: Mapped[float]
    window_rate_per_s: Mapped[float]
    full_scale: Mapped[float | None]
    start_sample: Mapped[Big | None]
    dtype: Mapped[str]
    sha256: Mapped[bytes]
    data: Mapped[bytes | None] = mapped_column(LargeBinary, deferred=True)
    bytes_deleted_at: Mapped[datetime | None]  # by a retention rule


COLUMNS = tuple(
    one.name
    for one in Record.__table__.columns
    if one.name not in ("created_at", "bytes_deleted_at")
)
"""What is stated of a time block."""

_STATED = tuple(
    name
    for name in COLUMNS
    if name in TimeBlock.__dataclass_fields__ and name not in ("hit", "samples")
)
_TYPES = {name: str(np.dtype(name)) for name in ("<f4", "<f8")}

_BYTES = func.coalesce(func.octet_length(Record.data), 0)

record_for = Lookup(Record, "record", "campaign_id", campaign_for)


def store_records(
    session: Session,
    user: User,
    campaign_id: UUID,
    filename: str,
    blocks: Sequence[TimeBlock],
    *,
    counted: bool,
) -> list[Record]:
    """Store time blocks of a script, all or none, each with the SHA-256 of its samples; see
    `write_records`.

    Raises:
        Conflict: the campaign has a hit of that number there already.
        QuotaExceeded: the project has no room for them.
    """
    campaign = campaign_for(session, user, campaign_id, "editor", lock=True)
    if not counted:
        require_new(session, campaign.id, blocks)
    keys = write_records(
        session, campaign.id, blocks, len(blocks), counted=counted, filename=filename
    )
    # one parameter, however many blocks there are
    written = Record.id == any_(literal(keys, ARRAY(Uuid)))
    stored = list(session.scalars(select(Record).where(written).order_by(Record.id)))
    campaign_for.note(
        session, user, campaign, "record.create", count=len(blocks), filename=filename
    )
    return stored


def write_records(
    session: Session,
    campaign_id: UUID,
    blocks: Iterable[TimeBlock],
    count: int,
    *,
    counted: bool,
    filename: str,
    import_id: UUID | None = None,
) -> list[UUID]:
    """Write time blocks, one at a time, and return their keys.

    Args:
        session: the transaction.
        campaign_id: the campaign that takes them.
        blocks: of whole hits.
        count: how many.
        counted: hit numbers were only counted, so they go on behind those that a place has already.
        filename: where they come from.
        import_id: the import that brings them.

    Raises:
        QuotaExceeded: the project has no room for them.
    """
    last = _last_hits(session, campaign_id) if counted else {}
    keys, size = new_keys(session, count), 0
    with copy_rows(session, Record, COLUMNS) as write:
        # The server stores one while the next is hashed.
        for key, block in zip(keys, blocks, strict=True):
            samples = encode(block.samples)
            size += len(samples.data)
            row = {
                "id": key,
                "campaign_id": campaign_id,
                "import_id": import_id,
                "filename": filename,
                **{name: getattr(block, name) for name in _STATED},
                "hit": block.hit + last.get((block.force_point, block.force_direction), 0),
                "samples": samples.count,
                "dtype": samples.dtype,
                "sha256": samples.sha256,
                "data": samples.data,
            }
            write([row[name] for name in COLUMNS])
    book(session, campaign_for, campaign_of(session, campaign_id), "records", size)
    return keys


def _last_hits(session: Session, campaign_id: UUID) -> dict[Place, int]:
    """The highest hit number of each place."""
    query = (
        select(Record.force_point, Record.force_direction, func.max(Record.hit))
        .where(Record.campaign_id == campaign_id)
        .group_by(Record.force_point, Record.force_direction)
    )
    return {(point, direction): last for point, direction, last in session.execute(query)}


def require_new(session: Session, campaign_id: UUID, blocks: Sequence[TimeBlock]) -> None:
    """Raise `Conflict` where the campaign has one of these blocks already, or they hold one twice;
    samples are not read.
    """
    points = {block.force_point for block in blocks}
    key_of = (
        Record.force_point,
        Record.force_direction,
        Record.hit,
        Record.quantity,
        Record.point,
        Record.direction,
    )
    query = select(*key_of).where(Record.campaign_id == campaign_id, Record.force_point.in_(points))
    known = {tuple(row) for row in session.execute(query)}
    seen: set[tuple[Any, ...]] = set()
    for block in blocks:
        place = block.force_point, block.force_direction, block.hit
        key = (*place, block.quantity, block.point, block.direction)
        if key in known or key in seen:
            where = "twice in what was sent" if key in seen else "in the campaign already"
            raise Conflict(
                f"hit {block.hit} of point {block.force_point} is {where} ({block.quantity} at"
                f" point {block.point}); delete it there, number the hits anew, or leave the"
                " numbers out"
            )
        seen.add(key)


def remove_record(session: Session, user: User, record_id: UUID) -> None:
    """Delete a time block; FRFs that rest on it stay, and their processing names its SHA-256.

    Raises:
        NotFound: there is none, or it is other people's.
    """
    row = record_for(session, user, record_id, "editor", lock=True)  # of two at once, one deletes
    record_for.note(session, user, row, "delete", sha256=row.sha256.hex(), hit=row.hit)
    (size,) = session.execute(delete(Record).where(Record.id == row.id).returning(_BYTES)).one()
    book(session, campaign_for, campaign_of(session, row.campaign_id), "records", -size)


def remove_records(session: Session, import_id: UUID) -> int:
    """Remove the time blocks that an import brought, and give their bytes."""
    gone = delete(Record).where(Record.import_id == import_id).returning(_BYTES)
    return sum(session.scalars(gone))


def records_from(first: UUID) -> Select[UUID]:
    """Campaigns to which time blocks came whose keys are at least this one, as part of a query."""
    return select(Record.campaign_id).where(Record.id >= first)


def delete_samples(
    session: Session, campaign_id: UUID, before: datetime, now: datetime
) -> tuple[int, int]:
    """Empty the time blocks of a campaign that were stored before a moment; how many there were,
    and their bytes.
    """
    old = select(Record.id, _BYTES).where(
        Record.campaign_id == campaign_id,
        Record.created_at < before,
        Record.bytes_deleted_at.is_(None),
    )
    sizes = {key: int(size) for key, size in session.execute(old)}
    session.execute(
        update(Record).where(Record.id.in_(sizes)).values(data=None, bytes_deleted_at=now)
    )
    return len(sizes), sum(sizes.values())


def emptied_at(session: Session, campaign_id: UUID) -> datetime | None:
    """When a retention rule emptied the last of a campaign's time blocks; None where it has none,
    or some that are not empty.
    """
    query = select(
        func.max(Record.bytes_deleted_at), func.count() - func.count(Record.bytes_deleted_at)
    )
    last, left = session.execute(query.where(Record.campaign_id == campaign_id)).one()
    return None if left else last


def newest_records(session: Session, campaign_ids: Sequence[UUID]) -> dict[UUID, datetime]:
    """When the newest time block of each campaign was stored; campaigns without any are left
    out.
    """
    query = select(Record.campaign_id, func.max(Record.created_at))
    query = query.where(Record.campaign_id.in_(campaign_ids)).group_by(Record.campaign_id)
    return dict(session.execute(query).all())


def query_of(campaign_id: UUID, point: int | None = None, hit: int | None = None) -> Select[Record]:
    """The query of a campaign's records, of one force point or hit number where wanted."""
    query = select(Record).where(Record.campaign_id == campaign_id)
    if point is not None:
        query = query.where(Record.force_point == point)
    return query if hit is None else query.where(Record.hit == hit)


def has_records(session: Session, campaign_id: UUID) -> bool:
    """Whether a campaign has time blocks."""
    query = select(Record.id).where(Record.campaign_id == campaign_id).limit(1)
    return session.scalar(query) is not None


def block_rows(
    session: Session, campaign_id: UUID, points: set[int] | None = None
) -> dict[Place, list[BlockRow]]:
    """What is said of a campaign's blocks, by place, in the order in which places were first hit;
    also of blocks whose hit is not `whole`, not of those that a retention rule has emptied.
    """
    names = BlockRow.__dataclass_fields__
    query = select(*(getattr(Record, name) for name in names)).where(
        Record.campaign_id == campaign_id, Record.bytes_deleted_at.is_(None)
    )
    if points is not None:
        query = query.where(Record.force_point.in_(points))
    by_place: dict[Place, list[BlockRow]] = {}
    for values in session.execute(query.order_by(Record.id)):
        row = BlockRow(*values)
        by_place.setdefault(row.place, []).append(row)
    return by_place


def sample_bytes(session: Session, rows: Sequence[BlockRow]) -> Iterator[bytes]:
    """The stored bytes of blocks, one at a time, in their order, after their SHA-256 has been
    verified.

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


def describe(row: Record) -> RecordOut:
    """A time block as clients see it. The samples are not read."""
    return shown_as(
        RecordOut, row, unit=UNITS[row.quantity], sha256=row.sha256.hex(), dtype=_TYPES[row.dtype]
    )


Channel = tuple[str, int, int, int, int]
Form = tuple[float, int]
"""Sampling rate and length."""
_NONE = np.empty(0)
_IN_MEMORY = 1 << 20  # bytes of blocks before a file is made: most imports hold none


class RecordIntake:
    """The way of a file's time blocks into a campaign.

    The n-th force block of a place is its n-th hit, and the n-th block of each sensor belongs to
    it; a block that states no place of the force belongs to the force block last seen. Hits go on
    behind those that the campaign has. A context manager, which removes what lies on disk.
    """

    def __init__(self) -> None:
        self._spool = tempfile.SpooledTemporaryFile(_IN_MEMORY, prefix="modalbase-records-")  # noqa: SIM115 - closed by `__exit__`
        self._seen: Counter[Channel] = Counter()
        self._place: Place | None = None
        self._forces: dict[tuple[Place, int], tuple[int, Form]] = {}
        self._others: dict[int, tuple[Place, int, Form]] = {}
        self._mapped: list[TimeBlock] = []

    def __enter__(self) -> RecordIntake:
        return self

    def __exit__(self, *_: object) -> None:
        self._spool.close()

    def take(self, dataset: int, block: TimeBlock) -> str | None:
        """One block of a file; returns why it is of no use, or None."""
        if not (block.point and block.direction):
            return "is a time block without a point and direction"
        if block.quantity == "force":
            self._place = block.point, block.direction
        if block.quantity == "force" or not (block.force_point and block.force_direction):
            if self._place is None:
                return (
                    "is a time block that names no force and comes before any force block; where no"
                    " load was measured, state kind=responses"
                )
            block = replace(block, force_point=self._place[0], force_direction=self._place[1])
        place = block.force_point, block.force_direction
        channel = (block.quantity, block.point, block.direction, *place)
        self._seen[channel] += 1
        hit, form = self._seen[channel], (block.sample_rate_hz, block.samples.size)
        if block.quantity == "force":
            self._forces[place, hit] = dataset, form
        else:
            self._others[dataset] = place, hit, form
        pickle.dump((dataset, replace(block, hit=hit)), self._spool)
        return None

    def finish(self) -> dict[int, str]:
        """Why a block makes no whole hit, by dataset."""
        refused: dict[int, str] = {}
        answered: set[tuple[Place, int]] = set()
        for dataset, (place, hit, form) in self._others.items():
            _, force = self._forces.get((place, hit), (0, None))
            if force is None:
                refused[dataset] = (
                    f"is a response to hit {hit} at point {place[0]}, of which the file has no"
                    " force block"
                )
            elif force != form:
                refused[dataset] = (
                    f"has {form[1]} samples at {form[0]:g} Hz, the force of its hit {force[1]} at"
                    f" {force[0]:g} Hz"
                )
            else:
                answered.add((place, hit))
        for (place, hit), (dataset, _) in self._forces.items():
            if (place, hit) not in answered:
                refused[dataset] = (
                    f"is the force of hit {hit} at point {place[0]}, of which the file has no"
                    " response"
                )
        return refused

    def hold(self, block: TimeBlock) -> None:
        """One block whose mapping says where it belongs."""
        pickle.dump((len(self._mapped), block), self._spool)
        self._mapped.append(replace(block, samples=_NONE))

    def store(
        self,
        session: Session,
        campaign_id: UUID,
        refused: Collection[int] = (),
        *,
        counted: bool,
        **source: Any,
    ) -> None:
        """Write the blocks that were not refused, one at a time; `source` is what `write_records`
        takes besides.

        Raises:
            Conflict: the campaign has a hit of a stated number there already.
            QuotaExceeded: the project has no room for them.
        """
        campaign_of(session, campaign_id, lock=True)  # against a script that sends the same hits
        if not counted:
            require_new(session, campaign_id, self._mapped)
        held = [
            *(dataset for dataset, _ in self._forces.values()),
            *self._others,
            *range(len(self._mapped)),
        ]
        kept = (block for number, block in self._read(len(held)) if number not in refused)
        count = sum(number not in refused for number in held)
        write_records(session, campaign_id, kept, count, counted=counted, **source)

    def _read(self, count: int) -> Iterator[tuple[int, TimeBlock]]:
        self._spool.seek(0)
        for _ in range(count):
            yield pickle.load(self._spool)
