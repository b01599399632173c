"""Pages of coupon batches."""

from __future__ import annotations

from uuid import UUID

from fastapi.responses import HTMLResponse

from service.show.pages.look import VisitDep
from service.store.coupons import routes as coupons
from service.web.routing import page_router

router = page_router()
MOST = 500  # specimens on a page


@router.get("/coupon-batches/{batch_id}")
def get_batch(batch_id: UUID, visit: VisitDep) -> HTMLResponse:
    """A batch: its specimens, their statistics, the priors that follow."""
    batch = coupons.batches.one(visit.session, visit.user, batch_id)
    return visit.show(
        "batch.html",
        **visit.in_structure(batch.structure_id),
        batch=batch,
        coupons=coupons.coupons.page(visit.session, visit.user, batch_id, limit=MOST).items,
        summary=coupons.get_summary(batch_id, visit.session, visit.user),
    )
