"""Matrices with their values: MAC of measured and model shapes, autoMAC of the measured ones, sensitivities."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from fecore.arrays import FloatArray
from service.show.figures.marks import MANY_NAMES, Axis, Figure, Matrix, Panel, Scale, named_axis

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
    matrix_mark = Matrix(values, cells, Scale("MAC", 0, 1), ids=ids, hover=hover)
    return _figure(title, matrix_mark, named_axis(across, columns), named_axis(down, rows, down=True))


def sensitivities_figure(effects: Mapping[str, FloatArray], known: Mapping[str, bool], modes: Sequence[str]) -> Figure:
    """How much each frequency changes by one prior standard deviation of each parameter, parameter by mode.

    The prior decides a parameter whose row has small values alone.

    Args:
        effects: (m,) changes of ln f by parameter; NaN of a mode without a partner.
        known: by parameter, whether the data supply most of what is known of it.
        modes: names of the m measured modes.
    """
    percent = 100 * np.array(list(effects.values())).reshape(len(effects), len(modes))
    cells = [["" if np.isnan(value) else f"{value:+.1f}" for value in row] for row in percent]
    rows = [f"{name}  from the {'data' if known[name] else 'prior'}" for name in effects]
    largest = float(np.nanmax(np.abs(percent), initial=1e-6))
    hover = "%{y}, mode %{x}: %{text} % of its frequency"
    return _figure(
        "Sensitivities: change of each frequency by one prior standard deviation of a parameter",
        Matrix(np.abs(percent), cells, Scale("|Δf| [%]", 0, largest), hover=hover),
        named_axis("measured mode", modes),
        named_axis("", rows, down=True),
    )


def _figure(title: str, matrix: Matrix, across: Axis, down: Axis) -> Figure:
    rows, columns = np.shape(matrix.values)
    height, margins = min(200 + 34 * max(rows, 4), 900), {"r": 90, "l": 120, "b": 130 if columns > MANY_NAMES else 85}
    return Figure(title, [matrix], [Panel(across, down)], height=height, margins=margins)
