"""A stretch of a body, along its longest side, in which one of its sets or all have lost stiffness.

A loss of stiffness by a share a in a stretch that has the part E of the modes' stiffness, E =
ΦᵀK_stretch Φ, gives the frequencies and the shapes of Λ - aE: it lowers a mode by its share of
strain energy there, and turns it towards others by their mutual energies. Constants soak up most of
the first, and hardly any of the second, which breaks the body's symmetry.

Residuals r of ln f, and of shapes at the measured points, each at its best scale, are linear in the
step z of the constants. With d the change of the model's frequencies and shapes by a loss the data
are likelier than without by

    ln B = dᵀW(r - Sz) - ½ dᵀ(W - WSH⁻¹SᵀW)d,    H = SᵀWS + P,

W the inverse of the noise: of measurement, of inputs that are believed to be nothing, of the
discrepancy s; of shapes k σ at each point, the shape's slope times what its points and their grid
are off their places, and what the model's error e of a frequency, were it alike in all directions
of the stiffness (the Gaussian orthogonal ensemble), turns modes towards each other, N(0,
2e²λ_jλ_k/(λ_j - λ_k)²). In the frequencies themselves the error of the model of joints is left to
the constants, which absorb it but for what s is. Of all sets, stretches (each length as likely) and
losses, and over the posterior of s and k where nothing is damaged, B is the mean, so that without
damage E[B] = 1, and P(B ≥ 1/p) ≤ p.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy

from fecore.arrays import FloatArray
from fecore.body.matrices import MatrixBody
from fecore.correlation import most_alike
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.posterior import (
    DISCREPANCY,
    SHAPE_DISCREPANCY,
    LinearProblem,
    grid_of_discrepancies,
    log_prior_of_scale,
)
from fecore.updating.shape_error import ShapeErrors, real_shape
from fecore.updating.state import ForwardState

_PARTS, _LONGEST = 20, 0.5  # of the body's longest side; share of it that a stretch takes at most
_LOSSES = np.array([0.02, 0.06, 0.12, 0.2, 0.3, 0.4, 0.55, 0.7])  # solved for
_FINE = np.linspace(0.02, 0.7, 69)  # each as likely; what is between is interpolated
_COARSE = 5  # of the grid of discrepancies, one in so many
_SHAPES = np.array([0.5, 1.0, 2.0, 4.0])  # k: a shape's standard deviation over the usual one
# standard deviations of the middle of the hits at a point about it, and of each end of the grid
# along the body, m
_PLACED, _GRID = 0.001, 0.002
_LIKE = 0.1  # of a shape in another, below which the two are not compared
_CLOSE = 1e-3  # relative distance of eigenvalues below which modes are turned freely
# sets at most, those with most energy; share of every mode's energy that is not looked at
_SETS, _SLIGHT = 4, 0.02
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
    # begin, end: least and greatest place along the axis that the likeliest sets' stretch reaches
    # to with 95 %, m
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
        begin, end, least, most = (
            f"{1e3 * each:.0f}" for each in (stretch.begin, stretch.end, self.begin, self.end)
        )
        return of, f"{axis} = {begin} and {end} mm (at most {least} to {most})"


@dataclass(frozen=True)
class Losses:
    """What losses of stiffness in P stretches do to the paired modes of a solved body, shapes at
    the measured points.
    """

    stretches: tuple[Stretch, ...]
    log_prior: FloatArray  # (P,)
    change: FloatArray  # (l, P, n) of ln f, by the losses solved for
    # what the measured shapes say, for each scale of their error; empty without any
    shapes: tuple[_ShapesGiven, ...]

    @classmethod
    def of(cls, elastic: ElasticResult, number: int) -> Losses | None:
        """Those of a campaign's body at the estimate; None of one that has no elements."""
        state, columns = (
            elastic.states[number],
            [column for _, column in elastic.pairings[number].pairs],
        )
        if isinstance(state.forward.specimen, MatrixBody):
            return None
        m = min(state.frequency_hz.size, max(columns) + 1 + _ABOVE)
        sets, axis, lines, energy = _energies(state, m)
        first, last = np.triu_indices(_PARTS)
        kept = last - first < _LONGEST * _PARTS
        first, last = first[kept], last[kept]
        whole = np.concatenate([np.zeros_like(energy[:, :1]), np.cumsum(energy, axis=1)], axis=1)
        groups = [(k,) for k in range(len(sets))] + (
            [tuple(range(len(sets)))] if len(sets) > 1 else []
        )
        parts = np.concatenate(
            [(whole[list(g)][:, last + 1] - whole[list(g)][:, first]).sum(axis=0) for g in groups]
        )
        stretches = tuple(
            Stretch(
                tuple(sets[k] for k in g),
                len(g) == len(sets),
                axis,
                float(lines[a]),
                float(lines[b + 1]),
            )
            for g in groups
            for a, b in zip(first, last, strict=True)
        )
        share = 1.0 / (last - first + 1)
        log_prior = np.tile(np.log(share / share.sum() / len(groups)), len(groups))
        value = state.modes.eigenvalue[state.modes.rigid :][:m]
        each = [_solved(value, loss * parts, columns) for loss in _LOSSES]
        change, turned = (np.array(some) for some in zip(*each, strict=True))
        shapes = _Shapes.of(elastic, number, turned)
        return cls(
            stretches,
            log_prior,
            change,
            () if shapes is None else tuple(map(shapes.given, _SHAPES.tolist())),
        )


