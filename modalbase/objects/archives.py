"""Archives of campaigns: checked before anything is taken from them, and read into a project of a service.

A zip can say that it is small and be large, and name files that it should not have. So nothing is unpacked by name: the
manifest says which members there are, each with its bytes and SHA-256, and no member is read beyond what it says.
"""

from __future__ import annotations

import csv
import io
import json
import tempfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import UUID
from zipfile import BadZipFile, ZipFile

from modalbase.archive import FORMAT, MANIFEST
from modalbase.client.errors import ClientError, Exit

if TYPE_CHECKING:
    from modalbase.objects.campaigns import Campaign
    from modalbase.objects.projects import Project, Structure

MOST_MANIFEST, MOST_WHOLE = 64 * 1024 * 1024, 512 * 1024 * 1024
"""Bytes of the manifest, and of any other member that is read whole."""
MOST_RATIO = 200
"""How many times an archive may grow when it is unpacked; text of numbers grows less than tenfold."""
BLOCK = 1024 * 1024
_OF_THE_SERVICE = {
    "id",
    "project_id",
    "structure_id",
    "version",
    "model",
    "replaced",
    "created_at",
    "updated_at",
    "deleted_at",
}
"""Members of a thing that another service gives it anew."""


@dataclass(frozen=True)
class Imported:
    """What came of an archive.

    Attributes:
        ids: of structures, campaigns and mode sets: as they were, to as they are.
        results: paths in the archive of results, which stay there: a service has the results that it computed.
    """

    ids: dict[str, str]
    results: list[str]


