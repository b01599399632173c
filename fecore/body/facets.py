"""Facets as a curved surface: where the middle of a straight side would lie.

Facets that turn by less than 30° at a side are taken for a curve. There the middle of a side lies
off its chord as the normals at its ends ask:

    x = (a + b)/2 + ((n_b · e) n_b - (n_a · e) n_a)/8,   e = b - a

which meets a circle to the fourth order (Vlachos et al., Curved PN triangles, I3D 2001). The
normals are means over the facets around a node; at an open edge, beyond which there is no facet,
that at the other end is mirrored about the side's middle, as on a circle.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy

from fecore.arrays import BoolArray, FloatArray, IntArray
from fecore.body.elements.surface import normals
from fecore.body.mesh import SHELLS, Mesh

SMOOTH = np.radians(30)
"""Turn of two facets at a side below which they may be a curved surface."""

_STRAIGHT = 1e-4  # of a side's length: a middle node nearer to the chord is on it
# of a side's length by which the curved surface lies off the facets, to count as another
_SEEN = 1e-6


def facet_turn(mesh: Mesh) -> float:
    """Median turn, rad, from facet to facet of those with straight sides that may be a curved
    surface; 0 of none.
    """
    sides, off = sides_of(mesh), np.linalg.norm(bows(mesh), axis=1)
    length = np.linalg.norm(mesh.nodes[sides[:, 1]] - mesh.nodes[sides[:, 0]], axis=1)
    bent = np.zeros(len(sides), dtype=bool)
    for block in mesh.blocks:
        for i, j, *middle in SHELLS[block.kind].sides if block.is_shell else ():
            if middle:
                a, b, m = (block.nodes[:, k] for k in (i, j, middle[0]))
                bent[find(sides, np.sort(np.column_stack([a, b]), axis=1))] |= ~is_straight(
                    mesh.nodes, a, b, m
                )
    turned = (off > _SEEN * length) & ~bent
    return float(np.median(8 * off[turned] / length[turned])) if turned.any() else 0.0


def is_straight(places: FloatArray, a: IntArray, b: IntArray, middle: IntArray) -> BoolArray:
    """(n,) whether middle nodes lie on the chords from a to b."""
    off = np.linalg.norm(places[middle] - (places[a] + places[b]) / 2, axis=1)
    return np.asarray(off < _STRAIGHT * np.linalg.norm(places[b] - places[a], axis=1))


def sides_of(mesh: Mesh) -> IntArray:
    """(s, 2) ends of the different sides of all shells, the smaller number first, in order."""
    sides = [
        _pairs(b.nodes, [side[:2] for side in SHELLS[b.kind].sides])
        for b in mesh.blocks
        if b.is_shell
    ]
    return np.unique(np.concatenate(sides), axis=0) if sides else np.zeros((0, 2), dtype=np.int64)


def bows(mesh: Mesh) -> FloatArray:
    """(s, 3) how far the middle of each of `sides_of` lies off its chord, were the facets a curved
    surface, m.
    """
    sides = sides_of(mesh)
    largest = np.zeros((len(sides), 3))
    if not len(sides):
        return largest
    facets = _Facets.of(mesh)
    fans, open_, single = facets.fans()
    total = np.zeros((fans.max() + 1, 3))
    np.add.at(total, fans.ravel(), (facets.weight[..., None] * facets.aligned(fans)).reshape(-1, 3))
    mean = total / np.maximum(np.linalg.norm(total, axis=1), 1e-300)[:, None]
    for i in range(facets.corners.shape[1]):
        j = facets.next[:, i]
        here = np.arange(len(facets.corners))
        real = facets.real[:, i]
        a, b = facets.corners[here, i], facets.corners[here, j]
        e = mesh.nodes[b] - mesh.nodes[a]
        na, nb = mean[fans[here, i]], mean[fans[here, j]]
        at, there = (fans[here, i], fans[here, j])
        lone_a = (open_[at] & ~open_[there]) | (single[at] & ~single[there])
        lone_b = (open_[there] & ~open_[at]) | (single[there] & ~single[at])
        na, nb = (
            np.where(lone_a[:, None], _mirrored(nb, e), na),
            np.where(lone_b[:, None], _mirrored(na, e), nb),
        )
        bow = (np.sum(nb * e, axis=1)[:, None] * nb - np.sum(na * e, axis=1)[:, None] * na) / 8
        place = find(sides, np.sort(np.column_stack([a, b]), axis=1))
        larger = real & (np.sum(bow**2, axis=1) > np.sum(largest[place] ** 2, axis=1))
        largest[place[larger]] = bow[larger]
    return largest


def re_entrant(mesh: Mesh) -> IntArray:
    """Nodes at which the free edge of a surface turns inwards by more than 30°, as at the corner of
    a cut-out.
    """
    if not any(block.is_shell for block in mesh.blocks):
        return np.zeros(0, dtype=np.int64)
    facets = _Facets.of(mesh)
    fans, open_, _ = facets.fans()
    angle = np.bincount(fans[facets.real], weights=facets.weight[facets.real], minlength=len(open_))
    turned = facets.real & (open_ & (angle > np.pi + SMOOTH))[fans]
    return np.unique(facets.corners[turned])


def _mirrored(normal: FloatArray, e: FloatArray) -> FloatArray:
    """(n, 3) normals at one end of sides as on a circle, from those at the other."""
    along = e / np.maximum(np.linalg.norm(e, axis=1), 1e-300)[:, None]  # a side may have no length
    return np.asarray(normal - 2 * np.sum(normal * along, axis=1)[:, None] * along)


@dataclass(frozen=True)
class _Facets:
    """The corners of all shells; a triangle has one corner fewer than the (f, 4) arrays."""

    corners: IntArray  # (f, 4) node numbers
    real: BoolArray  # (f, 4) whether there is such a corner
    next: IntArray  # (f, 4) the corner after each
    normal: FloatArray  # (f, 4, 3) at the corners
    weight: FloatArray  # (f, 4) angle of the corner
    inward: FloatArray  # (f, 4, 3) unit vectors across the side after each corner, into the facet

    @classmethod
    def of(cls, mesh: Mesh) -> _Facets:
        rows = []
        for block in mesh.blocks:
            if not block.is_shell:
                continue
            count = len(SHELLS[block.kind].sides)
            nodes = block.nodes[:, :count]
            x = mesh.nodes[nodes]
            shell = SHELLS["quad4" if count == 4 else "tri3"]
            normal = normals(x, shell.derivatives(shell.corners))
            after, before = np.roll(x, -1, axis=1) - x, np.roll(x, 1, axis=1) - x
            angle = np.arctan2(
                np.linalg.norm(np.cross(after, before), axis=2), np.sum(after * before, axis=2)
            )
            inward = np.cross(normal.mean(axis=1)[:, None], after)
            inward /= np.maximum(np.linalg.norm(inward, axis=2), 1e-300)[..., None]
            pad = [(0, 0), (0, 4 - count)]
            rows.append(
                (
                    np.pad(nodes, pad),
                    np.pad(np.ones(nodes.shape, dtype=bool), pad),
                    np.tile(
                        [*((np.arange(count) + 1) % count), *[0] * (4 - count)], (len(nodes), 1)
                    ),
                    np.pad(normal, [*pad, (0, 0)]),
                    np.pad(angle, pad),
                    np.pad(inward, [*pad, (0, 0)]),
                )
            )
        return cls(*(np.concatenate(column) for column in zip(*rows, strict=True)))

    def fans(self) -> tuple[IntArray, BoolArray, BoolArray]:
        """(f, 4) numbers of the fans of facets about a node that are one smooth surface; which are
        open; which of one facet.
        """
        count = self.corners.size
        here, at = np.nonzero(self.real)
        ends = np.sort(
            np.column_stack([self.corners[here, at], self.corners[here, self.next[here, at]]]),
            axis=1,
        )
        order = np.lexsort(ends.T[::-1])
        starts = np.flatnonzero(
            np.concatenate([[True], np.any(np.diff(ends[order], axis=0) != 0, axis=1), [True]])
        )
        # of the side after each corner
        links, closed = [], np.zeros(self.corners.shape, dtype=bool)
        for step in range(1, int(np.diff(starts).max(initial=1))):
            first = np.concatenate(
                [np.arange(a, b - step) for a, b in pairwise(starts.tolist()) if b - a > step]
            )
            one, two = order[first], order[first + step]
            turn = -np.sum(
                self.inward[here[one], at[one]] * self.inward[here[two], at[two]], axis=1
            )
            smooth = turn > np.cos(SMOOTH)
            one, two = one[smooth], two[smooth]
            for a, b in ((one, two), (two, one)):
                closed[here[a], at[a]] = True
                for own in (at[a], self.next[here[a], at[a]]):
                    node = self.corners[here[a], own]
                    other = np.where(
                        self.corners[here[b], at[b]] == node, at[b], self.next[here[b], at[b]]
                    )
                    links.append(np.column_stack([4 * here[a] + own, 4 * here[b] + other]))
        pairs = np.concatenate(links) if links else np.zeros((0, 2), dtype=np.int64)
        graph = scipy.sparse.coo_array((np.ones(len(pairs)), pairs.T), shape=(count, count))
        _, fan = scipy.sparse.csgraph.connected_components(graph, directed=False)
        fan = fan.reshape(self.corners.shape)
        open_ = np.zeros(fan.max() + 1, dtype=bool)
        lone_here, lone_at = np.nonzero(self.real & ~closed)
        open_[fan[lone_here, lone_at]] = True
        open_[fan[lone_here, self.next[lone_here, lone_at]]] = True
        return fan, open_, np.bincount(fan[self.real], minlength=len(open_)) == 1

    def aligned(self, fans: IntArray) -> FloatArray:
        """(f, 4, 3) normals at the corners, turned to the side of the first of their fan."""
        first = np.zeros(fans.max() + 1, dtype=np.int64)
        first[fans.ravel()[::-1]] = np.arange(fans.size)[::-1]
        flat = self.normal.reshape(-1, 3)
        sign = np.sign(np.sum(flat * flat[first[fans.ravel()]], axis=1))
        return np.asarray((sign[:, None] * flat).reshape(self.normal.shape))


def _pairs(nodes: IntArray, of: list[tuple[int, ...]]) -> IntArray:
    """(e × p, 2) pairs of nodes of (e, n) elements, the smaller number first."""
    return np.sort(nodes[:, np.array(of)].reshape(-1, 2), axis=1)


def find(sides: IntArray, pairs: IntArray) -> IntArray:
    """(w,) places of (w, 2) pairs among (s, 2) sorted ones, which hold them."""
    base = max(int(sides.max(initial=0)), int(pairs.max(initial=0))) + 1
    return np.searchsorted(sides[:, 0] * base + sides[:, 1], pairs[:, 0] * base + pairs[:, 1])
