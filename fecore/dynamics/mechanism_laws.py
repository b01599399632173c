"""Damping laws by mechanism: every part of the strain energy is damped at a rate of its own.

A law of frequency alone gives a torsion mode and a bending mode of one frequency the same ratio. In
a laminate the resin, which shears, damps more than the fibres, which bend. With the share U_mk of
mode k's strain energy in mechanism m

    c_k = 2 ζ_k ω_k = a₀ + ω_k Σ_m η_m U_mk      loss factors (structural damping; Ungar and Kerwin 1962), or
    c_k = a₀ + ω_k² Σ_m b_m U_mk                 viscous rates, of which C = a₀M + b K is the case of equal b_m.
"""

from dataclasses import dataclass

import numpy as np

from fecore.arrays import FloatArray
from fecore.errors import InputError


@dataclass(frozen=True)
class MechanismDamping:
    """A loss factor η, or a viscous rate b, for each of some groups of mechanisms."""

    name: str  # name in recipes and results
    # what each coefficient stands for, as a suffix of its name, and the columns of the shares that
    # it damps
    groups: tuple[tuple[str, tuple[int, ...]], ...]
    viscous: bool = False  # the rates go with ω² and not with ω
    mass: bool = True  # whether a mass-proportional a0 comes first

    @property
    def coefficient_names(self) -> tuple[str, ...]:
        """a0 where there is one, then eta_E and so on, or b_E."""
        letter = "b" if self.viscous else "eta"
        own = tuple(f"{letter}_{suffix}" if suffix else letter for suffix, _ in self.groups)
        return ("a0", *own) if self.mass else own

    @property
    def coefficient_units(self) -> tuple[str, ...]:
        """1/s for a0, 1 for loss factors, s for viscous rates."""
        own = ("s" if self.viscous else "1",) * len(self.groups)
        return ("1/s", *own) if self.mass else own

    def basis(self, omega: FloatArray, strain: FloatArray | None = None, /) -> FloatArray:
        """(n, p) derivative of the rates by the coefficients, at (n,) frequencies of modes with (n,
        q) shares.
        """
        power = omega**2 if self.viscous else omega
        columns = [power * part for part in self._shares(strain)]
        return np.column_stack([np.ones_like(omega), *columns] if self.mass else columns)

    def slope(self, omega: FloatArray, strain: FloatArray | None = None, /) -> FloatArray:
        """(n, p) derivative of `basis` by the circular frequency, the shares given."""
        power = 2 * omega if self.viscous else np.ones_like(omega)
        columns = [power * part for part in self._shares(strain)]
        return np.column_stack([np.zeros_like(omega), *columns] if self.mass else columns)

    def by_strain(self, omega: FloatArray, coefficients: FloatArray, count: int, /) -> FloatArray:
        """(n, q) derivative of the rates by the q shares."""
        by = np.zeros(count)
        for (_, columns), coefficient in zip(
            self.groups, coefficients[int(self.mass) :], strict=True
        ):
            by[list(columns)] += coefficient
        power = omega**2 if self.viscous else omega
        slopes: FloatArray = power[:, None] * by
        return slopes

    def _shares(self, strain: FloatArray | None) -> list[FloatArray]:
        if strain is None:
            raise InputError(
                f"damping.{self.name}",
                "needs the shares of strain energy of a finite element model's modes",
            )
        return [strain[:, list(columns)].sum(axis=1) for _, columns in self.groups]
