"""Steps and tapers of thickness along a specimen: the thickness at x over the specimen's own.

A specimen's thickness t is that where no piece says otherwise; a piece is r = t(x)/t times as thick. All plies share in that:

    A, S ∝ r,    B ∝ r²,    D ∝ r³,    I0 ∝ r,    I1 ∝ r²,    I2 ∝ r³

and the element matrices are integrated with these powers: the model stays affine in the coefficients of the section at t.
The middle surface stays plane: a step is taken off, or added on, both faces alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from fecore.arrays import FloatArray
from fecore.errors import InputError


@dataclass(frozen=True)
class Piece:
    """From x = `start` to `end` in m the thickness goes evenly from `first` to `last`, in m."""

    start: float
    end: float
    first: float
    last: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.start) and np.isfinite(self.end) and 0 <= self.start < self.end):
            raise InputError("piece", f"goes from {self.start} to {self.end} m, expected 0 ≤ start < end")
        for value in (self.first, self.last):
            if not (np.isfinite(value) and value > 0):
                raise InputError("piece.thickness", f"is {value}, expected a positive number of metres")


@dataclass(frozen=True)
class Profile:
    """The relative thickness r(x) along a specimen.

    Attributes:
        length, thickness: of the specimen, m; thickness where no piece lies.
        pieces: in the order of x, none over another.
    """

    length: float
    thickness: float
    pieces: tuple[Piece, ...]

    def __post_init__(self) -> None:
        for before, after in pairwise(self.pieces):
            if after.start < before.end:
                raise InputError(
                    "pieces", f"overlap, or are not in the order of x: {before.end:g} m is beyond {after.start:g} m"
                )
        if self.pieces and self.pieces[-1].end > self.length * (1 + 1e-9):
            raise InputError("pieces", f"end at {self.pieces[-1].end:g} m, beyond the length of {self.length:g} m")

    @property
    def breaks(self) -> tuple[float, ...]:
        """Where pieces begin and end inside the specimen, m: lines that the mesh has to have."""
        ends = {float(x) for piece in self.pieces for x in (piece.start, piece.end)}
        return tuple(sorted(x for x in ends if 1e-9 * self.length < x < (1 - 1e-9) * self.length))

    def ratio(self, x: FloatArray) -> FloatArray:
        """R at places (…) along x."""
        found = np.ones_like(x)
        for piece in self.pieces:
            share = (x - piece.start) / (piece.end - piece.start)
            inside = (share >= 0) & (share <= 1)
            found = np.where(inside, (piece.first + share * (piece.last - piece.first)) / self.thickness, found)
        return found


def profile_of(length: float, thickness: float, pieces: Sequence[Piece]) -> Profile | None:
    """The profile of a specimen's pieces; None where the specimen has none."""
    return Profile(length, thickness, tuple(pieces)) if pieces else None
