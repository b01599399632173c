"""Time blocks as one npz with its mapping, as `POST /campaigns/{id}/records` takes them."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

import numpy as np

from modalbase.formats.records.blocks import TimeBlock


def arrays_of(blocks: Sequence[TimeBlock], *, numbered: bool) -> tuple[bytes, dict[str, Any]]:
    """Blocks of whole hits, hit by hit, of the same sensors, sampling rate and length.

    Args:
        blocks: as `blocks_of` and `records_from_sep005` give them, the force first.
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
