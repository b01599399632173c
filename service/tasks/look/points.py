"""Coordinates that a file holds beside its FRFs or recordings: they are offered under the name of
their array, and taken by who sends the file.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fecore.quantities import QUANTITIES
from modalbase.formats.records import Variables
from modalbase.formats.units import factor_of, unit_beside, unit_in_name

_NAMES = ("point", "coord", "xyz", "node", "geom", "grid", "location", "position", "vertices")
_LABELS = ("label", "point", "node", "id", "number")
MOST = 10_000  # points of an offer
_MM = 1000.0  # of a metre


@dataclass(frozen=True)
class PointsOffer:
    """Points that an array may be."""

    array: str  # its name
    labels: tuple[int, ...]  # of an array of numbers beside it, else counted
    places: tuple[tuple[float, ...], ...]  # x, y and z of each, as they are in the file
    millimetres: Mapping[str, float]  # of each unit that they may be in: one that is stated, or two
    reach: tuple[float, float]  # along x and across, as `reach_of` has it

    def is_all_of(self, names: Iterable[str]) -> bool:
        """Whether a file with arrays of these names holds nothing but the points."""
        others = set(names) - set(self.array.split(", "))
        return all(any(word in other.lower() for word in _LABELS) for other in others)


def offers_of(variables: Variables, texts: Mapping[str, str], count: int) -> list[PointsOffer]:
    """The arrays of n x 3 coordinates, or of n x 4 numbers that begin with a label; and arrays x, y
    and perhaps z of n numbers each.

    Args:
        variables: the arrays of a file.
        texts: its texts, which may state units.
        count: of its FRFs; an array of as many rows needs no word of places in its name.
    """
    return [
        offer
        for name, array in [*variables.items(), *_side_by_side(variables)]
        if (offer := _offer(name, array, variables, texts, count)) is not None
    ]


def _side_by_side(variables: Variables) -> Iterator[tuple[str, NDArray[np.generic]]]:
    """Coordinates in arrays of their own, under the names of all."""
    vectors = {name: np.ravel(each) for name, each in variables.items() if each.dtype.kind in "fiu"}
    for name, x in vectors.items():
        parent, dot, own = name.rpartition(".")
        bare = unit_in_name(own, "length")[0].strip()
        if bare.lower() != "x" or x.size != max(variables[name].shape or (0,)):
            continue
        others = [parent + dot + own.replace(bare, chr(ord(bare) + k), 1) for k in (1, 2)]
        there = [one for one in others if one in vectors and vectors[one].size == x.size]
        if there[:1] == others[:1]:
            columns = [x, *(vectors[one] for one in there), np.zeros(x.size)][:3]
            yield ", ".join([name, *there]), np.column_stack(columns)


def _offer(
    name: str, array: NDArray[np.generic], among: Variables, texts: Mapping[str, str], count: int
) -> PointsOffer | None:
    if array.ndim != 2 or array.dtype.kind not in "fiu" or not np.all(np.isfinite(array)):
        return None
    named = ", " in name or any(word in name.lower() for word in _NAMES)
    rows = array.T if array.shape[1] not in (3, 4) and array.shape[0] == 3 else array
    labels = _as_labels(rows[:, 0]) if rows.shape[1] == 4 else None
    places = np.asarray(rows[:, -3:], dtype=float)
    if rows.shape[1] != 3 and labels is None:
        return None
    if not 2 <= len(places) <= MOST or len(np.unique(places, axis=0)) < len(places):
        return None
    if not named and len(places) != count:
        return None
    reach = reach_of(places.tolist())
    unit = unit_beside(name.partition(",")[0], texts, "length")
    factor = factor_of("length", unit) if unit else None
    millimetres = _either(reach[0]) if factor is None else {unit: factor * _MM}
    beside = (
        numbers
        for other, one in among.items()
        if one.size == len(places) and any(word in other.lower() for word in _LABELS)
        if (numbers := _as_labels(np.ravel(one))) is not None
    )
    labels = labels or next(beside, tuple(range(1, len(places) + 1)))
    return PointsOffer(name, labels, tuple(map(tuple, places.tolist())), millimetres, reach)


def _either(length: float) -> dict[str, float]:
    """Metres or millimetres, in which a length without a unit is a usual one; both where it is in
    neither.
    """
    low, high = QUANTITIES["length"].usual or (0.0, np.inf)
    units = {"m": _MM, "mm": 1.0}
    return {one: size for one, size in units.items() if low <= length * size / _MM <= high} or units


def _as_labels(column: NDArray[np.generic]) -> tuple[int, ...] | None:
    """Whole numbers from 1 on, each once."""
    if column.dtype.kind not in "fiu":
        return None
    values = np.asarray(column, dtype=float)
    whole = np.all(values == np.round(values)) and np.all(values >= 1) and np.all(values < 1e10)
    distinct = len(np.unique(values)) == len(values)
    return tuple(int(value) for value in values) if whole and distinct else None


def reach_of(places: Iterable[Iterable[float]]) -> tuple[float, float]:
    """Length and width that points reach over: from the end x = 0, and on both sides of the centre
    line where they lie on both.

    >>> reach_of([(0.1, -0.02, 0), (0.5, 0.018, 0)])
    (0.5, 0.04)
    """
    x, y, *_ = np.asarray(list(places), dtype=float).T
    length = x.max() - min(0.0, x.min())
    width = 2 * np.abs(y).max() if y.min() < 0 < y.max() else y.max() - y.min()
    return float(length), float(width)
