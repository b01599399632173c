"""What a body may have that nobody stated, as one more term of its model: a mass, a foot that it
stands on, a soft support.

With the reduced basis V and its matrices K and M, and one unknown size each,

- a mass m at a place whose motion is ψ adds mψᵀψ to M;
- a foot, a spring k to the ground at a place or along an end, adds kψᵀψ to K;
- a support that gives way lets its nodes move as a rigid block, along or about an axis, on a spring
  k. The whole body then follows with a rigid motion r that strains nothing, so u = Vq + rρ has the
  strain energy of q and kρ², and M of [V r] (Craig and Bampton, AIAA J. 6, 1968). Where other
  supports hold it, r ends at their nodes, and V has the deflection that this gives.

So the altered body is a model of the same parameters and one more, recomputed at any size, with its
frequencies, shapes and derivatives. The size's prior is log-normal, wide, about a few times what a
careful laboratory's clamp or sensor may have.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np
import scipy

from fecore.arrays import BoolArray, FloatArray
from fecore.body.constants import Body
from fecore.body.model import Model
from fecore.dynamics.reduction import ReducedSystem, bordered
from fecore.updating.forward import ForwardModel, ForwardState
from fecore.updating.parameters import Parametrisation

if TYPE_CHECKING:
    from fecore.body.structure import Structure
from fecore.body.supports import NodeSpring, Spring

SIZE_SD = 2.0
"""Standard deviation of the logarithm of a size: from 1/50 to 50 times its median."""

TYPICAL = 3.0
"""Median of a size of what was not stated, over those that are usual; of a stiffness that gives way
its inverse.
"""

MASS = "added_mass"
"""Name of the size of a mass."""

Kind = Literal["mass", "foot", "support"]


@dataclass(frozen=True)
class Addition:
    """Something that a body may have: a term of its mass or stiffness of unknown size."""

    kind: Kind
    name: str  # of its size as a parameter
    unit: str  # SI, of the size
    # (x, y, z) of the point, or of the middle of the nodes that it holds, m
    place: tuple[float, ...]
    median: float  # of the size's prior, SI
    # (q, dofs) what it moves with, or of a support the (1, dofs) rigid motion of the body that it
    # lets go
    motion: FloatArray | scipy.sparse.csr_array
    # a foot under all nodes at an end of the body, whose stiffness is that of all together
    along_an_end: bool = False
    # (nodes, dofs of a node) what the rigid motion of a support would have where other supports
    # hold the body, negative
    stopped: FloatArray | None = None

    @property
    def usual(self) -> float:
        """Of a mass or a foot the size, of a support the compliance, that a careful laboratory
        would not state.
        """
        return 1 / (TYPICAL * self.median) if self.kind == "support" else self.median / TYPICAL

    @property
    def of_mass(self) -> bool:
        """Whether it weighs; else it is a spring."""
        return self.kind == "mass"


def with_additions(
    system: ReducedSystem,
    model: Model,
    additions: Sequence[Addition],
    springs: int,
    static: FloatArray,
) -> ReducedSystem:
    """A reduced system with the terms of some additions, those of stiffness before the body's own
    springs.

    Args:
        system: of the body without.
        model: of the body.
        additions: to it.
        springs: how many it has of its own, the last terms of its stiffness.
        static: (dofs, l) deflections that the basis has to hold too.
    """
    support_motions = [each.motion for each in additions if each.kind == "support"]
    V, (stiffness, mass) = np.hstack([system.basis, static]), (system.stiffness, system.mass)
    if static.size:
        stiffness = bordered(
            stiffness, model.stiffness.project(V, slice(system.basis.shape[1], V.shape[1]))
        )
        mass = bordered(mass, model.mass.project(V, slice(system.basis.shape[1], V.shape[1])))
    size = V.shape[1]
    if support_motions:
        first = np.abs(np.einsum("jii->ji", mass)).sum(axis=0).max()
        own = np.abs(
            np.einsum(
                "jii->ji",
                model.mass.project(np.vstack(support_motions).T, slice(0, len(support_motions))),
            )
        ).sum(axis=0)
        scale = np.sqrt(first / own)  # as large as the basis, for the sake of round-off
        V = np.hstack([V, np.vstack(support_motions).T * scale])
        stiffness = _with_stopped(
            stiffness, model, V[:, :size], [a for a in additions if a.kind == "support"], scale
        )
        mass = bordered(mass, model.mass.project(V, slice(size, V.shape[1])))
    rows = [each.motion @ V for each in additions]
    column = size
    for place, each in enumerate(additions):
        if each.kind == "support":
            rows[place] = np.eye(V.shape[1])[[column]] * scale[column - size]
            column += 1
    # Rigid motions that a foot resists are none any more: they stand behind those that are left.
    resisted = [
        row[:, : system.rigid]
        for row, each in zip(rows, additions, strict=True)
        if each.kind == "foot"
    ]
    turn, rigid = np.eye(V.shape[1]), system.rigid
    if resisted and rigid:
        _, singular, right = np.linalg.svd(np.vstack(resisted))
        rank = int(np.sum(singular > 1e-9 * singular.max(initial=1e-300)))
        turn[:rigid, :rigid], rigid = np.roll(right, -rank, axis=0).T, rigid - rank
    rows = [row @ turn for row in rows]
    terms = [row.T @ row for row in rows]
    own = len(stiffness) - springs
    stiff, heavy = (
        [t for t, a in zip(terms, additions, strict=True) if a.of_mass == kind]
        for kind in (False, True)
    )
    turned = [turn.T @ each @ turn for each in (stiffness, mass)]
    empty = np.zeros((0, 0, V.shape[1]))
    return ReducedSystem(
        V @ turn,
        rigid,
        system.shift,
        stiffness=np.array([*turned[0][:own], *stiff, *turned[0][own:]]),
        mass=np.array([*turned[1], *heavy]),
        stiffness_sketch=empty,
        mass_sketch=empty,
    )


def _with_stopped(
    stiffness: FloatArray,
    model: Model,
    V: FloatArray,
    supports: Sequence[Addition],
    scale: FloatArray,
) -> FloatArray:
    """(k, r, r) projected terms bordered by those of supports that give way, which strain what
    other supports stop.
    """
    size = stiffness.shape[1]
    if all(each.stopped is None for each in supports):
        return np.pad(stiffness, ((0, 0), *((0, len(supports)),) * 2))
    none = np.zeros(model.free.shape)
    stopped = (
        np.stack([none if each.stopped is None else each.stopped for each in supports], axis=2)
        * scale
    )
    near = model.stiffness.about(np.flatnonzero(stopped.any(axis=(1, 2))))
    motion = np.concatenate([near.everywhere(V), stopped], axis=2)
    return bordered(stiffness, near.forms(motion, slice(size, motion.shape[2])))


@dataclass(frozen=True)
class AlteredBody(Body):
    """A body with additions, whose sizes are its last constants."""

    body: Body
    additions: tuple[Addition, ...]

    @property
    def nominal(self) -> dict[str, float]:
        """The body's constants, and the additions' sizes."""
        return {**self.body.nominal, **{each.name: each.median for each in self.additions}}

    @property
    def springs(self) -> tuple[Spring | NodeSpring, ...]:
        """The body's own."""
        return self.body.springs

    @property
    def as_structure(self) -> Structure | None:
        """The structure that the body is."""
        return self.body.as_structure

    @property
    def model_error(self) -> float:
        """The body's."""
        return self.body.model_error

    @property
    def model(self) -> Model:
        """The body's, without the additions, which live on the reduced basis."""
        return self.body.model

    def stiffness_coefficients(self, constants: FloatArray) -> FloatArray:
        """(k, …) the body's and those of additions."""
        own, sizes = self._split(constants)
        return np.concatenate(
            [self.body.stiffness_coefficients(own), sizes[[not a.of_mass for a in self.additions]]]
        )

    def mass_coefficients(self, constants: FloatArray) -> FloatArray:
        """(j, …) the body's and those of additions."""
        own, sizes = self._split(constants)
        return np.concatenate(
            [self.body.mass_coefficients(own), sizes[[a.of_mass for a in self.additions]]]
        )

    def are_physical(self, constants: FloatArray) -> BoolArray:
        """(…) whether the body could have the constants."""
        own, sizes = self._split(constants)
        return np.asarray(self.body.are_physical(own) & np.all(sizes > 0, axis=0))

    def _split(self, constants: FloatArray) -> tuple[FloatArray, FloatArray]:
        count = len(constants) - len(self.additions)
        return constants[:count], constants[count:]


