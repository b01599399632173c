"""What a laboratory knows of its inputs, how well, and what inputs do that are believed to be
nothing.

What a laboratory knows of its inputs, and how well.

Every number that a laboratory hands in beside the modes has an error of its own: lengths, density,
the angle of the fibres, Poisson's ratio, the sensor's mass, the clamp, the delay between channels,
the window. Each is a nuisance with a prior. A standard deviation that is not stated is that of a
careful laboratory:

| input | standard deviation | why |
|---|---|---|
| length | 0.5 mm | a steel rule at both ends; where a clamp begins to hold is no better known |
| width | 0.2 mm | a calliper on a sawn edge |
| thickness | 1.2 % | moulded laminates vary by that over their area; so do the two thicknesses of the source paper's one bar |
| density | 1.5 % | weight over volume, of which the thickness is a part |
| Poisson's ratio | 0.05 | a handbook's value |
| fibre angle | 1° | hand lay-up and sawing |
| angle of each ply of a stack about the others | 1° | hand lay-up |
| clamp, EI/kL | 0.0075, one-sided | a vice on a bench: the source paper's own was 0.012 |
| sensor not stated | 1 g, one-sided | a small accelerometer that nobody wrote down |
| sensor stated | 5 % | its cable and wax |
| a point of the grid | 1 mm | a pencil's cross, and the middle of the hits at it |
| the grid along the body | 2 mm | a tape that slips, or a drawing's other end |
| delay between channels | 30 µs | one line of a slow multiplexed converter |
| window not stated | rate 4/T, one-sided | exponential windows are the habit of hammer tests; T is the record's length |

A clamp gives way in translation too, as the elastic jaw does that lets it rotate: by (t/L)² of
EI/kL.

What shear theory misses of shells, and what a laminate that is not the same everywhere misses of
itself.

What is left of theory goes with the strain energy in transverse shear, of which mode k has the
share U_k, so an error of κ = 5/6 moves every mode alike,

    δf_k/f_k = ½ U_k δκ/κ,

and is one unknown of 2 %. Where a body lies in space its walls grow thinner where they are
stretched (`fecore.body.laminate.along_normal`), and waves are met to 0.02 % where they are twelve
thicknesses long; the unknown stands for Poisson's ratios through the thickness, 0.25 ± 0.1, which
are 0.5 to 1.3 % of κ, and for the layer along free edges, where twist asks for 0.7 % more
(Reissner's plate has a torsional stiffness of 1 - 0.6325 t/b, St-Venant's bar 1 - 0.6302 t/b). Of
strips and plates that only bend it stands for all of it: bending of a strip asks for νG/3E of κ, 1
to 2 %, much as twist does. Against solids of another code (`tests.support.blind_beams`: cantilevers
and free beams, constants and sizes drawn at random, all modes to 1.6 kHz, two bricks through the
thickness, which are 1 % too stiff in shear themselves) they are off by 0.04 to 0.08 % of a
frequency (rms), torsion most. Without the unknown 0.002 % is left of free beams, and 0.006 % of
clamped ones, whose root a solid keeps from growing thinner too, what the mesh misses included.

Beside theory there is the body. Laminates that vary by 1.2 % in thickness over their area
(`fecore.updating.inputs`) miss the frequencies of an even body by 0.1 % (`DISCREPANCY`). A
laboratory that knows its thickness better has a body that varies less, so this part follows the
thickness's standard deviation; the modes may say otherwise (`fecore.updating.posterior`).

Inputs that are believed to be nothing, but may be something: a clamp that gives way, fibres
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
- what a mesh misses is the same sort of error in all modes (`fecore.updating.mesh`);
- fibres askew by an angle change it by the angle's square, so the model is solved with them at one
  standard deviation.

A one-sided input a ≥ 0, in its standard deviations, is what the frequencies leave of it. a ~ N(0,
1) changes ln f by ea: with the score b = eᵀWμ and the information i = eᵀMe of the data, the other
unknowns following (`additions`), a is a Gaussian of mean b/(1 + i) and variance 1/(1 + i), cut off
at 0. So what it moves a constant by is bounded by the constant's prior, and is small where it would
have left other traces.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Literal

import numpy as np
import scipy

from fecore.arrays import FloatArray
from fecore.body.constants import Body
from fecore.body.supports import PointMass
from fecore.correlation import most_alike
from fecore.errors import InputError
from fecore.normal import Z_95
from fecore.quantities import (
    CLAMP,
    QUANTITIES,
    quantity_of,
)
from fecore.updating.forward import ForwardState
from fecore.updating.parameters import (
    PER_K,
    TEMPERATURE,
    Warmth,
    coefficient_of,
    stated_or,
)
from fecore.updating.posterior import DISCREPANCY

if TYPE_CHECKING:
    from fecore.updating.parameters import Parametrisation


@dataclass(frozen=True)
class Inputs:
    """Standard deviations of the inputs, SI: None is a careful laboratory's, 0 means exactly known.

    Raises:
        InputError: a value is negative or not finite, or the clamp is none.
    """

    # length_sd, width_sd, thickness_sd, height_sd: m
    length_sd: float | None = None
    width_sd: float | None = None
    thickness_sd: float | None = None
    height_sd: float | None = None
    density_sd: float | None = None  # kg/m³
    nu_xy_sd: float | None = None  # of Poisson's ratio
    fibre_angle_sd: float | None = None  # rad, about the stated angle
    # rad, of each ply of a stack about its stated angle, independent of the others'
    ply_angle_sd: float | None = None
    # of EI/kL of a clamped edge, k its rotational stiffness: the scale of a half-normal prior
    clamp_compliance_sd: float | None = None
    # kg; where no sensor is stated, the scale of a half-normal prior
    sensor_mass_sd: float | None = None
    delay_sd: float | None = None  # of the delay between response and force channel, s
    # 1/τ of an exponential window exp(-t/τ) on the response, 1/s, or of both channels; 0 for none,
    # None where nobody said
    window_rate: float | None = None
    # of a stated rate, 1/s; None where there may have been another window beside it
    window_rate_sd: float | None = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if value is not None and not (np.isfinite(value) and value >= 0):
                raise InputError(
                    f"inputs.{field.name}", f"is {value}, expected a number that is not negative"
                )
        if (self.clamp_compliance_sd or 0.0) > SOFTEST_CLAMP:
            raise InputError(
                "inputs.clamp_compliance_sd",
                f"is {self.clamp_compliance_sd:g}, expected at most {SOFTEST_CLAMP:g}: there the"
                " clamp turns as easily as the specimen bends, and is none",
            )

    @classmethod
    def exact(cls) -> Inputs:
        """Everything exactly known: no clamp compliance, sensor, window or delay that was not
        stated.
        """
        known = cls()
        return replace(known, **{field.name: 0.0 for field in fields(known)})

    @property
    def window_known(self) -> bool:
        """Whether the laboratory stated, or its data showed, the window's rate."""
        return self.window_rate is not None and self.window_rate_sd is not None

    def is_stated(self, name: str) -> bool:
        """Whether the laboratory stated a standard deviation itself; names as of `TOLERANCES`."""
        return getattr(self, f"{name}_sd") is not None

    def standard_deviations(self, constants: Mapping[str, float]) -> dict[str, float]:
        """Of those of a body's constants that are inputs, by the constants' names, SI."""
        known = {
            name: tolerance for name in constants if (tolerance := tolerance_of(name)) is not None
        }
        return {
            name: self.standard_deviation(tolerance, constants[name])
            for name, tolerance in known.items()
        }

    def standard_deviation(self, name: str, value: float = 1.0) -> float:
        """Of an input by its name, SI; relative tolerances are shares of its value."""
        stated = getattr(self, f"{name}_sd")
        if stated is not None:
            return float(stated)
        tolerance, relative = TOLERANCES[name]
        return tolerance * abs(value) if relative else tolerance


