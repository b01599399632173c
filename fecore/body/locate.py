"""Points on surfaces: the nearest point of the shells and beams, and what moves there."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fecore.arrays import BoolArray, FloatArray, IntArray
from fecore.body.mesh import BEAMS, SHELLS, Mesh
from fecore.body.supports import turning
from fecore.errors import OffSpecimenError

TOLERANCE = 0.002
"""m beyond half the wall by which a point may lie off the middle surface, unless stated: tapes
differ from callipers.
"""

_BOUNDS = (np.minimum, 1), (np.maximum, -1)
_STEPS = 12  # of Gauss and Newton: a point on a flat element is found in one


@dataclass(frozen=True)
class Places:
    """Points found on the surface."""

    # (p, n) nodes of each point's element; beyond an element's own its first with no weight
    nodes: IntArray
    functions: FloatArray  # (p, n) shape functions
    shift: FloatArray  # (p, n, 3) rigid links from the nodes to the element
    foot: FloatArray  # (p, 3) the nearest places themselves
    # (p, 3) from there to the point, m; from a shell's free edge along its normal alone
    arm: FloatArray
    distance: FloatArray  # (p,) from the surface, m
    thickness: FloatArray  # (p,) nominal thickness of the wall, m
    offset: FloatArray  # (p,) from there along the normal to the wall's middle, m
    block: IntArray  # (p,) number of the element's block
    normal: FloatArray  # (p, 3) of the surface
    on_beam: BoolArray  # (p,) whether it is a beam

    def rows(self, directions: FloatArray) -> FloatArray:
        """(p, n, 6) displacement of the points along (p, 3) directions by the nodes' dofs."""
        arms = turning(self.shift + self.arm[:, None])
        moved = np.concatenate([np.broadcast_to(np.eye(3), arms.shape), arms], axis=-1)
        return np.asarray(self.functions[..., None] * np.einsum("pk,pnkd->pnd", directions, moved))

    def turns(self) -> FloatArray:
        """(p, 3, n, 6) rotations at the points by the nodes' dofs."""
        turns = np.zeros((*self.functions.shape[:1], 3, self.functions.shape[1], 6))
        turns[..., 3:] = self.functions[:, None, :, None] * np.eye(3)[:, None]
        return turns


def place_in_words(place: Sequence[float]) -> str:
    """A place of a body, such as `x = 0.25 m, y = 0.02 m`."""
    words = [f"{name} = {value:.3g} m" for name, value in zip("xyz", place, strict=True) if value]
    return ", ".join(words) or "the origin"


def evenly_spread(places: FloatArray, most: int) -> list[int]:
    """Numbers of so many places, each of which is as far as can be from those before."""
    chosen, apart = [0], np.full(len(places), np.inf)
    for _ in range(min(most, len(places)) - 1):
        apart = np.minimum(apart, np.sum((places - places[chosen[-1]]) ** 2, axis=1))
        chosen.append(int(np.argmax(apart)))
    return chosen


