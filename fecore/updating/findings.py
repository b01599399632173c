"""What a user must know of a result: one table of all that can be found, the verdict that follows, and the warnings.

A row of `FINDINGS` has a level (what it means for the use of the result; None: nothing), a weight (within a level, more comes
first), the sentence, and what to do about it. `found` makes a finding of a row and of its numbers.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Literal, NamedTuple

from fecore.updating.result import Finding, ParameterEstimate, Verdict

Level = Literal["with_care", "do_not_use"]

MOST_WARNINGS = 12
"""That a result carries; what weighs less is counted in the last."""

SENTENCES = {
    "usable": "The result may be used: {numbers}.",
    "with_care": "Use the result with care: {numbers}.",
    "do_not_use": "Do not use the result: model and measurement do not belong together.",
}
_DECISIVE = 2  # reasons that a verdict names
_NAMED = 4  # of alike warnings, how many are named one by one


class Row(NamedTuple):
    """A row of the table: level and weight, the sentence, and what to do; with names for numbers in braces."""

    level: Level | None
    weight: float
    sentence: str
    advice: str = ""


_ANOTHER_BODY = "check that the file belongs to this structure, and boundary, points and frame"
_DECIDE = "shapes at more points would decide"
_OTHER_THAN_STATED = "another material, angle, thickness or boundary than stated, or specimens that scatter more"
_WINDOW = "state the window's rate 1/τ with the campaign, 0 for none"
_FRFS = "(in brackets the factor over that of all); mend or leave out"

FINDINGS = {
    # of the measurement and the model
    "measurement": Row(None, 0.5, "{text}"),
    "mesh_misses": Row(
        "with_care",
        8,
        "the mesh of {nx} × {ny} elements, the finest allowed, may miss frequencies by {percent:.2g} %",
        "lower the band",
    ),
    "points_beyond": Row(
        "with_care",
        9,
        "{where}points {points} lie beyond the {name} of {size:g} mm, by up to {out:.2g} mm",
        "the {name} or the points' coordinates are wrong, and so may be the constants; correct what is wrong",
    ),
    "joint_needs_frfs": Row(
        "with_care",
        1,
        "the method joint needs FRFs and there are none",
        "the constants come from the modes, as with two_stage",
    ),
    "roving_sensor": Row(
        "with_care",
        1,
        "the sensor of {grams:.3g} g moved with the response, so the FRFs have no common modes: constants and modes (those "
        "without the sensor) come from the FRFs through the loaded model, as with the method joint{unused}",
    ),
    # of the modes
    "pairing": Row(None, 1, "{text}"),
    "no_like_mode": Row(
        "do_not_use",
        110,
        "no measured mode is like any mode of the model (largest MAC {mac:.2f}): this is not the model of what was measured",
        _ANOTHER_BODY + ". The likest modes are paired for a comparison alone",
    ),
    "halves_of_a_mode": Row(
        "with_care",
        105,
        "measured modes {which} lie within their bandwidths, and the model does not have both: so looks one mode of a "
        "structure that changed between the FRFs (temperature, supports, a sensor that moved)",
        "measure it faster or at one temperature, or leave one of them out of the mode set",
    ),
    "most_modes_alone": Row(
        "do_not_use",
        100,
        "{alone} of {count} measured modes have no partner in the model: this is not the model of what was measured",
        _ANOTHER_BODY,
    ),
    "modes_alone": Row("with_care", 6, "{alone} of {count} measured modes have no partner in the model"),
    "shapes_unlike": Row("do_not_use", 80, "most measured shapes are unlike the model's (median MAC {mac:.2f})"),
    "shape_unlike": Row(
        "with_care",
        7,
        "measured mode {which} has only MAC {mac:.2f} with its partner, model mode {model} ({hz:.2f} Hz)",
        "check boundary, points and directions",
    ),
    "rival_pairing": Row(
        "with_care",
        40,
        "the modes may be others than those they were paired with: other partners, with {other}, are only {evidence:.1f} in "
        "log evidence behind{spanned}",
        _DECIDE,
    ),
    "partners_swing": Row(
        "with_care",
        30,
        "the partner of measured mode {which} changed to and fro in the fit, as modes of the model cross there: each pairing "
        "was fitted alone, and the likeliest is the result",
        _DECIDE,
    ),
    # of the constants
    "frequencies_missed": Row(
        "with_care",
        60,
        "the updated model misses the measured frequencies by {percent:.1f} % (rms), far more than plate theory does: a prior "
        "that is too sure, a constant fixed at a wrong value, or wrong geometry, density or boundary",
        "the estimates are only as right as these",
    ),
    "far_from_prior": Row(
        "with_care",
        20,
        "{name} ended {away:.1f} prior standard deviations {side} its prior mean ({value:.3g} against {mean:.3g})",
        "the prior or the model is wrong, and its interval supposes neither",
    ),
    "confounded": Row(
        "with_care",
        10,
        "{name} cannot be distinguished from {others}: the data fix a combination of them alone",
        "fix one, or state how well it is known",
    ),
    "samples_differ": Row(
        "with_care",
        5,
        "the sampled posterior of {name} is {ratio:.2f} times as wide as its Laplace approximation",
        "trust the samples",
    ),
    # of the FRFs
    "frfs_unlike": Row(
        "do_not_use",
        90,
        "most FRFs are unlike the model's (median likeness {likeness:.2f}): a wrong boundary, geometry, frame or numbering of "
        "the points",
        "do not use these estimates before that is found",
    ),
    "modes_absent": Row(
        "with_care",
        85,
        "the model has {modes} at {which} that would stand out of the FRFs, and nothing is there",
        "a wrong boundary or geometry, or modes that were paired wrongly",
    ),
    "sign_opposite": Row(
        "with_care",
        30,
        "most FRFs have the opposite sign of the model's: the hammer or the sensor has another direction or polarity "
        "than stated",
        "damping was sought in the FRFs of the other sign",
    ),
    "frfs_scaled": Row(
        "with_care",
        30,
        "the FRFs are {factor:.3g} times as large as the model's{unit}: check calibration (hammer, sensor, units), geometry, "
        "density, added masses and boundary",
        "the estimates are only as right as these, and damping was sought in FRFs divided by this factor",
    ),
    "frf_turned": Row(
        "with_care", 30, f"{{who}} the opposite sign of the {{of}}'s: a wrong direction or polarity {_FRFS}"
    ),
    "frf_scaled": Row("with_care", 30, f"{{who}} another height than the rest: a wrong sensitivity or range {_FRFS}"),
    "frf_unlike": Row(
        "with_care", 30, f"{{who}} little likeness with the model's: a wrong point, or a spoilt record {_FRFS}"
    ),
    # of the damping
    "damping_narrowed": Row(
        "with_care", 20, "the damping is that of {low:.4g} to {high:.4g} Hz alone, since over the whole band {text}"
    ),
    "damping_of_ratios": Row(
        "with_care", 30, "the damping is that of the modes' damping ratios, not of the FRFs, since {text}"
    ),
    "damping_failed": Row("with_care", 50, "the damping could not be updated: {text}"),
    "optima": Row("with_care", 4, "the {law} fit has {count} optima, of which the first is reported: {points}"),
    "law_negative": Row(
        "with_care",
        3,
        "the {law} law as fitted is negative from {first:.4g} to {last:.4g} Hz, where it would feed energy in",
        "use it at the measured modes alone, or another law",
    ),
    "law_replaced": Row(
        None,
        3,
        "{modes} fix the {count} coefficients of the {asked} law, so the damping is that of the {law} law",
        "a wider band with more modes would decide",
    ),
    "law_inadequate": Row("with_care", 2, "the {law} law is inadequate for this damping{missed}{better}"),
    "looks_windowed": Row(
        "with_care",
        1.5,
        "the FRFs look as if the response had had an exponential window: the slowest modes decay by {rate:.3g} 1/s on top of "
        "all else, as with a window that ends a record of {record:.3g} s at {end:.2g} %",
        _WINDOW,
    ),
    "window_unstated": Row(
        None,
        0.2,
        "nobody said whether the response had an exponential window; a usual one would raise {name} by {percent:.0f} %, and "
        "the interval of {name} allows for that",
        _WINDOW,
    ),
    # of several campaigns
    "campaigns_contradict": Row(
        "do_not_use",
        70,
        f"the campaigns contradict each other: {{which}}; {_OTHER_THAN_STATED}",
        "a third campaign would show which one is odd",
    ),
    "odd_campaign": Row(
        "do_not_use",
        70,
        "campaign {name} is the odd one out: given the others its frequencies have p = {p:.2g} ({moved} from all together): "
        + _OTHER_THAN_STATED,
        "correct it or leave it out",
    ),
    "campaign_missed": Row(
        "with_care",
        40,
        "campaign {name}: the material of all campaigns misses its frequencies by {percent:.1f} % (rms)",
    ),
    "campaign_modes_alone": Row(
        "with_care", 30, "campaign {name}: {alone} of {count} measured modes have no partner in the model"
    ),
    "unknown_far_from_prior": Row(
        "with_care",
        20,
        "{name} ended {away:.1f} prior standard deviations from its prior mean",
        "the prior is wrong, or it has taken up something else",
    ),
}
"""All that can be found, by its id."""


def found(kind: str, *, level: Level | None = None, **values: object) -> Finding:
    """A finding of a row of the table, with its numbers; of a graver or a milder level where one is given."""
    row = FINDINGS[kind]
    between = "; " if ": " in row.sentence or "; " in row.sentence else ": "
    text = row.sentence + (between + row.advice if row.advice else "")
    return Finding(text.format(**values), level or row.level, row.weight, kind)


def remarks(kind: str, texts: Iterable[str]) -> list[Finding]:
    """Findings of a row that is nothing but a text."""
    return [found(kind, text=text) for text in texts]


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
    """A dozen warnings at most: the gravest first, those that differ in their numbers alone folded into one."""
    groups: dict[str, list[str]] = {}
    for finding in ordered(findings):
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
    """The first of alike warnings, and what the others are about."""
    if len(alike) == 1:
        return alike[0]
    return f"{alike[0]} (likewise: {listed([_label(text) for text in alike[1:]], _NAMED)})"


def _label(text: str) -> str:
    """What a warning is about: its words up to the first bracket or verb, with their number and its unit."""
    match = re.match(r"[^:(;,]*?\d[\w./-]*(?: Hz\b)?(?: \([^)]*\))?", text)
    return match.group(0) if match else text


def _numbers(parameters: Sequence[ParameterEstimate]) -> str:
    """How well each parameter is known, and which the data do not determine; a tied one is neither."""
    known = [p for p in parameters if p.identifiable and p.estimate and p.tied_to is None]
    unknown = [p.name for p in parameters if not p.identifiable and p.tied_to is None]
    if not known:
        return "no parameter is identifiable"
    words = ", ".join(f"{p.name} to {100 * p.standard_deviation / abs(p.estimate):.2g} %" for p in known)
    return f"{words} (one standard deviation)" + (f"; not identifiable: {', '.join(unknown)}" if unknown else "")
