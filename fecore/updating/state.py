"""A model solved at one θ, and how far measured shapes may be off its own.

A model solved at one θ: its modes at the measured points, their FRFs, and exact derivatives by
the parameters.

The system is a pair of matrices, over the dofs or over a reduced basis; either way a state offers
the same, and all derivatives are exact ones of that system (`fecore.dynamics.sensitivity`).

How far measured mode shapes may be from the model's: scatter at the points, and other modes that
are mixed in.

A measured shape ψ_k, scaled to a largest entry of 1, is

    ψ_k = a φ_k + Σ_j≠k m_j a φ_j + e,    m_j ~ N(0, h²/((λ_j - λ_k)² + h²)),    h² = 2 s² λ_j λ_k,    e ~ N(0, v),

with the model's shapes φ, eigenvalues λ, and s the discrepancy of a frequency: a stiffness that
misses λ by 2 s λ on the diagonal has entries of half that variance off it (Mehta, Random Matrices,
3rd ed., 2), which turn the shapes into one another, two close ones without resistance. The variance
v of the scatter is estimated for each mode, with a scaled inverse χ² of two degrees of freedom
about 1 % as its prior, so that a shape which the model does not have says less.

How far two close modes may be mixed, and what that does to their shares of strain energy.

Where two modes veer, what the model misses by a per mille turns their shapes into each other. With
a perturbation δ of K - λM and h = φ_jᵀδφ_k the modes of the body are the model's, turned by the
angle α of

    sin 2α = 2h/(λ_k - λ_j),     h ~ N(0, σ_h²),     |α| < 45°, beyond which they would be paired the other way,

with the measured eigenvalues, and they share their energies U_jk = φ_jᵀK_mφ_k/√(λ_jλ_k) in every
mechanism m:

    U_j' = U_jj cos² α + U_kk sin² α + U_jk sin 2α,     U_k' = U_jj sin² α + U_kk cos² α - U_jk sin 2α.

σ_h has two parts: what the constants' posterior leaves open, gᵀCg with g = φ_jᵀ(∂K - λ∂M)φ_k, and
the model's discrepancy s of a frequency, √2 s λ: the entries off the diagonal of a symmetric random
matrix have half the variance of those on it (Mehta, Random Matrices, 3rd ed., 2). Measured shapes ψ
say more: their mean square off the turned ones is that of a model's shape, 1 % of the largest
entry, and counts once a mode, as its errors at the points are not independent.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy

from fecore.arrays import BoolArray, FloatArray, IntArray
from fecore.body.kinds import energy_shares, largest, motion_shares
from fecore.body.mechanisms import mechanism_weights
from fecore.correlation import Pairing
from fecore.dynamics.eigen import NormalModes
from fecore.dynamics.sensitivity import eigenvalue_derivatives, mode_forms, mode_shape_derivatives
from fecore.dynamics.synthesis import (
    RESIDUAL_TERMS,
    Matrix,
    ModalFrfModel,
    RovingMass,
    residual_series,
)
from fecore.frf import Dof
from fecore.modal import turn_real
from fecore.modes import MeasuredModes
from fecore.updating.parameters import Coefficients
from fecore.updating.posterior import DISCREPANCY_DOF, SHAPE_DISCREPANCY

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

    @property
    def every_shape(self) -> FloatArray:
        """(dofs, m) mass-normalised shapes of all modes, rigid ones too."""
        return self.modes.shapes if self.basis is None else self.basis @ self.modes.shapes

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

    def fractions(self, mode: int) -> dict[str, dict[str, float]]:
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
        fractions: FloatArray = np.where(moving[:, None], energies / value[:, None], 0.0)
        return fractions

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


_REACH = np.log([0.01, 100.0])  # of the scatter about its prior scale
_SAME = 0.01  # relative change of a scatter that changes nothing


@dataclass(frozen=True)
class ShapeErrors:
    """Of the measured modes of one campaign that have a partner, by their rows."""

    # √v, as a share of the shape's largest entry
    scatter: Mapping[int, float] = field(default_factory=dict)
    # (p, p) W with WᵀW the inverse of the covariance of the errors at the points
    whitening: Mapping[int, FloatArray] = field(default_factory=dict)

    @classmethod
    def of(
        cls, modes: MeasuredModes, state: ForwardState, pairing: Pairing, discrepancy: float
    ) -> ShapeErrors:
        """The errors at a solved model.

        Args:
            modes: the measured modes, with shapes at the first of the model's points.
            state: the solved model.
            pairing: measured modes with the model's.
            discrepancy: s, relative standard deviation of a frequency of the model.
        """
        scatter, whitening = dict[int, float](), dict[int, FloatArray]()
        value, shapes = (2 * np.pi * state.frequency_hz) ** 2, state.shapes[:, : len(modes.dofs)]
        for row, column in pairing.pairs:
            measured, model = real_shape(modes, row), shapes[column]
            size = float(measured @ model / (model @ model))
            coupling = 2 * discrepancy**2 * value * value[column]
            share = coupling / ((value - value[column]) ** 2 + coupling)
            share[column] = 0.0
            axes, singular, _ = np.linalg.svd(
                (size * np.sqrt(share)[:, None] * shapes).T, full_matrices=False
            )
            scatter[row] = _scatter(measured - size * model, axes, singular**2)
            relief = 1 - scatter[row] / np.hypot(scatter[row], singular)
            whitening[row] = (np.eye(len(model)) - (axes * relief) @ axes.T) / scatter[row]
        return cls(scatter, whitening)

    def are_those_of(self, other: ShapeErrors) -> bool:
        """Whether they differ by no more than what changes nothing."""
        pairs = [(self.scatter[row], other.scatter.get(row, np.inf)) for row in self.scatter]
        return len(self.scatter) == len(other.scatter) and all(
            abs(a - b) <= _SAME * a for a, b in pairs
        )

    def residual(
        self, modes: MeasuredModes, state: ForwardState, pairing: Pairing, root_weight: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Measured less model shapes, each at its best scale, in standard deviations, and -∂/∂θ of
        them.

        Args:
            modes: the measured modes.
            state: the solved model.
            pairing: measured modes with the model's.
            root_weight: (n,) root of the weight of each pair.

        Returns:
            (n p,) and (n p, parameters).
        """
        residuals, jacobians, points = [], [], len(modes.dofs)
        for (row, column), root in zip(pairing.pairs, root_weight, strict=True):
            whitening = self.whitening.get(row, np.eye(points) / SHAPE_DISCREPANCY)
            measured = whitening @ real_shape(modes, row)
            model = whitening @ state.shapes[column, :points]
            by = state.shape_jacobian[:, state.modes.rigid + column, :points] @ whitening.T
            scale = measured @ model / (model @ model)
            # the best scale takes what lies along
            across = by - np.outer(by @ model, model) / (model @ model)
            residuals.append(root * (measured - scale * model))
            jacobians.append(root * scale * across.T)
        return np.concatenate(residuals), np.vstack(jacobians)


