"""Raw curves in the database: the machine's file and its series, each under its SHA-256."""

from __future__ import annotations

import csv
import hashlib
import io
from typing import Any

import numpy as np
from sqlalchemy.orm import Session

from fecore.arrays import FloatArray
from service.coupons.bodies import RawCurve
from service.coupons.curve_schemas import CurveCouponIn, CurveFile, CurveOut
from service.coupons.reduction import Reduced
from service.coupons.tables import Coupon, CouponCurve
from service.problems import NotFound, ServiceError

UNITS = {"force": "N", "strain": "m/m", "strain_back": "m/m", "transverse_strain": "m/m", "time": "s"}


class DamagedCurveError(ServiceError):
    """Stored bytes of a curve do not have the SHA-256 that was recorded with them."""


def new_curve(coupon: Coupon, sent: RawCurve, reduced: Reduced) -> CouponCurve:
    """The row of a specimen's curve."""
    data = b"".join(np.ascontiguousarray(values, "<f8").tobytes() for values in reduced.series.values())
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
    """The specimen's curve.

    Raises:
        NotFound: its results were handed in without one.
    """
    curve = session.get(CouponCurve, coupon.id)
    if curve is None:
        raise NotFound("raw curve of coupon", coupon.id)
    return curve


def series_of(curve: CouponCurve) -> dict[str, FloatArray]:
    """(points,) SI arrays by name, verified. NaN where the machine wrote nothing.

    Raises:
        DamagedCurveError: the bytes are not the ones that were stored.
    """
    table = np.frombuffer(_verified(curve.data, curve.sha256), "<f8").reshape(len(curve.series), curve.points)
    return {name: row.astype(np.float64) for name, row in zip(curve.series, table, strict=True)}


def file_of(curve: CouponCurve) -> bytes:
    """The machine's file, byte for byte, verified.

    Raises:
        DamagedCurveError: the bytes are not the ones that were stored.
    """
    return _verified(curve.file, curve.file_sha256)


def describe_curve(curve: CouponCurve) -> CurveOut:
    """A curve as clients see it."""
    return CurveOut(
        file=CurveFile(filename=curve.filename, size=curve.file_size, sha256=curve.file_sha256.hex(), **curve.reading),
        series=curve.series,
        points=curve.points,
        sha256=curve.sha256.hex(),
        request=CurveCouponIn.model_validate(curve.request),
        reduction=curve.reduction,
        software=curve.software,
    )


def as_json(curve: CouponCurve) -> dict[str, Any]:
    """Series with null where the machine wrote nothing, and their units."""
    return {
        "units": {name: UNITS[name] for name in curve.series},
        "series": {
            name: [
                value if known else None for value, known in zip(row.tolist(), np.isfinite(row).tolist(), strict=True)
            ]
            for name, row in series_of(curve).items()
        },
    }


def as_csv(curve: CouponCurve) -> str:
    """One line a point; the header states the units. An empty cell is what the machine did not write."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\r\n")
    writer.writerow(f"{name} ({UNITS[name]})" for name in curve.series)
    for row in zip(*(values.tolist() for values in series_of(curve).values()), strict=True):
        writer.writerow("" if value != value else repr(value) for value in row)
    return text.getvalue()


def as_npz(curve: CouponCurve) -> bytes:
    """Series by name, SI."""
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **series_of(curve))
    return buffer.getvalue()


def _verified(data: bytes, sha256: bytes) -> bytes:
    if hashlib.sha256(data).digest() != sha256:
        raise DamagedCurveError(f"stored curve {sha256.hex()} fails its checksum; restore it from a backup")
    return data
