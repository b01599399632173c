"""The one place that writes arrays by name, and columns: npz, HDF5, Arrow, Parquet."""

import shutil
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, date
from typing import IO, Any

import numpy as np

from modalbase.formats.registry import FORMATS, HDF5, PARQUET

Write = Callable[[IO[bytes]], None]
"""What fills a file that is open for bytes."""


@dataclass(frozen=True)
class ArrayWriter:
    """A way to write arrays by name, or columns of one length."""

    media_type: str
    write: Callable[[Mapping[str, Any], IO[bytes]], None]


def write_npz(arrays: Mapping[str, Any], file: IO[bytes]) -> None:
    """Write arrays as npz, an array by name."""
    np.savez(
        file, allow_pickle=False, **{name: np.asarray(array) for name, array in arrays.items()}
    )


def write_hdf5(arrays: Mapping[str, Any], file: IO[bytes]) -> None:
    """Write arrays as HDF5, a dataset by name."""

    def fill(made: Any) -> None:
        for name, array in arrays.items():
            add_dataset(made, name, array)

    with_hdf5(fill, file)


def with_hdf5(fill: Callable[[Any], Any], file: IO[bytes]) -> None:
    """Write an HDF5 file that a function fills. It lies on disk first, as h5py reads what it has
    written, which a file that is only written cannot.
    """
    h5py = FORMATS["hdf5"].dependency("h5py")
    with tempfile.TemporaryFile() as spool:
        with h5py.File(spool, "w") as made:
            fill(made)
        spool.seek(0)
        shutil.copyfileobj(spool, file)


def add_dataset(made: Any, name: str, array: Any) -> None:
    """Add an array to an open HDF5 file; texts in UTF-8."""
    values = np.asarray(array)
    if values.dtype.kind == "U":
        h5py = FORMATS["hdf5"].dependency("h5py")
        made.create_dataset(name, data=values.astype(object), dtype=h5py.string_dtype())
    else:
        made.create_dataset(name, data=values)


def write_parquet(columns: Mapping[str, Any], file: IO[bytes]) -> None:
    """Write columns of one length as Parquet; single values stand in every row."""
    as_parquet(lambda stream: write_arrow(columns, stream), file)


def as_parquet(write: Write, file: IO[bytes]) -> None:
    """Write as Parquet what a function writes as an Arrow IPC stream, a batch at a time."""
    reader = PARQUET.dependency("arro3.io")
    with tempfile.TemporaryFile() as stream:
        write(stream)
        stream.seek(0)
        reader.write_parquet(reader.read_ipc_stream(stream), file)


def write_arrow(columns: Mapping[str, Any], file: IO[bytes]) -> None:
    """Write columns of one length as an Arrow IPC stream: float64, int64, bool or text, null where
    a value is None; times are texts in ISO 8601.
    """
    import nanoarrow as na
    from nanoarrow.ipc import StreamWriter

    count = max((len(each) for each in columns.values() if np.ndim(each)), default=1)
    whole = {
        name: each if np.ndim(each) else [np.asarray(each).item()] * count
        for name, each in columns.items()
    }
    made = {name: _column(each) for name, each in whole.items()}
    schema = na.struct({name: kind for name, (kind, _) in made.items()})
    children = [na.c_array(values, kind) for kind, values in made.values()]
    with StreamWriter.from_writable(file) as writer:
        writer.write_array(na.c_array_from_buffers(schema, count, [None], children=children))


def _column(values: Any) -> tuple[Any, Any]:
    """The type of a column, and its values as nanoarrow takes them."""
    import nanoarrow as na

    if isinstance(values, np.ndarray) and values.dtype.kind in "fiu":
        kind = "f" if values.dtype.kind == "f" else "i"
        return (na.float64() if kind == "f" else na.int64()), np.ascontiguousarray(
            values, f"{kind}8"
        )
    known = [one for one in values if one is not None]
    if known and all(isinstance(one, bool | np.bool_) for one in known):
        return na.bool_(), [None if one is None else bool(one) for one in values]
    if known and all(isinstance(one, int) and not isinstance(one, bool) for one in known):
        return na.int64(), list(values)
    if all(isinstance(one, int | float) for one in known):
        return na.float64(), [None if one is None else float(one) for one in values]
    return na.string(), [None if one is None else _text(one) for one in values]


def _text(value: Any) -> str:
    if isinstance(value, date):
        utc = value.astimezone(UTC) if hasattr(value, "astimezone") else value
        return utc.isoformat().replace("+00:00", "Z")
    return str(value)


ARRAY_WRITERS: Mapping[str, ArrayWriter] = {
    "npz": ArrayWriter("application/x-npz", write_npz),
    "hdf5": ArrayWriter(HDF5, write_hdf5),
    "parquet": ArrayWriter(PARQUET.writers[0].media_type, write_parquet),
}
"""Ways to write arrays by name, by theirs in `?format=`; those of Parquet are columns."""
