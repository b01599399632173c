"""FRFs as HDF5: datasets with the names, types and shapes that the arrays of the npz have."""

from pathlib import Path
from typing import IO, Any

import numpy as np

from modalbase.formats.arrays_out import add_dataset, with_hdf5
from modalbase.formats.errors import FormatError
from modalbase.formats.frfs.npz import REQUIRED, frfs_of_own, heads_of, matrices_of, require_own
from modalbase.formats.frfs.table import Frfs, FrfTable
from modalbase.formats.records.hdf5 import datasets, opened, whole
from modalbase.formats.types import Quantity


def read_hdf5(path: Path, limit_bytes: int | None = None, quantity: Quantity | None = None) -> Frfs:
    """FRFs of an HDF5 file with the datasets `frequency_hz` (L,), `values` (N, L) and others; see
    `modalbase.formats.frfs.npz.read_npz`.

    Raises:
        FormatError: the file is damaged, larger than allowed, or it is not known what its FRFs are;
            names the dataset.
    """
    with opened(path) as file:
        known = dict(datasets(file))
        require_own(known)
        size = sum(each.size * each.dtype.itemsize for each in known.values())
        if limit_bytes is not None and size > limit_bytes:
            raise FormatError("", f"declares {size} bytes, more than the {limit_bytes} allowed")
        arrays = {name: whole(name, dataset) for name, dataset in known.items()}
    read = {name: array for name, array in arrays.items() if array is not None}
    if strange := [name for name in known if name not in read]:
        raise FormatError(strange[0], f"is {known[strange[0]].dtype}, expected numbers or texts")
    return frfs_of_own(read, quantity)


def own_names(path: Path) -> frozenset[str] | None:
    """Names of the datasets of a file that `read_hdf5` reads; None of another one."""
    try:
        with opened(path) as file:
            names = frozenset(name for name, _ in datasets(file))
    except FormatError:
        return None
    return names if names.issuperset(REQUIRED) else None


def write_hdf5(table: FrfTable, file: IO[bytes]) -> None:
    """Write FRFs as HDF5, in the datasets that `read_hdf5` reads.

    Args:
        table: the FRFs; their values are taken one FRF at a time.
        file: open for writing bytes.
    """
    shape = (len(table.frfs), table.frequency_hz.size)

    def fill(made: Any) -> None:
        for name, array in heads_of(table).items():
            add_dataset(made, name, array)
        for name, dtype, rows in matrices_of(table):
            matrix = made.create_dataset(name, shape, dtype)
            for number, row in enumerate(rows):
                matrix[number] = np.asarray(row, dtype=dtype)

    with_hdf5(fill, file)
