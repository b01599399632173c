"""A model solved at one θ: its modes at the measured points, their FRFs, and exact derivatives by
the parameters.

The system is a pair of matrices, over the dofs or over a reduced basis; either way a state offers
the same, and all derivatives are exact ones of that system (`fecore.dynamics.sensitivity`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy

from fecore.arrays import BoolArray, FloatArray, IntArray
from fecore.body.kinds import energy_shares, largest, motion_shares
from fecore.body.mechanisms import mechanism_weights
from fecore.dynamics.eigen import NormalModes
from fecore.dynamics.sensitivity import (
    eigenvalue_derivatives,
    mode_forms,
    mode_shape_derivatives,
)
from fecore.dynamics.synthesis import (
    RESIDUAL_TERMS,
    Matrix,
    ModalFrfModel,
    RovingMass,
    residual_series,
)
from fecore.frf import Dof
from fecore.updating.parameters import Coefficients

if TYPE_CHECKING:
    from fecore.updating.forward import ForwardModel

_UNSEEN = 0.05  # of the square of the motion at the measured points
# relative, of differences of the parts of the section's coefficients, which are nearly linear
_SHARE_STEP = 1e-5


@dataclass(frozen=True)
class ForwardState:
    """The solved model at one θ. Mode indices count the elastic modes only, unless a name says
    `all`.
    """

    coefficients: Coefficients  # the model's coefficients and their derivatives there
    # all modes, rigid ones first; their shapes are over the dofs, or over the basis
    modes: NormalModes
    # stiffness, mass: matrices that the coefficients multiply, over the dofs or over the basis
    stiffness: list[Matrix]
    mass: list[Matrix]
    basis: FloatArray | None  # (dofs, r) reduced basis, or None for the full model
    forward: ForwardModel  # the model
    theta: FloatArray  # (p,) parameters

    @property
    def frequency_hz(self) -> FloatArray:
        """(n,) natural frequencies of the elastic modes, Hz."""
        return self.modes.frequency_hz[self.modes.rigid :]

    @property
    def constants(self) -> FloatArray:
        """(c + s,) constants and springs, SI."""
        return self.forward.parametrisation.constants(self.theta)

    @cached_property
    def observation(self) -> FloatArray | scipy.sparse.csr_array:
        """From the system's unknowns, dofs or basis, to the displacements of the measured rows."""
        observation = self.forward.observation
        return observation if self.basis is None else observation @ self.basis

    # --- shapes

    @cached_property
    def all_shapes(self) -> FloatArray:
        """(m, p) mass-normalised shapes of all modes, rigid ones first, at the measured points."""
        shapes: FloatArray = (self.observation @ self.modes.shapes).T
        return shapes

    @property
    def shapes(self) -> FloatArray:
        """(n, p) mass-normalised shapes of the elastic modes at the measured points."""
        return self.all_shapes[self.modes.rigid :]

    @cached_property
    def full_shapes(self) -> FloatArray:
        """(dofs, n) mass-normalised shapes of the elastic modes."""
        shapes = self.modes.shapes[:, self.modes.rigid :]
        return shapes if self.basis is None else self.basis @ shapes

    def displacement(self, places: FloatArray) -> FloatArray:
        """(n, p, 3) displacement of the middle surface in the elastic modes at (p, 3) places, m."""
        return self._moved(self.forward.specimen.model.displacement(places))

    def shapes_by(self, rows: scipy.sparse.csr_array) -> FloatArray:
        """(n, r) elastic modes by (r, dofs) rows of a model's."""
        # few rows: cheaper than shapes of all dofs
        seen = rows if self.basis is None else rows @ self.basis
        return np.asarray((seen @ self.modes.shapes[:, self.modes.rigid :]).T)

    @cached_property
    def slopes(self) -> FloatArray:
        """(n, p, 3) change of the elastic modes' shapes per metre that the measured points move
        along x, y and z.
        """
        slopes = self.shapes_by(self.forward.slopes)
        return slopes.reshape(len(slopes), -1, 3)

    def _moved(self, rows: scipy.sparse.csr_array) -> FloatArray:
        """(n, p, 3) of the rows that `Model.displacement` gives for p places."""
        moved = self.shapes_by(rows)
        return moved.reshape(len(moved), -1, 3)

    def participation(self, motions: FloatArray) -> FloatArray:
        """(m, n) rᵀMφ of (dofs, m) motions and the elastic modes."""
        mass = self.forward.specimen.model.mass.at(self.coefficients.mass)
        return np.asarray((mass @ motions).T @ self.full_shapes)

    @cached_property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of the elastic modes: bending, torsion, in-plane."""
        return largest(self.motion)

    @cached_property
    def motion(self) -> dict[str, FloatArray]:
        """(n,) shares of the elastic modes' motion, by kind."""
        return motion_shares(self.forward.specimen.model, self.full_shapes)

    @cached_property
    def energy(self) -> dict[str, FloatArray]:
        """(n,) shares of the elastic modes' strain energy, by set and spring."""
        energies = self._energies[self.modes.rigid :] * self.coefficients.stiffness
        return energy_shares(self.forward.specimen.model, energies)

    @property
    def shear(self) -> FloatArray:
        """(n,) shares of the elastic modes' strain energy in transverse shear of shells."""
        energies = self._energies[self.modes.rigid :] * self.coefficients.stiffness
        names = self.forward.specimen.model.stiffness.names
        across = [
            k for k, name in enumerate(names) if name.rpartition(".")[2] in ("S44", "S45", "S55")
        ]
        return np.asarray(
            energies[:, across].sum(axis=1) / self.modes.eigenvalue[self.modes.rigid :]
        )

    def shares(self, mode: int) -> dict[str, dict[str, float]]:
        """`motion` and `energy` of an elastic mode, to 1e-4."""
        both = {"motion": self.motion, "energy": self.energy}
        return {
            name: {each: round(float(of[mode]), 4) for each, of in of_kind.items()}
            for name, of_kind in both.items()
        }

    @cached_property
    def by_mesh(self) -> tuple[FloatArray, FloatArray, FloatArray] | None:
        """What meshes do to the elastic frequencies, as `MeshError.moved`; None where the mesh is
        taken on trust.
        """
        error, c = self.forward.mesh_error, self.coefficients
        value = self.modes.eigenvalue[self.modes.rigid :]
        return None if error is None else error.moved(self.full_shapes, value, c.stiffness, c.mass)

    @cached_property
    def hidden(self) -> tuple[int, ...]:
        """Elastic modes that no measured row sees: their points move across the measured
        directions.
        """
        forward = self.forward
        if not forward.dofs or len({0, 1, 2} & set(forward.specimen.model.dofs)) == 1:
            return ()
        all_of_it = np.sum(self._moved(forward.whole_motion) ** 2, axis=(1, 2))
        return tuple(np.flatnonzero(np.sum(self.shapes**2, axis=1) < _UNSEEN * all_of_it).tolist())

    # --- strain energy

    @cached_property
    def _energies(self) -> FloatArray:
        """(m, k) energies φᵀK_kφ of all modes."""
        phi = self.modes.shapes
        return np.stack([np.sum(phi * (term @ phi), axis=0) for term in self.stiffness], axis=1)

    @property
    def _moving(self) -> tuple[BoolArray, FloatArray]:
        """(m,) which of all modes are elastic, and (m,) their eigenvalues, 1 for the others."""
        moving: BoolArray = np.arange(self.modes.eigenvalue.size) >= self.modes.rigid
        return moving, np.where(moving, self.modes.eigenvalue, 1.0)

    @cached_property
    def on_springs(self) -> BoolArray:
        """(n,) elastic modes that are motions of a nearly rigid body: most of their strain energy
        is in the springs.
        """
        count, elastic = len(self.forward.specimen.springs), slice(self.modes.rigid, None)
        first = len(self.stiffness) - count
        energy = self._energies[elastic, first:] @ self.coefficients.stiffness[first:]
        share: BoolArray = energy > self.modes.eigenvalue[elastic] / 2  # mass-normalised: φᵀKφ = λ
        return share

    @cached_property
    def strain(self) -> FloatArray:
        """(m, q) shares of the strain energy of all modes by mechanism (`fecore.body.mechanisms`);
        0 of rigid-body modes.
        """
        energies, (moving, value) = self._energies @ self._mechanisms(self.theta).T, self._moving
        shares: FloatArray = np.where(moving[:, None], energies / value[:, None], 0.0)
        return shares

    @property
    def energy_forms(self) -> FloatArray:
        """(q, m, m) φ_jᵀK_qφ_k of all modes by mechanism."""
        return mode_forms(self.modes, self.stiffness, self._mechanisms(self.theta).T)

    @cached_property
    def strain_jacobian(self) -> FloatArray:
        """(p, m, q) derivative of the shares by the parameters."""
        weights, phi = self._mechanisms(self.theta), self.modes.shapes
        forces, (moving, value) = [term @ phi for term in self.stiffness], self._moving
        derivative = np.zeros((self.theta.size, *self.strain.shape))
        for p, change in enumerate(self.shape_derivatives):
            moved = np.stack([2 * np.sum(change * force, axis=0) for force in forces], axis=1)
            step = np.zeros_like(self.theta)
            step[p] = _SHARE_STEP * max(abs(self.theta[p]), _SHARE_STEP)
            by = (self._mechanisms(self.theta + step) - self._mechanisms(self.theta - step)) / (
                2 * step[p]
            )
            energy = (moved @ weights.T + self._energies @ by.T) / value[:, None]
            fall = self.strain * (self.eigenvalue_jacobian[:, p] / value)[:, None]
            derivative[p] = np.where(moving[:, None], energy - fall, 0.0)
        return derivative

    def _mechanisms(self, theta: FloatArray) -> FloatArray:
        """(q, k) parts of the stiffness coefficients by mechanism at parameters θ."""
        prior = self.forward.parametrisation
        return mechanism_weights(prior.body, *prior.split(prior.constants(theta)))

    # --- derivatives

    @cached_property
    def eigenvalue_jacobian(self) -> FloatArray:
        """(m, p) ∂λ/∂θ = φᵀ(∂K/∂θ - λ ∂M/∂θ)φ of all modes; 0 for rigid ones."""
        by: FloatArray = np.einsum("pkk->kp", self.eigenvalue_matrix)
        return by

    @cached_property
    def eigenvalue_matrix(self) -> FloatArray:
        """(p, m, m) derivatives of the eigenvalues; off the diagonal inside repeated roots only
        (`sensitivity`).
        """
        c = self.coefficients
        stiffness = mode_forms(self.modes, self.stiffness, c.stiffness_by)
        return eigenvalue_derivatives(
            self.modes, stiffness, mode_forms(self.modes, self.mass, c.mass_by)
        )

    @property
    def frequency_jacobian(self) -> FloatArray:
        """(n, p) ∂f/∂θ of the elastic modes, Hz per SI unit, f = √λ / 2π."""
        gradient: FloatArray = self.eigenvalue_jacobian[self.modes.rigid :] / (
            8 * np.pi**2 * self.frequency_hz[:, None]
        )
        return gradient

    @cached_property
    def shape_jacobian(self) -> FloatArray:
        """(p, m, points) derivative of all shapes at the measured points."""
        jacobian: FloatArray = np.array(
            [(self.observation @ each).T for each in self.shape_derivatives]
        )
        return jacobian

    @cached_property
    def shape_derivatives(self) -> FloatArray:
        """(p, dofs, m) derivative of all shapes, over the dofs or over the basis."""
        c = self.coefficients
        return mode_shape_derivatives(
            _weighted(self.stiffness, c.stiffness),
            _weighted(self.mass, c.mass),
            self.modes,
            [_weighted(self.stiffness, weights) for weights in c.stiffness_by.T],
            [_weighted(self.mass, weights) for weights in c.mass_by.T],
        )

    # --- FRFs

    def frf_model(
        self, responses: Sequence[Dof], references: Sequence[Dof], *, with_strain: bool = True
    ) -> ModalFrfModel:
        """Synthesis of the FRFs between some dofs, with residual terms for the truncated modes.

        The shares of strain energy may be left out where no law looks at them.
        """
        pairs, drive = self._pairs(responses, references), None
        loaded = [pairs.reference]
        if self.forward.roving_mass:  # the driving points too
            drive = self._pairs(responses, responses)
            loaded.append(drive.reference)
        state = self.forward.holding(self, np.concatenate(loaded))
        roving = None
        if drive is not None:
            roving = RovingMass(
                self.forward.roving_mass, drive.products(state.all_shapes), state.residual(drive)
            )
        return ModalFrfModel(
            eigenvalue=state.modes.eigenvalue,
            residues=pairs.products(state.all_shapes),
            residual=state.residual(pairs),
            shift=state.modes.shift,
            roving=roving,
            strain=state.strain if with_strain else None,
        )

    def residue_jacobian(self, responses: Sequence[Dof], references: Sequence[Dof]) -> FloatArray:
        """(p, N, m) derivative of the residues of `frf_model` by the parameters."""
        pairs, shapes, by = self._pairs(responses, references), self.all_shapes, self.shape_jacobian
        product = by[:, :, pairs.response] * shapes[:, pairs.reference]
        product = product + shapes[:, pairs.response] * by[:, :, pairs.reference]
        signed: FloatArray = pairs.sign[:, None] * product.transpose(0, 2, 1)
        return signed

    def residual(self, pairs: PointPairs) -> FloatArray:
        """(N, t) residual terms of the FRFs between pairs of points."""
        mass = _weighted(self.mass, self.coefficients.mass)
        return pairs.residual(self.modes, mass, self.observation)

    def _pairs(self, responses: Sequence[Dof], references: Sequence[Dof]) -> PointPairs:
        (response, sign), (reference, other) = (
            self.forward.rows(responses),
            self.forward.rows(references),
        )
        if np.unique(response).size < np.unique(reference).size:  # H is symmetric (Maxwell, Betti)
            response, reference = reference, response
        return PointPairs(response, reference, sign * other)


