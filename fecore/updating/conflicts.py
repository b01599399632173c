"""Sources of data that contradict each other, and what may be the cause: the values that
`contradictions` gives.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from fecore.arrays import FloatArray
from fecore.updating.posterior import LinearProblem
from fecore.updating.result import BESIDE


@dataclass(frozen=True)
class SourceStatement:
    """What a source says of one constant, and what the other data say of it, SI."""

    constant: str
    """its name; empty for the scatter between specimens, a share"""
    stated: float
    """by the source"""
    stated_sd: float
    """standard deviation of that"""
    rest: float
    """by the other data"""
    rest_sd: float
    """standard deviation of that"""


@dataclass(frozen=True)
class Check:
    """A source of data that may be wrong."""

    kind: str
    """what it is; a mass, a foot, a support that gives way and stiffness that is lost are those of
    a body
    """
    name: str
    """of the source, as a sentence names it"""
    p: float
    """probability of a larger difference from the other data, if it is as good as stated"""
    evidence: float
    """logarithm of how much likelier the data are if it is wrong, by a slip"""
    owner: str = ""
    """the campaign or specimen that it belongs to, as `campaign A`; empty: all"""
    said: tuple[SourceStatement, ...] = ()
    """what it says, constant by constant; nothing of a campaign"""
    place: tuple[float, ...] = field(default=(), metadata=BESIDE)
    """m, where a mass, a foot or a support likeliest is"""
    stretch: tuple[str, ...] = field(default=(), metadata=BESIDE)
    """where stiffness is lost, in words: of what, and between which places"""
    level: float = field(default=0.0, metadata=BESIDE)
    """probability at most that it is said to be lost where it is not"""


@dataclass(frozen=True)
class Conflict:
    """Data that contradict each other."""

    cause: Check
    """the likeliest"""
    rivals: tuple[Check, ...]
    """other causes that are not ruled out, the likeliest first"""
    cleared: tuple[str, ...]
    """what no longer contradicts the rest once the cause is allowed for"""
    moved: float
    """how far a constant then moves at most, in its standard deviations"""
    odds: float | None = None
    """logarithm of how much likelier the cause is than the next explanation, ruled out or not; null
    where there is none
    """


@dataclass(frozen=True)
class Agreement:
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
