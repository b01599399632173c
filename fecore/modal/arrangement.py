"""FRFs of a campaign laid out for identification: one axis, positive directions, a roving side and
a fixed side.

A roving hammer keeps the response fixed and a roving sensor the reference. By reciprocity H_ij =
H_ji both give a column of the FRF matrix, and the mode shape is found at the dofs that rove.
Campaigns with several fixed dofs, or with both rows and columns of the matrix, are covered too: the
fixed dofs are the fewest that touch every FRF.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fecore.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from fecore.errors import InputError
from fecore.frf import POWER_OF_I_OMEGA, Dof, FrfSet, Quantity
from fecore.signal.half_spectra import reference_of

FEW = 4
"""FRFs or tests below which nothing is learnt of what differs between them: shapes, drift, errors,
one that is alone.
"""

MANY = 8
"""... and from which their common part, or their scatter, is known well."""

CLEAR = 5.0
"""Times what chance or the others make from which something stands out."""


QUANTITIES = {power: quantity for quantity, power in POWER_OF_I_OMEGA.items()}
"""By the power of iω that makes them of a receptance."""

# parts of a band, from a thirtieth of its end on as leakage may be larger below, and least ratio of
# its ends, by which FRFs are compared
_PARTS, _LOWEST, _WIDE = 12, 30.0, 2.0
# standard deviations of the slope and of ln of the size of two FRFs of one structure; what a wrong
# unit, and a wrong quantity, are less likely than none (twice the logarithm of the odds)
SLOPE_SD, _SIZE_SD, _UNIT, SURE = 0.3, np.log(3.0), 9.0, 9.0


@dataclass(frozen=True)
class Arrangement:
    """All FRFs on one frequency axis, their signs turned to positive directions."""

    frequency_hz: FloatArray  # (L,) union of the lines of all sets, Hz; no line at 0 Hz
    values: ComplexArray  # (N, L) complex FRFs, 0 where nothing was measured
    measured: BoolArray  # (N, L) True where a value was measured
    variance: FloatArray  # (N, L) noise variance handed in; NaN where it is not known
    growth: ComplexArray  # (N, L) of a value with the height of hits (`FrfSet`); NaN where unknown
    # N (response, reference) pairs of positive dofs, as measured
    pairs: tuple[tuple[Dof, Dof], ...]
    quantity: Quantity  # what kind of FRF all of them are
    roving: tuple[Dof, ...]  # p dofs at which shapes are found
    fixed: tuple[Dof, ...]  # m dofs against which they are measured
    row: IntArray  # (N, 2) index into `roving` and into `fixed` of each FRF
    source: IntArray  # (N,) number of each FRF among those handed in, set after set

    @cached_property
    def omega(self) -> FloatArray:
        """(L,) circular frequency of the lines, rad/s."""
        return 2 * np.pi * self.frequency_hz

    @cached_property
    def session(self) -> IntArray:
        """(N,) number of the test that each FRF belongs to: the sensors of one hit, or the hits of
        one sensor, share theirs.
        """
        side = max((0, 1), key=lambda i: len({pair[i] for pair in self.pairs}))
        dofs = sorted({pair[side] for pair in self.pairs})
        return np.array([dofs.index(pair[side]) for pair in self.pairs], dtype=np.int64)

    @property
    def sessions(self) -> int:
        """Number of tests, each of which may have drifted on its own."""
        return int(self.session.max()) + 1

    def in_band(self, hz: FloatArray) -> BoolArray:
        """(n,) True for frequencies within the lines."""
        return np.asarray((hz >= self.frequency_hz[0]) & (hz <= self.frequency_hz[-1]))

    @property
    def power(self) -> int:
        """Power of iω that turns a receptance into these FRFs."""
        return POWER_OF_I_OMEGA[self.quantity]

    @cached_property
    def spacing_hz(self) -> float:
        """Usual distance of neighbouring lines, Hz."""
        return float(np.median(np.diff(self.frequency_hz))) if self.frequency_hz.size > 1 else 0.0

    def label(self, row: int) -> str:
        """Name of an FRF, response first: `33Z/1Z`."""
        return pair_label(*self.pairs[row])

    def on(self, lines: slice, mean: int = 1) -> Arrangement:
        """The same on some lines, or on the means of so many of them."""
        have = means(self.measured[:, lines], mean)
        return replace(
            self,
            frequency_hz=means(self.frequency_hz[lines], mean),
            values=np.asarray(means(self.values[:, lines], mean) / np.where(have > 0, have, 1.0)),
            measured=have > 0,
            variance=means(self.variance[:, lines], mean) / mean,
            growth=means(self.growth[:, lines], mean),
        )

    def without(self, rows: Sequence[int]) -> Arrangement:
        """The same without some FRFs.

        Raises:
            InputError: nothing is left.
        """
        keep = [i for i in range(len(self.pairs)) if i not in set(rows)]
        if not keep:
            raise InputError("frfs", "no usable FRF is left")
        pairs = tuple(self.pairs[i] for i in keep)
        roving, fixed, row = split_sides(pairs)
        return replace(
            self,
            values=self.values[keep],
            measured=self.measured[keep],
            variance=self.variance[keep],
            growth=self.growth[keep],
            pairs=pairs,
            roving=roving,
            fixed=fixed,
            row=row,
            source=self.source[keep],
        )


def means(each: np.ndarray, lines: int) -> np.ndarray:
    """(…, L // lines) means of neighbouring lines of (…, L)."""
    whole = each.shape[-1] // lines * lines
    return np.asarray(each[..., :whole].reshape(*each.shape[:-1], -1, lines).mean(axis=-1))


def pair_label(response: Dof, reference: Dof) -> str:
    """Name of an FRF as laboratories write it, response first: `33Z/1Z`; of a half spectrum of
    several setups `33Z/1Z of setup 2`.
    """
    axes = ("X", "Y", "Z", "RX", "RY", "RZ")
    own, setup = reference_of(reference)
    both = "/".join(
        f"{d.point}{'-' if d.sign < 0 else ''}{axes[d.axis - 1]}" for d in (response, own)
    )
    return f"{both} of setup {setup}" if setup else both


def set_with_gaps(
    frequency_hz: FloatArray,
    values: ComplexArray,
    responses: Sequence[Dof],
    references: Sequence[Dof],
    quantity: Quantity = "accelerance",
    variance: FloatArray | None = None,
) -> FrfSet:
    """An FRF set from data with holes: values that are NaN or infinite count as not measured."""
    hole = ~np.isfinite(values)
    return FrfSet(
        frequency_hz=np.asarray(frequency_hz, dtype=float),
        values=np.where(hole, 0, values).astype(complex),
        responses=tuple(responses),
        references=tuple(references),
        quantity=quantity,
        variance=variance,
        measured=~hole,
    )


def arrange(
    frfs: FrfSet | Sequence[FrfSet], band_hz: tuple[float, float] | None = None
) -> Arrangement:
    """Lay out one or several FRF sets (which may differ in frequency axis and quantity) for
    identification.

    Lines at 0 Hz are left out (an accelerance is zero there by definition, a receptance infinite
    for a free body).

    Raises:
        InputError: no FRF, or no line in the band.
    """
    sets = [frfs] if isinstance(frfs, FrfSet) else list(frfs)
    if not sets or not any(len(s.responses) for s in sets):
        raise InputError("frfs", "is empty, expected at least one FRF")
    low, high = band_hz if band_hz is not None else (0.0, np.inf)
    if not 0 <= low < high:
        raise InputError("band_hz", f"is {low:g} to {high:g} Hz, expected 0 <= low < high")
    low = max(low, np.nextafter(0, 1))
    sets = [
        s.band(low, high).to_quantity(sets[0].quantity) for s in sets if _has_line(s, low, high)
    ]
    if not sets:
        raise InputError("band_hz", f"no FRF has a line in {low:g} to {high:g} Hz")
    axis, places = _union_axis([s.frequency_hz for s in sets])
    count = sum(len(s.responses) for s in sets)
    values = np.zeros((count, axis.size), dtype=complex)
    variance = np.full((count, axis.size), np.inf)
    growth = np.full((count, axis.size), np.nan, dtype=complex)
    pairs: list[tuple[Dof, Dof]] = []
    for frf_set, place in zip(sets, places, strict=True):
        rows = slice(len(pairs), len(pairs) + len(frf_set.responses))
        both = list(zip(frf_set.responses, frf_set.references, strict=True))
        sign = np.array([a.sign * b.sign for a, b in both])
        values[rows, place] = sign[:, None] * frf_set.values
        known = np.nan if frf_set.variance is None else frf_set.variance
        variance[rows, place] = np.where(frf_set.measured, known, np.inf)
        if frf_set.growth is not None:
            growth[rows, place] = sign[:, None] * frf_set.growth
        pairs += [(Dof(a.point, a.axis), Dof(b.point, b.axis)) for a, b in both]
    roving, fixed, row = split_sides(tuple(pairs))
    measured = ~np.isposinf(variance)
    source = np.arange(len(pairs))
    return Arrangement(
        frequency_hz=axis,
        values=values,
        measured=measured,
        variance=variance,
        growth=growth,
        pairs=tuple(pairs),
        quantity=sets[0].quantity,
        roving=roving,
        fixed=fixed,
        row=row,
        source=source,
    )


def other_quantities(arrangement: Arrangement) -> dict[int, tuple[int, float]]:
    """FRFs that are another quantity than most: number to the power p of iω by which they differ,
    and how many times as large as most they are.

    ln|H_i| less the median of all FRFs, on parts of the band, is p ln ω but for the mode shapes: p
    is its slope, and its size agrees. A wrong unit makes a size without a slope. An odd p turns the
    phase by 90°: squares of opposite sign on most lines.
    """
    hz, values = arrangement.frequency_hz, arrangement.values
    whole = arrangement.measured.mean(axis=1) > 0.5
    alive = np.flatnonzero(whole & values.imag.any(axis=1) & values.real.any(axis=1))
    if alive.size < FEW or hz[-1] < _WIDE * hz[0]:
        return {}
    first = max(float(hz[0]), float(hz[-1]) / _LOWEST)
    ends = np.searchsorted(hz, np.geomspace(first, hz[-1], _PARTS + 1)[:-1])
    parts = [part for part in np.split(np.arange(hz.size), ends)[1:] if part.size]
    size = np.abs(values[alive])
    with np.errstate(divide="ignore", invalid="ignore"):
        power = [np.nanmean(size[:, part] ** 2, axis=1) for part in parts]
        level = np.log(np.array(power)) / 2
        level -= np.nanmedian(level, axis=1, keepdims=True)
        square = (values[alive] / np.maximum(size, np.finfo(float).tiny)) ** 2
    x = np.log(2 * np.pi * np.array([np.exp(np.log(hz[part]).mean()) for part in parts]))
    off, total, others = x - x.mean(), square.sum(axis=0), {}
    for row, own, phase in zip(alive, level.T, square, strict=True):
        if not np.all(np.isfinite(own)):
            continue
        slope = float(off @ own / (off @ off))
        rest = own - own.mean() - slope * off
        variance = float(rest @ rest / max(x.size - 2, 1) / (off @ off)) + SLOPE_SD**2
        turned = np.vdot(total - phase, phase).real < 0
        misfits = {
            p: (slope - p) ** 2 / variance + ((own.mean() - p * x.mean()) / _SIZE_SD) ** 2
            for p in (-2, -1, 0, 1, 2)
            if not p or (arrangement.power + p in QUANTITIES and turned == bool(p % 2))
        }
        best = min(misfits, key=lambda p: misfits[p])
        none = slope**2 / variance + min((own.mean() / _SIZE_SD) ** 2, _UNIT)
        if misfits[best] + SURE < none and best:
            others[int(row)] = best, float(np.exp(own.mean()))
    return others


def split_sides(
    pairs: tuple[tuple[Dof, Dof], ...],
) -> tuple[tuple[Dof, ...], tuple[Dof, ...], IntArray]:
    """Roving dofs, fixed dofs and for each pair the index into both; the fixed dofs are the fewest
    that touch all pairs.

    The cover is greedy (most pairs first, references before responses on a tie), which is exact for
    the arrangements that laboratories use: one or several whole rows or columns.
    """
    fixed: list[Dof] = []
    open_rows = set(range(len(pairs)))
    while open_rows:
        tally: dict[Dof, tuple[int, int]] = {}
        for i in open_rows:
            for side, dof in enumerate(pairs[i]):
                touched, as_reference = tally.get(dof, (0, 0))
                once = 0 if side == 1 and pairs[i][0] == pairs[i][1] else 1
                tally[dof] = (touched + once, as_reference + side)
        best = max(tally, key=lambda d: (tally[d], -d.point, -d.axis))
        fixed.append(best)
        open_rows = {i for i in open_rows if best not in pairs[i]}
    oriented = [(a, b) if b in fixed else (b, a) for a, b in pairs]
    roving = sorted({a for a, _ in oriented})
    fixed = sorted({b for _, b in oriented})
    row = np.array([(roving.index(a), fixed.index(b)) for a, b in oriented], dtype=np.int64)
    return tuple(roving), tuple(fixed), row


def _has_line(frf_set: FrfSet, low: float, high: float) -> bool:
    return bool(np.any((frf_set.frequency_hz >= low) & (frf_set.frequency_hz <= high)))


def _union_axis(axes: list[FloatArray]) -> tuple[FloatArray, list[IntArray]]:
    """Union of frequency axes and where the lines of each fall on it."""
    together = np.sort(np.concatenate(axes))
    spacings = [float(np.diff(a).min()) for a in axes if a.size > 1]
    # closer lines of two axes are one, written with fewer digits
    tolerance = 1e-6 * min(spacings, default=1.0)
    union = together[np.concatenate(([True], np.diff(together) > tolerance))]
    places = [np.searchsorted(union, a + tolerance, side="right") - 1 for a in axes]
    return union, [p.astype(np.int64) for p in places]
