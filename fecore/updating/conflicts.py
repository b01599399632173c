"""What is said of sources that contradict each other (`contradictions`)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Said:
    """What a source says of one constant, and what the rest says of it: values with standard deviations, SI."""

    constant: str
    stated: float
    stated_sd: float
    rest: float
    rest_sd: float


@dataclass(frozen=True)
class Check:
    """A source beside all others.

    Attributes:
        kind: `input`, `coupons`, `campaign`, `mass` that a body carries, or `scatter` of the specimens.
        name: of the source, as a sentence names it.
        p: probability of a difference from the rest that is larger than the one found.
        evidence: logarithm of how much likelier the data are where this source is off by a slip.
        owner: the campaign or specimen that an input belongs to, as `campaign A`; empty where all share it.
        said: of each constant that it says; nothing of a campaign.
        slip: the likeliest standard deviation of a slip of a coupon or an input, in those that are stated.
        place: m, where a mass is likeliest.
    """

    kind: str
    name: str
    p: float
    evidence: float
    owner: str = ""
    said: tuple[Said, ...] = ()
    slip: float = 1.0
    place: tuple[float, ...] = ()


@dataclass(frozen=True)
class Conflict:
    """A source that contradicts the others.

    Attributes:
        cause: the likeliest.
        rivals: other explanations that the data do not rule out, the likeliest first.
        cleared: names of sources that contradict no more once the cause is allowed for.
        moved: how far a constant then moves at most, in its stated standard deviations.
    """

    cause: Check
    rivals: tuple[Check, ...]
    cleared: tuple[str, ...]
    moved: float
