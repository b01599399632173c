"""Recordings of responses on disk to half spectra, and those as bytes. This module imports no
database.
"""

import hashlib
import io
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast
from uuid import UUID

import numpy as np

from fecore.arrays import FloatArray
from fecore.errors import within
from fecore.frf import Dof
from fecore.signal import (
    Averages,
    HalfSpectra,
    LoadFrfs,
    ResponseRecording,
    frfs_of_loads,
    spectra_of_setups,
)
from fecore.signal.block_spectra import Chunks, Motion
from modalbase.formats.records.mapping import Recorded
from service.compute.recordings import MappedChannels, dof_of, limit_of, mapped_channels
from service.platform.errors import verified

_HELD_BYTES = 64 * 1024 * 1024  # of samples, up to which a recording is read once

Report = Callable[[str, float], None]


@dataclass(frozen=True)
class RecordingFile:
    """A recording whose original lies on disk."""

    id: UUID
    path: Path
    filename: str
    format: str
    mapping: dict[str, Any]
    samples: int  # of each channel
    loads: bool  # some channels are measured loads


@dataclass(frozen=True)
class ResponseInputs:
    """The recordings of a campaign, and how they are processed."""

    recordings: tuple[RecordingFile, ...]
    references: tuple[Dof, ...] | None = None  # chosen where None
    lag_s: float | None = None  # chosen where None


@dataclass(frozen=True)
class EncodedSpectra:
    """The half spectra of a recording, or its FRFs with their blocks, on their way to the database."""

    recording_id: UUID
    document: dict[str, Any]  # about them
    data: bytes  # arrays, as npz
    sha256: bytes


def spectra_of(
    inputs: ResponseInputs, report: Report
) -> Iterator[tuple[RecordingFile, HalfSpectra | LoadFrfs]]:
    """Half spectra of each recording of responses alone, then FRFs of each with loads, one at a
    time.

    Raises:
        FormatError: an original is not what was imported.
        InputError: they do not go together, or one is too short for what is stated.
    """
    undriven = [file for file in inputs.recordings if not file.loads]
    driven = [file for file in inputs.recordings if file.loads]
    stage = "correlating responses"
    report(stage, 0.0)
    setups = [_setup(each) for each in undriven]
    spectra = spectra_of_setups(setups, inputs.references, inputs.lag_s) if setups else iter(())
    with within("recordings"):
        for number, pair in enumerate(zip(undriven, spectra, strict=True), 1):
            report(stage, number / len(inputs.recordings))
            yield pair
        lag_s = inputs.lag_s
        for number, file in enumerate(driven, len(undriven) + 1):
            frfs = _frfs_of(file, lag_s)
            lag_s = lag_s or (frfs.lag_s if frfs.window_rate_per_s else None)
            report(stage, number / len(inputs.recordings))
            yield file, frfs


def _frfs_of(file: RecordingFile, lag_s: float | None) -> LoadFrfs:
    own, chunks = _opened(file, "loads")
    is_load = np.array([each.quantity == "force" for each in own.mapped])
    order = np.argsort(is_load, kind="stable")  # loads below responses
    sensors = [own.mapped[k] for k in order[: int((~is_load).sum())]]
    with within(file.filename):
        return frfs_of_loads(
            lambda: (part[order] for part in chunks()),
            own.sample_rate_hz,
            responses=[dof_of(each) for each in sensors],
            loads=[dof_of(own.mapped[k]) for k in np.flatnonzero(is_load)],
            quantities=[cast("Motion", each.quantity) for each in sensors],
            lag_s=lag_s,
        )


def _opened(file: RecordingFile, kind: Recorded) -> tuple[MappedChannels, Chunks]:
    """Its channels, and what gives their samples."""
    own = mapped_channels(file.path, file.mapping, file.format, limit_of(file.path), kind)
    held = 8 * file.samples * len(own.mapped) <= _HELD_BYTES
    return own, _Held(own).chunks if held else own.chunks


