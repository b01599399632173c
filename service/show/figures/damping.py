"""Measured damping ratios and the laws that were fitted to them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fecore.arrays import FloatArray
from service.show.figures.look import MEASURED, UPDATED, Z_95, Figure, Trace, axis, layout, line, marks, numbers
from service.show.figures.palette import PALETTE

_ABOUT = 4.0  # how far the axis goes beyond the measured ratios


def damping_figure(laws: Sequence[Mapping[str, Any]], modes: Sequence[Mapping[str, Any]]) -> Figure:
    """ζ over frequency, both logarithmic: the first law is the one whose coefficients are reported.

    Args:
        laws: as a result document has them, each with its `curve`.
        modes: of the result, with measured ratios and, where they are known, their standard deviations.
    """
    data: list[Trace] = []
    for k, law in enumerate(laws):
        curve = law["curve"]
        ratio = [100 * value if value is not None and value > 0 else None for value in curve["damping_ratio"]]
        name = law["name"] + (" (reported)" if k == 0 else "") + (" (preferred)" if law["preferred"] else "")
        color = UPDATED if k == 0 else PALETTE[1 + (k - 1) % (len(PALETTE) - 1)]
        trace = line(curve["frequency_hz"], ratio, name, color, "solid" if law["preferred"] else "dash")
        if law["by_mechanism"]:  # it has a ratio at modes alone
            symbol = "square-open" if k == 0 else "triangle-up-open"
            trace = marks(curve["frequency_hz"], ratio, name, color, symbol, size=7)
        else:
            trace["line"]["width"] = 2.0 if k == 0 or law["preferred"] else 1.0
        data.append(trace)
    seen = [mode for mode in modes if mode["measured_damping"]]
    ratios = np.array([100 * mode["measured_damping"] for mode in seen])
    spread = np.array([100 * Z_95 * (mode["measured_damping_sd"] or 0.0) for mode in seen])
    error = {
        "type": "data", "symmetric": False, "array": numbers(spread), "color": MEASURED, "thickness": 1,
        "arrayminus": numbers(np.minimum(spread, 0.95 * ratios)),
    }  # fmt: skip
    hz = [mode["measured_hz"] for mode in seen]
    named = [f"mode {mode['number']}" for mode in seen]
    data.append(
        marks(numbers(hz), numbers(ratios), "measured, 95 %" if spread.any() else "measured", MEASURED, error_y=error)
        | {"text": named, "hovertemplate": "%{text}: %{y:.3g} %<extra></extra>"}
    )
    shown = layout(
        "Damping ratios: measured, and the laws",
        xaxis=axis("frequency [Hz]", type="log"),
        yaxis=axis("ζ [%]", type="log", **({"range": _range(ratios)} if seen else {})),
    )
    return {"data": data, "layout": shown}


def _range(ratios: FloatArray) -> list[float]:
    """Decades about the measured ratios: a law may leave them far below and above, between and beyond the modes."""
    return [float(np.log10(ratios.min() / _ABOUT)), float(np.log10(ratios.max() * _ABOUT))]
