"""Tables of FRFs as files: JSON, npz, CSV, Arrow, UFF. Written row by row, so that memory does not grow with their number."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import IO

import numpy as np

from modalbase.formats import uff
from modalbase.formats.frfs import write_csv, write_npz
from modalbase.formats.frfs.arrow import write_arrow
from modalbase.formats.frfs.table import DOFS
from modalbase.formats.uff.write import encode
from service.store.campaigns.grid_points import stored_points
from service.store.frfs.data import FrfTable, only_table
from service.store.frfs.schemas import UNITS


def write_json(table: FrfTable, file: IO[bytes]) -> None:
    """`{quantity, unit, frequency_hz, frfs: [{id, response_point, …, real, imag, coherence}]}`."""
    quantity = table.quantity
    head = {"quantity": quantity, "unit": UNITS[quantity], "frequency_hz": table.frequency_hz.tolist()}  # type: ignore[index]
    file.write(json.dumps(head, ensure_ascii=False)[:-1].encode() + b', "frfs": [')
    for i, (frf, values, coherence) in enumerate(table.both()):
        item = {
            "id": str(frf.id),
            "label": frf.label,
            **{key: getattr(frf, key) for key in DOFS},
            "averages": frf.averages,
            "real": values.real.tolist(),
            "imag": values.imag.tolist(),
            "coherence": None if coherence is None else coherence.tolist(),
        }
        file.write((b", " if i else b"") + json.dumps(item, ensure_ascii=False, allow_nan=False).encode())
    file.write(b"]}")


def write_uff(tables: Sequence[FrfTable], file: IO[bytes], *, binary: bool) -> None:
    """Grid points of the campaign (set 2411), FRFs and their coherences (set 58b, or 58 as text), SI.

    The binary form keeps every bit; the text keeps 13 digits.
    """
    points = stored_points(tables[0].session, tables[0].frfs[0].campaign_id)
    contents: Iterator[uff.Content] = (uff.GridPoint(label, xyz) for label, xyz in points.items())
    for block in encode(itertools.chain(contents, _functions(tables)), binary=binary):
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
    write: Callable[[Sequence[FrfTable], IO[bytes]], None]
    one_table: bool = True


def _alone(write: Callable[[FrfTable, IO[bytes]], None]) -> Callable[..., None]:
    return lambda tables, file: write(only_table(tables), file)


FORMATS: dict[str, Format] = {
    "json": Format("application/json", "json", 70, _alone(write_json)),
    "npz": Format("application/x-npz", "npz", 24, _alone(write_npz)),
    "csv": Format("text/csv", "csv", 90, _alone(write_csv)),
    "arrow": Format("application/vnd.apache.arrow.stream", "arrows", 50, _alone(write_arrow)),
    "uff": Format("application/x-uff", "uff", 24, partial(write_uff, binary=True), one_table=False),
    "uff-ascii": Format("text/x-uff", "uff", 62, partial(write_uff, binary=False), one_table=False),
}
"""By their names in `?format=`."""


def _functions(tables: Sequence[FrfTable]) -> Iterator[uff.Content]:
    """Each FRF, and its coherence after it."""
    for table in tables:
        axis = _uff_axis(table)
        for frf, values, coherence in table.both():
            dofs = {key: getattr(frf, key) for key in DOFS}
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
                    function_type=uff.COHERENCE,
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
