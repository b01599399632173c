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
    """A source beside all others."""

    kind: str  # `input`, `coupons`, `campaign`, `mass` that a body carries, or `scatter` of the specimens
    name: str  # of the source, as a sentence names it
    p: float  # probability of a difference from the rest that is larger than the one found
    evidence: float  # logarithm of how much likelier the data are where this source is off by a slip
    owner: str = ""  # the campaign or specimen that an input belongs to, as `campaign A`; empty where all share it
    said: tuple[Said, ...] = ()  # of each constant that it says; nothing of a campaign
    slip: float = 1.0  # the likeliest standard deviation of a slip of a coupon or an input, in those that are stated
    place: tuple[float, ...] = ()  # m, where a mass is likeliest


@dataclass(frozen=True)
class Conflict:
    """A source that contradicts the others."""

    cause: Check  # the likeliest
    rivals: tuple[Check, ...]  # other explanations that the data do not rule out, the likeliest first
    cleared: tuple[str, ...]  # names of sources that contradict no more once the cause is allowed for
    moved: float  # how far a constant then moves at most, in its stated standard deviations
