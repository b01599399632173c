"""From FRFs to the series of poles that they need, fitted to all of them: search, drift, company,
last fit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fecore.arrays import BoolArray, ComplexArray, FloatArray
from fecore.modal.arrangement import Arrangement
from fecore.modal.basis import BESIDE, Terms
from fecore.modal.compression import compress
from fecore.modal.drift import aligned, drift_of, drift_price
from fecore.modal.error_model import memory, shared_error
from fecore.modal.evidence import evidence_of
from fecore.modal.growth import (
    ENOUGH,
    ROUNDS,
    STEPS,
    grow,
    likely,
    linear_weight,
    local_level,
    pruned,
    settled,
    with_residual_terms,
)
from fecore.modal.lscf import LinearPoles, clusters, linear_poles
from fecore.modal.noise import student
from fecore.modal.probability import probability
from fecore.modal.refinement import Fit, Level, level_at, refine, spare

_CULLS = 2  # turns of probability and refinement
# steps, and the decrease of χ² that ends them, of the poles that stand: a move of a tenth of a
# standard deviation
_MANY, _SETTLED = 16, 1e-2
_LAST = 3  # steps of the refinement with all FRFs and a weight for each value
_ONE = 0.05  # distance below which the residues of two poles cancel, and have no phase of their own
# probability below which a pole is rather no mode, and what it takes up is error of its neighbours
_RATHER = 0.5

Report = Callable[[str, float], None]


@dataclass(frozen=True)
class Fitted:
    """The series fitted to all FRFs."""

    arrangement: Arrangement  # the FRFs without their drift
    fit: Fit  # of the poles that may be modes, or stand out of band or for much
    whole: Level  # the fit before, of all n poles
    free: BoolArray  # (n,) those of the last fit
    noise: FloatArray  # (N, L) variance of the FRFs' noise
    linear: LinearPoles  # the linear poles
    drift: FloatArray  # (N,) relative drift of each FRF's frequencies, all 0 where no drift pays
    full: bool  # whether the search had as many poles as it may

    @property
    def covariance(self) -> FloatArray:
        """(2n, 2n) covariance of (ln f, ζ).

        The mean of as many drifts as there are tests is common to all frequencies. Where the mass
        of a roving sensor moves them, modes do not drift alike: each may be off by the mean of the
        drifts by its own power in the FRFs.
        """
        covariance, n = self.fit.parameter_covariance.copy(), self.fit.terms.pairs
        power = np.abs(self.fit.residues) ** 2
        own = self.drift @ power / np.maximum(power.sum(axis=0), np.finfo(float).tiny)
        covariance[:n, :n] += self.drift.var() / self.arrangement.sessions + np.diag(own**2)
        return covariance


def fit_series(
    arrangement: Arrangement, noise: FloatArray, highest: int, most: int, report: Report
) -> Fitted:
    """Search the poles, align the tests and fit all FRFs.

    Args:
        arrangement: the FRFs.
        noise: (N, L) variance of their noise.
        highest: order of the linear stage.
        most: largest number of poles.
        report: called with the progress.
    """
    data = _Data.of(arrangement, noise)
    report("linear estimates", 0.05)
    linear = linear_poles(
        data.few.omega, data.few.values, linear_weight(data.few, data.few_noise), highest
    )
    most = min(most, int(arrangement.measured.sum(axis=1).min()) // 4)
    step, pool = _steps(report), clusters(linear)
    empty = Terms(np.empty(0), np.empty(0), (-2, 0))
    terms = data.grown(empty, pool, most, step, 1)
    still, terms, drift = _aligned(data, terms, pool, most, step)
    fit = still.fitted(still.settled(terms, steps=_MANY, enough=_SETTLED))
    report("refining with all FRFs", 0.6)
    full = fit.terms.pairs >= most
    fit = _without_company(still, fit)
    report("refining with all FRFs", 0.8)
    last, free = _last(still, fit)
    return Fitted(still.arrangement, last, fit, free, noise, linear, drift=drift, full=full)


@dataclass(frozen=True)
class _Data:
    """All FRFs and the few combinations that stand for them, each with the variance of its
    noise.
    """

    arrangement: Arrangement
    noise: FloatArray
    few: Arrangement
    few_noise: FloatArray

    @classmethod
    def of(cls, arrangement: Arrangement, noise: FloatArray) -> _Data:
        return cls(arrangement, noise, *compress(arrangement, noise))

    def settled(
        self,
        terms: Terms,
        before: Terms | None = None,
        steps: int = STEPS,
        enough: float = ENOUGH,
    ) -> Terms:
        """The poles refined on the combinations, under the variance that they leave, or poles
        before them.

        Where poles left, the others would make a variance large first that then lets them stray.
        """
        variance = local_level(self.few, before or terms, self.few_noise).variance
        level = level_at(self.few, terms, variance)
        return settled(self.few, level, steps, enough=enough).terms

    def grown(
        self,
        terms: Terms,
        pool: ComplexArray,
        most: int,
        step: Callable[[int], None],
        rounds: int = ROUNDS,
    ) -> Terms:
        """The poles with those, of the candidates and of what the residual shows, that the
        combinations need.
        """
        beside = len(self.arrangement.pairs) - len(self.few.pairs)
        return grow(
            self.few, self.few_noise, most, step, terms, pool=pool, rounds=rounds, beside=beside
        ).terms

    def fitted(self, terms: Terms) -> Level:
        """The series with all FRFs, without poles and residual terms that do not pay."""
        terms = with_residual_terms(self.arrangement, terms)
        return pruned(self.arrangement, local_level(self.arrangement, terms, self.noise))


def _steps(report: Report) -> Callable[[int], None]:
    """Reports the rounds of the search."""
    rounds = 0

    def step(count: int) -> None:
        nonlocal rounds
        rounds += 1
        report(f"searching poles: {count} found", 0.1 + 0.5 * (1 - 0.7**rounds))

    return step


def _aligned(
    data: _Data, terms: Terms, pool: ComplexArray, most: int, step: Callable[[int], None]
) -> tuple[_Data, Terms, FloatArray]:
    """The FRFs and the series that they need, grown from a first one: without the drift of their
    tests where it pays.

    Poles that the series lacks may pass for a drift, and a drift for poles. So both grow on aligned
    FRFs first, and the same poles, refined, must do worse by the price of the drift without it.
    """
    fit = data.fitted(terms)
    pool = np.append(pool, terms.poles)
    price = drift_price(data.arrangement, fit)
    found = drift_of(
        data.arrangement, fit, price, lambda moved, own: _Data.of(moved, data.noise).settled(own)
    )
    if found is not None:
        each, moved = found
        still = _Data.of(aligned(data.arrangement, moved, fit.weight, each), data.noise)
        grown = still.grown(moved, pool, most, step)
        still = _Data.of(aligned(data.arrangement, grown, fit.weight, each), data.noise)
        left = level_at(still.arrangement, still.settled(grown), fit.variance).chi_squared
        without = level_at(data.arrangement, data.settled(grown), fit.variance).chi_squared
        if without - left > price:
            return still, grown, each
    return data, data.grown(terms, pool, most, step), np.zeros(len(data.arrangement.pairs))


def _without_company(data: _Data, fit: Level) -> Level:
    """The fit without refused poles that only bend a better one beside them, or that no distance
    parts from a larger one.
    """
    for _ in range(_CULLS):
        if not fit.terms.pairs:
            break
        evidence = evidence_of(data.arrangement, fit)
        p = probability(evidence, fit.terms.damping_ratio)
        gone = _company(data.arrangement, fit.terms, p) | (evidence.apart < _ONE)
        if not gone.any():
            break
        fit = data.fitted(data.settled(fit.terms.some(~gone), fit.terms))
    return fit


def _company(arrangement: Arrangement, terms: Terms, p: FloatArray) -> BoolArray:
    """(n,) poles in band that are hardly modes and overlap one with a better probability."""
    width = terms.half_bandwidth_hz
    apart = np.abs(terms.frequency_hz[:, None] - terms.frequency_hz) / (width[:, None] + width)
    good = p >= _RATHER
    return np.asarray(
        ~good & arrangement.in_band(terms.frequency_hz) & (apart[:, good] < BESIDE).any(axis=1)
    )


def _last(data: _Data, level: Level) -> tuple[Fit, BoolArray]:
    """A few steps with a variance for each value (Student's law of the errors), and what the
    covariance needs; and (n,) the poles that have a part in it.

    What hardly is a mode stands fixed in the background.
    """
    arrangement = data.arrangement
    variance = student(arrangement, level.residual, data.noise, spare(arrangement, level))
    free = likely(arrangement, level)
    background = level.part(np.flatnonzero(np.repeat(~free, 2))) if not free.all() else 0.0
    start = level.terms.some(free)
    fit = refine(arrangement, start, variance, steps=_LAST, background=background)
    tau = memory(fit.residual, fit.variance, arrangement.measured, fit.model)
    shared = _shared(arrangement, fit)
    change = np.concatenate(
        [
            np.log(fit.terms.frequency_hz / start.frequency_hz),
            fit.terms.damping_ratio - start.damping_ratio,
        ]
    )
    return replace(
        fit, memory=tau, sessions=arrangement.session, shared=shared, change=change
    ), free


def _shared(arrangement: Arrangement, fit: Fit) -> FloatArray:
    """(n,) error of each pole's curve that all FRFs share; what poles that are rather no modes take
    up, and the background, is error too.
    """
    evidence = evidence_of(arrangement, fit)
    p = probability(evidence, fit.terms.damping_ratio)
    gone = (p < _RATHER) & arrangement.in_band(fit.terms.frequency_hz) & ~evidence.tone
    alone = level_at(arrangement, fit.terms.some(~gone), fit.variance)
    shared = shared_error(arrangement, fit)
    shared[~gone] = np.maximum(shared[~gone], shared_error(arrangement, alone))
    return shared
