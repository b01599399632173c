"""A stretch of a body, along its longest side, in which one of its sets or all have lost stiffness.

A loss of stiffness by a share a in a stretch that has the part E of the modes' stiffness, E = ΦᵀK_stretch Φ, gives the
frequencies and the shapes of Λ - aE: it lowers a mode by its share of strain energy there, and turns it towards others by
their mutual energies. Constants soak up most of the first, and hardly any of the second, which breaks the body's symmetry.

Residuals r of ln f, and of shapes at the measured points, each at its best scale, over their standard deviation, are linear in
the step z of the constants and in turns ω of close modes, by which the model's discrepancy s₀ in stiffness, alike in all
directions, mixes them: ω ~ N(0, 2s₀²λ_jλ_k/(λ_j - λ_k)²). With d the change of the model's frequencies and shapes by a loss
the data are likelier than without by

    ln B = dᵀW(r - Sz) - ½ dᵀ(W - WSH⁻¹SᵀW)d,    H = SᵀWS + P,

W the inverse of the noise: of measurement, of inputs that are believed to be nothing, of the discrepancy s, and of the shapes'
own k σ. The error of the model of joints is left to the constants, which absorb it but for what s is. Of all sets, stretches
(each length as likely) and losses, and over the posterior of s and k where nothing is damaged, B is the mean, so that without
damage E[B] = 1, and P(B ≥ 1/p) ≤ p (as in `added_mass`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy

from fecore.arrays import FloatArray
from fecore.body.matrices import MatrixBody
from fecore.modal import turn_real
from fecore.updating.elastic import shape_residual
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.posterior import (
    DISCREPANCY,
    SHAPE_DISCREPANCY,
    LinearProblem,
    grid_of_discrepancies,
    log_prior_of_scale,
)
from fecore.updating.state import ForwardState

_PARTS, _LONGEST = 20, 0.5  # of the body's longest side; share of it that a stretch takes at most
_LOSSES = np.array([0.02, 0.05, 0.1, 0.17, 0.25, 0.35, 0.45, 0.55, 0.7])  # solved for
_FINE = np.linspace(0.02, 0.7, 69)  # each as likely; what is between is interpolated
_COARSE = 4  # of the grid of discrepancies, one in so many
_SHAPES = np.array([0.5, 1.0, 2.0, 4.0, 8.0])  # k: a shape's standard deviation over the usual one
_TURNS = 0.5  # of a shape's standard deviation, from which a turn of two modes is an unknown
_FREE = 10.0  # rad: the turn of modes as close as can be
_SETS, _SLIGHT = 6, 0.02  # sets at most, those with most energy; share of every mode's energy that is not looked at
_ABOVE = 12  # elastic modes above the last paired one that shapes are made of
_SELDOM = 1e-6  # probability over the greatest that does not count
_COUNTS = 12.0  # log weight by which a pair of s and k may be behind the likeliest and still count


@dataclass(frozen=True)
class Stretch:
    """Some sets of a body between two places along an axis."""

    sets: tuple[str, ...]
    whole: bool  # whether these are all sets
    axis: int  # 0, 1, 2 for x, y, z
    # begin, end: m
    begin: float
    end: float


@dataclass(frozen=True)
class LostStiffness:
    """What the modes say of a loss of stiffness in any stretch of a body."""

    # by_frequencies, evidence: ln B of the frequencies alone, and with the shapes
    by_frequencies: float
    evidence: float
    likeliest: Stretch
    # begin, end: least and greatest place along the axis that the likeliest sets' stretch reaches to with 95 %, m
    begin: float
    end: float
    # factor, factor_sd: of the stiffness that is left
    factor: float
    factor_sd: float
    # mean, covariance: (n,) and (n, n) of the change of all ln f by the loss
    mean: FloatArray
    covariance: FloatArray

    @property
    def in_words(self) -> tuple[str, str]:
        """Of which sets, and between which places."""
        stretch, axis = self.likeliest, "xyz"[self.likeliest.axis]
        of = "all" if stretch.whole else ", ".join(stretch.sets)
        begin, end, least, most = (f"{1e3 * each:.0f}" for each in (stretch.begin, stretch.end, self.begin, self.end))
        return of, f"{axis} = {begin} and {end} mm (at most {least} to {most})"


@dataclass(frozen=True)
class Losses:
    """What losses of stiffness in P stretches do to the paired modes of a solved body, shapes at the measured points."""

    stretches: tuple[Stretch, ...]
    log_prior: FloatArray  # (P,)
    change: FloatArray  # (l, P, n) of ln f, by the losses solved for
    turned: FloatArray  # (l, P, n, m) share of the m elastic modes in each mode, itself 1

    @classmethod
    def of(cls, state: ForwardState, columns: Sequence[int]) -> Losses | None:
        """Those of a solved body; None of one that has no elements.

        Args:
            state: the body.
            columns: (n,) elastic modes that are paired.
        """
        if isinstance(state.forward.specimen, MatrixBody):
            return None
        m = min(state.frequency_hz.size, max(columns) + 1 + _ABOVE)
        sets, axis, lines, energy = _energies(state, m)
        first, last = np.triu_indices(_PARTS)
        kept = last - first < _LONGEST * _PARTS
        first, last = first[kept], last[kept]
        whole = np.concatenate([np.zeros_like(energy[:, :1]), np.cumsum(energy, axis=1)], axis=1)
        groups = [(k,) for k in range(len(sets))] + ([tuple(range(len(sets)))] if len(sets) > 1 else [])
        parts = np.concatenate([(whole[list(g)][:, last + 1] - whole[list(g)][:, first]).sum(axis=0) for g in groups])
        stretches = tuple(
            Stretch(tuple(sets[k] for k in g), len(g) == len(sets), axis, float(lines[a]), float(lines[b + 1]))
            for g in groups
            for a, b in zip(first, last, strict=True)
        )
        share = 1.0 / (last - first + 1)
        log_prior = np.tile(np.log(share / share.sum() / len(groups)), len(groups))
        value = state.modes.eigenvalue[state.modes.rigid :][:m]
        each = [_solved(value, loss * parts, list(columns)) for loss in _LOSSES]
        return cls(stretches, log_prior, *(np.array(some) for some in zip(*each, strict=True)))


def _solved(value: FloatArray, lost: FloatArray, columns: list[int]) -> tuple[FloatArray, FloatArray]:
    """(P, n) changes of ln f of some modes with (m,) eigenvalues, and (P, n, m) what they are made of, by (P, m, m) losses."""
    found, vectors = np.linalg.eigh(np.diag(value) - lost)
    found = np.maximum(found, 1e-3 * value[0])
    order = np.array([scipy.optimize.linear_sum_assignment(-(each**2))[1] for each in vectors])[:, columns]
    change = np.log(np.take_along_axis(found, order, axis=1) / value[columns]) / 2
    turned = np.take_along_axis(vectors, order[:, None], axis=2).transpose(0, 2, 1)
    return change, turned / turned[:, np.arange(len(columns)), columns][..., None]


def _energies(state: ForwardState, m: int) -> tuple[list[str], int, FloatArray, FloatArray]:
    """Sets, the longest axis, (F + 1,) lines between equal parts along it, and (sets, F, m, m) energies of elastic modes."""
    model, shapes = state.forward.specimen.model, state.full_shapes[:, :m]
    axis = int(np.argmax(np.ptp(model.mesh.nodes, axis=0)))
    x, K = model.mesh.nodes[:, axis], model.stiffness
    lines = np.linspace(x.min(), x.max(), _PARTS + 1)
    sets = list(model.mesh.sets)
    owner = [next((k for k, own in enumerate(sets) if name.startswith(f"{own}.")), -1) for name in K.names]
    energy, motion = np.zeros((len(sets), _PARTS, m, m)), K.everywhere(shapes)
    for group in (part for whole in K.groups for part in whole.parts(m)):
        own = owner[group.coefficients[0]]
        if own < 0:
            continue  # a spring
        C = np.tensordot(state.coefficients.stiffness[group.coefficients], group.terms, 1)
        share = np.repeat(_inside(x[group.nodes], lines), group.operators.shape[1], axis=1)
        strains = group.strains(motion)
        for part in np.flatnonzero(share.any(axis=1)):
            rows = np.flatnonzero(share[part])
            some = strains[:, rows] * np.sqrt(share[part, rows])[:, None]
            energy[own, part] += np.tensordot(some, np.tensordot(C, some, 1), ((0, 1), (0, 1)))
    most = (np.einsum("sfmm->sm", energy) / state.modes.eigenvalue[state.modes.rigid :][:m]).max(axis=1)
    kept = sorted(k for k in np.argsort(-most)[:_SETS] if most[k] > _SLIGHT)
    return [sets[k] for k in kept], axis, lines, energy[kept]


def _inside(x: FloatArray, lines: FloatArray) -> FloatArray:
    """(F, e) share of elements with nodes at (e, n) x that lies between neighbouring ones of (F + 1,) lines."""
    thin = 1e-9 * (lines[-1] - lines[0])
    low = np.clip(x.min(axis=1), lines[0], lines[-1] - thin)
    high = np.maximum(x.max(axis=1), low + thin)
    within = np.minimum(high, lines[1:, None]) - np.maximum(low, lines[:-1, None])
    return np.asarray(np.maximum(within, 0.0) / (high - low))


def lost_stiffness(
    elastic: ElasticResult, number: int, losses: Losses, problem: LinearProblem, *, with_shapes: bool = True
) -> LostStiffness:
    """Compare a loss of stiffness in any stretch of a campaign's body with none.

    Args:
        elastic: the update.
        number: of the campaign.
        losses: of its body.
        problem: at the estimate.
        with_shapes: look at the shapes too, where there are any.
    """
    at, (count, _, n) = elastic.rows[number], losses.change.shape
    change = np.zeros((count, len(losses.stretches), problem.residual.size))
    change[..., at] = losses.change
    data = _Data.of(elastic, number, problem, losses if with_shapes else None)
    log = data.likelier(change) + losses.log_prior  # (a, P)
    evidence = float(scipy.special.logsumexp(log) - np.log(_FINE.size))
    by_frequencies = evidence
    if data.shapes is not None:
        alone = _Data.of(elastic, number, problem, None).likelier(change) + losses.log_prior
        by_frequencies = float(scipy.special.logsumexp(alone) - np.log(_FINE.size))
    share = scipy.special.softmax(log)
    here, left = share.sum(axis=0), 1 - _FINE
    best = losses.stretches[int(np.argmax(here))]
    alike = np.array([each.sets == best.sets for each in losses.stretches])
    weight = share[:, alike] / share[:, alike].sum()
    factor = float(left @ weight.sum(axis=1))
    begin, end = (
        _quantile(np.array([getattr(each, name) for each in losses.stretches])[alike], weight.sum(axis=0), tail)
        for name, tail in (("begin", 0.025), ("end", 0.975))
    )
    by = np.array([_between(each / _LOSSES[:, None]) for each in change.transpose(2, 0, 1)])  # (n, a, P)
    some = share > _SELDOM * share.max()
    each = (by * _FINE[:, None])[:, some]
    mean = each @ share[some]
    return LostStiffness(
        by_frequencies=by_frequencies,
        evidence=evidence,
        likeliest=best,
        begin=begin,
        end=end,
        factor=factor,
        factor_sd=float(np.sqrt((left - factor) ** 2 @ weight.sum(axis=1))),
        mean=mean,
        covariance=(each * share[some]) @ each.T - np.outer(mean, mean),
    )


def _quantile(values: FloatArray, weight: FloatArray, tail: float) -> float:
    order = np.argsort(values)
    return float(values[order][min(np.searchsorted(np.cumsum(weight[order]), tail), values.size - 1)])


@dataclass(frozen=True)
class _Shapes:
    """Residuals of shapes in the space of the model's modes, over σ: (N,), by z and by turns (N, X) and (N, T)."""

    residual: FloatArray
    by: FloatArray
    by_turns: FloatArray
    turns: FloatArray  # (T,) prior standard deviations of the turns
    change: FloatArray  # (l, P, N) by losses

    @classmethod
    def of(cls, elastic: ElasticResult, number: int, losses: Losses) -> _Shapes | None:
        """Of a campaign; None where it has no shapes."""
        campaign, state, pairing = (each[number] for each in (elastic.layout.campaigns, elastic.states, elastic.pairings))
        if campaign.modes.shapes is None:
            return None
        count, (rows, columns) = len(campaign.modes.dofs), (list(each) for each in zip(*pairing.pairs, strict=True))
        weight = np.sqrt(elastic.problem.weights[elastic.rows[number]])
        missed, of_theta = shape_residual(campaign.modes, state, pairing, weight)
        by = of_theta @ (campaign.prior.slope(state.theta)[:, None] * campaign.pick)
        shapes = state.shapes[: losses.turned.shape[3], :count]
        basis = np.linalg.qr(shapes.T)[0]  # (points, b)
        own = shapes[columns]
        # A model's shape at the scale at which it is compared with the measured one, over σ.
        scale = weight * _scales(campaign.modes.shapes[rows], own) / SHAPE_DISCREPANCY
        seen = np.einsum("lpnm,mb->lpnb", losses.turned, shapes @ basis)
        mine = own @ basis
        along = np.sum(seen * mine, axis=3) / np.sum(mine**2, axis=1)
        change = (seen / np.where(np.abs(along) > 0.1, along, np.inf)[..., None] - mine) * scale[:, None]
        change[np.abs(along) <= 0.1] = 0.0
        turns, sds = _turns(state, columns, shapes @ basis, scale)
        return cls(
            (missed.reshape(-1, count) @ basis).ravel(),
            np.einsum("npx,pb->nbx", by.reshape(len(rows), count, -1), basis).reshape(-1, by.shape[1]),
            turns,
            sds,
            change.reshape(*change.shape[:2], -1),
        )


