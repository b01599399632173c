"""What is said of a hit: each of its numbers in a sentence with the limit that alone would refuse
it.
"""

from dataclasses import dataclass
from typing import Literal, NamedTuple

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


class Reason(NamedTuple):
    """A row of the table: a sentence without its stop, with names for values in braces."""

    criterion: Criterion
    sentence: str
    limit: str = ""  # the limit, where the sentence has one
    advice: str = ""  # what to think of it where it failed


_HEIGHT = "The peak force is {n:.3g} N"
_ALIKE = "Hit about as hard as in the other hits."

REASONS = {
    "lost": Reason("late", "The block holds the pulse and what follows it"),
    "no_pulse": Reason(
        "late", "The force block holds no pulse above its noise: the hit lies outside the block"
    ),
    "pulse_late": Reason(
        "late", "The pulse lies at {share:.0%} of the block; most of the response is lost"
    ),
    "pulse_early": Reason(
        "late", "{start} samples lie before the pulse, too few: its beginning is lost"
    ),
    "second": Reason(
        "double",
        "A second pulse has {n:.1%} of the first",
        "{l:.1%}",
        "It stands {apart:.3g} ms {side} it.",
    ),
    "swing": Reason(
        "swapped",
        "The force swings back by {n:.0%} of its pulse",
        "{l:.0%}",
        "The channels seem swapped.",
    ),
    "turned": Reason("polarity", "The pulse points the way of most hits"),
    "turned_away": Reason(
        "polarity",
        "The pulse points the other way than those of the other hits; the direction was probably"
        " turned",
    ),
    "full_scale": Reason(
        "overload", "The {cut} reaches {n:.1%} of its full scale; {l:.1%} is an overload"
    ),
    "flat": Reason(
        "overload",
        "The {cut} has {n:.2g} samples more at its largest value than a round top",
        "{l:.2g}",
        "It was cut off.",
    ),
    "beyond": Reason(
        "overload",
        "The {cut} has {n:.1%} of its largest value above the anti-alias filter's cut",
        "{l:.1%}",
        "Its top was cut off behind the filter.",
    ),
    "height": Reason("hard", _HEIGHT, "{l:.3g} N", _ALIKE),
    "quiet": Reason("quiet", _HEIGHT, "{l:.3g} N", _ALIKE),
    "early": Reason(
        "early",
        "Before the pulse the response is {n:.2g} times as loud as its quietest part",
        "{l:.2g}",
        "The body still rings from the hit before.",
    ),
    "jump": Reason(
        "cut",
        "The response jumps {n:.2g} times as far as beside",
        "{l:.2g}",
        "A cable was loose, or the record ends early.",
    ),
    "floor": Reason(
        "cut",
        "The quietest part of the response has {n:.2g} of its largest value",
        "{l:.2g}",
        "The channel lost its signal, or holds noise alone.",
    ),
    "distance": Reason(
        "place",
        "The FRF lies {n:.2g} typical distances from those of the point's other hits",
        "{l:.2g}",
        "It was probably hit at another place.",
    ),
    "offset": Reason(
        "place",
        "The hit landed {n:.1f} mm from where most hits of the point did",
        "{l:.1f} mm",
        "Hit again, at the mark.",
    ),
    "unlike": Reason(
        "polarity",
        "The FRF differs in sign from those of the point's other hits by {n:.2g} of 2",
        "{l:.2g}",
        "It has the opposite sign.",
    ),
    "gain": Reason(
        "height",
        "All bands of the FRF share a factor of {n:.2g} to those of the point's other hits",
        "{l:.2g}",
        "A sensitivity or range was probably another for this hit.",
    ),
}
"""All that can be said of one hit, by its id."""


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
    kind: str  # id of its row in `REASONS`


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
    pulse, after = features.pulse, features.second_s
    kind = name
    if name == "height" and number < limit:
        kind = "quiet"
    elif name == "turned" and failed:
        kind = "turned_away"
    elif name == "lost" and failed:
        late = pulse.peak > 0.5 * features.samples
        kind = "no_pulse" if not features.clear else "pulse_late" if late else "pulse_early"
    return reason(
        kind,
        number,
        limit,
        failed,
        cut=features.cut,
        start=pulse.start,
        share=pulse.peak / features.samples,
        apart=1e3 * abs(after),
        side="after" if after > 0 else "before",
    )


def reason(kind: str, number: float, limit: float, failed: bool, **values: object) -> HitFinding:
    """A finding of a row, with its number and limit and what else the row names."""
    row = REASONS[kind]
    bound = f"; the limit is {row.limit}" if row.limit and 0 < limit < np.inf else ""
    advice = f" {row.advice}" if failed and row.advice else ""
    sentence = f"{row.sentence}{bound}.{advice}".format(n=number, l=limit, **values)
    return HitFinding(row.criterion, number, limit, failed, sentence, kind)
