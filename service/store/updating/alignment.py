"""The test over the model: how far each measured point of a campaign lies from the structure's walls."""

from __future__ import annotations

from uuid import UUID

import numpy as np
from anyio import from_thread
from pydantic import Field

from service.access import CurrentUser, SessionDep
from service.compute.models.alignment import Distances, distances
from service.jobs.aside import read_aside
from service.store.campaigns.operations import campaign_for
from service.store.frfs.data import specimen_points
from service.store.structures.operations import present_structure
from service.store.updating.loading import body_for
from service.store.updating.schemas import RecipeIn
from service.web import StrictModel, api_router

router = api_router(tags=["campaigns"])


class AlignedPointOut(StrictModel):
    """A grid point in the structure's frame, and the place of the model that it belongs to."""

    label: int = Field(description="of the grid point")
    x_m: float = Field(description="in the structure's frame, m")
    y_m: float = Field(description="in the structure's frame, m")
    z_m: float = Field(description="in the structure's frame, m")
    distance_m: float = Field(description="from the wall's middle surface or the beam's axis, m")
    set: str = Field(description="of the nearest elements")
    normal: tuple[float, float, float] = Field(description="of the surface there, a unit vector")
    off: bool = Field(description="further away than half the wall and 2 mm: an update refuses it")


class AlignmentOut(StrictModel):
    """How a campaign's points lie on the structure's model."""

    rms_m: float | None = Field(description="root mean square of the distances, m; null without points")
    off: list[int] = Field(description="labels of the points that an update refuses")
    items: list[AlignedPointOut]


@router.get("/campaigns/{campaign_id}/alignment")
def get_alignment(campaign_id: UUID, session: SessionDep, user: CurrentUser) -> AlignmentOut:
    """Each grid point's distance from the model, with the nearest set and the surface's normal."""
    campaign = campaign_for(session, user, campaign_id)
    _, structure = present_structure(session, campaign.structure_id)
    body = body_for(session, structure, campaign.boundary, RecipeIn.model_validate({}))
    places = specimen_points(session, campaign)
    if not places:
        return AlignmentOut(rms_m=None, off=[], items=[])
    points = np.array(list(places.values()))
    found: Distances = from_thread.run(read_aside, distances, body, points)
    items = [
        AlignedPointOut(label=label, x_m=x, y_m=y, z_m=z, distance_m=float(away), set=name, normal=n, off=bool(off))
        for label, (x, y, z), away, name, n, off in zip(
            places, places.values(), found.distance_m, found.sets, found.normal.tolist(), found.off, strict=True
        )
    ]
    rms = float(np.sqrt(np.mean(found.distance_m**2)))
    return AlignmentOut(rms_m=rms, off=[item.label for item in items if item.off], items=items)
