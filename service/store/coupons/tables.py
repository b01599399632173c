"""Tables of coupon batches and their specimens."""

from __future__ import annotations

from typing import Any
from uuid import UUID

from sqlalchemy import CheckConstraint, ForeignKey, Index, LargeBinary, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column, relationship

from service.db.base import Base, Identified


class CouponBatch(Identified, Base):
    """A batch of coupons of a structure's material."""

    __tablename__ = "coupon_batches"
    __table_args__ = (Index(None, "structure_id", "id"),)

    structure_id: Mapped[UUID] = mapped_column(ForeignKey("structures.id", ondelete="CASCADE"))
    name: Mapped[str]
    constants: Mapped[list[Any]]
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


class CouponCurve(Base):
    """The raw curve that a specimen's results were reduced from: the machine's file, and its series in SI."""

    __tablename__ = "coupon_curves"

    coupon_id: Mapped[UUID] = mapped_column(ForeignKey("coupons.id", ondelete="CASCADE"), primary_key=True)
    filename: Mapped[str]
    file_sha256: Mapped[bytes]
    file_size: Mapped[int]
    request: Mapped[dict[str, Any]]
    reading: Mapped[dict[str, Any]]
    reduction: Mapped[dict[str, Any]]
    software: Mapped[str]
    series: Mapped[list[Any]]
    points: Mapped[int]
    sha256: Mapped[bytes]
    file: Mapped[bytes] = mapped_column(LargeBinary, deferred=True)
    data: Mapped[bytes] = mapped_column(LargeBinary, deferred=True)