def real_shape(modes: MeasuredModes, row: int) -> FloatArray:
    """(p,) a measured shape turned to be as real as it can be, its largest entry ±1."""
    assert modes.shapes is not None, "it was looked for"
    shape = turn_real(modes.shapes[row]).real
    return np.asarray(shape / np.abs(shape).max())


def _scatter(off: FloatArray, axes: FloatArray, variance: FloatArray) -> float:
    """√v, most probable for (p,) differences of shapes that also scatter by (q,) variances along
    (p, q) axes.
    """
    along = (axes.T @ off) ** 2
    across, rest = max(float(off @ off - along.sum()), 0.0), len(off) - 1 - len(along)
    prior = DISCREPANCY_DOF * SHAPE_DISCREPANCY**2

    def cost(log_scatter: float) -> float:
        v = SHAPE_DISCREPANCY**2 * np.exp(2 * log_scatter)
        known = np.sum(np.log(v + variance) + along / (v + variance))
        return float(known + (max(rest, 0) + DISCREPANCY_DOF) * np.log(v) + (across + prior) / v)

    return float(
        SHAPE_DISCREPANCY
        * np.exp(scipy.optimize.minimize_scalar(cost, bounds=_REACH, method="bounded").x)
    )


_SINES = np.linspace(-1, 1, 41)  # of 2α


