"""Stage 2 in the pipeline: which modes shift, how noisy the data are, and what the estimate's spread is made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.damping import DampingLaw, ModalDamping, fit_ratios
from fecore.errors import UpdatingError
from fecore.frf import FrfSet, ModalFrfModel, convert
from fecore.identification.noise import residual_variance
from fecore.modes import MeasuredModes
from fecore.updating.damping import DampingFit, Nuisance, fit_law
from fecore.updating.elastic import ElasticResult
from fecore.updating.misfit import FrfMisfit, Weighting
from fecore.updating.posterior import discrepancy

DAMPING_DISCREPANCY = 0.02
"""Prior standard deviation of a damping ratio about its law, as a share of it, for the intervals."""

LAW_DISCREPANCY = 0.002
"""The same for the estimate, as `elastic.THEORY_DISCREPANCY` is to `elastic.FREQUENCY_DISCREPANCY`."""

_UNMEASURED_SHIFT = 0.01  # prior standard deviation of the shift of an unmeasured mode, the constants given
_UNMEASURED_DEVIATION = 2.0  # and of the logarithm of its damping over the law's: nobody measured it
_GAIN_SD = 0.01  # prior standard deviation of a mode's gain: what a sensor's calibration is good for
_FIRST_NOISE = 1e-3
_FIRST_RATIO = 0.02  # of modes whose damping was not measured
_SAME_OPTIMUM = 1e-3  # relative distance of coefficients that counts as one point
_SAME_TO_NOISE = 0.3  # and their distance in standard deviations by noise alone
_RIVAL = 10.0  # difference of negative log posteriors below which a second optimum is worth telling
_SPREAD_OF_STARTS = 5.0


@dataclass(frozen=True)
class DampingResult:
    """A damping law from FRFs, with its spread.

    Attributes:
        fit: the fitted law, the best of all starts.
        start: (p,) coefficients that the measured damping ratios give: the model before stage 2.
        starts: how many starts were tried.
        optima: coefficients of every different point that the starts converged to and that the data do not refute
            against the best, which comes first.
        modal: the same data fitted with a ratio of its own for every measured mode.
        covariance: (p, p) with noise, stage 1's uncertainty and the law's discrepancy.
        sampled_covariance: (p, p) Gaussian approximation of the posterior given the damping ratios as the estimate took them.
        admitted_covariance: (p, p) what the discrepancy adds beyond that.
        tight: relative deviation from the law that the estimate allowed.
        by_elastic: (p, q) derivative of the estimate by the elastic parameters.
        discrepancy: estimated relative deviation of a damping ratio from the law.
        misfit: what was minimised, with the noise variance that was used.
    """

    fit: DampingFit
    start: FloatArray
    starts: int
    optima: tuple[FloatArray, ...]
    modal: DampingFit
    covariance: FloatArray
    sampled_covariance: FloatArray
    admitted_covariance: FloatArray
    tight: float
    by_elastic: FloatArray
    discrepancy: float
    misfit: FrfMisfit


@dataclass(frozen=True)
class MeasuredRatios:
    """Damping ratios of the paired modes that the law has to explain.

    Attributes:
        omega: (n,) circular frequencies, rad/s.
        ratio: (n,) damping ratios.
        relative_covariance: (n, n) covariance of their noise, relative.
    """

    omega: FloatArray
    ratio: FloatArray
    relative_covariance: FloatArray


@dataclass(frozen=True)
class DampingStage:
    """The data of stage 2: FRFs in the band, stage 1's result, measured modes."""

    frfs: FrfSet
    elastic: ElasticResult
    modes: MeasuredModes
    weighting: Weighting

    @cached_property
    def model(self) -> ModalFrfModel:
        """The updated elastic model between the measured dofs."""
        return self.elastic.updated.frf_model(self.frfs.responses, self.frfs.references)

    @cached_property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """Measured and model modes with a resonance in the band: of others the FRFs tell no damping.

        Raises:
            UpdatingError: there is none.
        """
        low, high = self.frfs.frequency_hz[[0, -1]]
        hz = self.modes.frequency_hz
        inside = tuple((i, j) for i, j in self.elastic.pairing.pairs if low <= hz[i] <= high)
        if not inside:
            raise UpdatingError(f"no paired mode lies in the band, {low:g} to {high:g} Hz; fit a wider one", {}, ())
        return inside

    @cached_property
    def shifted(self) -> IntArray:
        """Numbers, among all modes, of those that were measured in the band: they carry a frequency shift."""
        rigid = self.elastic.updated.modes.rigid
        return np.array([rigid + column for _, column in self.pairs])

    @cached_property
    def first_shift(self) -> FloatArray:
        """(s,) measured over model frequency of the shifted modes, relative."""
        return np.array([self.modes.frequency_hz[i] / self.elastic.updated.frequency_hz[j] - 1 for i, j in self.pairs])

    @cached_property
    def unmeasured(self) -> IntArray:
        """Numbers, among all modes, of elastic ones without a measured partner in the band: their tails reach into it."""
        elastic = np.arange(self.elastic.updated.modes.rigid, self.model.omega.size)
        return np.setdiff1d(elastic, self.shifted)

    @cached_property
    def suspended(self) -> IntArray:
        """Numbers, among all modes, of those that move as a body on its suspension, which damps them as it will."""
        updated = self.elastic.updated
        rigid = updated.modes.rigid
        return np.concatenate([np.arange(rigid), rigid + np.flatnonzero(updated.on_springs)])

    @cached_property
    def rows(self) -> list[int]:
        """Measured modes whose damping the law has to explain: those with a partner that is not suspended.

        Raises:
            UpdatingError: there is none.
        """
        rows = [row for (row, _), mode in zip(self.pairs, self.shifted, strict=True) if mode not in self.suspended]
        if not rows:
            raise UpdatingError("no measured mode strains the specimen: all move on the springs", {}, ())
        return rows

    @cached_property
    def lawful(self) -> IntArray:
        """Numbers, among all modes, of the partners of `rows`."""
        return self.shifted[~np.isin(self.shifted, self.suspended)]

    @cached_property
    def first_ratio(self) -> FloatArray:
        """(n,) damping ratios of `rows` as measured, 2 % where none was."""
        ratio = np.nan_to_num(self.modes.damping_ratio[self.rows], nan=_FIRST_RATIO)
        return np.where(ratio > 0, ratio, _FIRST_RATIO)

    @cached_property
    def unmeasured_shift_sd(self) -> FloatArray:
        """(u,) prior standard deviations of the shifts of `unmeasured`: the constants may be uncertain that tell them."""
        state = self.elastic.updated
        by = state.eigenvalue_jacobian[self.unmeasured] / (2 * state.modes.eigenvalue[self.unmeasured, None])
        variance = np.einsum("kp,pq,kq->k", by, self.elastic.covariance, by)
        spread: FloatArray = np.sqrt(_UNMEASURED_SHIFT**2 + variance)
        return spread

    def nuisance(self, deviation_sd: float) -> Nuisance:
        """Measured modes shift freely and deviate from the law a little, the others do both as far as priors let them.

        Suspended ones have rates of their own, which may lie as far from the lowest elastic mode's as nobody knows.
        """
        pairs, others = self.pairs, self.unmeasured.size
        modes = np.concatenate([self.shifted, self.unmeasured])
        deviation = np.concatenate([np.full(len(pairs), deviation_sd), np.full(others, _UNMEASURED_DEVIATION)])
        lowest = 2 * self.first_ratio[0] * 2 * np.pi * self.modes.frequency_hz[self.rows[0]]
        return Nuisance(
            modes=modes,
            first_shift=np.concatenate([self.first_shift, np.zeros(others)]),
            shift_sd=np.concatenate([np.full(len(pairs), np.inf), self.unmeasured_shift_sd]),
            deviation_sd=np.where(np.isin(modes, self.suspended), 0.0, deviation),
            suspended=self.suspended,
            suspended_rate=np.full(self.suspended.size, lowest),
        )

    @cached_property
    def modal_law(self) -> ModalDamping:
        """A damping ratio of its own for every measured mode that the law damps."""
        shift = self.first_shift[~np.isin(self.shifted, self.suspended)]
        return ModalDamping(tuple(np.sort(self.model.omega[self.lawful] * (1 + shift))))

    @cached_property
    def misfit(self) -> FrfMisfit:
        """The misfit with a noise variance: the measured one, or one from the residual of an unweighted modal fit."""
        stated = self.frfs.variance
        if stated is not None and not np.isnan(stated).any():
            return FrfMisfit(self.frfs, self.model, self.weighting, stated, self._gain_sd)
        measured = self.frfs.measured
        even = FrfMisfit(self.frfs, self.model, "linear", np.where(measured, 1.0, np.inf))
        first = fit_law(even, self.modal_law, self.start(self.modal_law), self.nuisance(0), self._unit(even))
        predicted = even.predict(first.eigenvalue, first.rate)
        variance = residual_variance(self.frfs.values - predicted, predicted, measured, 0)
        if stated is not None:
            variance = np.where(np.isnan(stated), variance, stated)
        return FrfMisfit(self.frfs, self.model, self.weighting, variance, self._gain_sd)

    @property
    def _gain_sd(self) -> FloatArray | None:
        """Prior spread of the gains of the modes that the law has to explain; only `noise` weights give it a unit."""
        if self.weighting != "noise":
            return None
        return np.where(np.isin(np.arange(self.model.omega.size), self.lawful), _GAIN_SD, 0.0)

    @cached_property
    def modal(self) -> DampingFit:
        """The reference of every law: a ratio of its own for every measured mode."""
        nuisance = self.nuisance(0)
        return fit_law(self.misfit, self.modal_law, self.start(self.modal_law), nuisance, self._unit(self.misfit))

    @cached_property
    def scale(self) -> float:
        """What E of one value is by noise alone, with the weighting of this stage."""
        return 1.0 if self.weighting == "noise" else self.modal.cost / np.sum(self.misfit.counted)

    @staticmethod
    def _unit(misfit: FrfMisfit) -> float:
        """A first guess of `scale`: a thousandth of the signal's own weight."""
        return 1.0 if misfit.weighting == "noise" else _FIRST_NOISE * misfit.signal() / misfit.measured.values.size

    @cached_property
    def ratios(self) -> MeasuredRatios:
        """Damping ratios of `rows`: as measured where they were, else from the modal fit."""
        rows = self.rows
        measured = self.modes.damping_ratio[rows]
        if np.all(np.nan_to_num(measured) > 0):
            covariance = np.zeros((len(rows), len(rows)))
            if self.modes.covariance is not None:
                places = len(self.modes) + np.array(rows)
                covariance = self.modes.covariance[np.ix_(places, places)]
            omega = 2 * np.pi * self.modes.frequency_hz[rows]
            return MeasuredRatios(omega, measured, covariance / np.outer(measured, measured))
        return self.modal_ratios

    @cached_property
    def modal_ratios(self) -> MeasuredRatios:
        """Damping ratios of `rows` in the modal fit."""
        omega = np.sqrt(self.modal.eigenvalue[self.lawful])
        ratio = self.modal.rate[self.lawful] / (2 * omega)
        order = np.argsort(self.model.omega[self.lawful])  # the modal law's coefficients ascend with their knots
        covariance = np.empty((ratio.size, ratio.size))
        covariance[np.ix_(order, order)] = self.modal.noise_covariance
        return MeasuredRatios(omega, ratio, covariance / np.outer(ratio, ratio))

    def start(self, law: DampingLaw) -> FloatArray:
        """(p,) coefficients that come nearest to the measured damping ratios (2 % where none was measured)."""
        omega = 2 * np.pi * self.modes.frequency_hz[self.rows]
        return nearest_positive(law, omega, self.first_ratio, self.model.omega[self.unmeasured])

    def fit(self, law: DampingLaw, *, many_starts: bool, progress: Callable[[float], None]) -> DampingResult:
        """Fit a law, from one start or from several that lie far apart.

        Raises:
            UpdatingError: no start converged.
        """
        start = self.start(law)
        missed = np.log(law_ratio(law, self.ratios.omega, self.ratios.ratio) / self.ratios.ratio)
        tight = discrepancy(missed, len(law.coefficient_names), LAW_DISCREPANCY)
        spread = discrepancy(missed, len(law.coefficient_names), DAMPING_DISCREPANCY)
        starts = self.starts(law) if many_starts else [start]
        fits: list[DampingFit] = []
        for done, first in enumerate(starts):
            progress(done / len(starts))
            fits += self._try(law, first, tight, last_hope=not fits and done == len(starts) - 1)
        fits.sort(key=lambda fit: fit.objective)
        best = fits[0]
        by_elastic = self._by_elastic(best)
        covariance = (
            best.noise_covariance
            + self._model_spread(best, spread)
            + by_elastic @ self.elastic.covariance @ by_elastic.T
        )
        sampled = self.sampled_ratios(tight)
        slope = law.basis(sampled.omega) / (2 * sampled.omega * sampled.ratio)[:, None]
        rivals = [fit.coefficients for fit in fits if fit.objective - best.objective < _RIVAL * self.scale]
        optima = _different(rivals, _SAME_TO_NOISE * np.sqrt(np.diag(best.noise_covariance)))
        return DampingResult(
            fit=best,
            start=start,
            starts=len(starts),
            optima=optima,
            modal=self.modal,
            covariance=covariance,
            sampled_covariance=np.linalg.inv(slope.T @ np.linalg.inv(sampled.relative_covariance) @ slope),
            admitted_covariance=self._model_spread(best, float(np.sqrt(max(spread**2 - tight**2, 0.0)))),
            tight=tight,
            by_elastic=by_elastic,
            discrepancy=spread,
            misfit=self.misfit,
        )

    def sampled_ratios(self, tight: float) -> MeasuredRatios:
        """Ratios of the modal fit to these FRFs, known to their noise and to the deviation that the estimate allows."""
        own = self.modal_ratios
        return replace(own, relative_covariance=own.relative_covariance + tight**2 * np.eye(own.ratio.size))

    def starts(self, law: DampingLaw) -> list[FloatArray]:
        """The measured ratios' law, it scaled up and down, and each coefficient alone."""
        start, omega, ratio = self.start(law), self.ratios.omega, np.median(self.ratios.ratio)
        basis = law.basis(omega)
        damping = np.flatnonzero(np.all(basis > 0, axis=0))  # coefficients that alone would damp every mode
        alone = [np.median(2 * omega * ratio / basis[:, j]) * np.eye(basis.shape[1])[j] for j in damping]
        return [start, start * _SPREAD_OF_STARTS, start / _SPREAD_OF_STARTS, *alone]

    def _try(self, law: DampingLaw, start: FloatArray, tight: float, *, last_hope: bool) -> list[DampingFit]:
        nuisance = self.nuisance(tight)
        try:
            return [fit_law(self.misfit, law, start, nuisance, self.scale)]
        except UpdatingError:
            if last_hope:
                raise
            return []

    def _model_spread(self, fit: DampingFit, relative: float) -> FloatArray:
        """(p, p) covariance by each mode lying off the law by its share, and unmeasured ones off the model's frequency."""
        m, others = fit.eigenvalue.size, self.unmeasured
        by = fit.response @ fit.normal.hessian
        by_rate = by[:, m + fit.nuisance.modes] * fit.rate[fit.nuisance.modes] * relative
        by_shift = by[:, others] * 2 * fit.eigenvalue[others] * self.elastic.discrepancy
        spread: FloatArray = by_rate @ by_rate.T + by_shift @ by_shift.T
        return spread

    def _by_elastic(self, fit: DampingFit) -> FloatArray:
        """(p, q) derivative of the estimate by stage 1's: constants move shapes, and the modes that carry no shift."""
        state, misfit = self.elastic.updated, self.misfit
        omega = self.frfs.omega
        flexibility = convert(omega, self.frfs.quantity) / (
            fit.eigenvalue[:, None] - omega**2 + 1j * omega * fit.rate[:, None]
        )
        jacobian = misfit.jacobian(fit.eigenvalue, fit.rate)
        by_residue = state.residue_jacobian(self.frfs.responses, self.frfs.references) @ flexibility
        if jacobian.factors is not None:
            by_drive = state.residue_jacobian(self.frfs.responses, self.frfs.responses) @ flexibility
            by_residue = jacobian.factors[0] * by_residue + jacobian.factors[1] * by_drive
        _, weight = misfit.residual(misfit.predict(fit.eigenvalue, fit.rate))
        gradients = np.array([jacobian.gradient(weight * change) for change in by_residue]) @ fit.normal.reduction
        by_eigenvalue = np.zeros_like(gradients)
        by_eigenvalue[:, : fit.eigenvalue.size] = state.eigenvalue_jacobian.T
        moved: FloatArray = -fit.response @ (gradients + by_eigenvalue @ fit.normal.hessian).T
        return moved


