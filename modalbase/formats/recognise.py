"""Which format a file has: by its first bytes, and where text could be either by its name."""

import re
from pathlib import Path, PurePosixPath

from modalbase.formats.registry import FORMATS, FormatName

_HEAD_BYTES = 4096
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
_DELIMITER = re.compile(rb"\A(?:\xef\xbb\xbf)?\s*-1[ \t]*\r?(?:\n|\Z)")


def recognise(path: Path, name: str = "") -> FormatName:
    """Return the format of a file.

    Text that opens with a UFF delimiter is UFF. What has no mark, such as a .mat of version 4, is what its name says, and the
    reader says what is wrong with it; of other names it is CSV where its first lines are columns, and else UFF.

    Args:
        path: of the file.
        name: what its sender calls it.
    """
    with path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
    suffix = PurePosixPath(name).suffix.lower()
    for magic, found in _MAGIC.items():
        if head.startswith(magic):
            return found
    if _DELIMITER.match(head) or suffix in _UFF_NAMES:
        return "uff"
    named: dict[str, FormatName] = {f".{form}": form for form in FORMATS}
    return named.get(suffix, "csv" if _is_table(head) else "uff")


def _is_table(head: bytes) -> bool:
    """Whether the first two lines of a text have as many columns, at least two."""
    if b"\0" in head:
        return False
    first, _, rest = head.partition(b"\n")
    second = rest.partition(b"\n")[0]
    return any(0 < first.count(sign) == second.count(sign) for sign in (b",", b";", b"\t"))
