"""How good a calibrated probability is: what `calibrate` of poles and `calibrate_hits` of hits print alike."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from fecore.arrays import BoolArray, FloatArray


def scores(p: FloatArray, true: BoolArray) -> tuple[float, float]:
    """Log loss and Brier score."""
    p = np.clip(p, 1e-9, 1 - 1e-9)
    return float(-np.mean(np.where(true, np.log(p), np.log(1 - p)))), float(np.mean((p - true) ** 2))


def print_reliability(p: FloatArray, true: BoolArray, of: str, are: str, edges: Sequence[float]) -> None:
    """How often those of like P are what P says, between edges."""
    print(f"P from    to {of:>8}   mean P   share {are}")
    for low, high in pairwise((*edges, 1.0000001)):
        own = (p >= low) & (p < high)
        if own.any():
            share = true[own].mean()
            error = np.sqrt(max(share * (1 - share), 1 / own.sum()) / own.sum())
            print(f"{low:6.2f} {high:5.2f} {own.sum():8} {p[own].mean():8.4f} {share:10.4f} ± {error:.4f}")
