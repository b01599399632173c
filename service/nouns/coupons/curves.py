"""Raw curves in the database: the machine's file and its series, each under its SHA-256."""

from __future__ import annotations

import csv
import hashlib
import io
from typing import TYPE_CHECKING, Any
from uuid import UUID

import numpy as np
from sqlalchemy import ForeignKey, LargeBinary
from sqlalchemy.orm import Mapped, Session, mapped_column

from fecore.arrays import FloatArray
from service.nouns.coupons.schemas import CouponCurveOut, CurveCouponIn, CurveFile
from service.platform.db.base import Base
from service.platform.errors import NotFound, verified

if TYPE_CHECKING:
    from service.nouns.coupons.operations import Coupon
    from service.nouns.coupons.routes import RawCurve


class CouponCurve(Base):
    """The raw curve that a specimen's results were reduced from: the machine's file, and its series
    in SI.
    """

    __tablename__ = "coupon_curves"

    coupon_id: Mapped[UUID] = mapped_column(
        ForeignKey("coupons.id", ondelete="CASCADE"), primary_key=True
    )
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


UNITS = {
    "force": "N",
    "strain": "m/m",
    "strain_back": "m/m",
    "transverse_strain": "m/m",
    "time": "s",
}


def new_curve(coupon: Coupon, sent: RawCurve) -> CouponCurve:
    """The row of a specimen's curve, to be added to a session: the machine's file and the series in
    SI, each with its SHA-256, and how the file was read and reduced.
    """
    reduced = sent.reduced
    data = b"".join(
        np.ascontiguousarray(values, "<f8").tobytes() for values in reduced.series.values()
    )
    return CouponCurve(
        coupon_id=coupon.id,
        filename=sent.filename,
        file_sha256=hashlib.sha256(sent.data).digest(),
        file_size=len(sent.data),
        request=sent.request.model_dump(mode="json"),
        reading=reduced.reading,
        reduction=reduced.reduction,
        software=reduced.software,
        series=list(reduced.series),
        points=next(iter(reduced.series.values())).size,
        sha256=hashlib.sha256(data).digest(),
        file=sent.data,
        data=data,
    )


def curve_of(session: Session, coupon: Coupon) -> CouponCurve:
    """The curve of a specimen.

    Raises:
        NotFound: its results were handed in without a curve.
    """
    curve = session.get(CouponCurve, coupon.id)
    if curve is None:
        raise NotFound("raw curve of coupon", coupon.id)
    return curve


def series_of(curve: CouponCurve) -> dict[str, FloatArray]:
    """(points,) SI arrays by name, verified. NaN where the machine wrote nothing.

    Raises:
        Damaged: the bytes are not the ones that were stored.
    """
    table = np.frombuffer(verified(curve.data, curve.sha256, "curve"), "<f8").reshape(
        len(curve.series), curve.points
    )
    return {name: row.astype(np.float64) for name, row in zip(curve.series, table, strict=True)}


def file_of(curve: CouponCurve) -> bytes:
    """The machine's file, byte for byte, verified.

    Raises:
        Damaged: the bytes are not the ones that were stored.
    """
    return verified(curve.file, curve.file_sha256, "file")


def describe_curve(curve: CouponCurve) -> CouponCurveOut:
    """A curve as clients see it: its file, how it was read, units, number of points, and what the
    standard reports.
    """
    return CouponCurveOut(
        file=CurveFile(
            filename=curve.filename,
            size=curve.file_size,
            sha256=curve.file_sha256.hex(),
            **curve.reading,
        ),
        series=curve.series,
        points=curve.points,
        sha256=curve.sha256.hex(),
        request=CurveCouponIn.model_validate(curve.request),
        reduction=curve.reduction,
        software=curve.software,
    )


def as_json(curve: CouponCurve) -> dict[str, Any]:
    """The series of a curve by name, in SI, with null where the machine wrote nothing, and their
    units.

    Raises:
        Damaged: the bytes are not the ones that were stored.
    """
    return {
        "units": {name: UNITS[name] for name in curve.series},
        "series": {
            name: [
                value if known else None
                for value, known in zip(row.tolist(), np.isfinite(row).tolist(), strict=True)
            ]
            for name, row in series_of(curve).items()
        },
    }


def as_csv(curve: CouponCurve) -> str:
    """The series of a curve as CSV: one line for each point; the header states the units. A cell is
    empty where the machine wrote nothing.

    Raises:
        Damaged: the bytes are not the ones that were stored.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\r\n")
    writer.writerow(f"{name} ({UNITS[name]})" for name in curve.series)
    for row in zip(*(values.tolist() for values in series_of(curve).values()), strict=True):
        writer.writerow("" if value != value else repr(value) for value in row)
    return text.getvalue()
