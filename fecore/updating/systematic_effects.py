"""Inputs that are believed to be nothing, but may be something: a clamp that gives way, fibres
askew, a sensor not stated.

Their prior is one-sided, or they count by their square, so the estimate stays where they are
nothing and the interval reaches to where they would be something. What each does to the natural
frequencies is exact to first order, or solved for:

- a clamp's compliance C lets the edge move by C times the reaction R of a mode, δλ = -R² C; and as
  a rigid motion r of the whole body strains nothing, its reaction is that of the inertia, R = λ
  rᵀMφ;
- of a body in space that one clamp holds, the clamp is a block on an even bed over the clamped
  nodes and their walls: 1 for translations, about its middle J = mean(r²1 − rrᵀ) + t²/12 for
  rotations, so δλ = -c Rᵀ diag(1, J)⁻¹ R, and c is that which lowers the first mode by what EI/kL
  lowers a strip's, δλ/λ = -4 EI/kL;
- a mass m at a point where the mode moves by φ lowers it by δλ = -λ m φ²; one that nobody stated
  may be large for the body, so the modes Λ are solved for with it, on I + m φφᵀ;
- what a mesh misses is the same sort of error in all modes (`fecore.updating.mesh_error`);
- fibres askew by an angle change it by the angle's square, so the model is solved with them at one
  standard deviation.

A one-sided input a ≥ 0, in its standard deviations, is what the frequencies leave of it. a ~ N(0,
1) changes ln f by ea: with the score b = eᵀWμ and the information i = eᵀMe of the data, the other
unknowns following (`screening`), a is a Gaussian of mean b/(1 + i) and variance 1/(1 + i), cut off
at 0. So what it moves a constant by is bounded by the constant's prior, and is small where it would
have left other traces.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import scipy

from fecore.arrays import FloatArray
from fecore.body.supports import PointMass
from fecore.correlation import most_alike
from fecore.normal import Z_95
from fecore.quantities import CLAMP
from fecore.updating.forward import ForwardState
from fecore.updating.inputs import UNSTATED_SENSOR, Inputs

MESH = "mesh"
"""The budget's source for what meshes miss."""

_SOLVED_TO = 1e-5  # relative, of a frequency on the reduced basis: a difference below is round-off


@dataclass(frozen=True)
class SystematicEffect:
    """What one standard deviation of an input does."""

    name: str  # of the input
    shift: FloatArray  # (n,) relative change of the model's elastic natural frequencies
    # `one-sided` and linear; `square`: as the square of a Gaussian; `both` sides alike
    kind: Literal["one-sided", "square", "both"]
    stated: bool  # whether the laboratory stated the standard deviation
    amount: str  # one standard deviation in words, with its unit

    # centre, width: of a one-sided input's Gaussian, in standard deviations of its prior, as the
    # data leave it
    centre: float = 0.0
    width: float = 1.0

    def conditioned(self, score: float, information: float) -> SystematicEffect:
        """A one-sided input as data leave it, by their score and information of it in its standard
        deviations.
        """
        return replace(self, centre=score / (1 + information), width=(1 + information) ** -0.5)

    @property
    def _log_share(self) -> float:
        """Logarithm of the share of the Gaussian that is not cut off."""
        return float(scipy.special.log_ndtr(self.centre / self.width))

    @property
    def _mean(self) -> float:
        """Of a one-sided input."""
        at = self.centre / self.width
        return float(
            self.centre + self.width * np.exp(-(at**2) / 2 - self._log_share) / np.sqrt(2 * np.pi)
        )

    @property
    def rms(self) -> float:
        """Root mean square of the input's effect, over that of one standard deviation: √E[z⁴] = √3
        for a square.
        """
        if self.kind == "one-sided":
            return float(np.sqrt(max(self.width**2 + self.centre * self._mean, 0.0)))
        return float(np.sqrt(3.0)) if self.kind == "square" else 1.0

    @property
    def sd(self) -> float:
        """Standard deviation of the effect about its own mean, likewise."""
        if self.kind == "one-sided":
            return float(np.sqrt(max(self.rms**2 - self._mean**2, 0.0)))
        return float(np.sqrt(2.0)) if self.kind == "square" else 1.0

    def draws(self, random: np.random.Generator, count: int) -> FloatArray:
        """(n,) draws of the input's effect, in that of one standard deviation."""
        normal = random.standard_normal(count)
        if self.kind == "one-sided":
            return self._beyond(np.log(2) + scipy.special.log_ndtr(-np.abs(normal)))
        return normal**2 if self.kind == "square" else normal

    @property
    def reach(self) -> float:
        """Of 95 % of the effect, over that of one standard deviation."""
        if self.kind == "one-sided":
            return float(self._beyond(np.log(0.05)))
        return Z_95**2 if self.kind == "square" else Z_95

    def _beyond(self, log_p: FloatArray | float) -> FloatArray:
        """What a one-sided input exceeds with a probability."""
        return np.asarray(
            self.centre - self.width * scipy.special.ndtri_exp(self._log_share + log_p)
        )


