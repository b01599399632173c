"""Routes of coupon batches and coupons.

`POST …/coupons` takes results as JSON, or a raw curve as multipart with fields `coupon` (JSON) and
`file`.
"""

import io
import shutil
import tempfile
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any
from urllib.parse import quote
from uuid import UUID

from fastapi import Depends, Request, Response
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import JSONResponse

from modalbase.formats.arrays_out import ARRAY_WRITERS
from service.nouns.coupons import curves, operations
from service.nouns.coupons.reduction import Reduced, reduce_curve
from service.nouns.coupons.schemas import (
    BatchIn,
    BatchOut,
    CouponCurveOut,
    CouponIn,
    CouponOut,
    CurveCouponIn,
    ExclusionIn,
    Summary,
)
from service.platform.access import CurrentUser, SessionDep, SettingsDep, api_router
from service.platform.access.nouns import NounRoutes
from service.platform.errors import Invalid, PayloadTooLarge, UnsupportedMediaType
from service.platform.queue.subprocess_read import in_subprocess
from service.platform.web import IF_MATCH, Confirm, Page, etag_of, require_match, require_usual
from service.platform.web.admission import without_slot
from service.platform.web.json_body import checked, parse_json
from service.platform.web.negotiation import content_type, is_json
from service.platform.web.openapi import BINARY, reads
from service.platform.web.parameters import form_of
from service.platform.web.uploads import multipart

MOST_COUPONS = 1000
_reduce = in_subprocess(reduce_curve)


@dataclass(frozen=True)
class RawCurve:
    """A machine's file, what is said of it, and what came of it by its standard."""

    request: CurveCouponIn
    filename: str
    data: bytes
    reduced: Reduced

    @property
    def stated(self) -> list[Any]:
        """What the request says, as JSON: the file by its SHA-256."""
        return [self.request.model_dump(mode="json"), self.filename, sha256(self.data).hexdigest()]


async def _received(request: Request, settings: SettingsDep) -> list[CouponIn] | RawCurve:
    """The body. No transaction is open while it is read."""
    kind = content_type(request.headers.get("content-type"))
    if kind == "multipart/form-data":
        return await _curve(request, settings.json_limit_bytes)
    if kind and not is_json(kind):
        raise UnsupportedMediaType(
            f"the body is {kind}, expected application/json or multipart/form-data"
        )
    body = await run_in_threadpool(parse_json, await request.body())
    if not isinstance(body, list):
        return [checked(CouponIn, body)]
    if not 0 < len(body) <= MOST_COUPONS:
        raise Invalid("", f"the list has {len(body)} specimens, expected 1 to {MOST_COUPONS}")
    return checked(list[CouponIn], body)


CouponBody = Annotated[list[CouponIn] | RawCurve, Depends(_received)]


async def _curve(request: Request, limit: int) -> RawCurve:
    async with multipart(request, limit) as form:
        stated = form.text_of("coupon")
        if stated is None:
            raise Invalid(
                "/coupon",
                "is missing: send what is known of the specimen as JSON in multipart field"
                " `coupon`",
            )
        if form.file.size is None or form.file.size > limit:
            raise PayloadTooLarge(
                f"the file has {form.file.size} bytes, the operator allows {limit}"
            )
        sent = checked(CurveCouponIn, parse_json(stated.encode("utf-8", "surrogatepass")))
        # not in memory while others are read
        with tempfile.NamedTemporaryFile(prefix="modalbase-curve-") as file:
            await run_in_threadpool(shutil.copyfileobj, form.file.file, file)
            file.flush()
            async with without_slot(request.scope):
                reduced = await _reduce(Path(file.name), sent)
            data = await run_in_threadpool(Path(file.name).read_bytes)
        return RawCurve(sent, form.filename or "curve.csv", data, reduced)


COUPONS = {
    "application/json": {"anyOf": [CouponIn, {"type": "array", "items": CouponIn}]},
    "multipart/form-data": {
        "title": "CurveForm",
        "type": "object",
        "required": ["file", "coupon"],
        "properties": {
            "file": {**BINARY, "description": "the testing machine's file, with its name"},
            "coupon": {
                "allOf": [CurveCouponIn],
                "examples": CurveCouponIn.model_json_schema()["examples"],
            },
        },
    },
}
"""What is read, by media type."""

router = api_router(tags=["coupons"])
batches = NounRoutes(
    router, operations.batch_for, BatchOut, operations.describe_all, "coupon-batches", "batch_id"
)
coupons = NounRoutes(
    router,
    operations.coupon_for,
    CouponOut,
    lambda _, rows: map(operations.describe_coupon, rows),
    "coupons",
    "coupon_id",
)

