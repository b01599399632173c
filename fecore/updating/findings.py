"""What a user must know of a result: one table of all that can be found, the verdict that follows,
and the warnings.

A row of `FINDINGS` has a level (what it means for the use of the result; None: nothing), a weight
(within a level, more comes first), the sentence, and what to do about it. `finding` makes a finding
of a row and of its numbers.
"""

import re
from collections.abc import Iterable, Sequence
from typing import Literal

from fecore.updating.known_findings import FINDINGS, Level
from fecore.updating.result import Finding, ParameterEstimate, Verdict
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
_NAMED = 4  # of alike warnings, how many are named one by one


def finding(kind: str, *, level: Level | None = None, **values: object) -> Finding:
    """A finding of a row of the table, with its numbers; of a graver or a milder level where one is
    given.
    """
    row = FINDINGS[kind]
    between = "; " if ": " in row.sentence or "; " in row.sentence else ": "
    text = row.sentence + (between + row.advice if row.advice else "")
    return Finding(text.format(**values), level or row.level, row.weight, kind)


def remarks(kind: str, texts: Iterable[str]) -> list[Finding]:
    """Findings of a row that is nothing but a text."""
    return [finding(kind, text=text) for text in texts]


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
    """A dozen warnings at most: the gravest first, those that differ in their numbers alone folded
    into one.
    """
    groups: dict[str, list[str]] = {}
    for finding in ordered(findings):
        alike = groups.setdefault(but_numbers(finding.text), [])
        if finding.text not in alike:
            alike.append(finding.text)
    folded = [fold(alike) for alike in groups.values()]
    if len(folded) <= MOST_WARNINGS:
        return tuple(folded)
    left = len(folded) - MOST_WARNINGS + 1
    return (*folded[: MOST_WARNINGS - 1], f"{left} less important warnings are not listed")


def modes_of(unpaired: int, count: int) -> str:
    """Some of the measured modes, as the subject of a sentence."""
    return f"{unpaired} of {count} measured modes {'has' if unpaired == 1 else 'have'}"


def listed(words: Sequence[object], most: int) -> str:
    """The first words of a list, and how many more there are."""
    more = f" and {len(words) - most} more" if len(words) > most else ""
    return ", ".join(map(str, words[:most])) + more


def but_numbers(text: str) -> str:
    """What warnings that are folded into one have in common: all but their numbers."""
    return re.sub(r"[-+]?\d[\d.]*", "#", text)


def fold(alike: Sequence[str]) -> str:
    """The first of alike warnings, and what the others are about."""
    if len(alike) == 1:
        return alike[0]
    return f"{alike[0]} (likewise: {listed([_label(text) for text in alike[1:]], _NAMED)})"


def _label(text: str) -> str:
    """What a warning is about: its words up to the first bracket or verb, with their number and its
    unit.
    """
    match = re.match(r"[^:(;,]*?\d[\w./-]*(?: Hz\b)?(?: \([^)]*\))?", text)
    return match.group(0) if match else text


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
