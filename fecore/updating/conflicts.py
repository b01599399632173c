"""Sources of data that contradict each other, and what may be the cause: the values that
`contradictions` gives.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fecore.arrays import FloatArray
from fecore.updating.posterior import LinearProblem


@dataclass(frozen=True)
class SourceStatement:
    """What a source says of one constant, and what the rest says of it: values with standard
    deviations, SI.
    """

    constant: str
    stated: float
    stated_sd: float
    rest: float
    rest_sd: float


@dataclass(frozen=True)
class Check:
    """A source beside all others."""

    # `input`, `coupons`, `campaign`, `scatter` of the specimens, or what a body has: `mass`,
    # `foot`, `support` that gives way or `stiffness` that is lost
    kind: str
    name: str  # of the source, as a sentence names it
    p: float  # probability of a difference from the rest that is larger than the one found
    # logarithm of how much likelier the data are where this source is off by a slip
    evidence: float
    # the campaign or specimen that an input belongs to, as `campaign A`; empty where all share it
    owner: str = ""
    said: tuple[SourceStatement, ...] = ()  # of each constant that it says; nothing of a campaign
    place: tuple[float, ...] = ()  # m, where a mass, a foot or a support likeliest is
    # where stiffness is lost, in words: of what, and between which places
    stretch: tuple[str, ...] = ()
    level: float = 0.0  # probability at most that it is said to be lost where it is not


@dataclass(frozen=True)
class Conflict:
    """A source that contradicts the others."""

    cause: Check  # the likeliest
    # other explanations that the data do not rule out, the likeliest first
    rivals: tuple[Check, ...]
    # names of sources that contradict no more once the cause is allowed for
    cleared: tuple[str, ...]
    moved: float  # how far a constant then moves at most, in its stated standard deviations
    # logarithm of how much likelier the cause is than the next explanation, ruled out or not; None
    # where there is none
    odds: float | None = None


@dataclass(frozen=True)
class CampaignAgreement:
    """One campaign beside the others."""

    # probability of frequencies further from the others' prediction than measured; None of a single
    # campaign
    predictive_p: float | None
    # (q,) coordinates' deviations of the material's parameters by this campaign alone
    own: FloatArray
    own_sd: FloatArray  # (q,) their standard deviations
    # (q,) of own against all together, in standard deviations of the difference; 0 where the
    # campaign says nothing
    z: FloatArray


@dataclass(frozen=True)
class Statement:
    """A source that says what k combinations (k, X) of the unknowns are: values, with standard
    deviations.

    The first unknown of each is that whose value it is about.
    """

    kind: str
    name: str
    owner: str
    rows: FloatArray
    values: FloatArray
    sds: FloatArray

    @property
    def places(self) -> list[int]:
        """(k,) unknowns that the values are about."""
        return [int(place) for place in self.rows.argmax(axis=1)]


def loosened_by(problem: LinearProblem, source: Statement, slip: float) -> LinearProblem:
    """The problem where a source may be off by a slip."""
    if source.kind == "input":
        wider = np.where(source.rows[0], slip, 1.0)
        return replace(
            problem, prior=lambda scatter: problem.prior(scatter) / np.outer(wider, wider)
        )
    less, off = (1 - slip**-2) / source.sds**2, source.values - source.rows @ problem.x
    return replace(
        problem,
        others={
            **problem.others,
            "coupons": problem.others["coupons"] - source.rows.T * less @ source.rows,
        },
        other_descent=problem.other_descent - source.rows.T @ (less * off),
        other_cost=problem.other_cost - float(less @ off**2) / 2,
    )