def _solved(
    value: FloatArray, lost: FloatArray, columns: list[int]
) -> tuple[FloatArray, FloatArray]:
    """(P, n) changes of ln f of some modes with (m,) eigenvalues, and (P, n, m) what they are made
    of, by (P, m, m) losses.
    """
    found, vectors = np.linalg.eigh(np.diag(value) - lost)
    found = np.maximum(found, 1e-3 * value[0])
    order = np.array([most_alike(each) for each in vectors])[:, columns]
    change = np.log(np.take_along_axis(found, order, axis=1) / value[columns]) / 2
    turned = np.take_along_axis(vectors, order[:, None], axis=2).transpose(0, 2, 1)
    return change, turned / turned[:, np.arange(len(columns)), columns][..., None]


def _energies(state: ForwardState, m: int) -> tuple[list[str], int, FloatArray, FloatArray]:
    """Sets, the longest axis, (F + 1,) lines between equal parts along it, and (sets, F, m, m)
    energies of elastic modes.
    """
    model, shapes = state.forward.specimen.model, state.full_shapes[:, :m]
    axis = int(np.argmax(np.ptp(model.mesh.nodes, axis=0)))
    x, K = model.mesh.nodes[:, axis], model.stiffness
    lines = np.linspace(x.min(), x.max(), _PARTS + 1)
    sets = list(model.mesh.sets)
    owner = [
        next((k for k, own in enumerate(sets) if name.startswith(f"{own}.")), -1)
        for name in K.names
    ]
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
    most = (np.einsum("sfmm->sm", energy) / state.modes.eigenvalue[state.modes.rigid :][:m]).max(
        axis=1
    )
    kept = sorted(k for k in np.argsort(-most)[:_SETS] if most[k] > _SLIGHT)
    return [sets[k] for k in kept], axis, lines, energy[kept]


def _inside(x: FloatArray, lines: FloatArray) -> FloatArray:
    """(F, e) share of elements with nodes at (e, n) x that lies between neighbouring ones of (F +
    1,) lines.
    """
    thin = 1e-9 * (lines[-1] - lines[0])
    low = np.clip(x.min(axis=1), lines[0], lines[-1] - thin)
    high = np.maximum(x.max(axis=1), low + thin)
    within = np.minimum(high, lines[1:, None]) - np.maximum(low, lines[:-1, None])
    return np.asarray(np.maximum(within, 0.0) / (high - low))


