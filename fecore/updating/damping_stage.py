"""Stage 2 in the pipeline: which modes shift, how noisy the data are, and what the estimate's spread is made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.damping import DampingLaw, ModalDamping, damping_ratio, fit_ratios
from fecore.frf import FrfSet, ModalFrfModel, convert
from fecore.identification.noise import residual_variance
from fecore.modes import MeasuredModes
from fecore.updating.damping import DampingFit, FrfMisfit, Weighting, fit_law
from fecore.updating.elastic import ElasticResult
from fecore.updating.posterior import discrepancy

DAMPING_DISCREPANCY = 0.02
"""Prior standard deviation of a damping ratio about its law, as a share of it, for the intervals."""

LAW_DISCREPANCY = 0.002
"""The same for the estimate, as `elastic.THEORY_DISCREPANCY` is to `elastic.FREQUENCY_DISCREPANCY`."""

_FIRST_RATIO = 0.02  # of modes whose damping was not measured


@dataclass(frozen=True)
class DampingResult:
    """A damping law from FRFs, with its spread.

    Attributes:
        fit: the fitted law.
        start: (p,) coefficients that the measured damping ratios give: the model before stage 2.
        modal: the same data fitted with a ratio of its own for every measured mode.
        covariance: (p, p) with noise, stage 1's uncertainty and the law's discrepancy.
        discrepancy: estimated relative deviation of a damping ratio from the law.
        misfit: what was minimised, with the noise variance that was used.
    """

    fit: DampingFit
    start: FloatArray
    modal: DampingFit
    covariance: FloatArray
    discrepancy: float
    misfit: FrfMisfit


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

    @property
    def shifted(self) -> IntArray:
        """Numbers, among all modes, of those that were measured: they carry a frequency shift."""
        rigid = self.elastic.updated.modes.rigid
        return np.array([rigid + column for _, column in self.elastic.pairing.pairs])

    @property
    def shift(self) -> FloatArray:
        """(s,) first relative shifts: measured over model frequency."""
        pairs = self.elastic.pairing.pairs
        return np.array([self.modes.frequency_hz[i] / self.elastic.updated.frequency_hz[j] - 1 for i, j in pairs])

    def start(self, law: DampingLaw) -> FloatArray:
        """(p,) coefficients that come nearest to the measured damping ratios (2 % where none was measured)."""
        ratio = np.nan_to_num(self.modes.damping_ratio, nan=_FIRST_RATIO)
        ratio = np.where(ratio > 0, ratio, _FIRST_RATIO)
        omega = 2 * np.pi * self.modes.frequency_hz
        coefficients = fit_ratios(law, omega, ratio)
        if np.all(law.basis(omega) @ coefficients > 0):
            return coefficients
        return fit_ratios(law, omega, np.full_like(ratio, float(np.median(ratio))))

    def fit(self, law: DampingLaw, progress: Callable[[float], None] = lambda _: None) -> DampingResult:
        """Fit a law and a modal reference, weighted by the noise of the FRFs.

        Raises:
            UpdatingError: no convergence.
        """
        start = self.start(law)
        modal_law = ModalDamping(tuple(np.sort(self.model.omega[self.shifted])))
        misfit = self._misfit(modal_law)
        progress(0.4)
        modal = fit_law(misfit, modal_law, self.start(modal_law), self.shifted, self.shift)
        progress(0.6)
        missed = self._missed_by(law, modal)
        tight = discrepancy(missed, len(law.coefficient_names), LAW_DISCREPANCY)
        spread = discrepancy(missed, len(law.coefficient_names), DAMPING_DISCREPANCY)
        # Only with noise weights is the misfit a likelihood, which a prior on deviations can be added to.
        fit = fit_law(misfit, law, start, self.shifted, self.shift, tight if self.weighting == "noise" else None)
        progress(0.9)
        covariance = fit.noise_covariance + self._law_spread(fit, spread) + self._elastic_spread(fit, misfit)
        return DampingResult(fit, start, modal, covariance, spread, misfit)

    def _missed_by(self, law: DampingLaw, modal: DampingFit) -> FloatArray:
        """(s,) how far the law that comes nearest misses the ratios of a modal fit, as ln(law/modal)."""
        omega = np.sqrt(modal.eigenvalue[self.shifted])
        ratio = modal.rate[self.shifted] / (2 * omega)
        if omega.size <= len(law.coefficient_names):
            return np.zeros(omega.size)
        near = fit_ratios(law, omega, ratio)
        if np.any(law.basis(omega) @ near <= 0):
            near = fit_ratios(law, omega, np.full(omega.size, np.median(ratio)))
        missed: FloatArray = np.log(damping_ratio(law, near, omega) / ratio)
        return missed

    def _misfit(self, modal_law: ModalDamping) -> FrfMisfit:
        """The misfit with a noise variance: the measured one, or one from the residual of an unweighted modal fit."""
        if self.frfs.variance is not None:
            return FrfMisfit(self.frfs, self.model, self.weighting, self.frfs.variance)
        even = FrfMisfit(self.frfs, self.model, "linear", np.ones(self.frfs.values.shape))
        first = fit_law(even, modal_law, self.start(modal_law), self.shifted, self.shift)
        predicted = even.predict(first.eigenvalue, first.rate)
        measured = np.ones(predicted.shape, dtype=bool)
        variance = residual_variance(self.frfs.values - predicted, predicted, measured, 0)
        return FrfMisfit(self.frfs, self.model, self.weighting, variance)

    def _law_spread(self, fit: DampingFit, relative: float) -> FloatArray:
        """(p, p) covariance by each measured mode's ratio deviating from the law by its share."""
        modes = fit.eigenvalue.size
        by_rate = (fit.response @ fit.normal.hessian)[:, modes + self.shifted] * fit.law_rate[self.shifted] * relative
        spread: FloatArray = by_rate @ by_rate.T
        return spread

    def _elastic_spread(self, fit: DampingFit, misfit: FrfMisfit) -> FloatArray:
        """(p, p) covariance by stage 1: wrong constants move shapes and the modes that carry no shift."""
        state = self.elastic.updated
        omega = self.frfs.omega
        denominator = fit.eigenvalue[:, None] - omega**2 + 1j * omega * fit.rate[:, None]
        by_residue = state.residue_jacobian(self.frfs.responses, self.frfs.references) @ (
            convert(omega, self.frfs.quantity) / denominator
        )
        by = misfit.derivatives(fit.eigenvalue, fit.rate)
        _, weight = misfit.residual(misfit.predict(fit.eigenvalue, fit.rate))
        gradients = np.array([misfit.gradient(by, weight * change) for change in by_residue])
        by_eigenvalue = np.zeros_like(gradients)
        by_eigenvalue[:, : fit.eigenvalue.size] = state.eigenvalue_jacobian.T
        moved = -(gradients + by_eigenvalue @ fit.normal.hessian) @ fit.response.T
        spread: FloatArray = moved.T @ self.elastic.covariance @ moved
        return spread
