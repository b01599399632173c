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
from fecore.signal import HalfSpectra, ResponseRecording, spectra_of_setups
from fecore.signal.block_spectra import Motion
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


@dataclass(frozen=True)
class ResponseInputs:
    """The recordings of a campaign, and how they are processed."""

    recordings: tuple[RecordingFile, ...]
    references: tuple[Dof, ...] | None = None  # chosen where None
    lag_s: float | None = None  # chosen where None


@dataclass(frozen=True)
class EncodedSpectra:
    """The half spectra of a recording on their way to the database."""

    recording_id: UUID
    document: dict[str, Any]  # about them
    data: bytes  # arrays, as npz
    sha256: bytes


def spectra_of(inputs: ResponseInputs, report: Report) -> Iterator[HalfSpectra]:
    """Half spectra of each recording, one at a time.

    Raises:
        FormatError: an original is not what was imported.
        InputError: they do not go together, or one is too short for what is stated.
    """
    setups = [_setup(each) for each in inputs.recordings]
    stage = "correlating responses"
    report(stage, 0.0)
    spectra = spectra_of_setups(setups, inputs.references, inputs.lag_s)
    with within("recordings"):
        for number, each in enumerate(spectra, 1):
            report(stage, number / len(setups))
            yield each


def _setup(file: RecordingFile) -> ResponseRecording:
    own = mapped_channels(file.path, file.mapping, file.format, limit_of(file.path), forced=False)
    held = 8 * file.samples * len(own.mapped) <= _HELD_BYTES
    return ResponseRecording(
        _Held(own).chunks if held else own.chunks,
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


def encoded(file: RecordingFile, spectra: HalfSpectra) -> EncodedSpectra:
    """Half spectra as they are stored: in single precision, far below their scatter."""
    stream = io.BytesIO()
    np.savez(
        stream,
        frequency_hz=spectra.frequency_hz,
        blocks=spectra.blocks.astype(np.complex64),
        weights=spectra.weights,
        kurtosis=spectra.kurtosis,
        autos=spectra.autos,
        crosses=spectra.crosses.astype(np.complex64),
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


def decoded(data: bytes, sha256: bytes) -> HalfSpectra:
    """Stored half spectra, after their SHA-256 has been verified.

    Raises:
        Damaged: the bytes are not the ones that were stored.
    """
    with np.load(io.BytesIO(verified(data, sha256, "half spectra"))) as file:
        return HalfSpectra(
            frequency_hz=file["frequency_hz"],
            blocks=file["blocks"].astype(np.complex128),
            weights=file["weights"],
            responses=_dofs(file["responses"]),
            references=_dofs(file["references"]),
            window_rate_per_s=float(file["window_rate_per_s"]),
            lag_s=float(file["lag_s"]),
            length_s=float(file["length_s"]),
            kurtosis=file["kurtosis"],
            autos=file["autos"],
            crosses=file["crosses"].astype(np.complex128),
            quantity=cast("Motion", str(file["quantity"])),
        )


def _pairs(dofs: tuple[Dof, ...]) -> FloatArray:
    return np.array([(dof.point, dof.direction) for dof in dofs], dtype=np.int64)


def _dofs(pairs: FloatArray) -> tuple[Dof, ...]:
    return tuple(Dof(int(point), int(direction)) for point, direction in pairs)
