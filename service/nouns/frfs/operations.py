"""FRFs in the database: their table; list, find, store. No spectrum is loaded here."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import UUID

import numpy as np
from sqlalchemy import (
    CheckConstraint,
    ForeignKey,
    Index,
    LargeBinary,
    Row,
    Select,
    delete,
    exists,
    func,
    literal,
    or_,
    select,
    text,
    update,
)
from sqlalchemy.dialects.postgresql import aggregate_order_by
from sqlalchemy.orm import Mapped, Session, aliased, mapped_column

from fecore.arrays import FloatArray
from fecore.signal import Averages
from modalbase.formats.frfs.table import DOFS, UNITS
from service.compute.frf_rows import COLUMNS, coherence_columns
from service.compute.spectra import encode, encode_axis
from service.nouns.campaigns.operations import campaign_for, campaign_of
from service.nouns.frfs.schemas import FrfOut
from service.nouns.storage import book
from service.platform.access import Lookup, User, present
from service.platform.access.metadata_schema import require_metadata
from service.platform.db.base import Base, Big, Identified, Labelled, label_indexes
from service.platform.db.bytea import copy_rows, new_keys
from service.platform.web import shown_as
from service.platform.web.bodies import Labels

if TYPE_CHECKING:
    from service.nouns.campaigns.operations import Campaign


DRIVING_POINT = (
    "response_point = reference_point AND abs(response_direction) = abs(reference_direction)"
)
"""Of the few FRFs that have force and response at one point and axis."""


class Frf(Identified, Labelled, Base):
    """One FRF. Spectra lie in their own columns, out of line and uncompressed, and are loaded only
    when asked for.
    """

    __tablename__ = "frfs"
    __table_args__ = (
        Index(None, "campaign_id", "id"),
        Index(None, "campaign_id", "response_point", "id"),
        Index(None, "reference_point", "id"),
        Index("ix_frfs_driving_point", "campaign_id", "id", postgresql_where=text(DRIVING_POINT)),
        Index(None, "import_id", "dataset", unique=True),
        Index(None, "processing_id"),
        *label_indexes("frfs"),
        CheckConstraint("(step_hz IS NULL) = (axis IS NOT NULL)", name="axis"),
    )

    campaign_id: Mapped[UUID] = mapped_column(ForeignKey("campaigns.id", ondelete="CASCADE"))
    import_id: Mapped[UUID | None] = mapped_column(ForeignKey("imports.id", deferrable=True))
    dataset: Mapped[int | None]
    label: Mapped[str]
    response_point: Mapped[Big]
    response_direction: Mapped[int]
    reference_point: Mapped[Big]
    reference_direction: Mapped[int]
    quantity: Mapped[str]
    averages: Mapped[int | None]
    start_hz: Mapped[float]
    end_hz: Mapped[float]
    step_hz: Mapped[float | None]
    lines: Mapped[int]
    dtype: Mapped[str]
    sha256: Mapped[bytes]
    coherence_dtype: Mapped[str | None]
    coherence_sha256: Mapped[bytes | None]
    axis: Mapped[bytes | None] = mapped_column(LargeBinary, deferred=True)
    data: Mapped[bytes] = mapped_column(LargeBinary, deferred=True)
    coherence: Mapped[bytes | None] = mapped_column(LargeBinary, deferred=True)
    processing_id: Mapped[UUID | None] = mapped_column(ForeignKey("processings.id"))
    window_rate_per_s: Mapped[float | None]
    window_rate_sd_per_s: Mapped[float | None]
    variance_sha256: Mapped[bytes | None]
    variance: Mapped[bytes | None] = mapped_column(LargeBinary, deferred=True)
    growth_sha256: Mapped[bytes | None]
    growth: Mapped[bytes | None] = mapped_column(LargeBinary, deferred=True)
    superseded_by: Mapped[UUID | None]  # the processing that made it anew


READ_COLUMNS = ("campaign_id", "import_id", "dataset", *COLUMNS)
"""What an import states of an FRF."""
PROCESSED_COLUMNS = (
    *("id", "campaign_id", "processing_id", *COLUMNS),
    *("window_rate_per_s", "window_rate_sd_per_s"),
    *("variance", "variance_sha256", "growth", "growth_sha256"),
)
"""What a processing states of an FRF."""


@dataclass(frozen=True)
class NewFrfs:
    """FRFs that were read and checked, on their way to the database."""

    path: Path  # rows, as `service.nouns.frfs.schemas.write_rows` left them
    count: int  # how many
    stated: str  # SHA-256 of what was sent


frf_for = Lookup(Frf, "FRF", "campaign_id", campaign_for)


def store_frfs(session: Session, user: User, campaign: Campaign, new: NewFrfs) -> Sequence[Frf]:
    """Store FRFs that a script hands in, all or none, each with the SHA-256 of its spectrum.

    Returns:
        The rows, in the order given.

    Raises:
        QuotaExceeded: the project has no room for them.
    """
    book(session, campaign_for, campaign, "frfs", new.path.stat().st_size)
    keys = new_keys(session, new.count)
    with (
        new.path.open("rb") as file,
        copy_rows(session, Frf, ("id", "campaign_id", *COLUMNS)) as write,
    ):
        for key in keys:
            write([key, campaign.id, *pickle.load(file)])
    campaign_for.note(session, user, campaign, "frf.create", count=new.count)
    return frfs_of(session, keys)


def store_processed(
    session: Session, campaign_id: UUID, processing_id: UUID, new: Averages
) -> list[UUID]:
    """Store FRFs of a processing in the job's transaction; those that come in parts are stored part
    by part.

    Returns:
        Their keys, in order.

    Raises:
        QuotaExceeded: the project has no room for them.
    """
    growth = None if new.frfs.growth is None else new.frfs.growth.astype(np.complex64, copy=False)
    kept = (new.frfs.values, new.coherence, new.frfs.variance, growth)
    size = sum(values.nbytes for values in kept if values is not None)
    book(session, campaign_for, campaign_of(session, campaign_id), "frfs", size)
    common = {
        "campaign_id": campaign_id,
        "processing_id": processing_id,
        "quantity": new.frfs.quantity,
        # Too few hits, or too little noise, show nothing of a window: then the FRFs state nothing
        # of one.
        "window_rate_per_s": None if new.rate_sd_per_s is None else new.rate_per_s,
        "window_rate_sd_per_s": new.rate_sd_per_s,
        **encode_axis(new.frfs.frequency_hz).columns(),
    }
    hits = new.hits.tolist()
    keys = new_keys(session, len(hits))
    with copy_rows(session, Frf, PROCESSED_COLUMNS) as write:
        for i, (key, response, force) in enumerate(
            zip(keys, new.frfs.responses, new.frfs.references, strict=True)
        ):
            of_hits: dict[str, bytes | None] = {}
            for name, each in (("variance", new.frfs.variance), ("growth", growth)):
                known = None if each is None or np.isnan(each[i]).any() else encode(each[i])
                of_hits[name] = None if known is None else known.data
                of_hits[f"{name}_sha256"] = None if known is None else known.sha256
            row = {
                "id": key,
                "label": f"{hits[i]} hits at point {force.point}",
                **dict(
                    zip(
                        DOFS,
                        (response.point, response.direction, force.point, force.direction),
                        strict=True,
                    )
                ),
                "averages": hits[i],
                **common,
                **encode(new.frfs.values[i]).columns(),
                **coherence_columns(new.coherence[i]),
                **of_hits,
            }
            write([row[name] for name in PROCESSED_COLUMNS])
    return keys


def any_sent(session: Session, campaign_id: UUID) -> bool:
    """Whether a present FRF of a campaign came with a file or a script, not of a processing."""
    sent = Frf.campaign_id == campaign_id, Frf.processing_id.is_(None), *present(Frf)
    return session.scalars(select(Frf.id).where(*sent).limit(1)).first() is not None


def processings_present(session: Session, campaign_id: UUID) -> set[UUID]:
    """Processings that made present FRFs of a campaign."""
    made = Frf.campaign_id == campaign_id, Frf.processing_id.is_not(None), *present(Frf)
    return set(session.scalars(select(Frf.processing_id).distinct().where(*made)))


def processings_of(session: Session, keys: Collection[UUID]) -> set[UUID]:
    """Processings that made some FRFs."""
    made = Frf.id.in_(keys), Frf.processing_id.is_not(None)
    return {
        key
        for key in session.scalars(select(Frf.processing_id).distinct().where(*made))
        if key is not None
    }


def frfs_changed(
    session: Session, campaign_id: UUID, used: Collection[UUID], after: datetime
) -> datetime | None:
    """When the first present FRF of a campaign came after a moment that is none of those used; None
    where none came.
    """
    came = (
        Frf.campaign_id == campaign_id,
        Frf.created_at > after,
        Frf.id.not_in(used),
        *present(Frf),
    )
    earliest: datetime | None = session.scalar(select(func.min(Frf.created_at)).where(*came))
    return earliest


def supersede(
    session: Session, campaign_id: UUID, processing_id: UUID, remade: Collection[UUID]
) -> None:
    """Mark FRFs of earlier processings as made anew by one: those of these keys, and those between
    the places of its own.
    """
    newer = aliased(Frf)
    between = [getattr(newer, dof) == getattr(Frf, dof) for dof in DOFS]
    same = exists().where(
        newer.campaign_id == campaign_id, newer.processing_id == processing_id, *between
    )
    earlier = update(Frf).where(
        Frf.campaign_id == campaign_id, Frf.processing_id != processing_id, *present(Frf)
    )
    session.execute(
        earlier.where(or_(Frf.id.in_(remade), same)).values(superseded_by=processing_id),
        execution_options={"synchronize_session": False},
    )


def quantities_of(session: Session, import_id: UUID) -> list[str]:
    """What the FRFs of an import are."""
    return list(
        session.scalars(
            select(Frf.quantity).where(Frf.import_id == import_id).distinct().order_by(Frf.quantity)
        )
    )


def remove_frfs(session: Session, import_id: UUID) -> int:
    """Remove the FRFs that an import brought, and give their bytes."""
    sizes = [func.octet_length(column) for column in (Frf.data, Frf.coherence, Frf.axis)]
    gone = delete(Frf).where(Frf.import_id == import_id).returning(*sizes)
    return sum(size or 0 for row in session.execute(gone) for size in row)


def describe(frf: Frf) -> FrfOut:
    """An FRF as clients see it: degrees of freedom, quantity, unit, axis and SHA-256. The values
    are not read.
    """
    return shown_as(
        FrfOut,
        frf,
        unit=UNITS[frf.quantity],
        dtype=str(np.dtype(frf.dtype)),
        sha256=frf.sha256.hex(),
        has_coherence=frf.coherence_sha256 is not None,
    )


@contextmanager
def writing_frfs(session: Session) -> Iterator[Callable[[Mapping[str, Any]], None]]:
    """Stream FRFs of a file into the database; while the block runs, the session can do nothing
    else.

    Yields:
        What takes an FRF: the value of each of `READ_COLUMNS`, by name.
    """
    with copy_rows(session, Frf, READ_COLUMNS) as write:
        yield lambda row: write([row[column] for column in READ_COLUMNS])


def label_frfs(
    session: Session, user: User, campaign: Campaign, selection: Select[Frf], labels: Labels
) -> int:
    """Give some FRFs of a campaign these tags and metadata in place of theirs, and return how many
    there are.

    Raises:
        Invalid: they are not what the project demands.
    """
    stated = labels.model_dump()
    require_metadata(session, campaign_for.project_of(session, campaign), "frfs", stated)
    keys = select(selection.subquery().c.id)
    count = len(
        session.scalars(
            update(Frf).where(Frf.id.in_(keys)).values(**stated).returning(Frf.id)
        ).all()
    )
    campaign_for.note(session, user, campaign, "frfs.label", count=count, **stated)
    return count


def add_coherence(session: Session, import_id: UUID, dataset: int, coherence: FloatArray) -> None:
    """Give the FRF of a file's dataset its coherence."""
    row = update(Frf).where(Frf.import_id == import_id, Frf.dataset == dataset)
    session.execute(row.values(**coherence_columns(coherence)))


