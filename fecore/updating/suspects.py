"""What may be added to a campaign's body to explain its frequencies, and whether a support gives
way.

Whether a support gives way that nobody stated to be soft, by the frequencies and the shapes
together.

With modes of eigenvalues Λ, and a motion r of the body as its support gives way by a compliance a,
where κ is how stiff other supports make that, the altered modes are those of diag(Λ, κ + 1/a) and
of the inertia that the modes and r share. A soft root may look like softer material, which shapes
contradict: they move where it holds. So the evidence of a compliance is that of the frequencies,
with the constants and the discrepancy integrated out (`additions`), times that of the shapes
(`of_shapes`).

What may be added to a campaign's body to explain its frequencies: where, and of what size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from fecore.arrays import BoolArray, FloatArray, IntArray
from fecore.body.locate import evenly_spread
from fecore.body.model import Model
from fecore.body.specimen import EDGE_ROUNDING
from fecore.body.supports import DISPLACEMENTS, Support, rigid_motions
from fecore.correlation import Pairing, most_alike
from fecore.modes import MeasuredModes
from fecore.normal import Z_95
from fecore.quantities import CLAMP
from fecore.updating.additions import (
    MASS,
    TYPICAL,
    Addition,
    AdditionScreening,
    AlteredForward,
    Data,
)
from fecore.updating.inputs import TOLERANCES, UNSTATED_SENSOR
from fecore.updating.posterior import DISCREPANCY_DOF, SHAPE_DISCREPANCY, LinearProblem, Mixture
from fecore.updating.state import ForwardState, real_shape

_FIRM = 1e-15  # of the largest 1/λ, below which a mode is that of a support that does not give way
ABOVE = 12  # modes above the last paired one that altered ones are made of
# compliances solved for, over usual ones
_SIZES = np.exp(np.linspace(np.log(0.1), np.log(400.0), 16))
_FINE = np.exp(np.linspace(np.log(0.1), np.log(400.0), 200))  # and between


def of_shapes(probability: FloatArray, alike: FloatArray) -> FloatArray:
    """(…) logarithm of the evidence of (…, n) MACs of modes with their partners, which are modes by
    (n,) probabilities.

    What a model misses of a shape is smooth, so each mode counts for one number, 1 - MAC, whatever
    its points, of a variance that has the prior of a discrepancy.
    """
    off = DISCREPANCY_DOF * SHAPE_DISCREPANCY**2 + (1 - alike) @ probability
    return np.asarray(-(DISCREPANCY_DOF + probability.sum()) / 2 * np.log(off))


def likeness(pairing: Pairing) -> FloatArray:
    """(n,) MAC of the measured modes with their partners, or with the likest where they have
    none.
    """
    assert pairing.mac is not None, "shapes are compared"
    alike = np.nan_to_num(pairing.mac).max(axis=1)
    for row, column in pairing.pairs:
        alike[row] = pairing.mac[row, column]
    return np.asarray(alike)


@dataclass(frozen=True)
class SupportEffect:
    """Supports that give way in some of Q motions, each by a compliance."""

    value: FloatArray  # (N,) eigenvalues of the body
    # inertia, stiffness: (N + Q, N + Q) of the modes and the motions, and (Q, Q) by which other
    # supports resist these
    inertia: FloatArray
    stiffness: FloatArray
    seen: FloatArray  # (N + Q, p) what the measured rows see of both

    @classmethod
    def of(cls, state: ForwardState, additions: Sequence[Addition]) -> SupportEffect:
        """Of a solved body that nothing lets move as a whole."""
        model, forward, count = state.forward.specimen.model, state.forward, len(additions)
        motions = np.vstack([each.motion for each in additions])
        stiffness: FloatArray = np.zeros((count, count))
        if any(each.stopped is not None for each in additions):
            motions, stiffness = _resisted(state, additions)
        both = np.vstack([state.full_shapes.T, motions])
        images = (model.mass.at(state.coefficients.mass[: len(model.mass.names)]) @ motions.T).T
        inertia = np.eye(len(both))
        inertia[-count:] = images @ both.T
        inertia[:, -count:] = inertia[-count:].T
        seen = np.vstack([state.shapes, (forward.observation @ motions.T).T])
        return cls(state.modes.eigenvalue, inertia, stiffness, seen)

    @property
    def moved(self) -> FloatArray:
        """(Q, N) inertia that the motions share with the modes."""
        return self.inertia[self.value.size :, : self.value.size]

    def first(self, count: int) -> SupportEffect:
        """That in the lowest modes alone."""
        kept = np.r_[: min(count, self.value.size), self.value.size : len(self.inertia)]
        return replace(
            self,
            value=self.value[:count],
            inertia=self.inertia[np.ix_(kept, kept)],
            seen=self.seen[kept],
        )

    def at(self, size: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(N, P) changes of ln f, and (P, N, p) shapes at the measured rows, by (P, Q) compliances,
        m/N or rad/N·m.
        """
        count = self.value.size
        # As springs and other supports together resist the motions: (C⁻¹ + κ)⁻¹ = R Rᵀ.
        inner = np.sqrt(size)
        resisted = np.eye(size.shape[1]) + inner[:, :, None] * self.stiffness * inner[:, None]
        root = np.zeros((len(size), *self.inertia.shape))
        root[:, range(count), range(count)] = self.value**-0.5
        root[:, count:, count:] = inner[:, :, None] * np.linalg.inv(
            np.linalg.cholesky(resisted)
        ).transpose(0, 2, 1)
        inverse, vectors = np.linalg.eigh(root.transpose(0, 2, 1) @ self.inertia @ root)
        inverse = np.maximum(inverse, _FIRM * inverse.max())
        order = np.array([most_alike(each[:count]) for each in vectors])
        inverse = np.take_along_axis(inverse, order, axis=1)
        shapes = (
            np.take_along_axis(root @ vectors, order[:, None], axis=2).transpose(0, 2, 1)
            @ self.seen
        )
        return (-np.log(inverse * self.value) / 2).T, shapes


