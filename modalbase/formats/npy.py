"""Arrays of numpy's files, each read no further than its head says."""

import zipfile
import zlib
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy

from modalbase.formats.errors import FormatError

Array = np.ndarray[Any, Any]
ARRAY = "array"
"""Name of the one array of an npy, which has none."""

_HEADS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
_MEMBER = ".npy"


@dataclass(frozen=True)
class Head:
    """What stands before the numbers of an array."""

    shape: tuple[int, ...]
    columns_first: bool  # in Fortran's order
    dtype: np.dtype[Any]

    @property
    def size(self) -> int:
        """Numbers, which no integer of numpy may hold."""
        return int(np.prod([int(n) for n in self.shape], dtype=object))

    def require_present(self, name: str, present: int) -> None:
        """Refuse a head that claims other bytes than are there, since numpy allocates what it claims.

        Raises:
            FormatError: it does; names the array.
        """
        if (claimed := self.size * self.dtype.itemsize) != present:
            raise FormatError(name, f"claims {claimed} bytes and has {present}")


@contextmanager
def named(name: str) -> Iterator[None]:
    """Say of which array a fault is that numpy or the archive has."""
    try:
        yield
    except (ValueError, KeyError, EOFError, OSError, zipfile.BadZipFile, zlib.error) as error:
        raise FormatError(name, f"cannot be read: {' '.join(str(error).split())}") from None


def head_of(stream: IO[bytes]) -> Head:
    """The head of the array that a stream begins with."""
    return Head(*_HEADS[npy.read_magic(stream)](stream))


def members_of(archive: zipfile.ZipFile) -> list[zipfile.ZipInfo]:
    """The members of an archive.

    Raises:
        FormatError: two have one name, of which a reader by name would lose one.
    """
    members = archive.infolist()
    if len(names := Counter(member.filename for member in members)) < len(members):
        raise FormatError(names.most_common(1)[0][0].removesuffix(_MEMBER), "is in the file twice")
    return members


def arrays_of(archive: zipfile.ZipFile) -> dict[str, zipfile.ZipInfo]:
    """Those that are arrays, by their name.

    Raises:
        FormatError: as of `members_of`.
    """
    return {
        member.filename.removesuffix(_MEMBER): member
        for member in members_of(archive)
        if member.filename.endswith(_MEMBER)
    }


def read_array(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> Array:
    """Return the array of an archive's member.

    Raises:
        FormatError: the member is damaged, cut short, or holds Python objects; names the array.
    """
    name = member.filename.removesuffix(_MEMBER)
    with named(name):
        with archive.open(member) as stream:
            _require_whole(name, stream, member.file_size)
        with archive.open(member) as stream:
            array: Array = npy.read_array(stream, allow_pickle=False)
    return array


def read_npy(path: Path) -> Array:
    """Return the array of an npy.

    Raises:
        FormatError: as of `read_array`.
    """
    with named(ARRAY), path.open("rb") as stream:
        _require_whole(ARRAY, stream, path.stat().st_size)
        stream.seek(0)
        array: Array = npy.read_array(stream, allow_pickle=False)
    return array


def _require_whole(name: str, stream: IO[bytes], size_bytes: int) -> None:
    head = head_of(stream)
    if head.dtype.hasobject:
        raise FormatError(name, "cannot be read: it holds Python objects, which are not unpickled")
    head.require_present(name, size_bytes - stream.tell())
