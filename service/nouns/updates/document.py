"""The result of an update as a JSON document, and the arrays that are stored beside it.

The arrays are an npz that is not compressed, in a column that is stored as it is
(`STORAGE EXTERNAL`), so PostgreSQL reads only
the parts asked for. Measured on 33 FRFs of 1,000 lines: 1.1 MB read whole took 27 ms, two rows take
3.
"""

import io
import math
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any
from uuid import UUID

import numpy as np
from sqlalchemy.orm import Session

from fecore.correlation import CRITERIA, Agreement, Of
from fecore.updating.campaigns import CampaignsResult
from fecore.updating.result import (
    Correlation,
    HeldOut,
    PosteriorSummary,
    UpdateResult,
)
from service.nouns.updates.result_schemas import CommonOut, JointResultOut, ResultOut
from service.platform.db.bytea import read_slice
from service.platform.errors import Conflict

VERSION = 3
"""Of a document's form; those of another are not read."""

LARGE_PARTS = {
    "stabilisation": ("identification", "stabilisation"),
    "convergence": ("convergence",),
}
"""Parts of a document that only a figure needs, and where they stand."""


def slim(document: Mapping[str, Any], leave_out: Iterable[str]) -> dict[str, Any]:
    """A document without some of its large parts; the one that is given stays as it is."""
    left = dict(document)
    for name in leave_out:
        first, *deeper = LARGE_PARTS[name]
        if deeper and isinstance(left.get(first), dict):
            left[first] = {key: value for key, value in left[first].items() if key != deeper[0]}
        elif not deeper:
            left.pop(first, None)
    return left


