"""The judgement of a hit: nine criteria, each with a number, a limit and a sentence.

Limits rest on what each number can be for a good hit, not on a set of data. A second pulse must stand out of its
neighbourhood by more than noise does once in a million blocks and weigh more than the after-ringing of hammers; an
overload is where samples pile up at one level; what lies before the pulse is compared with the quietest half of the
campaign's own hits; a hit's FRF is compared with the others of its point, on the scale of the whole campaign's scatter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from statistics import median
from typing import Literal

import numpy as np

from fecore.arrays import FloatArray
from fecore.errors import InputError
from fecore.frf import Dof
from fecore.processing.comparison import HIGHEST, Comparison, Offset
from fecore.processing.pulse import SMALLEST_SECOND
from fecore.processing.traits import REBOUND, Before, Top, Traits

_MOST_LINED = 256  # hits that say what the lines before the pulse usually have; of more, every k-th
_SWAPPED = 4.0  # times that a force may last as long as a response of it, which contains the pulse and what follows
_STOP_BAND_SCATTER = 3.0  # ratio that the noise between channels may scatter by
# Part above the filter's cut, and over the usual one, that two equal samples need.
_TWO_EQUAL, _TWO_EQUAL_SCATTER = 0.01, 1.5
_FLOOR = 10  # one in so many hits, the quietest, has at most the channel's own noise above the filter's cut

Criterion = Literal["double", "overload", "quiet", "late", "early", "place", "polarity", "height", "swapped"]


@dataclass(frozen=True)
class Limits:
    """What a hit may show.

    Attributes:
        second_pulse: largest second pulse as a share of the first.
        second_pulse_noise: how many standard deviations of its neighbourhood a second pulse must have to be one.
        full_scale: share of a channel's stated full scale that is an overload.
        quiet_share: smallest peak force as a share of the median of the campaign's hits.
        quiet_noise: smallest peak force in standard deviations of the force channel's noise.
        lead: samples before the pulse, as a share of its width.
        before_noise: largest level of the response before the pulse over the campaign's quiet hits.
        before_line: largest power of one line of the response before the pulse, over what that line usually has: noise comes
        to 20 once in a campaign, and a mode that rings on under the noise fills one line.
        before_response: the same as a share of the response's largest value, where no other hit can be asked.
        place: largest distance of a hit's FRF from those of its point, in the campaign's typical distances.
        place_m: largest distance between a hit and the others of its point, m, where hits can be located: one good hit of a
        thousand lands farther off. The limit is higher in a campaign whose hits all scatter more.
        place_sd: standard deviations of the hit's own placing that the limit is raised by.
        alike: distance of an FRF, in typical distances, up to which a hit is in its place wherever it is located.
        likeness: correlation with the other hits of its point below which a hit has the opposite sign.
        cut_top: largest part of a channel above the filter's cut, as a share of its largest value, that other hits do
        not have.
    """

    second_pulse: float = 0.03
    second_pulse_noise: float = 8.0
    full_scale: float = 0.998
    quiet_share: float = 0.25
    quiet_noise: float = 20.0
    lead: float = 0.5
    before_noise: float = 2.5
    before_line: float = 35.0
    before_response: float = 0.02
    place: float = 3.0
    place_m: float = 0.008
    place_sd: float = 0.25
    alike: float = 1.5
    likeness: float = -0.5
    cut_top: float = 0.06

    def __post_init__(self) -> None:
        if not self.second_pulse >= 2 * SMALLEST_SECOND:
            raise InputError("limits.second_pulse", f"is {self.second_pulse}, expected {2 * SMALLEST_SECOND:g} or more")


@dataclass(frozen=True)
class Finding:
    """One criterion of one hit: `failed` where the number is on the wrong side of the limit."""

    criterion: Criterion
    number: float
    limit: float
    failed: bool
    sentence: str


@dataclass(frozen=True)
class Verdict:
    """All findings of a hit.

    Attributes:
        force: where it was hit.
        number: which hit of its point it is.
        findings: one a criterion that could be judged.
        overruled: what a user has decided against them, or None.
    """

    force: Dof
    number: int
    findings: tuple[Finding, ...]
    overruled: bool | None = None

    @property
    def faults(self) -> tuple[Finding, ...]:
        """The findings that failed."""
        return tuple(f for f in self.findings if f.failed)

    @property
    def accepted(self) -> bool:
        """Whether the hit is used."""
        return not self.faults if self.overruled is None else self.overruled


@dataclass(frozen=True)
class Usual:
    """What the hits of a campaign are usually like.

    Attributes:
        peak: median magnitude of the peak force, N; None for a hit alone.
        before: level before the pulse of the quiet hits, by response dof.
        lines: (k,) usual power of the lines before the pulse, by response dof.
        stop_band: what the channels usually have above the filter's cut over their level, and at least, force first.
        polarity: sign of most pulses.
    """

    peak: float | None
    before: Mapping[Dof, float]
    stop_band: tuple[tuple[float, float], ...] = ()
    polarity: int = 1
    lines: Mapping[Dof, FloatArray] = field(default_factory=dict)


def usual(found: Sequence[Traits], *, before: bool = True) -> Usual:
    """What hits are usually like, from all of them: medians, so that up to half may be faulty. `before` is whether what lies
    before the pulse is asked for.
    """
    if len(found) < 3:
        return Usual(None, {})
    clear = [t for t in found if abs(t.pulse.height) > 20 * t.pulse.noise]
    levels: dict[Dof, list[float]] = {}
    for traits in found if before else ():
        for dof, own in zip(traits.responses, traits.before, strict=True):
            if own.samples:
                levels.setdefault(dof, []).append(own.level)
    quiet = {d: median(sorted(v)[: (len(v) + 1) // 2 + 1]) for d, v in levels.items() if len(v) >= 3}
    lines = {dof: _usual_lines(found, dof) for dof in quiet}
    if not clear:
        return Usual(None, quiet, lines=lines)
    heights = [t.pulse.height for t in clear]
    stop = tuple(
        (median(top.stop_band / top.level for top in tops), sorted(top.stop_band for top in tops)[len(tops) // _FLOOR])
        for tops in zip(*(t.tops for t in clear), strict=True)
        if all(top.level > 0 for top in tops)
    )
    upward = sum(h > 0 for h in heights)
    return Usual(median(map(abs, heights)), quiet, stop, 1 if 2 * upward >= len(heights) else -1, lines)


def _usual_lines(found: Sequence[Traits], dof: Dof) -> FloatArray:
    """Mean power of each line before the pulse, from its median over the hits, which is ln 2 of it for noise; no line is
    held to be quieter than the median of all, since a few hits say little of a line of its own.
    """
    powers = [
        before.lines
        for traits in found
        for own, before in zip(traits.responses, traits.before, strict=True)
        if own == dof and before.samples
    ]
    middle = np.median(powers[:: -(-len(powers) // _MOST_LINED)], axis=0) / np.log(2)
    floored: FloatArray = np.maximum(middle, np.median(middle))
    return floored


def judge(traits: Traits, others: Usual, comparison: Comparison | None, limits: Limits | None = None) -> Verdict:
    """The verdict of one hit, from its own numbers, the campaign's usual ones, and the other hits of its point."""
    limits = limits or Limits()
    findings = [
        _late(traits, limits),
        _quiet(traits, others, limits),
        _double(traits, limits),
        *_overload(traits, others, limits),
        *_early(traits, others, limits),
    ]
    if traits.pulse.height * others.polarity < 0 and not any(f.failed for f in findings[:2]):
        sentence = "The hammer's pulse points the other way than those of the other hits; was the direction turned?"
        findings.append(Finding("polarity", -1.0, limits.likeness, True, sentence))
    if not any(f.failed for f in findings[:2]):
        findings += _swapped(traits)
    if comparison is not None:
        findings += _compared(comparison, limits)
    return Verdict(traits.force, traits.number, tuple(findings))


