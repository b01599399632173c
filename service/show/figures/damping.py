"""Measured damping ratios and the laws that were fitted to them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fecore.normal import Z_95
from service.show.figures.colors import MEASURED, PALETTE, UPDATED
from service.show.figures.marks import Axis, Curve, Dash, Figure, Mark, Panel, Points

_ABOUT = 4.0  # how far the axis goes beyond the measured ratios: a law may leave them far below and above


def damping_figure(laws: Sequence[Mapping[str, Any]], modes: Sequence[Mapping[str, Any]]) -> Figure:
    """ζ over frequency, both logarithmic: the first law is the one whose coefficients are reported.

    Args:
        laws: as a result document has them, each with its `curve`.
        modes: of the result, with measured ratios and, where they are known, their standard deviations.
    """
    marks: list[Mark] = [
        _law(law, UPDATED if k == 0 else PALETTE[1 + (k - 1) % 9], k == 0) for k, law in enumerate(laws)
    ]
    seen = [mode for mode in modes if mode["measured_damping"]]
    ratios = np.array([100 * mode["measured_damping"] for mode in seen])
    spread = np.array([100 * Z_95 * (mode["measured_damping_sd"] or 0.0) for mode in seen])
    name = "measured, 95 %" if spread.any() else "measured"
    said: Any = {"text": [f"mode {mode['number']}" for mode in seen], "hover": "%{text}: %{y:.3g} %"}
    error = np.array([np.minimum(spread, 0.95 * ratios), spread])
    marks.append(Points([mode["measured_hz"] for mode in seen], ratios, name, MEASURED, error_y=error, **said))
    ends = (ratios.min() / _ABOUT, ratios.max() * _ABOUT) if seen else None
    panel = Panel(Axis("frequency [Hz]", "log"), Axis("ζ [%]", "log", ends))
    return Figure("Damping ratios: measured, and the laws", marks, [panel])


def _law(law: Mapping[str, Any], color: str, reported: bool) -> Mark:
    hz, ratios = law["curve"]["frequency_hz"], np.array(law["curve"]["damping_ratio"], dtype=float)
    ratios = np.where(ratios > 0, 100 * ratios, np.nan)
    name = law["name"] + (" (reported)" if reported else "") + (" (preferred)" if law["preferred"] else "")
    if law["by_mechanism"]:  # it has a ratio at modes alone
        return Points(hz, ratios, name, color, "square-open" if reported else "triangle-up-open", 7)
    dash: Dash = "solid" if law["preferred"] else "dash"
    return Curve(hz, ratios, name, color, dash, 2.0 if reported or law["preferred"] else 1.0)
