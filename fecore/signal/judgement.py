"""The judgement of a hit: nine criteria, each with a number, a limit and a sentence.

Limits rest on what each number can be for a good hit, not on a set of data. A second pulse must stand out of its
neighbourhood by more than noise does once in a million blocks and weigh more than the after-ringing of hammers; an
overload is where samples pile up at one level; what lies before the pulse is compared with the quietest half of the
campaign's own hits; a hit's FRF is compared with the others of its point, on the scale of the whole campaign's scatter.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from fecore.errors import InputError
from fecore.frf import Dof
from fecore.signal.comparison import HIGHEST, Comparison, Offset
from fecore.signal.pulse import SMALLEST_SECOND
from fecore.signal.traits import REBOUND, Before, Top, Traits
from fecore.signal.usual import Lines, Ordinary, StopBand, Usual

_SWAPPED = 4.0  # times that a force may last as long as a response of it, which contains the pulse and what follows
_STOP_BAND_SCATTER = 3.0  # ratio that the noise between channels may scatter by
# Part above the filter's cut, and over the usual one, that two equal samples need.
_TWO_EQUAL, _TWO_EQUAL_SCATTER = 0.01, 1.5
_LOUDER = 2.0  # times the noise: a smaller change of range is below the limits on level and line
_ALL = 2.0  # times the level that the louder noise accounts for, beyond which something else is louder too
_NOISE_SAMPLES = 40  # before the pulse, below which a single line that rings is as wide as the band

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
        lead: samples before the pulse, as a share of its width: of a pulse sin² so much lies below its foot.
        before_noise: largest level of the response before the pulse over the campaign's quiet hits; more where the hits
        scatter more among themselves (`usual.reach`), as where each follows the one before after another rest.
        before_line: largest power of one line of the response before the pulse, over what that line usually has: noise comes
        to 20 once in a campaign, and a mode that rings on under the noise fills one line; more in such a campaign.
        before_excited: amplitude before the pulse over that behind it, in the line where there is most before it beyond what is
        usual, up to which the hit is kept: it moves the FRF by no more than that.
        before_response: level before the pulse as a share of the response's largest value, where no other hit can be asked.
        place: largest distance of a hit's FRF from those of its point, in the campaign's typical distances; across a strip that
        moves along one axis alone one good hit of fifty is three of them off, and one of 200 three and a half.
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
    lead: float = 0.1
    before_noise: float = 2.5
    before_line: float = 35.0
    before_excited: float = 0.005
    before_response: float = 0.02
    place: float = 3.5
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
    if not (held := [value for value in responses if value > 0]):
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
    for place, channel, top in zip((None, *traits.responses), traits.channels, traits.tops, strict=True):
        name, stop_band = channel.name, others.stop_band.get(place)
        if channel.full_scale is not None:
            share = top.level / channel.full_scale
            sentence = f"The {name} reaches {share:.1%} of its full scale; {limits.full_scale:.1%} is an overload."
            if share >= limits.full_scale:
                found.append(Finding("overload", share, limits.full_scale, True, sentence))
                continue
        part = 0.0 if stop_band is None else _beyond_filter(top, stop_band)
        if part > limits.cut_top:
            sentence = (
                f"The {name} has {part:.0%} of its largest value above the anti-alias filter's cut, which the other "
                f"hits have not "
                f"(limit {limits.cut_top:.0%}): its top was cut off behind the filter."
            )
            found.append(Finding("overload", part, limits.cut_top, True, sentence))
            continue
        flat = top.flat(pulse=channel.quantity == "force") or (stop_band is not None and _cut_at_two(top, stop_band))
        sentence = f"{top.equal} samples of the {name} stand at its largest level, {top.level:.4g}: it was cut off."
        calm = f"The largest values of the {name} are not cut off."
        found.append(Finding("overload", float(top.equal), 3.0, flat, sentence if flat else calm))
    return found


def _beyond_filter(top: Top, others: StopBand) -> float:
    """What a channel has above the filter's cut beyond what is usual, as a share of its largest value."""
    expected = max(
        _STOP_BAND_SCATTER * max(others.share.level * top.level, others.least), others.share.reach * top.level
    )
    return float(np.sqrt(max(top.stop_band**2 - expected**2, 0.0))) / top.level if top.level > 0 else 0.0


