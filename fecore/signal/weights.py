"""What good hits are like and what each feature of a bad one weighs, by `python -m benchmarks calibrate_hits`, 2026-11-25.

`weight` is b of `judgement`; c₀ is `centre`, s₀ `within`, τ `between`. They are those of the logarithm of a number where it has
no `unit`.
"""

from __future__ import annotations

from typing import NamedTuple

LEAST = 1e-12  # that a number is taken for before its logarithm


class Weight(NamedTuple):
    """One feature's row; a number below `least` is as good as that."""

    weight: float
    unit: float = 0.0
    centre: float = 0.0
    between: float = 0.0
    within: float = 0.0
    least: float = LEAST


CONSTANT = 5.07  # b₀
ALONE = 2.06
"""What is taken from the logit of a hit that none is beside."""

WEIGHTS = {
    "lost": Weight(3.00, unit=0.1),
    "second": Weight(3.00, unit=0.045),
    "swing": Weight(2.82, unit=0.25),
    "turned": Weight(3.00, unit=0.1),
    "flat": Weight(3.11, unit=1),
    "beyond": Weight(3.16, unit=0.02, centre=0.005, within=0.01),
    "height": Weight(3.02, centre=4.25, between=0.96, within=0.28),
    "early": Weight(1.38, centre=0.06, between=1.53, within=0.35),
    "jump": Weight(1.28, centre=1.01, between=0.19, within=0.13),
    "floor": Weight(0.57, centre=-8.07, between=1.28, within=0.40),
    "offset": Weight(3.00, unit=6.3),  # fitted 1.94; so 8 mm refuse a hit alone
    "unlike": Weight(4.97, unit=1.25),
    "distance": Weight(1.14, unit=0.5, centre=1, within=0.3),
    "gain": Weight(0.62, centre=-0.00, between=0.04, within=0.10),
}
