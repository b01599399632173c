"""Recordings of responses in the database: a row each, whose samples stay in the original file; and
their half spectra.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any, TypeVar
from uuid import UUID

import numpy as np
from sqlalchemy import (
    ForeignKey,
    Index,
    LargeBinary,
    Select,
    delete,
    func,
    literal,
    select,
    update,
)
from sqlalchemy.dialects.postgresql import JSONB, aggregate_order_by, insert
from sqlalchemy.orm import Mapped, Session, mapped_column

from fecore.frf import Dof
from fecore.signal import HalfSpectra, LoadFrfs
from service.compute.frame import Frame
from service.compute.responses import EncodedSpectra, RecordingFile, ResponseInputs, decoded
from service.nouns.campaigns.operations import campaign_for, campaign_of, frame_of
from service.nouns.recordings.schemas import RecordingOut, SpectraOut
from service.nouns.records.schemas import CampaignProcessingIn
from service.nouns.storage import book
from service.nouns.storage.originals import write_original
from service.platform.access import Lookup
from service.platform.db.base import Base, Big, Identified
from service.platform.errors import Conflict, deleted_by_rule
from service.platform.web import shown_as


class Recording(Identified, Base):
    """A recording of responses to loads that nobody measured, of one import."""

    __tablename__ = "recordings"
    __table_args__ = (Index(None, "campaign_id", "id"), Index(None, "import_id"))

    campaign_id: Mapped[UUID] = mapped_column(ForeignKey("campaigns.id", ondelete="CASCADE"))
    import_id: Mapped[UUID] = mapped_column(ForeignKey("imports.id", deferrable=True))
    filename: Mapped[str]
    format: Mapped[str]
    mapping: Mapped[dict[str, Any]] = mapped_column(JSONB)
    sample_rate_hz: Mapped[float]
    samples: Mapped[Big]
    channels: Mapped[list[Any]] = mapped_column(JSONB)
    file_sha256: Mapped[bytes]
    bytes_deleted_at: Mapped[datetime | None]  # of its file, by a retention rule


class StoredSpectra(Base):
    """The half spectra of a recording; arrays lie out of line, as npz."""

    __tablename__ = "half_spectra"

    recording_id: Mapped[UUID] = mapped_column(
        ForeignKey("recordings.id", ondelete="CASCADE"), primary_key=True
    )
    processing_id: Mapped[UUID] = mapped_column(ForeignKey("processings.id"))
    document: Mapped[dict[str, Any]] = mapped_column(JSONB)
    sha256: Mapped[bytes]
    data: Mapped[bytes] = mapped_column(LargeBinary, deferred=True)
    created_at: Mapped[datetime] = mapped_column(server_default=func.now())


Spectra = TypeVar("Spectra", HalfSpectra, LoadFrfs)

recording_for = Lookup(Recording, "recording", "campaign_id", campaign_for)


def store_recording(session: Session, **stated: Any) -> None:
    """Store what is known of a recording.

    Raises:
        Conflict: the campaign has this file as a recording already.
    """
    row = Recording(**stated)
    same = select(Recording.filename).where(
        Recording.campaign_id == row.campaign_id, Recording.file_sha256 == row.file_sha256
    )
    if (known := session.scalars(same).first()) is not None:
        raise Conflict(
            f"the campaign has these bytes as the recording {known}; delete its import first"
        )
    session.add(row)
    session.flush()


def recordings_of(session: Session, campaign_id: UUID) -> Sequence[Recording]:
    """A campaign's recordings, oldest first."""
    return recording_for.all(session, campaign_id=[campaign_id])


def has_loads(row: Recording) -> bool:
    """Whether some channels of a recording are measured loads."""
    return any(channel["quantity"] == "force" for channel in row.channels)


@dataclass(frozen=True)
class RecordingsHeld:
    """The recordings of a campaign."""

    digest: str  # of their files
    newest: datetime  # when the last one was stored
    processed: bool  # whether each has half spectra


def recordings_from(first: UUID) -> Select[UUID]:
    """Campaigns to which recordings came whose keys are at least this one, as part of a query."""
    return select(Recording.campaign_id).where(Recording.id >= first)


