"""Storing what the child process read of a file: grid points, FRFs, coherences, modes and the reports, in one transaction."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any
from uuid import UUID

import numpy as np
from sqlalchemy import func, insert, select, update
from sqlalchemy.orm import Session

from service.campaigns.bytea import copy_rows
from service.campaigns.grid_points import stored_points
from service.campaigns.mode_sets import shape_columns
from service.campaigns.reading import EncodedFrf, Kept
from service.campaigns.spectra import encode
from service.campaigns.tables import Frf, GridPoint, Import, Mode, ModeSet
from service.campaigns.uff import DatasetReport, Function, ModeShape
from service.campaigns.uff import GridPoint as ReadPoint
from service.problems import Conflict, Invalid

FRF_COLUMNS = {
    "campaign_id": "uuid",
    "import_id": "uuid",
    "dataset": "int4",
    "label": "text",
    "response_point": "int8",
    "response_direction": "int4",
    "reference_point": "int8",
    "reference_direction": "int4",
    "quantity": "text",
    "start_hz": "float8",
    "end_hz": "float8",
    "step_hz": "float8",
    "axis": "bytea",
    "dtype": "text",
    "lines": "int4",
    "data": "bytea",
    "sha256": "bytea",
}
POINT_COLUMNS = {"campaign_id": "uuid", "label": "int8", "x_m": "float8", "y_m": "float8", "z_m": "float8"}
SAME_POINT_M = 1e-6
"""Coordinates of one point in two files may differ by this: a file may have them in single precision."""
MOST_NAMED = 10

Pair = tuple[int, int, int, int, int]


def store_import(session: Session, job_id: UUID, items: Iterator[Kept]) -> None:
    """Take in a file. A dry run goes the same way and writes the report alone.

    Raises:
        Conflict: a grid point of the file lies elsewhere than the campaign has it.
        Invalid: nothing at all of the file could be read.
    """
    row = session.get_one(Import, job_id)
    # Imports into one campaign are stored one after the other, so that each sees the points of the one before.
    session.execute(select(func.pg_advisory_xact_lock(func.hashtextextended(str(row.campaign_id), 0))))
    intake = _Intake(session, row)
    with copy_rows(session, Frf.__tablename__, FRF_COLUMNS) as write_frf:
        for item in items:
            intake.take(item, write_frf)
    intake.finish()


class _Intake:
    """One import's way into the tables: FRFs stream in as they come, the rest follows when the whole file was seen."""

    def __init__(self, session: Session, row: Import) -> None:
        self.session = session
        self.row = row
        self.reports: list[DatasetReport] = []
        self.points = stored_points(session, row.campaign_id)
        self.new_points: list[ReadPoint] = []
        self.pairs: dict[Pair, int] = {}
        self.coherences: list[tuple[int, Pair, Function]] = []
        self.modes: list[ModeShape] = []
        self.counts = {"frfs": 0, "grid_points": 0, "modes": 0}
        self.named: set[int] = set()
        self.seen: set[int] = set()

    def take(self, item: Kept, write_frf: Callable[[Sequence[Any]], None]) -> None:
        """One item, in the file's order."""
        if isinstance(item, list):
            self._take_points(item)
        elif isinstance(item, EncodedFrf):
            self._take_frf(item, write_frf)
        elif isinstance(item, Function):
            self.coherences.append((item.dataset, _pair(item), item))
        elif isinstance(item, ModeShape):
            self.modes.append(item)
            self.counts["modes"] += 1
        else:
            self.reports.append(item)

    def finish(self) -> None:
        """What can only be stored once the whole file was seen."""
        self._write_points()
        self._write_coherences()
        self._write_modes()
        if not any(self.counts.values()) and not self.row.dry_run:
            self._refuse_nothing()
        self.row.counts = self.counts
        self.row.datasets = [_report(report) for report in self.reports]
        self.row.warnings = self._warnings()
        self.session.flush()

    def _take_points(self, points: list[ReadPoint]) -> None:
        for point in points:
            known = self.points.get(point.number)
            if known is None:
                self.points[point.number] = point.xyz_m
                self.new_points.append(point)
            elif np.max(np.abs(np.subtract(known, point.xyz_m))) > SAME_POINT_M:
                raise Conflict(
                    f"grid point {point.number} lies at {_metres(point.xyz_m)} in the file and at {_metres(known)} in the "
                    "campaign, or it is in the file twice; correct the one that is wrong (PUT grid-points), or import "
                    "into a campaign of its own"
                )
        self.seen |= {point.number for point in points}
        self.counts["grid_points"] = len(self.seen)

    def _take_frf(self, frf: EncodedFrf, write: Callable[[Sequence[Any]], None]) -> None:
        self.counts["frfs"] += 1
        self.pairs[_pair(frf)] = frf.dataset
        self.named |= {frf.response_point, frf.reference_point}
        if self.row.dry_run:
            return
        row = {
            **vars(frf),
            "campaign_id": self.row.campaign_id,
            "import_id": self.row.id,
            **frf.axis.columns(),
            **frf.spectrum.columns(),
        }
        write([row[column] for column in FRF_COLUMNS])

    def _write_points(self) -> None:
        if self.new_points and not self.row.dry_run:
            with copy_rows(self.session, GridPoint.__tablename__, POINT_COLUMNS) as write:
                for point in self.new_points:
                    write((self.row.campaign_id, point.number, *point.xyz_m))

    def _write_coherences(self) -> None:
        """Each coherence goes to the FRF between the same points; one that has none is reported as ignored."""
        orphans: dict[int, str] = {}
        for dataset, pair, function in self.coherences:
            frf = self.pairs.get(pair)
            if frf is None:
                orphans[dataset] = "is a coherence of two points between which the file has no FRF on as many lines"
            elif not self.row.dry_run:
                spectrum = encode(function.values.real)
                self.session.execute(
                    update(Frf)
                    .where(Frf.import_id == self.row.id, Frf.dataset == frf)
                    .values(coherence=spectrum.data, coherence_dtype=spectrum.dtype, coherence_sha256=spectrum.sha256)
                )
        self.reports = [
            replace(r, outcome="ignored", reason=orphans[r.number]) if r.number in orphans else r for r in self.reports
        ]

    def _write_modes(self) -> None:
        if not self.modes or self.row.dry_run:
            return
        modes = sorted(self.modes, key=lambda m: m.frequency_hz)
        mode_set = ModeSet(
            campaign_id=self.row.campaign_id, import_id=self.row.id, name=self.row.filename, origin="file", details={}
        )
        self.session.add(mode_set)
        self.session.flush()
        self.session.execute(
            insert(Mode),
            [
                {
                    "mode_set_id": mode_set.id,
                    "number": number,
                    "frequency_hz": mode.frequency_hz,
                    "damping_ratio": None if np.isnan(mode.damping_ratio) else mode.damping_ratio,
                    "shape": shape_columns(mode.points, mode.values),
                }
                for number, mode in enumerate(modes, 1)
            ],
        )

    def _refuse_nothing(self) -> None:
        why = [f"dataset {r.number} (type {r.type}, byte {r.offset}): {r.reason}" for r in self.reports if r.reason]
        more = f"; and {len(why) - MOST_NAMED} more" if len(why) > MOST_NAMED else ""
        raise Invalid("file", "nothing in it can be stored. " + "; ".join(why[:MOST_NAMED]) + more)

    def _warnings(self) -> list[str]:
        warnings = []
        refused = sum(r.outcome == "refused" for r in self.reports)
        if refused:
            warnings.append(f"{refused} of {len(self.reports)} datasets were refused; see datasets for the reasons")
        unknown = sorted(self.named - self.points.keys())
        if unknown:
            shown = ", ".join(map(str, unknown[:MOST_NAMED])) + (" …" if len(unknown) > MOST_NAMED else "")
            warnings.append(f"FRFs name grid points that have no coordinates yet: {shown}; PUT grid-points adds them")
        return warnings


def _pair(item: EncodedFrf | Function) -> Pair:
    """Between which points and axes; the sense of a direction does not matter to a coherence."""
    lines = item.spectrum.count if isinstance(item, EncodedFrf) else item.abscissa.count
    return (
        item.response_point,
        abs(item.response_direction),
        item.reference_point,
        abs(item.reference_direction),
        lines,
    )


def _report(report: DatasetReport) -> dict[str, Any]:
    return {
        "number": report.number,
        "type": report.type,
        "offset": report.offset,
        "outcome": report.outcome,
        "reason": report.reason,
        "notes": list(report.notes),
    }


def _metres(xyz: tuple[float, float, float]) -> str:
    return "(" + ", ".join(f"{v:.6g}" for v in xyz) + ") m"
