"""The forward model as updating sees it: parameters in, modes at the measured points and their derivatives out.

Modes come from a reduced basis (`fecore.dynamics.reduction`) that checks itself and grows where it must, or from the full
model. Either way a state offers the same: its system is a pair of matrices, over the dofs or over the basis, and all
derivatives are exact ones of that system (`fecore.dynamics.sensitivity`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy

from fecore.arrays import BoolArray, FloatArray, IntArray
from fecore.body.mechanisms import mechanism_weights
from fecore.body.model import ModeKind, deflection_at
from fecore.body.specimen import Body
from fecore.dynamics.eigen import modes_below, normal_modes
from fecore.dynamics.reduction import ReducedModel
from fecore.dynamics.sensitivity import static_series
from fecore.dynamics.synthesis import RESIDUAL_TERMS, ModalFrfModel, RovingMass
from fecore.errors import InputError
from fecore.frf import Dof
from fecore.updating.parameters import Parametrisation
from fecore.updating.solution import Solution, Terms

OUT_OF_PLANE = 3
"""Direction code of z, which a bending model predicts."""

EXTRA_MODES = 3
"""Modes beyond the measured ones, at least, so that neighbours can be paired."""

_SHARE_STEP = 1e-5  # relative, of differences of the parts of the section's coefficients, which are nearly linear


@dataclass(frozen=True)
class ForwardModel:
    """A specimen's modes at measured points, for any parameters.

    Attributes:
        specimen: nominal specimen.
        parametrisation: from θ to coefficients.
        points: labels of the p measured points.
        places: (p, 2) their coordinates on the specimen, m.
        count: how many modes to solve for.
        reduced: solve on a reduced basis (frequencies within 1e-6 of the full model), or the full model each time.
        roving_mass: of a sensor that sits at the response point of each FRF, kg. The modes are those without it.
        verified: check the reduced basis and let it grow; without, far from where it was made it is some per cent off.
    """

    specimen: Body
    parametrisation: Parametrisation
    points: tuple[int, ...]
    places: FloatArray
    count: int
    reduced: bool = True
    roving_mass: float = 0.0
    verified: bool = True

    @cached_property
    def observation(self) -> scipy.sparse.csr_array:
        """(p, dofs) interpolation of the deflection w at the points."""
        return deflection_at(self.specimen.model, self.points, self.places)

    @cached_property
    def basis(self) -> ReducedModel:
        """The reduced basis about the prior means; it grows as it is used."""
        prior = self.parametrisation
        start = prior.coefficients(prior.prior_mean)
        reach = np.minimum(prior.prior_sd, np.where(prior.signed, 0.5, np.abs(prior.prior_mean) / 2))
        changes = start.stiffness_by * reach, start.mass_by * reach
        return ReducedModel(self.specimen.model, start.stiffness, start.mass, self.count, changes=changes)

    def unverified(self) -> ForwardModel:
        """The same on the basis as it is now, for a search that is verified afterwards."""
        loose = replace(self, verified=False)
        if self.reduced:  # the cached properties: the basis, and what it holds
            loose.__dict__.update(basis=self.basis, _covered=self._covered)
        return loose

    def on_basis(self) -> ForwardModel:
        """The same on a reduced basis; itself where it has one."""
        return self if self.reduced else replace(self, reduced=True)

    @cached_property
    def _covered(self) -> set[int]:
        """Rows of the points whose static deflections the basis holds."""
        return set()

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
        model, c = self.specimen.model, self.parametrisation.coefficients(theta)
        if self.reduced:
            reduced = self.basis.system
            if self.verified:
                modes = self.basis.modes(c.stiffness, c.mass)
                reduced = self.basis.system  # as it has grown
            else:
                modes = reduced.modes(c.stiffness, c.mass, self.count)
            terms = Terms(list(reduced.stiffness), list(reduced.mass))
            return ForwardState(c, modes, terms, reduced.basis, self, theta)
        mass, stiffness = model.mass.at(c.mass), model.stiffness.at(c.stiffness)
        modes = normal_modes(stiffness, mass, self.count, model.rigid_modes)
        full = Terms(
            [model.stiffness.term(k) for k in range(len(c.stiffness))], [model.mass.term(j) for j in range(len(c.mass))]
        )
        return ForwardState(c, modes, full, None, self, theta)

    def frequencies_at(self, parametrisation: Parametrisation, theta: FloatArray) -> FloatArray:
        """(n,) elastic natural frequencies, Hz, where another parametrisation of the same mesh gives the coefficients.

        The full model gives them: what is asked for once is not worth a larger basis.
        """
        modes = replace(self, parametrisation=parametrisation, reduced=False).solve(theta).modes
        return modes.frequency_hz[modes.rigid :]

    def holding(self, state: ForwardState, rows: IntArray) -> ForwardState:
        """The same state on a basis that holds the static deflections under forces at the given points."""
        missing = sorted(set(rows.tolist()) - self._covered)
        if state.basis is not None and missing:
            loads = self.observation[missing].T.toarray()
            self.basis.cover(loads, state.coefficients.stiffness, state.coefficients.mass)
            self._covered.update(missing)
        if state.basis is None or state.basis is self.basis.system.basis:
            return state
        return self.solve(state.theta)


@dataclass(frozen=True)
class ForwardState(Solution):
    """The solved model at one θ. Mode indices count the elastic modes only, unless a name says `all`.

    Attributes:
        forward: the model.
        theta: (p,) parameters.
    """

    forward: ForwardModel
    theta: FloatArray

    @property
    def frequency_hz(self) -> FloatArray:
        """(n,) natural frequencies of the elastic modes, Hz."""
        return self.modes.frequency_hz[self.modes.rigid :]

    @property
    def constants(self) -> FloatArray:
        """(c + s,) constants and springs, SI."""
        return self.forward.parametrisation.constants(self.theta)

    @cached_property
    def full_shapes(self) -> FloatArray:
        """(dofs, n) mass-normalised shapes of the elastic modes."""
        shapes = self.modes.shapes[:, self.modes.rigid :]
        return shapes if self.basis is None else self.basis @ shapes

    def deflection(self, places: FloatArray) -> FloatArray:
        """(n, p) deflection w of the elastic modes at (p, 2) places, m."""
        observed = self.forward.specimen.model.deflection(places)
        return np.asarray((observed @ self.full_shapes).T)

    def participation(self, motions: FloatArray) -> FloatArray:
        """(m, n) rᵀMφ of (dofs, m) motions and the elastic modes."""
        mass = self.forward.specimen.model.mass.at(self.coefficients.mass)
        return np.asarray((mass @ motions).T @ self.full_shapes)

    @cached_property
    def kinds(self) -> tuple[ModeKind, ...]:
        """Kinds of the elastic modes: bending, torsion, in-plane."""
        return self.forward.specimen.model.kinds(self.full_shapes)

    @cached_property
    def hidden(self) -> tuple[int, ...]:
        """Elastic modes that move in the plane, which nothing measured out of plane shows."""
        if not self.forward.specimen.model.has_membrane:
            return ()
        return tuple(number for number, kind in enumerate(self.kinds) if kind == "in-plane")

    @cached_property
    def on_springs(self) -> BoolArray:
        """(n,) elastic modes that are motions of a nearly rigid body: most of their strain energy is in the springs."""
        modes, count = self.modes, len(self.forward.specimen.springs)
        shapes = modes.shapes[:, modes.rigid :]
        energy = np.zeros(shapes.shape[1])
        for spring in range(-count, 0):
            force = self.terms.stiffness[spring] @ shapes
            energy += self.coefficients.stiffness[spring] * np.sum(shapes * force, axis=0)
        share: BoolArray = energy > modes.eigenvalue[modes.rigid :] / 2  # mass-normalised: φᵀKφ = λ
        return share

    @cached_property
    def strain(self) -> FloatArray:
        """(m, q) shares of the strain energy of all modes by mechanism (`fecore.body.mechanisms`); 0 of rigid-body modes."""
        energies = self.energies @ self._mechanisms(self.theta).T
        value, moving = self.modes.eigenvalue, np.arange(self.modes.eigenvalue.size) >= self.modes.rigid
        shares: FloatArray = np.where(moving[:, None], energies / np.where(moving, value, 1.0)[:, None], 0.0)
        return shares

    @cached_property
    def strain_jacobian(self) -> FloatArray:
        """(p, m, q) derivative of the shares by the parameters."""
        weights, phi = self._mechanisms(self.theta), self.modes.shapes
        forces = [term @ phi for term in self.terms.stiffness]
        moving = np.arange(self.modes.eigenvalue.size) >= self.modes.rigid
        value = np.where(moving, self.modes.eigenvalue, 1.0)
        found = np.zeros((self.theta.size, *self.strain.shape))
        for p, change in enumerate(self.shape_derivatives):
            moved = np.stack([2 * np.sum(change * force, axis=0) for force in forces], axis=1)
            step = np.zeros_like(self.theta)
            step[p] = _SHARE_STEP * max(abs(self.theta[p]), _SHARE_STEP)
            by = (self._mechanisms(self.theta + step) - self._mechanisms(self.theta - step)) / (2 * step[p])
            energy = (moved @ weights.T + self.energies @ by.T) / value[:, None]
            fall = self.strain * (self.eigenvalue_jacobian[:, p] / value)[:, None]
            found[p] = np.where(moving[:, None], energy - fall, 0.0)
        return found

    def _mechanisms(self, theta: FloatArray) -> FloatArray:
        """(q, k) parts of the stiffness coefficients by mechanism at parameters θ."""
        prior = self.forward.parametrisation
        return mechanism_weights(prior.body, *prior.split(prior.constants(theta)))

    @property
    def shapes(self) -> FloatArray:
        """(n, p) mass-normalised shapes of the elastic modes at the measured points."""
        return self.all_shapes[self.modes.rigid :]

    @cached_property
    def observation(self) -> FloatArray | scipy.sparse.csr_array:
        """From the system's unknowns, dofs or basis, to the deflections of the measured points."""
        observation = self.forward.observation
        return observation if self.basis is None else observation @ self.basis

    @property
    def frequency_jacobian(self) -> FloatArray:
        """(n, p) ∂f/∂θ of the elastic modes, Hz per SI unit, f = √λ / 2π."""
        gradient: FloatArray = self.eigenvalue_jacobian[self.modes.rigid :] / (
            8 * np.pi**2 * self.frequency_hz[:, None]
        )
        return gradient

    def frf_model(
        self, responses: Sequence[Dof], references: Sequence[Dof], *, with_strain: bool = True
    ) -> ModalFrfModel:
        """Synthesis of the FRFs between some dofs, with residual terms for the truncated modes.

        The shares of strain energy may be left out where no law looks at them.
        """
        state, pairs, drive = self._ready(responses, references)
        roving = None
        if drive is not None:
            roving = RovingMass(self.forward.roving_mass, drive.products(state.all_shapes), drive.residual(state))
        return ModalFrfModel(
            eigenvalue=state.modes.eigenvalue,
            residues=pairs.products(state.all_shapes),
            residual=pairs.residual(state),
            shift=state.modes.shift,
            roving=roving,
            strain=state.strain if with_strain else None,
        )

    def _ready(
        self, responses: Sequence[Dof], references: Sequence[Dof]
    ) -> tuple[ForwardState, PointPairs, PointPairs | None]:
        """The points of the FRFs, and the driving points where a sensor roves, with a basis that holds what they need."""
        pairs, drive = self._pairs(responses, references), None
        rows = pairs.reference
        if self.forward.roving_mass:
            drive = self._pairs(responses, responses)
            rows = np.concatenate([rows, drive.reference])
        return self.forward.holding(self, rows), pairs, drive

    def _pairs(self, responses: Sequence[Dof], references: Sequence[Dof]) -> PointPairs:
        return PointPairs.of(*self.forward.rows(responses), *self.forward.rows(references))

    def residue_jacobian(self, responses: Sequence[Dof], references: Sequence[Dof]) -> FloatArray:
        """(p, N, m) derivative of the residues of `frf_model` by the parameters."""
        return self._pairs(responses, references).product_derivatives(self.all_shapes, self.shape_jacobian)


