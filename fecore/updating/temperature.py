"""Constants that change with temperature: how much, by what prior, and how much of it a campaign
sees.

    c(T) = c_ref (1 + k (T - T_ref)),     k the coefficient of c, 1/K, named `Ex.per_K`, `web.G12.per_K`

A matrix softens more than fibres: k is -0.2 ± 0.15 %/K of constants that the matrix rules (E2, Ey,
all G), -0.05 ± 0.05 %/K of those that fibres rule (E1, Ex) and of isotropic materials. A factor on
a stiffness may be of either, and has the mean and the variance of both alike. Springs, Poisson's
ratios, densities and dimensions are taken to stay.

A campaign whose temperature nobody stated has it as one more unknown.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.body.constants import Body
from fecore.errors import InputError
from fecore.quantities import EITHER_PER_K, FIBRES_PER_K, MATRIX_PER_K, kind_of, quantity_of

if TYPE_CHECKING:
    from fecore.body.constants import Parameter
    from fecore.updating.parameters import Parametrisation

PER_K = ".per_K"
"""What the name of a coefficient has after that of its constant."""

REFERENCE_C = 23.0
"""Temperature at which constants of several campaigns are given, °C: that of the standard
atmosphere of ISO 291.
"""

TEMPERATURE = "temperature"
"""Name of a campaign's own unknown where nobody stated its temperature."""

UNKNOWN_TEMPERATURE_SD = 10.0
"""Standard deviation of such a temperature about the reference, K: rooms and halls from 3 to 43 °C
in nineteen of twenty.
"""

DAMPING_PER_K = (0.0, 0.01)
"""Mean and standard deviation of the coefficient of a damping ratio or of a law's coefficient,
1/K.
"""

AT_ONE_TEMPERATURE = (
    "{names}: all is at one temperature, so nothing says how it changes; leave the coefficient out,"
    " state reference_temperature_c, or add a campaign at another temperature"
)
"""What is said where a coefficient is stated that nothing needs."""

FREQUENCY_PER_K = (EITHER_PER_K[0] / 2, EITHER_PER_K[1] / 2)
"""The same of a natural frequency, which goes with the root of a stiffness of either kind."""

# to which share the constants of one isotropic material agree, and the largest ν of a beam's E and
# G
_ISOTROPIC, _LARGEST_POISSON = 1e-3, 0.5
_EXACT = 1e-9  # standard deviation of a coefficient of damping that is known exactly, 1/K


def constant_of(coefficient: str) -> str | None:
    """The constant of a coefficient of temperature; None where a name is that of something else."""
    return coefficient.removesuffix(PER_K) if coefficient.endswith(PER_K) else None


def usual_per_k(
    name: str, nominal: Mapping[str, float], stated: Mapping[str, tuple[float | None, float | None]]
) -> tuple[float, float] | None:
    """Mean and standard deviation of the relative change per kelvin of what a monitor watches; None
    of what stays.

    Args:
        name: of a constant, of a law's coefficient, or `frequency_2`, `damping_ratio_2`.
        nominal: the body's constants.
        stated: what the recipe states of coefficients of temperature, by name.
    """
    if name.startswith("frequency_"):
        return FREQUENCY_PER_K
    own = stated.get(name + PER_K)
    if name in nominal:
        usual = prior_per_k(name, nominal)
    else:
        usual = (
            DAMPING_PER_K
            if name.startswith("damping_ratio_") or is_of_damping(name + PER_K)
            else None
        )
    return usual if usual is None or own is None else (_or(own[0], usual[0]), _or(own[1], usual[1]))


def is_of_damping(name: str) -> bool:
    """Whether a name is that of the coefficient of temperature of a damping law's coefficient, as
    `a1.per_K`.
    """
    constant = constant_of(name)
    return (
        constant is not None
        and constant[:1].islower()
        and "." not in constant
        and quantity_of(constant) is None
    )


def damping_per_k(parameters: Sequence[Parameter]) -> dict[str, tuple[float, float]]:
    """Mean and standard deviation of those of damping that a recipe states, by name, 1/K."""
    mean, sd = DAMPING_PER_K
    return {
        each.name: (_or(each.prior_mean, mean), _EXACT if each.fixed else _or(each.prior_sd, sd))
        for each in parameters
        if is_of_damping(each.name)
    }


def prior_per_k(
    constant: str, nominal: Mapping[str, float] | None = None
) -> tuple[float, float] | None:
    """Mean and standard deviation of a constant's coefficient, 1/K; None of a constant that stays.

    Args:
        constant: its name.
        nominal: the constants beside it, which show whether the material is isotropic; None where
            nobody knows them.
    """
    known = quantity.per_k if (quantity := quantity_of(constant)) else None
    return (
        FIBRES_PER_K
        if known == MATRIX_PER_K and nominal is not None and _is_isotropic(constant, nominal)
        else known
    )


def _is_isotropic(constant: str, nominal: Mapping[str, float]) -> bool:
    """Whether a constant is of an isotropic material: E alike in both directions, G = E/2(1 +
    ν).
    """
    kind = kind_of(constant)
    before, after = constant[: constant.rfind(kind)], constant[constant.rfind(kind) + len(kind) :]
    if f"{before}E" in nominal and f"{before}G" in nominal:  # of a beam
        return 0 <= nominal[f"{before}E"] / (2 * nominal[f"{before}G"]) - 1 <= _LARGEST_POISSON
    for names in (("E1", "E2", "G12", "nu12"), ("Ex", "Ey", "Gxy", "nu_xy")):
        values = [nominal.get(f"{before}{name}{after}") for name in names]
        if None not in values:
            first, second, shear, nu = np.array(values, dtype=float)
            return bool(np.allclose([second, 2 * (1 + nu) * shear], first, rtol=_ISOTROPIC))
    return False


