"""What a body may have that nobody stated, and whether its frequencies show it.

What a body may have that nobody stated, as one more term of its model: a mass, a foot that it
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

Whether a body shows something that nobody stated: a mass at a point, a foot that it stands on.

With a size a at a place that the modes move by Φ (N, q), mass-normalised, the frequencies are those
of Λ and I + aΦΦᵀ (a mass), of Λ + aΦΦᵀ and I (a foot); of supports `suspects` has them.
With this as one more unknown, a ~ |N(0, σ²)|, and the change d(a) of ln f linear about its
likeliest â, d = c + ea, the data are likelier than without by

    B = 2 Φ(b/√q) exp(cᵀWμ - ½ cᵀMc + b²/2q)/√(σ²q),     μ = r - Sδ,     b = eᵀ(Wμ - Mc),     q = eᵀMe + σ⁻²,

M = W - WSH⁻¹SᵀW, in the terms of `posterior`. Of all places and all sizes of slips, each as likely,
and of the posterior of the discrepancy B is the mean. Where there is nothing E[B] = 1, whatever the
constants are, so P(B ≥ 1/p) ≤ p (Ville 1939; Shafer, Shen, Vereshchagin and Vovk, Statistical
Science 26, 2011).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np
import scipy

from fecore.arrays import BoolArray, FloatArray
from fecore.body.constants import Body
from fecore.body.model import Model
from fecore.body.supports import NodeSpring, PointMass, Spring
from fecore.correlation import most_alike
from fecore.dynamics.reduction import ReducedSystem, bordered
from fecore.updating.forward import ForwardModel
from fecore.updating.parameters import Parametrisation
from fecore.updating.posterior import LinearProblem, Mixture
from fecore.updating.state import ForwardState

if TYPE_CHECKING:
    from fecore.body.structure import Structure


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

    1. The basis gets the static deflections under what is added.
    2. It gets the rigid motion of each support that gives way, with what other supports then stop.
    3. Each addition moves with some rows in this basis.
    4. Rigid motions that a foot resists are turned behind those that are left.
    5. Each addition adds a term ψᵀψ of its rows, a mass to the mass and others to the stiffness.

    Args:
        system: of the body without.
        model: of the body.
        additions: to it.
        springs: how many it has of its own, the last terms of its stiffness.
        static: (dofs, l) deflections that the basis has to hold too.
    """
    # 1. The basis with the static deflections.
    V, (stiffness, mass) = np.hstack([system.basis, static]), (system.stiffness, system.mass)
    if static.size:
        columns = slice(system.basis.shape[1], V.shape[1])
        stiffness = bordered(stiffness, model.stiffness.project(V, columns))
        mass = bordered(mass, model.mass.project(V, columns))
    size = V.shape[1]
    # 2. Rigid motions of supports that give way.
    yielding = [each for each in additions if each.kind == "support"]
    scale = np.ones(0)
    if yielding:
        motions = np.vstack([each.motion for each in yielding])
        first = np.abs(np.einsum("jii->ji", mass)).sum(axis=0).max()
        own = model.mass.project(motions.T, slice(0, len(motions)))
        # as large as the basis, for the sake of round-off
        scale = np.sqrt(first / np.abs(np.einsum("jii->ji", own)).sum(axis=0))
        V = np.hstack([V, motions.T * scale])
        stiffness = _with_stopped(stiffness, model, V[:, :size], yielding, scale)
        mass = bordered(mass, model.mass.project(V, slice(size, V.shape[1])))
    # 3. What each addition moves with, in the basis.
    of_supports = iter(np.eye(V.shape[1])[size:] * scale[:, None])
    rows = [
        next(of_supports)[None] if each.kind == "support" else each.motion @ V for each in additions
    ]
    # 4. Rigid motions that a foot resists are none any more: they stand behind those that are left.
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
    # 5. Terms.
    rows = [row @ turn for row in rows]
    terms = [row.T @ row for row in rows]
    stiff, heavy = (
        [t for t, a in zip(terms, additions, strict=True) if a.of_mass == kind]
        for kind in (False, True)
    )
    turned, before = [turn.T @ each @ turn for each in (stiffness, mass)], len(stiffness) - springs
    empty = np.zeros((0, 0, V.shape[1]))
    return ReducedSystem(
        V @ turn,
        rigid,
        system.shift,
        stiffness=np.array([*turned[0][:before], *stiff, *turned[0][before:]]),
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

    def carrying(self, masses: Sequence[PointMass]) -> AlteredBody:
        """The body with more masses, and the same additions."""
        return replace(self, body=self.body.carrying(masses))

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


class Effect(Protocol):
    """What P additions do to the frequencies, each by itself."""

    def at(self, size: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n, P) change of ln f of the elastic modes by the (P,) sizes, and its derivative."""
        ...


@dataclass(frozen=True)
class AdditionScreening:
    """What the frequencies say of some additions to one body, one at a time, beside none."""

    evidence: float  # ln B
    share: FloatArray  # (P,) probability of each, where it is one of them
    size: FloatArray  # (P,) its mean, SI
    mean: float  # of the size of whichever it is
    sd: float  # likewise
    # (n, n) second moments of the change of ln f by the slip, over places and sizes
    covariance: FloatArray
    stated: float = 0.0  # ln B of what is stated to be possible, which is taken off the evidence


def screened(
    effect: Effect,
    at: slice,
    columns: Sequence[int],
    problem: LinearProblem,
    posterior: tuple[Mixture, FloatArray],
    sigma: FloatArray,
) -> AdditionScreening:
    """Compare each of P additions with none.

    Args:
        effect: of the additions.
        at: the frequencies of their body among all.
        columns: the elastic modes that these belong to.
        problem: at the estimate.
        posterior: about it, one Gaussian for each of s discrepancies, with the logarithms of their
            weights.
        sigma: (k, P) σ of each.
    """
    data, sigma = Data.of(problem, *posterior), sigma[:, None]
    change, by = np.zeros((2, problem.residual.size, sigma.shape[2]))
    size = np.zeros(sigma.shape[2])
    for _ in range(4):  # linearisations about the likeliest size of each place
        change[at], by[at] = (each[list(columns)] for each in effect.at(size))
        log, mean, variance = data.likelier(change - by * size, by, sigma)
        share = scipy.special.softmax(log)
        here = share.sum(axis=(0, 1))
        expansion = size
        size = np.maximum(np.sum(share * mean, axis=(0, 1)) / np.maximum(here, 1e-300), 0.0)
    middle = float(np.sum(share * mean))
    secant = np.where(expansion > 0, change / np.where(expansion > 0, expansion, 1.0), by)
    return AdditionScreening(
        evidence=float(scipy.special.logsumexp(log) - np.log(sigma.shape[0] * here.size)),
        share=here,
        size=size,
        mean=middle,
        sd=float(np.sqrt(np.sum(share * (variance + (mean - middle) ** 2)))),
        covariance=(secant * np.sum(share * sigma**2, axis=(0, 1))) @ secant.T,
    )


@dataclass(frozen=True)
class ModesWithAdditions:
    """A body's (N,) eigenvalues, 0 of rigid motions, and the (P, N, q) motion of P additions in its
    modes.
    """

    value: FloatArray
    moved: FloatArray
    rigid: int

    def relative(
        self, value: FloatArray, vectors: FloatArray, by: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Changes of ln f of the elastic modes, and their derivatives, by (P, N') altered
        eigenvalues, those shapes as (P, N', N') columns, and derivatives of ln f (P, N'): which
        mode each was is the one that it is most like, all together.
        """
        order = np.array([most_alike(each[: self.value.size]) for each in vectors])
        value, by = (
            np.take_along_axis(each, order[:, self.rigid :], axis=1) for each in (value, by)
        )
        return (np.log(value / self.value[self.rigid :]) / 2).T, by.T


class MassEffect(ModesWithAdditions):
    """A mass at any of P places."""

    def at(self, size: FloatArray) -> tuple[FloatArray, FloatArray]:
        """As of `Effect`, kg."""
        across = self.moved.transpose(0, 2, 1)
        inside = np.linalg.inv(
            np.eye(across.shape[1]) + size[:, None, None] * (across @ self.moved)
        )
        pushed = np.sqrt(self.value)[:, None] * self.moved
        back = pushed.transpose(0, 2, 1)
        value, vectors = np.linalg.eigh(
            np.diag(self.value) - size[:, None, None] * (pushed @ inside @ back)
        )
        by = -np.sum((inside @ back @ vectors) ** 2, axis=1) / np.where(value > 0, value, 1.0) / 2
        return self.relative(value, vectors, by)


class FootEffect(ModesWithAdditions):
    """A spring to the ground at any of P places; `moved` is (P, N, N) of ΦΦᵀ, since a foot may
    stand under many nodes.
    """

    def at(self, size: FloatArray) -> tuple[FloatArray, FloatArray]:
        """As of `Effect`, N/m."""
        value, vectors = np.linalg.eigh(np.diag(self.value) + size[:, None, None] * self.moved)
        by = np.sum(vectors * (self.moved @ vectors), axis=1) / np.where(value > 0, value, 1.0) / 2
        return self.relative(value, vectors, by)


def effect_of(state: ForwardState, additions: Sequence[Addition]) -> Effect:
    """What each of some masses or feet does to a solved body."""
    moving = np.arange(state.modes.eigenvalue.size) >= state.modes.rigid
    value, shapes = np.where(moving, state.modes.eigenvalue, 0.0), state.every_shape
    own = [each.motion @ shapes for each in additions]
    if not additions[0].of_mass:
        return FootEffect(value, np.array([rows.T @ rows for rows in own]), state.modes.rigid)
    moved = np.zeros((len(own), shapes.shape[1], max(map(len, own))))
    for place, rows in enumerate(own):
        moved[place, :, : len(rows)] = rows.T
    return MassEffect(value, moved, state.modes.rigid)


@dataclass(frozen=True)
class Data:
    """The data at each of s discrepancies: (s,) logarithms of weights, (s, n) Wμ and (s, n, n)
    M.
    """

    log_weight: FloatArray
    score: FloatArray
    M: FloatArray

    @classmethod
    def of(cls, problem: LinearProblem, posterior: Mixture, log_weight: FloatArray) -> Data:
        """At an estimate, about which the posterior is."""
        root, S = np.sqrt(problem.weights)[:, None], problem.sensitivity
        variance = problem.noise + posterior.scale[:, None, None] ** 2 * np.eye(len(S))
        W = root * np.linalg.inv(variance) * root.T
        residuals = problem.residual - posterior.shift @ S.T
        across = W @ S
        M = W - across @ posterior.covariance @ across.transpose(0, 2, 1)
        return cls(log_weight, (W @ residuals[..., None])[..., 0], M)

    def likeliest(self, change: FloatArray) -> FloatArray:
        """(P,) logarithms of how much likelier the data are by (n, P) changes of ln f."""
        each = self.score @ change - np.sum(change * (self.M @ change), axis=1) / 2
        return np.asarray(scipy.special.logsumexp(self.log_weight[:, None] + each, axis=0))

    def likelier(
        self, c: FloatArray, e: FloatArray, sigma: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(k, s, P) logarithms of the weights times B of (n, P) c and e, with the size's means and
        variances.
        """
        Mc, Me = self.M @ c, self.M @ e
        offset = self.score @ c - np.sum(c * Mc, axis=1) / 2
        b, q = self.score @ e - np.sum(e * Mc, axis=1), np.sum(e * Me, axis=1) + sigma**-2
        half = np.log(2) + scipy.special.log_ndtr(b / np.sqrt(q)) - np.log(sigma**2 * q) / 2
        return self.log_weight[:, None] + offset + b**2 / q / 2 + half, b / q, 1 / q
