"""Tables that the service writes, read back by others."""

import io
from typing import Any

import arro3.io
import nanoarrow as na


def parquet_rows(content: bytes) -> list[dict[str, Any]]:
    """The rows of a Parquet file."""
    table = na.ArrayStream(arro3.io.read_parquet(io.BytesIO(content)))
    rows: list[dict[str, Any]] = table.read_all().to_pylist()
    return rows
