"""The overlay of an FRF: log magnitude, phase and coherence; measured, of the initial model, of the updated one."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from fecore.arrays import ComplexArray, FloatArray, IntArray
from service.show.figures.look import (
    HELD_OUT,
    INITIAL,
    MEASURED,
    OUTSIDE,
    UPDATED,
    Z_95,
    Figure,
    Trace,
    axis,
    band,
    decades,
    layout,
    line,
    numbers,
    shown_name,
)

MOST_LINES = 3200
"""Lines that a figure draws: of more, the least and the greatest measured magnitude of each stretch."""
_ABOUT = 4.0  # how far the axis of the magnitude goes beyond what was measured
UNITS = {"accelerance": "(m/s²)/N", "mobility": "(m/s)/N", "receptance": "m/N"}
MODELS = {"initial": (INITIAL, "dot"), "updated": (UPDATED, "dash")}


@dataclass(frozen=True)
class Spread:
    """How sure a predicted FRF is: (L,) standard deviations of ln|H| and of its phase in radians."""

    log_magnitude: FloatArray
    phase: FloatArray


@dataclass(frozen=True)
class FrfCurves:
    """One FRF as measured and as the models predict it.

    Attributes:
        title: which FRF, in words.
        quantity: accelerance, mobility or receptance.
        frequency_hz: (L,).
        measured: (L,) SI; None where only models are drawn.
        coherence: (L,) γ², or None.
        models: (L,) by name, `initial` and `updated`; empty of a campaign without an update.
        spread: of the updated model, or None.
        band_hz: the lines that were fitted; None without a fit.
        held_band_hz: lines that were held out of the fit, or None.
    """

    title: str
    quantity: str
    frequency_hz: FloatArray
    measured: ComplexArray
    coherence: FloatArray | None = None
    models: dict[str, ComplexArray] | None = None
    spread: Spread | None = None
    band_hz: tuple[float, float] | None = None
    held_band_hz: tuple[float, float] | None = None


def frf_figure(curves: FrfCurves) -> Figure:
    """The overlay of one FRF.

    Args:
        curves: what is drawn. The panel of the coherence is there where one was stored.
    """
    kept = thinned(np.abs(curves.measured))
    hz = numbers(curves.frequency_hz[kept])
    with_coherence = curves.coherence is not None
    domains: tuple[tuple[float, float], ...] = (
        ((0.5, 1.0), (0.22, 0.46), (0.0, 0.18)) if with_coherence else ((0.38, 1.0), (0.0, 0.34))
    )
    data = [*_interval(curves, kept, hz), *_responses(curves, kept, hz)]
    if curves.coherence is not None:
        data.append(line(hz, numbers(curves.coherence[kept], 4), "", MEASURED, yaxis="y3", hovertemplate=_HOVER))
    unit = UNITS.get(curves.quantity, "")
    shown = layout(
        shown_name(curves.title),
        xaxis=axis("frequency [Hz]", anchor="y3" if with_coherence else "y2"),
        yaxis=axis(f"|{curves.quantity}| [{unit}]", domain=list(domains[0]), **_range(curves)),
        yaxis2=axis("phase [°]", domain=list(domains[1]), range=[-190, 190])
        | {"tickvals": [-180, -90, 0, 90, 180], "ticktext": ["−180", "−90", "0", "90", "180"]},
        shapes=_regions(curves, 3 if with_coherence else 2),
        height=640 if with_coherence else 560,
    )
    if with_coherence:
        shown["yaxis3"] = axis("coherence", domain=list(domains[2]), range=[0, 1.03])
    return {"data": data, "layout": shown}


_HOVER = "%{x:.5g} Hz: %{y:.4g}"


def thinned(magnitude: FloatArray, most: int = MOST_LINES) -> IntArray:
    """Which lines are drawn: all, or of each stretch those of the least and the greatest magnitude, so that no peak is lost.

    Args:
        magnitude: (L,) of the measured FRF.
        most: lines, about.
    """
    count = magnitude.size
    if count <= most:
        return np.arange(count)
    edges = np.linspace(0, count, most // 2 + 1).astype(int)
    stretches = pairwise(edges)
    ends = [(a + int(np.argmin(magnitude[a:b])), a + int(np.argmax(magnitude[a:b]))) for a, b in stretches]
    return np.unique(np.concatenate([np.array(ends).ravel(), [0, count - 1]]))


def _responses(curves: FrfCurves, kept: IntArray, hz: list[float | None]) -> list[Trace]:
    """Magnitude and phase of what was measured and of each model."""
    drawn = [("measured", curves.measured, MEASURED, "solid")]
    drawn += [(name, values, *MODELS[name]) for name, values in (curves.models or {}).items()]
    traces = []
    for name, values, color, dash in drawn:
        magnitude = np.where(values[kept] == 0, np.nan, np.abs(values[kept]))
        common: dict[str, Any] = {"legendgroup": name, "hovertemplate": f"{name}, {_HOVER}<extra></extra>"}
        traces.append(line(hz, numbers(magnitude, 5), name, color, dash, **common))
        x, phase = _broken(curves.frequency_hz[kept], np.degrees(np.angle(values[kept])))
        traces.append(line(x, phase, name, color, dash, yaxis="y2", **common | {"showlegend": False}))
    return traces


def _range(curves: FrfCurves) -> dict[str, Any]:
    """Decades about what was measured: a model may fall far below its noise."""
    seen = np.abs(curves.measured)
    seen = seen[seen > 0]
    if seen.size == 0:
        return decades(seen)
    ends = np.array([seen.min() / _ABOUT, seen.max() * _ABOUT])
    return {**decades(ends), "range": numbers(np.log10(ends), 4)}


def _broken(hz: FloatArray, phase: FloatArray) -> tuple[list[float | None], list[float | None]]:
    """A wrapped phase in degrees with a gap where it wraps, so that no line crosses the panel."""
    jumps = np.flatnonzero(np.abs(np.diff(phase)) > 180) + 1
    return numbers(np.insert(hz, jumps, hz[jumps])), numbers(np.insert(phase, jumps, np.nan), 4)


def _interval(curves: FrfCurves, kept: IntArray, hz: list[float | None]) -> list[Trace]:
    """The updated model's 95 % interval: a factor of the magnitude, and a part of a turn of the phase."""
    if curves.spread is None or not curves.models:
        return []
    updated = curves.models["updated"][kept]
    reach = np.exp(np.clip(Z_95 * curves.spread.log_magnitude[kept].astype(float), 0, 12))
    magnitude = np.where(updated == 0, np.nan, np.abs(updated))
    half = np.degrees(np.clip(Z_95 * curves.spread.phase[kept].astype(float), 0, np.pi))
    phase = np.degrees(np.angle(updated))
    low, high = (np.clip(phase + sign * half, -180, 180) for sign in (-1, 1))
    return [
        *band(hz, numbers(magnitude / reach, 5), numbers(magnitude * reach, 5), "updated, 95 %"),
        *band(hz, numbers(low, 4), numbers(high, 4), "", yaxis="y2"),
    ]


def _regions(curves: FrfCurves, panels: int) -> list[dict[str, Any]]:
    """What lies outside the fitted band is grey, what was held out of it orange, in every panel."""
    first, last = float(curves.frequency_hz[0]), float(curves.frequency_hz[-1])
    wanted: list[tuple[float, float, str]] = []
    if curves.band_hz is not None:
        low, high = curves.band_hz
        wanted = [(first, low, OUTSIDE), (high, last, OUTSIDE)]
    if curves.held_band_hz is not None:
        wanted.append((*curves.held_band_hz, HELD_OUT))
    regions = [(max(a, first), min(b, last), color) for a, b, color in wanted]
    return [
        {
            "type": "rect", "layer": "below", "xref": "x", "yref": f"y{'' if panel == 1 else panel} domain",
            "x0": low, "x1": high, "y0": 0, "y1": 1, "fillcolor": color, "line": {"width": 0, "color": color},
        }
        for low, high, color in regions if low < high
        for panel in range(1, panels + 1)
    ]  # fmt: skip
