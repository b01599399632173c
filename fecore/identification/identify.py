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
from dataclasses import dataclass

import numpy as np

from fecore.errors import IdentificationError, InputError
from fecore.frf import FrfSet
from fecore.identification.arrangement import Arrangement
from fecore.identification.basis import poles
from fecore.identification.candidates import LinearStage, linear_stage
from fecore.identification.drift import Drift, sessions
from fecore.identification.guards import Verdict, Witnesses, judge
from fecore.identification.orders import comes_back
from fecore.identification.parting import part
from fecore.identification.pole_search import Final, Searched, final_fit, search_poles
from fecore.identification.preparation import Prepared, prepare
from fecore.identification.refinement import Fit
from fecore.identification.remarks import remarks, unexplained
from fecore.identification.result import Found, Identification, RefusedPole
from fecore.identification.shapes import Shapes, shapes_from_residues
from fecore.identification.stabilisation import Stabilisation
from fecore.identification.stretch import without_stretch
from fecore.identification.subsets import halves
from fecore.modes import MeasuredModes

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
    prepared = prepare(frfs, options.band_hz)
    clock.lap("screening")
    report("linear estimates", 0.05)
    linear = linear_stage(prepared.arrangement, options.highest_order)
    clock.lap("linear stage")
    sought = _seek(prepared, linear, options, report)
    clock.lap("search")
    final = final_fit(sought.arrangement, sought.searched, report)
    clock.lap("refinement")
    report("judging the modes", 0.9)
    return _judged(prepared, sought, final, clock, report)


@dataclass(frozen=True)
class _Sought:
    """The FRFs as aligned, their linear stage, the poles that they need, the drift that was taken out, and whether the
    search had as many poles as it may.
    """

    arrangement: Arrangement
    linear: LinearStage
    searched: Searched
    drift: Drift | None
    stopped: bool


def _seek(prepared: Prepared, linear: LinearStage, options: Options, report: Report) -> _Sought:
    """The poles; where the structure drifted so far that modes are found twice, once more without the drift."""
    arrangement, noise = prepared.arrangement, prepared.noise
    most = min(options.most_modes, int(arrangement.measured.sum(axis=1).min()) // 4)
    searched = search_poles(arrangement, noise, linear.pool, most, report)
    stretch = without_stretch(arrangement, searched.sifted.fit.terms, noise)
    if stretch is None:
        return _Sought(arrangement, linear, searched, None, _stopped(searched, options))
    aligned, drift = stretch
    linear = linear_stage(aligned, options.highest_order)
    searched = search_poles(aligned, noise, linear.pool, most, report)
    return _Sought(aligned, linear, searched, drift, _stopped(searched, options))


def _stopped(searched: Searched, options: Options) -> bool:
    """Whether there were as many poles as the options allow."""
    return searched.sifted.fit.terms.pairs + len(searched.sifted.dropped) >= options.most_modes


def _judged(prepared: Prepared, sought: _Sought, final: Final, clock: _Clock, report: Report) -> Identification:
    """Which of the poles are modes, with their shapes, and all that there is to say of them."""
    arrangement, sifted, search, diagram = (
        final.arrangement,
        final.sifted,
        sought.searched.search,
        sought.linear.diagram,
    )
    witnesses = Witnesses(sifted.needs, halves(search, sifted.fit), comes_back(search, sifted.fit, diagram))
    verdict = judge(arrangement, final.fit, search, witnesses)
    refused = (*verdict.refused, *(RefusedPole(*pole) for pole in sifted.dropped))
    if not verdict.kept.size:
        raise IdentificationError(_nothing(arrangement, diagram, refused, sought.stopped))
    fit, verdict, parted = part(arrangement, final.fit, verdict)
    shapes = _shapes(arrangement, fit, verdict)
    notes = (
        *prepared.said,
        *([] if sought.drift is None else [_stretched(sought.drift)]),
        *parted,
        *(f"no mode at {p.frequency_hz:.2f} Hz: {p.reason}" for p in refused),
        *sought.searched.said,
        *final.said,
        *remarks(arrangement, fit, verdict, shapes),
        *_noise_remarks(arrangement, fit),
        *unexplained(arrangement, fit, sought.linear.variance),
        *(f"FRF {r.frf} was not used: {r.reason}" for r in prepared.refused),
    )
    clock.lap("shapes")
    report("done", 1.0)
    spoilt = np.isin(np.arange(arrangement.frequency_hz.size), verdict.spoilt)
    drift = _both(sought.drift, final.drift)
    return Identification(
        found=Found(_modes(arrangement, fit, verdict, shapes, drift), shapes, verdict.significance, verdict.doubt),
        terms=fit.terms,
        stabilisation=diagram,
        used=tuple(arrangement.label(r) for r in range(len(arrangement.pairs))),
        rows=arrangement.source,
        refused=prepared.refused,
        refused_poles=refused,
        warnings=notes,
        frequency_hz=arrangement.frequency_hz,
        quantity=arrangement.quantity,
        measured=np.where(arrangement.measured & ~spoilt, arrangement.values, np.nan),
        predicted=fit.model(arrangement),
        noise_variance=fit.variance,
        noise_ratio=fit.chi_squared / fit.freedom,
        model_error=search.errors.relative,
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


def _nothing(arrangement: Arrangement, diagram: Stabilisation, refused: tuple[RefusedPole, ...], stopped: bool) -> str:
    """What was seen and what to try, for a record without a mode."""
    band = f"{arrangement.frequency_hz[0]:g} to {arrangement.frequency_hz[-1]:g} Hz"
    stable = np.unique(np.round(diagram.frequency_hz[diagram.damping_stable], -1))
    seen = [f"{p.frequency_hz:.1f} Hz ({p.reason})" for p in refused]
    again = f"Poles that came back from order to order lie near {', '.join(f'{f:g}' for f in stable[:8])} Hz. "
    return (
        f"no mode is supported by the {len(arrangement.pairs)} FRFs from {band}. "
        + (f"Poles seen and refused: {'; '.join(seen)}. " if seen else "No pole lowers the misfit by what it costs. ")
        + (again if stable.size else "")
        + ("The search stopped at most_modes; raise it, or leave it out. " if stopped else "")
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
