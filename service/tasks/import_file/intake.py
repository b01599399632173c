"""Storing what the child process read of a file: grid points, FRFs, coherences, modes and the
reports, in one transaction.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Mapping
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from sqlalchemy.orm import Session

if TYPE_CHECKING:
    from service.nouns.imports.operations import Import

from fecore.body.specimen import off_specimen
from modalbase.formats.records import TimeBlock
from modalbase.formats.uff import (
    DatasetReport,
    Function,
    GridPoint,
    ModeShape,
    TimeResponse,
    TraceLine,
)
from service.compute.frf_rows import EncodedFrf
from service.compute.models.alignment import distances
from service.nouns.campaigns.operations import (
    add_points,
    campaign_for,
    campaign_of,
    frame_of,
    stored_points,
)
from service.nouns.frfs.operations import add_coherence
from service.nouns.modes.operations import store_read_modes
from service.nouns.recordings.operations import store_recording
from service.nouns.records.operations import RecordIntake
from service.nouns.storage import book
from service.nouns.structures.models import body_in_space
from service.nouns.structures.operations import present_structure
from service.platform.errors import Conflict, Invalid, PayloadTooLarge
from service.tasks.import_file.arrays_of_files import FileDescription
from service.tasks.import_file.compute import Kept
from service.tasks.import_file.responses import ReadRecording
from service.tasks.import_file.using_conditions import use_conditions

SAME_POINT_M = 1e-6
"""Coordinates of one point in two files may differ by this: a file may have them in single
precision.
"""
MOST_NAMED = 10
MOST_POINTS = 1_000_000  # of a campaign, as many as PUT grid-points takes
RATIO, FREE_BYTES = 8, 64 * 1024 * 1024
"""Spectra of a UFF file may take so many times its size, or so much whatever that is. The densest
text makes 4.
"""
HELD_BYTES = 1024 * 1024 * 1024
"""Coherences and mode shapes of one file that the worker holds until their FRFs and points are
known.
"""
LABEL_BYTES = 64  # that a label of a trace line takes until it is stored
LISTED = 20_000
"""Datasets of one file that are reported one by one; of more, their number is."""

Pair = tuple[int, int, int, int, int]


class Intake:
    """One import's way into the tables: FRFs stream in as they come, the rest follows when the
    whole file was seen.
    """

    def __init__(
        self, session: Session, row: Import, file_bytes: int, records: RecordIntake
    ) -> None:
        self.session = session
        self.row = row
        self.description = FileDescription("uff")
        self.reports: list[DatasetReport] = []
        self.points = stored_points(session, row.campaign_id)
        self.new_points: list[GridPoint] = []
        self.pairs: dict[Pair, int] = {}
        self.coherences: list[tuple[int, Pair, Function]] = []
        self.modes: list[ModeShape] = []
        self.lines: list[TraceLine] = []
        self.counts = {"frfs": 0, "grid_points": 0, "modes": 0, "records": 0, "recordings": 0}
        self.records = records
        self.recordings: list[ReadRecording] = []
        self.conditions: list[str] = []
        self.blocks: set[int] = set()
        self.unused: dict[int, str] = {}
        self.file_bytes = file_bytes
        self.frf_bytes = self.held_bytes = 0
        self.named: set[int] = set()
        self.seen: set[int] = set()

    def take(self, item: Kept, write_frf: Callable[[Mapping[str, Any]], None]) -> None:
        """One item, in the file's order."""
        if isinstance(item, FileDescription):
            self.description = item
        elif isinstance(item, list):
            self._take_points(item)
        elif isinstance(item, EncodedFrf):
            self._take_frf(item, write_frf)
        elif isinstance(item, TimeResponse):
            self._take_block(item)
        elif isinstance(item, TimeBlock):
            self.records.hold(item)
            self.counts["records"] += 1
        elif isinstance(item, ReadRecording):
            self.recordings.append(item)
            self.counts["recordings"] += 1
        elif isinstance(item, Function):
            self._hold(item.values.nbytes)
            self.coherences.append((item.dataset, _pair(item), item))
        elif isinstance(item, ModeShape):
            self._hold(item.values.nbytes + item.points.nbytes)
            self.modes.append(item)
            self.counts["modes"] += 1
        elif isinstance(item, TraceLine):
            self._hold(LABEL_BYTES * len(item.points))
            self.lines.append(item)
        else:
            self.reports.append(item)

    def _hold(self, size: int) -> None:
        self.held_bytes += size
        if self.held_bytes > HELD_BYTES:
            raise PayloadTooLarge(
                f"the file's coherences and mode shapes take more than {HELD_BYTES} bytes; import"
                " it in parts"
            )

    def finish(self) -> None:
        """What can only be stored once the whole file was seen."""
        self.unused |= self.records.finish()
        self.counts["records"] += len(self.blocks - self.unused.keys())
        if self.counts["records"] and not self.row.dry_run:
            counted = bool(self.blocks) or self.description.counted
            source = {"filename": self.row.filename, "import_id": self.row.id}
            self.records.store(
                self.session, self.row.campaign_id, self.unused.keys(), counted=counted, **source
            )
        self._write_recordings()
        self._write_points()
        self._write_coherences()
        self._write_modes()
        self.reports = [
            (
                replace(r, outcome="ignored", reason=self.unused[r.number])
                if r.number in self.unused
                else r
            )
            for r in sorted(self.reports, key=lambda r: r.number)
        ]
        if not any(self.counts.values()) and not self.row.dry_run:
            self._refuse_nothing()
        if self.frf_bytes and not self.row.dry_run:
            campaign = campaign_of(self.session, self.row.campaign_id)
            book(self.session, campaign_for, campaign, "frfs", self.frf_bytes)
        self.row.counts = self.counts
        self.row.format, self.row.kind = self.description.format, self.description.kind
        if self.description.kind is not None:
            self.row.found = {
                name: getattr(self.description, name)
                for name in ("variables", "mapping", "blocks", "table")
            }
        self.row.trace_lines = [line.points for line in self.lines] or None
        self.row.datasets = [asdict(report) for report in self.reports[:LISTED]]
        self.row.warnings = self._warnings()
        self.session.flush()

    def _take_points(self, points: list[GridPoint]) -> None:
        for point in points:
            known = self.points.get(point.number)
            if known is None:
                self.points[point.number] = point.xyz_m
                self.new_points.append(point)
            elif np.max(np.abs(np.subtract(known, point.xyz_m))) > SAME_POINT_M:
                raise Conflict(
                    f"grid point {point.number} lies at {_metres(point.xyz_m)} in the file and at"
                    f" {_metres(known)} in the campaign, or it is in the file twice; correct the"
                    " one that is wrong (PUT grid-points), or import into a campaign of its own"
                )
        if len(self.points) > MOST_POINTS:
            raise PayloadTooLarge(f"the campaign would have more than {MOST_POINTS} grid points")
        self.seen |= {point.number for point in points}
        self.counts["grid_points"] = len(self.seen)

    def _take_block(self, block: TimeResponse) -> None:
        self.blocks.add(block.dataset)
        reason = self.records.take(
            block.dataset,
            TimeBlock(
                quantity=block.quantity,
                point=block.response_point,
                direction=block.response_direction,
                force_point=block.reference_point,
                force_direction=block.reference_direction,
                hit=1,
                sample_rate_hz=block.sample_rate_hz,
                samples=block.samples,
                label=block.label,
            ),
        )
        if reason is not None:
            self.unused[block.dataset] = reason

    def _take_frf(self, frf: EncodedFrf, write: Callable[[Mapping[str, Any]], None]) -> None:
        self.counts["frfs"] += 1
        self.frf_bytes += frf.size
        if self.description.format == "uff" and self.frf_bytes > max(
            FREE_BYTES, RATIO * self.file_bytes
        ):
            raise PayloadTooLarge(
                f"the file has {self.file_bytes} bytes and unpacks to more than {RATIO} times that;"
                " import it in parts"
            )
        if frf.dataset is not None:
            self.pairs[_pair(frf)] = frf.dataset
        self.named |= {frf.response_point, frf.reference_point}
        if self.row.dry_run:
            return
        write({"campaign_id": self.row.campaign_id, "import_id": self.row.id, **frf.columns()})

    def _write_recordings(self) -> None:
        own = {name: getattr(self.row, name) for name in ("campaign_id", "filename")}
        own |= {"import_id": self.row.id, "file_sha256": self.row.sha256}
        for each in self.recordings:
            known = vars(each) | own
            conditions = known.pop("conditions")
            self.conditions += use_conditions(self.session, self.row, conditions)
            if not self.row.dry_run:
                store_recording(self.session, **known)

    def _write_points(self) -> None:
        if self.new_points and not self.row.dry_run:
            points = ((point.number, point.xyz_m) for point in self.new_points)
            add_points(self.session, self.row.campaign_id, points)

    def _write_coherences(self) -> None:
        """Each coherence goes to the FRF between the same points; one that has none is reported as
        ignored.
        """
        for dataset, pair, function in self.coherences:
            values = function.values.real
            # an FRF without its line at 0 Hz
            if pair not in self.pairs and function.abscissa.start == 0:
                pair, values = (*pair[:-1], pair[-1] - 1), values[1:]
            frf = self.pairs.get(pair)
            if frf is None:
                self.unused[dataset] = (
                    "is a coherence of two points between which the file has no FRF on as many"
                    " lines"
                )
            elif not self.row.dry_run:
                self.frf_bytes += values.nbytes
                add_coherence(self.session, self.row.id, frf, values)

    def _write_modes(self) -> None:
        if self.modes and not self.row.dry_run:
            row = self.row
            store_read_modes(self.session, row.campaign_id, row.id, row.filename, self.modes)

    def _refuse_nothing(self) -> None:
        why = [
            f"dataset {r.number} (type {r.type}, byte {r.offset}): {r.reason}"
            for r in self.reports
            if r.reason
        ]
        why = why or ["it holds no hit, FRF, point or mode", *self.description.notes]
        more = f"; and {len(why) - MOST_NAMED} more" if len(why) > MOST_NAMED else ""
        raise Invalid("file", "nothing in it can be stored. " + "; ".join(why[:MOST_NAMED]) + more)

    def _warnings(self) -> list[str]:
        warnings = [*self.description.notes, *self.conditions]
        refused = sum(r.outcome == "refused" for r in self.reports)
        if refused:
            warnings.append(
                f"{refused} of {len(self.reports)} datasets were refused; see datasets for the"
                " reasons"
            )
        if more := Counter(report.outcome for report in self.reports[LISTED:]):
            shown = ", ".join(f"{count} {outcome}" for outcome, count in sorted(more.items()))
            warnings.append(
                f"{more.total()} datasets after the first {LISTED} are not listed: {shown}"
            )
        if unknown := self.named - self.points.keys():
            warnings.append(
                f"FRFs name grid points that have no coordinates yet: {_shown(unknown)}; "
                "`modalbase points` or PUT grid-points states them"
            )
        if off := self._off_specimen():
            warnings.append(
                f"FRFs name grid points off the specimen: {_shown(off)}; an update will refuse"
                " them: check the structure's dimensions, the points' coordinates and the"
                " campaign's frame; GET /campaigns/{id}/alignment lists distances"
            )
        return warnings

    def _off_specimen(self) -> list[int]:
        """Labels of the FRFs' points that an update would refuse."""
        labels = sorted(self.named & self.points.keys())
        if not labels:
            return []
        campaign = campaign_of(self.session, self.row.campaign_id)
        _, structure = present_structure(self.session, campaign.structure_id)
        places = frame_of(campaign).points(np.array([self.points[label] for label in labels]))
        if (g := structure.geometry) is not None:
            off = off_specimen(places[:, :2], g.length_m, g.width_m)
        elif (body := body_in_space(self.session, structure)) is not None:
            off = distances(body, places).off
        else:
            return []
        return [labels[row] for row in np.flatnonzero(off)]


def _shown(labels: Collection[int]) -> str:
    """The first of some points."""
    return ", ".join(map(str, sorted(labels)[:MOST_NAMED])) + (
        " …" if len(labels) > MOST_NAMED else ""
    )


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


def _metres(xyz: tuple[float, float, float]) -> str:
    return "(" + ", ".join(f"{v:.6g}" for v in xyz) + ") m"
