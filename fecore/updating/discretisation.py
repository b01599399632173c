"""A mesh for a specimen and a band: elements as the waves need them, and an estimate of what they
miss.

The element's frequencies converge with the fourth power of its size along a strip, f(h) - f ∝ h⁴.
So a mesh half as fine along x misses 16 times as much there, and the difference of the two, over
15, is what the fine one misses (Richardson). Across, a layer as wide as the thickness lies along
each free edge, where twist turns into shear, which elements much wider than it do not see; so a
narrow strip begins with elements of its size. Elements are added until the largest estimate of the
modes in the band is below the tolerance.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import scipy

from fecore.arrays import FloatArray
from fecore.body.constants import Body
from fecore.body.specimen import FlatBody
from fecore.dynamics.bodies import body_modes
from fecore.dynamics.eigen import modes_below
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
_ROUNDS = 3  # of solving, estimating and refining


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
    for _ in range(_ROUNDS):
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
