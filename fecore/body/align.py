"""Where a test's frame lies in a body's: by named pairs of points, or by the closest points of the
surface.

A rigid motion x ↦ Rx + t that brings points p nearest to places q, Σ|Rp + t − q|² least, is R = U
diag(1, 1, det UVᵀ) Vᵀ of the singular value decomposition USVᵀ of Σ(q − q̄)(p − p̄)ᵀ (Kabsch, Acta
Cryst. A32, 1976). Without pairs, q are the nearest points of the mesh, then of the outer faces, and
nearest points and motion are found in turn (Besl and McKay, IEEE PAMI 14, 1992), from each of the
24 turns that bring axes onto axes; at last distances along the faces' normals alone count (Chen and
Medioni, Image Vis. Comput. 10, 1992). Symmetric bodies, and grids on them, have several answers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
import scipy

from fecore.arrays import FloatArray
from fecore.body.locate import Surfaces
from fecore.errors import InputError

_STRAIGHT = 1e-6  # second singular value by the first of points on a line
_COARSE, _FINE = 30, 15  # steps by the mesh's nodes, and by its surface
_WORTH = 6  # of the coarse answers that are made fine
_AS_GOOD = 1.3  # times the least residual, within which an answer is another one that fits
_RESOLVED = 2e-4  # m, below which residuals say nothing
_SLIDES = 1e-3  # share of the largest singular value below which the faces do not hold the grid
_SAME = 0.02  # of turns, and of the body's size, within which two answers are one


@dataclass(frozen=True)
class Motion:
    """x ↦ turn · x + shift."""

    turn: FloatArray  # (3, 3) proper rotation
    shift: FloatArray  # (3,) m
    residual: FloatArray  # (p,) distances that are left, m

    @property
    def rms(self) -> float:
        """Root mean square of the residual, m."""
        return float(np.sqrt(np.mean(self.residual**2)))


def by_pairs(points: FloatArray, places: FloatArray) -> Motion:
    """The motion that brings (p, 3) points of a test nearest to their (p, 3) places on the body.

    Raises:
        InputError: there are fewer than three, or they lie on a line.
    """
    if len(points) < 3:
        raise InputError(
            "pairs", f"are {len(points)}, expected three or more that are not on a line"
        )
    centred = points - points.mean(axis=0)
    singular = np.linalg.svd(centred, compute_uv=False)
    if singular[1] <= _STRAIGHT * singular[0]:
        raise InputError("pairs", "lie on a line: nothing says how the test is turned about it")
    turn, shift = _kabsch(points, places)
    return Motion(turn, shift, np.linalg.norm(points @ turn.T + shift - places, axis=1))


def by_closest(surfaces: Surfaces, points: FloatArray) -> tuple[Motion, ...]:
    """Motions that bring (p, 3) points onto the body's faces, the best first, and those that fit
    nearly as well.

    Raises:
        InputError: there are fewer than three points, or they lie on a line.
    """
    by_pairs(points, points)
    nodes = np.concatenate(
        [surfaces.mesh.nodes[block.nodes].mean(axis=1) for block in surfaces.mesh.blocks]
    )
    tree = scipy.spatial.cKDTree(np.concatenate([surfaces.mesh.nodes, nodes]))
    as_it_is = _on_faces(surfaces, points, np.eye(3), np.zeros(3))
    turns = product(_turns(), (0, _COARSE))
    starts = sorted(
        (_coarse(tree, surfaces, points, *each) for each in turns), key=lambda motion: motion.rms
    )
    some = _different([as_it_is, *starts])[:_WORTH]
    # Of those whose residuals say nothing the first stays, as a grid on one face of a wall lies as
    # well on the other.
    fine = sorted(
        (_fine(surfaces, points, start) for start in some),
        key=lambda motion: max(motion.rms, _RESOLVED),
    )
    limit = max(_AS_GOOD * fine[0].rms, _RESOLVED)
    return tuple(motion for motion in _different(fine) if motion.rms <= limit)


def _kabsch(points: FloatArray, places: FloatArray) -> tuple[FloatArray, FloatArray]:
    middle, centre = points.mean(axis=0), places.mean(axis=0)
    U, _, Vt = np.linalg.svd((places - centre).T @ (points - middle))
    turn = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
    return turn, centre - turn @ middle


def _turns() -> list[FloatArray]:
    """The 24 proper turns of axes onto axes."""
    turns: list[FloatArray] = []
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        turn = np.zeros((3, 3))
        turn[np.arange(3), order] = signs
        if np.linalg.det(turn) > 0:
            turns.append(turn)
    return turns


def _coarse(
    tree: scipy.spatial.cKDTree,
    surfaces: Surfaces,
    points: FloatArray,
    turn: FloatArray,
    steps: int,
) -> Motion:
    """From middles on each other, some steps by the nearest of the mesh's nodes and centres; these
    lie in the walls' middles, so that steps may also lead away from an answer.
    """
    low, high = surfaces.mesh.nodes.min(axis=0), surfaces.mesh.nodes.max(axis=0)
    turned = points @ turn.T
    shift = (low + high) / 2 - (turned.min(axis=0) + turned.max(axis=0)) / 2
    for _ in range(steps):
        _, nearest = tree.query(points @ turn.T + shift)
        turn, shift = _kabsch(points, tree.data[nearest])
    return _on_faces(surfaces, points, turn, shift)


def _fine(surfaces: Surfaces, points: FloatArray, start: Motion) -> Motion:
    """Onto the tangent planes of the outer faces at the nearest points, which lets a grid slide
    along its walls.
    """
    turn, shift = start.turn, start.shift
    for _ in range(_FINE):
        moved = points @ turn.T + shift
        places, normal = _on_face(surfaces, moved)
        middle = moved.mean(axis=0)
        arms = (moved - middle) / surfaces.mesh.size
        rows = np.hstack([np.cross(arms, normal), normal])
        step = np.linalg.lstsq(rows, np.sum((places - moved) * normal, axis=1), rcond=_SLIDES)[0]
        small = scipy.spatial.transform.Rotation.from_rotvec(
            step[:3] / surfaces.mesh.size
        ).as_matrix()
        turn, shift = small @ turn, small @ (shift - middle) + middle + step[3:]
    return _on_faces(surfaces, points, turn, shift)


def _on_faces(
    surfaces: Surfaces, points: FloatArray, turn: FloatArray, shift: FloatArray
) -> Motion:
    """The motion with the distances that it leaves to the faces."""
    moved = points @ turn.T + shift
    return Motion(turn, shift, np.linalg.norm(moved - _on_face(surfaces, moved)[0], axis=1))


def _on_face(surfaces: Surfaces, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(p, 3) the nearest points of the walls' faces, of beams of their axes; (p, 3) normals
    there.
    """
    nearest = surfaces.nearest(points)
    middle = nearest.foot + nearest.offset[:, None] * nearest.normal
    side = np.sign(np.sum((points - middle) * nearest.normal, axis=1, keepdims=True))
    half = np.where(nearest.on_beam, 0.0, nearest.thickness / 2)[:, None]
    return np.asarray(middle + side * half * nearest.normal), nearest.normal


def _different(motions: Sequence[Motion]) -> list[Motion]:
    """Those that are not the same as one before."""
    kept: list[Motion] = []
    for one in motions:
        size = max(float(np.linalg.norm(one.shift)), 1e-3)
        if not any(
            np.abs(one.turn - other.turn).max() < _SAME
            and np.abs(one.shift - other.shift).max() < _SAME * size
            for other in kept
        ):
            kept.append(one)
    return kept
