"""What holds a structure and what it carries: supports, springs, masses, links."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from fecore.arrays import BoolArray, FloatArray, IntArray
from fecore.body.mesh import Box, Mesh
from fecore.errors import InputError

Held = Literal["clamped", "simply_supported"]
EdgeSupport = Literal["free", "clamped", "simply_supported", "simply_supported_normal"]
Boundary = Literal["cantilever", "free", "simply_supported"]
Edge = Literal["start", "end", "lower", "upper"]

DISPLACEMENTS = ("u", "v", "w", "rx", "ry", "rz")
_WRITTEN = 1e-5  # digits to which coefficients of equations are written, by their terms
ALL_DOFS = tuple(range(len(DISPLACEMENTS)))
"""Dofs of a node, along and about the axes of the structure."""


@dataclass(frozen=True)
class Support:
    """Nodes that are held."""

    where: str | Box  # a node set, such as the edge `start` of a generated body, or a box of space
    # `clamped` holds all dofs, `simply_supported` the three displacements; or the names of dofs to
    # hold
    how: Held | tuple[str, ...] = "clamped"

    @property
    def dofs(self) -> tuple[int, ...]:
        """Numbers of the held dofs of a node.

        Raises:
            InputError: a name is not of a dof.
        """
        if isinstance(self.how, str):
            if self.how not in get_args(Held):
                raise InputError(
                    "support.how",
                    f"is {self.how!r}, expected {', '.join(get_args(Held))}, or names of dofs",
                )
            return tuple(range(6)) if self.how == "clamped" else (0, 1, 2)
        unknown = [name for name in self.how if name not in DISPLACEMENTS]
        if unknown:
            raise InputError(
                "support.how", f"names {unknown[0]!r}, expected some of {', '.join(DISPLACEMENTS)}"
            )
        return tuple(DISPLACEMENTS.index(name) for name in self.how)


def edges(
    start: EdgeSupport = "free",
    end: EdgeSupport = "free",
    lower: EdgeSupport = "free",
    upper: EdgeSupport = "free",
) -> tuple[Support, ...]:
    """How each edge of a strip or plate is held: `start` is x = 0, `end` x = L, `lower` and `upper`
    y = ∓b/2.

    A simply supported edge holds w and the displacement and rotation along the edge's own direction
    ("hard" support, free to move across the edge in the plane: SS-1 in the literature). One that is
    `simply_supported_normal` lets the edge move along its own direction and holds it across (SS-2),
    as the closed forms of antisymmetric angle-ply plates have it.

    Raises:
        InputError: an edge is held in a way that is not known.
    """
    supports = []
    for edge, how in (("start", start), ("end", end), ("lower", lower), ("upper", upper)):
        if how not in get_args(EdgeSupport):
            raise InputError(
                f"supports.{edge}", f"is {how!r}, expected {', '.join(get_args(EdgeSupport))}"
            )
        if how == "clamped":
            supports.append(Support(edge))
        elif how != "free":
            along, turn, across = ("v", "rx", "u") if edge in ("start", "end") else ("u", "ry", "v")
            supports.append(
                Support(edge, ("w", turn, along if how == "simply_supported" else across))
            )
    return tuple(supports)


def of_boundary(boundary: Boundary) -> tuple[Support, ...]:
    """The supports of a strip by the name of its boundary.

    Raises:
        InputError: the name is not a known boundary.
    """
    if boundary not in get_args(Boundary):
        raise InputError(
            "boundary", f"is {boundary!r}, expected one of {', '.join(get_args(Boundary))}"
        )
    if boundary == "cantilever":
        return edges(start="clamped")
    return edges("simply_supported", "simply_supported") if boundary == "simply_supported" else ()


@dataclass(frozen=True)
class Spring:
    """An elastic support, at a point or all along an edge. Its stiffness can be an updating
    parameter, by its name.
    """

    name: str  # such as `root_rotation`
    # at a point N/m, or N·m/rad for a rotation; on an edge the same per metre of edge
    stiffness: float
    direction: int  # 1, 2, 3 for displacements along x, y, z; 4, 5, 6 for rotations about them
    edge: str | None = None  # a node set along an edge of elements, or None for a spring at a point
    # (x, y) or (x, y, z) in m on the surface, or None for a spring on an edge
    point: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        if not self.name:
            raise InputError("spring.name", "is empty; a spring is known by its name")
        if not (np.isfinite(self.stiffness) and self.stiffness > 0):
            raise InputError(
                "spring.stiffness",
                f"of {self.name} is {self.stiffness}, expected positive; leave out a spring of"
                " none",
            )
        if not 1 <= self.direction <= 6:
            raise InputError(
                "spring.direction", f"of {self.name} is {self.direction}, expected 1 … 6"
            )
        if (self.edge is None) == (self.point is None):
            raise InputError("spring", f"{self.name} needs a place: either an edge or a point")
        if self.point is not None and not np.all(np.isfinite(self.point)):
            raise InputError(
                "spring.point", f"of {self.name} is {self.point}, expected finite x and y in m"
            )

    @property
    def unit(self) -> str:
        """SI unit of the stiffness."""
        unit = "N/m" if self.direction <= 3 else "N·m/rad"
        return unit if self.edge is None else {"N/m": "N/m²", "N·m/rad": "N/rad"}[unit]


@dataclass(frozen=True)
class NodeSpring:
    """Springs of one stiffness between nodes, or from nodes to the ground."""

    name: str  # of the stiffness as a parameter
    stiffness: float  # of each, N/m or N·m/rad
    nodes: IntArray  # (s, n) numbers of their nodes
    # (s, n, 6) what stretches or turns them, by the motions and turns of the nodes
    rows: FloatArray

    @property
    def unit(self) -> str:
        """SI unit of the stiffness."""
        return "N/m" if self.rows[..., :3].any() else "N·m/rad"


@dataclass(frozen=True)
class Clamp:
    """What is held by a spring whose constant is its compliance C: its stiffness is that of the
    spring over C.
    """

    # nominal C; EI/kL, so that 0.01 lowers the first bending mode of a strip by 2 %
    compliance: float
    spring: Spring | NodeSpring  # the spring at C = 1, with the name of the constant

    @property
    def name(self) -> str:
        """Name of the constant."""
        return self.spring.name


@dataclass(frozen=True)
class PointMass:
    """A mass in kg at (x, y) in m on a strip, with a rotary inertia in kg·m² about x and y: an
    accelerometer, say.

    One that is `weighed` was put on to be known, with no error that matters; that of a sensor has
    the error of its cable. On a body in space it has a height z too.
    """

    x: float
    y: float
    mass: float
    rotary_inertia: float = 0.0
    weighed: bool = False
    z: float = 0.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.mass) and self.mass >= 0):
            raise InputError(
                "point_mass.mass", f"is {self.mass}, expected a mass in kg that is not negative"
            )
        if not (np.isfinite(self.rotary_inertia) and self.rotary_inertia >= 0):
            raise InputError(
                "point_mass.rotary_inertia",
                f"is {self.rotary_inertia}, expected kg·m², not negative",
            )
        if not np.all(np.isfinite(self.place)):
            raise InputError(
                "point_mass",
                f"a mass of {self.mass:g} kg has no place; expected finite x and y in m",
            )

    @property
    def place(self) -> tuple[float, float, float]:
        """(x, y, z), m."""
        return self.x, self.y, self.z

    def on_surface(self) -> Mass:
        """The mass as a structure carries it."""
        return Mass(self.mass, self.place, self.rotary_inertia, weighed=self.weighed)


@dataclass(frozen=True)
class Mass:
    """A mass at a place on the structure, or at a node."""

    mass: float  # kg
    # a point (x, y, z) in m on the surface, or a node's number
    where: tuple[float, float, float] | int
    # (3, 3) rotary inertia about its own centre, kg·m², or one number for all axes
    inertia: tuple[tuple[float, ...], ...] | float = 0.0
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)  # from the place to its centre, m
    name: str = ""  # of its mass as a parameter; none where it is known
    weighed: bool = True  # as of a `PointMass`

    def __post_init__(self) -> None:
        if not (np.isfinite(self.mass) and self.mass >= 0):
            raise InputError("mass", f"is {self.mass}, expected kg, not negative")

    @property
    def matrix(self) -> FloatArray:
        """(6, 6) on u and θ of the place."""
        own = np.asarray(self.inertia, dtype=float)
        rigid = np.hstack([np.eye(3), turning(np.array(self.offset))])
        matrix = self.mass * rigid.T @ rigid
        matrix[3:, 3:] += own if own.ndim else own * np.eye(3)
        return np.asarray(matrix)


@dataclass(frozen=True)
class Link:
    """A node that others lead: RBE2 where one leads it as a rigid body, RBE3 where it is their
    weighted mean.

    One that none leads is held: a support along axes of its own.
    """

    node: int  # the dependent node
    # one node for a rigid link, two or more apart for a mean, none for a support
    independent: tuple[int, ...]
    # numbers (0 … 5) of the node's dofs that depend; the others stay its own, along the same axes
    dofs: tuple[int, ...] = ALL_DOFS
    weights: tuple[float, ...] = ()  # of the independent nodes of a mean; alike where empty
    # (3, 3) as rows, along which the dofs are; the structure's where None
    axes: FloatArray | None = None
    # (n + 1, 6, 6) the dependent dofs, along their axes, by the motions of the independent nodes
    # and, last, by the dofs that stay its own: linear equations, which may hold rigid motions
    equations: FloatArray | None = None

    @property
    def turn(self) -> FloatArray:
        """(6, 6) from the structure's axes to those of the dofs."""
        return np.eye(6) if self.axes is None else np.kron(np.eye(2), self.axes)

    @property
    def dependent(self) -> FloatArray:
        """(6, 6) what of the node's motion depends."""
        kept = np.isin(np.arange(6), self.dofs).astype(float)
        return np.asarray(self.turn.T * kept @ self.turn)

    @property
    def own(self) -> FloatArray:
        """(6, 6) motion of the node by the dofs that stay its own."""
        stay = np.diag(~np.isin(np.arange(6), self.dofs)).astype(float)
        return np.asarray(
            self.turn.T @ (stay if self.equations is None else stay + self.equations[-1])
        )

    def matrices(self, nodes: FloatArray) -> FloatArray:
        """(independent, 6, 6) motion of the node by those of its independent nodes.

        A mean moves as the rigid body that fits their displacements best, weights w and arms
        r from their centre: θ = J⁻¹Σw r × u with J = Σw(r²I − rrᵀ), u = Σwu/Σw + θ × (x − centre).
        Displacements on a line t say nothing of the turn about it, which is that of the nodes: θ =
        J⁺Σw r × u + ttᵀΣwθ.

        Raises:
            InputError: the independent nodes of a mean lie in one place.
        """
        places, here = nodes[list(self.independent)], nodes[self.node]
        matrices = np.zeros((len(places), 6, 6))
        if self.equations is not None:
            return np.asarray(self.turn.T @ self.equations[:-1])
        if not self.independent:
            return matrices
        if len(places) == 1:
            matrices[0] = np.eye(6)
            matrices[0, :3, 3:] = turning(here - places[0])
        else:
            w = np.array(self.weights or (1.0,) * len(places))
            w = w / w.sum()
            r = places - w @ places
            J = np.einsum("i,ik,ik->", w, r, r) * np.eye(3) - np.einsum("i,ij,ik->jk", w, r, r)
            moments, axes = np.linalg.eigh(J)  # of a line the first is 0, and its axis t
            if not moments[1] > 0:
                raise InputError(
                    "links",
                    f"the nodes that lead the one at {here.round(6).tolist()} m lie in one place; a"
                    " mean needs two that do not",
                )
            is_line = moments[0] < moments[1] * 1e-12
            inverse = np.linalg.pinv(J, rcond=1e-12, hermitian=True)
            spin = inverse @ -np.array([wi * turning(ri) for wi, ri in zip(w, r, strict=True)])
            turns = is_line * w[:, None, None] * np.outer(axes[:, 0], axes[:, 0])
            matrices[:, 3:, :3], matrices[:, 3:, 3:] = spin, turns
            arm = turning(here - w @ places)
            matrices[:, :3, :3] = w[:, None, None] * np.eye(3) + arm @ spin
            matrices[:, :3, 3:] = arm @ turns
        return np.asarray(self.dependent @ matrices)