def recordings_held(session: Session, campaign_ids: Sequence[UUID]) -> dict[UUID, RecordingsHeld]:
    """What campaigns hold of recordings; those without any are left out."""
    sha = func.encode(Recording.file_sha256, "hex")
    query = (
        select(
            Recording.campaign_id,
            func.md5(func.string_agg(sha, aggregate_order_by(literal(","), sha))),
            func.max(Recording.created_at),
            func.count(StoredSpectra.recording_id) == func.count(Recording.id),
        )
        .outerjoin(StoredSpectra, StoredSpectra.recording_id == Recording.id)
        .where(Recording.campaign_id.in_(campaign_ids))
        .group_by(Recording.campaign_id)
    )
    return {key: RecordingsHeld(*held) for key, *held in session.execute(query)}


def remove_recordings(session: Session, import_id: UUID) -> int:
    """Remove the recordings that an import brought with their spectra, and give the spectra's
    bytes.
    """
    own = select(Recording.id).where(Recording.import_id == import_id)
    size = func.coalesce(func.sum(func.octet_length(StoredSpectra.data)), 0)
    gone = session.scalars(select(size).where(StoredSpectra.recording_id.in_(own))).one()
    session.execute(delete(Recording).where(Recording.import_id == import_id))
    return int(gone)


def imports_without_spectra(campaigns: Select[UUID]) -> Select[UUID]:
    """Keys of imports into some campaigns of recordings that no processing has seen, as part of a
    query.
    """
    return (
        select(Recording.import_id)
        .outerjoin(StoredSpectra, StoredSpectra.recording_id == Recording.id)
        .where(Recording.campaign_id.in_(campaigns), StoredSpectra.recording_id.is_(None))
    )


def delete_recorded(session: Session, import_ids: Sequence[UUID], now: datetime) -> None:
    """Note that the files of recordings, by their imports, are deleted; spectra stay."""
    own = Recording.import_id.in_(import_ids)
    session.execute(update(Recording).where(own).values(bytes_deleted_at=now))


def require_files(rows: Sequence[Recording]) -> None:
    """Refuse to read recordings anew whose file is gone.

    Raises:
        Conflict: a retention rule has deleted one.
    """
    for row in rows:
        if row.bytes_deleted_at is not None:
            why = deleted_by_rule("original", row.bytes_deleted_at)
            raise Conflict(f"recording {row.filename} cannot be read anew: {why}; its spectra stay")


def load_recordings(
    session: Session, campaign_id: UUID, workspace: Path, options: CampaignProcessingIn
) -> ResponseInputs | None:
    """A campaign's recordings with their originals on the worker's disk; None where it has none."""
    files = []
    rows = recordings_of(session, campaign_id)
    require_files(rows)
    for number, row in enumerate(rows):
        path = workspace / f"{number}.recording"
        write_original(session, row.file_sha256, path)
        stated = {name: getattr(row, name) for name in ("id", "filename", "format", "mapping")}
        files.append(RecordingFile(**stated, path=path, samples=row.samples, loads=has_loads(row)))
    named = options.references
    references = None if named is None else tuple(Dof(d.point, d.direction) for d in named)
    return ResponseInputs(tuple(files), references, options.lag_s) if files else None


def keep_spectra(
    session: Session, campaign_id: UUID, processing_id: UUID, spectra: EncodedSpectra
) -> None:
    """Keep half spectra in place of earlier ones of the same recording.

    Raises:
        QuotaExceeded: the project has no room for them.
    """
    gone = delete(StoredSpectra).where(StoredSpectra.recording_id == spectra.recording_id)
    before = sum(session.scalars(gone.returning(func.octet_length(StoredSpectra.data))))
    size = len(spectra.data) - before
    book(session, campaign_for, campaign_of(session, campaign_id), "spectra", size)
    session.execute(
        insert(StoredSpectra).values(
            recording_id=spectra.recording_id,
            processing_id=processing_id,
            document=spectra.document,
            sha256=spectra.sha256,
            data=spectra.data,
        )
    )


def spectra_rows(session: Session, rows: Sequence[Recording]) -> dict[UUID, StoredSpectra]:
    """What is known of the half spectra of these recordings, without the arrays."""
    keys = [row.id for row in rows]
    query = select(StoredSpectra).where(StoredSpectra.recording_id.in_(keys))
    return {each.recording_id: each for each in session.scalars(query)}


