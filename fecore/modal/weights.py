"""The weights of `probability`, of 26 November 2026; `python -m benchmarks calibrate` fits them and judges them.

Fitted to 1,244 poles of made sets, 705 of them modes (seeds 5000 to 5009). The prior means of constant, rise and share are
those of an earlier fit to measured and made sets. That of the damping is the exponent of Cauchy's law. The chance of a second
mode within d goes with d, so that of the distance is at least 0.5. For two modes at n independent points p(1 - M) goes as
(1 - M)^(n/2 - 3/2), M their MAC; for one shape seen twice it ends at the errors. So that of the shape is about ln 10 (n - 1)/2,
with its share of what is known of the distance: 4, as for four or five points, ± 3.
"""

import numpy as np

PRIOR_MEAN = np.array([3.2, 1.15, 6.9, 1.0, 1.0, 4.0, 1.0])
"""Of b₀ … b₆: constant, rise, share, damping, apart, shape, reach."""

PRIOR_SD = np.array([1.0, 0.7, 2.4, 0.6, 3.0, 3.0, 3.0])

MEAN = np.array([3.340, 1.078, 6.699, 0.620, 9.573, 8.624, 5.315])

COVARIANCE = np.array(
    [
        [0.5940, -0.1329, 0.2868, 0.0942, 0.2071, 0.2424, 0.1392],
        [-0.1329, 0.1120, 0.0190, -0.0058, 0.1287, 0.0386, 0.0821],
        [0.2868, 0.0190, 1.1979, 0.0269, 0.0350, 0.0673, -0.0481],
        [0.0942, -0.0058, 0.0269, 0.0559, 0.0424, 0.0404, -0.0014],
        [0.2071, 0.1287, 0.0350, 0.0424, 2.1544, 0.2777, 0.2544],
        [0.2424, 0.0386, 0.0673, 0.0404, 0.2777, 2.0983, 0.1908],
        [0.1392, 0.0821, -0.0481, -0.0014, 0.2544, 0.1908, 0.8267],
    ]
)
