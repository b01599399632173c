"""A plain poly-reference least-squares complex frequency estimator, by which the time of `identify`
is measured: poles of the orders to 60, and nothing else.

With m references, real m x m matrices A_r and z = exp(i(ω - ω₀)T), T such that the band is half a
turn, the row H_o of each response is taken as B_o(z) A(z)⁻¹,

    H_o Σ_r A_r z^r - Σ_r β_or z^r  small,    r = 0 … n,    A_n = 1,

and the β_o are eliminated (Guillaume and others 2003). There are no weights, no windows, and no
choice of what is a mode.
"""

import numpy as np
import scipy

from fecore.frf import FrfSet

HIGHEST = 60
"""Of the orders."""


def plain_poles(frfs: FrfSet) -> list[np.ndarray]:
    """The poles of every order, rad/s."""
    rows, omega = _rows(frfs), 2 * np.pi * frfs.frequency_hz
    m, size = rows.shape[1], HIGHEST + 1
    period = np.pi / (omega[-1] - omega[0])
    lags = np.exp(1j * period * np.outer(omega - omega[0], np.arange(1 - size, size)))
    shift = size - 1 + np.arange(size) - np.arange(size)[:, None]
    factor = scipy.linalg.cho_factor(lags.sum(axis=0).real[shift])
    powers = np.einsum("oil,ojl->ijl", rows.conj(), rows) @ lags
    normal = powers.real[:, :, shift].transpose(2, 0, 3, 1).reshape(size * m, size * m)
    for each in rows:
        cross = (each @ lags).real[:, shift].transpose(1, 2, 0).reshape(size, size * m)
        normal -= cross.T @ scipy.linalg.cho_solve(factor, cross)
    return [
        np.log(z.astype(complex)) / period + 1j * omega[0]
        for z in (_roots(normal, n * m, m) for n in range(1, size))
    ]


def _roots(normal: np.ndarray, count: int, m: int) -> np.ndarray:
    """Eigenvalues z of the companion matrix of the denominator with so many poles."""
    last = np.linalg.lstsq(normal[:count, :count], -normal[:count, count : count + m], rcond=None)
    companion = np.eye(count, k=m)
    companion[-m:] = last[0].T
    return np.asarray(np.linalg.eigvals(companion))


def _rows(frfs: FrfSet) -> np.ndarray:
    """(o, m, L) the FRFs by the fewer of their dofs, where all pairs were measured; else each by
    itself.
    """
    sides = [sorted(set(side)) for side in (frfs.responses, frfs.references)]
    long, short = sides if len(sides[0]) >= len(sides[1]) else sides[::-1]
    if len(long) * len(short) != len(frfs.values):
        return frfs.values[:, None]
    pairs = [*zip(frfs.responses, frfs.references, strict=True)]
    place = {pair: number for number, pair in enumerate(pairs)}
    turned = long is not sides[0]
    return np.array(
        [[frfs.values[place[(b, a) if turned else (a, b)]] for b in short] for a in long]
    )
