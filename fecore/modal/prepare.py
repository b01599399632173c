"""FRFs as they come, to what modes can be sought in: what is left out, mended or only named in a
warning, and how noisy each value is.

Nothing is dropped in silence: each finding names the FRF or line, and refused FRFs are listed with
their reason. What cannot be seen in FRFs alone is not guessed: the wrong sign of one roving channel
against one fixed dof turns that entry of every shape and leaves no trace in the data.

Which way FRFs turn. With exp(+iωt) the phase of every stable resonance falls through 180°, whatever
the sign of its residue: from line to line FRFs turn clockwise. Programs that write exp(-iωt), or
that conjugated the wrong channel of a cross spectrum, give the conjugates. These turn the other way,
and their impulse responses lie before the hit, which no passive structure does. The sense is
measured by

    z_i = √(2/L) Σ_l Im(H̄_i,l H_i,l+1)/v_i,l,    v the noise as the lines scatter,

standard normal for noise alone, and below 0 for FRF i as it should be. By Parseval's theorem the
sum without v is that of -sin(2πt/T) over the energy of the impulse response in a record of length
T. Leakage next to 0 Hz turns either way, and scatters from line to line as noise does.

Where the FRF set carries a variance (from coherence and averages) it is used, as far as the records
bear it out. Elsewhere the noise is what changes from line to line without memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from fecore.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from fecore.errors import IdentificationError, InputError
from fecore.findings import Finding, listed, texts
from fecore.frf import FrfSet
from fecore.modal.arrangement import (
    CLEAR,
    FEW,
    MANY,
    QUANTITIES,
    Arrangement,
    arrange,
    counted,
    other_quantities,
    row_medians,
)
from fecore.modal.findings import finding, lines_in_words

FEWEST_LINES = 16
"""That an FRF must have in the band."""

# times the median of the FRFs' rms from which one is in another unit, and what is left of it below
# which one may be
_OFF = 300.0
_SPIKE = 400.0  # jump squared over the local median of jumps squared
_SHARED = 0.25  # share of the FRFs that may show a spike at one line
# neighbours of a true resonance stand this much above the lines further off; those of a spike do
# not
_RAISED = 2.0
# correlation from which two reciprocal FRFs may be the same beside drift and hits off the point
_LIKE = 0.5
_SAME = 0.9  # correlation from which two FRFs between the same dofs are the same FRF
_DROWNED = 0.3  # square of the jumps from line to line over the power: nothing but noise
_ALIKE = 0.2  # of it that the lines beside do not have: below it is a mode's
# power of such lines next to 0 Hz over that at their end, from which they are leakage
_RISES = 10.0
_REACH = 0.3  # half the window over the number of its line
_NARROW, _WIDE = 4, 40  # ... and its bounds, lines
_STEEP = 2.0  # power of a line's number by which a scatter falls from which it rises towards 0 Hz
_HALF = 0.5  # line: the number of one at 0 Hz, where a power of it has no end
_BESIDE = 8  # lines on each side that show what FRFs have in common
# ratio of two estimates of the noise from which the larger one holds something else
_DISAGREES = 4.0
# of the rms of a record: below this nothing is believed, so that clean data keep finite weights
_FLOOR = 1e-5


@dataclass(frozen=True)
class Refused:
    """An FRF that was left out."""

    frf: str  # its label, response first: `33Z/1Z`
    why: Finding

    @property
    def reason(self) -> str:
        """Why, in words."""
        return self.why.text


@dataclass(frozen=True)
class Screened:
    """FRFs that are fit for use, and what was found on the way."""

    arrangement: Arrangement  # the usable FRFs
    refused: tuple[Refused, ...]  # the others
    notes: tuple[Finding, ...]  # what a user should know
    # (n,) numbers, among the FRFs handed in, of those that may be used: copies that were averaged
    # too
    kept: IntArray
    measured: BoolArray  # (n, L) which of their values may be used
    # whether the FRFs handed in are conjugates, which `arrangement` holds conjugated back
    conjugated: bool = False

    @property
    def warnings(self) -> tuple[str, ...]:
        """The notes, in words."""
        return texts(self.notes)


@dataclass(frozen=True)
class Prepared:
    """FRFs to seek modes in."""

    arrangement: Arrangement  # the FRFs that can be used, without what leaked from below the band
    # (N, L) variance of their noise, as stated where it is, and as seen from line to line elsewhere
    noise: FloatArray
    refused: tuple[Refused, ...]  # FRFs that cannot be used
    # what the screening has to say of all FRFs, and then of the noise and the leakage
    notes: tuple[Finding, ...]


def prepare(frfs: FrfSet | Sequence[FrfSet], band_hz: tuple[float, float] | None) -> Prepared:
    """Screen FRFs, and find out how large their noise is.

    Args:
        frfs: of one campaign: one set, or several with different axes or quantities.
        band_hz: lines to use; all where None.

    Raises:
        InputError: the FRFs cannot be read as such.
        IdentificationError: none of them can be used.
    """
    screened = screen(frfs, band_hz)
    arrangement, left_out = leakage(screened.arrangement)
    scatter = scatter_of(arrangement)
    arrangement, doubts = _credible(arrangement, scatter)
    notes = (*screened.notes, *doubts, *left_out)
    return Prepared(arrangement, _known_or(arrangement, scatter), screened.refused, notes)


def noise_of(arrangement: Arrangement) -> FloatArray:
    """(N, L) variance of the noise: as stated where it is, and as seen from line to line
    elsewhere.
    """
    return _known_or(arrangement, scatter_of(arrangement))


def _known_or(arrangement: Arrangement, scatter: FloatArray) -> FloatArray:
    return np.where(np.isfinite(arrangement.variance), arrangement.variance, scatter)


def _credible(arrangement: Arrangement, scatter: FloatArray) -> tuple[Arrangement, list[Finding]]:
    """Enlarge a stated noise that the records themselves contradict by more than a factor 2, and
    say so; then take it no larger than what changes from line to line, where there are FRFs enough
    to learn other errors.

    Coherence that was averaged over few hits, or stated for the wrong estimator, is often too good
    by far. Hits beside the point scatter from hit to hit, but alike on all lines of a resonance: that
    is no noise of a line. The residues take it up, and as noise it would hide one line and overrate
    the next. Its size is learnt with the relative error.
    """
    factor = excess(arrangement.variance, scatter, arrangement.measured)
    factor = np.where(factor > 2, factor, 1.0)
    count, worst = int(np.sum(factor > 1)), int(np.argmax(factor))
    frf, times = arrangement.label(worst), np.sqrt(factor[worst])
    doubts = [finding("noise_understated", count=count, frf=frf, times=times)] if count else []
    variance = arrangement.variance * factor[:, None] if count else arrangement.variance
    with np.errstate(invalid="ignore"):
        over = variance[arrangement.measured] / scatter[arrangement.measured]
    over = over[np.isfinite(over)]
    if len(arrangement.pairs) >= FEW and over.size and np.median(over) >= _DISAGREES:
        variance = np.minimum(variance, scatter)  # NaN, not known, stays so
    return replace(arrangement, variance=variance), doubts


def screen(frfs: FrfSet | Sequence[FrfSet], band_hz: tuple[float, float] | None = None) -> Screened:
    """Arrange FRFs and sort out what is not usable.

    Raises:
        InputError: no FRF or line at all, or a variance that is not positive.
        IdentificationError: no usable FRF is left.
    """
    sets = [frfs] if isinstance(frfs, FrfSet) else list(frfs)
    arrangement = arrange(sets, band_hz)
    if np.any(arrangement.variance <= 0):
        raise InputError(
            "variance",
            "must be positive (infinite where nothing was measured, NaN where it is unknown)",
        )
    notes = _notes_on_axes(sets)
    arrangement, gaps = _without_zeros(arrangement)
    notes += gaps
    refused = _unusable(arrangement)
    if len(refused) == len(arrangement.pairs):
        reasons = "; ".join(
            f"{arrangement.label(r)} {why.text}" for r, why in list(refused.items())[:5]
        )
        raise IdentificationError(f"no FRF is usable: {reasons}")
    out = [Refused(arrangement.label(r), why) for r, why in refused.items()]
    if refused:
        arrangement = arrangement.without(list(refused))
    notes += _off_scale(arrangement)
    conjugated = turned_backwards(arrangement if band_hz is None else _alive(arrange(sets)))
    if conjugated:  # judged by all lines: a band about an antiresonance alone turns the other way
        both = arrangement.values.conj(), arrangement.growth.conj()
        arrangement = replace(arrangement, values=both[0], growth=both[1])
        notes.append(finding("conjugates"))
    arrangement, spikes = _without_spikes(arrangement)
    merged, drop, notes_on_doubles = _merge_repeated(arrangement)
    out += [fault for fault in drop.values() if fault is not None]
    kept = [row for row in range(len(arrangement.pairs)) if drop.get(row) is None]
    return Screened(
        arrangement=merged,
        refused=tuple(out),
        notes=tuple(notes + spikes + notes_on_doubles),
        kept=arrangement.source[kept],
        measured=arrangement.measured[kept],
        conjugated=conjugated,
    )


def _notes_on_axes(sets: list[FrfSet]) -> list[Finding]:
    notes = []
    if any(s.frequency_hz[0] == 0 for s in sets):
        notes.append(finding("line_at_zero"))
    axes = {
        (s.frequency_hz.size, float(s.frequency_hz[0]), float(s.frequency_hz[-1])) for s in sets
    }
    if len(axes) > 1:
        words = "; ".join(f"{n} lines, {low:g} to {high:g} Hz" for n, low, high in sorted(axes))
        notes.append(finding("axes_differ", count=len(axes), axes=words))
    if len({s.quantity for s in sets}) > 1:
        notes.append(finding("quantities_differ", quantity=sets[0].quantity))
    return notes


def _without_zeros(arrangement: Arrangement) -> tuple[Arrangement, list[Finding]]:
    """Values that are exactly zero in a living FRF were not measured; say which lines are
    missing.
    """
    zero = np.asarray(arrangement.values == 0, dtype=bool) & arrangement.measured
    alive: BoolArray = np.asarray(np.any(arrangement.values, axis=1), dtype=bool)
    marked = np.asarray(zero & alive[:, None], dtype=bool)
    measured = arrangement.measured & ~marked
    notes = []
    for row in np.flatnonzero(marked.any(axis=1)):
        words = lines_in_words(arrangement.frequency_hz[marked[row]])
        notes.append(finding("zero_lines", frf=arrangement.label(int(row)), lines=words))
    return replace(arrangement, measured=measured), notes


def _alive(arrangement: Arrangement) -> Arrangement:
    """The FRFs without those that cannot be used."""
    refused = _unusable(arrangement)
    return (
        arrangement.without(list(refused))
        if 0 < len(refused) < len(arrangement.pairs)
        else arrangement
    )


def _unusable(arrangement: Arrangement) -> dict[int, Finding]:
    rms = _rms(arrangement)
    usual = np.median(rms[rms > 0]) if np.any(rms) else 1.0
    loud = (rms > _OFF * usual) & (rms.size >= FEW)
    quieter = np.where(loud, 0.0, rms)
    strongest, largest = int(np.argmax(quieter)), np.abs(arrangement.values).max(axis=1)

    mistaken = other_quantities(arrangement)

    def why(row: int) -> Finding | None:
        own, lines = arrangement.values[row], int(arrangement.measured[row].sum())
        if not np.any(own):
            return finding("dead")
        if row in mistaken:
            p, times = mistaken[row]
            return finding(
                "other_quantity",
                times=times,
                how="rises" if p > 0 else "falls",
                power="ω²" if p % 2 == 0 else "ω",
                true=QUANTITIES[arrangement.power + p],
                stated=arrangement.quantity,
            )
        if loud[row]:
            return finding("loud", times=rms[row] / usual)
        if rms[row] <= 1e-9 * quieter[strongest]:  # no converter has so many digits
            label, reached = arrangement.label(strongest), largest[strongest]
            return finding("faint", largest=largest[row], strongest=label, reached=reached)
        if lines < FEWEST_LINES:
            return finding("few_lines", lines=lines, fewest=FEWEST_LINES)
        if np.ptp(own[arrangement.measured[row]]) == 0:
            return finding("constant")
        for part, values, other in (
            ("imaginary", own.imag, "real"),
            ("real", own.real, "imaginary"),
        ):
            if not np.any(values):
                return finding("one_part", part=part, other=other)
        return None

    return {row: fault for row in range(len(rms)) if (fault := why(row)) is not None}


def _rms(arrangement: Arrangement) -> FloatArray:
    square = np.sum(np.abs(arrangement.values) ** 2, axis=1)
    return np.asarray(np.sqrt(square / np.maximum(arrangement.measured.sum(axis=1), 1)))


def _off_scale(arrangement: Arrangement) -> list[Finding]:
    """FRFs so much smaller than most that their unit may be another one."""
    if len(arrangement.pairs) < FEW:
        return []
    times = _rms(arrangement) / np.median(_rms(arrangement))
    return [
        finding("off_scale", frf=arrangement.label(int(row)), times=times[row])
        for row in np.flatnonzero(times < 1 / _OFF)
    ]


def turned_backwards(arrangement: Arrangement) -> bool:
    """Whether the FRFs are conjugates: from line to line most of them turn anti-clockwise, clearly
    above their noise.
    """
    values = arrangement.values / np.sqrt(_line_scatter(arrangement))
    both = arrangement.measured[:, 1:] & arrangement.measured[:, :-1]
    turn = np.sum(np.where(both, values[:, 1:] * values[:, :-1].conj(), 0).imag, axis=1)
    return bool(np.median(turn / np.sqrt(np.maximum(both.sum(axis=1), 1) / 2)) > CLEAR)


def _without_spikes(arrangement: Arrangement) -> tuple[Arrangement, list[Finding]]:
    """Leave out single lines that stand out of a smooth record, as an overload or a mains line
    makes them.
    """
    pairs = zip(arrangement.values, arrangement.measured, strict=True)
    each = [_spikes(v, m) for v, m in pairs]
    spikes, raised, height = (np.array(marks) for marks in zip(*each, strict=True))
    # what most records show is a resonance
    spikes &= raised.sum(axis=0) <= max(1, _SHARED * len(raised))
    # ... but an overload may fall on one: no other FRF jumps nearly as far there
    if len(height) >= FEW:
        spikes |= raised & (height > CLEAR * np.partition(height, -2, axis=0)[-2])
    if not spikes.any():
        return arrangement, []
    notes = []
    lines = np.flatnonzero(spikes.any(axis=0))
    for line in lines[:8]:
        rows = np.flatnonzero(spikes[:, line])
        kind = "spike_in_all" if rows.size == len(spikes) else "spike"
        which = listed([arrangement.label(int(r)) for r in rows], 5)
        notes.append(finding(kind, hz=arrangement.frequency_hz[line], frfs=which))
    if lines.size > 8:
        notes.append(finding("more_spikes", count=lines.size - 8))
    measured = arrangement.measured & ~spikes
    return (
        replace(arrangement, measured=measured, values=np.where(measured, arrangement.values, 0)),
        notes,
    )


def _spikes(record: ComplexArray, measured: BoolArray) -> tuple[BoolArray, BoolArray, FloatArray]:
    """What each line of a record looks like between its neighbours.

    Returns:
        spikes: (L,) lines that jump far beyond the local scatter while their neighbours are not
            raised.
        raised: (L,) the same beside raised neighbours too.
        height: (L,) by how much it jumps.
    """
    spikes, raised = (np.zeros(record.size, dtype=bool) for _ in range(2))
    height = np.zeros(record.size)
    at = np.flatnonzero(measured)
    values = record[at]
    middle = values[2:-2]
    beside = (values[1:-3] + values[3:-1]) / 2
    jump = np.abs(middle - beside) ** 2
    # jumps of lines beside a spike are raised by it: the local median does not see them
    usual = scipy.ndimage.median_filter(jump, size=21, mode="nearest")
    far = (np.abs(values[:-4]) + np.abs(values[4:])) / 2
    near = np.maximum(np.abs(values[1:-3]), np.abs(values[3:-1]))
    floor = 1e-20 * np.max(jump, initial=0.0)
    # the same line may be the culprit of its neighbours' jumps: only the largest of three is meant
    largest = jump >= np.maximum(np.append(jump[1:], 0), np.append(0, jump[:-1]))
    far_out = (jump > _SPIKE * (usual + floor)) & largest & (np.abs(middle) > 3 * near)
    inner = at[2:-2]
    spikes[inner], raised[inner] = far_out & (near < _RAISED * far), far_out
    height[inner] = np.sqrt(jump)
    return spikes, raised, height


def _merge_repeated(
    arrangement: Arrangement,
) -> tuple[Arrangement, dict[int, Refused | None], list[Finding]]:
    """Average FRFs measured twice between the same dofs; leave both out where they contradict each
    other.

    With the result come the rows that it lacks: those refused, and None for a copy that was
    averaged.

    Reciprocal FRFs (hit and read exchanged) are compared too, but kept, since both belong to the
    shapes.
    """
    groups: dict[tuple[object, object], list[int]] = {}
    for row, (a, b) in enumerate(arrangement.pairs):
        groups.setdefault((a, b) if a <= b else (b, a), []).append(row)
    values, measured = arrangement.values.copy(), arrangement.measured.copy()
    drop: dict[int, Refused | None] = {}
    notes: list[Finding] = []
    for first, *rest in groups.values():
        for other in rest:
            own, label = arrangement.label(first), arrangement.label(other)
            likeness = _correlation(arrangement, first, other)
            reciprocal = arrangement.pairs[first] != arrangement.pairs[other]
            # a session with a drift and hits of its own
            if reciprocal and _LIKE < likeness < _SAME:
                notes.append(finding("not_reciprocal", first=own, other=label, likeness=likeness))
            elif likeness < _SAME:
                reason = _contradiction(own, label, likeness)
                drop[first], drop[other] = Refused(own, reason), Refused(label, reason)
            elif not reciprocal and first not in drop:
                both = arrangement.measured[[first, other]]
                share = both / np.maximum(both.sum(axis=0), 1)
                values[first] = (arrangement.values[[first, other]] * share).sum(axis=0)
                measured[first] = both.any(axis=0)
                drop[other] = None
                notes.append(finding("copies_averaged", frf=label))
    merged = replace(arrangement, values=values, measured=measured)
    if drop:
        if len(drop) == len(arrangement.pairs):
            raise IdentificationError(
                "all FRFs contradict their repeats: " + next(r.reason for r in drop.values() if r)
            )
        merged = merged.without(list(drop))
    return merged, drop, list(dict.fromkeys(notes))


def _contradiction(first: str, other: str, likeness: float) -> Finding:
    kind = "opposite_copy" if likeness < -_SAME else "unlike_copy"
    return finding(kind, first=first, other=other, likeness=likeness)


def _correlation(arrangement: Arrangement, a: int, b: int) -> float:
    """Re H_aᴴH_b / (|H_a||H_b|) over the common lines, 1 where there are none."""
    both = arrangement.measured[a] & arrangement.measured[b]
    x, y = arrangement.values[a, both], arrangement.values[b, both]
    size = np.linalg.norm(x) * np.linalg.norm(y)
    return float(np.vdot(x, y).real / size) if size > 0 else 1.0


def leakage(arrangement: Arrangement) -> tuple[Arrangement, list[Finding]]:
    """Leave out the lines next to 0 Hz in which the FRFs jump from line to line as noise does, and
    rise towards 0 Hz.

    FRFs that are noise nearly to their last line stay whole: there is nothing that leakage stands
    before. An FRF that is clearly noisier than most counts less. Narrow modes jump too, but alike:
    a jump of many FRFs that the lines two further on nearly have is a mode's.
    """
    level = np.median(_line_scatter(arrangement), axis=1, keepdims=True)
    values = arrangement.values * np.sqrt(counted(level, float(np.median(level))))
    power = np.sum(np.abs(values) ** 2, axis=0)
    jumps = values[:, 1:-1] - (values[:, :-2] + values[:, 2:]) / 2
    jump = np.sum(np.abs(jumps) ** 2, axis=0)
    around = (power[:-2] + power[1:-1] + power[2:]) / 3
    ratios = [jump / 1.5 / np.maximum(around, np.finfo(float).tiny)]
    if len(values) >= MANY and len(power) > FEWEST_LINES:
        rest = np.sum(np.abs(_not_beside(values, jumps)) ** 2, axis=0)
        ratios.append(rest / np.maximum(jump, np.finfo(float).tiny))
    rough, *own = (scipy.ndimage.median_filter(each, size=5, mode="nearest") for each in ratios)
    rough = np.where(own[0] < _ALIKE, 0.0, rough) if own else rough
    drowned = int(np.argmax(rough < _DROWNED))
    first = drowned + 1  # `rough` is of the lines between others
    left = power.size - first
    if not drowned or left < FEWEST_LINES or np.mean(power[:first]) < _RISES * power[first]:
        return arrangement, []
    cut = replace(
        arrangement,
        frequency_hz=arrangement.frequency_hz[first:],
        values=values[:, first:],
        measured=arrangement.measured[:, first:],
        variance=arrangement.variance[:, first:],
        growth=arrangement.growth[:, first:],
    )
    return cut, [finding("leakage", hz=cut.frequency_hz[0])]


def _not_beside(values: ComplexArray, jumps: ComplexArray) -> ComplexArray:
    """(N, L - 2) the jumps of N FRFs at their inner lines less what these have in common with the
    lines two before and two after, as large as noise leaves them.
    """
    line = np.arange(1, jumps.shape[1] + 1)
    places = np.where(line > 1, line - 2, line + 3), np.where(line < line.size, line + 2, line - 3)
    kept: list[ComplexArray] = []
    for place in places:
        beside = values[:, place]
        for other in kept:
            beside = beside - other * np.sum(other.conj() * beside, axis=0)
        size = np.linalg.norm(beside, axis=0)
        kept.append(beside / np.where(size > 0, size, 1.0))
        jumps = jumps - kept[-1] * np.sum(kept[-1].conj() * jumps, axis=0)
    return np.asarray(jumps * np.sqrt(len(values) / (len(values) - 2)))


def excess(variance: FloatArray, scatter: FloatArray, measured: BoolArray) -> FloatArray:
    """(N,) median over the lines of each FRF of the scatter (N, L) over the stated variance; NaN
    where none is stated.
    """
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return row_medians(np.where(measured & np.isfinite(variance), scatter / variance, np.nan))


def line_scatter(values: ComplexArray, measured: BoolArray, first_line: float) -> FloatArray:
    """(N, L) variance of what changes from line to line without memory, as it follows frequency.

    The running median of the squared second differences (E = 1.5 v, median of an exponential = ln 2
    of its mean), over a window that grows with the number of the line from 0 Hz: leakage rises
    towards 0 Hz as a power of it, and the first lines go on with that power. A median does not see
    resonances as long as they cover less than half of the window.

    Args:
        values: (N, L) FRFs, or the residual of a fit.
        measured: (N, L) where they were measured.
        first_line: frequency of the first line over the line spacing.
    """
    lines = values.shape[1]
    jump = np.abs(values[:, 1:-1] - (values[:, :-2] + values[:, 2:]) / 2) ** 2 / (1.5 * np.log(2))
    whole = measured[:, 1:-1] & measured[:, :-2] & measured[:, 2:]
    jump = np.where(whole & (jump > 0), jump, np.nan)
    nodes = np.unique(
        np.geomspace(1 + first_line, lines + first_line, 64).round() - first_line - 1
    ).astype(int)
    nodes = np.clip(nodes, 0, lines - 3)
    medians = np.empty((len(values), nodes.size))
    for place, node in enumerate(nodes):
        reach = int(np.clip(_REACH * (node + first_line), _NARROW, _WIDE))
        part = jump[:, max(0, node - reach) : node + reach + 1]
        medians[:, place] = row_medians(part)
    line = np.arange(-1, lines - 1)
    usual = np.mean(np.abs(values) ** 2, axis=1)
    out = np.empty((len(values), lines))
    for row, own in enumerate(medians):
        known = np.isfinite(own)
        out[row] = (
            np.exp(np.interp(line, nodes[known], np.log(own[known]))) if known.any() else usual[row]
        )
        out[row, :_NARROW] *= _rise(nodes[known] + first_line, own[known], first_line)[:lines]
    return np.asarray(np.maximum(out, _floor(values)))


def _rise(number: FloatArray, median: FloatArray, first_line: float) -> FloatArray:
    """(4,) what the scatter of the first lines is over the median of theirs, where that rises towards
    0 Hz as a power of the line's number by the medians (m,) at lines up to eight times further.
    """
    near = number <= 8 * (number.min(initial=np.inf) + _NARROW)
    if near.sum() < FEW:
        return np.ones(_NARROW)
    x, y = np.log(number[near] + 1), np.log(median[near])
    slope = np.polyfit(x, y, 1)[0]
    centre = first_line + (_NARROW + 1) / 2
    less = np.clip((first_line + np.arange(_NARROW)) / centre, _HALF / centre, 1.0)
    return np.asarray(less**slope if slope < -_STEEP else np.ones(_NARROW))


def _floor(values: ComplexArray) -> FloatArray:
    """(N, 1) the least variance that is believed."""
    usual = np.mean(np.abs(values) ** 2, axis=1, keepdims=True)
    return np.asarray(_FLOOR**2 * np.maximum(usual, np.finfo(float).tiny))


def scatter_of(arrangement: Arrangement) -> FloatArray:
    """(N, L) variance of what changes from line to line of FRFs, at most several times what they do
    not have in common.
    """
    scatter = _line_scatter(arrangement)
    level = np.median(scatter, axis=1, keepdims=True)
    least = np.minimum(scatter, _DISAGREES * level * _uncommon(arrangement, level))
    return np.asarray(np.maximum(least, _floor(arrangement.values)))


def _line_scatter(arrangement: Arrangement) -> FloatArray:
    first = float(arrangement.frequency_hz[0] / max(arrangement.spacing_hz, np.finfo(float).tiny))
    return line_scatter(arrangement.values, arrangement.measured, first)


def _uncommon(arrangement: Arrangement, level: FloatArray) -> FloatArray:
    """(L,) power, over the level (N, 1), of what many FRFs do not have in common on neighbouring
    lines; infinite where they are few or have gaps.

    Modes are common to all FRFs: they fill few directions of the FRFs, or of the lines, and noise
    fills all. It is the mean of the smaller half of the singular values' squares. Second differences
    take several resonances on the few lines next to 0 Hz for noise.
    """
    lines, out = arrangement.frequency_hz.size, np.full(arrangement.frequency_hz.size, np.inf)
    if len(level) < MANY or lines <= 2 * _BESIDE:
        return out
    scaled = arrangement.values / np.sqrt(level)
    nodes = np.unique(np.append(np.arange(_BESIDE, lines - _BESIDE, _BESIDE), lines - 1 - _BESIDE))
    near = nodes[:, None] + np.arange(-_BESIDE, _BESIDE + 1)
    whole = arrangement.measured[:, near].all(axis=(0, 2))
    products = []
    for each in near[whole]:
        both = np.concatenate([scaled[:, each].real, scaled[:, each].imag], axis=1)
        products.append(both @ both.T if len(both) < both.shape[1] else both.T @ both)
    power = np.full(nodes.size, np.inf)
    if products:
        value = np.linalg.eigvalsh(np.array(products))
        small = value[:, : value.shape[1] // 2].mean(axis=1)
        power[whole] = np.maximum(small, 0.0) * 2 / max(len(scaled), 2 * near.shape[1])
    return np.asarray(np.repeat(power, np.diff(np.r_[0, (nodes[1:] + nodes[:-1]) // 2, lines])))
