"""Which pole of a fit is which mode of a draw: the truth that probabilities are judged by.

Pole k and mode m are alike by

    S = MAC(R_k, R_m) · exp(-½(Δf/w)² - ½(ln ζ_k/ζ_m / ln 3)²),    w = max(0.004, ζ_m/2) f_m,

R their residues over the FRFs. The assignment that makes the sum of S largest gives each mode at
most one pole and each pole at most one mode (Kuhn's assignment problem); pairs below 0.1 are none.
A pole left over within 2w of a mode that has its own, with a damping within a factor of 3, takes
part in the response of that mode. The highest of such a group, of those with S >= 0.1, is the mode;
the others are `SPLIT`, no modes of their own, but nothing was invented either. For the weights and
scores they count as no modes, as a user would have one mode twice.
"""

import numpy as np
import scipy

from benchmarks.made_frfs import Draw
from fecore.correlation import mac
from fecore.modal.arrangement import Arrangement
from fecore.modal.refine import LinearFit

OTHER, SPLIT, OPTIONAL = -1, -2, -3
"""In place of the number of a mode: neither; a second pole on a mode; a mode that may be lost."""

_NEAR = 0.004
_RATIO = np.log(3)
_LEAST = 0.1


def modes_of_poles(draw: Draw, arrangement: Arrangement, fit: LinearFit) -> np.ndarray:
    """(n,) number of the mode that each pole is, or why it is none."""
    hz, zeta = fit.terms.frequency_hz, fit.terms.damping_ratio
    of = np.full(hz.size, OTHER)
    if not draw.frequency_hz.size or not hz.size:
        return of
    width = np.maximum(_NEAR, draw.zeta / 2) * draw.frequency_hz
    off = np.abs(hz[:, None] - draw.frequency_hz) / width
    ratio = np.abs(np.log(zeta[:, None] / draw.zeta)) / _RATIO
    alike = mac(fit.residues.T, draw.residue[:, arrangement.source]) * np.exp(
        -(off**2 + ratio**2) / 2
    )
    near = (off < 2) & (ratio < 1)
    pairs = [
        (k, m)
        for k, m in zip(*scipy.optimize.linear_sum_assignment(alike, maximize=True), strict=True)
    ]
    pairs = [(k, m) for k, m in pairs if alike[k, m] >= _LEAST]
    height = np.linalg.norm(fit.residues, axis=0) / (hz * zeta)
    of[near[:, [m for _, m in pairs]].any(axis=1)] = SPLIT
    of[[k for k, _ in pairs]] = [m for _, m in pairs]
    for k, m in pairs:
        group = np.append(np.flatnonzero((of == SPLIT) & near[:, m] & (alike[:, m] >= _LEAST)), k)
        of[k] = SPLIT
        of[group[np.argmax(height[group])]] = OPTIONAL if draw.optional[m] else m
    return of
