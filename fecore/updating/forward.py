"""The forward model as updating sees it: parameters in, modes at the measured points and their derivatives out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from fecore.arrays import FloatArray, IntArray
from fecore.eigen import NormalModes, modes_below, normal_modes
from fecore.errors import InputError
from fecore.frf import Dof, ModalFrfModel
from fecore.specimen import Specimen
from fecore.updating.parameters import Coefficients, Parametrisation

OUT_OF_PLANE = 3
"""Direction code of z, which a bending model predicts."""


@dataclass(frozen=True)
class ForwardModel:
    """A specimen's modes at measured points, for any parameters.

    Attributes:
        specimen: nominal specimen.
        parametrisation: from θ to coefficients.
        points: labels of the p measured points.
        places: (p, 2) their coordinates on the specimen, m.
        count: how many modes to solve for.
    """

    specimen: Specimen
    parametrisation: Parametrisation
    points: tuple[int, ...]
    places: FloatArray
    count: int

    @cached_property
    def observation(self) -> sparse.csr_array:
        """(p, dofs) interpolation of the deflection w at the points."""
        return self.specimen.model.deflection(self.places)

    def rows(self, dofs: Sequence[Dof]) -> tuple[IntArray, FloatArray]:
        """(N,) numbers of the points of some dofs along ±z, and (N,) their signs.

        Raises:
            InputError: a dof is not out of plane, or its point is not among the model's.
        """
        number = {point: row for row, point in enumerate(self.points)}
        for dof in dofs:
            if dof.axis != OUT_OF_PLANE:
                raise InputError("direction", f"{dof.direction} at point {dof.point} is not out of plane (±3)")
            if dof.point not in number:
                raise InputError("point", f"{dof.point} has no coordinates; give it a grid point")
        return np.array([number[dof.point] for dof in dofs]), np.array([float(dof.sign) for dof in dofs])

    def solve(self, theta: FloatArray) -> ForwardState:
        """Modes at parameters θ.

        Raises:
            ModelError: the eigenproblem cannot be solved.
        """
        model = self.specimen.model
        coefficients = self.parametrisation.coefficients(theta)
        mass = model.mass.at(coefficients.mass)
        modes = normal_modes(model.stiffness.at(coefficients.stiffness), mass, self.count, model.rigid_modes)
        return ForwardState(self, theta, coefficients, modes, mass)


@dataclass(frozen=True)
class ForwardState:
    """The solved model at one θ. Mode indices count the elastic modes only, unless a name says `all`."""

    forward: ForwardModel
    theta: FloatArray
    coefficients: Coefficients
    modes: NormalModes
    mass: sparse.csc_array

    @property
    def frequency_hz(self) -> FloatArray:
        """(n,) natural frequencies of the elastic modes, Hz."""
        return self.modes.frequency_hz[self.modes.rigid :]

    @cached_property
    def all_shapes(self) -> FloatArray:
        """(m, p) mass-normalised shapes of all modes, rigid ones first, at the measured points."""
        shapes: FloatArray = (self.forward.observation @ self.modes.shapes).T
        return shapes

    @property
    def shapes(self) -> FloatArray:
        """(n, p) mass-normalised shapes of the elastic modes at the measured points."""
        return self.all_shapes[self.modes.rigid :]

    @cached_property
    def projected_derivatives(self) -> FloatArray:
        """(p, 2, m, m) φᵀ(∂K/∂θ)φ and φᵀ(∂M/∂θ)φ over all modes."""
        model, phi = self.forward.specimen.model, self.modes.shapes
        stiffness = np.array([phi.T @ (model.stiffness.term(k) @ phi) for k in range(len(model.stiffness.names))])
        mass = np.array([phi.T @ (model.mass.term(k) @ phi) for k in range(len(model.mass.names))])
        by = self.coefficients
        return np.stack(
            [
                np.einsum("kij,kp->pij", stiffness, by.stiffness_by),
                np.einsum("kij,kp->pij", mass, by.mass_by),
            ],
            axis=1,
        )

    @cached_property
    def eigenvalue_jacobian(self) -> FloatArray:
        """(m, p) ∂λ/∂θ = φᵀ(∂K/∂θ - λ ∂M/∂θ)φ of all modes; 0 for rigid ones."""
        K, M = self.projected_derivatives[:, 0], self.projected_derivatives[:, 1]
        by: FloatArray = np.einsum("pkk->kp", K) - self.modes.eigenvalue[:, None] * np.einsum("pkk->kp", M)
        by[: self.modes.rigid] = 0
        return by

    @property
    def frequency_jacobian(self) -> FloatArray:
        """(n, p) ∂f/∂θ of the elastic modes, Hz per SI unit, f = √λ / 2π."""
        gradient: FloatArray = self.eigenvalue_jacobian[self.modes.rigid :] / (
            8 * np.pi**2 * self.frequency_hz[:, None]
        )
        return gradient

    @cached_property
    def shape_jacobian(self) -> FloatArray:
        """(p, m, points) derivative of all shapes at the measured points, expanded in the solved modes.

        ∂φ_k/∂θ = Σ_{j≠k} φ_j φ_jᵀ(∂K/∂θ - λ_k ∂M/∂θ)φ_k / (λ_k - λ_j) - ½ φ_k φ_kᵀ(∂M/∂θ)φ_k   (Fox and Kapoor 1968)
        """
        K, M = self.projected_derivatives[:, 0], self.projected_derivatives[:, 1]
        value = self.modes.eigenvalue
        gap = value[:, None] - value[None, :]
        alone = np.abs(gap) <= 1e-9 * value.max()
        force = K - value[None, :, None] * M  # row k: mode k's own eigenvalue
        weights = np.where(alone, 0.0, force / np.where(alone, 1.0, gap))
        diagonal = np.arange(value.size)
        weights[:, diagonal, diagonal] = -np.einsum("pkk->pk", M) / 2
        jacobian: FloatArray = weights @ self.all_shapes
        return jacobian

    def frf_model(self, responses: Sequence[Dof], references: Sequence[Dof]) -> ModalFrfModel:
        """Synthesis of the FRFs between some dofs, with residual terms for the truncated modes."""
        response, response_sign = self.forward.rows(responses)
        reference, reference_sign = self.forward.rows(references)
        sign = (response_sign * reference_sign)[:, None]
        return ModalFrfModel(
            eigenvalue=self.modes.eigenvalue,
            residues=sign * (self.all_shapes[:, response] * self.all_shapes[:, reference]).T,
            residual=sign * self._residual(response, reference),
            shift=self.modes.shift,
        )

    def residue_jacobian(self, responses: Sequence[Dof], references: Sequence[Dof]) -> FloatArray:
        """(p, N, m) derivative of the residues of `frf_model` by the parameters."""
        response, response_sign = self.forward.rows(responses)
        reference, reference_sign = self.forward.rows(references)
        by, shapes = self.shape_jacobian, self.all_shapes
        product = by[:, :, response] * shapes[:, reference] + shapes[:, response] * by[:, :, reference]
        signed: FloatArray = (response_sign * reference_sign)[:, None] * product.transpose(0, 2, 1)
        return signed

    def _residual(self, response: IntArray, reference: IntArray) -> FloatArray:
        """(N, 2) static and next term of the truncated modes: two solves with the factor that the modes left."""
        modes, observation = self.modes, self.forward.observation
        used, column = np.unique(reference, return_inverse=True)
        load = observation[used].T.toarray()
        # Rigid-body motion is among the solved modes; without it the solves stay well conditioned.
        rigid = modes.shapes[:, : modes.rigid]
        load = load - self.mass @ (rigid @ (rigid.T @ load))
        first = modes.factor.solve(load)
        second = modes.factor.solve(self.mass @ first)
        away = modes.eigenvalue[modes.rigid :] - modes.shift
        residues = (self.shapes[:, response] * self.shapes[:, reference]).T
        solved = [(observation @ solution)[response, column] for solution in (first, second)]
        return np.column_stack([total - residues @ away**-power for power, total in enumerate(solved, start=1)])


def modes_to_cover(specimen: Specimen, highest_hz: float, at_least: int) -> int:
    """How many modes to solve for: those below twice a frequency in the nominal model, and at least so many elastic ones.

    The factor is the margin for constants that come out lower than nominal, and for the residual series.
    """
    model = specimen.model
    stiffness = model.stiffness.at(model.stiffness_coefficients(specimen.section))
    mass = model.mass.at(model.mass_coefficients(specimen.section))
    below = modes_below(stiffness, mass, (2 * np.pi * 2 * highest_hz) ** 2)
    return max(below, at_least + int(model.rigid_modes.shape[1]))
