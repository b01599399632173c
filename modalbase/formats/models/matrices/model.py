"""A model that is matrices: K = K_0 + Σ c_k K_k, M = M_0 + Σ m_j M_j, with factors that are 1 as it comes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from modalbase.formats.errors import FormatError
from modalbase.formats.models.model import Floats, Integers

CONSTANT = "0"
"""Name of the part that no factor scales."""

DOFS = 6
_ASYMMETRY = 1e-6
_MOST = 1e12


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


def integers(place: str, values: NDArray[Any]) -> Integers:
    """Numbers of rows, nodes and dofs.

    Raises:
        FormatError: one is not whole, or has more than 12 digits.
    """
    exact = np.asarray(values, dtype=float)
    if not np.all((np.abs(exact) < _MOST) & (exact == np.round(exact))):
        raise FormatError(place, "has a row, column, node or dof that is not a whole number of at most 12 digits")
    return exact.astype(np.int64)


def built(name: str, entries: Entries, dofs: Integers) -> scipy.sparse.csc_array:
    """The symmetric matrix of entries, on rows of the (d,) codes of dofs.

    Raises:
        FormatError: an entry is of no dof, not finite, or the matrix is not symmetric.
    """
    if not (size := len(dofs)):
        raise FormatError(name, "has no row")
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
    values, off = entries.values, rows != columns
    has_both = np.isin(rows[off] * size + columns[off], columns[off] * size + rows[off]).any()
    if entries.is_half and has_both:
        raise FormatError(name, "says that it is symmetric, of which one half stands for both, and states both")
    if entries.is_half or (entries.is_half is None and not has_both):
        rows, columns = np.concatenate([rows, columns[off]]), np.concatenate([columns, rows[off]])
        values = np.concatenate([values, values[off]])
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
