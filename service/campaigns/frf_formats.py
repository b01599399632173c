"""Tables of FRFs as files: JSON, npz, CSV. Written row by row, so that memory does not grow with their number."""

from __future__ import annotations

import csv
import io
import json
import zipfile
from collections.abc import Callable, Iterable
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from sqlalchemy.orm import Session

from service.campaigns.frf_data import FrfTable
from service.campaigns.frf_schemas import UNITS
from service.campaigns.tables import Frf

KEYS = ("response_point", "response_direction", "reference_point", "reference_direction")

Writer = Callable[[Session, FrfTable, IO[bytes]], None]


def write_json(session: Session, table: FrfTable, file: IO[bytes]) -> None:
    """`{quantity, unit, frequency_hz, frfs: [{id, response_point, …, real, imag, coherence}]}`."""
    quantity = table.frfs[0].quantity
    head = {"quantity": quantity, "unit": UNITS[quantity], "frequency_hz": table.frequency_hz.tolist()}  # type: ignore[index]
    file.write(json.dumps(head, ensure_ascii=False)[:-1].encode() + b', "frfs": [')
    both = zip(table.spectra(session), table.coherences(session), strict=True)
    for i, ((frf, values), (_, coherence)) in enumerate(both):
        item = {
            "id": str(frf.id),
            "label": frf.label,
            **{key: getattr(frf, key) for key in KEYS},
            "averages": frf.averages,
            "real": values.real.tolist(),
            "imag": values.imag.tolist(),
            "coherence": None if coherence is None else coherence.tolist(),
        }
        file.write((b", " if i else b"") + json.dumps(item, ensure_ascii=False, allow_nan=False).encode())
    file.write(b"]}")


def write_npz(session: Session, table: FrfTable, file: IO[bytes]) -> None:
    """Arrays `frequency_hz` (L,), `values` (N, L), `response_point` … (N,), `id`, `label`, `quantity`, `coherence` (N, L).

    `coherence` is there where at least one FRF has one; the rows of the others are NaN. Values keep their precision.
    """
    shape = (len(table.frfs), table.lines.size)
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED, allowZip64=True) as archive:
        _member(archive, "frequency_hz", table.frequency_hz)
        for key in KEYS:
            _member(archive, key, np.array([getattr(frf, key) for frf in table.frfs], dtype=np.int64))
        _member(archive, "averages", np.array([frf.averages or 0 for frf in table.frfs], dtype=np.int64))
        _member(archive, "id", np.array([str(frf.id) for frf in table.frfs]))
        _member(archive, "label", np.array([frf.label for frf in table.frfs], dtype=np.str_))
        _member(archive, "quantity", np.array(table.frfs[0].quantity))
        _matrix(archive, "values", shape, table.dtype, (values for _, values in table.spectra(session)))
        if table.has_coherence:
            nothing = np.full(table.lines.size, np.nan)
            rows = (nothing if c is None else c for _, c in table.coherences(session))
            _matrix(archive, "coherence", shape, np.dtype(np.float64), rows)


def write_csv(session: Session, table: FrfTable, file: IO[bytes]) -> None:
    """One line a frequency line and FRF: `response_point, …, frequency_hz, real, imag, coherence`."""
    text = io.TextIOWrapper(file, "utf-8", newline="", write_through=True)
    writer = csv.writer(text, lineterminator="\r\n")
    writer.writerow((*KEYS, "frequency_hz", "real", "imag", "coherence"))
    frequency = table.frequency_hz.tolist()
    both = zip(table.spectra(session), table.coherences(session), strict=True)
    for (frf, values), (_, coherence) in both:
        head = _head(frf)
        gamma: Iterable[Any] = [""] * len(frequency) if coherence is None else coherence.tolist()
        rows = zip(frequency, values.real.tolist(), values.imag.tolist(), gamma, strict=True)
        writer.writerows((*head, *row) for row in rows)
    text.flush()
    text.detach()


FORMATS: dict[str, tuple[str, Writer]] = {
    "json": ("application/json", write_json),
    "npz": ("application/x-npz", write_npz),
    "csv": ("text/csv", write_csv),
}
"""Name in `?format=` to media type and writer."""


def _head(frf: Frf) -> tuple[int, ...]:
    return tuple(getattr(frf, key) for key in KEYS)


def _member(archive: zipfile.ZipFile, name: str, array: np.ndarray[Any, Any]) -> None:
    with archive.open(f"{name}.npy", "w") as stream:
        npy.write_array(stream, array, allow_pickle=False)


def _matrix(
    archive: zipfile.ZipFile,
    name: str,
    shape: tuple[int, int],
    dtype: np.dtype[Any],
    rows: Iterable[np.ndarray[Any, Any]],
) -> None:
    """A matrix whose rows come one by one."""
    with archive.open(f"{name}.npy", "w", force_zip64=True) as stream:
        header = {"descr": npy.dtype_to_descr(dtype), "fortran_order": False, "shape": shape}
        npy.write_array_header_2_0(stream, header)
        for row in rows:
            stream.write(np.ascontiguousarray(row, dtype=dtype).tobytes())
