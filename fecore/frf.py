"""Frequency response functions: what they are measured between, and sets of them.

A frequency response function (FRF) is the ratio of a response at one degree of freedom to a force at another,
H(ω) = X(ω)/F(ω). Where X is an acceleration it is an accelerance, a velocity a mobility, a displacement a receptance:
accelerance = iω·mobility = -ω²·receptance.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from fecore.arrays import BoolArray, ComplexArray, FloatArray
from fecore.errors import InputError

Quantity = Literal["accelerance", "mobility", "receptance"]

_POWER_OF_I_OMEGA: dict[Quantity, int] = {"receptance": 0, "mobility": 1, "accelerance": 2}


RESIDUAL_TERMS = 3
"""Terms of the truncated modes' series that models hand over: the error falls as (ω²/λ)³ of the first mode left out."""


def convert(omega: FloatArray, quantity: Quantity) -> ComplexArray:
    """(L,) factor from receptance to another quantity: (iω)⁰, (iω)¹ or (iω)²."""
    factor: ComplexArray = (1j * omega) ** _POWER_OF_I_OMEGA[quantity]
    return factor


def residual_powers(omega: FloatArray, shift: float, terms: int, beyond: tuple[float, float]) -> ComplexArray:
    """(t, L) factors of the residual terms R_t where the truncated modes are damped at the rates p + qλ.

    λ - ω² + iω(p + qλ) = s (λ - σ) - z with s = 1 + iωq, z = ω² - iωp - sσ, so the factors are zᵗ/sᵗ⁺¹.
    """
    p, q = beyond
    s = 1 + 1j * omega * q
    z = omega**2 - 1j * omega * p - s * shift
    powers: ComplexArray = np.vander(z / s, terms, increasing=True).T / s
    return powers


@dataclass(frozen=True, order=True)
class Dof:
    """A measurement point and a signed direction there.

    Attributes:
        point: label of the grid point.
        direction: 1, 2, 3 for +x, +y, +z, 4, 5, 6 for rotations about them; negative for the opposite sense.
    """

    point: int
    direction: int

    def __post_init__(self) -> None:
        if not 1 <= abs(self.direction) <= 6:
            raise InputError("direction", f"is {self.direction}, expected ±1 … ±6")

    @property
    def axis(self) -> int:
        """Direction without its sign, 1 to 6."""
        return abs(self.direction)

    @property
    def sign(self) -> int:
        """+1 or -1."""
        return 1 if self.direction > 0 else -1


