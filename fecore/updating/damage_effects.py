"""What losses of stiffness in stretches along a body do to its modes and their shapes.

What measured shapes say of a loss of stiffness in a stretch of a body, beside its frequencies
(`fecore.updating.damage`).

What losses of stiffness in stretches along a body do to its modes (`fecore.updating.damage`).

Where a stretch has lost the share a of its stiffness K_s, the modes are those of Λ - aE, E =
ΦᵀK_sΦ, as far as the body's modes Φ span what they become. Those that are solved for do not:
strains that gather in a short stretch are made of many more, and what is left out is made up for by
a greater loss (0.34 for 0.3 by ten modes of a beam). So about the likely stretches Φ is taken with
the static deflections under the forces K_pφ of each part p, and ends are tried between the lines
that part the body.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import scipy

from fecore.arrays import BoolArray, FloatArray
from fecore.body.affine import Group
from fecore.correlation import most_alike
from fecore.dynamics.eigen import shifted
from fecore.dynamics.factor import factorise
from fecore.updating.elastic_result import HOPELESS_MISS, SAME_SHAPE, ElasticResult
from fecore.updating.inputs import GRID_SD, POINT_SD
from fecore.updating.posterior import DISCREPANCY, SHAPE_DISCREPANCY
from fecore.updating.state import ForwardState, ShapeErrors, real_shape
from fecore.updating.suspects import ABOVE

_LIKE = 0.1  # of a shape in another, below which the two are not compared
_CLOSE = 1e-3  # relative distance of eigenvalues below which modes are turned freely


@dataclass(frozen=True)
class DamageShapes:
    """Residuals of n shapes in the space of b shapes of the model, over σ, and what they follow
    from, along the N = n b axes of the covariance that they share.
    """

    residual: FloatArray  # (N,)
    by: FloatArray  # (N, X) of the model's by the unknowns
    # (N,) by turns of modes, and by points that are met within `POINT_SD`
    variance: FloatArray
    change: FloatArray  # (l, P, N) by losses
    # information, descent: (X, X) and (X,) of them in the fit, where it looks at shapes
    information: FloatArray
    descent: FloatArray

    @classmethod
    def of(
        cls,
        elastic: ElasticResult,
        number: int,
        turned: FloatArray,
        value: FloatArray,
        seen: FloatArray,
    ) -> DamageShapes | None:
        """Of a campaign; None where it has no shapes that are those of the model.

        Args:
            elastic: the update.
            number: of the campaign.
            turned: (l, P, n, m) what its paired modes are made of by losses.
            value: (m,) eigenvalues of those modes.
            seen: (m, r) their shapes at the model's rows, those of the shapes' dofs first.
        """
        campaign, state = elastic.layout.campaigns[number], elastic.states[number]
        pairing = elastic.pairings[number]
        # Shapes at one point alone are not compared, and modes are paired by frequency.
        if campaign.modes.shapes is None or pairing.mac is None:
            return None
        count, (rows, columns) = (
            len(campaign.modes.dofs),
            (list(each) for each in zip(*pairing.pairs, strict=True)),
        )
        same = pairing.mac[rows, columns] >= SAME_SHAPE
        weight = np.sqrt(elastic.problem.weights[elastic.rows[number]]) * same
        if not same.any():
            return None
        residual, _ = ShapeErrors().residual(campaign.modes, state, pairing, 1.0 * same)
        weight = weight * _evenly(residual.reshape(-1, count), same)
        residual, of_theta = ShapeErrors().residual(campaign.modes, state, pairing, weight)
        by = of_theta @ (campaign.prior.slope(state.theta)[:, None] * campaign.pick)
        seen = seen[:, :count]
        basis = np.linalg.qr(seen.T)[0]  # (points, b)
        # A model's shape at the scale at which it is compared with the measured one, over σ.
        real, own = np.array([real_shape(campaign.modes, row) for row in rows]), seen[columns]
        scale = weight * np.sum(real * own, axis=1) / np.sum(own**2, axis=1) / SHAPE_DISCREPANCY
        placed = _placed(state, scale[:, None, None] * state.slopes[columns, :count], basis)
        shapes = seen @ basis
        both = np.hstack([_turned(value, columns, shapes, scale), placed])
        variance, axes = np.linalg.eigh(both @ both.T)
        own = shapes[columns]
        lost = turned @ shapes
        along = np.sum(lost * own, axis=3) / np.sum(own**2, axis=1)
        like = np.abs(along) > _LIKE
        change = (
            scale[:, None] * (lost / np.where(like, along, 1.0)[..., None] - own) * like[..., None]
        )
        fitted = elastic.problem.others.get("mode shapes")
        each = by.reshape(len(rows), count, -1)
        return cls(
            axes.T @ (residual.reshape(-1, count) @ basis).ravel(),
            axes.T @ np.einsum("npx,pb->nbx", each, basis).reshape(len(axes), -1),
            np.maximum(variance, 0.0),
            change.reshape(*change.shape[:2], -1) @ axes,
            np.zeros((by.shape[1],) * 2) if fitted is None else fitted,
            np.zeros(by.shape[1]) if fitted is None else elastic.problem.other_descent,
        )

    def given(self, k: float) -> DamageTerms:
        """What they say where a shape's standard deviation is k times the usual one."""
        variance = k**2 + self.variance
        r, J, d = self.residual, self.by / variance[:, None], self.change
        return DamageTerms(
            cost=float(np.sum(r**2 / variance + np.log(variance))),
            hessian=self.by.T @ J - self.information,
            descent=J.T @ r - self.descent,
            across=d @ J,
            along=d @ (r / variance) - d**2 @ (0.5 / variance),
        )


