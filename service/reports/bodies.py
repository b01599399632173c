"""The body on paper: its mesh as each of the first modes moves it, with the measured points, in true
proportions.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from fecore.arrays import FloatArray
from modalbase.formats.cell_types import CELL_TYPES
from service.figures.colors import BAND, MEASURED, QUIET, UPDATED
from service.figures.marks import Axis, Curve, Figure, Mark, Panel, Points
from service.reports.figure_data import UpdateFigures
from service.reports.space import ResultMeshOut, measured_shape, mesh_of_result, model_shape

MOST, ACROSS = 6, 3  # bodies, and how many stand side by side
MOST_SIDES = 3000  # of elements within the body, beyond which its edges alone are drawn
WIDE, LOWEST, HIGHEST = 205.0, 60.0, 150.0  # pixels of one
REACH = 0.12  # of the largest displacement, as a share of the body's diagonal
SLANT, DEPTH = 0.45, 0.32  # where a unit away from the viewer goes: to the right, and up

Side = tuple[int, ...]  # nodes along a side of an element


def bodies_figure(data: UpdateFigures) -> Figure | None:
    """The measured modes that have a partner, the first ones; None where none has a shape."""
    pairs = data.arrays["shape_pairs"].tolist()[:MOST] if "mesh_shapes" in data.arrays else []
    if not pairs or not data.arrays["shapes_measured"].shape[1]:
        return None
    mesh = mesh_of_result(data)
    edges, within = _sides(mesh)
    rest = np.array([mesh.nodes.x_m, mesh.nodes.y_m, mesh.nodes.z_m]).T
    places = np.array([(point.x_m, point.y_m, point.z_m) for point in mesh.points])
    known = np.array([not point.held_out for point in mesh.points])
    axes = np.argsort(-np.ptp(rest, axis=0), kind="stable")
    view = _View([int(axes[0]), *sorted(int(axis) for axis in axes[1:])])
    reach = REACH * float(np.linalg.norm(np.ptp(rest, axis=0)))
    drawn: list[tuple[str, list[tuple[FloatArray, Iterable[Side], Any]], FloatArray]] = []
    for i, j in pairs:
        moved = rest + reach * _real(model_shape(data, j + 1).nodes.real)
        points = places + reach * _real(measured_shape(data, i + 1).points.real)
        mode = data.document["modes"][i]
        mac = "" if mode["mac"] is None else f", MAC {mode['mac']:.3f}"
        title = f"{mode['number']}: {mode['measured_hz']:.4g} → {mode['updated_hz']:.4g} Hz{mac}"
        lines: list[tuple[FloatArray, Iterable[Side], Any]] = [
            (view(rest), edges, {"color": QUIET, "dash": "dot", "width": 0.6}),
            (view(moved), within, {"color": BAND, "width": 0.7}),
            (view(moved), edges, {"color": UPDATED, "width": 1.1}),
        ]
        drawn.append((title, lines, view(points[known])))
    every = np.concatenate(
        [each for _, lines, points in drawn for each in (lines[0][0], lines[1][0], points)]
    )
    low, high = every.min(axis=0), every.max(axis=0)
    return _laid_out(drawn, (low + high) / 2, high - low)


def _laid_out(drawn: Sequence[Any], middle: FloatArray, size: FloatArray) -> Figure:
    """Bodies side by side, all to one scale."""
    pixels = float(np.clip(WIDE * size[1] / size[0], LOWEST, HIGHEST))
    unit = 1.04 * max(size[0] / WIDE, size[1] / pixels)  # m a pixel
    ends = [
        (m - unit * p / 2, m + unit * p / 2) for m, p in zip(middle, (WIDE, pixels), strict=True)
    ]
    rows, marks, panels = -(-len(drawn) // ACROSS), list[Mark](), list[Panel]()
    for place, (title, lines, points) in enumerate(drawn):
        row, column = divmod(place, ACROSS)
        across = (column + 0.02) / ACROSS, (column + 0.98) / ACROSS
        share = pixels / (pixels + 30)
        up = 1 - (row + 1) / rows, 1 - (row + 1 - share) / rows  # below its title
        x, y = (Axis(range=each, hidden=True) for each in ends)
        panels.append(panel := Panel(x, y, across, up, title))
        for places, sides, look in lines:
            chain = [node for side in sides for node in (*side, -1)]
            with_gap = np.vstack([places, [np.nan, np.nan]])[chain]
            marks.append(Curve(with_gap[:, 0], with_gap[:, 1], "", panel=panel, hover=None, **look))
        marks.append(Points(points[:, 0], points[:, 1], "", MEASURED, size=3, panel=panel))
    height = int(rows * (pixels + 30)) + 35
    title = "Measured points (black) on the updated model (blue), mode by mode: measured → updated"
    return Figure(title, marks, panels, height=height, margins={"l": 10, "r": 10, "t": 30, "b": 5})


class _View:
    """Places on paper: the longest side of the body to the right, the others up and away."""

    def __init__(self, axes: Sequence[int]) -> None:
        self._right, self._deep, self._up = axes

    def __call__(self, places: FloatArray) -> FloatArray:
        right, deep, up = (places[:, axis] for axis in (self._right, self._deep, self._up))
        return np.stack([right + SLANT * deep, up + DEPTH * deep], axis=1)


def _sides(mesh: ResultMeshOut) -> tuple[list[Side], list[Side]]:
    """Sides of the elements where the body ends or two sets meet, and the others."""
    sets: dict[frozenset[int], set[str]] = {}
    counts: Counter[frozenset[int]] = Counter()
    sides: dict[frozenset[int], Side] = {}
    for block in mesh.blocks:
        kind = CELL_TYPES[block.kind]
        for side in _around(kind.dimension, kind.around, block.corners, block.nodes):
            key = frozenset((side[0], side[-1]))
            sides[key] = side
            counts[key] += 1
            sets.setdefault(key, set()).add(block.set)
    edges = [sides[key] for key, count in counts.items() if count != 2 or len(sets[key]) > 1]
    within = [sides[key] for key, count in counts.items() if count == 2 and len(sets[key]) == 1]
    return edges, within if len(within) <= MOST_SIDES else []


def _around(
    dimension: int, around: Sequence[int], corners: int, elements: Iterable[Sequence[int]]
) -> Iterator[Side]:
    """Sides of elements, each from corner to corner by way of its middle."""
    if dimension == 0:
        return
    step = max(1, len(around) // corners)
    for nodes in elements:
        ring = [nodes[place] for place in around]
        if dimension == 1:
            yield tuple(ring)
            continue
        ring.append(ring[0])
        for first, last in pairwise(range(0, len(ring), step)):
            yield tuple(ring[first : last + 1])


def _real(moved: Sequence[float]) -> FloatArray:
    return np.array(moved).reshape(-1, 3)
