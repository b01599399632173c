"""Routes of time blocks."""

import io
from functools import partial
from typing import Annotated
from uuid import UUID

import numpy as np
from fastapi import Query, Response
from fastapi.responses import JSONResponse

from modalbase.formats.arrays_out import ARRAY_WRITERS
from service.nouns.campaigns.operations import campaign_for
from service.nouns.records import operations
from service.nouns.records.processings import decide, decisions_of
from service.nouns.records.schemas import (
    UNITS,
    HitDecisionIn,
    HitDecisionOut,
    RecordOut,
)
from service.platform.access import CurrentUser, SessionDep, api_router
from service.platform.errors import require_bytes
from service.platform.web import Cursor, Limit, Page, paged, shown_as
from service.platform.web.parameters import form_of

router = api_router(tags=["records"])


Whole = Annotated[int | None, Query(ge=0, le=9_999_999_999)]
MEDIA_TYPES = {
    "json": "application/json",
    **{name: writer.media_type for name, writer in ARRAY_WRITERS.items()},
    "csv": "text/csv",
}


@router.get("/campaigns/{campaign_id}/records")
def list_records(
    campaign_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    point: Annotated[Whole, Query(description="where it was hit")] = None,
    hit: Annotated[Whole, Query(description="number of the hit")] = None,
    cursor: Cursor = None,
    limit: Limit = 100,
) -> Page[RecordOut]:
    """Time blocks of a campaign, without their samples."""
    campaign = campaign_for(session, user, campaign_id)
    return paged(
        session,
        operations.query_of(campaign.id, point, hit),
        cursor,
        limit,
        partial(map, operations.describe),
    )


@router.get("/records/{record_id}")
def get_record(record_id: UUID, session: SessionDep, user: CurrentUser) -> RecordOut:
    """A time block without its samples."""
    return operations.describe(operations.record_for(session, user, record_id))


@router.get(
    "/records/{record_id}/data", responses={200: {"content": {m: {} for m in MEDIA_TYPES.values()}}}
)
def get_record_data(
    record_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    form: Annotated[str, form_of(MEDIA_TYPES)],
) -> Response:
    """Samples of a time block in SI with their time axis, as JSON, npz, HDF5, Parquet or CSV."""
    row = operations.record_for(session, user, record_id)
    require_bytes("time block", row.bytes_deleted_at)
    rows = operations.block_rows(session, row.campaign_id, {row.force_point})
    blocks = [r for r in rows[row.force_point, row.force_direction] if r.id == row.id]
    (samples,) = operations.samples_of(session, blocks)
    time = np.arange(samples.size) / row.sample_rate_hz
    if form == "json":
        shown = {
            "sample_rate_hz": row.sample_rate_hz,
            "unit": UNITS[row.quantity],
            "samples": samples.tolist(),
        }
        return JSONResponse(shown)
    file = io.BytesIO()
    if form in ARRAY_WRITERS:
        arrays = {"time_s": time, "samples": samples, "sample_rate_hz": row.sample_rate_hz}
        ARRAY_WRITERS[form].write(arrays, file)
    else:
        np.savetxt(
            file,
            np.column_stack((time, samples)),
            "%.9g",
            ",",
            header=f"time_s,{row.quantity}",
            comments="",
        )
    return Response(file.getvalue(), media_type=MEDIA_TYPES[form], headers={"Vary": "Accept"})


@router.delete("/records/{record_id}", status_code=204)
def delete_record(record_id: UUID, session: SessionDep, user: CurrentUser) -> None:
    """Delete a time block. FRFs that were made of it stay."""
    operations.remove_record(session, user, record_id)


@router.post("/campaigns/{campaign_id}/hit-decisions", status_code=201)
def judge_hit(
    campaign_id: UUID, body: HitDecisionIn, session: SessionDep, user: CurrentUser
) -> HitDecisionOut:
    """Accept or refuse a hit by hand: every later processing keeps to it, and the decision says who
    made it, when and why.
    """
    return shown_as(HitDecisionOut, decide(session, user, campaign_id, body))


@router.get("/campaigns/{campaign_id}/hit-decisions")
def list_hit_decisions(
    campaign_id: UUID,
    session: SessionDep,
    user: CurrentUser,
    cursor: Cursor = None,
    limit: Limit = 100,
) -> Page[HitDecisionOut]:
    """Decisions about a campaign's hits, newest first; of several about one hit the newest
    counts.
    """
    campaign = campaign_for(session, user, campaign_id)
    shown = partial(map, partial(shown_as, HitDecisionOut))
    return paged(session, decisions_of(campaign.id), cursor, limit, shown, newest_first=True)
