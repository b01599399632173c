"""Spectra of hits under one set of windows, on one set of frequency lines."""

import threading
from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np
import numpy.typing as npt
import scipy

from fecore.arrays import ComplexArray, FloatArray
from fecore.errors import InputError
from fecore.signal.blocks import Hit, exponential
from fecore.signal.comparison import compare_lines
from fecore.signal.coupling import find_coupling, impulse
from fecore.signal.document import Processing
from fecore.signal.hit_features import HitFeatures, find_features
from fecore.signal.participation import MOST_SENSORS, Basis, find_basis, hit_frfs
from fecore.signal.windows import LEFT_AT_END, choose_windows, force_window, total_rate, windowed

USABLE_SHARE = 1 / 2.56
"""Highest line over the sampling rate: analysers' anti-alias filters are flat to there."""

EXCITED = 0.01
"""Hits are compared where the force's power is at least this share of its largest (-20 dB)."""

SAME_RATE = 1e-4
"""Sampling rates are one up to this share, as the digits of a time column leave it; the frequencies
are as sure.
"""

_FEWEST_LINES = 2  # that make a band
_LOOKED_AT = 12  # hits from which windows are chosen
_COUPLED = 36  # and the force channel's coupling
_AT_ONCE = 2**18  # samples that are transformed together: fast, and within a processor's cache


class Source(Protocol):
    """Hits, point by point: so many points, and the hits of each, read anew at each call."""

    def __len__(self) -> int: ...

    def __getitem__(self, point: int, /) -> Sequence[Hit]: ...


def by_point(hits: Sequence[Hit]) -> list[list[Hit]]:
    """Hits that lie in memory, grouped by where they were hit and measured, in order of
    appearance.
    """
    points: dict[object, list[Hit]] = {}
    for hit in hits:
        points.setdefault(hit.pair, []).append(hit)
    return list(points.values())