def law_ratio(law: DampingLaw, omega: FloatArray, ratio: FloatArray) -> FloatArray:
    """(n,) ratios of the law that comes nearest to given ones."""
    near: FloatArray = law.basis(omega) @ nearest_positive(law, omega, ratio) / (2 * omega)
    return near


def nearest_positive(
    law: DampingLaw, omega: FloatArray, ratio: FloatArray, others: FloatArray | tuple[()] = ()
) -> FloatArray:
    """Coefficients nearest to given ratios; where those would damp one of these or other modes negatively, to their median."""
    if omega.size < len(law.coefficient_names):
        raise UpdatingError(
            f"{omega.size} measured {'mode' if omega.size == 1 else 'modes'} cannot fix the {len(law.coefficient_names)} "
            f"coefficients of the {law.name} law; measure a wider band, or put `modal` first in damping_models",
            best={},
            history=(),
        )
    coefficients = fit_ratios(law, omega, ratio)
    if np.all(law.basis(np.concatenate([omega, others])) @ coefficients > 0):
        return coefficients
    return fit_ratios(law, omega, np.full_like(ratio, float(np.median(ratio))))


def _different(points: list[FloatArray], apart: FloatArray) -> tuple[FloatArray, ...]:
    """Points that lie further from all before them than the fit resolves: than round-off, or than (p,) `apart`."""
    kept: list[FloatArray] = []
    for point in points:
        if all(np.any(np.abs(point - other) > np.maximum(_SAME_OPTIMUM * np.abs(other), apart)) for other in kept):
            kept.append(point)
    return tuple(kept)
