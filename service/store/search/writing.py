"""Rows that a search found as CSV and as an Arrow stream."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Iterator, Sequence
from datetime import UTC, datetime, timedelta
from itertools import islice
from typing import IO, Any

import nanoarrow as na
import numpy as np
from nanoarrow.ipc import StreamWriter

from service.store.search.fields import Kind
from service.store.search.operations import Column

_TYPES: dict[Kind, Any] = {
    "text": na.string(),
    "id": na.string(),
    "number": na.float64(),
    "whole": na.int64(),
    "truth": na.bool_(),
    "time": na.timestamp("us", timezone="UTC"),
    "tags": na.string(),
    "json": na.string(),
}
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_TOGETHER = 1000  # rows of a record batch


def write_csv(columns: Sequence[Column], rows: Iterable[tuple[Any, ...]], file: IO[bytes]) -> None:
    """A header of names and a line for each row, numbers in the shortest form that is exact, times as ISO 8601."""
    text = io.TextIOWrapper(file, "utf-8", newline="", write_through=True)
    writer = csv.writer(text, lineterminator="\r\n")
    writer.writerow(column.name for column in columns)
    writer.writerows([as_text(shown(value)) for value in row] for row in rows)
    text.detach()


def write_lines(columns: Sequence[Column], rows: Iterable[tuple[Any, ...]], file: IO[bytes]) -> None:
    """A line of JSON for each row, with a member for each column."""
    names = [column.name for column in columns]
    for row in rows:
        item = dict(zip(names, map(shown, row), strict=True))
        file.write(json.dumps(item, ensure_ascii=False, allow_nan=False).encode() + b"\n")


def write_arrow(columns: Sequence[Column], rows: Iterable[tuple[Any, ...]], file: IO[bytes]) -> None:
    """An Arrow IPC stream with a column for each field: text, float64, int64, bool, or microseconds UTC."""
    schema = na.struct({column.name: _TYPES[column.field.kind] for column in columns})
    with StreamWriter.from_writable(file) as writer:
        for batch in _batches(rows):
            children = [_array(column, [row[i] for row in batch]) for i, column in enumerate(columns)]
            writer.write_array(na.c_array_from_buffers(schema, len(batch), [None], children=children))


def shown(value: Any) -> Any:
    """A value as JSON and CSV have it."""
    if isinstance(value, datetime):
        return value.astimezone(UTC).isoformat().replace("+00:00", "Z")
    return value if value is None or isinstance(value, bool | int | float | list | dict) else str(value)


def as_text(value: Any) -> Any:
    """A value as a table has it: tags with commas between them, other lists and objects as JSON."""
    if isinstance(value, list) and all(isinstance(one, str) for one in value):
        return ", ".join(value)
    return json.dumps(value, ensure_ascii=False) if isinstance(value, list | dict) else value


def _array(column: Column, values: list[Any]) -> Any:
    kind = column.field.kind
    if kind in ("id", "tags", "json"):
        values = [None if one is None else str(as_text(one)) for one in values]
    if kind != "time":
        return na.c_array(values, _TYPES[kind])
    since = np.array([0 if one is None else (one - _EPOCH) // timedelta(microseconds=1) for one in values], np.int64)
    known = np.array([one is not None for one in values], bool)
    buffers = [np.packbits(known, bitorder="little"), since]
    return na.c_array_from_buffers(_TYPES[kind], len(values), buffers, null_count=int((~known).sum()))


def _batches(rows: Iterable[tuple[Any, ...]]) -> Iterator[list[tuple[Any, ...]]]:
    row = iter(rows)
    while batch := list(islice(row, _TOGETHER)):
        yield batch
