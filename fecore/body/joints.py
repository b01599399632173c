"""The joint model: what shells that overlap at a junction miss of the body.

Middle surfaces run to the junction's line, so walls overlap there, and the corner is stiffer than its lines. So each wall of
thickness t begins at

    d = (T/2) / (1 + 3 (t/T)^p)

from the line, by a rigid link, with T the other wall's thickness over the sine of their angle, and p = 1.7 for a wall that
passes, 3 for one that ends at a wall that passes, 2 where both end. Along the line a bead, a beam, carries what is then
missing: the moments of the true area less the modelled one, with the walls' modulus along the line and density (so mass is
exact); the shear and twist of the strips that were taken away; and a torsion 0.1 G t⁴, t⁴ the geometric mean of the walls'.
All is linear in E, G and density; dimensions are nominal.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.body.elements.beams import fibre
from fecore.body.junctions import Edge, Junction, Wall
from fecore.body.laminate import SHEAR_CORRECTION
from fecore.body.mesh import Mesh

TORSION = 0.1
"""Torsion of a bead by G t⁴."""

# p by how a wall meets the other: found with solids whose walls are up to 2.5 times as thick as one another.
_PASSING, _ENDING, _CORNER = 1.7, 3.0, 2.0
_DEEPEST = 0.4  # share of an element that a wall may begin later
_PARALLEL = 0.17  # sine of 10°
_GAUSS = np.polynomial.legendre.leggauss(3)


@dataclass(frozen=True)
class Bead:
    """Beams along a junction's line.

    Attributes:
        nodes: (e, 2) or (e, 3) their nodes.
        axis: (3,) n₁ of their section.
        walls: sets of the walls, each with the angle (rad) from its axis 1 to the line.
        stiffness: (walls, 3, 6, 6) matrices by the set's E and G along the line and G across, on the strains of a beam.
        mass: (walls, 6, 6) by the set's density, on its motions.
    """

    nodes: IntArray
    axis: FloatArray
    walls: tuple[tuple[str, float], ...]
    stiffness: FloatArray
    mass: FloatArray


@dataclass(frozen=True)
class Joints:
    """The joint model of a mesh's junctions."""

    mesh: Mesh
    junctions: tuple[Junction, ...]
    axes: Mapping[str, tuple[float, float, float]]

    @cached_property
    def shifts(self) -> tuple[FloatArray, ...]:
        """(e, n, 3) of each block: from the mesh's nodes to where the elements begin, m."""
        found = tuple(
            np.zeros((*block.nodes.shape, 3)) if block.offsets is None else block.offsets.copy()
            for block in self.mesh.blocks
        )
        for junction in self.junctions:
            for edge in junction.edges:
                for wall in edge.walls:
                    here = np.isin(self.mesh.blocks[wall.block].nodes[wall.element], edge.nodes)
                    found[wall.block][wall.element, here] += start(wall, edge.walls) * wall.away
        return found

    @cached_property
    def beads(self) -> tuple[Bead, ...]:
        """The beads of all lines; edges of a line with three nodes apart from those with two."""
        found = []
        for junction in self.junctions:
            for count in (2, 3):
                edges = [edge for edge in junction.edges if len(edge.nodes) == count]
                if edges:
                    found.append(bead(edges, self.axes))
        return tuple(found)


def start(wall: Wall, walls: tuple[Wall, ...]) -> float:
    """d, m; no more than a share of the element's own depth."""
    T = _across(wall, walls)
    power = _PASSING if wall.passes else _ENDING if any(other.passes for other in walls) else _CORNER
    return min(T / 2 / (1 + 3 * float((wall.thickness / T) ** power)), _DEEPEST * wall.depth)


def _across(wall: Wall, walls: tuple[Wall, ...]) -> float:
    """T: the largest thickness of the walls that stand across, each over the sine of the angle."""
    found = []
    for other in walls:
        sine = float(np.linalg.norm(np.cross(wall.away, other.away)))
        if other is not wall and sine > _PARALLEL:
            found.append(other.thickness / sine)
    return max(found, default=wall.thickness)


