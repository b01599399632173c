"""Tables of FRFs as an Arrow IPC stream: the columns of the CSV, one record batch an FRF."""

from typing import IO, Any

import nanoarrow as na
import numpy as np
from nanoarrow.ipc import StreamWriter

from modalbase.formats.frfs.table import FrfTable

SCHEMA = na.struct(
    {
        "response_point": na.int64(),
        "response_direction": na.int8(),
        "reference_point": na.int64(),
        "reference_direction": na.int8(),
        "frequency_hz": na.float64(),
        "real": na.float64(),
        "imag": na.float64(),
        "coherence": na.float64(),
    },
    nullable=False,
)


def write_arrow(table: FrfTable, file: IO[bytes]) -> None:
    """Write FRFs as an Arrow IPC stream, a record batch for each FRF, with the columns of the CSV.

    `coherence` is null where an FRF has none. Read it with `polars.read_ipc_stream` or
    `pyarrow.ipc.open_stream`.

    Args:
        table: the FRFs; their values are taken one FRF at a time.
        file: open for writing bytes.
    """
    lines = table.frequency_hz.size
    frequency = np.ascontiguousarray(table.frequency_hz, np.float64)
    with StreamWriter.from_writable(file) as writer:
        for frf, values, coherence in table.both():
            columns = (
                np.full(lines, frf.response_point, np.int64),
                np.full(lines, frf.response_direction, np.int8),
                np.full(lines, frf.reference_point, np.int64),
                np.full(lines, frf.reference_direction, np.int8),
                frequency,
                np.ascontiguousarray(values.real, np.float64),
                np.ascontiguousarray(values.imag, np.float64),
            )
            children: list[Any] = [na.c_array(column) for column in columns]
            children.append(
                _nulls(lines) if coherence is None else na.c_array(np.ascontiguousarray(coherence))
            )
            writer.write_array(na.c_array_from_buffers(SCHEMA, lines, [None], children=children))


def _nulls(count: int) -> Any:
    """A column in which nothing is known."""
    nothing = np.zeros((count + 7) // 8, np.uint8)
    return na.c_array_from_buffers(
        na.float64(), count, [nothing, np.zeros(count)], null_count=count
    )