def load_spectra(
    session: Session, campaign_id: UUID
) -> tuple[tuple[HalfSpectra, ...], tuple[LoadFrfs, ...]]:
    """All half spectra of a campaign, and all FRFs of measured loads with their blocks; directions in the specimen's frame.

    Raises:
        Damaged: what was stored is not what a processing made.
    """
    frame = frame_of(campaign_of(session, campaign_id))
    query = (
        select(StoredSpectra.data, StoredSpectra.sha256)
        .join(Recording, Recording.id == StoredSpectra.recording_id)
        .where(Recording.campaign_id == campaign_id)
        .order_by(Recording.id)
    )
    all_of_them = [decoded(data, sha) for data, sha in session.execute(query)]
    return (
        tuple(in_frame(each, frame) for each in all_of_them if isinstance(each, HalfSpectra)),
        tuple(in_frame(each, frame) for each in all_of_them if isinstance(each, LoadFrfs)),
    )


def beside_frfs(spectra: Sequence[HalfSpectra]) -> list[str]:
    """That the half spectra of a campaign are not used, as it has FRFs."""
    if not spectra:
        return []
    return [
        f"half spectra of {len(spectra)} recordings of responses are not used beside the FRFs; a campaign"
        " of their own finds modes in them"
    ]


def in_frame(spectra: Spectra, frame: Frame) -> Spectra:
    """Spectra of a file with directions in the specimen's frame."""
    return replace(
        spectra,
        responses=tuple(map(frame.dof, spectra.responses)),
        references=tuple(map(frame.dof, spectra.references)),
    )


def spectra_of_recording(session: Session, row: Recording) -> HalfSpectra:
    """The half spectra of a recording, directions in the file's coordinates.

    Raises:
        Conflict: no processing has made them yet.
    """
    query = select(StoredSpectra.data, StoredSpectra.sha256).where(
        StoredSpectra.recording_id == row.id
    )
    stored = session.execute(query).one_or_none()
    if stored is None:
        raise Conflict(
            f"recording {row.filename} has no half spectra yet; POST"
            f" /campaigns/{row.campaign_id}/processings makes them"
        )
    spectra = decoded(*stored)
    if isinstance(spectra, LoadFrfs):
        raise Conflict(
            f"recording {row.filename} has its loads: it became FRFs, which GET"
            f" /campaigns/{row.campaign_id}/frfs lists"
        )
    return spectra


def arrays_of(spectra: HalfSpectra) -> dict[str, Any]:
    """Spectra as arrays: power spectra `auto` and `cross`, `half` spectra of the blocks."""
    sensors = {
        name: np.array([(dof.point, dof.direction) for dof in getattr(spectra, name)])
        for name in ("responses", "references")
    }
    return {
        "frequency_hz": spectra.frequency_hz,
        "auto": spectra.autos,
        "cross": spectra.crosses,
        "half": spectra.blocks,
        "weights": spectra.weights,
        "window_rate_per_s": spectra.window_rate_per_s,
        "lag_s": spectra.lag_s,
        **sensors,
    }


def columns_of(spectra: HalfSpectra) -> dict[str, Any]:
    """Power spectra as columns, a row for each line of each pair, that of a sensor with itself
    first.
    """
    pairs = [
        (dof, dof, own + 0j) for dof, own in zip(spectra.responses, spectra.autos, strict=True)
    ]
    pairs += [
        (dof, reference, spectra.crosses[row, column])
        for row, dof in enumerate(spectra.responses)
        for column, reference in enumerate(spectra.references)
        if dof != reference
    ]
    lines = spectra.frequency_hz.size
    places = {
        f"{side}_{what}": np.repeat([getattr(pair[k], what) for pair in pairs], lines)
        for k, side in enumerate(("response", "reference"))
        for what in ("point", "direction")
    }
    values = np.concatenate([pair[2] for pair in pairs])
    return {
        **places,
        "frequency_hz": np.tile(spectra.frequency_hz, len(pairs)),
        "real": values.real,
        "imag": values.imag,
    }


def describe_all(session: Session, rows: Sequence[Recording]) -> list[RecordingOut]:
    """Recordings as clients see them, in the order given."""
    known = spectra_rows(session, rows)
    return [
        shown_as(
            RecordingOut,
            row,
            length_s=row.samples / row.sample_rate_hz,
            file_sha256=row.file_sha256.hex(),
            spectra=None if (own := known.get(row.id)) is None else _spectra(own),
        )
        for row in rows
    ]


def _spectra(row: StoredSpectra) -> SpectraOut:
    stated = {name: row.document[name] for name in SpectraOut.model_fields if name in row.document}
    return SpectraOut(
        **stated,
        processing_id=row.processing_id,
        sha256=row.sha256.hex(),
        created_at=row.created_at,
    )
