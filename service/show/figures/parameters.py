"""Parameters: what was known before beside what is known after."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fecore.normal import Z_95
from service.show.figures.colors import INITIAL, QUIET, UPDATED
from service.show.figures.marks import Axis, Figure, Mark, Panel, Points, Rule, rows_axis

SHOWN = {"Pa": (1e-9, "GPa"), "s": (1e6, "µs"), "m": (1e3, "mm"), "1": (1.0, "–")}
"""Factor and unit in which values of an SI unit are drawn; others as they are."""

_Row = tuple[float, Mapping[str, Any]]  # with its place up the figure


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
    prior: list[_Row] = []
    sure: list[_Row] = []
    unsure: list[_Row] = []
    for place, row in enumerate(parameters):
        (sure if row["identifiable"] else unsure).append((place + 0.15, row))
        if row["prior_sd"]:
            reach = Z_95 * row["prior_sd"]
            interval = [row["prior_mean"] - reach, row["prior_mean"] + reach]
            prior.append((place - 0.15, {**row, "estimate": row["prior_mean"], "interval_95": interval}))
    marks = [
        *_drawn(prior, "prior", "prior, 95 %", INITIAL, "diamond-open"),
        *_drawn(sure, "updated", "updated, 95 %", UPDATED, "circle"),
        *_drawn(unsure, "updated", "updated, not identifiable", QUIET, "circle-open"),
        Rule(100),
    ]
    names = [f"{row['name']}  {shown_value(row['estimate'], row['unit'])}" for row in parameters]
    panel = Panel(Axis("share of the initial value [%]"), rows_axis(names))
    return Figure(title, marks, [panel], height=190 + 42 * max(len(names), 3), margins={"l": 130})


def _drawn(rows: Sequence[_Row], said: str, name: str, color: str, symbol: str) -> list[Mark]:
    """Estimates with their intervals at places up the figure, in per cent of each row's initial value."""
    if not rows:
        return []
    per_cent = np.array([100 / (row["initial"] or row["estimate"]) for _, row in rows])
    middle = per_cent * [row["estimate"] for _, row in rows]
    low, high = per_cent * np.array([row["interval_95"] for _, row in rows], dtype=float).T
    hover: Any = {"ids": [row["name"] for _, row in rows], "hover": "%{customdata}, " + said + ": %{x:.1f} %"}
    error = np.array([middle - low, high - middle])
    return [Points(middle, [place for place, _ in rows], name, color, symbol, error_x=error, **hover)]
