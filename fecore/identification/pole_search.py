"""From screened FRFs to the series of poles that they need, and to its fit to all of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fecore.arrays import FloatArray
from fecore.identification.arrangement import Arrangement
from fecore.identification.basis import Terms
from fecore.identification.compression import compress
from fecore.identification.drift import Drift, aligned, drift_of, session_of
from fecore.identification.error_model import ErrorModel, memory
from fecore.identification.gains import in_band
from fecore.identification.learning import learn, tones, without_lines
from fecore.identification.noise import line_scatter, profile_of
from fecore.identification.outliers import leave_out_outliers
from fecore.identification.refinement import Fit, evaluate, noise_of, refine, refine_with_noise
from fecore.identification.residues import known_or
from fecore.identification.screening import lines_in_words
from fecore.identification.search import Search
from fecore.identification.selection import grow, hold_vague
from fecore.identification.sifting import Sifted, sift, without_twins

_CLEANER = 0.1  # errors over those supposed, from which more can be seen than was looked for
_RELEARN = 3  # rounds in which the errors are learnt anew
_MANY = 64  # FRFs from which the poles of the combinations are taken for near enough
_ALIGN = 8  # most turns of drift and poles
_LAST = 2  # steps with all of many FRFs: their combinations have come near already
_STILL = 0.05  # of the whole drift: what is left below it is at rest

Report = Callable[[str, float], None]


@dataclass(frozen=True)
class Searched:
    """The search with its errors, the poles that it needs, and what was seen on the way."""

    search: Search
    sifted: Sifted
    said: tuple[str, ...]


def search_poles(
    arrangement: Arrangement, noise: FloatArray, pool: tuple[FloatArray, FloatArray], most: int, report: Report
) -> Searched:
    """The poles that the FRFs need.

    Args:
        arrangement: the FRFs.
        noise: (N, L) variance of their noise.
        pool: frequencies (Hz) and damping ratios of candidate poles.
        most: largest number of poles.
        report: called with the progress.
    """
    small = compress(arrangement, noise)
    search = Search(small, ErrorModel(small.squares(noise), small.squares(np.abs(arrangement.values) ** 2)))
    rounds = 0

    def step(fit: Fit) -> None:
        nonlocal rounds
        rounds += 1
        inside = int(np.sum(in_band(arrangement, fit.terms.frequency_hz)))
        report(f"searching poles: {inside} found", 0.1 + 0.5 * (1 - 0.85**rounds))

    said: list[str] = []
    search, fit = grow(search, Terms(np.empty(0), np.empty(0), (0,)), pool, most, step)
    lines = tones(fit)
    if lines.size:
        said.append(f"interference at {lines_in_words(arrangement.frequency_hz[lines])}: left out")
        search, fit = grow(without_lines(search, lines), fit.terms, pool, most, step)
    for _ in range(_RELEARN):
        learnt = learn(search, fit)
        cleaner = np.median(learnt.variance(fit)) < _CLEANER * np.median(search.variance(fit))
        search = learnt
        if not cleaner:
            break
        search, fit = grow(search, fit.terms, pool, most, step)
    report("trying the series without each pole", 0.65)
    sifted = sift(search, fit, lambda: report("trying the series without each pole", 0.7))
    more = tones(sifted.fit)  # a pole that stood on such a line has hidden it
    if more.size:
        said.append(f"interference at {lines_in_words(arrangement.frequency_hz[more])}: left out")
        search = without_lines(search, more)
        fit = evaluate(search.arrangement, sifted.fit.terms, search.variance(sifted.fit))
        search = learn(search, refine(search.arrangement, fit.terms, fit.variance, steps=8))
        again = sift(search, fit, lambda: report("trying the series without each pole", 0.72))
        sifted = replace(again, dropped=(*sifted.dropped, *again.dropped))
    return Searched(search, sifted, tuple(said))


@dataclass(frozen=True)
class Final:
    """The series fitted to all FRFs.

    Attributes:
        sifted: its poles; two that came together, when the drift was taken out, are one.
        arrangement: the FRFs without drift and outlying values.
        fit: the fit.
        drift: None where there is none.
        said: what was seen, in words.
    """

    sifted: Sifted
    arrangement: Arrangement
    fit: Fit
    drift: Drift | None
    said: tuple[str, ...]


def final_fit(arrangement: Arrangement, searched: Searched, report: Report) -> Final:
    """The needed poles, fitted to all FRFs by maximum likelihood, without their drift and without single outlying values."""
    final = _fit_all(arrangement, searched.search, searched.sifted, report)
    while True:
        drift = 0.0 if final.drift is None else final.drift.sd
        left = without_twins(searched.search, final.sifted, final.arrangement, final.fit, drift)
        if left is None:
            return final
        final = _fit_all(arrangement, searched.search, left, report)


def _fit_all(arrangement: Arrangement, search: Search, sifted: Sifted, report: Report) -> Final:
    found = sifted.fit
    measured = arrangement.measured & search.arrangement.measured.any(axis=0)
    arrangement = replace(arrangement, measured=measured, values=np.where(measured, arrangement.values, 0))
    report("refining with all FRFs", 0.75)
    first_line = arrangement.frequency_hz[0] / arrangement.spacing_hz
    noise = known_or(arrangement, line_scatter(arrangement.values, measured, first_line))
    fit = evaluate(arrangement, found.terms, noise)
    profile = profile_of(line_scatter(fit.residual, measured, first_line))
    fit = evaluate(arrangement, found.terms, noise_of(arrangement, fit, profile))
    arrangement, fit, drift = _without_drift(arrangement, fit)
    fit = evaluate(arrangement, fit.terms, noise_of(arrangement, fit, profile))
    said = []
    if drift is not None:
        said.append(f"the FRFs drift against each other by {100 * drift.sd:.2g} % of a frequency (1 sd): aligned")
    if len(arrangement.pairs) < _MANY:
        free = replace(fit.terms, held=np.zeros(fit.terms.pairs, dtype=bool))
        fit = evaluate(arrangement, free, fit.variance)
        held = hold_vague(fit, ~in_band(arrangement, fit.terms.frequency_hz))
        fit = refine_with_noise(
            arrangement, held, fit.variance, profile=profile, report=lambda: report("refining with all FRFs", 0.8)
        )
        arrangement, fit, outliers = leave_out_outliers(arrangement, fit, profile)
        said += outliers
    else:
        fit = refine(arrangement, fit.terms, fit.variance, steps=_LAST)
    tau = memory(fit.residual, fit.variance, arrangement.measured, fit.model(arrangement))
    fit = replace(fit, memory=tau, sessions=session_of(arrangement))
    return Final(sifted, arrangement, fit, drift, tuple(said))


def _without_drift(arrangement: Arrangement, fit: Fit) -> tuple[Arrangement, Fit, Drift | None]:
    """The FRFs without the drift of their sessions, the series for them, and the drift; as they are where there is none.

    The drift is found to first order and the series is too broad before it is known: both are repeated until they rest, and
    each time the FRFs as they were measured are moved by all of it.
    """
    total, unmoved = None, arrangement
    for _ in range(_ALIGN):
        drift = drift_of(arrangement, fit)
        if drift is None:
            break
        total = drift if total is None else total.plus(drift)
        arrangement = aligned(unmoved, fit, total)
        fit = refine(arrangement, fit.terms, fit.variance, steps=1)
        if drift.sd < _STILL * total.sd:
            break
    return arrangement, fit, total
