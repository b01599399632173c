"""FRFs as CSV in: one line a frequency line and FRF, with the columns that the CSV out has."""

from __future__ import annotations

import csv
import itertools
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from fecore.frf import Quantity
from service.campaigns.frf_bodies import DOFS, checked
from service.campaigns.frfs import NewFrfs
from service.problems import Invalid

NUMBERS = ("frequency_hz", "real", "imag")
COLUMNS = (*DOFS, *NUMBERS, "coherence")

Record = tuple[tuple[int, ...], tuple[float, float, float, float]]


def from_csv(path: Path, quantity: Quantity) -> NewFrfs:
    """FRFs of a CSV file with the header `response_point,response_direction,…,frequency_hz,real,imag[,coherence]`.

    Lines of one FRF stand together; all FRFs have the same frequency lines. An empty coherence is none.

    Raises:
        Invalid: the text is not such a table; names the line.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as text:
            groups = [(dofs, [r[1] for r in rows]) for dofs, rows in itertools.groupby(_records(text), lambda r: r[0])]
    except UnicodeDecodeError as error:
        raise Invalid("", f"the CSV is not UTF-8: {error.reason} at byte {error.start}") from None
    except csv.Error as error:
        raise Invalid("", f"the CSV cannot be read: {error}") from None
    if not groups:
        raise Invalid("line 2", "is missing: the table has a header and nothing below it")
    blocks = [np.array(rows) for _, rows in groups]
    frequency = blocks[0][:, 0]
    for (dofs, _), block in zip(groups, blocks, strict=True):
        if not np.array_equal(block[:, 0], frequency):
            raise Invalid("frequency_hz", f"the lines of FRF {dofs} are not those of the first FRF {groups[0][0]}")
    coherence = np.array([block[:, 3] for block in blocks])
    return checked(
        frequency,
        np.array([block[:, 1] + 1j * block[:, 2] for block in blocks]),
        {name: np.array([dofs[i] for dofs, _ in groups]) for i, name in enumerate(DOFS)},
        quantity,
        ("",) * len(groups),
        (None,) * len(groups),
        None if np.isnan(coherence).all() else coherence,
    )


def _records(text: Iterator[str]) -> Iterator[Record]:
    """Each line below the header: the FRF's degrees of freedom and (frequency, real, imag, coherence)."""
    reader = csv.reader(text, strict=True)
    header = [cell.strip() for cell in next(reader, [])]
    if set(header) - set(COLUMNS) or len(set(header)) != len(header) or not {*DOFS, *NUMBERS} <= set(header):
        raise Invalid("line 1", f"is {','.join(header)[:200]!r}, expected the header {','.join(COLUMNS)}")
    for row in reader:
        if not any(cell.strip() for cell in row):
            continue
        if len(row) != len(header):
            raise Invalid(f"line {reader.line_num}", f"has {len(row)} cells, the header has {len(header)}")
        cells = dict(zip(header, row, strict=True))
        dofs = tuple(_integer(cells, name, reader.line_num) for name in DOFS)
        frequency, real, imag = (_real(cells, name, reader.line_num) for name in NUMBERS)
        coherence = _real(cells, "coherence", reader.line_num) if cells.get("coherence", "").strip() else np.nan
        yield dofs, (frequency, real, imag, coherence)


def _integer(cells: dict[str, str], name: str, line: int) -> int:
    try:
        return int(cells[name])
    except ValueError:
        raise Invalid(f"line {line}, {name}", f"is {cells[name][:40]!r}, expected a whole number") from None


def _real(cells: dict[str, str], name: str, line: int) -> float:
    try:
        return float(cells[name])
    except ValueError:
        wanted = "a number with a decimal point"
        raise Invalid(f"line {line}, {name}", f"is {cells[name][:40]!r}, expected {wanted}") from None
