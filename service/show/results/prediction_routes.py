"""Routes of predicted FRFs."""

from __future__ import annotations

from hashlib import sha256
from typing import Annotated
from uuid import UUID

from fastapi import Header, Query, Request, Response
from fastapi.responses import FileResponse

from service.access import CurrentUser, SessionDep
from service.errors import Invalid
from service.show.results.predictions import Chosen, Model, predicted_table
from service.store.frfs.data import Cut
from service.store.frfs.routes import FORMATS
from service.store.updating.operations import update_job_for
from service.web import api_router
from service.web.conditional import not_modified
from service.web.downloads import spooled
from service.web.negotiation import choose_format, one_of

router = api_router(tags=["update jobs"])

MEDIA_TYPES = {name: form.media_type for name, form in FORMATS.items()}
FILES = {200: {"content": {kind: {} for kind in MEDIA_TYPES.values()}, "description": "The spectra."}}
Hertz = Annotated[float | None, Query(ge=0, le=1e12, allow_inf_nan=False)]
Whole = Annotated[int | None, Query(ge=0, le=9_999_999_999)]


@router.get("/update-jobs/{job_id}/frfs/data", response_class=FileResponse, responses=FILES)  # type: ignore[arg-type]
def get_predicted_frfs(
    job_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    request: Request,
    model: Annotated[Model, Query(description="with the updated parameters, or with the initial ones")] = "updated",
    point: Annotated[Whole, Query(description="response point")] = None,
    direction: Annotated[int | None, Query(ge=-6, le=6, description="signed response direction")] = None,
    reference: Annotated[Whole, Query(description="reference point")] = None,
    fmin: Annotated[Hertz, Query(description="Hz")] = None,
    fmax: Annotated[Hertz, Query(description="Hz")] = None,
    stride: Annotated[int, Query(ge=1, le=1_000_000, description="every how many-th line")] = 1,
    file_format: Annotated[
        Annotated[str, one_of(MEDIA_TYPES)] | None,
        Query(alias="format", description="as of measured FRFs; default: by Accept"),
    ] = None,
    accept: Annotated[str | None, Header(include_in_schema=False)] = None,
) -> Response:
    """FRFs that the model predicts where FRFs were measured, in the formats, coordinates and order of the measured ones.

    `id` and `label` are those of the measured FRF. Values are in single precision.
    """
    if fmin is not None and fmax is not None and fmin > fmax:
        raise Invalid("fmin", f"is {fmin:g} Hz and above fmax, {fmax:g} Hz")
    job = update_job_for(session, user, job_id)
    name = choose_format(file_format, accept, MEDIA_TYPES)
    form = FORMATS[name]
    table = predicted_table(session, job, model, Chosen(point, direction, reference), Cut(fmin, fmax, stride))
    # A result never changes: the query says which part of it this is, and only UFF holds grid points, which may.
    headers = {"Vary": "Accept"}
    if form.one_table:
        headers["ETag"] = f'"{job.id}-{name}-{sha256(request.url.query.encode()).hexdigest()[:16]}"'
        if (unchanged := not_modified(request, headers)) is not None:
            return unchanged
    return spooled(lambda file: form.write([table], file), form.media_type, f"predicted.{form.suffix}", headers)
