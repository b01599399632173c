"""What may be added to a campaign's body to explain its frequencies: where, and of what size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from fecore.arrays import BoolArray, FloatArray, IntArray
from fecore.body.locate import evenly_spread
from fecore.body.model import Model
from fecore.body.supports import DISPLACEMENTS, Support, rigid_motions
from fecore.quantities import CLAMP
from fecore.updating.additions import MASS, TYPICAL, Addition
from fecore.updating.inputs import TOLERANCES, UNSTATED_SENSOR
from fecore.updating.state import ForwardState
from fecore.updating.support_compliance import SupportEffect

_SITES = 200  # nodes at which a mass or a foot is tried, at most
_DIGITS = 9  # of a place in m
_EDGE = 1e-6  # of the body's size: nodes so near to its end lie on it
_MOVED = 0.01  # of the largest work of a mode on a support, from which it is one that moves it
_TOLERANCE = TOLERANCES[CLAMP][0]


def masses(state: ForwardState) -> list[Addition]:
    """A mass at each of some nodes, evenly spread."""
    model, nodes = state.forward.specimen.model, _sites(state)
    additions = []
    for node in nodes:
        place = tuple(model.mesh.nodes[node].tolist())
        motion = _moving(model, np.array([node]), np.ones(1))
        additions.append(Addition("mass", MASS, "kg", place, TYPICAL * UNSTATED_SENSOR, motion))
    return additions


def feet(state: ForwardState, highest: int) -> list[Addition]:
    """A spring to the ground along each end of the body, and at each of some nodes.

    The median is that which raises the most affected one of the elastic modes up to `highest` by a
    few times what a careful laboratory's clamp lowers it.
    """
    model, additions = state.forward.specimen.model, []
    nodes = model.mesh.nodes
    for group in [*_ends(model), *(np.array([node]) for node in _sites(state))]:
        motion = _moving(model, group, np.sqrt(_shares(nodes[group])))
        place = tuple(nodes[group].mean(axis=0).tolist())
        additions.append(Addition("foot", "foot", "N/m", place, 1.0, motion, len(group) > 1))
    shapes = _shapes(state)[:, state.modes.rigid :][:, : highest + 1]
    value = state.modes.eigenvalue[state.modes.rigid :][: highest + 1]
    softest = [
        float(np.max(np.sum((each.motion @ shapes) ** 2, axis=0) / value)) for each in additions
    ]
    return [
        replace(each, median=TYPICAL * 4 * _TOLERANCE / most)
        for each, most in zip(additions, softest, strict=True)
        if most > 0
    ]


def supports(state: ForwardState, highest: int) -> list[Addition]:
    """The body's supports, each giving way along or about each axis in which it holds the body;
    none of a body that moves.
    """
    body, model = state.forward.specimen, state.forward.specimen.model
    structure = body.as_structure
    if structure is None or state.modes.rigid:
        return []
    several = len(structure.supports) > 1
    held = np.zeros((len(structure.supports), *model.free.shape), dtype=bool)
    for own, support in zip(held, structure.supports, strict=True):
        columns = [model.dofs.index(dof) for dof in support.dofs if dof in model.dofs]
        own[np.ix_(model.mesh.select(support.where), np.array(columns, dtype=np.int64))] = True
    additions = []
    for number, (own, support) in enumerate(zip(held, structure.supports, strict=True), start=1):
        name = f"support_{number}" if several else "support"
        additions += _of_support(model, support, held.any(axis=0) & ~own, name)
    if not additions:
        return []
    effect = SupportEffect.of(state, additions)
    value = state.modes.eigenvalue[: highest + 1]
    reaction = value * effect.moved[:, : highest + 1] ** 2
    usual = [float(np.median(each[each >= _MOVED * each.max()])) for each in reaction]
    largest = max(usual)
    return [
        replace(each, median=most / (4 * _TOLERANCE) / TYPICAL)
        for each, most in zip(additions, usual, strict=True)
        if most > 1e-12 * largest
    ]


def _of_support(model: Model, support: Support, others: BoolArray, name: str) -> list[Addition]:
    """A support that gives way along or about each of its axes, where (nodes, dofs of a node) are
    held by others.
    """
    places, nodes = model.mesh.nodes, model.mesh.select(support.where)
    centre = np.round(places[nodes].mean(axis=0), _DIGITS) + 0.0
    motions = rigid_motions(places, model.links)[:, list(model.dofs)]
    # θ × (x - c) = θ × (x - m) - θ × (c - m), m the nodes' centre
    motions[..., 3:] -= motions[..., :3] @ np.cross(np.eye(3), centre - places.mean(axis=0)).T
    additions = []
    for dof in support.dofs:
        motion, stopped = motions[..., dof], np.where(others, -motions[..., dof], 0.0)
        if np.any(motion[model.free]):
            unit = "N/m" if dof < 3 else "N·m/rad"
            names = f"{name}_{DISPLACEMENTS[dof]}", unit, tuple(centre.tolist())
            held = stopped if stopped.any() else None
            additions.append(
                Addition("support", *names, 1.0, motion[model.free][None], stopped=held)
            )
    return additions


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
    size, ends = float(np.ptp(nodes, axis=0).max()), []
    for x in nodes.T:
        if np.ptp(x) > _EDGE * size:
            ends += [
                np.flatnonzero(free & (np.abs(x - end) < _EDGE * size))
                for end in (x.min(), x.max())
            ]
    return [each for each in ends if each.size > 1]


def _shares(places: FloatArray) -> FloatArray:
    """(n,) share of each of (n, 3) nodes in a foot under all: on a line by the length that is
    nearest to it, else alike.
    """
    offsets = places - places.mean(axis=0)
    _, sizes, axes = np.linalg.svd(offsets, full_matrices=False)
    if len(places) < 3 or sizes[1] > _EDGE * sizes[0]:
        return np.full(len(places), 1 / len(places))
    along = offsets @ axes[0]
    order = np.argsort(along)
    share = np.empty(len(places))
    middle = (along[order][1:] + along[order][:-1]) / 2
    share[order] = np.diff(np.concatenate([along[order][:1], middle, along[order][-1:]]))
    return np.asarray(share / share.sum())


def _moving(model: Model, nodes: IntArray, weights: FloatArray) -> scipy.sparse.csr_array:
    """(q, dofs) displacement of (n,) nodes, times (n,) weights, along those of x, y and z in which
    they move.
    """
    rows = model.unfolded[(6 * nodes[:, None] + np.arange(3)).ravel()]
    rows.data *= np.repeat(np.repeat(weights, 3), np.diff(rows.indptr))
    return rows[np.diff(rows.indptr) > 0]
