"""Hits in an archive: npz of samples with the mapping that `POST /campaigns/{id}/records` takes, and a table of all blocks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any
from uuid import UUID
from zipfile import ZipFile, ZipInfo

from numpy.lib import format as npy
from sqlalchemy.orm import Session

from service.show.archives.writing import Archive
from service.store.records.operations import query_of, sample_bytes

if TYPE_CHECKING:
    from service.store.records.operations import Record

MOST_HITS = 500  # of a file; not more than samples either, since a mapping takes a table's longer side for the time
PLACED = ("file", "variable", "row")
COLUMNS = (
    *("id", "label", "filename", "quantity", "point", "direction", "force_point", "force_direction", "hit"),
    *("sample_rate_hz", "samples", "sensitivity", "window_rate_per_s", "full_scale", "start_sample", "created_at"),
)
_ALIKE = ("quantity", "dtype", "samples", "sample_rate_hz", "sensitivity", "window_rate_per_s", "full_scale")
"""What the blocks of one channel in one file have in common."""


def write_hits(session: Session, archive: Archive, folder: str, campaign_id: UUID) -> None:
    """Write all time blocks of a campaign, one at a time: alike hits share a file, an array for each channel."""
    rows: list[dict[str, Any]] = []
    stored = session.scalars(query_of(campaign_id).order_by("id")).all()
    for number, hits in enumerate(_alike(stored), 1):
        path = f"{folder}/hits/{number}"
        channels = {f"{blocks[0].quantity}_{n}": blocks for n, blocks in enumerate(zip(*hits, strict=True), 1)}
        with archive.member(f"{path}.npz") as file, ZipFile(file, "w") as arrays:
            for variable, blocks in channels.items():
                _write_samples(session, arrays, variable, blocks)
        archive.json(f"{path}.json", {"archived": True, **_mapping(channels)})
        rows += [
            {**{name: getattr(block, name) for name in COLUMNS}, "file": f"hits/{number}.npz", "row": row}
            | {"variable": variable, "sha256": block.sha256.hex()}
            for variable, blocks in channels.items()
            for row, block in enumerate(blocks)
        ]
    archive.table(f"{folder}/hits.csv", (*PLACED, *COLUMNS, "sha256"), rows)


def _alike(blocks: Sequence[Record]) -> Iterator[list[list[Record]]]:
    """Hits whose channels are alike, as many as a file takes; the blocks of each with the force first."""
    hits: dict[tuple[int, int, int], list[Record]] = {}
    for block in blocks:
        hits.setdefault((block.force_point, block.force_direction, block.hit), []).append(block)
    found: dict[tuple[Any, ...], list[list[Record]]] = {}
    for own in hits.values():
        own.sort(key=lambda block: block.quantity != "force")
        alike = tuple((*(getattr(b, name) for name in _ALIKE), b.start_sample is None) for b in own)
        found.setdefault(alike, []).append(own)
    for group in found.values():
        most = min(MOST_HITS, group[0][0].samples)
        yield from (group[start : start + most] for start in range(0, len(group), most))


def _write_samples(session: Session, arrays: ZipFile, variable: str, blocks: Sequence[Record]) -> None:
    """One channel: (hits, samples). It states no time, so that the same hits make the same file."""
    with arrays.open(ZipInfo(f"{variable}.npy"), "w", force_zip64=True) as target:
        shape = len(blocks), blocks[0].samples
        npy.write_array_header_1_0(target, {"descr": blocks[0].dtype, "fortran_order": False, "shape": shape})
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
                **{name: getattr(blocks[0], name) for name in ("quantity", "sensitivity", "window_rate_per_s")},
                "full_scale": blocks[0].full_scale,
                **{name: [getattr(b, name) for b in blocks] for name in ("point", "direction", "label")},
                **_starts(blocks),
            }
            for variable, blocks in channels.items()
        ],
    }


def _starts(blocks: Sequence[Record]) -> dict[str, list[int]]:
    starts = [block.start_sample for block in blocks if block.start_sample is not None]
    return {"start_sample": starts} if starts else {}
