"""FRFs: the overlay of one (log magnitude, phase, coherence; measured, of the initial model, of the
updated one); the hits of a point that it is made of; the agreement of measured and predicted ones,
line by line, between lines, and by point.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import cycle, pairwise
from typing import Any

import numpy as np

from fecore.arrays import ComplexArray, FloatArray, IntArray
from fecore.correlation import Criterion
from fecore.frf import Dof
from fecore.normal import Z_95
from service.figures.colors import (
    ALARM,
    HELD_OUT,
    INITIAL,
    MEASURED,
    OUTSIDE,
    PALETTE,
    QUIET,
    UPDATED,
)
from service.figures.marks import (
    Axis,
    Band,
    Curve,
    Dash,
    Figure,
    Kind,
    Mark,
    Matrix,
    Panel,
    Points,
    Region,
    Rule,
    Scale,
    decades,
    named_axis,
    shortened,
)

# lines that a figure draws: of more, the least and the greatest measured magnitude of each stretch
MOST_LINES = 3200
_ABOUT = 4.0  # how far the axis of the magnitude goes beyond what was measured
UNITS = {"accelerance": "(m/s²)/N", "mobility": "(m/s)/N", "receptance": "m/N"}
MODELS: dict[str, tuple[str, Dash]] = {"initial": (INITIAL, "dot"), "updated": (UPDATED, "dash")}


def dof_name(dof: Dof) -> str:
    """Point, sign and axis, such as `7+Z`."""
    return f"{dof.point}{'+' if dof.sign > 0 else '−'}{('X', 'Y', 'Z', 'RX', 'RY', 'RZ')[dof.axis - 1]}"


@dataclass(frozen=True)
class Spread:
    """How sure a predicted FRF is: (L,) standard deviations of ln|H| and of its phase in
    radians.
    """

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
    turns = Axis(
        "phase [°]",
        range=(-190, 190),
        ticks={-180: "−180", -90: "−90", 0: "0", 90: "90", 180: "180"},
    )
    ups = ((0.38, 1.0), (0.0, 0.34)) if curves.coherence is None else ((0.5, 1.0), (0.22, 0.46))
    panels = [Panel(x, y, up=up) for y, up in zip((size, turns), ups, strict=True)]
    marks = [*_interval(curves, kept, panels[1]), *_responses(curves, kept, panels[1])]
    if curves.coherence is not None:
        panels.append(Panel(x, Axis("coherence", range=(0, 1.03)), up=(0.0, 0.18)))
        marks.append(Curve(hz, curves.coherence[kept], digits=4, panel=panels[-1], hover=_HOVER))
    regions = _regions(curves, panels)
    return Figure(
        shortened(curves.title), [*marks, *regions], panels, height=560 if len(panels) == 2 else 640
    )


_HOVER = "%{x:.5g} Hz: %{y:.4g}"


def thinned(magnitude: FloatArray, most: int = MOST_LINES) -> IntArray:
    """Which lines are drawn: all, or of each stretch those of the least and the greatest magnitude,
    so that no peak is lost.

    Args:
        magnitude: (L,) of the measured FRF.
        most: lines, about.
    """
    count = magnitude.size
    if count <= most:
        return np.arange(count)
    edges = np.linspace(0, count, most // 2 + 1).astype(int)
    bins = pairwise(edges)
    ends = [
        (a + int(np.argmin(magnitude[a:b])), a + int(np.argmax(magnitude[a:b]))) for a, b in bins
    ]
    return np.unique(np.concatenate([np.array(ends).ravel(), [0, count - 1]]))


Window = tuple[float | None, float | None]
"""First and last value of an axis that is in view; None for its end."""


def seen_in(window: Window, place: FloatArray, values: FloatArray, most: int) -> IntArray:
    """Which samples are drawn where a part of them is in view: of that part all, or as many as it
    has pixels; of the rest those that show its shape.

    Args:
        window: that is in view.
        place: (n,) of the samples along the axis, rising.
        values: (n,) by which they are thinned out.
        most: samples, about, of the part and of all.
    """
    low, high = window
    first = 0 if low is None else max(int(np.searchsorted(place, low)) - 1, 0)
    last = (
        place.size
        if high is None
        else min(int(np.searchsorted(place, high, "right")) + 1, place.size)
    )
    inside = first + thinned(values[first:last], most) if last > first else np.empty(0, dtype=int)
    return np.union1d(thinned(values, most), inside)


def _responses(curves: FrfCurves, kept: IntArray, phases: Panel) -> list[Mark]:
    """Magnitude and phase of what was measured and of each model."""
    marks: list[Mark] = []
    for name, values in {"measured": curves.measured, **(curves.models or {})}.items():
        look = name, *MODELS.get(name, (MEASURED, "solid"))
        shared: Any = {"group": name, "hover": f"{name}, {_HOVER}"}
        magnitude = np.where(values[kept] == 0, np.nan, np.abs(values[kept]))
        x, phase = _broken(curves.frequency_hz[kept], np.degrees(np.angle(values[kept])))
        marks.append(Curve(curves.frequency_hz[kept], magnitude, *look, digits=5, **shared))
        marks.append(Curve(x, phase, *look, digits=4, panel=phases, listed=False, **shared))
    return marks


def _decades(curves: FrfCurves) -> tuple[Kind, tuple[float, float] | None]:
    """Kind and ends of the axis of the magnitude, about what was measured: a model may fall far
    below its noise.
    """
    seen = np.abs(curves.measured)
    seen = seen[seen > 0]
    ends = (float(seen.min()) / _ABOUT, float(seen.max()) * _ABOUT) if seen.size else None
    return decades(ends or ()), ends


def _broken(hz: FloatArray, phase: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A wrapped phase in degrees with a gap where it wraps, so that no line crosses the panel."""
    jumps = np.flatnonzero(np.abs(np.diff(phase)) > 180) + 1
    return np.insert(hz, jumps, hz[jumps]), np.insert(phase, jumps, np.nan)