def _scales(measured: FloatArray, model: FloatArray) -> FloatArray:
    """(n,) of (n, p) model shapes that make them most like the measured ones, whose largest entries are 1."""
    real = np.array([turn_real(each).real for each in measured])
    real /= np.abs(real).max(axis=1, keepdims=True)
    return np.asarray(np.sum(real * model, axis=1) / np.sum(model**2, axis=1))


def _turns(state: ForwardState, columns: list[int], shapes: FloatArray, scale: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(N, T) change of shapes by turns of pairs of modes, of which one is paired, and (T,) the turns' standard deviations."""
    value = state.modes.eigenvalue[state.modes.rigid :]
    place = {column: k for k, column in enumerate(columns)}
    found, sds = [], []
    for j, k in zip(*np.triu_indices(len(shapes), 1), strict=True):
        apart = abs(value[j] - value[k]) / np.sqrt(value[j] * value[k])
        sd = min(np.sqrt(2) * DISCREPANCY / max(apart, 1e-12), _FREE)
        if sd < _TURNS * SHAPE_DISCREPANCY or not {j, k} & place.keys():
            continue
        one = np.zeros((len(columns), shapes.shape[1]))
        for mode, other, sign in ((j, k, 1), (k, j, -1)):
            if mode in place:
                own, into = shapes[mode], shapes[other]
                one[place[mode]] = sign * scale[place[mode]] * (into - own * (own @ into) / (own @ own))
        found.append(one.ravel())
        sds.append(sd)
    return np.array(found).reshape(len(found), -1).T, np.array(sds)


@dataclass(frozen=True)
class _Data:
    """The data, and the pairs of s and k that count with the logarithms of their posterior weights without damage."""

    problem: LinearProblem
    shapes: _Shapes | None
    scatter: float

    @classmethod
    def of(cls, elastic: ElasticResult, number: int, problem: LinearProblem, losses: Losses | None) -> _Data:
        noise = problem.noise.copy()
        for campaign, at in zip(elastic.layout.campaigns, elastic.rows, strict=True):
            noise[at, at] -= campaign.model_error**2 * np.eye(at.stop - at.start)
        for found, pairing, at in zip(elastic.excursions, elastic.pairings, elastic.rows, strict=True):
            for each in found:
                shift = each.rms * each.shift[[column for _, column in pairing.pairs]]
                noise[at, at] += np.outer(shift, shift)
        problem = replace(problem, noise=noise)
        return cls(problem, None if losses is None else _Shapes.of(elastic, number, losses), elastic.layout.scatter)

    def likelier(self, change: FloatArray) -> FloatArray:
        """(a, P) ln B of each loss and stretch, from (l, P, n) changes of ln f."""
        found = [(log, *self._given(s, k, change)) for s, k, log in self._pairs()]
        logs = np.array([log + own for log, own, _ in found])
        kept = logs > logs.max() - _COUNTS
        weight = logs[kept] - scipy.special.logsumexp(logs[kept])
        # ln B is zero without a loss, and nearly a parabola in it.
        over = [each / _LOSSES[:, None] for (_, _, each), some in zip(found, kept, strict=True) if some]
        return scipy.special.logsumexp(
            [w + _FINE[:, None] * _between(each) for w, each in zip(weight, over, strict=True)], axis=0
        )

    def _pairs(self) -> Iterator[tuple[float, float, float]]:
        """Discrepancies s and scales k of the shapes, with the logarithms of their prior probabilities."""
        spreads, logs = grid_of_discrepancies(_COARSE)
        sizes = _SHAPES if self.shapes is not None else np.ones(1)
        for s, log in zip(spreads, logs, strict=True):
            for k, own in zip(sizes, log_prior_of_scale(sizes, 1.0), strict=True):
                yield float(s), float(k), float(log + own)

    def _given(self, s: float, k: float, change: FloatArray) -> tuple[float, FloatArray]:
        """The log evidence without a loss at s and k, and (l, P) ln B of each loss there."""
        problem, x = self.problem, self.problem.x
        root = np.sqrt(problem.weights)[:, None]
        variance = problem.noise + s**2 * np.eye(len(root))
        W = root * np.linalg.inv(variance) * root.T
        P = problem.prior(self.scatter)
        others = sum((each for name, each in problem.others.items()), np.zeros_like(P))
        S, r = problem.sensitivity, problem.residual
        H, g = S.T @ W @ S + P + others, S.T @ W @ r + problem.other_descent - P @ x
        log = -float(r @ W @ r + np.linalg.slogdet(variance)[1])
        pulled, curved = change @ W, change @ (W @ S)
        if self.shapes is not None:
            own = self.shapes
            J = np.hstack([own.by, own.by_turns]) / k
            H = scipy.linalg.block_diag(H, np.diag(own.turns**-2)) + J.T @ J
            g = np.concatenate([g, np.zeros(own.turns.size)]) + J.T @ own.residual / k
            log -= float(own.residual @ own.residual) / k**2 + 2 * own.residual.size * np.log(k)
            curved = np.concatenate([curved, np.zeros((*curved.shape[:2], own.turns.size))], axis=2) + self._of_shapes / k**2
        factor = scipy.linalg.cho_factor(H)
        z = scipy.linalg.cho_solve(factor, g)
        log += float(g @ z) - 2 * float(np.log(np.diag(factor[0])).sum())
        gain = pulled @ r - curved @ z - np.sum(pulled * change, axis=2) / 2
        if self.shapes is not None:
            gain += self._along / k**2
        across = scipy.linalg.solve_triangular(factor[0], curved.reshape(-1, len(H)).T, trans=1, lower=factor[1])
        return log / 2, gain + np.sum(across**2, axis=0).reshape(gain.shape) / 2

    @cached_property
    def _of_shapes(self) -> FloatArray:
        """(l, P, X + T) products of the shapes' changes with their derivatives."""
        assert self.shapes is not None
        return np.asarray(self.shapes.change @ np.hstack([self.shapes.by, self.shapes.by_turns]))

    @cached_property
    def _along(self) -> FloatArray:
        """(l, P) of those with the shapes' residuals, less half their squares."""
        assert self.shapes is not None
        change = self.shapes.change
        return np.asarray(change @ self.shapes.residual - np.sum(change**2, axis=2) / 2)


def _between(over: FloatArray) -> FloatArray:
    """(a, P) of what is nearly linear, (l, P) at the losses solved for, at all losses."""
    after = np.clip(np.searchsorted(_LOSSES, _FINE), 1, _LOSSES.size - 1)
    share = ((_FINE - _LOSSES[after - 1]) / (_LOSSES[after] - _LOSSES[after - 1]))[:, None]
    return np.asarray((1 - share) * over[after - 1] + share * over[after])
