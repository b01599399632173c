"""How walls share a line: what each takes of the others there, continuous in their angles.

Two walls whose directions turn by α at a line overlap inside and gape outside over (T/2) tan(α/2)
from it, T the other wall's
thickness: T/2 at a right angle, nothing where one goes straight on. So what holds at a right angle
is scaled by tan(α/2), and a faceted curve is a curve. Where three or more walls meet, each has such
a factor on both its sides:

- a wall that passes, as another goes straight on beyond the line, has the larger of its two;
- one that ends has their mean: at an angle β to a wall that passes that is ½ (tan(β/2) + cot(β/2))
  = 1/sin β.

Whether walls pass is a share from 0 to 1: how much straighter the two lie than either does to any
other. A factor never takes an overlap beyond a third of a wall's width (a smooth minimum): at sharp
edges the rest is not repaired.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fecore.arrays import FloatArray

# p by how a wall meets the other: found with solids whose walls are up to 2.5 times as thick as one
# another.
_PASSING, _ENDING, _CORNER = 1.7, 3.0, 2.0
_MOST = 1 / 3  # of a wall's width that an overlap may take
_SHARPNESS = 32  # of the smooth minimum
_LEAST = 1e-15  # of sines and squares that are divided by


@dataclass(frozen=True)
class Corner:
    """Stacks of walls around a line, in the order of their angles about it; walls on the same nodes
    are one stack.
    """

    directions: FloatArray  # (n, 3) unit directions away from the line
    thickness: FloatArray  # (n,) m
    factors: FloatArray  # (n,) tan(α/2) between each and the next; below 0 where they gape

    @classmethod
    def of(cls, tangent: FloatArray, directions: FloatArray, thickness: Sequence[float]) -> Corner:
        """The corner of stacks in the order of their angles about a tangent, with nothing cut."""
        after = np.roll(directions, -1, axis=0)
        sine = np.cross(directions, after) @ tangent
        inner = np.arctan2(sine, np.sum(directions * after, axis=1)) % (2 * np.pi)
        return cls(
            directions,
            np.array(thickness),
            np.cos(inner / 2) / np.maximum(np.sin(inner / 2), _LEAST),
        )

    @property
    def is_simple(self) -> bool:
        """Whether only two meet."""
        return len(self.thickness) == 2

    @property
    def turn(self) -> float:
        """tan(α/2), of two up to 1: how much of a right angle it is; of more 1."""
        return min(float(np.abs(self.factors).max()), 1.0) if self.is_simple else 1.0

    @property
    def scale(self) -> float:
        """What the torsion of the line is scaled by."""
        return float(np.abs(self.factors[0])) if self.is_simple else 1.0

    def overlap(self, stack: int) -> float:
        """The deepest overlap of a stack with its neighbours, m."""
        return float(max(T / 2 * factor for T, factor in self._sides(stack)))

    def cut(self, widths: Sequence[float], share: float = _MOST) -> Corner:
        """With factors that take no overlap beyond a share, a third, of any width."""
        most = (
            2
            * share
            * np.array(widths)
            / np.maximum(np.roll(self.thickness, -1), np.roll(self.thickness, 1))
        )
        parts = np.array([np.maximum(np.abs(self.factors), _LEAST), most, np.roll(most, -1)])
        least = parts.min(axis=0)
        size = least * np.sum((least / parts) ** _SHARPNESS, axis=0) ** (-1 / _SHARPNESS)
        return replace(self, factors=np.copysign(size, self.factors))

    def left(self, cut: Corner) -> float:
        """How many right angles' worth of a factor a cut took at most."""
        return float(np.max(np.abs(self.factors) - np.abs(cut.factors)))

    @property
    def size(self) -> float:
        """How many right angles' worth its largest factor is; where more than two meet 1 at
        least.
        """
        return max(float(np.abs(self.factors).max()), 0.0 if self.is_simple else 1.0)

    @cached_property
    def straight(self) -> FloatArray:
        """(n, n) from 0 to 1 how far two are one that passes: squared, so that derivatives
        exist.
        """
        if len(self.thickness) < 3:
            return np.zeros((len(self.thickness),) * 2)
        cosine = np.clip(self.directions @ self.directions.T, -1, 1)
        near = np.maximum(1 - cosine, _LEAST) / np.maximum(1 + cosine, _LEAST)
        np.fill_diagonal(near, 0.0)
        share = near / near.sum(axis=1, keepdims=True)
        return np.asarray(np.maximum(share + share.T - 1, 0.0) ** 2)

    def begin(self, stack: int) -> float:
        """d, m: where a stack's elements begin."""
        t = float(self.thickness[stack])
        (T, most), (other, least) = sorted(
            self._sides(stack), key=lambda side: side[0] * side[1], reverse=True
        )
        if self.is_simple:
            return _link(t, T, _CORNER) * most
        passes = float(self.straight[stack].max())
        beside = float(np.delete(np.delete(self.straight, stack, 0), stack, 1).max())
        power = _CORNER + beside * (_ENDING - _CORNER)
        mean = (most + least) / 2 if least > 0 else most
        ends = _link(t, max(T, other), power) * mean
        return float(max(passes * _link(t, T, _PASSING) * most + (1 - passes) * ends, 0.0))

    def true_start(self, stack: int, zeta: FloatArray, goes_on: int = 0) -> FloatArray:
        """(g,) where a stack truly begins, m from the line, at heights ζ along tangent × direction.

        Where a wall passes, the others begin at its face. Else each is mitred with its neighbours,
        from the line to the corner where their faces meet; of two, one may go on to the outer face.

        Args:
            stack: its number.
            zeta: heights, m.
            goes_on: 1 of a corner's stack that goes on, −1 of the other, 0 where they are mitred.
        """
        (T, up), (other, down) = self._sides(stack)
        if goes_on:
            return np.full_like(zeta, -goes_on * T / 2 * abs(up))
        reach = np.where(zeta >= 0, T * up, other * down)
        mitred = np.abs(zeta) / self.thickness[stack] * reach
        through = self.straight * np.maximum.outer(self.thickness, self.thickness)
        pair = np.unravel_index(int(np.argmax(through)), through.shape)
        share = float(self.straight[pair])
        if not share:
            return np.asarray(mitred)
        face = np.zeros_like(zeta)
        if stack not in pair:
            face = self.thickness[list(pair)].max() * (up + down) / 4 + zeta * (up - down) / 2
        return np.asarray(share * face + (1 - share) * mitred)

    def _sides(self, stack: int) -> tuple[tuple[float, float], tuple[float, float]]:
        """The neighbour's thickness and the factor on the side of tangent × direction, and on the
        other.
        """
        n = len(self.thickness)
        after, before = (stack + 1) % n, (stack - 1) % n
        return (
            (float(self.thickness[after]), float(self.factors[stack])),
            (float(self.thickness[before]), float(self.factors[before])),
        )


def _link(t: float, T: float, power: float) -> float:
    """Where a wall of thickness t begins at a right angle to one of thickness T."""
    return T / 2 / (1 + 3 * float((t / T) ** power))
