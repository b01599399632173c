"""Parameters: what was known before beside what is known after, and what the uncertainty is made of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from service.show.figures.look import (
    INITIAL,
    QUIET,
    UPDATED,
    Z_95,
    Figure,
    Trace,
    axis,
    layout,
    marks,
    named_ticks,
    numbers,
)

SHOWN = {"Pa": (1e-9, "GPa"), "s": (1e6, "µs"), "m": (1e3, "mm"), "1": (1.0, "–")}
"""Factor and unit in which values of an SI unit are drawn; others as they are."""
MOST_SOURCES = 7


def shown_value(value: float, unit: str) -> str:
    """A value in the unit in which it is drawn, to three digits."""
    factor, name = SHOWN.get(unit, (1.0, unit))
    return f"{value * factor:.3g} {name}".removesuffix(" –")


def parameters_figure(parameters: Sequence[Mapping[str, Any]], title: str) -> Figure:
    """Prior and posterior of every parameter with their 95 % intervals, each as a share of its initial value.

    Args:
        parameters: as a result document has them. One that had no initial value is drawn as a share of its estimate.
        title: of the figure.
    """
    names = [f"{row['name']}  {shown_value(row['estimate'], row['unit'])}" for row in parameters]
    data = [*_prior(parameters), *_posterior(parameters)]
    shapes = [
        {
            "type": "line", "xref": "x", "yref": "y domain", "x0": 100, "x1": 100, "y0": 0, "y1": 1,
            "line": {"color": QUIET, "width": 1, "dash": "dot"},
        }
    ]  # fmt: skip
    shown = layout(
        title,
        xaxis=axis("share of the initial value [%]"),
        yaxis=axis("", range=[len(names) - 0.4, -0.6], **named_ticks(names)),
        shapes=shapes,
        margin={"l": 130},
        height=190 + 42 * max(len(names), 3),
    )
    return {"data": data, "layout": shown}


def _scale(row: Mapping[str, Any]) -> float:
    """100 % of a parameter."""
    return float(row["initial"] or row["estimate"])


def _prior(parameters: Sequence[Mapping[str, Any]]) -> list[Trace]:
    known = [(i, row) for i, row in enumerate(parameters) if row["prior_sd"]]
    if not known:
        return []
    middle = [100 * row["prior_mean"] / _scale(row) for _, row in known]
    reach = [100 * Z_95 * row["prior_sd"] / _scale(row) for _, row in known]
    error = {"type": "data", "array": numbers(reach), "color": INITIAL, "thickness": 1.5}
    places = [i - 0.15 for i, _ in known]
    prior = marks(numbers(middle), places, "prior, 95 %", INITIAL, "diamond-open", error_x=error)
    return [{**prior, "customdata": [row["name"] for _, row in known], "hovertemplate": _hover("prior")}]


def _posterior(parameters: Sequence[Mapping[str, Any]]) -> list[Trace]:
    traces = []
    for sure, color, symbol, name in (
        (True, UPDATED, "circle", "updated, 95 %"),
        (False, QUIET, "circle-open", "updated, not identifiable"),
    ):
        rows = [(i, row) for i, row in enumerate(parameters) if row["identifiable"] is sure]
        if not rows:
            continue
        middle = [100 * row["estimate"] / _scale(row) for _, row in rows]
        up = [100 * (row["interval_95"][1] - row["estimate"]) / _scale(row) for _, row in rows]
        down = [100 * (row["estimate"] - row["interval_95"][0]) / _scale(row) for _, row in rows]
        error = {
            "type": "data", "symmetric": False, "array": numbers(up), "arrayminus": numbers(down), "color": color,
            "thickness": 1.5,
        }  # fmt: skip
        trace = marks(numbers(middle), [i + 0.15 for i, _ in rows], name, color, symbol, error_x=error)
        traces.append({**trace, "customdata": [row["name"] for _, row in rows], "hovertemplate": _hover("updated")})
    return traces


def _hover(name: str) -> str:
    return "%{customdata}, " + name + ": %{x:.1f} %<extra></extra>"
