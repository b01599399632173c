"""The forward model as updating sees it: parameters in, modes at the measured points and their
derivatives out.

Modes come from a reduced basis (`fecore.dynamics.reduction`) that checks itself and grows where it
must, or from the full model; `state` has what a solved model offers.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import numpy as np
import scipy

from fecore.arrays import FloatArray, IntArray
from fecore.body.constants import Body
from fecore.body.model import observed_at
from fecore.dynamics.bodies import body_modes
from fecore.dynamics.eigen import NormalModes, modes_below
from fecore.dynamics.reduction import FREQUENCY_TOLERANCE, ReducedModel, ReducedSystem
from fecore.errors import InputError
from fecore.frf import Dof
from fecore.updating.mesh_error import Finer, MeshError
from fecore.updating.parameters import Coefficients, Parametrisation
from fecore.updating.state import ForwardState

__all__ = ["EXTRA_MODES", "ForwardModel", "ForwardState", "modes_to_cover"]

EXTRA_MODES = 3
"""Modes beyond the measured ones, at least, so that neighbours can be paired."""

_OF_MODEL_ERROR = 0.03  # share of the model's own error that a reduced basis may add to it
# times the highest frequency: modes up to there are solved for …
_COVERED, _COVERED_IN_SPACE = 2.0, 1.3
# … and a basis of a body in space, which has many modes, holds those up to here
_HELD_IN_SPACE = 1.05


@dataclass(frozen=True)
class ForwardModel:
    """A specimen's modes at measured points, for any parameters."""

    specimen: Body  # nominal specimen
    parametrisation: Parametrisation  # from θ to coefficients
    dofs: tuple[Dof, ...]  # the r measured rows: a point and a signed direction each
    places: FloatArray  # (r, 3) coordinates of their points, m; (r, 2) where z = 0
    count: int  # how many modes to solve for
    # solve on a reduced basis (frequencies within 1e-6 of the full model), or the full model each
    # time
    reduced: bool = True
    # of a sensor that sits at the response point of each FRF, kg. The modes are those without it.
    roving_mass: float = 0.0
    # check the reduced basis and let it grow; without, far from where it was made it is some per
    # cent off
    verified: bool = True
    # (3, 3) directions 1, 2 and 3 of points that have axes of their own, as rows
    axes: Mapping[int, FloatArray] = field(default_factory=dict)
    # up to where a reduced basis meets the full model's frequencies; beyond, modes count for their
    # tails
    held_hz: float = np.inf
    # (p,) parameters about which the error of the body's own mesh is known; None: the prior means
    about: FloatArray | None = None
    # the model that this one was made from: what they have in common is made once
    like: ForwardModel | None = None

    def __post_init__(self) -> None:
        if self.places.shape[1] == 2:
            object.__setattr__(
                self, "places", np.column_stack([self.places, np.zeros(len(self.places))])
            )

    @classmethod
    def of_dofs(
        cls,
        parametrisation: Parametrisation,
        dofs: Sequence[Dof],
        coordinates: Mapping[int, Sequence[float]],
        highest_hz: float,
        modes: int = 0,
        roving_mass: float = 0.0,
        axes: Mapping[int, FloatArray] | None = None,
    ) -> ForwardModel:
        """The model at some dofs, with the modes below twice a frequency and some more than are
        measured.

        Under a roving sensor a basis would have to hold the static deflections of every point: the
        full model is quicker.
        """
        places = np.array([[*coordinates[dof.point], 0.0][:3] for dof in dofs]).reshape(-1, 3)
        count = modes_to_cover(parametrisation, highest_hz, modes + EXTRA_MODES)
        # (what a mesh misses is taken out on a basis)
        reduced = not roving_mass or Finer.of(parametrisation.body) is not None
        return cls(
            parametrisation.body,
            parametrisation,
            tuple(dofs),
            places,
            count,
            reduced=reduced,
            roving_mass=roving_mass,
            axes=axes or {},
            held_hz=_HELD_IN_SPACE * highest_hz if _is_in_space(parametrisation) else np.inf,
        )

    @property
    def points(self) -> tuple[int, ...]:
        """Labels of the rows' points."""
        return tuple(dof.point for dof in self.dofs)

    @cached_property
    def observation(self) -> scipy.sparse.csr_array:
        """(r, dofs) displacement of the rows' points along their directions."""
        return observed_at(
            self.specimen.model, self.points, self.places, directions_of(self.dofs, self.axes)
        )

    @cached_property
    def slopes(self) -> scipy.sparse.csr_array:
        """(3r, dofs) change of these per metre that their points move along x, y and z."""
        return self.specimen.model.slopes(self.places, directions_of(self.dofs, self.axes))

    @cached_property
    def whole_motion(self) -> scipy.sparse.csr_array:
        """(3 × points, dofs) displacement of each point once, along all axes."""
        _, first = np.unique(self.points, return_index=True)
        return self.specimen.model.displacement(self.places[first])

    @cached_property
    def basis(self) -> ReducedModel:
        """The reduced basis about the prior means; it grows as it is used.

        Where the model itself is known to miss frequencies by more, the basis need not meet them as
        closely.
        """
        if self._same is not None:
            return self._same.basis
        prior = self.parametrisation
        start = prior.coefficients(prior.prior_mean)
        reach = np.minimum(
            prior.prior_sd, np.where(prior.logarithmic, np.abs(prior.prior_mean) / 2, 0.5)
        )
        changes = start.stiffness_by * reach, start.mass_by * reach
        tolerance = max(FREQUENCY_TOLERANCE, _OF_MODEL_ERROR * self.specimen.model_error)
        held = (2 * np.pi * self.held_hz) ** 2
        return ReducedModel(
            self.specimen.model,
            start.stiffness,
            start.mass,
            self.count,
            tolerance=tolerance,
            held=held,
            changes=changes,
        )

    def with_unverified_basis(self) -> ForwardModel:
        """The same on the basis as it is now, for a search that is verified afterwards."""
        return replace(self, verified=False, like=self if self.reduced else None)

    @property
    def _same(self) -> ForwardModel | None:
        """The model of the same parameters that this one was made from."""
        same = self.like is not None and self.like.parametrisation is self.parametrisation
        return self.like if same else None

    def with_mesh_error_about(self, theta: FloatArray) -> ForwardModel:
        """The same with the error of the body's own mesh as it is at parameters θ."""
        return replace(self, about=theta, like=self)

    @cached_property
    def finer(self) -> Finer | None:
        """Finer meshes by which the error of the body's own is known and taken out; None where that
        is taken on trust.
        """
        if self.like is not None and self.like.specimen is self.specimen:
            return self.like.finer
        return Finer.of(self.specimen)

    @cached_property
    def mesh_error(self) -> MeshError | None:
        """What the body's own mesh misses, about the prior means or where it was asked for."""
        if self.finer is None or not self.reduced:
            return None
        if self._same is not None and self._same.about is self.about:
            return self._same.mesh_error
        prior = self.parametrisation
        theta = prior.prior_mean if self.about is None else self.about
        c = prior.coefficients(theta)
        modes = self.basis.modes(c.stiffness, c.mass)
        held = (2 * np.pi * self.held_hz) ** 2
        whole = replace(modes, shapes=self.basis.basis @ modes.shapes)
        return self.finer.error(whole, *prior.split(prior.constants(theta)), held)

    @property
    def system(self) -> ReducedSystem:
        """The model on the basis as it is now, with the finest mesh's matrices of the modes where
        what the body's own misses is known.
        """
        return self.basis.system if self.mesh_error is None else self._corrected(self.basis.system)

    @cached_property
    def _corrected(self) -> Callable[[ReducedSystem], ReducedSystem]:
        """From the basis's last system to the one without the error of the mesh."""
        if self._same is not None and self._same.about is self.about:
            return self._same._corrected
        assert self.mesh_error is not None, "what the mesh misses is known"
        return lru_cache(maxsize=1)(self.mesh_error.corrected)

    def on_basis(self) -> ForwardModel:
        """The same on a reduced basis; itself where it has one."""
        return self if self.reduced else replace(self, reduced=True)

    def rows(self, dofs: Sequence[Dof]) -> tuple[IntArray, FloatArray]:
        """(N,) numbers of the rows of some dofs, and (N,) +1 or -1 where a dof has the opposite
        sense of its row.

        Raises:
            InputError: a dof is not among the model's.
        """
        number = {(dof.point, dof.axis): row for row, dof in enumerate(self.dofs)}
        for dof in dofs:
            if dof.point not in self.points:
                raise InputError("point", f"{dof.point} has no coordinates; give it a grid point")
            if (dof.point, dof.axis) not in number:
                raise InputError(
                    "direction", f"{dof.direction} at point {dof.point} is none of the model's rows"
                )
        rows = [number[dof.point, dof.axis] for dof in dofs]
        return np.array(rows), np.array(
            [float(dof.sign * self.dofs[k].sign) for dof, k in zip(dofs, rows, strict=True)]
        )

    def solve(self, theta: FloatArray) -> ForwardState:
        """Modes at parameters θ.

        Raises:
            ModelError: the eigenproblem cannot be solved.
        """
        model, c = self.specimen.model, self.parametrisation.coefficients(theta)
        if self.reduced:
            modes = self.basis.modes(c.stiffness, c.mass) if self.verified else None
            reduced = self.system  # as it has grown
            if modes is None or reduced is not self.basis.system:
                modes = reduced.modes(c.stiffness, c.mass, self.count)
            return self.state_of(reduced, c, modes, theta)
        mass, stiffness = model.mass.at(c.mass), model.stiffness.at(c.stiffness)
        modes = body_modes(model, stiffness, mass, self.count - model.rigid_modes.shape[1])
        stiffness_terms = [model.stiffness.term(k) for k in range(len(c.stiffness))]
        mass_terms = [model.mass.term(j) for j in range(len(c.mass))]
        return ForwardState(c, modes, stiffness_terms, mass_terms, None, forward=self, theta=theta)

    def state_of(
        self, system: ReducedSystem, c: Coefficients, modes: NormalModes, theta: FloatArray
    ) -> ForwardState:
        """The state at parameters θ, with coefficients c, of modes that a reduced system has."""
        terms = list(system.stiffness), list(system.mass)
        return ForwardState(c, modes, *terms, system.basis, forward=self, theta=theta)

    def frequencies_at(self, parametrisation: Parametrisation, theta: FloatArray) -> FloatArray:
        """(n,) elastic natural frequencies, Hz, where another parametrisation of the same mesh
        gives the coefficients.

        The full model gives them: what is asked for once is not worth a larger basis.
        """
        modes = replace(self, parametrisation=parametrisation, reduced=False).solve(theta).modes
        return modes.frequency_hz[modes.rigid :]

    def holding(self, state: ForwardState, rows: IntArray) -> ForwardState:
        """The same state on a basis that holds the static deflections under forces along the given
        rows.
        """
        if state.basis is None:
            return state
        c = state.coefficients
        self.basis.cover(self.observation, rows.tolist(), c.stiffness, c.mass)
        return state if state.basis is self.basis.system.basis else self.solve(state.theta)


