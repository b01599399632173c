"""Spectra as bytes: little-endian, in the precision that the file had, with a SHA-256 that every
read verifies.
"""

import hashlib
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from fecore.arrays import FloatArray
from service.platform.errors import Damaged, verified

Stored = Literal["<c8", "<c16", "<f4", "<f8"]

AXIS_TOLERANCE = 1e-12
"""Relative to the last line: an axis that strays less from even steps than this is stored as start,
step, count.
"""


@dataclass(frozen=True)
class Spectrum:
    """An array as it lies in the database."""

    dtype: Stored  # numpy's name of the little-endian type
    count: int  # number of values
    data: bytes  # the bytes
    sha256: bytes  # of the bytes

    def columns(self) -> dict[str, Any]:
        """The spectrum's columns of an FRF's row."""
        return {"dtype": self.dtype, "lines": self.count, "data": self.data, "sha256": self.sha256}


def encode(values: NDArray[np.complexfloating] | NDArray[np.floating]) -> Spectrum:
    """One-dimensional values as little-endian bytes with their SHA-256; the precision stays as it
    is.

    Args:
        values: (L,) complex64, complex128, float32 or float64.
    """
    kinds: dict[str, Stored] = {"c8": "<c8", "c16": "<c16", "f4": "<f4", "f8": "<f8"}
    dtype = kinds[f"{values.dtype.kind}{values.dtype.itemsize}"]
    data = np.ascontiguousarray(values, dtype=dtype).tobytes()
    return Spectrum(dtype, int(values.size), data, hashlib.sha256(data).digest())


def decode(spectrum: Spectrum) -> NDArray[np.complexfloating] | NDArray[np.floating]:
    """The values, read-only, after their SHA-256 has been verified.

    Raises:
        Damaged: the bytes are not the ones that were stored.
    """
    data = verified(spectrum.data, spectrum.sha256, "spectrum")
    values: NDArray[np.complexfloating] = np.frombuffer(data, dtype=spectrum.dtype)
    if values.size != spectrum.count:
        raise Damaged("spectrum", spectrum.sha256)
    return values


@dataclass(frozen=True)
class FrequencyAxis:
    """A frequency axis: even (start, step, count) or, where it is uneven, its lines."""

    start_hz: float  # first line
    step_hz: float | None  # spacing; None where it is uneven
    count: int  # number of lines
    lines: bytes | None = None  # float64 bytes, little-endian, of an uneven axis

    def columns(self) -> dict[str, Any]:
        """The axis' columns of an FRF's row."""
        return {
            "start_hz": self.start_hz,
            "end_hz": self._end_hz(),
            "step_hz": self.step_hz,
            "axis": self.lines,
        }

    def frequency_hz(self) -> FloatArray:
        """(count,) frequency lines, Hz: start + k step."""
        if self.lines is not None:
            return np.frombuffer(self.lines, dtype="<f8").astype(np.float64)
        return self.start_hz + (self.step_hz or 0.0) * np.arange(self.count, dtype=np.float64)

    def _end_hz(self) -> float:
        if self.lines is not None:
            return float(self.frequency_hz()[-1])
        return self.start_hz + (self.step_hz or 0.0) * (self.count - 1)


def encode_axis(frequency_hz: FloatArray) -> FrequencyAxis:
    """The axis in its shortest form that gives the same lines back: start, step and count where
    every line is within AXIS_TOLERANCE of the last one's frequency, else an array.

    Args:
        frequency_hz: (L,) increasing, Hz.
    """
    count, start = int(frequency_hz.size), float(frequency_hz[0])
    if count == 1:
        return FrequencyAxis(start, None, 1, np.asarray(frequency_hz, "<f8").tobytes())
    step = float(frequency_hz[-1] - start) / (count - 1)
    even = start + step * np.arange(count)
    if float(np.max(np.abs(even - frequency_hz))) <= AXIS_TOLERANCE * abs(float(frequency_hz[-1])):
        return FrequencyAxis(start, step, count)
    return FrequencyAxis(start, None, count, np.asarray(frequency_hz, "<f8").tobytes())