@dataclass(frozen=True)
class DamageTerms:
    """The terms of frequencies or shapes in ln B: of the misfit twice, by the unknowns, and by
    losses.
    """

    cost: float
    hessian: FloatArray  # (X, X)
    descent: FloatArray  # (X,)
    across: FloatArray  # (l, P, X) dᵀWS
    along: FloatArray  # (l, P) dᵀWr - ½ dᵀWd

    def __add__(self, other: DamageTerms) -> DamageTerms:
        """Those of both."""
        return DamageTerms(
            self.cost + other.cost,
            self.hessian + other.hessian,
            self.descent + other.descent,
            self.across + other.across,
            self.along + other.along,
        )

    @property
    def likelier(self) -> tuple[float, FloatArray]:
        """The log evidence without a loss, and (l, P) ln B of each loss."""
        H, g, across = self.hessian, self.descent, self.across
        z = np.linalg.solve(H, g)
        gain = self.along - across @ z + np.sum((across @ np.linalg.inv(H)) * across, axis=2) / 2
        return float(g @ z - self.cost - np.linalg.slogdet(H)[1]) / 2, gain


def _evenly(residual: FloatArray, same: BoolArray) -> FloatArray:
    """(n,) weights by which (n, p) shapes that are further off than the middle one of some are as
    far off as it: what is wrong with one mode alone, such as a share of another in it, is no loss,
    which all modes see.
    """
    off = np.sqrt(np.mean(residual**2, axis=1))
    return np.asarray(np.minimum(1.0, np.median(off[same]) / np.maximum(off, 1e-300)))


def _turned(
    value: FloatArray, columns: list[int], shapes: FloatArray, scale: FloatArray
) -> FloatArray:
    """(n b, n m) root of the covariance of paired modes' shapes, by what turns them towards
    others.
    """
    apart = np.abs(value[columns, None] - value) / np.sqrt(value[columns, None] * value)
    sd = np.sqrt(2) * DISCREPANCY / np.maximum(apart, _CLOSE)
    own = shapes[columns]
    across = shapes - (own @ shapes.T / np.sum(own**2, axis=1)[:, None])[..., None] * own[:, None]
    sd[np.arange(len(columns)), columns] = 0.0
    each = (scale[:, None] * sd)[..., None] * across
    return np.asarray(scipy.linalg.block_diag(*each.transpose(0, 2, 1)))


