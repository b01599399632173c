"""Reading an npz, .mat, CSV, wav or TDMS in the child process: hits or FRFs, and what its arrays are.

This module imports no database and no web, since the child imports it.
"""

from __future__ import annotations

import csv
import warnings
import zipfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from fecore.errors import InputError
from fecore.frf import Quantity
from modalbase.formats.errors import FormatError
from modalbase.formats.frfs import Frfs, read_csv, read_npz
from modalbase.formats.frfs.mat import frfs_of, propose_frfs
from modalbase.formats.frfs.npz import REQUIRED
from modalbase.formats.frfs.table import DOFS
from modalbase.formats.records import (
    TimeBlock,
    Variables,
    blocks_of,
    described,
    propose,
    propose_recording,
    read_mapping,
    read_variables,
)
from modalbase.formats.registry import FORMATS, MEMBERS, FormatName, Kind
from service.compute.frf_rows import EncodedFrf, encoded
from service.compute.recordings import channels_of, looked_at, proposed_recording, recording_of
from service.errors import Fault, Invalid, pointer

if TYPE_CHECKING:
    from service.compute.reading import ReadingInputs

T = TypeVar("T")

FREE_BYTES, RATIO, MOST_BYTES = 64 * 1024 * 1024, 100, 1024 * 1024 * 1024
"""A file may unpack to `FREE_BYTES`, or to `RATIO` times its own size, at most to `MOST_BYTES` or its own size: what is
measured does not compress better."""

MOST_VARIABLES = 1000  # arrays of a file that are listed


@dataclass(frozen=True)
class Found:
    """What a file is."""

    format: FormatName  # by its content
    kind: Kind | None = None  # whether its arrays are hits or FRFs; None of UFF, which may hold both
    variables: dict[str, str] = field(default_factory=dict)  # type and shape of its arrays, with their extremes
    mapping: dict[str, Any] = field(default_factory=dict)  # one that suggests itself; empty where none is needed
    blocks: int | None = None  # time blocks that the stated mapping makes
    counted: bool = False  # hit numbers were only counted in the file
    notes: list[str] = field(default_factory=list)  # what the reader noticed


def read_arrays(inputs: ReadingInputs, form: FormatName) -> Iterator[Found | TimeBlock | EncodedFrf]:
    """What a file is, then its time blocks or FRFs.

    Without a mapping where one is needed, a dry run ends after what the file is.

    Raises:
        Invalid: the file cannot be read, or the mapping is missing or does not fit; each fault with its pointer.
    """
    kind = inputs.kind or _kind_by_names(inputs, form)
    if isinstance(inputs.mapping, dict) and "recording" in inputs.mapping:
        if inputs.kind == "frfs":
            raise Invalid("kind", "is frfs, and the mapping is of a recording of hits; state one of them")
        require_taken(inputs, form, "hits")
        yield from _recording(inputs, inputs.mapping, form)
        return
    if form in ("wav", "tdms"):
        require_taken(inputs, form, kind)
    if form == "tdms" or (form == "wav" and inputs.mapping is None):
        file = _faults_as(_dotted, lambda: recording_of(inputs.path))
        if not inputs.dry_run or inputs.mapping is not None:
            why = f"is missing: a {form} holds a recording of hits; the file has {', '.join(file.names)}"
            raise Invalid(_dotted("mapping.recording"), why)
        yield Found(form, "hits", _faults_as(_dotted, lambda: looked_at(file)), propose_recording(file.names))
        return
    with warnings.catch_warnings(record=True) as noticed:
        warnings.simplefilter("always", UserWarning)
        if kind == "frfs" and inputs.mapping is None and form in ("npz", "csv"):
            yield from _own_frfs(inputs, form)
            return
        limit = limit_of(inputs.path)
        variables = _faults_as(_dotted, lambda: read_variables(inputs.path, f".{form}", limit))
    notes = [str(warning.message) for warning in noticed]
    if kind is None:
        kind = "frfs" if any(array.dtype.kind == "c" for array in variables.values()) else "hits"
    require_taken(inputs, form, kind)
    read = _mapped_frfs if kind == "frfs" else _hits
    yield from read(inputs, form, variables, notes)


def require_taken(inputs: ReadingInputs, form: FormatName, kind: Kind | None) -> None:
    """Refuse what is stated beside a file and not taken with what it holds.

    Raises:
        Invalid: each such member of the request.
    """
    stated = [name for name in MEMBERS if getattr(inputs, name) is not None]
    _faults_as(str, lambda: FORMATS[form].require_taken(kind, stated))


