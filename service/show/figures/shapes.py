"""Mode shapes, measured beside updated: the points of the specimen in an oblique view, moved up by their deflection."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fecore.arrays import ComplexArray, FloatArray
from service.show.figures.colors import MEASURED, QUIET, UPDATED
from service.show.figures.joining import chains
from service.show.figures.marks import Axis, Curve, Dash, Figure, Mark, Panel, Points
from service.show.figures.screen import numbers

# How far a row of points is set off to the right and up, and how high a body in space is, in shares of length and deflection.
_OBLIQUE, _DEPTH, _HEIGHT = 0.18, 0.9, 1.2
MOST_MODES, MOST_ROWS = 40, 8
"""Pairs that are drawn at all, the rest is a table's; and in a figure that is no higher than a page."""


@dataclass(frozen=True)
class ShapePair:
    """A measured shape and that of its partner."""

    number: int  # of the measured mode
    measured_title: str  # such as `measured, 160.9 Hz`.
    updated_title: str
    measured: ComplexArray  # (p,) complex, at the first p points; empty where it has no shape
    updated: FloatArray  # (P,) real; empty where measured shapes alone are drawn


def shapes_figure(pairs: Sequence[ShapePair], points: Sequence[int], places: FloatArray, which: str = "") -> Figure:
    """One row of panels a mode: measured on the left, updated on the right if there is one, over the undeformed grid.

    `layout.meta` has the same as numbers for an animation: `points`, `x_m`, `y_m` (`z_m` of a body in space), and by mode
    `measured` and `updated` (None where a point has none), each with its greatest value ±1 and turned to the same sign.

    Args:
        pairs: in the order of the measured modes.
        points: (P,) labels; those of the measured shapes first.
        places: (P, 3) coordinates, m.
        which: of all pairs these are, for the title; empty where they are all.
    """
    marks: list[Mark] = []
    panels, modes = [], []
    grid = _Grid(places)
    top = 1.15 + grid.height
    both = " and updated" if any(pair.updated.size for pair in pairs) else ""
    x, y = (Axis(range=ends, hidden=True) for ends in ((-0.05, 1.1 + _OBLIQUE), (-1.15, top)))
    for row, pair in enumerate(pairs):
        measured, updated = aligned(pair.measured, pair.updated)
        padded = np.concatenate([measured, np.full(len(points) - measured.size, np.nan)])
        modes.append({"number": pair.number, "measured": numbers(padded, 5), "updated": numbers(updated, 5)})
        up = 1 - (row + 0.8) / len(pairs), 1 - (row + 0.12) / len(pairs)
        sides: list[tuple[FloatArray, str, str, Dash, tuple[float, float]]] = [
            (measured, pair.measured_title, MEASURED, "solid", (0.0, 0.48)),
            (updated, pair.updated_title, UPDATED, "dash", (0.52, 1.0)),
        ]
        for values, title, color, dash, across in sides if updated.size else sides[:1]:
            # Axes of its own, so that a page can zoom one shape.
            panel = Panel(replace(x), replace(y), across, up, title)
            panels.append(panel)
            marks += grid.lines(np.zeros(values.size), QUIET, "dot", 0.7, panel)
            marks += grid.lines(values, color, dash, 1.0, panel)
            marks += grid.dots(values, color, points, panel)
    return Figure(
        f"Mode shapes, measured{both}" + (which and f": {which}"),
        marks,
        panels,
        height=110 + max(130 * len(pairs), 260),
        margins={"l": 30},
        meta={"points": list(points), **_named(places), "modes": modes},
    )


def _named(places: FloatArray) -> dict[str, list[float | None]]:
    """Coordinates by name; z of bodies in space."""
    used = 3 if places.shape[1] > 2 and np.ptp(places[:, 2]) > 0 else 2
    return {name: numbers(places[:, axis]) for axis, name in enumerate(("x_m", "y_m", "z_m")[:used])}


def aligned(measured: ComplexArray, updated: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Both shapes real, with their greatest value ±1 and alike in sign."""
    updated = updated / max(float(np.abs(updated).max(initial=0.0)), 1e-300)
    if measured.size == 0:
        return np.zeros(0), updated
    real = turned(measured).real
    if updated.size and real @ updated[: real.size] < 0:
        real = -real
    return real / max(float(np.abs(real).max()), 1e-300), updated


def turned(shape: ComplexArray) -> ComplexArray:
    """A complex shape, turned so that as much of it as possible is real: by half the angle of Σφ²."""
    return np.asarray(shape * np.exp(-0.5j * np.angle(np.sum(shape**2))))


class _Grid:
    """Points of a specimen joined with their neighbours, in an oblique view; each is moved up by its value."""

    def __init__(self, places: FloatArray) -> None:
        low, size = places.min(axis=0), np.ptp(places, axis=0)
        share = (places - low) / np.where(size > 0, size, 1.0)
        z = _HEIGHT * share[:, 2] if share.shape[1] > 2 else np.zeros(len(share))  # older results have x and y alone
        self._across = share[:, 0] + _OBLIQUE * share[:, 1]
        self._up = _DEPTH * share[:, 1] + z
        self.height = _DEPTH + float(z.max(initial=0.0))
        self._places = places
        self._chains: dict[int, list[list[int]]] = {}

    def lines(self, values: FloatArray, color: str, dash: Dash, width: float, panel: Panel) -> list[Mark]:
        """The points joined with their neighbours."""
        up = np.append(self._up[: values.size] + values, np.nan)
        across = np.append(self._across[: values.size], np.nan)
        if values.size not in self._chains:
            self._chains[values.size] = chains(self._places[: values.size])
        joined = [i for chain in self._chains[values.size] for i in (*chain, -1)]  # a gap behind each line
        if not joined:
            return []
        return [Curve(across[joined], up[joined], "", color, dash, width, digits=4, panel=panel, hover=None)]

    def dots(self, values: FloatArray, color: str, labels: Sequence[int], panel: Panel) -> list[Mark]:
        """Marks at the points."""
        if values.size == 0:
            return []
        place = self._across[: values.size], self._up[: values.size] + values
        said: Any = {"text": [f"{value:+.3f}" for value in values], "hover": "point %{customdata}: %{text}"}
        return [Points(*place, "", color, size=5, digits=4, panel=panel, ids=list(labels[: values.size]), **said)]