def _placed(state: ForwardState, slopes: FloatArray, basis: FloatArray) -> FloatArray:
    """(n b, 3 p + 2) root of the covariance of shapes with (n, p, 3) slopes by how far points, and
    the ends of their grid, are off their places: as far in each mode.
    """
    places = state.forward.places[: slopes.shape[1]]
    axis = int(np.argmax(np.ptp(places, axis=0)))
    x = (places[:, axis] - places[:, axis].min()) / max(float(np.ptp(places[:, axis])), 1e-300)
    own = np.einsum("pb,npk->nbpk", basis, POINT_SD * slopes)
    ends = GRID_SD * np.einsum("pb,np,pe->nbe", basis, slopes[..., axis], np.stack([x, 1 - x], 1))
    rows = len(slopes) * basis.shape[1]
    return np.hstack([own.reshape(rows, -1), ends.reshape(rows, -1)])


LOSSES = np.array([0.02, 0.06, 0.12, 0.2, 0.3, 0.4, 0.55, 0.7])
"""Shares of the stiffness that are lost, solved for; what is between is interpolated."""

SHAPES = 2.0 ** np.arange(-1.0, 5.5, 0.5)
"""Standard deviations of a shape over the usual one: to that of shapes which say nothing."""

_PARTS, _LONGEST = 20, 0.5  # of the body's longest side; share of it that a stretch takes at most
# sets at most, those with most energy; share of every mode's energy that is not looked at
_SETS, _SLIGHT = 4, 0.02
# steps between two lines, and so many to either side of likely stretches' ends, that are tried
_FINER, _NEAR = 4, 2
# probability of the stretches that are looked at closely, and how many at most
_LIKELY, _MOST = 0.99, 5
# deflections at most; share of the greatest energy of those that are left out
_STATIC, _TINY = 24, 1e-4


@dataclass(frozen=True)
class Stretch:
    """Some sets of a body between two places along an axis."""

    sets: tuple[str, ...]
    whole: bool  # whether these are all sets
    axis: int  # 0, 1, 2 for x, y, z
    # begin, end: m
    begin: float
    end: float

    @property
    def length(self) -> float:
        """M."""
        return self.end - self.begin


@dataclass(frozen=True)
class _Modes:
    """What modes with a loss are made of: the elastic modes of a solved body, and what else it may
    do.
    """

    value: FloatArray  # (m,) eigenvalues
    full: FloatArray  # (dofs, m) mass-normalised shapes
    seen: FloatArray  # (m, r) at the measured rows

    @classmethod
    def of(cls, state: ForwardState, columns: list[int]) -> _Modes:
        m = min(state.frequency_hz.size, max(columns) + 1 + ABOVE)
        return cls(
            state.modes.eigenvalue[state.modes.rigid :][:m],
            state.full_shapes[:, :m],
            state.shapes[:m],
        )

    def with_static(self, state: ForwardState, forces: FloatArray) -> _Modes:
        """The same and the deflections under (dofs, f) forces that are none of the body's modes, as
        modes of their own.
        """
        model, c = state.forward.specimen.model, state.coefficients
        K = model.stiffness.at(c.stiffness[: len(model.stiffness.names)])
        M = model.mass.at(c.mass[: len(model.mass.names)])
        known = state.modes.shapes if state.basis is None else state.basis @ state.modes.shapes
        more = factorise(shifted(K, M, -float(self.value[0]))).solve(forces)
        more -= known @ (known.T @ (M @ more))
        energy, turn = np.linalg.eigh(more.T @ (K @ more))
        kept = np.flatnonzero(energy > _TINY * energy[-1])[-_STATIC:]
        more = more @ (turn[:, kept] / np.sqrt(energy[kept]))
        inverse, turn = np.linalg.eigh(more.T @ (M @ more))
        more = more @ (turn / np.sqrt(inverse))[:, ::-1]
        seen = np.asarray((state.forward.observation @ more).T)
        value = np.concatenate([self.value, 1 / inverse[::-1]])
        return _Modes(value, np.hstack([self.full, more]), np.vstack([self.seen, seen]))


