"""Which format a file has: by its first bytes, and where text could be either by its name."""

from pathlib import Path, PurePosixPath

from modalbase.formats.errors import FormatError
from modalbase.formats.foreign import HEAD_BYTES, MEASURED, UTF_16, refuse_foreign
from modalbase.formats.registry import FORMATS
from modalbase.formats.tables import WORKBOOK, open_table


def recognise(path: Path, name: str = "") -> str:
    """Return the name of a file's format.

    Text that opens with a UFF delimiter is UFF. What has no mark, such as a .mat of version 4, is
    what its name says, and the reader says what is wrong with it; of other names it is CSV where
    its first lines are columns, and else UFF.

    Args:
        path: of the file.
        name: what its sender calls it.

    Raises:
        FormatError: it is of a format that is not read; says what to export instead.
    """
    with path.open("rb") as file:
        head = file.read(HEAD_BYTES)
    suffix = PurePosixPath(name).suffix.lower()
    rows, workbook = FORMATS.values(), WORKBOOK.match(head)
    for row in () if workbook else rows:
        if head.startswith(row.marks) or (row.opening and row.opening.match(head)):
            return row.name
    refuse_foreign(head, name, MEASURED)
    if workbook:
        return "csv"  # whose reader says what to do
    own = next((row.name for row in rows if suffix in row.suffixes), None)
    other = next((row.name for row in rows if suffix in row.other_suffixes), None)
    if other:  # words may stand before the first dataset
        own = next((row.name for row in rows if row.inside and row.inside.search(head)), other)
    if own is None and b"\0" in head and not head.startswith(UTF_16):
        known = ", ".join(row.title.partition(":")[0] for row in rows)
        raise FormatError("", f"the file is of a format that is not read; export one of {known}")
    return own or ("csv" if _is_table(head) else "uff")


def _is_table(head: bytes) -> bool:
    """Whether a text has two columns of numbers or more."""
    whole = head[: head.rfind(b"\n") + 2] if len(head) == HEAD_BYTES else head
    try:
        return len(open_table(whole[: len(whole) // 2 * 2] if b"\0" in head else whole).names) > 1
    except FormatError:
        return False