def directions_of(dofs: Sequence[Dof], axes: Mapping[int, FloatArray]) -> FloatArray:
    """(r, 3) unit vectors along dofs: of x, y and z, or of the (3, 3) axes of their own that some
    points have.
    """
    whole = np.eye(3)
    return np.array([dof.sign * axes.get(dof.point, whole)[dof.axis - 1] for dof in dofs]).reshape(
        -1, 3
    )


def modes_to_cover(parametrisation: Parametrisation, highest_hz: float, at_least: int) -> int:
    """How many modes to solve for: those below twice a frequency at the prior means, and at least
    so many elastic ones.

    The factor is the margin for constants that come out lower, and for the residual series. In a
    body in space modes are so many that each of the next counts for little, and the factor is 1.3.
    """
    model, c = parametrisation.body.model, parametrisation.coefficients(parametrisation.prior_mean)
    factor = _COVERED_IN_SPACE if _is_in_space(parametrisation) else _COVERED
    below = modes_below(
        model.stiffness.at(c.stiffness),
        model.mass.at(c.mass),
        (2 * np.pi * factor * highest_hz) ** 2,
    )
    return max(below, at_least + int(model.rigid_modes.shape[1]))


def _is_in_space(parametrisation: Parametrisation) -> bool:
    return len(parametrisation.body.model.dofs) == 6
