"""Mode shapes, measured beside updated: the points of the specimen in an oblique view, moved up by their deflection."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fecore.arrays import ComplexArray, FloatArray
from service.show.figures.colors import MEASURED, QUIET, UPDATED
from service.show.figures.marks import Axis, Curve, Dash, Figure, Mark, Panel, Points
from service.show.figures.screen import numbers

# How far a row of points is set off to the right and up, as shares of length and deflection.
_OBLIQUE, _DEPTH = 0.18, 0.9
_SAME_ROW = 1e-3  # of the specimen's size: points this near lie in one row
MOST_MODES, MOST_ROWS = 40, 8
"""Pairs that are drawn at all, the rest is a table's; and in a figure that is no higher than a page."""


@dataclass(frozen=True)
class ShapePair:
    """A measured shape and that of its partner."""

    number: int  # of the measured mode
    measured_title: str  # such as `measured, 160.9 Hz`.
    updated_title: str
    measured: ComplexArray  # (p,) complex, at the first p points; empty where it has no shape
    updated: FloatArray  # (P,) real


def shapes_figure(pairs: Sequence[ShapePair], points: Sequence[int], places: FloatArray, which: str = "") -> Figure:
    """One row of panels a mode: measured on the left, updated on the right, over the undeformed grid.

    `layout.meta` has the same as numbers for an animation: `points`, `x_m`, `y_m`, and by mode `measured` and `updated`
    (None where a point has none), each with its greatest value ±1 and turned to the same sign.

    Args:
        pairs: in the order of the measured modes.
        points: (P,) labels; those of the measured shapes first.
        places: (P, 2) x and y, m.
        which: of all pairs these are, for the title; empty where they are all.
    """
    marks: list[Mark] = []
    panels, modes = [], []
    grid = _Grid(places)
    x, y = (Axis(range=ends, hidden=True) for ends in ((-0.05, 1.1 + _OBLIQUE), (-1.15, 1.15 + _DEPTH)))
    for row, pair in enumerate(pairs):
        measured, updated = aligned(pair.measured, pair.updated)
        padded = np.concatenate([measured, np.full(len(points) - measured.size, np.nan)])
        modes.append({"number": pair.number, "measured": numbers(padded, 5), "updated": numbers(updated, 5)})
        up = 1 - (row + 0.8) / len(pairs), 1 - (row + 0.12) / len(pairs)
        sides: tuple[tuple[FloatArray, str, str, Dash, tuple[float, float]], ...] = (
            (measured, pair.measured_title, MEASURED, "solid", (0.0, 0.48)),
            (updated, pair.updated_title, UPDATED, "dash", (0.52, 1.0)),
        )
        for values, title, color, dash, across in sides:
            # Axes of its own, so that a page can zoom one shape.
            panel = Panel(replace(x), replace(y), across, up, title)
            panels.append(panel)
            marks += grid.lines(np.zeros(values.size), QUIET, "dot", 0.7, panel)
            marks += grid.lines(values, color, dash, 1.0, panel)
            marks += grid.dots(values, color, points, panel)
    return Figure(
        "Mode shapes, measured and updated" + (which and f": {which}"),
        marks,
        panels,
        height=110 + max(130 * len(pairs), 260),
        margins={"l": 30},
        meta={"points": list(points), "x_m": numbers(places[:, 0]), "y_m": numbers(places[:, 1]), "modes": modes},
    )


def aligned(measured: ComplexArray, updated: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Both shapes real, with their greatest value ±1 and alike in sign.

    The complex shape is turned so that as much of it as possible is real: by half the angle of Σφ².
    """
    updated = updated / max(float(np.abs(updated).max(initial=0.0)), 1e-300)
    if measured.size == 0:
        return np.zeros(0), updated
    real = (measured * np.exp(-0.5j * np.angle(np.sum(measured**2)))).real
    if real @ updated[: real.size] < 0:
        real = -real
    return real / max(float(np.abs(real).max()), 1e-300), updated


class _Grid:
    """Points of a specimen in rows along x and along y, in an oblique view; each is moved up by its value."""

    def __init__(self, places: FloatArray) -> None:
        low, size = places.min(axis=0), np.ptp(places, axis=0)
        share = (places - low) / np.where(size > 0, size, 1.0)
        self._across = share[:, 0] + _OBLIQUE * share[:, 1]
        self._up = _DEPTH * share[:, 1]
        self._chains = [*_rows(share, 1, 0), *_rows(share, 0, 1)]

    def lines(self, values: FloatArray, color: str, dash: Dash, width: float, panel: Panel) -> list[Mark]:
        """The points joined along the rows."""
        up = np.append(self._up[: values.size] + values, np.nan)
        across = np.append(self._across[: values.size], np.nan)
        inside = ([i for i in chain if i < values.size] for chain in self._chains)
        joined = [i for chain in inside if len(chain) > 1 for i in (*chain, -1)]  # a gap behind each row
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


def _rows(share: FloatArray, fixed: int, along: int) -> Iterator[list[int]]:
    """Numbers of the points of each row of equal coordinate `fixed`, in the order of the other one."""
    rows: list[list[int]] = []
    for i in np.argsort(share[:, fixed], kind="stable"):
        if rows and share[i, fixed] - share[rows[-1][-1], fixed] < _SAME_ROW:
            rows[-1].append(int(i))
        else:
            rows.append([int(i)])
    for row in rows:
        yield sorted(row, key=lambda i: float(share[i, along]))
