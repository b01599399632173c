"""Named arrays of a file: npz, .mat (version 4 to 7 by scipy, 7.3 by h5py where it is installed),
CSV, wav.

Nothing is unpickled and nothing is guessed: what the arrays mean is the mapping's to say.
"""

import warnings
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from modalbase.formats.errors import FormatError
from modalbase.formats.npy import ARRAY, arrays_of, read_array, read_npy
from modalbase.formats.records.arrays import SAMPLE_RATE, Variables
from modalbase.formats.records.hdf5 import require_inside
from modalbase.formats.records.text import open_recording
from modalbase.formats.records.wav import read_wav_head
from modalbase.formats.registry import FORMATS, load

_DEEPEST = 8
_LONGEST_TEXT = 1000
_MOST_ELEMENTS = 10_000  # of a list of structures
_COMPRESSED = 15  # type of a compressed element of a .mat of version 7
_BLOCK_BYTES = 1 << 20
_SCIPY_LOSES = "Duplicate variable name", "Unreadable variable", "We do not support byte ordering"
"""How scipy's warnings begin behind which a variable is lost or wrong."""


def read_variables(
    path: Path, suffix: str | None = None, limit_bytes: int | None = None
) -> Variables:
    """The numeric arrays of a file by name.

    A wav file's channels are `channel_1`, `channel_2` …, from -1 to 1 also where its samples are
    integers, and its rate `sample_rate_hz`; the columns of a table of text have the names of its
    heading, see `modalbase.formats.tables`.

    Args:
        path: of the file.
        suffix: its kind where the path does not say it.
        limit_bytes: the most that its arrays may take.

    Raises:
        FormatError: the file is of another kind, damaged, empty or larger.
    """
    return read_named(path, suffix, limit_bytes)[0]


def read_named(
    path: Path, suffix: str | None = None, limit_bytes: int | None = None
) -> tuple[Variables, dict[str, str]]:
    """The numeric arrays of a file by name, and its texts, by which analysers name units and
    points; several have a line each.

    Raises:
        FormatError: as of `read_variables`.
    """
    kind = (suffix or path.suffix).lower()
    rows = {end: row for row in FORMATS.values() if row.arrays for end in row.every_suffix}
    if kind not in rows:
        known = dict.fromkeys(row.suffixes[0] for row in rows.values())
        raise FormatError("", f"is a '{kind}' file, expected one of {', '.join(known)}")
    kind = rows[kind].suffixes[0]
    try:
        arrays = load(rows[kind].arrays)(path, limit_bytes)
    except FormatError:
        raise
    except Exception as error:  # noqa: BLE001 - of damaged files the readers raise errors of a dozen kinds
        why = " ".join(str(error).split()) or type(error).__name__
        raise FormatError("", f"cannot be read as {kind}: {why}") from None
    if any("\0" in name for name in arrays):
        raise FormatError("", "has a variable whose name holds a NUL character")
    numbers = {
        name: array for name, array in arrays.items() if array.dtype.kind in "fiuc" and array.size
    }
    if not numbers:
        raise FormatError("", "holds no numeric array")
    words = {
        name: array
        for name, array in arrays.items()
        if array.dtype.kind == "U" and array.size < _LONGEST_TEXT
    }
    texts = {
        name: "\n".join(str(one).strip() for one in np.ravel(array))
        for name, array in words.items()
    }
    return numbers, texts


def _within(declared: int, limit_bytes: int | None, name: str) -> None:
    if limit_bytes is not None and declared > limit_bytes:
        raise FormatError(
            name, f"declares {declared} bytes, more than the {limit_bytes} that are allowed"
        )


def npz_arrays(path: Path, limit_bytes: int | None) -> Variables:
    """The arrays of an npz."""
    with zipfile.ZipFile(path) as archive:
        members = arrays_of(archive)
        _within(sum(member.file_size for member in members.values()), limit_bytes, "")
        arrays = {name: read_array(archive, member) for name, member in members.items()}
    return {own: array for name, each in arrays.items() for own, array in _fields(name, each)}


def npy_arrays(path: Path, limit_bytes: int | None) -> Variables:
    """The one array of an npy."""
    _within(path.stat().st_size, limit_bytes, "")
    return dict(_fields(ARRAY, read_npy(path)))


def _fields(name: str, array: np.ndarray[Any, Any]) -> list[tuple[str, np.ndarray[Any, Any]]]:
    """An array by its name, or the fields of one that has such, `table.force`."""
    fields = array.dtype.names
    return [(f"{name}.{own}", array[own]) for own in fields] if fields else [(name, array)]


def mat_arrays(path: Path, limit_bytes: int | None) -> Variables:
    """The variables of a .mat; those of structures by their path."""
    with path.open("rb") as file:
        newer = b"MATLAB 7.3" in file.read(128) or (
            file.seek(0) == 0 and file.read(8) == b"\x89HDF\r\n\x1a\n"
        )
    if newer:
        return _mat73(path, limit_bytes)
    _require_inflated(path, limit_bytes)
    reader = FORMATS["mat"].dependency("scipy.io")  # a script that reads other files lacks it
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of what scipy will change; that is no fault of the file
        for loss in _SCIPY_LOSES:
            warnings.filterwarnings("error", message=loss)
        try:
            content = reader.loadmat(path, squeeze_me=False)
        except Exception as error:  # noqa: BLE001 - on damaged files scipy raises errors of a dozen kinds
            raise FormatError("", f"cannot be read as .mat: {error}") from None
    arrays: Variables = {}
    for name, value in content.items():
        if not name.startswith("__") and isinstance(value, np.ndarray):
            _flatten(name, value, arrays)
    _within(sum(array.nbytes for array in arrays.values()), limit_bytes, "")
    return arrays


