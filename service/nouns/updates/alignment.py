"""The test over the model: how far each measured point of a campaign lies from the structure's
walls.
"""

from uuid import UUID

import numpy as np
from anyio import from_thread
from pydantic import Field

from fecore.body.align import Motion
from service.compute.models.alignment import distances, motions_of
from service.nouns.campaigns.operations import campaign_for, stored_points
from service.nouns.campaigns.schemas import Coordinate, FrameIn
from service.nouns.frfs.data import specimen_points
from service.nouns.structures.operations import present_structure
from service.nouns.updates.bodies import body_for
from service.nouns.updates.schemas import USUAL
from service.platform.access import CurrentUser, SessionDep, api_router
from service.platform.errors import Invalid
from service.platform.queue.subprocess_read import in_subprocess
from service.platform.web import LongList, RequestModel, StrictModel, example

router = api_router(tags=["campaigns"])
_distances, _motions = in_subprocess(distances), in_subprocess(motions_of)


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

    rms_m: float | None = Field(
        description="root mean square of the distances, m; null without points"
    )
    off: list[int] = Field(description="labels of the points that an update refuses")
    items: list[AlignedPointOut]


@router.get("/campaigns/{campaign_id}/alignment")
def get_alignment(campaign_id: UUID, session: SessionDep, user: CurrentUser) -> AlignmentOut:
    """Each grid point's distance from the model, with the nearest set and the surface's normal."""
    campaign = campaign_for(session, user, campaign_id)
    _, structure = present_structure(session, campaign.structure_id)
    body = body_for(session, structure, campaign.boundary, USUAL)
    places = specimen_points(session, campaign)
    if not places:
        return AlignmentOut(rms_m=None, off=[], items=[])
    points = np.array(list(places.values()))
    offsets = from_thread.run(_distances, body, points)
    items = [
        AlignedPointOut(
            label=label,
            x_m=x,
            y_m=y,
            z_m=z,
            distance_m=float(distance),
            set=name,
            normal=n,
            off=bool(off),
        )
        for label, (x, y, z), distance, name, n, off in zip(
            places,
            places.values(),
            offsets.distance_m,
            offsets.sets,
            offsets.normal.tolist(),
            offsets.off,
            strict=True,
        )
    ]
    rms = float(np.sqrt(np.mean(offsets.distance_m**2)))
    return AlignmentOut(rms_m=rms, off=[item.label for item in items if item.off], items=items)


class PairIn(RequestModel):
    """A grid point, and where it is on the structure."""

    label: int = Field(description="of the grid point")
    x_m: Coordinate = Field(description="in the structure's frame, m")
    y_m: Coordinate = Field(description="in the structure's frame, m")
    z_m: Coordinate = Field(description="in the structure's frame, m")


class AlignIn(RequestModel):
    """How to find a campaign's frame; `{}` takes the closest points."""

    model_config = example()

    pairs: LongList[PairIn] | None = Field(
        None,
        min_length=3,
        max_length=10_000,
        description="three or more that are not on a line; default: closest points",
    )


class ResidualOut(StrictModel):
    """How far a point is from where it should be."""

    label: int = Field(description="of the grid point")
    distance_m: float = Field(description="from its place, or from the nearest face, m")


class FoundFrameOut(StrictModel):
    """A frame that brings the test onto the model."""

    frame: FrameIn = Field(description="as a campaign takes it")
    rms_m: float = Field(description="root mean square of the distances, m")
    items: list[ResidualOut]


class FoundFramesOut(StrictModel):
    """Frames that fit, the best first. Several: the body and the grid are alike from several sides,
    so name pairs.
    """

    frames: list[FoundFrameOut] = Field(description="the best first")
    sentence: str = Field(description="what was found, in words")


@router.post("/campaigns/{campaign_id}/alignment")
def find_alignment(
    campaign_id: UUID, body: AlignIn, session: SessionDep, user: CurrentUser
) -> FoundFramesOut:
    """Find the frame that brings points onto the structure: by named pairs, or by the
    closest points.

    Nothing is stored: `PATCH /campaigns/{id}` with a `frame` takes it.
    """
    campaign = campaign_for(session, user, campaign_id, "editor")
    _, structure = present_structure(session, campaign.structure_id)
    model = body_for(session, structure, campaign.boundary, USUAL)
    places = stored_points(session, campaign.id)
    targets = None
    if body.pairs is not None:
        if unknown := [pair.label for pair in body.pairs if pair.label not in places]:
            raise Invalid("/pairs", f"{unknown[0]} is no grid point of the campaign")
        places = {pair.label: places[pair.label] for pair in body.pairs}
        targets = np.array([(pair.x_m, pair.y_m, pair.z_m) for pair in body.pairs])
    points = np.array(list(places.values())).reshape(-1, 3)
    motions = from_thread.run(_motions, model, points, targets)
    return FoundFramesOut(
        frames=[_frame(motion, list(places)) for motion in motions], sentence=_sentence(motions)
    )


def _frame(motion: Motion, labels: list[int]) -> FoundFrameOut:
    """x_specimen = Rx + t, and a frame is x_specimen = Eᵀ(x − origin): E = Rᵀ, origin = −Rᵀt."""
    origin = (-motion.turn.T @ motion.shift).tolist()
    frame = FrameIn(
        origin_m=tuple(origin),
        x_axis=tuple(motion.turn[0].tolist()),
        y_axis=tuple(motion.turn[1].tolist()),
    )
    items = [
        ResidualOut(label=label, distance_m=float(distance))
        for label, distance in zip(labels, motion.residual, strict=True)
    ]
    return FoundFrameOut(frame=frame, rms_m=motion.rms, items=items)


def _sentence(motions: tuple[Motion, ...]) -> str:
    first = f"the points lie {1e3 * motions[0].rms:.3g} mm (rms) from their places"
    if len(motions) == 1:
        return first
    return f"{first}; {len(motions)} frames fit about as well, so name three pairs or more"
