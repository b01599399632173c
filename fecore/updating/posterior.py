"""The posterior of stage 1, and whether each measured mode is one of the structure.

The posterior of stage 1: Gaussian in its unknowns for a given discrepancy s and scatter τ, which
both are marginalised.

A body is never its model: each of its natural frequencies is off by a share ε ~ N(0, s²), and s is
not known. Its prior is a scaled inverse χ² of ν₀ = 2 degrees of freedom about s₀ = 0.1 %: between
what plate theory misses, 0.05 %, and what real laminates show, 0.2 %. Where a laboratory's inputs
say that a body is more even than that, s₀ is smaller (`inputs`), but
a thickness that is known well need not be the same everywhere: half of the prior is about such an
s₀, half about a scale that lies anywhere between it and 0.1 %, even in its logarithm, as nobody
knows its order of magnitude (Jeffreys 1946). So modes that follow the model closely keep their
narrow intervals, and modes that scatter have those of laminates that do. The constants of a
specimen, or of a set, are off the material's by a share of standard deviation τ, with the same kind
of prior about its own scale (Gelman et al., Bayesian Data Analysis, 3rd ed., 5, 11.6 and 14).

With the residuals r = ln f_measured - ln f at the estimate, their derivative S by the unknowns, the
noise N, prior precision P(τ) and the hessian A of what is no frequency (coupons, shapes), the
posterior is a mixture over a grid of ln s and ln τ of

    N(x̂ + δ, H⁻¹),    H = SᵀW_sS + A + P(τ),    W_s = (N + s²)⁻¹,    δ = H⁻¹g,
    log p(s, τ | f) = log p(s) + log p(τ) + ½ (log|W_s| + log|P(τ)| - log|H| - rᵀW_sr - x̂ᵀPx̂ +
    gᵀδ) + const.

with the descent g at the estimate. With few modes its tails are those of a Student t.

Whether each measured mode is one of the structure: its probability P before the update, and what
the model makes of it.

A mode that is none lies anywhere in the band. So the likelihood of the residual r = ln f_measured -
ln f is a mixture,

    P N(r; 0, σ²) + (1 - P)/W,      W = f_max/f: uniform from 0 Hz to the highest measured frequency, as a density of ln f,

and the posterior of the unknowns one over all sets of modes that may be real. Given the others,
mode k is real with w,

    w/(1 - w) = P W/(1 - P) · (p(all with k)/p(all without k) + π N(e; 0, σ_π²)),

the evidence with the unknowns and the discrepancy integrated out: the mode itself does not widen
what it is judged by. The second term is that of a real mode which the model misses by far, e from
what the others predict: of another material, boundary or length than stated. So a mode that is
certain is not taken for none where it contradicts a wrong model. The estimate is that of the
likeliest set, found anew in every turn of the fit (hard expectation maximisation): the data of a
mode with w < ½ have no weight. The posterior about it holds the sets that differ from it in one
mode, each with its Gaussians and by its odds. Where P = 1 for all, as where somebody typed the
modes in, nothing of this changes a result.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from fecore.arrays import BoolArray, FloatArray, log_sum

DISCREPANCY = 0.001
"""Prior scale s₀ of the model's error in a natural frequency, as a share of it."""

SHAPE_DISCREPANCY = 0.01
"""Standard deviation of a measured shape about the model's at a point, as a share of the shape's
largest entry.
"""

DISCREPANCY_DOF = 2.0
"""Degrees of freedom ν₀ of that prior: what two modes would say."""

SCATTER = 0.02
"""Prior scale of the scatter τ of a modulus between specimens: what coupons of one panel show."""

COMMON = "common material of the sets"
"""Name of the information that sets of one material give one another."""

_SCALES = 12  # between which the prior's scale may lie
_GRID = np.linspace(np.log(0.1), np.log(30.0), 41)  # ln s over s₀
_SCATTERS = np.exp(np.linspace(np.log(0.1), np.log(8.0), 9))  # τ over its scale
_POINT = 1e-6  # of the widest Gaussian's standard deviation: what is narrower is a point
# share of the prior's variance below which the data have supplied most of what is known
_INFORMED = 0.5
# of the prior's variance that is left along a direction of which the data say next to nothing
_NULL_SHARE = 0.9
# share of a parameter's unit vector in the space of such directions that makes it one of theirs
_IN_NULL = 0.1


