"""What is said of a hit: each of its numbers in a sentence with the limit that alone would refuse
it.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from fecore.signal.hit_features import HitFeatures

Criterion = Literal[
    "double",
    "overload",
    "quiet",
    "hard",
    "late",
    "early",
    "cut",
    "place",
    "polarity",
    "height",
    "swapped",
]

_SAYS: dict[str, tuple[Criterion, str, str]] = {
    "lost": ("late", "The block holds the pulse and what follows it.", ""),
    "second": ("double", "A second pulse has {n:.1%} of the first; the limit is {l:.1%}.", ""),
    "swing": (
        "swapped",
        "The force swings back by {n:.0%} of its pulse; the limit is {l:.0%}.",
        "The channels seem swapped.",
    ),
    "turned": ("polarity", "The pulse points the way of most hits.", ""),
    "flat": (
        "overload",
        (
            "The {cut} has {n:.2g} samples more at its largest value than a round top; the limit is"
            " {l:.2g}."
        ),
        "It was cut off.",
    ),
    "beyond": (
        "overload",
        (
            "The {cut} has {n:.1%} of its largest value above the anti-alias filter's cut; the"
            " limit is {l:.1%}."
        ),
        "Its top was cut off behind the filter.",
    ),
    "height": (
        "hard",
        "The peak force is {n:.3g} N; the limit is {l:.3g} N.",
        "Hit about as hard as in the other hits.",
    ),
    "early": (
        "early",
        (
            "Before the pulse the response is {n:.2g} times as loud as its quietest part; the limit"
            " is {l:.2g}."
        ),
        "The body still rings from the hit before.",
    ),
    "jump": (
        "cut",
        "The response jumps {n:.2g} times as far as beside; the limit is {l:.2g}.",
        "A cable was loose, or the record ends early.",
    ),
    "floor": (
        "cut",
        "The quietest part of the response has {n:.2g} of its largest value; the limit is {l:.2g}.",
        "The channel lost its signal, or holds noise alone.",
    ),
    "distance": (
        "place",
        (
            "The FRF lies {n:.2g} typical distances from those of the point's other hits; the limit"
            " is {l:.2g}."
        ),
        "It was probably hit at another place.",
    ),
    "offset": (
        "place",
        "The hit landed {n:.1f} mm from where most hits of the point did; the limit is {l:.1f} mm.",
        "Hit again, at the mark.",
    ),
    "unlike": (
        "polarity",
        (
            "The FRF differs in sign from those of the point's other hits by {n:.2g} of 2; the"
            " limit is {l:.2g}."
        ),
        "It has the opposite sign.",
    ),
    "gain": (
        "height",
        (
            "All bands of the FRF share a factor of {n:.2g} to those of the point's other hits; the"
            " limit is {l:.2g}."
        ),
        "A sensitivity or range was probably another for this hit.",
    ),
}


@dataclass(frozen=True)
class HitFinding:
    """One number of one hit: `failed` where it is a reason to refuse it; `limit` is the number that
    alone would refuse it.
    """

    criterion: Criterion
    number: float
    limit: float
    failed: bool
    sentence: str


def finding(
    features: HitFeatures, name: str, number: float, limit: float, failed: bool
) -> HitFinding:
    """What a number says.

    Args:
        features: of the hit.
        name: of the number.
        number: of the hit.
        limit: the number that alone would refuse it.
        failed: whether it is a reason to refuse the hit.
    """
    criterion, text, advice = _SAYS[name]
    if not 0 < limit < np.inf:
        text = text.partition("; the limit")[0].rstrip(".") + "."
    sentence = text.format(n=number, l=limit, cut=features.cut)
    if name == "height" and number < limit:
        criterion = "quiet"
    if not failed:
        return HitFinding(criterion, number, limit, False, sentence)
    if name == "lost":
        sentence = _lost(features)
    elif name == "turned":
        sentence = (
            "The pulse points the other way than those of the other hits; the direction was"
            " probably turned."
        )
    elif name == "second":
        after = 1e3 * features.second_s
        advice = f"It stands {abs(after):.3g} ms {'after' if after > 0 else 'before'} it."
    return HitFinding(criterion, number, limit, True, f"{sentence} {advice}".strip())


def _lost(features: HitFeatures) -> str:
    pulse = features.pulse
    if not features.clear:
        return "The force block holds no pulse above its noise: the hit lies outside the block."
    if pulse.peak > 0.5 * features.samples:
        return (
            f"The pulse lies at {pulse.peak / features.samples:.0%} of the block; most of the"
            " response is lost."
        )
    return f"{pulse.start} samples lie before the pulse, too few: its beginning is lost."
