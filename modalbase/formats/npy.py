"""The arrays of an npz archive, each read no further than its entry says."""

import zipfile
import zlib
from collections import Counter
from typing import Any

import numpy as np
from numpy.lib import format as npy

from modalbase.formats.errors import FormatError

Array = np.ndarray[Any, Any]

HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
"""How the head of an array is read, by its version."""


def members_of(archive: zipfile.ZipFile) -> list[zipfile.ZipInfo]:
    """The members of an archive.

    Raises:
        FormatError: two have one name, of which a reader by name would lose one.
    """
    members = archive.infolist()
    if len(names := Counter(member.filename for member in members)) < len(members):
        raise FormatError(names.most_common(1)[0][0].removesuffix(".npy"), "is in the file twice")
    return members


def read_array(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> Array:
    """Return the array of an archive's member. Its header must claim exactly the bytes that are
    there, since numpy allocates what it claims.

    Raises:
        FormatError: the member is damaged, cut short, or holds Python objects; names the array.
    """
    name = member.filename.removesuffix(".npy")
    try:
        with archive.open(member) as stream:
            shape, _, dtype = HEADERS[npy.read_magic(stream)](stream)
            claimed = int(np.prod([int(n) for n in shape], dtype=object)) * dtype.itemsize
            present = member.file_size - stream.tell()
        if dtype.hasobject:
            raise FormatError(
                name, "cannot be read: it holds Python objects, which are not unpickled"
            )
        if claimed != present:
            raise FormatError(name, f"claims {claimed} bytes and has {present}")
        with archive.open(member) as stream:
            array: Array = npy.read_array(stream, allow_pickle=False)
    except (ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise FormatError(name, f"cannot be read: {' '.join(str(error).split())}") from None
    return array