@dataclass(frozen=True)
class Identifiability:
    """What the data say of one parameter."""

    name: str  # the parameter
    # whether the data, rather than the prior, supply most of what is known of it, and no direction
    # that the data do not see moves it
    identifiable: bool
    information: float  # 1 - (posterior sd / prior sd)², from 0 (nothing learnt) to 1
    # other parameters and inputs that move with it in such a direction
    confounded_with: tuple[str, ...] = ()


def identifiability(
    names: tuple[str, ...], covariance: FloatArray, prior_sd: FloatArray
) -> tuple[Identifiability, ...]:
    """Of each of p parameters, from the (p, p) posterior covariance and the (p,) prior standard
    deviations, in coordinates.
    """
    information = _information(covariance, prior_sd)
    unseen = null_directions(covariance, prior_sd)
    # projector on what the data do not see: the same for any basis of it
    shared = np.abs(unseen.T @ unseen)
    return tuple(
        Identifiability(
            name,
            bool(information[i] > _INFORMED and shared[i, i] < _IN_NULL),
            float(information[i]),
            tuple(names[j] for j in np.flatnonzero(shared[i] > _IN_NULL) if j != i),
        )
        for i, name in enumerate(names)
    )


def spread_over(
    known: tuple[Identifiability, ...], covariance: FloatArray, prior_sd: FloatArray
) -> tuple[Identifiability, ...]:
    """The same where the posterior is wider than it was judged by, from its (p, p) second moments
    about the estimate.
    """
    information = _information(covariance, prior_sd)
    return tuple(
        replace(
            each, identifiable=bool(each.identifiable and left > _INFORMED), information=float(left)
        )
        for each, left in zip(known, information, strict=True)
    )


def _information(covariance: FloatArray, prior_sd: FloatArray) -> FloatArray:
    """(p,) share of what is known of each parameter that the data supply."""
    return np.maximum(1 - np.diag(covariance) / prior_sd**2, 0)


def root(covariance: FloatArray, of: FloatArray | None = None) -> FloatArray:
    """R with RRᵀ = a covariance that may be singular; scaled first, as SI units spread over fifteen
    decades.

    A difference of two covariances may be none: it is scaled as the larger one, `of`, and what is
    negative is left out.
    """
    scale = np.sqrt(np.maximum(np.diag(covariance if of is None else of), 1e-300))
    value, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    factor: FloatArray = scale[:, None] * vectors * np.sqrt(np.maximum(value, 0))
    return factor


def null_directions(covariance: FloatArray, prior_sd: FloatArray) -> FloatArray:
    """(d, p) unit vectors, in prior standard deviations, along which more than 0.9 of the prior
    variance is left.
    """
    share, directions = np.linalg.eigh(covariance / np.outer(prior_sd, prior_sd))
    unseen: FloatArray = directions.T[share > _NULL_SHARE]
    return unseen


def discrepancy(relative_residual: FloatArray, fitted: float, prior: float) -> float:
    """Root of the posterior mean variance of a relative discrepancy, from residuals and its own
    prior.

    s² = (ν₀ s₀² + Σ r²) / (ν₀ + n - p). With five modes the residuals alone have one or two degrees
    of freedom.

    Args:
        relative_residual: (n,) residuals as shares of the measured values.
        fitted: p, number of parameters that the residuals determined.
        prior: s₀.
    """
    freedom = max(relative_residual.size - fitted, 0.0)
    total = DISCREPANCY_DOF * prior**2 + float(np.sum(relative_residual**2))
    return float(np.sqrt(total / (DISCREPANCY_DOF + freedom)))