def _recording(inputs: ReadingInputs, mapping: dict[str, Any], form: FormatName) -> Iterator[Found | TimeBlock]:
    """The hits of a recording that goes on over many."""
    limit = limit_of(inputs.path)
    channels = _faults_as(_dotted, lambda: channels_of(inputs.path, mapping, inputs.filename, limit))
    try:
        found = _faults_as(_dotted, channels.survey)
    except InputError as error:
        raise Invalid("", str(error)) from None
    places = _faults_as(_dotted, lambda: channels.places(found.hits))
    notes = _faults_as(_dotted, lambda: channels.notes(found))
    count = sum(map(found.fits, found.hits)) * len(channels.mapped)
    yield Found(form, "hits", channels.file.shapes(), mapping, blocks=count, counted=True, notes=notes)
    yield from channels.blocks(found, places)


def limit_of(path: Path) -> int:
    """The most bytes that a file may unpack to."""
    size = path.stat().st_size
    return max(FREE_BYTES, size, min(RATIO * size, MOST_BYTES))


def _kind_by_names(inputs: ReadingInputs, form: FormatName) -> Kind | None:
    """What the mapping, the format or the names of its columns or arrays say that a file holds; None where they do not."""
    if inputs.mapping is not None:
        return "frfs" if isinstance(inputs.mapping, dict) and "frf" in inputs.mapping else "hits"
    if form in ("wav", "tdms"):
        return "hits"
    names: set[str] = set()
    if form == "csv":
        with inputs.path.open(encoding="utf-8-sig", errors="replace") as text:
            names = {cell.strip() for cell in next(csv.reader([text.readline(1 << 16)]), [])}
    elif form == "npz":
        names = _arrays_of(inputs.path)
    return "frfs" if names.issuperset(REQUIRED) or names.issuperset((*DOFS, "frequency_hz", "real", "imag")) else None


def _arrays_of(path: Path) -> set[str]:
    """Names of the arrays of an npz; none of what is no archive, of which its reader says what is wrong."""
    with suppress(zipfile.BadZipFile), zipfile.ZipFile(path) as archive:
        return {name.removesuffix(".npy") for name in archive.namelist()}
    return set()


def _own_frfs(inputs: ReadingInputs, form: FormatName) -> Iterator[Found | EncodedFrf]:
    """FRFs in the arrays or columns that `GET …/frfs/data` writes, which need no mapping."""
    if form == "npz":
        says = "quantity" in _arrays_of(inputs.path)
        stated = inputs.quantity if says else inputs.quantity or "accelerance"
        frfs = _faults_as(_named, lambda: read_npz(inputs.path, limit_of(inputs.path), stated))
        if not says:
            _quantity(inputs, form)
    else:
        frfs = _faults_as(str, lambda: read_csv(inputs.path, _quantity(inputs, form)))
    shapes = {"frequency_hz": frfs.frequency_hz, "values": frfs.values, "coherence": frfs.coherence}
    rows = encoded(frfs)
    yield Found(form, "frfs", _shapes({name: array for name, array in shapes.items() if array is not None}))
    yield from rows


def _mapped_frfs(
    inputs: ReadingInputs, form: FormatName, variables: Variables, notes: list[str]
) -> Iterator[Found | EncodedFrf]:
    found = Found(form, "frfs", _shapes(variables), propose_frfs(variables), notes=notes)
    if inputs.mapping is None and inputs.dry_run:
        yield found
        return
    quantity = _quantity(inputs, form)
    frfs: Frfs = _faults_as(_dotted, lambda: frfs_of(variables, inputs.mapping, quantity))
    rows = encoded(frfs)
    yield found
    yield from rows


def _hits(
    inputs: ReadingInputs, form: FormatName, variables: Variables, notes: list[str]
) -> Iterator[Found | TimeBlock]:
    found, blocks = hits_of(variables, inputs.mapping, dry_run=inputs.dry_run)
    recording = proposed_recording(variables) if inputs.mapping is None else None
    yield replace(found, format=form, mapping=recording or found.mapping, notes=notes)
    yield from blocks


def hits_of(variables: Variables, stated: Any, *, dry_run: bool) -> tuple[Found, list[TimeBlock]]:
    """What arrays of hits are, and the time blocks that a mapping makes of them; none in a dry run without one.

    Raises:
        Invalid: the mapping is missing or does not fit; each fault with its pointer.
    """
    found = Found("npz", "hits", _shapes(variables), propose(variables))
    if stated is None:
        if not dry_run:
            raise Invalid("mapping", f"is missing; ?dry_run=true proposes one; the file suggests {found.mapping}")
        return found, []
    mapping = _faults_as(_dotted, lambda: read_mapping(stated))
    blocks = _faults_as(_dotted, lambda: blocks_of(variables, mapping))
    return replace(found, blocks=len(blocks), counted=mapping.hit is None), blocks


def _quantity(inputs: ReadingInputs, form: FormatName) -> Quantity:
    if inputs.quantity is None and not inputs.dry_run:
        raise Invalid("quantity", f"is missing: a {form} does not say what it holds, so ?quantity= must")
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
