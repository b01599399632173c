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
discrepancy s; of shapes k σ at each point (more in modes that are further off than the middle one),
the shapes' slopes times what points and their grid are off their places, which is the same in all
modes, and what the model's error e of a frequency, were it alike in all directions of the stiffness
(the Gaussian orthogonal ensemble), turns modes towards each other, N(0, 2e²λ_jλ_k/(λ_j - λ_k)²).
In the frequencies themselves the error of the model of joints is left to the constants, which
absorb it but for what s is. Of all sets, stretches (each length as likely) and
losses, and over the posterior of s and k where nothing is damaged, B is the mean, so that without
damage E[B] = 1, and P(B ≥ 1/p) ≤ p. Where B is large the likely stretches are compared more closely
(`fecore.updating.damage_effects`), which the factor is taken from.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy

from fecore.arrays import FloatArray
from fecore.updating.damage_effects import LOSSES, SHAPES, DamageEffects, Stretch
from fecore.updating.damage_shapes import DamageShapesAt
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.posterior import LinearProblem, grid_of_discrepancies, log_prior_of_scale

# losses, each as likely; what is between those solved for is interpolated
_FINE = np.linspace(0.02, 0.7, 69)
_COARSE = 5  # of the grid of discrepancies, one in so many
_SELDOM = 1e-6  # probability over the greatest that does not count
_WORTH = float(np.log(20.0))  # ln B from which the likely stretches are looked at closely …
_ROUNDS = 2  # … until the likeliest stays


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


def lost_stiffness(
    elastic: ElasticResult, number: int, effects: DamageEffects, problem: LinearProblem
) -> LostStiffness:
    """Compare a loss of stiffness in any stretch of a campaign's body with none, by frequencies and
    what shapes there are.

    Args:
        elastic: the update.
        number: of the campaign.
        effects: of its body.
        problem: at the estimate.
    """
    given = _Given(elastic, number, _without_joints(elastic, problem))
    compared = [given.compared(effects)]
    if scipy.special.logsumexp(compared[0].log) > _WORTH:
        compared = [given.near(each, log) for each, log in effects.of_sets(compared[0].log)]
        best = int(np.argmax([scipy.special.logsumexp(each.log) for each in compared]))
        compared[best] = given.followed(compared[best])
    change, log = (
        np.concatenate(each, axis=1)
        for each in zip(*((f.change, f.log) for f in compared), strict=True)
    )
    intervals = [stretch for each in compared for stretch in each.effects.intervals]
    share = scipy.special.softmax(log)
    here, left = share.sum(axis=0), 1 - _FINE
    likeliest = intervals[int(np.argmax(here))]
    alike = np.array([each.sets == likeliest.sets for each in intervals])
    weight = share[:, alike] / share[:, alike].sum()
    factor = float(left @ weight.sum(axis=1))
    # A stretch stands for those whose ends lie within half a step, or an element, of its own: modes
    # see loss times length.
    apart = max(compared[0].effects.step, compared[0].effects.element)
    between = (
        _FINE[:, None] * apart / np.array([each.length for each in intervals])[alike] / np.sqrt(6)
    )
    begin, end = (
        _quantile(
            np.array([getattr(each, name) for each in intervals])[alike], weight.sum(axis=0), tail
        )
        for name, tail in (("begin", 0.025), ("end", 0.975))
    )
    # an array (n, a, P)
    by = np.array([_between(each / LOSSES[:, None]) for each in change.transpose(2, 0, 1)])
    some = share > _SELDOM * share.max()
    each = (by * _FINE[:, None])[:, some]
    mean = each @ share[some]
    return LostStiffness(
        by_frequencies=float(scipy.special.logsumexp([each.by_frequencies for each in compared])),
        evidence=float(scipy.special.logsumexp(log)),
        likeliest=likeliest,
        begin=begin,
        end=end,
        factor=factor,
        factor_sd=float(np.sqrt(np.sum(weight * ((left[:, None] - factor) ** 2 + between**2)))),
        mean=mean,
        covariance=(each * share[some]) @ each.T - np.outer(mean, mean),
    )


@dataclass(frozen=True)
class _Compared:
    """Some losses, and what the data say of them."""

    effects: DamageEffects
    change: FloatArray  # (l, P, n) of all ln f
    log: FloatArray  # (a, P) ln B of each loss and stretch, with its prior
    by_frequencies: float  # ln B of all by the frequencies alone

    @property
    def likeliest(self) -> Stretch:
        return self.effects.intervals[int(np.argmax(scipy.special.logsumexp(self.log, axis=0)))]