TOLERANCES: dict[str, tuple[float, bool]] = {
    name: row.tolerance for name, row in QUANTITIES.items() if row.tolerance is not None
}
"""Standard deviation of each input that a laboratory does not state, and whether it is a share of
the input's value.
"""

POINT_SD, GRID_SD = 0.001, 0.002
"""Standard deviation of a point about its place in the grid, and of the whole grid about the body,
m.
"""

SOFTEST_CLAMP = 1.0
"""Largest scale of EI/kL that a clamp may have."""

UNSTATED_SENSOR = 1e-3
"""Scale of the half-normal prior of the mass of a sensor that nobody stated, kg."""

UNSTATED_WINDOW = 4.0
"""Scale of the half-normal prior of an unstated exponential window's rate, over the record's
length: such windows end at 1 to 5 % of their first value.
"""


def tolerance_of(constant: str) -> str | None:
    """The name of the tolerance of a constant that is an input; None of one that is not."""
    quantity = quantity_of(constant)
    return (quantity.input or None) if quantity else None


SHEAR_CORRECTION = "shear correction"
"""The budget's source for the factor of transverse shear."""

SHEAR_CORRECTION_SD = 0.02
"""Relative standard deviation of κ."""

OF_THEORY = 2e-5
"""Prior scale of what theory misses of a frequency beside κ, as a share of it: what is left against
free solids. What a clamp's root adds lies between it and what laminates vary by, as half of the
prior does (`fecore.updating.posterior`).
"""


def by_shear_correction(state: ForwardState) -> FloatArray:
    """(n,) relative change of the elastic frequencies by one standard deviation of κ of the body's
    shells; 0 without.
    """
    if not state.forward.specimen.has_elements:
        return np.zeros(state.frequency_hz.size)
    return SHEAR_CORRECTION_SD / 2 * state.shear


