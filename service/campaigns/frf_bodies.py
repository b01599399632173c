"""FRFs that a script sends, as npz or JSON, checked in full before anything is stored."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy
from pydantic import ValidationError

from fecore.errors import InputError
from fecore.frf import Dof, FrfSet
from service.campaigns.frf_schemas import FrfsIn
from service.campaigns.frfs import NewFrfs
from service.problems import Fault, Invalid
from service.problems.json_body import parse_json

DOFS = ("response_point", "response_direction", "reference_point", "reference_direction")
REQUIRED = ("frequency_hz", "values", *DOFS)
OPTIONAL = ("quantity", "averages", "coherence", "label", "id")

Array = np.ndarray[Any, Any]


def from_json(body: bytes) -> NewFrfs:
    """FRFs of a JSON body `{quantity, frequency_hz, frfs: [{response_point, …, real, imag}]}`.

    Raises:
        Invalid: each fault with its pointer.
    """
    try:
        sent = FrfsIn.model_validate(parse_json(body))
    except ValidationError as error:
        faults = [Fault("".join(f"/{step}" for step in e["loc"]), e["msg"]) for e in error.errors()[:20]]
        raise Invalid(faults) from None
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
    return checked(
        np.array(sent.frequency_hz),
        values,
        {key: np.array([getattr(frf, key) for frf in sent.frfs]) for key in DOFS},
        sent.quantity,
        tuple(frf.label for frf in sent.frfs),
        tuple(frf.averages for frf in sent.frfs),
        coherence,
    )


def from_npz(path: Path, limit_bytes: int) -> NewFrfs:
    """FRFs of an npz file with the arrays `frequency_hz` (L,), `values` (N, L), `response_point` … (N,), `quantity`.

    Raises:
        Invalid: the file is not such an archive; names the array.
    """
    arrays = _read_arrays(path, limit_bytes)
    missing = [name for name in REQUIRED if name not in arrays]
    if missing:
        raise Invalid([Fault(f"/{name}", "is missing") for name in missing])
    values = arrays["values"]
    if values.ndim == 1:
        values = values[np.newaxis]
    if values.ndim != 2 or values.dtype.kind != "c" or values.dtype.itemsize not in (8, 16) or not values.size:
        raise Invalid("/values", f"is {values.dtype} of shape {values.shape}, expected complex64 or complex128 (N, L)")
    frequency = arrays["frequency_hz"]
    if frequency.ndim != 1 or frequency.dtype.kind not in "fiu":
        raise Invalid("/frequency_hz", f"is {frequency.dtype} of shape {frequency.shape}, expected real numbers (L,)")
    count = values.shape[0]
    averages = _integers("averages", arrays["averages"], count) if "averages" in arrays else np.zeros(count, np.int64)
    return checked(
        frequency.astype(np.float64),
        values.astype(values.dtype.newbyteorder("<")),
        {name: _integers(name, arrays[name], count) for name in DOFS},
        _text("quantity", arrays["quantity"]) if "quantity" in arrays else "accelerance",
        _labels(arrays.get("label"), count),
        tuple(int(n) if n > 0 else None for n in averages),
        _coherence(arrays.get("coherence"), values.shape),
    )


def checked(
    frequency: Array,
    values: Array,
    dofs: dict[str, Array],
    quantity: str,
    labels: tuple[str, ...],
    averages: tuple[int | None, ...],
    coherence: Array | None,
) -> NewFrfs:
    """FRFs that hold together.

    Raises:
        Invalid: they do not.
    """
    for name in ("response_point", "reference_point"):
        if (dofs[name] < 1).any() or (dofs[name] > 9_999_999_999).any():
            raise Invalid(f"/{name}", "a label of a grid point is a number from 1 to 9999999999")
    if coherence is not None:
        known = coherence[~np.isnan(coherence)]
        if (known < 0).any() or (known > 1 + 1e-6).any():
            raise Invalid("/coherence", "lies outside 0 to 1")
    try:
        frfs = FrfSet(
            frequency_hz=frequency,
            values=values,
            responses=tuple(map(Dof, dofs["response_point"].tolist(), dofs["response_direction"].tolist())),
            references=tuple(map(Dof, dofs["reference_point"].tolist(), dofs["reference_direction"].tolist())),
            quantity=quantity,  # type: ignore[arg-type]  # FrfSet refuses others
        )
    except InputError as error:
        raise Invalid(f"/{error.field}", error.message) from None
    if not np.isfinite(frequency).all():
        raise Invalid("/frequency_hz", "holds NaN or infinite lines")
    return NewFrfs(frfs, labels, averages, coherence)


def _read_arrays(path: Path, limit_bytes: int) -> dict[str, Array]:
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
            if sum(member.file_size for member in members) > limit_bytes:
                raise Invalid("", f"the npz unpacks to more than the {limit_bytes} bytes that the operator allows")
            known = {f"{name}.npy": name for name in (*REQUIRED, *OPTIONAL)}
            strange = [
                Fault(f"/{m.filename[:100]}", "is no array that is read here")
                for m in members
                if m.filename not in known
            ]
            if strange:
                raise Invalid(strange[:20])
            return {known[member.filename]: _read_array(archive, member) for member in members}
    except (zipfile.BadZipFile, EOFError, OSError, NotImplementedError, RuntimeError) as error:
        raise Invalid("", f"the body is not an npz archive: {error}") from None


def _read_array(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> Array:
    """One array; its header must claim exactly the bytes that are there, since numpy allocates what it claims."""
    name = member.filename.removesuffix(".npy")
    try:
        with archive.open(member) as stream:
            read_header = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}[npy.read_magic(stream)]
            shape, _, dtype = read_header(stream)
            claimed = int(np.prod([int(n) for n in shape], dtype=object)) * dtype.itemsize
            present = member.file_size - stream.tell()
        if claimed != present:
            raise Invalid(f"/{name}", f"claims {claimed} bytes and has {present}")
        with archive.open(member) as stream:
            array: Array = npy.read_array(stream, allow_pickle=False)
    except (ValueError, KeyError, zipfile.BadZipFile) as error:
        raise Invalid(f"/{name}", f"cannot be read: {error}") from None
    return array


def _integers(name: str, array: Array, count: int) -> Array:
    """(N,) integers; one number stands for all."""
    if array.dtype.kind not in "iu" or array.ndim > 1 or (array.ndim == 1 and array.size != count):
        raise Invalid(
            f"/{name}", f"is {array.dtype} of shape {array.shape}, expected integers ({count},) or one of them"
        )
    if array.dtype.kind == "u" and array.size and array.max() > 2**63 - 1:
        raise Invalid(f"/{name}", "is beyond the range of 64-bit integers")
    return np.broadcast_to(array.astype(np.int64), (count,))


def _text(name: str, array: Array) -> str:
    if array.dtype.kind != "U" or array.ndim != 0:
        raise Invalid(f"/{name}", f"is {array.dtype} of shape {array.shape}, expected one text")
    return str(array)


def _labels(array: Array | None, count: int) -> tuple[str, ...]:
    if array is None:
        return ("",) * count
    if array.dtype.kind != "U" or array.shape != (count,):
        raise Invalid("/label", f"is {array.dtype} of shape {array.shape}, expected texts ({count},)")
    labels = tuple(str(label) for label in array)
    if any("\0" in label or not label.isprintable() or len(label) > 200 for label in labels):
        raise Invalid("/label", "a label has at most 200 printable characters")
    return labels


def _coherence(array: Array | None, shape: tuple[int, ...]) -> Array | None:
    if array is None:
        return None
    if array.dtype.kind != "f":
        raise Invalid("/coherence", f"is {array.dtype}, expected real numbers")
    if array.ndim == 1:
        array = array[np.newaxis]
    if array.shape != shape:
        raise Invalid("/coherence", f"has shape {array.shape}, values have {shape}")
    return array.astype(np.float64)
