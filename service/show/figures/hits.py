"""The hits of a point: force and response in time, each hit's FRF, the coherence of the good ones; bad hits stand out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import cycle

import numpy as np

from fecore.arrays import ComplexArray, FloatArray
from service.show.figures.colors import ALARM, INITIAL, MEASURED, PALETTE, UPDATED
from service.show.figures.frf import UNITS, thinned
from service.show.figures.marks import Axis, Curve, Dash, Figure, Mark, Panel, decades, shortened

MOST_SAMPLES = 1600
"""Samples or lines of a hit that a figure draws: of more, the least and the greatest of each stretch."""
AFTER = {"acceleration": "m/s²", "velocity": "m/s", "displacement": "m"}
_BAD = (INITIAL, ALARM, PALETTE[3], PALETTE[6], PALETTE[8], PALETTE[9])


@dataclass(frozen=True)
class HitShown:
    """One hit."""

    number: int  # of the point, from 1
    good: bool  # whether it is used
    why: str  # what was found against it, in a few words; empty of a good one
    sentence: str  # the same at length
    force: FloatArray  # (n,) samples, SI
    response: FloatArray
    frf: ComplexArray  # (L,) of this hit alone


@dataclass(frozen=True)
class PointShown:
    """The hits of a point at one sensor."""

    title: str  # where was hit and measured
    quantity: str  # acceleration, velocity or displacement
    frf_quantity: str  # accelerance, mobility or receptance
    sample_rate_hz: float  # of the blocks
    frequency_hz: FloatArray  # (L,)
    pulse_s: tuple[float, float]  # begin of the first pulse and end of the last, s
    hits: list[HitShown]  # in their order
    mean: ComplexArray | None  # (L,) FRF of the good ones; None without any
    coherence: FloatArray | None  # (L,) of two good ones or more, or None


def hits_figure(point: PointShown) -> Figure:
    """The hits of a point, one below the other: force about the pulse, response, FRF, coherence.

    Good hits are drawn solid and alike; each bad one dashed in a colour of its own, with what was found in the legend.
    """
    hz = Axis("frequency [Hz]")
    size = f"|{point.frf_quantity}| [{UNITS[point.frf_quantity]}]"
    axes = [
        (Axis("time [ms]", range=_about_the_pulse(point)), Axis("force [N]")),
        (Axis("time [s]"), Axis(f"{point.quantity} [{AFTER[point.quantity]}]")),
        (hz, Axis(size, decades([] if point.mean is None else np.abs(point.mean)))),
    ]
    ups = [(0.76, 1.0), (0.46, 0.68), (0.0, 0.38)]
    if point.coherence is not None:
        axes.append((hz, Axis("coherence", range=(0, 1.05))))
        ups = [(0.78, 1.0), (0.53, 0.71), (0.17, 0.46), (0.0, 0.11)]
    panels = [Panel(x, y, up=up) for (x, y), up in zip(axes, ups, strict=True)]
    styles = zip(point.hits, _styles(point.hits), strict=True)
    marks = [mark for hit, style in styles for mark in _marks(point, hit, style, panels)]
    if point.mean is not None:
        kept = thinned(np.abs(point.mean), MOST_SAMPLES)
        place = point.frequency_hz[kept], _size(point.mean[kept])
        marks.append(Curve(*place, "average of the good hits", UPDATED, digits=5, panel=panels[2]))
        if point.coherence is not None:
            kept = thinned(-point.coherence, MOST_SAMPLES)
            place = point.frequency_hz[kept], point.coherence[kept]
            marks.append(Curve(*place, "", UPDATED, digits=4, panel=panels[3]))
    return Figure(shortened(point.title), marks, panels, height=760 if point.coherence is None else 900)


_Style = tuple[str, str, str, Dash]  # name in the legend, group, colour, dash


def _styles(hits: list[HitShown]) -> Iterator[_Style]:
    """Good hits are alike, and the first of them has their name; each bad one has its own."""
    name, colors = f"good hits ({sum(hit.good for hit in hits)})", cycle(_BAD)
    for hit in hits:
        if hit.good:
            yield name, "good", MEASURED, "solid"
            name = ""
        else:
            yield f"hit {hit.number}: {hit.why}", f"hit {hit.number}", next(colors), "dash"


def _marks(point: PointShown, hit: HitShown, style: _Style, panels: list[Panel]) -> list[Mark]:
    """Force, response and FRF of a hit."""
    name, group, color, dash = style
    said = f"hit {hit.number}" + (f", {hit.why}" if hit.why else "")
    forced, answered = thinned(hit.force, MOST_SAMPLES), thinned(hit.response, MOST_SAMPLES)
    seen = thinned(np.abs(np.nan_to_num(hit.frf)), MOST_SAMPLES)
    seconds = 1 / point.sample_rate_hz
    series = (
        (1e3 * seconds * forced, hit.force[forced], "%{x:.5g} ms: %{y:.4g} N"),
        (seconds * answered, hit.response[answered], "%{x:.5g} s: %{y:.4g}"),
        (point.frequency_hz[seen], _size(hit.frf[seen]), "%{x:.5g} Hz: %{y:.4g}"),
    )
    return [
        Curve(
            x, y, name if panel is panels[0] else "", color, dash, 1, panel=panel, digits=5,
            hover=f"{said}<br>{hover}", group=group, meta=hit.sentence,
        )
        for (x, y, hover), panel in zip(series, panels, strict=False)
    ]  # fmt: skip


def _size(values: ComplexArray) -> FloatArray:
    size = np.abs(values)
    return np.where(size > 0, size, np.nan)


def _about_the_pulse(point: PointShown) -> tuple[float, float]:
    """Where the force is drawn, ms: from before the pulses to behind the last second one; the rest can be zoomed to."""
    begin, end = point.pulse_s
    margin = 0.2 * (end - begin)
    return 1e3 * max(begin - margin, 0.0), 1e3 * (end + margin)