def _swapped(traits: Traits) -> list[Finding]:
    if not traits.lasting:
        text = f"The force swings back by {traits.rebound:.0%} of its largest value; up to {REBOUND:.0%} it is a pulse."
        return [Finding("swapped", traits.rebound, REBOUND, False, text)]
    force, *responses = traits.lasting
    if force == 0 or not (held := [value for value in responses if value > 0]):
        return []
    ratio = force / min(held)
    if ratio > _SWAPPED:
        text = (
            f"The force rings on for some {force:.0f} samples while a response is a pulse of {min(held):.0f}: the channels "
            f"seem swapped."
        )
        return [Finding("swapped", ratio, _SWAPPED, True, text)]
    return [Finding("swapped", ratio, _SWAPPED, False, "The force does not last much longer than the responses.")]


def overrule(verdict: Verdict, accepted: bool | None) -> Verdict:
    """The verdict with a user's decision; None takes it back."""
    return replace(verdict, overruled=accepted)


def _late(traits: Traits, limits: Limits) -> Finding:
    pulse = traits.pulse
    need = max(limits.lead * pulse.width, 2.0)
    if abs(pulse.height) < 8 * pulse.noise or pulse.height == 0:
        return Finding(
            "late", 0.0, need, True, "The force block holds no pulse above its noise: the hit lies outside the block."
        )
    if pulse.peak > 0.5 * traits.samples:
        sentence = f"The pulse lies at {pulse.peak / traits.samples:.0%} of the block; most of the response is lost."
        return Finding("late", (traits.samples - pulse.peak) / traits.samples, 0.5, True, sentence)
    failed = pulse.start < need
    sentence = f"{pulse.start} samples lie before the pulse; at least {need:.3g} must, or its beginning is lost."
    return Finding("late", float(pulse.start), need, failed, sentence)


