"""The modal series that all steps fit: pole terms, residual terms and their derivatives.

A receptance is, with s = iω,

    α(s) = Σ_k R_k/(s - s_k) + R̄_k/(s - s̄_k)  +  Σ_e c_e s^e  +  Σ_j d_j/(s(s + a_j)),

s_k = ω_k(-ζ_k + i√(1 - ζ_k²)). The middle sum is the residual terms: s⁻² and s⁻¹ stand for modes below the band (rigid
body motion), s⁰, s¹, s² for modes above it; their coefficients are real because α is the transform of a real function.
The last sum holds floating bodies: mass m in a viscous medium has α = 1/(m s(s + a)), a = c/m, and so has the rigid
motion of a free body with mass-proportional damping. A mobility or accelerance is α times s or s². Everything is
linear in (Re R, Im R, c, d) for given poles.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from fecore.arrays import BoolArray, ComplexArray, FloatArray


@dataclass(frozen=True)
class Terms:
    """What a model of the FRFs is made of.

    Attributes:
        frequency_hz: (n,) undamped natural frequencies of the complex pole pairs, Hz.
        damping_ratio: (n,) their damping ratios.
        exponents: powers of s of the residual terms (of a receptance).
        decay: (r,) rates a of floating bodies, 1/s.
        held: (n,) True for pole pairs that keep their place: too vague in the data to be moved, as are those far
            outside the band.
    """

    frequency_hz: FloatArray
    damping_ratio: FloatArray
    exponents: tuple[int, ...] = (-2, 0)
    decay: FloatArray = field(default_factory=lambda: np.empty(0))
    held: BoolArray = field(default_factory=lambda: np.empty(0, dtype=bool))

    def __post_init__(self) -> None:
        if self.held.size != self.frequency_hz.size:  # poles are free unless it is said otherwise
            object.__setattr__(self, "held", np.zeros(self.frequency_hz.size, dtype=bool))

    @property
    def pairs(self) -> int:
        """Number of complex pole pairs."""
        return int(self.frequency_hz.size)

    @property
    def columns(self) -> int:
        """Number of real linear coefficients of each FRF."""
        return 2 * self.pairs + len(self.exponents) + int(self.decay.size)

    @property
    def parameters(self) -> int:
        """Number of non-linear parameters: frequency and damping of each pair, rate of each body."""
        return 2 * self.pairs + int(self.decay.size)


def poles(frequency_hz: FloatArray, damping_ratio: FloatArray) -> ComplexArray:
    """Poles with positive imaginary part, rad/s: s = 2πf(-ζ + i√(1 - ζ²))."""
    omega = 2 * np.pi * np.asarray(frequency_hz, dtype=float)
    zeta = np.asarray(damping_ratio, dtype=float)
    return np.asarray(omega * (-zeta + 1j * np.sqrt(1 - zeta**2)))


def columns(omega: FloatArray, terms: Terms, power: int) -> ComplexArray:
    """(L, q) basis: for each pole pair the factors of Re R and Im R, then residual terms, then bodies.

    Residual terms are taken in s/ω_ref (ω_ref = geometric mean of the first and the last line) to be of like size.
    """
    s = 1j * omega
    lift = s[:, None] ** power
    pole = poles(terms.frequency_hz, terms.damping_ratio)
    direct, mirror = 1 / (s[:, None] - pole), 1 / (s[:, None] - pole.conj())
    pairs = np.stack([direct + mirror, 1j * (direct - mirror)], axis=2).reshape(omega.size, -1)
    scaled = s / np.sqrt(omega[0] * omega[-1])
    residual = np.stack([scaled**e for e in terms.exponents], axis=1) if terms.exponents else np.empty((omega.size, 0))
    real = 1 / (s[:, None] * (s[:, None] + terms.decay))
    return np.asarray(lift * np.concatenate([pairs, residual, real], axis=1))


def derivatives(omega: FloatArray, terms: Terms, power: int) -> ComplexArray:
    """(L, 2n + r) columns of which all derivatives of the model by its poles are made, see `slopes`.

    For each pole pair 1/(s - s_k)² + 1/(s - s̄_k)² and i times their difference; for each body -a/(s(s + a)²).
    """
    s = 1j * omega
    lift = s[:, None] ** power
    pole = poles(terms.frequency_hz, terms.damping_ratio)
    direct, mirror = 1 / (s[:, None] - pole) ** 2, 1 / (s[:, None] - pole.conj()) ** 2
    pairs = np.stack([direct + mirror, 1j * (direct - mirror)], axis=2).reshape(omega.size, -1)
    real = -terms.decay / (s[:, None] * (s[:, None] + terms.decay) ** 2)
    return np.asarray(lift * np.concatenate([pairs, real], axis=1))


def slopes(terms: Terms) -> tuple[ComplexArray, ComplexArray]:
    """(n,) ∂s_k/∂ln ω_k and ∂s_k/∂ζ_k.

    With R_k the residue, ∂H/∂θ = Re(R_k ∂s_k/∂θ) E₁ + Im(R_k ∂s_k/∂θ) E₂, E the two columns of the pair in `derivatives`.
    """
    zeta = np.asarray(terms.damping_ratio, dtype=float)
    by_zeta = 2 * np.pi * terms.frequency_hz * (-1 - 1j * zeta / np.sqrt(1 - zeta**2))
    return poles(terms.frequency_hz, zeta), np.asarray(by_zeta)
