"""Updating parameters and how the model's coefficients depend on them.

The constants of a specimen are (Ex, Ey, Gxy, Gxz, Gyz, nu_xy, density, thickness). A parameter is one of them with a
Gaussian prior; a constant may be fixed, or tied to another, which it then follows in the ratio of their nominal values.
With Q = Ex / (Ex - ν² Ey) and a single layer of thickness t the section's coefficients are

    D11 = Ex Q t³/12,  D22 = Ey Q t³/12,  D12 = ν D22,  D66 = Gxy t³/12,  S55 = κ Gxz t,  S44 = κ Gyz t,
    I0 = ρ t,  I2 = ρ t³/12.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fecore.arrays import BoolArray, FloatArray
from fecore.errors import InputError
from fecore.laminate import SHEAR_CORRECTION
from fecore.specimen import Specimen

CONSTANTS = ("Ex", "Ey", "Gxy", "Gxz", "Gyz", "nu_xy", "density", "thickness")
"""Constants that can be parameters."""

UNITS = dict(zip(CONSTANTS, ("Pa", "Pa", "Pa", "Pa", "Pa", "1", "kg/m³", "m"), strict=True))
"""SI unit of each constant."""

DEFAULT_RELATIVE_SD = 0.30
"""Prior standard deviation of a parameter for which none is stated, as a share of its mean."""


@dataclass(frozen=True)
class Parameter:
    """One constant in a recipe.

    Attributes:
        name: one of `CONSTANTS`.
        prior_mean: SI; the specimen's nominal value where None.
        prior_sd: SI; 30 % of the mean where None.
        fixed: keep the constant at its prior mean.
        tied_to: name of a parameter that this constant follows in the ratio of the nominal values.
    """

    name: str
    prior_mean: float | None = None
    prior_sd: float | None = None
    fixed: bool = False
    tied_to: str | None = None


DEFAULT_PARAMETERS = (
    Parameter("Ex"),
    Parameter("Ey"),
    Parameter("Gxy"),
    Parameter("Gxz"),
    Parameter("Gyz", tied_to="Gxz"),
)
"""What is updated when a recipe names nothing: the contract's default."""


