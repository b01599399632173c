"""A stretch of a body, along its longest side, in which one of its sets or all have lost stiffness.

A loss of stiffness by a share a in a stretch that has the part E of the modes' stiffness, E = ΦᵀK_stretch Φ, gives the
frequencies and the shapes of Λ - aE: it lowers a mode by its share of strain energy there, and turns it towards others by
their mutual energies. Constants soak up most of the first, and hardly any of the second, which breaks the body's symmetry.

Residuals r of ln f, and of shapes at the measured points, each at its best scale, are linear in the step z of the constants.
With d the change of the model's frequencies and shapes by a loss the data are likelier than without by

    ln B = dᵀW(r - Sz) - ½ dᵀ(W - WSH⁻¹SᵀW)d,    H = SᵀWS + P,

W the inverse of the noise: of measurement, of inputs that are believed to be nothing, of the discrepancy s; of shapes k σ at
each point, and what the model's error e of a frequency, were it alike in all directions of the stiffness (the Gaussian
orthogonal ensemble), turns modes towards each other, N(0, 2e²λ_jλ_k/(λ_j - λ_k)²). In the frequencies themselves the error of
the model of joints is left to the constants, which absorb it but for what s is. Of all sets, stretches
(each length as likely) and losses, and over the posterior of s and k where nothing is damaged, B is the mean, so that without
damage E[B] = 1, and P(B ≥ 1/p) ≤ p (as in `added_mass`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from fecore.arrays import ComplexArray, FloatArray
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
_LOSSES = np.array([0.02, 0.06, 0.12, 0.2, 0.3, 0.4, 0.55, 0.7])  # solved for
_FINE = np.linspace(0.02, 0.7, 69)  # each as likely; what is between is interpolated
_COARSE = 5  # of the grid of discrepancies, one in so many
_SHAPES = np.array([0.5, 1.0, 2.0, 4.0])  # k: a shape's standard deviation over the usual one
_LIKE = 0.1  # of a shape in another, below which the two are not compared
_CLOSE = 1e-3  # relative distance of eigenvalues below which modes are turned freely
_SETS, _SLIGHT = 4, 0.02  # sets at most, those with most energy; share of every mode's energy that is not looked at
_ABOVE = 12  # elastic modes above the last paired one that shapes are made of
_SELDOM = 1e-6  # probability over the greatest that does not count


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
    at, count = elastic.rows[number], len(_LOSSES)
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
    place = int(np.searchsorted(np.cumsum(weight[order]), tail))
    return float(values[order][min(place, values.size - 1)])


@dataclass(frozen=True)
class _Shapes:
    """Residuals of n shapes in the space of b shapes of the model, over σ, and what they follow from."""

    residual: FloatArray  # (n, b)
    by: FloatArray  # (n, b, X) of the model's by the unknowns
    turned: FloatArray  # (n, b, b) covariance by turns of modes
    change: FloatArray  # (l, P, n, b) by losses
    # information, descent: (X, X) and (X,) of them in the fit, where it looks at shapes
    information: FloatArray
    descent: FloatArray

    @classmethod
    def of(cls, elastic: ElasticResult, number: int, losses: Losses) -> _Shapes | None:
        """Of a campaign; None where it has no shapes."""
        campaign, state = elastic.layout.campaigns[number], elastic.states[number]
        pairing, measured = elastic.pairings[number], campaign.modes.shapes
        if measured is None:
            return None
        count, (rows, columns) = len(campaign.modes.dofs), (list(each) for each in zip(*pairing.pairs, strict=True))
        weight = np.sqrt(elastic.problem.weights[elastic.rows[number]])
        missed, of_theta = shape_residual(campaign.modes, state, pairing, weight)
        by = of_theta @ (campaign.prior.slope(state.theta)[:, None] * campaign.pick)
        shapes = state.shapes[: losses.turned.shape[3], :count]
        basis = np.linalg.qr(shapes.T)[0]  # (points, b)
        # A model's shape at the scale at which it is compared with the measured one, over σ.
        scale = weight * _scales(measured[rows], shapes[columns]) / SHAPE_DISCREPANCY
        shapes = shapes @ basis
        own = shapes[columns]
        seen = losses.turned @ shapes
        along = np.sum(seen * own, axis=3) / np.sum(own**2, axis=1)
        like = np.abs(along) > _LIKE
        change = scale[:, None] * (seen / np.where(like, along, 1.0)[..., None] - own) * like[..., None]
        fitted = "mode shapes" in elastic.problem.others
        return cls(
            missed.reshape(-1, count) @ basis,
            np.einsum("npx,pb->nbx", by.reshape(len(rows), count, -1), basis),
            _turned(state, columns, shapes, scale),
            change,
            fitted * (by.T @ by),
            fitted * (by.T @ missed),
        )

    def given(self, k: float) -> _ShapesGiven:
        """What they say where a shape's standard deviation is k times the usual one."""
        covariance = k**2 * np.eye(self.residual.shape[1]) + self.turned
        whiten = np.linalg.inv(np.linalg.cholesky(covariance))
        r, J = (whiten @ self.residual[..., None])[..., 0], whiten @ self.by
        d = np.stack([self.change[:, :, j] @ each.T for j, each in enumerate(whiten)], axis=2)
        return _ShapesGiven(
            cost=float(np.sum(r**2) + np.linalg.slogdet(covariance)[1].sum()),
            hessian=np.einsum("nbx,nby->xy", J, J) - self.information,
            descent=np.einsum("nbx,nb->x", J, r) - self.descent,
            across=np.tensordot(d, J, ((2, 3), (0, 1))),
            along=np.tensordot(d, r, 2) - np.sum(d**2, axis=(2, 3)) / 2,
        )