@dataclass(frozen=True)
class Mixture:
    """A mixture of Gaussians about an estimate."""

    weight: FloatArray  # (m,) of each
    shift: FloatArray  # (m, p) of its mean from the estimate
    covariance: FloatArray  # (m, p, p)
    scale: FloatArray  # (m,) the discrepancy s that each belongs to

    @property
    def total(self) -> FloatArray:
        """(p, p) second moments about the estimate."""
        spread = np.einsum("m,mpq->pq", self.weight, self.covariance)
        total: FloatArray = spread + np.einsum("m,mp,mq->pq", self.weight, self.shift, self.shift)
        return total

    @classmethod
    def joined(cls, share: FloatArray, shift: FloatArray, parts: Sequence[Mixture]) -> Mixture:
        """Several mixtures by their (k,) shares, each about a point that lies off the estimate by
        its row of (k, p).
        """
        return cls(
            np.concatenate([part * each.weight for part, each in zip(share, parts, strict=True)]),
            np.concatenate([off + each.shift for off, each in zip(shift, parts, strict=True)]),
            np.concatenate([each.covariance for each in parts]),
            np.concatenate([each.scale for each in parts]),
        )

    def reach(self, along: FloatArray, probability: float = 0.95) -> tuple[float, float]:
        """How far the central interval of a (p,) combination reaches below and above the estimate,
        both positive or nothing.
        """
        mean = self.shift @ along
        sd = np.sqrt(np.einsum("p,mpq,q->m", along, self.covariance, along))
        if not np.any(sd > 0):
            return 0.0, 0.0
        sd = np.maximum(sd, _POINT * sd.max())
        widest = float(np.abs(mean).max() + 40 * sd.max())
        tail = (1 - probability) / 2
        low, high = (
            scipy.optimize.brentq(
                lambda x, p=p: float(self.weight @ scipy.special.ndtr((x - mean) / sd)) - p,
                -widest,
                widest,
            )
            for p in (tail, 1 - tail)
        )
        return max(-low, 0.0), max(high, 0.0)