def _setup(file: RecordingFile) -> ResponseRecording:
    own, chunks = _opened(file, "responses")
    return ResponseRecording(
        chunks,
        own.sample_rate_hz,
        file.samples,
        tuple(map(dof_of, own.mapped)),
        tuple(cast("Motion", each.quantity) for each in own.mapped),
        file.filename,
    )


class _Held:
    """A short recording, whose samples are read when they are asked for first and stay."""

    def __init__(self, own: MappedChannels) -> None:
        self._own, self._parts = own, list[FloatArray]()

    def chunks(self) -> list[FloatArray]:
        """Its parts in SI."""
        self._parts = self._parts or list(self._own.chunks())
        return self._parts


def encoded(file: RecordingFile, spectra: HalfSpectra | LoadFrfs) -> EncodedSpectra:
    """Half spectra or FRFs with their blocks as they are stored: in single precision, far below their scatter."""
    stream = io.BytesIO()
    np.savez(
        stream,
        frequency_hz=spectra.frequency_hz,
        blocks=spectra.blocks.astype(np.complex64),
        weights=spectra.weights,
        **{name: getattr(spectra, name) for name in _OWN[type(spectra)]},
        responses=_pairs(spectra.responses),
        references=_pairs(spectra.references),
        window_rate_per_s=spectra.window_rate_per_s,
        lag_s=spectra.lag_s,
        length_s=spectra.length_s,
        quantity=spectra.quantity,
    )
    data = stream.getvalue()
    document = {
        "recording": str(file.id),
        "filename": file.filename,
        "quantity": spectra.quantity,
        "references": [{"point": d.point, "direction": d.direction} for d in spectra.references],
        "lag_s": spectra.lag_s,
        "length_s": spectra.length_s,
        "start_hz": float(spectra.frequency_hz[0]),
        "end_hz": float(spectra.frequency_hz[-1]),
        "lines": int(spectra.frequency_hz.size),
        "groups": int(spectra.weights.size),
    }
    return EncodedSpectra(file.id, document, data, hashlib.sha256(data).digest())


_OWN: dict[type[Any], tuple[str, ...]] = {
    HalfSpectra: ("kurtosis", "autos", "crosses"),
    LoadFrfs: ("coherence", "separable"),
}
"""What each kind of spectra has besides what all have."""


def decoded(data: bytes, sha256: bytes) -> HalfSpectra | LoadFrfs:
    """Stored half spectra, or FRFs of measured loads, after their SHA-256 has been verified.

    Raises:
        Damaged: the bytes are not the ones that were stored.
    """
    with np.load(io.BytesIO(verified(data, sha256, "spectra"))) as file:
        kind: type[Any] = LoadFrfs if "separable" in file else HalfSpectra
        spectra: HalfSpectra | LoadFrfs = kind(
            frequency_hz=file["frequency_hz"],
            blocks=file["blocks"].astype(np.complex128),
            weights=file["weights"],
            responses=_dofs(file["responses"]),
            references=_dofs(file["references"]),
            window_rate_per_s=float(file["window_rate_per_s"]),
            lag_s=float(file["lag_s"]),
            length_s=float(file["length_s"]),
            quantity=str(file["quantity"]),
            **{name: file[name] for name in _OWN[kind]},
        )
        return spectra


def averages_of(frfs: LoadFrfs) -> Averages:
    """FRFs of a recording as those of hits are kept; they rest on no hit, and on as many averages
    as the recording is longer than a segment.
    """
    table, count = frfs.frfs(), len(frfs.responses) * len(frfs.references)
    segment_s = 2 * frfs.lag_s if frfs.window_rate_per_s else frfs.lag_s
    return Averages(
        rate_per_s=frfs.window_rate_per_s,
        rate_sd_per_s=0.0,
        frfs=table,
        coherence=np.repeat(frfs.coherence, len(frfs.references), axis=0),
        hits=np.full(count, int(frfs.length_s / segment_s)),
        used=((),) * count,
    )


def _pairs(dofs: tuple[Dof, ...]) -> FloatArray:
    return np.array([(dof.point, dof.direction) for dof in dofs], dtype=np.int64)


def _dofs(pairs: FloatArray) -> tuple[Dof, ...]:
    return tuple(Dof(int(point), int(direction)) for point, direction in pairs)
