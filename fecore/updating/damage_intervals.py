"""The posterior over stretches of a body that may have another stiffness: none, one or two, from
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
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from fecore.arrays import BoolArray, FloatArray, IntArray
from fecore.updating.posterior import LinearProblem, Mixture, grid_of_discrepancies

_SIZES = (1 / 3, 1.0, 3.0)  # σ over the prior standard deviation of a factor
# of the likest partition's weight, from which others take part, and so many at most
_KEPT, _MOST = 1e-5, 600
_COARSE = 5  # of the grid of discrepancies, one in so many
# of a body: the moduli are those of the longer part of it, all but once in a hundred times
_HALF, _RARE = 0.5, 0.01
_STIFFEST = -0.9  # least change of a compliance, over its prior mean


@dataclass(frozen=True)
class DamageIntervals:
    """Which parts of a body have another stiffness, as far as its modes show."""

    lines: FloatArray  # (F + 1,) x of the lines between parts, m
    # (m, F) changes of compliance of the parts, by partition; 0 outside its stretches
    change: FloatArray
    # the posterior of the reported unknowns about their estimate, one Gaussian a partition
    mixture: Mixture

    @property
    def probability(self) -> float:
        """That any stretch has another stiffness."""
        return float(self.mixture.weight @ self.change.any(axis=1))

    def extent(self, probability: float = 0.95) -> tuple[float, float, float, float]:
        """Between which x, m, so much of the change lies, and the least and the greatest length, m,
        that it may be spread over.

        The length of a partition is (∫|δ| dx)²/∫δ² dx, which of one stretch is its own.
        """
        some, long, tail = self.change.any(axis=1), np.diff(self.lines), (1 - probability) / 2
        weight, size = self.mixture.weight[some], np.abs(self.change[some])
        length = (size @ long) ** 2 / (size**2 @ long)
        there = np.concatenate(
            [[0.0], np.cumsum(long * (weight @ (size / (size @ long)[:, None])))]
        )
        begin, end = np.interp([tail, 1 - tail], there / there[-1], self.lines).tolist()
        order = np.argsort(length)
        least, most = np.interp(
            [tail, 1 - tail], np.cumsum(weight[order]) / weight.sum(), length[order]
        ).tolist()
        return begin, end, least, most


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
        return np.where(
            self.factors,
            -np.log1p(np.maximum(np.where(self.factors, y * self.nominal, 0.0), _STIFFEST)),
            y,
        )

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
