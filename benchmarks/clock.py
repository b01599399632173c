"""What a call takes."""

import os
import time
from collections.abc import Callable
from typing import TypeVar

import numpy as np

T = TypeVar("T")


def now() -> np.ndarray:
    """Seconds of wall clock and of the processor, processes that were waited for included."""
    return np.array([time.perf_counter(), time.process_time() + sum(os.times()[2:4])])


def timed(call: Callable[[], T]) -> tuple[T, np.ndarray]:
    """A call's value, and its wall clock and processor time."""
    start = now()
    value = call()
    return value, now() - start


def least(call: Callable[[], T]) -> tuple[T, np.ndarray]:
    """The run of three that took the least processor time."""
    return min((timed(call) for _ in range(3)), key=lambda run: float(run[1][1]))


def median_ms(call: Callable[[], object], repeats: int) -> float:
    """Median time of a call in ms, after one that warms up."""
    call()
    return 1e3 * float(np.median([timed(call)[1][0] for _ in range(repeats)]))
