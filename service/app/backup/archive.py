"""The backup file: a zip with each table as PostgreSQL's binary COPY writes it, and a manifest that describes them.

Binary COPY keeps every value bit for bit. The queue's own tables are left out: their rows are made anew from the jobs.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from json import JSONDecodeError, dumps, loads
from pathlib import Path
from zipfile import BadZipFile, ZipFile

MANIFEST = "manifest.json"
FORMAT = 1
BLOCK_BYTES = 1024 * 1024


class BackupError(Exception):
    """A backup cannot be written, read or restored; the message says why, and nothing has changed."""


@dataclass(frozen=True)
class TableEntry:
    """A table in the file.

    Attributes:
        name: of the table.
        columns: in the order of the copied rows.
        rows: how many.
        sha256: of the copied bytes, hexadecimal.
    """

    name: str
    columns: list[str]
    rows: int
    sha256: str

    @property
    def member(self) -> str:
        """Its name in the zip."""
        return f"tables/{self.name}"


@dataclass(frozen=True)
class Manifest:
    """What a backup holds.

    Attributes:
        format: of the file.
        software: version of modalbase that wrote it.
        revision: of the schema.
        created_at: moment that the backup shows, ISO 8601.
        tables: what is in it, parents first.
        damaged: what was damaged in the database already, as `service.app.backup.verification` names it.
    """

    format: int
    software: str
    revision: str
    created_at: str
    tables: list[TableEntry]
    damaged: list[str]

    def to_json(self) -> str:
        """The manifest's text."""
        return dumps(asdict(self), indent=1)


def read_manifest(file: Path, archive: ZipFile) -> Manifest:
    """The manifest of an open backup.

    Raises:
        BackupError: it is no backup of ours, or one of a later format.
    """
    try:
        content = loads(archive.read(MANIFEST))
        if content["format"] != FORMAT:
            raise BackupError(f"{file} is a backup of format {content['format']}; install a newer modalbase")
        return Manifest(**content | {"tables": [TableEntry(**table) for table in content["tables"]]})
    except (KeyError, TypeError, JSONDecodeError, UnicodeDecodeError, BadZipFile) as error:
        raise BackupError(f"{file} is no backup of modalbase, or is damaged: {error}") from error
