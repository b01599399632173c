"""Recordings of responses to loads that nobody measured: a minute of three sensors of a beam."""

import io
from typing import Any

import numpy as np
import scipy

WIND: dict[str, Any] = {
    "sample_rate_hz": 128.0,
    "recording": {},
    "channels": [
        {"variable": name, "quantity": "acceleration", "sensitivity": 1, "point": point}
        | {"direction": direction}
        for name, point, direction in (("a1", 1, 3), ("a2", 2, 3), ("a3", 1, 1))
    ],
}
"""The mapping of `wind`."""


def wind(seed: int, **beside: Any) -> bytes:
    """Noise through a mode at 20 Hz, in all sensors, and what each has of its own, as npz; with
    other arrays beside.
    """
    generator = np.random.default_rng(seed)
    common, *own = generator.standard_normal((4, 7680))
    pole = 0.98 * np.exp(2j * np.pi * 20 / 128)
    mode = scipy.signal.lfilter([1.0], [1.0, -2 * pole.real, abs(pole) ** 2], common)
    file = io.BytesIO()
    np.savez(file, **{f"a{k}": mode / k + 0.1 * each for k, each in enumerate(own, 1)}, **beside)
    return file.getvalue()
