"""The weights of `probability`, as `python -m benchmarks calibrate` fitted them."""

from __future__ import annotations

import numpy as np

PRIOR_MEAN = np.array([3.2, 1.15, 6.9, 1.2, 9.0, 4.0, 4.0])
"""Of b₀ … b₆, from a first fit to measured and made sets."""

PRIOR_SD = np.array([1.0, 0.7, 2.4, 0.6, 3.0, 1.0, 1.0])

MEAN = PRIOR_MEAN
COVARIANCE = np.diag((0.2 * PRIOR_SD) ** 2)
