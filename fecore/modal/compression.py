"""Many FRFs as the few that carry all of their common content.

The FRFs of one structure are real combinations of as many functions of frequency as there are modes
and residual terms, so N FRFs span few dimensions above their noise. With a_i the noise of FRF i,
the rows H_i/a_i (real beside imaginary parts) have a singular value decomposition U S Vᵀ; its
leading rows UᵀH/a are themselves FRFs with the same poles: real combinations keep the conjugate
symmetry of the series. Poles are searched in these; residues, covariance and verdicts come from all
FRFs.
"""

from dataclasses import replace

import numpy as np

from fecore.arrays import BoolArray, ComplexArray, FloatArray
from fecore.modal.arrangement import Arrangement

_MOST = 24  # combinations kept
_ENOUGH = 12  # FRFs up to which nothing is gained
_SHORT = 0.02  # of the lines: a gap up to here is bridged for the search
_BRIDGED = 0.5  # of the FRFs must be whole or bridged


def compress(arrangement: Arrangement, noise: FloatArray) -> tuple[Arrangement, FloatArray]:
    """The leading combinations under a noise variance (N, L), as if they were FRFs, and the (r, L)
    variance of their noise.

    Their pairs name no true dofs. FRFs that are few or full of gaps stay as they are.
    """
    rows = len(arrangement.pairs)
    if rows <= _ENOUGH:
        return arrangement, noise
    values, bridged = _bridged(arrangement)
    if bridged.sum() < _BRIDGED * rows:
        return arrangement, noise
    own = np.sqrt(np.median(noise[bridged], axis=1))
    scaled = values[bridged] / own[:, None]
    weight = 1 / np.sqrt(
        np.mean(noise[bridged] / own[:, None] ** 2 + np.abs(scaled) ** 2 * 1e-4, axis=0)
    )
    flat = np.concatenate([scaled.real * weight, scaled.imag * weight], axis=1)
    value, vector = np.linalg.eigh(flat @ flat.T)
    count = _count(value[::-1], flat.shape[1])
    if count >= rows:
        return arrangement, noise
    mixing = np.zeros((count, rows))
    mixing[:, bridged] = vector[:, ::-1][:, :count].T / own
    few = replace(
        arrangement,
        values=mixing @ values,
        measured=np.ones((count, arrangement.frequency_hz.size), dtype=bool),
        variance=np.full((count, arrangement.frequency_hz.size), np.nan),
        pairs=arrangement.pairs[:count],
        row=arrangement.row[:count],
        source=arrangement.source[:count],
    )
    return few, np.asarray(mixing**2 @ noise)


def _count(value: FloatArray, columns: int) -> int:
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
