"""Stage 2: a damping law from the FRFs of the updated model, step by step.

    data = damping_data(frfs, elastic, modes, weighting, inputs)      modes take their parts
    reference = fit_reference(data)                                   noise, delay, and a ratio of its own for every mode
    result = fit_damping(data, reference, law)                        the law, and what its spread is made of

A law is never exact: each mode's damping is off it by a share ε ~ N(0, s²). The prior of s has a
root mean square of 2 %, as in no body damping follows a law better, and s is learnt from how far
the modes are off (`scale_of_deviations`): the root of its posterior mean square enters the
estimate, all of its posterior the intervals.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fecore.arrays import FloatArray, real_times
from fecore.dynamics.damping_laws import DampingLaw
from fecore.findings import Finding
from fecore.frf import FrfSet, convert
from fecore.least_squares import nearest
from fecore.modal.prepare import line_scatter
from fecore.modal.series import memory
from fecore.updating.damping_data import DampingData
from fecore.updating.elastic import Unsettled, settled
from fecore.updating.forward import ForwardState
from fecore.updating.frf_fits import DampingFit, fit_law
from fecore.updating.inputs import Inputs, SystematicEffect
from fecore.updating.laws import (
    DAMPING_DISCREPANCY,
    MeasuredRatios,
    ScaleMixture,
    disagreement,
    law_of_window,
    law_ratio,
    scale_of_deviations,
)
from fecore.updating.misfit import FrfMisfit, residual_variance
from fecore.updating.posterior import root
from fecore.updating.result import finding

_FIRST_NOISE = 1e-3  # of the signal, before it is estimated
_SAME_OPTIMUM = 1e-3  # relative distance of coefficients that counts as one point
_SAME_TO_NOISE = 0.3  # and their distance in standard deviations by noise alone
# difference of negative log posteriors below which a second optimum is worth a warning
_RIVAL = 10.0
_SPREAD_OF_STARTS = 5.0  # factor between the starts
_LINES_OF_PEAK = 4.0  # of the narrowest resonance that show where a start leads
_FEWEST_LINES = 32  # of which the noise of the lines can be seen beside what lasts over a resonance
# rad, of a delay at the highest line: beyond, the data are turned back and the fit begins anew
_LARGE_TURN = 0.02


@dataclass(frozen=True)
class DampingResult:
    """A damping law from FRFs, with its spread."""

    fit: DampingFit  # the fitted law, the best of all starts
    # (p,) coefficients that the measured damping ratios give: the model before stage 2
    start: FloatArray
    starts: int  # how many starts were tried
    # coefficients of every different point that the starts converged to and that the data do not
    # refute against the best, which comes first
    optima: tuple[FloatArray, ...]
    reference: ReferenceFit  # the same data fitted with a ratio of its own for every measured mode
    # by name of its source, (p, k) independent standard deviations of which the coefficients' error
    # is made: `own` at given parameters of stage 1, `inherited` through these
    own: Mapping[str, FloatArray]
    inherited: Mapping[str, FloatArray]
    # stage 1's, then a window that nobody stated or that is not known exactly
    systematic_effects: tuple[SystematicEffect, ...]
    # (p, e) change of the coefficients by one standard deviation of each of these
    bias_sensitivity: FloatArray
    by_elastic: FloatArray  # (p, q) derivative of the estimate by stage 1's parameters
    # what is known of the scale of the relative deviations of damping ratios from the law
    deviations: ScaleMixture

    @property
    def discrepancy(self) -> float:
        """Estimated relative deviation of a damping ratio from the law."""
        return self.deviations.rms

    @property
    def sources(self) -> dict[str, FloatArray]:
        """Of the whole error, excursions apart."""
        return {**self.own, **self.inherited}

    @property
    def covariance(self) -> FloatArray:
        """(p, p) of the coefficients, excursions apart."""
        return _covariance(self.sources)

    @property
    def window(self) -> FloatArray:
        """(p,) change of the coefficients by an exponential window of one standard deviation of its
        rate.
        """
        moved: FloatArray = self.bias_sensitivity[
            :, [each.name == WINDOW for each in self.systematic_effects]
        ].sum(axis=1)
        return moved

    def joint(self, elastic: FloatArray, own: FloatArray | None = None) -> FloatArray:
        """(q+p, q+p) covariance of θ and a: a = â + (∂a/∂θ)(θ - θ̂) + its own error, of all its
        sources or as given.

        Args:
            elastic: (q, q) covariance of θ.
            own: (p, p) of a at given θ.
        """
        by = np.vstack([np.eye(len(elastic)), self.by_elastic])
        joint: FloatArray = by @ elastic @ by.T
        joint[len(elastic) :, len(elastic) :] += _covariance(self.own) if own is None else own
        return joint

    def draws(self, random: np.random.Generator, count: int) -> FloatArray:
        """(n, p) draws of the error at given parameters of stage 1: each with a scale of the modes'
        deviations of its own.
        """
        scale = (
            random.choice(self.deviations.scale, count, p=self.deviations.weight) / self.discrepancy
        )
        parts = {
            name: random.standard_normal((count, part.shape[1])) @ part.T
            for name, part in self.own.items()
        }
        parts[OF_LAW] *= scale[:, None]
        total: FloatArray = np.sum(list(parts.values()), axis=0)
        return total


def _covariance(sources: Mapping[str, FloatArray]) -> FloatArray:
    """(p, p) of an error that is made of independent sources."""
    total: FloatArray = np.sum([part @ part.T for part in sources.values()], axis=0)
    return total


OF_LAW = "discrepancy of the law"

AGAINST_MODES = "FRFs against modes"

WINDOW = "window"

_OF_FRFS = ("measurement noise of FRFs", OF_LAW, "modes not measured")


@dataclass(frozen=True)
class ReferenceFit:
    """A ratio of its own for every measured mode: the reference of every law."""

    # with the noise variance: the measured one, or one from the residual of an unweighted modal
    # fit. A delay between the channels, and flexibilities of driving points, are taken out of its
    # FRFs.
    misfit: FrfMisfit
    fit: DampingFit  # the modal fit
    # what the misfit of one value is by noise alone, with the weighting of this stage, times how
    # many lines are worth
    # one: an error of the model's shapes lasts over a resonance (`fecore.modal.refine.memory`)
    scale: float
    # mean square of the residual over the noise of the lines, 1 at least: what is above 1 is the
    # model's error
    variance_inflation: float
    ratios: MeasuredRatios  # damping ratios as measured where they were, else from the modal fit
    delay: float  # between the channels, as the FRFs show it, s

    @property
    def line_step(self) -> int:
        """Of every so many lines one is enough to show all resonances."""
        spacing = np.median(np.diff(self.misfit.frfs.frequency_hz, append=np.inf))
        width = np.min(self.ratios.ratio * self.ratios.omega) / np.pi
        return max(1, int(width / spacing / _LINES_OF_PEAK))


def fit_reference(data: DampingData) -> ReferenceFit:
    """Find the noise and the channels' delay, and fit every measured mode by itself.

    Raises:
        UpdatingError: the fit did not converge.
    """
    delay = _first_delay(data)
    frfs = _turned_back(data.frfs, delay)
    variance = _noise_variance(replace(data, frfs=frfs))
    for _ in range(3):
        misfit = data.misfit(frfs, data.weighting, variance)
        fit = _modal_fit(data, misfit)
        left = misfit.delay(fit.eigenvalue, fit.rate)
        delay += left
        if abs(left) * frfs.omega[-1] < _LARGE_TURN:
            break
        frfs = _turned_back(frfs, left)
    scale = fit.cost / float(np.sum(misfit.counted))
    if data.weighting == "noise":
        scale = max(scale, 1.0)
        fit = settled(fit_law(misfit, data.modal_law, fit, data.nuisance(0, scale), scale))
    misfit = replace(misfit, frfs=misfit.without_driving(fit.eigenvalue, fit.rate))
    variance_inflation = _variance_inflation(misfit, fit, scale)
    predicted = misfit.predict(fit.eigenvalue, fit.rate)
    residual, _ = misfit.residual(predicted)
    scale *= memory(residual, misfit.variance, misfit.counted, predicted)
    return ReferenceFit(
        misfit=misfit,
        fit=fit,
        scale=scale,
        variance_inflation=variance_inflation,
        ratios=data.measured_ratios or _modal_ratios(data, fit),
        delay=delay,
    )


def _variance_inflation(misfit: FrfMisfit, fit: DampingFit, scale: float) -> float:
    """How many times the noise the modal fit misses the FRFs by, 1 at least.

    A noise that was found from the residual itself has the model's errors in it. What changes from
    line to line without memory has not: they last over a resonance.
    """
    if misfit.frfs.variance is not None or misfit.frfs.frequency_hz.size < _FEWEST_LINES:
        return max(scale, 1.0) if misfit.weighting == "noise" else 1.0
    residual, _ = misfit.residual(misfit.predict(fit.eigenvalue, fit.rate))
    spacing = float(np.median(np.diff(misfit.frfs.frequency_hz)))
    noise = line_scatter(residual, misfit.counted, float(misfit.frfs.frequency_hz[0]) / spacing)
    return max(float(np.mean((np.abs(residual) ** 2 / noise)[misfit.counted])), 1.0)


def _first_delay(data: DampingData) -> float:
    """The channels' delay at the measured modes, s: a fit's steps are only exact where little of it
    is left.

    All lines count alike here, as the noise is not known yet.
    """
    frfs, nuisance = data.frfs, data.nuisance(0)
    level = np.mean(np.abs(frfs.values) ** 2, axis=1, keepdims=True)
    misfit = data.misfit(
        frfs, data.weighting, np.broadcast_to(_FIRST_NOISE * level, frfs.values.shape)
    )
    rate = data.modal_law.basis(data.first_omega) @ data.start(data.modal_law)
    rate[nuisance.suspension_modes] = nuisance.suspension_rate
    return misfit.delay(data.first_omega**2, rate + nuisance.window_rate)


def _turned_back(frfs: FrfSet, delay: float) -> FrfSet:
    """FRFs without a delay of the response, s."""
    return replace(frfs, values=frfs.values * np.exp(1j * frfs.omega * delay)) if delay else frfs


def fit_damping(
    data: DampingData,
    reference: ReferenceFit,
    law: DampingLaw,
    progress: Callable[[float], None] = lambda _: None,
    strain: FloatArray | None = None,
) -> DampingResult:
    """Stage 2: a damping law from complex FRFs (Eq. 11), from several starts that lie far apart.

    1. Where close modes are mixed otherwise than the model's, they take the shares of strain energy
       that suit the law.
    2. How far damping ratios are off the law is learnt from the measured ones: the scale s of their
       deviations.
    3. The law is fitted to all FRFs and modes together from each start: the law of the measured
       ratios, it five times as large and as small, and each coefficient alone. Where they lead
       shows on a few lines of each resonance; from each different end the fit goes on with all.
    4. The best fit is the estimate; other points that starts came to stand beside it where the
       data do not refute them.
    5. Errors of stage 1 move the estimate by ∂a/∂θ, and so do a window that nobody stated and the
       other inputs that are believed to be nothing.
    6. The error is made of its own sources, noise, the law's discrepancy, modes that were not
       measured, FRFs against modes, and of those that stage 1 hands on.

    Args:
        data: as the reference was fitted to them.
        reference: every mode by itself.
        law: the law.
        progress: called with the share that is done.
        strain: (n, q) shares of the lawful modes' strain energy, where close modes are not mixed as
            the model's (`fecore.updating.state`): else such a pair passes for a law that is off,
            and its deviation for all modes'.

    Raises:
        UpdatingError: no start converged.
    """
    # 1. Mixed modes.
    data = data.mixed(strain)
    reference = replace(
        reference,
        misfit=replace(reference.misfit, model=data.model),
        ratios=replace(reference.ratios, strain=data.law_mode_strain),
    )
    # 2. The scale of deviations from the law.
    start, ratios = data.start(law), reference.ratios
    scale = scale_of_deviations(
        np.log(law_ratio(law, ratios) / ratios.ratio),
        ratios.relative_covariance,
        ratios.relative_basis(law),
        DAMPING_DISCREPANCY,
    )
    spread = scale.rms
    # 3. Fits from all starts.
    starts = _starts(law, start, ratios)
    nuisance = data.nuisance(spread, reference.variance_inflation)
    step, misfit, ends = reference.line_step, reference.misfit, list[DampingFit | Unsettled]()
    few = misfit.on_every(step)
    for done, first in enumerate(starts):
        progress(done / len(starts))
        ends.append(fit_law(few, law, first, nuisance, reference.scale / step))
    fits = _best_first(
        [
            fit_law(misfit, law, end, nuisance, reference.scale)
            for end in _different(_best_first(ends))
        ]
    )
    # 4. The best, and other optima.
    best = fits[0]
    rivals = [fit for fit in fits if fit.objective - best.objective < _RIVAL * reference.scale]
    # 5. What moves the estimate.
    elastic, by_elastic = data.elastic, _by_elastic(data, misfit, best)
    by_coordinates = by_elastic * elastic.prior.slope(elastic.theta)
    window_sd = data.window_sd()
    effects = elastic.all_systematic_effects
    sensitivity = by_coordinates @ elastic.bias_sensitivity
    if window_sd:
        known = data.inputs.window_known
        effects += (
            SystematicEffect(WINDOW, np.zeros(0), "both" if known else "one-sided", known, ""),
        )
        sensitivity = np.column_stack([sensitivity, -law_of_window(law, ratios) * window_sd])
    # 6. The error and its sources.
    return DampingResult(
        fit=best,
        start=start,
        starts=len(starts),
        optima=tuple(fit.coefficients for fit in _different(rivals)),
        reference=reference,
        own={
            **_own_sources(data, best, spread),
            AGAINST_MODES: np.diag(_against_modes(ratios, best, spread)),
        },
        inherited={n: by_coordinates @ part for n, part in elastic.sources.items()},
        systematic_effects=effects,
        bias_sensitivity=sensitivity,
        by_elastic=by_elastic,
        deviations=scale,
    )


def _noise_variance(data: DampingData) -> FloatArray:
    """(N, L) noise variance: as stated, else from the residual of an unweighted modal fit."""
    stated, measured = data.frfs.variance, data.frfs.measured
    if stated is not None and not np.isnan(stated[measured]).any():
        return np.where(measured, stated, 1.0)
    even = data.misfit(data.frfs, "linear", np.ones(measured.shape))
    first = _modal_fit(data, even)
    predicted = even.predict(first.eigenvalue, first.rate)
    values = even.without_driving(first.eigenvalue, first.rate).values
    variance = residual_variance(values - predicted, predicted, measured)
    return variance if stated is None else np.where(np.isnan(stated), variance, stated)


def _modal_fit(data: DampingData, misfit: FrfMisfit) -> DampingFit:
    """Every mode by itself, at a first guess of the scale: a thousandth of the signal's own
    weight.
    """
    law = data.modal_law
    guess = _FIRST_NOISE * misfit.signal() / misfit.frfs.values.size
    scale = 1.0 if misfit.weighting == "noise" else guess
    return settled(fit_law(misfit, law, data.start(law), data.nuisance(0), scale))


def _modal_ratios(data: DampingData, modal: DampingFit) -> MeasuredRatios:
    """The same in the modal fit."""
    modes = data.law_modes
    omega = np.sqrt(modal.eigenvalue[modes])
    ratio = modal.law_rate[modes] / (2 * omega)
    # the modal law's coefficients ascend with their knots
    order = np.argsort(data.model.omega[modes])
    covariance = np.empty((ratio.size, ratio.size))
    covariance[np.ix_(order, order)] = modal.noise_covariance
    return data.ratios_of(omega, ratio, covariance)


def _starts(law: DampingLaw, start: FloatArray, ratios: MeasuredRatios) -> list[FloatArray]:
    """The measured ratios' law, it scaled up and down, and each coefficient alone."""
    omega, ratio = ratios.omega, np.median(ratios.ratio)
    basis = law.basis(omega, ratios.strain)
    # coefficients that alone would damp every mode
    damping = np.flatnonzero(np.all(basis > 0, axis=0))
    single = [
        np.median(2 * omega * ratio / basis[:, j]) * np.eye(basis.shape[1])[j] for j in damping
    ]
    return [start, start * _SPREAD_OF_STARTS, start / _SPREAD_OF_STARTS, *single]


