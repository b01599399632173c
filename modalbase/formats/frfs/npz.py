"""FRFs as npz: `frequency_hz` (L,), `values` (N, L), `response_point` … (N,), `quantity`, `label`,
`averages`, `coherence`.
"""

import zipfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy

from modalbase.formats.errors import FormatError
from modalbase.formats.frfs.table import DOFS, FrfRow, Frfs, FrfTable
from modalbase.formats.npy import Array, members_of, read_array
from modalbase.formats.types import Quantity

REQUIRED = ("frequency_hz", "values", *DOFS)
OPTIONAL = ("quantity", "averages", "coherence", "label", "id")


def read_npz(path: Path, limit_bytes: int | None = None, quantity: Quantity | None = None) -> Frfs:
    """FRFs of an npz file with the arrays `frequency_hz` (L,), `values` (N, L), `response_point` …
    (N,), `quantity`.

    One number in place of an array of points or directions stands for all FRFs. `label`, `averages`
    and `coherence` (N, L) may be there too; `quantity` may be missing where it is stated beside the
    file. Nothing is unpickled, and no array may claim more bytes than the file has.

    >>> import pathlib, tempfile
    >>> import numpy as np
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "frfs.npz"
    >>> np.savez(
    ...     path,
    ...     frequency_hz=np.array([10.0, 20.0]),
    ...     values=np.array([[1 + 2j, 3 + 4j]]),
    ...     response_point=np.array([7]),
    ...     response_direction=np.array(3),
    ...     reference_point=np.array([1]),
    ...     reference_direction=np.array(-3),
    ... )
    >>> found = read_npz(path, quantity="mobility")
    >>> found.quantity, found.values.shape, found.frfs[0].response_point
    ('mobility', (1, 2), 7)

    Args:
        path: of the file.
        limit_bytes: the most that its arrays may take; None where nothing limits them.
        quantity: what the FRFs are, where somebody states it beside the file.

    Raises:
        FormatError: the file is not such an archive, or it is not known what its FRFs are; names
            the array.
    """
    return frfs_of_own(_read_arrays(path, limit_bytes), quantity)


def frfs_of_own(arrays: Mapping[str, Array], quantity: Quantity | None) -> Frfs:
    """FRFs of arrays that have the names of this module; see `read_npz`.

    Raises:
        FormatError: an array is missing or does not fit; names it.
    """
    missing = [name for name in REQUIRED if name not in arrays]
    if missing:
        raise FormatError([(name, "is missing") for name in missing])
    values = arrays["values"]
    if values.ndim == 1:
        values = values[np.newaxis]
    if (
        values.ndim != 2
        or values.dtype.kind != "c"
        or values.dtype.itemsize not in (8, 16)
        or not values.size
    ):
        raise FormatError(
            "values",
            f"is {values.dtype} of shape {values.shape}, expected complex64 or complex128 (N, L)",
        )
    frequency = arrays["frequency_hz"]
    if frequency.ndim != 1 or frequency.dtype.kind not in "fiu":
        raise FormatError(
            "frequency_hz",
            f"is {frequency.dtype} of shape {frequency.shape}, expected real numbers (L,)",
        )
    count = values.shape[0]
    averages = (
        _integers("averages", arrays["averages"], count)
        if "averages" in arrays
        else np.zeros(count, np.int64)
    )
    dofs = zip(*(_integers(name, arrays[name], count).tolist() for name in DOFS), strict=True)
    labels = _labels(arrays.get("label"), count)
    rows = tuple(
        FrfRow.between(dof, label, int(n) if n > 0 else None)
        for dof, label, n in zip(dofs, labels, averages, strict=True)
    )
    return Frfs(
        frequency.astype(np.float64),
        values.astype(values.dtype.newbyteorder("<")),
        rows,
        _quantity(arrays.get("quantity"), quantity),
        _coherence(arrays.get("coherence"), values.shape),
    )


