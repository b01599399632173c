"""Matrices as npz: `nodes` (n, 4) with numbers first, `dofs` (d, 2), and `K_0` … dense, or by their sparse parts."""

from __future__ import annotations

import io
import zipfile

import numpy as np
import scipy

from modalbase.formats.errors import FormatError
from modalbase.formats.models.matrices.model import DOFS, Entries, code, integers
from modalbase.formats.models.model import Floats, Integers
from modalbase.formats.npy import Array, members_of, read_array

_PARTS = ("data", "indices", "indptr")


def read_archive(
    name: str, content: bytes, limit_bytes: int
) -> tuple[dict[str, Entries], tuple[Integers, Floats] | None, Integers | None]:
    """Matrices, nodes and dofs of an archive; of a sparse `K_0` the arrays `K_0_data`, `K_0_indices`, `K_0_indptr`.

    Raises:
        FormatError: it is damaged, or an array is not what its name says.
    """
    arrays = _arrays(name, content, limit_bytes)
    table, pairs = arrays.pop("nodes", None), arrays.pop("dofs", None)
    nodes = dofs = None
    if table is not None:
        if table.ndim != 2 or table.shape[1] != 4:
            raise FormatError(f"{name} nodes", f"has the shape {table.shape}, expected (n, 4): number, x, y, z")
        nodes = integers(f"{name} nodes", table[:, 0]), table[:, 1:].astype(float)
    if pairs is not None:
        if pairs.ndim != 2 or pairs.shape[1] != 2 or not np.all((pairs[:, 1] >= 1) & (pairs[:, 1] <= DOFS)):
            raise FormatError(f"{name} dofs", f"has the shape {pairs.shape}, expected (d, 2): node, dof 1 … 6")
        numbers, own = integers(f"{name} dofs", pairs).T
        dofs = code(numbers, own - 1)
    stems = dict.fromkeys(_stem(array) for array in arrays)
    return {stem: _entries(f"{name} {stem}", stem, arrays) for stem in stems}, nodes, dofs


def _arrays(name: str, content: bytes, limit_bytes: int) -> dict[str, Array]:
    try:
        archive = zipfile.ZipFile(io.BytesIO(content))
    except zipfile.BadZipFile as error:
        raise FormatError(name, "is no npz archive") from error
    with archive:
        members = members_of(archive)
        if sum(member.file_size for member in members) > limit_bytes:
            raise FormatError(name, f"holds more than {limit_bytes} bytes")
        found = {member.filename.removesuffix(".npy"): read_array(archive, member) for member in members}
    for array, values in found.items():
        if values.dtype.kind not in "fiu":
            raise FormatError(f"{name} {array}", f"is {values.dtype}, expected real numbers")
    return found


def _stem(array: str) -> str:
    head, _, part = array.rpartition("_")
    return head if part in _PARTS else array


def _entries(place: str, stem: str, arrays: dict[str, Array]) -> Entries:
    if stem in arrays:
        matrix = np.asarray(arrays[stem], dtype=float)
        if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
            raise FormatError(place, f"has the shape {matrix.shape}, expected (d, d)")
        rows, columns = np.nonzero(matrix)
        return Entries(rows, columns, matrix[rows, columns], is_half=False, size=len(matrix))
    parts = [arrays.get(f"{stem}_{part}") for part in _PARTS]
    if any(part is None or part.ndim != 1 for part in parts):
        raise FormatError(place, f"needs {', '.join(f'{stem}_{part}' for part in _PARTS)}, each of one dimension")
    data, indices, starts = (np.asarray(part) for part in parts)
    size = len(starts) - 1
    try:
        sparse = scipy.sparse.csr_array(
            (data.astype(float), integers(place, indices), integers(place, starts)), (size, size)
        )
        sparse.check_format(full_check=True)
    except (ValueError, IndexError) as error:
        raise FormatError(place, f"is no sparse matrix: {error}") from error
    entries = sparse.tocoo()
    return Entries(entries.coords[0], entries.coords[1], entries.data, is_half=False, size=size)
