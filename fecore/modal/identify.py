"""FRFs in, modes out: FRFs -> candidates -> one joint fit -> probability -> modes."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fecore.arrays import BoolArray, FloatArray, IntArray, real_times
from fecore.errors import IdentificationError, InputError
from fecore.findings import Finding
from fecore.frf import FrfSet
from fecore.modal.arrangement import Arrangement
from fecore.modal.basis import columns
from fecore.modal.diagram import diagram_of
from fecore.modal.evidence import Evidence, evidence_of
from fecore.modal.findings import finding, not_used
from fecore.modal.fitting import Fitted, Report, fit_series
from fecore.modal.growth import REFUSED, pole_price
from fecore.modal.noise import OUTLYING
from fecore.modal.parting import part
from fecore.modal.preparation import Prepared, prepare
from fecore.modal.probability import Feature, features, probability
from fecore.modal.refinement import Fit, Level
from fecore.modal.remarks import remarks
from fecore.modal.result import Found, Identification, RefusedPole
from fecore.modal.screening import lines_in_words
from fecore.modal.shapes import Shapes, shapes_from_residues
from fecore.modes import MeasuredModes

_SAID = 3  # features that are said of a pole
_FEW_OUTLIERS = 0.01  # share of a record that may be outliers


@dataclass(frozen=True)
class Options:
    """How to identify; the defaults need no human."""

    # lines to use; all where None. Modes outside are not reported.
    band_hz: tuple[float, float] | None = None
    highest_order: int = 40  # largest order of the linear stage (poles in a window of lines)
    most_modes: int = 100  # largest number of pole pairs of the fitted series
    # probability from which a pole is a mode; below it, from 0.1 on, it is uncertain
    threshold: float = 0.9

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


def identify(
    frfs: FrfSet | Sequence[FrfSet],
    options: Options | None = None,
    report: Report = lambda _stage, _share: None,
) -> Identification:
    """Natural frequencies, damping ratios and shapes of all modes in the band, with their
    covariance and probability.

    Args:
        frfs: the FRFs of one campaign: one set, or several with different axes or quantities.
        options: band, order, number of modes and threshold; defaults suit an unattended run.
        report: called often with the step and the share of the work that is done; what it raises
            ends the run.

    Raises:
        InputError: the FRFs or options cannot be read as such.
        IdentificationError: the data support no mode; the message says what was seen and what to
            try.
    """
    options = options or Options()
    times = [time.perf_counter()]
    report("screening the FRFs", 0.0)
    prepared = prepare(frfs, options.band_hz)
    times.append(time.perf_counter())
    fitted = fit_series(
        prepared.arrangement, prepared.noise, options.highest_order, options.most_modes, report
    )
    times.append(time.perf_counter())
    report("judging the poles", 0.9)
    found = _judged(prepared, fitted, options.threshold)
    times.append(time.perf_counter())
    report("done", 1.0)
    steps = ("screening", "search and refinement", "probability and shapes")
    return replace(found, seconds=dict(zip(steps, np.diff(times).tolist(), strict=True)))


@dataclass(frozen=True)
class _Verdict:
    """The poles of a fit that are modes or uncertain, `kept` in ascending frequency, and those
    refused.
    """

    kept: IntArray
    probability: FloatArray
    features: list[tuple[Feature, ...]]
    refused: tuple[RefusedPole, ...]

    def of(self, old: IntArray, frequency_hz: FloatArray) -> _Verdict:
        """The verdict of new poles with these frequencies, each with what was found of an old
        one.
        """
        kept = np.concatenate([np.flatnonzero(old == k) for k in self.kept])
        kept = kept[np.argsort(frequency_hz[kept], kind="stable")]
        return _Verdict(kept, self.probability[old], [self.features[k] for k in old], self.refused)


def _judged(prepared: Prepared, fitted: Fitted, threshold: float) -> Identification:
    """Which of the poles are modes, with their shapes, and all that there is to say of them."""
    arrangement, fit = fitted.arrangement, fitted.fit
    diagram = diagram_of(arrangement, fitted.linear)
    evidence = evidence_of(arrangement, fit)
    verdict = _verdict(arrangement, fit, evidence)
    verdict = replace(verdict, refused=_all_refused(fitted, verdict.refused))
    if not verdict.kept.size:
        raise IdentificationError(_nothing(arrangement, verdict.refused, fitted.full))
    significance, toned = (
        fit.gains / (pole_price(fit) * fit.memory),
        _toned(arrangement, fit, evidence),
    )
    fit, old, parted = part(arrangement, fit, verdict.kept)
    fitted = replace(fitted, fit=fit)
    verdict = verdict.of(old, fit.terms.frequency_hz)
    kept = verdict.kept
    doubt = tuple(_doubt(verdict, int(k), threshold) for k in kept)
    shapes = _shapes(arrangement, fit, kept)
    known, outliers = arrangement.measured & np.isfinite(arrangement.variance), _outliers(fit)
    ratio = fit.chi_squared / fit.freedom
    if known.any():
        ratio = float(np.mean(np.abs(fit.residual[known]) ** 2 / arrangement.variance[known]))
    notes = (
        *prepared.notes,
        *_of_drift(fitted),
        *_of_phase(evidence),
        *_of_tones(arrangement, toned),
        *([finding("most_modes")] if fitted.full else []),
        *parted,
        *remarks(arrangement, fit, kept, shapes, evidence.share[old], doubt),
        *_of_outliers(arrangement, outliers),
        *(_of_noise(ratio) if known.any() and ratio >= 2 else []),
        *(not_used(refused.frf, refused.why) for refused in prepared.refused),
    )
    return Identification(
        found=Found(
            modes=_modes(fitted, verdict, shapes),
            shapes=shapes,
            significance=significance[old][kept],
            features=tuple(verdict.features[int(k)] for k in kept),
            doubt=doubt,
        ),
        terms=fit.terms,
        stabilisation=diagram,
        used=tuple(arrangement.label(r) for r in range(len(arrangement.pairs))),
        rows=arrangement.source,
        refused=prepared.refused,
        refused_poles=verdict.refused,
        notes=notes,
        frequency_hz=arrangement.frequency_hz,
        quantity=arrangement.quantity,
        measured=np.where(arrangement.measured & ~outliers & ~toned, arrangement.values, np.nan),
        predicted=fit.model,
        noise_variance=np.where(known, arrangement.variance, fit.variance),
        noise_ratio=ratio,
        model_error=_model_error(arrangement, fitted),
        drift=float(fitted.drift.std()),
        delay=evidence.delay,
        memory_lines=fit.memory,
        seconds={},
    )


def _all_refused(fitted: Fitted, refused: tuple[RefusedPole, ...]) -> tuple[RefusedPole, ...]:
    """Refused poles with those of the background."""
    arrangement, terms = fitted.arrangement, fitted.whole.terms
    if fitted.free.all():
        return refused
    before = _verdict(arrangement, fitted.whole, evidence_of(arrangement, fitted.whole))
    still = terms.frequency_hz[~fitted.free]
    both = (*refused, *(each for each in before.refused if each.frequency_hz in still))
    return tuple(sorted(both, key=lambda each: each.frequency_hz))


def _verdict(arrangement: Arrangement, fit: Level, evidence: Evidence) -> _Verdict:
    terms = fit.terms
    p = probability(evidence, terms.damping_ratio)
    said = features(evidence, terms.frequency_hz, terms.damping_ratio)
    order = np.argsort(terms.frequency_hz, kind="stable")
    order = order[arrangement.in_band(terms.frequency_hz)[order]]
    refused = tuple(
        RefusedPole(
            float(terms.frequency_hz[k]),
            float(terms.damping_ratio[k]),
            _against(said[k]),
            float(p[k]),
            said[k][:_SAID],
        )
        for k in order[p[order] < REFUSED]
    )
    return _Verdict(order[p[order] >= REFUSED], p, [each[:_SAID] for each in said], refused)


def _against(said: tuple[Feature, ...]) -> str:
    """What speaks most against a pole, in words."""
    against = [each.words for each in said if each.weight < 0][:2]
    return "; ".join(against) if against else "nothing speaks for it clearly"


def _doubt(verdict: _Verdict, k: int, threshold: float) -> str | None:
    p = verdict.probability[k]
    if p >= threshold:
        return None
    return (
        f"a mode with probability {p:.2f}: {'; '.join(each.words for each in verdict.features[k])}"
    )


def _shapes(arrangement: Arrangement, fit: Fit, kept: IntArray) -> Shapes:
    damped = fit.terms.poles[kept].imag
    return shapes_from_residues(
        arrangement, fit.residues[:, kept], fit.residue_variance[:, kept], damped
    )


def _modes(fitted: Fitted, verdict: _Verdict, shapes: Shapes) -> MeasuredModes:
    arrangement, fit, kept = fitted.arrangement, fitted.fit, verdict.kept
    n, f = fit.terms.pairs, fit.terms.frequency_hz[kept]
    both = np.concatenate([kept, n + kept])
    scale = np.concatenate([f, np.ones(f.size)])  # from ln f to f
    covariance = fitted.covariance[np.ix_(both, both)] * np.outer(scale, scale)
    zeta, p = fit.terms.damping_ratio[kept], verdict.probability[kept]
    return MeasuredModes(f, zeta, shapes.complex, arrangement.roving, covariance, p)


def _of_drift(fitted: Fitted) -> list[Finding]:
    if not fitted.drift.any():
        return []
    return [finding("drift", percent=100 * fitted.drift.std())]


def _toned(arrangement: Arrangement, fit: Fit, evidence: Evidence) -> BoolArray:
    """(N, L) values of which a tone is the larger part, and larger than their noise: they are no
    answer to the force.
    """
    pairs, tone = slice(0, 2 * fit.terms.pairs), np.repeat(evidence.tone, 2)
    own = columns(arrangement.omega, fit.terms, arrangement.power)[:, pairs][:, tone]
    part = real_times(fit.linear.coefficients[:, pairs][:, tone], own.T)
    rest = np.abs(arrangement.values - part) ** 2
    return np.asarray(np.abs(part) ** 2 > np.maximum(fit.variance, rest))


def _of_tones(arrangement: Arrangement, toned: BoolArray) -> list[Finding]:
    lines = lines_in_words(arrangement.frequency_hz[toned.any(axis=0)])
    return [finding("tones", lines=lines)] if toned.any() else []


def _of_phase(evidence: Evidence) -> list[Finding]:
    if evidence.turned:
        return [finding("residues_turned")]
    if abs(evidence.delay) < 2e-5:
        return []
    side = "after" if evidence.delay > 0 else "before"
    return [finding("channels_delayed", delay=1e6 * evidence.delay, side=side)]


def _outliers(fit: Fit) -> BoolArray:
    """(N, L) single values that Student's law has left hardly any weight."""
    far = np.abs(fit.residual) ** 2 > OUTLYING * fit.variance
    alone = far.copy()
    alone[:, 1:] &= ~far[:, :-1]
    alone[:, :-1] &= ~far[:, 1:]
    return np.asarray(
        alone & (far.sum(axis=1, keepdims=True) <= np.maximum(1, _FEW_OUTLIERS * far.shape[1]))
    )


