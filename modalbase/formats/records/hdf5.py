"""Datasets of an HDF5 file, whole or part by part, with h5py.

A dataset is named by its path with dots, `daq.acc`, as in a .mat of version 7.3, which is HDF5 too.
An attribute that is a number or a text is `daq.acc@rate`: a mapping may name it as any variable.
`unit` and `units` of a dataset are the unit that the file states of it; other attributes count
where the mapping names them. Nothing outside the file is read.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from modalbase.formats.errors import FormatError
from modalbase.formats.records.arrays import Variables, channels_of, real
from modalbase.formats.records.npz import Channel, NpzRecording
from modalbase.formats.records.wav import FRAMES
from modalbase.formats.registry import FORMATS
from modalbase.formats.types import FloatArray

_BROKEN = (OSError, KeyError, ValueError, RuntimeError, TypeError, OverflowError, MemoryError)
_COMPLEX = ("real", "imag")
_SMALL = 1000  # elements up to which an array is read whole
_FREE_BYTES, _DENSEST = 1 << 26, 100
"""What a dataset may take whatever the file's size, and how many times its size at most: none that
was measured compresses better.
"""


@contextmanager
def in_one_line(name: str) -> Iterator[None]:
    """What is wrong with a dataset, in one line that names it."""
    try:
        yield
    except FormatError:
        raise
    except _BROKEN as error:
        why = " ".join(str(error).split()) or type(error).__name__
        raise FormatError(name, f"cannot be read: {why}") from None


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """The file.

    Raises:
        FormatError: it is damaged or cut short, or h5py is not installed.
    """
    h5py = FORMATS["hdf5"].dependency("h5py")
    with in_one_line(""), h5py.File(path, "r") as file:
        yield file


def hdf5_arrays(path: Path, limit_bytes: int | None) -> Variables:
    """The datasets of numbers, and texts and numbers of attributes.

    Raises:
        FormatError: the file is damaged, or takes more bytes than allowed; names the dataset.
    """
    with opened(path) as file:
        declared = 0
        arrays: Variables = {}
        for name, dataset in datasets(file):
            declared += dataset.size * dataset.dtype.itemsize
            if limit_bytes is not None and declared > limit_bytes:
                raise FormatError(
                    name, f"declares {declared} bytes, more than the {limit_bytes} that are allowed"
                )
            values = whole(name, dataset)
            if values is not None:
                arrays[name] = values
            elif (fields := dataset.dtype.names) and dataset.size:  # a table, column by column
                with in_one_line(name):
                    rows = dataset[()]
                columns = {f"{name}.{field}": _readable(rows[field]) for field in fields}
                arrays |= {own: array for own, array in columns.items() if array is not None}
        return arrays | attributes(file)


def hdf5_texts(path: Path, _most_bytes: int) -> dict[str, str]:
    """Texts of attributes and datasets, by name; no array of numbers is read for them."""
    with opened(path) as file:
        stated = attributes(file)
        for name, dataset in datasets(file):
            if dataset.dtype.kind in "OS" and (values := whole(name, dataset)) is not None:
                stated[name] = values
    return {
        name: "\n".join(map(str, np.ravel(array)))
        for name, array in stated.items()
        if array.dtype.kind == "U"
    }


class Hdf5Recording(NpzRecording):
    """The heads of the datasets of an HDF5, which are channels and columns as those of an npz are."""

    def chunks(self, names: Sequence[str]) -> Iterator[FloatArray]:
        """(channels, n) parts of these channels in order, in the unit of the file. Columns of one
        dataset are read together.

        Raises:
            FormatError: a dataset is damaged; names it.
        """
        own = [self.channels[name] for name in names]
        kind = np.result_type(np.float32, *(channel.dtype for channel in own))
        together: dict[str, list[int]] = {}
        for channel in own:
            together.setdefault(channel.array, []).append(channel.first)
        with opened(self.path) as file:
            known = {name: dataset for name, dataset in datasets(file) if name in together}
            widest = max(max(columns) - min(columns) + 1 for columns in together.values())
            frames = max(FRAMES // widest, 1024)
            for first in range(0, own[0].length, frames):
                count = min(frames, own[0].length - first)
                blocks = {
                    name: _rows(name, known[name], columns, first, count)
                    for name, columns in together.items()
                }
                rows = [
                    real(blocks[channel.array][channel.first], name)
                    for channel, name in zip(own, names, strict=True)
                ]
                yield np.array(rows, kind)


def _rows(
    name: str, dataset: Any, columns: Sequence[int], first: int, count: int
) -> dict[int, np.ndarray[Any, Any]]:
    """So many samples of some columns of a dataset, whose longer side is the time."""
    low, high = min(columns), max(columns) + 1
    sides = [k for k, side in enumerate(dataset.shape) if side != 1]
    time = max(sides, key=lambda k: (dataset.shape[k], -k))
    where = [slice(0, 1)] * dataset.ndim
    for k in sides:
        where[k] = slice(first, first + count) if k == time else slice(low, high)
    with in_one_line(name):
        block = _scaled(dataset, np.asarray(dataset[tuple(where)]))
    rows = block.reshape(count, -1).T if time == sides[0] else block.reshape(-1, count)
    return {column: rows[column - low] for column in columns}


def open_hdf5(path: Path) -> Hdf5Recording:
    """The datasets that are channels, or whose columns are, and the small ones.

    Raises:
        FormatError: the file is damaged, or holds no channel; names the dataset.
    """
    channels: dict[str, Channel] = {}
    most = max(_FREE_BYTES, _DENSEST * path.stat().st_size)
    with opened(path) as file:
        small = attributes(file)
        for name, dataset in datasets(file):
            columns = channels_of(name, dataset.shape)
            if dataset.dtype.kind in "fiuc" and columns:
                if (size := dataset.size * dataset.dtype.itemsize) > most:
                    raise FormatError(
                        name, f"claims {size} bytes, more than any measurement of this file's size"
                    )
                for k, own in enumerate(columns):
                    channels[own] = Channel(name, dataset.dtype, max(dataset.shape), k)
            if dataset.size <= _SMALL and (values := whole(name, dataset)) is not None:
                small[name] = values
    if not channels:
        raise FormatError("", "holds no dataset of one or two dimensions, which channels are")
    return Hdf5Recording(path, channels, small)


def datasets(file: Any) -> Iterator[tuple[str, Any]]:
    """The datasets of a file by name, those of groups within groups too; no links are followed.

    Raises:
        FormatError: two have one name, or the values of one lie in another file.
    """
    h5py = FORMATS["hdf5"].dependency("h5py")
    known: dict[str, Any] = {}

    def take(path: str, item: Any) -> None:
        if not isinstance(item, h5py.Dataset) or item.shape is None:
            return
        if (name := path.replace("/", ".")) in known:
            raise FormatError(name, "is the name of two datasets, as dots stand for groups")
        require_inside(name, item)
        known[name] = item

    file.visititems(take)
    yield from known.items()


def require_inside(name: str, dataset: Any) -> None:
    """Refuse a dataset whose values lie in another file.

    Raises:
        FormatError: they do.
    """
    if dataset.external or dataset.is_virtual:
        raise FormatError(name, "has its values in other files, which are not read")


def attributes(file: Any) -> Variables:
    """Texts and single numbers of attributes, as `path@name`; those of the file are `@name`."""
    h5py = FORMATS["hdf5"].dependency("h5py")
    arrays: Variables = {}

    def take(path: str, item: Any) -> None:
        for name in item.attrs:
            with in_one_line(f"{path}@{name}"):
                if isinstance(value := item.attrs[name], h5py.Empty):
                    continue
                values = _readable(np.asarray(value))
            if values is not None and 0 < values.size <= _SMALL:
                arrays[f"{path.replace('/', '.')}@{name}"] = values

    take("", file)
    file.visititems(take)
    return arrays


def whole(name: str, dataset: Any) -> np.ndarray[Any, Any] | None:
    """The values of a dataset: numbers, complex ones, texts; None of others."""
    with in_one_line(name):
        if dataset.dtype.kind in "OS" and dataset.size > _SMALL:
            return None
        values = _readable(np.asarray(dataset[()]))
        return values if values is None else _scaled(dataset, values)


def _scaled(dataset: Any, values: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Numbers that are stored packed, as netCDF has them: times `scale_factor` plus `add_offset`."""
    factor, offset = (dataset.attrs.get(name) for name in ("scale_factor", "add_offset"))
    if values.dtype.kind not in "fiuc" or (factor is None and offset is None):
        return values
    factor, offset = (1.0 if factor is None else factor), (0.0 if offset is None else offset)
    return np.asarray(values * np.float64(np.squeeze(factor)) + np.float64(np.squeeze(offset)))


def _readable(values: np.ndarray[Any, Any]) -> np.ndarray[Any, Any] | None:
    if values.dtype.names == _COMPLEX and all(
        values.dtype[part].kind in "fiu" for part in _COMPLEX
    ):
        return np.asarray(values["real"] + 1j * values["imag"])
    if values.dtype.kind in "SO":
        texts = [
            one.decode("utf-8", "replace") if isinstance(one, bytes) else one
            for one in values.ravel().tolist()
        ]
        known = texts and all(isinstance(one, str) for one in texts)
        return np.array(texts).reshape(values.shape) if known else None
    return values if values.dtype.kind in "fiucU" else None