def turning(arm: FloatArray) -> FloatArray:
    """(…, 3, 3) matrix of θ ↦ θ × arm."""
    x, y, z = np.moveaxis(np.asarray(arm, dtype=float), -1, 0)
    none = np.zeros_like(x)
    rows = [np.stack(row, axis=-1) for row in ((none, z, -y), (-z, none, x), (y, -x, none))]
    return np.stack(rows, axis=-2)


def free_dofs(
    mesh: Mesh,
    supports: tuple[Support, ...],
    used: IntArray,
    dofs: tuple[int, ...],
    links: tuple[Link, ...] = (),
) -> BoolArray:
    """(nodes, dofs of a node) which dofs are free: of nodes that elements use, neither held nor
    dependent.
    """
    free = np.zeros((len(mesh.nodes), 6), dtype=bool)
    free[used] = True
    for link in links:
        free[link.node, list(link.dofs)] = False
    for support in supports:
        free[mesh.select(support.where)[:, None], list(support.dofs)] = False
    return free[:, list(dofs)]


def rigid_motions(nodes: FloatArray, links: tuple[Link, ...] = ()) -> FloatArray:
    """(n, 6, 6) the six rigid motions of (n, 3) nodes: shifts along x, y, z and turns about axes
    through the nodes' centre.

    Those of a node with a link are along its axes; what others lead there is none, but what of a
    motion its equations do not have.
    """
    motions = np.zeros((len(nodes), 6, 6))
    motions[:, :3, :3] = motions[:, 3:, 3:] = np.eye(3)
    motions[:, :3, 3:] = turning(nodes - nodes.mean(axis=0))
    whole = motions.copy()
    for link in links:
        along = link.turn @ whole[link.node]
        dependent = np.isin(np.arange(6), link.dofs)
        if link.equations is not None:
            others = np.concatenate([whole[list(link.independent)], along[None]])
            by = np.einsum("nij,njm->im", link.equations, others)
            terms = np.abs(along) + np.einsum("nij,njm->im", np.abs(link.equations), np.abs(others))
            along[dependent] = np.where(np.abs(along - by) > _WRITTEN * terms, along - by, 0)[
                dependent
            ]
        elif link.independent:
            along[dependent] = 0
        motions[link.node] = along
    return motions
