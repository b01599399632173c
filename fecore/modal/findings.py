"""All that can be said of FRFs and of the modes that were found in them, by its id."""

from dataclasses import replace
from functools import partial

from fecore.arrays import FloatArray
from fecore.findings import Finding, make, remark

_MODE = "{which} ({hz:.2f} Hz)"

OF_FRFS = {
    "line_at_zero": remark("the line at 0 Hz is left out: it holds no modal information"),
    "axes_differ": remark(
        "the FRFs have {count} different frequency axes ({axes}): each is fitted on its own lines"
    ),
    "quantities_differ": remark(
        "the FRFs are of different quantities: all were taken as {quantity}"
    ),
    "zero_lines": remark(
        "{frf} is exactly zero at {lines}: taken as not measured", subject="{frf}"
    ),
    "conjugates": remark(
        "the FRFs are conjugates: from line to line they turn anti-clockwise, as no passive"
        " structure does with exp(+iωt) (written with exp(-iωt), or the wrong channel of the"
        " cross spectrum conjugated); they were conjugated back, write them with exp(+iωt)"
    ),
    "spike": remark(
        "the line at {hz:g} Hz stands alone out of {frfs} (overload or interference): left out"
        " there",
        subject="the line at {hz:g} Hz",
    ),
    "spike_in_all": remark(
        "the line at {hz:g} Hz stands alone out of all FRFs (overload or interference): left out"
        " there",
        subject="the line at {hz:g} Hz",
    ),
    "more_spikes": remark("{count} more such lines were left out"),
    "not_reciprocal": remark(
        "{first} and {other} should be the same FRF by reciprocity; their correlation is"
        " {likeness:.2f}",
        subject="{first} and {other}",
    ),
    "copies_averaged": remark(
        "{frf} was measured more than once: the copies agree and were averaged", subject="{frf}"
    ),
    "off_scale": remark(
        "{frf} is {times:.2g} times as large as most FRFs: a point that hardly moves, or another"
        " unit",
        "check its unit and calibration",
        "{frf}",
    ),
    "frf_not_used": remark("FRF {frf} was not used: {reason}", subject="FRF {frf}"),
    "noise_understated": remark(
        "{count} FRFs scatter more from line to line than the noise that coherence and averages"
        " state (most in {frf}: {times:.1f} times the noise); the stated noise was enlarged there"
    ),
    "leakage": remark(
        "leakage below {hz:g} Hz left out: the FRFs jump from line to line there and rise towards"
        " 0 Hz"
    ),
}
"""Of the FRFs."""

WHY_NOT_USED = {
    "dead": remark("is zero at all lines: a dead channel", "check the cable and measure again"),
    "faint": remark(
        "is at most {largest:.2g} where {strongest} reaches {reached:.2g}: a dead channel, or the"
        " scale of one of the two is wrong",
        "check cable and scale",
    ),
    "loud": remark(
        "is {times:.2g} times as large as most FRFs: another unit (mV for V), or scale",
        "check its unit and calibration",
    ),
    "other_quantity": remark(
        "is {times:.2g} times as large as most FRFs, and {how} with {power} beside them: {true}"
        " stated as {stated}",
        "state its quantity at import",
    ),
    "few_lines": remark(
        "has only {lines} measured lines in the band, at least {fewest} are needed"
    ),
    "constant": remark("is the same number at all lines: not a measurement"),
    "one_part": remark(
        "has no {part} part at any line: only its {other} part, or a magnitude, was exported",
        "export both",
    ),
    "opposite_copy": remark(
        "{first} and {other} are the same FRF with opposite signs: a wrong direction or polarity"
        " in one of them"
    ),
    "unlike_copy": remark(
        "{first} and {other} are stated as the same FRF and differ (correlation {likeness:.2f}):"
        " correct the points and directions where one of them is another FRF",
        "else measure it again",
    ),
}
"""Why an FRF was not used."""

