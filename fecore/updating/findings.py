"""What a user must know of a result: one table of all that can be found, the verdict that follows,
and the warnings.

A row of `FINDINGS` has a level (what it means for the use of the result; None: nothing), a weight
(within a level, more comes first), the sentence, and what to do about it. `finding` makes a finding
of a row and of its numbers.
"""

import re
from collections.abc import Iterable, Sequence
from typing import Literal, NamedTuple

from fecore.updating.result import Finding, ParameterEstimate, Verdict
from fecore.updating.temperature import constant_of

Level = Literal["with_care", "do_not_use"]

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


class Row(NamedTuple):
    """A row of the table: level and weight, the sentence, and what to do; with names for numbers in
    braces.
    """

    level: Level | None
    weight: float
    sentence: str
    advice: str = ""


_ANOTHER_BODY = "check that the file belongs to this structure, and boundary, points and frame"
_DECIDE = "shapes measured at more points would decide"
_WINDOW = "state the window's rate 1/τ with the campaign, 0 for none"
_FRFS = "(in brackets: its factor relative to all FRFs); correct or leave out"

FINDINGS = {
    # of the measurement and the model
    "measurement": Row(None, 0.5, "{text}"),
    "mesh_misses": Row(
        "with_care",
        8,
        "the finest mesh allowed, {nx} × {ny} elements, may give frequencies that are wrong by"
        " {percent:.2g} %",
        "choose a band that ends lower",
    ),
    "mesh_moves": Row(
        None,
        7,
        "on the model's own mesh, of elements of {size:.2g} mm, the result would move: {moved}; the"
        " constants are those of elements of {finest:.2g} mm",
        "elements of {enough:.2g} mm would do",
    ),
    "mesh_decides": Row(
        "with_care",
        20,
        "the mesh decides {names}, whatever was measured",
        "make its elements smaller, and its facets as many as the curve needs",
    ),
    "mesh_on_trust": Row(
        None,
        1,
        "what the model's mesh misses is not known, as {why}: it is taken on trust, and is in no"
        " interval",
    ),
    "without_joints": Row(
        None,
        4,
        "walls of the model meet at their middle surfaces without a model of their joint, as the"
        " recipe has it: each frequency may be wrong by {percent:.2g} %",
        "constants found so belong to models without joints",
    ),
    "points_beyond": Row(
        "with_care",
        9,
        "{where}points {points} lie beyond the {name} of {size:g} mm, by up to {out:.2g} mm",
        "the {name} or the points' coordinates are wrong, and so may be the constants; correct what"
        " is wrong",
    ),
    "joint_needs_frfs": Row(
        "with_care",
        1,
        "the method joint needs FRFs, and the campaign has none",
        "the constants were estimated from the modes, as the method two_stage does",
    ),
    "roving_sensor": Row(
        "with_care",
        1,
        "the sensor of {grams:.3g} g moved with the response, so its mass shifts the modes from FRF"
        " to FRF: the constants, and the modes without the sensor, were estimated from the FRFs"
        " with a model that carries it, as the method joint does{unused}",
    ),
    # of the modes
    "pairing": Row(None, 1, "{text}"),
    "no_like_mode": Row(
        "do_not_use",
        110,
        "no measured mode shape agrees with one of the model (largest MAC {mac:.2f}): the model is"
        " not one of the structure that was measured",
        _ANOTHER_BODY + ". The modes that agree best are paired for comparison only",
    ),
    "halves_of_a_mode": Row(
        "with_care",
        105,
        "measured modes {which} lie closer together than their bandwidths, and the model has only"
        " one mode there: probably one mode, of a structure that changed between the FRFs"
        " (temperature, supports, a sensor that was moved)",
        "measure faster or at a constant temperature, or leave one of the two out of the mode set",
    ),
    "two_in_one": Row(
        None,
        3,
        "measured mode {which} is probably two: the model has modes at {hz}, closer together than"
        " half a bandwidth, which the FRFs do not separate. Its frequency is of both, its shape and"
        " damping are a mixture",
        "hit or sense at a second place, where one of the two stands still",
    ),
    "most_modes_alone": Row(
        "do_not_use",
        100,
        "{unpaired} no partner in the model: the model is not one of the structure that was measured",
        _ANOTHER_BODY,
    ),
    "modes_alone": Row("with_care", 6, "{unpaired} no partner in the model"),
    "mode_not_believed": Row(
        None,
        2,
        "measured mode {which}, which is a mode with probability {probability:.2f}, lies {off:+.2f}"
        " % off its partner in the model and is left out",
        "look at it in the FRFs, and drop or keep it in the mode set",
    ),
    "shapes_unlike": Row(
        "do_not_use",
        80,
        "most measured mode shapes disagree with the model's (median MAC {mac:.2f})",
    ),
    "shape_unlike": Row(
        "with_care",
        7,
        "measured mode {which} agrees poorly with its partner, model mode {model} ({hz:.2f} Hz):"
        " MAC {mac:.2f}",
        "check boundary, points and directions",
    ),
    "rival_pairing": Row(
        "with_care",
        40,
        "the measured modes may be paired with the wrong modes of the model: another pairing, which"
        " gives {other}, is nearly as likely (its log evidence is lower by"
        " {evidence:.1f}){spanned}",
        _DECIDE,
    ),
    "partners_swing": Row(
        "with_care",
        30,
        "the partner of measured mode {which} alternated during the fit, because modes of the model"
        " cross there: each pairing was fitted separately, and the most likely one is reported",
        _DECIDE,
    ),
    # of the constants
    "frequencies_missed": Row(
        "with_care",
        60,
        "the frequencies of the updated model differ from the measured ones by {percent:.1f} %"
        " (rms), far more than the error of plate theory: a prior is too narrow, a constant fixed"
        " at a wrong value, or geometry, density or boundary wrong",
        "find the cause before you use the estimates",
    ),
    "stiffness_changed": Row(
        None,
        4,
        "with a probability of {p:.2g} the stiffness has changed between x = {begin:.3g} and"
        " {end:.3g} mm, over {least:.3g} to {most:.3g} mm of that: the modes do not resolve it"
        " further, so the factor of a zone is the mean over the zone",
        "more modes would narrow it",
    ),
    "confounded": Row(
        None,
        3,
        "{name} cannot be distinguished from {others}: the data determine only a combination of"
        " them",
        "fix one of them, or state how well it is known",
    ),
    "not_determined": Row(
        "with_care",
        10,
        "the recipe asks for {names}, which the data do not determine: what is given is the prior",
        "leave out what you do not need, measure a wider band, or state a better prior",
    ),
    "nothing_determined": Row(
        "with_care",
        10,
        "the data determine none of the constants: what is given is the prior",
        "measure a wider band, or at more points",
    ),
    "samples_differ": Row(
        "with_care",
        5,
        "the sampled posterior of {name} is {ratio:.2f} times as wide as its Laplace approximation",
        "use the samples",
    ),
    "length_moves": Row(
        None,
        1.2,
        "the modes show the length to ± {rest:.2g} % alone: a length 1 % longer than stated would"
        " change {moved}",
        "measure it twice",
    ),
    "support_moves": Row(
        None,
        1.1,
        "the support may give way {stiffness} for all that the modes say: that would change"
        " {moved}",
    ),
    # of the FRFs
    "frfs_unlike": Row(
        "do_not_use",
        90,
        "most FRFs disagree with the model's (median agreement {likeness:.2f}, 1 would be perfect):"
        " a wrong boundary, geometry, frame or numbering of the points",
        "find the cause before you use the estimates",
    ),
    "modes_absent": Row(
        "with_care",
        85,
        "the model has {modes} at {which} that the FRFs should show clearly, and they show none"
        " there",
        "the boundary or the geometry is wrong, or modes were paired wrongly",
    ),
    "sign_opposite": Row(
        "with_care",
        30,
        "most FRFs have the opposite sign of the model's: the hammer or the sensor has another"
        " direction or polarity than stated",
        "the damping was fitted to the FRFs with their sign reversed",
    ),
    "frfs_scaled": Row(
        "with_care",
        30,
        "the FRFs are {factor} times as large as the model's{unit}: check calibration (hammer,"
        " sensor, units), geometry, density, added masses and boundary",
        "the damping was fitted to the FRFs divided by this factor",
    ),
    "frfs_scaled_by_place": Row(
        None,
        3,
        "the FRFs are {factor} times as large as the model's{unit}: the sensor, or the hammer, that"
        " stood still is some millimetres off its point, near which the modes are steep, or its"
        " calibration is wrong",
        "measure where it is; the damping was fitted to the FRFs divided by this factor",
    ),
    "frf_turned": Row(
        "with_care",
        30,
        f"{{who}} the opposite sign of the {{of}}'s: a wrong direction or polarity {_FRFS}",
    ),
    "frf_scaled": Row(
        "with_care",
        30,
        f"{{who}} another level than the rest: a wrong sensitivity or range {_FRFS}",
    ),
    "frf_unlike": Row(
        "with_care",
        30,
        f"{{who}} little agreement with the model's: a wrong point, or a damaged record {_FRFS}",
    ),
    # of the damping
    "damping_narrowed": Row(
        "with_care",
        20,
        "the damping is that of {low:.4g} to {high:.4g} Hz alone, since over the whole band {text}",
    ),
    "damping_of_ratios": Row(
        "with_care",
        30,
        "the damping is that of the modes' damping ratios, not of the FRFs, since {text}",
    ),
    "damping_failed": Row("with_care", 50, "the damping could not be updated: {text}"),
    "optima": Row(
        "with_care",
        4,
        "the fit of the {law} law has {count} optima, of which the first is reported: {points}",
    ),
    "law_negative": Row(
        "with_care",
        3,
        "the fitted {law} law has negative damping from {first:.4g} to {last:.4g} Hz",
        "use it at the measured modes only, or choose another law",
    ),
    "law_replaced": Row(
        None,
        3,
        "{modes} fix the {count} coefficients of the {requested} law, so the {law} law was used",
        "measure a wider band with more modes",
    ),
    "law_inadequate": Row(
        "with_care", 2, "the {law} law is inadequate for this damping{missed}{better}"
    ),
    "looks_windowed": Row(
        "with_care",
        1.5,
        "the response seems to have had an exponential window that is not stated: all modes share a"
        " decay of {rate:.3g} 1/s, which a window that falls to {end:.2g} % over the record of"
        " {record:.3g} s would give",
        _WINDOW,
    ),
    "window_unstated": Row(
        None,
        0.2,
        "the campaign does not say whether the response had an exponential window; a typical one"
        " would raise {name} by {percent:.0f} %, and the interval of {name} allows for that",
        _WINDOW,
    ),
    "sources_conflict": Row(
        "with_care",
        70,
        "the data contradict each other (p = {p:.2g}), and the likeliest explanation is"
        " {cause}{rivals}{cleared}",
        "correct it or leave it out",
    ),
    # of several campaigns
    "campaign_missed": Row(
        "with_care",
        40,
        "campaign {name}: frequencies of the joint material differ from the measured ones by"
        " {percent:.1f} % (rms)",
    ),
    "temperature_unknown": Row(
        None,
        6,
        "campaign {name} states no temperature, and the others do: it was taken to be {assumed},"
        " and comes out as {now}",
        "state its temperature_c",
    ),
    "campaign_modes_alone": Row(
        "with_care", 30, "campaign {name}: {unpaired} no partner in the model"
    ),
}
"""All that can be found, by its id."""


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
