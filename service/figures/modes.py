"""Modes: the stabilisation diagram, poles by order of the model over the mode indicator, coloured
by how probably each is a mode; shapes, measured beside updated; matrices of MAC, autoMAC and
sensitivities with their values.

Two points of a shape are joined where the ball between them holds no other (Gabriel and Sokal,
Systematic Zoology 18, 1969): of a rectangular grid its rows and columns, of irregular points a part
of their triangulation, never a zigzag.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import scipy

from fecore.arrays import BoolArray, ComplexArray, FloatArray
from service.figures.colors import INITIAL, MEASURED, QUIET, UPDATED
from service.figures.marks import (
    MANY_NAMES,
    Axis,
    Curve,
    Dash,
    Figure,
    Mark,
    Matrix,
    Panel,
    Points,
    Rule,
    Scale,
    named_axis,
)
from service.figures.screen import numbers

NEAR = 0.01
"""Relative distance within which a pole of an order stands for a fitted one: as far as poles of two
orders are one.
"""
KINDS = (
    ("stable in frequency and damping", "circle", 6.0),
    ("stable in frequency", "diamond", 5.0),
    ("new", "cross", 4.0),
)
PROBABILITY = Scale("P", 0, 1, length=0.8)
_DASHES: tuple[Dash, ...] = ("solid", "dash", "dot")


def stabilisation_figure(document: Mapping[str, Any]) -> Figure:
    """Poles by order, the fitted poles above them, and the modes that were chosen.

    A pole of an order has the colour of the fitted pole within 1 % of it; those without one, and
    all of a document before probabilities, are grey. `ids` are the fitted poles' frequencies, by
    which a page keeps or drops them.

    Args:
        document: an identification's document: `stabilisation`, `modes`, `doubtful` and
            `refused_poles`.
    """
    diagram, modes, doubtful = document["stabilisation"], document["modes"], document["doubtful"]
    poles = [
        row
        for row in (*modes, *doubtful, *document["refused_poles"])
        if row["probability"] is not None
    ]
    lines = diagram["indicator"]["frequency_hz"]
    x = Axis("frequency [Hz]", range=(min(lines), max(lines)))
    above = Panel(x, Axis("", "log", bare=True), over=True)
    marks: list[Mark] = [*_indicator(diagram["indicator"], above), *_by_order(diagram, poles)]
    if poles:
        marks.append(_fitted(poles, 1.08 * max(diagram["order"], default=1)))
    marks += [Rule(mode["frequency_hz"], MEASURED, "solid") for mode in modes]
    marks += [Rule(mode["frequency_hz"], INITIAL) for mode in doubtful]
    title = "Stabilisation diagram, with the identified modes as upright lines"
    return Figure(
        title, marks, [Panel(x, Axis("order of the model")), above], height=520, margins={"r": 90}
    )


def _indicator(indicator: Mapping[str, Any], panel: Panel) -> Iterator[Mark]:
    """The singular values of H, of earlier documents the root of the sum of squares alone."""
    curves = indicator.get("cmif") or [indicator["rms"]]
    name = "CMIF" if "cmif" in indicator else "rms of the FRFs"
    for number, curve in enumerate(curves):
        size = np.asarray(curve, dtype=float)
        look: Any = {
            "digits": 5,
            "panel": panel,
            "hover": None,
            "listed": number == 0,
            "dash": _DASHES[number],
        }
        yield Curve(
            indicator["frequency_hz"],
            np.where(size > 0, size, np.nan),
            name,
            QUIET,
            width=1,
            **look,
        )


def _by_order(diagram: Mapping[str, Any], poles: Sequence[Mapping[str, Any]]) -> Iterator[Mark]:
    hz, order = np.array(diagram["frequency_hz"], dtype=float), np.array(diagram["order"])
    ratio = 100 * np.array(diagram["damping_ratio"], dtype=float)
    near, known = _nearest(hz, np.array([row["frequency_hz"] for row in poles], dtype=float))
    probability = np.array([row["probability"] for row in poles] or [np.nan], dtype=float)[near]
    in_frequency = np.array(diagram["frequency_stable"], dtype=bool)
    in_both = in_frequency & np.array(diagram["damping_stable"], dtype=bool)
    kinds = in_both, in_frequency & ~in_both, ~in_frequency
    for coloured in (False, True):
        for (name, symbol, size), kind in zip(KINDS, kinds, strict=True):
            rows = np.flatnonzero(kind & (known == coloured))
            labels = [
                f"{ratio[k]:.3g} %" + (f", P {probability[k]:.2f}" if coloured else "")
                for k in rows
            ]
            look: Any = {"text": labels, "hover": "%{x:.5g} Hz, ζ %{text}, order %{y}"}
            if coloured:
                look |= {"color": probability[rows], "scale": replace(PROBABILITY, shown=False)}
                look["ids"] = [poles[near[k]]["frequency_hz"] for k in rows]
            else:
                look |= {"color": QUIET, "listed": False}
            yield Points(
                hz[rows],
                order[rows],
                name,
                symbol=symbol,
                size=size if coloured else size / 2,
                **look,
            )


def _nearest(hz: FloatArray, fitted: FloatArray) -> tuple[Any, BoolArray]:
    """(n,) number of the fitted pole that is nearest to each pole, and whether it is near enough to
    be the same.
    """
    if not fitted.size:
        return np.zeros(hz.size, dtype=int), np.zeros(hz.size, dtype=bool)
    off = np.abs(hz[:, None] / fitted - 1)
    return np.argmin(off, axis=1), np.asarray(off.min(axis=1, initial=np.inf) < NEAR)


def _fitted(poles: Sequence[Mapping[str, Any]], at: float) -> Mark:
    """The poles of the joint fit in a row on top, each with what speaks most for or against it."""
    hz = [row["frequency_hz"] for row in poles]
    labels = [
        f"ζ {100 * row['damping_ratio']:.3g} %, P {row['probability']:.2f}"
        + "".join(f"\n{each['words']}" for each in row["features"][:2])
        for row in poles
    ]
    look: Any = {
        "text": labels,
        "ids": hz,
        "hover": "fitted: %{x:.5g} Hz, %{text}",
        "scale": PROBABILITY,
    }
    return Points(
        hz,
        np.full(len(hz), at),
        "fitted pole",
        [row["probability"] for row in poles],
        "square",
        10,
        **look,
    )


# How far a row of points is set off to the right and up, and how high a body in space is, in shares
# of length and deflection.
_OBLIQUE, _DEPTH, _HEIGHT = 0.18, 0.9, 1.2
MOST_MODES, MOST_ROWS = 40, 8
"""Pairs that are drawn at all, the rest is a table's; and in a figure that is no higher than a
page.
"""


@dataclass(frozen=True)
class ShapePair:
    """A measured shape and that of its partner."""

    number: int  # of the measured mode
    measured_title: str  # such as `measured, 160.9 Hz`.
    updated_title: str
    measured: ComplexArray  # (p,) complex, at the first p points; empty where it has no shape
    updated: FloatArray  # (P,) real; empty where measured shapes alone are drawn


def shapes_figure(
    pairs: Sequence[ShapePair], points: Sequence[int], places: FloatArray, which: str = ""
) -> Figure:
    """One row of panels a mode: measured on the left, updated on the right if there is one, over
    the undeformed grid.

    `layout.meta` has the same as numbers for an animation: `points`, `x_m`, `y_m` (`z_m` of a body
    in space), and by mode `measured` and `updated` (None where a point has none), each with its
    greatest value ±1 and turned to the same sign.

    Args:
        pairs: in the order of the measured modes.
        points: (P,) labels; those of the measured shapes first.
        places: (P, 3) coordinates, m.
        which: of all pairs these are, for the title; empty where they are all.
    """
    marks: list[Mark] = []
    panels, modes = [], []
    grid = _Grid(places)
    top = 1.15 + grid.height
    both = " and updated" if any(pair.updated.size for pair in pairs) else ""
    x, y = (Axis(range=ends, hidden=True) for ends in ((-0.05, 1.1 + _OBLIQUE), (-1.15, top)))
    for row, pair in enumerate(pairs):
        measured, updated = aligned(pair.measured, pair.updated)
        padded = np.concatenate([measured, np.full(len(points) - measured.size, np.nan)])
        modes.append(
            {"number": pair.number, "measured": numbers(padded, 5), "updated": numbers(updated, 5)}
        )
        up = 1 - (row + 0.8) / len(pairs), 1 - (row + 0.12) / len(pairs)
        sides: list[tuple[FloatArray, str, str, Dash, tuple[float, float]]] = [
            (measured, pair.measured_title, MEASURED, "solid", (0.0, 0.48)),
            (updated, pair.updated_title, UPDATED, "dash", (0.52, 1.0)),
        ]
        for values, title, color, dash, across in sides if updated.size else sides[:1]:
            # Axes of its own, so that a page can zoom one shape.
            panel = Panel(replace(x), replace(y), across, up, title)
            panels.append(panel)
            marks += grid.lines(np.zeros(values.size), QUIET, "dot", 0.7, panel)
            marks += grid.lines(values, color, dash, 1.0, panel)
            marks += grid.dots(values, color, points, panel)
    return Figure(
        f"Mode shapes, measured{both}" + (which and f": {which}"),
        marks,
        panels,
        height=110 + max(130 * len(pairs), 260),
        margins={"l": 30},
        meta={"points": list(points), **_named(places), "modes": modes},
    )


def _named(places: FloatArray) -> dict[str, list[float | None]]:
    """Coordinates by name; z of bodies in space."""
    used = 3 if places.shape[1] > 2 and np.ptp(places[:, 2]) > 0 else 2
    return {
        name: numbers(places[:, axis]) for axis, name in enumerate(("x_m", "y_m", "z_m")[:used])
    }


def aligned(measured: ComplexArray, updated: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Both shapes real, with their greatest value ±1 and alike in sign."""
    updated = updated / max(float(np.abs(updated).max(initial=0.0)), 1e-300)
    if measured.size == 0:
        return np.zeros(0), updated
    real = turned(measured).real
    if updated.size and real @ updated[: real.size] < 0:
        real = -real
    return real / max(float(np.abs(real).max()), 1e-300), updated


