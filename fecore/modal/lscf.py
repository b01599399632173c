"""Linear stage: least-squares complex frequency estimates (LSCF) in windows of the band, and the
poles that come back.

In a window of lines the M rows of FRFs share a denominator of order n with complex coefficients, in
z = exp(i(ω - ω₀)T), which maps the window to 0.95 of the circle:

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

from dataclasses import dataclass

import numpy as np
import scipy

from fecore.arrays import ComplexArray, FloatArray, IntArray

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
_BROADEST = 0.5  # of a window that a pole's half bandwidth may take


@dataclass(frozen=True)
class LinearPoles:
    """Poles of all windows and orders, one entry a pole."""

    order: IntArray  # (k,) model order
    pole: ComplexArray  # (k,) with positive imaginary part, rad/s
    spacing: FloatArray  # (k,) distance of the lines that were used, rad/s


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
    found: list[tuple[int, ComplexArray, float]] = []
    for lines in _MEANS:
        if lines > 1 and omega.size < lines * NARROW:
            break
        w, h, g = (omega, values, weight) if lines == 1 else _means(omega, values, weight, lines)
        for size in windows if lines == 1 else (WIDE,):
            orders = tuple(n for n in ORDERS[size] if n <= max(highest, ORDERS[size][0]))
            for part in _parts(w.size, size):
                found += _in_window(w, h, g, part, orders)
        if lines == 1:
            near = min(w.size, _NEAR_0)
            for part in _parts(near, SHORT):
                found += _in_window(w[:near], h[:, :near], g[:, :near], part, ORDERS[SHORT])
    counts = [pole.size for _, pole, _ in found]
    return LinearPoles(
        order=np.repeat(np.array([order for order, _, _ in found], dtype=np.int64), counts),
        pole=np.concatenate([np.empty(0, dtype=complex), *(pole for _, pole, _ in found)]),
        spacing=np.repeat(np.array([spacing for _, _, spacing in found]), counts),
    )


def clusters(found: LinearPoles) -> ComplexArray:
    """(c,) the medians of poles that came back, those that came most often first."""
    order = np.argsort(found.pole.imag)
    pole = found.pole[order]
    reach = np.maximum(_CLOSE * -pole.real, _OF_LINE * found.spacing[order])
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
    whole = omega.size // lines * lines

    def taken(each: np.ndarray) -> np.ndarray:
        return np.asarray(each[..., :whole].reshape(*each.shape[:-1], -1, lines).mean(axis=-1))

    return taken(omega), taken(values), taken(weight)


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
    orders: tuple[int, ...],
) -> list[tuple[int, ComplexArray, float]]:
    """Order, poles (rad/s) and line spacing, order by order."""
    lines, low, high = part
    w, h, g = omega[lines], values[:, lines], weight[:, lines]
    span = float(w[-1] - w[0])
    top = [n for n in orders if n <= w.size // 3] or [max(w.size // 3, 2)]
    period = 2 * np.pi * _CIRCLE / span
    found = []
    for n, z in _of_orders(h, g, np.exp(1j * (w - w[0]) * period), top):
        turned = np.log(z)
        turned = np.where(turned.imag < -(1 - _CIRCLE) * np.pi, turned + 2j * np.pi, turned)
        s = turned / period + 1j * w[0]
        place = (s.imag - w[0]) / span
        keep = (
            (s.real < 0)
            & (-s.real < _BROADEST * span)
            & (s.imag > 0)
            & (place > low)
            & (place < high)
        )
        found.append((n, s[keep], span / max(w.size - 1, 1)))
    return found


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