@dataclass(frozen=True)
class Mixing:
    """Two modes that may be mixed."""

    rows: tuple[int, ...]  # of the measured modes, one or both
    change: FloatArray  # (a, rows, q) changes of their shares of strain energy, by angle
    cost: FloatArray  # (a,) of each angle: -2 ln p, 0 of the model's own shapes


def mixings(
    state: ForwardState,
    columns: Sequence[int],
    hz: FloatArray,
    shapes: FloatArray | None,
    discrepancy: float,
    covariance: FloatArray,
) -> tuple[Mixing, ...]:
    """The pairs of modes that may be mixed by more than the angles' grid resolves.

    Args:
        state: the updated model.
        columns: (n,) elastic modes that were measured.
        hz: (n,) their measured frequencies, Hz.
        shapes: (n, points) their realised measured shapes, at the first of the model's points.
        discrepancy: relative standard deviation of a frequency of the model.
        covariance: (p, p) posterior covariance of θ.
    """
    rigid, c = state.modes.rigid, state.coefficients
    value = (2 * np.pi * state.frequency_hz) ** 2
    measured = value.copy()
    measured[list(columns)] = (2 * np.pi * hz) ** 2
    stiffness = mode_forms(state.modes, state.stiffness, c.stiffness_by)
    mass = mode_forms(state.modes, state.mass, c.mass_by)
    mean = (measured[:, None] + measured) / 2
    by = stiffness[:, rigid:, rigid:] - mean * mass[:, rigid:, rigid:]
    sd = np.sqrt(np.einsum("pjk,pq,qjk->jk", by, covariance, by) + 2 * (discrepancy * mean) ** 2)
    with np.errstate(divide="ignore"):
        spread = 2 * sd / np.abs(measured[:, None] - measured)
    energy = state.energy_forms[:, rigid:, rigid:] / np.sqrt(value[:, None] * value)
    pairs = []
    for number, j in enumerate(columns):
        for k in range(value.size):
            if spread[j, k] > _SINES[1] - _SINES[0] and (k > j or (k < j and k not in columns)):
                rows = (number, columns.index(k)) if k in columns else (number,)
                cost = (_SINES / spread[j, k]) ** 2
                if shapes is not None:
                    cost = cost + _off(state.shapes[[j, k], : shapes.shape[1]], shapes[list(rows)])
                pairs.append(Mixing(rows, _change(energy, j, k)[:, : len(rows)], cost - cost.min()))
    return tuple(pairs)


def _change(energy: FloatArray, j: int, k: int) -> FloatArray:
    """(a, 2, q) changes of the shares of two modes, by angle."""
    sine = _SINES[:, None]
    moved = (1 - np.sqrt(1 - sine**2)) / 2 * (energy[:, k, k] - energy[:, j, j]) + sine * energy[
        :, j, k
    ]
    return np.stack([moved, -moved], axis=1)


def _off(pair: FloatArray, measured: FloatArray) -> FloatArray:
    """(a,) -2 ln p of one or both of (2, points) shapes, as they were measured, by the angle that
    turns them.
    """
    cosine, sine = np.cos(np.arcsin(_SINES) / 2), np.sin(np.arcsin(_SINES) / 2)
    turned = np.array([[cosine, sine], [-sine, cosine]]).transpose(2, 0, 1) @ pair
    turned = turned[:, : len(measured)]
    unit = measured / np.abs(measured).max(axis=1, keepdims=True)
    along = np.sum(turned * unit, axis=2) ** 2 / np.sum(turned**2, axis=2)
    return np.asarray(
        np.sum(np.sum(unit**2, axis=1) - along, axis=1) / measured.shape[1] / SHAPE_DISCREPANCY**2
    )