@dataclass(frozen=True)
class DamageEffects:
    """What losses of stiffness in P stretches do to the paired modes of a solved body, shapes at
    the measured points.
    """

    intervals: tuple[Stretch, ...]
    log_prior: FloatArray  # (P,)
    change: FloatArray  # (l, P, n) of ln f, by the losses solved for
    # what the measured shapes say, for each scale of their error; empty without any
    shapes: tuple[DamageTerms, ...]
    step: float  # between places where stretches end, m
    # length of the elements along the body, m: within one the energy is taken as even
    element: float

    @classmethod
    def of(cls, elastic: ElasticResult, number: int) -> DamageEffects | None:
        """Those of a campaign's body at the estimate; None of one that has no elements, or is not
        the model's.
        """
        state, columns = elastic.states[number], _columns(elastic, number)
        if (
            not state.forward.specimen.has_elements
            or elastic.rms_residual(elastic.rows[number]) > HOPELESS_MISS
        ):
            return None
        modes, (axis, lines) = _Modes.of(state, columns), _lines(state)
        names, energy = _most_loaded(state, modes, _energies(state, modes.full, lines))
        sets = [(name,) for name in names] + ([tuple(names)] if len(names) > 1 else [])
        pairs = list(zip(*np.triu_indices(_PARTS + 1, 1), strict=True))
        intervals = [
            Stretch(group, len(group) == len(names), axis, float(lines[a]), float(lines[b]))
            for group in sets
            for a, b in pairs
            if b - a <= _LONGEST * _PARTS
        ]
        share, step = np.array([1 / each.length for each in intervals]), float(lines[1] - lines[0])
        return _damage_effects(
            elastic,
            number,
            modes,
            intervals,
            np.log(share / share.sum()),
            names=names,
            lines=lines,
            energy=energy,
            step=step,
        )

    def of_sets(self, share: FloatArray) -> Iterator[tuple[DamageEffects, FloatArray]]:
        """Those of each group of sets, with what is left of (a, P) probabilities of stretches."""
        for sets in dict.fromkeys(each.sets for each in self.intervals):
            at = np.array([each.sets == sets for each in self.intervals])
            own = tuple(each for each in self.intervals if each.sets == sets)
            yield (
                replace(
                    self,
                    intervals=own,
                    log_prior=self.log_prior[at],
                    change=self.change[:, at],
                ),
                share[:, at],
            )

    def near(self, elastic: ElasticResult, number: int, share: FloatArray) -> DamageEffects:
        """Those in stretches about the likely ones, whose ends may lie between lines, of the body
        with static deflections.

        Args:
            elastic: the update.
            number: of the campaign.
            share: (P,) probabilities of the stretches, which are of the same sets.
        """
        state, columns = elastic.states[number], _columns(elastic, number)
        order, (_, lines) = np.argsort(-share), _lines(state)
        likely = order[: min(int(np.searchsorted(np.cumsum(share[order]), _LIKELY)) + 1, _MOST)]
        step, names = float(lines[1] - lines[0]) / _FINER, list(self.intervals[0].sets)
        nearby = dict[tuple[int, int], Stretch]()
        for each in (self.intervals[k] for k in likely):
            ends = [round((place - lines[0]) / step) for place in (each.begin, each.end)]
            for a, b in product(*([end + k for k in range(-_NEAR, _NEAR + 1)] for end in ends)):
                if 0 <= a < b <= _FINER * _PARTS:
                    begin, end = (float(lines[0] + k * step) for k in (a, b))
                    nearby[a, b] = replace(each, begin=begin, end=end)
        intervals = list(nearby.values())
        finer = np.unique(
            [lines[0], lines[-1], *(x for each in intervals for x in (each.begin, each.end))]
        )
        about = (lines[1:] > min(each.begin for each in intervals)) & (
            lines[:-1] < max(each.end for each in intervals)
        )
        modes = _Modes.of(state, columns)
        modes = modes.with_static(state, _forces(state, modes, columns, names, lines, about))
        sets = list(state.forward.specimen.model.mesh.sets)
        energy = _energies(state, modes.full, finer)[[sets.index(name) for name in names]]
        # As likely as those between lines, of which there are fewer.
        log_density = self.log_prior[0] + np.log(self.intervals[0].length * (step / self.step) ** 2)
        log_prior = np.array([log_density - np.log(each.length) for each in intervals])
        return _damage_effects(
            elastic,
            number,
            modes,
            intervals,
            log_prior,
            names=names,
            lines=finer,
            energy=energy,
            step=step,
        )


