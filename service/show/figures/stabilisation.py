"""The stabilisation diagram: poles by order of the model over the sum of the measured FRFs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from service.show.figures.look import (
    INITIAL,
    MEASURED,
    QUIET,
    UPDATED,
    Figure,
    Trace,
    axis,
    layout,
    line,
    marks,
    numbers,
)

KINDS = (
    ("stable in frequency and damping", "circle", UPDATED, 5),
    ("stable in frequency", "diamond-open", INITIAL, 5),
    ("new", "cross", QUIET, 4),
)


def stabilisation_figure(
    diagram: Mapping[str, Any], modes: Sequence[Mapping[str, Any]], doubtful: Sequence[Mapping[str, Any]]
) -> Figure:
    """Poles by order, and the modes that were chosen.

    Args:
        diagram: `stabilisation` of an identification's document: `order`, `frequency_hz`, `damping_ratio`, `frequency_stable`
            and `damping_stable` of the poles, and the `indicator` with its lines.
        modes: that were chosen.
        doubtful: those that were called doubtful.
    """
    order, hz = np.array(diagram["order"]), np.array(diagram["frequency_hz"], dtype=float)
    ratio = 100 * np.array(diagram["damping_ratio"], dtype=float)
    in_frequency = np.array(diagram["frequency_stable"], dtype=bool)
    in_both = in_frequency & np.array(diagram["damping_stable"], dtype=bool)
    indicator = diagram["indicator"]
    rms = np.array(indicator["rms"], dtype=float)
    data: list[Trace] = [
        line(
            numbers(indicator["frequency_hz"]), numbers(np.where(rms > 0, rms, np.nan), 5), "rms of the FRFs", QUIET,
            yaxis="y2", hoverinfo="skip",
        )
    ]  # fmt: skip
    for (name, symbol, color, size), rows in zip(KINDS, (in_both, in_frequency & ~in_both, ~in_frequency), strict=True):
        text = [f"{value:.3g} %" for value in ratio[rows]]
        data.append(
            marks(numbers(hz[rows]), order[rows].tolist(), name, color, symbol, size=size)
            | {"text": text, "hovertemplate": "%{x:.5g} Hz, ζ %{text}, order %{y}<extra></extra>"}
        )
    lines = indicator["frequency_hz"]
    shown = layout(
        "Stabilisation diagram, with the identified modes as upright lines",
        xaxis=axis("frequency [Hz]", range=[min(lines), max(lines)]),
        yaxis=axis("order of the model"),
        yaxis2=axis("", type="log", overlaying="y", side="right", showgrid=False, showticklabels=False),
        shapes=[_upright(mode["frequency_hz"], MEASURED, "solid") for mode in modes]
        + [_upright(mode["frequency_hz"], INITIAL, "dot") for mode in doubtful],
        height=520,
    )
    return {"data": data, "layout": shown}


def _upright(x: float, color: str, dash: str) -> dict[str, Any]:
    line = {"color": color, "width": 1, "dash": dash}
    return {"type": "line", "xref": "x", "yref": "y domain", "x0": x, "x1": x, "y0": 0, "y1": 1, "line": line}
