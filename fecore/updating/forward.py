"""The forward model as updating sees it, and which measured mode is which of its modes.

The forward model as updating sees it: parameters in, modes at the measured points and their
derivatives out.

Modes come from a reduced basis (`fecore.dynamics.reduction`) that checks itself and grows where it
must, or from the full model; `state` has what a solved model offers.

Which measured mode is which of the model's: by shape, or where shapes say nothing by order.

With fewer than three dofs the MAC of any two shapes is 1 or nearly so, and frequencies are all
there is. Modes keep their order when all frequencies of a model are off by a common factor, so
measured and model modes are laid side by side in their order, as sequences are aligned (Needleman
and Wunsch 1970): the factor e^c, which mode of the model was missed and which measured mode has no
partner are those of the least

    Σ_pairs (½ (ln f_e - ln f_n - c)²/σ² - ln p_k) - Σ_missed ln(1 - p_k) + ½ c²/σ_c² + L ·
    (measured modes alone),

p_k the probability that mode k is seen, which is small where the FRFs' points lie near its nodes.
Kinds of modes that swap their order as constants move are a matter for several starts
(`elastic_starts`): each constant moves its own kind. Partners that are held are named by their
kind, so that they stay the same where modes of two kinds cross.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import numpy as np
import scipy

from fecore.arrays import ROUND_OFF, FloatArray, IntArray
from fecore.body.constants import Body
from fecore.body.model import observed_at
from fecore.correlation import Pairing, pair_modes
from fecore.dynamics.bodies import body_modes
from fecore.dynamics.eigen import NormalModes, modes_below
from fecore.dynamics.reduction import FREQUENCY_TOLERANCE, ReducedModel, ReducedSystem
from fecore.errors import InputError
from fecore.frf import Dof
from fecore.modes import MeasuredModes
from fecore.updating.mesh import Finer, MeshError
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


FEWEST_DOFS = 3
"""Dofs from which shapes distinguish modes."""

Partners = tuple[tuple[int, str, int], ...]
"""Measured modes with the kinds of their partners, and the partners' places among the model's modes
of their kind.
"""

_SCATTER = 0.06  # σ: of kinds of modes about the common factor, as the constants' ratios are off
_FACTOR_SD, _FACTORS = 0.15, np.linspace(-0.5, 0.5, 41)  # σ_c, and the c that are tried
UNPAIRED = 8.0  # L: a measured mode without a partner is what an offset of four σ would cost
_NEAR_NODE = 0.1  # amplitude over the largest mode's at which a mode is as often missed as seen
_LEAST, _MOST = 0.05, 0.95  # p_k: nothing is sure
# times the model's own error of a frequency: distance within which that error may mix modes
_MIXING = 3.0


def has_shapes(modes: MeasuredModes) -> bool:
    """Whether the modes have shapes that distinguish them."""
    return modes.shapes is not None and len(modes.dofs) >= FEWEST_DOFS


def pair_with(modes: MeasuredModes, state: ForwardState) -> Pairing:
    """Measured modes with those of a solved model, whose first points are those of the shapes."""
    dofs = len(modes.dofs)
    if has_shapes(modes):
        return pair_modes(
            modes.shapes,
            state.shapes[:, :dofs],
            modes.frequency_hz,
            state.frequency_hz,
            hidden=state.hidden,
            mixing=_MIXING * state.forward.specimen.model_error,
            highest_hz=modes.highest_hz,
        )
    seen = probability_seen(modes, state)
    shown = np.setdiff1d(np.arange(state.frequency_hz.size), state.hidden)
    return _among(
        shown,
        pair_in_order(
            modes.frequency_hz, state.frequency_hz[shown], seen[shown], unpaired_cost(modes)
        ),
    )


def pair_best_match(modes: MeasuredModes, state: ForwardState) -> Pairing:
    """The likest partners by shape, however unlike and far apart: for a comparison where no mode
    has a like one.
    """
    dofs = len(modes.dofs)
    return pair_modes(
        modes.shapes,
        state.shapes[:, :dofs],
        modes.frequency_hz,
        state.frequency_hz,
        minimum_mac=0.0,
        maximum_frequency_ratio=np.inf,
        hidden=state.hidden,
    )


def partners_of(pairing: Pairing, kinds: Sequence[str]) -> Partners:
    """Who is paired with whom, whatever other kinds lie between."""
    return tuple(
        (row, kinds[column], kinds[:column].count(kinds[column])) for row, column in pairing.pairs
    )


def exchanged(pairing: Pairing, kinds: Sequence[str]) -> list[Partners]:
    """The partners with one measured mode's other candidate, of another kind, in place of its
    own.
    """
    own = dict(pairing.pairs)
    changes = [
        {row: other} for row, _, other in pairing.ambiguous if kinds[other] != kinds[own[row]]
    ]
    return [
        partners_of(replace(pairing, pairs=tuple({**own, **change}.items())), kinds)
        for change in changes
    ]


def pair_fixed(modes: MeasuredModes, state: ForwardState, partners: Partners) -> Pairing:
    """The pairing with given partners at a solved model; those that the model does not have there
    are left out.
    """
    kinds = state.kinds
    numbers: dict[tuple[str, int], int] = {
        (kind, kinds[:column].count(kind)): column for column, kind in enumerate(kinds)
    }
    pairs = tuple(
        (row, numbers[kind, place]) for row, kind, place in partners if (kind, place) in numbers
    )
    seen = probability_seen(modes, state)
    seen[list(state.hidden)] = 0.0  # so that none of these is a rival, or was missed
    pairing = _described(pairs, modes.frequency_hz, state.frequency_hz, seen)
    return replace(pairing, mac=pair_best_match(modes, state).mac) if has_shapes(modes) else pairing


def _among(shown: IntArray, pairing: Pairing) -> Pairing:
    """A pairing with some of the model's modes, by these modes' numbers among all."""
    at = [int(number) for number in shown]
    return replace(
        pairing,
        pairs=tuple((i, at[j]) for i, j in pairing.pairs),
        unpaired_model=tuple(at[j] for j in pairing.unpaired_model),
        ambiguous=tuple((i, at[j], at[k]) for i, j, k in pairing.ambiguous),
    )


def probability_seen(modes: MeasuredModes, state: ForwardState) -> FloatArray:
    """(m,) p_k of the model's modes: by their amplitude at the shapes' points times that at the
    points that stood still.
    """
    dofs, points = len(modes.dofs), len(state.forward.points)
    amplitude = np.abs(state.shapes)
    if not dofs or not points:
        return np.full(state.frequency_hz.size, _MOST)
    height = amplitude[:, :dofs].max(axis=1) * np.prod(
        amplitude[:, dofs : min(points, dofs + 2)], axis=1
    )
    share = (height / max(float(height.max()), 1e-300) / _NEAR_NODE) ** 2
    return np.asarray(np.clip(share / (1 + share), _LEAST, _MOST))


def unpaired_cost(modes: MeasuredModes) -> FloatArray:
    """(n,) what each measured mode costs without a partner: L, less where it may be none, -ln(1 - P
    + P e^-L).
    """
    probability = np.ones(len(modes)) if modes.probability is None else modes.probability
    with np.errstate(divide="ignore"):
        return np.asarray(-np.logaddexp(np.log(1 - probability), np.log(probability) - UNPAIRED))


def pair_in_order(
    measured_hz: FloatArray,
    model_hz: FloatArray,
    seen: FloatArray,
    unpaired_costs: FloatArray | None = None,
) -> Pairing:
    """Align ascending measured with ascending model frequencies (module docstring).

    Args:
        measured_hz: (n,).
        model_hz: (m,).
        seen: (m,) p_k.
        unpaired_costs: (n,) of a measured mode without a partner; L where nobody doubts the modes.
    """
    costs = np.full(measured_hz.size, UNPAIRED) if unpaired_costs is None else unpaired_costs
    n, m = measured_hz.size, model_hz.size
    order = np.argsort(model_hz, kind="stable")
    pair, miss = -np.log(seen[order]), -np.log(1 - seen[order])
    off = np.log(measured_hz[:, None] / np.maximum(model_hz[order], 1e-9)[None, :])
    best = np.full((n + 1, m + 1, _FACTORS.size), np.inf)
    came = np.zeros((n + 1, m + 1, _FACTORS.size), dtype=np.int8)
    best[0] = np.concatenate([[0.0], np.cumsum(miss)])[:, None]
    for i in range(1, n + 1):
        best[i, 0] = best[i - 1, 0] + costs[i - 1]
        came[i, 0] = 1
        for j in range(1, m + 1):
            together = (
                best[i - 1, j - 1]
                + pair[j - 1]
                + ((off[i - 1, j - 1] - _FACTORS) / _SCATTER) ** 2 / 2
            )
            skipped = best[i, j - 1] + miss[j - 1]
            unpaired = best[i - 1, j] + costs[i - 1]
            choice = np.stack([together, unpaired, skipped])
            came[i, j] = choice.argmin(axis=0)
            best[i, j] = choice.min(axis=0)
    # modes above the last measured one cost nothing
    total = best[n].min(axis=0) + (_FACTORS / _FACTOR_SD) ** 2 / 2
    c = int(total.argmin())
    i, j = n, int(best[n, :, c].argmin())
    pairs: list[tuple[int, int]] = []
    while i > 0:
        step = int(came[i, j, c])
        if step == 0:
            pairs.append((i - 1, int(order[j - 1])))
        i, j = i - (step != 2), j - (step != 1)
    pairs.reverse()
    return _described(tuple(pairs), measured_hz, model_hz, seen)


def detection_cost(
    pairing: Pairing,
    seen: FloatArray,
    model_hz: FloatArray,
    unpaired_costs: FloatArray | None = None,
) -> float:
    """What a pairing in order says against itself, frequencies apart: modes that were missed, and
    seen near their nodes.
    """
    if not pairing.pairs:
        return float("inf")
    paired = np.array([column for _, column in pairing.pairs])
    below = np.setdiff1d(
        np.flatnonzero(model_hz < model_hz[paired].max() * (1 + ROUND_OFF)), paired
    )
    left = list(pairing.unpaired_measured)
    unpaired = UNPAIRED * len(left) if unpaired_costs is None else float(unpaired_costs[left].sum())
    return float(-np.log(seen[paired]).sum() - np.log(1 - seen[below]).sum()) + unpaired


def _described(
    pairs: tuple[tuple[int, int], ...],
    measured_hz: FloatArray,
    model_hz: FloatArray,
    seen: FloatArray,
) -> Pairing:
    """The pairing with who stays alone; ambiguous where the next mode that may be seen is nearly as
    near.
    """
    taken = {j for _, j in pairs}
    rows = {i for i, _ in pairs}
    distance = np.abs(np.log(np.maximum(model_hz, 1e-9)[None, :] / measured_hz[:, None]))
    ambiguous = []
    for i, j in pairs:
        others = [
            k
            for k in range(model_hz.size)
            if k not in taken and seen[k] > 0.5 and distance[i, k] < _SCATTER
        ]
        if others:
            k = min(others, key=lambda k: float(distance[i, k]))
            if distance[i, k] < distance[i, j] + _SCATTER / 4:
                ambiguous.append((i, j, k))
    top = float(measured_hz.max())
    return Pairing(
        pairs=pairs,
        mac=None,
        unpaired_measured=tuple(i for i in range(measured_hz.size) if i not in rows),
        unpaired_model=tuple(
            j
            for j in range(model_hz.size)
            if j not in taken and model_hz[j] <= top and seen[j] > 0.5
        ),
        ambiguous=tuple(ambiguous),
    )
