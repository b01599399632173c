"""A zip of UFF, CSV and JSON, with a manifest of SHA-256 and the metadata of an RO-Crate (1.1,
https://w3id.org/ro/crate).

The layout is a public format, described in `docs/archives.md`; `FORMAT` counts its versions.
"""

import csv
import io
import json
from collections.abc import Iterable, Mapping, Sequence
from contextlib import contextmanager
from datetime import datetime
from hashlib import sha256
from typing import IO, Any
from uuid import UUID
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile, ZipInfo

from pydantic_core import to_jsonable_python

from fecore import __version__
from modalbase.archive import CRATE, FORMAT, MANIFEST
from modalbase.formats.registry import WRITERS

KINDS = {name: WRITERS[name].media_type for name in ("uff", "npz", "csv", "json")}


class _Digest(io.RawIOBase):
    """Passes bytes on, counts them, and makes their SHA-256."""

    def __init__(self, target: IO[bytes]) -> None:
        self.target, self.sha256, self.size = target, sha256(), 0

    def writable(self) -> bool:
        """It can be written."""
        return True

    def write(self, data: Any, /) -> int:
        """Write bytes."""
        self.sha256.update(data)
        self.size += len(data)
        return self.target.write(data)


class Archive:
    """An archive that is being written.

    Attributes:
        files: path in it to bytes and SHA-256.
    """

    def __init__(self, file: IO[bytes], now: datetime) -> None:
        self._zip, self._now = ZipFile(file, "w", allowZip64=True), now
        self.files: dict[str, dict[str, Any]] = {}

    @contextmanager
    def member(self, path: str) -> Any:
        """A member to write bytes to; spectra are left as they are, texts are compressed."""
        info = ZipInfo(path, self._now.timetuple()[:6])
        info.compress_type = ZIP_STORED if path.endswith((".uff", ".npz")) else ZIP_DEFLATED
        with self._zip.open(info, "w", force_zip64=True) as target:
            digest = _Digest(target)
            yield digest
        self.files[path] = {"bytes": digest.size, "sha256": digest.sha256.hexdigest()}

    def json(self, path: str, value: Any) -> None:
        """A member of JSON, of what a client would be answered."""
        with self.member(path) as file:
            file.write(
                json.dumps(
                    to_jsonable_python(value), ensure_ascii=False, allow_nan=False, indent=1
                ).encode()
            )

    def table(self, path: str, columns: Sequence[str], rows: Iterable[Mapping[str, Any]]) -> None:
        """A member of CSV: a header and a line for each row, objects and lists as JSON."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\r\n")
        writer.writerow(columns)
        writer.writerows([_cell(row.get(column)) for column in columns] for row in rows)
        with self.member(path) as file:
            file.write(text.getvalue().encode())

    def close(self, title: str, made_by: str, names: Mapping[UUID, str]) -> None:
        """Write what says what the archive is: the RO-Crate and the manifest.

        Args:
            title: of the archive.
            made_by: who asked for it.
            names: of structures, campaigns and attachments.
        """
        self.json(CRATE, crate(title, self._now, self.files, names))
        head = {"format": FORMAT, "title": title, "software": f"modalbase {__version__}"}
        self.json(
            MANIFEST, {**head, "made_at": self._now, "made_by": made_by, "files": dict(self.files)}
        )
        self._zip.close()


def _cell(value: Any) -> Any:
    return json.dumps(value, ensure_ascii=False) if isinstance(value, list | dict) else value


def crate(
    title: str, now: datetime, files: Mapping[str, Mapping[str, Any]], names: Mapping[UUID, str]
) -> dict[str, Any]:
    """The metadata of an RO-Crate: the archive, a data set for each campaign, structure and attachment, and
    every file.
    """
    folders: dict[str, list[str]] = {}
    for path in files:
        if "/" in path:
            folders.setdefault("/".join(path.split("/")[:2]) + "/", []).append(path)
    top = [*folders, *(path for path in files if "/" not in path)]
    root = {
        "@id": "./",
        "@type": "Dataset",
        "name": title,
        "description": (
            f"{title}: measurements of structures and what was found of them, written by modalbase"
        ),
        "datePublished": now.date().isoformat(),
        "license": "The rights stay with whoever measured; nothing is granted by this file.",
        "hasPart": [{"@id": path} for path in top],
    }
    described: dict[str, Any] = {
        "@id": CRATE,
        "@type": "CreativeWork",
        "conformsTo": {"@id": "https://w3id.org/ro/crate/1.1"},
        "about": {"@id": "./"},
    }
    datasets = [
        {
            "@id": one,
            "@type": "Dataset",
            "name": names[UUID(one.split("/")[1])],
            "hasPart": [{"@id": path} for path in parts],
        }
        for one, parts in folders.items()
    ]
    entries = [
        {
            "@id": path,
            "@type": "File",
            "name": path.rsplit("/", 1)[-1],
            "encodingFormat": KINDS.get(path.rsplit(".", 1)[-1], "text/plain"),
            "contentSize": str(entry["bytes"]),
            "sha256": entry["sha256"],
        }
        for path, entry in files.items()
    ]
    return {
        "@context": "https://w3id.org/ro/crate/1.1/context",
        "@graph": [described, root, *datasets, *entries],
    }
