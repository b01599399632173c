"""Reading an uploaded file in the child process: what is kept from it, and a report on every
dataset.

This module imports no database and no web, since the child imports it.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fecore.errors import InputError
from fecore.frf import Quantity, size_fault
from modalbase.formats import uff
from modalbase.formats.records import TimeBlock, described
from modalbase.formats.records.uff import channel_of
from modalbase.formats.registry import Kind
from modalbase.formats.uff.channels import Spectra
from modalbase.formats.uff.content import Outcome
from service.compute.frf_rows import EncodedFrf
from service.compute.spectra import FrequencyAxis, encode, encode_axis
from service.platform.errors import Invalid
from service.tasks.import_file.arrays_of_files import (
    FileDescription,
    form_of,
    read_arrays,
    require_taken,
    responses_of,
)
from service.tasks.import_file.recordings import recording_in_uff, responses_in_uff
from service.tasks.import_file.responses import (
    ReadRecording,
    Throughout,
    proposal_of,
    recorded_throughout,
)

if TYPE_CHECKING:
    from service.platform.queue.kinds import Reporter

POINTS_AT_ONCE = 5000
REPORT_SECONDS = 0.5


Kept = (
    FileDescription
    | list[uff.GridPoint]
    | EncodedFrf
    | uff.Function
    | uff.TimeResponse
    | TimeBlock
    | ReadRecording
    | uff.ModeShape
    | uff.TraceLine
    | uff.DatasetReport
)
"""What goes to the database; of functions that are not FRFs, ordinary coherences and time
blocks.
"""


@dataclass(frozen=True)
class ReadingInputs:
    """A file to read."""

    path: Path  # where it lies
    quantity: Quantity | None  # what an FRF is whose file states neither data type nor unit
    filename: str = ""  # what its sender calls it
    form: str | None = None  # its format where that is known
    kind: Kind | None = None  # what an npz, .mat or CSV holds, where its sender says so
    mapping: Any = None  # which of its variables is what
    dry_run: bool = False  # nothing will be stored


def read_upload(inputs: ReadingInputs, report: Reporter) -> Iterator[Kept]:
    """What a file is, and what is kept of it.

    Raises:
        InputError: the framing of a UFF file is broken; nothing was yielded before.
        Invalid: another file cannot be read, or its mapping does not fit.
    """
    report("checking the file", 0.0)
    form = inputs.form or form_of(inputs.path, inputs.filename)
    recording = isinstance(inputs.mapping, dict) and "recording" in inputs.mapping
    throughout = recorded_throughout(inputs.mapping, inputs.kind)
    if form == "uff" and (throughout or not recording):
        # its hits have no mapping, but in a recording
        require_taken(inputs, form, throughout or "frfs")
        yield from _read_uff(inputs, report, throughout)
        return
    report("reading arrays", 0.0)
    yield from read_arrays(inputs, form)


def _read_uff(
    inputs: ReadingInputs, report: Reporter, throughout: Throughout | None
) -> Iterator[Kept]:
    """What is kept of a UFF file, dataset by dataset, each followed by its report.

    Args:
        inputs: the file.
        report: how far the reading is.
        throughout: what its time blocks are one recording of; None of hits.
    """
    size = inputs.path.stat().st_size
    report_at = 0.0
    try:
        items = uff.read_file(inputs.path, uff.Limits(quantity=inputs.quantity))
        yield FileDescription("uff")
        points: list[uff.GridPoint] = []
        unused: tuple[Outcome, str] | None = None
        spectra = Spectra()
        frfs = refused = False
        channels = Counter[str]()
        for item in items:
            if isinstance(item, uff.GridPoint) and len(points) < POINTS_AT_ONCE:
                points.append(item)
                continue
            if points:
                yield points
                points = []
            if isinstance(item, uff.PowerSpectrum):
                spectra.take(item)
            elif isinstance(item, uff.DatasetReport) and spectra.holds(item):
                continue
            elif isinstance(item, uff.DatasetReport):
                # each report is a commit, which waits for all that is being stored
                if time.monotonic() >= report_at:
                    report("reading datasets", min(1.0, item.offset / size))
                    report_at = time.monotonic() + REPORT_SECONDS
                left_out = unused if item.outcome == "read" else None
                yield (
                    item
                    if left_out is None
                    else replace(item, outcome=left_out[0], reason=left_out[1])
                )
                unused, refused = None, refused or item.outcome == "refused"
            elif isinstance(item, uff.GridPoint):
                points.append(item)
            elif (reason := _why_unused(item)) is not None:
                unused = ("refused" if isinstance(item, uff.Frf) else "ignored", reason)
            elif isinstance(item, uff.Frf):
                spectra.note(item)
                yield _encoded(item, inputs.quantity)
                frfs = True
            elif isinstance(item, uff.Function | uff.TimeResponse | uff.ModeShape | uff.TraceLine):
                is_block = isinstance(item, uff.TimeResponse)
                channels.update([channel_of(item)] if isinstance(item, uff.TimeResponse) else [])
                if not (is_block and throughout):
                    yield item
        for spectrum in spectra.finish():
            yield _encoded(spectrum, inputs.quantity) if isinstance(spectrum, uff.Frf) else spectrum
            frfs = frfs or isinstance(spectrum, uff.Frf)
        if throughout:
            yield from responses_of(inputs, "uff", throughout, complete=True)
            return
        if inputs.quantity is not None and not (frfs or refused):
            raise Invalid(
                "quantity", f"is {inputs.quantity}, and the file has no FRF; leave it out"
            )
        yield from _as_recording(inputs, channels)
    except uff.UffError as error:
        raise InputError("file", f"{error.reason} (byte {error.offset})") from error


def _as_recording(inputs: ReadingInputs, channels: Counter[str]) -> Iterator[FileDescription]:
    """What the time blocks of a file are where they are no single hits, and a mapping.

    Raises:
        Invalid: they are a recording of several hits, and nothing states it.
    """
    if inputs.dry_run and (file := responses_in_uff(inputs.path, channels)) is not None:
        yield FileDescription("uff", "responses", file.shapes(), proposal_of(file))
    elif (recording := recording_in_uff(inputs.path, channels)) is not None:
        if not inputs.dry_run:
            why = "is missing: the force has several hits; ?dry_run=true proposes a mapping"
            raise Invalid("/mapping/recording", why)
        blocks, proposed = recording
        arrays = {name: described(array) for name, array in blocks.items()}
        yield FileDescription("uff", "hits", arrays, proposed)


def _encoded(frf: uff.Frf, stated: Quantity | None) -> EncodedFrf:
    """An FRF on its way to the database.

    Raises:
        Invalid: the file says that it is something else than the request does.
    """
    if stated not in (None, frf.quantity):
        own = f"dataset {frf.dataset} of the file says that it is {frf.quantity}"
        raise Invalid(
            "quantity", f"is {stated}, and {own}; leave quantity out, or correct the file"
        )
    lines = frf.frequency
    even = lines.values is None and lines.count > 1
    return EncodedFrf(
        dataset=frf.dataset,
        label=frf.label,
        response_point=frf.response_point,
        response_direction=frf.response_direction,
        reference_point=frf.reference_point,
        reference_direction=frf.reference_direction,
        quantity=frf.quantity,
        axis=FrequencyAxis(lines.start, lines.step, lines.count)
        if even
        else encode_axis(lines.points()),
        spectrum=encode(frf.values),
    )


def _why_unused(item: uff.Content) -> str | None:
    """Why a content that could be read is not stored; None where it is, or where it only serves to
    read the rest.
    """
    if isinstance(item, uff.Frf):
        return size_fault(item.values)
    if isinstance(item, uff.Function) and item.function_type != uff.COHERENCE:
        article = "an" if item.name[0] in "aeo" else "a"
        return (
            f"is {article} {item.name} in {item.unit or 'no unit'}; of functions, FRFs, coherences,"
            " time blocks and power spectra of force and motion are stored, as their unit or the data"
            " type in record 9 says (13 force, 12 acceleration, 11 velocity, 8 displacement)"
        )
    if isinstance(item, uff.Element):
        return "holds elements of the drawing; they stay in the original file"
    return None