def systematic_effects(
    state: ForwardState, inputs: Inputs, fixed_points: Sequence[int]
) -> tuple[SystematicEffect, ...]:
    """All excursions of a body's inputs that change its frequencies.

    Args:
        state: the updated model.
        inputs: what the laboratory says of its inputs.
        fixed_points: points at which a sensor stood through the test, if one was not stated.
    """
    effects = [
        *_clamp(state, inputs),
        *_sensor(state, inputs, fixed_points),
        *_fibres(state, inputs),
        *_mesh(state),
    ]
    return tuple(each for each in effects if np.any(each.shift))


def _clamp(state: ForwardState, inputs: Inputs) -> list[SystematicEffect]:
    """Rotation of the clamp, and its translation and roll: EI/kL and (t/L)² of it; of a body in
    space those of a block on an even bed.
    """
    body, model = state.forward.specimen, state.forward.specimen.model
    sd, stated = inputs.standard_deviation(CLAMP), inputs.is_stated(CLAMP)
    if not sd:
        return []
    value = state.modes.eigenvalue[state.modes.rigid :]
    amount = f"EI/kL = {sd:.3g}"
    if (bed := body.bed) is not None:
        yields = bed.yields(state.participation(model.motions)) * value
        lowered = -2 * sd * yields / yields[0]
        return [SystematicEffect("clamp", lowered, "one-sided", stated, amount)]
    if (root := body.root(state.constants)) is None:
        return []
    EI, L, b, t = root.bending_stiffness, root.length, root.width, root.thickness
    heave, roll, pitch = state.participation(model.motions[:, 2:5])
    pitch = pitch - model.mesh.nodes[:, 0].mean() * heave  # about the edge x = 0
    across = sd * (t / L) ** 2 * L**3 / EI
    rotation = -value * pitch**2 * sd * L / EI / 2
    translation = -value * (heave**2 + 12 / b**2 * roll**2) * across / 2
    of_translation = f"EI/kL³ = {sd * (t / L) ** 2:.2g}"
    return [
        SystematicEffect("clamp_rotation", rotation, "one-sided", stated, amount),
        SystematicEffect("clamp_translation", translation, "one-sided", stated, of_translation),
    ]


def _sensor(
    state: ForwardState, inputs: Inputs, fixed_points: Sequence[int]
) -> list[SystematicEffect]:
    """The stated sensor's mass, or that of one that nobody stated."""
    forward, body = state.forward, state.forward.specimen
    carried = [each.on_surface() if isinstance(each, PointMass) else each for each in body.masses]
    masses = [each for each in carried if isinstance(each.where, tuple) and not each.weighed]
    stated = inputs.is_stated("sensor_mass")
    kind: Literal["both", "one-sided"] = "both"
    if masses:
        sds = np.array([inputs.standard_deviation("sensor_mass", each.mass) for each in masses])
        shift = (
            -np.sum(state.displacement(np.array([each.where for each in masses])) ** 2, axis=2)
            @ sds
            / 2
        )
    elif fixed_points and not forward.roving_mass:
        sds = np.full(len(fixed_points), inputs.sensor_mass_sd if stated else UNSTATED_SENSOR)
        places = forward.places[[forward.points.index(point) for point in fixed_points]]
        kind, shift = "one-sided", _with_masses(state, places, sds)
    else:
        return []
    return [SystematicEffect("sensor_mass", shift, kind, stated, f"{1e3 * sds.max():.2g} g")]


