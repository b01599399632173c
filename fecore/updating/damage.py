"""Where the stiffness of a body has changed: in a stretch of any body, in stretches of a strip in
zones.

The posterior over stretches of a body that may have another stiffness: none, one or two, from
any place to any other.

Damage sits in one place or two, and never where somebody drew a line. So a body is divided into F
parts, whose changes of compliance δ = 1/s - 1/s₀, in which frequencies are more nearly linear than
in a factor s of stiffness, are those of stretches:

    δ = V α,     α ~ N(0, σ²),     p(none) = p(one) = p(two),     p(stretch) ∝ 1/length,

the columns of V being 1 in a stretch and 0 outside; σ is one of three sizes. As a stretch that is
softer and a rest that is stiffer are the same body with other moduli, stretches over more than half
of it are taken for rare. With the other unknowns integrated out, the misfit of the frequencies at a
discrepancy s is ½ δᵀAδ - cᵀδ, and the evidence of a partition (O'Hagan and Forster, Kendall's
Advanced Theory of Statistics 2B, 11)

    log p(f | V, s, σ) = ½ cᵀV Q⁻¹Vᵀc - ½ ln |σ²Q| + const(s),     Q = VᵀAV + σ⁻².

All of them are compared, and the posterior is their mixture.

A stretch of a body, along its longest side, in which one of its sets or all have lost stiffness.

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

Where the stiffness of a body has changed: in few of its sets, or in stretches of a strip that
begin and end anywhere.

One factor for the whole of a zone fits the modes of a body that is damaged between the lines by
changes of zones in which nothing is. So each zone is divided into parts, and the posterior is that
over all stretches of parts (`Partitions`), linearised at its own mean until that rests. Of a
zone its mean is reported, 1/s = (1/L) ∫ dx/s(x), of which modes know more than of how long and how
deep a stretch is. The model of the result has the mean changes of all parts; a zone's factor scales
its own.

Where a body of sets has lost stiffness, stage 1 is made anew: the prior of the factors of sets
expects nearly all of them to be 1. Damage sits in one place or two. A factor of its own for every
place, each with the same wide prior, would spread one place's loss over its neighbours. So each
factor's prior standard deviation is itself estimated, by the evidence (MacKay, Neural Comput. 4,
1992; Tipping, J. Mach. Learn. Res. 1, 2001): with ξ = ln of the factor, σ² its posterior and s² its
prior variance,

    γ = 1 - σ²/s²,     s² ← ξ²/γ,

where γ is the share of what is known of the factor that the data supply. A factor that the data do
not move is held ever more firmly at 1; one that they move keeps its room, up to the standard
deviation that the recipe states.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy

from fecore.arrays import BoolArray, FloatArray, IntArray, log_sum
from fecore.quantities import kind_of
from fecore.updating.damage_effects import LOSSES, SHAPES, DamageEffects, DamageTerms, Stretch
from fecore.updating.elastic import Misfit
from fecore.updating.elastic_result import DamageIntervals, ElasticResult
from fecore.updating.elastic_starts import LEAST_FACTOR_SD
from fecore.updating.inputs import with_temperature
from fecore.updating.measurement import Recipe
from fecore.updating.parameters import Parametrisation, parametrise
from fecore.updating.posterior import (
    LinearProblem,
    Mixture,
    grid_of_discrepancies,
    log_prior_of_scale,
)

_SIZES = (1 / 3, 1.0, 3.0)  # σ over the prior standard deviation of a factor
# of the likest partition's weight, from which others take part, and so many at most
_KEPT, _MOST = 1e-5, 600
_COARSE = 5  # of the grid of discrepancies, one in so many
# of a body: the moduli are those of the longer part of it, all but once in a hundred times
_HALF, _RARE = 0.5, 0.01
_STIFFEST = -0.9  # least change of a compliance, over its prior mean


@dataclass(frozen=True)
class Compliance:
    """Which of some unknowns are factors of stiffness, and their changes of compliance."""

    factors: BoolArray  # (X,) whether an unknown is the logarithm of a factor over its prior mean
    nominal: FloatArray  # (X,) prior means

    def of(self, x: FloatArray) -> FloatArray:
        """(…, X) unknowns with changes of compliance in the places of factors."""
        return np.where(self.factors, np.expm1(np.where(self.factors, -x, 0.0)) / self.nominal, x)

    def back(self, y: FloatArray) -> FloatArray:
        """(…, X) unknowns of those with changes of compliance."""
        change = np.maximum(np.where(self.factors, y * self.nominal, 0.0), _STIFFEST)
        return np.where(self.factors, -np.log1p(change), y)

    def slope(self, x: FloatArray) -> FloatArray:
        """(…, X) ∂x/∂y."""
        return np.where(self.factors, -np.exp(np.where(self.factors, x, 0.0)) * self.nominal, 1.0)


class Partitions:
    """The posterior over partitions of a problem whose factors are those of parts, linearised at
    its x.

    Attributes:
        mixture: the posterior of the unknowns y with changes of compliance, absolute: of each
            partition, discrepancy and size that counts.
    """

    def __init__(
        self, problem: LinearProblem, compliance: Compliance, lines: FloatArray, part: IntArray
    ) -> None:
        """Compare the partitions.

        Args:
            problem: of the unknowns of parts.
            compliance: which of them are the parts' factors.
            lines: (F + 1,) x of the lines between parts, m.
            part: number of the part that each factor belongs to.
        """
        self.compliance, self.part, self.count = compliance, part, lines.size - 1
        stretch = _damage_intervals(lines, part)
        share = stretch.T @ np.diff(lines) / (lines[-1] - lines[0])
        size = (
            1
            / np.sqrt(np.diag(problem.prior(0.0))[compliance.factors].min())
            / compliance.nominal[compliance.factors].min()
        )
        partitions = [
            (log, given, ratio * size, stretch[:, list(chosen)])
            for discrepancy, log_prior in zip(
                *grid_of_discrepancies(problem.scale, _COARSE), strict=True
            )
            for given in [_AtDiscrepancy(problem, compliance, float(discrepancy), float(log_prior))]
            for ratio in _SIZES
            for log, chosen in given.likeliest(stretch[part], share, ratio * size)
        ]
        least = max(log for log, *_ in partitions) + np.log(_KEPT)
        partitions = sorted(
            (each for each in partitions if each[0] > least), key=lambda each: -each[0]
        )[:_MOST]
        moments = [given.moments(inside[part], size) for _, given, size, inside in partitions]
        mean, covariance = (np.array(each) for each in zip(*moments, strict=True))
        weight = scipy.special.softmax([log for log, *_ in partitions])
        self.mixture = Mixture(
            weight, mean, covariance, np.array([given.discrepancy for _, given, *_ in partitions])
        )

    @property
    def change(self) -> FloatArray:
        """(m, F) changes of compliance of all parts by partition."""
        change = np.zeros((self.mixture.weight.size, self.count))
        change[:, self.part] = self.mixture.shift[:, self.compliance.factors]
        return change

    @cached_property
    def mean(self) -> FloatArray:
        """(X,) the mean of y."""
        return np.asarray(self.mixture.weight @ self.mixture.shift)

    @property
    def sd(self) -> FloatArray:
        """(X,) standard deviations of y."""
        return np.asarray(np.sqrt(np.diag(self.mixture.total) - self.mean**2))

    def of(self, turn: FloatArray, compliance: Compliance, x: FloatArray) -> Mixture:
        """The posterior, about an x, of combinations of y: rows of `turn`, of which some are
        changes of compliance too.
        """
        each = compliance.back(self.mixture.shift @ turn.T)
        slope = compliance.slope(each)
        covariance = turn @ self.mixture.covariance @ turn.T * slope[:, :, None] * slope[:, None, :]
        return Mixture(self.mixture.weight, each - x, covariance, self.mixture.scale)


class _AtDiscrepancy:
    """The misfit at a discrepancy as one of the parts' changes alone, the other unknowns integrated
    out.
    """

    def __init__(
        self, problem: LinearProblem, compliance: Compliance, discrepancy: float, log_prior: float
    ) -> None:
        hessian, descent, misfit, logs = (
            each[0] for each in problem.of_data(np.array([discrepancy]))
        )
        self.cells, self.rest = (
            np.flatnonzero(compliance.factors),
            np.flatnonzero(~compliance.factors),
        )
        slope, y = compliance.slope(problem.x), compliance.of(problem.x)
        H, g = hessian * np.outer(slope, slope), slope * descent
        b = g + H @ y
        own = H[np.ix_(self.rest, self.rest)] + problem.prior(0.0)[np.ix_(self.rest, self.rest)]
        self.discrepancy, self.inverse = discrepancy, np.linalg.inv(own)
        self.across = self.inverse @ H[np.ix_(self.rest, self.cells)]
        self.A = H[np.ix_(self.cells, self.cells)] - H[np.ix_(self.cells, self.rest)] @ self.across
        self.c = b[self.cells] - self.across.T @ b[self.rest]
        self.mean = self.inverse @ b[self.rest]
        squares = misfit + y @ (g + b) - b[self.rest] @ self.mean
        self.log = log_prior - float(logs + squares + np.linalg.slogdet(own)[1]) / 2

    def likeliest(
        self, inside: FloatArray, share: FloatArray, size: float
    ) -> list[tuple[float, tuple[int, ...]]]:
        """The partitions that count, each the numbers of its stretches, with the logarithms of
        their evidence.

        Args:
            inside: (F, n) of each stretch, 1 for the factors inside.
            share: (n,) of the body's length.
            size: σ.
        """
        log_prior = -np.log(share) - scipy.special.logsumexp(-np.log(share))
        G, c = inside.T @ self.A @ inside, inside.T @ self.c
        d = np.diag(G) + size**-2
        one = log_prior + np.log(_RARE) * (share > _HALF) + (c**2 / d - np.log(size**2 * d)) / 2
        i, j = np.triu_indices(c.size, 1)
        both = d[i] * d[j] - G[i, j] ** 2
        squares = (d[j] * c[i] ** 2 + d[i] * c[j] ** 2 - 2 * G[i, j] * c[i] * c[j]) / both
        two = np.log(2) + log_prior[i] + log_prior[j] + (squares - np.log(size**4 * both)) / 2
        two += np.log(_RARE) * (share[i] + share[j] > _HALF)
        least = max(0.0, one.max(), two.max()) + np.log(_KEPT)
        singles = [(self.log + float(one[k]), (int(k),)) for k in np.flatnonzero(one > least)]
        pairs = [
            (self.log + float(two[k]), (int(i[k]), int(j[k]))) for k in np.flatnonzero(two > least)
        ]
        return [(self.log, ()), *singles, *pairs]

    def moments(self, inside: FloatArray, size: float) -> tuple[FloatArray, FloatArray]:
        """(X,) mean and (X, X) covariance of y, given stretches."""
        count = self.cells.size + self.rest.size
        by = np.empty((count, inside.shape[1]))
        mean = np.zeros(count)
        covariance = np.zeros((count, count))
        by[self.cells], by[self.rest] = inside, -self.across @ inside
        mean[self.rest], covariance[np.ix_(self.rest, self.rest)] = self.mean, self.inverse
        inverse = np.linalg.inv(inside.T @ self.A @ inside + size**-2 * np.eye(inside.shape[1]))
        return mean + by @ (inverse @ (inside.T @ self.c)), covariance + by @ inverse @ by.T


def _damage_intervals(lines: FloatArray, part: IntArray) -> FloatArray:
    """(F, n) every stretch from line to line with a part that may change: 1 inside."""
    number = np.arange(lines.size - 1)
    first, last = np.triu_indices(number.size)
    stretch = ((number[:, None] >= first) & (number[:, None] <= last)).astype(float)
    return stretch[:, stretch[part].any(axis=0)]


# losses, each as likely; what is between those solved for is interpolated
_FINE = np.linspace(0.02, 0.7, 69)
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
        return self.effects.intervals[int(np.argmax(log_sum(self.log, axis=0)))]


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
        prior = effects.log_prior - np.log(_FINE.size)
        discrepancies, log_priors = grid_of_discrepancies(coarse=_COARSE)
        given = [_by_frequencies(self.problem, scatter, s, change) for s in discrepancies]
        both = [(), effects.shapes] if effects.shapes else [()]
        logs = [_likelier(given, log_priors, each) + prior for each in both]
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


def _by_frequencies(
    problem: LinearProblem, scatter: float, s: float, change: FloatArray
) -> DamageTerms:
    """The terms at a discrepancy by (l, P, n) changes of ln f."""
    S, r, root = problem.sensitivity, problem.residual, np.sqrt(problem.weights)[:, None]
    variance, precision = problem.noise + s**2 * np.eye(r.size), problem.prior(scatter)
    W = root * np.linalg.inv(variance) * root.T
    pulled = change @ W
    return DamageTerms(
        cost=float(r @ W @ r + np.linalg.slogdet(variance)[1]),
        hessian=np.sum([S.T @ W @ S + precision, *problem.others.values()], axis=0),
        descent=S.T @ W @ r + problem.other_descent - precision @ problem.x,
        across=change @ (W @ S),
        along=pulled @ r - np.sum(pulled * change, axis=2) / 2,
    )


def _likelier(
    given: list[DamageTerms], log_priors: FloatArray, shapes: tuple[DamageTerms, ...]
) -> FloatArray:
    """(a, P) ln B of each loss and stretch, from what frequencies say at discrepancies of such
    priors, and shapes, if they are asked.
    """
    log_sizes = log_prior_of_scale(SHAPES, 1.0).tolist() if shapes else [0.0]
    both = [[each + own for each in given] for own in shapes] or [given]
    gains = [[each.likelier for each in own] for own in both]
    logs = np.array(
        [
            log_size + log_prior + log
            for log_size, own in zip(log_sizes, gains, strict=True)
            for log_prior, (log, _) in zip(log_priors.tolist(), own, strict=True)
        ]
    )
    weight = (logs - log_sum(logs)).reshape(-1, len(given))
    # ln B is zero without a loss, and nearly a parabola in it.
    over = [np.stack([gain / LOSSES[:, None] for _, gain in own], axis=1) for own in gains]
    each = [
        w[:, None, None] + (_FINE[:, None, None] * _between(own)).transpose(1, 0, 2)
        for w, own in zip(weight, over, strict=True)
    ]
    return log_sum(np.concatenate(each), axis=0)


def _between(over: FloatArray) -> FloatArray:
    """(a, …) of what is smooth, (l, …) at the losses solved for, at all losses."""
    return np.asarray(scipy.interpolate.PchipInterpolator(LOSSES, over)(_FINE))


_PARTS, _FEWEST = 30, 3  # of a body, about; of a zone, at least
# linearisations at most; posterior standard deviations that their point may still move
_LINEARISATIONS, _RESTS = 8, 0.2


def with_damage_intervals(first: ElasticResult, recipe: Recipe) -> ElasticResult:
    """The elastic update of one campaign with zones changed by stretches; as it is where no zone's
    factor is updated.

    Args:
        first: the update with one factor for the whole of each zone.
        recipe: of the update.
    """
    prior = first.prior
    zones = np.array([kind_of(name) == "zone" for name in prior.names])
    if not zones.any():
        return first
    parts = _Parts.of(prior, recipe)
    layout = first.layout.with_prior(parts.prior, reduced=False)
    misfit = Misfit(layout, use_shapes=recipe.use_shapes, fixed_pairing=first.fixed_pairing)
    x = first.x[parts.column]
    for _ in range(_LINEARISATIONS):
        states = layout.solved(x)
        pairings = misfit.partners(states)
        shapes = misfit.shape_errors(states, pairings, first.discrepancy)
        by_shear = misfit.by_shear(states, pairings)
        problem = misfit.linear(x, states, pairings, first.weights, shapes, by_shear)
        number = parts.number[parts.number >= 0]
        partitions = Partitions(problem, parts.compliance, parts.lines, number)
        moved, x = partitions.mean - parts.compliance.of(x), parts.compliance.back(partitions.mean)
        if np.all(np.abs(moved) <= _RESTS * partitions.sd):
            break
    whole = Compliance(zones, prior.prior_mean)
    at = whole.back(parts.to_zones @ partitions.mean)
    mixture = partitions.of(parts.to_zones, whole, at)
    # MacKay, Neural Comput. 4, 1992: the variance s² of a factor's prior that has the largest
    # evidence is E ξ².
    known = prior.prior_mean * np.clip(
        np.sqrt(np.diag(mixture.total) + at**2), LEAST_FACTOR_SD, prior.xi_sd
    )
    body = replace(prior.body, profile=parts.profile(x))  # type: ignore[type-var]
    layout = first.layout.with_prior(
        replace(prior, body=body, prior_sd=np.where(zones, known, prior.prior_sd))
    )
    misfit, states = replace(misfit, layout=layout), layout.solved(at)
    pairings = misfit.partners(states)
    by_shear = misfit.by_shear(states, pairings)
    return replace(
        first,
        layout=layout,
        x=at,
        states=states,
        pairings=pairings,
        problem=misfit.linear(at, states, pairings, first.weights, shapes, by_shear),
        damage_intervals=DamageIntervals(parts.lines, partitions.change, mixture),
    )


@dataclass(frozen=True)
class _Parts:
    """The unknowns of an update with those of each zone's parts in the place of its factor."""

    prior: Parametrisation  # the parameters with parts
    number: IntArray  # (X,) of each, the part that it is the factor of, from 0; -1 of another
    column: IntArray  # (X,) its place among the parameters with zones
    lines: FloatArray  # (F + 1,) x of the lines between parts, m

    @classmethod
    def of(cls, coarse: Parametrisation, recipe: Recipe) -> _Parts:
        """Divide the zones of a strip by its parameters with zones, which a recipe has."""
        body = coarse.body
        count = max(_FEWEST, round(_PARTS / (len(body.zones) + 1)))
        finer = body.divided(count)

        def part(name: str, which: int) -> str:
            return (
                f"zone_{(_number(name) - 1) * count + which}" if kind_of(name) == "zone" else name
            )

        parameters = [
            replace(
                each,
                name=part(each.name, which),
                tied_to=each.tied_to and part(each.tied_to, which),
            )
            for each in recipe.parameters or body.default_parameters()
            for which in range(1, count + 1 if kind_of(each.name) == "zone" else 2)
        ]
        prior = parametrise(finer, parameters)
        if coarse.warmth is not None:
            prior = with_temperature(
                prior, coarse.warmth.reference, coarse.warmth.temperature, reported=False
            )
        own = zip(coarse.names, coarse.prior_sd.tolist(), strict=True)
        prior = prior.with_inputs(
            {name: sd for name, sd in own if name not in {*coarse.reported, *prior.names}}
        )
        number = np.array(
            [_number(name) - 1 if kind_of(name) == "zone" else -1 for name in prior.names]
        )
        owner = [
            f"zone_{k // count + 1}" if k >= 0 else n
            for k, n in zip(number, prior.names, strict=True)
        ]
        column = np.array([coarse.names.index(name) for name in owner])
        return cls(prior, number, column, np.array([0.0, *finer.zones, body.nominal["length"]]))

    @property
    def compliance(self) -> Compliance:
        """Which unknowns are factors of parts."""
        return Compliance(self.number >= 0, self.prior.prior_mean)

    @property
    def to_zones(self) -> FloatArray:
        """(p, X) the means over the parts of each zone; of another unknown itself."""
        mine = self.column == np.arange(self.column.max() + 1)[:, None]
        return np.asarray(mine / mine.sum(axis=1, keepdims=True))

    def profile(self, x: FloatArray) -> tuple[float, ...]:
        """Changes of compliance from 1 of the parts at an x, over their zones' means.

        Where the parts of a zone change in both directions, or not at all, its change is even.
        """
        factors, profile = self.number >= 0, np.ones(self.lines.size - 1)
        change = np.where(factors, np.exp(-x) / self.prior.prior_mean - 1, 0.0)
        mean, size = self.to_zones @ change, self.to_zones @ np.abs(change)
        uneven = np.abs(mean) > size / 2
        share = np.where(
            uneven[self.column], change / np.where(uneven, mean, 1.0)[self.column], 1.0
        )
        profile[self.number[factors]] = share[factors]
        return tuple(profile.tolist())


def _number(name: str) -> int:
    return int(name.rpartition("_")[2])
