"""Synthesis of FRFs from modes: modal superposition with the truncated modes' series, also under a
sensor that moves.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
import scipy

from fecore.arrays import ComplexArray, FloatArray, real_times
from fecore.dynamics.eigen import NormalModes
from fecore.frf import Quantity, convert

Matrix: TypeAlias = "scipy.sparse.csc_array | FloatArray"

RESIDUAL_TERMS = 3
"""Terms of the truncated modes' series that models hand over: the error falls as (ω²/λ)³ of the
first mode left out.
"""


def residual_series(modes: NormalModes, mass: Matrix, loads: FloatArray, terms: int) -> FloatArray:
    """y_t = P (F⁻¹M)ᵗ F⁻¹ b for t = 0 … terms-1, F = K - σM, P = I - ΦΦᵀM: the receptance in powers
    of ω² - σ, modes left out.

    The modes are taken out of the load and of every term: what they have there is larger by ((λ -
    σ)/(λ₁ - σ))ᵗ⁺¹, λ that of the first mode left out, so that of a difference at the end nothing
    but round-off is left where a body is free.

    Args:
        modes: Φ, which are left out; they carry F's factorisation and σ.
        mass: M.
        loads: (dofs, l) forces b.
        terms: how many.

    Returns:
        (terms, dofs, l).
    """
    images = mass @ modes.shapes
    force = loads - images @ (modes.shapes.T @ loads)
    series = np.empty((terms, *loads.shape))
    for t in range(terms):
        moved = modes.factor.solve(force)
        series[t] = moved - modes.shapes @ (images.T @ moved)
        force = mass @ series[t]
    return series


def residual_powers(
    omega: FloatArray, shift: float, terms: int, beyond: tuple[float, float]
) -> ComplexArray:
    """(t, L) factors of the residual terms R_t where the truncated modes are damped at the rates p
    + qλ.

    λ - ω² + iω(p + qλ) = s (λ - σ) - z with s = 1 + iωq, z = ω² - iωp - sσ, so the factors are
    zᵗ/sᵗ⁺¹.
    """
    p, q = beyond
    s = 1 + 1j * omega * q
    z = omega**2 - 1j * omega * p - s * shift
    powers: ComplexArray = np.vander(z / s, terms, increasing=True).T / s
    return powers


@dataclass(frozen=True)
class RovingMass:
    """A sensor that moves with the response, so that every FRF belongs to a slightly different
    structure.

    A mass m at the response point adds the force ω² m x there, so with the driving-point receptance
    G of that point

        H' = H / (1 - ω² m G)                                          (Sherman and Morrison 1950, rank one)
    """

    mass: float  # m, kg
    # (N, n) of G, one driving point an FRF; residual: (N, t) its residual terms
    residues: FloatArray
    residual: FloatArray

    def drive(self, model: ModalFrfModel) -> ModalFrfModel:
        """G of each FRF's response point, on the eigenvalues of the model that it loads."""
        return ModalFrfModel(model.eigenvalue, self.residues, self.residual, model.shift)


@dataclass(frozen=True)
class ModalFrfModel:
    """What the FRFs between measured degrees of freedom need from a model: Eq. 8 (with its erratum)
    and a residual.

    With residues A_ik = φ_k(response i) φ_k(force i) the receptance is

        H_i(ω) = Σ_k A_ik / (λ_k - ω² + iω c_k) + Σ_t R_it (ω² - σ)ᵗ,

    where c_k = 2 ζ_k ω_k and the R_t are the exact first terms of the series of the truncated modes
    in (ω² - σ)/(λ - σ): the static one, and those that bend it towards the next resonance.
    """

    eigenvalue: FloatArray  # (n,) λ_k = ω_k², rad²/s²
    residues: FloatArray  # (N, n) A_ik, signs of the directions included
    residual: FloatArray  # (N, t) R_0, R_1 …
    shift: float  # σ, rad²/s²
    roving: RovingMass | None = None  # a sensor that loads each FRF at a place of its own, or None
    # (n, q) shares of strain energy by mechanism, for damping laws that look at them; None where
    # not known
    strain: FloatArray | None = None

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

        `beyond` damps the truncated modes too, at the rate p + qλ (`damping_laws.beyond`): without
        it the residual is real, which under stiffness-proportional damping misses 10⁻³ of the peak.
        """
        omega = 2 * np.pi * frequency_hz
        denominator = self.eigenvalue[:, None] - omega**2 + 1j * omega * rate[:, None]
        power = residual_powers(omega, self.shift, self.residual.shape[1], beyond)
        flexibility = 1 / denominator
        receptance = real_times(self.residues, flexibility) + real_times(self.residual, power)
        if self.roving is not None:
            drive = real_times(self.roving.residues, flexibility) + real_times(
                self.roving.residual, power
            )
            receptance = receptance / (1 - omega**2 * self.roving.mass * drive)
        converted: ComplexArray = receptance * convert(omega, quantity)
        return converted

    def load_factors(
        self, frequency_hz: FloatArray, rate: FloatArray, quantity: Quantity
    ) -> tuple[ComplexArray, ComplexArray] | None:
        """(N, L) factors g, h of ∂H' = g ∂H + h ∂H_d, H and H_d the FRFs without the roving mass;
        None where none roves.

        By the rank-one formula of `RovingMass`, g = 1/(1 - ω² m G) and h = g ω² m H'/f with f of
        `convert`.
        """
        if self.roving is None:
            return None
        omega = 2 * np.pi * frequency_hz
        drive = self.roving.drive(self).synthesise(frequency_hz, rate, "receptance")
        factor = 1 / (1 - omega**2 * self.roving.mass * drive)
        loaded = self.synthesise(frequency_hz, rate, quantity)
        return factor, factor * omega**2 * self.roving.mass * loaded / convert(omega, quantity)

    def with_eigenvalue(self, eigenvalue: FloatArray) -> ModalFrfModel:
        """The same residues on other eigenvalues."""
        return replace(self, eigenvalue=eigenvalue)
