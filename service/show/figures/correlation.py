"""Agreement of measured and predicted FRFs: line by line (CSAC, CSF), and by point on the specimen (SAC, FRAC)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fecore.arrays import FloatArray
from service.show.figures.look import INITIAL, QUIET, UPDATED, Figure, Trace, axis, layout, line, marks, numbers

TITLES = {"csac": "CSAC: agreement in shape, line by line", "csf": "CSF: agreement in level, line by line"}


def agreement_figure(name: str, hz: FloatArray, initial: FloatArray, updated: FloatArray, modes: ArrayLike) -> Figure:
    """CSAC or CSF over frequency, before and after.

    Args:
        name: `csac` or `csf`.
        hz: (L,) lines of the fitted band.
        initial: (L,) from 0 to 1.
        updated: (L,) the same after.
        modes: (n,) measured natural frequencies, Hz, which are marked.
    """
    x = numbers(hz)
    inside = [value for value in numbers(modes) if value is not None and hz[0] <= value <= hz[-1]]
    data = [
        line(x, numbers(initial, 4), f"initial, mean {np.nanmean(initial):.3f}", INITIAL, "dot"),
        line(x, numbers(updated, 4), f"updated, mean {np.nanmean(updated):.3f}", UPDATED, "solid"),
    ]
    shown = layout(
        TITLES[name],
        xaxis=axis("frequency [Hz]"),
        yaxis=axis(name.upper(), range=[0, 1.03]),
        shapes=[_upright(value) for value in inside],
    )
    return {"data": data, "layout": shown}


def _upright(x: float) -> dict[str, Any]:
    line = {"color": QUIET, "width": 1, "dash": "dot"}
    return {"type": "line", "xref": "x", "yref": "y domain", "x0": x, "x1": x, "y0": 0, "y1": 1, "line": line}


@dataclass(frozen=True)
class PointValues:
    """A criterion by FRF, at the point that distinguishes the FRF from others.

    Attributes:
        labels: of the points.
        x, y: their places on the specimen, m.
        sac, frac: from 0 to 1; NaN where there is none.
        held_out: whether the FRF was held out of the fit.
    """

    labels: Sequence[int]
    x: FloatArray
    y: FloatArray
    sac: FloatArray
    frac: FloatArray
    held_out: Sequence[bool]


def points_figure(values: PointValues, length: float, width: float) -> Figure:
    """SAC and FRAC at the points of the specimen, seen from above, each point in the colour of its value.

    Args:
        values: by point.
        length: of the specimen, m.
        width: of it, m; y runs from -width/2 to width/2.
    """
    data: list[Trace] = []
    lowest = float(np.nanmin([*values.sac, *values.frac, 1.0]))
    floor = float(np.floor(10 * max(lowest, 0.0)) / 10)
    held = np.array(values.held_out, dtype=bool)
    for panel, (name, found) in enumerate((("SAC", values.sac), ("FRAC", values.frac)), start=1):
        place = "" if panel == 1 else "2"
        for rows, symbol, words in ((~held, "circle", "fitted"), (held, "diamond", "held out of the fit")):
            if not rows.any():
                continue
            labels = [label for label, here in zip(values.labels, rows, strict=True) if here]
            trace = marks(
                numbers(values.x[rows]), numbers(values.y[rows]), words if panel == 1 else "", numbers(found[rows], 4),
                symbol, size=14, xaxis="x", yaxis=f"y{place}", customdata=labels,
                hovertemplate=f"point %{{customdata}}: {name} %{{marker.color:.4f}}<extra></extra>",
            )  # fmt: skip
            trace["marker"] |= {
                "colorscale": "Cividis", "cmin": floor, "cmax": 1.0, "showscale": symbol == "circle",
                "line": {"color": QUIET, "width": 0.5},
                "colorbar": {"title": {"text": name}, "len": 0.45, "y": 0.8 if panel == 1 else 0.2},
            }  # fmt: skip
            data.append(trace)
    edge = {
        "type": "rect",
        "x0": 0,
        "x1": length,
        "y0": -width / 2,
        "y1": width / 2,
        "line": {"color": QUIET, "width": 1},
    }
    reach = [-0.75 * width, 0.75 * width]
    shown = layout(
        "SAC and FRAC by point on the specimen",
        xaxis=axis("x [m]", anchor="y2", range=[-0.03 * length, 1.03 * length]),
        yaxis=axis("y [m]", domain=[0.58, 1.0], range=reach),
        yaxis2=axis("y [m]", domain=[0.0, 0.42], range=reach),
        shapes=[
            {**edge, "xref": "x", "yref": "y", "layer": "below"},
            {**edge, "xref": "x", "yref": "y2", "layer": "below"},
        ],
        annotations=[
            {"text": name, "x": 0.5, "y": y, "xref": "paper", "yref": "paper", "showarrow": False, "yanchor": "bottom"}
            for name, y in (("SAC", 1.0), ("FRAC", 0.42))
        ],
        height=460,
        margin={"r": 95, "t": 70},
    )
    return {"data": data, "layout": shown}
