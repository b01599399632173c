"""Many FRFs as the few that carry all of their common content.

The FRFs of one structure are real combinations of as many functions of frequency as there are modes and residual terms, so N
FRFs
span few dimensions above their noise. With a_i the noise of FRF i, the rows H_i/a_i (real beside imaginary parts) have a
singular
value decomposition U S Vᵀ; its leading rows UᵀH/a are themselves FRFs with the same poles: real combinations keep the conjugate
symmetry of the series. Poles are searched in these; residues, covariance and verdicts come from all FRFs.
"""

from dataclasses import dataclass, replace

import numpy as np

from fecore.arrays import BoolArray, ComplexArray, FloatArray
from fecore.modal.arrangement import Arrangement

_MOST = 24  # combinations kept
_ENOUGH = 12  # FRFs up to which nothing is gained
_SHORT = 0.02  # of the lines: a gap up to here is bridged for the search
_BRIDGED = 0.5  # of the FRFs must be whole or bridged


@dataclass(frozen=True)
class Compressed:
    """Leading combinations of FRFs."""

    arrangement: Arrangement  # the combinations as if they were FRFs; its pairs name no true dofs
    mixing: FloatArray  # (r, N) real factors, combination = mixing @ FRFs
    source: Arrangement  # the FRFs

    def squares(self, square: FloatArray) -> FloatArray:
        """(r, L) what independent parts of the FRFs, with mean squares (N, L), have as mean squares in the combinations."""
        return square if len(self.mixing) == len(self.source.pairs) else np.asarray(self.mixing**2 @ square)


def compress(arrangement: Arrangement, noise: FloatArray) -> Compressed:
    """The leading combinations under a noise variance (N, L); all FRFs as they are where they are few or full of gaps."""
    rows = len(arrangement.pairs)
    identity = Compressed(arrangement, np.eye(rows), arrangement)
    if rows <= _ENOUGH:
        return identity
    values, bridged = _bridged(arrangement)
    if bridged.sum() < _BRIDGED * rows:
        return identity
    whole, noise = values[bridged], noise[bridged]
    own = np.sqrt(np.median(noise, axis=1))
    scaled = whole / own[:, None]
    weight = 1 / np.sqrt(np.mean(noise / own[:, None] ** 2 + np.abs(scaled) ** 2 * 1e-4, axis=0))
    flat = np.concatenate([scaled.real * weight, scaled.imag * weight], axis=1)
    value, vector = np.linalg.eigh(flat @ flat.T)
    kept = vector[:, ::-1][:, : _count(value[::-1], flat.shape[1])]
    mixing = np.zeros((kept.shape[1], rows))
    mixing[:, bridged] = kept.T / own
    if len(mixing) >= rows:
        return identity
    small = replace(
        arrangement,
        values=mixing @ values,
        measured=np.ones((len(mixing), arrangement.frequency_hz.size), dtype=bool),
        variance=np.full((len(mixing), arrangement.frequency_hz.size), np.nan),
        pairs=arrangement.pairs[: len(mixing)],
        row=arrangement.row[: len(mixing)],
        source=arrangement.source[: len(mixing)],
    )
    return Compressed(small, mixing, arrangement)


def _count(value: FloatArray, columns: int) -> int:
    """Combinations above the noise: eigenvalues over twice the edge (1 + √(N/columns))² of those of noise alone."""
    usual = float(np.median(value[len(value) // 2 :]))
    edge = 2 * usual * (1 + np.sqrt(len(value) / columns)) ** 2
    return int(np.clip(np.sum(value > edge), 4, _MOST))


def _bridged(arrangement: Arrangement) -> tuple[ComplexArray, BoolArray]:
    """The values with short gaps bridged by straight lines, and (N,) the FRFs in which that was possible."""
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
