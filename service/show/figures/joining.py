"""Which measured points are neighbours, so that a picture joins them as an eye would.

Two points are joined where the ball between them holds no other (Gabriel and Sokal, Systematic Zoology 18, 1969): of a
rectangular grid its rows and columns, of irregular points a part of their triangulation, never a zigzag.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np
import scipy

from fecore.arrays import FloatArray

NEAREST = 128  # candidates of a point: in a grid of up to so many points all, in a larger one all that are near
_STRAIGHT = 0.7  # cosine of the angle up to which a line goes on
_TOUCHING = 1e-6  # share of a ball's radius within which a point lies on it, such as the other corners of a square


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
    third = tree.query((distinct[a] + distinct[b]) / 2, k=[3])[0][:, 0]  # the nearest are the two themselves
    alone = third > (1 + _TOUCHING) * np.linalg.norm(distinct[a] - distinct[b], axis=1) / 2
    return sorted(
        (min(i, j), max(i, j)) for i, j in zip(first[a[alone]].tolist(), first[b[alone]].tolist(), strict=True)
    )


def joined_as(lines: Iterable[Sequence[int]], labels: Sequence[int], places: FloatArray) -> list[tuple[int, int]]:
    """Pairs of numbers of labelled places: along the file's trace lines, or neighbours where it has none between them.

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
    """Neighbours joined to lines that go on as straight as they can: numbers of the places along each, m."""
    left: dict[int, set[int]] = {}
    pairs = joined(places)
    for i, j in pairs:
        left.setdefault(i, set()).add(j)
        left.setdefault(j, set()).add(i)
    found = []
    for i, j in pairs:
        if j in left[i]:
            _take(left, i, j)
            ahead = _onward(places, left, i, j)
            found.append([*reversed(_onward(places, left, j, i)), i, j, *ahead])
    return found


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
