"""Frequency response functions: what they are measured between, and sets of them.

A frequency response function (FRF) is the ratio of a response at one degree of freedom to a force
at another, H(ω) = X(ω)/F(ω). Where X is an acceleration it is an accelerance, a velocity a
mobility, a displacement a receptance: accelerance = iω·mobility = -ω²·receptance.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Literal, get_args

import numpy as np

from fecore.arrays import BoolArray, ComplexArray, FloatArray
from fecore.errors import InputError

Quantity = Literal["accelerance", "mobility", "receptance"]

MAINS_HZ = (50.0, 60.0)
"""Frequencies of the public supplies, at whose multiples cables hum, Hz."""

SMALLEST, LARGEST = 1e-70, 1e70
"""Of the largest value of an FRF: what lies between can be squared twice in double precision;
nothing beyond is measured.
"""

_DERIVATIVES: tuple[Quantity, ...] = ("receptance", "mobility", "accelerance")
POWER_OF_I_OMEGA = {name: power for power, name in enumerate(_DERIVATIVES)}
"""Power of iω that turns a receptance into each quantity."""


def convert(omega: FloatArray, quantity: Quantity) -> ComplexArray:
    """(L,) factor from receptance to another quantity: (iω)⁰, (iω)¹ or (iω)²."""
    factor: ComplexArray = (1j * omega) ** POWER_OF_I_OMEGA[quantity]
    return factor


def size_fault(values: ComplexArray) -> str | None:
    """Why values are too large or too small to be computed with, in words; None where they are not,
    or all are zero.
    """
    largest = max(
        float(np.abs(part).max(initial=0.0)) for part in (values.real, values.imag)
    )  # |1e308 + 1e308i| overflows
    if largest == 0 or SMALLEST <= largest <= LARGEST:
        return None
    return (
        f"reaches {largest:.3g}, expected its largest between {SMALLEST:g} and {LARGEST:g}; check"
        " unit and scale"
    )


@dataclass(frozen=True, order=True)
class Dof:
    """A measurement point and a signed direction there."""

    point: int  # label of the grid point
    # 1, 2, 3 for +x, +y, +z, 4, 5, 6 for rotations about them; negative for the opposite sense
    direction: int

    def __post_init__(self) -> None:
        if not 1 <= abs(self.direction) <= 6:
            raise InputError("direction", f"is {self.direction}, expected ±1 … ±6")

    @property
    def axis(self) -> int:
        """Direction without its sign, 1 to 6."""
        return abs(self.direction)

    @property
    def sign(self) -> int:
        """+1 or -1."""
        return 1 if self.direction > 0 else -1


def along_z(points: Iterable[int]) -> tuple[Dof, ...]:
    """Dofs along +z of some points, which is out of a strip's plane."""
    return tuple(Dof(point, 3) for point in points)


