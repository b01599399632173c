"""The weights of `probability`, of 25 November 2026; `python -m benchmarks calibrate` fits them and judges them.

Fitted to 1,036 poles of made sets, 547 of them modes (seeds 5000 to 5009). The prior means of constant, rise and share are
those of an earlier fit to measured and made sets. That of the damping is the exponent of Cauchy's law. For the distance, the
chance of a second mode within d goes with d, so the logit has ln d = 2.3 lg d at least. Repeat and growth are the prior's.
"""

from __future__ import annotations

import numpy as np

PRIOR_MEAN = np.array([3.2, 1.15, 6.9, 1.0, 2.3, 1.0, 4.0, 4.0])
"""Of b₀ … b₇: constant, rise, share, damping, apart, reach, repeat, growth."""

PRIOR_SD = np.array([1.0, 0.7, 2.4, 0.6, 3.0, 3.0, 1.0, 1.0])

MEAN = np.array([3.046, 1.413, 7.579, 0.920, 8.894, 5.626, 4.0, 4.0])

COVARIANCE = np.array(
    [
        [0.6677, -0.1515, 0.2672, 0.0984, 0.1946, 0.1642, 0.0, 0.0],
        [-0.1515, 0.1369, 0.0756, 0.0065, 0.1380, 0.1028, 0.0, 0.0],
        [0.2672, 0.0756, 1.9608, 0.0262, -0.0183, -0.0741, 0.0, 0.0],
        [0.0984, 0.0065, 0.0262, 0.0720, 0.0738, 0.0021, 0.0, 0.0],
        [0.1946, 0.1380, -0.0183, 0.0738, 1.3300, 0.2559, 0.0, 0.0],
        [0.1642, 0.1028, -0.0741, 0.0021, 0.2559, 1.1223, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
    ]
)