def modes_to_cover(parametrisation: Parametrisation, highest_hz: float, at_least: int) -> int:
    """How many modes to solve for: those below twice a frequency at the prior means, and at least so many elastic ones.

    The factor is the margin for constants that come out lower, and for the residual series.
    """
    model, c = parametrisation.body.model, parametrisation.coefficients(parametrisation.prior_mean)
    below = modes_below(model.stiffness.at(c.stiffness), model.mass.at(c.mass), (2 * np.pi * 2 * highest_hz) ** 2)
    return max(below, at_least + int(model.rigid_modes.shape[1]))


@dataclass(frozen=True)
class PointPairs:
    """Point numbers of N FRFs and the product of their directions' signs, the side with fewer points as reference."""

    response: IntArray
    reference: IntArray
    sign: FloatArray

    @classmethod
    def of(
        cls, response: IntArray, response_sign: FloatArray, reference: IntArray, reference_sign: FloatArray
    ) -> PointPairs:
        """The pairs of some FRFs between (N,) points with (N,) signs of their directions."""
        if np.unique(response).size < np.unique(reference).size:  # H is symmetric (Maxwell, Betti)
            response, reference = reference, response
        return cls(response, reference, response_sign * reference_sign)

    def products(self, shapes: FloatArray) -> FloatArray:
        """(N, m) residues of (m, points) shapes."""
        residues: FloatArray = self.sign[:, None] * (shapes[:, self.response] * shapes[:, self.reference]).T
        return residues

    def product_derivatives(self, shapes: FloatArray, by: FloatArray) -> FloatArray:
        """(p, N, m) derivatives of the residues, from those of the shapes."""
        product = (
            by[:, :, self.response] * shapes[:, self.reference] + shapes[:, self.response] * by[:, :, self.reference]
        )
        signed: FloatArray = self.sign[:, None] * product.transpose(0, 2, 1)
        return signed

    def residual(self, state: Solution) -> FloatArray:
        """(N, t) terms of the truncated modes' series in ω² - σ: solves with the factor of K - σM."""
        used, column = np.unique(self.reference, return_inverse=True)
        load = state.observation[used].T
        load = load if isinstance(load, np.ndarray) else load.toarray()
        mass = state.terms.sum("mass", state.coefficients.mass)
        series = static_series(state.modes, mass, load, RESIDUAL_TERMS)
        seen = np.array([(state.observation @ each)[self.response, column] for each in series]).T
        away = 1 / (state.modes.eigenvalue - state.modes.shift)
        # What a residue counts for in each term of the series: 1 / (λ - σ)ᵗ.
        powers = away[:, None] ** np.arange(1, RESIDUAL_TERMS + 1)
        residual: FloatArray = seen * self.sign[:, None] - self.products(state.all_shapes) @ powers
        return residual
