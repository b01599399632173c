"""Coordinates in which the posterior of the parameters is nearly Gaussian.

A modulus is positive and its prior a share of its value, so its coordinate is its logarithm: no interval reaches zero, and none
needs a bound. A Poisson's ratio may be negative and is its own coordinate. A prior mean m ± s becomes ln m ± √ln(1 + (s/m)²),
which has the same coefficient of variation and its median at m.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fecore.arrays import BoolArray, FloatArray
from fecore.updating.parameters import Parametrisation

_FARTHEST = np.log(1000.0)  # from its prior mean, in either direction: no parameter is believed beyond


@dataclass(frozen=True)
class Coordinates:
    """The map between parameters θ and coordinates ξ, with the Gaussian prior of ξ.

    Attributes:
        parametrisation: whose parameters they are.
    """

    parametrisation: Parametrisation

    @property
    def logarithmic(self) -> BoolArray:
        """(p,) coordinates that are logarithms."""
        return ~self.parametrisation.signed

    @cached_property
    def mean(self) -> FloatArray:
        """(p,) prior mean of ξ."""
        return self.of(self.parametrisation.prior_mean)

    @cached_property
    def sd(self) -> FloatArray:
        """(p,) prior standard deviation of ξ."""
        prior = self.parametrisation
        share = prior.prior_sd / np.where(self.logarithmic, prior.prior_mean, 1.0)
        sd: FloatArray = np.where(self.logarithmic, np.sqrt(np.log1p(share**2)), prior.prior_sd)
        return sd

    def of(self, theta: FloatArray) -> FloatArray:
        """(…, p) ξ of (…, p) θ."""
        xi: FloatArray = np.where(self.logarithmic, np.log(np.where(self.logarithmic, theta, 1.0)), theta)
        return xi

    def values(self, xi: FloatArray) -> FloatArray:
        """(…, p) θ of (…, p) ξ."""
        theta: FloatArray = np.where(self.logarithmic, np.exp(np.where(self.logarithmic, xi, 0.0)), xi)
        return theta

    def slope(self, theta: FloatArray) -> FloatArray:
        """(p,) ∂θ/∂ξ."""
        slope: FloatArray = np.where(self.logarithmic, theta, 1.0)
        return slope

    def are_believable(self, xi: FloatArray) -> BoolArray:
        """(…) ξ that are physical and within a factor of a thousand of their prior means."""
        near: BoolArray = np.all((np.abs(xi - self.mean) < _FARTHEST) | ~self.logarithmic, axis=-1)
        allowed = np.zeros(near.shape, dtype=bool)
        if near.any():
            allowed[near] = self.parametrisation.are_physical(self.values(np.atleast_2d(xi)[np.atleast_1d(near)]))
        return allowed
