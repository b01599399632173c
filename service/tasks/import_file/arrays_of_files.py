"""Reading a file that is no UFF in the child process: hits or FRFs, and what its arrays are.

This module imports no database and no web, since the child imports it.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

from fecore.errors import InputError
from fecore.frf import Quantity
from modalbase.formats.errors import FormatError
from modalbase.formats.frfs import Frfs
from modalbase.formats.frfs.mat import frfs_of
from modalbase.formats.frfs.parts import (
    PARTS,
    is_frequency,
    is_parts,
    names_of,
    propose_parts,
    texts_of,
)
from modalbase.formats.frfs.proposal import assumed, doubts, left_out, propose_frfs
from modalbase.formats.frfs.table import without_gap
from modalbase.formats.recognise import recognise
from modalbase.formats.records import (
    TimeBlock,
    Variables,
    blocks_of,
    described,
    propose,
    propose_recording,
    read_mapping,
)
from modalbase.formats.records.arrays import SAMPLE_RATE, is_named
from modalbase.formats.records.mapping import ONE_FILE
from modalbase.formats.records.recording import AnyRecording, Arrays
from modalbase.formats.records.text import TextRecording, open_recording
from modalbase.formats.records.variables import read_named
from modalbase.formats.registry import FORMATS, MEMBERS, Format, Kind, load
from modalbase.formats.tables import Stated
from service.compute.frf_rows import EncodedFrf, encoded
from service.compute.recordings import limit_of, recording_of, units_in
from service.platform.errors import Fault, Invalid, pointer
from service.tasks.import_file.recordings import (
    channels_of,
    looked_at,
    proposed_recording,
)
from service.tasks.import_file.responses import (
    ReadRecording,
    Throughout,
    proposal_of,
    proposed_responses,
    read_responses,
    recorded_throughout,
    table_of,
)

if TYPE_CHECKING:
    from service.tasks.import_file.compute import ReadingInputs

T = TypeVar("T")

_TEXT = 80  # characters of a text that is listed
MOST_VARIABLES = 1000  # arrays of a file that are listed


@dataclass(frozen=True)
class FileDescription:
    """What a file is."""

    format: str  # by its content
    # whether its arrays are hits or FRFs; None of UFF, which may hold both
    kind: Kind | None = None
    # type and shape of its arrays, with their extremes
    variables: dict[str, str] = field(default_factory=dict)
    # one that suggests itself; empty where none is needed
    mapping: dict[str, Any] = field(default_factory=dict)
    blocks: int | None = None  # time blocks that the stated mapping makes
    table: dict[str, Any] | None = None  # how a table of text was read
    counted: bool = False  # hit numbers were only counted in the file
    notes: list[str] = field(default_factory=list)  # what the reader noticed


def form_of(path: Path, filename: str) -> str:
    """The name of a file's format.

    Raises:
        Invalid: it is of one that is not read.
    """
    return _faults_as(lambda _: pointer(["file"]), lambda: recognise(path, filename))


def read_arrays(
    inputs: ReadingInputs, form: str
) -> Iterator[FileDescription | TimeBlock | EncodedFrf | ReadRecording]:
    """What a file is, then its time blocks or FRFs, or the recording of responses that it is.

    Without a mapping where one is needed, a dry run ends after what the file is.

    Raises:
        Invalid: the file cannot be read, or the mapping is missing or does not fit; each fault with
            its pointer.
    """
    if (throughout := recorded_throughout(inputs.mapping, inputs.kind)) is not None:
        require_taken(inputs, form, throughout)
        yield from responses_of(inputs, form, throughout)
        return
    if isinstance(inputs.mapping, dict) and "recording" in inputs.mapping:
        if inputs.kind == "frfs":
            raise Invalid(
                "kind", "is frfs, and the mapping is of a recording of hits; state one of them"
            )
        require_taken(inputs, form, "hits")
        yield from _recording(inputs, inputs.mapping, form)
        return
    row = FORMATS[form]
    if row.is_table:
        yield from _table(inputs, form)
        return
    names = row.names_in(inputs.path) if inputs.mapping is None else None
    kind = inputs.kind or _kind_of(inputs, row, own=names is not None)
    if "frfs" not in row.takes:
        require_taken(inputs, form, kind)
    if row.recording and inputs.mapping is None:
        yield _without_mapping(inputs, form)
        return
    if row.recording and not row.arrays:
        yield from _single_hits(inputs, form)
        return
    with warnings.catch_warnings(record=True) as noticed:
        warnings.simplefilter("always", UserWarning)
        if kind == "frfs" and inputs.mapping is None and row.frfs:
            yield from _own_frfs(inputs, form, names or frozenset())
            return
        limit = limit_of(inputs.path)
        variables, texts = _faults_as(
            _dotted, lambda: read_named(inputs.path, row.suffixes[0], limit)
        )
    notes = [str(warning.message) for warning in noticed]
    if kind is None:
        has_parts = propose_parts(list(variables), texts) is not None
        kind = (
            "frfs"
            if has_parts or any(array.dtype.kind == "c" for array in variables.values())
            else "hits"
        )
    require_taken(inputs, form, kind)
    if kind == "frfs":
        yield from _mapped_frfs(inputs, form, variables, texts, notes)
    else:
        yield from _hits(inputs, form, variables, units_in(variables, texts), notes)


def _without_mapping(inputs: ReadingInputs, form: str) -> FileDescription:
    """What a recording is whose mapping a dry run proposes.

    Raises:
        Invalid: it is no dry run.
    """
    file = _faults_as(_dotted, lambda: recording_of(inputs.path, form))
    if not inputs.dry_run:
        why = (
            f"is missing: a {form} holds a recording of hits or of responses, or one hit; the file"
            f" has {', '.join(file.names)}"
        )
        raise Invalid(_dotted("mapping.recording"), why)
    shapes = _faults_as(_dotted, lambda: looked_at(file, together=FORMATS[form].fixed_rate))
    known, proposed = "hits", propose_recording(file.names, file.units)
    of_responses = proposed_responses(file, file.names, None)
    if of_responses is not None and of_responses[1]:
        known, proposed = "responses", of_responses[0]
    return FileDescription(form, cast("Kind", known), shapes, proposed, notes=_starts(file))


def responses_of(
    inputs: ReadingInputs, form: str, kind: Throughout, *, complete: bool = False
) -> Iterator[FileDescription | ReadRecording]:
    """A recording of responses, alone or with their loads; without a mapping, which a dry run proposes, what its channels
    are.

    Args:
        inputs: the file.
        form: its format.
        kind: whether loads were measured.
        complete: the file says of each channel what it is, so that no mapping needs to be stated.

    Raises:
        Invalid: the mapping is missing, or does not fit; or a channel cannot be used.
    """
    limit, stated = limit_of(inputs.path), inputs.mapping
    if stated is None and complete:
        file = _faults_as(_dotted, lambda: recording_of(inputs.path, form, limit))
        stated = proposal_of(file)
    if stated is None:
        file = _faults_as(_dotted, lambda: recording_of(inputs.path, form, limit))
        proposed = proposal_of(file)
        if not inputs.dry_run:
            raise Invalid("/mapping", _missing(proposed))
        table = table_of(file)
        yield FileDescription(form, kind, file.shapes(), proposed, table=table, notes=_starts(file))
        return
    recording, own, notes = _faults_as(
        _dotted, lambda: read_responses(inputs.path, stated, form, limit, kind)
    )
    yield FileDescription(
        form, kind, own.file.shapes(), stated, table=table_of(own.file), notes=notes
    )
    yield recording


def require_taken(inputs: ReadingInputs, form: str, kind: Kind | None) -> None:
    """Refuse what is stated beside a file and not taken with what it holds.

    Raises:
        Invalid: each such member of the request.
    """
    stated = [name for name in MEMBERS if getattr(inputs, name) is not None]
    _faults_as(str, lambda: FORMATS[form].require_taken(kind, stated))


def _recording(
    inputs: ReadingInputs, mapping: dict[str, Any], form: str
) -> Iterator[FileDescription | TimeBlock]:
    """The hits of a recording that goes on over many."""
    limit = limit_of(inputs.path)
    channels = _faults_as(
        _dotted, lambda: channels_of(inputs.path, mapping, inputs.filename, form, limit)
    )
    try:
        survey = _faults_as(_dotted, channels.survey)
    except InputError as error:
        raise Invalid("", str(error)) from None
    places = _faults_as(_dotted, lambda: channels.places(survey.hits))
    notes = _faults_as(_dotted, lambda: channels.notes(survey))
    count = sum(map(survey.fits, survey.hits)) * len(channels.mapped)
    file = channels.file
    table = (
        file.table.layout.described(file.table.encoding)
        if isinstance(file, TextRecording)
        else None
    )
    yield FileDescription(
        form, "hits", file.shapes(), mapping, blocks=count, table=table, counted=True, notes=notes
    )
    yield from channels.blocks(survey, places)


def _table(inputs: ReadingInputs, form: str) -> Iterator[FileDescription | TimeBlock | EncodedFrf]:
    """A table of text: FRFs as this service writes them, or what a mapping says."""
    mapping, stated = inputs.mapping, None
    if isinstance(mapping, dict) and "table" in mapping:
        stated = mapping["table"]
        mapping = {name: value for name, value in mapping.items() if name != "table"} or None
        inputs = replace(inputs, mapping=mapping)
    unstated = mapping is None and stated is None and inputs.kind != "hits"
    if unstated and (names := FORMATS[form].names_in(inputs.path)) is not None:
        require_taken(inputs, form, "frfs")
        yield from _own_frfs(inputs, form, names)
        return
    file = _faults_as(
        _dotted, lambda: open_recording(inputs.path, Stated.of(stated, "mapping.table"))
    )
    kind = inputs.kind or ("frfs" if _holds_frfs(mapping, file) else "hits")
    require_taken(inputs, form, kind)
    variables = _faults_as(_dotted, file.arrays)
    described_ = file.table.layout.described(file.table.encoding)
    notes = file.table.notes
    if kind == "frfs":
        own: dict[str, Any] = mapping if isinstance(mapping, dict) else {}
        columns = names_of(own["frf"], *chain(*PARTS)) if is_parts(own.get("frf")) else []
        by = (
            own["frequency_hz"].get("variable")
            if isinstance(own.get("frequency_hz"), dict)
            else None
        )
        axes = [name for name in file.names if is_frequency(name, file.units)]
        _faults_as(_dotted, lambda: file.require_one_axis(columns, by, axes))
        read: Iterator[FileDescription | TimeBlock | EncodedFrf] = _mapped_frfs(
            inputs, form, variables, texts_of(file.table), notes
        )
    else:
        _faults_as(_dotted, lambda: file.require_one_axis(_variables_of(mapping)))
        read = _hits(inputs, form, variables, file.units, notes)
    for item in read:
        yield (
            replace(item, table=described_, notes=item.notes + _lonely(item))
            if isinstance(item, FileDescription)
            else item
        )


def _lonely(description: FileDescription) -> list[str]:
    """That force and response of a hit belong in one file, where a file holds one of them alone."""
    quantities = [channel["quantity"] for channel in description.mapping.get("channels", [])]
    if None in quantities or not quantities or 0 < quantities.count("force") < len(quantities):
        return []
    return [f"the file holds {' and '.join(quantities)} alone; {ONE_FILE}"]


def _holds_frfs(mapping: Any, file: TextRecording) -> bool:
    """Whether a mapping says so, or without one a column of frequencies, or columns of parts of
    FRFs.
    """
    if mapping is not None:
        return isinstance(mapping, dict) and "frf" in mapping
    by_axis = any(is_frequency(name, file.units) for name in file.names)
    return by_axis or propose_parts(file.names, texts_of(file.table)) is not None


def _starts(file: AnyRecording) -> list[str]:
    """Which channels begin later than others, and whether they can be aligned."""
    try:
        return file.notes(file.names)
    except FormatError as error:
        return [str(error)]


def _single_hits(inputs: ReadingInputs, form: str) -> Iterator[FileDescription | TimeBlock]:
    """A recording whose channels are a block each, of which those that are mapped are read."""
    file = _faults_as(_dotted, lambda: load(FORMATS[form].recording)(inputs.path))
    stated = inputs.mapping
    named = _variables_of(stated)
    names = [name for name in file.names if name in named]
    variables = _faults_as(_dotted, lambda: file.arrays(names, limit_of(inputs.path)))
    axis: Any = stated.get("sample_rate_hz") if isinstance(stated, dict) else None
    if is_named(axis) and axis["variable"] in file.names:
        variables |= _faults_as(
            _dotted, lambda: file.arrays([axis["variable"]], limit_of(inputs.path))
        )
    description, blocks = hits_of(variables, stated, dry_run=inputs.dry_run, units=file.units)
    yield replace(
        description,
        format=form,
        notes=_faults_as(_dotted, lambda: file.notes(names)) if names else [],
    )
    yield from blocks


def _variables_of(mapping: Any) -> list[Any]:
    """What the channels of a mapping name."""
    listed = mapping.get("channels") if isinstance(mapping, dict) else None
    channels = listed if isinstance(listed, list) else []
    return [each.get("variable") for each in channels if isinstance(each, dict)]


def _kind_of(inputs: ReadingInputs, row: Format, *, own: bool) -> Kind | None:
    """What the mapping, the format or its names, which are its `own` ones of FRFs, say that a file
    holds; None where they do not.
    """
    if inputs.mapping is not None and row.looked_at:
        return "frfs" if isinstance(inputs.mapping, dict) and "frf" in inputs.mapping else "hits"
    if "frfs" not in row.takes:
        return "hits"
    return "frfs" if own else None


def _own_frfs(
    inputs: ReadingInputs, form: str, names: frozenset[str]
) -> Iterator[FileDescription | EncodedFrf]:
    """FRFs in the arrays or columns that `GET …/frfs/data` writes, which need no mapping; `names`
    are those of what the file states.
    """
    says = "quantity" in names
    stated = inputs.quantity if says else inputs.quantity or "accelerance"
    frfs: Frfs = _faults_as(
        _named,
        lambda: load(FORMATS[form].frfs)(
            inputs.path, quantity=stated, limit_bytes=limit_of(inputs.path)
        ),
    )
    if not says:
        _quantity(inputs, form)
    shapes = {"frequency_hz": frfs.frequency_hz, "values": frfs.values, "coherence": frfs.coherence}
    frfs, notes = _faults_as(_named, lambda: without_gap(frfs))
    rows = encoded(frfs)
    yield FileDescription(
        form,
        "frfs",
        _shapes({name: array for name, array in shapes.items() if array is not None}),
        notes=notes,
    )
    yield from rows


def _mapped_frfs(
    inputs: ReadingInputs,
    form: str,
    variables: Variables,
    texts: dict[str, str],
    notes: list[str],
) -> Iterator[FileDescription | EncodedFrf]:
    shapes = _shapes(variables) | {
        name: f"text {text[:_TEXT]!r}" for name, text in list(texts.items())[:MOST_VARIABLES]
    }
    proposed = propose_frfs(variables, texts)
    notes = [
        *notes,
        *doubts(inputs.mapping or proposed),
        *left_out(variables, inputs.mapping or proposed),
    ]
    description = FileDescription(form, "frfs", shapes, proposed, notes=notes)
    if inputs.mapping is None and inputs.dry_run:
        yield description
        return
    otherwise: Quantity | None = "accelerance" if inputs.dry_run else None
    mapped: Frfs = _faults_as(
        _dotted, lambda: frfs_of(variables, inputs.mapping, inputs.quantity, texts, otherwise)
    )
    frfs, gap = _faults_as(_dotted, lambda: without_gap(mapped))
    rows = encoded(frfs)
    yield replace(description, notes=[*notes, *assumed(inputs.mapping, texts), *gap])
    yield from rows


def _hits(
    inputs: ReadingInputs,
    form: str,
    variables: Variables,
    units: dict[str, str],
    notes: list[str],
) -> Iterator[FileDescription | TimeBlock]:
    description, blocks = hits_of(variables, inputs.mapping, dry_run=inputs.dry_run, units=units)
    recording = proposed_recording(Arrays(variables, units)) if inputs.mapping is None else None
    yield replace(description, format=form, mapping=recording or description.mapping, notes=notes)
    yield from blocks


def hits_of(
    variables: Variables, stated: Any, *, dry_run: bool, units: dict[str, str] | None = None
) -> tuple[FileDescription, list[TimeBlock]]:
    """What arrays of hits are, and the time blocks that a mapping makes of them; none in a dry run
    without one.

    Args:
        variables: the arrays.
        stated: the mapping.
        dry_run: it need not be stated.
        units: that the file's properties state, by channel.

    Raises:
        Invalid: the mapping is missing or does not fit; each fault with its pointer.
    """
    description = FileDescription("npz", "hits", _shapes(variables), propose(variables, units))
    if stated is None:
        if not dry_run:
            raise Invalid("mapping", _missing(description.mapping))
        return description, []
    if SAMPLE_RATE in variables and isinstance(stated, dict):
        stated = {"sample_rate_hz": {"variable": SAMPLE_RATE}, **stated}
    mapping = _faults_as(_dotted, lambda: read_mapping(stated, units))
    blocks = _faults_as(_dotted, lambda: blocks_of(variables, mapping, units))
    return replace(description, blocks=len(blocks), counted=mapping.hit is None), blocks


def _missing(proposed: dict[str, Any]) -> str:
    """That the mapping is missing, with the one that a file suggests, to be copied."""
    suggested = json.dumps(proposed, ensure_ascii=False)
    return f"is missing; ?dry_run=true proposes one; the file suggests {suggested}"


def _quantity(inputs: ReadingInputs, form: str) -> Quantity:
    if inputs.quantity is None and not inputs.dry_run:
        raise Invalid(
            "quantity", f"is missing: a {form} does not say what it holds, so ?quantity= must"
        )
    return inputs.quantity or "accelerance"


def _shapes(variables: Variables) -> dict[str, str]:
    listed = sorted(variables.items())[:MOST_VARIABLES]
    return {name: described(array) for name, array in listed}


def _faults_as(place: Callable[[str], str], read: Callable[[], T]) -> T:
    """What is read; the places of faults become pointers."""
    try:
        return read()
    except FormatError as error:
        raise Invalid([Fault(place(where), why) for where, why in error.faults]) from None


def _dotted(place: str) -> str:
    return pointer(place.split(".") if place else [])


def _named(place: str) -> str:
    return pointer([place] if place else [])
