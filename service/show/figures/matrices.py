"""Matrices of correlation with their values: MAC of measured and model shapes, autoMAC of the measured ones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from service.show.figures.marks import MANY_NAMES, Figure, Matrix, Panel, Scale, named_axis

_FEWEST_DIGITS = 12  # columns from which a value is printed with one digit
_MOST_VALUES = 40  # columns beyond which there is no room for values


def mac_figure(
    matrix: Sequence[Sequence[float | None]],
    rows: Sequence[str],
    columns: Sequence[str],
    title: str,
    across: str,
    down: str = "measured mode",
) -> Figure:
    """A matrix of MAC values, in Cividis, each value printed where there is room.

    Args:
        matrix: (n, m) from 0 to 1; None where there is none.
        rows: names of the n modes down.
        columns: names of the m modes across.
        title: of the figure.
        across: title of the axis across.
        down: title of the other axis.
    """
    values, count = np.array(matrix, dtype=float), len(columns)
    digits = 2 if count <= _FEWEST_DIGITS else 1
    cells = [
        ["" if np.isnan(value) or count > _MOST_VALUES else f"{value:.{digits}f}" for value in row] for row in values
    ]
    ids = [[[i + 1, j + 1] for j in range(count)] for i in range(len(rows))]
    hover = "%{customdata[0]} and %{customdata[1]}: %{z:.4f}"
    return Figure(
        title,
        [Matrix(values, cells, Scale("MAC", 0, 1), ids=ids, hover=hover)],
        [Panel(named_axis(across, columns), named_axis(down, rows, down=True))],
        height=min(200 + 34 * max(len(rows), 4), 900),
        margins={"r": 90, "l": 120, "b": 130 if count > MANY_NAMES else 85},
    )
