"""What a dropped file holds and states, in a child process of the API: no database, no web, and
nothing is stored.
"""

from __future__ import annotations

import re
import warnings
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path, PurePosixPath
from typing import Any

from modalbase.formats import uff
from modalbase.formats.errors import FormatError
from modalbase.formats.models.units import guess
from modalbase.formats.records.variables import read_named
from modalbase.formats.registry import FORMATS, Kind
from modalbase.formats.statements import (
    date_in,
    instruments,
    performed_at,
    texts_in,
    with_sensitivities,
)
from service.compute.models.meshes import MESHES
from service.compute.models.reading import READERS, parsed
from service.compute.recordings import limit_of
from service.tasks.import_file.arrays_of_files import FileDescription
from service.tasks.import_file.compute import Kept, ReadingInputs, read_upload
from service.tasks.look.points import PointsOffer, offers_of, reach_of

MODELS = (*READERS, *MESHES)
"""Ends of names of files that hold a model; some of them may hold a measurement instead."""

LARGE = 64_000_000  # bytes of a file that is not searched for grid points as a whole
SMALL = 1_000_000  # the same of a table, which is read line by line
_MEASURED = frozenset(suffix for row in FORMATS.values() for suffix in row.every_suffix)
_BLANK = re.compile(r"\s+")
_NO_NAME = ("", "none", "unknown")


@dataclass(frozen=True)
class FileLook:
    """What a file holds and states."""

    format: str = ""  # by its content; of a model, the end of its name
    kind: Kind | None = None  # what its arrays are, where it holds arrays
    variables: dict[str, str] = field(default_factory=dict)  # arrays: type, shape, extent
    mapping: dict[str, Any] = field(default_factory=dict)  # that suggests itself of them
    counts: Counter[str] = field(default_factory=Counter)  # FRFs, grid points, modes, time blocks
    refused: tuple[str, ...] = ()  # why datasets were refused, each reason once
    notes: tuple[str, ...] = ()  # what its reader noticed
    title: str = ""  # its own name of what was measured
    program: str = ""  # that wrote it
    units: str = ""  # that it states, in its own words
    fits: str = ""  # units in which the materials of a deck are known ones
    performed_at: datetime | None = None  # that it states, local where it names no zone
    instruments: dict[str, str] = field(default_factory=dict)  # by members of a campaign's
    is_model: bool = False  # whether it is a deck or a mesh
    states_units: bool = True  # whether its numbers need no unit to be stated
    points: tuple[PointsOffer, ...] = ()  # arrays that may be grid points
    only_points: bool = False  # whether it holds nothing else
    reach_m: tuple[float, float] | None = None  # length and width that its grid points reach over


class _Silence:
    """A reporter for what nobody waits to hear of."""

    restored: bytes | None = None

    def __call__(self, stage: str, progress: float) -> None:
        """Say nothing."""

    def checkpoint(self, data: bytes) -> None:
        """Keep nothing."""


def look_at(path: Path, filename: str, kind: Kind | None) -> FileLook:
    """Look at a file.

    Args:
        path: where it lies.
        filename: what its sender calls it.
        kind: what its arrays are, where its sender says so.

    Raises:
        InputError, Invalid: it cannot be read.
    """
    suffix = PurePosixPath(filename.lower()).suffix
    if suffix in MODELS and suffix not in _MEASURED:
        return _model(path, filename, suffix)
    inputs = ReadingInputs(path, None, filename, kind=kind, dry_run=True)
    looked = _gathered(read_upload(inputs, _Silence()))
    if looked.format == "uff":
        return _with_head(path, looked)
    texts, points = texts_in(path, looked.format, limit_of(path)), _points(path, looked)
    if any(one.is_all_of(looked.variables) for one in points):
        count = Counter({"grid points": len(points[0].labels)})
        return replace(looked, kind=None, mapping={}, counts=count, points=points, only_points=True)
    return replace(
        looked,
        mapping=with_sensitivities(looked.mapping, texts),
        performed_at=performed_at(texts),
        instruments=instruments(texts),
        points=points,
    )


def _points(path: Path, looked: FileLook) -> tuple[PointsOffer, ...]:
    """Arrays of a file that may be its grid points; none of one that is read part by part."""
    row = FORMATS[looked.format]
    if not row.arrays or row.fixed_rate or path.stat().st_size > (SMALL if row.is_table else LARGE):
        return ()
    with warnings.catch_warnings(), suppress(FormatError):
        warnings.simplefilter("ignore")  # they are notes of the file already
        variables, texts = read_named(path, row.suffixes[0], limit_of(path))
        at = looked.mapping.get("response_point")
        count = len(at) if isinstance(at, list) else looked.counts["FRFs"]
        return tuple(offers_of(variables, texts, count))
    return ()


def _model(path: Path, filename: str, suffix: str) -> FileLook:
    """A deck has no units: those in which its materials are known ones are offered."""
    if suffix in MESHES:
        return FileLook(format=suffix[1:], is_model=True)
    model = parsed(path.read_bytes(), filename)
    offered = guess(model)
    counts = Counter(nodes=len(model.nodes), elements=sum(len(b.nodes) for b in model.elements))
    notes = () if offered is None else (f"units {offered.units}? {offered.reason}",)
    return FileLook(
        format=suffix[1:],
        counts=counts,
        notes=notes,
        title=model.title,
        fits="" if offered is None else offered.units,
        is_model=True,
        states_units=False,
    )


def _gathered(items: Any) -> FileLook:
    description, counts, refused = FileDescription(""), Counter[str](), dict[str, None]()
    places: list[tuple[float, float, float]] = []
    for item in items:
        if isinstance(item, FileDescription):
            description = item
        elif isinstance(item, uff.DatasetReport):
            if item.outcome == "refused" and item.reason:
                refused[item.reason] = None
        else:
            counts[_noun(item)] += len(item) if isinstance(item, list) else 1
            places += [point.xyz_m for point in item] if isinstance(item, list) else []
    return FileLook(
        format=description.format,
        kind=description.kind,
        variables=description.variables,
        mapping=description.mapping,
        counts=counts,
        refused=tuple(refused),
        notes=tuple(description.notes),
        reach_m=reach_of(places) if places else None,
    )


def _noun(item: Kept) -> str:
    """What an item is counted as."""
    if isinstance(item, list):
        return "grid points"
    if isinstance(item, uff.ModeShape):
        return "modes"
    if isinstance(item, uff.Function | uff.TraceLine):
        return "others"
    return "FRFs" if type(item).__name__ == "EncodedFrf" else "time blocks"


def _with_head(path: Path, looked: FileLook) -> FileLook:
    """A UFF with what stands before its first function: names, units, when it was measured."""
    head: dict[str, Any] = {}
    for item in uff.read_file(path, uff.Limits()):
        if isinstance(item, uff.FileHeader):
            head["title"] = _named(item.model_name)
            head["program"] = _named(item.program)
        elif isinstance(item, uff.Units):
            head["units"] = _named(item.description)
        elif isinstance(item, uff.Frf | uff.Function):
            head["performed_at"] = next(filter(None, map(date_in, item.id_lines)), None)
            break
        elif isinstance(item, uff.TimeResponse | uff.ModeShape):
            break
    return replace(looked, **head)


def _named(text: str) -> str:
    text = _BLANK.sub(" ", text).strip()
    return "" if text.lower() in _NO_NAME else text