def frfs_of(session: Session, keys: Sequence[UUID]) -> list[Frf]:
    """Rows by key, in the order given, whoever asks."""
    rows = frf_for.rows(session, keys)
    return [rows[key] for key in keys]


def frf_extents(session: Session, campaign_id: UUID) -> Sequence[Row[float, float, int, int]]:
    """First and last line (`start_hz`, `end_hz`), `response_point` and `reference_point` of each
    FRF of a campaign.
    """
    columns = (Frf.start_hz, Frf.end_hz, Frf.response_point, Frf.reference_point)
    return session.execute(
        select(*columns).where(Frf.campaign_id == campaign_id, *present(Frf))
    ).all()


def count_frfs(session: Session, campaign_ids: Sequence[UUID]) -> dict[UUID, int]:
    """How many FRFs each campaign has; those without any are left out."""
    query = select(Frf.campaign_id, func.count()).where(
        Frf.campaign_id.in_(campaign_ids), *present(Frf)
    )
    counts = session.execute(query.group_by(Frf.campaign_id))
    return {row[0]: row[1] for row in counts}


def frfs_from(first: UUID) -> Select[UUID]:
    """Campaigns to which FRFs came whose keys are at least this one, as part of a query."""
    return select(Frf.campaign_id).where(Frf.id >= first)


def frf_digests(session: Session, campaign_ids: Sequence[UUID]) -> dict[UUID, tuple[str, datetime]]:
    """Digest and newest time of each campaign's FRFs; reads no spectrum. Campaigns without any are
    left out.
    """
    parts = (
        Frf.response_point,
        Frf.response_direction,
        Frf.reference_point,
        Frf.reference_direction,
        Frf.quantity,
    )
    one = func.concat_ws(
        " ", func.encode(Frf.sha256, "hex"), *parts, Frf.start_hz, Frf.step_hz, Frf.lines
    )
    digest = func.md5(func.string_agg(one, aggregate_order_by(literal(","), one)))
    query = select(Frf.campaign_id, digest, func.max(Frf.created_at))
    query = query.where(Frf.campaign_id.in_(campaign_ids), *present(Frf))
    return {
        key: (digest, newest)
        for key, digest, newest in session.execute(query.group_by(Frf.campaign_id))
    }
