"""One long recording with many hits: where they are, how long the body rings, and their blocks.

A recording comes in chunks and is read twice. The first reading keeps only the extremes and the
energy of each channel in short hops, by which the hits are found; the second cuts. So memory does
not grow with the samples.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from fecore.arrays import FloatArray
from fecore.errors import InputError
from fecore.signal.blocks import FEWEST_SAMPLES
from fecore.signal.pulse import LEAD

_HOP_S = 0.005  # the recording is looked through in steps of it: a pulse of a hammer is no longer
# nobody hits twice on purpose within it: what follows is a bounce, and stays in the hit's block
_BOUNCE_S = 0.25
_PERIOD_S = 0.1  # energy is averaged over it, a period of the slowest mode that a hammer excites
_OVER_PAUSES = 8.0  # times that a hit is higher than what the force channel has in the pauses
_OVER_LARGEST = 0.05  # share of the largest hit below which a pulse is none
_FLOOR = 2.0  # times the energy of the quietest pauses, at which a response has decayed
_CLIPPED = 0.999  # of full scale
# relative, of the extremes in all hops: two channels that differ less are copies but for rounding
_SAME = 1e-6


@dataclass(frozen=True)
class Impact:
    """A hit in a recording."""

    at: int  # sample of the force's peak, from 0
    force: float  # its magnitude over the baseline, in the unit of the force channel
    # samples until every response is at its floor; to the next hit where that comes before
    decay: int
    room: int  # samples to the next hit, or to the end of the recording less the lead
    clipped: tuple[int, ...] = ()  # channels that reach their full scale before the next hit


@dataclass(frozen=True)
class Survey:
    """Where the hits of a recording are."""

    hits: tuple[Impact, ...]  # in the order of time
    length: int  # samples of each block

    def fits(self, hit: Impact) -> bool:
        """Whether a hit has its lead, and its block ends before the next hit's lead."""
        return hit.at >= LEAD and hit.room >= self.length


@dataclass(frozen=True)
class _Hops:
    """Extremes, means and mean squares of channels (channels, hops), and where the force has its
    extremes (2, hops).
    """

    low: FloatArray
    high: FloatArray
    mean: FloatArray
    square: FloatArray
    places: np.ndarray[tuple[int, ...], np.dtype[np.int64]]
    hop: int


