"""Modes of a body, with a mechanism named by what moves."""

from __future__ import annotations

import numpy as np
import scipy

from fecore.arrays import FloatArray
from fecore.body.model import Model
from fecore.body.supports import rigid_motions
from fecore.dynamics.eigen import MechanismError, NormalModes, normal_modes
from fecore.dynamics.factor import Factor
from fecore.errors import ModelError

_GROUPS, _NEIGHBOURS = 40, 20  # of nodes, whose rigid motions are tried as that of most nodes
_STILL = 1e-3  # share of the largest motion; nodes that move less stand still


def body_modes(
    model: Model,
    stiffness: scipy.sparse.csc_array,
    mass: scipy.sparse.csc_array,
    elastic: int,
    like: Factor | None = None,
) -> NormalModes:
    """The rigid motions of a body and so many modes after them.

    Args:
        model: the body's.
        stiffness: (dofs, dofs) K of it at its constants.
        mass: (dofs, dofs) M of it.
        elastic: number of modes besides the rigid motions.
        like: as in `factorise`.

    Raises:
        InputError: there are not so many modes.
        ModelError: as of `normal_modes`; a mechanism is named by its nodes and sets.
    """
    rigid = model.rigid_modes
    try:
        return normal_modes(stiffness, mass, elastic + rigid.shape[1], rigid, like)
    except MechanismError as error:
        raise ModelError(f"the model is a mechanism: {_named(model, error.shape)}") from None


def _named(model: Model, shape: FloatArray) -> str:
    """What moves without resistance, against what most nodes do."""
    motion, nodes = model.everywhere(shape[:, None])[:, :3, 0], model.mesh.nodes
    rigid, moves = rigid_motions(nodes)[:, :3], []
    near = min(_NEIGHBOURS, len(nodes) // 4 + 1)
    _, groups = scipy.spatial.cKDTree(nodes).query(nodes[:: -(-len(nodes) // _GROUPS)], [*range(1, near + 1)])
    for group in groups:
        turns, *_ = np.linalg.lstsq(rigid[group].reshape(-1, 6), motion[group].ravel(), rcond=None)
        size = np.linalg.norm(motion - rigid @ turns, axis=1)
        moves.append((int(np.sum(size > _STILL * size.max())), size))
    count, size = min(moves, key=lambda each: each[0])
    moving = np.flatnonzero(size > _STILL * size.max())
    sets = dict.fromkeys(block.set for block in model.mesh.blocks if np.isin(block.nodes, moving).any(axis=1).any())
    most = ", ".join(f"{x:.4g}" for x in nodes[np.argmax(size)])
    return (
        f"nothing resists a motion of {count} of {len(nodes)} nodes, of {', '.join(sets)}, the largest at ({most}) m. "
        "Join them to the rest, or hold them"
    )
