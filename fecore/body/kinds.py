"""Kinds of modes in words: by the shares of motion of a flat body, and by those of a folded one's sections."""

from __future__ import annotations

from typing import Literal

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.body.model import Model

ModeKind = Literal["rigid", "bending", "torsion", "in-plane"]


def mode_kinds(model: Model, shapes: FloatArray) -> tuple[ModeKind, ...]:
    """Kind of each (dofs, n) elastic shape by the larger share of its motion over the nodes: in-plane (u, v) against w, and of
    w the part odd in y (torsion) against the even part (bending). A beam's torsion moves its axis nowhere.
    """
    motion = np.zeros((len(model.mesh.nodes), 6, shapes.shape[1]))
    motion[:, list(model.dofs)] = model.stiffness.everywhere(shapes)
    flat = np.sum(motion[:, :2] ** 2, axis=(0, 1))
    w = motion[:, 2]
    if not np.ptp(model.mesh.nodes[:, 1]):
        turn = np.sum(motion[:, 3] ** 2, axis=0) * (1e-3 * model.mesh.size) ** 2
        shares = np.array([np.sum(w**2, axis=0), turn, flat])
    else:
        mirrored = w[_mirror(model.mesh.nodes[:, :2])]
        shares = np.array([np.sum((w + mirrored) ** 2, axis=0) / 4, np.sum((w - mirrored) ** 2, axis=0) / 4, flat])
        shares[2] = np.where(shares[2] > shares[0] + shares[1], np.inf, -np.inf)
    names: tuple[ModeKind, ...] = ("bending", "torsion", "in-plane")
    return tuple(names[int(k)] for k in np.argmax(shares, axis=0))


def _mirror(nodes: FloatArray) -> IntArray:
    """(n,) number of the node at (x, -y) of each node."""
    x, y = nodes.T
    grid = np.rint(np.column_stack([x, y]) / (np.ptp(nodes, axis=0) * 1e-9)).astype(np.int64)
    here, there = np.lexsort((grid[:, 1], grid[:, 0])), np.lexsort((-grid[:, 1], grid[:, 0]))
    mirror = np.empty_like(here)
    mirror[here] = there
    return mirror
