"""What good hits are like and what each feature of a bad one weighs, by `python -m benchmarks calibrate_hits`, 2026-11-26.

`weight` is b of `judgement`; c₀ is `centre`, s₀ `within`, τ `between`, of the logarithm of a number. Where there is a `unit`, a
number counts by it; where there is a `centre` too, by that of the campaign's own level.
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


CONSTANT = 5.35  # b₀
ALONE = 2.00
"""What is taken from the logit of a hit that none is beside."""

WEIGHTS = {
    "lost": Weight(3.00, unit=0.1),
    "second": Weight(3.58, unit=0.045),
    "swing": Weight(3.42, unit=0.25),
    "turned": Weight(3.00, unit=0.1),
    "flat": Weight(4.00, unit=1),
    "beyond": Weight(1.75, unit=0.03, centre=-5.30, between=0.53, within=0.10, least=0.005),
    "height": Weight(2.32, centre=4.32, between=0.97, within=0.28),
    "early": Weight(1.66, centre=-0.03, between=1.39, within=0.36),
    "jump": Weight(1.17, centre=1.01, between=0.19, within=0.12),
    "floor": Weight(0.77, centre=-7.91, between=1.25, within=0.43),
    "offset": Weight(3.00, unit=6.3),  # fitted 1.5; so 8 mm refuse a hit alone
    "unlike": Weight(6.05, unit=1.25),
    "distance": Weight(1.00, unit=2, centre=0.10, between=0.32, within=0.46),
    "gain": Weight(0.38, centre=0.00, between=0.01, within=0.10),
}