def turned(shape: ComplexArray) -> ComplexArray:
    """A complex shape, turned so that as much of it as possible is real: by half the angle of
    Σφ².
    """
    return np.asarray(shape * np.exp(-0.5j * np.angle(np.sum(shape**2))))


class _Grid:
    """Points of a specimen joined with their neighbours, in an oblique view; each is moved up by
    its value.
    """

    def __init__(self, places: FloatArray) -> None:
        low, size = places.min(axis=0), np.ptp(places, axis=0)
        share = (places - low) / np.where(size > 0, size, 1.0)
        # older results have x and y alone
        z = _HEIGHT * share[:, 2] if share.shape[1] > 2 else np.zeros(len(share))
        self._across = share[:, 0] + _OBLIQUE * share[:, 1]
        self._up = _DEPTH * share[:, 1] + z
        self.height = _DEPTH + float(z.max(initial=0.0))
        self._places = places
        self._chains: dict[int, list[list[int]]] = {}

    def lines(
        self, values: FloatArray, color: str, dash: Dash, width: float, panel: Panel
    ) -> list[Mark]:
        """The points joined with their neighbours."""
        up = np.append(self._up[: values.size] + values, np.nan)
        across = np.append(self._across[: values.size], np.nan)
        if values.size not in self._chains:
            self._chains[values.size] = chains(self._places[: values.size])
        # a gap behind each line
        joined = [i for chain in self._chains[values.size] for i in (*chain, -1)]
        if not joined:
            return []
        return [
            Curve(
                across[joined],
                up[joined],
                "",
                color,
                dash,
                width,
                digits=4,
                panel=panel,
                hover=None,
            )
        ]

    def dots(
        self, values: FloatArray, color: str, labels: Sequence[int], panel: Panel
    ) -> list[Mark]:
        """Marks at the points."""
        if values.size == 0:
            return []
        place = self._across[: values.size], self._up[: values.size] + values
        look: Any = {
            "text": [f"{value:+.3f}" for value in values],
            "hover": "point %{customdata}: %{text}",
        }
        return [
            Points(
                *place,
                "",
                color,
                size=5,
                digits=4,
                panel=panel,
                ids=list(labels[: values.size]),
                **look,
            )
        ]