def _quiet(traits: Traits, others: Usual, limits: Limits) -> Finding:
    pulse = traits.pulse
    height = abs(pulse.height)
    if height < limits.quiet_noise * pulse.noise or others.peak is None or others.peak == 0:
        ratio = height / pulse.noise if pulse.noise > 0 else (np.inf if height else 0.0)
        sentence = (
            f"The peak force of {height:.3g} N is {ratio:.3g} times the channel's noise; "
            f"{limits.quiet_noise:g} times are needed."
        )
        return Finding("quiet", ratio, limits.quiet_noise, bool(ratio < limits.quiet_noise), sentence)
    share = height / others.peak
    sentence = (
        f"The peak force of {height:.3g} N is {share:.0%} of the usual {others.peak:.3g} N; "
        f"{limits.quiet_share:.0%} are needed."
    )
    return Finding("quiet", share, limits.quiet_share, bool(share < limits.quiet_share), sentence)


def _double(traits: Traits, limits: Limits) -> Finding:
    pulse = traits.pulse
    failed = pulse.second > limits.second_pulse and pulse.second_z > limits.second_pulse_noise
    after = (pulse.second_at - pulse.peak) / traits.sample_rate_hz * 1e3
    number = pulse.second if pulse.second_z > limits.second_pulse_noise else 0.0
    sentence = (
        f"A second pulse of {pulse.second:.1%} of the first stands {abs(after):.3g} ms "
        f"{'after' if after > 0 else 'before'} it; "
        f"the limit is {limits.second_pulse:.0%}."
        if failed
        else f"No second pulse above {limits.second_pulse:.0%} of the first and the noise."
    )
    return Finding("double", number, limits.second_pulse, failed, sentence)


def _overload(traits: Traits, others: Usual, limits: Limits) -> list[Finding]:
    found = []
    for number, (channel, top) in enumerate(zip(traits.channels, traits.tops, strict=True)):
        name = channel.name
        if channel.full_scale is not None:
            share = top.level / channel.full_scale
            sentence = f"The {name} reaches {share:.1%} of its full scale; {limits.full_scale:.1%} is an overload."
            if share >= limits.full_scale:
                found.append(Finding("overload", share, limits.full_scale, True, sentence))
                continue
        part = _beyond_filter(top, others.stop_band[number]) if number < len(others.stop_band) else 0.0
        if part > limits.cut_top:
            sentence = (
                f"The {name} has {part:.0%} of its largest value above the anti-alias filter's cut, which the other "
                f"hits have not "
                f"(limit {limits.cut_top:.0%}): its top was cut off behind the filter."
            )
            found.append(Finding("overload", part, limits.cut_top, True, sentence))
            continue
        flat = top.flat(pulse=channel.quantity == "force") or (
            number < len(others.stop_band) and _cut_at_two(top, others.stop_band[number])
        )
        sentence = f"{top.equal} samples of the {name} stand at its largest level, {top.level:.4g}: it was cut off."
        calm = f"The largest values of the {name} are not cut off."
        found.append(Finding("overload", float(top.equal), 3.0, flat, sentence if flat else calm))
    return found


def _beyond_filter(top: Top, usual_part: tuple[float, float]) -> float:
    """What a channel has above the filter's cut beyond what is usual, as a share of its largest value."""
    share, least = usual_part
    expected = _STOP_BAND_SCATTER * max(share * top.level, least)
    return float(np.sqrt(max(top.stop_band**2 - expected**2, 0.0))) / top.level if top.level > 0 else 0.0