def _resisted(state: ForwardState, additions: Sequence[Addition]) -> tuple[FloatArray, FloatArray]:
    """(Q, dofs) motions of a body as one of its supports gives way, at rest, and (Q, Q) how other
    supports resist them.
    """
    system = AlteredForward.of(state.forward, additions).altered
    count = len(additions)
    own = len(system.stiffness) - len(additions) - len(state.forward.specimen.springs)
    terms = np.delete(system.stiffness, slice(own, own + count), axis=0)
    K = np.tensordot(state.coefficients.stiffness, terms, 1)
    within = np.vstack([-np.linalg.solve(K[:-count, :-count], K[:-count, -count:]), np.eye(count)])
    scale = np.sqrt(
        [each[-count:].max() for each in np.abs(system.stiffness[own : own + count]).max(axis=1)]
    )
    within = within / scale
    return (system.basis @ within).T, within.T @ K @ within


@dataclass(frozen=True)
class SupportCompliance:
    """How much likelier the data are where supports give way, in any of W ways by S sizes: along or
    about one axis, or all.
    """

    # (W, Q) compliances along and about each axis, usual ones or 0, m/N or rad/N·m
    ways: FloatArray
    change: FloatArray  # (n, W, S) of all ln f
    likelier: FloatArray  # (W, S) logarithms

    @classmethod
    def of(
        cls,
        state: ForwardState,
        supports: Sequence[Addition],
        at: slice,
        pairing: Pairing,
        measured: tuple[MeasuredModes, FloatArray],
        problem: LinearProblem,
        posterior: tuple[Mixture, FloatArray],
    ) -> SupportCompliance:
        """Those of one body at an estimate.

        Args:
            state: the solved body.
            supports: as of `suspects.supports`.
            at: the frequencies of the body among all.
            pairing: its measured modes with the model's.
            measured: these, and the probability of each to be one.
            problem: at the estimate.
            posterior: about it, as of `screened`.
        """
        rows, columns = (list(side) for side in zip(*pairing.pairs, strict=True))
        usual = np.array([each.usual for each in supports])
        ways = np.vstack([np.diag(usual), usual] if len(supports) > 1 else [usual])
        effect = SupportEffect.of(state, supports).first(max(columns) + 1 + ABOVE)
        count = len(ways)
        solved = [effect.at(ways * size) for size in _SIZES]
        grids = np.log(_SIZES), np.log(_FINE)
        change = np.zeros((problem.residual.size, count, _FINE.size))
        change[at] = _between(*grids, np.array([own[columns] for own, _ in solved])).transpose(
            1, 2, 0
        )
        data = Data.of(problem, *posterior)
        log = data.likeliest(change.reshape(len(change), -1)).reshape(count, -1)
        if pairing.mac is not None:
            modes, probability = measured
            own = np.array([real_shape(modes, row) for row in rows])
            # an array (steps, P, n)
            alike = np.array(
                [_alike(own, shapes[:, columns, : own.shape[1]]) for _, shapes in solved]
            )
            every = np.tile(likeness(pairing), (count, _FINE.size, 1))
            every[..., rows] = _between(*grids, alike).transpose(1, 0, 2)
            log = log + of_shapes(probability, every) - of_shapes(probability, likeness(pairing))
        return cls(ways, change, log)

    def screened(self, sizes: Sequence[float]) -> AdditionScreening:
        """Compared with supports that do not give way, of sizes that are half-normal of so many
        usual ones each.
        """
        sigma = np.array(sizes)[:, None]
        density = np.sqrt(2 / np.pi) * _FINE / sigma * np.exp(-((_FINE / sigma) ** 2) / 2)
        step = float(np.log(_FINE[1] / _FINE[0]))
        prior = np.log(np.maximum(density.mean(axis=0) * step / len(self.ways), 1e-300))
        weight = prior + self.likelier
        evidence = float(scipy.special.logsumexp(weight))
        share = np.exp(weight - evidence)
        here = share.sum(axis=1) @ ((self.ways > 0) / np.sum(self.ways > 0, axis=1)[:, None])
        size = (share @ _FINE) @ self.ways
        best = int(np.argmax(here))
        square = float((share @ _FINE**2) @ self.ways[:, best] ** 2)
        return AdditionScreening(
            evidence=evidence,
            share=here,
            size=size,
            mean=float(size[best]),
            sd=float(np.sqrt(max(square - size[best] ** 2, 0.0))),
            covariance=np.einsum("nps,ps,mps->nm", self.change, share, self.change),
        )

    def left_open(self) -> tuple[int, float, FloatArray]:
        """How far the support may give way in the way that lowers the lowest frequency most, in 95
        % of its likelihood.

        Returns:
            The axis, its compliance, and (n,) the change of all ln f by that.
        """
        single = len(self.ways[0])
        lowest = int(np.flatnonzero(self.change[:, 0, -1])[0])
        axis = int(np.argmin(self.change[lowest, :single, 0]))
        likely = self.likelier[axis] > max(float(self.likelier[axis].max()), 0.0) - Z_95**2 / 2
        most = int(np.flatnonzero(likely)[-1]) if likely.any() else 0
        return axis, float(self.ways[axis, axis] * _FINE[most]), self.change[:, axis, most]