def _require_inflated(path: Path, limit_bytes: int | None) -> None:
    """Inflate the compressed elements of a .mat of version 5 to 7 block by block and keep nothing,
    before scipy does so and keeps it all.

    Raises:
        FormatError: they take more bytes than allowed.
    """
    with path.open("rb") as file:
        order: Literal["little", "big"] = "little" if file.read(128)[126:] == b"IM" else "big"
        inflated = 0
        while limit_bytes is not None and len(tag := file.read(8)) == 8:
            kind, left = (int.from_bytes(part, order) for part in (tag[:4], tag[4:]))
            if kind != _COMPRESSED:
                file.seek(left, 1)
                continue
            stream = zlib.decompressobj()
            while left and (block := file.read(min(left, _BLOCK_BYTES))):
                left -= len(block)
                while block and not stream.eof:
                    inflated += len(stream.decompress(block, _BLOCK_BYTES))
                    _within(inflated, limit_bytes, "")
                    block = stream.unconsumed_tail


def _flatten(name: str, value: np.ndarray[Any, Any], into: Variables, depth: int = 0) -> None:
    """The arrays of a structure by their path, `measurement.frf`; of cells, and of a list of
    structures, as `_joined` has them.
    """
    fields = value.dtype.names
    if fields is None and value.dtype.kind != "O":
        into[name] = value
    elif value.size <= _MOST_ELEMENTS and depth < _DEEPEST:
        elements: list[Variables] = []
        for each in value.reshape(-1):
            elements.append({})
            inside = [(f"{name}.{field}", each[field]) for field in fields or ()] or [(name, each)]
            for path, inner in inside:
                if isinstance(inner, np.ndarray):
                    _flatten(path, inner, elements[-1], depth + 1)
        into.update(_joined(name, elements))


def _joined(name: str, elements: Sequence[Variables]) -> Variables:
    """The arrays of the elements of a list: one behind the other where all have one shape, once
    what is the same in all of them, and else by the element's number, `measurement(2).frf`.
    """
    joined: Variables = {}
    for path in dict.fromkeys(path for element in elements for path in element):
        parts = {k: element[path] for k, element in enumerate(elements, 1) if path in element}
        first = next(iter(parts.values()))
        if len(parts) < len(elements) or any(part.shape != first.shape for part in parts.values()):
            rest = path.removeprefix(name)
            joined |= {f"{name}({k}){rest}": part for k, part in parts.items()}
        elif all(np.array_equal(part, first) for part in parts.values()):
            joined[path] = first
        else:
            joined[path] = np.stack(list(parts.values()))
    return joined


def _mat73(path: Path, limit_bytes: int | None) -> Variables:
    h5py = FORMATS["mat"].dependency("h5py")
    declared = 0
    with h5py.File(path, "r") as file:

        def arrays_in(name: str, item: Any, depth: int = 0) -> Variables:
            nonlocal declared
            if not isinstance(item, h5py.Dataset):
                inside = [
                    arrays_in(f"{name}.{key}" if name else key, each, depth + 1)
                    for key, each in item.items()
                    if not key.startswith("#") and depth < _DEEPEST
                ]
                return {path: array for arrays in inside for path, array in arrays.items()}
            require_inside(name, item)
            if item.attrs.get("MATLAB_empty"):
                return {}
            if h5py.check_ref_dtype(item.dtype) and item.size <= _MOST_ELEMENTS:  # cells
                cells = [file[each] for each in np.ravel(item[()])] if depth < _DEEPEST else []
                return _joined(name, [arrays_in(name, each, depth + 1) for each in cells])
            is_text = item.attrs.get("MATLAB_class") == b"char"
            if is_text and item.dtype.kind == "u" and item.size < _LONGEST_TEXT:
                return {name: np.array("".join(map(chr, np.ravel(item[()].T))))}
            whole = item.dtype.names == ("real", "imag")  # as MATLAB stores complex numbers
            if item.dtype.kind not in "fiu" and not whole:
                return {}
            declared += item.size * item.dtype.itemsize
            _within(declared, limit_bytes, name)
            values = np.asarray(item[()]).T  # MATLAB stores columns first
            return {name: values["real"] + 1j * values["imag"] if whole else values}

        return arrays_in("", file)


def csv_arrays(path: Path, limit_bytes: int | None) -> Variables:
    """The columns of a table of text."""
    _within(path.stat().st_size, limit_bytes, "")
    return open_recording(path).arrays()


def wav_arrays(path: Path, limit_bytes: int | None) -> Variables:
    """The channels of a wav, and its rate."""
    _within(path.stat().st_size, limit_bytes, "")
    wav = read_wav_head(path)
    if not wav.declared:
        warnings.warn(
            f"{path.name} declares no length: it is read to its end, and nobody knows whether it"
            " was cut off",
            stacklevel=3,
        )
    parts = [np.empty((wav.channels, 0)), *wav.chunks(wav.names, np.float64)]
    return {
        SAMPLE_RATE: np.array(wav.sample_rate_hz),
        **dict(zip(wav.names, np.hstack(parts), strict=True)),
    }