def survey(
    chunks: Iterable[FloatArray],
    sample_rate_hz: float,
    force: int,
    *,
    least_force: float | None = None,
    full_scale: Sequence[float | None] = (),
    names: Sequence[str] = (),
) -> Survey:
    """Find the hits of a recording.

    A hit is where the force rises over eight times what it has in the pauses and over 5 % of the
    largest hit, or over a stated force; pulses within 0.25 s belong to the hit before. All blocks
    are of one length L, which three quarters of the hits need to decay, and which keeps most of the
    recording: the largest product of L and the hits whose room is L or more.

    Args:
        chunks: (channels, n) parts of the recording, in order, of any length.
        sample_rate_hz: samples a second.
        force: row of the force.
        least_force: what a hit has at least.
        full_scale: largest magnitude of each channel, None where it is not known.
        names: of the channels, for what is said of them; `channel 1` and so on where there are
            none.

    Raises:
        InputError: the recording is too short, holds NaN or no hit, or a channel is constant or a
            copy of another.
    """
    hops = _hops(chunks, force, max(int(_HOP_S * sample_rate_hz), 4), names)
    _check(hops, names)
    middle = np.median((hops.low[force] + hops.high[force]) / 2)
    peaks = np.maximum(hops.high[force] - middle, middle - hops.low[force])
    pauses, largest = float(np.median(peaks)), int(np.argmax(peaks))
    least = (
        max(_OVER_PAUSES * pauses, _OVER_LARGEST * peaks[largest])
        if least_force is None
        else least_force
    )
    if not peaks[largest] > max(least, 0.0):
        raise InputError(
            "recording",
            f"has no hit: the force reaches {peaks[largest]:.3g} at"
            f" {largest * hops.hop / sample_rate_hz:.2f} s and {pauses:.3g} in the pauses; a hit"
            f" has {least:.3g} or more. Is the right channel named as force?",
        )
    first = _starts(np.flatnonzero(peaks > least), peaks, _BOUNCE_S * sample_rate_hz / hops.hop)
    rises = hops.high[force] - middle >= middle - hops.low[force]
    at = [int(hops.places[0 if rises[k] else 1, k]) for k in first]
    ends = [*at[1:], peaks.size * hops.hop + LEAD]
    decays = _decays(
        hops, force, first, [min(end // hops.hop, peaks.size) for end in ends], sample_rate_hz
    )
    hits = tuple(
        Impact(a, float(peaks[k]), min(decay, end - a), end - a, _clipped(hops, full_scale, a, end))
        for a, k, end, decay in zip(at, first, ends, decays, strict=True)
    )
    return Survey(hits, _length(hits))


def cut(chunks: Iterable[FloatArray], survey: Survey) -> Iterator[tuple[Impact, FloatArray]]:
    """The block (channels, length) of each hit that has room for one; see `Survey.fits`.

    Args:
        chunks: the recording again.
        survey: of the first reading.
    """
    waiting = [hit for hit in survey.hits if survey.fits(hit)]
    held: FloatArray = np.empty((0, 0))
    begin = 0
    for chunk in chunks:
        held = np.concatenate((held, chunk), axis=1) if held.size else chunk
        while waiting and (start := waiting[0].at - LEAD) + survey.length <= begin + held.shape[1]:
            yield waiting.pop(0), held[:, start - begin : start - begin + survey.length].copy()
        if not waiting:
            return
        gone = min(max(waiting[0].at - LEAD - begin, 0), held.shape[1])
        held, begin = held[:, gone:], begin + gone


def _hops(chunks: Iterable[FloatArray], force: int, hop: int, names: Sequence[str]) -> _Hops:
    """Raises InputError where a sample is not finite, or fewer come than a block needs."""
    parts: list[tuple[FloatArray, ...]] = []
    rest: FloatArray = np.empty((0, 0))
    begin = 0
    for chunk in chunks:
        held = np.concatenate((rest, chunk), axis=1) if rest.size else chunk
        whole = held.shape[1] // hop * hop
        table = held[:, :whole].reshape(held.shape[0], -1, hop)
        rest = held[:, whole:]
        square = np.einsum("chn,chn->ch", table, table) / hop
        if not np.isfinite(square).all():
            row, k = np.argwhere(~np.isfinite(square))[0]
            raise InputError(
                "recording",
                f"holds NaN or infinity in {_named(names, row)} behind sample"
                f" {begin + k * hop + 1}",
            )
        edges = begin + np.arange(whole // hop) * hop
        places = np.array(
            [table[force].argmax(axis=1) + edges, table[force].argmin(axis=1) + edges]
        )
        parts.append((table.min(axis=2), table.max(axis=2), table.mean(axis=2), square, places))
        begin += whole
    if begin < LEAD + FEWEST_SAMPLES:
        raise InputError(
            "recording",
            f"has {begin + rest.shape[1]} samples, expected {LEAD + FEWEST_SAMPLES} or more",
        )
    low, high, mean, energy, where = (
        np.concatenate(columns, axis=1) for columns in zip(*parts, strict=True)
    )
    return _Hops(low, high, mean, energy, where, hop)


def _check(hops: _Hops, names: Sequence[str]) -> None:
    """Raises InputError where a channel carried nothing, or has the samples of another, perhaps
    times a number.
    """
    scaled: list[FloatArray] = []
    for row, (low, high) in enumerate(zip(hops.low, hops.high, strict=True)):
        if low.min() == high.max():
            why = f"{_named(names, row)} is {low[0]:g} throughout: a channel that carried nothing"
            raise InputError("recording", why)
        extremes = np.concatenate((low, high)) / max(high.max(), -low.min())
        for other, seen in enumerate(scaled):
            if np.allclose(extremes, seen, rtol=_SAME, atol=0):
                why = f"{_named(names, row)} holds the same samples as {_named(names, other)}"
                raise InputError("recording", f"{why}: one channel was written twice")
        scaled.append(extremes)


def _named(names: Sequence[str], row: int) -> str:
    return names[row] if names else f"channel {row + 1}"


def _starts(
    above: np.ndarray[tuple[int, ...], np.dtype[np.int64]], peaks: FloatArray, bounce: float
) -> list[int]:
    """The highest hop of each hit's first run of hops that lie above."""
    runs = np.split(above, np.flatnonzero(np.diff(above) > 1) + 1)
    starts: list[int] = []
    for run in runs:
        if not starts or run[0] - starts[-1] > bounce:
            starts.append(int(run[np.argmax(peaks[run])]))
    return starts


def _decays(
    hops: _Hops, force: int, first: list[int], ends: list[int], sample_rate_hz: float
) -> list[int]:
    """Samples from each hit until the energy of all responses, over the last period, is near that
    of the quietest pauses.
    """
    width = max(min(int(_PERIOD_S * sample_rate_hz / hops.hop), hops.mean.shape[1] // 4), 1)
    quiet = np.ones(hops.mean.shape[1], dtype=bool)
    for row in range(hops.mean.shape[0]):
        if row == force:
            continue
        offset = float(np.median(hops.mean[row]))
        energy = np.maximum(hops.square[row] - 2 * offset * hops.mean[row] + offset**2, 0.0)
        sums = np.concatenate((np.zeros(width), np.cumsum(energy, dtype=float)))
        mean = (sums[width:] - sums[:-width]) / width
        quiet &= mean <= _FLOOR * np.quantile(mean[width:], 0.05)
    decays = []
    for k, end in zip(first, ends, strict=True):
        quiet_hops = np.flatnonzero(quiet[k + width : end])
        decays.append((width + int(quiet_hops[0]) if quiet_hops.size else end - k) * hops.hop)
    return decays


def _clipped(hops: _Hops, full_scale: Sequence[float | None], at: int, end: int) -> tuple[int, ...]:
    part = slice(at // hops.hop, max(end // hops.hop, at // hops.hop + 1))
    return tuple(
        row
        for row, most in enumerate(full_scale)
        if most is not None
        and max(hops.high[row, part].max(), -hops.low[row, part].min()) >= _CLIPPED * most
    )


def _length(hits: tuple[Impact, ...]) -> int:
    """Samples of all blocks."""
    needed = LEAD + float(np.quantile([hit.decay for hit in hits], 0.75))
    rooms = np.array([hit.room for hit in hits])
    lengths = np.minimum(rooms, int(needed))
    kept = [np.sum(rooms >= length) for length in lengths]
    return max(int(lengths[np.argmax(lengths * kept)]), FEWEST_SAMPLES)
