"""pyuff as the second reader: each dataset alone, from a temporary file of just that set, compared with our reading."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyuff

from service.campaigns.uff.scan import Frame
from service.campaigns.uff.text import Refusal

_TAG = b"    -1\n"


class SecondReader:
    """Reads one dataset at a time with pyuff and holds it against what was read from it already.

    Args:
        folder: a folder for the temporary file.
    """

    def __init__(self, folder: Path) -> None:
        self._file = folder / "dataset.uff"

    def compare(self, frame: Frame, body: bytes, claims: dict[str, object]) -> str:
        """A note where pyuff cannot read the dataset, else "".

        Raises:
            Refusal: pyuff reads it, but differently.
        """
        if frame.type == "58b" and b"    -1" in body:
            return "its data hold the bytes of a delimiter, which pyuff cannot read past; read by its byte count alone"
        self._file.write_bytes(_TAG + frame.type_line + body + _TAG)
        try:
            found = pyuff.UFF(str(self._file)).read_sets()
        except Exception:  # noqa: BLE001 - pyuff raises bare Exception for whatever went wrong
            return "pyuff cannot read this dataset; it was read by its columns alone"
        if not isinstance(found, dict):
            raise Refusal("pyuff finds more than one dataset in it")
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
