"""A model that is matrices: K = K_0 + Σ c_k K_k, M = M_0 + Σ m_j M_j, with factors that are 1 as it comes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy

from modalbase.formats.errors import FormatError
from modalbase.formats.models.model import Floats, Integers

CONSTANT = "0"
"""Name of the part that no factor scales."""

DOFS = 6
_ASYMMETRY = 1e-6


@dataclass(frozen=True)
class MatrixModel:
    """Matrices of a solver, in its units.

    Attributes:
        numbers: (n,) the user's numbers of the nodes.
        nodes: (n, 3) coordinates.
        dofs: (d, 2) row of the node, and dof 0 … 5, of each row of the matrices.
        stiffness, mass: (d, d) symmetric, by the factor's name; `0` is what no factor scales.
    """

    numbers: Integers
    nodes: Floats
    dofs: Integers
    stiffness: Mapping[str, scipy.sparse.csc_array]
    mass: Mapping[str, scipy.sparse.csc_array]


@dataclass(frozen=True)
class Entries:
    """Entries of a matrix.

    Attributes:
        rows, columns: from 0, or codes of `code` where `is_labelled`.
        values: of them.
        is_labelled: whether they are known by node and dof.
        is_half: whether one triangle stands for both; None where the entries themselves must show it.
        size: of a matrix whose rows are numbered.
    """

    rows: Integers
    columns: Integers
    values: Floats
    is_labelled: bool = False
    is_half: bool | None = None
    size: int | None = None


def code(nodes: Integers, dofs: Integers) -> Integers:
    """One number for a node's number and a dof from 0."""
    return nodes * DOFS + dofs


def built(name: str, entries: Entries, dofs: Integers) -> scipy.sparse.csc_array:
    """The symmetric matrix of entries, on rows of the (d,) codes of dofs.

    Raises:
        FormatError: an entry is of no dof, not finite, or the matrix is not symmetric.
    """
    size = len(dofs)
    rows, columns = entries.rows, entries.columns
    if entries.is_labelled:
        order = np.argsort(dofs)
        rows, columns = (_found(name, one, dofs, order) for one in (rows, columns))
    elif entries.size is not None and entries.size != size:
        raise FormatError(name, f"has {entries.size} rows, the table of dofs {size}")
    for one in (rows, columns):
        if one.size and (one.min() < 0 or one.max() >= size):
            raise FormatError(name, f"has an entry in row {int(one.max()) + 1}, and there are {size} dofs")
    if not np.all(np.isfinite(entries.values)):
        raise FormatError(name, "has an entry that is not a finite number")
    is_half = entries.is_half
    if is_half is None:
        off = rows != columns
        is_half = not np.isin(rows[off] * size + columns[off], columns[off] * size + rows[off]).any()
    if is_half:
        off = rows != columns
        rows, columns = np.concatenate([rows, columns[off]]), np.concatenate([columns, rows[off]])
        values = np.concatenate([entries.values, entries.values[off]])
    else:
        values = entries.values
    matrix = scipy.sparse.coo_array((values, (rows, columns)), shape=(size, size)).tocsc()
    scale = abs(matrix).max() if matrix.nnz else 0.0
    if abs(matrix - matrix.T).max() > _ASYMMETRY * scale:
        raise FormatError(name, "is not symmetric; updating needs symmetric matrices")
    return scipy.sparse.csc_array((matrix + matrix.T) / 2)


def _found(name: str, codes: Integers, dofs: Integers, order: Integers) -> Integers:
    at = np.minimum(np.searchsorted(dofs, codes, sorter=order), len(dofs) - 1)
    rows = order[at]
    strange = np.flatnonzero(dofs[rows] != codes)
    if strange.size:
        node, dof = divmod(int(codes[strange[0]]), DOFS)
        raise FormatError(
            name, f"has an entry of node {node}, dof {dof + 1}, which is not in the tables of nodes and dofs"
        )
    return np.asarray(rows)