@dataclass(frozen=True)
class FrfSet:
    """FRFs on one frequency axis."""

    frequency_hz: FloatArray  # (L,) increasing frequency lines, Hz
    values: ComplexArray  # (N, L) complex FRFs, SI (m/s² per N, m/s per N or m per N)
    responses: tuple[Dof, ...]  # N response degrees of freedom
    references: tuple[Dof, ...]  # N force degrees of freedom
    quantity: Quantity = "accelerance"  # what kind of FRF all of them are
    # (N, L) variance of the complex noise E|n|² of each value, NaN or None where it is not known
    variance: FloatArray | None = None
    # (N, L) where a value was measured; all of them by default. Elsewhere a value means nothing.
    measured: BoolArray = field(default_factory=lambda: np.zeros((0, 0), dtype=bool))
    # (N, L) what each value grows by where a hit is harder by the scatter (1 sd of ln) of the hits,
    # NaN or None where it is not known
    growth: ComplexArray | None = None

    def __post_init__(self) -> None:
        if self.measured.size == 0:
            object.__setattr__(self, "measured", np.ones(self.values.shape, dtype=bool))
        lines, count = self.frequency_hz.size, len(self.responses)
        if self.frequency_hz.ndim != 1 or lines == 0:
            raise InputError(
                "frequency_hz", f"has shape {self.frequency_hz.shape}, expected one axis of lines"
            )
        hz = self.frequency_hz
        if not np.isfinite(hz).all() or np.any(np.diff(hz) <= 0) or hz[0] < 0:
            raise InputError("frequency_hz", "must be finite, non-negative and strictly increasing")
        if self.values.shape != (count, lines):
            raise InputError(
                "values", f"has shape {self.values.shape}, expected ({count}, {lines})"
            )
        if len(self.references) != count:
            raise InputError("references", f"has {len(self.references)} entries, expected {count}")
        if self.quantity not in get_args(Quantity):
            raise InputError(
                "quantity", f"is {self.quantity!r}, expected one of {', '.join(get_args(Quantity))}"
            )
        if not np.all(np.isfinite(self.values)):
            row = int(np.argmin(np.isfinite(self.values).all(axis=1)))
            raise InputError("values", f"holds NaN or infinite ordinates ({self._named(row)})")
        if (reason := size_fault(self.values)) is not None:
            row = next(i for i, values in enumerate(self.values) if size_fault(values) is not None)
            raise InputError("values", f"{reason} ({self._named(row)})")
        for name in ("variance", "growth", "measured"):
            each = getattr(self, name)
            if each is not None and each.shape != self.values.shape:
                raise InputError(name, f"has shape {each.shape}, expected {self.values.shape}")

    def _named(self, row: int) -> str:
        between = self.responses[row].point, self.references[row].point
        return f"FRF {row + 1}, response point {between[0]}, reference point {between[1]}"

    @property
    def points(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Labels of the N response points and of the N force points."""
        return tuple(dof.point for dof in self.responses), tuple(
            dof.point for dof in self.references
        )

    @property
    def omega(self) -> FloatArray:
        """(L,) circular frequency of the lines, rad/s."""
        return 2 * np.pi * self.frequency_hz

    def conjugated(self) -> FrfSet:
        """The conjugates, which have exp(+iωt) where these have exp(-iωt)."""
        growth = None if self.growth is None else self.growth.conj()
        return replace(self, values=self.values.conj(), growth=growth)

    def unmeasured_at(self, gaps: BoolArray) -> FrfSet:
        """The same FRFs with (N, L) more values taken as not measured."""
        return replace(self, measured=self.measured & ~gaps)

    def without(self, low_hz: float, high_hz: float) -> FrfSet:
        """The same FRFs but for the lines from `low_hz` to `high_hz`.

        Raises:
            InputError: no line is left.
        """
        keep = (self.frequency_hz < low_hz) | (self.frequency_hz > high_hz)
        if not keep.any():
            raise InputError("band_hz", f"{low_hz:g} to {high_hz:g} Hz are all the lines there are")
        return self._lines(keep)

    def band(self, low_hz: float, high_hz: float) -> FrfSet:
        """The same FRFs on the lines from `low_hz` to `high_hz`, both included.

        Raises:
            InputError: the band holds no line.
        """
        keep = (self.frequency_hz >= low_hz) & (self.frequency_hz <= high_hz)
        if not keep.any():
            raise InputError("band_hz", f"no frequency line lies in {low_hz:g} to {high_hz:g} Hz")
        return self._lines(keep)

    def on_every(self, step: int) -> FrfSet:
        """The same FRFs on one line of every so many."""
        return self._lines(slice(None, None, step))

    def _lines(self, keep: BoolArray | slice) -> FrfSet:
        return replace(
            self,
            frequency_hz=self.frequency_hz[keep],
            values=self.values[:, keep],
            variance=None if self.variance is None else self.variance[:, keep],
            growth=None if self.growth is None else self.growth[:, keep],
            measured=self.measured[:, keep],
        )

    def select(self, rows: list[int]) -> FrfSet:
        """The FRFs of the given rows, in that order."""
        return replace(
            self,
            values=self.values[rows],
            responses=tuple(self.responses[i] for i in rows),
            references=tuple(self.references[i] for i in rows),
            variance=None if self.variance is None else self.variance[rows],
            growth=None if self.growth is None else self.growth[rows],
            measured=self.measured[rows],
        )

    def to_quantity(self, quantity: Quantity) -> FrfSet:
        """The same FRFs as another quantity, multiplied by the right power of iω.

        Raises:
            InputError: the set has a line at 0 Hz and the conversion would divide by it.
        """
        power = POWER_OF_I_OMEGA[quantity] - POWER_OF_I_OMEGA[self.quantity]
        if power < 0 and self.frequency_hz[0] == 0:
            raise InputError("frequency_hz", f"a line at 0 Hz has no {quantity}; leave it out")
        factor = (1j * self.omega) ** power
        variance = None if self.variance is None else self.variance * np.abs(factor) ** 2
        growth = None if self.growth is None else self.growth * factor
        values = self.values * factor
        return replace(self, values=values, quantity=quantity, variance=variance, growth=growth)