@dataclass(frozen=True)
class FrfSet:
    """FRFs on one frequency axis.

    Attributes:
        frequency_hz: (L,) increasing frequency lines, Hz.
        values: (N, L) complex FRFs, SI (m/s² per N, m/s per N or m per N).
        responses: N response degrees of freedom.
        references: N force degrees of freedom.
        quantity: what kind of FRF all of them are.
        variance: (N, L) variance of the complex noise E|n|² of each value, NaN or None where it is not known, infinite
            where nothing was measured.
    """

    frequency_hz: FloatArray
    values: ComplexArray
    responses: tuple[Dof, ...]
    references: tuple[Dof, ...]
    quantity: Quantity = "accelerance"
    variance: FloatArray | None = None

    def __post_init__(self) -> None:
        lines, count = self.frequency_hz.size, len(self.responses)
        if self.frequency_hz.ndim != 1 or lines == 0:
            raise InputError("frequency_hz", f"has shape {self.frequency_hz.shape}, expected one axis of lines")
        if np.any(np.diff(self.frequency_hz) <= 0) or self.frequency_hz[0] < 0:
            raise InputError("frequency_hz", "must be non-negative and strictly increasing")
        if self.values.shape != (count, lines):
            raise InputError("values", f"has shape {self.values.shape}, expected ({count}, {lines})")
        if len(self.references) != count:
            raise InputError("references", f"has {len(self.references)} entries, expected {count}")
        if self.quantity not in get_args(Quantity):
            raise InputError("quantity", f"is {self.quantity!r}, expected one of {', '.join(get_args(Quantity))}")
        if not np.all(np.isfinite(self.values)):
            raise InputError("values", "holds NaN or infinite ordinates")
        if self.variance is not None and self.variance.shape != self.values.shape:
            raise InputError("variance", f"has shape {self.variance.shape}, expected {self.values.shape}")

    @property
    def omega(self) -> FloatArray:
        """(L,) circular frequency of the lines, rad/s."""
        return 2 * np.pi * self.frequency_hz

    @property
    def measured(self) -> BoolArray:
        """(N, L) where a value was measured."""
        if self.variance is None:
            return np.ones(self.values.shape, dtype=bool)
        return ~np.isposinf(self.variance)

    def unmeasured_at(self, gaps: BoolArray) -> FrfSet:
        """The same FRFs with (N, L) more values taken as not measured."""
        if not gaps.any():
            return self
        variance = np.full(self.values.shape, np.nan) if self.variance is None else self.variance
        return replace(self, variance=np.where(gaps, np.inf, variance))

    def without(self, low_hz: float, high_hz: float) -> FrfSet:
        """The same FRFs but for the lines from `low_hz` to `high_hz`.

        Raises:
            InputError: no line is left.
        """
        keep = (self.frequency_hz < low_hz) | (self.frequency_hz > high_hz)
        if not keep.any():
            raise InputError("band_hz", f"{low_hz:g} to {high_hz:g} Hz are all the lines there are")
        return self._lines(keep)

    def band(self, low_hz: float, high_hz: float) -> FrfSet:
        """The same FRFs on the lines from `low_hz` to `high_hz`, both included.

        Raises:
            InputError: the band holds no line.
        """
        keep = (self.frequency_hz >= low_hz) & (self.frequency_hz <= high_hz)
        if not keep.any():
            raise InputError("band_hz", f"no frequency line lies in {low_hz:g} to {high_hz:g} Hz")
        return self._lines(keep)

    def _lines(self, keep: BoolArray) -> FrfSet:
        return replace(
            self,
            frequency_hz=self.frequency_hz[keep],
            values=self.values[:, keep],
            variance=None if self.variance is None else self.variance[:, keep],
        )

    def select(self, rows: list[int]) -> FrfSet:
        """The FRFs of the given rows, in that order."""
        return replace(
            self,
            values=self.values[rows],
            responses=tuple(self.responses[i] for i in rows),
            references=tuple(self.references[i] for i in rows),
            variance=None if self.variance is None else self.variance[rows],
        )

    def to_quantity(self, quantity: Quantity) -> FrfSet:
        """The same FRFs as another quantity, multiplied by the right power of iω.

        Raises:
            InputError: the set has a line at 0 Hz and the conversion would divide by it.
        """
        power = _POWER_OF_I_OMEGA[quantity] - _POWER_OF_I_OMEGA[self.quantity]
        if power < 0 and self.frequency_hz[0] == 0:
            raise InputError("frequency_hz", f"a line at 0 Hz has no {quantity}; leave it out")
        factor = (1j * self.omega) ** power
        variance = None if self.variance is None else self.variance * np.abs(factor) ** 2
        return replace(self, values=self.values * factor, quantity=quantity, variance=variance)


@dataclass(frozen=True)
class RovingMass:
    """A sensor that moves with the response, so that every FRF belongs to a slightly different structure.

    A mass m at the response point adds the force ω² m x there, so with the driving-point receptance G of that point

        H' = H / (1 - ω² m G)                                          (Sherman and Morrison 1950, rank one)

    Attributes:
        mass: m, kg.
        residues: (N, n) of G, one driving point an FRF; residual: (N, t) its residual terms.
    """

    mass: float
    residues: FloatArray
    residual: FloatArray

    def drive(self, model: ModalFrfModel) -> ModalFrfModel:
        """G of each FRF's response point, on the eigenvalues of the model that it loads."""
        return ModalFrfModel(model.eigenvalue, self.residues, self.residual, model.shift)


