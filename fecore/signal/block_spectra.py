"""Spectra of a recording with their scatter over its blocks: what all kinds of them share.

A recording comes in chunks, and memory does not grow with its samples. All lines and pairs of
spectra share the same few blocks of it, so their errors are correlated: the spectra of blocks are
kept, in at most 40 groups.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from fecore.arrays import ComplexArray, FloatArray, IntArray
from fecore.errors import InputError
from fecore.frf import Dof

BLOCKS = 20
"""Disjoint blocks that a recording is cut into at least, and groups of blocks that are kept at
least where there are more.
"""

LEFT = 0.05
"""The exponential window at the last lag, and what is left there of the response of the slowest
mode.
"""

BAND = 1 / 2.56
"""Share of the sampling rate up to which lines are kept, as analysers do: filters begin there."""

MOST_LAGS = 8192
"""Of spectra: some 3200 lines."""

Motion = Literal["displacement", "velocity", "acceleration"]
"""What a sensor of a response measures."""

DERIVATIVE: dict[Motion, int] = {"displacement": 0, "velocity": 1, "acceleration": 2}

_UNSTATED: Motion = "acceleration"

Chunks = Callable[[], Iterable[FloatArray]]
"""Gives the (N, n) parts of a recording in their order, as often as it is called."""


@dataclass(frozen=True)
class BlockSpectra:
    """Spectra of one recording: N responses to R references."""

    frequency_hz: FloatArray  # (L,) lines, without 0 Hz
    blocks: ComplexArray  # (G, N, R, L) of each group of blocks; their weighted mean is the whole's
    weights: FloatArray  # (G,) share of each group in the recording
    responses: tuple[Dof, ...]  # N
    references: tuple[Dof, ...]  # R
    window_rate_per_s: float  # β of the exponential window that the spectra carry
    lag_s: float  # longest lag that they hold
    length_s: float  # of what was used of the recording

    @property
    def mean(self) -> ComplexArray:
        """(N, R, L) spectra of the whole recording."""
        whole: ComplexArray = np.einsum("g,gnrl->nrl", self.weights, self.blocks)
        return whole

    def pairs(
        self, columns: Sequence[Dof]
    ) -> tuple[ComplexArray, tuple[Dof, ...], tuple[Dof, ...]]:
        """(N R, L) the mean, pair by pair, those of a response side by side; the response of each,
        and its reference by the name that it has in `columns`.
        """
        n, r, lines = self.mean.shape
        of_each = tuple(dof for dof in self.responses for _ in columns)
        return self.mean.reshape(n * r, lines), of_each, tuple(columns) * n


class Groups:
    """Sums over groups of consecutive blocks, of which there are `BLOCKS` to twice as many where
    there are so many blocks.

    Args:
        finish: what is kept of the sum of a group, to which it is linear.
        least: blocks of the smallest group, the last one apart.
    """

    def __init__(self, finish: Callable[[ComplexArray], NDArray[Any]], least: int = 1) -> None:
        self._finish, self._full = finish, least
        self._sums, self._counts = list[NDArray[Any]](), list[int]()
        self._open: ComplexArray = np.zeros((), dtype=complex)
        self._held = 0  # blocks of the open group

    def add(self, block: ComplexArray) -> None:
        """Take in the next block."""
        if not self._held and len(self._counts) == 2 * BLOCKS:
            pairs = zip(self._sums[::2], self._sums[1::2], strict=True)
            self._sums = [first + second for first, second in pairs]
            self._full *= 2
            self._counts = [self._full] * BLOCKS
        self._open = self._open + block
        self._held += 1
        if self._held == self._full:
            self._close()

    def done(self) -> tuple[NDArray[Any], FloatArray]:
        """(G, …) sums, and (G,) how many blocks each holds."""
        if self._held:
            self._close()
        return np.array(self._sums), np.array(self._counts, dtype=float)

    def _close(self) -> None:
        self._sums.append(self._finish(self._open))
        self._counts.append(self._held)
        self._open, self._held = np.zeros((), dtype=complex), 0


def survey(chunks: Iterable[FloatArray], channels: int) -> tuple[int, FloatArray]:
    """Number of samples, and (N,) variances.

    Raises:
        InputError: a chunk has other channels, a sample is not finite, or a channel is constant.
    """
    length, sums = 0, np.zeros((2, channels))
    low, high = np.full(channels, np.inf), np.full(channels, -np.inf)
    for chunk in chunks:
        if chunk.shape[0] != channels:
            raise InputError("recording", f"has {chunk.shape[0]} channels, expected {channels}")
        if not np.isfinite(chunk).all():
            row, at = np.argwhere(~np.isfinite(chunk))[0]
            raise InputError(
                "recording",
                f"channel {row + 1} holds NaN or infinity at sample {length + at + 1}",
            )
        length += chunk.shape[1]
        sums += np.stack(
            [chunk.sum(axis=1, dtype=float), np.square(chunk).sum(axis=1, dtype=float)]
        )
        low, high = np.minimum(low, chunk.min(axis=1)), np.maximum(high, chunk.max(axis=1))
    if length and (constant := np.flatnonzero(low == high)).size:
        raise InputError(
            "recording",
            f"channel {constant[0] + 1} is {low[constant[0]]:g} throughout: it carried nothing",
        )
    mean, square = sums / max(length, 1)
    return length, square - mean**2


def segments(
    chunks: Iterable[FloatArray], size: int, hop: int | None = None
) -> Iterator[FloatArray]:
    """(N, size) parts that begin every `hop` samples, by default side by side; what is left at the
    end of the recording is not given.
    """
    hop = hop or size
    held: FloatArray = np.empty((0, 0))
    for chunk in chunks:
        held = np.concatenate((held, chunk), axis=1) if held.size else chunk
        begins = range(0, held.shape[1] - size + 1, hop)
        for at in begins:
            yield np.asarray(held[:, at : at + size], dtype=np.float64)
        held = held[:, len(begins) * hop :]


def channel_of(dof: Dof, channels: Sequence[Dof], field: str) -> int:
    """Where a degree of freedom stands among channels.

    Raises:
        InputError: nowhere.
    """
    if dof not in channels:
        raise InputError(field, f"point {dof.point} along {dof.direction} is no channel of these")
    return channels.index(dof)


def highest_of(quantities: Sequence[Motion] | None, responses: int) -> tuple[Motion, IntArray]:
    """The highest derivative among the sensors of so many responses, and (N,) how many each lies
    below it; accelerations where nothing is stated.
    """
    measured = quantities or (_UNSTATED,) * responses
    highest = max(measured, key=DERIVATIVE.__getitem__)
    return highest, np.array([DERIVATIVE[highest] - DERIVATIVE[each] for each in measured])
