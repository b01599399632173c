"""Updating parameters: their priors, how the model's coefficients depend on them, and how they
change with temperature.

Constants that change with temperature: how much, by what prior, and how much of it a campaign
sees.

    c(T) = c_ref (1 + k (T - T_ref)),     k the coefficient of c, 1/K, named `Ex.per_K`, `web.G12.per_K`

A matrix softens more than fibres: k is -0.2 ± 0.15 %/K of constants that the matrix rules (E2, Ey,
all G), -0.05 ± 0.05 %/K of those that fibres rule (E1, Ex) and of isotropic materials. A factor on
a stiffness may be of either, and has the mean and the variance of both alike. Springs, Poisson's
ratios, densities and dimensions are taken to stay.

A campaign whose temperature nobody stated has it as one more unknown.

Updating parameters and how the model's coefficients depend on them.

A parameter is one of a specimen's constants (`fecore.body.specimen`) with a Gaussian prior; a
constant may be fixed, or tied to another, which it then follows in the ratio of their nominal
values. The derivatives of the specimen's closed forms are complex steps, Im c(q + ih)/h, which have
no truncation error at h = 10⁻³⁰ and no cancellation (Squire and Trapp, SIAM Rev. 40, 1998).

Coordinates are those in which the posterior is nearly Gaussian. A modulus is positive and its prior
a share of its value, so its coordinate is its logarithm: no interval reaches zero, and none needs a
bound. A Poisson's ratio may be negative and is its own coordinate. A prior mean m ± s becomes ln m
± √ln(1 + (s/m)²), which has the same coefficient of variation and its median at m.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from fecore.arrays import BoolArray, FloatArray, IntArray
from fecore.body.constants import (
    DEFAULT_PARAMETERS,
    ISOTROPIC,
    LARGEST_POISSON,
    Body,
    CommonPrior,
    Parameter,
    with_followers,
)
from fecore.errors import InputError
from fecore.quantities import (
    CONSTANTS,
    EITHER_PER_K,
    FIBRES_PER_K,
    MATRIX_PER_K,
    is_signed,
    kind_of,
    quantity_of,
    usual_prior_sd,
)

if TYPE_CHECKING:
    from fecore.body.constants import Parameter


PER_K = ".per_K"
"""What the name of a coefficient has after that of its constant."""

TEMPERATURE = "temperature"
"""Name of a campaign's own unknown where nobody stated its temperature."""

DAMPING_PER_K = (0.0, 0.01)
"""Mean and standard deviation of the coefficient of a damping ratio or of a law's coefficient,
1/K.
"""

FREQUENCY_PER_K = (EITHER_PER_K[0] / 2, EITHER_PER_K[1] / 2)
"""The same of a natural frequency, which goes with the root of a stiffness of either kind."""

# to which share the constants of one isotropic material agree, and the largest ν of a beam's E and
# G
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
    return (
        usual
        if usual is None or own is None
        else (stated_or(own[0], usual[0]), stated_or(own[1], usual[1]))
    )


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
        each.name: (
            stated_or(each.prior_mean, mean),
            _EXACT if each.fixed else stated_or(each.prior_sd, sd),
        )
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
        return 0 <= nominal[f"{before}E"] / (2 * nominal[f"{before}G"]) - 1 <= LARGEST_POISSON
    for names in (("E1", "E2", "G12", "nu12"), ("Ex", "Ey", "Gxy", "nu_xy")):
        values = [nominal.get(f"{before}{name}{after}") for name in names]
        if None not in values:
            first, second, shear, nu = np.array(values, dtype=float)
            return bool(np.allclose([second, 2 * (1 + nu) * shear], first, rtol=ISOTROPIC))
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
    own: int  # number of the unknown temperature among θ

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


def stated_or(stated: float | None, usual: float) -> float:
    """A number as it was stated, or the usual one."""
    return usual if stated is None else stated


def coefficient_of(name: str, body: Body) -> tuple[float, float] | None:
    """Mean and standard deviation of the coefficient of a body's constant, 1/K; None of one that
    stays.
    """
    return prior_per_k(name, body.nominal) if name in body.nominal else None


_STEP = 1e-30  # of a constant: a complex step may be as small as that
# from its prior mean, in either direction: no parameter is believed beyond
_FARTHEST = np.log(1000.0)