@dataclass(frozen=True)
class Surfaces:
    """The shells and beams of a mesh as they lie in space."""

    mesh: Mesh
    # (e, n, 3) of each block: from the mesh's nodes to where its elements begin
    shifts: tuple[FloatArray, ...]
    # nominal thickness of each block, m; of beams twice how far material lies from the axis
    thickness: tuple[float, ...]
    # of each block, from its elements along their normals to the walls' middles, m
    offsets: tuple[float, ...]
    # m along x, y and z by which a point may lie further away than half the wall
    reach: tuple[float, float, float] = (TOLERANCE,) * 3

    @cached_property
    def _elements(self) -> tuple[tuple[FloatArray, ...], IntArray, FloatArray, FloatArray]:
        """Coordinates of each block's elements; of all elements (e, 2) block and number, centres
        and radii of balls around.
        """
        x = tuple(
            self.mesh.nodes[block.nodes] + shift
            for block, shift in zip(self.mesh.blocks, self.shifts, strict=True)
        )
        numbers = np.concatenate(
            [np.column_stack([np.full(len(e), k), np.arange(len(e))]) for k, e in enumerate(x)]
        )
        centres = [e.mean(axis=1) for e in x]
        # A curved element's surface may leave the ball of its nodes by some share of its size.
        radii = [
            1.1 * np.linalg.norm(e - c[:, None], axis=2).max(axis=1)
            for e, c in zip(x, centres, strict=True)
        ]
        return x, numbers, np.concatenate(centres), np.concatenate(radii)

    def spread(self, most: int) -> tuple[FloatArray, FloatArray]:
        """(p, 3) places on the middle surface, as far from each other as can be, and (p, 3) normals
        there.
        """
        _, _, centres, _ = self._elements
        nearest = self.nearest(centres[evenly_spread(centres, most)])
        return nearest.foot, nearest.normal

    def find(self, points: FloatArray) -> Places:
        """The nearest points of the surface to (p, 3) points. One beyond an edge counts as on it.

        Raises:
            OffSpecimenError: as of `are_off`.
        """
        places = self.nearest(points)
        off = self.are_off(points, places)
        if np.any(off):
            index = int(np.flatnonzero(off)[0])
            place = ", ".join(f"{x:g}" for x in points[index])
            low, high = self.mesh.nodes.min(axis=0), self.mesh.nodes.max(axis=0)
            spans = ", ".join(
                f"{n} {a:g} … {b:g} m" for n, a, b in zip("xyz", low, high, strict=True) if b > a
            )
            raise OffSpecimenError(
                index,
                f"({place}) m lies {1000 * places.distance[index]:.3g} mm off the specimen, which"
                f" spans {spans}",
            )
        return places

    def are_off(self, points: FloatArray, places: Places) -> BoolArray:
        """(p,) which points lie further than `reach` from what is at their places: the wall, and
        the link to it from nodes.
        """
        wall = (
            places.thickness[:, None]
            / 2
            * np.where(places.on_beam[:, None], 1.0, np.abs(places.normal))
        )
        middle = places.foot + places.offset[:, None] * places.normal
        nodes = places.foot - np.einsum("pn,pnk->pk", places.functions, places.shift)
        low, high = (
            pick.reduce([middle - sign * wall, places.foot, nodes]) for pick, sign in _BOUNDS
        )
        beyond = np.maximum(low - points, points - high)
        return np.asarray(np.any(beyond > np.array(self.reach) * (1 + 1e-9), axis=1))

    def nearest(self, points: FloatArray) -> Places:
        """The nearest points of the surface, however far."""
        blocks, numbers, centres, radii = self._elements
        width = max(x.shape[1] for x in blocks)
        near = [np.linalg.norm(centres - point, axis=1) for point in points]
        close = [np.flatnonzero(each - radii <= each.min()) for each in near]
        p = np.repeat(np.arange(len(points)), [each.size for each in close])
        e = np.concatenate([np.zeros(0, dtype=np.int64), *close])
        best = np.full(len(points), np.inf)
        nodes, functions = (
            np.zeros((len(points), width), dtype=np.int64),
            np.zeros((len(points), width)),
        )
        shift, foot, normal = (
            np.zeros((len(points), width, 3)),
            np.zeros((len(points), 3)),
            np.zeros((len(points), 3)),
        )
        number = np.zeros(len(points), dtype=np.int64)
        for k, x in enumerate(blocks):
            own = numbers[e, 0] == k
            who, element = p[own], numbers[e[own], 1]
            N, place, n = self._project(self.mesh.blocks[k].kind, x[element], points[who])
            distance = np.linalg.norm(points[who] - place, axis=1)
            order = np.argsort(-distance, kind="stable")  # the nearest is written last
            order = order[distance[order] < best[who[order]]]
            at, count = who[order], x.shape[1]
            nodes[at] = self.mesh.blocks[k].nodes[element[order], :1]
            functions[at], shift[at] = 0, 0
            nodes[at, :count], functions[at, :count] = (
                self.mesh.blocks[k].nodes[element[order]],
                N[order],
            )
            shift[at, :count], foot[at], normal[at] = (
                self.shifts[k][element[order]],
                place[order],
                n[order],
            )
            best[at], number[at] = distance[order], k
        on_beam = np.array([not block.is_shell for block in self.mesh.blocks])[number]
        arm = points - foot
        # Beside a shell's edge a point counts as on it; beside a junction's rigid link, as what the
        # link carries.
        carried = on_beam | shift.any(axis=(1, 2))
        arm = np.where(carried[:, None], arm, np.sum(arm * normal, axis=1, keepdims=True) * normal)
        return Places(
            nodes,
            functions,
            shift,
            foot=foot,
            arm=arm,
            distance=best,
            thickness=np.array(self.thickness)[number],
            offset=np.array(self.offsets)[number],
            block=number,
            normal=normal,
            on_beam=on_beam,
        )

    def _project(
        self, kind: str, x: FloatArray, points: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Shape functions at, and place and normal of, the point of each element nearest to each
        point (Gauss and Newton).

        Of a beam the normal points to the point.
        """
        if kind in BEAMS:
            beam, along = BEAMS[kind], np.zeros(len(x))
            for _ in range(_STEPS):
                tangent = np.einsum("en,enk->ek", beam.derivatives(along), x)
                missing = points - np.einsum("en,enk->ek", beam.functions(along), x)
                step = np.einsum("ek,ek->e", tangent, missing) / np.einsum(
                    "ek,ek->e", tangent, tangent
                )
                along = np.clip(along + step, -1, 1)
            N = beam.functions(along)
            place = np.einsum("en,enk->ek", N, x)
            return (
                N,
                place,
                (points - place)
                / np.maximum(np.linalg.norm(points - place, axis=1), 1e-300)[:, None],
            )
        shell = SHELLS[kind]
        natural = np.tile(shell.corners[: len(shell.sides)].mean(axis=0), (len(x), 1))
        for _ in range(_STEPS):
            tangents = np.einsum("ean,enk->eak", shell.derivatives(natural), x)
            missing = points - np.einsum("en,enk->ek", shell.functions(natural), x)
            gram = tangents @ tangents.transpose(0, 2, 1)
            step = np.linalg.solve(gram, np.einsum("eak,ek->ea", tangents, missing)[..., None])[
                ..., 0
            ]
            natural = shell.inside(natural + step)
        N = shell.functions(natural)
        tangents = np.einsum("ean,enk->eak", shell.derivatives(natural), x)
        normal = np.cross(tangents[:, 0], tangents[:, 1])
        return (
            N,
            np.einsum("en,enk->ek", N, x),
            normal / np.linalg.norm(normal, axis=1, keepdims=True),
        )
