"""Which way FRFs turn: those of a structure that answers after the hit, or their conjugates.

With exp(+iωt) the phase of every stable resonance falls through 180°, whatever the sign of its
residue: from line to line FRFs turn clockwise. Programs that write exp(-iωt), or that conjugated
the wrong channel of a cross spectrum, give the conjugates. These turn the other way, and their
impulse responses lie before the hit, which no passive structure does. The sense is measured by

    z_i = √(2/L) Σ_l Im(H̄_i,l H_i,l+1)/v_i,l,    v the noise as the lines scatter,

standard normal for noise alone, and below 0 for FRF i as it should be. By Parseval's theorem the
sum without v is that of -sin(2πt/T) over the energy of the impulse response in a record of length
T. Leakage next to 0 Hz turns either way, and scatters from line to line as noise does.
"""

import numpy as np

from fecore.modal.arrangement import Arrangement
from fecore.modal.noise import scatter_of

_CLEAR = 5.0  # z from which the sense is clear


def turned_backwards(arrangement: Arrangement) -> bool:
    """Whether the FRFs are conjugates: from line to line most of them turn anti-clockwise, clearly
    above their noise.
    """
    values = arrangement.values / np.sqrt(scatter_of(arrangement))
    both = arrangement.measured[:, 1:] & arrangement.measured[:, :-1]
    turn = np.sum(np.where(both, values[:, 1:] * values[:, :-1].conj(), 0).imag, axis=1)
    return bool(np.median(turn / np.sqrt(np.maximum(both.sum(axis=1), 1) / 2)) > _CLEAR)
