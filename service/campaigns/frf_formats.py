"""Tables of FRFs as files: JSON, npz, CSV, Arrow, UFF. Written row by row, so that memory does not grow with their number."""

from __future__ import annotations

import csv
import io
import itertools
import json
import zipfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from sqlalchemy.orm import Session

from service.campaigns import uff
from service.campaigns.frf_arrow import write_arrow
from service.campaigns.frf_data import FrfTable, only_table
from service.campaigns.frf_schemas import UNITS
from service.campaigns.grid_points import stored_points
from service.campaigns.reading import COHERENCE
from service.campaigns.tables import Frf
from service.campaigns.uff.write import encode

KEYS = ("response_point", "response_direction", "reference_point", "reference_direction")


def write_json(session: Session, table: FrfTable, file: IO[bytes]) -> None:
    """`{quantity, unit, frequency_hz, frfs: [{id, response_point, …, real, imag, coherence}]}`."""
    quantity = table.frfs[0].quantity
    head = {"quantity": quantity, "unit": UNITS[quantity], "frequency_hz": table.frequency_hz.tolist()}  # type: ignore[index]
    file.write(json.dumps(head, ensure_ascii=False)[:-1].encode() + b', "frfs": [')
    for i, (frf, values, coherence) in enumerate(table.both(session)):
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
    shape = (len(table.frfs), table.frequency_hz.size)
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
            nothing = np.full(table.frequency_hz.size, np.nan)
            rows = (nothing if c is None else c for _, c in table.coherences(session))
            _matrix(archive, "coherence", shape, np.dtype(np.float64), rows)


def write_csv(session: Session, table: FrfTable, file: IO[bytes]) -> None:
    """One line a frequency line and FRF: `response_point, …, frequency_hz, real, imag, coherence`."""
    text = io.TextIOWrapper(file, "utf-8", newline="", write_through=True)
    writer = csv.writer(text, lineterminator="\r\n")
    writer.writerow((*KEYS, "frequency_hz", "real", "imag", "coherence"))
    frequency = table.frequency_hz.tolist()
    for frf, values, coherence in table.both(session):
        head = _head(frf)
        gamma: Iterable[Any] = [""] * len(frequency) if coherence is None else coherence.tolist()
        rows = zip(frequency, values.real.tolist(), values.imag.tolist(), gamma, strict=True)
        writer.writerows((*head, *row) for row in rows)
    text.flush()
    text.detach()


def write_uff(session: Session, tables: Sequence[FrfTable], file: IO[bytes], *, binary: bool) -> None:
    """Grid points of the campaign (set 2411), FRFs and their coherences (set 58b, or 58 as text), SI.

    The binary form keeps every bit; the text keeps 13 digits.
    """
    points = stored_points(session, tables[0].frfs[0].campaign_id)
    contents: Iterator[uff.Content] = (uff.GridPoint(label, xyz) for label, xyz in points.items())
    for block in encode(itertools.chain(contents, _functions(session, tables)), binary=binary):
        file.write(block)


@dataclass(frozen=True)
class Format:
    """A way to write FRFs.

    Attributes:
        media_type: of the file.
        suffix: of its name.
        value_bytes: about what a value takes, its coherence included.
        write: writes tables; where `one_table`, there is one.
        one_table: only FRFs of one quantity on one axis can be written.
    """

    media_type: str
    suffix: str
    value_bytes: int
    write: Callable[[Session, Sequence[FrfTable], IO[bytes]], None]
    one_table: bool = True


def _alone(write: Callable[[Session, FrfTable, IO[bytes]], None]) -> Callable[..., None]:
    return lambda session, tables, file: write(session, only_table(tables), file)


FORMATS: dict[str, Format] = {
    "json": Format("application/json", "json", 70, _alone(write_json)),
    "npz": Format("application/x-npz", "npz", 24, _alone(write_npz)),
    "csv": Format("text/csv", "csv", 90, _alone(write_csv)),
    "arrow": Format("application/vnd.apache.arrow.stream", "arrows", 50, _alone(write_arrow)),
    "uff": Format("application/x-uff", "uff", 24, partial(write_uff, binary=True), one_table=False),
    "uff-ascii": Format("text/x-uff", "uff", 62, partial(write_uff, binary=False), one_table=False),
}
"""By their names in `?format=`."""


def _functions(session: Session, tables: Sequence[FrfTable]) -> Iterator[uff.Content]:
    """Each FRF, and its coherence after it."""
    for table in tables:
        axis = _uff_axis(table)
        for frf, values, coherence in table.both(session):
            dofs = {key: getattr(frf, key) for key in KEYS}
            ids = (frf.label, table.description, "NONE", "NONE", "NONE")
            yield uff.Frf(
                dataset=0,
                label=frf.label,
                id_lines=ids,
                **dofs,
                quantity=frf.quantity,  # type: ignore[arg-type]  # the column holds what was checked on the way in
                frequency=axis,
                values=values,
            )
            if coherence is not None:
                yield uff.Function(
                    dataset=0,
                    label=frf.label,
                    id_lines=ids,
                    function_type=COHERENCE,
                    **dofs,
                    abscissa=axis,
                    abscissa_unit="Hz",
                    values=coherence,
                    unit="",
                )


def _uff_axis(table: FrfTable) -> uff.Axis:
    """Start and step where they give the lines exactly, else the lines."""
    frequency = table.frequency_hz
    if frequency.size > 1:
        even = uff.Axis(float(frequency[0]), float(frequency[1] - frequency[0]), frequency.size)
        if np.array_equal(even.points(), frequency):
            return even
    return uff.Axis(float(frequency[0]), 0.0, frequency.size, frequency)


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
            stream.write(np.ascontiguousarray(row, dtype=dtype).data)
