"""What `POST …/coupons` takes: results as JSON, or a raw curve as multipart with fields `coupon` (JSON) and `file`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import PurePosixPath, PureWindowsPath
from typing import Annotated, Any, TypeVar

from fastapi import Depends, Request
from pydantic import TypeAdapter, ValidationError
from starlette.datastructures import UploadFile
from starlette.exceptions import HTTPException

from service.access import CurrentUser, SettingsDep
from service.coupons.curve_schemas import CurveCouponIn
from service.coupons.schemas import CouponIn
from service.problems import Fault, Invalid, PayloadTooLarge, UnsupportedMediaType
from service.problems.json_body import escape, parse_json
from service.problems.openapi import schema_of

Body = TypeVar("Body")

MOST_COUPONS = 1000
MOST_FAULTS = 20

_ONE: TypeAdapter[CouponIn] = TypeAdapter(CouponIn)
_SEVERAL: TypeAdapter[list[CouponIn]] = TypeAdapter(list[CouponIn])
_CURVE: TypeAdapter[CurveCouponIn] = TypeAdapter(CurveCouponIn)


@dataclass(frozen=True)
class RawCurve:
    """A machine's file and what is said of it."""

    request: CurveCouponIn
    filename: str
    data: bytes


async def _received(request: Request, settings: SettingsDep, _: CurrentUser) -> list[CouponIn] | RawCurve:
    """The body, which is read after the key was checked."""
    kind = request.headers.get("content-type", "").split(";")[0].strip().lower()
    if kind == "multipart/form-data":
        return await _multipart(request, settings.json_limit_bytes)
    if kind and kind != "application/json" and not kind.endswith("+json"):
        raise UnsupportedMediaType(f"the body is {kind}, expected application/json or multipart/form-data")
    body = parse_json(await request.body())
    if not isinstance(body, list):
        return [_checked(_ONE, body)]
    if not 0 < len(body) <= MOST_COUPONS:
        raise Invalid("", f"the list has {len(body)} specimens, expected 1 to {MOST_COUPONS}")
    return _checked(_SEVERAL, body)


CouponBody = Annotated[list[CouponIn] | RawCurve, Depends(_received)]


async def _multipart(request: Request, limit: int) -> RawCurve:
    try:
        form = await request.form(max_files=1, max_fields=5, max_part_size=limit)
    except (HTTPException, KeyError, ValueError) as error:  # Starlette's form() turns a parser's error into the first
        detail = getattr(error, "detail", error)
        raise Invalid("", f"the multipart body cannot be read: {detail}") from None
    try:
        part, stated = form.get("file"), form.get("coupon")
        if not isinstance(part, UploadFile):
            raise Invalid("/file", "is missing: send the machine's file as multipart field `file`")
        if not isinstance(stated, str):
            raise Invalid(
                "/coupon", "is missing: send what is known of the specimen as JSON in multipart field `coupon`"
            )
        if part.size is None or part.size > limit:
            raise PayloadTooLarge(f"the file has {part.size} bytes, the operator allows {limit}")
        name = PurePosixPath(PureWindowsPath(part.filename or "").name).name or "curve.csv"
        return RawCurve(_checked(_CURVE, parse_json(stated.encode("utf-8", "surrogatepass"))), name, await part.read())
    finally:
        await form.close()


def _checked(adapter: TypeAdapter[Body], value: Any) -> Body:
    try:
        return adapter.validate_python(value)
    except ValidationError as error:
        faults = [
            Fault("".join(f"/{escape(step)}" for step in e["loc"]), e["msg"]) for e in error.errors()[:MOST_FAULTS]
        ]
        raise Invalid(faults) from None


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
