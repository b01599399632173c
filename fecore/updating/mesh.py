"""Meshes: one for a specimen and a band, and what the mesh of a body in space misses.

A mesh for a specimen and a band: elements as the waves need them, and an estimate of what they
miss.

The element's frequencies converge with the fourth power of its size along a strip, f(h) - f ∝ h⁴.
So a mesh half as fine along x misses 16 times as much there, and the difference of the two, over
15, is what the fine one misses (Richardson). Across, a layer as wide as the thickness lies along
each free edge, where twist turns into shear, which elements much wider than it do not see; so a
narrow strip begins with elements of its size. Elements are added until the largest estimate of the
modes in the band is below the tolerance.

What a body's own mesh misses, mode by mode, and the model without it.

The modes φ of the body are carried to finer meshes (`fecore.body.refine`) and moved there into the
space of the lowest modes by (K - σM)⁻¹M. In that space, turned as near to φ as it goes, the finer
mesh's own matrices ZᵀK_kZ and ZᵀM_jZ stand for φᵀK_kφ and φᵀM_jφ. So a basis that holds φ has the
finer mesh's frequencies where φ are modes, their derivatives by all constants, and what close modes
do to each other; elsewhere it is right to the first order in constants times mesh.

With the size h of elements the error goes with h⁴ where motion is smooth, so there what the finest
mesh misses is taken to be a tenth of what it moved. About the corner of a cut-out it goes with
h¹·⁰⁹ only (Williams 1952: stresses as r^-0.456 at 270°), and no mesh that is worth its time gets
rid of it; but it is a share of the strain energy of the elements at the corner, whatever the mode.
The shares are those of isotropic plates in the form of an L, and of an orthotropic one with a
cut-out, by quad8 elements of two sizes. Facets that turn little are taken for a curve, the more
surely the less they turn.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
import scipy

from fecore.arrays import FloatArray, IntArray
from fecore.body.affine import AffineMatrix
from fecore.body.constants import Body
from fecore.body.facets import SMOOTH, facet_turn, re_entrant
from fecore.body.refine import Refined, element_size, is_quadratic, refined
from fecore.body.specimen import FlatBody
from fecore.body.structure import Structure
from fecore.correlation import most_alike
from fecore.dynamics.bodies import body_modes
from fecore.dynamics.eigen import NormalModes, mass_orthonormal, modes_below, shifted
from fecore.dynamics.factor import factorise
from fecore.dynamics.reduction import ReducedSystem
from fecore.errors import InputError

DISCRETISATION = 2e-4
"""Largest relative error of a natural frequency by the mesh."""

_PER_WAVE = 6.0  # elements a bending wave's length to begin with
_FEWEST = (8, 2)  # elements along and across
_EDGE_LAYER = 2.0  # thicknesses that an element may be wide, to begin with, …
_MOST_ACROSS = 16  # … but not beyond so many elements: on a wide plate the layer weighs little
_MOST = 1500  # elements: a job with more would take minutes
# wanted elements from which those allowed are fewer than two a wave, and modes thousands
_HOPELESS = 9 * _MOST
_SAFETY = 1.3  # on the number of elements that the fourth power asks for

AnyBody = TypeVar("AnyBody", bound=Body)


@dataclass(frozen=True)
class Discretisation:
    """A mesh and what it misses."""

    divisions: tuple[int, int]  # elements along the length and across the width
    # (n,) estimated relative errors of the elastic natural frequencies in the band
    error: FloatArray
    by_side: FloatArray  # the largest of them by the size along the length, and by that across


def meshed(body: AnyBody, highest_hz: float) -> tuple[AnyBody, Discretisation | None]:
    """The body with a mesh for its modes up to a frequency, and what that misses; as it is where it
    has one of its own.
    """
    strip = body.unmeshed
    if strip is None:
        return body, None
    mesh = discretise(strip, highest_hz)
    return body.with_mesh(mesh.divisions), mesh


def nominal_matrices(body: Body) -> tuple[scipy.sparse.csc_array, scipy.sparse.csc_array]:
    """K and M of a body at its nominal constants."""
    constants = np.array(list(body.nominal.values()))
    springs = [spring.stiffness for spring in body.springs]
    stiffness = np.concatenate([body.stiffness_coefficients(constants), springs])
    return body.model.stiffness.at(stiffness), body.model.mass.at(body.mass_coefficients(constants))


def discretise(specimen: FlatBody, highest_hz: float) -> Discretisation:
    """Choose a specimen's mesh for its modes up to a frequency, at its nominal constants.

    Where the tolerance would take more elements than `_MOST`, the finest mesh allowed stands with
    what it misses.

    Raises:
        InputError: the body is so large for its thickness and the band that no mesh allowed follows
            its waves.
    """
    needed = _first(specimen, highest_hz)
    if needed[0] * needed[1] > _HOPELESS:
        sides = " × ".join(
            f"{side:g}" for side in (specimen.length, specimen.width, specimen.thickness)
        )
        raise InputError(
            "geometry",
            f"of {sides} m takes {needed[0]} × {needed[1]} elements for its waves up to"
            f" {highest_hz:.4g} Hz, in all {needed[0] * needed[1]} and more than {_HOPELESS}:"
            " lengths are in m, not in mm; or lower the band",
        )
    divisions = _within(needed)
    for _ in range(3):  # solving, estimating and refining
        estimated = _estimate(specimen, divisions, highest_hz)
        if estimated.error.max(initial=0.0) <= DISCRETISATION or np.prod(divisions) >= 0.9 * _MOST:
            break
        ratios = _SAFETY * (2 * estimated.by_side / DISCRETISATION) ** 0.25
        more = tuple(int(np.ceil(d * max(g, 1.0))) for d, g in zip(divisions, ratios, strict=True))
        divisions = _within((more[0], more[1]))
    return estimated


def _estimate(specimen: FlatBody, divisions: tuple[int, int], highest_hz: float) -> Discretisation:
    """What a mesh misses, by meshes half as fine along one side each."""
    fine = _frequencies(specimen, divisions, highest_hz)
    errors = []
    for axis, d in enumerate(divisions):
        half = max(1, d // 2)
        coarse = (half, divisions[1]) if axis == 0 else (divisions[0], half)
        apart = np.abs(_frequencies(specimen, coarse, highest_hz, fine.size) / fine - 1)
        errors.append(apart / ((d / half) ** 4 - 1))
    return Discretisation(divisions, np.sum(errors, axis=0), np.max(errors, axis=1))


def _within(divisions: tuple[int, int]) -> tuple[int, int]:
    """No more elements than are allowed, in the same proportion."""
    share = min(1.0, float(np.sqrt(_MOST / np.prod(divisions))))
    return max(2, int(divisions[0] * share)), max(2, int(divisions[1] * share))


def _first(specimen: FlatBody, highest_hz: float) -> tuple[int, int]:
    """By the length of bending waves at the highest frequency, k⁴ = ρtω²/D, along x and across."""
    section = specimen.section
    mass, omega = section.inertia[0], 2 * np.pi * highest_hz
    waves = [2 * np.pi * (section.D[i, i] / (mass * omega**2)) ** 0.25 for i in (0, 1)]
    sides = zip((specimen.length, specimen.width), waves, _FEWEST, strict=True)
    nx, ny = (max(fewest, int(np.ceil(_PER_WAVE * side / wave))) for side, wave, fewest in sides)
    layered = int(np.ceil(specimen.width / (_EDGE_LAYER * specimen.thickness)))
    return nx, max(ny, min(layered, _MOST_ACROSS))


def _frequencies(
    specimen: FlatBody,
    divisions: tuple[int, int],
    highest_hz: float,
    count: int = 0,
) -> FloatArray:
    """(n,) elastic natural frequencies up to the highest, or as many as are asked for, Hz."""
    meshed = specimen.with_mesh(divisions)
    model, (K, M) = meshed.model, nominal_matrices(meshed)
    rigid = model.rigid_modes.shape[1]
    number = count or max(modes_below(K, M, (2 * np.pi * highest_hz) ** 2) - rigid, 1)
    frequencies: FloatArray = body_modes(model, K, M, number).frequency_hz[rigid:]
    return frequencies


MOST_DOFS = 300_000
"""Of a finer mesh; the mesh of a body with more is taken on trust."""

_CHEAP = 30_000  # dofs up to which a finer mesh is made finer still, …
_ROUNDS = 3  # … at most so often, …
_CLOSE = 2e-3  # … while a mode moves by more
_LEFT = 0.1  # share of what the last refinement moved that the finest mesh may still miss

_AT_CORNERS = {
    "A": 0.10,
    "D": 0.04,
    "S": 0.04,
}  # shares of the energy of quadratic elements at a corner; as L-plates have them, …

_OF_CORNERS = 0.4  # … and one standard deviation of these, relative
# probability that facets are those of the body where they turn by 30°; in proportion where by less
_FACETED = 0.1
_LEAST = 0.01  # of an eigenvalue, that the body's own mesh gives at least
_SETTLED, _SWEEPS = 1e-5, 3  # relative change of an eigenvalue by one more sweep; sweeps


@dataclass(frozen=True)
class Forms:
    """Differences of the matrices of the m modes at the reference, by the coefficients of the
    body's own model.
    """

    stiffness: FloatArray  # (k, m, m)
    mass: FloatArray  # (j, m, m)

    def __sub__(self, other: Forms) -> Forms:
        return Forms(self.stiffness - other.stiffness, self.mass - other.mass)

    def __rmul__(self, factor: float) -> Forms:
        return Forms(factor * self.stiffness, factor * self.mass)

    def shift(
        self, along: FloatArray, value: FloatArray, stiffness: FloatArray, mass: FloatArray
    ) -> FloatArray:
        """(n,) first-order relative changes of frequency of mass-normalised (m, n) motions with
        eigenvalues (n,).
        """
        energy = np.einsum("mn,mo,on->n", along, np.tensordot(stiffness, self.stiffness, 1), along)
        inertia = np.einsum("mn,mo,on->n", along, np.tensordot(mass, self.mass, 1), along)
        return np.asarray((energy / value - inertia) / 2)


@dataclass(frozen=True)
class MeshError:
    """What a body's mesh misses, about some constants."""

    images: FloatArray  # (dofs, m) Mφ of the elastic modes φ there
    whole: Forms  # from the body's own mesh to the finest, and beyond it about corners
    left: Forms  # one standard deviation of what the finest may miss
    flat: Forms | None  # from a curved surface to flat facets, where the mesh does not say which
    turn: float  # of the facets, rad
    size: float  # of the body's elements, m
    finest: float  # of those of the finest mesh
    order: int  # of the size, with which the error of the body's elements goes

    def size_for(self, share: float) -> float:
        """Size of elements that miss such a share of what the body's miss, m."""
        return float(self.size * min(share, 1.0) ** (1 / self.order))

    def moved(
        self, shapes: FloatArray, value: FloatArray, stiffness: FloatArray, mass: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(n,) relative changes of the frequencies of modes on the finest mesh.

        Args:
            shapes: (dofs, n) mass-normalised.
            value: (n,) eigenvalues.
            stiffness: (k,) coefficients of the model.
            mass: (j,) likewise.

        Returns:
            Those by the body's own mesh; one standard deviation of what the finest may miss; root
            mean squares of flat facets.
        """
        rest = self.images.T @ shapes, value, stiffness, mass
        own = np.sqrt(np.maximum(1 - 2 * self.whole.shift(*rest), _LEAST)) - 1
        share = np.sqrt(_FACETED * self.turn / SMOOTH)  # of the difference: its root mean square
        flat = np.zeros(value.size) if self.flat is None else share * self.flat.shift(*rest)
        return own, self.left.shift(*rest), flat

    def frequencies(self, value: FloatArray, stiffness: FloatArray, mass: FloatArray) -> FloatArray:
        """(m,) frequencies in Hz on the finest mesh of the modes at the reference, whose own
        eigenvalues are (m,).
        """
        K = np.diag(value) + np.tensordot(stiffness, self.whole.stiffness, 1)
        M = np.eye(value.size) + np.tensordot(mass, self.whole.mass, 1)
        fine, turn = scipy.linalg.eigh(K, M)
        return np.asarray(np.sqrt(fine[most_alike(turn)]) / (2 * np.pi))

    def corrected(self, system: ReducedSystem) -> ReducedSystem:
        """A basis with the finest mesh's matrices of the modes."""
        W = system.basis.T @ self.images
        return replace(
            system,
            stiffness=system.stiffness + W @ self.whole.stiffness @ W.T,
            mass=system.mass + W @ self.whole.mass @ W.T,
        )


class Finer:
    """Finer meshes of a body, made once."""

    def __init__(self, body: Structure) -> None:
        self.body = body
        self._levels: list[Refined] = []

    @classmethod
    def of(cls, body: Body) -> Finer | None:
        """Of a body with a mesh of its own that can be made finer; None of strips, of matrices and
        of large ones.
        """
        own = body.in_space
        if own is None:
            return None
        growth = 4 if is_quadratic(own.mesh) else 3
        return cls(own) if growth * len(own.mesh.nodes) * len(own.dofs) <= MOST_DOFS else None

    @cached_property
    def _flat(self) -> Refined | None:
        return refined(self.body, curved=False) if self.turn else None

    @cached_property
    def _corners(self) -> IntArray:
        return re_entrant(self.body.mesh)

    @cached_property
    def turn(self) -> float:
        """Of facets that may be a curved surface, rad; 0 where there are none."""
        return facet_turn(self.body.mesh)

    def level(self, number: int) -> Refined:
        """The body on a mesh that was refined so often, with the interpolation from its own."""
        while len(self._levels) < number:
            finer = refined(self._levels[-1].body if self._levels else self.body)
            if self._levels:
                finer = Refined(finer.body, finer.interpolation @ self._levels[-1].interpolation)
            self._levels.append(finer)
        return self._levels[number - 1]

    def error(
        self,
        modes: NormalModes,
        constants: FloatArray,
        springs: FloatArray,
        held: float = np.inf,
        *,
        with_flat: bool = True,
    ) -> MeshError:
        """What the mesh misses about some constants.

        Args:
            modes: of the body's own mesh there, with shapes over its dofs.
            constants: of the body, in the order of `nominal`.
            springs: stiffnesses of its springs.
            held: eigenvalue up to which modes count.
            with_flat: try facets that may be a curved surface flat too.
        """
        shapes = modes.shapes[:, modes.rigid :]
        value = modes.eigenvalue[modes.rigid :]
        own = _Values.of(self.body, constants, springs)
        base = own.forms(shapes)
        model = self.body.model

        def solved(level: Refined) -> tuple[Forms, Forms]:
            """The forms, and those of what the mesh misses about corners."""
            fine = _Values.of(level.body, constants, springs)
            motion = level.interpolation @ model.everywhere(shapes).reshape(len(model.free), -1)
            motion = motion.reshape(-1, 6, shapes.shape[1])[:, list(model.dofs)][
                level.body.model.free
            ]
            moved = _moved(fine, motion, modes.shift)
            return fine.named_as(fine.forms(moved), own), fine.named_as(
                fine.at_corners(moved, self._corners), own
            )

        def off(change: Forms) -> float:
            own_shift = np.abs(change.shift(np.eye(len(value)), value, own.stiffness, own.mass))
            return float(own_shift[value <= held].max(initial=0.0))

        before, (after, at_corners), number = base, solved(self.level(1)), 1
        while (
            number < _ROUNDS and off(after - before) > _CLOSE and self._next_size(number) <= _CHEAP
        ):
            number += 1
            before, (after, at_corners) = after, solved(self.level(number))
        flat = None
        if with_flat and self._flat is not None:
            flat = solved(self._flat)[0] - solved(self.level(1))[0]
        sizes = element_size(self.body.mesh), element_size(self.level(number).body.mesh)
        order = 4 if is_quadratic(self.body.mesh) else 2
        images = model.mass.at(own.mass) @ shapes
        left = _LEFT * (after - before) - _OF_CORNERS * at_corners
        return MeshError(images, after - base - at_corners, left, flat, self.turn, *sizes, order)

    def _next_size(self, number: int) -> int:
        return 4 * len(self.level(number).body.mesh.nodes) * len(self.body.dofs)


@dataclass(frozen=True)
class _Values:
    """A body's model with the coefficients of some constants."""

    body: Structure
    stiffness: FloatArray  # (k,)
    mass: FloatArray  # (j,)

    @classmethod
    def of(cls, body: Structure, constants: FloatArray, springs: FloatArray) -> _Values:
        stiffness = np.concatenate([body.stiffness_coefficients(constants), springs])
        return cls(body, stiffness, body.mass_coefficients(constants))

    def forms(self, shapes: FloatArray) -> Forms:
        """The matrices' parts between (dofs, m) shapes."""
        model, all_of = self.body.model, slice(0, shapes.shape[1])
        return Forms(model.stiffness.project(shapes, all_of), model.mass.project(shapes, all_of))

    def at_corners(self, shapes: FloatArray, corners: IntArray) -> Forms:
        """What the mesh misses about corners, between (dofs, m) shapes."""
        model, count = self.body.model, shapes.shape[1]
        forms = Forms(
            np.zeros((len(self.stiffness), count, count)), np.zeros((len(self.mass), count, count))
        )
        if corners.size:
            share = np.array(
                [
                    _AT_CORNERS.get(name.rpartition(".")[2][:1], 0.0)
                    for name in model.stiffness.names
                ]
            )
            energy = model.stiffness.about(corners).project(shapes, slice(0, count))
            forms = replace(forms, stiffness=share[:, None, None] * energy)
        return forms

    def named_as(self, forms: Forms, own: _Values) -> Forms:
        """This model's forms by the coefficients of another's, of the same constants."""
        mine, other = self.body.model, own.body.model
        return Forms(
            _by_names(
                forms.stiffness, mine.stiffness, other.stiffness, self.stiffness, own.stiffness
            ),
            _by_names(forms.mass, mine.mass, other.mass, self.mass, own.mass),
        )


def _by_names(
    forms: FloatArray, of: AffineMatrix, names: AffineMatrix, values: FloatArray, others: FloatArray
) -> FloatArray:
    """Forms by another matrix's coefficients; what that has not, such as a joint's, goes with the
    largest of its set.
    """
    place = {name: k for k, name in enumerate(names.names)}
    sums = np.zeros((len(names.names), *forms.shape[1:]))
    for k, name in enumerate(of.names):
        if name in place:
            sums[place[name]] += forms[k]
            continue
        prefix = name.split(".joint")[0].rpartition(".")[0] or name.split(".joint")[0]
        like = [j for j, each in enumerate(names.names) if each.startswith(prefix)] or range(
            len(others)
        )
        target = max(like, key=lambda j: others[j])
        sums[target] += forms[k] * values[k] / others[target]
    return sums


def _moved(fine: _Values, motion: FloatArray, shift: float) -> FloatArray:
    """(dofs, m) M-orthonormal vectors of the space of the lowest modes, as near to (dofs, m)
    motions as it has them.
    """
    model = fine.body.model
    K, M = model.stiffness.at(fine.stiffness), model.mass.at(fine.mass)
    rigid, factor = mass_orthonormal(model.rigid_modes, M), factorise(shifted(K, M, shift))
    images = M @ rigid

    def upright(vectors: FloatArray) -> FloatArray:
        return np.asarray(vectors - rigid @ (images.T @ vectors))

    first = upright(motion)
    pushed = M @ first
    vectors, image, before = first, pushed, np.zeros(motion.shape[1])
    for _ in range(_SWEEPS):
        vectors = upright(factor.solve(image))
        heavy = M @ vectors
        inertia = vectors.T @ heavy
        # (K - σM) times what was solved for is its right side, and K moves nothing rigidly.
        value, turn = scipy.linalg.eigh(vectors.T @ image + shift * inertia, inertia)
        vectors, image = vectors @ turn, heavy @ turn
        if np.all(np.abs(value - before) <= _SETTLED * value):
            break
        before = value
    left, _, right = np.linalg.svd(vectors.T @ pushed)
    return np.asarray(vectors @ (left @ right))


def on_finer_mesh(
    body: Body, modes: NormalModes, constants: FloatArray, springs: FloatArray
) -> FloatArray | None:
    """(n,) frequencies in Hz of a body's elastic modes on a finer mesh; None where its mesh is
    taken on trust.

    Args:
        body: solved on its own mesh.
        modes: over its dofs, at these constants.
        constants: in the order of `nominal`.
        springs: stiffnesses of its springs.
    """
    finer = Finer.of(body)
    if finer is None:
        return None
    own = _Values.of(finer.body, constants, springs)
    error = finer.error(modes, constants, springs, with_flat=False)
    return error.frequencies(modes.eigenvalue[modes.rigid :], own.stiffness, own.mass)