def _with_masses(state: ForwardState, places: FloatArray, masses: FloatArray) -> FloatArray:
    """(n,) relative change of the elastic frequencies by (p,) masses at (p, 3) places."""
    rows, modes = state.forward.specimen.model.displacement(places), state.modes
    moved = (rows if state.basis is None else rows @ state.basis) @ modes.shapes
    value = np.where(np.arange(modes.eigenvalue.size) < modes.rigid, 0.0, modes.eigenvalue)
    heavier = np.eye(value.size) + (moved.T * np.repeat(masses, 3)) @ moved
    loaded, turn = scipy.linalg.eigh(np.diag(value), heavier)
    order = most_alike(turn)[modes.rigid :]
    return np.asarray(np.sqrt(loaded[order] / value[modes.rigid :]) - 1)


def _fibres(state: ForwardState, inputs: Inputs) -> list[SystematicEffect]:
    """Fibres askew by one standard deviation, to one side and to the other.

    Where the angle is a parameter the fit has its first derivative, and the square alone is left,
    as at 0° and 90°.
    """
    forward, body, prior = state.forward, state.forward.specimen, state.forward.parametrisation
    sd = inputs.standard_deviation("fibre_angle")
    if not sd or body.turned(sd) is None:
        return []
    stated, amount = inputs.is_stated("fibre_angle"), f"{np.degrees(sd):.2g}°"
    if "fibre_angle" in prior.names:
        step = np.where(np.array(prior.names) == "fibre_angle", sd, 0.0)
        both = sum(forward.frequencies_at(prior, state.theta + sign * step) for sign in (1, -1))
        return [
            SystematicEffect(
                "fibre_angle", both / (2 * state.frequency_hz) - 1, "square", stated, amount
            )
        ]
    shifts: list[FloatArray] = []
    for side in filter(None, (body.turned(sd), body.turned(-sd))):
        if shifts and body.is_mirrored:  # turned to the other side it is its own mirror image
            shifts.append(shifts[0])
            continue
        turned = replace(prior, body=side)
        shifts.append(forward.frequencies_at(turned, state.theta) / state.frequency_hz - 1)
    even, odd = (shifts[0] + shifts[1]) / 2, (shifts[0] - shifts[1]) / 2
    return [
        SystematicEffect("fibre_angle", even, "square", stated, amount),
        SystematicEffect(
            "fibre_angle_linear",
            np.where(np.abs(odd) > _SOLVED_TO, odd, 0.0),
            "both",
            stated,
            amount,
        ),
    ]


def _mesh(state: ForwardState) -> list[SystematicEffect]:
    """What the finest mesh may still miss, and facets of a surface that was taken to be curved."""
    if state.by_mesh is None:
        return []
    _, missed, flat = state.by_mesh
    words = f"at most {100 * np.abs(missed).max(initial=0.0):.2g} % of a frequency"
    if flat.any():
        words += f", and {100 * np.abs(flat).max():.2g} % were the facets flat"
    return [
        SystematicEffect(MESH, missed, "both", False, words),
        SystematicEffect(MESH, flat, "one-sided", False, words),
    ]


def fixed_points(responses: Sequence[int], references: Sequence[int]) -> tuple[int, ...]:
    """Points at which a sensor stood while the hammer moved: response points far fewer than
    reference points.
    """
    sensors = tuple(sorted(set(responses)))
    return sensors if len(sensors) < len(set(references)) else ()
