"""The posterior as a corner plot: each parameter's density with its prior, each pair's contours or samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from fecore.arrays import FloatArray
from fecore.normal import Z_95
from service.show.figures.colors import INITIAL, UPDATED
from service.show.figures.marks import Axis, Curve, Figure, Mark, Panel, Points
from service.show.figures.parameters import SHOWN

MOST_PARAMETERS = 8
_RADII = (1.0, 2.4477)  # of what holds 39 % and 95 % of two Gaussian variables
_SHOWN_SAMPLES = 600
_CLOUD = "rgba(0,114,178,0.35)"
_GAP = 0.12  # between panels, as a share of a panel with its gap
_REACH = 3.2  # standard deviations that are drawn


@dataclass(frozen=True)
class Marginal:
    """One parameter, in the unit in which it is drawn.

    Its posterior is Gaussian to either side of the estimate, in the logarithm where it must be positive; between the two sides
    the standard deviation changes smoothly.
    """

    title: str  # name and unit
    estimate: float  # value
    below: float  # standard deviations to either side, in the coordinate
    above: float
    log: bool  # whether the coordinate is the logarithm
    prior: tuple[float, float] | None  # mean and standard deviation, or None

    def at(self, z: FloatArray) -> FloatArray:
        """Values so many standard deviations from the estimate."""
        reach = (self.below + (self.above - self.below) * scipy.special.ndtr(2 * z)) * z
        moved: FloatArray = self.estimate * np.exp(reach) if self.log else self.estimate + reach
        return moved

    def density(self, z: FloatArray) -> FloatArray:
        """The density at these values, in 1 over the drawn unit: the Gaussian one over the slope of the values."""
        found: FloatArray = np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi) / np.gradient(self.at(z), z)
        return found


def marginal(row: Mapping[str, Any]) -> Marginal:
    """The marginal of a parameter of a result, of which its 95 % interval is the central part."""
    factor, unit = SHOWN.get(row["unit"], (1.0, row["unit"]))
    low, high = row["interval_95"]
    estimate = row["estimate"]
    log = row["unit"] == "Pa" and low > 0
    to = np.log if log else (lambda value: factor * value)
    below, above = (max(float(abs(to(end) - to(estimate))) / Z_95, 1e-9) for end in (low, high))
    prior = (factor * row["prior_mean"], factor * row["prior_sd"]) if row["prior_sd"] else None
    return Marginal(f"{row['name']} [{unit}]", factor * estimate, below, above, log, prior)


def posterior_figure(
    parameters: Sequence[Mapping[str, Any]], correlation: FloatArray, samples: FloatArray | None = None
) -> Figure:
    """A corner plot.

    Args:
        parameters: p rows of a result document, in the order of `correlation`; the first eight are drawn.
        correlation: (p, p) of the posterior.
        samples: (n, p) of it, SI, drawn in place of contours; None where the posterior is Gaussian.
    """
    count = min(len(parameters), MOST_PARAMETERS)
    found = [marginal(row) for row in parameters[:count]]
    factors = [SHOWN.get(row["unit"], (1.0, ""))[0] for row in parameters[:count]]
    drawn = None if samples is None else samples[:: -(-len(samples) // _SHOWN_SAMPLES), :count] * factors
    size = (1 - _GAP / count * (count - 1)) / count
    starts = [i * (size + _GAP / count) for i in range(count)]
    limits = [(float(of.at(np.array([-_REACH]))[0]), float(of.at(np.array([_REACH]))[0])) for of in found]
    columns, rows = (
        [Axis(of.title, range=ends, few=True) for of, ends in zip(found, limits, strict=True)] for _ in "xy"
    )
    marks: list[Mark] = []
    panels: list[Panel] = []
    for i, of in enumerate(found):
        up = 1 - starts[i] - size, 1 - starts[i]
        *beside, own = (
            Panel(columns[j], rows[i] if j < i else Axis(bare=True), (starts[j], starts[j] + size), up)
            for j in range(i + 1)
        )
        panels += [*beside, own]
        marks += _diagonal(of, limits[i], own, first=i == 0)
        for j, panel in enumerate(beside):
            if drawn is None:
                marks += _pair(found[j], of, float(correlation[j, i]), panel)
            else:
                marks.append(Points(drawn[:, j], drawn[:, i], "", _CLOUD, size=3, panel=panel, hover=None))
    title = "Posterior: densities and correlations"
    return Figure(title, marks, panels, height=150 + 115 * count, margins={"l": 95})


def _diagonal(of: Marginal, limits: tuple[float, float], panel: Panel, *, first: bool) -> list[Mark]:
    z = np.linspace(-_REACH, _REACH, 65)
    look: dict[str, Any] = {"panel": panel, "digits": 5, "hover": None}
    curve = Curve(of.at(z), of.density(z), "updated" if first else "", UPDATED, **look)
    if of.prior is None:
        return [curve]
    mean, sd = of.prior
    values = np.linspace(*limits, 41)
    density = np.exp(-(((values - mean) / sd) ** 2) / 2) / (sd * np.sqrt(2 * np.pi))
    return [Curve(values, density, "prior" if first else "", INITIAL, "dot", **look), curve]


def _pair(across: Marginal, up: Marginal, correlation: float, panel: Panel) -> list[Mark]:
    """Contours that hold 39 % and 95 % of two Gaussian variables, drawn where they lie in values."""
    angle = np.linspace(0, 2 * np.pi, 61)
    first, second = np.cos(angle), correlation * np.cos(angle) + np.sqrt(max(1 - correlation**2, 0.0)) * np.sin(angle)
    inner, outer = ((across.at(radius * first), up.at(radius * second)) for radius in _RADII)
    look: dict[str, Any] = {"panel": panel, "digits": 5, "hover": f"correlation {correlation:+.2f}"}
    return [Curve(*inner, "", UPDATED, **look), Curve(*outer, "", UPDATED, "dash", **look)]
