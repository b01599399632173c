"""The weights of `probability`, of 25 November 2026; `python -m benchmarks calibrate` fits them and judges them.

Fitted to 1,175 poles of made sets, 645 of them modes (seeds 5000 to 5009). The prior means of constant, rise and share are
those of an earlier fit to measured and made sets. That of the damping is the exponent of Cauchy's law. The chance of a second
mode within d goes with d, so that of the distance is at least 0.5.
"""

from __future__ import annotations

import numpy as np

PRIOR_MEAN = np.array([3.2, 1.15, 6.9, 1.0, 1.0, 1.0])
"""Of b₀ … b₅: constant, rise, share, damping, apart, reach."""

PRIOR_SD = np.array([1.0, 0.7, 2.4, 0.6, 3.0, 3.0])

MEAN = np.array([3.466, 1.218, 6.960, 0.815, 10.023, 5.567])

COVARIANCE = np.array(
    [
        [0.6041, -0.1242, 0.3020, 0.0994, 0.2398, 0.1682],
        [-0.1242, 0.1085, 0.0209, -0.0078, 0.1191, 0.0813],
        [0.3020, 0.0209, 1.1597, 0.0395, 0.0675, -0.0517],
        [0.0994, -0.0078, 0.0395, 0.0488, 0.0376, 0.0005],
        [0.2398, 0.1191, 0.0675, 0.0376, 2.0837, 0.2574],
        [0.1682, 0.0813, -0.0517, 0.0005, 0.2574, 0.9073],
    ]
)
