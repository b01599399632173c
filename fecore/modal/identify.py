"""FRFs to modes: `identify` where nothing is known of the poles, `shapes_at_poles` at poles that
somebody has typed in.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import count

import numpy as np

from fecore.arrays import FloatArray
from fecore.errors import IdentificationError, InputError
from fecore.frf import FrfSet
from fecore.modal.arrangement import Arrangement, arrange, clusters, linear_estimates, octaves
from fecore.modal.errors import with_errors
from fecore.modal.findings import finding, not_used
from fecore.modal.judge import REFUSED, evidence_of, judge, no_mode_message
from fecore.modal.prepare import noise_of, prepare
from fecore.modal.refine import (
    LinearFit,
    plausible,
    reweighted_fit,
    robust_fit,
)
from fecore.modal.result import (
    FittedSeries,
    Identification,
    IdentifiedPoles,
    diagram_of,
    interference,
    left_out,
    moved_by_height,
    of_residual,
    of_series,
    outlying,
    remarks,
)
from fecore.modal.search import (
    REFINED,
    SETTLED,
    CombinedFrfs,
    Searched,
    aligned_search,
    forward_selection,
    joined,
    with_stated,
    without_spurious,
)
from fecore.modal.series import DAMPING_RANGE, Terms
from fecore.modal.shapes import Shapes, of_rank_two, separate_close_modes, shapes_from_residues
from fecore.modes import MeasuredModes
from fecore.signal.block_spectra import BlockSpectra

Report = Callable[[str, float], None]


@dataclass(frozen=True)
class StatedPole:
    """A pole that a person sees in the FRFs: where its fit starts."""

    frequency_hz: float
    damping_ratio: float | None = None  # a line's width where None


@dataclass(frozen=True)
class Options:
    """How to identify; the defaults need no human."""

    # lines to use; all where None. Modes outside are not reported.
    band_hz: tuple[float, float] | None = None
    highest_order: int = 40  # largest order of the linear stage (poles in a window of lines)
    most_modes: int = 100  # largest number of pole pairs of the fitted series
    # probability from which a pole is a mode; below it, from 0.1 on, it is uncertain
    threshold: float = 0.9
    # fitted beside those that the search finds, and modes whatever their probability
    poles: tuple[StatedPole, ...] = ()

    def __post_init__(self) -> None:
        if not 4 <= self.highest_order <= 200:
            raise InputError("highest_order", f"is {self.highest_order}, expected 4 to 200")
        if not 1 <= self.most_modes <= 200:
            raise InputError("most_modes", f"is {self.most_modes}, expected 1 to 200")
        if not REFUSED <= self.threshold < 1:
            raise InputError(
                "threshold",
                f"is {self.threshold:g}, expected a probability from {REFUSED:g} to below 1",
            )

    def stated(self, arrangement: Arrangement) -> Terms:
        """The poles as terms.

        Raises:
            InputError: one lies outside the lines.
        """
        hz = np.array([pole.frequency_hz for pole in self.poles])
        width = arrangement.spacing_hz / 2
        zeta = [pole.damping_ratio or width / pole.frequency_hz for pole in self.poles]
        for number in np.flatnonzero(~arrangement.in_band(hz))[:1]:
            low, high = arrangement.frequency_hz[[0, -1]]
            raise InputError(
                f"poles.{number}.frequency_hz",
                f"is {hz[number]:g}, outside the lines, {low:g} to {high:g} Hz",
            )
        return Terms(hz, np.clip(zeta, *DAMPING_RANGE), ())


def identify(
    frfs: FrfSet | Sequence[FrfSet],
    options: Options | None = None,
    report: Report = lambda _stage, _share: None,
    blocks: BlockSpectra | None = None,
) -> Identification:
    """Natural frequencies, damping ratios and shapes of all modes in the band, with their
    covariance and probability.

    1. Prepare: FRFs that can be used, on one axis, and how noisy each value is.
    2. Divide: a wide band of many lines into octaves, which take steps 3 to 8 each for itself.
    3. Combine: the few combinations of many FRFs that carry their common content.
    4. Candidates: poles of linear estimates that come back from order to order.
    5. Search: of the candidates, those that lower the misfit of the combinations by more than they
       cost.
    6. Align: without what the structure drifted between the tests, where that pays, the search goes
       on with what the residual shows.
    7. Refine: all poles together on the combinations, then the series with all FRFs.
    8. Cull: refused poles that only bend a better one beside them leave.
    9. Join: one series of the whole band with the poles of all octaves, and those that a person
       stated.
    10. Fit: all FRFs with a variance for each value, and the errors of the poles.
    11. Judge: features and probability of each pole, which is a mode, uncertain, or refused.
    12. Separate: two modes for a pole whose residues are two shapes.
    13. Shapes: one for each pole that was kept, with its modal mass.
    14. Result: the modes and what a user should know of them.

    Args:
        frfs: the FRFs of one campaign: one set, or several with different axes or quantities.
        options: band, order, number of modes and threshold; defaults suit an unattended run.
        report: called often with the step and the share of the work that is done; what it raises
            ends the run.
        blocks: of the half spectra of one recording, whose pairs the FRFs are in turn.

    Raises:
        InputError: the FRFs or options cannot be read as such.
        IdentificationError: the data support no mode; the message says what was seen and what to
            try.
    """
    options, began = options or Options(), time.perf_counter()
    # 1. Prepare.
    report("screening the FRFs", 0.0)
    prepared = prepare(frfs, options.band_hz)
    prepared = replace(prepared, arrangement=replace(prepared.arrangement, blocks=blocks))
    stated = options.stated(prepared.arrangement)
    # 2. Divide.
    screened, full = time.perf_counter(), False
    parts = octaves(prepared.arrangement, prepared.noise)
    of_parts: list[Searched] = []

    def step(number: int, rounds: Iterator[int], poles: int) -> None:
        share = (number + 1 - 0.7 ** next(rounds)) / len(parts)
        report(f"searching poles: {poles} found", 0.05 + 0.55 * share)

    for number, part in enumerate(parts):
        # 3. Combine.
        combined = CombinedFrfs.of(part.arrangement, part.noise)
        # 4. Candidates.
        report("linear estimates", 0.05 + 0.55 * number / len(parts))
        linear = linear_estimates(combined.few, combined.few_noise, options.highest_order)
        candidates = clusters(linear)
        # 5. Search.
        steps = partial(step, number, count(1))
        taken = (p.own(o.series.terms).size for p, o in zip(parts, of_parts, strict=False))
        lines = int(part.arrangement.measured.sum(axis=1).min())
        room = min(options.most_modes - sum(taken), lines // 4)
        empty = Terms(np.empty(0), np.empty(0), (-2, 0))
        terms = forward_selection(combined, empty, candidates, room, steps, 1)
        # 6. Align.
        aligned, terms, drift = aligned_search(combined, terms, candidates, room, steps)
        # 7. Refine.
        terms = aligned.refined(terms, steps=REFINED, enough=SETTLED)
        series = aligned.fitted(terms)
        full |= series.terms.pairs >= room
        # 8. Cull.
        series, gone = without_spurious(aligned, series)
        of_parts.append(Searched(aligned, series, drift, linear, gone))
    # 9. Join.
    report("refining with all FRFs", 0.6)
    whole = joined(prepared.arrangement, prepared.noise, parts, of_parts)
    aligned, drift, linear, gone = whole.data, whole.drift, whole.linear, whole.refused
    series, by_hand = with_stated(aligned, whole.series, stated)
    # 10. Fit.
    report("refining with all FRFs", 0.8)
    arrangement, noise = aligned.arrangement, aligned.noise
    free = plausible(arrangement, series)
    free[by_hand] = True
    by_hand = np.cumsum(free)[by_hand] - 1  # among those
    fit = robust_fit(arrangement, series, noise, free)
    # 11. Judge.
    report("judging the poles", 0.9)
    searched = time.perf_counter()
    growth = fit.growth(arrangement)
    evidence = evidence_of(arrangement, fit, growth)
    verdict = judge(arrangement, fit, evidence, options.threshold, by_hand)
    if not free.all():  # the others are judged by the fit that had them
        fixed = series.terms.frequency_hz[~free]
        before = judge(arrangement, series, evidence_of(arrangement, series), options.threshold)
        gone += tuple(each for each in before.refused if each.frequency_hz in fixed)
    verdict = verdict.with_refused(gone)
    if not verdict.kept.size:
        raise IdentificationError(no_mode_message(arrangement, verdict.refused, full))
    doubted = arrangement.in_band(fit.terms.frequency_hz) & ~evidence.tone
    doubted &= verdict.probability < 0.5
    fit = with_errors(arrangement, fit, series.terms.some(free), doubted, growth)
    fitted = FittedSeries(arrangement, fit, noise, linear, drift, full)
    significance = fit.gains / (fit.pole_price * fit.memory)
    # 12. Separate.
    poles = verdict.kept
    fit, old, separated = separate_close_modes(arrangement, fit, poles)
    verdict = verdict.of(old, fit.terms.frequency_hz)
    # 13. Shapes.
    kept, hz = verdict.kept, fit.terms.frequency_hz
    shapes = shapes_from_residues(
        arrangement,
        fit.residues[:, kept],
        fit.residue_variance[:, kept],
        fit.terms.poles[kept].imag,
    )
    two = of_rank_two(arrangement, fit.residues, fit.residue_variance)
    # 14. Result.
    report("done", 1.0)
    doubt, separate = tuple(verdict.doubt[k] for k in kept), replace(fitted, fit=fit)
    outliers, toned = outlying(fit), interference(fitted, evidence)
    of_interference, of_outliers = left_out(arrangement, toned, outliers)
    return Identification(
        found=IdentifiedPoles(
            modes=separate.modes(kept, verdict.probability, shapes),
            shapes=shapes,
            significance=significance[old][kept],
            features=tuple(verdict.features[int(k)] for k in kept),
            doubt=doubt,
        ),
        fitted=fitted,
        terms=fit.terms,
        stabilisation=diagram_of(arrangement, linear),
        stated=tuple(hz[verdict.stated].tolist()),
        used=tuple(arrangement.label(r) for r in range(len(arrangement.pairs))),
        rows=arrangement.source,
        refused=prepared.refused,
        refused_poles=verdict.refused,
        notes=(
            *prepared.notes,
            *of_series(fitted, evidence),
            *of_interference,
            *([finding("most_modes")] if full else []),
            *separated,
            *(finding("pole_stated", hz=hz[k], p=verdict.probability[k]) for k in verdict.stated),
            *remarks(
                arrangement, fit, kept, shapes, share=evidence.share[old], doubt=doubt, two=two
            ),
            *moved_by_height(fitted.fit, poles),
            *of_outliers,
            *of_residual(separate),
            *(not_used(refused.frf, refused.why) for refused in prepared.refused),
        ),
        frequency_hz=arrangement.frequency_hz,
        quantity=arrangement.quantity,
        measured=np.where(arrangement.measured & ~outliers & ~toned, arrangement.values, np.nan),
        predicted=fit.model,
        noise_variance=np.where(arrangement.known_noise, arrangement.variance, fit.variance),
        noise_ratio=separate.noise_ratio,
        model_error=separate.model_error,
        drift=float(drift.std()),
        delay=evidence.delay,
        memory_lines=fit.memory,
        seconds={
            "screening": screened - began,
            "search and refinement": searched - screened,
            "probability and shapes": time.perf_counter() - searched,
        },
    )


def shapes_at_poles(
    frfs: FrfSet | Sequence[FrfSet],
    frequency_hz: FloatArray,
    damping_ratio: FloatArray,
    *,
    band_hz: tuple[float, float] | None = None,
    exponents: tuple[int, ...] = (-2, -1, 0, 1, 2),
) -> tuple[MeasuredModes, Shapes]:
    """Mode shapes from FRFs at given natural frequencies and damping ratios.

    Args:
        frfs: FRFs of one campaign, one set or several; poles outside their band are fitted too and
            returned.
        frequency_hz: (n,) ascending undamped natural frequencies, Hz.
        damping_ratio: (n,) viscous damping ratios, above 0 and below 1.
        band_hz: lines to use; all where not given.
        exponents: powers of iω of the lower and upper residual terms (of the receptance).

    Returns:
        The modes with complex shapes at the roving dofs (positive directions), and the shapes in
        full: realised, mass normalised where a driving point was measured, with standard deviations
        and phase collinearity. The poles' own uncertainty is not known here: the modes carry no
        covariance.

    Raises:
        InputError: frequencies or ratios that are not usable.
        IdentificationError: two poles coincide, or a pole has no support in the data's band.
    """
    frequency, zeta = np.asarray(frequency_hz, dtype=float), np.asarray(damping_ratio, dtype=float)
    if frequency.ndim != 1 or frequency.size == 0 or zeta.shape != frequency.shape:
        raise InputError(
            "frequency_hz",
            f"and damping_ratio have shapes {frequency.shape} and {zeta.shape}, expected one of"
            " each a mode",
        )
    if not np.all(np.isfinite(frequency) & (frequency > 0)) or np.any(np.diff(frequency) < 0):
        raise InputError("frequency_hz", "must be positive and ascend")
    if not np.all((zeta > 0) & (zeta < 1)):
        raise InputError(
            "damping_ratio",
            "must be above 0 and below 1 to find shapes from FRFs (a ratio, not per cent)",
        )
    arrangement = arrange(frfs, band_hz)
    dead = [r for r in range(len(arrangement.pairs)) if not np.any(arrangement.values[r])]
    arrangement = arrangement.without(dead) if dead else arrangement
    fit = _fit_at(arrangement, Terms(frequency, zeta, exponents))
    spread = fit.linear.variance[:, : 2 * frequency.size]
    shapes = shapes_from_residues(
        arrangement, fit.residues, spread[:, 0::2] + spread[:, 1::2], fit.terms.poles.imag
    )
    return MeasuredModes(frequency, zeta, shapes.complex, arrangement.roving), shapes


def _fit_at(arrangement: Arrangement, terms: Terms) -> LinearFit:
    """The series at given poles under the variance of its own misfit.

    Raises:
        IdentificationError: fewer lines than unknowns, or terms that cannot be separated.
    """
    lines = arrangement.measured.sum(axis=1)
    if 2 * lines.min() <= terms.columns:
        raise IdentificationError(
            f"{terms.pairs} poles and the residual terms are {terms.columns} unknowns an FRF, but"
            f" {arrangement.label(int(lines.argmin()))} has only {lines.min()} lines; use a wider"
            " band or fewer modes"
        )
    fit = reweighted_fit(arrangement, terms, noise_of(arrangement))
    if fit.linear.turn.shape[1] < terms.columns:
        raise IdentificationError(
            "the model's terms cannot be distinguished on the measured lines: two poles coincide,"
            " or there are fewer lines than unknowns; use fewer poles or a wider band"
        )
    return fit