def bead(edges: list[Edge], axes: Mapping[str, tuple[float, float, float]]) -> Bead:
    """The bead of edges with the same walls, given axis 1 of their sets."""
    walls, tangent = edges[0].walls, edges[0].tangent
    axis = walls[0].away
    frame = np.array([axis, np.cross(tangent, axis)])
    own = [np.array(axes[wall.set]) if wall.axis is None else wall.axis for wall in walls]
    of = [(wall.set, _angle(axis_1, tangent, wall.away)) for wall, axis_1 in zip(walls, own, strict=True)]
    kinds = tuple(dict.fromkeys(of))
    stiffness, mass = np.zeros((len(kinds), 3, 6, 6)), np.zeros((len(kinds), 6, 6))
    t4 = np.prod([wall.thickness for wall in walls]) ** (4 / len(walls))
    for wall, kind in zip(walls, of, strict=True):
        k, s = kinds.index(kind), frame @ wall.away
        places, weight = _missing(wall, walls, tangent, s)
        rows = fibre(places)
        stiffness[k, 0] += np.einsum("g,ga,gb->ab", weight, rows[:, 0], rows[:, 0])
        mass[k] += np.einsum("g,gra,grb->ab", weight, rows, rows)
        stiffness[k, 1:] += _strip(start(wall, walls), wall.thickness, s)
        stiffness[k, 1, 3, 3] += TORSION * t4 / len(walls)
    # Every edge of the line runs the way of the first.
    nodes = [
        edge.nodes if edge.tangent @ tangent > 0 else (edge.nodes[1], edge.nodes[0], *edge.nodes[2:]) for edge in edges
    ]
    return Bead(np.array(nodes), axis, kinds, stiffness, mass)


def _angle(axis: FloatArray, tangent: FloatArray, away: FloatArray) -> float:
    """From axis 1 on a wall to the line, rad, from 0 to π, as rounded to a tenth of a degree."""
    normal = np.cross(tangent, away)
    flat = axis - (axis @ normal) * normal
    angle = np.arctan2(normal @ np.cross(flat, tangent), flat @ tangent) % np.pi
    return float(np.radians(round(float(np.degrees(angle)), 1) % 180))


def _missing(wall: Wall, walls: tuple[Wall, ...], tangent: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(g, 2) places and (g,) weights that integrate over the wall's true area less its modelled one: from b(ζ) to d."""
    points, weights = _GAUSS
    t, d = wall.thickness, start(wall, walls)
    zeta = points * t / 2
    begin = _true_start(wall, walls, tangent, zeta)
    half = (d - begin) / 2
    along = begin[:, None] + half[:, None] * (1 + points)
    places = along[..., None] * s + zeta[:, None, None] * np.array([-s[1], s[0]])
    weight = (weights * t / 2)[:, None] * half[:, None] * weights
    return places.reshape(-1, 2), weight.ravel()


def _true_start(wall: Wall, walls: tuple[Wall, ...], tangent: FloatArray, zeta: FloatArray) -> FloatArray:
    """(g,) where the wall truly begins along s, at heights ζ along t × s.

    The thickest that passes goes through, and others begin at its face. At a corner of two sets the first set's wall goes on to
    the outer face; where the walls are of one set, or more than two end, each is mitred with its neighbours, from the line
    to the corner where their faces meet.
    """
    through = max((other for other in walls if other.passes), key=lambda other: other.thickness, default=None)
    if through is not None:
        across = wall.away - (wall.away @ through.away) * through.away
        sine = float(np.linalg.norm(across))
        if sine < _PARALLEL:
            return np.zeros_like(zeta)
        slope = float(np.cross(tangent, wall.away) @ across) / sine
        return (through.thickness / 2 - zeta * slope) / sine
    number = walls.index(wall)
    begin = np.empty_like(zeta)
    for side, other in ((1, walls[(number + 1) % len(walls)]), (-1, walls[number - 1])):
        turn = np.arctan2(tangent @ np.cross(wall.away, other.away), wall.away @ other.away) * side % (2 * np.pi)
        if len(walls) == 2 and wall.rank != other.rank:
            face = other.thickness / 2 / abs(np.sin(turn))
            return np.full_like(zeta, -face if wall.rank < other.rank else face)
        corner = (other.thickness / 2 + wall.thickness / 2 * np.cos(turn)) / np.sin(turn)
        here = zeta * side >= 0
        begin[here] = np.abs(zeta[here]) / (wall.thickness / 2) * corner
    return begin


def _strip(d: float, t: float, s: FloatArray) -> FloatArray:
    """(2, 6, 6) shear in the plane and twist, by G along, and shear across, by the other G, of a strip of width d."""
    plane, across = np.zeros((6, 6)), np.zeros((6, 6))
    normal = np.array([-s[1], s[0]])
    plane[1:3, 1:3] = t * d * np.outer(s, s)
    plane[3, 3] = t**3 * d / 3
    across[1:3, 1:3] = SHEAR_CORRECTION * t * d * np.outer(normal, normal)
    return np.array([plane, across])