# candidates of a point: in a grid of up to so many points all, in a larger one all that are near
NEAREST = 128
_STRAIGHT = 0.7  # cosine of the angle up to which a line goes on
# share of a ball's radius within which a point lies on it, such as the other corners of a square
_TOUCHING = 1e-6


def joined(places: FloatArray) -> list[tuple[int, int]]:
    """Pairs of numbers of (p, 3) places that are neighbours, the lower number first, m."""
    distinct, first = np.unique(places, axis=0, return_index=True)
    count = len(distinct)
    if count < 2:
        return []
    tree = scipy.spatial.cKDTree(distinct)
    _, near = tree.query(distinct, k=min(NEAREST, count))
    a = np.repeat(np.arange(count), near.shape[1])
    b = near.ravel()
    a, b = a[a < b], b[a < b]
    # the nearest are the two themselves
    third = tree.query((distinct[a] + distinct[b]) / 2, k=[3])[0][:, 0]
    adjacent = third > (1 + _TOUCHING) * np.linalg.norm(distinct[a] - distinct[b], axis=1) / 2
    return sorted(
        (min(i, j), max(i, j))
        for i, j in zip(first[a[adjacent]].tolist(), first[b[adjacent]].tolist(), strict=True)
    )


def joined_as(
    lines: Iterable[Sequence[int]], labels: Sequence[int], places: FloatArray
) -> list[tuple[int, int]]:
    """Pairs of numbers of labelled places: along the file's trace lines, or neighbours where it has
    none between them.

    Args:
        lines: labels along each, 0 lifts the pen.
        labels: of the places.
        places: (p, 3) m.
    """
    number = {label: i for i, label in enumerate(labels)}
    steps = ((number.get(a, -1), number.get(b, -1)) for line in lines for a, b in pairwise(line))
    drawn = {(min(i, j), max(i, j)) for i, j in steps if i != j and min(i, j) >= 0}
    return sorted(drawn) or joined(places)