def _columns(elastic: ElasticResult, number: int) -> list[int]:
    return [column for _, column in elastic.pairings[number].pairs]


def _damage_effects(
    elastic: ElasticResult,
    number: int,
    modes: _Modes,
    intervals: list[Stretch],
    log_prior: FloatArray,
    *,
    names: list[str],
    lines: FloatArray,
    energy: FloatArray,
    step: float,
) -> DamageEffects:
    """Those in stretches that end at lines, by (sets, parts, m, m) energies of modes between
    lines.
    """
    whole = np.concatenate([np.zeros_like(energy[:, :1]), np.cumsum(energy, axis=1)], axis=1)
    parts = []
    for each in intervals:
        first, last = np.searchsorted(lines, [each.begin, each.end])
        parts.append(
            sum(whole[k, last] - whole[k, first] for k in (names.index(name) for name in each.sets))
        )
    solved = [
        _solved(modes.value, loss * np.array(parts), _columns(elastic, number)) for loss in LOSSES
    ]
    change, turned = (np.array(some) for some in zip(*solved, strict=True))
    shapes = DamageShapes.of(elastic, number, turned, modes.value, modes.seen)
    given = () if shapes is None else tuple(map(shapes.given, SHAPES.tolist()))
    mesh = elastic.states[number].forward.specimen.model.mesh
    along = mesh.nodes[:, _lines(elastic.states[number])[0]]
    element = max(float(np.ptp(along[block.nodes], axis=1).mean()) for block in mesh.blocks)
    return DamageEffects(tuple(intervals), log_prior, change, given, step, element)


def _solved(
    value: FloatArray, lost: FloatArray, columns: list[int]
) -> tuple[FloatArray, FloatArray]:
    """(P, n) changes of ln f of some modes with (m,) eigenvalues, and (P, n, m) what they are made
    of, by (P, m, m) losses.
    """
    left, vectors = np.linalg.eigh(np.diag(value) - lost)
    left = np.maximum(left, 1e-3 * value[0])
    order = np.array([most_alike(each) for each in vectors])[:, columns]
    change = np.log(np.take_along_axis(left, order, axis=1) / value[columns]) / 2
    turned = np.take_along_axis(vectors, order[:, None], axis=2).transpose(0, 2, 1)
    return change, turned / turned[:, np.arange(len(columns)), columns][..., None]


def _lines(state: ForwardState) -> tuple[int, FloatArray]:
    """The longest axis of a body, and lines between equal parts along it."""
    nodes = state.forward.specimen.model.mesh.nodes
    axis = int(np.argmax(np.ptp(nodes, axis=0)))
    return axis, np.linspace(nodes[:, axis].min(), nodes[:, axis].max(), _PARTS + 1)


def _most_loaded(
    state: ForwardState, modes: _Modes, energy: FloatArray
) -> tuple[list[str], FloatArray]:
    """The sets that are looked at, with their (sets, parts, m, m) energies, of those of all
    sets.
    """
    most = (np.einsum("sfmm->sm", energy) / modes.value).max(axis=1)
    kept = sorted(k for k in np.argsort(-most)[:_SETS] if most[k] > _SLIGHT)
    sets = list(state.forward.specimen.model.mesh.sets)
    return [sets[k] for k in kept], energy[kept]