def discrepancy_scale(body: Body, inputs: Inputs) -> float:
    """Prior scale s₀ of the model's independent errors in natural frequencies, as shares of
    them.
    """
    if (thickness := body.even_thickness) is None:
        return DISCREPANCY
    usual, _ = TOLERANCES["thickness"]
    uneven = min(inputs.standard_deviation("thickness", thickness) / (usual * thickness), 1.0)
    return float(np.hypot(OF_THEORY, uneven * np.sqrt(DISCREPANCY**2 - OF_THEORY**2)))


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
    _, mesh_error, flat = state.by_mesh
    words = f"at most {100 * np.abs(mesh_error).max(initial=0.0):.2g} % of a frequency"
    if flat.any():
        words += f", and {100 * np.abs(flat).max():.2g} % were the facets flat"
    return [
        SystematicEffect(MESH, mesh_error, "both", False, words),
        SystematicEffect(MESH, flat, "one-sided", False, words),
    ]


def fixed_points(responses: Sequence[int], references: Sequence[int]) -> tuple[int, ...]:
    """Points at which a sensor stood while the hammer moved: response points far fewer than
    reference points.
    """
    sensors = tuple(sorted(set(responses)))
    return sensors if len(sensors) < len(set(references)) else ()


REFERENCE_C = 23.0
"""Temperature at which constants of several campaigns are given, °C: that of the standard
atmosphere of ISO 291.
"""

UNKNOWN_TEMPERATURE_SD = 10.0
"""Standard deviation of such a temperature about the reference, K: rooms and halls from 3 to 43 °C
in nineteen of twenty.
"""

AT_ONE_TEMPERATURE = (
    "{names}: all is at one temperature, so nothing says how it changes; leave the coefficient out,"
    " state reference_temperature_c, or add a campaign at another temperature"
)
"""What is said where a coefficient is stated that nothing needs."""


def reference_of(temperatures: Sequence[float | None], stated: float | None) -> float | None:
    """The temperature at which the constants of some campaigns are given, °C; None where all are at
    their own.

    Args:
        temperatures: of the campaigns, °C; None where nobody stated one.
        stated: the recipe's reference.

    Raises:
        InputError: a reference is stated, and no temperature.
    """
    known = sorted({each for each in temperatures if each is not None})
    if not known:
        if stated is not None:
            raise InputError(
                "reference_temperature_c",
                f"is {stated:g} °C, but no campaign states its temperature_c: nothing can be"
                " brought to it; state it",
            )
        return None
    reference = stated if stated is not None else known[0] if len(known) == 1 else REFERENCE_C
    return None if all(each == reference for each in temperatures) else reference


def with_temperature(
    prior: Parametrisation, reference: float | None, temperature: float | None, *, reported: bool
) -> Parametrisation:
    """The parameters at a reference, of a body that has a temperature of its own: with a
    coefficient of each that changes.

    Args:
        prior: the parameters, without inputs.
        reference: °C; None where nothing is brought to one.
        temperature: of the body, °C; None where nobody stated it.
        reported: whether the coefficients are asked for; else they are inputs.

    Raises:
        InputError: coefficients are stated, and there is no reference.
    """
    stated = {each.name: each for each in prior.per_kelvin}
    if reference is None:
        if stated:
            raise InputError("parameters", AT_ONE_TEMPERATURE.format(names=", ".join(stated)))
        return prior
    changing, columns, known = list[int](), list[int](), list[float]()
    names, means, sds = list(prior.names), list(prior.prior_mean), list(prior.prior_sd)
    for number, name in enumerate(prior.names):
        usual = coefficient_of(name, prior.body)
        if usual is None:
            continue
        own = stated.get(name + PER_K)
        mean, sd = (
            usual
            if own is None
            else (stated_or(own.prior_mean, usual[0]), stated_or(own.prior_sd, usual[1]))
        )
        exact = own is not None and own.fixed
        changing.append(number)
        columns.append(-1 if exact else len(names))
        known.append(mean if exact else 0.0)
        if not exact:
            names.append(name + PER_K)
            means.append(mean)
            sds.append(sd)
    inputs = 0 if reported else len(names) - len(prior.names)
    own_column = -1
    if temperature is None:
        own_column, inputs = len(names), inputs + 1
        names.append(TEMPERATURE)
        means.append(reference)
        sds.append(UNKNOWN_TEMPERATURE_SD)
    warmth = Warmth(
        reference,
        temperature,
        np.array(changing, int),
        np.array(columns, int),
        np.array(known),
        own_column,
    )
    more = np.zeros((prior.base.size, len(names) - len(prior.names)))
    return replace(
        prior,
        names=tuple(names),
        prior_mean=np.array(means),
        prior_sd=np.array(sds),
        spread=np.hstack([prior.spread, more]),
        inputs=inputs,
        warmth=warmth,
    )
