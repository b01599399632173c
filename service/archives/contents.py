"""What an archive has of instruments, structures and campaigns; `docs/archives.md` describes each
file.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from typing import IO, TYPE_CHECKING, Any
from uuid import UUID
from zipfile import ZipFile, ZipInfo

from numpy.lib import format as npy
from sqlalchemy.orm import Session

from modalbase.formats.arrays_out import write_npz
from modalbase.formats.frfs.table import DOFS
from modalbase.formats.frfs.uff import write_uff
from service.archives.writing import Archive
from service.nouns.attachments.operations import attached_to, beside_projects
from service.nouns.attachments.routes import describe as describe_attachments
from service.nouns.campaigns.operations import campaigns_of, list_points, to_csv
from service.nouns.campaigns.operations import describe as described_campaign
from service.nouns.coupons import curves
from service.nouns.coupons.operations import batch_for, coupon_for, describe_coupon
from service.nouns.coupons.operations import describe_all as described_batches
from service.nouns.frfs.data import Cut, make_tables
from service.nouns.frfs.operations import frf_for
from service.nouns.instruments.routes import InstrumentOut, instrument_for
from service.nouns.modes.operations import describe_all as described_modes
from service.nouns.modes.operations import mode_set_for
from service.nouns.monitors.operations import describe_all as described_monitors
from service.nouns.monitors.operations import monitors_of, series_for
from service.nouns.monitors.points import EVERY, Part
from service.nouns.monitors.presentation import series_document
from service.nouns.recordings.operations import (
    arrays_of,
    recordings_of,
    spectra_of_recording,
)
from service.nouns.recordings.operations import describe_all as described_recordings
from service.nouns.records.operations import query_of, sample_bytes
from service.nouns.records.processings import decisions_of, documents_of
from service.nouns.records.schemas import HitDecisionOut
from service.nouns.storage.originals import copy_original
from service.nouns.structures.models import deck_of, model_for
from service.nouns.structures.operations import describe as described_structure
from service.nouns.structures.operations import structures_of
from service.nouns.updates.operations import joint_update_for, labelled_results
from service.nouns.updates.result_schemas import CONSTANTS
from service.platform.access import User
from service.platform.web import shown_as

if TYPE_CHECKING:
    from service.nouns.campaigns.operations import Campaign
    from service.nouns.records.operations import Record
    from service.nouns.structures.operations import Structure

FRF_COLUMNS = (
    "id",
    "label",
    *DOFS,
    "quantity",
    "averages",
    "window_rate_per_s",
    "processing_id",
    "tags",
    "meta",
)
MODE_COLUMNS = ("number", "frequency_hz", "damping_ratio", "frequency_sd_hz", "damping_sd")
RESULT_COLUMNS = ("id", "campaign_id", "campaign", "structure", "verdict")
COUPON_COLUMNS = (
    *("batch", "specimen", "standard", "E_Pa", "G_Pa", "nu", "strength_Pa", "ultimate_strain"),
    *("failure_code", "excluded", "exclusion_reason"),
)


def write_archive(
    session: Session,
    user: User,
    title: str,
    campaign_ids: Sequence[UUID],
    structure_ids: Sequence[UUID],
    file: IO[bytes],
    project_ids: Sequence[UUID] = (),
) -> None:
    """Write campaigns and structures, whose readers are known to be allowed, to a file.

    Args:
        session: a transaction in which the database stands still.
        user: who asks.
        title: of the archive.
        campaign_ids: of the campaigns; their structures are written too.
        structure_ids: of more structures; where there are any, all instruments are written, else
            those that campaigns name.
        file: takes the zip.
        project_ids: of projects that are written whole, whose own attachments are written too.
    """
    archive, campaigns = (
        Archive(file, datetime.now(UTC)),
        sorted(campaigns_of(session, campaign_ids).values(), key=lambda row: row.id),
    )
    structures = structures_of(session, {*structure_ids, *(row.structure_id for row in campaigns)})
    named = None if structure_ids else {pair for row in campaigns for pair in _instruments(row)}
    instruments = instrument_for.all(
        session, project_id={row.project_id for row in structures.values()}
    )
    shown = [row for row in instruments if named is None or (row.kind, row.serial) in named]
    archive.json("instruments.json", [shown_as(InstrumentOut, row) for row in shown])
    for _, structure in sorted(structures.items()):
        _write_structure(session, archive, structure)
    results: list[dict[str, Any]] = []
    for campaign in campaigns:
        _write_campaign(session, archive, campaign)
        results += _write_results(
            session, archive, campaign, structures[campaign.structure_id].name
        )
    attached = _write_attachments(session, archive, project_ids, structures, campaigns)
    constants = [name + end for name in CONSTANTS for end in ("", "_sd", "_low", "_high")]
    archive.table("results.csv", [*RESULT_COLUMNS, *constants], results)
    names = {row.id: row.name for row in campaigns} | {
        key: row.name for key, row in structures.items()
    }
    names |= attached
    archive.close(title, user.name, names)


def _instruments(campaign: Campaign) -> list[tuple[str, str]]:
    """Kind and serial number of the instruments that a campaign names."""
    stated = [
        (kind, campaign.instruments.get(kind, {})) for kind in ("hammer", "sensor", "analyser")
    ]
    stated += [("sensor", one) for one in campaign.instruments.get("sensors", ())]
    return [(kind, str(one.get("serial"))) for kind, one in stated]


def _write_structure(session: Session, archive: Archive, structure: Structure) -> None:
    """A structure with its deck, coupons and monitors."""
    folder, shown = f"structures/{structure.id}", described_structure(session, structure)
    archive.json(f"{folder}/structure.json", shown)
    if shown.model is not None:
        row = model_for.row(session, shown.model)
        sent = {name: getattr(row, name) for name in ("filename", "units", "accepted", "sections")}
        archive.json(f"{folder}/model.json", sent)
        with archive.member(f"{folder}/deck") as target:
            target.write(deck_of(session, row))
    _write_coupons(session, archive, structure.id, folder)
    monitors = monitors_of(session, structure.id)
    for monitor, item in zip(monitors, described_monitors(session, monitors), strict=True):
        series = series_document(
            session, monitor, series_for(session, monitor, None), Part(stride=1, limit=EVERY)
        )
        archive.json(f"{folder}/monitors/{monitor.id}.json", {"monitor": item, "series": series})


def _write_attachments(
    session: Session,
    archive: Archive,
    project_ids: Sequence[UUID],
    structures: Mapping[UUID, Structure],
    campaigns: Sequence[Campaign],
) -> dict[UUID, str]:
    """Files beside what is in the archive, as they were sent; their names."""
    monitors = [one.id for key in structures for one in monitors_of(session, key)]
    of_campaigns = [row.id for row in campaigns]
    updates = [key for one in of_campaigns for key, _, _ in labelled_results(session, one)]
    its = joint_update_for.all(session, project_id=project_ids)
    updates += [row.id for row in its if row.joint]
    rows = [
        *beside_projects(session, project_ids),
        *attached_to(session, structure_id=structures),
        *attached_to(session, campaign_id=of_campaigns),
        *attached_to(session, update_job_id=updates),
        *attached_to(session, monitor_id=monitors),
    ]
    for row in rows:
        with archive.member(f"attachments/{row.id}/file") as target:
            copy_original(session, row.sha256, target)
    if rows:
        archive.json("attachments.json", list(describe_attachments(rows)))
    return {row.id: row.name for row in rows}


def _write_coupons(session: Session, archive: Archive, structure_id: UUID, folder: str) -> None:
    batches, rows = [], []
    for batch in described_batches(session, batch_for.all(session, structure_id=[structure_id])):
        items = []
        for coupon in coupon_for.all(session, batch_id=[batch.id]):
            item = describe_coupon(coupon).model_dump()
            rows.append({**item, "batch": batch.name})
            if curve := coupon.curve:
                item["curve"] = curves.describe_curve(curve)
                with archive.member(f"{folder}/curves/{coupon.id}/original") as target:
                    target.write(curves.file_of(curve))
                with archive.member(f"{folder}/curves/{coupon.id}/curve.csv") as target:
                    target.write(curves.as_csv(curve).encode())
            items.append(item)
        batches.append({"batch": batch, "coupons": items})
    archive.json(f"{folder}/coupon-batches.json", batches)
    archive.table(f"{folder}/coupons.csv", COUPON_COLUMNS, rows)


def _write_campaign(session: Session, archive: Archive, campaign: Campaign) -> None:
    """A campaign with its points, hits, FRFs and mode sets."""
    folder = f"campaigns/{campaign.id}"
    archive.json(f"{folder}/campaign.json", described_campaign(campaign))
    with archive.member(f"{folder}/grid-points.csv") as file:
        file.write(to_csv(list_points(session, campaign.id)).encode())
    write_hits(session, archive, folder, campaign.id)
    decided = session.scalars(decisions_of(campaign.id).order_by("id"))
    archive.json(f"{folder}/hit-decisions.json", [shown_as(HitDecisionOut, row) for row in decided])
    processed = documents_of(session, campaign.id)
    archive.json(
        f"{folder}/processings.json",
        [{"id": p.id, "options": p.options, "result": p.document} for p in processed],
    )
    _write_recordings(session, archive, folder, campaign.id)
    tables = make_tables(session, frf_for.all(session, campaign_id=[campaign.id]), Cut())
    if tables:
        with archive.member(f"{folder}/frfs.uff") as file:
            write_uff(tables, file)
    shown = [
        {name: getattr(frf, name) for name in FRF_COLUMNS} for table in tables for frf in table.frfs
    ]  # in the order of the file
    archive.table(f"{folder}/frfs.csv", FRF_COLUMNS, shown)
    sets = described_modes(session, mode_set_for.all(session, campaign_id=[campaign.id]))
    archive.json(f"{folder}/mode-sets.json", sets)
    modes = [
        {"mode_set": str(one.id), "name": one.name, **mode.model_dump()}
        for one in sets
        for mode in one.modes
    ]
    archive.table(f"{folder}/modes.csv", ("mode_set", "name", *MODE_COLUMNS), modes)


def _write_recordings(session: Session, archive: Archive, folder: str, campaign_id: UUID) -> None:
    """Recordings of responses as they were sent, and their spectra."""
    rows = recordings_of(session, campaign_id)
    if not rows:
        return
    shown = described_recordings(session, rows)
    archive.json(f"{folder}/recordings.json", shown)
    for row, each in zip(rows, shown, strict=True):
        if row.bytes_deleted_at is None:
            with archive.member(f"{folder}/recordings/{row.id}/original") as file:
                copy_original(session, row.file_sha256, file)
        if each.spectra is not None:
            with archive.member(f"{folder}/recordings/{row.id}/spectra.npz") as file:
                write_npz(arrays_of(spectra_of_recording(session, row)), file)


def _write_results(
    session: Session, archive: Archive, campaign: Campaign, structure: str
) -> list[dict[str, Any]]:
    """The results of a campaign as documents; a row of the table of results each."""
    rows = []
    for key, document, labels in labelled_results(session, campaign.id):
        archive.json(f"campaigns/{campaign.id}/results/{key}.json", {**document, "labels": labels})
        row = {
            "id": key,
            "campaign_id": campaign.id,
            "campaign": campaign.name,
            "structure": structure,
        }
        row["verdict"] = (document.get("verdict") or {}).get("level")
        for one in document["parameters"]:
            low, high = one["interval_95"] or (None, None)
            row |= {one["name"]: one["estimate"], f"{one['name']}_sd": one["standard_deviation"]}
            row |= {f"{one['name']}_low": low, f"{one['name']}_high": high}
        rows.append(row)
    return rows


# of a file; not more than samples either, since a mapping takes a table's longer side for the time
MOST_HITS = 500
PLACED = ("file", "variable", "row")
COLUMNS = (
    *(
        "id",
        "label",
        "filename",
        "quantity",
        "point",
        "direction",
        "force_point",
        "force_direction",
        "hit",
    ),
    *(
        "sample_rate_hz",
        "samples",
        "sensitivity",
        "window_rate_per_s",
        "full_scale",
        "start_sample",
        "created_at",
    ),
)
_ALIKE = (
    "quantity",
    "dtype",
    "samples",
    "sample_rate_hz",
    "sensitivity",
    "window_rate_per_s",
    "full_scale",
)
"""What the blocks of one channel in one file have in common."""


def write_hits(session: Session, archive: Archive, folder: str, campaign_id: UUID) -> None:
    """Write all time blocks of a campaign, one at a time: alike hits share a file, an array for
    each channel.
    """
    rows: list[dict[str, Any]] = []
    listed = session.scalars(query_of(campaign_id).order_by("id"))
    stored = [row for row in listed if row.bytes_deleted_at is None]
    for number, hits in enumerate(_alike(stored), 1):
        path = f"{folder}/hits/{number}"
        channels = {
            f"{blocks[0].quantity}_{n}": blocks
            for n, blocks in enumerate(zip(*hits, strict=True), 1)
        }
        with archive.member(f"{path}.npz") as file, ZipFile(file, "w") as arrays:
            for variable, blocks in channels.items():
                _write_samples(session, arrays, variable, blocks)
        archive.json(f"{path}.json", {"archived": True, **_mapping(channels)})
        rows += [
            {
                **{name: getattr(block, name) for name in COLUMNS},
                "file": f"hits/{number}.npz",
                "row": row,
            }
            | {"variable": variable, "sha256": block.sha256.hex()}
            for variable, blocks in channels.items()
            for row, block in enumerate(blocks)
        ]
    archive.table(f"{folder}/hits.csv", (*PLACED, *COLUMNS, "sha256"), rows)


def _alike(blocks: Sequence[Record]) -> Iterator[list[list[Record]]]:
    """Hits whose channels are alike, as many as a file takes; the blocks of each with the force
    first.
    """
    hits: dict[tuple[int, int, int], list[Record]] = {}
    for block in blocks:
        hits.setdefault((block.force_point, block.force_direction, block.hit), []).append(block)
    groups: dict[tuple[Any, ...], list[list[Record]]] = {}
    for own in hits.values():
        own.sort(key=lambda block: block.quantity != "force")
        alike = tuple((*(getattr(b, name) for name in _ALIKE), b.start_sample is None) for b in own)
        groups.setdefault(alike, []).append(own)
    for group in groups.values():
        most = min(MOST_HITS, group[0][0].samples)
        yield from (group[start : start + most] for start in range(0, len(group), most))


def _write_samples(
    session: Session, arrays: ZipFile, variable: str, blocks: Sequence[Record]
) -> None:
    """One channel: (hits, samples). It states no time, so that the same hits make the same file."""
    with arrays.open(ZipInfo(f"{variable}.npy"), "w", force_zip64=True) as target:
        shape = len(blocks), blocks[0].samples
        npy.write_array_header_1_0(
            target, {"descr": blocks[0].dtype, "fortran_order": False, "shape": shape}
        )
        target.writelines(sample_bytes(session, blocks))  # type: ignore[arg-type]  # a record has what a BlockRow has


def _mapping(channels: Mapping[str, Sequence[Record]]) -> dict[str, Any]:
    """What the arrays are."""
    force = next(iter(channels.values()))
    return {
        "sample_rate_hz": force[0].sample_rate_hz,
        "hit": [block.hit for block in force],
        "channels": [
            {
                "variable": variable,
                **{
                    name: getattr(blocks[0], name)
                    for name in ("quantity", "sensitivity", "window_rate_per_s")
                },
                "full_scale": blocks[0].full_scale,
                **{
                    name: [getattr(b, name) for b in blocks]
                    for name in ("point", "direction", "label")
                },
                **_starts(blocks),
            }
            for variable, blocks in channels.items()
        ],
    }


def _starts(blocks: Sequence[Record]) -> dict[str, list[int]]:
    starts = [block.start_sample for block in blocks if block.start_sample is not None]
    return {"start_sample": starts} if starts else {}
