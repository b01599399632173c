"""The weights of `probability`, of 24 November 2026; `python -m benchmarks calibrate` fits them and judges them.

They are prior means taken over from an earlier prototype: fitted there to 1,138 poles of measured and made sets, of which
152 were no modes, with a phase law of another form; they were not fitted again to those poles. A fit to 434 poles of made
sets alone with these as the prior (constant 1.2, rise 1.0, share 9.9, damping 1.3, twin 3.9) does hardly better on 367
others (Brier 0.020 against 0.023) and doubts weak true modes, so they stay until measured sets speak.
"""

from __future__ import annotations

import numpy as np

PRIOR_MEAN = np.array([3.2, 1.15, 6.9, 1.2, 9.0, 4.0, 4.0])
"""Of b₀ … b₆: constant, rise, share, damping, twin, repeat, growth."""

PRIOR_SD = np.array([1.0, 0.7, 2.4, 0.6, 3.0, 1.0, 1.0])

MEAN = PRIOR_MEAN
COVARIANCE = np.diag((0.2 * PRIOR_SD) ** 2)
"""Of the weights. Those of a fit are correlated: the logit of a pole varies by about a fifth of what each would give alone."""
