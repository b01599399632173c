"""The hits of a point: force and response in time, each hit's FRF, the coherence of the good ones; bad hits stand out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fecore.arrays import ComplexArray, FloatArray
from service.show.figures.frf import UNITS, thinned
from service.show.figures.look import (
    ALARM,
    INITIAL,
    MEASURED,
    UPDATED,
    Figure,
    Trace,
    axis,
    decades,
    layout,
    line,
    numbers,
    shown_name,
)
from service.show.figures.palette import PALETTE

MOST_SAMPLES = 1600
"""Samples or lines of a hit that a figure draws: of more, the least and the greatest of each stretch."""
AFTER = {"acceleration": "m/s²", "velocity": "m/s", "displacement": "m"}
_BAD = (INITIAL, ALARM, PALETTE[3], PALETTE[6], PALETTE[8], PALETTE[9])


@dataclass(frozen=True)
class HitShown:
    """One hit.

    Attributes:
        number: of the point, from 1.
        good: whether it is used.
        why: what was found against it, in a few words; empty of a good one.
        sentence: the same at length.
        force, response: (n,) samples, SI.
        frf: (L,) of this hit alone.
    """

    number: int
    good: bool
    why: str
    sentence: str
    force: FloatArray
    response: FloatArray
    frf: ComplexArray


@dataclass(frozen=True)
class PointShown:
    """The hits of a point at one sensor.

    Attributes:
        title: where was hit and measured.
        quantity: acceleration, velocity or displacement.
        frf_quantity: accelerance, mobility or receptance.
        sample_rate_hz: of the blocks.
        frequency_hz: (L,).
        pulse_s: begin of the first pulse and end of the last, s.
        hits: in their order.
        mean: (L,) FRF of the good ones; None without any.
        coherence: (L,) of two good ones or more, or None.
    """

    title: str
    quantity: str
    frf_quantity: str
    sample_rate_hz: float
    frequency_hz: FloatArray
    pulse_s: tuple[float, float]
    hits: list[HitShown]
    mean: ComplexArray | None
    coherence: FloatArray | None


def hits_figure(point: PointShown) -> Figure:
    """The hits of a point, one below the other: force about the pulse, response, FRF, coherence.

    Good hits are drawn solid and alike; each bad one dashed in a colour of its own, with what was found in the legend.
    """
    domains = [(0.78, 1.0), (0.53, 0.71), (0.17, 0.46), (0.0, 0.11)]
    if point.coherence is None:
        domains = [(0.76, 1.0), (0.46, 0.68), (0.0, 0.38)]
    styles = _styles(point.hits)
    data = [trace for hit, style in zip(point.hits, styles, strict=True) for trace in _traces(point, hit, style)]
    if point.mean is not None:
        kept = thinned(np.abs(point.mean), MOST_SAMPLES)
        hz = numbers(point.frequency_hz[kept])
        data.append(line(hz, _size(point.mean[kept]), "average of the good hits", UPDATED, xaxis="x3", yaxis="y3"))
        if point.coherence is not None:
            kept = thinned(-point.coherence, MOST_SAMPLES)
            hz = numbers(point.frequency_hz[kept])
            data.append(line(hz, numbers(point.coherence[kept], 4), "", UPDATED, xaxis="x3", yaxis="y4"))
    last = "y3" if point.coherence is None else "y4"
    shown = layout(
        shown_name(point.title),
        xaxis=axis("time [ms]", anchor="y", range=_about_the_pulse(point)),
        yaxis=axis("force [N]", domain=list(domains[0])),
        xaxis2=axis("time [s]", anchor="y2"),
        yaxis2=axis(f"{point.quantity} [{AFTER[point.quantity]}]", domain=list(domains[1]), anchor="x2"),
        xaxis3=axis("frequency [Hz]", anchor=last),
        yaxis3=axis(
            f"|{point.frf_quantity}| [{UNITS[point.frf_quantity]}]", domain=list(domains[2]), anchor="x3",
            **decades([] if point.mean is None else np.abs(point.mean)),
        ),
        height=900 if point.coherence is not None else 760,
    )  # fmt: skip
    if point.coherence is not None:
        shown["yaxis4"] = axis("coherence", domain=list(domains[3]), anchor="x3", range=[0, 1.05])
    return {"data": data, "layout": shown}


@dataclass(frozen=True)
class _Style:
    name: str  # in the legend; empty of a good hit that is not the first
    group: str
    color: str
    dash: str


def _styles(hits: list[HitShown]) -> list[_Style]:
    good = sum(hit.good for hit in hits)
    styles, bad, named = [], 0, False
    for hit in hits:
        if hit.good:
            styles.append(_Style("" if named else f"good hits ({good})", "good", MEASURED, "solid"))
            named = True
        else:
            color = _BAD[bad % len(_BAD)]
            styles.append(_Style(f"hit {hit.number}: {hit.why}", f"hit {hit.number}", color, "dash"))
            bad += 1
    return styles


def _traces(point: PointShown, hit: HitShown, style: _Style) -> list[Trace]:
    """Force, response and FRF of a hit."""
    said = f"hit {hit.number}" + (f", {hit.why}" if hit.why else "")
    common: dict[str, Any] = {"legendgroup": style.group, "meta": hit.sentence}
    forced, answered = thinned(hit.force, MOST_SAMPLES), thinned(hit.response, MOST_SAMPLES)
    seen = thinned(np.abs(np.nan_to_num(hit.frf)), MOST_SAMPLES)
    seconds = 1 / point.sample_rate_hz
    panels = (
        (numbers(1e3 * seconds * forced), numbers(hit.force[forced], 5), "", "%{x:.5g} ms: %{y:.4g} N"),
        (numbers(seconds * answered), numbers(hit.response[answered], 5), "2", "%{x:.5g} s: %{y:.4g}"),
        (numbers(point.frequency_hz[seen]), _size(hit.frf[seen]), "3", "%{x:.5g} Hz: %{y:.4g}"),
    )
    drawn = [
        line(
            x, y, style.name if not panel else "", style.color, style.dash, xaxis=f"x{panel}", yaxis=f"y{panel}",
            hovertemplate=f"{said}<br>{hover}<extra></extra>", **common,
        )
        for x, y, panel, hover in panels
    ]  # fmt: skip
    return [trace | {"line": trace["line"] | {"width": 1}} for trace in drawn]


def _size(values: ComplexArray) -> list[float | None]:
    size = np.abs(values)
    return numbers(np.where(size > 0, size, np.nan), 5)


def _about_the_pulse(point: PointShown) -> list[float]:
    """Where the force is drawn, ms: from before the pulses to behind the last second one; the rest can be zoomed to."""
    begin, end = point.pulse_s
    margin = 0.2 * (end - begin)
    return [1e3 * max(begin - margin, 0.0), 1e3 * (end + margin)]
