"""Spectra of hits under one set of windows, on one set of frequency lines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np
from scipy import fft

from fecore.arrays import ComplexArray, FloatArray, IntArray
from fecore.errors import InputError
from fecore.processing.blocks import Hit
from fecore.processing.choice import choose_windows
from fecore.processing.comparison import compare_lines
from fecore.processing.coupling import find_coupling, impulse
from fecore.processing.document import Processing
from fecore.processing.traits import Traits, find_traits
from fecore.processing.windows import keep_pulse, total_rate, windowed

USABLE_SHARE = 1 / 2.56
"""Highest line over the sampling rate: analysers' anti-alias filters are flat to there."""

EXCITED = 0.01
"""Hits are compared where the force's power is at least this share of its largest (-20 dB)."""

_LOOKED_AT = 12  # hits from which windows are chosen
_COUPLED = 36  # and the force channel's coupling


class Source(Protocol):
    """Hits, point by point: so many points, and the hits of each, read anew at each call."""

    def __len__(self) -> int: ...

    def __getitem__(self, point: int, /) -> Sequence[Hit]: ...


def by_point(hits: Sequence[Hit]) -> list[list[Hit]]:
    """Hits that lie in memory, grouped by where they were hit and measured, in order of appearance."""
    points: dict[object, list[Hit]] = {}
    for hit in hits:
        points.setdefault(hit.pair, []).append(hit)
    return list(points.values())


class Spectra:
    """The frequency lines and choices of one processing, fixed by its first hits."""

    def __init__(self, source: Source, processing: Processing) -> None:
        if len(source) == 0 or len(source[0]) == 0:
            raise InputError("hits", "is empty; processing needs at least one hit")
        first = source[0][0]
        self.samples, self.sample_rate = first.samples, first.sample_rate_hz
        self.kinds = tuple(block.quantity for block in first.responses)
        if len(set(self.kinds)) > 1:
            raise InputError(
                "responses", f"hold {', '.join(sorted(set(self.kinds)))}; process one kind of response at a time"
            )
        frequency = fft.rfftfreq(self.samples, 1 / self.sample_rate)
        low, high = processing.band_hz or (0.5 * frequency[1], USABLE_SHARE * self.sample_rate)
        self.lines = np.flatnonzero((frequency >= low) & (frequency <= high))
        if not self.lines.size:
            raise InputError("band_hz", f"holds none of the lines {frequency[1]:g} to {frequency[-1]:g} Hz")
        self.lines = np.arange(self.lines[0], self.lines[-1] + 1)
        self.frequency = frequency[self.lines]
        self.delay = np.exp(2j * np.pi * self.frequency * processing.delay_s) if processing.delay_s else None
        looked, more = [], []
        step = max(1, len(source) // _LOOKED_AT)
        for number in range(0, len(source), step)[:_LOOKED_AT]:
            first_hit, *others = ((hit, find_traits(hit)) for hit in source[number][: _COUPLED // _LOOKED_AT])
            looked.append(first_hit)
            more += others
        self.windows = processing.windows or choose_windows(looked)
        self.coupling = None if self.windows.force_length_s is None else find_coupling([*looked, *more])
        self._time = np.arange(self.samples) / self.sample_rate
        self.processing = replace(
            processing, windows=self.windows, band_hz=(float(self.frequency[0]), float(self.frequency[-1]))
        )
        self.rate = total_rate(first, self.windows)
        self.compared = self._excited([hit for hit, _ in looked], [traits for _, traits in looked])

    def _excited(self, hits: Sequence[Hit], traits: Sequence[Traits]) -> IntArray:
        """Kept lines on which hits are compared: those that the hammer excites."""
        power = np.median(
            [np.abs(self.of(h, t)[0]) ** 2 / max(t.pulse.height**2, 1e-300) for h, t in zip(hits, traits, strict=True)],
            axis=0,
        )
        weak = np.flatnonzero(power < EXCITED * power.max())
        start = int(np.argmax(power >= EXCITED * power.max()))
        weak = weak[weak > start]
        stop = int(weak[0]) if weak.size else power.size
        return compare_lines(np.arange(start, max(stop, start + 64))[: power.size - start])

    def check(self, hit: Hit) -> None:
        """Refuse a hit that is unlike the first.

        Raises:
            InputError: sampling rate, length, window or quantity differ.
        """
        if hit.sample_rate_hz != self.sample_rate or hit.samples != self.samples:
            raise InputError(
                "hits",
                f"differ: hit {hit.number} of point {hit.force.dof.point} has {hit.samples} samples at "
                f"{hit.sample_rate_hz:g} Hz, the "
                f"first {self.samples} at {self.sample_rate:g} Hz; process them apart",
            )
        if tuple(b.quantity for b in hit.responses) != self.kinds:
            raise InputError(
                "hits",
                f"differ: hit {hit.number} of point {hit.force.dof.point} measures another quantity; process them "
                f"apart",
            )
        if total_rate(hit, self.windows) != self.rate:
            raise InputError(
                "window_rate_per_s",
                f"differs: hit {hit.number} of point {hit.force.dof.point} carries "
                f"{total_rate(hit, self.windows):g} per second, the "
                f"first {self.rate:g}; process them apart",
            )

    def of(self, hit: Hit, traits: Traits) -> tuple[ComplexArray, list[ComplexArray]]:
        """Spectra of force and responses on the kept lines."""
        force = windowed(hit.force, traits.pulse.baseline, self.sample_rate, self.rate)
        if self.windows.force_length_s is not None:
            kept = keep_pulse(force, traits.pulse, round(self.windows.force_length_s * self.sample_rate))
            self._keep_tail(force, hit, traits, kept)
        cut = slice(self.lines[0], self.lines[-1] + 1)
        responses = [
            fft.rfft(windowed(block, before.offset, self.sample_rate, self.rate))[cut]
            for block, before in zip(hit.responses, traits.before, strict=True)
        ]
        if self.delay is not None:
            responses = [r * self.delay for r in responses]
        return fft.rfft(force)[cut], responses

    def _keep_tail(self, force: FloatArray, hit: Hit, traits: Traits, kept: FloatArray) -> None:
        """Put the coupling's tail in place of the noise that the force window has taken away."""
        if self.coupling is None:
            return
        behind = traits.pulse.stop
        time = self._time[behind:] - self._time[traits.pulse.peak]
        tail = self.coupling.tail(impulse(hit, traits.pulse), time)
        if self.rate:
            tail *= np.exp(-self.rate * self._time[behind:])
        force[behind:] += (1 - kept[behind:]) * tail

    def stack(
        self, hits: Sequence[Hit], traits: Sequence[Traits], chosen: Sequence[int]
    ) -> tuple[ComplexArray, list[ComplexArray]]:
        """(h, L) spectra of the force of the chosen hits, and of each response."""
        count, channels = len(chosen), len(self.kinds)
        forces = np.empty((count, self.lines.size), dtype=complex)
        responses = [np.empty_like(forces) for _ in range(channels)]
        for row, i in enumerate(chosen):
            forces[row], found = self.of(hits[i], traits[i])
            for target, values in zip(responses, found, strict=True):
                target[row] = values
        return forces, responses
