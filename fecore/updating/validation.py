"""Validation on what the fits did not see: predicted FRFs with intervals, and how many measured
values lie in them.

A prediction is uncertain by the elastic constants θ, the law's coefficients a (which follow θ:
∂a/∂θ is known from stage 2), by each mode's own deviation from the model in frequency and in
damping, and by the noise of the new measurement. All of it is carried through the derivatives of
the FRF, for real and imaginary parts apart.
"""

from dataclasses import dataclass

import numpy as np

from fecore.arrays import ComplexArray, FloatArray
from fecore.correlation import Agreement, correlate
from fecore.dynamics.synthesis import ModalFrfModel
from fecore.frf import Dof, FrfSet, convert
from fecore.normal import Z_95
from fecore.updating.damping_stage import DampingResult
from fecore.updating.elastic_result import ElasticResult
from fecore.updating.posterior import root
from fecore.updating.result import HeldOut

_VALUES_AT_ONCE = 200_000  # of FRFs whose changes are held in memory, some twenty for each value


@dataclass(frozen=True)
class Predictor:
    """The updated model with its uncertainty."""

    elastic: ElasticResult
    damping: DampingResult

    def predict(self, frfs: FrfSet) -> tuple[ComplexArray, FloatArray]:
        """(N, L) predicted FRFs, and (2, N, L) variances of their real and imaginary parts, noise
        not included.
        """
        predicted, changes = self._with_changes(frfs)
        return predicted, _squares(changes)

    def spread(self, frfs: FrfSet) -> tuple[FloatArray, FloatArray]:
        """(N, L) standard deviations of ln|H| and of the phase in radians of predicted FRFs, noise
        not included.

        To first order a small change of H is a change of ln|H| by the real part of δH/H and of the
        phase by the imaginary one.
        """
        few = max(1, _VALUES_AT_ONCE // frfs.frequency_hz.size)
        parts = []
        for first in range(0, len(frfs.responses), few):
            some = frfs.select(list(range(first, min(first + few, len(frfs.responses)))))
            predicted, changes = self._with_changes(some)
            # at a zero of H nothing is known of its logarithm
            with np.errstate(divide="ignore", invalid="ignore"):
                changes *= 1 / predicted
            parts.append(np.sqrt(_squares(changes)))
        log_magnitude, phase = (
            np.nan_to_num(np.vstack(part), nan=np.inf) for part in zip(*parts, strict=True)
        )
        return log_magnitude, phase

    def _with_changes(self, frfs: FrfSet) -> tuple[ComplexArray, ComplexArray]:
        """(N, L) predicted FRFs, and (q, N, L) their change by one standard deviation of each of q
        independent causes.
        """
        model = self.elastic.updated.frf_model(frfs.responses, frfs.references)
        fit = self.damping.fit
        return fit.synthesise(model, frfs.frequency_hz, frfs.quantity), self._changes(
            frfs, model, fit.rates(model)
        )

    def _changes(self, frfs: FrfSet, model: ModalFrfModel, rate: FloatArray) -> ComplexArray:
        """(q, N, L) those changes, of a roving mass too."""
        change = self._plain_changes(frfs, frfs.references, model, rate)
        factors = model.load_factors(frfs.frequency_hz, rate, frfs.quantity)
        if factors is None or model.roving is None:
            return change
        loaded: ComplexArray = factors[0] * change
        loaded += factors[1] * self._plain_changes(
            frfs, frfs.responses, model.roving.drive(model), rate
        )
        return loaded

    def _plain_changes(
        self, frfs: FrfSet, references: tuple[Dof, ...], model: ModalFrfModel, rate: FloatArray
    ) -> ComplexArray:
        """(q, N, L) the same of FRFs to other references, without a roving mass."""
        omega, state = frfs.omega, self.elastic.updated
        factor = convert(omega, frfs.quantity)
        flexibility = 1 / (model.eigenvalue[:, None] - omega**2 + 1j * omega * rate[:, None])
        by_eigenvalue = -factor * flexibility**2
        lines = np.vstack([factor * flexibility, by_eigenvalue, 1j * omega * by_eigenvalue])
        A, m = model.residues, model.eigenvalue.size
        basis = self.damping.fit.law.basis(model.omega, model.strain)
        basis[self.damping.fit.nuisance.suspension_modes] = 0
        shifted = self.damping.fit.nuisance.modes
        covariance = self.damping.joint(self.elastic.covariance, self.damping.fit.noise_covariance)
        p, e = len(covariance), shifted.size
        # Of the lines' functions, in the change of each FRF by each constant and coefficient.
        weights = np.zeros((p, len(A), 3 * m))
        weights[: self.elastic.theta.size, :, :m] = state.residue_jacobian(
            frfs.responses, references
        )
        weights[: self.elastic.theta.size, :, m : 2 * m] = (
            A * state.eigenvalue_jacobian.T[:, None, :]
        )
        weights[self.elastic.theta.size :, :, 2 * m :] = A * basis.T[:, None, :]
        weights = np.tensordot(root(covariance).T, weights, 1)
        # The weights are real: real and imaginary parts go side by side through products of real
        # numbers.
        parts = np.ascontiguousarray(lines).view(np.float64)
        change = np.empty((p + 2 * e, len(A), parts.shape[1]))
        change[:p] = (weights.reshape(-1, 3 * m) @ parts).reshape(p, len(A), -1)
        shift = 2 * model.eigenvalue[shifted] * self.elastic.discrepancy
        deviation = rate[shifted] * self.damping.discrepancy
        for own, size, first in (
            (change[p : p + e], shift, m),
            (change[p + e :], deviation, 2 * m),
        ):
            np.multiply(
                (size * A[:, shifted]).T[:, :, None], parts[first + shifted][:, None], out=own
            )
        return change.view(np.complex128)

    def hold_against(
        self, frfs: FrfSet, points: tuple[int, ...], band_hz: tuple[float, float]
    ) -> HeldOut:
        """Compare held-out FRFs with their prediction; the noise level is that of the fitted
        data.
        """
        predicted, variance = self.predict(frfs)
        measured = frfs.measured
        stated = np.nan if frfs.variance is None else frfs.variance
        noise = np.where(np.isnan(stated), self._noise(predicted), stated)
        error = frfs.values - predicted
        inside = [
            (np.abs(part) <= Z_95 * np.sqrt(spread + noise / 2))[measured]
            for part, spread in zip((error.real, error.imag), variance, strict=True)
        ]
        return HeldOut(
            points=points,
            band_hz=band_hz,
            agreement=agreement(frfs, predicted),
            coverage_95=float(np.mean(inside)),
        )

    def _noise(self, predicted: ComplexArray) -> FloatArray:
        """(N, L) noise variance of unseen FRFs: the fitted ones' v = a² + b²|H|², with the median
        a² and b².
        """
        seen, modal = self.damping.reference.misfit, self.damping.reference.fit
        level = np.abs(seen.predict(modal.eigenvalue, modal.rate)) ** 2
        rows = zip(level, seen.variance, seen.counted, strict=True)
        pairs = np.array([_line(row[known], floor[known]) for row, floor, known in rows])
        slope, constant = np.median(pairs, axis=0)
        variance: FloatArray = constant + slope * np.abs(predicted) ** 2
        return variance


def _squares(changes: ComplexArray) -> FloatArray:
    """(2, N, L) sums of the squares of real and imaginary parts of (q, N, L) changes."""
    parts = changes.view(np.float64).reshape(*changes.shape, 2)
    return np.moveaxis(np.einsum("qnlc,qnlc->nlc", parts, parts), -1, 0)


def agreement(frfs: FrfSet, predicted: ComplexArray) -> Agreement:
    """All criteria of some FRFs, over the values that were measured."""
    values, there = (np.where(frfs.measured, each, 0) for each in (frfs.values, predicted))
    return correlate("FRFs", values, there)


def _line(level: FloatArray, variance: FloatArray) -> FloatArray:
    """Slope and constant of v = a² + b² level, neither below zero."""
    slope = float(np.polyfit(level, variance, 1)[0]) if np.ptp(level) > 0 else 0.0
    slope = max(slope, 0.0)
    return np.array([slope, max(float(np.mean(variance - slope * level)), float(variance.min()))])