def _own_sources(data: DampingData, fit: DampingFit, relative: float) -> dict[str, FloatArray]:
    """(p, k) by noise, by each mode lying off the law by its share, and by unmeasured ones off the
    model's frequency.
    """
    m, others, moved = fit.eigenvalue.size, data.unmeasured, fit.nuisance.modes
    by = fit.response @ fit.normal.hessian
    by_shift = by[:, others] * 2 * fit.eigenvalue[others] * data.elastic.discrepancy
    parts = (
        root(fit.noise_covariance),
        (by[:, m + moved] * fit.law_rate[moved] + fit.ratio_data[:, moved]) * relative,
        by_shift,
    )
    return dict(zip(_OF_FRFS, parts, strict=True))


def _against_modes(ratios: MeasuredRatios, fit: DampingFit, spread: float) -> FloatArray:
    """(p,) by what the FRFs say of the law and the identified modes do not."""
    basis = ratios.relative_basis(fit.law)
    return disagreement(
        basis, ratios.relative_covariance, spread, fit.coefficients, fit.noise_covariance
    )


def _by_elastic(data: DampingData, misfit: FrfMisfit, fit: DampingFit) -> FloatArray:
    """(p, q) derivative of the estimate by stage 1's: constants move shapes, and the modes that
    carry no shift.
    """
    state, frfs = data.elastic.updated, data.frfs
    omega = frfs.omega
    flexibility = convert(omega, frfs.quantity) / (
        fit.eigenvalue[:, None] - omega**2 + 1j * omega * fit.rate[:, None]
    )
    predicted = misfit.predict(fit.eigenvalue, fit.rate)
    jacobian = misfit.jacobian(fit.eigenvalue, fit.rate, predicted)
    by_residue = real_times(state.residue_jacobian(frfs.responses, frfs.references), flexibility)
    if jacobian.factors is not None:
        by_drive = real_times(state.residue_jacobian(frfs.responses, frfs.responses), flexibility)
        by_residue = jacobian.factors[0] * by_residue + jacobian.factors[1] * by_drive
    _, weight = misfit.residual(predicted)
    gradients = (
        np.array([jacobian.gradient(weight * change) for change in by_residue])
        @ fit.normal.reduction
    )
    stretch = _by_stretch(state)
    by_eigenvalue = np.zeros_like(gradients)
    by_eigenvalue[:, : fit.eigenvalue.size] = 2 * fit.eigenvalue * stretch
    moved: FloatArray = -fit.response @ (gradients + by_eigenvalue @ fit.normal.hessian).T
    # a rigid mode has no slope and needs none
    own_omega = np.sqrt(np.where(stretch.any(axis=0), fit.eigenvalue, 1.0))
    rate = (fit.law.slope(own_omega, data.model.strain) @ fit.coefficients) * own_omega * stretch
    if fit.law.groups:
        strain = state.strain_jacobian
        slope = fit.law.by_strain(own_omega, fit.coefficients, strain.shape[2])
        rate += np.einsum("pmq,mq->pm", strain, slope)
    return moved + _by_rates(fit, rate.T)


