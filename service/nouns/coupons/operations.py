"""Coupon batches and their specimens: their tables, and what can be done with them: record,
summarise, use as a prior.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from statistics import median
from typing import TYPE_CHECKING, Any
from uuid import UUID

from sqlalchemy import CheckConstraint, ForeignKey, Index, UniqueConstraint, func, select
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Mapped, Session, mapped_column, relationship

from fecore.coupons.batch import (
    FEWEST_SPECIMENS,
    CouponResult,
    Statistics,
    failed_at_grip,
    outlier_warnings,
    prior,
    statistics,
)
from fecore.errors import InputError
from service.nouns.coupons.curves import CouponCurve, new_curve
from service.nouns.coupons.reduction import Reduced
from service.nouns.coupons.schemas import (
    BatchIn,
    BatchOut,
    Constant,
    CouponIn,
    CouponOut,
    Excluded,
    ExclusionIn,
    Prior,
    Statistic,
    Summary,
)
from service.nouns.storage import book
from service.nouns.structures.models import sets_of
from service.nouns.structures.operations import structure_for
from service.platform.access import Lookup, User
from service.platform.db.base import Base, Identified
from service.platform.errors import Conflict, Fault, Invalid
from service.platform.web import shown_as

if TYPE_CHECKING:
    from service.nouns.coupons.routes import RawCurve


class CouponBatch(Identified, Base):
    """A batch of coupons of a structure's material."""

    __tablename__ = "coupon_batches"
    __table_args__ = (Index(None, "structure_id", "id"),)

    structure_id: Mapped[UUID] = mapped_column(ForeignKey("structures.id", ondelete="CASCADE"))
    name: Mapped[str]
    constants: Mapped[list[Any]]
    sets: Mapped[list[Any]]
    published: Mapped[dict[str, Any]]
    conditions: Mapped[dict[str, Any]]


class Coupon(Identified, Base):
    """Results of one specimen."""

    __tablename__ = "coupons"
    __table_args__ = (
        UniqueConstraint("batch_id", "specimen"),
        CheckConstraint("excluded = (exclusion_reason IS NOT NULL)", name="exclusion_reason"),
    )

    batch_id: Mapped[UUID] = mapped_column(ForeignKey("coupon_batches.id", ondelete="CASCADE"))
    specimen: Mapped[str]
    standard: Mapped[str]
    E_Pa: Mapped[float | None] = mapped_column("e_pa")
    G_Pa: Mapped[float | None] = mapped_column("g_pa")
    nu: Mapped[float | None]
    strength_Pa: Mapped[float | None] = mapped_column("strength_pa")
    ultimate_strain: Mapped[float | None]
    failure_code: Mapped[str | None]
    excluded: Mapped[bool]
    exclusion_reason: Mapped[str | None]
    curve: Mapped[CouponCurve | None] = relationship(lazy="joined", viewonly=True)


PROPERTY_OF: dict[Constant, str] = {"Ex": "E_Pa", "Ey": "E_Pa", "Gxy": "G_Pa", "nu_xy": "nu"}
"""Which measured property of a specimen a constant of the structure is."""

UNLIKE_DIMENSION = 3.0
"""Ratio of a dimension to that of the batch's other specimens from which on it is thought to be a
mistake.
"""

UNITS = {"E_Pa": "Pa", "G_Pa": "Pa", "nu": "1", "strength_Pa": "Pa", "ultimate_strain": "1"}


batch_for = Lookup(CouponBatch, "coupon batch", "structure_id", structure_for)
coupon_for = Lookup(Coupon, "coupon", "batch_id", batch_for)


def create_batch(session: Session, user: User, structure_id: UUID, body: BatchIn) -> CouponBatch:
    """Store a new batch of coupons of a structure's material and note it in the audit trail.

    Raises:
        Invalid: it names sets that the structure has not.
    """
    structure = structure_for(session, user, structure_id, "editor")
    there = sets_of(session, structure)
    if faults := [
        Fault(f"/sets/{place}", f"is {name}; the structure has {', '.join(there) or 'none'}")
        for place, name in enumerate(body.sets)
        if name not in there
    ]:
        raise Invalid(faults)
    return batch_for.add(
        session, user, CouponBatch(structure_id=structure.id, **body.model_dump()), name=body.name
    )


