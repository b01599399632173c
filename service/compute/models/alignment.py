"""How the points of a test lie on a model."""

from __future__ import annotations

from dataclasses import dataclass

from fecore.arrays import BoolArray, FloatArray
from fecore.body.constants import Body


@dataclass(frozen=True)
class Distances:
    """Where points lie.

    Attributes:
        distance_m: (p,) from the middle surface or the beam's axis.
        sets: of the nearest elements.
        normal: (p, 3) of the surface there; of a beam towards the point.
        off: (p,) which lie further away than an update takes.
    """

    distance_m: FloatArray
    sets: tuple[str, ...]
    normal: FloatArray
    off: BoolArray


def distances(body: Body, points: FloatArray) -> Distances:
    """How far (p, 3) points in the body's frame lie from it, m."""
    surfaces = body.model.surfaces
    found = surfaces.nearest(points)
    sets = tuple(surfaces.mesh.blocks[number].set for number in found.block.tolist())
    return Distances(found.distance, sets, found.normal, surfaces.are_off(points, found))