def own_names(path: Path) -> frozenset[str] | None:
    """Names of the arrays of an npz that `read_npz` reads; None where it is another one, or no
    archive.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            names = frozenset(name.removesuffix(".npy") for name in archive.namelist())
    except zipfile.BadZipFile:
        return None
    return names if names.issuperset(REQUIRED) else None


def _read_arrays(path: Path, limit_bytes: int | None) -> dict[str, Array]:
    try:
        with zipfile.ZipFile(path) as archive:
            members = members_of(archive)
            if (
                limit_bytes is not None
                and sum(member.file_size for member in members) > limit_bytes
            ):
                raise FormatError(
                    "",
                    f"the npz unpacks to more than the {limit_bytes} bytes that the operator"
                    " allows",
                )
            known = {f"{name}.npy": name for name in (*REQUIRED, *OPTIONAL)}
            require_own(known.get(member.filename, member.filename) for member in members)
            return {known[member.filename]: read_array(archive, member) for member in members}
    except (zipfile.BadZipFile, EOFError, OSError, NotImplementedError, RuntimeError) as error:
        raise FormatError("", f"the file is not an npz archive: {error}") from None


def require_own(names: Iterable[str]) -> None:
    """Refuse arrays that a file of FRFs without a mapping has no place for.

    Raises:
        FormatError: names them.
    """
    known = {*REQUIRED, *OPTIONAL}
    strange = [(n[:100], "is no array that is read here") for n in names if n not in known]
    if strange:
        raise FormatError(strange[:20])


def _integers(name: str, array: Array, count: int) -> Array:
    """(N,) integers; one number stands for all."""
    if array.dtype.kind not in "iu" or array.ndim > 1 or (array.ndim == 1 and array.size != count):
        raise FormatError(
            name,
            f"is {array.dtype} of shape {array.shape}, expected integers ({count},) or one of them",
        )
    if array.dtype.kind == "u" and array.size and array.max() > 2**63 - 1:
        raise FormatError(name, "is beyond the range of 64-bit integers")
    return np.broadcast_to(array.astype(np.int64), (count,))


def _quantity(array: Array | None, stated: Quantity | None) -> Quantity:
    """What the file says, and what is stated beside it."""
    if array is None:
        if stated is None:
            raise FormatError(
                "quantity",
                "is missing: the npz has no such array, and nobody states what its FRFs are",
            )
        return stated
    if array.dtype.kind != "U" or array.ndim != 0:
        raise FormatError("quantity", f"is {array.dtype} of shape {array.shape}, expected one text")
    own: Quantity = str(array)  # type: ignore[assignment]  # checked where it is stored
    if stated not in (None, own):
        raise FormatError(
            "quantity",
            f"is {own} in the file and {stated} beside it: correct the one that is wrong",
        )
    return own


def _labels(array: Array | None, count: int) -> tuple[str, ...]:
    if array is None:
        return ("",) * count
    if array.dtype.kind != "U" or array.shape != (count,):
        raise FormatError(
            "label", f"is {array.dtype} of shape {array.shape}, expected texts ({count},)"
        )
    labels = tuple(str(label) for label in array)
    if any("\0" in label or not label.isprintable() or len(label) > 200 for label in labels):
        raise FormatError("label", "a label has at most 200 printable characters")
    return labels


def _coherence(array: Array | None, shape: tuple[int, ...]) -> Array | None:
    if array is None:
        return None
    if array.dtype.kind != "f":
        raise FormatError("coherence", f"is {array.dtype}, expected real numbers")
    if array.ndim == 1:
        array = array[np.newaxis]
    if array.shape != shape:
        raise FormatError("coherence", f"has shape {array.shape}, values have {shape}")
    return array.astype(np.float64)


def write_npz(table: FrfTable, file: IO[bytes]) -> None:
    """Write FRFs as npz, in the arrays that `read_npz` reads, and `id` (N,). Values keep their
    precision.

    `coherence` is there where at least one FRF has one; the rows of the others are NaN.

    Args:
        table: the FRFs; their values are taken one FRF at a time.
        file: open for writing bytes.
    """
    shape = (len(table.frfs), table.frequency_hz.size)
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED, allowZip64=True) as archive:
        for name, array in heads_of(table).items():
            _member(archive, name, array)
        for name, dtype, rows in matrices_of(table):
            _matrix(archive, name, shape, dtype, rows)


def heads_of(table: FrfTable) -> dict[str, Array]:
    """What is said of FRFs besides their values, as arrays by name."""
    dofs = {key: np.array([getattr(f, key) for f in table.frfs], dtype=np.int64) for key in DOFS}
    return {
        "frequency_hz": np.asarray(table.frequency_hz),
        **dofs,
        "averages": np.array([frf.averages or 0 for frf in table.frfs], dtype=np.int64),
        "id": np.array([str(frf.id) for frf in table.frfs]),
        "label": np.array([frf.label for frf in table.frfs], dtype=np.str_),
        "quantity": np.array(table.quantity),
    }


def matrices_of(table: FrfTable) -> Iterator[tuple[str, np.dtype[Any], Iterable[Array]]]:
    """Name, type and rows of the values, and of the coherences where some have one."""
    yield "values", table.dtype, (values for _, values in table.spectra())
    if table.has_coherence:
        nothing = np.full(table.frequency_hz.size, np.nan)
        rows = (nothing if c is None else c for _, c in table.coherences())
        yield "coherence", np.dtype(np.float64), rows


def _member(archive: zipfile.ZipFile, name: str, array: np.ndarray[Any, Any]) -> None:
    with archive.open(f"{name}.npy", "w") as stream:
        npy.write_array(stream, array, allow_pickle=False)


def _matrix(
    archive: zipfile.ZipFile,
    name: str,
    shape: tuple[int, int],
    dtype: np.dtype[Any],
    rows: Iterable[np.ndarray[Any, Any]],
) -> None:
    """A matrix whose rows come one by one."""
    with archive.open(f"{name}.npy", "w", force_zip64=True) as stream:
        header = {"descr": npy.dtype_to_descr(dtype), "fortran_order": False, "shape": shape}
        npy.write_array_header_2_0(stream, header)
        for row in rows:
            stream.write(np.ascontiguousarray(row, dtype=dtype).data)
