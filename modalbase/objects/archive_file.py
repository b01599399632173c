"""An archive on this machine's disk, checked before anything is taken from it.

A zip can say that it is small and be large, and name files that it should not have. So nothing is
unpacked by name: the manifest says which members there are, each with its bytes and SHA-256, and no
member is read beyond what it says.
"""

from __future__ import annotations

import csv
import io
import json
import tempfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import Any
from zipfile import BadZipFile, ZipFile

from modalbase.archive import CRATE, FORMAT, MANIFEST
from modalbase.client.errors import ClientError, Exit

MOST_MANIFEST, MOST_WHOLE = 64 * 1024 * 1024, 512 * 1024 * 1024
"""Bytes of the manifest, and of any other member that is read whole."""
MOST_RATIO = 200
"""How many times an archive may grow when it is unpacked; text of numbers grows less than
tenfold.
"""
BLOCK = 1024 * 1024


class ArchiveFile:
    """An archive on this machine's disk.

    Attributes:
        manifest: as the archive has it.
        last: the member that was read last.
    """

    last = MANIFEST

    def __init__(self, path: Path) -> None:
        """Open an archive, and hold its manifest against what the zip says.

        Raises:
            ClientError: it is none, or has other members than the manifest says.
        """
        try:
            self._zip = ZipFile(path)
            self.manifest = json.loads(self._read(MANIFEST, MOST_MANIFEST))
            members: dict[str, Any] = self.manifest["files"]
            stated = {name: int(entry["bytes"]) for name, entry in members.items()}
            self._digests = {name: str(entry["sha256"]) for name, entry in members.items()}
            version = int(self.manifest["format"])
        except (
            BadZipFile,
            KeyError,
            OSError,
            RuntimeError,
            ValueError,
            TypeError,
            AttributeError,
            zlib.error,
        ) as error:
            raise broken(f"{path.name} is no archive of modalbase: {error}") from None
        if version != FORMAT:
            raise broken(f"{path.name} is of format {version}; this version reads {FORMAT}")
        infos = [info for info in self._zip.infolist() if info.filename != MANIFEST]
        sizes = {info.filename: info.file_size for info in infos}
        if len(sizes) != len(infos) or sizes != stated:
            other = sorted(sizes.items() ^ stated.items())
            raise broken(
                f"{path.name} has other members than its manifest:"
                f" {other[0][0] if other else 'one twice'}"
            )
        if sum(sizes.values()) > MOST_RATIO * path.stat().st_size:
            raise broken(
                f"{path.name} would grow to {sum(sizes.values())} bytes, over {MOST_RATIO} times"
                " its size"
            )

    def __enter__(self) -> ArchiveFile:
        return self

    def __exit__(self, *_: object) -> None:
        self._zip.close()

    @property
    def digest(self) -> str:
        """SHA-256 of what is in it: archives of the same content have the same, whenever they were
        written.
        """
        content = {name: sha for name, sha in self._digests.items() if name != CRATE}
        return sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()

    def names(self, folder: str, end: str) -> list[str]:
        """Paths of members in a folder that end so."""
        return sorted(
            name for name in self._digests if name.startswith(folder) and name.endswith(end)
        )

    def check(self) -> None:
        """Read all members once.

        Raises:
            ClientError: one is not what the manifest says.
        """
        for name in self._digests:
            for _ in self._blocks(name):
                continue

    def has(self, name: str) -> bool:
        """Whether there is such a member."""
        return name in self._digests

    def json(self, name: str) -> Any:
        """A member of JSON."""
        try:
            return json.loads(self._whole(name))
        except (ValueError, RecursionError) as error:
            raise broken(f"{name} cannot be read: {error}") from None

    def rows(self, name: str) -> list[dict[str, str]]:
        """A member of CSV, a row each."""
        try:
            return list(
                csv.DictReader(io.StringIO(self._whole(name).decode(), newline=""), strict=True)
            )
        except (ValueError, csv.Error) as error:
            raise broken(f"{name} cannot be read: {error}") from None

    @contextmanager
    def unpacked(self, name: str, called: str) -> Iterator[Path]:
        """A member as a file of that name, while it is needed."""
        with tempfile.TemporaryDirectory(prefix="modalbase-") as folder:
            file = Path(folder, Path(called).name)
            with file.open("wb") as target:
                target.writelines(self._blocks(name))
            yield file

    def _whole(self, name: str) -> bytes:
        if self._zip.getinfo(name).file_size > MOST_WHOLE:
            raise broken(
                f"{name} has {self._zip.getinfo(name).file_size} bytes, at most {MOST_WHOLE} are"
                " read at once"
            )
        return b"".join(self._blocks(name))

    def _read(self, name: str, most: int) -> bytes:
        with self._zip.open(name) as member:
            content = member.read(most + 1)
        if len(content) > most:
            raise BadZipFile(f"{name} has more than {most} bytes")
        return content

    def _blocks(self, name: str) -> Iterator[bytes]:
        """The bytes of a member; `ZipExtFile` ends at the size that the zip states.

        Raises:
            ClientError: they are not those that the manifest says.
        """
        digest, self.last = sha256(), name
        try:
            with self._zip.open(name) as member:
                while block := member.read(BLOCK):
                    digest.update(block)
                    yield block
        except (BadZipFile, EOFError, NotImplementedError, RuntimeError, zlib.error) as error:
            raise broken(f"{name} cannot be unpacked: {error}") from None
        if digest.hexdigest() != self._digests[name]:
            raise broken(f"{name} is not what the manifest says: its SHA-256 differs")


def broken(why: str) -> ClientError:
    """What is wrong with an archive, as an error."""
    return ClientError(why, Exit.USAGE)