CURVE_TYPES = {
    "json": "application/json",
    "csv": "text/csv",
    **{name: writer.media_type for name, writer in ARRAY_WRITERS.items()},
}
CURVES: dict[int | str, dict[str, Any]] = {
    200: {"content": {kind: {} for kind in CURVE_TYPES.values()}}
}
ORIGINAL: dict[int | str, dict[str, Any]] = {200: {"content": {"application/octet-stream": {}}}}


batches.creating(
    "create_batch",
    "Open a batch: which constants it gives, and published means of those that have no specimens"
    " here.",
    BatchIn,
    operations.create_batch,
    measured=True,
)
batches.listing("list_batches", "Coupon batches of a structure.")
batches.getting("get_batch", "A coupon batch.")


@router.post("/coupon-batches/{batch_id}/coupons", status_code=201, openapi_extra=reads(COUPONS))
def create_coupons(
    batch_id: UUID,
    body: CouponBody,
    session: SessionDep,
    user: CurrentUser,
    confirm: Confirm = False,
) -> Page[CouponOut]:
    """Record specimens: results of one, or of several as a list, in JSON; or the raw curve of one
    as multipart.

    The multipart fields are `file`, as the testing machine wrote it, and `coupon`, JSON with the
    dimensions, the columns and their units. The curve is reduced by D3039 or D3518 and kept with
    its results. All are stored, or none.
    """
    batch = operations.batch_for(session, user, batch_id, "editor")
    if isinstance(body, RawCurve):
        require_usual(body.request, confirm)
        require_usual(body.reduced.coupon, confirm)
        rows = [operations.add_measured_coupon(session, user, batch, body)]
    else:
        require_usual(body if len(body) > 1 else body[0], confirm)
        rows = operations.add_coupons(session, user, batch, body)
    return Page(items=[operations.describe_coupon(row) for row in rows])


coupons.listing(
    "list_coupons", "Specimens of a batch, excluded ones included.", owners="coupon-batches"
)


@router.get("/coupon-batches/{batch_id}/summary")
def get_summary(batch_id: UUID, session: SessionDep, user: CurrentUser) -> Summary:
    """Statistics of a batch: mean, n-1 standard deviation and coefficient of variation of each
    property, and the constants that follow.
    """
    return operations.summarise(session, operations.batch_for(session, user, batch_id))


coupons.getting("get_coupon", "A specimen.", tagged=True)


@router.patch("/coupons/{coupon_id}", openapi_extra=IF_MATCH)
def change_coupon(
    coupon_id: UUID,
    body: ExclusionIn,
    session: SessionDep,
    user: CurrentUser,
    request: Request,
    response: Response,
) -> CouponOut:
    """Exclude a specimen from its batch with a reason, or take it back in. It stays recorded either
    way.
    """
    coupon = operations.coupon_for(session, user, coupon_id, "editor", lock=True)
    require_match(request, etag_of(coupons.shown(session, coupon)))
    operations.exclude(session, user, coupon, body)
    return coupons.tagged(session, coupon, response)


@router.get("/coupons/{coupon_id}/curve")
def get_curve(coupon_id: UUID, session: SessionDep, user: CurrentUser) -> CouponCurveOut:
    """Where a specimen's raw curve came from, how it was read, and all that its standard reports of
    it.
    """
    return curves.describe_curve(
        curves.curve_of(session, operations.coupon_for(session, user, coupon_id))
    )


@router.get("/coupons/{coupon_id}/curve/data", response_class=Response, responses=CURVES)
def get_curve_data(
    coupon_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    form: Annotated[str, form_of(CURVE_TYPES)],
) -> Response:
    """The raw curve in SI: force N, strains m/m, time s; in arrays NaN where the machine wrote
    nothing.
    """
    curve = curves.curve_of(session, operations.coupon_for(session, user, coupon_id))
    headers = {"ETag": f'"{curve.sha256.hex()[:32]}-{form}"', "Vary": "Accept"}
    if form == "csv":
        return Response(curves.as_csv(curve), media_type="text/csv", headers=headers)
    if form in ARRAY_WRITERS:
        file = io.BytesIO()
        ARRAY_WRITERS[form].write(curves.series_of(curve), file)
        return Response(file.getvalue(), media_type=CURVE_TYPES[form], headers=headers)
    return JSONResponse(curves.as_json(curve), headers=headers)


@router.get("/coupons/{coupon_id}/curve/original", response_class=Response, responses=ORIGINAL)
def get_coupons_curve_original(coupon_id: UUID, session: SessionDep, user: CurrentUser) -> Response:
    """The testing machine's file as it was uploaded, byte for byte."""
    curve = curves.curve_of(session, operations.coupon_for(session, user, coupon_id))
    headers = {
        "ETag": f'"{curve.file_sha256.hex()}"',
        "Content-Disposition": f"attachment; filename*=UTF-8''{quote(curve.filename, safe='')}",
    }
    return Response(curves.file_of(curve), media_type="application/octet-stream", headers=headers)