@dataclass(frozen=True)
class Warmth:
    """How the parameters θ of a body differ from their values at the reference, as it is warmer or
    colder.
    """

    reference: float  # °C
    temperature: float | None  # of the body, °C; None where it is unknown
    changing: IntArray  # (k,) numbers of the parameters that change
    columns: IntArray  # (k,) numbers of their coefficients among θ; -1 of one that is known exactly
    known: FloatArray  # (k,) value of such a one, 1/K; else 0
    own: int = -1  # number of the unknown temperature among θ

    def above(self, theta: FloatArray) -> FloatArray:
        """(…, 1) how much warmer than the reference the body is at (…, p) θ, K."""
        temperature = (
            theta[..., [self.own]]
            if self.temperature is None
            else np.full_like(theta[..., :1], self.temperature)
        )
        return np.asarray(temperature - self.reference)

    def coefficients(self, theta: FloatArray) -> FloatArray:
        """(…, k) coefficients at (…, p) θ, 1/K."""
        return np.where(self.columns < 0, self.known, theta[..., self.columns])

    def at(self, theta: FloatArray) -> FloatArray:
        """(…, p) θ as they are at the body's temperature; what changes by more than all of itself
        is not physical.
        """
        warm = theta.copy()
        warm[..., self.changing] *= 1 + self.coefficients(theta) * self.above(theta)
        return warm

    def slope(self, theta: FloatArray) -> FloatArray:
        """(p, p) derivative of that by θ."""
        slope, above, k = np.eye(theta.size), self.above(theta)[0], self.coefficients(theta)
        values, learnt = theta[self.changing], self.columns >= 0
        slope[self.changing, self.changing] = 1 + k * above
        slope[self.changing[learnt], self.columns[learnt]] = values[learnt] * above
        if self.temperature is None:
            slope[self.changing, self.own] = values * k
        return slope


def reference_of(temperatures: Sequence[float | None], stated: float | None) -> float | None:
    """The temperature at which the constants of some campaigns are given, °C; None where all are at
    their own.

    Args:
        temperatures: of the campaigns, °C; None where nobody stated one.
        stated: the recipe's reference.

    Raises:
        InputError: a reference is stated, and no temperature.
    """
    known = sorted({each for each in temperatures if each is not None})
    if not known:
        if stated is not None:
            raise InputError(
                "reference_temperature_c",
                f"is {stated:g} °C, but no campaign states its temperature_c: nothing can be"
                " brought to it; state it",
            )
        return None
    reference = stated if stated is not None else known[0] if len(known) == 1 else REFERENCE_C
    return None if all(each == reference for each in temperatures) else reference


def with_temperature(
    prior: Parametrisation, reference: float | None, temperature: float | None, *, reported: bool
) -> Parametrisation:
    """The parameters at a reference, of a body that has a temperature of its own: with a
    coefficient of each that changes.

    Args:
        prior: the parameters, without inputs.
        reference: °C; None where nothing is brought to one.
        temperature: of the body, °C; None where nobody stated it.
        reported: whether the coefficients are asked for; else they are inputs.

    Raises:
        InputError: coefficients are stated, and there is no reference.
    """
    stated = {each.name: each for each in prior.per_kelvin}
    if reference is None:
        if stated:
            raise InputError("parameters", AT_ONE_TEMPERATURE.format(names=", ".join(stated)))
        return prior
    changing, columns, known = list[int](), list[int](), list[float]()
    names, means, sds = list(prior.names), list(prior.prior_mean), list(prior.prior_sd)
    for number, name in enumerate(prior.names):
        usual = coefficient_of(name, prior.body)
        if usual is None:
            continue
        own = stated.get(name + PER_K)
        mean, sd = (
            usual if own is None else (_or(own.prior_mean, usual[0]), _or(own.prior_sd, usual[1]))
        )
        exact = own is not None and own.fixed
        changing.append(number)
        columns.append(-1 if exact else len(names))
        known.append(mean if exact else 0.0)
        if not exact:
            names.append(name + PER_K)
            means.append(mean)
            sds.append(sd)
    inputs = 0 if reported else len(names) - len(prior.names)
    own_column = -1
    if temperature is None:
        own_column, inputs = len(names), inputs + 1
        names.append(TEMPERATURE)
        means.append(reference)
        sds.append(UNKNOWN_TEMPERATURE_SD)
    warmth = Warmth(
        reference,
        temperature,
        np.array(changing, int),
        np.array(columns, int),
        np.array(known),
        own_column,
    )
    more = np.zeros((prior.base.size, len(names) - len(prior.names)))
    return replace(
        prior,
        names=tuple(names),
        prior_mean=np.array(means),
        prior_sd=np.array(sds),
        spread=np.hstack([prior.spread, more]),
        inputs=inputs,
        warmth=warmth,
    )


def _or(stated: float | None, usual: float) -> float:
    return usual if stated is None else stated


def coefficient_of(name: str, body: Body) -> tuple[float, float] | None:
    """Mean and standard deviation of the coefficient of a body's constant, 1/K; None of one that
    stays.
    """
    return prior_per_k(name, body.nominal) if name in body.nominal else None
