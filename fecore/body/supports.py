"""What holds a specimen and what it carries: edges, springs, point masses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from fecore.errors import InputError

EdgeSupport = Literal["free", "clamped", "simply_supported", "simply_supported_normal"]
Boundary = Literal["cantilever", "free", "simply_supported"]
Edge = Literal["start", "end", "lower", "upper"]


@dataclass(frozen=True)
class Supports:
    """How each edge of the rectangle is held: `start` is x = 0, `end` x = L, `lower` and `upper` y = ∓b/2.

    A simply supported edge holds w and the displacement and rotation along the edge's own direction ("hard" support,
    free to move across the edge in the plane: SS-1 in the literature). One that is `simply_supported_normal` lets the edge
    move along its own direction and holds it across (SS-2), as the closed forms of antisymmetric angle-ply plates have it.
    """

    start: EdgeSupport = "free"
    end: EdgeSupport = "free"
    lower: EdgeSupport = "free"
    upper: EdgeSupport = "free"

    def __post_init__(self) -> None:
        for edge in get_args(Edge):
            if getattr(self, edge) not in get_args(EdgeSupport):
                raise InputError(
                    f"supports.{edge}", f"is {getattr(self, edge)!r}, expected {', '.join(get_args(EdgeSupport))}"
                )

    @classmethod
    def of(cls, boundary: Boundary) -> Supports:
        """The supports of a strip by the name of its boundary.

        Raises:
            InputError: the name is not a known boundary.
        """
        if boundary not in get_args(Boundary):
            raise InputError("boundary", f"is {boundary!r}, expected one of {', '.join(get_args(Boundary))}")
        if boundary == "cantilever":
            return cls(start="clamped")
        if boundary == "simply_supported":
            return cls(start="simply_supported", end="simply_supported")
        return cls()


@dataclass(frozen=True)
class PointMass:
    """A mass in kg at (x, y) in m, with a rotary inertia in kg·m² about x and y: an accelerometer, say.

    One that is `weighed` was put on to be known, with no error that matters; that of a sensor has the error of its cable.
    """

    x: float
    y: float
    mass: float
    rotary_inertia: float = 0.0
    weighed: bool = False

    def __post_init__(self) -> None:
        if not (np.isfinite(self.mass) and self.mass >= 0):
            raise InputError("point_mass.mass", f"is {self.mass}, expected a mass in kg that is not negative")
        if not (np.isfinite(self.rotary_inertia) and self.rotary_inertia >= 0):
            raise InputError("point_mass.rotary_inertia", f"is {self.rotary_inertia}, expected kg·m², not negative")
        if not (np.isfinite(self.x) and np.isfinite(self.y)):
            raise InputError("point_mass", f"a mass of {self.mass:g} kg has no place; expected finite x and y in m")


@dataclass(frozen=True)
class Spring:
    """An elastic support, at a point or all along an edge. Its stiffness can be an updating parameter, by its name.

    Attributes:
        name: such as `root_rotation`.
        stiffness: at a point N/m, or N·m/rad for a rotation; on an edge the same per metre of edge.
        direction: 1, 2, 3 for displacements along x, y, z; 4, 5, 6 for rotations about them.
        edge: the edge that it holds, or None for a spring at a point.
        point: (x, y) in m, or None for a spring on an edge.
    """

    name: str
    stiffness: float
    direction: int
    edge: Edge | None = None
    point: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if not self.name:
            raise InputError("spring.name", "is empty; a spring is known by its name")
        if not (np.isfinite(self.stiffness) and self.stiffness > 0):
            raise InputError(
                "spring.stiffness", f"of {self.name} is {self.stiffness}, expected positive; leave out a spring of none"
            )
        if not 1 <= self.direction <= 6:
            raise InputError("spring.direction", f"of {self.name} is {self.direction}, expected 1 … 6")
        if (self.edge is None) == (self.point is None):
            raise InputError("spring", f"{self.name} needs a place: either an edge or a point")
        if self.edge is not None and self.edge not in get_args(Edge):
            raise InputError("spring.edge", f"of {self.name} is {self.edge!r}, expected {', '.join(get_args(Edge))}")
        if self.point is not None and not np.all(np.isfinite(self.point)):
            raise InputError("spring.point", f"of {self.name} is {self.point}, expected finite x and y in m")

    @property
    def unit(self) -> str:
        """SI unit of the stiffness."""
        alone = "N/m" if self.direction <= 3 else "N·m/rad"
        return alone if self.edge is None else {"N/m": "N/m²", "N·m/rad": "N/rad"}[alone]
