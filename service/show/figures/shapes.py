"""Mode shapes, measured beside updated: the points of the specimen in an oblique view, moved up by their deflection."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fecore.arrays import ComplexArray, FloatArray
from service.show.figures.look import MEASURED, QUIET, UPDATED, Figure, Trace, axis, layout, numbers

# How far a row of points is set off to the right and up, as shares of length and deflection.
_OBLIQUE, _DEPTH = 0.18, 0.9
_SAME_ROW = 1e-3  # of the specimen's size: points this near lie in one row
MOST_MODES, MOST_ROWS = 40, 8
"""Pairs that are drawn at all, the rest is a table's; and in a figure that is no higher than a page."""


@dataclass(frozen=True)
class ShapePair:
    """A measured shape and that of its partner.

    Attributes:
        number: of the measured mode.
        measured_title, updated_title: such as `measured, 160.9 Hz`.
        measured: (p,) complex, at the first p points; empty where it has no shape.
        updated: (P,) real.
    """

    number: int
    measured_title: str
    updated_title: str
    measured: ComplexArray
    updated: FloatArray


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
    data: list[Trace] = []
    axes: dict[str, Any] = {}
    notes, modes = [], []
    grid = _Grid(places)
    count = len(pairs)
    for row, pair in enumerate(pairs):
        measured, updated = aligned(pair.measured, pair.updated)
        modes.append(
            {
                "number": pair.number,
                "measured": numbers(_padded(measured, len(points)), 5),
                "updated": numbers(updated, 5),
            }
        )
        top = 1 - row / count
        domain = [top - 0.8 / count, top - 0.12 / count]
        for side, (values, title, color, dash) in enumerate(
            ((measured, pair.measured_title, MEASURED, "solid"), (updated, pair.updated_title, UPDATED, "dash"))
        ):
            place = 2 * row + side + 1
            x, y = f"x{place}" if place > 1 else "x", f"y{place}" if place > 1 else "y"
            across = [0.0, 0.48] if side == 0 else [0.52, 1.0]
            axes[f"xaxis{x[1:]}"] = axis("", domain=across, anchor=y, visible=False, range=[-0.05, 1.1 + _OBLIQUE])
            axes[f"yaxis{y[1:]}"] = axis("", domain=domain, anchor=x, visible=False, range=[-1.15, 1.15 + _DEPTH])
            data += grid.traces(np.zeros(values.size), {"color": QUIET, "dash": "dot"}, "", (x, y))
            name = ("measured", "updated")[side] if row == 0 else ""
            data += grid.traces(values, {"color": color, "dash": dash}, name, (x, y), points)
            notes.append(
                {
                    "text": title, "x": 0.0, "y": 1.0, "xref": f"{x} domain", "yref": f"{y} domain", "showarrow": False,
                    "xanchor": "left", "yanchor": "bottom", "font": {"size": 13},
                }
            )  # fmt: skip
    meta = {"points": list(points), "x_m": numbers(places[:, 0]), "y_m": numbers(places[:, 1]), "modes": modes}
    shown = layout(
        "Mode shapes, measured and updated" + (which and f": {which}"),
        annotations=notes,
        height=110 + max(130 * count, 260),
        meta=meta,
        margin={"l": 30},
        **axes,
    )
    return {"data": data, "layout": shown}


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


def _padded(values: FloatArray, count: int) -> FloatArray:
    return np.concatenate([values, np.full(count - values.size, np.nan)])


class _Grid:
    """Points of a specimen in rows along x and along y, in an oblique view."""

    def __init__(self, places: FloatArray) -> None:
        low, size = places.min(axis=0), np.ptp(places, axis=0)
        share = (places - low) / np.where(size > 0, size, 1.0)
        self._across = share[:, 0] + _OBLIQUE * share[:, 1]
        self._up = _DEPTH * share[:, 1]
        self._chains = [*_rows(share, 1, 0), *_rows(share, 0, 1)]

    def traces(
        self, values: FloatArray, style: dict[str, Any], name: str, panel: tuple[str, str], labels: Sequence[int] = ()
    ) -> Iterator[Trace]:
        """The points moved up by their values, joined along the rows; marks at them where they have labels."""
        count = values.size
        if count == 0:
            return
        up = self._up[:count] + values
        line_x: list[float | None] = []
        line_y: list[float | None] = []
        for chain in self._chains:
            seen = [i for i in chain if i < count]
            if len(seen) > 1:
                line_x += [*numbers(self._across[seen], 4), None]
                line_y += [*numbers(up[seen], 4), None]
        common = {"type": "scatter", "xaxis": panel[0], "yaxis": panel[1], "showlegend": False, "hoverinfo": "skip"}
        if line_x:
            drawn = style | {"width": 1.0 if labels else 0.7}
            yield {**common, "mode": "lines", "name": name, "x": line_x, "y": line_y, "line": drawn}
        if labels:
            marker = {"color": style["color"], "size": 5, "symbol": "circle"}
            yield {
                **common, "mode": "markers", "name": name, "x": numbers(self._across[:count], 4), "y": numbers(up, 4),
                "marker": marker, "customdata": list(labels[:count]), "text": [f"{value:+.3f}" for value in values],
                "hoverinfo": "all", "hovertemplate": "point %{customdata}: %{text}<extra></extra>",
            }  # fmt: skip


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