def add_coupons(
    session: Session, user: User, batch: CouponBatch, bodies: Sequence[CouponIn]
) -> list[Coupon]:
    """Record specimens with their results, all or none.

    Returns:
        The rows, in the order given.

    Raises:
        Invalid: a specimen measures what the batch does not give without saying of which direction
            it is.
        Conflict: a specimen of that name is in the batch already.
    """
    along = [name for name in ("Ex", "Ey") if name in batch.constants]
    faults = [
        Fault(
            f"/{i}/E_Pa" if len(bodies) > 1 else "/E_Pa",
            "the batch gives Ex and Ey, and E_Pa could be either; record each direction in a batch"
            " of its own",
        )
        for i, body in enumerate(bodies)
        if body.E_Pa is not None and len(along) == 2
    ]
    if faults:
        raise Invalid(faults)
    rows = [Coupon(batch_id=batch.id, **body.model_dump()) for body in bodies]
    session.add_all(rows)
    try:
        session.flush()
    except IntegrityError as error:
        if "uq_coupons_batch_id_specimen" not in str(error.orig):
            raise
        raise Conflict(
            "a specimen of that name is in the batch already; every specimen has a name of its own"
        ) from None
    for row in rows:
        session.refresh(row)
    batch_for.note(session, user, batch, "coupon.create", count=len(rows))
    return rows


def add_measured_coupon(session: Session, user: User, batch: CouponBatch, sent: RawCurve) -> Coupon:
    """Record the specimen of a raw curve with file, curve and what came of them by its standard
    (ASTM D3039 or D3518), or nothing. One that is sent again as it was is there already.

    Raises:
        Conflict: the batch has this run of this file already.
        QuotaExceeded: the project has no room for the curve.
        Invalid, Conflict: as `add_coupons`.
    """
    if (known := same_curve(session, batch, sent)) is not None:
        return known
    reduced = sent.reduced
    reduced.reduction["warnings"] += unlike_the_batch(session, batch, sent.data, reduced)
    (row,) = add_coupons(session, user, batch, [reduced.coupon])
    curve = new_curve(row, sent)
    structure = structure_for.row(session, batch.structure_id)
    book(session, structure_for, structure, "curves", len(curve.file) + len(curve.data))
    session.add(curve)
    session.flush()
    session.refresh(row)
    return row


def exclude(session: Session, user: User, coupon: Coupon, body: ExclusionIn) -> None:
    """Decide whether a locked specimen counts in the batch's statistics. It stays recorded; the
    audit trail keeps what was before.
    """
    was = {"excluded": coupon.excluded, "exclusion_reason": coupon.exclusion_reason}
    coupon.excluded, coupon.exclusion_reason = body.excluded, body.exclusion_reason
    session.flush()
    coupon_for.note(session, user, coupon, "exclude", was=was, now=body.model_dump())


def summarise(session: Session, batch: CouponBatch) -> Summary:
    """The statistics of a batch, by ASTM D3039: mean, standard deviation with n − 1, and
    coefficient of variation.

    Excluded specimens do not count and are listed with their reasons. Constants follow from the
    specimens; where none measures a constant, its published mean stands in. Warnings say what the
    standard asks for and is not met, such as fewer than five specimens.

    `priors` has mean and standard deviation of each constant as of one more piece. Of a constant
    that has no standard deviation (one specimen, or a published mean without one) it is an assumed
    one, which `basis` says.
    """
    coupons = coupon_for.all(session, batch_id=[batch.id])
    counted = [coupon for coupon in coupons if not coupon.excluded]
    measured: dict[str, Statistics] = {}
    for name in UNITS:
        if values := [own[name] for coupon in counted if name in (own := _values(coupon))]:
            measured[name] = statistics(values)
    constants, warnings = _constants(batch, measured)
    warnings += outlier_warnings([CouponResult(c.specimen, _values(c)) for c in counted])
    coded = [coupon.failure_code for coupon in counted if coupon.failure_code is not None]
    at_grip = sum(failed_at_grip(code) for code in coded)
    if 2 * at_grip > len(coded):
        warnings.append(
            f"{at_grip} of {len(coded)} failed in or next to the grips: see how force enters the"
            " specimens"
        )
    return Summary(
        batch_id=batch.id,
        properties={name: _statistic(s, UNITS[name], "specimens") for name, s in measured.items()},
        constants=constants,
        priors=_priors(constants, warnings),
        excluded=[
            Excluded(specimen=c.specimen, reason=c.exclusion_reason or "")
            for c in coupons
            if c.excluded
        ],
        warnings=warnings,
    )


