"""Points on surfaces: the nearest point of the shells, and what moves there."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from fecore.arrays import FloatArray, IntArray
from fecore.errors import OffSpecimenError
from fecore.space.mesh import SHELLS, Mesh
from fecore.space.supports import turning

TOLERANCE = 0.002
"""m beyond half the wall by which a point may lie off the middle surface, unless stated: tapes differ from callipers."""

_NEAR = 12  # nodes of elements nearest to a point, whose elements are looked at
_STEPS = 12  # of Gauss and Newton: a point on a flat element is found in one


@dataclass(frozen=True)
class Places:
    """Points found on the surface.

    Attributes:
        nodes: (p, n) nodes of each point's element; beyond an element's own its first with no weight.
        functions: (p, n) shape functions.
        shift: (p, n, 3) rigid links from the nodes to the element.
        arm: (p, 3) from the surface to the point, m.
        distance: (p,) from the surface, m.
        thickness: (p,) nominal thickness of the wall, m.
        block: (p,) number of the element's block.
        normal: (p, 3) of the surface.
    """

    nodes: IntArray
    functions: FloatArray
    shift: FloatArray
    arm: FloatArray
    distance: FloatArray
    thickness: FloatArray
    block: IntArray
    normal: FloatArray

    def rows(self, directions: FloatArray) -> FloatArray:
        """(p, n, 6) displacement of the points along (p, 3) directions by the nodes' dofs."""
        arms = turning(self.shift + self.arm[:, None])
        moved = np.concatenate([np.broadcast_to(np.eye(3), arms.shape), arms], axis=-1)
        return np.asarray(self.functions[..., None] * np.einsum("pk,pnkd->pnd", directions, moved))

    def turns(self) -> FloatArray:
        """(p, 3, n, 6) rotations at the points by the nodes' dofs."""
        found = np.zeros((*self.functions.shape[:1], 3, self.functions.shape[1], 6))
        found[..., 3:] = self.functions[:, None, :, None] * np.eye(3)[:, None]
        return found


@dataclass(frozen=True)
class Surfaces:
    """The shells of a mesh as they lie in space.

    Attributes:
        mesh: the mesh.
        shifts: (e, n, 3) of each block: from the mesh's nodes to where its elements begin.
        thickness: nominal thickness of each block, m; 0 for beams.
    """

    mesh: Mesh
    shifts: tuple[FloatArray, ...]
    thickness: tuple[float, ...]

    @cached_property
    def _elements(self) -> tuple[tuple[tuple[int, FloatArray], ...], scipy.spatial.KDTree, IntArray]:
        """Blocks of shells with their elements' coordinates, a tree of those, and (block, element) of each leaf."""
        blocks = tuple(
            (number, self.mesh.nodes[block.nodes] + self.shifts[number])
            for number, block in enumerate(self.mesh.blocks)
            if block.is_shell
        )
        leaves = [
            np.column_stack(
                [np.full(x.shape[0] * (x.shape[1] + 1), number), np.repeat(np.arange(len(x)), x.shape[1] + 1)]
            )
            for number, x in blocks
        ]
        points = [np.concatenate([x, x.mean(axis=1, keepdims=True)], axis=1).reshape(-1, 3) for _, x in blocks]
        return blocks, scipy.spatial.KDTree(np.concatenate(points)), np.concatenate(leaves)

    def find(self, points: FloatArray, tolerance: float | None = None) -> Places:
        """The nearest points of the surface to (p, 3) points.

        Args:
            points: m.
            tolerance: m by which a point may lie further from the surface than half the wall; `TOLERANCE` if not stated.

        Raises:
            OffSpecimenError: a point lies further.
        """
        found = self.nearest(points)
        beyond = found.distance - found.thickness / 2 - (TOLERANCE if tolerance is None else tolerance)
        if np.any(beyond > 0):
            index = int(np.flatnonzero(beyond > 0)[0])
            x, y, z = points[index]
            raise OffSpecimenError(
                index,
                f"({x:g}, {y:g}, {z:g}) m lies {found.distance[index]:.4g} m off the surface of "
                f"{self.mesh.blocks[found.block[index]].set}, whose wall is {found.thickness[index]:g} m thick",
            )
        return found

    def nearest(self, points: FloatArray) -> Places:
        """The nearest points of the surface, however far."""
        blocks, tree, leaves = self._elements
        _, near = tree.query(points, k=min(_NEAR, len(leaves)))
        near = near.reshape(len(points), -1)
        width = max(x.shape[1] for _, x in blocks)
        best = np.full(len(points), np.inf)
        nodes, functions = np.zeros((len(points), width), dtype=np.int64), np.zeros((len(points), width))
        shift, foot, normal = np.zeros((len(points), width, 3)), np.zeros((len(points), 3)), np.zeros((len(points), 3))
        block = np.zeros(len(points), dtype=np.int64)
        for number, x in blocks:
            pairs = np.array(
                [(p, e) for p, row in enumerate(leaves[near]) for b, e in set(map(tuple, row)) if b == number]
            )
            if not pairs.size:
                continue
            p, e = pairs.T
            N, place, n = self._project(number, x[e], points[p])
            distance = np.linalg.norm(points[p] - place, axis=1)
            order = np.argsort(-distance, kind="stable")  # the nearest is written last
            order = order[distance[order] < best[p[order]]]
            who, count = p[order], x.shape[1]
            nodes[who] = self.mesh.blocks[number].nodes[e[order], :1]
            functions[who], shift[who] = 0, 0
            nodes[who, :count], functions[who, :count] = self.mesh.blocks[number].nodes[e[order]], N[order]
            shift[who, :count], foot[who], normal[who] = self.shifts[number][e[order]], place[order], n[order]
            best[who], block[who] = distance[order], number
        thickness = np.array(self.thickness)[block]
        return Places(nodes, functions, shift, points - foot, best, thickness, block, normal)

    def _project(self, number: int, x: FloatArray, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Shape functions at, and place and normal of, the point of each element nearest to each point (Gauss and Newton)."""
        shell = SHELLS[self.mesh.blocks[number].kind]
        natural = np.tile(shell.corners[: len(shell.sides)].mean(axis=0), (len(x), 1))
        for _ in range(_STEPS):
            tangents = np.einsum("ean,enk->eak", shell.derivatives(natural), x)
            missing = points - np.einsum("en,enk->ek", shell.functions(natural), x)
            gram = tangents @ tangents.transpose(0, 2, 1)
            step = np.linalg.solve(gram, np.einsum("eak,ek->ea", tangents, missing)[..., None])[..., 0]
            natural = shell.inside(natural + step)
        N = shell.functions(natural)
        tangents = np.einsum("ean,enk->eak", shell.derivatives(natural), x)
        normal = np.cross(tangents[:, 0], tangents[:, 1])
        return N, np.einsum("en,enk->ek", N, x), normal / np.linalg.norm(normal, axis=1, keepdims=True)