@dataclass(frozen=True)
class Parametrisation:
    """Free parameters θ and the linear map from them to all constants."""

    body: Body  # the specimen
    # the p free parameters; the last `inputs` of them are nuisances: the laboratory's inputs, with
    # their errors
    names: tuple[str, ...]
    # prior_mean, prior_sd: (p,) SI
    prior_mean: FloatArray
    prior_sd: FloatArray
    base: FloatArray  # (c + s,) constants and springs at θ = 0: the fixed ones
    spread: FloatArray  # (c + s, p) their derivative by θ; a tied constant has its ratio there
    inputs: int = 0
    # of each tied constant, how far it may be off its tie: standard deviation over its prior mean
    ties: Mapping[str, float] = field(default_factory=dict)
    # constants that share a prior; `prior_sd` is that of each alone
    common: tuple[CommonPrior, ...] = ()
    per_kelvin: tuple[Parameter, ...] = ()  # what the recipe says of coefficients of temperature
    warmth: Warmth | None = None  # how θ changes with temperature; None where all of it is at one

    @property
    def reported(self) -> tuple[str, ...]:
        """The parameters that are asked for, without the inputs."""
        return self.names[: len(self.names) - self.inputs]

    def with_inputs(self, standard_deviations: Mapping[str, float]) -> Parametrisation:
        """The same with inputs let go about their values: constants by name with standard
        deviations, zeros left out.
        """
        rows = [self.constant_names.index(name) for name in standard_deviations]
        sds = list(standard_deviations.values())
        chosen = [
            (row, sd)
            for row, sd in zip(rows, sds, strict=True)
            if sd > 0 and not self.spread[row].any()
        ]
        base, spread = self.base.copy(), np.zeros((self.base.size, len(chosen)))
        for column, (row, _) in enumerate(chosen):
            base[row], spread[row, column] = 0.0, 1.0
        return replace(
            self,
            names=(*self.names, *(self.constant_names[row] for row, _ in chosen)),
            prior_mean=np.concatenate([self.prior_mean, [self.base[row] for row, _ in chosen]]),
            prior_sd=np.concatenate([self.prior_sd, [sd for _, sd in chosen]]),
            base=base,
            spread=np.hstack([self.spread, spread]),
            inputs=self.inputs + len(chosen),
        )

    @property
    def constant_names(self) -> tuple[str, ...]:
        """The specimen's c constants and s springs."""
        return (*self.body.nominal, *(spring.name for spring in self.body.springs))

    @property
    def units(self) -> tuple[str, ...]:
        """SI units of the constants."""
        return (
            *(CONSTANTS[kind_of(name)].unit for name in self.body.nominal),
            *(spring.unit for spring in self.body.springs),
        )

    def unit_of(self, name: str) -> str:
        """SI unit of a parameter or of a constant."""
        if name in self.constant_names:
            return self.units[self.constant_names.index(name)]
        return CONSTANTS[kind_of(name)].unit

    def constants(self, theta: FloatArray) -> FloatArray:
        """(c + s,) constants in the order of `constant_names`, at the body's temperature."""
        values: FloatArray = self.base + self.spread @ self.warm(theta)
        return values

    def warm(self, theta: FloatArray) -> FloatArray:
        """(…, p) θ as they are at the body's temperature."""
        return theta if self.warmth is None else self.warmth.at(theta)

    def constants_by(self, theta: FloatArray) -> FloatArray:
        """(c + s, p) derivative of the constants by θ."""
        return self.spread if self.warmth is None else self.spread @ self.warmth.slope(theta)

    def is_physical(self, theta: FloatArray) -> bool:
        """Whether the specimen could have these constants, and every spring is positive."""
        return bool(self.are_physical(theta[None])[0])

    def are_physical(self, theta: FloatArray) -> BoolArray:
        """(w,) the same for (w, p) parameters."""
        constants, springs = self.split((self.base + self.warm(theta) @ self.spread.T).T)
        physical: BoolArray = self.body.are_physical(constants) & np.all(springs > 0, axis=0)
        return physical

    def coefficient_values(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(w, k + s) stiffness coefficients and (w, j) inertias at (w, p) parameters, without
        derivatives.
        """
        constants, springs = self.split((self.base + self.warm(theta) @ self.spread.T).T)
        stiffness = np.concatenate([self.body.stiffness_coefficients(constants), springs])
        return stiffness.T, self.body.mass_coefficients(constants).T

    def coefficients(self, theta: FloatArray) -> Coefficients:
        """Section coefficients, springs and inertias, and when asked for their derivatives by θ."""
        return Coefficients(self, theta)

    def split(self, rows: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Rows of the constants and of the springs."""
        count = len(self.body.nominal)
        return rows[:count], rows[count:]

    # --- coordinates ξ of the parameters θ

    @cached_property
    def logarithmic(self) -> BoolArray:
        """(p,) coordinates that are logarithms: those of parameters that cannot be negative."""
        springs = {spring.name for spring in self.body.springs}
        return np.array([name in springs or not is_signed(name) for name in self.names])

    @cached_property
    def xi_mean(self) -> FloatArray:
        """(p,) prior mean of ξ."""
        return self.xi(self.prior_mean)

    @cached_property
    def xi_sd(self) -> FloatArray:
        """(p,) prior standard deviation of ξ."""
        share = self.prior_sd / np.where(self.logarithmic, self.prior_mean, 1.0)
        sd: FloatArray = np.where(self.logarithmic, np.sqrt(np.log1p(share**2)), self.prior_sd)
        return sd

    def xi(self, theta: FloatArray) -> FloatArray:
        """(…, p) ξ of (…, p) θ."""
        xi: FloatArray = np.where(
            self.logarithmic, np.log(np.where(self.logarithmic, theta, 1.0)), theta
        )
        return xi

    def theta(self, xi: FloatArray) -> FloatArray:
        """(…, p) θ of (…, p) ξ."""
        theta: FloatArray = np.where(
            self.logarithmic, np.exp(np.where(self.logarithmic, xi, 0.0)), xi
        )
        return theta

    def slope(self, theta: FloatArray) -> FloatArray:
        """(p,) ∂θ/∂ξ."""
        slope: FloatArray = np.where(self.logarithmic, theta, 1.0)
        return slope

    def are_believable(self, xi: FloatArray) -> BoolArray:
        """(w,) of (w, p) ξ, which are physical and within a factor of a thousand of their prior
        means.
        """
        near: BoolArray = np.all(
            (np.abs(xi - self.xi_mean) < _FARTHEST) | ~self.logarithmic, axis=-1
        )
        if near.any():
            near[near] = self.are_physical(self.theta(xi[near]))
        return near


@dataclass(frozen=True)
class Coefficients:
    """Coefficients of an affine model and their derivatives by the parameters."""

    parametrisation: Parametrisation  # from θ to coefficients
    theta: FloatArray  # (p,) θ

    @cached_property
    def stiffness(self) -> FloatArray:
        """(k + s,) as the model orders them, springs last."""
        constants, springs = self._values
        return np.concatenate(
            [self.parametrisation.body.stiffness_coefficients(constants), springs]
        )

    @cached_property
    def stiffness_by(self) -> FloatArray:
        """(k + s, p) their derivatives."""
        by_constants, by_springs = self.parametrisation.split(
            self.parametrisation.constants_by(self.theta)
        )
        slope = _derivative(self.parametrisation.body.stiffness_coefficients, self._values[0])
        return np.vstack([slope @ by_constants, by_springs])

    @cached_property
    def mass(self) -> FloatArray:
        """(j,) as the model orders them."""
        return self.parametrisation.body.mass_coefficients(self._values[0])

    @cached_property
    def mass_by(self) -> FloatArray:
        """(j, p) their derivatives."""
        by_constants, _ = self.parametrisation.split(self.parametrisation.constants_by(self.theta))
        slope: FloatArray = (
            _derivative(self.parametrisation.body.mass_coefficients, self._values[0]) @ by_constants
        )
        return slope

    @cached_property
    def _values(self) -> tuple[FloatArray, FloatArray]:
        """Constants and springs."""
        return self.parametrisation.split(self.parametrisation.constants(self.theta))


def parametrise(
    specimen: Body, parameters: Sequence[Parameter] = DEFAULT_PARAMETERS
) -> Parametrisation:
    """Check a recipe's parameters against a specimen and lay out θ.

    Raises:
        InputError: a name is unknown, repeated or tied to itself or to nothing, a fixed parameter
            has a spread, a prior is not positive, or nothing is left to update.
    """
    nominal = _nominal(specimen)
    parameters = [p for p in parameters if not is_of_damping(p.name)]
    parameters = with_followers(parameters, nominal)
    coefficients = tuple(p for p in parameters if constant_of(p.name) is not None)
    free = [p for p in parameters if not p.fixed and p.tied_to is None and p not in coefficients]
    changing = [p.name + PER_K for p in free if coefficient_of(p.name, specimen) is not None]
    _check(parameters, (*nominal, *changing))
    parameters = [p for p in parameters if p not in coefficients]
    if not free:
        raise InputError(
            "parameters",
            "leaves nothing to update; expected at least one that is neither fixed nor tied",
        )
    mean = {p.name: nominal[p.name] if p.prior_mean is None else p.prior_mean for p in parameters}
    base = dict(nominal)
    constant_names = tuple(nominal)
    spread = np.zeros((len(constant_names), len(free)))
    for p in parameters:
        row = constant_names.index(p.name)
        if p.fixed:
            base[p.name] = mean[p.name]
            continue
        base[p.name] = 0.0
        master = p.name if p.tied_to is None else p.tied_to
        ratio = 1.0 if p.tied_to is None else mean[p.name] / mean[master]
        spread[row, [f.name for f in free].index(master)] = ratio
    prior_mean = np.array([mean[p.name] for p in free])
    prior_sd = np.array(
        [usual_prior_sd(p.name, mean[p.name]) if p.prior_sd is None else p.prior_sd for p in free]
    )
    names = tuple(p.name for p in free)
    unstated = {p.name for p in free if p.prior_sd is None and p.prior_mean is None}
    common = [c for c in specimen.common_priors() if set(c.constants) <= unstated]
    for each in common:
        rows = [names.index(name) for name in each.constants]
        prior_sd[rows] = np.hypot(each.common, each.own) * prior_mean[rows]
    fixed = np.array([base[name] for name in constant_names])
    ties = {
        p.name: abs((p.prior_sd or usual_prior_sd(p.name, mean[p.name])) / mean[p.name])
        for p in parameters
        if p.tied_to is not None
    }
    result = Parametrisation(
        specimen,
        names,
        prior_mean,
        prior_sd,
        fixed,
        spread,
        ties=ties,
        common=tuple(common),
        per_kelvin=coefficients,
    )
    if not result.is_physical(prior_mean):
        raise InputError(
            "parameters",
            "the prior means are not those of a positive definite material; look at Poisson's"
            " ratio",
        )
    return result


def _nominal(specimen: Body) -> dict[str, float]:
    constants = specimen.nominal
    springs = {spring.name: spring.stiffness for spring in specimen.springs}
    if set(springs) & set(constants):
        raise InputError(
            "springs",
            f"a spring has the name of a constant: {', '.join(set(springs) & set(constants))}",
        )
    return {**constants, **springs}


def _check(parameters: Sequence[Parameter], known: tuple[str, ...]) -> None:
    by_name = {p.name: p for p in parameters}
    for index, p in enumerate(parameters):
        where = f"parameters.{index}"
        if p.name not in known:
            raise InputError(f"{where}.name", f"is {p.name!r}, expected one of {', '.join(known)}")
        if p.name in {before.name for before in parameters[:index]}:
            raise InputError(f"{where}.name", f"{p.name} is named twice")
        if p.prior_mean is not None and not (
            np.isfinite(p.prior_mean) and (p.prior_mean > 0 or is_signed(p.name))
        ):
            raise InputError(
                f"{where}.prior_mean", f"is {p.prior_mean}, expected a positive number"
            )
        if p.prior_sd is not None and not (np.isfinite(p.prior_sd) and p.prior_sd > 0):
            raise InputError(
                f"{where}.prior_sd",
                f"is {p.prior_sd}, expected a positive number; to fix it, say fixed",
            )
        if p.prior_sd is not None and p.fixed:
            raise InputError(f"{where}.prior_sd", f"{p.name} is fixed, so it cannot have a spread")
        if p.fixed and p.tied_to:
            raise InputError(f"{where}.tied_to", f"{p.name} is fixed and tied at once")
        if p.tied_to is not None:
            _check_tie(where, p, by_name)
        if constant_of(p.name) is not None and (p.tied_to or (p.fixed and p.prior_mean is None)):
            raise InputError(
                where,
                f"{p.name} is a coefficient of temperature: state its prior_mean in 1/K, or"
                " nothing",
            )


def _check_tie(where: str, p: Parameter, by_name: dict[str, Parameter]) -> None:
    if p.tied_to == p.name:
        raise InputError(f"{where}.tied_to", f"{p.name} is tied to itself")
    master = by_name.get(p.tied_to or "")
    if master is None or master.fixed or master.tied_to or constant_of(master.name) is not None:
        raise InputError(
            f"{where}.tied_to", f"{p.tied_to!r} is not a free parameter of this recipe"
        )


def by_name(names: Sequence[str], values: FloatArray) -> dict[str, float]:
    """(n,) values by their names, as results and errors carry them."""
    return dict(zip(names, map(float, values), strict=True))


def _derivative(
    closed_form: Callable[[FloatArray], FloatArray], constants: FloatArray
) -> FloatArray:
    """(k, c) derivative of a closed form by its constants."""
    step = _STEP * np.maximum(np.abs(constants), _STEP)
    derivative: FloatArray = closed_form(constants[:, None] + 1j * np.diag(step)).imag / step
    return derivative