def _cut_at_two(top: Top, others: StopBand) -> bool:
    """Whether two equal samples are a top that was cut off: by chance they are so in one of a thousand channels, and then
    nothing lies above the filter's cut that is not usual.
    """
    expected = _TWO_EQUAL_SCATTER * max(others.share.level * top.level, others.least)
    return top.equal == 2 and top.stop_band > max(_TWO_EQUAL * top.level, expected)


def _early(traits: Traits, others: Usual, limits: Limits) -> list[Finding]:
    found = []
    for dof, before, top in zip(traits.responses, traits.before, traits.tops[1:], strict=True):
        if before.samples == 0 or top.level == 0:
            continue
        share = before.level / top.level
        quiet = others.before.get(dof)
        if quiet is not None and quiet.level > 0:
            found.append(_still_rings(before, share, quiet, others.lines[dof], limits))
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


def _still_rings(before: Before, share: float, quiet: Ordinary, lines: Lines, limits: Limits) -> Finding:
    """Whether the response before the pulse is louder than the campaign's own is, as a whole or in one line, and then
    whether that is enough to matter beside what the hit excites. What is louder in all lines alike is noise, as where a
    range or a sensitivity was another, and no body that rings.
    """
    gain = _louder_noise(before, quiet, lines)
    number, limit = before.level / (gain * quiet.level), max(limits.before_noise, quiet.reach / quiet.level)
    quiet_hits = "quiet hits" if gain == 1 else f"quiet hits whose noise were {gain:.2g} times as loud"
    sentence = (
        f"Before the pulse the response is {number:.2g} times as loud as before {quiet_hits}; the limit is {limit:.2g}."
    )
    loudest, most = _loudest_line(before, lines, limits)
    loudest /= gain**2
    if number <= limit and loudest > most:
        number, limit = loudest, most
        sentence = (
            f"Before the pulse one line of the response's spectrum has {number:.3g} times the power that it usually has; "
            f"the limit is {limit:.3g}."
        )
    failed = bool(number > limit and share > 1e-5)
    if failed and (part := _of_excited(before, lines)) < limits.before_excited:
        sentence += f" It is {part:.2%} of what the hit excites there, so the hit is not refused."
        failed = False
    return Finding("early", number, limit, failed, sentence)


def _louder_noise(before: Before, quiet: Ordinary, others: Lines) -> float:
    """How much louder the noise before the pulse is than usual, by the median line, which a ringing body hardly raises; of
    white noise it is ln 2 of the mean. 1 where it is less than `_LOUDER`, which no limit minds, or not all that is louder.
    """
    if before.samples < _NOISE_SAMPLES or not others.power.min() > 0:
        return 1.0
    gain = float(np.sqrt(np.median(before.lines / others.power) / np.log(2)))
    return gain if gain > _LOUDER and before.level < _ALL * gain * quiet.level else 1.0


def _of_excited(before: Before, others: Lines) -> float:
    """Amplitude before the pulse over that behind it, in the line that has most before it beyond what is usual."""
    line = int(np.argmax(before.lines - others.power))
    return float(np.sqrt(before.lines[line] / before.after[line])) if before.after[line] > 0 else np.inf


def _loudest_line(before: Before, others: Lines, limits: Limits) -> tuple[float, float]:
    """Largest power of a line before the pulse, over what it usually is, and its limit; 0 where that is nothing."""
    if not others.power.min() > 0:
        return 0.0, limits.before_line
    return float((before.lines / others.power).max()), max(limits.before_line, others.reach)


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
