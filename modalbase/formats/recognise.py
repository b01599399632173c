"""Which format a file has: by its first bytes, and where text could be either by its name."""

import re
from pathlib import Path, PurePosixPath

from modalbase.formats.errors import FormatError
from modalbase.formats.registry import FORMATS, FormatName
from modalbase.formats.tables import open_table

_HEAD_BYTES = 1 << 16
TEXT_NAMES = (".tsv", ".txt", ".dat", ".asc", ".lvm", ".prn", ".tab", ".tra", ".text")
"""Suffixes that tables of text have beside .csv."""
_UFF_NAMES = (".uff", ".unv", ".uf", ".bunv", ".ufb")
_MAGIC: dict[bytes, FormatName] = {
    b"PK": "npz",
    b"RIFF": "wav",
    b"RIFX": "wav",
    b"RF64": "wav",
    b"TDSm": "tdms",
    b"MATLAB ": "mat",
    b"\x89HDF\r\n\x1a\n": "mat",
}
_OPENING = re.compile(rb"^[ \t]*-1[ \t]*\r?\n[ \t]*\d{1,6}[ \t\r\nb]", re.MULTILINE)
_DELIMITER = re.compile(rb"\A(?:\xef\xbb\xbf)?\s*-1[ \t]*\r?(?:\n|\Z)")


def recognise(path: Path, name: str = "") -> FormatName:
    """Return the format of a file.

    Text that opens with a UFF delimiter is UFF. What has no mark, such as a .mat of version 4, is
    what its name says, and the reader says what is wrong with it; of other names it is CSV where
    its first lines are columns, and else UFF.

    Args:
        path: of the file.
        name: what its sender calls it.
    """
    with path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
    suffix = PurePosixPath(name).suffix.lower()
    for magic, kind in _MAGIC.items():
        if head.startswith(magic):
            return kind
    if _DELIMITER.match(head) or suffix in _UFF_NAMES:
        return "uff"
    named: dict[str, FormatName] = {f".{form}": form for form in FORMATS} | dict.fromkeys(
        TEXT_NAMES, "csv"
    )
    if suffix in TEXT_NAMES and _OPENING.search(head):  # words may stand before the first dataset
        return "uff"
    return named.get(suffix, "csv" if _is_table(head) else "uff")


def _is_table(head: bytes) -> bool:
    """Whether a text has two columns of numbers or more."""
    whole = head[: head.rfind(b"\n") + 2] if len(head) == _HEAD_BYTES else head
    try:
        return len(open_table(whole[: len(whole) // 2 * 2] if b"\0" in head else whole).names) > 1
    except FormatError:
        return False