@dataclass(frozen=True)
class _Share:
    """Elements of one set, and how much of them lies between neighbouring ones of some lines."""

    set_number: int
    group: Group
    elasticity: FloatArray  # (r, r) C
    share: FloatArray  # (parts, e·p) of each element's points


def _shares(state: ForwardState, lines: FloatArray, vectors: int) -> Iterator[_Share]:
    """Of all elements of a set, few enough at a time for so many vectors."""
    model = state.forward.specimen.model
    axis, K = _lines(state)[0], model.stiffness
    x, sets = model.mesh.nodes[:, axis], list(model.mesh.sets)
    owner = [
        next((k for k, own in enumerate(sets) if name.startswith(f"{own}.")), -1)
        for name in K.names
    ]
    for group in (part for whole in K.groups for part in whole.parts(vectors)):
        if owner[group.coefficients[0]] >= 0:  # else a spring
            C = np.tensordot(state.coefficients.stiffness[group.coefficients], group.terms, 1)
            share = np.repeat(_inside(x[group.nodes], lines), group.operators.shape[1], axis=1)
            yield _Share(owner[group.coefficients[0]], group, C, share)


def _energies(state: ForwardState, shapes: FloatArray, lines: FloatArray) -> FloatArray:
    """(sets, F, m, m) energies of (dofs, m) shapes between (F + 1,) lines, of all sets."""
    model, m = state.forward.specimen.model, shapes.shape[1]
    energy = np.zeros((len(model.mesh.sets), len(lines) - 1, m, m))
    motion = model.stiffness.everywhere(shapes)
    for each in _shares(state, lines, m):
        strains = each.group.strains(motion)
        for part in np.flatnonzero(each.share.any(axis=1)):
            rows = np.flatnonzero(each.share[part])
            some = strains[:, rows] * np.sqrt(each.share[part, rows])[:, None]
            energy[each.set_number, part] += np.tensordot(
                some, np.tensordot(each.elasticity, some, 1), ((0, 1), (0, 1))
            )
    return energy


def _forces(
    state: ForwardState,
    modes: _Modes,
    columns: list[int],
    names: list[str],
    lines: FloatArray,
    about: BoolArray,
) -> FloatArray:
    """(dofs, f) forces with which some sets' parts between lines resist some modes, over these'
    frequencies.
    """
    model = state.forward.specimen.model
    shapes = modes.full[:, columns] / np.sqrt(modes.value[columns])
    motion, parts = model.stiffness.everywhere(shapes), np.flatnonzero(about)
    forces, sets = np.zeros((len(names), parts.size, *motion.shape)), list(model.mesh.sets)
    for each in _shares(state, lines, len(columns) * parts.size):
        if sets[each.set_number] not in names:
            continue
        stress = np.tensordot(each.elasticity, each.group.strains(motion), 1)
        for number, part in enumerate(parts):
            if each.share[part].any():
                own = each.group.forces(stress * each.share[part][:, None], motion.shape[1])
                np.add.at(forces[names.index(sets[each.set_number]), number], each.group.nodes, own)
    free = forces[:, :, model.stiffness.pattern.free]
    return np.asarray(free.transpose(2, 0, 1, 3).reshape(free.shape[2], -1))


def _inside(x: FloatArray, lines: FloatArray) -> FloatArray:
    """(F, e) share of elements with nodes at (e, n) x that lies between neighbouring ones of (F +
    1,) lines.
    """
    thin = 1e-9 * (lines[-1] - lines[0])
    low = np.clip(x.min(axis=1), lines[0], lines[-1] - thin)
    high = np.maximum(x.max(axis=1), low + thin)
    within = np.minimum(high, lines[1:, None]) - np.maximum(low, lines[:-1, None])
    return np.asarray(np.maximum(within, 0.0) / (high - low))
