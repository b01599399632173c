"""What may be added to a campaign's body to explain its frequencies: where, and of what size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from fecore.arrays import FloatArray, IntArray
from fecore.body.locate import evenly_spread
from fecore.body.model import Model
from fecore.body.named import OfStructure
from fecore.body.structure import Structure
from fecore.body.supports import CLAMP, DISPLACEMENTS
from fecore.updating.additions import MASS, TYPICAL, Addition
from fecore.updating.inputs import TOLERANCES, UNSTATED_SENSOR
from fecore.updating.state import ForwardState

_SITES = 200  # nodes at which a mass or a foot is tried, at most
_DIGITS = 9  # of a place in m
_EDGE = 1e-6  # of the body's size: nodes so near to its end lie on it
_MOVED = 0.01  # of the largest work of a mode on a support, from which it is one that moves it
_TOLERANCE = TOLERANCES[CLAMP][0]


def masses(state: ForwardState) -> list[Addition]:
    """A mass at each of some nodes, evenly spread."""
    model, nodes = state.forward.specimen.model, _sites(state)
    found = []
    for node in nodes:
        place = tuple(model.mesh.nodes[node].tolist())
        found.append(
            Addition("mass", MASS, "kg", place, TYPICAL * UNSTATED_SENSOR, _moving(model, node))
        )
    return found


def feet(state: ForwardState, highest: int) -> list[Addition]:
    """A spring to the ground along each end of the body, and at each of some nodes.

    The median is that which raises the most affected one of the elastic modes up to `highest` by a
    few times what a careful laboratory's clamp lowers it.
    """
    model, found = state.forward.specimen.model, []
    nodes = model.mesh.nodes
    for group in [*_ends(model), *(np.array([node]) for node in _sites(state))]:
        root = np.sqrt(_shares(nodes[group]))
        motion = scipy.sparse.vstack(
            [share * _moving(model, node) for share, node in zip(root, group, strict=True)]
        )
        place = tuple(nodes[group].mean(axis=0).tolist())
        found.append(Addition("foot", "foot", "N/m", place, 1.0, motion, len(group) > 1))
    shapes = _shapes(state)[:, state.modes.rigid :][:, : highest + 1]
    value = state.modes.eigenvalue[state.modes.rigid :][: highest + 1]
    softest = [float(np.max(np.sum((each.motion @ shapes) ** 2, axis=0) / value)) for each in found]
    return [
        replace(each, median=TYPICAL * 4 * _TOLERANCE / most)
        for each, most in zip(found, softest, strict=True)
        if most > 0
    ]


def supports(state: ForwardState, highest: int) -> list[Addition]:
    """The body's one support, giving way along or about each axis in which it holds the body; none
    of a body otherwise held.
    """
    body, model = state.forward.specimen, state.forward.specimen.model
    inner = getattr(body, "body", body)
    structure = inner.structure if isinstance(inner, OfStructure) else inner
    if not isinstance(structure, Structure) or len(structure.supports) != 1 or state.modes.rigid:
        return []
    (support,) = structure.supports
    places = model.mesh.nodes[model.mesh.select(support.where)]
    centre = np.round(places.mean(axis=0), _DIGITS) + 0.0
    motions = model.motions.T.copy()
    motions[3:] += _about(centre - model.mesh.nodes.mean(axis=0), motions[:3])
    shapes = _shapes(state)[:, : highest + 1]
    value = state.modes.eigenvalue[: highest + 1]
    mass = model.mass.at(state.coefficients.mass[: len(model.mass.names)])
    found = []
    for dof in support.dofs:
        motion = motions[dof]
        if not np.any(motion):
            continue
        reaction = value * (motion @ (mass @ shapes)) ** 2
        usual = float(np.median(reaction[reaction >= _MOVED * reaction.max()]))
        median = usual / (4 * _TOLERANCE) / TYPICAL
        unit = "N/m" if dof < 3 else "N·m/rad"
        name = f"support_{DISPLACEMENTS[dof]}"
        found.append(Addition("support", name, unit, tuple(centre.tolist()), median, motion[None]))
    largest = max((each.median for each in found), default=0.0)
    return [each for each in found if each.median > 1e-12 * largest]


def _about(arm: FloatArray, shifts: FloatArray) -> FloatArray:
    """(3, dofs) what turns about x, y, z through a point that lies off the nodes' centre by an arm
    have beside those about it.

    θ × (x - c) = θ × (x - m) - θ × (c - m).
    """
    return np.asarray(-np.cross(np.eye(3), arm) @ shifts)


def _shapes(state: ForwardState) -> FloatArray:
    return state.modes.shapes if state.basis is None else state.basis @ state.modes.shapes


def _sites(state: ForwardState) -> IntArray:
    """Some free nodes, evenly spread."""
    model = state.forward.specimen.model
    nodes = np.flatnonzero(model.free[:, [dof < 3 for dof in model.dofs]].any(axis=1))
    return np.asarray(nodes[evenly_spread(model.mesh.nodes[nodes], _SITES)])


def _ends(model: Model) -> list[IntArray]:
    """Free nodes at both ends of the body along each axis."""
    nodes, free = model.mesh.nodes, model.free[:, [dof < 3 for dof in model.dofs]].any(axis=1)
    size, found = float(np.ptp(nodes, axis=0).max()), []
    for x in nodes.T:
        if np.ptp(x) > _EDGE * size:
            found += [
                np.flatnonzero(free & (np.abs(x - end) < _EDGE * size))
                for end in (x.min(), x.max())
            ]
    return [each for each in found if each.size > 1]


def _shares(places: FloatArray) -> FloatArray:
    """(n,) share of each of (n, 3) nodes in a foot under all: on a line by the length that is
    nearest to it, else alike.
    """
    away = places - places.mean(axis=0)
    _, sizes, axes = np.linalg.svd(away, full_matrices=False)
    if len(places) < 3 or sizes[1] > _EDGE * sizes[0]:
        return np.full(len(places), 1 / len(places))
    along = away @ axes[0]
    order = np.argsort(along)
    share = np.empty(len(places))
    middle = (along[order][1:] + along[order][:-1]) / 2
    share[order] = np.diff(np.concatenate([along[order][:1], middle, along[order][-1:]]))
    return np.asarray(share / share.sum())


def _moving(model: Model, node: int) -> scipy.sparse.csr_array:
    """(q, dofs) displacement of a node along those of x, y and z in which it moves."""
    rows = model.unfolded[6 * int(node) : 6 * int(node) + 3]
    return rows[np.diff(rows.indptr) > 0]
