"""FRFs as CSV: one line a frequency line and FRF."""

import csv
import io
import itertools
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np

from modalbase.formats.errors import FormatError
from modalbase.formats.frfs.table import DOFS, FrfRow, Frfs, FrfTable
from modalbase.formats.tables import read_rows, real, whole, whole_rows
from modalbase.formats.types import Quantity

NUMBERS = ("frequency_hz", "real", "imag")
COLUMNS = (*DOFS, *NUMBERS, "coherence")
_REQUIRED = (*DOFS, *NUMBERS)

Record = tuple[tuple[int, ...], tuple[float, float, float, float]]


def read_csv(
    path: Path, quantity: Quantity = "accelerance", limit_bytes: int | None = None
) -> Frfs:
    r"""FRFs of a CSV file with the header
    `response_point,response_direction,…,frequency_hz,real,imag[,coherence]`.

    Lines of one FRF stand together; all FRFs have the same frequency lines. An empty coherence is
    none.

    >>> import pathlib, tempfile
    >>> header = "response_point,response_direction,reference_point,reference_direction,frequency_hz,real,imag"
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "frfs.csv"
    >>> _ = path.write_text(header + "\n7,3,1,-3,10.0,0.5,0.25\n7,3,1,-3,20.0,1.5,0.75\n")
    >>> found = read_csv(path)
    >>> found.frequency_hz, found.values, found.frfs[0].reference_direction
    (array([10., 20.]), array([[0.5+0.25j, 1.5+0.75j]]), -3)

    Args:
        path: of the file; a spreadsheet may have written it again with other separators.
        quantity: what the FRFs are, which the file does not state; values are in m/s², m/s or m per
            N.
        limit_bytes: the most that the file may have.

    Raises:
        FormatError: the text is not such a table; names the line. Or it is larger.
    """
    if limit_bytes is not None and path.stat().st_size > limit_bytes:
        raise FormatError("", f"has more than the {limit_bytes} bytes that are allowed")
    groups = [
        (dofs, [r[1] for r in rows])
        for dofs, rows in itertools.groupby(_records(path), lambda r: r[0])
    ]
    if not groups:
        raise FormatError("line 2", "is missing: the table has a header and nothing below it")
    blocks = [np.array(rows) for _, rows in groups]
    frequency = blocks[0][:, 0]
    for (dofs, _), block in zip(groups, blocks, strict=True):
        if not np.array_equal(block[:, 0], frequency):
            raise FormatError(
                "frequency_hz",
                f"the lines of FRF {dofs} are not those of the first FRF {groups[0][0]}",
            )
    coherence = np.array([block[:, 3] for block in blocks])
    values = np.array([block[:, 1] + 1j * block[:, 2] for block in blocks])
    rows = tuple(FrfRow.between(dofs) for dofs, _ in groups)
    return Frfs(frequency, values, rows, quantity, None if np.isnan(coherence).all() else coherence)


def write_csv(table: FrfTable, file: IO[bytes]) -> None:
    """Write FRFs as CSV, one line for each frequency line of each FRF, in the columns that
    `read_csv` reads.

    Numbers are in the shortest form that is exact, so what is written is read back bit for bit.

    Args:
        table: the FRFs; their values are taken one FRF at a time.
        file: open for writing bytes.
    """
    text = io.TextIOWrapper(file, "utf-8", newline="", write_through=True)
    writer = csv.writer(text, lineterminator="\r\n")
    writer.writerow(COLUMNS)
    frequency = table.frequency_hz.tolist()
    for frf, values, coherence in table.both():
        head = [getattr(frf, name) for name in DOFS]
        gamma: Iterable[Any] = [""] * len(frequency) if coherence is None else coherence.tolist()
        rows = zip(frequency, values.real.tolist(), values.imag.tolist(), gamma, strict=True)
        writer.writerows((*head, *row) for row in rows)
    text.flush()
    text.detach()


def own_names(path: Path) -> frozenset[str] | None:
    """The columns of a text that `read_csv` reads; None of another one."""
    try:
        return frozenset(read_rows(path, _REQUIRED)[0])
    except FormatError:
        return None


def _records(path: Path) -> Iterator[Record]:
    """Each line below the header: the FRF's degrees of freedom and (frequency, real, imag,
    coherence).
    """
    header, rows = read_rows(path, _REQUIRED)
    if set(header) - set(COLUMNS) or len(set(header)) != len(header):
        raise FormatError(
            "line 1", f"is {','.join(header)[:200]!r}, expected the header {','.join(COLUMNS)}"
        )
    for line, row in whole_rows(header, rows):
        cells = dict(zip(header, row, strict=True))
        dofs = tuple(whole(cells[name], f"line {line}, {name}") for name in DOFS)
        frequency, re, im = (real(cells[name], f"line {line}, {name}") for name in NUMBERS)
        gamma = cells.get("coherence", "").strip()
        yield dofs, (frequency, re, im, real(gamma, f"line {line}, coherence") if gamma else np.nan)
