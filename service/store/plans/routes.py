"""Routes of plans: where to hit next."""

from __future__ import annotations

from uuid import UUID

from anyio import from_thread

from service.access import CurrentUser, SessionDep
from service.compute.planning import compute_plan
from service.jobs.aside import read_aside
from service.store.plans.orders import PlanIn, PlanOut, order_of
from service.web import api_router

router = api_router(tags=["update jobs"])


@router.post("/structures/{structure_id}/plans")
def plan(structure_id: UUID, body: PlanIn, session: SessionDep, user: CurrentUser) -> PlanOut:
    """Rank tests by what they would add to what is known of the material. `{}` compares boundaries and an added mass.

    Nothing is stored; send it again with each new campaign in `made`. It takes a minute at most.
    """
    order = order_of(session, user, structure_id, body)
    return PlanOut.model_validate(from_thread.run(read_aside, compute_plan, order))
