"""What a user must know of a result: one table of all that can be found, the verdict that follows,
and the warnings.

`finding` makes a finding of a row of `FINDINGS` and of its numbers.
"""

from collections.abc import Iterable, Sequence
from functools import partial
from typing import Literal

from fecore.findings import Finding, Level, alike, likewise, make
from fecore.updating.known_findings import FINDINGS, PASSED_ON
from fecore.updating.result import ParameterEstimate, Verdict
from fecore.updating.temperature import constant_of

MOST_WARNINGS = 12
"""That a result carries; what weighs less is counted in the last."""

SENTENCES = {
    "usable": "The result may be used: {numbers}.",
    "with_care": "Use the result with care: {numbers}.",
    "do_not_use": "Do not use the result: the model and the measurement do not belong together.",
}
_DECISIVE = 2  # reasons that a verdict names
SKEWED = 1.25
"""Ratio of the sides of an interval from which they are written as two: what the second digit of a
± would show.
"""

finding = partial(make, FINDINGS)
"""A finding of a row of the table, with its numbers; of a graver or a milder level where one is
given.
"""


def passed_on(kind: str, notes: Iterable[Finding]) -> list[Finding]:
    """Remarks on the data as a result says them, under one kind."""
    return [note.passed_on(kind, PASSED_ON[kind]) for note in notes]


def judge(findings: Sequence[Finding], parameters: Sequence[ParameterEstimate]) -> Verdict:
    """The worst level of the findings, with the two that weigh most as its reasons."""
    levels: tuple[Level, ...] = ("do_not_use", "with_care")
    level: Literal["usable", "with_care", "do_not_use"] = "usable"
    decisive: list[Finding] = []
    for worst in levels:
        decisive = sorted((f for f in findings if f.level == worst), key=lambda f: -f.weight)
        if decisive:
            level = worst
            break
    reasons = tuple(dict.fromkeys(f.text for f in decisive))[:_DECISIVE]
    return Verdict(level, SENTENCES[level].format(numbers=_numbers(parameters)), reasons)


def ordered(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """The gravest first."""
    rank = {"do_not_use": 2, "with_care": 1, None: 0}
    return tuple(sorted(findings, key=lambda f: (-rank[f.level], -f.weight)))


def warnings(findings: Sequence[Finding]) -> tuple[str, ...]:
    """A dozen warnings at most: the gravest first, those of one kind about several things folded
    into one.
    """
    folded = [first.text + likewise(others) for first, *others in alike(ordered(findings))]
    if len(folded) <= MOST_WARNINGS:
        return tuple(folded)
    left = len(folded) - MOST_WARNINGS + 1
    return (*folded[: MOST_WARNINGS - 1], f"{left} less important warnings are not listed")


def modes_of(unpaired: int, count: int) -> str:
    """Some of the measured modes, as the subject of a sentence."""
    return f"{unpaired} of {count} measured modes {'has' if unpaired == 1 else 'have'}"


def _in_percent(known: ParameterEstimate) -> str:
    """A standard deviation as a share of the estimate, or one to each side where the interval is
    not about its middle.
    """
    above, below = known.deviations
    if max(above, below) < SKEWED * min(above, below):
        return f"{100 * known.standard_deviation / abs(known.estimate):.2g} %"
    return (
        " ".join(
            f"{sign}{100 * each / abs(known.estimate):.2g}"
            for sign, each in (("+", above), ("−", below))
        )
        + " %"
    )


def _numbers(parameters: Sequence[ParameterEstimate]) -> str:
    """How well each parameter is known, and which the data do not determine; a tied one is
    neither.
    """
    constants = [p for p in parameters if p.tied_to is None and constant_of(p.name) is None]
    known = [p for p in constants if p.identifiable and p.estimate]
    unknown = [p.name for p in constants if not p.identifiable]
    if not known:
        return "no parameter is identifiable"
    words = ", ".join(f"{p.name} to {_in_percent(p)}" for p in known)
    return f"{words} (one standard deviation)" + (
        f"; not identifiable: {', '.join(unknown)}" if unknown else ""
    )
