"""What one channel recorded of one hit, and the npz in which many of them travel."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

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
        start_sample: of a block cut from a recording, its first sample there, from 0; None where it was recorded alone.
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
    start_sample: int | None = None


def arrays_of(blocks: Sequence[TimeBlock], *, numbered: bool) -> tuple[bytes, dict[str, Any]]:
    """Blocks as one npz with its mapping, as `POST /campaigns/{id}/records` takes them.

    Args:
        blocks: of whole hits, hit by hit, of the same sensors, sampling rate and length, the force first, as `blocks_of` and
            `records_from_sep005` give them.
        numbered: their hit numbers are meant; else the hits of each point are counted on.

    Returns:
        The npz, and the mapping that says what its arrays are.
    """
    sensors = {(block.quantity, block.label): block for block in blocks}
    variables: dict[str, Any] = {}
    channels = []
    for number, (key, first) in enumerate(sensors.items(), 1):
        own = [block for block in blocks if (block.quantity, block.label) == key]
        name = first.label if first.label not in ("", "file") else f"channel_{number}"  # savez has an argument `file`
        variables[name] = np.array([block.samples for block in own])
        variables[f"_point_{number}"] = np.array([block.point for block in own])
        variables[f"_direction_{number}"] = np.array([block.direction for block in own])
        channels.append(
            {
                "variable": name,
                "quantity": first.quantity,
                "point": {"variable": f"_point_{number}"},
                "direction": {"variable": f"_direction_{number}"},
                "window_rate_per_s": first.window_rate_per_s,
                "full_scale": first.full_scale,
            }
        )
        variables["_hit"] = np.array([block.hit for block in own])
    mapping: dict[str, Any] = {"sample_rate_hz": blocks[0].sample_rate_hz, "channels": channels}
    if numbered:
        mapping["hit"] = {"variable": "_hit"}
    file = io.BytesIO()
    np.savez(file, **variables)
    return file.getvalue(), mapping