@dataclass(frozen=True)
class AlteredForward(ForwardModel):
    """The modes of a body with additions, on the reduced basis of the body without."""

    plain: ForwardModel | None = None  # the body's own
    additions: tuple[Addition, ...] = ()  # what was added

    @classmethod
    def of(cls, forward: ForwardModel, additions: Sequence[Addition]) -> AlteredForward:
        """A model with additions, beside those that it has."""
        plain = forward.on_basis()
        before: tuple[Addition, ...] = ()
        if isinstance(forward, AlteredForward):
            assert forward.plain is not None, "an altered model has the one that it alters"
            plain, before = forward.plain, forward.additions
        everything = (*before, *additions)
        prior = with_sizes(plain.parametrisation, everything)
        fields = {
            name: getattr(plain, name)
            for name in ("dofs", "places", "roving_mass", "axes", "held_hz")
        }
        count = plain.count + len(everything)
        return cls(
            prior.body,
            prior,
            count=count,
            verified=False,
            plain=plain,
            additions=everything,
            **fields,
        )

    @cached_property
    def altered(self) -> ReducedSystem:
        """The projected model with the terms of the additions."""
        assert self.plain is not None, "an altered model has the one that it alters"
        system, model = self.plain.system, self.specimen.model
        loads = [
            each.motion.T
            for each in self.additions
            if each.kind != "support" and not each.along_an_end
        ]
        prior = self.plain.parametrisation
        start = prior.coefficients(prior.prior_mean).stiffness
        for each in self.additions:
            if each.stopped is not None:
                near = model.stiffness.about(np.flatnonzero(each.stopped.any(axis=1)))
                loads.append(scipy.sparse.csr_array(near.force(start, each.stopped[..., None])))
        forces = scipy.sparse.hstack(
            [scipy.sparse.csr_array((model.mass.size, 0)), *loads]
        ).toarray()
        static = self.plain.basis.static(forces) if loads else forces
        return with_additions(system, model, self.additions, len(self.specimen.springs), static)

    def solve(self, theta: FloatArray) -> ForwardState:
        """Modes at parameters θ, of which the additions' sizes are the last."""
        c, system = self.parametrisation.coefficients(theta), self.altered
        modes = system.modes(c.stiffness, c.mass, self.count)
        return self.state_of(system, c, modes, theta)

    def with_unverified_basis(self) -> AlteredForward:
        """Itself: its basis is not checked."""
        return self


def with_sizes(prior: Parametrisation, additions: Sequence[Addition]) -> Parametrisation:
    """Parameters with the sizes of additions as the last ones."""
    at, more = len(prior.body.nominal), len(additions)
    base = np.insert(prior.base, at, np.zeros(more))
    spread = np.insert(np.pad(prior.spread, ((0, 0), (0, more))), at, np.zeros((more, 1)), axis=0)
    spread[at : at + more, spread.shape[1] - more :] = np.eye(more)
    median = np.array([each.median for each in additions])
    return replace(
        prior,
        body=AlteredBody(prior.body, tuple(additions)),
        names=(*prior.names, *(each.name for each in additions)),
        prior_mean=np.concatenate([prior.prior_mean, median]),
        prior_sd=np.concatenate([prior.prior_sd, median * np.sqrt(np.expm1(SIZE_SD**2))]),
        base=base,
        spread=spread,
        inputs=prior.inputs + more,
    )
