"""Modes of a body, with a mechanism named by what moves."""

from __future__ import annotations

import numpy as np
import scipy

from fecore.arrays import FloatArray
from fecore.body.model import Model
from fecore.body.supports import rigid_motions
from fecore.dynamics.eigen import MechanismError, NormalModes, normal_modes
from fecore.dynamics.factor import Factor, factorise
from fecore.errors import ModelError

_GROUPS, _NEIGHBOURS = 40, 20  # of nodes, whose rigid motions are tried as that of most nodes
_NOTHING = 1e-11  # share of what a motion's dofs alone would cost: it costs nothing
_TOO_FAR = 1e8  # ratio of stiffnesses from where that of a slender body loses its digits
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
    except ModelError as error:
        shape = (
            error.shape
            if isinstance(error, MechanismError)
            else _softest(stiffness, rigid.shape[1])
        )
        if shape is None:
            raise
        least, most = _range(stiffness)
        if most > _TOO_FAR * least:
            raise ModelError(
                f"stiffnesses from {least:.1g} to {most:.1g} N/m stand side by side, so that"
                " nothing is left of the softer in 16 digits. Have the stiffest springs no more"
                " than 1e7 times what they join, or join it rigidly"
            ) from None
        raise ModelError(f"the model is a mechanism: {_named(model, shape)}") from None


def _range(stiffness: scipy.sparse.csc_array) -> tuple[float, float]:
    """What most dofs have on the diagonal, and the largest there."""
    diagonal = stiffness.diagonal()
    return float(np.median(diagonal)), float(diagonal.max(initial=0.0))


def _softest(stiffness: scipy.sparse.csc_array, rigid: int) -> FloatArray | None:
    """A motion that K resists nothing of, by inverse iteration; None where there is none, or rigid
    motions are among these.
    """
    diagonal = stiffness.diagonal()
    if diagonal.min() == 0:
        return np.asarray(np.eye(1, diagonal.size, diagonal.argmin())[0])
    if rigid or diagonal.min() < 0:
        return None
    scale = 1 / np.sqrt(diagonal)
    scaled = scipy.sparse.csc_array(stiffness * scale[:, None] * scale)
    try:
        factor = factorise(
            scipy.sparse.csc_array(scaled + _NOTHING * scipy.sparse.eye_array(diagonal.size))
        )
    except ModelError:
        return None
    shape = np.random.default_rng(0).standard_normal(diagonal.size)
    for _ in range(3):
        shape = factor.solve(shape / np.linalg.norm(shape))
    shape /= np.linalg.norm(shape)
    return np.asarray(scale * shape) if shape @ (scaled @ shape) <= _NOTHING else None


def _named(model: Model, shape: FloatArray) -> str:
    """What moves without resistance, against what most nodes do."""
    motion, nodes = model.everywhere(shape[:, None])[..., 0], model.mesh.nodes
    turns = np.linalg.norm(motion[:, 3:], axis=1)
    if np.abs(motion[:, :3]).max() <= _NOTHING * turns.max() * np.linalg.norm(
        np.ptp(nodes, axis=0)
    ):
        return _unresisted_nodes("a turn", turns, model)
    motion, rigid, candidates = motion[:, :3], rigid_motions(nodes)[:, :3], []
    near = min(_NEIGHBOURS, len(nodes) // 4 + 1)
    _, groups = scipy.spatial.cKDTree(nodes).query(
        nodes[:: -(-len(nodes) // _GROUPS)], [*range(1, near + 1)]
    )
    for group in groups:
        whole, *_ = np.linalg.lstsq(rigid[group].reshape(-1, 6), motion[group].ravel(), rcond=None)
        size = np.linalg.norm(motion - rigid @ whole, axis=1)
        candidates.append((int(np.sum(size > _STILL * size.max())), size))
    return _unresisted_nodes("a motion", min(candidates, key=lambda each: each[0])[1], model)


def _unresisted_nodes(what: str, size: FloatArray, model: Model) -> str:
    """Which nodes move, by the (nodes,) sizes of their motions."""
    nodes, moving = model.mesh.nodes, np.flatnonzero(size > _STILL * size.max())
    sets = dict.fromkeys(
        block.set for block in model.mesh.blocks if np.isin(block.nodes, moving).any(axis=1).any()
    )
    most = ", ".join(f"{x:.4g}" for x in nodes[np.argmax(size)])
    return (
        f"nothing resists {what} of {moving.size} of {len(nodes)} nodes, of"
        f" {', '.join(sets) or 'no set of elements'}, the largest at ({most}) m. Join them to the"
        " rest, or hold them"
    )
