"""May the result be used? One level, one sentence, the decisive reasons; and warnings by weight, alike ones folded."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from fecore.updating.result import ParameterEstimate, Verdict

Level = Literal["usable", "with_care", "do_not_use"]

MOST_WARNINGS = 12
"""That a result carries; what weighs less is counted in the last."""

_DECISIVE = 2  # reasons that a verdict names
_NAMED = 4  # of alike warnings, how many are named one by one
_SENTENCE = {
    "usable": "The result may be used: {numbers}.",
    "with_care": "Use the result with care: {numbers}.",
    "do_not_use": "Do not use the result: model and measurement do not belong together.",
}


@dataclass(frozen=True)
class Finding:
    """Something that a user must know.

    Attributes:
        text: in words: what was found and what to do.
        level: what it means for the use of the result; None where it means nothing for it.
        weight: within a level, more comes first.
    """

    text: str
    level: Literal["with_care", "do_not_use"] | None = None
    weight: float = 0.0


def notes(
    texts: Iterable[str], level: Literal["with_care", "do_not_use"] | None = None, weight: float = 0.0
) -> list[Finding]:
    """Findings of one level and weight."""
    return [Finding(text, level, weight) for text in texts]


def judge(findings: Sequence[Finding], parameters: Sequence[ParameterEstimate]) -> Verdict:
    """The worst level of the findings, with the two that weigh most as its reasons."""
    for level in ("do_not_use", "with_care"):
        decisive = sorted((f for f in findings if f.level == level), key=lambda f: -f.weight)
        if decisive:
            break
    else:
        level = "usable"
    return Verdict(
        level=level,  # type: ignore[arg-type]
        sentence=_SENTENCE[level].format(numbers=_numbers(parameters)),
        reasons=tuple(dict.fromkeys(f.text for f in decisive))[:_DECISIVE],
    )


def warnings(findings: Sequence[Finding]) -> tuple[str, ...]:
    """A dozen warnings at most: the gravest first, those that differ in their numbers alone folded into one."""
    rank = {"do_not_use": 2, "with_care": 1, None: 0}
    ordered = sorted(findings, key=lambda f: (-rank[f.level], -f.weight))
    groups: dict[str, list[str]] = {}
    for finding in ordered:
        alike = groups.setdefault(re.sub(r"[-+]?\d[\d.]*", "#", finding.text), [])
        if finding.text not in alike:
            alike.append(finding.text)
    folded = [_fold(alike) for alike in groups.values()]
    if len(folded) <= MOST_WARNINGS:
        return tuple(folded)
    left = len(folded) - MOST_WARNINGS + 1
    return (*folded[: MOST_WARNINGS - 1], f"{left} more remarks of less weight")


def listed(words: Sequence[object], most: int) -> str:
    """The first words of a list, and how many more there are."""
    more = f" and {len(words) - most} more" if len(words) > most else ""
    return ", ".join(map(str, words[:most])) + more


def _fold(alike: list[str]) -> str:
    """The first of alike warnings, and the words in which the others differ from it."""
    if len(alike) == 1:
        return alike[0]
    return f"{alike[0]}; the same of {listed([_label(text) for text in alike[1:]], _NAMED)}"


def _label(text: str) -> str:
    """What a warning is about: its words up to the first bracket or verb, with their number and its unit."""
    found = re.match(r"[^:(;,]*?\d[\w./-]*(?: Hz\b)?(?: \([^)]*\))?", text)
    return found.group(0) if found else text


def _numbers(parameters: Sequence[ParameterEstimate]) -> str:
    """How well each parameter is known, and which the data do not determine; a tied one is neither."""
    known = [p for p in parameters if p.identifiable and p.estimate and p.tied_to is None]
    unknown = [p.name for p in parameters if not p.identifiable and p.tied_to is None]
    words = [f"{p.name} to {100 * p.standard_deviation / abs(p.estimate):.2g} %" for p in known]
    text = ", ".join(words) if words else "no parameter is identifiable"
    return (
        f"{text} (one standard deviation)" * bool(words)
        + text * (not words)
        + (f"; not identifiable: {', '.join(unknown)}" if unknown and words else "")
    )
