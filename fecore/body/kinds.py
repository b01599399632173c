"""Kinds of modes in words: by the shares of motion of a flat body, and by how the sections of a folded one move."""

from __future__ import annotations

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.body.model import Model

_SLICES = 24  # across the longest axis of a folded body, in which its section moves as one or does not


def mode_kinds(model: Model, shapes: FloatArray) -> tuple[str, ...]:
    """Kind of each (dofs, n) elastic shape, by the largest share of its motion over the nodes.

    Of a flat body or a beam along x: in-plane (u, v) against w, and of w the part odd in y (torsion) against the even part
    (bending). A beam's torsion moves its axis nowhere. Of a body in space: its sections along x shift along y or z (bending),
    along x (axial), turn (torsion), or change their form (walls).
    """
    nodes = model.mesh.nodes
    motion = np.zeros((len(nodes), 6, shapes.shape[1]))
    motion[:, list(model.dofs)] = model.stiffness.everywhere(shapes)
    if np.ptp(nodes[:, 2]):
        return _of_sections(nodes, motion)
    flat, w = np.sum(motion[:, :2] ** 2, axis=(0, 1)), motion[:, 2]
    if not np.ptp(nodes[:, 1]):
        turn = np.sum(motion[:, 3] ** 2, axis=0) * (1e-3 * model.mesh.size) ** 2
        return _largest(("bending", "torsion", "in-plane"), np.array([np.sum(w**2, axis=0), turn, flat]))
    mirrored = w[_mirror(nodes[:, :2])]
    even, odd = np.sum((w + mirrored) ** 2, axis=0) / 4, np.sum((w - mirrored) ** 2, axis=0) / 4
    bent = _largest(("bending", "torsion"), np.array([even, odd]))
    return tuple("in-plane" if p > q else kind for p, q, kind in zip(flat, even + odd, bent, strict=True))


def _of_sections(nodes: FloatArray, motion: FloatArray) -> tuple[str, ...]:
    """By the rigid motion across x, and the mean along it, that fit each slice of the body best."""
    x, count = nodes[:, 0], motion.shape[2]
    number = np.minimum(((x - x.min()) / np.ptp(x) * _SLICES).astype(np.int64), _SLICES - 1)
    shares = np.zeros((5, count))  # along y, along z, turns, the rest, along x
    for k in range(_SLICES):
        own = number == k
        size = int(own.sum())
        if size < 2:
            continue
        y, z = (nodes[own, axis] - nodes[own, axis].mean() for axis in (1, 2))
        u, v, w = (motion[own, axis] for axis in range(3))
        arm = y @ y + z @ z
        turn = (y @ w - z @ v) / arm if arm else np.zeros(count)
        each = np.array([size * v.mean(axis=0) ** 2, size * w.mean(axis=0) ** 2, turn**2 * arm])
        shares[:3] += each
        shares[3] += np.sum(v**2 + w**2, axis=0) - each.sum(axis=0)
        shares[4] += np.sum(u**2, axis=0)
    names = "bending y", "bending z", "torsion", "walls", "axial"
    return _largest(names, shares)


def _largest(names: tuple[str, ...], shares: FloatArray) -> tuple[str, ...]:
    """The name of the largest of (k, n) shares of each of n modes."""
    return tuple(names[int(k)] for k in np.argmax(shares, axis=0))


def _mirror(nodes: FloatArray) -> IntArray:
    """(n,) number of the node at (x, -y) of each node."""
    x, y = nodes.T
    grid = np.rint(np.column_stack([x, y]) / (np.ptp(nodes, axis=0) * 1e-9)).astype(np.int64)
    here, there = np.lexsort((grid[:, 1], grid[:, 0])), np.lexsort((-grid[:, 1], grid[:, 0]))
    mirror = np.empty_like(here)
    mirror[here] = there
    return mirror
