"""Viscous damping laws on the undamped modes.

Every law gives the modal damping rate c_k = 2 ζ_k ω_k (1/s) of a mode from its undamped circular
frequency, so that φ_kᵀ C φ_k = c_k with mass-normalised shapes. Rigid-body modes (ω = 0) have a
rate but no ratio. Laws by mechanism (`mechanism_laws`) also see where a mode's strain energy sits;
the laws here do not look at it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from fecore.arrays import FloatArray
from fecore.errors import InputError
from fecore.least_squares import nearest


class DampingLaw(Protocol):
    """A damping rate that is linear in its coefficients: a function of frequency, and of strain
    energy where a law looks at it.

    `strain` are (n, q) shares of the modes' strain energy in q mechanisms
    (`fecore.body.mechanisms`).
    """

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

    @property
    def groups(self) -> tuple[tuple[str, tuple[int, ...]], ...]:
        """Groups of mechanisms that it damps, with their columns of the shares of strain energy;
        none of a law of frequency alone.
        """
        ...

    def basis(self, omega: FloatArray, strain: FloatArray | None = None, /) -> FloatArray:
        """(n, p) derivative of the rates at (n,) circular frequencies by the p coefficients."""
        ...

    def slope(self, omega: FloatArray, strain: FloatArray | None = None, /) -> FloatArray:
        """(n, p) derivative of `basis` by the circular frequency, ω > 0."""
        ...

    def by_strain(self, omega: FloatArray, coefficients: FloatArray, count: int, /) -> FloatArray:
        """(n, q) derivative of the rates by the q = `count` shares."""
        ...


class FrequencyLaw:
    """What the laws of frequency alone have in common: they look at no strain energy."""

    groups: ClassVar[tuple[tuple[str, tuple[int, ...]], ...]] = ()

    def by_strain(self, omega: FloatArray, _coefficients: FloatArray, count: int, /) -> FloatArray:
        """(n, q) zeros."""
        return np.zeros((omega.size, count))


@dataclass(frozen=True)
class CaugheySeries(FrequencyLaw):
    """C = M Σ_j a_j (M⁻¹K)^n_j (Caughey 1960; the paper's Eq. 2), so c(ω) = Σ_j a_j ω^(2 n_j)."""

    name: str  # name in recipes and results
    exponents: tuple[int, ...]  # the n_j; 0 is mass-proportional, 1 stiffness-proportional damping

    def __post_init__(self) -> None:
        if not self.exponents or len(set(self.exponents)) != len(self.exponents):
            raise InputError(
                "damping.exponents",
                f"are {self.exponents}, expected one or more different integers",
            )

    @property
    def coefficient_names(self) -> tuple[str, ...]:
        """a0 for exponent 0, a1 for 1, a-1 for -1 and so on."""
        return tuple(f"a{exponent}" for exponent in self.exponents)

    @property
    def coefficient_units(self) -> tuple[str, ...]:
        """1/s for a0, s for a1, s³ for a2 and so on."""
        return tuple({0: "1/s", 1: "s"}.get(n, f"s^{2 * n - 1}") for n in self.exponents)

    def basis(self, omega: FloatArray, _strain: FloatArray | None = None, /) -> FloatArray:
        """(n, p) powers ω^(2 n_j); a term with a negative exponent leaves rigid-body modes
        undamped.
        """
        powers = np.zeros((omega.size, len(self.exponents)))
        for j, exponent in enumerate(self.exponents):
            moving = omega > 0 if exponent < 0 else np.ones(omega.size, dtype=bool)
            powers[moving, j] = omega[moving] ** (2 * exponent)
        return powers

    def slope(self, omega: FloatArray, _strain: FloatArray | None = None, /) -> FloatArray:
        """(n, p) derivatives 2 n_j ω^(2 n_j - 1)."""
        columns = [2 * exponent * omega ** (2.0 * exponent - 1) for exponent in self.exponents]
        return np.column_stack(columns)


RAYLEIGH = CaugheySeries("rayleigh", (0, 1))
"""C = a0 M + a1 K (Eq. 1): ζ = ½ (a0/ω + a1 ω), ω in rad/s (Eq. 9 with its erratum)."""


@dataclass(frozen=True)
class ModalDamping(FrequencyLaw):
    """A damping ratio of its own for each of some modes; another frequency has the ratio of the
    nearest of them.

    So the ratio of a mode does not change as its frequency shifts a little.
    """

    knots: tuple[float, ...]  # (p,) ascending circular frequencies of the modes, rad/s

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

    def basis(self, omega: FloatArray, _strain: FloatArray | None = None, /) -> FloatArray:
        """(n, p) rates 2ω of the mode whose knot is nearest to ω on a logarithmic scale."""
        rates: FloatArray = 2 * omega[:, None] * self._nearest(omega)
        return rates

    def slope(self, omega: FloatArray, _strain: FloatArray | None = None, /) -> FloatArray:
        """(n, p) derivatives: 2 for the nearest mode."""
        return 2 * self._nearest(omega)

    def _nearest(self, omega: FloatArray) -> FloatArray:
        """(n, p) 1 where the knot is the nearest, else 0."""
        knots = np.array(self.knots)
        borders = np.sqrt(knots[1:] * knots[:-1])
        nearest: FloatArray = np.eye(knots.size)[np.searchsorted(borders, omega)]
        return nearest


# f(x) and f'(x), x = ω/ω_r, of functions of which generalised proportional damping may be made.
_FUNCTIONS: dict[
    str, tuple[Callable[[FloatArray], FloatArray], Callable[[FloatArray], FloatArray]]
] = {
    "constant": (np.ones_like, np.zeros_like),
    "root": (lambda x: x, np.ones_like),
    "stiffness": (lambda x: x**2, lambda x: 2 * x),
    "saturating": (lambda x: -np.expm1(-(x**2)), lambda x: 2 * x * np.exp(-(x**2))),
    "logarithm": (lambda x: np.log1p(x**2), lambda x: 2 * x / (1 + x**2)),
    "arctangent": (lambda x: np.arctan(x), lambda x: 1 / (1 + x**2)),
}


@dataclass(frozen=True)
class GeneralisedProportional(FrequencyLaw):
    """C = M β(M⁻¹K) with a smooth function β (Adhikari, J. Sound Vib. 293, 2006), so c(ω) = Σ_j g_j
    f_j(ω/ω_r).

    The functions are `constant` (1: mass-proportional), `root` (x: the same ratio g/2ω_r at every
    frequency), `stiffness` (x²), `saturating` (1 - exp(-x²)), `logarithm` (ln(1 + x²)) and
    `arctangent` (arctan x), x = ω/ω_r.
    """

    functions: tuple[str, ...]  # names of the f_j
    reference: float  # ω_r, rad/s, at which the functions turn; it scales the coefficients
    name: str = "generalised"  # name in recipes and results

    def __post_init__(self) -> None:
        unknown = [function for function in self.functions if function not in _FUNCTIONS]
        if unknown or not self.functions or len(set(self.functions)) != len(self.functions):
            raise InputError(
                "damping.functions",
                f"are {self.functions}, expected one or more different of {', '.join(_FUNCTIONS)}",
            )
        if not (np.isfinite(self.reference) and self.reference > 0):
            raise InputError(
                "damping.reference", f"is {self.reference}, expected a positive circular frequency"
            )

    @property
    def coefficient_names(self) -> tuple[str, ...]:
        """g_constant and so on."""
        return tuple(f"g_{function}" for function in self.functions)

    @property
    def coefficient_units(self) -> tuple[str, ...]:
        """All in 1/s: a coefficient is a rate."""
        return ("1/s",) * len(self.functions)

    def basis(self, omega: FloatArray, _strain: FloatArray | None = None, /) -> FloatArray:
        """(n, p) values f_j(ω/ω_r)."""
        x = np.asarray(omega, dtype=float) / self.reference
        return np.column_stack([_FUNCTIONS[function][0](x) for function in self.functions])

    def slope(self, omega: FloatArray, _strain: FloatArray | None = None, /) -> FloatArray:
        """(n, p) derivatives f_j'(ω/ω_r)/ω_r."""
        x = np.asarray(omega, dtype=float) / self.reference
        return (
            np.column_stack([_FUNCTIONS[function][1](x) for function in self.functions])
            / self.reference
        )


def damping_rate(
    law: DampingLaw, coefficients: FloatArray, omega: FloatArray, strain: FloatArray | None = None
) -> FloatArray:
    """(n,) modal damping rates c = 2 ζ ω of a law, 1/s."""
    rate: FloatArray = law.basis(omega, strain) @ coefficients
    return rate


def beyond(
    law: DampingLaw, coefficients: FloatArray, omega: float, strain: FloatArray | None = None
) -> tuple[float, float]:
    """(p, q) of the tangent p + qλ to a law's rate at λ = ω², for the modes above ω that a
    synthesis leaves out.

    It is exact for Rayleigh damping: (a0, a1). Where the law falls the rate stays as it is, as a
    falling tangent would soon feed energy in. A law by mechanism takes the mean of the shares of
    the modes that the synthesis has.
    """
    at, mean = np.array([omega]), None
    if strain is not None:
        moving = strain[strain.any(axis=1)]
        mean = (moving if len(moving) else strain).mean(axis=0, keepdims=True)
    q = max(float((law.slope(at, mean) @ coefficients)[0]) / (2 * omega), 0.0)
    return float(damping_rate(law, coefficients, at, mean)[0]) - q * omega**2, q


def damping_ratio(
    law: DampingLaw, coefficients: FloatArray, omega: FloatArray, strain: FloatArray | None = None
) -> FloatArray:
    """(n,) damping ratios ζ = c / 2ω of a law at positive circular frequencies.

    Raises:
        InputError: a frequency is not positive; a rigid-body mode has no damping ratio.
    """
    if np.any(omega <= 0):
        raise InputError(
            "omega", "a damping ratio needs positive frequencies; rigid-body modes have only a rate"
        )
    return damping_rate(law, coefficients, omega, strain) / (2 * omega)


def negative_band(
    law: DampingLaw,
    coefficients: FloatArray,
    low: float,
    high: float,
    strain: FloatArray | None = None,
) -> tuple[float, float] | None:
    """First and last circular frequency of a band at which a law would feed energy in, or None
    where it never does.

    Args:
        law: the law.
        coefficients: (p,) its coefficients.
        low: circular frequency of the band's lower end, rad/s.
        high: of its upper end.
        strain: (m, q) shares of strain energy of the modes that may lie there; None for a law of
            frequency alone.
    """
    omega = np.linspace(low, high, 2001)
    kinds = [None] if strain is None else [np.tile(row, (omega.size, 1)) for row in strain]
    rate = np.min([damping_rate(law, coefficients, omega, each) for each in kinds], axis=0)
    negative = omega[rate < -1e-12 * np.abs(rate).max()]
    return (float(negative[0]), float(negative[-1])) if negative.size else None


def fit_ratios(
    law: DampingLaw, omega: FloatArray, ratio: FloatArray, strain: FloatArray | None = None
) -> FloatArray:
    """Coefficients whose law comes nearest to given damping ratios, by relative least squares.

    With as many modes as coefficients this is Eq. 9 solved exactly, ω in rad/s.

    Raises:
        InputError: there are fewer modes than coefficients, or a ratio is not positive.
    """
    if omega.size < len(law.coefficient_names):
        raise InputError(
            "damping_ratio", f"{omega.size} modes cannot fix the {law.name} law's coefficients"
        )
    if np.any(ratio <= 0):
        raise InputError("damping_ratio", "must be positive")
    return nearest(law.basis(omega, strain) / (2 * omega * ratio)[:, None], np.ones(omega.size))