class ArchiveFile:
    """An archive on this machine's disk.

    Attributes:
        manifest: as the archive has it.
    """

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
            raise _broken(f"{path.name} is no archive of modalbase: {error}") from None
        if version != FORMAT:
            raise _broken(f"{path.name} is of format {version}; this version reads {FORMAT}")
        infos = [info for info in self._zip.infolist() if info.filename != MANIFEST]
        found = {info.filename: info.file_size for info in infos}
        if len(found) != len(infos) or found != stated:
            other = sorted(found.items() ^ stated.items())
            raise _broken(f"{path.name} has other members than its manifest: {other[0][0] if other else 'one twice'}")
        if sum(found.values()) > MOST_RATIO * path.stat().st_size:
            raise _broken(f"{path.name} would grow to {sum(found.values())} bytes, over {MOST_RATIO} times its size")

    def __enter__(self) -> ArchiveFile:
        return self

    def __exit__(self, *_: object) -> None:
        self._zip.close()

    def names(self, folder: str, end: str) -> list[str]:
        """Paths of members in a folder that end so."""
        return sorted(name for name in self._digests if name.startswith(folder) and name.endswith(end))

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
            raise _broken(f"{name} cannot be read: {error}") from None

    def rows(self, name: str) -> list[dict[str, str]]:
        """A member of CSV, a row each."""
        try:
            return list(csv.DictReader(io.StringIO(self._whole(name).decode()), strict=True))
        except (ValueError, csv.Error) as error:
            raise _broken(f"{name} cannot be read: {error}") from None

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
            raise _broken(
                f"{name} has {self._zip.getinfo(name).file_size} bytes, at most {MOST_WHOLE} are read at once"
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
        digest = sha256()
        try:
            with self._zip.open(name) as member:
                while block := member.read(BLOCK):
                    digest.update(block)
                    yield block
        except (BadZipFile, EOFError, NotImplementedError, RuntimeError, zlib.error) as error:
            raise _broken(f"{name} cannot be unpacked: {error}") from None
        if digest.hexdigest() != self._digests[name]:
            raise _broken(f"{name} is not what the manifest says: its SHA-256 differs")


def import_archive(project: Project, path: Path) -> Imported:
    """Read an archive into a project; everything gets ids of the service, and says in `meta.archive` where it came from.

    Raises:
        ClientError: the archive is not what was written, which is known before anything is sent; or a part of it is none of an
            archive, or refused by the service.
    """
    with ArchiveFile(path) as archive:
        archive.check()
        try:
            return _imported(project, archive)
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise _broken(f"{path.name} is not as an archive is: {type(error).__name__} {error}") from error


def _imported(project: Project, archive: ArchiveFile) -> Imported:
    structures = {
        _id(was): _structure(project, archive, was)
        for was in map(archive.json, archive.names("structures/", "/structure.json"))
    }
    ids = {was: made.fields["id"] for was, made in structures.items()}
    for name in archive.names("campaigns/", "/campaign.json"):
        was = archive.json(name)
        if (structure := structures.get(str(was.get("structure_id")))) is None:
            raise _broken(f"{name} is of a structure that the archive does not have")
        campaign = _campaign(structure, archive, was)
        ids[_id(was)] = campaign.id
        ids |= _measurements(campaign, archive, f"campaigns/{_id(was)}")
    return Imported(ids, [name for name in archive.names("campaigns/", ".json") if "/results/" in name])


def _structure(project: Project, archive: ArchiveFile, was: Mapping[str, Any]) -> Structure:
    folder = f"structures/{_id(was)}"
    made = project.new_structure(**_stated(was), confirm=True)
    if archive.has(f"{folder}/deck"):
        deck = archive.json(f"{folder}/model.json")
        with archive.unpacked(f"{folder}/deck", str(deck["filename"])) as file:
            said = {"accept": deck["accepted"], "sections": deck.get("sections")}
            made.import_model(file, deck["units"], **said, confirm=True)
    return made


def _campaign(structure: Structure, archive: ArchiveFile, was: Mapping[str, Any]) -> Campaign:
    stated = _stated(was)
    rates = {row["window_rate_per_s"] for row in archive.rows(f"campaigns/{_id(was)}/frfs.csv")}
    if (stated.get("inputs") or {}).get("window_rate_per_s") is None and len(rates) == 1 and (rate := rates.pop()):
        stated["inputs"] = {**(stated.get("inputs") or {}), "window_rate_per_s": float(rate)}
    return structure.new_campaign(**stated, confirm=True)


def _measurements(campaign: Campaign, archive: ArchiveFile, folder: str) -> dict[str, str]:
    """Send points, FRFs with their labels, and mode sets; ids of the mode sets as they were to as they are."""
    if archive.has(f"{folder}/frfs.uff"):
        with archive.unpacked(f"{folder}/frfs.uff", "frfs.uff") as file:
            sent = campaign.import_file(file)
        _label(campaign, archive.rows(f"{folder}/frfs.csv"), sent.id)
    elif points := archive.rows(f"{folder}/grid-points.csv"):
        items = [{"label": int(row["label"]), **{f"{a}_m": float(row[f"{a}_m"]) for a in "xyz"}} for row in points]
        campaign.lab.connection.call("PUT", f"{campaign.address}/grid-points", json={"items": items})
    ids = {}
    for one in archive.json(f"{folder}/mode-sets.json"):
        modes = [{name: mode[name] for name in _MODE} for mode in one["modes"] if mode["frequency_hz"] > 0]
        if modes:
            made = campaign.lab.connection.post(f"{campaign.address}/mode-sets", {"name": one["name"], "modes": modes})
            ids[_id(one)] = str(made["id"])
    return ids


_MODE = ("frequency_hz", "damping_ratio", "frequency_sd_hz", "damping_sd", "shape")


def _label(campaign: Campaign, rows: list[dict[str, str]], import_id: str) -> None:
    for row in rows:
        tags, meta = json.loads(row["tags"]), json.loads(row["meta"])
        if tags or meta:
            which = {"point": row["response_point"], "direction": row["response_direction"]}
            which |= {"reference": row["reference_point"], "quantity": row["quantity"], "import_id": import_id}
            campaign.label_frfs(tags=tags, meta=meta, **which)


def _stated(was: Mapping[str, Any]) -> dict[str, Any]:
    """What a client states of a thing, with where it came from."""
    stated = {name: value for name, value in was.items() if name not in _OF_THE_SERVICE and value is not None}
    origin = {"id": _id(was), "created_at": was.get("created_at")}
    return {**stated, "meta": {**stated.get("meta", {}), "archive": origin}}


def _id(was: Any) -> str:
    try:
        return str(UUID(was["id"]))
    except (KeyError, TypeError, ValueError, AttributeError):
        raise _broken("something in the archive has no id") from None


def _broken(why: str) -> ClientError:
    return ClientError(why, Exit.USAGE)
