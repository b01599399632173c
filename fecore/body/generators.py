"""Meshes of bodies extruded along x: strips, profiles, panels with ribs; of 8-node elements on
middle surfaces.

x runs from 0 to the length, y and z from the middle of the outer dimensions; z is up, and a flange
or a plate lies on top. The node sets `start` and `end` are the ends.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.body.mesh import CellBlock, Mesh
from fecore.errors import InputError

ELEMENTS = 6
"""Elements over the larger side of a section; with 4, 20 modes are within .2 % of a fine mesh."""

_SHAPES = ("i", "box", "channel", "angle", "tee")


@dataclass(frozen=True)
class Segment:
    """A wall's middle line in the section, from (y, z) to (y, z), m."""

    set: str
    start: tuple[float, float]
    end: tuple[float, float]


def profile(
    shape: str,
    length: float,
    height: float,
    width: float,
    flange: float,
    web: float,
    elements: int = ELEMENTS,
) -> Mesh:
    """A profile of the sets `flange` and `web`.

    Args:
        shape: `i`, `box`, `channel` (web on the left), `angle` (flange below, web on the left) or
            `tee`.
        length: m.
        height: outer dimension along z, m.
        width: the same along y.
        flange: thickness of the flanges, m.
        web: thickness of the webs, m.
        elements: over the larger side.

    Raises:
        InputError: the shape is unknown, or a dimension leaves no wall.
    """
    if shape not in _SHAPES:
        raise InputError(
            "shape.kind", f"is {shape!r}, expected one of {', '.join(_SHAPES)} or panel"
        )
    _check("shape", length=length, height=height, width=width, flange=flange, web=web)
    if height <= 2 * flange or width <= 2 * web:
        raise InputError(
            "shape",
            f"of {height:g} × {width:g} m has no room for walls of {flange:g} and {web:g} m",
        )
    y, z, side, top = (width - web) / 2, (height - flange) / 2, width / 2, height / 2
    corner = {
        "i": [(0.0, z), (0.0, -z)],
        "tee": [(0.0, z), (0.0, -top)],
        "channel": [(-y, z), (-y, -z)],
    }
    segments = {
        "i": [(-side, z, 0, z), (0, z, side, z), (-side, -z, 0, -z), (0, -z, side, -z)],
        "box": [(-y, z, y, z), (-y, -z, y, -z)],
        "channel": [(-y, z, side, z), (-y, -z, side, -z)],
        "angle": [(-y, -z, side, -z)],
        "tee": [(-side, z, 0, z), (0, z, side, z)],
    }[shape]
    webs = {"box": [(-y, -z, -y, z), (y, -z, y, z)], "angle": [(-y, -z, -y, top)]}.get(shape)
    if webs is None:
        (y0, z0), (y1, z1) = corner[shape]
        webs = [(y1, z1, y0, z0)]
    walls = [("flange", s) for s in segments] + [("web", s) for s in webs]
    return extrude(
        [Segment(n, (a, b), (c, d)) for n, (a, b, c, d) in walls],
        length,
        max(height, width) / elements,
    )


def panel(
    length: float,
    width: float,
    height: float,
    plate: float,
    rib: float,
    ribs: Sequence[float],
    elements: int = 3 * ELEMENTS,
) -> Mesh:
    """A plate, the set `plate`, with ribs along x below it, the set `rib`.

    Args:
        length: m.
        width: m.
        height: of plate and ribs together, m.
        plate: thickness of the plate, m.
        rib: thickness of the ribs, m.
        ribs: y of each, m, rising.
        elements: over the width.

    Raises:
        InputError: a rib lies off the plate or where another one is, or a dimension leaves no rib.
    """
    _check("shape", length=length, width=width, height=height, plate=plate, rib=rib)
    if height <= plate:
        raise InputError(
            "shape.height_m", f"is {height:g}, expected more than the plate's {plate:g} m"
        )
    lines = np.array([-width / 2, *ribs, width / 2])
    if np.any(np.diff(ribs) <= 0) or lines[0] > lines[1] or lines[-2] > lines[-1]:
        raise InputError(
            "shape.ribs", f"lie at {list(ribs)} m, expected rising places on a width of {width:g} m"
        )
    z = (height - plate) / 2
    walls = [Segment("plate", (a, z), (b, z)) for a, b in pairwise(lines.tolist()) if b > a]
    walls += [Segment("rib", (y, -height / 2), (y, z)) for y in ribs]
    return extrude(walls, length, width / elements)


