"""What a series of poles leaves of measured FRFs, beside the noise: the error of the model itself.

The residual of FRF i at line l is taken as r_il = n_il + e_il |H_il| + d_i ∂H_il/∂ln ω:

* n, noise without memory from line to line, of variance n²_il: stated (hits, coherence) or seen in how the record jumps;
* e, a relative error of the measuring chain (hits beside the point, cables, slight non-linearity), smooth over some lines, of
  standard deviation ε;
* d, a drift of the structure between the records (temperature, moved sensors), of standard deviation σ: where a resonance is
  narrow a small drift is a large error.

The variance is the sum of the three, v = n² + ε²|H|² + σ²|∂H/∂ln ω|². Since e and d last over several lines, a line is worth
less
than one: with the correlation ρ_j of the standardised residual j lines apart, n lines are worth n/τ, τ = 1 + 2 Σ_j ρ_j.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fecore.arrays import BoolArray, ComplexArray, FloatArray

RELATIVE = 0.02  # prior of the errors that grow with the FRF, over it: where a hit lands, calibrations
DRIFT = 3e-4  # prior of the relative drift of the frequencies during a test
_STILL = 0.05  # correlation below which the sum ends
_CAP = 3.0  # standard deviations
_LONGEST = 200  # lines


@dataclass(frozen=True)
class ErrorModel:
    """Noise variance n² (N, L), mean squares of the FRFs (N, L), and the two model errors ε and σ."""

    noise: FloatArray
    level: FloatArray
    relative: float = RELATIVE
    drift: float = DRIFT

    def variance(self, slope: FloatArray) -> FloatArray:
        """(N, L) v for the mean squares of ∂H/∂ln ω."""
        return np.asarray(self.noise + self.relative**2 * self.level + self.drift**2 * slope)


def memory(
    residual: ComplexArray, variance: FloatArray, measured: BoolArray, model: ComplexArray | None = None
) -> float:
    """τ, the number of lines that are worth one, from the correlation of the standardised residual; at least 1.

    With the `model` the error is taken relative to it, for a relative error turns with the phase of a resonance, and lines
    count
    by their signal to noise: what matters for a mode are the lines where it is seen.
    """
    z = np.where(measured, residual / np.sqrt(variance), 0)
    if model is not None:
        z = z / np.maximum(1.0, np.abs(z) / _CAP)  # one line of interference must not hide what the others share
        z = z * model.conj() / np.sqrt(variance)
    lines = z.shape[1]
    size = 1 << int(2 * lines - 1).bit_length()
    power = np.sum(np.abs(np.fft.fft(z, size, axis=1)) ** 2, axis=0)
    lagged = np.fft.ifft(power).real[: min(_LONGEST, lines // 4) + 1]
    if not lagged[0] > 0:
        return 1.0
    rho = lagged[1:] / lagged[0] / (1 - np.arange(1, lagged.size) / lines)
    ends = np.flatnonzero(rho < _STILL)
    return float(1 + 2 * np.sum(rho[: ends[0] if ends.size else rho.size]))
