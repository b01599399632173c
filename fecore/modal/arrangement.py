"""FRFs of a campaign laid out for identification: one axis, positive directions, a roving side and
a fixed side; the octaves of a wide band; and linear estimates (LSCF) of the poles in windows of its
lines, of which those that come back are candidates.

A roving hammer keeps the response fixed and a roving sensor the reference. By reciprocity H_ij =
H_ji both give a column of the FRF matrix, and the mode shape is found at the dofs that rove.
Campaigns with several fixed dofs, or with both rows and columns of the matrix, are covered too: the
fixed dofs are the fewest that touch every FRF.

In a window of lines the M rows of FRFs share a denominator of order n with complex coefficients, in
z = exp(i(ω - ω₀)T), which maps the window to 0.95 of the circle:

    H_m(z) = (Σ_r β_mr z^r) / (Σ_r α_r z^r),    r = 0 … n,    α_n = 1,

and Σ_r β_mr z^r - H_m Σ_r α_r z^r is made small in the weighted least-squares sense (Guillaume,
Verboven and Vanlanduit 1998). The β_m are eliminated; the poles are the eigenvalues of the
companion matrix of the α. Complex coefficients spare the mirror poles and let the numerators stand
for all that lies outside the window. All inner products are Toeplitz in r: moments Σ_l w (...) z^k.
A pole of the structure comes back from order to order and from window to window; the median of such
a cluster is a candidate. Noise biases it: it is a start for the refinement, nothing more.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import scipy

from fecore.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from fecore.errors import InputError
from fecore.frf import POWER_OF_I_OMEGA, Dof, FrfSet, Quantity
from fecore.signal.block_spectra import BlockSpectra
from fecore.signal.half_spectra import reference_of

if TYPE_CHECKING:
    from fecore.modal.series import Terms

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

WHOLE = 0.9
"""Of its lines that every FRF has where gaps are few."""

# lines up to which a band stays whole, the finest setting of most analysers; fewest of the lowest
# octave; most of an octave that is searched on them, and not on means
_UNDIVIDED, _FEWEST, _MOST_LINES = 3200, 150, 1500
_GAP = 10  # lines that may be missing in one place of a band that is divided
_BEYOND = 0.18  # of its ends by which an octave's window goes on beyond them
# of an end by which it is moved to where FRFs are smallest, and lines over which that is seen
_VALLEY, _SMOOTH = 0.1, 9
_LARGE = 0.95  # quantile of the values that are large
WIDE, NARROW, SHORT = 220, 75, 30  # lines of the windows
# of each window
ORDERS: dict[int, tuple[int, ...]] = {
    WIDE: (6, 12, 18, 24, 30),
    NARROW: (6, 10, 14, 18),
    SHORT: (3, 4, 5, 6, 8, 10),
}
_NEAR_0 = 3 * NARROW  # lines next to 0 Hz with short windows as well: modes are dense there
_MEANS = (4, 16)  # lines that are taken together
_INNER = 0.15  # of a window at each end, where another window sees more
_CIRCLE = 0.95  # of the circle that a window is mapped to
_CLOSE = 0.3  # distance over the half bandwidth within which two poles are one that came back
_OF_LINE = 0.05  # ... and over the line spacing
_TIMES = 3  # that a pole must come at least

RELATIVE = 0.02
"""What errors that grow with the FRF usually are, over it: where a hit lands, calibrations."""

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
    blocks: BlockSpectra | None = None  # of the one recording whose half spectra these are

    @cached_property
    def omega(self) -> FloatArray:
        """(L,) circular frequency of the lines, rad/s."""
        return 2 * np.pi * self.frequency_hz

    @cached_property
    def squares(self) -> FloatArray:
        """(N, L) |H|²."""
        return np.asarray(self.values.real**2 + self.values.imag**2)

    @cached_property
    def large(self) -> IntArray:
        """Places of the largest twentieth of the values, all FRFs one after the other."""
        return np.flatnonzero(self.squares >= np.quantile(self.squares, _LARGE))

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

    @property
    def known_noise(self) -> BoolArray:
        """(N, L) True for values whose noise variance was handed in."""
        return np.asarray(self.measured & np.isfinite(self.variance))

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
            blocks=self.blocks if mean == 1 else None,
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


def row_medians(rows: FloatArray) -> FloatArray:
    """(N,) median of each row without its NaNs, NaN of a row that is nothing else; numpy's own
    sorts masked arrays, slowly.
    """
    ordered = np.sort(rows, axis=1)  # NaN comes last
    count = np.sum(~np.isnan(rows), axis=1)
    at = np.arange(len(rows))
    low, high = (ordered[at, np.maximum(place, 0)] for place in ((count - 1) // 2, count // 2))
    return np.asarray(np.where(count > 0, low / 2 + high / 2, np.nan))


def counted(variance: FloatArray, usual: FloatArray | float) -> FloatArray:
    """What a value counts by its variance: 1, and less by the ratio where that is clearly larger
    than is usual.
    """
    return np.asarray(np.minimum(1.0, CLEAR**2 * usual / variance))


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


@dataclass(frozen=True)
class Part:
    """A part of a band, in which poles are searched alone."""

    arrangement: Arrangement  # a window of lines, or means of them, that goes on beyond its ends
    noise: FloatArray  # (N, L) variance of their noise
    ends_hz: tuple[float, float]  # between which it gives the poles

    def own(self, terms: Terms) -> ComplexArray:
        """Its poles among the terms, rad/s: those between its ends, or half a bandwidth beyond."""
        hz, width, (low, high) = terms.frequency_hz, terms.half_bandwidth_hz, self.ends_hz
        return terms.poles[(hz + width >= low) & (hz - width < high)]


def octaves(arrangement: Arrangement, noise: FloatArray) -> list[Part]:
    """The parts in which the poles of FRFs with a variance (N, L) of their noise are searched: the
    whole band where lines are few, or many are missing.

    A mode is as wide as its damping times its frequency. Over many octaves no window of lines suits
    all modes, and what a mode of the upper ones leaves hides those of the lower ones.
    """
    hz, lines = arrangement.frequency_hz, arrangement.frequency_hz.size
    gaps = np.diff(hz).max() > _GAP * arrangement.spacing_hz
    if lines <= _UNDIVIDED or gaps or arrangement.measured.mean(axis=1).min() < WHOLE:
        return [Part(arrangement, noise, (0.0, np.inf))]
    size = np.mean(np.log(np.abs(arrangement.values) + np.finfo(float).tiny), axis=0)
    size = scipy.ndimage.uniform_filter1d(size, _SMOOTH)
    ends, high = [np.inf], float(hz[-1]) / 2
    while np.searchsorted(hz, high) >= _FEWEST:
        first, last = np.searchsorted(hz, high * np.array([1 - _VALLEY, 1 + _VALLEY]))
        ends.append(float(hz[first + np.argmin(size[first:last])]))
        high /= 2
    parts = []
    for low, high in pairwise([0.0, *ends[::-1]]):
        start, stop = np.searchsorted(hz, [low * (1 - _BEYOND), high * (1 + _BEYOND)])
        window, mean = slice(start, stop), max(1, round((stop - start) / _MOST_LINES))
        own = means(noise[:, window], mean) / mean
        parts.append(Part(arrangement.on(window, mean), own, (low, high)))
    return parts


def proportional(weight: FloatArray) -> FloatArray | None:
    """(N,) the FRFs' weights over those of the first, where these are one function of frequency but
    for a factor.
    """
    share: FloatArray = weight.sum(axis=1) / weight[0].sum()
    expected = share[:, None] * weight[0]
    return share if np.all(np.abs(weight - expected) <= 1e-9 * expected) else None


@dataclass(frozen=True)
class LinearPoles:
    """Poles of all windows and orders, one entry a pole."""

    order: IntArray  # (k,) model order
    pole: ComplexArray  # (k,) with positive imaginary part, rad/s
    spacing: FloatArray  # (k,) distance of the lines that were used, rad/s

    def between(self, low: float, high: float) -> LinearPoles:
        """Those with a natural frequency from `low` to below `high`, Hz."""
        hz = np.abs(self.pole) / (2 * np.pi)
        own = (hz >= low) & (hz < high)
        return LinearPoles(self.order[own], self.pole[own], self.spacing[own])


def linear_estimates(arrangement: Arrangement, noise: FloatArray, highest: int) -> LinearPoles:
    """The poles of FRFs with a variance (N, L) of their noise, up to an order."""
    weight = _linear_weight(arrangement, noise)
    return linear_poles(arrangement.omega, arrangement.values, weight, highest)


def _linear_weight(arrangement: Arrangement, noise: FloatArray) -> FloatArray:
    """(N, L) weights of the linear stage: noise, and errors that grow with the FRF; alike for all
    where nothing is missing.
    """
    weight = np.where(
        arrangement.measured, 1 / (noise + RELATIVE**2 * np.abs(arrangement.values) ** 2), 0.0
    )
    return (
        np.broadcast_to(weight.mean(axis=0), weight.shape) if arrangement.measured.all() else weight
    )


def linear_poles(
    omega: FloatArray,
    values: ComplexArray,
    weight: FloatArray,
    highest: int,
    windows: tuple[int, ...] = (WIDE, NARROW),
) -> LinearPoles:
    """Poles of every order in every window.

    Args:
        omega: (L,) circular frequencies, rad/s.
        values: (M, L) FRFs, or what a fit leaves of them.
        weight: (M, L) weights w; 0 where nothing was measured.
        highest: largest order.
        windows: numbers of lines.
    """
    if weight.any(axis=1).all() and (share := proportional(weight)) is not None:
        values, weight = values * np.sqrt(share)[:, None], weight[:1]
    seen = [(omega, values, weight, size) for size in windows]
    seen.append((omega[:_NEAR_0], values[:, :_NEAR_0], weight[:, :_NEAR_0], SHORT))
    for lines in _MEANS:
        if omega.size >= lines * NARROW:
            seen.append((means(omega, lines), means(values, lines), means(weight, lines), WIDE))
    estimates = [poles for w, h, g, size in seen for poles in _in_windows(w, h, g, size, highest)]
    return LinearPoles(
        *(np.concatenate(each) for each in zip(*map(astuple, estimates), strict=True))
    )


def clusters(linear: LinearPoles) -> ComplexArray:
    """(c,) the medians of poles that came back, those that came most often first."""
    order = np.argsort(linear.pole.imag)
    pole = linear.pole[order]
    reach = np.maximum(_CLOSE * -pole.real, _OF_LINE * linear.spacing[order])
    # poles next in frequency that one is compared with: more than come near
    most = min(60, pole.size)
    near = np.zeros((2 * most + 1, pole.size), dtype=bool)
    near[most] = True
    for shift in range(1, min(most, pole.size - 1) + 1):
        close = np.abs(pole[shift:] - pole[:-shift]) < np.minimum(reach[shift:], reach[:-shift])
        near[most + shift, :-shift], near[most - shift, shift:] = close, close
    count, free = near.sum(axis=0), np.ones(pole.size, dtype=bool)
    parts, out = np.stack([pole.real, pole.imag], axis=1), []
    for k in np.argsort(-count, kind="stable"):
        if count[k] < _TIMES:
            break
        if free[k]:
            members = k + np.flatnonzero(near[:, k]) - most
            free[members] = False
            out.append(np.median(parts[members], axis=0))
    return np.array(out).reshape(-1, 2).view(np.complex128)[:, 0]


def _in_windows(
    omega: FloatArray, values: ComplexArray, weight: FloatArray, size: int, highest: int
) -> Iterator[LinearPoles]:
    """Poles of windows of so many lines that overlap, order by order; of each window those where no
    other sees more.
    """
    most, size, own = max(highest, ORDERS[size][0]), min(size, omega.size), ORDERS[size]
    orders = [n for n in own if n <= min(most, size // 3)] or [max(size // 3, 2)]
    count = int(np.ceil((omega.size - size) / ((1 - 2 * _INNER) * size))) + 1
    low, high = np.full((count, 1), _INNER), np.full((count, 1), 1 - _INNER)
    low[0], high[-1] = -1.0, 2.0  # beyond the band there is no other window
    lines = np.linspace(0, omega.size - size, count).round().astype(int)[:, None] + np.arange(size)
    first, span = omega[lines[:, :1]], omega[lines[:, -1:]] - omega[lines[:, :1]]
    period = 2 * np.pi * _CIRCLE / span
    h, g = np.moveaxis(values[:, lines], 1, 0), np.moveaxis(weight[:, lines], 1, 0)
    for z in _of_orders(h, g, np.exp(1j * (omega[lines] - first) * period), orders):
        turned = np.log(np.where(z == 0, np.nan, z))
        turned += np.where(turned.imag < -(1 - _CIRCLE) * np.pi, 2j * np.pi, 0)
        s = turned / period + 1j * first
        place = (s.imag - first) / span
        keep = (s.real < 0) & (-2 * s.real < span) & (s.imag > 0) & (place > low) & (place < high)
        spacing = np.broadcast_to(span / max(size - 1, 1), keep.shape)
        yield LinearPoles(np.full(int(keep.sum()), z.shape[1]), s[keep], spacing[keep])


def _of_orders(
    values: ComplexArray, weight: FloatArray, z: ComplexArray, orders: Sequence[int]
) -> Iterator[ComplexArray]:
    """(W, n) poles in z of W windows for every order n, from the moments of the largest: leading
    parts of one Cholesky factor serve all, and what an order adds is taken out once. 0 stands for
    none.

    Args:
        values: (W, M, l) FRFs.
        weight: (W, M, l), or (W, 1, l) where it is one of all.
        z: (W, l) lines on the circle.
        orders: ascending.
    """
    top = orders[-1]
    powers = np.cumprod(np.repeat(z[:, :, None], top, axis=2), axis=2)
    lags = np.concatenate([powers[..., ::-1].conj(), np.ones((*z.shape, 1)), powers], axis=2)
    shift = top + np.arange(top + 1) - np.arange(top + 1)[:, None]  # [r, s] -> moment of z^(s - r)
    power = np.sum(weight * np.abs(values) ** 2, axis=1, keepdims=True)
    R, T = ((each @ lags)[..., shift] for each in (weight, power))
    S = ((weight * values) @ lags)[..., shift]
    size = np.einsum("wmii->wm", R).real[..., None, None] / (top + 1)
    dead = size == 0
    size[dead] = 1.0
    R = R / size + np.where(dead, 1.0, 1e-12) * np.eye(top + 1)
    S = S / np.sqrt(size)
    if weight.shape[1] == 1:
        S = S.transpose(0, 2, 1, 3).reshape(len(z), 1, top + 1, -1)
    Y = np.linalg.inv(np.linalg.cholesky(R)) @ S
    Y = Y.transpose(0, 2, 1, 3).reshape(len(z), -1, top + 1)
    left, rows, begin = T[:, 0], Y.shape[1] // (top + 1), 0  # rows of Y to one of the factor
    for n in orders:
        own = Y[:, begin * rows : (n + 1) * rows]
        left, begin = left - own.conj().transpose(0, 2, 1) @ own, n + 1
        normal = left[:, : n + 1, : n + 1].copy()
        ridge = np.trace(normal, axis1=1, axis2=2).real / n
        flat = ~(ridge > 0)
        normal[:, np.arange(n), np.arange(n)] += np.where(flat, 1.0, 1e-13 * ridge)[:, None]
        companion = np.zeros((len(z), n, n), dtype=complex)
        companion[:, np.arange(1, n), np.arange(n - 1)] = 1.0
        companion[:, :, -1] = np.linalg.solve(normal[:, :n, :n], normal[:, :n, n:])[..., 0]
        yield np.asarray(np.linalg.eigvals(companion), dtype=complex)