def _weighted(terms: Sequence[Matrix], weights: FloatArray) -> Matrix:
    """Σ weight · matrix."""
    total = terms[0] * weights[0]
    for weight, matrix in zip(weights[1:], terms[1:], strict=True):
        if weight:
            total = total + weight * matrix
    return total


@dataclass(frozen=True)
class PointPairs:
    """Point numbers of N FRFs and the product of their directions' signs, the side with fewer
    points as reference.
    """

    response: IntArray
    reference: IntArray
    sign: FloatArray

    def products(self, shapes: FloatArray) -> FloatArray:
        """(N, m) residues of (m, points) shapes."""
        residues: FloatArray = (
            self.sign[:, None] * (shapes[:, self.response] * shapes[:, self.reference]).T
        )
        return residues

    def residual(
        self, modes: NormalModes, mass: Matrix, observation: FloatArray | scipy.sparse.csr_array
    ) -> FloatArray:
        """(N, t) terms of the truncated modes' series in ω² - σ: solves with the factor of K - σM.

        Args:
            modes: that are summed.
            mass: M.
            observation: (points, dofs) displacements of the points.
        """
        used, column = np.unique(self.reference, return_inverse=True)
        load = observation[used].T
        load = load if isinstance(load, np.ndarray) else load.toarray()
        series = residual_series(modes, mass, load, RESIDUAL_TERMS)
        seen = np.array([(observation @ each)[self.response, column] for each in series]).T
        return np.asarray(seen * self.sign[:, None])
