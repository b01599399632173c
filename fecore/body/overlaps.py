"""Where walls overlap at a junction: what of a wall's elements lies inside another wall.

There the other wall's material is, so the elements give up mass, and stiffness along the junction's
line. What their points see of strains and motions is interpolated between the points, and
integrated over the part that lies inside. Over the whole element that integral is the element's own
sum over its points. So what is left is an integral too, over the rest: never negative, whatever the
size of the elements.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from fecore.arrays import BoolArray, FloatArray, IntArray
from fecore.body.affine import distinct
from fecore.body.elements.shells import Rule, Shell
from fecore.body.mesh import SHELLS, CellBlock
from fecore.body.operators import Operators

MOST = 0.9
"""Share that elements give up, over as much more of the wall: with 1, nodes inside had no mass, and
soft waves of their own.
"""

# exact for products of two functions of the fourth degree
_GAUSS = np.polynomial.legendre.leggauss(5)


@dataclass(frozen=True)
class Overlap:
    """Elements of one block that lie in part nearer to a line than where they are whole; as often
    as there are lines.
    """

    elements: IntArray  # (k,) their numbers in the block
    ratio: (
        # (k, corners) distances of their corners from the line, by that up to which elements give
        # up `MOST`
        FloatArray
    )
    tangents: FloatArray  # (k, 3) directions of the lines
    angles: FloatArray  # (k,) from the elements' axes 1 to the lines, rad
    turns: FloatArray  # (k,) how much of a right angle the corners are

    def overlap_fractions(self, shell: Shell, rule: Rule) -> FloatArray:
        """(k, p, p) the correction as forms of what the p points see times the roots of their
        weights.
        """
        if not len(self.elements):
            return np.zeros((0, len(rule[0]), len(rule[0])))
        chosen, which = distinct(np.minimum(self.ratio, 2.0))
        return MOST * _overlap_fractions(shell, rule, self.ratio[chosen])[which]


def overlap_correction(
    strains: Operators, block: CellBlock, nodes: FloatArray, overlap: Overlap, axis: FloatArray
) -> FloatArray:
    """(k, p, 2, n, 6) stretch and curvature along the lines, as far as an overlap goes."""
    shell = SHELLS[block.kind]
    roots = _roots(overlap.overlap_fractions(shell, shell.strain_rule))
    own = block.nodes[overlap.elements]
    axes = np.broadcast_to(
        axis if block.axes is None else block.axes[overlap.elements], (len(own), 3)
    )
    along = _along(nodes[own], axes, overlap.tangents)
    rows = np.einsum(
        "eab,eqbnd->eqand", along, strains.rows[strains.which[overlap.elements]], optimize=True
    )
    count, points = roots.shape[:2]
    return np.asarray((roots @ rows.reshape(count, points, -1)).reshape(rows.shape))


def kept(motions: Operators, block: CellBlock, overlap: Overlap) -> Operators:
    """The motions of a block's elements, without what overlaps."""
    if not len(overlap.elements):
        return motions
    shell = SHELLS[block.kind]
    touched, place = np.unique(overlap.elements, return_inverse=True)
    left = np.tile(np.eye(motions.rows.shape[1]), (len(touched), 1, 1))
    np.subtract.at(left, place.ravel(), overlap.overlap_fractions(shell, shell.mass_rule))
    seen = motions.rows[motions.which[touched]]
    rows = (_roots(left) @ seen.reshape(*left.shape[:2], -1)).reshape(seen.shape)
    chosen, again = distinct(rows)
    which = motions.which.copy()
    which[touched] = len(motions.rows) + again
    return replace(motions, which=which, rows=np.concatenate([motions.rows, rows[chosen]]))


def _overlap_fractions(shell: Shell, rule: Rule, ratio: FloatArray) -> FloatArray:
    """(k, p, p) forms of elements, from their (k, corners) distances by those up to which they
    overlap.
    """
    points, weights = rule
    corners = ratio.shape[1]
    forms = np.tile(np.eye(len(points)), (len(ratio), 1, 1))
    seen_by = np.linalg.inv(_monomials(points, corners, len(points)))
    inside, partial = ratio < 1, ratio.max(axis=1) > 1
    for pattern in np.unique(inside[partial], axis=0):
        own = partial & np.all(inside == pattern, axis=1)
        natural, area = _below(shell.corners[:corners], pattern, ratio[own])
        seen = _monomials(natural, corners, len(points)) @ seen_by
        forms[own] = (
            np.swapaxes(seen * area[..., None], 1, 2) @ seen / np.sqrt(np.outer(weights, weights))
        )
    return forms


def _below(
    corners: FloatArray, inside: BoolArray, ratio: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(k, g, 2) points and (k, g) weights on the part of a polygon of natural coordinates where (k,
    corners) ratios are below 1, which they are at the same corners.
    """
    part: list[FloatArray] = []
    for k, here in enumerate(inside):
        following = k - len(inside) + 1
        if here:
            part.append(np.broadcast_to(corners[k], (len(ratio), 2)))
        if here != inside[following]:
            share = (1 - ratio[:, k]) / (ratio[:, following] - ratio[:, k])
            part.append(corners[k] + share[:, None] * (corners[following] - corners[k]))
    x, w = (_GAUSS[0] + 1) / 2, _GAUSS[1] / 2
    u, v = (each.ravel() for each in np.meshgrid(x, x, indexing="ij"))
    points, areas = [np.zeros((len(ratio), 0, 2))], [np.zeros((len(ratio), 0))]
    for second, third in pairwise(part[1:]):
        first, across = second - part[0], third - second
        points.append(
            part[0][:, None] + u[:, None] * first[:, None] + (u * v)[:, None] * across[:, None]
        )
        size = np.abs(first[:, 0] * across[:, 1] - first[:, 1] * across[:, 0])
        areas.append(np.outer(w, w).ravel() * u * size[:, None])
    return np.concatenate(points, axis=1), np.concatenate(areas, axis=1)


def _monomials(natural: FloatArray, corners: int, count: int) -> FloatArray:
    """(…, p, count) the monomials that so many points of a triangle's or a square's rule hold."""
    degrees = [(i, j) for i in range(3) for j in range(3)]
    degrees.sort(key=lambda ij: sum(ij) if corners == 3 else max(ij))
    return np.stack(
        [natural[..., 0] ** i * natural[..., 1] ** j for i, j in degrees[:count]], axis=-1
    )


def _roots(forms: FloatArray) -> FloatArray:
    """(k, p, p) square roots of symmetric forms."""
    value, vectors = np.linalg.eigh(forms)
    return np.asarray(
        (vectors * np.sqrt(np.maximum(value, 0.0))[:, None]) @ vectors.transpose(0, 2, 1)
    )


def _along(x: FloatArray, axis: FloatArray, tangents: FloatArray) -> FloatArray:
    """(k, 2, 8) stretch and curvature along (k, 3) tangents from the strains of (k, n, 3) elements
    with (k, 3) axes 1.
    """
    normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    e1 = axis - np.sum(axis * normal, axis=1, keepdims=True) * normal
    e1 /= np.linalg.norm(e1, axis=1, keepdims=True)
    c, s = (np.sum(each * tangents, axis=1) for each in (e1, np.cross(normal, e1)))
    rows = np.zeros((len(x), 2, 8))
    rows[:, 0, :3] = rows[:, 1, 3:6] = np.stack([c * c, s * s, c * s], axis=1)
    return rows
