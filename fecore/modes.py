"""Measured modes: natural frequencies, damping ratios and shapes with their uncertainty, however
they were found.
"""

from dataclasses import dataclass

import numpy as np

from fecore.arrays import ComplexArray, FloatArray
from fecore.errors import InputError
from fecore.frf import Dof


@dataclass(frozen=True)
class MeasuredModes:
    """Modes of a structure as an experiment gave them, in ascending frequency."""

    frequency_hz: FloatArray  # (n,) undamped natural frequencies ω_k/2π, Hz
    damping_ratio: FloatArray  # (n,) viscous damping ratios ζ_k; NaN where not known
    # (n, p) complex shapes at `dofs`, or None where only frequencies are known
    shapes: ComplexArray | None = None
    # the p measurement degrees of freedom of the shapes (signed directions)
    dofs: tuple[Dof, ...] = ()
    # (2n, 2n) covariance of (f₁ … f_n in Hz, ζ₁ … ζ_n), or None where not known
    covariance: FloatArray | None = None
    # (n,) that each is a mode of the structure, or None where somebody says so
    probability: FloatArray | None = None
    highest_hz: float = np.inf  # up to where modes were looked for: the last line of the FRFs, Hz

    def __post_init__(self) -> None:
        n = self.frequency_hz.size
        if n == 0:
            raise InputError("modes", "is empty, expected at least one mode")
        if not np.all(np.isfinite(self.frequency_hz)) or np.any(self.frequency_hz <= 0):
            raise InputError("frequency_hz", "must be positive and finite")
        if np.any(np.diff(self.frequency_hz) < 0):
            raise InputError("frequency_hz", "must ascend")
        if self.damping_ratio.shape != (n,):
            raise InputError(
                "damping_ratio", f"has shape {self.damping_ratio.shape}, expected ({n},)"
            )
        if np.any(self.damping_ratio < 0) or np.any(self.damping_ratio >= 1):
            raise InputError(
                "damping_ratio", "must be at least 0 and below 1 (a ratio, not per cent)"
            )
        if self.shapes is not None and self.shapes.shape != (n, len(self.dofs)):
            raise InputError(
                "shapes", f"has shape {self.shapes.shape}, expected ({n}, {len(self.dofs)})"
            )
        if self.covariance is not None and self.covariance.shape != (2 * n, 2 * n):
            raise InputError(
                "covariance", f"has shape {self.covariance.shape}, expected ({2 * n}, {2 * n})"
            )
        p = self.probability
        if p is not None and (p.shape != (n,) or not np.all((p >= 0) & (p <= 1))):
            raise InputError("probability", "must be a number from 0 to 1 for each mode")

    def __len__(self) -> int:
        return int(self.frequency_hz.size)

    @property
    def frequency_sd_hz(self) -> FloatArray | None:
        """(n,) standard deviation of the frequencies, Hz, or None where not known."""
        return None if self.covariance is None else np.sqrt(np.diag(self.covariance)[: len(self)])

    @property
    def damping_sd(self) -> FloatArray | None:
        """(n,) standard deviation of the damping ratios, or None where not known."""
        return None if self.covariance is None else np.sqrt(np.diag(self.covariance)[len(self) :])
