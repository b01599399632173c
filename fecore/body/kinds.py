"""What modes are: shares of their motion by kind, of flat bodies and of folded ones, and of their
strain energy by set.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.body.model import Model

# across the longest axis of a folded body, in which its section moves as one or does not
_SLICES = 24


def mode_kinds(model: Model, shapes: FloatArray) -> tuple[str, ...]:
    """Kind of each (dofs, n) elastic shape, by the largest of its `motion_shares`."""
    return largest(motion_shares(model, shapes))


def largest(fractions: Mapping[str, FloatArray]) -> tuple[str, ...]:
    """The name of the largest of the shares of each of n modes."""
    names = tuple(fractions)
    return tuple(names[int(k)] for k in np.argmax(list(fractions.values()), axis=0))


def motion_shares(model: Model, shapes: FloatArray) -> dict[str, FloatArray]:
    """(n,) shares, by kind, of the squared motion over the nodes in (dofs, n) elastic shapes; their
    sum is 1, or 0 at rest.

    Of a flat body or a beam along x: in-plane (u, v) against w, and of w the part odd in y
    (torsion) against the even part (bending). A beam's torsion moves its axis nowhere. Of a body in
    space: its sections along x shift along y or z (bending), along x (axial), turn (torsion), or
    change their form (walls).
    """
    nodes = model.mesh.nodes
    motion = model.everywhere(shapes)
    if np.ptp(nodes[:, 2]):
        squares = _of_sections(nodes, motion)
    else:
        flat, w = np.sum(motion[:, :2] ** 2, axis=(0, 1)), motion[:, 2]
        if np.ptp(nodes[:, 1]):
            mirrored = w[_mirror(nodes[:, :2])]
            even, odd = (
                np.sum((w + mirrored) ** 2, axis=0) / 4,
                np.sum((w - mirrored) ** 2, axis=0) / 4,
            )
        else:
            even = np.sum(w**2, axis=0)
            odd = np.sum(motion[:, 3] ** 2, axis=0) * (1e-3 * model.mesh.size) ** 2
        squares = {"bending": even, "torsion": odd, "in-plane": flat}
    whole = np.sum(list(squares.values()), axis=0)
    return {name: share / np.where(whole, whole, 1.0) for name, share in squares.items()}


def energy_shares(model: Model, energies: FloatArray) -> dict[str, FloatArray]:
    """(n,) shares of the strain energy by set, and by spring and clamp, of (n, k) energies by the
    coefficients of K.
    """
    owners = [_owner(name, model.mesh.sets) for name in model.stiffness.names]
    whole = energies.sum(axis=1)
    return {
        owner: (
            energies[:, [k for k, each in enumerate(owners) if each == owner]].sum(axis=1) / whole
        )
        for owner in dict.fromkeys(owners)
    }


def _owner(coefficient: str, sets: Sequence[str]) -> str:
    """The set of a coefficient of K; of a spring or a clamp its own name."""
    return max(
        (name for name in sets if coefficient.startswith(f"{name}.")), key=len, default=coefficient
    )


def _of_sections(nodes: FloatArray, motion: FloatArray) -> dict[str, FloatArray]:
    """By the rigid motion across x, and the mean along it, that fit each slice of the body best."""
    x, count = nodes[:, 0], motion.shape[2]
    number = np.minimum(
        ((x - x.min()) / (np.ptp(x) or 1.0) * _SLICES).astype(np.int64), _SLICES - 1
    )
    fractions = np.zeros((5, count))  # along y, along z, turns, the rest, along x
    for k in range(_SLICES):
        own = number == k
        size = int(own.sum())
        if not size:
            continue
        y, z = (nodes[own, axis] - nodes[own, axis].mean() for axis in (1, 2))
        u, v, w = (motion[own, axis] for axis in range(3))
        arm = y @ y + z @ z
        turn = (y @ w - z @ v) / arm if arm else np.zeros(count)
        each = np.array([size * v.mean(axis=0) ** 2, size * w.mean(axis=0) ** 2, turn**2 * arm])
        fractions[:3] += each
        fractions[3] += np.sum(v**2 + w**2, axis=0) - each.sum(axis=0)
        fractions[4] += np.sum(u**2, axis=0)
    return dict(
        zip(("bending y", "bending z", "torsion", "walls", "axial"), fractions, strict=True)
    )


def _mirror(nodes: FloatArray) -> IntArray:
    """(n,) number of the node at (x, -y) of each node."""
    x, y = nodes.T
    extent = np.ptp(nodes, axis=0)
    grid = np.rint(np.column_stack([x, y]) / (np.where(extent, extent, 1.0) * 1e-9)).astype(
        np.int64
    )
    here, there = np.lexsort((grid[:, 1], grid[:, 0])), np.lexsort((-grid[:, 1], grid[:, 0]))
    mirror = np.empty_like(here)
    mirror[here] = there
    return mirror
