"""The weights of `probability`, of 26 November 2026; `python -m benchmarks calibrate` fits them and
judges them.

Fitted to 1,286 poles of made sets, 729 of them modes (seeds 5000 to 5009). The prior means of
constant, rise and share are those of an earlier fit to measured and made sets, that of the damping
is the exponent of Cauchy's law. A fit gives up what the weights in use refuse beside a better pole,
so the poles that it leaves say little of the distance: its prior is the fit before this one. For
two modes at n independent points p(1 - M) goes as (1 - M)^(n/2 - 3/2), M their MAC; for one shape
seen twice it ends at the errors. So that of the shape is about ln 10 (n - 1)/2, with its share of
what is known of the distance: 4, as for four or five points, ± 3.
"""

import numpy as np

PRIOR_MEAN = np.array([3.2, 1.15, 6.9, 1.0, 9.6, 4.0, 1.0])
"""Of b₀ … b₆: constant, rise, share, damping, apart, shape, reach."""

PRIOR_SD = np.array([1.0, 0.7, 2.4, 0.6, 1.5, 3.0, 3.0])

MEAN = np.array([3.090, 1.268, 6.738, 0.599, 9.256, 7.070, 5.746])

COVARIANCE = np.array(
    [
        [0.5663, -0.1364, 0.2776, 0.0964, 0.0234, 0.1834, 0.1282],
        [-0.1364, 0.0990, 0.0186, -0.0023, 0.0098, 0.0530, 0.0973],
        [0.2776, 0.0186, 1.1681, 0.0402, -0.0127, 0.1042, -0.0238],
        [0.0964, -0.0023, 0.0402, 0.0639, -0.0089, 0.0277, 0.0050],
        [0.0234, 0.0098, -0.0127, -0.0089, 2.2366, -0.0624, -0.0108],
        [0.1834, 0.0530, 0.1042, 0.0277, -0.0624, 2.1577, 0.1386],
        [0.1282, 0.0973, -0.0238, 0.0050, -0.0108, 0.1386, 1.2628],
    ]
)