def same_curve(session: Session, batch: CouponBatch, sent: RawCurve) -> Coupon | None:
    """The specimen of the batch that came of the same file and the same request; None where there
    is none.
    """
    query = select(Coupon).join(CouponCurve, CouponCurve.coupon_id == Coupon.id)
    own = Coupon.batch_id == batch.id, Coupon.specimen == sent.request.specimen
    coupon = session.scalars(
        query.where(*own, CouponCurve.file_sha256 == hashlib.sha256(sent.data).digest())
    ).first()
    same = (
        coupon is not None
        and coupon.curve is not None
        and coupon.curve.request == sent.request.model_dump(mode="json")
    )
    return coupon if same else None


def unlike_the_batch(
    session: Session, batch: CouponBatch, data: bytes, reduced: Reduced
) -> list[str]:
    """What is odd about a specimen beside those that the batch has already.

    Raises:
        Conflict: the batch has this run of this file already, under another name.
    """
    others = session.execute(
        select(Coupon.specimen, CouponCurve.file_sha256, CouponCurve.reading, CouponCurve.reduction)
        .join(CouponCurve, CouponCurve.coupon_id == Coupon.id)
        .where(Coupon.batch_id == batch.id, Coupon.excluded.is_(False))
        .order_by(Coupon.id)
    ).all()
    digest = hashlib.sha256(data).digest()
    for specimen, sha256, reading, _ in others:
        if sha256 == digest and reading["run"] == reduced.reading["run"]:
            raise Conflict(
                f"the batch has run {reading['run']} of this file already, as specimen {specimen}"
            )
    differences = []
    for name in ("width_m", "thickness_m") if others else ():
        usual, own = median(reduction[name] for *_, reduction in others), reduced.reduction[name]
        if not 1 / UNLIKE_DIMENSION < own / usual < UNLIKE_DIMENSION:
            differences.append(
                f"the {name.removesuffix('_m')} is {1e3 * own:.4g} mm, {own / usual:.3g} times that"
                f" of the batch's other specimens ({1e3 * usual:.4g} mm): is it in another unit?"
            )
    return differences


def describe_all(session: Session, batches: Sequence[CouponBatch]) -> list[BatchOut]:
    """Batches as clients see them, in the order given, each with the number of its specimens; one
    query for all counts.
    """
    counts = session.execute(
        select(Coupon.batch_id, func.count())
        .where(Coupon.batch_id.in_([b.id for b in batches]))
        .group_by(Coupon.batch_id)
    )
    number = dict(counts.all())
    return [shown_as(BatchOut, batch, coupons=number.get(batch.id, 0)) for batch in batches]


def describe_coupon(coupon: Coupon) -> CouponOut:
    """A specimen as clients see it, with the warnings of the reduction where it came as a raw
    curve.
    """
    curve = coupon.curve
    warnings = [] if curve is None else curve.reduction["warnings"]
    return shown_as(CouponOut, coupon, has_curve=curve is not None, warnings=warnings)


def _values(coupon: Coupon) -> dict[str, float]:
    """What was measured of a specimen, by property."""
    return {name: value for name in UNITS if (value := getattr(coupon, name)) is not None}


def _priors(constants: dict[Constant, Statistic], warnings: list[str]) -> dict[Constant, Prior]:
    priors: dict[Constant, Prior] = {}
    for name, value in constants.items():
        try:
            core_prior = prior(Statistics(value.n, value.mean, value.standard_deviation))
        except InputError as error:
            warnings.append(f"{name}: no prior: {error}")
        else:
            priors[name] = shown_as(Prior, core_prior)
    return priors


def _constants(
    batch: CouponBatch, measured: dict[str, Statistics]
) -> tuple[dict[Constant, Statistic], list[str]]:
    constants: dict[Constant, Statistic] = {}
    warnings: list[str] = []
    for name in batch.constants:
        own, published = measured.get(PROPERTY_OF[name]), batch.published.get(name)
        value = Statistics(**published) if own is None and published is not None else own
        if value is None:
            warnings.append(f"{name}: no valid specimen and no published mean")
            continue
        constants[name] = _statistic(
            value, "1" if name == "nu_xy" else "Pa", "published" if own is None else "specimens"
        )
        if own is not None and published is not None:
            warnings.append(f"{name}: the specimens are used, not the published mean")
        if value.n is None:
            warnings.append(
                f"{name}: a published mean that does not say how many specimens it stands for"
            )
        elif value.n < FEWEST_SPECIMENS:
            label = f"{value.n} {'' if own is None else 'valid '}specimen{'s' * (value.n != 1)}"
            warnings.append(f"{name}: {label}; D3039 asks for at least {FEWEST_SPECIMENS}")
    return constants, warnings


def _statistic(value: Statistics, unit: str, source: str) -> Statistic:
    return shown_as(Statistic, value, unit=unit, source=source)
