"""FRFs that a script sends, as npz, CSV or JSON: read in a child process, checked in full, and left as rows to store.

This module imports no database, since the child imports it.
"""

from __future__ import annotations

import pickle
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from fecore.arrays import FloatArray
from fecore.errors import InputError
from fecore.frf import Dof, FrfSet, Quantity
from modalbase.formats.errors import FormatError
from modalbase.formats.frfs import FrfRow, Frfs, read_csv, read_mat, read_npz
from modalbase.formats.frfs.table import DOFS
from service.errors import Fault, Invalid
from service.frfs.schemas import FrfsIn
from service.frfs.spectra import encode, encode_axis
from service.web.json_body import BULK_VALUES, checked, parse_json, parse_parameter, pointer

MOST_FRFS = 10_000
"""Of one body: each is a row of the answer."""

FREE_BYTES, RATIO = 64 * 1024 * 1024, 100
"""An npz may unpack to `FREE_BYTES`, or to `RATIO` times its own size: what is measured does not compress better."""

COLUMNS = {
    "label": "text",
    **dict.fromkeys(("response_point", "reference_point"), "int8"),
    **dict.fromkeys(("response_direction", "reference_direction"), "int4"),
    "quantity": "text",
    "averages": "int4",
    **dict.fromkeys(("start_hz", "end_hz", "step_hz"), "float8"),
    "axis": "bytea",
    "dtype": "text",
    "lines": "int4",
    "data": "bytea",
    "sha256": "bytea",
    "coherence": "bytea",
    "coherence_dtype": "text",
    "coherence_sha256": "bytea",
}
"""What a row says of an FRF, and the types of the columns."""


@dataclass(frozen=True)
class Sent:
    """A body to read.

    Attributes:
        path: where it lies.
        kind: `json`, `npz`, `csv` or `mat`.
        quantity: what a CSV or a .mat holds.
        limit_bytes: the most that it may unpack to.
        mapping: which variable of a .mat is what, as JSON.
    """

    path: Path
    kind: Literal["json", "npz", "csv", "mat"]
    quantity: Quantity
    limit_bytes: int
    mapping: str | None = None


def write_rows(sent: Sent, target: Path) -> int:
    """Read a body and write the rows that are to be stored, each a pickled list in the order of `COLUMNS`.

    Returns:
        The number of rows.

    Raises:
        Invalid: it cannot be read, or does not hold together; each fault with its pointer.
    """
    if sent.kind == "json":
        frfs = from_json(sent.path.read_bytes())
    elif sent.kind == "csv":
        frfs = from_csv(sent.path, sent.quantity)
    elif sent.kind == "mat":
        frfs = from_mat(sent)
    else:
        frfs = from_npz(sent.path, min(sent.limit_bytes, max(FREE_BYTES, RATIO * sent.path.stat().st_size)))
    if len(frfs.frfs) > MOST_FRFS:
        raise Invalid("", f"holds {len(frfs.frfs)} FRFs, at most {MOST_FRFS} are taken at a time; send several bodies")
    common = {"quantity": frfs.quantity, **encode_axis(frfs.frequency_hz).columns()}
    with target.open("wb") as file:
        for row, values, coherence in frfs.both():
            columns = {
                "label": row.label,
                "averages": row.averages,
                **{name: getattr(row, name) for name in DOFS},
                **common,
                **encode(values).columns(),
                **coherence_columns(coherence),
            }
            pickle.dump([columns[name] for name in COLUMNS], file)
    return len(frfs.frfs)


def coherence_columns(coherence: FloatArray | None) -> dict[str, Any]:
    """A coherence's columns of an FRF's row; empty ones where there is none."""
    if coherence is None:
        return {"coherence": None, "coherence_dtype": None, "coherence_sha256": None}
    spectrum = encode(coherence)
    return {
        "coherence": spectrum.data,
        "coherence_dtype": spectrum.dtype,
        "coherence_sha256": spectrum.sha256,
    }


def from_npz(path: Path, limit_bytes: int) -> Frfs:
    """FRFs of an npz file; see `modalbase.formats.frfs.read_npz`.

    Raises:
        Invalid: it cannot be read, or does not hold together; each fault with its pointer.
    """
    try:
        return _consistent(read_npz(path, limit_bytes))
    except FormatError as error:
        raise Invalid([Fault(pointer([name] if name else []), why) for name, why in error.faults]) from None


def from_csv(path: Path, quantity: Quantity) -> Frfs:
    """FRFs of a CSV file; see `modalbase.formats.frfs.read_csv`.

    Raises:
        Invalid: it cannot be read, or does not hold together; names the line.
    """
    try:
        return _consistent(read_csv(path, quantity))
    except FormatError as error:
        raise Invalid([Fault(*fault) for fault in error.faults]) from None


def from_mat(sent: Sent) -> Frfs:
    """FRFs of a .mat file; see `modalbase.formats.frfs.read_mat`.

    Raises:
        Invalid: it cannot be read, its mapping is missing or does not fit, or the FRFs do not hold together.
    """
    document = None if sent.mapping is None else parse_parameter("mapping", sent.mapping)
    try:
        return _consistent(read_mat(sent.path, document, sent.quantity, sent.limit_bytes))
    except FormatError as error:
        raise Invalid([Fault(pointer(name.split(".") if name else []), why) for name, why in error.faults]) from None


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
    return _consistent(Frfs(np.array(sent.frequency_hz), values, rows, sent.quantity, coherence))


def _consistent(frfs: Frfs) -> Frfs:
    """The FRFs themselves.

    Raises:
        Invalid: they do not hold together; the core says what makes a set of FRFs.
    """
    for name in ("response_point", "reference_point"):
        if not all(1 <= getattr(row, name) <= 9_999_999_999 for row in frfs.frfs):
            raise Invalid(f"/{name}", "a label of a grid point is a number from 1 to 9999999999")
    if frfs.coherence is not None:
        known = frfs.coherence[~np.isnan(frfs.coherence)]
        if (known < 0).any() or (known > 1 + 1e-6).any():
            raise Invalid("/coherence", "lies outside 0 to 1")
    try:
        FrfSet(
            frequency_hz=frfs.frequency_hz,
            values=frfs.values,
            responses=tuple(Dof(row.response_point, row.response_direction) for row in frfs.frfs),
            references=tuple(Dof(row.reference_point, row.reference_direction) for row in frfs.frfs),
            quantity=frfs.quantity,
        )
    except InputError as error:
        raise Invalid(f"/{error.field}", error.message) from None
    if not np.isfinite(frfs.frequency_hz).all():
        raise Invalid("/frequency_hz", "holds NaN or infinite lines")
    return frfs
