"""pyuff as the second reader: a dataset alone, from a temporary file of just that set, compared with our reading.

Our own reading accounts for every column, count and byte, so damage is found without pyuff. What a second reader adds is
the guard against a dialect that both the file and our reader state consistently and that others understand otherwise. A
file comes from one program, so its first datasets of each type show that, and the rest need not be read twice.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyuff

from modalbase.formats.uff.scan import Frame
from modalbase.formats.uff.text import Refusal

_TAG = b"    -1\n"
_UNREADABLE = "pyuff cannot read this dataset; it was read by its columns alone"


class SecondReader:
    """Reads one dataset at a time with pyuff and holds it against what was read from it already.

    Args:
        folder: a folder for the temporary file.
        budget: bytes to read of each dataset type.
    """

    def __init__(self, folder: Path, budget: int) -> None:
        self._file = folder / "dataset.uff"
        self._budget = budget
        self._spent: dict[str, int] = {}

    def has_time_for(self, frame: Frame) -> bool:
        """Whether a dataset is within the budget of its type, which it then uses up."""
        spent = self._spent.get(frame.type, 0) + frame.end - frame.start
        if spent > self._budget:
            return False
        self._spent[frame.type] = spent
        return True

    def compare(self, frame: Frame, body: bytes, claims: dict[str, object]) -> str:
        """A note where pyuff cannot read the dataset, else "".

        Raises:
            Refusal: pyuff reads it, but differently.
        """
        if frame.type == "58b" and b"    -1" in body:
            return "its data hold the bytes of a delimiter, which pyuff cannot read past; read by its byte count alone"
        mode = "r+b" if self._file.exists() else "w+b"  # truncating to nothing first would wait for the disk
        with self._file.open(mode) as file:
            file.write(_TAG + frame.type_line + body + _TAG)
            file.truncate()
        try:
            found = pyuff.UFF(str(self._file)).read_sets()
        except Exception:  # noqa: BLE001 - pyuff raises bare Exception for whatever went wrong
            return _UNREADABLE
        if not isinstance(found, dict):
            return _UNREADABLE
        for key, expected in claims.items():
            if key not in found:
                raise Refusal(f"pyuff finds no '{key}' in it")
            if not _equal(found[key], expected):
                raise Refusal(f"pyuff reads another '{key}' from it than its columns hold")
        return ""


def _equal(found: object, expected: object) -> bool:
    """Whether two readings are the same; text is compared where it is plain, for pyuff decodes it otherwise."""
    if isinstance(expected, str):
        return not expected.isascii() or str(found).strip() == expected
    ours, theirs = np.asarray(expected), np.asarray(found)
    return ours.shape == theirs.shape and bool(np.array_equal(theirs.astype(ours.dtype), ours))
