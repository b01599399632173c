"""Matrices of correlation with their values: MAC of measured and model shapes, autoMAC of the measured ones."""

from __future__ import annotations

from collections.abc import Sequence

from service.show.figures.look import MANY_NAMES, Figure, axis, layout, named_ticks, numbers

_FEWEST_DIGITS = 12  # columns from which a value is printed with one digit
_MOST_VALUES = 40  # columns beyond which there is no room for values


def mac_figure(
    matrix: Sequence[Sequence[float | None]], rows: Sequence[str], columns: Sequence[str], title: str, across: str
) -> Figure:
    """A matrix of MAC values, in Cividis, each value printed where there is room.

    Args:
        matrix: (n, m) from 0 to 1; None where there is none.
        rows: names of the n measured modes.
        columns: names of the m modes across.
        title: of the figure.
        across: title of the axis across.
    """
    crowded = len(columns) > _MOST_VALUES
    digits = 2 if len(columns) <= _FEWEST_DIGITS else 1
    shown = [numbers([float("nan") if value is None else value for value in row], 5) for row in matrix]
    trace = {
        "type": "heatmap",
        "z": shown,
        "x": list(range(len(columns))),
        "y": list(range(len(rows))),
        "text": [["" if value is None or crowded else f"{value:.{digits}f}" for value in row] for row in shown],
        "texttemplate": "%{text}",
        "colorscale": "Cividis",
        "zmin": 0,
        "zmax": 1,
        "xgap": 1,
        "ygap": 1,
        "colorbar": {"title": {"text": "MAC"}},
        "hovertemplate": "measured mode %{y}, mode %{x}: %{z:.4f}<extra></extra>",
        "customdata": [[[i + 1, j + 1] for j in range(len(columns))] for i in range(len(rows))],
    }
    trace["hovertemplate"] = "%{customdata[0]} and %{customdata[1]}: %{z:.4f}<extra></extra>"
    down = axis("measured mode", autorange="reversed", **named_ticks(rows))
    height = 200 + 34 * max(len(rows), 4)
    return {
        "data": [trace],
        "layout": layout(
            title,
            xaxis=axis(across, **named_ticks(columns)),
            yaxis=down,
            height=min(height, 900),
            margin={"r": 90, "l": 120, "b": 130 if len(columns) > MANY_NAMES else 85},
        ),
    }