def lost_stiffness(
    elastic: ElasticResult,
    number: int,
    losses: Losses,
    problem: LinearProblem,
    *,
    with_shapes: bool = True,
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
    given = _without_joints(elastic, problem)

    def likelier(shapes: tuple[_ShapesGiven, ...]) -> tuple[FloatArray, float]:
        log = (
            _likelier(given, elastic.layout.scatter, shapes, change)
            + losses.log_prior
            - np.log(_FINE.size)
        )
        return log, float(scipy.special.logsumexp(log))

    log, by_frequencies = likelier(())
    evidence = by_frequencies
    if with_shapes and losses.shapes:
        log, evidence = likelier(losses.shapes)
    share = scipy.special.softmax(log)
    here, left = share.sum(axis=0), 1 - _FINE
    best = losses.stretches[int(np.argmax(here))]
    alike = np.array([each.sets == best.sets for each in losses.stretches])
    weight = share[:, alike] / share[:, alike].sum()
    factor = float(left @ weight.sum(axis=1))
    begin, end = (
        _quantile(
            np.array([getattr(each, name) for each in losses.stretches])[alike],
            weight.sum(axis=0),
            tail,
        )
        for name, tail in (("begin", 0.025), ("end", 0.975))
    )
    # (n, a, P)
    by = np.array([_between(each / _LOSSES[:, None]) for each in change.transpose(2, 0, 1)])
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
    """Residuals of n shapes in the space of b shapes of the model, over σ, and what they follow
    from.
    """

    residual: FloatArray  # (n, b)
    by: FloatArray  # (n, b, X) of the model's by the unknowns
    # (n, b, b) covariance by turns of modes, and by points that are met within `_PLACED`
    turned: FloatArray
    change: FloatArray  # (l, P, n, b) by losses
    # information, descent: (X, X) and (X,) of them in the fit, where it looks at shapes
    information: FloatArray
    descent: FloatArray

    @classmethod
    def of(cls, elastic: ElasticResult, number: int, turned: FloatArray) -> _Shapes | None:
        """Of a campaign, by (l, P, n, m) of modes that losses turned; None where it has no
        shapes.
        """
        campaign, state = elastic.layout.campaigns[number], elastic.states[number]
        pairing = elastic.pairings[number]
        if campaign.modes.shapes is None:
            return None
        count, (rows, columns) = (
            len(campaign.modes.dofs),
            (list(each) for each in zip(*pairing.pairs, strict=True)),
        )
        weight = np.sqrt(elastic.problem.weights[elastic.rows[number]])
        missed, of_theta = ShapeErrors().residual(campaign.modes, state, pairing, weight)
        by = of_theta @ (campaign.prior.slope(state.theta)[:, None] * campaign.pick)
        shapes = state.shapes[: turned.shape[3], :count]
        basis = np.linalg.qr(shapes.T)[0]  # (points, b)
        # A model's shape at the scale at which it is compared with the measured one, over σ.
        real, own = np.array([real_shape(campaign.modes, row) for row in rows]), shapes[columns]
        scale = weight * np.sum(real * own, axis=1) / np.sum(own**2, axis=1) / SHAPE_DISCREPANCY
        placed = _placed(state, scale[:, None, None] * state.slopes[columns, :count], basis)
        shapes = shapes @ basis
        own = shapes[columns]
        seen = turned @ shapes
        along = np.sum(seen * own, axis=3) / np.sum(own**2, axis=1)
        like = np.abs(along) > _LIKE
        change = (
            scale[:, None] * (seen / np.where(like, along, 1.0)[..., None] - own) * like[..., None]
        )
        fitted = elastic.problem.others.get("mode shapes")
        return cls(
            missed.reshape(-1, count) @ basis,
            np.einsum("npx,pb->nbx", by.reshape(len(rows), count, -1), basis),
            _turned(state, columns, shapes, scale) + placed,
            change,
            np.zeros((by.shape[1],) * 2) if fitted is None else fitted,
            np.zeros(by.shape[1]) if fitted is None else elastic.problem.other_descent,
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


def _turned(
    state: ForwardState, columns: list[int], shapes: FloatArray, scale: FloatArray
) -> FloatArray:
    """(n, b, b) covariance of paired modes' shapes, by what turns them towards others."""
    value = state.modes.eigenvalue[state.modes.rigid :][: len(shapes)]
    apart = np.abs(value[columns, None] - value) / np.sqrt(value[columns, None] * value)
    sd = np.sqrt(2) * DISCREPANCY / np.maximum(apart, _CLOSE)
    own = shapes[columns]
    across = shapes - (own @ shapes.T / np.sum(own**2, axis=1)[:, None])[..., None] * own[:, None]
    sd[np.arange(len(columns)), columns] = 0.0
    each = (scale[:, None] * sd)[..., None] * across
    return np.asarray(each.transpose(0, 2, 1) @ each)


def _placed(state: ForwardState, slopes: FloatArray, basis: FloatArray) -> FloatArray:
    """(n, b, b) covariance of (n, p, 3) slopes times how far points, and the ends of their grid,
    are off their places.
    """
    places = state.forward.places[: slopes.shape[1]]
    axis = int(np.argmax(np.ptp(places, axis=0)))
    x = (places[:, axis] - places[:, axis].min()) / max(float(np.ptp(places[:, axis])), 1e-300)
    own = np.einsum("pb,npk,pc->nbc", basis, (_PLACED * slopes) ** 2, basis)
    ends = _GRID * np.stack([slopes[..., axis] * x, slopes[..., axis] * (1 - x)]) @ basis
    return np.asarray(own + np.einsum("enb,enc->nbc", ends, ends))


def _without_joints(elastic: ElasticResult, problem: LinearProblem) -> LinearProblem:
    """The problem without the error of the joints' model in its noise, and with inputs that may be
    something.
    """
    noise = problem.noise.copy()
    parts = zip(
        elastic.layout.campaigns, elastic.excursions, elastic.pairings, elastic.rows, strict=True
    )
    for campaign, found, pairing, at in parts:
        noise[at, at] -= campaign.model_error**2 * np.eye(at.stop - at.start)
        for each in found:
            shift = each.rms * each.shift[[column for _, column in pairing.pairs]]
            noise[at, at] += np.outer(shift, shift)
    return replace(problem, noise=noise)


def _likelier(
    problem: LinearProblem, scatter: float, shapes: tuple[_ShapesGiven, ...], change: FloatArray
) -> FloatArray:
    """(a, P) ln B of each loss and stretch, from (l, P, n) changes of ln f and what the shapes say,
    if they are asked.
    """
    spreads, log_spreads = grid_of_discrepancies(coarse=_COARSE)
    log_sizes = log_prior_of_scale(_SHAPES, 1.0).tolist()
    found = [
        (log_size + log_spread, *_given(problem, scatter, s, own, change))
        for log_size, own in (zip(log_sizes, shapes, strict=True) if shapes else [(0.0, None)])
        for s, log_spread in zip(spreads.tolist(), log_spreads.tolist(), strict=True)
    ]
    logs = np.array([log + own for log, own, _ in found])
    weight = logs - scipy.special.logsumexp(logs)
    # ln B is zero without a loss, and nearly a parabola in it.
    over = [each / _LOSSES[:, None] for *_, each in found]
    each = [w + _FINE[:, None] * _between(own) for w, own in zip(weight, over, strict=True)]
    return np.asarray(scipy.special.logsumexp(each, axis=0))


def _given(
    problem: LinearProblem,
    scatter: float,
    s: float,
    shapes: _ShapesGiven | None,
    change: FloatArray,
) -> tuple[float, FloatArray]:
    """The log evidence without a loss at s, and (l, P) ln B of each loss there."""
    S, r, root = problem.sensitivity, problem.residual, np.sqrt(problem.weights)[:, None]
    variance, precision = problem.noise + s**2 * np.eye(r.size), problem.prior(scatter)
    W = root * np.linalg.inv(variance) * root.T
    H, g = S.T @ W @ S + precision, S.T @ W @ r + problem.other_descent - precision @ problem.x
    H = np.sum([H, *problem.others.values()], axis=0)
    pulled, across = change @ W, change @ (W @ S)
    cost, gain = (
        r @ W @ r + np.linalg.slogdet(variance)[1],
        pulled @ r - np.sum(pulled * change, axis=2) / 2,
    )
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
