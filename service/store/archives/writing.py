"""A zip of UFF, CSV and JSON, with a manifest of SHA-256 and the metadata of an RO-Crate (1.1, https://w3id.org/ro/crate).

The layout is a public format, described in `docs/archives.md`; `FORMAT` counts its versions.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from hashlib import sha256
from typing import IO, TYPE_CHECKING, Any
from uuid import UUID
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile, ZipInfo

from pydantic import BaseModel
from sqlalchemy.orm import Session

from fecore import __version__
from modalbase.archive import FORMAT, MANIFEST
from modalbase.formats.frfs.table import DOFS
from service.access import User
from service.store.campaigns.operations import campaigns_of, list_points, to_csv
from service.store.campaigns.operations import describe as described_campaign
from service.store.frfs.data import Cut, make_tables
from service.store.frfs.operations import FrfFilter
from service.store.frfs.routes import write_uff
from service.store.modes.operations import describe_all as described_modes
from service.store.modes.operations import mode_sets_of
from service.store.structures.models import deck_of, said_of_deck
from service.store.structures.operations import describe as described_structure
from service.store.structures.operations import structures_of
from service.store.updating.operations import labelled_results
from service.store.updating.result_schemas import CONSTANTS

if TYPE_CHECKING:
    from service.store.campaigns.operations import Campaign

CRATE = "ro-crate-metadata.json"
KINDS = {"uff": "application/x-uff", "csv": "text/csv", "json": "application/json"}
FRF_COLUMNS = ("id", "label", *DOFS, "quantity", "averages", "window_rate_per_s", "tags", "meta")
MODE_COLUMNS = ("number", "frequency_hz", "damping_ratio", "frequency_sd_hz", "damping_sd")
RESULT_COLUMNS = ("id", "campaign_id", "campaign", "structure", "verdict")


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
        info.compress_type = ZIP_STORED if path.endswith(".uff") else ZIP_DEFLATED
        with self._zip.open(info, "w", force_zip64=True) as target:
            digest = _Digest(target)
            yield digest
        self.files[path] = {"bytes": digest.size, "sha256": digest.sha256.hexdigest()}

    def json(self, path: str, value: Any) -> None:
        """A member of JSON."""
        plain = value.model_dump(mode="json") if isinstance(value, BaseModel) else value
        with self.member(path) as file:
            file.write(json.dumps(plain, ensure_ascii=False, allow_nan=False, indent=1).encode())

    def table(self, path: str, columns: Sequence[str], rows: Iterable[Mapping[str, Any]]) -> None:
        """A member of CSV: a header and a line for each row, objects and lists as JSON."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\r\n")
        writer.writerow(columns)
        writer.writerows([_cell(row.get(column)) for column in columns] for row in rows)
        with self.member(path) as file:
            file.write(text.getvalue().encode())

    def close(self) -> None:
        """Write what is still to be written."""
        self._zip.close()


def _cell(value: Any) -> Any:
    return json.dumps(value, ensure_ascii=False) if isinstance(value, list | dict) else value


def write_archive(session: Session, user: User, title: str, keys: Sequence[UUID], file: IO[bytes]) -> None:
    """Write campaigns, whose readers are known to be allowed, with their structures to a file.

    Args:
        session: a transaction in which the database stands still.
        user: who asks.
        title: of the archive.
        keys: of the campaigns.
        file: takes the zip.
    """
    now = datetime.now(UTC)
    archive, campaigns = Archive(file, now), sorted(campaigns_of(session, keys), key=lambda row: row.id)
    structures = structures_of(session, {row.structure_id for row in campaigns})
    for key, structure in sorted(structures.items()):
        shown = described_structure(session, structure)
        archive.json(f"structures/{key}/structure.json", shown)
        if shown.model is not None:
            name, units, deck = deck_of(session, shown.model)
            read = {"filename": name, "units": units, **said_of_deck(session, shown.model)}
            archive.json(f"structures/{key}/model.json", read)
            with archive.member(f"structures/{key}/deck") as target:
                target.write(deck)
    results: list[dict[str, Any]] = []
    for campaign in campaigns:
        _write_campaign(session, archive, campaign)
        results += _write_results(session, archive, campaign, structures[campaign.structure_id].name)
    constants = [name + end for name in CONSTANTS for end in ("", "_sd", "_low", "_high")]
    archive.table("results.csv", [*RESULT_COLUMNS, *constants], results)
    names = {row.id: row.name for row in campaigns} | {key: row.name for key, row in structures.items()}
    archive.json(CRATE, crate(title, now, archive.files, names))
    head = {"format": FORMAT, "title": title, "software": f"modalbase {__version__}", "made_at": now.isoformat()}
    archive.json(MANIFEST, {**head, "made_by": user.name, "files": archive.files})
    archive.close()


def _write_campaign(session: Session, archive: Archive, campaign: Campaign) -> None:
    """A campaign with its points, FRFs and mode sets."""
    folder = f"campaigns/{campaign.id}"
    archive.json(f"{folder}/campaign.json", described_campaign(campaign))
    with archive.member(f"{folder}/grid-points.csv") as file:
        file.write(to_csv(list_points(session, campaign.id)).encode())
    rows = session.scalars(FrfFilter().query(campaign.id).order_by("id")).all()
    tables = make_tables(session, rows, Cut())
    if tables:
        with archive.member(f"{folder}/frfs.uff") as file:
            write_uff(tables, file, binary=True)
    shown = [
        {name: getattr(frf, name) for name in FRF_COLUMNS} for table in tables for frf in table.frfs
    ]  # in the order of the file
    archive.table(f"{folder}/frfs.csv", FRF_COLUMNS, shown)
    sets = described_modes(session, mode_sets_of(session, campaign.id))
    archive.json(f"{folder}/mode-sets.json", [one.model_dump(mode="json") for one in sets])
    modes = [{"mode_set": str(one.id), "name": one.name, **mode.model_dump()} for one in sets for mode in one.modes]
    archive.table(f"{folder}/modes.csv", ("mode_set", "name", *MODE_COLUMNS), modes)


def _write_results(session: Session, archive: Archive, campaign: Campaign, structure: str) -> list[dict[str, Any]]:
    """The results of a campaign as documents; a row of the table of results each."""
    rows = []
    for key, document, labels in labelled_results(session, campaign.id):
        archive.json(f"campaigns/{campaign.id}/results/{key}.json", {**document, "labels": labels})
        row = {"id": key, "campaign_id": campaign.id, "campaign": campaign.name, "structure": structure}
        row["verdict"] = document["verdict"]["level"]
        for one in document["parameters"]:
            low, high = one["interval_95"] or (None, None)
            row |= {one["name"]: one["estimate"], f"{one['name']}_sd": one["standard_deviation"]}
            row |= {f"{one['name']}_low": low, f"{one['name']}_high": high}
        rows.append(row)
    return rows


def crate(
    title: str, now: datetime, files: Mapping[str, Mapping[str, Any]], names: Mapping[UUID, str]
) -> dict[str, Any]:
    """The metadata of an RO-Crate: the archive, a data set for each campaign and structure, and every file."""
    folders: dict[str, list[str]] = {}
    for path in files:
        if "/" in path:
            folders.setdefault("/".join(path.split("/")[:2]) + "/", []).append(path)
    top = [*folders, *(path for path in files if "/" not in path)]
    root = {
        "@id": "./",
        "@type": "Dataset",
        "name": title,
        "description": f"{title}: measurements of structures and what was found of them, written by modalbase",
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
    return {"@context": "https://w3id.org/ro/crate/1.1/context", "@graph": [described, root, *datasets, *entries]}
