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

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from fecore.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from fecore.modal.arrangement import Arrangement, means

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
_MEANS = (1, 4, 16)  # lines that are taken together
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
    near = min(omega.size, _NEAR_0)
    whole, start = (omega, values, weight), (omega[:near], values[:, :near], weight[:, :near])
    means = [_means(*whole, lines) for lines in _MEANS[1:] if omega.size >= lines * NARROW]
    orders = {
        size: [n for n in each if n <= max(highest, each[0])] for size, each in ORDERS.items()
    }
    estimates = [
        estimate
        for (w, h, g), size, own in (
            *((whole, size, orders[size]) for size in windows),
            (start, SHORT, ORDERS[SHORT]),
            *((mean, WIDE, orders[WIDE]) for mean in means),
        )
        for part in _parts(w.size, size)
        for estimate in _in_window(w, h, g, part, own)
    ]
    counts = [pole.size for _, pole, _ in estimates]
    return LinearPoles(
        order=np.repeat(np.array([order for order, _, _ in estimates], dtype=np.int64), counts),
        pole=np.concatenate([np.empty(0, dtype=complex), *(pole for _, pole, _ in estimates)]),
        spacing=np.repeat(np.array([spacing for _, _, spacing in estimates]), counts),
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


def _means(
    omega: FloatArray, values: ComplexArray, weight: FloatArray, lines: int
) -> tuple[FloatArray, ComplexArray, FloatArray]:
    """The same with as many neighbouring lines as that in one."""
    return means(omega, lines), means(values, lines), means(weight, lines)


def _parts(lines: int, size: int) -> list[tuple[slice, float, float]]:
    """Windows with the shares of their lines between which a pole is theirs."""
    if lines <= size:
        return [(slice(0, lines), -1.0, 2.0)]
    count = int(np.ceil((lines - size) / ((1 - 2 * _INNER) * size))) + 1
    starts = np.linspace(0, lines - size, count).round().astype(int)
    low, high = np.full(count, _INNER), np.full(count, 1 - _INNER)
    low[0], high[-1] = -1.0, 2.0  # beyond the band there is no other window
    return [(slice(s, s + size), a, b) for s, a, b in zip(starts, low, high, strict=True)]


def _in_window(
    omega: FloatArray,
    values: ComplexArray,
    weight: FloatArray,
    part: tuple[slice, float, float],
    orders: Sequence[int],
) -> list[tuple[int, ComplexArray, float]]:
    """Order, poles (rad/s) and line spacing, order by order."""
    lines, low, high = part
    w, h, g = omega[lines], values[:, lines], weight[:, lines]
    span = float(w[-1] - w[0])
    top = [n for n in orders if n <= w.size // 3] or [max(w.size // 3, 2)]
    period = 2 * np.pi * _CIRCLE / span
    out = []
    for n, z in _of_orders(h, g, np.exp(1j * (w - w[0]) * period), top):
        turned = np.log(z)
        turned = np.where(turned.imag < -(1 - _CIRCLE) * np.pi, turned + 2j * np.pi, turned)
        s = turned / period + 1j * w[0]
        place = (s.imag - w[0]) / span
        keep = (s.real < 0) & (-2 * s.real < span) & (s.imag > 0) & (place > low) & (place < high)
        out.append((n, s[keep], span / max(w.size - 1, 1)))
    return out


def _of_orders(
    values: ComplexArray, weight: FloatArray, z: ComplexArray, orders: list[int]
) -> list[tuple[int, ComplexArray]]:
    """Poles in z for every order, from the moments of the largest: leading parts of one Cholesky
    factor serve all.
    """
    top = orders[-1]
    lags = z[:, None] ** np.arange(-top, top + 1)
    shift = top + np.arange(top + 1) - np.arange(top + 1)[:, None]  # [r, s] -> moment of z^(s - r)
    alike = np.all(weight == weight[0])
    R = ((weight[:1] if alike else weight) @ lags)[:, shift]
    S = ((weight * values) @ lags)[:, shift]
    T = (np.sum(weight * np.abs(values) ** 2, axis=0) @ lags)[shift]
    size = np.einsum("mii->m", R).real / (top + 1)
    alive = size > 0
    if not alive.any():
        return []
    R = R[alive] / size[alive, None, None] + 1e-12 * np.eye(top + 1)
    S = (S if alike else S[alive]) / np.sqrt(size[alive, None, None])
    try:
        root = np.linalg.cholesky(R)
    except np.linalg.LinAlgError:
        return []
    if alike:
        Y = scipy.linalg.solve_triangular(
            root[0], S.transpose(1, 0, 2).reshape(top + 1, -1), lower=True, check_finite=False
        )
        Y = Y.reshape(top + 1, -1, top + 1)
    else:
        Y = np.linalg.solve(root, S).transpose(1, 0, 2)
    out: list[tuple[int, ComplexArray]] = []
    for n in orders:
        own = Y[: n + 1, :, : n + 1].reshape(-1, n + 1)
        normal = T[: n + 1, : n + 1] - own.conj().T @ own
        ridge = 1e-13 * np.trace(normal).real / n * np.eye(n)
        try:
            alpha = np.linalg.solve(normal[:n, :n] + ridge, -normal[:n, n])
        except np.linalg.LinAlgError:
            continue
        companion = np.eye(n, k=-1, dtype=complex)
        companion[:, -1] = -alpha
        if np.all(np.isfinite(alpha)):
            roots = np.linalg.eigvals(companion)
            out.append((n, np.asarray(roots[np.abs(roots) > np.finfo(float).tiny], dtype=complex)))
    return out
