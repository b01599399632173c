"""How good a calibrated probability is: what `calibrate` of poles and `calibrate_hits` of hits
print alike.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from benchmarks.tables import Table
from fecore.arrays import BoolArray, FloatArray


def scores(p: FloatArray, true: BoolArray) -> tuple[float, float]:
    """Log loss and Brier score."""
    p = np.clip(p, 1e-9, 1 - 1e-9)
    return float(-np.mean(np.where(true, np.log(p), np.log(1 - p)))), float(
        np.mean((p - true) ** 2)
    )


def print_reliability(
    p: FloatArray, true: BoolArray, of: str, are: str, edges: Sequence[float]
) -> None:
    """How often those of like P are what P says, between edges."""
    table = Table("", "P from:6", "to:.2f", f"{of}:d", "mean P:.4f", f"share {are}:.4f", "±:.4f")
    for low, high in pairwise((*edges, 1.0000001)):
        own = (p >= low) & (p < high)
        if own.any():
            share = true[own].mean()
            error = np.sqrt(max(share * (1 - share), 1 / own.sum()) / own.sum())
            table.row(low, high, own.sum(), p[own].mean(), share, error)