def describe(
    result: UpdateResult | CampaignsResult,
    warnings: Iterable[str],
    provenance: dict[str, Any],
    *,
    identification: dict[str, Any] | None = None,
    sources: Sequence[dict[str, Any]] = (),
) -> dict[str, Any]:
    """The document of a result, as `GET /update-jobs/{id}/result` and `/joint-updates/{id}/result`
    answer it: the core's, some members in place of the core's or beside them; what is not finite is
    null.

    Args:
        result: of the core.
        warnings: of what was loaded.
        provenance: where all of it came from.
        identification: how the modes of one campaign were found, as JSON.
        sources: of each of several campaigns, the ids of what it was made of.
    """
    others: dict[str, Any] = {
        "warnings": [*warnings, *result.warnings],
        "posterior": _posterior(result.posterior),
    }
    model: type[CommonOut]
    if isinstance(result, CampaignsResult):
        model, parts = JointResultOut, zip(result.campaigns, sources, strict=True)
        others["campaigns"] = [{**vars(part), **source} for part, source in parts]
    else:
        model = ResultOut
        others["correlation"] = _correlation(result.correlation)
        others["identification"] = identification
    last = {"provenance": provenance, "version": VERSION}
    own = {name: getattr(result, name) for name in model.model_fields.keys() - {*others, *last}}
    document = _plain(model.model_validate(own | others | last).model_dump(exclude_unset=True))
    return {**{name: document[name] for name in document if name not in last}, **last}


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _plain(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    value = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _posterior(posterior: PosteriorSummary) -> dict[str, Any]:
    """The method, how the parameters correlate, and for samples what the chains were like."""
    described: dict[str, Any] = {"method": posterior.method}
    if posterior.correlation is not None:
        described |= {"names": posterior.names, "correlation": posterior.correlation}
    if posterior.samples is not None:
        described["samples"] = len(posterior.samples)
        for name in ("effective_samples", "autocorrelation_time", "acceptance"):
            described[name] = list(getattr(posterior, name))
    return described


def _correlation(correlation: Correlation) -> dict[str, Any]:
    return {
        **_agreement(correlation.updated),
        "initial": _agreement(correlation.initial),
        "held_out": {
            "frfs": _held_out(correlation.held_out_frfs),
            "band": _held_out(correlation.held_out_band),
        },
        "mac_matrix": correlation.mac_matrix,
        **_agreement(correlation.shapes, "shapes"),
    }


def _held_out(held: HeldOut | None) -> dict[str, Any] | None:
    if held is None:
        return None
    kept = {"points": held.points, "band_hz": held.band_hz, "coverage_95": held.coverage_95}
    return kept | _agreement(held.agreement)


def _agreement(agreement: Agreement | None, of: Of = "FRFs") -> dict[str, Any]:
    known = Agreement() if agreement is None else agreement
    return {
        each.member: each.stated(known.get(name))
        for name, each in CRITERIA.items()
        if each.of == of
    }


def is_current(document: Mapping[str, Any]) -> bool:
    """Whether a stored document, or its `version` and some other members, is of today's form."""
    return document.get("version") == VERSION


def require_current(document: dict[str, Any]) -> dict[str, Any]:
    """A stored document that is of today's form.

    Raises:
        Conflict: it is of another one; the message says what to do.
    """
    if not is_current(document):
        raise Conflict(
            "this result has a form that this version of modalbase does not read, as another one"
            " stored it: run the update again"
        )
    if correlation := document.get("correlation"):
        return {**document, "correlation": _with_all_criteria(correlation)}
    return document


def _with_all_criteria(correlation: Mapping[str, Any]) -> dict[str, Any]:
    """Criteria that came after a result was stored have no value in it."""
    held_out = correlation.get("held_out")
    return {
        **_filled(_filled(correlation, "FRFs"), "shapes"),
        "initial": _filled(correlation.get("initial"), "FRFs"),
        "held_out": held_out and {name: _filled(each, "FRFs") for name, each in held_out.items()},
    }


def _filled(part: Any, of: Of) -> Any:
    return part and {**part, **{n: v for n, v in _agreement(None, of).items() if n not in part}}


_BUFFER = 32 * 1024  # bytes that are read at a time: the archive's list of contents fits in


class _Column(io.RawIOBase):
    """The bytes of a result's arrays as a file."""

    def __init__(self, session: Session, key: UUID, size: int) -> None:
        self._session, self._key, self._size, self._place = session, key, size, 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        start = {io.SEEK_SET: 0, io.SEEK_CUR: self._place, io.SEEK_END: self._size}[whence]
        self._place = max(start + offset, 0)
        return self._place

    def readinto(self, buffer: Any) -> int:
        data = read_slice(
            self._session, "update_results", "prediction", self._key, self._place, len(buffer)
        )
        buffer[: len(data)] = data
        self._place += len(data)
        return len(data)


class StoredArrays(Mapping[str, Any]):
    """Arrays by name."""

    def __init__(self, session: Session, key: UUID, size: int) -> None:
        """Name the result.

        Args:
            session: of the request.
            key: of the update job.
            size: of its arrays' bytes.
        """
        # Everything is read through this one buffer: it takes for granted that nobody else moves
        # the column's place.
        self._file = io.BufferedReader(_Column(session, key, size), _BUFFER)
        self._read: dict[str, Any] = {}

    @cached_property
    def _archive(self) -> zipfile.ZipFile:
        return zipfile.ZipFile(self._file)

    @cached_property
    def _names(self) -> list[str]:
        return [name.removesuffix(".npy") for name in self._archive.namelist()]

    def __contains__(self, name: object) -> bool:
        return name in self._names

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __getitem__(self, name: str) -> Any:
        if name not in self._read:
            with self._archive.open(f"{name}.npy") as file:
                self._read[name] = np.lib.format.read_array(file, allow_pickle=False)
        return self._read[name]

    def row(self, name: str, number: int) -> Any:
        """One row of a table, without reading the others."""
        info = self._archive.getinfo(f"{name}.npy")
        with self._archive.open(info) as file:
            np.lib.format.read_magic(file)
            (_, *inner), in_columns, dtype = np.lib.format.read_array_header_1_0(file)
            header = file.tell()
        assert not in_columns, "tables are written row by row"
        self._file.seek(info.header_offset)
        # of an archive's member: at 26 and 28 the lengths of its name and extra field
        local = self._file.read(30)
        begin = (
            info.header_offset
            + 30
            + int.from_bytes(local[26:28], "little")
            + int.from_bytes(local[28:30], "little")
        )
        size = dtype.itemsize * int(np.prod(inner))
        self._file.seek(begin + header + number * size)
        return np.frombuffer(self._file.read(size), dtype=dtype).reshape(inner)
