"""How the fits came to their end: cost of every start, parameters of the one that was chosen, coefficients of the damping."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import cycle
from typing import Any

from service.show.figures.colors import PALETTE, QUIET, UPDATED
from service.show.figures.marks import Axis, Curve, Figure, Panel, decades

MOST_PARAMETERS = 8
_GAP = 0.1


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
    axes = [
        Axis("cost of stage 1", decades([cost for start in starts for cost in start["cost"]])),
        Axis("constants, % of the last"),
        *([Axis("damping, % of the last")] if coefficients else []),
    ]
    height = (1 - _GAP * (len(axes) - 1)) / len(axes)
    tops = [1 - k * (height + _GAP) for k in range(len(axes))]
    x = Axis("iteration")
    panels = [Panel(x, y, up=(top - height, top)) for y, top in zip(axes, tops, strict=True)]
    names = list(parameters)[:MOST_PARAMETERS]
    curves = [_cost(number, start) for number, start in enumerate(starts, start=1) if len(start["cost"])]
    curves += _shares({name: parameters[name] for name in names}, PALETTE[1:], panels[1])
    curves += _shares(coefficients, cycle(reversed(PALETTE)), panels[-1])
    return Figure("Convergence of all starts", curves, panels, height=200 + 170 * len(panels))


def _cost(number: int, start: Mapping[str, Any]) -> Curve:
    chosen, failed = start["chosen"], start["failure"]
    name = f"start {number}" + (", chosen" if chosen else ", failed" if failed else "")
    look: Any = {"color": UPDATED} if chosen else {"color": QUIET, "dash": "dot"}
    return Curve(range(len(start["cost"])), start["cost"], name, symbol="x" if failed else "circle", **look)


def _shares(series: Mapping[str, Sequence[float]], colors: Iterable[str], panel: Panel) -> list[Curve]:
    """Each series as shares of its last value."""
    look: Any = {"symbol": "circle", "panel": panel}
    per_cent = {name: [100 * value / (values[-1] or 1.0) for value in values] for name, values in series.items()}
    pairs = zip(per_cent.items(), colors, strict=False)
    return [Curve(range(len(values)), values, name, color, **look) for (name, values), color in pairs]
