"""The modal series that all steps fit: pole terms, residual terms and their derivatives.

A receptance is, with s = iω,

    α(s) = Σ_k R_k/(s - s_k) + R̄_k/(s - s̄_k)  +  Σ_e c_e s^e,

s_k = ω_k(-ζ_k + i√(1 - ζ_k²)). The last sum is the residual terms: s⁻³ to s⁻¹ stand for modes below
the band (rigid body motion and its damping), s⁰, s¹, s² for modes above it; their coefficients are
real because α is the transform of a real function. A mobility or accelerance is α times s or s².
Everything is linear in (Re R, Im R, c) for given poles.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fecore.arrays import BoolArray, ComplexArray, FloatArray, IntArray

DAMPING_RANGE = (1e-5, 0.95)
"""Of ζ: a pole beyond is no resonance."""

ONE, BESIDE = 0.5, 1.5
"""Summed half bandwidths within which two poles may be one mode, and within which one bends the
other.
"""


@dataclass(frozen=True)
class Terms:
    """What a model of the FRFs is made of."""

    frequency_hz: FloatArray  # (n,) undamped natural frequencies of the complex pole pairs, Hz
    damping_ratio: FloatArray  # (n,) their damping ratios
    exponents: tuple[int, ...] = (-2, 0)  # powers of s of the residual terms (of a receptance)

    @property
    def pairs(self) -> int:
        """Number of complex pole pairs."""
        return int(self.frequency_hz.size)

    @property
    def columns(self) -> int:
        """Number of real linear coefficients of each FRF."""
        return 2 * self.pairs + len(self.exponents)

    @property
    def half_bandwidth_hz(self) -> FloatArray:
        """(n,) ζf, Hz."""
        return self.frequency_hz * self.damping_ratio

    @property
    def poles(self) -> ComplexArray:
        """(n,) poles with positive imaginary part, rad/s: s = ω(-ζ + i√(1 - ζ²))."""
        zeta = self.damping_ratio
        return np.asarray(2 * np.pi * self.frequency_hz * (-zeta + 1j * np.sqrt(1 - zeta**2)))

    def some(self, which: IntArray | BoolArray) -> Terms:
        """The terms with some of the poles."""
        return replace(
            self,
            frequency_hz=self.frequency_hz[which],
            damping_ratio=self.damping_ratio[which],
        )

    @property
    def parameters(self) -> int:
        """Number of non-linear parameters: frequency and damping of each pair."""
        return 2 * self.pairs


def columns(
    omega: FloatArray, terms: Terms, power: int, reference: float | None = None
) -> ComplexArray:
    """(L, q) basis: for each pole pair the factors of Re R and Im R, then residual terms.

    Residual terms are taken in s/ω_ref to be of like size; `reference` is ω_ref, by default the
    geometric mean of the first and the last line.
    """
    s, n = 1j * omega, 2 * terms.pairs
    lift, pole = (s**power)[:, None], terms.poles
    basis = np.empty((omega.size, terms.columns), dtype=complex)
    # the temporaries of so many entries stay in the processor's cache
    step = max(1, 30_000 // max(terms.pairs, 1))
    for part in (slice(first, first + step) for first in range(0, omega.size, step)):
        direct, mirror = (
            lift[part] / (s[part, None] - pole),
            lift[part] / (s[part, None] - pole.conj()),
        )
        np.add(direct, mirror, out=basis[part, 0:n:2])
        np.multiply(direct - mirror, 1j, out=basis[part, 1:n:2])
    scaled = s / (reference or np.sqrt(omega[0] * omega[-1]))
    for place, e in enumerate(terms.exponents, n):
        basis[:, place] = lift[:, 0] * scaled**e
    return basis


def derivatives(omega: FloatArray, terms: Terms, power: int) -> ComplexArray:
    """(L, 2n) columns of which all derivatives of the model by its poles are made, see `slopes`.

    For each pole pair 1/(s - s_k)² + 1/(s - s̄_k)² and i times their difference.
    """
    s, n = 1j * omega, 2 * terms.pairs
    lift, pole = (s**power)[:, None], terms.poles
    direct, mirror = (lift / (s[:, None] - each) ** 2 for each in (pole, pole.conj()))
    steep = np.empty((omega.size, n), dtype=complex)
    np.add(direct, mirror, out=steep[:, 0:n:2])
    np.multiply(direct - mirror, 1j, out=steep[:, 1:n:2])
    return steep


def slopes(terms: Terms) -> tuple[ComplexArray, ComplexArray]:
    """(n,) ∂s_k/∂ln ω_k and ∂s_k/∂ζ_k.

    With R_k the residue, ∂H/∂θ = Re(R_k ∂s_k/∂θ) E₁ + Im(R_k ∂s_k/∂θ) E₂, E the two columns of the
    pair in `derivatives`.
    """
    zeta = terms.damping_ratio
    by_zeta = 2 * np.pi * terms.frequency_hz * (-1 - 1j * zeta / np.sqrt(1 - zeta**2))
    return terms.poles, np.asarray(by_zeta)