@dataclass(frozen=True)
class _ShapesGiven:
    """The terms of the shapes in ln B: of the misfit twice, by the unknowns, and by losses."""

    cost: float
    hessian: FloatArray  # (X, X)
    descent: FloatArray  # (X,)
    across: FloatArray  # (l, P, X) dᵀWS
    along: FloatArray  # (l, P) dᵀWr - ½ dᵀWd


def _scales(measured: ComplexArray, model: FloatArray) -> FloatArray:
    """(n,) of (n, p) model shapes that make them most like the measured ones, whose largest entries are 1."""
    real = np.array([turn_real(each).real for each in measured])
    real /= np.abs(real).max(axis=1, keepdims=True)
    return np.asarray(np.sum(real * model, axis=1) / np.sum(model**2, axis=1))


def _turned(state: ForwardState, columns: list[int], shapes: FloatArray, scale: FloatArray) -> FloatArray:
    """(n, b, b) covariance of paired modes' shapes, by what turns them towards others."""
    value = state.modes.eigenvalue[state.modes.rigid :][: len(shapes)]
    apart = np.abs(value[columns, None] - value) / np.sqrt(value[columns, None] * value)
    sd = np.sqrt(2) * DISCREPANCY / np.maximum(apart, _CLOSE)
    own = shapes[columns]
    across = shapes - (own @ shapes.T / np.sum(own**2, axis=1)[:, None])[..., None] * own[:, None]
    sd[np.arange(len(columns)), columns] = 0.0
    each = (scale[:, None] * sd)[..., None] * across
    return np.asarray(each.transpose(0, 2, 1) @ each)


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
        spreads, log_spreads = grid_of_discrepancies(_COARSE)
        sizes = np.ones(1) if self.shapes is None else _SHAPES
        found = []
        for k, log_size in zip(sizes.tolist(), log_prior_of_scale(sizes, 1.0).tolist(), strict=True):
            shapes = None if self.shapes is None else self.shapes.given(k)
            for s, log_spread in zip(spreads.tolist(), log_spreads.tolist(), strict=True):
                found.append((log_size + log_spread, *self._given(s, shapes, change)))
        logs = np.array([log + own for log, own, _ in found])
        weight = logs - scipy.special.logsumexp(logs)
        # ln B is zero without a loss, and nearly a parabola in it.
        over = [each / _LOSSES[:, None] for *_, each in found]
        each = [w + _FINE[:, None] * _between(own) for w, own in zip(weight, over, strict=True)]
        return np.asarray(scipy.special.logsumexp(each, axis=0))

    def _given(self, s: float, shapes: _ShapesGiven | None, change: FloatArray) -> tuple[float, FloatArray]:
        """The log evidence without a loss at s, and (l, P) ln B of each loss there."""
        problem = self.problem
        S, r, root = problem.sensitivity, problem.residual, np.sqrt(problem.weights)[:, None]
        variance, precision = problem.noise + s**2 * np.eye(r.size), problem.prior(self.scatter)
        W = root * np.linalg.inv(variance) * root.T
        H, g = S.T @ W @ S + precision, S.T @ W @ r + problem.other_descent - precision @ problem.x
        H = np.sum([H, *problem.others.values()], axis=0)
        pulled, across = change @ W, change @ (W @ S)
        cost, gain = r @ W @ r + np.linalg.slogdet(variance)[1], pulled @ r - np.sum(pulled * change, axis=2) / 2
        if shapes is not None:
            H, g, cost = H + shapes.hessian, g + shapes.descent, cost + shapes.cost
            across, gain = across + shapes.across, gain + shapes.along
        z = np.linalg.solve(H, g)
        gain = gain - across @ z + np.sum((across @ np.linalg.inv(H)) * across, axis=2) / 2
        return float(g @ z - cost - np.linalg.slogdet(H)[1]) / 2, gain


def _between(over: FloatArray) -> FloatArray:
    """(a, P) of what is nearly linear, (l, P) at the losses solved for, at all losses."""
    after = np.clip(np.searchsorted(_LOSSES, _FINE), 1, _LOSSES.size - 1)
    share = ((_FINE - _LOSSES[after - 1]) / (_LOSSES[after] - _LOSSES[after - 1]))[:, None]
    return np.asarray((1 - share) * over[after - 1] + share * over[after])
