"""What a result opens with: the few findings that change what one would do, each with where it is
mended, the rest as notes; how well the model agrees.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fecore.correlation import CRITERIA
from fecore.findings import Finding, Place, alike, likewise
from fecore.normal import Z_95
from fecore.updating.known_findings import FINDINGS, SECTION_OF
from service.pages.forms import page_words
from service.pages.numbers import in_unit, mean, number

OF_FRFS = [each for each in CRITERIA.values() if each.of == "FRFs"]
MOST = 3  # findings that a result opens with; a reader does not act on a longer list
PLACES: dict[Place, tuple[str, str]] = {
    "campaign": ("ui/edit/campaigns/{campaign}", "Edit the campaign"),
    "modes": ("ui/campaigns/{campaign}#modes", "Go to the mode sets"),
    "structure": ("ui/edit/structures/{structure}", "Edit the structure"),
    "update": ("ui/campaigns/{campaign}/update?like={job}", "Change the recipe"),
    "frfs": ("#frfs", "Look at the FRFs"),
    "damping": ("#damping", "Compare the damping laws"),
}
"""Where a finding is mended: an address and what its link says."""


@dataclass(frozen=True)
class Step:
    """A finding with what to do about it."""

    text: str  # what was found
    level: str | None  # with_care, do_not_use, or None where the result may be used all the same
    advice: str  # what to do
    place: str  # address of where it is done, to be filled in with ids
    link: str  # words of the link there
    guide: str  # address within the guide, of the section that lists it


def opening(document: Mapping[str, Any]) -> tuple[list[Step], list[str]]:
    """The findings that a result opens with, at most three, the gravest first; and the other
    sentences as notes.

    A result of an earlier version has no findings; its reasons and warnings are all notes.
    """
    warnings = [*document["verdict"]["reasons"], *document["warnings"]]
    chosen: dict[str, list[Finding]] = {}
    for group in alike(map(_finding, document.get("findings") or [])):
        if group[0].link and len(chosen) < MOST:
            chosen.setdefault(group[0].kind, group)
    shown = {each.text for group in chosen.values() for each in group}
    shown |= {first.text + likewise(others) for first, *others in chosen.values()}
    rest = [text for text in dict.fromkeys(warnings) if text not in shown]
    return [_step(*group) for group in chosen.values()], list(map(page_words, rest))


def _finding(stored: Mapping[str, Any]) -> Finding:
    """A finding as it is stored, with its row's link and whether it folds."""
    row = FINDINGS.get(stored["kind"])
    return Finding(
        **{"sentence": stored["text"], **stored, "link": row and row.link},
        folds=row is not None and row.folds,
    )


def _step(first: Finding, *others: Finding) -> Step:
    """A finding's sentence without its advice, which stands apart; in brackets, of what else it
    holds.
    """
    assert first.link is not None, "it leads somewhere"
    return Step(
        _sentence(page_words(first.sentence + likewise(others))),
        first.level,
        _sentence(page_words(first.advice)) if first.advice else "",
        *PLACES[first.link],
        guide=section(first.kind),
    )


def section(kind: str) -> str:
    """Address within the guide of the section that lists a finding."""
    return f"findings.html#{SECTION_OF[kind].lower().replace(' ', '-')}"


def _sentence(text: str) -> str:
    """With a capital and a full stop; a name of a constant keeps its own letters."""
    first = text[:1].upper() if text.split(" ")[0].rstrip(",:;").isalpha() else text[:1]
    return first + text[1:] + ("" if text.endswith((".", ")")) else ".")


@dataclass(frozen=True)
class Bar:
    """Prior and posterior of a parameter on one scale, in per cent of the bar's width."""

    # where its 95 % begin, and how wide they are; None without a prior
    prior: tuple[float, float] | None
    posterior: tuple[float, float]
    estimate: float
    initial: float | None
    words: str  # the same for who does not see it


def bar(row: Mapping[str, Any]) -> Bar | None:
    """The bar of a parameter of a result; None where it has no interval.

    >>> row = {"unit": "1", "interval_95": [0.9, 1.1], "estimate": 1.0, "initial": 1.2, "prior_mean": 1.2, "prior_sd": 0.1}
    >>> bar(row | {"standard_deviation": 0.05}).estimate < 50
    True
    """
    if None in (interval := row["interval_95"] or [None]):
        return None
    low, high = interval
    prior = None
    if row.get("prior_sd"):
        prior = (
            row["prior_mean"] - Z_95 * row["prior_sd"],
            row["prior_mean"] + Z_95 * row["prior_sd"],
        )
    ends = [
        low,
        high,
        row["estimate"],
        *(prior or ()),
        *([row["initial"]] if row["initial"] is not None else []),
    ]
    first, last = min(ends), max(ends)
    if last <= first:
        return None

    def place(value: float) -> float:
        return float(2 + 96 * (value - first) / (last - first))

    def span(ends: tuple[float, float]) -> tuple[float, float]:
        return round(place(ends[0]), 2), round(max(place(ends[1]) - place(ends[0]), 0.8), 2)

    shown = [in_unit(value, row["unit"], row["standard_deviation"]) for value in (low, high)]
    words = f"95 %: {shown[0]} to {shown[1]}"
    if prior is not None:
        words = (
            f"prior {in_unit(prior[0], row['unit'])} to {in_unit(prior[1], row['unit'])}, now"
            f" {shown[0]} to {shown[1]}"
        )
    initial = None if row["initial"] is None else round(place(row["initial"]), 2)
    return Bar(
        prior and span(prior), span((low, high)), round(place(row["estimate"]), 2), initial, words
    )


def agreement(result: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """How well the model agrees: name, before and after the update."""
    modes, correlation = result["modes"], result.get("correlation") or {}
    pairs = [m for m in modes if m["updated_hz"] and m["initial_hz"]]
    rows = []
    if pairs:
        before, after = (
            math.sqrt(mean([(m[name] / m["measured_hz"] - 1) ** 2 for m in pairs]) or 0.0)
            for name in ("initial_hz", "updated_hz")
        )
        rows.append(("Frequencies, rms", f"{100 * before:.2g}", f"{100 * after:.2g} %"))
    if shapes := [m["mac"] for m in modes if m["mac"] is not None]:
        rows.append(("MAC, least", "", number(min(shapes), 3)))
    initial = correlation.get("initial") or {}
    for each in OF_FRFS:
        if mean(correlation.get(each.member)) is not None:
            was, now = (number(mean(of.get(each.member)), 2) for of in (initial, correlation))
            rows.append((f"{each.label}, mean", was, now))
    return rows