class Spectra:
    """The frequency lines and choices of one processing, fixed by its first hits.

    Args:
        source: the hits.
        processing: the choices.
        rate_sd: standard deviation of the exponential window's rate, 1/s; None where nothing shows
            whether there was another.
    """

    def __init__(self, source: Source, processing: Processing, rate_sd: float | None = 0.0) -> None:
        if len(source) == 0 or len(source[0]) == 0:
            raise InputError("hits", "is empty; processing needs at least one hit")
        first = source[0][0]
        self.samples, self.sample_rate = first.samples, first.sample_rate_hz
        if abs(processing.delay_s) > 0.5 * (block_s := self.samples / self.sample_rate):
            raise InputError(
                "delay_s",
                f"is {processing.delay_s:g} s, expected at most half a block of {block_s:g} s",
            )
        kinds = sorted({block.quantity for block in first.responses})
        if len(kinds) > 1:
            raise InputError(
                "responses", f"hold {', '.join(kinds)}; process one kind of response at a time"
            )
        (self.quantity,) = kinds
        frequency = scipy.fft.rfftfreq(self.samples, 1 / self.sample_rate)
        low, high = processing.band_hz or (0.5 * frequency[1], USABLE_SHARE * self.sample_rate)
        self.lines = np.flatnonzero((frequency >= low) & (frequency <= high))
        if self.lines.size < _FEWEST_LINES:
            raise InputError(
                "band_hz",
                f"is {low:g} to {high:g} Hz and holds {self.lines.size} of the lines, which lie"
                f" {frequency[1]:g} Hz apart up to {frequency[-1]:g} Hz; expected {_FEWEST_LINES}"
                " at least",
            )
        self.lines = np.arange(self.lines[0], self.lines[-1] + 1)
        self.frequency = frequency[self.lines]
        self.delay = (
            np.exp(2j * np.pi * self.frequency * processing.delay_s) if processing.delay_s else None
        )
        looked: list[tuple[Hit, HitFeatures]] = []
        more: list[tuple[Hit, HitFeatures]] = []
        step = max(1, len(source) // _LOOKED_AT)
        for number in range(0, len(source), step)[:_LOOKED_AT]:
            first_hit, *others = (
                (hit, find_features([hit])[0]) for hit in source[number][: _COUPLED // _LOOKED_AT]
            )
            looked.append(first_hit)
            more += others
        self.windows = processing.windows or choose_windows(looked)
        self.coupling = (
            None if self.windows.force_length_s is None else find_coupling([*looked, *more])
        )
        self.processing = replace(
            processing,
            windows=self.windows,
            band_hz=(float(self.frequency[0]), float(self.frequency[-1])),
        )
        self.rate, self.rate_sd = total_rate(first, self.windows), rate_sd
        self._kept = threading.local()
        self.compared = self._excited(
            [hit for hit, _ in looked], [features for _, features in looked]
        )
        self.basis = self._basis([*looked, *more]) if processing.positions else None

    def _excited(self, hits: Sequence[Hit], features: Sequence[HitFeatures]) -> slice:
        """Kept lines on which hits are compared: those that the hammer excites."""
        power = np.median(
            [
                np.abs(self.stack([h], [t], [0])[0][0]) ** 2 / max(t.pulse.height**2, 1e-300)
                for h, t in zip(hits, features, strict=True)
            ],
            axis=0,
        )
        weak = np.flatnonzero(power < EXCITED * power.max())
        start = int(np.argmax(power >= EXCITED * power.max()))
        weak = weak[weak > start]
        stop = int(weak[0]) if weak.size else power.size
        return compare_lines(start, min(max(stop, start + 64), power.size))

    def _basis(self, sample: Sequence[tuple[Hit, HitFeatures]]) -> Basis | None:
        """What the resonances look like, from a sample of hits."""
        frfs = []
        for hit, features in sample:
            force, responses = self.stack([hit], [features], [0])
            frfs += [
                hit_frfs(force[:, self.compared], r[:, self.compared])
                for r in responses[:MOST_SENSORS]
            ]
        return find_basis(np.concatenate(frfs))

    def participation(
        self, forces: ComplexArray, responses: Sequence[ComplexArray]
    ) -> FloatArray | None:
        """(h, K) what each resonance has in each hit, over the sensors; None where places are not
        asked for.
        """
        if self.basis is None:
            return None
        force = forces[:, self.compared]
        some = responses[:MOST_SENSORS]
        return np.concatenate(
            [self.basis.participation(hit_frfs(force, r[:, self.compared])) for r in some], axis=1
        )

    def strong_window(self) -> str | None:
        """The exponential window in words, where it falls to 1 % in a quarter of the block: a
        chosen one is weaker than any such, and it takes the resonances of whatever body.
        """
        block = self.samples / self.sample_rate
        if not self.rate * block > 4 * np.log(1 / LEFT_AT_END):
            return None
        fall = np.log(1 / LEFT_AT_END) / self.rate
        return (
            f"the exponential window of {self.rate:g} per second, down to 1 % after {fall:.2g} of"
            f" {block:.2g} s,"
        )

    def check(self, hit: Hit) -> None:
        """Refuse a hit that is unlike the first.

        Raises:
            InputError: sampling rate, length, window or quantity differ.
        """
        which = f"differ: hit {hit.number} of point {hit.force.dof.point}"
        apart = abs(hit.sample_rate_hz / self.sample_rate - 1)
        if apart > SAME_RATE or hit.samples != self.samples:
            raise InputError(
                "hits",
                f"{which} has {hit.samples} samples at {hit.sample_rate_hz:.8g} Hz, the first"
                f" {self.samples} at {self.sample_rate:.8g} Hz; keep them in a campaign of"
                " their own",
            )
        if others := sorted({b.quantity for b in hit.responses} - {self.quantity}):
            raise InputError(
                "hits",
                f"{which} measures {', '.join(others)}, the first {self.quantity}; keep them in a"
                " campaign of their own",
            )
        if total_rate(hit, self.windows) != self.rate:
            raise InputError(
                "window_rate_per_s",
                f"differs: hit {hit.number} of point {hit.force.dof.point} carries "
                f"{total_rate(hit, self.windows):g} per second, the "
                f"first {self.rate:g}; keep them in a campaign of their own",
            )

    def _force(self, hit: Hit, features: HitFeatures, into: FloatArray) -> None:
        """A hit's force under both windows, with the coupling's tail in place of the noise that the
        force window has taken away.
        """
        pulse, rate = features.pulse, self.sample_rate
        if self.windows.force_length_s is None:
            windowed(hit.force, pulse.baseline, rate, self.rate, into)
            return
        kept, weights = force_window(pulse, round(self.windows.force_length_s * rate), self.samples)
        part = np.empty(weights.size)
        windowed(hit.force, pulse.baseline, rate, self.rate, part, kept)
        part *= weights
        behind = pulse.stop
        into[:behind] = 0
        if self.coupling is None:
            into[behind:] = 0
        else:
            fall = exponential(self.samples, self.coupling.rate_per_s / rate)[
                behind - pulse.peak : self.samples - pulse.peak
            ]
            np.multiply(
                fall, -self.coupling.amplitude_per_s * impulse(hit, pulse), out=into[behind:]
            )
            if self.rate:
                into[behind:] *= exponential(self.samples, self.rate / rate)[behind:]
            covered = max(behind - kept.start, 0)
            into[behind : kept.stop] *= 1 - weights[covered:]
        into[kept] += part

    def stack(
        self, hits: Sequence[Hit], features: Sequence[HitFeatures], chosen: Sequence[int]
    ) -> tuple[ComplexArray, list[ComplexArray]]:
        """(h, L) spectra of the force of the chosen hits, and of each response; a few hits at a
        time.
        """
        values: ComplexArray = np.empty(
            (1 + len(hits[0].responses), len(chosen), self.lines.size), dtype=complex
        )
        step = max(1, _AT_ONCE // (self.samples * len(values)))
        for start in range(0, len(chosen), step):
            part, some = slice(start, start + step), chosen[start : start + step]
            blocks, spectra = self._room(len(values), len(some))
            for row, i in enumerate(some):
                self._force(hits[i], features[i], blocks[0, row])
                for channel, (block, offset) in enumerate(
                    zip(hits[i].responses, features[i].offsets, strict=True), 1
                ):
                    windowed(block, offset, self.sample_rate, self.rate, blocks[channel, row])
            np.fft.rfft(blocks, out=spectra)
            values[:, part] = spectra[..., self.lines[0] : self.lines[-1] + 1]
        if self.delay is not None:
            values[1:] *= self.delay
        return values[0], list(values[1:])

    def _room(self, channels: int, hits: int) -> tuple[FloatArray, npt.NDArray[np.complex128]]:
        """Memory for the blocks of so many channels and hits and their transforms, the same at each
        call of a thread: new memory costs as much as the transforms.
        """
        kept: tuple[FloatArray, npt.NDArray[np.complex128]] | None = getattr(
            self._kept, "room", None
        )
        shape = channels, hits
        if kept is None or kept[0].shape[:2] != shape:
            kept = (
                np.empty((*shape, self.samples)),
                np.empty((*shape, self.samples // 2 + 1), dtype=complex),
            )
            self._kept.room = kept
        return kept
