"""Named arrays of a file: npz, .mat (version 4 to 7 by scipy, 7.3 by h5py where it is installed), CSV, wav.

Nothing is unpickled and nothing is guessed: what the arrays mean is the mapping's to say.
"""

from __future__ import annotations

import codecs
import io
import warnings
import zipfile
import zlib
from array import array
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO, Literal

import numpy as np

from modalbase.formats.columns import read_columns
from modalbase.formats.errors import FormatError
from modalbase.formats.npy import members_of, read_array

_DEEPEST = 8
_COMPRESSED = 15  # type of a compressed element of a .mat of version 7
_BLOCK_BYTES = 1 << 20
Variables = dict[str, np.ndarray[Any, Any]]

SAMPLE_RATE = "sample_rate_hz"
"""Name of the variable that a wav file's own sampling rate becomes."""


def read_variables(path: Path, suffix: str | None = None, limit_bytes: int | None = None) -> Variables:
    """The numeric arrays of a file by name.

    A wav file's channels are `channel_1`, `channel_2` …, from -1 to 1 also where its samples are integers, and its rate
    `sample_rate_hz`; a CSV's columns have the names of its first line.

    Args:
        path: of the file.
        suffix: its kind where the path does not say it.
        limit_bytes: the most that its arrays may take.

    Raises:
        FormatError: the file is of another kind, damaged, empty or larger.
    """
    kind = (suffix or path.suffix).lower()
    if kind not in SUFFIXES:
        raise FormatError("", f"is a '{kind}' file, expected one of {', '.join(SUFFIXES)}")
    try:
        found = SUFFIXES[kind](path, limit_bytes)
    except FormatError:
        raise
    except Exception as error:  # noqa: BLE001 - of damaged files the readers raise errors of a dozen kinds
        why = " ".join(str(error).split()) or type(error).__name__
        raise FormatError("", f"cannot be read as {kind}: {why}") from None
    if any("\0" in name for name in found):
        raise FormatError("", "has a variable whose name holds a NUL character")
    numbers = {name: array for name, array in found.items() if array.dtype.kind in "fiuc" and array.size}
    if not numbers:
        raise FormatError("", "holds no numeric array")
    return numbers


def variable(variables: Variables, name: str) -> np.ndarray[Any, Any]:
    """The array of a name.

    Raises:
        FormatError: the file has none; lists those that it has.
    """
    if name not in variables:
        raise FormatError(name, f"is not in the file; it has {', '.join(sorted(variables))}")
    return variables[name]


def described(array: np.ndarray[Any, Any]) -> str:
    """Type and shape of an array, and its least and greatest value where it has such."""
    extent = "" if array.dtype.kind == "c" or not array.size else f", {array.min():.3g} to {array.max():.3g}"
    return f"{array.dtype} {list(array.shape)}{extent}"


def is_named(given: Any) -> bool:
    """Whether a mapping's value is `{"variable": name}`."""
    return isinstance(given, dict) and set(given) == {"variable"} and isinstance(given["variable"], str)


def _within(declared: int, limit_bytes: int | None, name: str) -> None:
    if limit_bytes is not None and declared > limit_bytes:
        raise FormatError(name, f"declares {declared} bytes, more than the {limit_bytes} that are allowed")


def _npz(path: Path, limit_bytes: int | None) -> Variables:
    with zipfile.ZipFile(path) as archive:
        members = members_of(archive)
        _within(sum(member.file_size for member in members), limit_bytes, "")
        found = [member for member in members if member.filename.endswith(".npy")]
        return {member.filename.removesuffix(".npy"): read_array(archive, member) for member in found}


def _scipy_io(kind: str) -> Any:
    """Scipy's readers; a script that reads other files goes without scipy."""
    try:
        from scipy import io
    except ImportError:
        raise FormatError("", f"is a {kind} file; install scipy, which modalbase[server] brings") from None
    return io


def _mat(path: Path, limit_bytes: int | None) -> Variables:
    with path.open("rb") as file:
        newer = b"MATLAB 7.3" in file.read(128) or (file.seek(0) == 0 and file.read(8) == b"\x89HDF\r\n\x1a\n")
    if newer:
        return _mat73(path, limit_bytes)
    _require_inflated(path, limit_bytes)
    reader = _scipy_io(".mat")
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # scipy warns of duplicate names and then loses one of them
        try:
            found = reader.loadmat(path, squeeze_me=False)
        except Exception as error:  # noqa: BLE001 - on damaged files scipy raises errors of a dozen kinds
            raise FormatError("", f"cannot be read as .mat: {error}") from None
    arrays: Variables = {}
    for name, value in found.items():
        if not name.startswith("__") and isinstance(value, np.ndarray):
            _flatten(name, value, arrays)
    _within(sum(array.nbytes for array in arrays.values()), limit_bytes, "")
    return arrays