def _alike(measured: FloatArray, shapes: FloatArray) -> FloatArray:
    """(…, n) MAC of (n, p) real shapes with (…, n, p)."""
    across = np.sum(measured * shapes, axis=-1) ** 2
    return np.asarray(
        across / (np.sum(measured**2, axis=-1) * np.maximum(np.sum(shapes**2, axis=-1), 1e-300))
    )


def _between(known: FloatArray, at: FloatArray, values: FloatArray) -> FloatArray:
    return np.asarray(scipy.interpolate.pchip_interpolate(known, values, at))


_SITES = 200  # nodes at which a mass or a foot is tried, at most
_DIGITS = 9  # of a place in m
_MOVED = 0.01  # of the largest work of a mode on a support, from which it is one that moves it
_TOLERANCE = TOLERANCES[CLAMP][0]


def masses(state: ForwardState) -> list[Addition]:
    """A mass at each of some nodes, evenly spread."""
    model, nodes = state.forward.specimen.model, sites(state)
    median = TYPICAL * UNSTATED_SENSOR
    return [
        Addition("mass", MASS, "kg", tuple(place), median, motion)
        for place, motion in zip(
            model.mesh.nodes[nodes].tolist(), _each_moving(model, nodes), strict=True
        )
    ]


def feet(state: ForwardState, highest: int) -> list[Addition]:
    """A spring to the ground along each end of the body, and at each of some nodes.

    The median is that which raises the most affected one of the elastic modes up to `highest` by a
    few times what a careful laboratory's clamp lowers it.
    """
    model, single = state.forward.specimen.model, sites(state)
    nodes, additions = model.mesh.nodes, []
    for group in _ends(model):
        motion = _moving(model, group, np.sqrt(_shares(nodes[group])))
        place = tuple(nodes[group].mean(axis=0).tolist())
        additions.append(Addition("foot", "foot", "N/m", place, 1.0, motion, along_an_end=True))
    additions += [
        Addition("foot", "foot", "N/m", tuple(place), 1.0, motion)
        for place, motion in zip(nodes[single].tolist(), _each_moving(model, single), strict=True)
    ]
    shapes = state.every_shape[:, state.modes.rigid :][:, : highest + 1]
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
    none of a body that moves, or whose equations hold it too.
    """
    body, model = state.forward.specimen, state.forward.specimen.model
    structure = body.as_structure
    if structure is None or state.modes.rigid or not model.is_one_body:
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


def sites(state: ForwardState) -> IntArray:
    """Some free nodes, evenly spread."""
    model = state.forward.specimen.model
    nodes = np.flatnonzero(model.free[:, [dof < 3 for dof in model.dofs]].any(axis=1))
    return np.asarray(nodes[evenly_spread(model.mesh.nodes[nodes], _SITES)])


def _ends(model: Model) -> list[IntArray]:
    """Free nodes at both ends of the body along each axis."""
    nodes, free = model.mesh.nodes, model.free[:, [dof < 3 for dof in model.dofs]].any(axis=1)
    size, ends = float(np.ptp(nodes, axis=0).max()), []
    for x in nodes.T:
        if np.ptp(x) > EDGE_ROUNDING * size:
            ends += [
                np.flatnonzero(free & (np.abs(x - end) < EDGE_ROUNDING * size))
                for end in (x.min(), x.max())
            ]
    return [each for each in ends if each.size > 1]


def _shares(places: FloatArray) -> FloatArray:
    """(n,) share of each of (n, 3) nodes in a foot under all: on a line by the length that is
    nearest to it, else alike.
    """
    offsets = places - places.mean(axis=0)
    _, sizes, axes = np.linalg.svd(offsets, full_matrices=False)
    if len(places) < 3 or sizes[1] > EDGE_ROUNDING * sizes[0]:
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


def _each_moving(model: Model, nodes: IntArray) -> list[scipy.sparse.csr_array]:
    """The same of each of (n,) nodes: one selection of all takes a tenth of one for each."""
    selected, dofs = _moving(model, nodes, np.ones(nodes.size)), model.unfolded.shape[1]
    rows = np.sum(np.diff(model.unfolded.indptr).reshape(-1, 6)[nodes, :3] > 0, axis=1)
    motions, last = [], np.cumsum(rows)
    for first, after in zip((last - rows).tolist(), last.tolist(), strict=True):
        at = selected.indptr[first : after + 1]
        entries = slice(int(at[0]), int(at[-1]))
        own = selected.data[entries], selected.indices[entries], at - at[0]
        motions.append(scipy.sparse.csr_array(own, shape=(after - first, dofs)))
    return motions