@dataclass(frozen=True)
class Parametrisation:
    """Free parameters θ and the linear map from them to all constants.

    Attributes:
        names: the p free parameters.
        prior_mean, prior_sd: (p,) SI.
        base: (8 + s,) constants at θ = 0: the fixed ones.
        spread: (8 + s, p) derivative of the constants by θ; a tied constant has its ratio there.
        constant_names: `CONSTANTS` and the names of the specimen's s springs.
        units: SI units of the constants.
    """

    names: tuple[str, ...]
    prior_mean: FloatArray
    prior_sd: FloatArray
    base: FloatArray
    spread: FloatArray
    constant_names: tuple[str, ...] = CONSTANTS
    units: tuple[str, ...] = tuple(UNITS.values())

    def constants(self, theta: FloatArray) -> FloatArray:
        """(8 + s,) constants in the order of `constant_names`."""
        values: FloatArray = self.base + self.spread @ theta
        return values

    def is_physical(self, theta: FloatArray) -> bool:
        """Whether every constant is positive (ν apart) and the material positive definite."""
        return bool(self.are_physical(theta[None])[0])

    def are_physical(self, theta: FloatArray) -> BoolArray:
        """(w,) the same for (w, p) parameters."""
        q = self.base + theta @ self.spread.T
        positive = np.all(np.delete(q, CONSTANTS.index("nu_xy"), axis=1) > 0, axis=1)
        physical: BoolArray = positive & (q[:, 5] ** 2 * q[:, 1] < 0.99 * q[:, 0])
        return physical

    def coefficient_values(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(w, 9 + s) stiffness coefficients and (w, 3) inertias at (w, p) parameters, without derivatives."""
        q = (self.base + theta @ self.spread.T).T
        section, springs = q[: len(CONSTANTS)], q[len(CONSTANTS) :]
        return np.concatenate([_stiffness_values(section), springs]).T, _mass_values(section).T

    def coefficients(self, theta: FloatArray) -> Coefficients:
        """Section coefficients, springs and inertias with their derivatives by θ."""
        q, count = self.constants(theta), len(CONSTANTS)
        stiffness, by_constant = _stiffness(q[:count])
        mass, mass_by_constant = _mass(q[:count])
        by_section, by_spring = self.spread[:count], self.spread[count:]
        return Coefficients(
            np.concatenate([stiffness, q[count:]]),
            np.vstack([by_constant @ by_section, by_spring]),
            mass,
            mass_by_constant @ by_section,
        )


@dataclass(frozen=True)
class Coefficients:
    """Coefficients of an affine model and their derivatives by the parameters.

    Attributes:
        stiffness: (9 + s,) as `PlateModel.stiffness_coefficients` orders them; stiffness_by: (9 + s, p).
        mass: (3,) as `PlateModel.mass_coefficients` orders them; mass_by: (3, p).
    """

    stiffness: FloatArray
    stiffness_by: FloatArray
    mass: FloatArray
    mass_by: FloatArray


def parametrise(specimen: Specimen, parameters: Sequence[Parameter] = DEFAULT_PARAMETERS) -> Parametrisation:
    """Check a recipe's parameters against a specimen and lay out θ.

    Raises:
        InputError: a name is unknown, repeated or tied to itself or to nothing, a fixed parameter has a spread, a
            prior is not positive, or nothing is left to update.
    """
    nominal = _nominal(specimen)
    _check(parameters, tuple(nominal))
    free = [p for p in parameters if not p.fixed and p.tied_to is None]
    if not free:
        raise InputError("parameters", "leaves nothing to update; expected at least one that is neither fixed nor tied")
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
        ratio = mean[p.name] / mean[master]
        spread[row, [f.name for f in free].index(master)] = ratio
    prior_mean = np.array([mean[p.name] for p in free])
    prior_sd = np.array([DEFAULT_RELATIVE_SD * mean[p.name] if p.prior_sd is None else p.prior_sd for p in free])
    names = tuple(p.name for p in free)
    result = Parametrisation(
        names,
        prior_mean,
        prior_sd,
        np.array([base[name] for name in constant_names]),
        spread,
        constant_names,
        (*UNITS.values(), *(spring.unit for spring in specimen.springs)),
    )
    if not result.is_physical(prior_mean):
        raise InputError(
            "parameters", "the prior means are not those of a positive definite material (nu_xy² Ey/Ex ≥ 1)"
        )
    return result


def with_constants(specimen: Specimen, constants: FloatArray) -> Specimen:
    """The specimen with other constants, in the order of `CONSTANTS` and then of its springs."""
    count = len(CONSTANTS)
    values = dict(zip(CONSTANTS, (float(value) for value in constants[:count]), strict=True))
    thickness = values.pop("thickness")
    springs = tuple(
        replace(spring, stiffness=float(value))
        for spring, value in zip(specimen.springs, constants[count:], strict=True)
    )
    return replace(specimen, thickness=thickness, material=replace(specimen.material, **values), springs=springs)


def _nominal(specimen: Specimen) -> dict[str, float]:
    material = {name: float(getattr(specimen.material, name)) for name in CONSTANTS if name != "thickness"}
    springs = {spring.name: spring.stiffness for spring in specimen.springs}
    if set(springs) & set(CONSTANTS):
        raise InputError("springs", f"a spring has the name of a constant: {', '.join(set(springs) & set(CONSTANTS))}")
    return {**material, "thickness": specimen.thickness, **springs}


def _check(parameters: Sequence[Parameter], known: tuple[str, ...]) -> None:
    by_name = {p.name: p for p in parameters}
    for index, p in enumerate(parameters):
        where = f"parameters.{index}"
        if p.name not in known:
            raise InputError(f"{where}.name", f"is {p.name!r}, expected one of {', '.join(known)}")
        if p.name in {before.name for before in parameters[:index]}:
            raise InputError(f"{where}.name", f"{p.name} is named twice")
        if p.prior_mean is not None and not (np.isfinite(p.prior_mean) and (p.prior_mean > 0 or p.name == "nu_xy")):
            raise InputError(f"{where}.prior_mean", f"is {p.prior_mean}, expected a positive number")
        if p.prior_sd is not None and not (np.isfinite(p.prior_sd) and p.prior_sd > 0):
            raise InputError(f"{where}.prior_sd", f"is {p.prior_sd}, expected a positive number; to fix it, say fixed")
        if p.prior_sd is not None and (p.fixed or p.tied_to):
            raise InputError(f"{where}.prior_sd", f"{p.name} is fixed or tied, so it cannot have a spread of its own")
        if p.fixed and p.tied_to:
            raise InputError(f"{where}.tied_to", f"{p.name} is fixed and tied at once")
        if p.tied_to is not None:
            _check_tie(where, p, by_name)


def _check_tie(where: str, p: Parameter, by_name: dict[str, Parameter]) -> None:
    if p.tied_to == p.name:
        raise InputError(f"{where}.tied_to", f"{p.name} is tied to itself")
    master = by_name.get(p.tied_to or "")
    if master is None or master.fixed or master.tied_to:
        raise InputError(f"{where}.tied_to", f"{p.tied_to!r} is not a free parameter of this recipe")


def _stiffness_values(q: FloatArray) -> FloatArray:
    """(9, …) stiffness coefficients at (8, …) constants."""
    Ex, Ey, Gxy, Gxz, Gyz, nu, _, t = q
    bending, shear, rest = t**3 / 12, SHEAR_CORRECTION * t, Ex - nu**2 * Ey
    Q11, Q22, none = Ex**2 / rest, Ex * Ey / rest, np.zeros_like(Ex)
    rows = [Q11, nu * Q22, Q22, Gxy, none, none]
    return np.stack([*(bending * row for row in rows), shear * Gxz, shear * Gyz, none])


def _mass_values(q: FloatArray) -> FloatArray:
    """(3, …) mass coefficients at (8, …) constants."""
    density, t = q[6], q[7]
    return np.stack([density * t, density * t**3 / 12, np.ones_like(t)])


def _stiffness(q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(9,) stiffness coefficients and their (9, 8) derivatives by the constants."""
    Ex, Ey, _, _, _, nu, _, t = q
    bending, shear, rest = t**3 / 12, SHEAR_CORRECTION * t, Ex - nu**2 * Ey
    Q22 = Ex * Ey / rest
    value = _stiffness_values(q)
    by = np.zeros((9, 8), dtype=q.dtype)
    Q11_by = np.array([Ex * (Ex - 2 * nu**2 * Ey), Ex**2 * nu**2, 2 * nu * Ey * Ex**2]) / rest**2
    Q22_by = np.array([-((nu * Ey) ** 2), Ex**2, 2 * nu * Ex * Ey**2]) / rest**2
    Ex_Ey_nu = [0, 1, 5]
    by[0, Ex_Ey_nu] = bending * Q11_by
    by[1, Ex_Ey_nu] = bending * (nu * Q22_by + np.array([0, 0, Q22]))
    by[2, Ex_Ey_nu] = bending * Q22_by
    by[3, 2] = bending
    by[6, 3] = by[7, 4] = shear
    by[:6, 7] = 3 / t * value[:6]
    by[6:, 7] = value[6:] / t
    return value, by


def _mass(q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(3,) mass coefficients and their (3, 8) derivatives by the constants."""
    density, t = q[6], q[7]
    by = np.zeros((3, 8), dtype=q.dtype)
    by[0, 6], by[0, 7] = t, density
    by[1, 6], by[1, 7] = t**3 / 12, density * t**2 / 4
    return _mass_values(q), by