def _by_stretch(state: ForwardState) -> FloatArray:
    """(q, m) relative change of every mode's circular frequency, ½ ∂ln λ/∂θ: 0 of rigid ones."""
    value = state.modes.eigenvalue
    moving = np.arange(value.size) >= state.modes.rigid
    by: FloatArray = (state.eigenvalue_jacobian / np.where(moving, 2 * value, np.inf)[:, None]).T
    return by


def _by_rates(fit: DampingFit, rate: FloatArray) -> FloatArray:
    """(p, q) what it does to the estimate that the law's (m, q) rates move at given coefficients,
    shifts and own rates.

    A mode with a rate of its own is tied to the law's, any other follows it. Without this part a
    shift, which takes up the model's own change of a frequency, would pass for one of the measured
    frequency, and so for another law.
    """
    rate = rate.copy()
    rate[fit.nuisance.suspension_modes] = 0.0
    own = np.isin(np.arange(len(rate)), fit.nuisance.modes[fit.nuisance.deviation_sd > 0])
    by_rate = (fit.response @ fit.normal.hessian)[:, len(rate) :]
    relative = rate[own] / fit.law_rate[own, None]
    moved: FloatArray = fit.tie[:, own] @ relative - by_rate[:, ~own] @ rate[~own]
    return moved


