"""What one channel recorded of one hit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from modalbase.formats.types import FloatArray

ChannelQuantity = Literal["force", "acceleration", "velocity", "displacement"]


@dataclass(frozen=True, eq=False)
class TimeBlock:
    """One channel's time block of one hit, in SI.

    Attributes:
        quantity: what the samples are.
        point, direction: where the sensor sits, or where the hammer hit for a force.
        force_point, force_direction: where the hit was that this block belongs to.
        hit: number of the hit at its point, from 1.
        sample_rate_hz: samples a second.
        samples: (n,) float32 or float64, N, m/s², m/s or m.
        window_rate_per_s: r where the analyser has multiplied the block by exp(-r t); 0 for none.
        full_scale: largest magnitude that the channel can record, in SI; None where it is not known.
        sensitivity: volts (or counts) per SI unit that the samples were divided by; 1 where they were in SI.
        label: name of the variable or column, or the first ID line.
    """

    quantity: ChannelQuantity
    point: int
    direction: int
    force_point: int
    force_direction: int
    hit: int
    sample_rate_hz: float
    samples: FloatArray
    window_rate_per_s: float = 0.0
    full_scale: float | None = None
    sensitivity: float = 1.0
    label: str = ""
