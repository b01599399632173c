"""Strips and a plate cut from one simulated laminate, whose bodies are not the model that updates
them.

The truth is solved on a finer mesh than updating takes, on a full model, with inputs drawn from a
careful laboratory's errors (dimensions, density, angle, a clamp that yields), every frequency off
by the error of a plate theory, and noise.
"""

from dataclasses import replace

import numpy as np

from fecore.body.constants import Parameter
from fecore.body.laminate import OrthotropicMaterial
from fecore.body.specimen import OrientedSpecimen
from fecore.body.supports import PointMass
from fecore.frf import along_z
from fecore.updating.campaigns import Campaign
from fecore.updating.forward import ForwardModel
from fecore.updating.inputs import Inputs
from fecore.updating.parameters import parametrise
from tests.support.draws import modes_at

NOMINAL = OrthotropicMaterial(
    Ex=40e9, Ey=9e9, Gxy=4.0e9, Gxz=4.0e9, Gyz=3.2e9, nu_xy=0.28, density=1900.0
)
"""A glass fibre laminate, as a handbook has it."""

TRUTH = {"Ex": 36.5e9, "Ey": 10.4e9, "Gxy": 4.6e9, "Gxz": 3.5e9, "Gyz": 2.9e9, "nu_xy": 0.31}
"""What the simulated panel is made of."""

STRIP = (0.25, 0.03, 0.005)
PLATE = (0.30, 0.20, 0.005)
# relative errors of a frequency: of a plate theory, of a measurement
_THEORY, _NOISE = 0.0005, 0.0003


def tour(length: float, width: float) -> tuple[tuple[float, float], ...]:
    """Points of eleven rows of three."""
    return tuple(
        (float(x), y)
        for x in np.linspace(length / 11, length, 11)
        for y in (-width / 2, 0.0, width / 2)
    )


def panel(
    random: np.random.Generator, *, boundary: str = "free", modes: int = 9, pieces: int = 4
) -> list[Campaign]:
    """Strips at 0°, 90° and 45° and a plate of the simulated panel, or the first of them, measured."""
    cuts = [
        ("strip 0", STRIP, 0.0),
        ("strip 90", STRIP, 90.0),
        ("strip 45", STRIP, 45.0),
        ("plate", PLATE, 0.0),
    ]
    return [
        measured(random, name, size, angle, boundary=boundary, modes=modes)
        for name, size, angle in cuts[:pieces]
    ]


def measured(
    random: np.random.Generator,
    name: str,
    size: tuple[float, float, float],
    angle: float,
    *,
    boundary: str = "free",
    modes: int = 9,
    truth: dict[str, float] | None = None,
    unstated: tuple[PointMass, ...] = (),
) -> Campaign:
    """One campaign: the modes of a body drawn about what the laboratory believes of it, with masses
    that it did not state.
    """
    coarse = (14, 10) if size[1] > 0.1 else (16, 3)
    turned = float(np.radians(angle))
    body = OrientedSpecimen(*size, NOMINAL, boundary, divisions=coarse, fibre_angle=turned)
    inputs = Inputs()
    own = {
        name: inputs.standard_deviation(name, value)
        for name, value in body.nominal.items()
        if name in _DRAWN
    }
    drawn = {key: body.nominal[key] + sd * random.standard_normal() for key, sd in own.items()}
    compliance = abs(0.0075 * random.standard_normal()) if boundary == "cantilever" else 0.0
    fine = replace(
        body,
        divisions=(28, 20) if size[1] > 0.1 else (32, 6),
        clamp_compliance=compliance,
        masses=unstated,
    )
    constants = {**fine.nominal, **(truth or TRUTH), **drawn}
    x = np.linspace(0.02, 0.98, 9) * size[0]
    places = np.array(
        [(along, across) for along in x for across in np.array([-0.45, 0.0, 0.45]) * size[1]]
    )
    prior = parametrise(
        fine, [Parameter(key, prior_mean=value) for key, value in constants.items()]
    )
    forward = ForwardModel(
        fine, prior, along_z(range(1, len(places) + 1)), places, modes + 8, reduced=False
    )
    state = forward.solve(prior.prior_mean)
    hz = state.frequency_hz[:modes] * (
        1 + np.hypot(_THEORY, _NOISE) * random.standard_normal(modes)
    )
    order = np.argsort(hz)
    points = {number: (float(u), float(v), 0.0) for number, (u, v) in enumerate(places, start=1)}
    return Campaign(
        name=name,
        specimen=name,
        body=body,
        modes=modes_at(points, hz[order], state.shapes[:modes][order], _NOISE),
        points=points,
        inputs=inputs,
    )


_DRAWN = ("width", "thickness", "density", "fibre_angle", "length")
