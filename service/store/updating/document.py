"""The result of an update as a JSON document, and the arrays that are stored beside it.

The arrays are an npz that is not compressed, in a column that is stored as it is
(`STORAGE EXTERNAL`), so PostgreSQL reads only
the parts asked for. Measured on 33 FRFs of 1,000 lines: 1.1 MB read whole took 27 ms, two rows take
3.
"""

import io
import math
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
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
from service.compute.identifying import up_to_date as identification_up_to_date
from service.db.bytea import read_slice
from service.store.updating.result_schemas import JointResultOut, ResultOut

Document = Mapping[str, Any]

VERSION = 3

MARKS = ("version", "outcomes")
"""Members that show the version of a document."""

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
    result: UpdateResult,
    identification: dict[str, Any] | None,
    warnings: Iterable[str],
    provenance: dict[str, Any],
) -> dict[str, Any]:
    """The document that `GET /update-jobs/{id}/result` answers."""
    shapes = result.shapes
    modes = (
        []
        if shapes is None
        else zip(shapes.frequency_hz.tolist(), shapes.kinds, shapes.shares, strict=True)
    )
    members = {
        **{name: getattr(result, name) for name in _AS_THEY_ARE},
        "warnings": [*warnings, *result.warnings],
        "correlation": _correlation(result.correlation),
        "damping_fit": {
            "starts": result.damping_starts,
            "optima": list(result.damping_optima),
            "history": result.damping_history.tolist(),
        },
        "model_modes": [
            {"number": k, "frequency_hz": hz, "kind": kind, **shares}
            for k, (hz, kind, shares) in enumerate(modes, start=1)
        ],
        "identifiability": {"null_directions": list(result.null_directions)},
        "discrepancy": {
            "frequency": result.frequency_discrepancy,
            "damping": result.damping_discrepancy,
        },
        "identification": identification,
        "posterior": _posterior(result.posterior),
        "provenance": provenance,
        "version": VERSION,
    }
    return _written(ResultOut.model_validate(members))


_AS_THEY_ARE = (
    *("verdict", "findings", "outcomes", "parameters", "modes", "damping_models", "convergence"),
    *("starts", "pairing", "band_hz", "channel_delay_s", "reference_temperature_c", "curve"),
)


def describe_joint(
    result: CampaignsResult,
    warnings: Iterable[str],
    sources: Sequence[dict[str, Any]],
    provenance: dict[str, Any],
) -> dict[str, Any]:
    """The document of a joint update, each campaign's part with the ids of what it was made of."""
    members = {
        **vars(result),
        "warnings": [*result.warnings, *warnings],
        "posterior": {"names": result.free, "correlation": result.correlation},
        "campaigns": [
            {**vars(part), **source} for part, source in zip(result.campaigns, sources, strict=True)
        ],
        "damping_models": result.damping,
        "discrepancy": {"frequency": result.discrepancy, "scatter": result.scatter},
        "provenance": provenance,
    }
    for name in ("correlation", "free", "scatter", "damping"):
        del members[name]
    return _written(JointResultOut.model_validate(members))


def _written(result: ResultOut | JointResultOut) -> dict[str, Any]:
    """A result as JSON has it: what is not finite is null."""
    document: dict[str, Any] = _plain(result.model_dump(exclude_unset=True))
    return document


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


_NO_VERDICT = (
    "modalbase 0.1.0, which computed this result, judged none and left the errors of dimensions,"
    " mass, support and instruments out of its intervals: they are too narrow; run the update again"
)


def up_to_date(document: Document) -> dict[str, Any]:
    """A stored document, or some of its members and its `MARKS`, as the present version writes
    them.
    """
    for step in _STEPS[_version(document) - 1 :]:
        document = step(document)
    if correlation := document.get("correlation"):
        document = {**document, "correlation": _with_all_criteria(correlation)}
    return {**document, "version": VERSION}


def _with_all_criteria(correlation: Document) -> dict[str, Any]:
    """Criteria that came after a result was stored have no value in it."""
    held_out = correlation.get("held_out")
    return {
        **_filled(_filled(correlation, "FRFs"), "shapes"),
        "initial": _filled(correlation.get("initial"), "FRFs"),
        "held_out": held_out and {name: _filled(each, "FRFs") for name, each in held_out.items()},
    }


def _filled(part: Any, of: Of) -> Any:
    return part and {**part, **{n: v for n, v in _agreement(None, of).items() if n not in part}}


def _version(document: Document) -> int:
    return int(document.get("version") or (2 if document.get("outcomes") else 1))


def _from_1(document: Document) -> Document:
    """0.1.0 failed a job unless both stages succeeded, and its only uncertainty was noise and the
    model's discrepancy.
    """
    return {
        **dict.fromkeys(("verdict", "warnings")),
        **document,
        "verdict": {
            "level": "with_care",
            "sentence": f"Use with care: {_NO_VERDICT}.",
            "reasons": [],
        },
        "warnings": [_NO_VERDICT, *document.get("warnings", ())],
        "outcomes": [
            {"stage": stage, "status": "succeeded", "message": ""}
            for stage in ("elastic", "damping")
        ],
        "parameters": [
            {
                **row,
                "comparable": {
                    "estimate": row["estimate"],
                    "standard_deviation": row["noise_standard_deviation"],
                },
                "budget": [],
                "confounded_with": [],
            }
            for row in document.get("parameters", ())
        ],
        "channel_delay_s": None,
    }


def _from_2(document: Document) -> Document:
    """What 0.2.0 had not from its beginning is here too: some of its first builds left results
    behind.
    """
    costs = [step["cost"] for step in document.get("convergence", ())]
    identified = document.get("identification")
    return {
        "starts": [{"chosen": True, "failure": None, "cost": costs, "parameters": {}}],
        "model_modes": [],
        "pairing": None,
        "findings": [],
        "reference_temperature_c": None,
        "curve": None,
        **document,
        "parameters": [{"tied_to": None, **row} for row in document.get("parameters", ())],
        "modes": [{"measured_damping_sd": None, **row} for row in document.get("modes", ())],
        "damping_models": [
            {"standard_deviations": {}, "curve": None, "by_mechanism": False, **row}
            for row in document.get("damping_models", ())
        ],
        "identification": identified and identification_up_to_date(identified),
    }


_STEPS: tuple[Callable[[Document], Document], ...] = (_from_1, _from_2)


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