OF_MODES = {
    "drift": remark(
        "all natural frequencies drift together between the tests, by {percent:.2g} % (1 sd): the"
        " tests were aligned; temperature does this, or a support that comes loose"
    ),
    "sensor_mass": remark(
        "the natural frequencies of the tests fall with the height of the mode where the sensor stands,"
        " as its mass pulls them: the mean over the tests is stated",
        "a lighter sensor, or a model that has its mass, leads to the structure alone",
    ),
    "residues_turned": remark(
        "the residues of all strong poles are turned by 90°: another quantity than stated (a"
        " velocity written as an acceleration?), or a channel that was integrated",
        "check it",
    ),
    "channels_delayed": remark(
        "the responses come {delay:.0f} µs {side} the forces, by the phases of the strong modes: a"
        " delay between the channels; the phases were judged without it"
    ),
    "tones": remark("interference at {lines}: left out there, a tone of no width is no mode"),
    "most_modes": remark("the search stopped at most_modes; raise it, or leave it out"),
    "parted": remark(
        "the modes at {first:.3f} and {second:.3f} Hz have one pole in the fit; they were parted"
        " by the references, which see two shapes there. Where their intervals overlap the shapes"
        " are any two of their plane",
        subject="the modes at {first:.3f} and {second:.3f} Hz",
    ),
    "mode_uncertain": remark(
        "the pole at {hz:.2f} Hz is uncertain: {why}", subject="the pole at {hz:.2f} Hz"
    ),
    "pole_stated": remark(
        "the pole at {hz:.2f} Hz was stated, and is a mode for that; by the FRFs alone it is one with"
        " probability {p:.2f}",
        subject="the pole at {hz:.2f} Hz",
    ),
    "few_lines_in_peak": remark(
        f"{_MODE}: its half-power bandwidth covers {{lines:.1f}} lines, so its damping rests on the"
        " window and on leakage",
        "measure with a finer line spacing",
        _MODE,
    ),
    "weak": remark(f"{_MODE}: weak, {{percent:.0f}} % of the FRFs at its own frequency", "", _MODE),
    "complex_shape": remark(
        f"{_MODE}: complex shape (modal phase collinearity {{collinearity:.2f}})", "", _MODE
    ),
    "damping_uncertain": remark(
        f"{_MODE}: damping is known to ± {{percent:.0f}} % only", "", _MODE
    ),
    "not_linear": remark(
        "the frequency at {hz:.2f} Hz {way} by {percent:.2g} % in hits harder by one standard"
        " deviation of the hits: a spring or joint that is not linear; its interval reaches what"
        " small hits would show",
        "hit as softly as the noise allows, and all alike",
        "the frequency at {hz:.2f} Hz",
    ),
    "close_pair": remark(
        "{low} ({first:.2f} Hz) and {high} ({second:.2f} Hz) overlap: a close pair",
        subject="{low} and {high}",
    ),
    "one_record": remark(
        f"{_MODE}: {{frf}} alone shows it: a local mode, or a resonance of that sensor or hammer",
        "",
        _MODE,
    ),
    "rank_two": remark(
        f"{_MODE}: its residues against the fixed dofs are of rank two: two modes at one"
        " frequency, of which the stronger shape is given",
        "",
        _MODE,
    ),
    "driving_point": remark(
        "driving point {frf}: {negative} of {count} modes have a negative modal mass there, so the"
        " sign of hammer or sensor is wrong (a hit along -Z entered as +Z?); all shapes of this"
        " fixed dof are turned if it is the sensor, one entry if it is the hit",
        subject="driving point {frf}",
    ),
    "opposite_sign": remark(
        "{frf}: its sign contradicts what the other fixed dofs see at the same point",
        "correct the direction of the hit or sensor in this FRF",
        "{frf}",
    ),
    "driving_point_quantity": remark(
        "driving point {frf}: all resonances point the other way than its values below them, which"
        " {how}: {true} stated as {stated}, larger or smaller by ω²",
        "state the quantity at import",
        "driving point {frf}",
    ),
    "quantity_of_all": remark(
        "the modal constants of all FRFs {how}, which those of a structure hardly do: {true} stated as"
        " {stated}, in the middle of the modes {times:.2g} times as large? Frequencies and damping hold,"
        " no modal mass",
        "state the quantity at import",
        "the modal constants of all FRFs",
    ),
    "outliers": remark(
        "{frf}: {lines} left out, far off what the other lines say", subject="{frf}"
    ),
    "more_outliers": remark("outlying values were left out of {count} more FRFs"),
    "residual_large": remark(
        "the residual is {times:.1f} times the noise that coherence and averages state: the model"
        " does not explain all of the data (non-linearity, leakage, a moving sensor mass); the"
        " standard deviations were enlarged by as much"
    ),
}
"""Of the modes."""

finding = partial(make, {**OF_FRFS, **WHY_NOT_USED, **OF_MODES})
"""A finding of these, with its values."""


def not_used(frf: str, why: Finding) -> Finding:
    """That an FRF was not used, of the kind that the reason has."""
    return replace(finding("frf_not_used", frf=frf, reason=why.text), kind=why.kind)


def lines_in_words(frequency_hz: FloatArray, most: int = 4) -> str:
    """`120, 121, 122 Hz` or `120, 121, 122, 123 … 180 Hz (61 lines)`."""
    named = [f"{f:g}" for f in frequency_hz]
    if len(named) <= most + 1:
        return ", ".join(named) + " Hz"
    return f"{', '.join(named[:most])} … {named[-1]} Hz ({len(named)} lines)"
