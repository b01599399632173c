"""Batches: statistics of specimens (ASTM D3039, section 13), and what they say as a prior of an
elastic constant.

    x̄ = Σ x_i / n,   s = √(Σ (x_i − x̄)² / (n − 1)),   CV = 100 s / |x̄|

An outlier is known by its distance from the median in units of the median absolute deviation, which
one or two strange specimens do not move; the mean and s of five specimens are moved so far by one
that it hides itself.

As a prior the batch stands for one more piece of the same material, the structure: its constant is
spread about x̄ like another specimen. With n specimens that is a t distribution with n − 1 degrees
of freedom and scale s √(1 + 1/n); the prior is the normal distribution with the same 95 % interval,
so its standard deviation is

    s √(1 + 1/n) · t_{0.975, n−1} / 1.960

The three-part failure code of ASTM D3039 says type, area and location: LGM is lateral, in the gauge
length, middle.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy

from fecore.errors import InputError
from fecore.normal import SD_OF_MAD

TYPE = {
    "A": "angled",
    "D": "edge delamination",
    "G": "grip or tab",
    "L": "lateral",
    "M": "multi-mode",
    "S": "long splitting",
    "X": "explosive",
    "O": "other",
}
AREA = {
    "I": "inside grip or tab",
    "A": "at grip or tab",
    "W": "less than one width from grip or tab",
    "G": "gauge length",
    "M": "multiple areas",
    "V": "various",
    "U": "unknown",
}
LOCATION = {
    "B": "bottom",
    "T": "top",
    "L": "left",
    "R": "right",
    "M": "middle",
    "V": "various",
    "U": "unknown",
}

AT_GRIP = frozenset("IAW")  # areas that put the way in which force enters the specimen in doubt

_CODE = re.compile(r"([A-Z])(?:\(([A-Z]+)\))?([A-Z])([A-Z])(?:\((\d)\))?")


def check_failure_code(code: str) -> str:
    """The code in capitals.

    The standard's spellings `M(xyz)` for the types of a multi-mode failure and `AGM(1)`, `AGM(2)`
    for its variants are accepted.

    Raises:
        InputError: it is not a code of the standard; says which of the three parts is wrong and
            what it may be.
    """
    kind, modes, area, location = _parts(code)
    if modes is not None and (kind != "M" or not set(modes) <= TYPE.keys() - {"M"}):
        raise InputError(
            "failure_code", f"{code!r}: only a multi-mode failure lists types, such as M(DL)GM"
        )
    for part, letter, known in (
        ("type", kind, TYPE),
        ("area", area, AREA),
        ("location", location, LOCATION),
    ):
        if letter not in known:
            raise InputError(
                "failure_code",
                f"{code!r}: {letter} is no {part}, expected one of {', '.join(known)}",
            )
    return code.strip().upper()


def failed_at_grip(code: str) -> bool:
    """Whether a valid code says that the specimen failed in, at or next to a grip or tab."""
    return _parts(code)[2] in AT_GRIP


def _parts(code: str) -> tuple[str, str | None, str, str]:
    match = _CODE.fullmatch(code.strip().upper())
    if match is None:
        raise InputError(
            "failure_code", f"{code!r} is not a three-part code (type, area, location) such as LGM"
        )
    kind, modes, area, location, _ = match.groups()
    return kind, modes, area, location


FEWEST_SPECIMENS = 5  # D3039, 8.1: at least five specimens per condition

OUTLIER_LIMIT = {
    4: 6.91, 5: 7.91, 6: 5.53, 7: 5.83, 8: 4.92, 9: 5.10, 10: 4.58, 12: 4.36, 15: 4.28, 20: 4.00, 30: 3.85, 50: 3.75,
}  # fmt: skip
"""By the number of specimens, max |x − median| / (1.4826 MAD) that 95 of 100 normal samples stay
below; simulated.
"""


@dataclass(frozen=True)
class CouponResult:
    """Reduced results of a specimen."""

    name: str  # unique in its batch
    # by property, SI; a property that was not measured is left out
    values: Mapping[str, float] = field(default_factory=dict)
    failure_code: str | None = None  # of D3039, or None
    # why it does not count; None where it counts. It is kept either way
    exclusion_reason: str | None = None

    def __post_init__(self) -> None:
        if self.failure_code is not None:
            check_failure_code(self.failure_code)
        if self.exclusion_reason is not None and not self.exclusion_reason.strip():
            raise InputError(
                "exclusion_reason", f"specimen {self.name} is excluded without a reason"
            )
        for name, value in self.values.items():
            if not np.isfinite(value):
                raise InputError(
                    f"values.{name}", f"of specimen {self.name} is not a number; leave it out"
                )


@dataclass(frozen=True)
class Statistics:
    """Mean and scatter of a property."""

    n: int | None  # number of values; None where a published mean does not say
    mean: float  # x̄
    standard_deviation: float | None  # s, with n − 1; None below two values

    @property
    def cv_percent(self) -> float | None:
        """Coefficient of variation; None where s is not known or the mean is 0."""
        if self.standard_deviation is None or self.mean == 0:
            return None
        return 100 * self.standard_deviation / abs(self.mean)


@dataclass(frozen=True)
class BatchSummary:
    """A batch in numbers."""

    # statistics of each property over the specimens that count
    properties: Mapping[str, Statistics]
    excluded: tuple[tuple[str, str], ...]  # (name, reason) of those that do not
    warnings: tuple[str, ...]  # fewer than five specimens, failures at the grips


@dataclass(frozen=True)
class Prior:
    """A constant before an update."""

    mean: float  # x̄
    standard_deviation: float  # of the structure's constant
    between_specimens: float | None  # s, None where it is assumed
    basis: str  # in words, for the report


# share of the mean below which a scatter is that of the arithmetic, of equal values
_ROUNDING = 1e-12


def statistics(values: Sequence[float]) -> Statistics:
    """Statistics of at least one value.

    Raises:
        InputError: there is none.
    """
    x = np.asarray(values, float)
    if x.size == 0:
        raise InputError("values", "is empty, expected at least one specimen")
    mean, sd = float(x.mean()), float(x.std(ddof=1)) if x.size > 1 else None
    if sd is not None and sd < _ROUNDING * abs(mean):
        sd = 0.0
    return Statistics(x.size, mean, sd)


def outliers(values: Sequence[float]) -> tuple[int, ...]:
    """Indices of values that lie too far from the median to belong to the others.

    A value counts as an outlier where |x − median| / (1.4826 MAD) is above `OUTLIER_LIMIT`: in one
    of twenty batches of sound specimens any is. Below four values none is: nobody can say which of
    three is the strange one.

    Args:
        values: (n,) one property of the specimens that count.
    """
    x = np.asarray(values, float)
    if x.size < min(OUTLIER_LIMIT):
        return ()
    distance = np.abs(x - np.median(x))
    scale = SD_OF_MAD * max(float(np.median(distance)), 1e-9 * abs(float(np.median(x))))
    limit = np.interp(x.size, list(OUTLIER_LIMIT), list(OUTLIER_LIMIT.values()))
    return tuple(int(i) for i in np.flatnonzero(distance > limit * scale))


def outlier_warnings(specimens: Sequence[CouponResult]) -> list[str]:
    """A sentence for each outlier among the specimens that count, with its value beside the median
    of all.
    """
    warnings = []
    for name in dict.fromkeys(name for s in specimens for name in s.values):
        having = [s for s in specimens if s.exclusion_reason is None and name in s.values]
        values = [s.values[name] for s in having]
        warnings += [
            f"{name}: specimen {having[i].name} has {values[i]:.4g}, the median is"
            f" {np.median(values):.4g}; it lies too far out for the scatter of the others: look for"
            " its cause, and exclude it with the reason if there is one"
            for i in outliers(values)
        ]
    return warnings


def summarise(specimens: Sequence[CouponResult]) -> BatchSummary:
    """Summary of a batch.

    Raises:
        InputError: two specimens of one name, or none that counts.
    """
    names = [s.name for s in specimens]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(
            "specimens",
            f"{', '.join(twice)} is in the batch twice; every specimen has a name of its own",
        )
    counted = [s for s in specimens if s.exclusion_reason is None]
    if not counted:
        raise InputError("specimens", f"none of {len(specimens)} counts")
    properties = {
        name: statistics([s.values[name] for s in counted if name in s.values])
        for name in dict.fromkeys(name for s in counted for name in s.values)
    }
    warnings = [
        f"{name}: {statistic.n} valid specimen{'s' * (statistic.n != 1)}; D3039 asks for at least"
        f" {FEWEST_SPECIMENS}"
        for name, statistic in properties.items()
        if statistic.n is not None and statistic.n < FEWEST_SPECIMENS
    ]
    warnings += outlier_warnings(counted)
    coded = [s.failure_code for s in counted if s.failure_code is not None]
    at_grip = sum(failed_at_grip(code) for code in coded)
    if coded and 2 * at_grip > len(coded):
        warnings.append(
            f"{at_grip} of {len(coded)} failed in or next to the grips: see how force enters the"
            " specimens"
        )
    excluded = tuple(
        (s.name, s.exclusion_reason) for s in specimens if s.exclusion_reason is not None
    )
    return BatchSummary(properties, excluded, tuple(warnings))


def prior(published: Statistics, assumed_cv: float = 0.3) -> Prior:
    """Prior of a constant from its batch, or from a published mean.

    A published mean without a scatter, or a single specimen, says nothing about how far the
    structure may be from it; the scatter is then assumed as a share of the value, that of a handbook
    value by default, and the basis says so.

    Raises:
        InputError: an assumed scatter that is not positive, or a mean of 0 with an assumed scatter.
    """
    if not assumed_cv > 0:
        raise InputError("assumed_cv", f"is {assumed_cv}, expected a positive share such as 0.3")
    n, s = published.n, published.standard_deviation
    if s is None:
        if published.mean == 0:
            raise InputError(
                "mean", "is 0, so a relative scatter means nothing; state the standard deviation"
            )
        many = "one value" if n in (None, 1) else f"a mean of {n} specimens"
        return Prior(
            published.mean,
            assumed_cv * abs(published.mean),
            None,
            f"{many} without a scatter; {100 * assumed_cv:g} % assumed",
        )
    if s <= 0:
        raise InputError(
            "standard_deviation", "is 0; specimens that agree to the last digit were not measured"
        )
    if n is None:
        return Prior(
            published.mean,
            s,
            s,
            "published mean and standard deviation, number of specimens not known",
        )
    if n < 2:
        raise InputError("n", f"is {n}, but a scatter needs at least two specimens")
    widening = float(
        np.sqrt(1 + 1 / n) * scipy.special.stdtrit(n - 1, 0.975) / scipy.special.ndtri(0.975)
    )
    return Prior(
        published.mean,
        s * widening,
        s,
        f"{n} specimens; their scatter times {widening:.3f} for one more piece",
    )