def strip(
    length: float,
    width: float,
    along: int = 40,
    across: int = 4,
    zones: Sequence[float] = (),
    pieces: Sequence[Piece] = (),
    thickness: float = 1.0,
) -> Mesh:
    """A flat strip at z = 0, the set `strip` or, between lines at some x, `strip_1`, `strip_2` and
    so on.

    Edges are node sets: `start`, `end`, `lower` (y < 0) and `upper`.

    Args:
        length: m.
        width: m.
        along: number of elements along the length, at least.
        across: number of elements across.
        zones: x of the lines between sets, m.
        pieces: steps and tapers of thickness, in the order of x; the middle surface stays plane.
        thickness: where no piece lies, m.

    Raises:
        InputError: a dimension or a number of elements is not positive, or pieces overlap or reach
            beyond the end.
    """
    _check("geometry", length=length, width=width)
    for name, number in (("nx", along), ("ny", across)):
        if number < 1:
            raise InputError(f"mesh.{name}", f"is {number}, expected at least one element")
    ends = {
        x
        for piece in pieces
        for x in (piece.start, piece.end)
        if 1e-9 * length < x < (1 - 1e-9) * length
    }
    stations = _stations(length, along, sorted({*zones, *ends}))
    mesh = _extruded([Segment("strip", (-width / 2, 0.0), (width / 2, 0.0))], stations, [across])
    # numbered along the side with fewer elements, which keeps the matrices' band narrow
    if across > along:
        mesh = _renumbered(mesh, np.lexsort(mesh.nodes[:, :2].T.round(12)))
    y, (block,) = mesh.nodes[:, 1], mesh.blocks
    sides = {
        "lower": np.flatnonzero(y < -width / 2 * (1 - 1e-9)),
        "upper": np.flatnonzero(y > width / 2 * (1 - 1e-9)),
    }
    x = mesh.nodes[block.nodes, 0]
    ratio = relative_thickness(x, length, thickness, pieces) if pieces else None
    zone = np.searchsorted(np.array(zones), x.mean(axis=1))
    blocks = tuple(
        CellBlock(
            "quad8",
            block.nodes[own],
            f"strip_{k + 1}" if zones else "strip",
            None if ratio is None else ratio[own],
        )
        for k in range(len(zones) + 1)
        for own in [zone == k]
    )
    return Mesh(mesh.nodes, blocks, {**mesh.node_sets, **sides})


@dataclass(frozen=True)
class Piece:
    """From x = `start` to `end` in m the thickness goes evenly from `first` to `last`, in m."""

    start: float
    end: float
    first: float
    last: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.start) and np.isfinite(self.end) and 0 <= self.start < self.end):
            raise InputError(
                "piece", f"goes from {self.start} to {self.end} m, expected 0 ≤ start < end"
            )
        for value in (self.first, self.last):
            if not (np.isfinite(value) and value > 0):
                raise InputError(
                    "piece.thickness", f"is {value}, expected a positive number of metres"
                )


def relative_thickness(
    x: FloatArray, length: float, thickness: float, pieces: Sequence[Piece]
) -> FloatArray:
    """(e, n) thickness over the nominal one at (e, n) places x of elements' nodes, each by the
    piece that its element is in.

    Raises:
        InputError: as of `check_pieces`.
    """
    check_pieces(length, pieces)
    ratio, middle = np.ones_like(x), x.mean(axis=1)
    for piece in pieces:
        inside = (middle > piece.start) & (middle < piece.end)
        share = (x[inside] - piece.start) / (piece.end - piece.start)
        ratio[inside] = (piece.first + share * (piece.last - piece.first)) / thickness
    return ratio


