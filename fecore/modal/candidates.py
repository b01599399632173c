"""Candidates for poles: linear estimates (LSCF) in windows of the band, from the few combinations of
the FRFs that carry all of their common content, and the poles that come back.

The FRFs of one structure are real combinations of as many functions of frequency as there are modes
and residual terms, so N FRFs span few dimensions above their noise. With a_i the noise of FRF i,
the rows H_i/a_i (real beside imaginary parts) have a singular value decomposition U S Vᵀ; its
leading rows UᵀH/a are themselves FRFs with the same poles: real combinations keep the conjugate
symmetry of the series. Poles are searched in these; residues, covariance and verdicts come from all
FRFs.

In a window of lines the M rows of FRFs share a denominator of order n with
complex coefficients, in z = exp(i(ω - ω₀)T), which maps the window to 0.95 of the circle:

    H_m(z) = (Σ_r β_mr z^r) / (Σ_r α_r z^r),    r = 0 … n,    α_n = 1,

and Σ_r β_mr z^r - H_m Σ_r α_r z^r is made small in the weighted least-squares sense (Guillaume,
Verboven and Vanlanduit 1998). The β_m are eliminated; the poles are the eigenvalues of the
companion matrix of the α. Complex coefficients spare the mirror poles and let the numerators stand
for all that lies outside the window. All inner products are Toeplitz in r: moments Σ_l w (...) z^k.
Windows of 220 and of 75 lines see modes of some lines; the same windows on the means of 4 and of 16
lines see broad ones. A pole of the structure comes back from order to order and from window to
window; the median of such a cluster is a candidate. The estimate is biased by noise: it is a start
for the refinement and the stuff of the stabilisation diagram, nothing more.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass, replace

import numpy as np

from fecore.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from fecore.modal.arrangement import Arrangement, means
from fecore.modal.series import proportional

_MOST = 24  # combinations kept
_SHORT = 0.02  # of the lines: a gap up to here is bridged for the search
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


def compress(arrangement: Arrangement, noise: FloatArray) -> tuple[Arrangement, FloatArray]:
    """The leading combinations under a noise variance (N, L), as if they were FRFs, and the (r, L)
    variance of their noise.

    Their pairs name no true dofs. FRFs that are few or full of gaps stay as they are.
    """
    rows = len(arrangement.pairs)
    if rows <= _MOST // 2:  # nothing is gained
        return arrangement, noise
    values, bridged = _bridged(arrangement)
    if 2 * bridged.sum() < rows:
        return arrangement, noise
    own = np.sqrt(np.median(noise[bridged], axis=1))
    scaled = values[bridged] / own[:, None]
    weight = 1 / np.sqrt(
        np.mean(noise[bridged] / own[:, None] ** 2 + np.abs(scaled) ** 2 * 1e-4, axis=0)
    )
    flat = np.concatenate([scaled.real * weight, scaled.imag * weight], axis=1)
    value, vector = np.linalg.eigh(flat @ flat.T)
    count = _rank(value[::-1], flat.shape[1])
    if count >= rows:
        return arrangement, noise
    mixing = np.zeros((count, rows))
    mixing[:, bridged] = vector[:, ::-1][:, :count].T / own
    few = replace(
        arrangement,
        values=mixing @ values,
        measured=np.ones((count, arrangement.frequency_hz.size), dtype=bool),
        variance=np.full((count, arrangement.frequency_hz.size), np.nan),
        growth=np.full((count, arrangement.frequency_hz.size), np.nan, dtype=complex),
        pairs=arrangement.pairs[:count],
        row=arrangement.row[:count],
        source=arrangement.source[:count],
    )
    return few, np.asarray(mixing**2 @ noise)


def _rank(value: FloatArray, columns: int) -> int:
    """Combinations above the noise: eigenvalues over twice the edge (1 + √(N/columns))² of those of
    noise alone.
    """
    usual = float(np.median(value[len(value) // 2 :]))
    edge = 2 * usual * (1 + np.sqrt(len(value) / columns)) ** 2
    return int(np.clip(np.sum(value > edge), 4, _MOST))


def _bridged(arrangement: Arrangement) -> tuple[ComplexArray, BoolArray]:
    """The values with short gaps bridged by straight lines, and (N,) the FRFs in which that was
    possible.
    """
    gaps = ~arrangement.measured
    fine = np.ones(len(gaps), dtype=bool)
    if not gaps.any():
        return arrangement.values, fine
    values = arrangement.values.copy()
    line = np.arange(arrangement.frequency_hz.size)
    longest = max(2, _SHORT * line.size)
    for row in np.flatnonzero(gaps.any(axis=1)):
        known = np.concatenate([[-1], line[~gaps[row]], [line.size]])
        fine[row] = np.diff(known).max() <= longest + 1
        if fine[row]:
            values[row] = np.interp(line, known[1:-1], values[row, known[1:-1]])
    return values, fine


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
    out = []
    for k in np.argsort(-count, kind="stable"):
        if count[k] < _TIMES:
            break
        if free[k]:
            members = k + np.flatnonzero(near[:, k]) - most
            free[members] = False
            out.append(np.median(pole[members].real) + 1j * np.median(pole[members].imag))
    return np.array(out, dtype=complex)


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
