"""Which way FRFs turn: those of a structure that answers after the hit, or their conjugates.

With exp(+iωt) the phase of every stable resonance falls through 180°, whatever the sign of its residue: from line to line FRFs
turn clockwise. Programs that write exp(-iωt), or that conjugated the wrong channel of a cross spectrum, give the
conjugates. These turn the other way, and their impulse responses lie before the hit, which no passive structure does. The
sense is measured by

    q_i = Σ_l Im(H̄_i,l H_i,l+1) / Σ_l |H_i,l H_i,l+1|,

below 0 for FRF i as it should be. By Parseval's theorem the numerator is the sum of -sin(2πt/T) over the energy of the impulse
response in a record of length T.
"""

import numpy as np

from fecore.arrays import FloatArray
from fecore.modal.arrangement import Arrangement
from fecore.modal.leakage import leakage

_CLEAR = 3.0  # standard deviations of q for noise alone from which one FRF shows a sense
_MOST = 0.9  # share of the FRFs that turn the wrong way from which all are conjugates
_NOISE = 0.9  # standard deviation of q for complex Gaussian noise, times the root of its lines


def turned_backwards(arrangement: Arrangement) -> bool:
    """Whether the FRFs are conjugates: nearly all turn anti-clockwise from line to line, and most of them clearly."""
    kept, _ = leakage(arrangement)
    sense, clear = _sense(kept)
    return bool(np.mean(sense > 0) >= _MOST and np.median(clear) > _CLEAR)


def _sense(arrangement: Arrangement) -> tuple[FloatArray, FloatArray]:
    """(N,) q of each FRF, and how clear it is: the larger of q over that of noise, and its sum over the root of its squares.

    A few lines of a narrow resonance show it by size, many lines of a broad one by number.
    """
    both = arrangement.measured[:, 1:] & arrangement.measured[:, :-1]
    product = np.where(both, arrangement.values[:, 1:] * arrangement.values[:, :-1].conj(), 0)
    tiny = np.finfo(float).tiny
    turn = product.imag.sum(axis=1)
    sense = turn / np.maximum(np.abs(product).sum(axis=1), tiny)
    by_size = sense * np.sqrt(np.maximum(both.sum(axis=1), 1)) / _NOISE
    by_number = turn / np.maximum(np.sqrt(np.sum(product.imag**2, axis=1)), tiny)
    return sense, np.maximum(by_size, by_number)
