"""The clamp of a body in space that gives way: a rigid block over the clamped nodes, on an even
bed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.body.sections import ShellSection
from fecore.body.supports import Clamp, Link, NodeSpring
from fecore.quantities import CLAMP

if TYPE_CHECKING:
    from fecore.body.structure import Structure


@dataclass(frozen=True)
class Root:
    """The clamped end x = 0 of a strip."""

    bending_stiffness: float  # EI there, N·m²
    # of the strip, m
    length: float
    width: float
    thickness: float


@dataclass(frozen=True)
class Bed:
    """An even bed under the block that holds a body's clamped nodes."""

    nodes: IntArray  # (n,) numbers of the clamped nodes
    centre: FloatArray  # (3,) of these nodes, m
    arm: FloatArray  # (3,) from there to the centre of all nodes, m
    # (3, 3) stiffness of the bed in rotation about its centre over that in translation, m²
    inertia: FloatArray

    def yields(self, pushes: FloatArray) -> FloatArray:
        """(m,) work on a bed of unit stiffness in translation, of (6, m) forces, and moments about
        the centre of all nodes.
        """
        shift, turn = np.split(pushes, 2)
        turn = turn + np.cross(self.arm[None], shift.T).T
        turned = np.einsum("in,ij,jn->n", turn, np.linalg.pinv(self.inertia), turn)
        return np.asarray(np.sum(shift**2, axis=0) + turned)


def bed_of(body: Structure) -> Bed | None:
    """The bed of a body's clamp; None of a body that anything but one clamp holds."""
    held = [support for support in body.supports if support.how == "clamped"]
    skew = [link for link in body.links if not link.independent]
    if len(held) != 1 or len(body.supports) > 1 or skew or body.springs or body.clamps:
        return None
    nodes = body.mesh.select(held[0].where)
    places = body.mesh.nodes[nodes]
    arms = places - places.mean(axis=0)
    walls = [
        section.thickness for section in body.sections.values() if isinstance(section, ShellSection)
    ]
    inertia = np.mean(np.sum(arms**2, axis=1)) * np.eye(3) - arms.T @ arms / len(arms)
    centre = places.mean(axis=0)
    return Bed(
        nodes,
        centre,
        body.mesh.nodes.mean(axis=0) - centre,
        inertia + max(walls, default=0.0) ** 2 / 12 * np.eye(3),
    )


def on_bed(body: Structure, bed: Bed, compliance: float, stiffness: float) -> Structure:
    """The body with its clamp on the bed, as the constant `CLAMP`.

    Args:
        body: a body that the clamp of `bed` holds.
        bed: the clamp's.
        compliance: nominal compliance C.
        stiffness: of the bed in translation at C = 1, N/m.
    """
    block = len(body.mesh.nodes)
    mesh = replace(body.mesh, nodes=np.vstack([body.mesh.nodes, bed.centre]))
    rows = np.eye(6)
    rows[3:, 3:] = np.linalg.cholesky(bed.inertia).T
    spring = NodeSpring(CLAMP, stiffness, np.full((6, 1), block), rows[:, None])
    links = (*body.links, *(Link(int(node), (block,)) for node in bed.nodes))
    return replace(body, mesh=mesh, supports=(), links=links, clamps=(Clamp(compliance, spring),))