@dataclass(frozen=True)
class LinearProblem:
    """Stage 1's problem at an estimate, linear in the step from it."""

    residual: FloatArray  # (n,) ln f_measured - ln f
    noise: FloatArray  # (n, n) covariance of ln f_measured, and of what the model is known to miss
    sensitivity: FloatArray  # (n, X) derivative of ln f by x
    x: FloatArray  # (X,) the estimate; the prior's mean is 0
    prior: Callable[[float], FloatArray]  # precision P (X, X) for a scatter
    # by name, (X, X) information of what is no frequency: coupons, mode shapes
    others: Mapping[str, FloatArray]
    # other_descent, other_cost: their descent (X,) and misfit
    other_descent: FloatArray
    other_cost: float = 0.0
    # (n,) w, 1 of a frequency that is taken for one of a mode, 0 of another (`weights_of`): W_s
    # becomes √w W_s √w
    weight: FloatArray | float = 1.0
    scale: float = DISCREPANCY  # s₀

    def at(self, discrepancy: float, scatter: float) -> tuple[float, FloatArray, FloatArray]:
        """The misfit E at a discrepancy and a scatter, its descent (X,) and its hessian H (X,
        X).
        """
        hessian, descent, (misfit,), _ = self.of_data(np.array([discrepancy]))
        precision = self.prior(scatter)
        restoring = precision @ self.x
        return (
            (float(misfit) + float(self.x @ restoring)) / 2 + self.other_cost,
            descent[0] - restoring,
            hessian[0] + precision,
        )

    def solve(self, discrepancy: float, scatter: float) -> tuple[FloatArray, FloatArray]:
        """(X,) step and (X, X) covariance at a discrepancy and a scatter."""
        _, descent, hessian = self.at(discrepancy, scatter)
        covariance: FloatArray = np.linalg.inv(hessian)
        return covariance @ descent, covariance

    def gain(self, discrepancy: float, scatter: float) -> FloatArray:
        """(X, n) G = H⁻¹SᵀW_s: how the estimate follows the logarithms of the measured
        frequencies.
        """
        _, covariance = self.solve(discrepancy, scatter)
        gain: FloatArray = (
            covariance
            @ self._weighted(self._variance(np.array([discrepancy])), self.sensitivity)[0].T
        )
        return gain

    def of_another(self, by: FloatArray, discrepancy: float, scatter: float) -> tuple[float, float]:
        """Score eᵀWμ and information eᵀMe of one more unknown, which changes ln f by (n,) e, where
        the others follow.
        """
        step, covariance = self.solve(discrepancy, scatter)
        weighted = self._weighted(self._variance(np.array([discrepancy])), by[:, None])[0, :, 0]
        across = self.sensitivity.T @ weighted
        return float(weighted @ (self.residual - self.sensitivity @ step)), float(
            weighted @ by - across @ covariance @ across
        )

    def informed(self, discrepancy: float, scatter: float) -> float:
        """How many unknowns the frequencies determine at a discrepancy and a scatter: tr(GS)."""
        return float(np.trace(self.gain(discrepancy, scatter) @ self.sensitivity))

    def only(self, rows: BoolArray) -> LinearProblem:
        """The problem of some frequencies alone: (n,) `rows` says which."""
        return replace(
            self,
            residual=self.residual[rows],
            noise=self.noise[np.ix_(rows, rows)],
            sensitivity=self.sensitivity[rows],
            weight=self.weights[rows],
        )

    @property
    def weights(self) -> FloatArray:
        """(n,) w."""
        return np.broadcast_to(self.weight, self.residual.shape)

    def with_weight(self, number: int, weight: float) -> LinearProblem:
        """The problem with another weight of one frequency."""
        return replace(
            self, weight=np.where(np.arange(self.residual.size) == number, weight, self.weights)
        )

    def log_evidence(self, scatter: float) -> float:
        """The logarithm of the evidence at a scatter, the unknowns and the discrepancy integrated
        out, up to a constant.
        """
        discrepancies, log_prior = grid_of_discrepancies(self.scale)
        *_, evidence = self._solve_all(discrepancies, np.array([scatter]))
        return float(log_sum(evidence[0] + log_prior))

    def discrepancy(self, present: float, scatter: float) -> float:
        """The discrepancy as the residuals give it, where so many unknowns are determined as at
        given scales.
        """
        root, fitted = np.sqrt(self.weights), self.informed(present, scatter)
        return discrepancy(
            root * self.residual,
            fitted + self.residual.size - float(self.weights.sum()),
            self.scale,
        )

    def _variance(self, discrepancies: FloatArray) -> FloatArray:
        """(s, n, n) W_s⁻¹ at (s,) discrepancies."""
        variance: FloatArray = self.noise + discrepancies[:, None, None] ** 2 * np.eye(
            self.residual.size
        )
        return variance

    def _weighted(self, variance: FloatArray, columns: FloatArray) -> FloatArray:
        """(s, n, c) √w W_s √w times some columns."""
        root = np.sqrt(self.weights)[:, None]
        return np.asarray(root * np.linalg.solve(variance, root * columns))

    def mixture(self, scatter_scale: float) -> tuple[Mixture, FloatArray]:
        """The posterior about the estimate, and (m,) the scatter of each of its Gaussians; a scale
        of 0 has no scatter.
        """
        discrepancies, log_prior = grid_of_discrepancies(self.scale)
        scatters, probability = prior_of_scatter(scatter_scale)
        step, covariance, evidence = self._solve_all(discrepancies, scatters)
        log_weight = evidence + log_prior + np.log(probability)[:, None]
        weight, size = np.exp(log_weight - log_sum(log_weight)).ravel(), self.x.size
        scale = np.tile(discrepancies, scatters.size)
        mixture = Mixture(weight, step.reshape(-1, size), covariance.reshape(-1, size, size), scale)
        return mixture, np.repeat(scatters, discrepancies.size)

    def at_scatter(self, scatter: float) -> tuple[Mixture, FloatArray]:
        """The posterior about the estimate at a scatter, and (m,) the logarithms of its weights,
        which hold those too that are 0 to rounding.
        """
        discrepancies, log_prior = grid_of_discrepancies(self.scale)
        step, covariance, evidence = (
            part[0] for part in self._solve_all(discrepancies, np.array([scatter]))
        )
        log_weight: FloatArray = scipy.special.log_softmax(evidence + log_prior)
        return Mixture(np.exp(log_weight), step, covariance, discrepancies), log_weight

    def evidence_of_scatter(self, scale: float) -> tuple[float, float]:
        """Logarithm of how much likelier the data are with the scatter's prior than with its scale,
        and its estimate then.
        """
        scatters, prior = prior_of_scatter(scale)
        each = np.array([self.log_evidence(float(scatter)) for scatter in scatters])
        weight = scipy.special.softmax(each + np.log(prior))
        gain = scipy.special.logsumexp(each, b=prior) - self.log_evidence(scale)
        return float(gain), float(np.sqrt(weight @ scatters**2))

    def _solve_all(
        self, discrepancies: FloatArray, scatters: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(t, s, X) steps, (t, s, X, X) covariances and (t, s) evidence at every pair of t scatters
        and s discrepancies.
        """
        own, of_residuals, misfit, logs = self.of_data(discrepancies)
        precision = np.array([self.prior(float(scatter)) for scatter in scatters])
        hessian = own + precision[:, None]
        descent = of_residuals - (precision @ self.x)[:, None]
        covariance = np.linalg.inv(hessian)
        step = (covariance @ descent[..., None])[..., 0]
        gain = np.sum(descent * step, axis=-1) - misfit - (precision @ self.x @ self.x)[:, None]
        logs = np.linalg.slogdet(precision)[1][:, None] - np.linalg.slogdet(hessian)[1] - logs
        return step, covariance, (gain + logs) / 2

    def of_data(
        self, discrepancies: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """What no scatter changes, for each discrepancy: hessian and descent without the prior's,
        rᵀW_sr and -log|W_s|.
        """
        variance = self._variance(discrepancies)
        weighted = self._weighted(variance, np.column_stack([self.sensitivity, self.residual]))
        S, r = weighted[..., :-1], weighted[..., -1:]
        # Of a frequency that is no mode's the variance says nothing.
        known = np.log(np.diagonal(variance, axis1=1, axis2=2)) @ (1 - self.weights)
        counted = np.linalg.slogdet(variance)[1] - known
        hessian = self.sensitivity.T @ S + np.sum(
            [np.zeros((self.x.size,) * 2), *self.others.values()], axis=0
        )
        descent = (self.sensitivity.T @ r)[..., 0] + self.other_descent
        return hessian, descent, r[..., 0] @ self.residual, counted


def grid_of_discrepancies(
    scale: float = DISCREPANCY, coarse: int = 1
) -> tuple[FloatArray, FloatArray]:
    """(s,) values of the discrepancy, one in so many of the grid, and the logarithms of their prior
    probabilities.

    However small its scale, it may be what a body shows that is not as it is stated.
    """
    low, high = _GRID[0] + np.log(scale), _GRID[-1] + np.log(DISCREPANCY)
    discrepancies = np.exp(np.linspace(low, high, _GRID.size)[::coarse])
    return discrepancies, _log_prior_of_discrepancy(discrepancies, scale)


def _log_prior_of_discrepancy(discrepancies: FloatArray, scale: float) -> FloatArray:
    """Of ln s: half about the scale, half about one that lies between it and that of usual
    laminates; up to a constant.
    """
    among = np.geomspace(scale, DISCREPANCY, _SCALES)[:, None]
    uneven = log_prior_of_scale(discrepancies, among) + DISCREPANCY_DOF * np.log(among / scale)
    log: FloatArray = np.logaddexp(
        log_prior_of_scale(discrepancies, scale),
        log_sum(uneven, axis=0) - np.log(_SCALES),
    )
    return np.asarray(log - np.log(2))


def prior_of_scatter(scale: float) -> tuple[FloatArray, FloatArray]:
    """(t,) values of the scatter and their prior probabilities; a scale of 0 has no scatter."""
    if not scale:
        return np.zeros(1), np.ones(1)
    scatters = scale * _SCATTERS
    return scatters, scipy.special.softmax(log_prior_of_scale(scatters, scale))


def log_prior_of_scale(value: FloatArray, scale: FloatArray | float) -> FloatArray:
    """Of ln s for a scaled inverse χ² of two degrees of freedom, up to a constant."""
    log: FloatArray = -DISCREPANCY_DOF * (np.log(value) + scale**2 / (2 * value**2))
    return log


def log_likelihood(
    noise: FloatArray, weights: FloatArray | float = 1.0, scale: float = DISCREPANCY
) -> Callable[[FloatArray], FloatArray]:
    """The logarithm of p(r), up to a constant, of (w, n) residuals of ln f with (n, n) noise, the
    discrepancy marginalised.

    Each counts as far as its (n,) weight says that it is one of a mode.
    """
    s, log_prior = grid_of_discrepancies(scale)
    weights = np.broadcast_to(weights, len(noise))
    values, turn = np.linalg.eigh(noise)
    variance = np.maximum(values, 0) + s[:, None] ** 2
    logs, uncounted = np.log(variance), turn.T**2 @ (1 - weights)
    constant, inverse = log_prior - (logs.sum(axis=1) - logs @ uncounted) / 2, (1 / variance).T
    weighted_turn = np.sqrt(weights)[:, None] * turn

    def value(residual: FloatArray) -> FloatArray:
        each = constant - (residual @ weighted_turn) ** 2 @ inverse / 2
        return log_sum(each, axis=1)

    return value


FAR_OFF = 0.01  # π: of the modes, that the model misses by far more than its discrepancy

_THEN_BY = 0.05  # by how much then: as a wrong boundary, thickness or material does


def weights_of(
    problem: LinearProblem, probability: FloatArray, width: FloatArray, scatter: float
) -> FloatArray:
    """Find w of the frequencies of a problem, each given which of the others are taken for real.

    Args:
        problem: at an estimate, with the present weights.
        probability: (n,) P.
        width: (n,) W.
        scatter: the scatter τ between specimens.

    Returns:
        (n,) w, 1 where P is.
    """
    weights: FloatArray = np.ones(probability.size)
    for k in np.flatnonzero(probability < 1).tolist():
        none = problem.with_weight(k, 0.0)
        fits = (
            problem.with_weight(k, 1.0).log_evidence(scatter)
            - none.log_evidence(scatter)
            - np.log(2 * np.pi) / 2
        )
        real = np.logaddexp(fits, np.log(FAR_OFF) + _log_far_off(none, k, scatter))
        weights[k] = scipy.special.expit(_logit(probability[k]) + np.log(width[k]) + real)
    return weights


def _log_far_off(others: LinearProblem, k: int, scatter: float) -> float:
    """Ln N(e; 0, σ_π²) of a frequency that has no weight in a problem, the spread of its prediction
    included.
    """
    step, covariance = others.solve(DISCREPANCY, scatter)
    along = others.sensitivity[k]
    variance = others.noise[k, k] + _THEN_BY**2 + float(along @ covariance @ along)
    return float(
        -(np.log(2 * np.pi * variance) + (others.residual[k] - along @ step) ** 2 / variance) / 2
    )


def _logit(probability: FloatArray | float) -> FloatArray:
    with np.errstate(divide="ignore"):  # what is certain has infinite odds
        return np.asarray(scipy.special.logit(probability))


def over_sets(
    problem: LinearProblem, mode_inclusion: FloatArray, scatter_scale: float, given: Mixture
) -> Mixture:
    """The posterior about the estimate over which modes are real.

    Args:
        problem: at the estimate, of the likeliest set: weights 1 and 0.
        mode_inclusion: (n,) w of each mode.
        scatter_scale: of the scatter between specimens; 0 for none.
        given: the posterior of that set, which is all where there is no doubt.
    """
    doubted = np.flatnonzero(mode_inclusion < 1).tolist()
    if not doubted:
        return given
    other = np.abs(problem.weights - mode_inclusion)[doubted]  # probability of the other verdict
    share = np.concatenate([[1.0], other / np.maximum(1 - other, 1e-300)])
    sets = [
        problem.with_weight(k, 1 - problem.weights[k]).mixture(scatter_scale)[0] for k in doubted
    ]
    return Mixture.joined(
        share / share.sum(), np.zeros((share.size, problem.x.size)), [given, *sets]
    )


def spurious_mode_penalty(
    weights: FloatArray, probability: FloatArray, width: FloatArray, discrepancy: float
) -> float:
    """In log evidence, what modes cost that are taken for none: the density of the band beside that
    of a mode that fits.
    """
    off = weights < 1
    fits = _logit(probability[off]) + np.log(width[off]) - np.log(2 * np.pi * discrepancy**2) / 2
    return float((1 - weights[off]) @ np.maximum(fits, 0.0))
