"""The weights of `probability`, of 25 November 2026; `python -m benchmarks calibrate` fits them and judges them.

Fitted to 1,175 poles of made sets, 645 of them modes (seeds 5000 to 5009). The prior means of constant, rise and share are
those of an earlier fit to measured and made sets. That of the damping is the exponent of Cauchy's law. For the distance, the
chance of a second mode within d goes with d, so the logit has ln d = 2.3 lg d at least.
"""

from __future__ import annotations

import numpy as np

PRIOR_MEAN = np.array([3.2, 1.15, 6.9, 1.0, 2.3, 1.0])
"""Of b₀ … b₅: constant, rise, share, damping, apart, reach."""

PRIOR_SD = np.array([1.0, 0.7, 2.4, 0.6, 3.0, 3.0])

MEAN = np.array([3.612, 1.153, 6.699, 0.738, 9.234, 5.627])

COVARIANCE = np.array(
    [
        [0.6378, -0.1336, 0.3072, 0.1045, 0.1992, 0.1640],
        [-0.1336, 0.1135, 0.0156, -0.0108, 0.1149, 0.0877],
        [0.3072, 0.0156, 1.1372, 0.0381, 0.0466, -0.0465],
        [0.1045, -0.0108, 0.0381, 0.0492, 0.0389, 0.0008],
        [0.1992, 0.1149, 0.0466, 0.0389, 1.2641, 0.2438],
        [0.1640, 0.0877, -0.0465, 0.0008, 0.2438, 0.8916],
    ]
)
