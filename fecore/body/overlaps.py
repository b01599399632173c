"""Where walls overlap at a junction: what of a wall's elements lies inside another wall.

There the other wall's material is, so the elements give up mass, and stiffness along the junction's line. What their points
see of strains and motions is interpolated between the points, and integrated over the part that lies inside. Over the
whole element that integral is the element's own sum over its points. So what is left is an integral too, over the rest: never
negative, whatever the size of the elements.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.body.affine import distinct
from fecore.body.elements.shells import Rule, Shell
from fecore.body.mesh import SHELLS, Block
from fecore.body.operators import Operators

MOST = 0.9
"""Share that elements give up, over as much more of the wall: with 1, nodes inside had no mass, and soft waves of their own."""

_GAUSS = np.polynomial.legendre.leggauss(5)  # exact for products of two functions of the fourth degree


@dataclass(frozen=True)
class Overlap:
    """Elements of one block that lie in part nearer to a line than where they are whole."""

    elements: IntArray  # (k,) their numbers in the block
    distance: FloatArray  # (k, corners) of their corners from the line, m
    end: float  # distance up to which elements give up `MOST`, m
    tangent: FloatArray  # (3,) direction of the line
    angle: float  # from the elements' axis 1 to the line, rad

    def shares(self, shell: Shell, rule: Rule) -> FloatArray:
        """(k, p, p) what is given up as forms of what the p points see times the roots of their weights."""
        chosen, which = distinct(np.minimum(self.distance / self.end, 2.0))
        return MOST * np.array([_share(shell, rule, self.distance[k] / self.end) for k in chosen])[which]


def given_up(strains: Operators, block: Block, nodes: FloatArray, overlap: Overlap, axis: FloatArray) -> Operators:
    """Stretch and curvature along the line, as far as an overlap goes."""
    shell = SHELLS[block.kind]
    roots = _roots(overlap.shares(shell, shell.strain_rule))
    own = block.nodes[overlap.elements]
    axes = np.broadcast_to(axis if block.axes is None else block.axes[overlap.elements], (len(own), 3))
    along = _along(nodes[own], axes, overlap.tangent)
    rows = np.einsum("epq,eab,eqbnd->epand", roots, along, strains.rows[strains.which[overlap.elements]], optimize=True)
    chosen, which = distinct(rows)
    return Operators(own, which, rows[chosen])


def kept(motions: Operators, block: Block, overlaps: Sequence[Overlap]) -> Operators:
    """The motions of a block's elements, without what overlaps."""
    if not overlaps:
        return motions
    shell = SHELLS[block.kind]
    points = motions.rows.shape[1]
    left = np.tile(np.eye(points), (len(block.nodes), 1, 1))
    for overlap in overlaps:
        left[overlap.elements] -= overlap.shares(shell, shell.mass_rule)
    touched = np.unique(np.concatenate([overlap.elements for overlap in overlaps]))
    rows = np.einsum("epq,eqand->epand", _roots(left[touched]), motions.rows[motions.which[touched]])
    chosen, again = distinct(rows)
    which = motions.which.copy()
    which[touched] = len(motions.rows) + again
    return replace(motions, which=which, rows=np.concatenate([motions.rows, rows[chosen]]))


def _share(shell: Shell, rule: Rule, ratio: FloatArray) -> FloatArray:
    """(p, p) form of one element, from its (corners,) distances by that up to which it overlaps."""
    points, weights = rule
    if ratio.max() <= 1:
        return np.eye(len(points))
    natural, area = _below(shell.corners[: len(ratio)], ratio)
    seen = _monomials(natural, len(ratio), len(points)) @ np.linalg.inv(_monomials(points, len(ratio), len(points)))
    return np.asarray((seen.T * area) @ seen / np.sqrt(np.outer(weights, weights)))


def _below(corners: FloatArray, ratio: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points and weights on the part of a polygon of natural coordinates where the ratio is below 1."""
    part: list[FloatArray] = []
    for k, here in enumerate(ratio):
        if here < 1:
            part.append(corners[k])
        if (here < 1) != (ratio[k - len(ratio) + 1] < 1):
            step = ratio[k - len(ratio) + 1] - here
            part.append(corners[k] + (1 - here) / step * (corners[k - len(ratio) + 1] - corners[k]))
    x, w = (_GAUSS[0] + 1) / 2, _GAUSS[1] / 2
    u, v = (each.ravel() for each in np.meshgrid(x, x, indexing="ij"))
    points, areas = [np.zeros((0, 2))], [np.zeros(0)]
    for second, third in pairwise(part[1:]):
        first, aside = second - part[0], third - second
        points.append(part[0] + u[:, None] * first + (u * v)[:, None] * aside)
        areas.append(np.outer(w, w).ravel() * u * abs(first[0] * aside[1] - first[1] * aside[0]))
    return np.concatenate(points), np.concatenate(areas)


def _monomials(natural: FloatArray, corners: int, count: int) -> FloatArray:
    """(p, count) the monomials that so many points of a triangle's or a square's rule hold."""
    degrees = [(i, j) for i in range(3) for j in range(3)]
    degrees.sort(key=lambda ij: sum(ij) if corners == 3 else max(ij))
    return np.stack([natural[:, 0] ** i * natural[:, 1] ** j for i, j in degrees[:count]], axis=1)


def _roots(forms: FloatArray) -> FloatArray:
    """(k, p, p) square roots of symmetric forms."""
    value, vectors = np.linalg.eigh(forms)
    return np.asarray((vectors * np.sqrt(np.maximum(value, 0.0))[:, None]) @ vectors.transpose(0, 2, 1))


def _along(x: FloatArray, axis: FloatArray, tangent: FloatArray) -> FloatArray:
    """(k, 2, 8) stretch and curvature along a tangent from the strains of (k, n, 3) elements with (k, 3) axes 1."""
    normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    e1 = axis - np.sum(axis * normal, axis=1, keepdims=True) * normal
    e1 /= np.linalg.norm(e1, axis=1, keepdims=True)
    c, s = e1 @ tangent, np.cross(normal, e1) @ tangent
    rows = np.zeros((len(x), 2, 8))
    rows[:, 0, :3] = rows[:, 1, 3:6] = np.stack([c * c, s * s, c * s], axis=1)
    return rows
