"""What good hits are like and what each feature of a bad one weighs, by
`python -m benchmarks calibrate_hits`, 2026-11-26.

`weight` is b of `judgement`; c₀ is `centre`, s₀ `within`, τ `between`, of the logarithm of a
number. Where there is a `unit`, the number counts by it; where there is a `centre` too, by that of
the campaign's own level.
"""

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


CONSTANT = 5.26  # b₀
ALONE = 2.09
"""What is taken from the logit of a hit that none is beside."""

WEIGHTS = {
    "lost": Weight(3.00, unit=0.1),
    "second": Weight(3.42, unit=0.045),
    "swing": Weight(3.37, unit=0.25),
    "turned": Weight(3.00, unit=0.1),
    "flat": Weight(3.01, unit=1),
    "beyond": Weight(1.75, unit=0.03, centre=-5.30, between=0.53, within=0.10, least=0.005),
    "height": Weight(3.21, centre=4.32, between=0.98, within=0.28),
    "early": Weight(1.46, centre=0.00, between=1.49, within=0.36),
    "jump": Weight(1.29, centre=1.00, between=0.19, within=0.12),
    "floor": Weight(0.85, centre=-7.97, between=1.29, within=0.41),
    "offset": Weight(2.20, unit=6.3),  # fitted 1.48; so 9.7 mm refuse a hit alone
    "unlike": Weight(5.23, unit=1.25),
    "distance": Weight(0.85, unit=1.5, centre=-0.04, between=0.25, within=0.44),  # fitted 0.53
    "gain": Weight(0.23, centre=0.00, between=0.01, within=0.01),
}
