"""How the points of a test lie on a model, and where its frame is."""

from dataclasses import dataclass

from fecore.arrays import BoolArray, FloatArray
from fecore.body.align import Motion, by_closest, by_pairs
from fecore.body.constants import Body


@dataclass(frozen=True)
class Distances:
    """Where points lie."""

    distance_m: FloatArray  # (p,) from the middle surface or the beam's axis
    sets: tuple[str, ...]  # of the nearest elements
    normal: FloatArray  # (p, 3) of the surface there; of a beam towards the point
    off: BoolArray  # (p,) which lie further away than an update takes


def distances(body: Body, points: FloatArray) -> Distances:
    """How far (p, 3) points in the body's frame lie from it, m."""
    surfaces = body.surfaces
    closest = surfaces.nearest(points)
    sets = tuple(surfaces.mesh.blocks[number].set for number in closest.block.tolist())
    return Distances(closest.distance, sets, closest.normal, surfaces.are_off(points, closest))


def motions_of(body: Body, points: FloatArray, places: FloatArray | None) -> tuple[Motion, ...]:
    """Motions from a file's coordinates to the body's frame, the best first.

    Args:
        body: as it is modelled.
        points: (p, 3) in the file's coordinates, m.
        places: (p, 3) where they are on the body; None to find the closest.

    Raises:
        InputError: there are fewer than three points, or they lie on a line.
    """
    return (
        by_closest(body.model.surfaces, points) if places is None else (by_pairs(points, places),)
    )
