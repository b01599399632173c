"""How the fits came to their end: cost of every start, parameters of the one that was chosen, coefficients of the damping."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import Any

from service.show.figures.look import QUIET, UPDATED, Figure, Trace, axis, decades, layout, numbers
from service.show.figures.palette import PALETTE

MOST_PARAMETERS = 8


def convergence_figure(
    starts: Sequence[Mapping[str, Any]],
    parameters: Mapping[str, Sequence[float]],
    coefficients: Mapping[str, Sequence[float]],
) -> Figure:
    """Cost, elastic constants and damping coefficients over the iterations.

    Args:
        starts: every start of stage 1 with `cost` by iteration, `chosen`, and `failure` in words or None.
        parameters: of the chosen start, by name and iteration; drawn as shares of their last values.
        coefficients: of the damping law, in the same way; empty where damping was not fitted.
    """
    panels = 3 if coefficients else 2
    gap, height = 0.1, (1 - 0.1 * (panels - 1)) / panels
    domains = [[1 - (k + 1) * height - k * gap, 1 - k * (height + gap)] for k in range(panels)]
    data = [_cost(number, start) for number, start in enumerate(starts, start=1) if len(start["cost"])]
    names = list(parameters)[:MOST_PARAMETERS]
    data += [_relative(name, parameters[name], PALETTE[1 + k], "y2") for k, name in enumerate(names)]
    colors = cycle(reversed(PALETTE))
    data += [
        _relative(name, coefficients[name], color, "y3") for name, color in zip(coefficients, colors, strict=False)
    ]
    axes: dict[str, Any] = {
        "xaxis": axis("iteration", anchor=f"y{panels}"),
        "yaxis": axis("cost of stage 1", domain=domains[0], **decades([c for start in starts for c in start["cost"]])),
        "yaxis2": axis("constants, % of the last", domain=domains[1]),
    }
    if coefficients:
        axes["yaxis3"] = axis("damping, % of the last", domain=domains[2])
    return {"data": data, "layout": layout("Convergence of all starts", height=200 + 170 * panels, **axes)}


def _cost(number: int, start: Mapping[str, Any]) -> Trace:
    chosen = start["chosen"]
    name = f"start {number}" + (", chosen" if chosen else ", failed" if start["failure"] else "")
    color = UPDATED if chosen else QUIET
    return {
        "type": "scatter",
        "mode": "lines+markers",
        "name": name,
        "x": list(range(len(start["cost"]))),
        "y": numbers(start["cost"]),
        "line": {"color": color, "width": 1.5, "dash": "solid" if chosen else "dot"},
        "marker": {"symbol": "x" if start["failure"] else "circle", "size": 5, "color": color},
    }


def _relative(name: str, values: Sequence[float], color: str, panel: str) -> Trace:
    last = values[-1] or 1.0
    return {
        "type": "scatter",
        "mode": "lines+markers",
        "name": name,
        "x": list(range(len(values))),
        "y": numbers([100 * value / last for value in values]),
        "line": {"color": color, "width": 1.5},
        "marker": {"symbol": "circle", "size": 5, "color": color},
        "yaxis": panel,
    }
