"""A solved model: its modes, and their exact derivatives by the parameters, over the dofs or over a reduced basis."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from fecore.arrays import FloatArray
from fecore.dynamics.eigen import NormalModes
from fecore.dynamics.sensitivity import Matrix, eigenvalue_derivatives, mode_forms, mode_shape_derivatives
from fecore.updating.parameters import Coefficients


@dataclass(frozen=True)
class Terms:
    """The matrices that the coefficients of stiffness and mass multiply."""

    stiffness: list[Matrix]
    mass: list[Matrix]

    def sum(self, which: str, weights: FloatArray) -> Matrix:
        """Σ weight · matrix."""
        matrices = getattr(self, which)
        total = matrices[0] * weights[0]
        for weight, matrix in zip(weights[1:], matrices[1:], strict=True):
            if weight:
                total = total + weight * matrix
        return total


@dataclass(frozen=True)
class Solution(ABC):
    """The solved system at one θ, all modes of it, rigid ones first.

    Attributes:
        coefficients: the model's coefficients and their derivatives there.
        modes: all modes; their shapes are over the dofs, or over the basis.
        terms: matrices of the system, over the dofs or over the basis.
        basis: (dofs, r) reduced basis, or None for the full model.
    """

    coefficients: Coefficients
    modes: NormalModes
    terms: Terms
    basis: FloatArray | None

    @property
    @abstractmethod
    def observation(self) -> FloatArray | scipy.sparse.csr_array:
        """From the system's unknowns, dofs or basis, to the deflections of the measured points."""

    @cached_property
    def all_shapes(self) -> FloatArray:
        """(m, p) mass-normalised shapes of all modes, rigid ones first, at the measured points."""
        shapes: FloatArray = (self.observation @ self.modes.shapes).T
        return shapes

    @cached_property
    def energies(self) -> FloatArray:
        """(m, k) energies φᵀK_kφ of all modes."""
        phi = self.modes.shapes
        return np.stack([np.sum(phi * (term @ phi), axis=0) for term in self.terms.stiffness], axis=1)

    @cached_property
    def by_parameter(self) -> tuple[list[Matrix], list[Matrix]]:
        """∂K/∂θ and ∂M/∂θ for each parameter."""
        c = self.coefficients
        return (
            [self.terms.sum("stiffness", weights) for weights in c.stiffness_by.T],
            [self.terms.sum("mass", weights) for weights in c.mass_by.T],
        )

    @cached_property
    def eigenvalue_matrix(self) -> FloatArray:
        """(p, m, m) derivatives of the eigenvalues; off the diagonal inside repeated roots only (`sensitivity`)."""
        c = self.coefficients
        stiffness = mode_forms(self.modes, self.terms.stiffness, c.stiffness_by)
        mass = mode_forms(self.modes, self.terms.mass, c.mass_by)
        return eigenvalue_derivatives(self.modes, stiffness, mass)

    @cached_property
    def eigenvalue_jacobian(self) -> FloatArray:
        """(m, p) ∂λ/∂θ = φᵀ(∂K/∂θ - λ ∂M/∂θ)φ of all modes; 0 for rigid ones."""
        by: FloatArray = np.einsum("pkk->kp", self.eigenvalue_matrix)
        return by

    @cached_property
    def shape_jacobian(self) -> FloatArray:
        """(p, m, points) derivative of all shapes at the measured points."""
        jacobian: FloatArray = np.array([(self.observation @ each).T for each in self.shape_derivatives])
        return jacobian

    @cached_property
    def shape_derivatives(self) -> FloatArray:
        """(p, dofs, m) derivative of all shapes, over the dofs or over the basis."""
        c = self.coefficients
        stiffness, mass = self.terms.sum("stiffness", c.stiffness), self.terms.sum("mass", c.mass)
        return mode_shape_derivatives(stiffness, mass, self.modes, *self.by_parameter)