@dataclass(frozen=True)
class ModalFrfModel:
    """What the FRFs between measured degrees of freedom need from a model: Eq. 8 (with its erratum) and a residual.

    With residues A_ik = φ_k(response i) φ_k(force i) the receptance is

        H_i(ω) = Σ_k A_ik / (λ_k - ω² + iω c_k) + Σ_t R_it (ω² - σ)ᵗ,

    where c_k = 2 ζ_k ω_k and the R_t are the exact first terms of the series of the truncated modes in
    (ω² - σ)/(λ - σ): the static one, and those that bend it towards the next resonance.

    Attributes:
        eigenvalue: (n,) λ_k = ω_k², rad²/s².
        residues: (N, n) A_ik, signs of the directions included.
        residual: (N, t) R_0, R_1 …
        shift: σ, rad²/s².
        roving: a sensor that loads each FRF at a place of its own, or None.
    """

    eigenvalue: FloatArray
    residues: FloatArray
    residual: FloatArray
    shift: float
    roving: RovingMass | None = None

    @property
    def omega(self) -> FloatArray:
        """(n,) undamped circular frequencies, rad/s."""
        return np.sqrt(self.eigenvalue)

    def synthesise(
        self,
        frequency_hz: FloatArray,
        rate: FloatArray,
        quantity: Quantity = "accelerance",
        beyond: tuple[float, float] = (0.0, 0.0),
    ) -> ComplexArray:
        """(N, L) FRFs at (L,) frequencies in Hz with (n,) modal damping rates c_k in 1/s.

        `beyond` damps the truncated modes too, at the rate p + qλ (`fecore.damping.beyond`): without it the residual is
        real, which under stiffness-proportional damping misses 10⁻³ of the peak.
        """
        omega = 2 * np.pi * frequency_hz
        denominator = self.eigenvalue[:, None] - omega**2 + 1j * omega * rate[:, None]
        power = residual_powers(omega, self.shift, self.residual.shape[1], beyond)
        receptance = self.residues @ (1 / denominator) + self.residual @ power
        if self.roving is not None:
            drive = self.roving.residues @ (1 / denominator) + self.roving.residual @ power
            receptance = receptance / (1 - omega**2 * self.roving.mass * drive)
        converted: ComplexArray = receptance * convert(omega, quantity)
        return converted

    def load_factors(
        self, frequency_hz: FloatArray, rate: FloatArray, quantity: Quantity, beyond: tuple[float, float] = (0.0, 0.0)
    ) -> tuple[ComplexArray, ComplexArray] | None:
        """(N, L) factors g, h of ∂H' = g ∂H + h ∂H_d, H and H_d the FRFs without the roving mass; None where none roves.

        By the rank-one formula of `RovingMass`, g = 1/(1 - ω² m G) and h = g ω² m H'/f with f of `convert`.
        """
        if self.roving is None:
            return None
        omega = 2 * np.pi * frequency_hz
        drive = self.roving.drive(self).synthesise(frequency_hz, rate, "receptance", beyond)
        factor = 1 / (1 - omega**2 * self.roving.mass * drive)
        loaded = self.synthesise(frequency_hz, rate, quantity, beyond)
        return factor, factor * omega**2 * self.roving.mass * loaded / convert(omega, quantity)

    def blocks(
        self,
        frequency_hz: FloatArray,
        rate: FloatArray,
        quantity: Quantity = "accelerance",
        beyond: tuple[float, float] = (0.0, 0.0),
        values: int = 2**22,
    ) -> Iterator[tuple[slice, ComplexArray]]:
        """The same FRFs as `synthesise`, some lines at a time, each block of at most about so many values.

        Yields:
            The slice of the lines, and (N, lines) FRFs there.
        """
        step = max(1, values // max(len(self.residues), self.eigenvalue.size))
        for first in range(0, frequency_hz.size, step):
            lines = slice(first, min(first + step, frequency_hz.size))
            yield lines, self.synthesise(frequency_hz[lines], rate, quantity, beyond)

    def with_eigenvalue(self, eigenvalue: FloatArray) -> ModalFrfModel:
        """The same residues on other eigenvalues."""
        return replace(self, eigenvalue=eigenvalue)
