"""Named arrays, and the sampling rate among them."""

from __future__ import annotations

from typing import Any

import numpy as np

from modalbase.formats.errors import FormatError
from modalbase.formats.types import FloatArray

Variables = dict[str, np.ndarray[Any, Any]]

SAMPLE_RATE = "sample_rate_hz"
"""Name of the variable that a wav file's own sampling rate becomes."""

_UNEVEN = 1e-3
_OTHER_RATE = 0.01  # by which a stated rate may differ from the file's own
_FASTEST_HZ = 1e9  # no analyser of vibrations samples faster


def variable(variables: Variables, name: str) -> np.ndarray[Any, Any]:
    """The array of a name.

    Raises:
        FormatError: the file has none; lists those that it has.
    """
    if name not in variables:
        raise FormatError(name, f"is not in the file; it has {', '.join(sorted(variables))}")
    return variables[name]


def described(array: np.ndarray[Any, Any]) -> str:
    """Type and shape of an array, and its least and greatest value where it has such."""
    extent = "" if array.dtype.kind == "c" or not array.size else f", {array.min():.3g} to {array.max():.3g}"
    return f"{array.dtype} {list(array.shape)}{extent}"


def is_named(given: Any) -> bool:
    """Whether a mapping's value is `{"variable": name}`."""
    return isinstance(given, dict) and set(given) == {"variable"} and isinstance(given["variable"], str)


def sampling_rate(variables: Variables, given: float | str, samples: int) -> float:
    """Samples a second: a number, or the name of the variable that holds it or the time axis of so many samples.

    Raises:
        FormatError: it is no rate, the axis is uneven or of another length, or the file says another.
    """
    if not isinstance(given, str):
        rate = float(given)
        own = variables.get(SAMPLE_RATE, np.array(rate))
        if own.size == 1 and own.dtype.kind != "c" and abs(rate - float(own.item())) > _OTHER_RATE * abs(rate):
            raise FormatError(
                "mapping.sample_rate_hz",
                f'is {rate:g}, and the file says {float(own.item()):g}; state {{"variable": "{SAMPLE_RATE}"}}',
            )
    else:
        values = real(np.ravel(variable(variables, given)), given)
        if values.size == 1:
            rate = float(values[0])
        elif values.size == samples:
            steps = np.diff(values)
            step = float(values[-1] - values[0]) / (samples - 1)
            uneven = float(np.abs(steps - step).max())
            if not (step > 0 and uneven <= _UNEVEN * step + 1e-6 * abs(float(values[-1]))):
                raise FormatError(given, "is not an evenly rising time axis")
            rate = 1 / step
        else:
            raise FormatError(given, f"has {values.size} values, expected the rate or a time axis of {samples}")
    if not 0 < rate <= _FASTEST_HZ:
        expected = f"expected a positive number of samples a second, up to {_FASTEST_HZ:g}"
        raise FormatError("mapping.sample_rate_hz", f"is {rate:g}, {expected}")
    return float(f"{rate:.12g}")


def real(values: np.ndarray[Any, Any], name: str) -> FloatArray:
    """Values as reals.

    Raises:
        FormatError: they are complex.
    """
    if values.dtype.kind == "c":
        raise FormatError(name, "holds complex numbers")
    return np.asarray(values, dtype=float)
