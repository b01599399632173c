"""Routes of coupon batches and coupons."""

from __future__ import annotations

from typing import Annotated, Any
from uuid import UUID

from fastapi import Body, Response
from pydantic import BeforeValidator, Field
from sqlalchemy import select

from service.access import CurrentUser, Cursor, Limit, SessionDep, paged
from service.coupons import operations
from service.coupons.schemas import BatchIn, BatchOut, CouponIn, CouponOut, Summary
from service.coupons.tables import Coupon, CouponBatch
from service.problems import Page, api_router
from service.structures.operations import structure_for

router = api_router(tags=["coupons"])


def _as_list(body: Any) -> Any:
    """A specimen that is sent alone is a list of one, and its faults keep their own pointers."""
    return body if isinstance(body, list) else [CouponIn.model_validate(body)]


Coupons = Annotated[list[CouponIn], BeforeValidator(_as_list), Field(min_length=1, max_length=1000)]


@router.post("/structures/{structure_id}/coupon-batches", status_code=201)
def create_batch(
    structure_id: UUID, body: BatchIn, session: SessionDep, user: CurrentUser, response: Response
) -> BatchOut:
    """Open a batch: which constants it gives, and published means of those that have no specimens here."""
    batch = operations.create_batch(session, user, structure_id, body)
    response.headers["Location"] = f"/api/v1/coupon-batches/{batch.id}"
    return operations.describe_all(session, [batch])[0]


@router.get("/structures/{structure_id}/coupon-batches")
def list_batches(
    structure_id: UUID, session: SessionDep, user: CurrentUser, cursor: Cursor = None, limit: Limit = 100
) -> Page[BatchOut]:
    """Coupon batches of a structure."""
    structure = structure_for(session, user, structure_id)
    query = select(CouponBatch).where(CouponBatch.structure_id == structure.id)
    rows, following = paged(session, query, CouponBatch.id, cursor, limit)
    return Page(items=operations.describe_all(session, rows), next_cursor=following)


@router.get("/coupon-batches/{batch_id}")
def get_batch(batch_id: UUID, session: SessionDep, user: CurrentUser) -> BatchOut:
    """A coupon batch."""
    return operations.describe_all(session, [operations.batch_for(session, user, batch_id)])[0]


@router.post("/coupon-batches/{batch_id}/coupons", status_code=201)
def create_coupons(
    batch_id: UUID, body: Annotated[Coupons, Body()], session: SessionDep, user: CurrentUser
) -> Page[CouponOut]:
    """Record the results of one specimen, or of several as a list; all are stored, or none."""
    batch = operations.batch_for(session, user, batch_id, "editor")
    rows = operations.add_coupons(session, user, batch, body)
    return Page(items=[operations.describe_coupon(row) for row in rows])


@router.get("/coupon-batches/{batch_id}/coupons")
def list_coupons(
    batch_id: UUID, session: SessionDep, user: CurrentUser, cursor: Cursor = None, limit: Limit = 100
) -> Page[CouponOut]:
    """Specimens of a batch, excluded ones included."""
    batch = operations.batch_for(session, user, batch_id)
    rows, following = paged(session, select(Coupon).where(Coupon.batch_id == batch.id), Coupon.id, cursor, limit)
    return Page(items=[operations.describe_coupon(row) for row in rows], next_cursor=following)


@router.get("/coupon-batches/{batch_id}/summary")
def get_summary(batch_id: UUID, session: SessionDep, user: CurrentUser) -> Summary:
    """Mean, n-1 standard deviation and coefficient of variation of each property, and the constants that follow."""
    return operations.summarise(session, operations.batch_for(session, user, batch_id))
