"""What a result opens with: the few findings that change what one would do, each with where it is
mended; the rest as notes.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fecore.normal import Z_95
from fecore.updating.findings import FINDINGS, but_numbers, fold
from service.show.pages.forms import page_words
from service.show.pages.numbers import in_unit

MOST = 3  # findings that a result opens with; a reader does not act on a longer list
CAMPAIGN, MODES, MODEL, RECIPE, FRFS, DAMPING = (
    "campaign",
    "modes",
    "structure",
    "update",
    "frfs",
    "damping",
)
PLACES = {
    CAMPAIGN: ("ui/edit/campaigns/{campaign}", "Edit the campaign"),
    MODES: ("ui/campaigns/{campaign}#modes", "Go to the mode sets"),
    MODEL: ("ui/edit/structures/{structure}", "Edit the structure"),
    RECIPE: ("ui/campaigns/{campaign}/update?like={job}", "Change the recipe"),
    FRFS: ("#frfs", "Look at the FRFs"),
    DAMPING: ("#damping", "Compare the damping laws"),
}
"""Where a finding is mended: an address and what its link says."""

_AS_SAID = {
    RECIPE: (
        *("mesh_misses", "sources_conflict", "confounded", "not_determined"),
        *("nothing_determined", "samples_differ", "law_negative"),
    ),
    MODEL: ("points_beyond", "frequencies_missed", "mesh_moves", "mesh_decides", "length_moves"),
    CAMPAIGN: (
        *("no_like_mode", "most_modes_alone", "shape_unlike", "rival_pairing", "partners_swing"),
        *("stiffness_changed", "frfs_unlike", "law_replaced", "looks_windowed", "window_unstated"),
        *("frfs_scaled_by_place", "temperature_unknown"),
    ),
    MODES: ("halves_of_a_mode", "mode_not_believed", "two_in_one"),
}
"""Kinds whose own advice says all, by where it is followed."""

REMEDIES: dict[str, tuple[str, str]] = {
    **{kind: (place, "") for place, kinds in _AS_SAID.items() for kind in kinds},
    "joint_needs_frfs": (CAMPAIGN, "Import the FRFs for a joint update."),
    "roving_sensor": (CAMPAIGN, "State the sensor's grid point if it stood still."),
    "mesh_on_trust": (
        MODEL,
        "Compare its frequencies with those of a finer mesh in the program that it is of.",
    ),
    "modes_alone": (
        MODES,
        "Leave in-plane modes out of the mode set, and check boundary, frame and geometry.",
    ),
    "shapes_unlike": (CAMPAIGN, "Check boundary, geometry, frame and numbering of the points."),
    "modes_absent": (CAMPAIGN, "Check boundary and geometry, and the pairs in the table of modes."),
    "sign_opposite": (
        CAMPAIGN,
        "Correct the direction or polarity of hammer or sensor in the file.",
    ),
    "frfs_scaled": (CAMPAIGN, "Correct what is wrong: the constants are wrong with it."),
    "frf_turned": (FRFS, "Correct the direction of this FRF, or leave it out."),
    "frf_scaled": (FRFS, "Correct the sensitivity of this FRF, or leave it out."),
    "frf_unlike": (FRFS, "Correct the point of this FRF, or leave it out."),
    "damping_narrowed": (RECIPE, "Choose the band of the damping, or another law."),
    "damping_of_ratios": (FRFS, "Find out why the FRFs disagree, or use the ratios as they are."),
    "damping_failed": (RECIPE, "Choose another law or band; the elastic constants stand."),
    "optima": (RECIPE, "Fit a wider band, or another law."),
    "law_inadequate": (
        DAMPING,
        "Quote its coefficients only with their intervals, or put the preferred law first.",
    ),
}
"""What to do about each kind of finding, and where; the advice is that of the finding's own row
where nothing is said here.
"""


@dataclass(frozen=True)
class Step:
    """A finding with what to do about it."""

    text: str  # what was found
    level: str | None  # with_care, do_not_use, or None where the result may be used all the same
    advice: str  # what to do
    place: str  # address of where it is done, to be filled in with ids
    link: str  # words of the link there


def opening(document: Mapping[str, Any]) -> tuple[list[Step], list[str]]:
    """The findings that a result opens with, at most three, the gravest first; and the other
    sentences as notes.

    A result of an earlier version has no findings; its reasons and warnings are all notes.
    """
    warnings = [*document["verdict"]["reasons"], *document["warnings"]]
    findings = document.get("findings") or []
    chosen: dict[str, tuple[str, Step]] = {}
    for finding in findings:
        if finding["kind"] in REMEDIES and finding["kind"] not in chosen and len(chosen) < MOST:
            common = but_numbers(finding["text"])
            alike = list(
                dict.fromkeys(
                    each["text"] for each in findings if but_numbers(each["text"]) == common
                )
            )
            chosen[finding["kind"]] = (
                common,
                _step(finding, fold(alike).removeprefix(finding["text"])),
            )
    shown = tuple(common for common, _ in chosen.values())
    rest = [text for text in dict.fromkeys(warnings) if not but_numbers(text).startswith(shown)]
    return [step for _, step in chosen.values()], list(map(page_words, rest))


def _step(finding: Mapping[str, Any], alike: str) -> Step:
    """A finding's sentence without its advice, which stands apart; `alike` says what else it holds
    of.
    """
    place, advice = REMEDIES[finding["kind"]]
    own, text = FINDINGS[finding["kind"]].advice, finding["text"]
    if own and text.endswith(own):
        text, advice = text.removesuffix(own).rstrip(";: "), advice or own
    address, link = PLACES[place]
    return Step(
        _sentence(page_words(text + alike)),
        finding["level"],
        _sentence(page_words(advice)) if advice else "",
        address,
        link,
    )


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