def _best_first(outcomes: Sequence[DampingFit | Unsettled]) -> list[DampingFit]:
    """The fits among what starts ended with.

    Raises:
        UpdatingError: there is none.
    """
    fits = [each for each in outcomes if isinstance(each, DampingFit)] or [settled(outcomes[-1])]
    return sorted(fits, key=lambda fit: fit.objective)


def _different(fits: Sequence[DampingFit]) -> list[DampingFit]:
    """Fits that lie further from all before them than round-off, and than the noise of the first
    resolves.
    """
    apart = _SAME_TO_NOISE * np.sqrt(np.diag(fits[0].noise_covariance))
    kept: list[DampingFit] = []
    for fit in fits:
        point, others = fit.coefficients, [each.coefficients for each in kept]
        if all(
            np.any(np.abs(point - other) > np.maximum(_SAME_OPTIMUM * np.abs(other), apart))
            for other in others
        ):
            kept.append(fit)
    return kept


_USUAL = (2.0, 5.0)  # 1/τ of usual windows, over the record's length
_OF_DECAY = 0.5  # share of the slowest mode's decay that a window has where FRFs look windowed
_FEWEST_MODES = 3  # that show a constant part of the decay
_MATTERS = 0.05  # share of a coefficient that an unstated window may take


def unstated_window(damping: DampingResult, inputs: Inputs, record_s: float) -> list[Finding]:
    """What a user must know of a window that nobody stated; nothing where it was, or where it would
    hardly matter.

    Args:
        damping: the fitted law.
        inputs: what the laboratory says of the window.
        record_s: T, the length of the records that the FRFs' line spacing is of.
    """
    if inputs.window_known:
        return []
    values, names = damping.fit.coefficients, damping.fit.law.coefficient_names
    fractions = np.abs(damping.window / np.where(values == 0, 1.0, values))
    worst = int(np.argmax(fractions))
    if fractions[worst] < _MATTERS:
        return []
    omega, ratio = damping.reference.ratios.omega, damping.reference.ratios.ratio
    rate = looks_windowed(omega, ratio - (inputs.window_rate or 0.0) / omega, record_s)
    if rate is None:
        return [finding("window_unstated", name=names[worst], percent=100 * fractions[worst])]
    return [
        finding("looks_windowed", rate=rate, record=record_s, end=100 * np.exp(-rate * record_s))
    ]


def looks_windowed(omega: FloatArray, ratio: FloatArray, record_s: float) -> float | None:
    """The part of the decay that all modes share, 1/s, where it is that of a usual window; else
    None.

    Args:
        omega: (n,) circular frequencies, rad/s.
        ratio: (n,) damping ratios.
        record_s: T, s.
    """
    if omega.size < _FEWEST_MODES:
        return None
    decay = ratio * omega
    basis = np.column_stack([np.ones_like(omega), omega**2]) / decay[:, None]
    constant = float(nearest(basis, np.ones_like(omega))[0])
    usual = _USUAL[0] <= constant * record_s <= _USUAL[1]
    return constant if usual and constant > _OF_DECAY * decay.min() else None