@dataclass(frozen=True)
class _Given:
    """The data of a campaign, and of those beside it."""

    elastic: ElasticResult
    number: int
    problem: LinearProblem

    def compared(self, effects: DamageEffects) -> _Compared:
        """What they say of some losses."""
        change = np.zeros((LOSSES.size, len(effects.intervals), self.problem.residual.size))
        change[..., self.elastic.rows[self.number]] = effects.change
        scatter = self.elastic.layout.scatter
        both = [(), effects.shapes] if effects.shapes else [()]
        prior = effects.log_prior - np.log(_FINE.size)
        logs = [_likelier(self.problem, scatter, each, change) + prior for each in both]
        return _Compared(effects, change, logs[-1], float(scipy.special.logsumexp(logs[0])))

    def near(self, effects: DamageEffects, log: FloatArray) -> _Compared:
        """What they say of losses near those that are likely by (a, P) ln B."""
        return self.compared(
            effects.near(self.elastic, self.number, scipy.special.softmax(log).sum(axis=0))
        )

    def followed(self, compared: _Compared) -> _Compared:
        """The same near those, until the likeliest stays."""
        for _ in range(_ROUNDS):
            before, compared = compared.likeliest, self.near(compared.effects, compared.log)
            if compared.likeliest == before:
                break
        return compared


def _quantile(values: FloatArray, weight: FloatArray, tail: float) -> float:
    order = np.argsort(values)
    place = int(np.searchsorted(np.cumsum(weight[order]), tail))
    return float(values[order][min(place, values.size - 1)])


def _without_joints(elastic: ElasticResult, problem: LinearProblem) -> LinearProblem:
    """The problem without the error of the joints' model in its noise, and with inputs that may be
    something.
    """
    noise = problem.noise.copy()
    parts = zip(
        elastic.layout.campaigns,
        elastic.systematic_effects,
        elastic.pairings,
        elastic.rows,
        strict=True,
    )
    for campaign, effects, pairing, at in parts:
        noise[at, at] -= campaign.model_error**2 * np.eye(at.stop - at.start)
        for each in effects:
            shift = each.rms * each.shift[[column for _, column in pairing.pairs]]
            noise[at, at] += np.outer(shift, shift)
    return replace(problem, noise=noise)


def _likelier(
    problem: LinearProblem, scatter: float, shapes: tuple[DamageShapesAt, ...], change: FloatArray
) -> FloatArray:
    """(a, P) ln B of each loss and stretch, from (l, P, n) changes of ln f and what the shapes say,
    if they are asked.
    """
    discrepancies, log_priors = grid_of_discrepancies(coarse=_COARSE)
    log_sizes = log_prior_of_scale(SHAPES, 1.0).tolist()
    terms = [
        (log_size + log_prior, *_given(problem, scatter, s, own, change))
        for log_size, own in (zip(log_sizes, shapes, strict=True) if shapes else [(0.0, None)])
        for s, log_prior in zip(discrepancies.tolist(), log_priors.tolist(), strict=True)
    ]
    logs = np.array([log + own for log, own, _ in terms])
    weight = logs - scipy.special.logsumexp(logs)
    # ln B is zero without a loss, and nearly a parabola in it.
    over = [each / LOSSES[:, None] for *_, each in terms]
    each = [w + _FINE[:, None] * _between(own) for w, own in zip(weight, over, strict=True)]
    return np.asarray(scipy.special.logsumexp(each, axis=0))


def _given(
    problem: LinearProblem,
    scatter: float,
    s: float,
    shapes: DamageShapesAt | None,
    change: FloatArray,
) -> tuple[float, FloatArray]:
    """The log evidence without a loss at s, and (l, P) ln B of each loss there."""
    S, r, root = problem.sensitivity, problem.residual, np.sqrt(problem.weights)[:, None]
    variance, precision = problem.noise + s**2 * np.eye(r.size), problem.prior(scatter)
    W = root * np.linalg.inv(variance) * root.T
    H, g = S.T @ W @ S + precision, S.T @ W @ r + problem.other_descent - precision @ problem.x
    H = np.sum([H, *problem.others.values()], axis=0)
    pulled, across = change @ W, change @ (W @ S)
    cost = r @ W @ r + np.linalg.slogdet(variance)[1]
    gain = pulled @ r - np.sum(pulled * change, axis=2) / 2
    if shapes is not None:
        H, g, cost = H + shapes.hessian, g + shapes.descent, cost + shapes.cost
        across, gain = across + shapes.across, gain + shapes.along
    z = np.linalg.solve(H, g)
    gain = gain - across @ z + np.sum((across @ np.linalg.inv(H)) * across, axis=2) / 2
    return float(g @ z - cost - np.linalg.slogdet(H)[1]) / 2, gain


def _between(over: FloatArray) -> FloatArray:
    """(a, P) of what is smooth, (l, P) at the losses solved for, at all losses."""
    return np.asarray(scipy.interpolate.PchipInterpolator(LOSSES, over)(_FINE))
