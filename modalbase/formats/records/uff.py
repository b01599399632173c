"""The time blocks of a UFF file as one recording."""

from pathlib import Path

import numpy as np

from modalbase.formats.errors import FormatError
from modalbase.formats.records.arrays import SAMPLE_RATE, Variables
from modalbase.formats.records.recording import Arrays
from modalbase.formats.records.scale import SI
from modalbase.formats.uff import Limits, TimeResponse, UffError, read_file


def open_uff(path: Path) -> Arrays:
    """The time blocks of a UFF file by `channel_of`, and their rate; its reader has brought them to
    SI by the file's own units.

    Raises:
        FormatError: it cannot be read, or has several blocks of one channel.
    """
    variables: Variables = {}
    try:
        for item in read_file(path, Limits()):
            if isinstance(item, TimeResponse):
                name = channel_of(item)
                if variables.setdefault(name, item.samples) is not item.samples:
                    raise FormatError(
                        name, "is in the file several times: as single hits, which need no mapping"
                    )
                if (
                    variables.setdefault(SAMPLE_RATE, np.array(item.sample_rate_hz))
                    != item.sample_rate_hz
                ):
                    raise FormatError(
                        name,
                        "differs in rate from another channel; those of a hit are on one clock",
                    )
    except UffError as error:
        raise FormatError("", f"{error.reason} (byte {error.offset})") from error
    units = {name: SI[name.partition("_")[0]] for name in variables if name != SAMPLE_RATE}
    return Arrays(variables, units)


def is_force(channel: str) -> bool:
    """Whether a channel of that name is the force."""
    return channel.startswith("force_")


def channel_of(block: TimeResponse) -> str:
    """Name of a block's channel, by what it measures, its point and direction:
    `acceleration_33_3`.
    """
    return f"{block.quantity}_{block.response_point}_{block.response_direction}"
