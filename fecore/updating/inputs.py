"""What a laboratory knows of its inputs, and how well.

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
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import numpy as np

from fecore.errors import InputError
from fecore.quantities import QUANTITIES, quantity_of


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