def _require_inflated(path: Path, limit_bytes: int | None) -> None:
    """Inflate the compressed elements of a .mat of version 5 to 7 block by block and keep nothing, before scipy does so
    and keeps it all.

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
    """The arrays of a structure by their path, `measurement.frf`; of lists of structures, none."""
    if value.dtype.names is None:
        into[name] = value
    elif value.size == 1 and depth < _DEEPEST:
        for field in value.dtype.names:
            inner = value.reshape(-1)[0][field]
            if isinstance(inner, np.ndarray):
                _flatten(f"{name}.{field}", inner, into, depth + 1)


def _mat73(path: Path, limit_bytes: int | None) -> Variables:
    try:
        import h5py
    except ImportError:
        raise FormatError("", "is a .mat of version 7.3; install modalbase[mat73], or save it with -v7") from None
    arrays: Variables = {}
    declared = 0
    with h5py.File(path, "r") as file:

        def take(name: str, item: object) -> None:
            nonlocal declared
            if not isinstance(item, h5py.Dataset) or name.startswith("#"):
                return
            whole = item.dtype.names == ("real", "imag")  # as MATLAB stores complex numbers
            if item.dtype.kind in "fiu" or whole:
                declared += item.size * item.dtype.itemsize
                _within(declared, limit_bytes, name)
                values = np.asarray(item[()]).T  # MATLAB stores columns first
                arrays[name.replace("/", ".")] = values["real"] + 1j * values["imag"] if whole else values

        file.visititems(take)
    return arrays


def _csv(path: Path, limit_bytes: int | None) -> Variables:
    _within(path.stat().st_size, limit_bytes, "")
    content = path.read_bytes()
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise FormatError("", "is a CSV in UTF-16, as spreadsheets write Unicode text; save it as UTF-8")
    header, rows = read_columns(io.StringIO(content.decode("utf-8-sig", errors="replace"), newline=""))
    if len(header) < 2 or len(set(header)) < len(header) or not all(header):
        raise FormatError("line 1", "is not a heading with a name of its own for each column")
    numbers = array("d")
    for line, row in rows:
        try:
            numbers.extend(map(float, row))
        except ValueError as error:
            raise FormatError(f"line {line}", str(error)) from None
    columns = np.frombuffer(numbers).reshape(-1, len(header)).T if numbers else np.empty((len(header), 0))
    return {name: column.copy() for name, column in zip(header, columns, strict=True)}


def _wav(path: Path, limit_bytes: int | None) -> Variables:
    _within(path.stat().st_size, limit_bytes, "")
    source = _whole_wav(path)
    wavfile = _scipy_io(".wav").wavfile
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", wavfile.WavFileWarning)  # chunks beside the samples
        rate, samples = wavfile.read(source)
    table = samples[:, np.newaxis] if samples.ndim == 1 else samples
    scale, zero = _full_scale(table.dtype)
    channels = {f"channel_{i + 1}": (table[:, i].astype(float) - zero) / scale for i in range(table.shape[1])}
    return {SAMPLE_RATE: np.array(float(rate)), **channels}


def _full_scale(kind: np.dtype[Any]) -> tuple[float, float]:
    """Counts of full scale and of zero, by which all kinds of samples go from -1 to 1, as those of floating point do; scipy
    puts 24 bits into the upper ones of 32.
    """
    if kind.kind == "f":
        return 1.0, 0.0
    half = 2.0 ** (8 * kind.itemsize - 1)
    return half, half if kind.kind == "u" else 0.0


UNKNOWN_LENGTH = 0xFFFF_FFFF
"""Size that a recorder declares, or 0, which writes its file as it measures and never comes back to the head."""


def _whole_wav(path: Path) -> Path | io.BytesIO:
    """What scipy is to read: the file, or its bytes with a length where it declares none.

    Raises:
        FormatError: it ends before its samples do, of which scipy would read what is there.
    """
    with path.open("rb") as file:
        if (kind := file.read(12)[:4]) not in (b"RIFF", b"RIFX"):  # others state their sizes elsewhere
            return path
        order: Literal["little", "big"] = "little" if kind == b"RIFF" else "big"
        size, frame = path.stat().st_size, 1
        while len(head := file.read(8)) == 8:
            declared, begin = int.from_bytes(head[4:], order), file.tell()
            left = size - begin
            if head[:4] == b"fmt ":
                frame = max(int.from_bytes(file.read(14)[12:], order), 1)
            if head[:4] == b"data" and (
                declared == UNKNOWN_LENGTH or (declared == 0 and not are_chunks(file, left, order))
            ):
                return _with_length(path, begin, left // frame * frame, order)
            if head[:4] == b"data" and declared > left:
                raise FormatError(
                    "", f"is cut off: it declares {declared} bytes of samples and has {left}; copy it again"
                )
            file.seek(begin + declared + declared % 2)
    return path


def are_chunks(file: BinaryIO, left: int, order: Literal["little", "big"]) -> bool:
    """Whether the rest of a file is chunks to its very end, so that those before them are as long as they declare."""
    while left >= 8:
        length = int.from_bytes(file.read(8)[4:], order)
        length += length % 2
        file.seek(length, 1)
        left -= 8 + length
    return left == 0


def _with_length(path: Path, begin: int, length: int, order: Literal["little", "big"]) -> io.BytesIO:
    """The bytes of a wav whose samples begin there and go to its end, with that for its length."""
    warnings.warn(
        f"{path.name} declares no length: it is read to its end, and nobody knows whether it was cut off",
        stacklevel=4,
    )
    whole = bytearray(path.read_bytes()[: begin + length])
    whole[begin - 4 : begin] = length.to_bytes(4, order)
    whole[4:8] = (len(whole) - 8).to_bytes(4, order)
    return io.BytesIO(whole)


SUFFIXES: dict[str, Callable[[Path, int | None], Variables]] = {".npz": _npz, ".mat": _mat, ".csv": _csv, ".wav": _wav}
"""Kinds of files, by their suffix."""