def check_pieces(length: float, pieces: Sequence[Piece]) -> None:
    """Make sure that pieces lie on a specimen, one beyond the other.

    Raises:
        InputError: pieces overlap, are not in the order of x, or reach beyond the end.
    """
    for before, after in pairwise(pieces):
        if after.start < before.end:
            raise InputError(
                "pieces",
                f"overlap, or are not in the order of x: {before.end:g} m is beyond"
                f" {after.start:g} m",
            )
    if pieces and pieces[-1].end > length * (1 + 1e-9):
        raise InputError(
            "pieces", f"end at {pieces[-1].end:g} m, beyond the length of {length:g} m"
        )


def _renumbered(mesh: Mesh, order: IntArray) -> Mesh:
    """The mesh with its nodes in another order."""
    new = np.argsort(order)
    blocks = tuple(replace(block, nodes=new[block.nodes]) for block in mesh.blocks)
    return Mesh(
        mesh.nodes[order],
        blocks,
        {name: np.sort(new[nodes]) for name, nodes in mesh.node_sets.items()},
    )


def extrude(segments: Sequence[Segment], length: float, size: float) -> Mesh:
    """Walls along x from 0 to the length, of elements of about a size in m."""
    counts = [
        max(1, int(np.ceil(np.hypot(*np.subtract(s.end, s.start)) / size - 1e-9))) for s in segments
    ]
    return _extruded(
        segments, np.linspace(0, length, max(1, int(np.ceil(length / size - 1e-9))) + 1), counts
    )


def _extruded(segments: Sequence[Segment], stations: FloatArray, counts: Sequence[int]) -> Mesh:
    """Numbered station after station, which keeps the matrices' band narrow where the section is
    small.
    """
    places: dict[tuple[float, float], int] = {}
    corner: list[bool] = []
    rows: dict[str, list[list[int]]] = {}
    for segment, count in zip(segments, counts, strict=True):
        line = np.linspace(segment.start, segment.end, 2 * count + 1)
        numbers = []
        for k, point in enumerate(line):
            number = places.setdefault(
                (round(float(point[0]), 12), round(float(point[1]), 12)), len(places)
            )
            if number == len(corner):
                corner.append(k % 2 == 0)
            numbers.append(number)
        rows.setdefault(segment.set, []).extend(numbers[k : k + 3] for k in range(0, 2 * count, 2))
    section, real = np.array(list(places)), np.array(corner)
    nx = len(stations) - 1
    x = np.interp(np.arange(2 * nx + 1) / 2, np.arange(nx + 1), stations)
    there = np.where(np.arange(2 * nx + 1)[:, None] % 2 == 0, True, real)
    grid: IntArray = np.cumsum(there).reshape(there.shape) - 1
    nodes = np.column_stack([np.repeat(x, there.sum(axis=1)), section[np.nonzero(there)[1]]])
    first = 2 * np.arange(nx)
    blocks = tuple(
        CellBlock("quad8", _elements(grid, first, np.array(sides)), name)
        for name, sides in rows.items()
    )
    ends = {"start": grid[0], "end": grid[-1]}
    return Mesh(nodes, blocks, ends)


def _elements(number: IntArray, first: IntArray, sides: IntArray) -> IntArray:
    """(e, 8) nodes of the elements between stations, from (stations, section nodes) numbers and (s,
    3) sides.
    """
    a, m, b = (sides[:, k][None] for k in range(3))
    i = first[:, None]
    corners = (number[i, a], number[i + 2, a], number[i + 2, b], number[i, b])
    middles = (number[i + 1, a], number[i + 2, m], number[i + 1, b], number[i, m])
    return np.stack([*corners, *middles], axis=-1).reshape(-1, 8)


def _stations(length: float, along: int, lines: Sequence[float]) -> FloatArray:
    """X of the stations: equally spaced, or as equal as lines between them allow, and at least so
    many.
    """
    ends = np.array([0.0, *lines, length])
    counts = np.ceil(np.diff(ends) / length * along - 1e-9).astype(np.int64)
    parts = [
        np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(ends[:-1], ends[1:], counts, strict=True)
    ]
    return np.concatenate([*parts, [length]])


def _check(field: str, **dimensions: float) -> None:
    for name, size in dimensions.items():
        if not (np.isfinite(size) and size > 0):
            raise InputError(
                f"{field}.{name}_m", f"is {size}, expected a positive number of metres"
            )
