"""What `POST …/coupons` takes: results as JSON, or a raw curve as multipart with fields `coupon` (JSON) and `file`."""

from __future__ import annotations

import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from fastapi import Depends, Request
from fastapi.concurrency import run_in_threadpool

from service.access import SettingsDep
from service.errors import Invalid, PayloadTooLarge, UnsupportedMediaType
from service.jobs.aside import read_aside
from service.store.coupons.curve_schemas import CurveCouponIn
from service.store.coupons.reduction import Reduced, reduce_curve
from service.store.coupons.schemas import CouponIn
from service.web.gate import without_slot
from service.web.json_body import checked, parse_json
from service.web.negotiation import content_type, is_json
from service.web.openapi import schema_of
from service.web.uploads import multipart

MOST_COUPONS = 1000


@dataclass(frozen=True)
class RawCurve:
    """A machine's file, what is said of it, and what came of it by its standard."""

    request: CurveCouponIn
    filename: str
    data: bytes
    reduced: Reduced


async def _received(request: Request, settings: SettingsDep) -> list[CouponIn] | RawCurve:
    """The body. No transaction is open while it is read."""
    kind = content_type(request.headers.get("content-type"))
    if kind == "multipart/form-data":
        return await _curve(request, settings.json_limit_bytes)
    if kind and not is_json(kind):
        raise UnsupportedMediaType(f"the body is {kind}, expected application/json or multipart/form-data")
    body = await run_in_threadpool(parse_json, await request.body())
    if not isinstance(body, list):
        return [checked(CouponIn, body)]
    if not 0 < len(body) <= MOST_COUPONS:
        raise Invalid("", f"the list has {len(body)} specimens, expected 1 to {MOST_COUPONS}")
    return checked(list[CouponIn], body)


CouponBody = Annotated[list[CouponIn] | RawCurve, Depends(_received)]


async def _curve(request: Request, limit: int) -> RawCurve:
    async with multipart(request, limit) as form:
        stated = form.fields.get("coupon")
        if stated is None:
            raise Invalid(
                "/coupon", "is missing: send what is known of the specimen as JSON in multipart field `coupon`"
            )
        if form.file.size is None or form.file.size > limit:
            raise PayloadTooLarge(f"the file has {form.file.size} bytes, the operator allows {limit}")
        sent = checked(CurveCouponIn, parse_json(stated.encode("utf-8", "surrogatepass")))
        with tempfile.NamedTemporaryFile(prefix="modalbase-curve-") as file:  # not in memory while others are read
            await run_in_threadpool(shutil.copyfileobj, form.file.file, file)
            file.flush()
            async with without_slot(request.scope):
                reduced = await read_aside(reduce_curve, Path(file.name), sent)
            data = await run_in_threadpool(Path(file.name).read_bytes)
        return RawCurve(sent, form.filename or "curve.csv", data, reduced)


def documented() -> dict[str, Any]:
    """The bodies for the OpenAPI document."""
    return {
        "requestBody": {
            "required": True,
            "content": {
                "application/json": {
                    "schema": {"anyOf": [schema_of(CouponIn), {"type": "array", "items": schema_of(CouponIn)}]}
                },
                "multipart/form-data": {
                    "schema": {
                        "type": "object",
                        "required": ["file", "coupon"],
                        "properties": {
                            "file": {"type": "string", "format": "binary"},
                            "coupon": schema_of(CurveCouponIn),
                        },
                    }
                },
            },
        }
    }