def _cut_at_two(top: Top, usual_part: tuple[float, float]) -> bool:
    """Whether two equal samples are a top that was cut off: by chance they are so in one of a thousand channels, and then
    nothing lies above the filter's cut that is not usual.
    """
    expected = _TWO_EQUAL_SCATTER * max(usual_part[0] * top.level, usual_part[1])
    return top.equal == 2 and top.stop_band > max(_TWO_EQUAL * top.level, expected)


def _early(traits: Traits, others: Usual, limits: Limits) -> list[Finding]:
    found = []
    for dof, before, top in zip(traits.responses, traits.before, traits.tops[1:], strict=True):
        if before.samples == 0 or top.level == 0:
            continue
        share = before.level / top.level
        floor = others.before.get(dof)
        if floor is not None and floor > 0:
            ratio, line = before.level / floor, _loudest_line(before, others.lines.get(dof))
            if share > 1e-5 and ratio <= limits.before_noise and line > limits.before_line:
                sentence = (
                    f"Before the pulse one line of the response's spectrum has {line:.3g} times the power that it usually has; "
                    f"the limit is {limits.before_line:g}. The body still rings from the hit before."
                )
                found.append(Finding("early", line, limits.before_line, True, sentence))
                continue
            failed = ratio > limits.before_noise and share > 1e-5
            sentence = (
                f"Before the pulse the response is {ratio:.2g} times as loud as before quiet hits; "
                f"the limit is {limits.before_noise:g}."
            )
            found.append(Finding("early", ratio, limits.before_noise, bool(failed), sentence))
        else:
            sentence = (
                f"Before the pulse the response is {share:.2%} of its largest value; "
                f"the limit is {limits.before_response:.0%}."
            )
            found.append(
                Finding("early", share, limits.before_response, bool(share > limits.before_response), sentence)
            )
        if found[-1].failed:
            text = found[-1].sentence + " The body still rings from the hit before."
            found[-1] = replace(found[-1], sentence=text)
    return found


def _loudest_line(before: Before, usual_lines: FloatArray | None) -> float:
    """Largest power of a line before the pulse, over what it usually is; 0 where that is not known."""
    if usual_lines is None or not usual_lines.min() > 0:
        return 0.0
    return float((before.lines / usual_lines).max())


def _compared(comparison: Comparison, limits: Limits) -> list[Finding]:
    alike = comparison.likeness
    turned = alike < limits.likeness
    signs = f"The FRF correlates by {alike:.2f} with those of the point's other hits"
    if turned:
        return [Finding("polarity", alike, limits.likeness, True, f"{signs}: it has the opposite sign.")]
    found = [
        Finding("polarity", alike, limits.likeness, False, f"{signs}; below {limits.likeness:g} its sign is opposite.")
    ]
    if not 1 / HIGHEST < comparison.height < HIGHEST:
        sentence = (
            f"The FRF is {comparison.height:.2g} times as high as those of the point's other hits; the limit is {HIGHEST:g} "
            f"either way. Was a sensitivity or range another for this hit?"
        )
        return [*found, Finding("height", comparison.height, HIGHEST, True, sentence)]
    if comparison.offset is not None:
        return [*found, _placed(comparison.offset, comparison.distance, limits)]
    failed = comparison.distance > limits.place
    sentence = (
        f"The FRF lies {comparison.distance:.2g} typical distances from the point's other hits; the limit is "
        f"{limits.place:g}." + (" It was probably hit at another place." if failed else "")
    )
    found.append(Finding("place", comparison.distance, limits.place, failed, sentence))
    return found


def _placed(offset: Offset, distance: float, limits: Limits) -> Finding:
    """The number and the limit are in mm."""
    number, sd = 1e3 * offset.distance_m, 1e3 * offset.sd_m
    limit = 1e3 * max(limits.place_m, offset.usual_m) + limits.place_sd * sd
    sentence = (
        f"The hit landed {number:.1f} ± {sd:.1f} mm from where most hits of the point did; the limit is {limit:.3g} mm."
    )
    if number > limit and distance <= limits.alike:
        sentence += f" Its FRF is like those of the others ({distance:.2g} typical distances), so it is not refused."
    return Finding("place", number, limit, number > limit and distance > limits.alike, sentence)
