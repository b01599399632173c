"""Pages of coupon batches."""

from __future__ import annotations

from typing import Any
from uuid import UUID

from fastapi.responses import HTMLResponse

from service.show.pages.look import Visit, VisitDep
from service.store.coupons import routes as coupons
from service.web.routing import page_router

router = page_router()
MOST = 500  # specimens on a page


@router.get("/coupon-batches/{batch_id}")
def get_batch(batch_id: UUID, visit: VisitDep) -> HTMLResponse:
    """A batch: its specimens, their statistics, the priors that follow."""
    batch = coupons.batches.one(visit.session, visit.user, batch_id)
    specimens = coupons.coupons.page(visit.session, visit.user, batch_id, limit=MOST).items
    return visit.show(
        "batch.html",
        **visit.in_structure(batch.structure_id),
        batch=batch,
        coupons=specimens,
        as_before=next((_reading(visit, c.id) for c in reversed(specimens) if c.has_curve), {}),
        summary=coupons.get_summary(batch_id, visit.session, visit.user),
    )


def _reading(visit: Visit, coupon_id: UUID) -> dict[str, Any]:
    """How a specimen's raw curve was read, with which the form of the next one begins; its own sizes left out."""
    request = coupons.get_curve(coupon_id, visit.session, visit.user).request
    stated = request.model_dump(mode="json", include={"standard", "columns"}, exclude_none=True)
    return {**stated, "dimensions": {"unit": request.dimensions.unit}}
