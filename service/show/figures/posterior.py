"""The posterior as a corner plot: each parameter's density with its prior, each pair's contours or samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from fecore.arrays import FloatArray
from service.show.figures.look import INITIAL, UPDATED, Z_95, Figure, Trace, axis, layout, line, marks, numbers
from service.show.figures.parameters import SHOWN

MOST_PARAMETERS = 8
_RADII = (1.0, 2.4477)  # of what holds 39 % and 95 % of two Gaussian variables
_SHOWN_SAMPLES = 600


@dataclass(frozen=True)
class Marginal:
    """One parameter, in the unit in which it is drawn.

    Its posterior is Gaussian to either side of the estimate, in the logarithm where it must be positive; between the two sides
    the standard deviation changes smoothly.

    Attributes:
        title: name and unit.
        estimate: value.
        below, above: standard deviations to either side, in the coordinate.
        log: whether the coordinate is the logarithm.
        prior: mean and standard deviation, or None.
    """

    title: str
    estimate: float
    below: float
    above: float
    log: bool
    prior: tuple[float, float] | None

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
    data: list[Trace] = []
    axes: dict[str, Any] = {}
    gap = 0.12 / count
    size = (1 - gap * (count - 1)) / count
    for i in range(count):
        place = "" if i == 0 else str(i + 1)
        left = i * (size + gap)
        reach = found[i].at(np.array([-3.2, 3.2]))
        limits = [float(value) for value in reach]
        across = {"domain": [left, left + size], "anchor": _lowest(count, i), "range": limits, "nticks": 4}
        axes[f"xaxis{place}"] = axis(found[i].title, **across)
        up = 1 - i * (size + gap)
        if i > 0:
            axes[f"yaxis{place}"] = axis(found[i].title, domain=[up - size, up], anchor="x", range=limits, nticks=4)
        axes[f"yaxis{_own(i)[1:]}"] = axis(
            "", domain=[up - size, up], anchor=f"x{place}", showticklabels=False, showgrid=False, rangemode="tozero"
        )
        data += _diagonal(found[i], f"x{place}", _own(i), limits, first=i == 0)
        for j in range(i):
            panel = {"xaxis": f"x{'' if j == 0 else j + 1}", "yaxis": f"y{place}"}
            data += (
                _pair(found[j], found[i], float(correlation[j, i]), panel)
                if drawn is None
                else [_cloud(drawn[:, j], drawn[:, i], panel)]
            )
    side = 150 + 115 * count
    shown = layout("Posterior: densities and correlations", height=side, margin={"l": 95}, **axes)
    return {"data": data, "layout": shown}


def _own(i: int) -> str:
    """The y axis of a density, which no other panel has."""
    return f"y{21 + i}" if i else "y"


def _lowest(count: int, i: int) -> str:
    """The y axis of the lowest panel of a column."""
    return f"y{count}" if i < count - 1 else _own(i)


def _diagonal(of: Marginal, x: str, y: str, limits: list[float], *, first: bool) -> list[Trace]:
    z = np.linspace(-3.2, 3.2, 65)
    panel = {"xaxis": x, "yaxis": y, "hoverinfo": "skip"}
    curve = line(numbers(of.at(z), 5), numbers(of.density(z), 5), "updated" if first else "", UPDATED, **panel)
    if of.prior is None:
        return [curve]
    mean, sd = of.prior
    values = np.linspace(limits[0], limits[1], 41)
    density = np.exp(-(((values - mean) / sd) ** 2) / 2) / (sd * np.sqrt(2 * np.pi))
    prior = line(numbers(values, 5), numbers(density, 5), "prior" if first else "", INITIAL, "dot", **panel)
    return [prior, curve]


def _pair(across: Marginal, up: Marginal, correlation: float, panel: dict[str, str]) -> list[Trace]:
    """Contours that hold 39 % and 95 % of two Gaussian variables, drawn where they lie in values."""
    angle = np.linspace(0, 2 * np.pi, 61)
    first, second = np.cos(angle), correlation * np.cos(angle) + np.sqrt(max(1 - correlation**2, 0.0)) * np.sin(angle)
    hover = {"hovertemplate": f"correlation {correlation:+.2f}<extra></extra>"}
    return [
        line(numbers(across.at(r * first), 5), numbers(up.at(r * second), 5), "", UPDATED, dash, **panel, **hover)
        for r, dash in zip(_RADII, ("solid", "dash"), strict=True)
    ]


def _cloud(x: FloatArray, y: FloatArray, panel: dict[str, str]) -> Trace:
    return marks(numbers(x, 5), numbers(y, 5), "", "rgba(0,114,178,0.35)", size=3, hoverinfo="skip", **panel)
