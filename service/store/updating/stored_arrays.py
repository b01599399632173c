"""Arrays of a result in the database, read one by one, and of a table of FRFs one row: a figure needs few of them.

The npz is not compressed and its column is stored as it is (`STORAGE EXTERNAL`), so PostgreSQL reads only the parts asked for.
Measured on 33 FRFs of 1,000 lines: 1.1 MB read whole took 27 ms, two rows take 3.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Any
from uuid import UUID

import numpy as np
from sqlalchemy.orm import Session

from service.db.bytea import read_slice

_BUFFER = 32 * 1024  # bytes that are read at a time: the archive's list of contents fits in


class _Column(io.RawIOBase):
    """The bytes of a result's arrays as a file."""

    def __init__(self, session: Session, key: UUID, size: int) -> None:
        self._session, self._key, self._size, self._place = session, key, size, 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        start = {io.SEEK_SET: 0, io.SEEK_CUR: self._place, io.SEEK_END: self._size}[whence]
        self._place = max(start + offset, 0)
        return self._place

    def readinto(self, buffer: Any) -> int:
        found = read_slice(self._session, "update_results", "prediction", self._key, self._place, len(buffer))
        buffer[: len(found)] = found
        self._place += len(found)
        return len(found)


class StoredArrays(Mapping[str, Any]):
    """Arrays by name."""

    def __init__(self, session: Session, key: UUID, size: int) -> None:
        """Name the result.

        Args:
            session: of the request.
            key: of the update job.
            size: of its arrays' bytes.
        """
        # Everything is read through this one buffer: it takes for granted that nobody else moves the column's place.
        self._file = io.BufferedReader(_Column(session, key, size), _BUFFER)
        self._read: dict[str, Any] = {}

    @cached_property
    def _archive(self) -> zipfile.ZipFile:
        return zipfile.ZipFile(self._file)

    @cached_property
    def _names(self) -> list[str]:
        return [name.removesuffix(".npy") for name in self._archive.namelist()]

    def __contains__(self, name: object) -> bool:
        return name in self._names

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __getitem__(self, name: str) -> Any:
        if name not in self._read:
            with self._archive.open(f"{name}.npy") as file:
                self._read[name] = np.lib.format.read_array(file, allow_pickle=False)
        return self._read[name]

    def row(self, name: str, number: int) -> Any:
        """One row of a table, without reading the others."""
        info = self._archive.getinfo(f"{name}.npy")
        with self._archive.open(info) as file:
            np.lib.format.read_magic(file)
            (_, *inner), in_columns, dtype = np.lib.format.read_array_header_1_0(file)
            header = file.tell()
        assert not in_columns, "tables are written row by row"
        self._file.seek(info.header_offset)
        local = self._file.read(30)  # of an archive's member: at 26 and 28 the lengths of its name and extra field
        begin = (
            info.header_offset + 30 + int.from_bytes(local[26:28], "little") + int.from_bytes(local[28:30], "little")
        )
        size = dtype.itemsize * int(np.prod(inner))
        self._file.seek(begin + header + number * size)
        return np.frombuffer(self._file.read(size), dtype=dtype).reshape(inner)