def _interval(curves: FrfCurves, kept: IntArray, phases: Panel) -> list[Mark]:
    """The updated model's 95 % interval: a factor of the magnitude, and a part of a turn of the
    phase.
    """
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
    bands: list[tuple[float, float, str]] = []
    if curves.band_hz is not None:
        low, high = curves.band_hz
        bands = [(first, low, OUTSIDE), (high, last, OUTSIDE)]
    if curves.held_band_hz is not None:
        bands.append((*curves.held_band_hz, HELD_OUT))
    inside = [(max(low, first), min(high, last), color) for low, high, color in bands]
    return [
        Region((low, high), color, panel=panel)
        for low, high, color in inside
        if low < high
        for panel in panels
    ]


MOST_SAMPLES = 1600
"""Samples or lines of a hit that a figure draws: of more, the least and the greatest of each
stretch.
"""
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


def hits_figure(
    point: PointShown, seconds: Window = (None, None), hertz: Window = (None, None)
) -> Figure:
    """The hits of a point, one below the other: force about the pulse, response, FRF, coherence.

    Good hits are drawn solid and alike; each bad one dashed in a colour of its own, with what was
    found in the legend.

    Args:
        point: its hits.
        seconds: of the records in view, drawn sample by sample; default: of the force the pulse, of
            the response all.
        hertz: of the FRFs in view, drawn line by line.
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
    marks = [
        mark
        for hit, style in styles
        for mark in _marks(point, hit, style, panels, (seconds, hertz))
    ]
    if point.mean is not None:
        kept = seen_in(hertz, point.frequency_hz, np.abs(point.mean), MOST_SAMPLES)
        place = point.frequency_hz[kept], _size(point.mean[kept])
        marks.append(Curve(*place, "average of the good hits", UPDATED, digits=5, panel=panels[2]))
        if point.coherence is not None:
            kept = seen_in(hertz, point.frequency_hz, -point.coherence, MOST_SAMPLES)
            place = point.frequency_hz[kept], point.coherence[kept]
            marks.append(Curve(*place, "", UPDATED, digits=4, panel=panels[3]))
    height = 760 if point.coherence is None else 900
    return Figure(shortened(point.title), marks, panels, height=height, meta={"windows": _WINDOWS})


_WINDOWS = {"x": ("tmin", "tmax", 1e-3), "x2": ("tmin", "tmax", 1.0), "x3": ("fmin", "fmax", 1.0)}
"""By axis: parameters of the address by which a page that zooms has what is in view, and their unit
on the axis.
"""


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


def _marks(
    point: PointShown,
    hit: HitShown,
    style: _Style,
    panels: list[Panel],
    windows: tuple[Window, Window],
) -> list[Mark]:
    """Force, response and FRF of a hit, in full where they are in view."""
    name, group, color, dash = style
    title = f"hit {hit.number}" + (f", {hit.why}" if hit.why else "")
    seconds = 1 / point.sample_rate_hz
    times, (window, hertz) = seconds * np.arange(hit.force.size), windows
    low, high = _about_the_pulse(point)
    pulse = window if any(end is not None for end in window) else (1e-3 * low, 1e-3 * high)
    forced = seen_in(pulse, times, hit.force, MOST_SAMPLES)
    answered = seen_in(window, times, hit.response, MOST_SAMPLES)
    seen = seen_in(hertz, point.frequency_hz, np.abs(np.nan_to_num(hit.frf)), MOST_SAMPLES)
    series = (
        (1e3 * seconds * forced, hit.force[forced], "%{x:.5g} ms: %{y:.4g} N"),
        (seconds * answered, hit.response[answered], "%{x:.5g} s: %{y:.4g}"),
        (point.frequency_hz[seen], _size(hit.frf[seen]), "%{x:.5g} Hz: %{y:.4g}"),
    )
    return [
        Curve(
            x, y, name if panel is panels[0] else "", color, dash, 1, panel=panel, digits=5,
            hover=f"{title}<br>{hover}", group=group, meta=hit.sentence,
        )
        for (x, y, hover), panel in zip(series, panels, strict=False)
    ]  # fmt: skip


def _size(values: ComplexArray) -> FloatArray:
    size = np.abs(values)
    return np.where(size > 0, size, np.nan)


def _about_the_pulse(point: PointShown) -> tuple[float, float]:
    """Where the force is drawn, ms: from before the pulses to behind the last second one; the rest
    can be zoomed to.
    """
    begin, end = point.pulse_s
    margin = 0.2 * (end - begin)
    return 1e3 * max(begin - margin, 0.0), 1e3 * (end + margin)


def agreement_figure(
    criterion: Criterion,
    hz: FloatArray,
    initial: FloatArray,
    updated: FloatArray,
    modes: Sequence[float],
) -> Figure:
    """A criterion of lines over frequency, before and after.

    Args:
        criterion: whose values they are.
        hz: (L,) lines of the fitted band.
        initial: (L,) from 0 to 1.
        updated: (L,) the same after.
        modes: (n,) measured natural frequencies, Hz, which are marked.
    """
    marks: list[Mark] = [
        Curve(hz, initial, f"initial, mean {np.nanmean(initial):.3f}", INITIAL, "dot", digits=4),
        Curve(hz, updated, f"updated, mean {np.nanmean(updated):.3f}", UPDATED, digits=4),
        *(Rule(mode) for mode in modes if hz[0] <= mode <= hz[-1]),
    ]
    return Figure(
        f"{criterion.label}: {criterion.says}, line by line",
        marks,
        [Panel(Axis("frequency [Hz]"), Axis(criterion.label, range=(0, 1.03)))],
    )


def line_pairs_figure(
    criterion: Criterion, hz: FloatArray, initial: FloatArray, updated: FloatArray
) -> Figure:
    """A criterion of pairs of lines, in Cividis, before and after: where the model's frequencies
    are off, large values lie beside the diagonal.

    Args:
        criterion: whose values they are.
        hz: (l,) the lines.
        initial: (l, l) from 0 to 1, measured lines down, predicted ones across.
        updated: (l, l) the same after.
    """
    names = [f"{each:.4g}" for each in hz]
    ids = [[[down, across] for across in names] for down in names]
    cells = [[""] * hz.size] * hz.size
    hover = "measured %{customdata[0]} Hz, predicted %{customdata[1]} Hz: %{z:.4f}"
    down = named_axis("measured line [Hz]", names)
    marks: list[Mark] = []
    for name, values, across in (
        ("initial", initial, (0.0, 0.45)),
        ("updated", updated, (0.55, 1.0)),
    ):
        x = named_axis(f"line of the {name} model [Hz]", names)
        panel = Panel(x, down, across=across, title=name)
        scale = Scale(criterion.label, 0, 1, shown=name == "updated")
        marks.append(Matrix(values, cells, scale, ids=ids, hover=hover, panel=panel))
    title = f"{criterion.label}: {criterion.says} between any two lines"
    panels = [mark.panel for mark in marks if mark.panel is not None]
    return Figure(title, marks, panels, height=460, margins={"r": 90, "b": 85, "t": 70})


def dofs_figure(criterion: Criterion, dofs: Sequence[str], values: FloatArray) -> Figure:
    """A criterion of degrees of freedom, dof by dof.

    Args:
        criterion: whose values they are.
        dofs: names of the p dofs.
        values: (p,) from 0 to 1; NaN where there is none.
    """
    marks = [Points(range(len(dofs)), values, ids=dofs, hover="%{customdata}: %{y:.4f}")]
    panel = Panel(named_axis("degree of freedom", dofs), Axis(criterion.label, range=(0, 1.03)))
    return Figure(
        f"{criterion.label}: {criterion.says} by degree of freedom", marks, [panel],
        margins={"b": 85},
    )  # fmt: skip


_GAP = 0.16  # between panels, as a share of the height


@dataclass(frozen=True)
class PointValues:
    """A criterion by FRF, at the point that distinguishes the FRF from others."""

    labels: Sequence[int]  # of the points
    x: FloatArray  # their places on the specimen, m
    y: FloatArray
    # by criterion, from 0 to 1; NaN where there is none
    values: Mapping[Criterion, FloatArray]
    held_out: Sequence[bool]  # whether the FRF was held out of the fit


def points_figure(
    values: PointValues, along: tuple[float, float], across: tuple[float, float]
) -> Figure:
    """Criteria of FRFs at the points of the specimen, seen from above, each point in the colour of
    its value.

    Args:
        values: by point.
        along: x of the specimen's ends, m.
        across: y of its edges, m.
    """
    lowest = float(np.nanmin(np.append(list(values.values.values()), 1.0)))
    floor = float(np.floor(10 * max(lowest, 0.0)) / 10)
    held = np.array(values.held_out, dtype=bool)
    margin, spread = 0.03 * (along[1] - along[0]), across[1] - across[0]
    x = Axis("x [m]", range=(along[0] - margin, along[1] + margin))
    y = Axis("y [m]", range=(across[0] - spread / 4, across[1] + spread / 4))
    marks: list[Mark] = []
    panels = []
    count = len(values.values)
    height = (1 - _GAP * (count - 1)) / count
    for place, (criterion, each) in enumerate(values.values.items()):
        title, top = criterion.label, round(1 - place * (height + _GAP), 3)
        up = round(top - height, 3), top
        middle = round(sum(up) / 2, 1)
        panel = Panel(x, replace(y), up=up, title=title)
        panels.append(panel)
        marks.append(Region(along, QUIET, across, outline=True, panel=panel))
        for rows, symbol, words in (
            (~held, "circle", "fitted"),
            (held, "diamond", "held out of the fit"),
        ):
            if rows.any():
                scale = Scale(title, floor, 1.0, symbol == "circle", middle, 0.9 / count)
                look: Any = {
                    "ids": np.array(values.labels)[rows].tolist(),
                    "hover": f"point %{{customdata}}: {title} %{{marker.color:.4f}}",
                }
                at = values.x[rows], values.y[rows], "" if place else words
                marks.append(Points(*at, each[rows], symbol, 14, scale=scale, panel=panel, **look))
    return Figure(
        f"{' and '.join(each.label for each in values.values)} by point on the specimen",
        marks,
        panels,
        height=230 * count,
        margins={"r": 95, "t": 70},
    )
