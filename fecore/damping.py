"""Viscous damping laws on the undamped modes.

Every law gives the modal damping rate c_k = 2 ζ_k ω_k (1/s) of a mode from its undamped circular frequency, so that
φ_kᵀ C φ_k = c_k with mass-normalised shapes. Rigid-body modes (ω = 0) have a rate but no ratio.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fecore.arrays import FloatArray
from fecore.errors import InputError


class DampingLaw(Protocol):
    """A damping rate that is a function of frequency and linear in its coefficients."""

    @property
    def name(self) -> str:
        """Name in recipes and results."""
        ...

    @property
    def coefficient_names(self) -> tuple[str, ...]:
        """Names of the coefficients, in order."""
        ...

    @property
    def coefficient_units(self) -> tuple[str, ...]:
        """SI units of the coefficients."""
        ...

    def basis(self, omega: FloatArray) -> FloatArray:
        """(n, p) derivative of the rates at (n,) circular frequencies by the p coefficients."""
        ...


@dataclass(frozen=True)
class CaugheySeries:
    """C = M Σ_j a_j (M⁻¹K)^n_j (Caughey 1960; the paper's Eq. 2), so c(ω) = Σ_j a_j ω^(2 n_j).

    Attributes:
        name: name in recipes and results.
        exponents: the n_j; 0 is mass-proportional, 1 stiffness-proportional damping.
    """

    name: str
    exponents: tuple[int, ...]

    def __post_init__(self) -> None:
        if not self.exponents or len(set(self.exponents)) != len(self.exponents):
            raise InputError("damping.exponents", f"are {self.exponents}, expected one or more different integers")

    @property
    def coefficient_names(self) -> tuple[str, ...]:
        """a0 for exponent 0, a1 for 1, a-1 for -1 and so on."""
        return tuple(f"a{exponent}" for exponent in self.exponents)

    @property
    def coefficient_units(self) -> tuple[str, ...]:
        """1/s for a0, s for a1, s³ for a2 and so on."""
        return tuple({0: "1/s", 1: "s"}.get(n, f"s^{2 * n - 1}") for n in self.exponents)

    def basis(self, omega: FloatArray) -> FloatArray:
        """(n, p) powers ω^(2 n_j); a term with a negative exponent leaves rigid-body modes undamped."""
        powers = np.zeros((omega.size, len(self.exponents)))
        for j, exponent in enumerate(self.exponents):
            moving = omega > 0 if exponent < 0 else np.ones(omega.size, dtype=bool)
            powers[moving, j] = omega[moving] ** (2 * exponent)
        return powers


RAYLEIGH = CaugheySeries("rayleigh", (0, 1))
"""C = a0 M + a1 K (Eq. 1): ζ = ½ (a0/ω + a1 ω), ω in rad/s (Eq. 9 with its erratum)."""


@dataclass(frozen=True)
class ModalDamping:
    """A damping ratio of its own for each of some modes, linear in between and constant beyond.

    Attributes:
        knots: (p,) ascending circular frequencies of the modes, rad/s.
    """

    knots: tuple[float, ...]

    @property
    def name(self) -> str:
        """`modal`."""
        return "modal"

    @property
    def coefficient_names(self) -> tuple[str, ...]:
        """zeta1 … zetap."""
        return tuple(f"zeta{number}" for number in range(1, len(self.knots) + 1))

    @property
    def coefficient_units(self) -> tuple[str, ...]:
        """Ratios."""
        return ("1",) * len(self.knots)

    def basis(self, omega: FloatArray) -> FloatArray:
        """(n, p) rates 2ω of the modes whose knots lie next to ω."""
        hats = [np.interp(omega, self.knots, row) for row in np.eye(len(self.knots))]
        rates: FloatArray = 2 * omega[:, None] * np.column_stack(hats)
        return rates


def damping_rate(law: DampingLaw, coefficients: FloatArray, omega: FloatArray) -> FloatArray:
    """(n,) modal damping rates c = 2 ζ ω of a law, 1/s."""
    rate: FloatArray = law.basis(omega) @ coefficients
    return rate


def damping_ratio(law: DampingLaw, coefficients: FloatArray, omega: FloatArray) -> FloatArray:
    """(n,) damping ratios ζ = c / 2ω of a law at positive circular frequencies.

    Raises:
        InputError: a frequency is not positive; a rigid-body mode has no damping ratio.
    """
    if np.any(omega <= 0):
        raise InputError("omega", "a damping ratio needs positive frequencies; rigid-body modes have only a rate")
    return damping_rate(law, coefficients, omega) / (2 * omega)


def fit_ratios(law: DampingLaw, omega: FloatArray, ratio: FloatArray) -> FloatArray:
    """Coefficients whose law comes nearest to given damping ratios, by relative least squares.

    With as many modes as coefficients this is Eq. 9 solved exactly, ω in rad/s.

    Raises:
        InputError: there are fewer modes than coefficients, or a ratio is not positive.
    """
    if omega.size < len(law.coefficient_names):
        raise InputError("damping_ratio", f"{omega.size} modes cannot fix the {law.name} law's coefficients")
    if np.any(ratio <= 0):
        raise InputError("damping_ratio", "must be positive")
    rows = law.basis(omega) / (2 * omega * ratio)[:, None]
    scale = np.linalg.norm(rows, axis=0)
    solution: FloatArray = np.linalg.lstsq(rows / scale, np.ones(omega.size), rcond=None)[0] / scale
    return solution
