"""FRFs in, modes out: the steps in their order.

screen       what can be used, and what is wrong with the rest
stabilise    linear p-LSCF poles over many orders: candidates
grow         poles that the data support, in combinations of the FRFs, under a model of their errors
learn        the errors from the residual; lines of interference are left out; poles that are not needed are dropped
refine       all FRFs, by maximum likelihood
judge        which poles are modes, which are doubtful
shapes       residues to complex, real and mass-normalised shapes
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fecore.arrays import FloatArray
from fecore.errors import IdentificationError, InputError
from fecore.frf import FrfSet
from fecore.identification.arrangement import Arrangement
from fecore.identification.basis import poles
from fecore.identification.drift import Drift, sessions
from fecore.identification.guards import Verdict, Witnesses, judge
from fecore.identification.leakage import leakage
from fecore.identification.noise import believable, line_scatter, rough_variance
from fecore.identification.orders import comes_back
from fecore.identification.parting import part
from fecore.identification.pole_search import final_fit, search_poles
from fecore.identification.refinement import Fit
from fecore.identification.remarks import remarks, unexplained
from fecore.identification.result import Found, Identification, RefusedPole
from fecore.identification.screening import screen
from fecore.identification.shapes import Shapes, shapes_from_residues
from fecore.identification.stabilisation import Stabilisation, first_variance, stabilise
from fecore.identification.stretch import without_stretch
from fecore.identification.subsets import halves
from fecore.modes import MeasuredModes

_BEYOND = np.array([1.02, 1.06, 1.12, 1.2, 1.35, 1.6])  # candidate frequencies above the band, in its end
_BELOW = np.array([0.5, 0.8, 0.95])  # ... and below it, in its start
_LOOK_BACK = 40  # poles of lower frequency that a candidate is compared with
_ALIKE_ON_LINES = 4.0  # stated noise over the scatter of lines from which most of it is alike on neighbouring lines
_FEWEST_LEARNT = 4  # FRFs of which a relative error can be learnt beside the noise
_WIDTHS = np.array([0.01, 0.03, 0.1])

Report = Callable[[str, float], None]


@dataclass(frozen=True)
class Options:
    """How to identify; the defaults need no human.

    Attributes:
        band_hz: lines to use; all where None. Modes outside are not reported.
        highest_order: largest order of the linear stage (poles of one fixed dof).
        most_modes: largest number of pole pairs of the fitted series.
    """

    band_hz: tuple[float, float] | None = None
    highest_order: int = 40
    most_modes: int = 40

    def __post_init__(self) -> None:
        if not 4 <= self.highest_order <= 200:
            raise InputError("highest_order", f"is {self.highest_order}, expected 4 to 200")
        if not 1 <= self.most_modes <= 200:
            raise InputError("most_modes", f"is {self.most_modes}, expected 1 to 200")


def identify(
    frfs: FrfSet | Sequence[FrfSet], options: Options | None = None, report: Report = lambda _stage, _share: None
) -> Identification:
    """Natural frequencies, damping ratios and shapes of all modes in the band, with their covariance.

    Args:
        frfs: the FRFs of one campaign: one set, or several with different axes or quantities.
        options: band, order and number of modes; defaults suit an unattended run.
        report: called often with the step and the share of the work that is done; what it raises ends the run.

    Raises:
        InputError: the FRFs or options cannot be read as such.
        IdentificationError: the data support no mode; the message says what was seen and what to try.
    """
    options = options or Options()
    clock = _Clock()
    report("screening the FRFs", 0.0)
    screened = screen(frfs, options.band_hz)
    arrangement, notes = screened.arrangement, list(screened.warnings)
    arrangement, doubts = _doubt_variance(arrangement)
    arrangement, left_out = leakage(arrangement)
    scatter = line_scatter(arrangement.values, arrangement.measured, _first_line(arrangement))
    arrangement = _of_lines(arrangement, scatter)
    noise = np.where(np.isfinite(arrangement.variance), arrangement.variance, scatter)
    notes += [*doubts, *left_out]
    clock.lap("screening")
    report("linear estimates", 0.05)
    variance = first_variance(arrangement)
    diagram = stabilise(arrangement, variance, _orders(arrangement, options.highest_order))
    clock.lap("linear stage")
    most = min(options.most_modes, int(arrangement.measured.sum(axis=1).min()) // 4)
    searched = search_poles(arrangement, noise, _candidates(arrangement, diagram), most, report)
    stretch = without_stretch(arrangement, searched.sifted.fit.terms, noise)
    if stretch is not None:
        arrangement = stretch[0]
        notes.append(_stretched(stretch[1]))
        diagram = stabilise(arrangement, first_variance(arrangement), _orders(arrangement, options.highest_order))
        searched = search_poles(arrangement, noise, _candidates(arrangement, diagram), most, report)
    clock.lap("search")
    final = final_fit(arrangement, searched, report)
    arrangement, fit, sifted = final.arrangement, final.fit, final.sifted
    drift = _both(None if stretch is None else stretch[1], final.drift)
    clock.lap("refinement")
    report("judging the modes", 0.9)
    stable = comes_back(searched.search, sifted.fit, diagram)
    witnesses = Witnesses(sifted.needs, halves(searched.search, sifted.fit), stable)
    verdict = judge(arrangement, fit, searched.search, witnesses)
    refused = (*verdict.refused, *(RefusedPole(*pole) for pole in sifted.dropped))
    if not verdict.kept.size:
        raise IdentificationError(_nothing(arrangement, diagram, refused))
    fit, verdict, parted = part(arrangement, fit, verdict)
    notes += parted
    shapes = _shapes(arrangement, fit, verdict)
    notes += [f"no mode at {p.frequency_hz:.2f} Hz: {p.reason}" for p in refused]
    notes += [
        *searched.said,
        *final.said,
        *remarks(arrangement, fit, verdict, shapes),
        *_noise_remarks(arrangement, fit),
    ]
    notes += unexplained(arrangement, fit, variance)
    clock.lap("shapes")
    report("done", 1.0)
    spoilt = np.isin(np.arange(arrangement.frequency_hz.size), verdict.spoilt)
    errors = searched.search.errors
    return Identification(
        found=Found(_modes(arrangement, fit, verdict, shapes, drift), shapes, verdict.significance, verdict.doubt),
        terms=fit.terms,
        stabilisation=diagram,
        used=tuple(arrangement.label(r) for r in range(len(arrangement.pairs))),
        rows=arrangement.source,
        refused=screened.refused,
        refused_poles=refused,
        warnings=tuple(notes + [f"FRF {r.frf} was not used: {r.reason}" for r in screened.refused]),
        frequency_hz=arrangement.frequency_hz,
        quantity=arrangement.quantity,
        measured=np.where(arrangement.measured & ~spoilt, arrangement.values, np.nan),
        predicted=fit.model(arrangement),
        noise_variance=fit.variance,
        noise_ratio=fit.chi_squared / fit.freedom,
        model_error=errors.relative,
        drift=0.0 if drift is None else drift.sd,
        memory_lines=fit.memory,
        seconds=clock.laps,
    )


def _both(first: Drift | None, then: Drift | None) -> Drift | None:
    return first.plus(then) if first is not None and then is not None else first or then


def _stretched(drift: Drift) -> str:
    return (
        f"all natural frequencies drift together, by {100 * np.ptp(drift.each):.2g} % over the tests, so that modes were found"
        " twice: the tests were aligned, and the twins are one mode; temperature does this, or a support that comes loose"
    )


def _first_line(arrangement: Arrangement) -> float:
    """Number of the first line, counted from 0 Hz."""
    return float(arrangement.frequency_hz[0] / max(arrangement.spacing_hz, 1e-300))


def _orders(arrangement: Arrangement, highest: int) -> tuple[int, ...]:
    """Orders of the linear stage: with m fixed dofs each order has m poles, and a line can carry half an unknown."""
    p, m = len(arrangement.roving), len(arrangement.fixed)
    shared = m if m > 1 and p * m == len(arrangement.pairs) else 1
    top = min(max(6, 2 * highest // (shared + 1)), int(arrangement.measured.sum(axis=1).min()) // 3)
    return tuple(range(2, max(top, 3) + 1))


def _candidates(arrangement: Arrangement, diagram: Stabilisation) -> tuple[FloatArray, FloatArray]:
    """Poles of every fourth and of the highest two orders, once each, and a few beyond the band."""
    top = int(diagram.order.max())
    keep = (diagram.order % 4 == 0) | (diagram.order >= top - 1)
    high, low = arrangement.frequency_hz[-1] * _BEYOND, arrangement.frequency_hz[0] * _BELOW
    low = low[low > 2 * arrangement.spacing_hz]
    outside_hz, outside_zeta = (v.ravel() for v in np.meshgrid(np.append(low, high), _WIDTHS))
    hz = np.append(diagram.frequency_hz[keep], outside_hz)
    zeta = np.append(diagram.damping_ratio[keep], outside_zeta)
    order = np.argsort(hz, kind="stable")
    hz, zeta = hz[order], zeta[order]
    fresh = np.ones(hz.size, dtype=bool)
    for k in range(1, hz.size):  # a pole within a tenth of its bandwidth of one that is there adds nothing to the scan
        near = slice(max(0, k - _LOOK_BACK), k)
        like = np.abs(hz[near] - hz[k]) < 0.1 * zeta[k] * hz[k]
        fresh[k] = not np.any(like & fresh[near] & (np.abs(np.log(zeta[near] / zeta[k])) < 0.15))
    return hz[fresh], zeta[fresh]


def _shapes(arrangement: Arrangement, fit: Fit, verdict: Verdict) -> Shapes:
    residues, spread = fit.residues()
    kept = verdict.kept
    damped = poles(fit.terms.frequency_hz[kept], fit.terms.damping_ratio[kept]).imag
    return shapes_from_residues(arrangement, residues[:, kept], spread[:, kept], damped)


def _modes(arrangement: Arrangement, fit: Fit, verdict: Verdict, shapes: Shapes, drift: Drift | None) -> MeasuredModes:
    kept, n = verdict.kept, fit.terms.pairs
    f = fit.terms.frequency_hz[kept]
    both = np.concatenate([kept, n + kept])
    covariance = fit.parameter_covariance[np.ix_(both, both)]
    scale = np.concatenate([f, np.ones(f.size)])  # from ln f to f
    covariance = covariance * np.outer(scale, scale)
    if drift is not None:  # the mean of as many drifts as there are sessions, common to all modes
        covariance[: f.size, : f.size] += np.outer(f, f) * drift.sd**2 / sessions(arrangement)
    return MeasuredModes(f, fit.terms.damping_ratio[kept], shapes.complex, arrangement.roving, covariance)


def _doubt_variance(arrangement: Arrangement) -> tuple[Arrangement, list[str]]:
    """Enlarge a stated noise that the records themselves contradict, and say so."""
    rough = rough_variance(arrangement.values, arrangement.measured)
    variance, factor = believable(arrangement.variance, rough, arrangement.measured)
    if np.all(factor == 1):
        return arrangement, []
    worst = int(np.argmax(factor))
    note = (
        f"{int(np.sum(factor > 1))} FRFs scatter more from line to line than the noise that coherence and averages"
        f" state (most in {arrangement.label(worst)}: {np.sqrt(factor[worst]):.1f} times the noise); the stated noise was"
        " enlarged there"
    )
    return replace(arrangement, variance=variance), [note]


def _of_lines(arrangement: Arrangement, scatter: FloatArray) -> Arrangement:
    """The stated noise, no larger than what changes from line to line, where there are FRFs enough to learn other errors.

    Hits beside the point scatter from hit to hit, but alike on all lines of a resonance: that is no noise of a line. The
    residues take it up, and as noise it would hide one line and overrate the next. Its size is learnt with the relative error.
    """
    with np.errstate(invalid="ignore"):
        over = arrangement.variance[arrangement.measured] / scatter[arrangement.measured]
    over = over[np.isfinite(over)]
    if len(arrangement.pairs) < _FEWEST_LEARNT or not over.size or np.median(over) < _ALIKE_ON_LINES:
        return arrangement
    return replace(arrangement, variance=np.minimum(arrangement.variance, scatter))  # NaN, not known, stays so


def _noise_remarks(arrangement: Arrangement, fit: Fit) -> list[str]:
    """Compare the stated noise with the residual."""
    known = arrangement.measured & np.isfinite(arrangement.variance)
    if not known.any():
        return []
    ratio = float(np.mean(np.abs(fit.residual[known]) ** 2 / fit.variance[known]))
    if ratio < 2:
        return []
    return [
        f"the residual is {np.sqrt(ratio):.1f} times the noise that coherence and averages state: the model does not"
        " explain all of the data (non-linearity, leakage, a moving sensor mass); the standard deviations were enlarged"
        " by as much"
    ]


def _nothing(arrangement: Arrangement, diagram: Stabilisation, refused: tuple[RefusedPole, ...]) -> str:
    """What was seen and what to try, for a record without a mode."""
    band = f"{arrangement.frequency_hz[0]:g} to {arrangement.frequency_hz[-1]:g} Hz"
    stable = np.unique(np.round(diagram.frequency_hz[diagram.damping_stable], -1))
    seen = [f"{p.frequency_hz:.1f} Hz ({p.reason})" for p in refused]
    again = f"Poles that came back from order to order lie near {', '.join(f'{f:g}' for f in stable[:8])} Hz. "
    return (
        f"no mode is supported by the {len(arrangement.pairs)} FRFs from {band}. "
        + (f"Poles seen and refused: {'; '.join(seen)}. " if seen else "No pole lowers the misfit by what it costs. ")
        + (again if stable.size else "")
        + "Try a band around a resonance, more averages, or a higher order; check that responses and forces are not"
        " swapped, and that the imaginary part has the sign of exp(+iωt)."
    )


class _Clock:
    """Seconds of each step."""

    def __init__(self) -> None:
        self.laps: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, name: str) -> None:
        now = time.perf_counter()
        self.laps[name] = now - self._last
        self._last = now
