"""The overlay of an FRF: log magnitude, phase and coherence; measured, of the initial model, of the updated one."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from fecore.arrays import ComplexArray, FloatArray, IntArray
from fecore.frf import Dof
from fecore.normal import Z_95
from service.show.figures.colors import HELD_OUT, INITIAL, MEASURED, OUTSIDE, UPDATED
from service.show.figures.marks import Axis, Band, Curve, Dash, Figure, Kind, Mark, Panel, Region, decades, shortened

MOST_LINES = 3200  # lines that a figure draws: of more, the least and the greatest measured magnitude of each stretch
_ABOUT = 4.0  # how far the axis of the magnitude goes beyond what was measured
UNITS = {"accelerance": "(m/s²)/N", "mobility": "(m/s)/N", "receptance": "m/N"}
MODELS: dict[str, tuple[str, Dash]] = {"initial": (INITIAL, "dot"), "updated": (UPDATED, "dash")}


def dof_name(dof: Dof) -> str:
    """Point, sign and axis, such as `7+Z`."""
    return f"{dof.point}{'+' if dof.sign > 0 else '−'}{('X', 'Y', 'Z', 'RX', 'RY', 'RZ')[dof.axis - 1]}"


@dataclass(frozen=True)
class Spread:
    """How sure a predicted FRF is: (L,) standard deviations of ln|H| and of its phase in radians."""

    log_magnitude: FloatArray
    phase: FloatArray


@dataclass(frozen=True)
class FrfCurves:
    """One FRF as measured and as the models predict it."""

    title: str  # which FRF, in words
    quantity: str  # accelerance, mobility or receptance
    frequency_hz: FloatArray  # (L,)
    measured: ComplexArray  # (L,) SI; None where only models are drawn
    coherence: FloatArray | None = None  # (L,) γ², or None
    # (L,) by name, `initial` and `updated`; empty of a campaign without an update
    models: dict[str, ComplexArray] | None = None
    spread: Spread | None = None  # of the updated model, or None
    band_hz: tuple[float, float] | None = None  # the lines that were fitted; None without a fit
    held_band_hz: tuple[float, float] | None = None  # lines that were held out of the fit, or None


def frf_figure(curves: FrfCurves) -> Figure:
    """The overlay of one FRF.

    Args:
        curves: what is drawn. The panel of the coherence is there where one was stored.
    """
    kept = thinned(np.abs(curves.measured))
    hz = curves.frequency_hz[kept]
    x = Axis("frequency [Hz]")
    size = Axis(f"|{curves.quantity}| [{UNITS.get(curves.quantity, '')}]", *_decades(curves))
    turns = Axis("phase [°]", range=(-190, 190), ticks={-180: "−180", -90: "−90", 0: "0", 90: "90", 180: "180"})
    ups = ((0.38, 1.0), (0.0, 0.34)) if curves.coherence is None else ((0.5, 1.0), (0.22, 0.46))
    panels = [Panel(x, y, up=up) for y, up in zip((size, turns), ups, strict=True)]
    marks = [*_interval(curves, kept, panels[1]), *_responses(curves, kept, panels[1])]
    if curves.coherence is not None:
        panels.append(Panel(x, Axis("coherence", range=(0, 1.03)), up=(0.0, 0.18)))
        marks.append(Curve(hz, curves.coherence[kept], digits=4, panel=panels[-1], hover=_HOVER))
    regions = _regions(curves, panels)
    return Figure(shortened(curves.title), [*marks, *regions], panels, height=560 if len(panels) == 2 else 640)


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


def _responses(curves: FrfCurves, kept: IntArray, phases: Panel) -> list[Mark]:
    """Magnitude and phase of what was measured and of each model."""
    marks: list[Mark] = []
    for name, values in {"measured": curves.measured, **(curves.models or {})}.items():
        look = name, *MODELS.get(name, (MEASURED, "solid"))
        said: Any = {"group": name, "hover": f"{name}, {_HOVER}"}
        magnitude = np.where(values[kept] == 0, np.nan, np.abs(values[kept]))
        x, phase = _broken(curves.frequency_hz[kept], np.degrees(np.angle(values[kept])))
        marks.append(Curve(curves.frequency_hz[kept], magnitude, *look, digits=5, **said))
        marks.append(Curve(x, phase, *look, digits=4, panel=phases, listed=False, **said))
    return marks


def _decades(curves: FrfCurves) -> tuple[Kind, tuple[float, float] | None]:
    """Kind and ends of the axis of the magnitude, about what was measured: a model may fall far below its noise."""
    seen = np.abs(curves.measured)
    seen = seen[seen > 0]
    ends = (float(seen.min()) / _ABOUT, float(seen.max()) * _ABOUT) if seen.size else None
    return decades(ends or ()), ends


def _broken(hz: FloatArray, phase: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A wrapped phase in degrees with a gap where it wraps, so that no line crosses the panel."""
    jumps = np.flatnonzero(np.abs(np.diff(phase)) > 180) + 1
    return np.insert(hz, jumps, hz[jumps]), np.insert(phase, jumps, np.nan)


def _interval(curves: FrfCurves, kept: IntArray, phases: Panel) -> list[Mark]:
    """The updated model's 95 % interval: a factor of the magnitude, and a part of a turn of the phase."""
    if curves.spread is None or not curves.models:
        return []
    hz, updated = curves.frequency_hz[kept], curves.models["updated"][kept]
    reach = np.exp(np.clip(Z_95 * curves.spread.log_magnitude[kept].astype(float), 0, 12))
    magnitude = np.where(updated == 0, np.nan, np.abs(updated))
    half = np.degrees(np.clip(Z_95 * curves.spread.phase[kept].astype(float), 0, np.pi))
    phase = np.degrees(np.angle(updated))
    low, high = (np.clip(phase + sign * half, -180, 180) for sign in (-1, 1))
    return [
        Band(hz, magnitude / reach, magnitude * reach, "updated, 95 %", digits=5, hover=None),
        Band(hz, low, high, digits=4, panel=phases, hover=None),
    ]


def _regions(curves: FrfCurves, panels: list[Panel]) -> list[Mark]:
    """What lies outside the fitted band is grey, what was held out of it orange, in every panel."""
    first, last = float(curves.frequency_hz[0]), float(curves.frequency_hz[-1])
    wanted: list[tuple[float, float, str]] = []
    if curves.band_hz is not None:
        low, high = curves.band_hz
        wanted = [(first, low, OUTSIDE), (high, last, OUTSIDE)]
    if curves.held_band_hz is not None:
        wanted.append((*curves.held_band_hz, HELD_OUT))
    inside = [(max(low, first), min(high, last), color) for low, high, color in wanted]
    return [Region((low, high), color, panel=panel) for low, high, color in inside if low < high for panel in panels]
