"""One or two modes of known rank in a narrow band about a pole: least squares with their shapes eliminated.

The unknowns θ are (ln f_q, ζ_q) and the free entries of l_q, how well each reference sees mode q, its largest entry being 1.
For given θ the shapes ψ_q and a complex constant for each FRF are linear; one matrix serves all roving dofs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from fecore.arrays import ComplexArray, FloatArray, IntArray
from fecore.modal.arrangement import Arrangement
from fecore.modal.basis import DAMPING_RANGE, poles
from fecore.modal.refinement import widened

_REACH = 6.0  # half bandwidths on each side of the pole that are fitted
_LEAST_REACH = 5.0  # ... and at least lines
_FEWEST_LINES = 8  # of such a band
_EVALUATIONS = 40  # of the least squares


@dataclass(frozen=True)
class Modes:
    """Modes in a band: what was fitted, and what is left.

    Attributes:
        frequency_hz, damping_ratio: (q,).
        seen: (q, m) how well each reference sees each mode, largest entry 1.
        chi_squared: weighted sum of squared residuals.
        freedom: its expectation where the model is true.
        jacobian: (rows, p, parameters) derivatives of the residual; residual: (rows, p).
    """

    frequency_hz: FloatArray
    damping_ratio: FloatArray
    seen: ComplexArray
    chi_squared: float
    freedom: int
    jacobian: FloatArray
    residual: FloatArray


@dataclass(frozen=True)
class Band:
    """FRFs of p roving against m fixed dofs on the lines about a pole, without what other poles make of them.

    Attributes:
        omega: (L,) rad/s; power: of iω that makes these FRFs of a receptance.
        values: (p, m, L); weight: (m, L) 2/v, alike for all roving dofs.
        place: (p, m) number of each FRF.
        frequency_hz, damping_ratio: of the pole.
    """

    omega: FloatArray
    power: int
    values: ComplexArray
    weight: FloatArray
    place: IntArray
    frequency_hz: float
    damping_ratio: float

    def start(self, count: int) -> Modes | None:
        """One mode or two, to first order in their distance from the pole; None where there is no answer."""
        s, pole = 1j * self.omega, poles(np.array([self.frequency_hz]), np.array([self.damping_ratio]))[0]
        near = s**self.power / (s - pole)
        design = np.stack([near, near / (s - pole), np.ones_like(s)], axis=1)
        first, second = np.empty((2, *self.place.shape), dtype=complex)
        for j, root in enumerate(np.sqrt(self.weight)):
            solved = np.linalg.lstsq(design * root[:, None], (self.values[:, j] * root).T, rcond=None)[0]
            first[:, j], second[:, j] = solved[0], solved[1]
        left, size, right = np.linalg.svd(first, full_matrices=False)
        left, size, right = left[:, :count], size[:count], right[:count]
        shift, vectors = np.linalg.eig(left.conj().T @ second @ right.conj().T / size)
        try:
            seen = np.linalg.solve(vectors, size[:, None] * right)
        except np.linalg.LinAlgError:
            return None
        at = pole + np.where(np.abs(shift) < -pole.real, shift, -pole.real * shift / np.abs(shift))
        zeta = np.clip(-at.real / np.abs(at), 0.2 * self.damping_ratio, 5 * self.damping_ratio)
        seen = seen / seen[np.arange(count), np.argmax(np.abs(seen), axis=1)][:, None]
        return self.fitted(np.abs(at) / (2 * np.pi), zeta, seen)

    def fitted(self, frequency_hz: FloatArray, damping_ratio: FloatArray, seen: ComplexArray) -> Modes:
        """Least squares from a start."""
        largest = np.argmax(np.abs(seen), axis=1)
        free = np.ones(seen.shape, dtype=bool)
        free[np.arange(len(seen)), largest] = False
        start = np.concatenate([np.log(frequency_hz), damping_ratio, seen[free].real, seen[free].imag])
        scale = np.concatenate([np.full(2 * len(seen), self.damping_ratio), np.ones(2 * int(free.sum()))])
        target = self._target()

        def apart(theta: FloatArray) -> FloatArray:
            frame = np.linalg.qr(self._design(*_unpacked(theta, seen, free)))[0]
            return np.asarray(target - frame @ (frame.T @ target)).ravel()

        found = scipy.optimize.least_squares(apart, start, x_scale=scale, max_nfev=_EVALUATIONS)
        f, zeta, view = _unpacked(found.x, seen, free)
        unknowns = found.x.size + target.shape[1] * (2 * len(seen) + 2 * seen.shape[1])
        return Modes(
            f,
            zeta,
            view,
            chi_squared=float(2 * found.cost),
            freedom=max(target.size - unknowns, 1),
            jacobian=found.jac.reshape(*target.shape, -1),
            residual=found.fun.reshape(target.shape),
        )

    def residues(
        self, frequency_hz: FloatArray, damping_ratio: FloatArray, seen: ComplexArray
    ) -> tuple[ComplexArray, FloatArray]:
        """(N, q) residues ψ_q l_q of all FRFs for given poles and views, and their variance under the weights."""
        design = self._design(frequency_hz, damping_ratio, seen)
        frame, triangle = np.linalg.qr(design)
        count = len(seen)
        inverse = np.linalg.inv(triangle)
        c = (inverse @ (frame.T @ self._target()))[: 2 * count]
        own = np.sum(inverse[: 2 * count] ** 2, axis=1)
        shape = c[0::2] + 1j * c[1::2]  # (q, p)
        rows = int(self.place.max()) + 1
        values, spread = np.zeros((rows, count), dtype=complex), np.zeros((rows, count))
        for q in range(count):
            values[self.place, q] = shape[q][:, None] * seen[q]
            spread[self.place, q] = (own[2 * q] + own[2 * q + 1]) * np.abs(seen[q]) ** 2
        return values, spread

    def covariance(self, modes: Modes, memory: float) -> FloatArray:
        """Of θ; each standard deviation at least what the scatter between the roving dofs shows."""
        jacobian = modes.jacobian.reshape(-1, modes.jacobian.shape[2])
        inverse = np.linalg.pinv(jacobian.T @ jacobian, hermitian=True)
        pull = np.einsum("rpn,rp->pn", modes.jacobian, modes.residual)
        return widened(inverse, max(1.0, modes.chi_squared / modes.freedom) * memory, pull, np.arange(len(pull)))

    def _target(self) -> FloatArray:
        """(2 m L, p) weighted FRFs, real above imaginary parts."""
        weighted = (self.values * np.sqrt(self.weight)).reshape(len(self.values), -1)
        return np.concatenate([weighted.real, weighted.imag], axis=1).T

    def _design(self, frequency_hz: FloatArray, damping_ratio: FloatArray, seen: ComplexArray) -> FloatArray:
        """(2 m L, 2 q + 2 m) columns of Re ψ_q, Im ψ_q, and of the constants."""
        s, m = 1j * self.omega, len(self.weight)
        at = poles(frequency_hz, damping_ratio)[:, None, None]
        lift = s**self.power
        direct, mirror = lift * seen[:, :, None] / (s - at), lift * seen.conj()[:, :, None] / (s - at.conj())
        both = np.stack([direct + mirror, 1j * (direct - mirror)], axis=1).reshape(2 * len(seen), m, s.size)
        level = np.mean(np.abs(both))
        constant = np.zeros((2 * m, m, s.size), dtype=complex)
        constant[np.arange(m), np.arange(m)], constant[m + np.arange(m), np.arange(m)] = level, 1j * level
        columns = (np.concatenate([both, constant]) * np.sqrt(self.weight)).reshape(2 * len(seen) + 2 * m, -1)
        return np.concatenate([columns.real, columns.imag], axis=1).T


def band_about(
    arrangement: Arrangement, values: ComplexArray, variance: FloatArray, pole: tuple[float, float]
) -> Band | None:
    """The band about a pole (Hz, ratio), where all FRFs were measured; None where it has too few lines.

    Args:
        arrangement: which FRF lies between which dofs; all pairs of roving and fixed dofs.
        values: (N, L) the FRFs without what other poles make of them.
        variance: (N, L) of their errors.
        pole: its frequency and damping ratio.
    """
    f, zeta = pole
    place = np.empty((len(arrangement.roving), len(arrangement.fixed)), dtype=np.int64)
    place[arrangement.row[:, 0], arrangement.row[:, 1]] = np.arange(len(arrangement.pairs))
    reach = max(_REACH * zeta * f, _LEAST_REACH * arrangement.spacing_hz)
    use = (np.abs(arrangement.frequency_hz - f) <= reach) & arrangement.measured.all(axis=0)
    if use.sum() < _FEWEST_LINES:
        return None
    own = values[:, use][place]
    weight = 2 / variance[:, use][place].mean(axis=0)
    return Band(
        omega=arrangement.omega[use],
        power=arrangement.power,
        values=own,
        weight=weight,
        place=place,
        frequency_hz=f,
        damping_ratio=zeta,
    )


def _unpacked(theta: FloatArray, seen: ComplexArray, free: np.ndarray) -> tuple[FloatArray, FloatArray, ComplexArray]:
    """Frequencies, damping ratios (kept physical) and views of θ."""
    q, n = len(seen), int(free.sum())
    view = np.ones(seen.shape, dtype=complex)
    view[free] = theta[2 * q : 2 * q + n] + 1j * theta[2 * q + n :]
    return np.exp(theta[:q]), np.clip(theta[q : 2 * q], *DAMPING_RANGE), view
