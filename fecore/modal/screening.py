"""Faults of the input: what is left out, mended or only named in a warning.

Nothing is dropped in silence: each finding names the FRF or line, and refused
FRFs are listed with their reason. What cannot be seen in FRFs alone is not guessed: the wrong sign
of one roving channel against one fixed dof turns that entry of every shape and leaves no trace in
the data.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from fecore.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from fecore.errors import IdentificationError, InputError
from fecore.findings import Finding, listed, texts
from fecore.frf import FrfSet
from fecore.modal.arrangement import FEW, Arrangement, arrange
from fecore.modal.causality import turned_backwards
from fecore.modal.findings import finding

FEWEST_LINES = 16
"""That an FRF must have in the band."""

# times the median of the FRFs' rms from which one is in another unit, and what is left of it below
# which one may be
_OFF = 300.0
_SPIKE = 400.0  # jump squared over the local median of jumps squared
_SHARED = 0.25  # share of the FRFs that may show a spike at one line
_ALONE = (
    # times the jump of any other FRF at a line: no mode shape, even at few points, has such a peak
    # there alone
    5.0
)
# neighbours of a true resonance stand this much above the lines further off; those of a spike do
# not
_RAISED = 2.0
# correlation from which two reciprocal FRFs may be the same beside drift and hits off the point
_LIKE = 0.5
_SAME = 0.9  # correlation from which two FRFs between the same dofs are the same FRF


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
        arrangement = replace(arrangement, values=arrangement.values.conj())
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


def lines_in_words(frequency_hz: FloatArray, most: int = 4) -> str:
    """`120, 121, 122 Hz` or `120, 121, 122, 123 … 180 Hz (61 lines)`."""
    named = [f"{f:g}" for f in frequency_hz]
    if len(named) <= most + 1:
        return ", ".join(named) + " Hz"
    return f"{', '.join(named[:most])} … {named[-1]} Hz ({len(named)} lines)"


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
    heard = np.where(loud, 0.0, rms)
    found = {}
    for row, (level, lines) in enumerate(zip(rms, arrangement.measured.sum(axis=1), strict=True)):
        if not np.any(arrangement.values[row]):
            found[row] = finding("dead")
        elif loud[row]:
            found[row] = finding("loud", times=level / usual)
        elif level <= 1e-9 * heard.max():  # no converter has so many digits
            largest, strongest = np.abs(arrangement.values).max(axis=1), int(np.argmax(heard))
            found[row] = finding(
                "faint",
                largest=largest[row],
                strongest=arrangement.label(strongest),
                reached=largest[strongest],
            )
        elif lines < FEWEST_LINES:
            found[row] = finding("few_lines", lines=lines, fewest=FEWEST_LINES)
        elif np.ptp(arrangement.values[row, arrangement.measured[row]]) == 0:
            found[row] = finding("constant")
        elif not np.any(arrangement.values[row].imag) or not np.any(arrangement.values[row].real):
            part, other = (
                ("imaginary", "real")
                if not np.any(arrangement.values[row].imag)
                else ("real", "imaginary")
            )
            found[row] = finding("one_part", part=part, other=other)
    return found


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


def _without_spikes(arrangement: Arrangement) -> tuple[Arrangement, list[Finding]]:
    """Leave out single lines that stand out of a smooth record, as an overload or a mains line
    makes them.
    """
    pairs = zip(arrangement.values, arrangement.measured, strict=True)
    seen = [_spikes(v, m) for v, m in pairs]
    spikes, standing, height = (np.array(marks) for marks in zip(*seen, strict=True))
    # what most records show is a resonance
    spikes &= standing.sum(axis=0) <= max(1, _SHARED * len(standing))
    # ... but an overload may fall on one: no other FRF jumps nearly as far there
    if len(height) >= FEW:
        spikes |= standing & (height > _ALONE * np.partition(height, -2, axis=0)[-2])
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
        standing: (L,) the same beside raised neighbours too.
        height: (L,) by how much it jumps.
    """
    spikes, standing = (np.zeros(record.size, dtype=bool) for _ in range(2))
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
    spikes[inner], standing[inner] = far_out & (near < _RAISED * far), far_out
    height[inner] = np.sqrt(jump)
    return spikes, standing, height


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
