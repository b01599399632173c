"""FRFs that a script sends as JSON: read in a child process, checked in full, and left as rows to store.

This module imports no database, since the child imports it.
"""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np

from modalbase.formats.frfs import FrfRow, Frfs
from modalbase.formats.frfs.table import DOFS
from service.compute.frf_rows import COLUMNS, encoded
from service.errors import Invalid
from service.store.frfs.schemas import FrfsIn
from service.web.json_body import BULK_VALUES, checked, parse_json


def write_rows(body: Path, target: Path) -> int:
    """Read a JSON body and write the rows that are to be stored, each a pickled list in the order of `COLUMNS`.

    Returns:
        The number of rows.

    Raises:
        Invalid: it cannot be read, or does not hold together; each fault with its pointer.
    """
    count = 0
    with target.open("wb") as file:
        for count, frf in enumerate(encoded(from_json(body.read_bytes())), 1):  # noqa: B007 - the last is the number
            columns = frf.columns()
            pickle.dump([columns[name] for name in COLUMNS], file)
    return count


def from_json(body: bytes) -> Frfs:
    """FRFs of a JSON body `{quantity, frequency_hz, frfs: [{response_point, …, real, imag}]}`.

    Raises:
        Invalid: each fault with its pointer.
    """
    sent = checked(FrfsIn, parse_json(body, most_values=BULK_VALUES))
    lines = len(sent.frequency_hz)
    for i, frf in enumerate(sent.frfs):
        for name in ("real", "coherence"):
            values = getattr(frf, name)
            if values is not None and len(values) != lines:
                raise Invalid(f"/frfs/{i}/{name}", f"has {len(values)} values, frequency_hz has {lines}")
    values = np.array([np.array(frf.real) + 1j * np.array(frf.imag) for frf in sent.frfs])
    coherence = None
    if any(frf.coherence is not None for frf in sent.frfs):
        coherence = np.array([frf.coherence or [np.nan] * lines for frf in sent.frfs], dtype=np.float64)
    rows = tuple(FrfRow.between([getattr(f, key) for key in DOFS], f.label, f.averages) for f in sent.frfs)
    return Frfs(np.array(sent.frequency_hz), values, rows, sent.quantity, coherence)
