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

_IN_CACHE = 30_000  # entries of a block of lines whose temporaries stay in the processor's cache


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
    s, n = 1j * omega, 2 * terms.pairs
    lift, pole = (s**power)[:, None], poles(terms.frequency_hz, terms.damping_ratio)
    basis = np.empty((omega.size, terms.columns), dtype=complex)
    step = max(1, _IN_CACHE // max(terms.pairs, 1))
    for part in (slice(first, first + step) for first in range(0, omega.size, step)):
        direct, mirror = lift[part] / (s[part, None] - pole), lift[part] / (s[part, None] - pole.conj())
        np.add(direct, mirror, out=basis[part, 0:n:2])
        np.multiply(direct - mirror, 1j, out=basis[part, 1:n:2])
    scaled = s / np.sqrt(omega[0] * omega[-1])
    for place, e in enumerate(terms.exponents, n):
        basis[:, place] = lift[:, 0] * scaled**e
    if terms.decay.size:
        basis[:, n + len(terms.exponents) :] = lift / (s[:, None] * (s[:, None] + terms.decay))
    return basis


def pair_power(omega: FloatArray, terms: Terms, power: int) -> FloatArray:
    """(L, n) sum of the squared magnitudes of a pole pair's two columns: 2|s^p|² (|s - s_k|⁻² + |s - s̄_k|⁻²)."""
    pole = poles(terms.frequency_hz, terms.damping_ratio)
    near, far = (1 / ((omega[:, None] - side * pole.imag) ** 2 + pole.real**2) for side in (1, -1))
    return np.asarray(2 * omega[:, None] ** (2 * power) * (near + far))


def derivatives(omega: FloatArray, terms: Terms, power: int) -> ComplexArray:
    """(L, 2n + r) columns of which all derivatives of the model by its poles are made, see `slopes`.

    For each pole pair 1/(s - s_k)² + 1/(s - s̄_k)² and i times their difference; for each body -a/(s(s + a)²).
    """
    s, n = 1j * omega, 2 * terms.pairs
    lift, pole = (s**power)[:, None], poles(terms.frequency_hz, terms.damping_ratio)
    direct, mirror = (lift / (s[:, None] - each) ** 2 for each in (pole, pole.conj()))
    steep = np.empty((omega.size, n + terms.decay.size), dtype=complex)
    np.add(direct, mirror, out=steep[:, 0:n:2])
    np.multiply(direct - mirror, 1j, out=steep[:, 1:n:2])
    if terms.decay.size:
        steep[:, n:] = -lift * terms.decay / (s[:, None] * (s[:, None] + terms.decay) ** 2)
    return steep


def slopes(terms: Terms) -> tuple[ComplexArray, ComplexArray]:
    """(n,) ∂s_k/∂ln ω_k and ∂s_k/∂ζ_k.

    With R_k the residue, ∂H/∂θ = Re(R_k ∂s_k/∂θ) E₁ + Im(R_k ∂s_k/∂θ) E₂, E the two columns of the pair in `derivatives`.
    """
    zeta = np.asarray(terms.damping_ratio, dtype=float)
    by_zeta = 2 * np.pi * terms.frequency_hz * (-1 - 1j * zeta / np.sqrt(1 - zeta**2))
    return poles(terms.frequency_hz, zeta), np.asarray(by_zeta)
