"""FRFs from a file and to one, in whatever format of the table."""

from pathlib import Path

from modalbase.formats.errors import FormatError
from modalbase.formats.frfs.table import Frfs, FrfTable
from modalbase.formats.recognise import recognise
from modalbase.formats.registry import ALL, FORMATS, load, titles
from modalbase.formats.types import Quantity


def read_frfs(path: Path, quantity: Quantity | None = None) -> Frfs:
    """FRFs of a file that needs no mapping, in the format that its content shows.

    Args:
        path: of the file.
        quantity: what the FRFs are where the file does not state it; None: accelerance.

    Raises:
        FormatError: the file is damaged, or of a format that does not say what is what.
    """
    row = FORMATS[recognise(path, path.name)]
    if not row.frfs:
        known = titles(one for one in FORMATS.values() if one.frfs)
        raise FormatError("", f"is a {row.title} file, expected {known}")
    says = "quantity" in (row.names_in(path) or ())
    frfs: Frfs = load(row.frfs)(path, quantity=quantity if says else quantity or "accelerance")
    return frfs


def write_frfs(table: FrfTable, path: Path) -> None:
    """Write FRFs in the format that the end of the file's name says.

    Raises:
        FormatError: it says none, or what writes it is not installed.
    """
    rows = {
        suffix: (row, writer)
        for row in ALL
        for writer in row.writers
        if writer.one_table
        for suffix in row.suffixes
    }
    if (known := rows.get(path.suffix.lower())) is None:
        raise FormatError("", f"is a '{path.suffix}' file, expected one of {', '.join(rows)}")
    row, writer = known
    for need in row.needs:
        row.dependency(need.module)
    with path.open("wb") as file:
        writer.write(table, file)
