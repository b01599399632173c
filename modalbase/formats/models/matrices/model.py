"""A model that is matrices: K = K_0 + Σ c_k K_k, M = M_0 + Σ m_j M_j, with factors that are 1 as it
comes; from files.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import PurePath

import numpy as np
import scipy

from modalbase.formats.errors import FormatError
from modalbase.formats.models.matrices.files import (
    DOFS,
    Entries,
    code,
    read_archive,
    read_dmig,
    read_dofs,
    read_nodes,
    read_text,
)
from modalbase.formats.models.model import Floats, Integers

CONSTANT = "0"
"""Name of the part that no factor scales."""

_ASYMMETRY = 1e-6


@dataclass(frozen=True)
class MatrixModel:
    """Matrices of a solver, in its units."""

    numbers: Integers  # (n,) the user's numbers of the nodes
    nodes: Floats  # (n, 3) coordinates
    dofs: Integers  # (d, 2) row of the node, and dof 0 … 5, of each row of the matrices
    # stiffness, mass: (d, d) symmetric, by the factor's name; `0` is what no factor scales
    stiffness: Mapping[str, scipy.sparse.csc_array]
    mass: Mapping[str, scipy.sparse.csc_array]


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
        rows, columns = (_rows_of(name, one, dofs, order) for one in (rows, columns))
    elif entries.size is not None and entries.size != size:
        raise FormatError(name, f"has {entries.size} rows, the table of dofs {size}")
    for one in (rows, columns):
        if one.size and (one.min() < 0 or one.max() >= size):
            raise FormatError(
                name, f"has an entry in row {int(one.max()) + 1}, and there are {size} dofs"
            )
    require_range(name, entries.values)
    values, off = entries.values, rows != columns
    has_both = np.isin(rows[off] * size + columns[off], columns[off] * size + rows[off]).any()
    if entries.is_half and has_both:
        raise FormatError(
            name, "says that it is symmetric, of which one half stands for both, and states both"
        )
    if entries.is_half or (entries.is_half is None and not has_both):
        rows, columns = np.concatenate([rows, columns[off]]), np.concatenate([columns, rows[off]])
        values = np.concatenate([values, values[off]])
    matrix = scipy.sparse.coo_array((values, (rows, columns)), shape=(size, size)).tocsc()
    scale = abs(matrix).max() if matrix.nnz else 0.0
    if abs(matrix - matrix.T).max() > _ASYMMETRY * scale:
        raise FormatError(name, "is not symmetric; updating needs symmetric matrices")
    return scipy.sparse.csc_array((matrix + matrix.T) / 2)


LARGEST = 1e100
"""A number above it, or a matrix of numbers below its inverse, has no square."""


def require_range(name: str, values: Floats) -> None:
    """Refuse numbers that cannot be squared.

    Raises:
        FormatError: one is not finite or too large, or all are too small.
    """
    if not np.all(np.isfinite(values)):
        raise FormatError(name, "has an entry that is not a finite number")
    most = float(np.abs(values).max(initial=0.0))
    if most > LARGEST or 0 < most < 1 / LARGEST:
        raise FormatError(
            name,
            f"has {most:.3g} as its largest number, expected {1 / LARGEST:g} to {LARGEST:g}:"
            " check it",
        )


def _rows_of(name: str, codes: Integers, dofs: Integers, order: Integers) -> Integers:
    at = np.minimum(np.searchsorted(dofs, codes, sorter=order), len(dofs) - 1)
    rows = order[at]
    strange = np.flatnonzero(dofs[rows] != codes)
    if strange.size:
        node, dof = divmod(int(codes[strange[0]]), DOFS)
        raise FormatError(
            name,
            f"has an entry of node {node}, dof {dof + 1}, which is not in the tables of nodes and"
            " dofs",
        )
    return np.asarray(rows)


_ROLE = re.compile(r"([KM])_(\w+)")
_USUAL = (
    (re.compile(r"K(AA|GG|JJ|FF|XX|LL|2GG)X?|.*_STIF\d*", re.IGNORECASE), ("K", CONSTANT)),
    (re.compile(r"M(AA|GG|JJ|FF|XX|LL|2GG)X?|.*_MASS\d*", re.IGNORECASE), ("M", CONSTANT)),
)
_BY_ENDING = {".sti": ("K", CONSTANT), ".mas": ("M", CONSTANT)}


def read_matrices(
    files: Mapping[str, bytes],
    roles: Mapping[str, str] | None = None,
    limit_bytes: int = 4_000_000_000,
) -> MatrixModel:
    """A model of matrices from files by name.

    Matrices are Matrix Market or Abaqus's `.mtx`, CalculiX's `.sti` and `.mas`, DMIG (`.pch`,
    `.bdf`, `.dat`) and `.npz`. `nodes.csv` (node, x, y, z) states the nodes, and `dofs.csv` (node,
    dof) or a `.dof` file of CalculiX what the rows are. Without that the rows are the dofs that
    matrices name, or else the six, or three, of each node in the table's order. Files or arrays
    that are called `K_0`, `K_skin`, `M_0` … are the constant part and those of the factors by this;
    the usual names of solvers (`KAAX`, `MAAX`, `job_STIF1`, `.sti`, `.mas`) are K_0 and M_0.

    Args:
        files: content by name.
        roles: of matrices with other names: `{"KSKIN": "K_skin"}`.
        limit_bytes: the most that an archive may take.

    Raises:
        FormatError: a file cannot be read, or the parts do not fit; names the file.
    """
    matrices: dict[str, Entries] = {}
    nodes: tuple[Integers, Floats] | None = None
    dofs: Integers | None = None
    for name, content in files.items():
        path = PurePath(name)
        ending = path.suffix.lower()
        more: Mapping[str, Entries] = {}
        if ending == ".npz":
            more, own_nodes, own_dofs = read_archive(name, content, limit_bytes)
            nodes, dofs = own_nodes or nodes, dofs if own_dofs is None else own_dofs
        elif ending in (".pch", ".bdf", ".dat", ".asm"):
            more, own_nodes = read_dmig(content)
            nodes = own_nodes or nodes
        elif path.name.lower() == "nodes.csv":
            nodes = read_nodes(name, content)
        elif path.name.lower() == "dofs.csv" or ending == ".dof":
            dofs = read_dofs(name, content)
        elif ending in (".mtx", ".sti", ".mas"):
            more = {name: read_text(name, content)}
        else:
            raise FormatError(
                name,
                "is not known: expected .mtx, .sti, .mas, .pch, .npz, .dof, nodes.csv or dofs.csv",
            )
        if twice := set(more) & set(matrices):
            raise FormatError(name, f"states {twice.pop()} a second time")
        matrices.update(more)
    if nodes is None:
        raise FormatError(
            "nodes.csv", "is missing: measured points need the places of the nodes (node, x, y, z)"
        )
    return _model(matrices, nodes, dofs, roles or {})


def _model(
    matrices: Mapping[str, Entries],
    nodes: tuple[Integers, Floats],
    dofs: Integers | None,
    roles: Mapping[str, str],
) -> MatrixModel:
    numbers, places = nodes
    require_range("nodes", places)
    if len(np.unique(numbers)) < len(numbers):
        raise FormatError("nodes", "has a number twice")
    codes = _codes(matrices, numbers) if dofs is None else dofs
    if len(np.unique(codes)) < len(codes):
        raise FormatError("dofs", "names a dof twice")
    order = np.argsort(numbers)
    at = np.minimum(np.searchsorted(numbers, codes // DOFS, sorter=order), len(numbers) - 1)
    rows = order[at]
    strange = np.flatnonzero(numbers[rows] != codes // DOFS)
    if strange.size:
        raise FormatError(
            "dofs", f"names node {codes[strange[0]] // DOFS}, which is not in the table of nodes"
        )
    parts: dict[str, dict[str, scipy.sparse.csc_array]] = {"K": {}, "M": {}}
    for name, entries in matrices.items():
        letter, factor = _role(name, roles)
        if factor in parts[letter]:
            raise FormatError(name, f"is a second {letter}_{factor}")
        parts[letter][factor] = built(name, entries, codes)
    for letter, what in (("K", "stiffness"), ("M", "mass")):
        if not parts[letter]:
            raise FormatError(f"{letter}_0", f"is missing: there is no matrix of the {what}")
    table = np.column_stack([rows, codes % DOFS])
    return MatrixModel(numbers, places, table, parts["K"], parts["M"])


def _codes(matrices: Mapping[str, Entries], numbers: Integers) -> Integers:
    """Dofs of the rows, where no table states them."""
    labelled = [one for one in matrices.values() if one.is_labelled]
    if labelled:
        return np.unique(
            np.concatenate([part for one in labelled for part in (one.rows, one.columns)])
        )
    sizes = {
        one.size or int(max(one.rows.max(initial=0), one.columns.max(initial=0))) + 1
        for one in matrices.values()
    }
    size = max(sizes, default=0)
    for count in (DOFS, 3):
        if size == count * len(numbers):
            return code(np.repeat(numbers, count), np.tile(np.arange(count), len(numbers)))
    raise FormatError(
        "dofs.csv",
        f"is missing: matrices of {size} rows are neither six nor three of each of {len(numbers)}"
        " nodes",
    )


def _role(name: str, roles: Mapping[str, str]) -> tuple[str, str]:
    """Letter and factor of a matrix."""
    stem = PurePath(name).stem
    stated = roles.get(name, roles.get(stem, stem))
    if match := _ROLE.fullmatch(stated):
        return match.group(1), match.group(2)
    ending = PurePath(name).suffix.lower()
    if ending in _BY_ENDING:
        return _BY_ENDING[ending]
    for pattern, role in _USUAL:
        if pattern.fullmatch(stem):
            return role
    raise FormatError(
        name, "has no role; call it K_0, K_factor, M_0 or M_factor, or say which of these it is"
    )