def _of_outliers(arrangement: Arrangement, outliers: BoolArray) -> list[Finding]:
    rows = np.flatnonzero(outliers.any(axis=1))
    words = [lines_in_words(arrangement.frequency_hz[outliers[row]]) for row in rows]
    notes = [
        finding("outliers", frf=arrangement.label(int(row)), lines=lines)
        for row, lines in zip(rows, words, strict=True)
    ]
    more = len(notes) - 8
    return notes if more <= 0 else [*notes[:8], finding("more_outliers", count=more)]


def _model_error(arrangement: Arrangement, fitted: Fitted) -> float:
    """Relative error of the FRFs beside the noise, from lines where they are large: root of Σ(|r|²
    - n²)|H|²/Σ|H|⁴.
    """
    size = np.where(arrangement.measured, np.abs(arrangement.values) ** 2, 0.0)
    excess = (np.abs(fitted.fit.residual) ** 2 - fitted.noise) * size
    total = float(np.sum(size**2))
    return float(np.sqrt(max(float(np.sum(excess)), 0.0) / total)) if total > 0 else 0.0


def _of_noise(ratio: float) -> list[Finding]:
    return [finding("residual_large", times=np.sqrt(ratio))]


def _nothing(arrangement: Arrangement, refused: tuple[RefusedPole, ...], full: bool) -> str:
    """What was seen and what to try, for a record without a mode."""
    band = f"{arrangement.frequency_hz[0]:g} to {arrangement.frequency_hz[-1]:g} Hz"
    seen = [f"{p.frequency_hz:.1f} Hz ({p.reason})" for p in refused[:8]]
    return (
        f"no mode is supported by the {len(arrangement.pairs)} FRFs from {band}. "
        + (
            f"Poles seen and refused: {'; '.join(seen)}. "
            if seen
            else "No pole lowers the misfit by what it costs. "
        )
        + ("The search stopped at most_modes; raise it, or leave it out. " if full else "")
        + "Try a band around a resonance, more averages, or a higher order; check that responses"
        " and forces are not swapped, and that the imaginary part has the sign of exp(+iωt)."
    )