def chains(places: FloatArray) -> list[list[int]]:
    """Neighbours joined to lines that go on as straight as they can: numbers of the places along
    each, m.
    """
    left: dict[int, set[int]] = {}
    pairs = joined(places)
    for i, j in pairs:
        left.setdefault(i, set()).add(j)
        left.setdefault(j, set()).add(i)
    lines = []
    for i, j in pairs:
        if j in left[i]:
            _take(left, i, j)
            ahead = _onward(places, left, i, j)
            lines.append([*reversed(_onward(places, left, j, i)), i, j, *ahead])
    return lines


def _onward(places: FloatArray, left: dict[int, set[int]], before: int, last: int) -> list[int]:
    """Where a line goes on, which takes its pairs away."""
    line: list[int] = []
    while left[last]:
        heading = places[last] - places[before]

        def straight(k: int, last: int = last, heading: FloatArray = heading) -> float:
            step = places[k] - places[last]
            return float(step @ heading / np.linalg.norm(step) / np.linalg.norm(heading))

        following = max(sorted(left[last]), key=straight)
        if straight(following) < _STRAIGHT:
            break
        _take(left, last, following)
        line.append(following)
        before, last = last, following
    return line


def _take(left: dict[int, set[int]], i: int, j: int) -> None:
    left[i].discard(j)
    left[j].discard(i)


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
        ["" if np.isnan(value) or count > _MOST_VALUES else f"{value:.{digits}f}" for value in row]
        for row in values
    ]
    ids = [[[i + 1, j + 1] for j in range(count)] for i in range(len(rows))]
    hover = "%{customdata[0]} and %{customdata[1]}: %{z:.4f}"
    matrix_mark = Matrix(values, cells, Scale("MAC", 0, 1), ids=ids, hover=hover)
    return _figure(
        title, matrix_mark, named_axis(across, columns), named_axis(down, rows, down=True)
    )


def sensitivities_figure(
    effects: Mapping[str, FloatArray], known: Mapping[str, bool], modes: Sequence[str]
) -> Figure:
    """How much each frequency changes by one prior standard deviation of each parameter, parameter
    by mode.

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
    height, margins = (
        min(200 + 34 * max(rows, 4), 900),
        {"r": 90, "l": 120, "b": 130 if columns > MANY_NAMES else 85},
    )
    return Figure(title, [matrix], [Panel(across, down)], height=height, margins=margins)
