"""Sparse symmetric matrices factorised front by front: LLᵀ, or the inertia of one that is not
definite.

Columns that are eliminated together form a front, a small dense matrix of these columns and of the
later rows that they touch. What a front leaves to the later rows is added to the front that
eliminates them next (Duff and Reid, ACM Trans. Math. Softw. 9, 1983). So nearly all work is done by
LAPACK, only one triangle is kept, and a count of negative pivots keeps nothing.

The order is found on the graph of columns of one pattern, as are the dofs of a node, by SuperLU's
minimum degree on a definite matrix of that graph, whose factor shows the fill too. Fronts join
their parents where that adds few zeros.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy

from fecore.arrays import FloatArray, IntArray
from fecore.errors import ModelError

# columns of a front below which the overhead of a front outweighs the zeros of a larger one
_SMALL = 30
_BLOCK = 64  # columns that LAPACK takes at a time
_ZEROS = 0.2  # share of zeros that joining a larger one to its parent may add to it


@dataclass(frozen=True)
class Front:
    """Columns that are eliminated together; all numbers are places in the order of elimination."""

    columns: slice  # the columns
    rows: IntArray  # (b,) later rows that they touch, ascending
    # which of the matrix's entries on and below the diagonal, column by column, belong to it
    entries: slice
    into: IntArray  # (e,) where they land in the front, stored column by column
    # of each front that leaves something to this one: its number, and the place here of each of its
    # rows
    children: tuple[tuple[int, IntArray], ...]


@dataclass(frozen=True)
class Elimination:
    """How to eliminate any symmetric matrix of one sparsity pattern."""

    # row numbers and starts of the columns of the matrix in compressed columns
    pattern: tuple[IntArray, IntArray]
    order: IntArray  # (n,) the rows in the order of elimination
    # (e,) the matrix's stored entries on and below the diagonal in that order, column by column
    taken: IntArray
    fronts: tuple[Front, ...]  # children before parents

    @classmethod
    def of(cls, matrix: scipy.sparse.csc_array) -> Elimination:
        """A good elimination of a matrix's pattern."""
        first, group = _alike(matrix)
        place, pattern = _minimum_degree(matrix, first, group)
        size = np.empty(len(first), dtype=np.int64)
        size[place] = np.bincount(group)
        tree = _tree(pattern, size)
        moved = np.argsort(np.concatenate([own for own, _, _ in tree]))
        start = np.concatenate([[0], np.cumsum(size[np.argsort(moved)])])
        order = np.argsort(moved[place[group]], kind="stable")
        numbered = scipy.sparse.csc_array(
            (np.arange(matrix.nnz), matrix.indices, matrix.indptr), shape=matrix.shape
        )
        numbered = numbered[:, order]
        column, row = (
            np.repeat(np.arange(len(order)), np.diff(numbered.indptr)),
            np.argsort(order)[numbered.indices],
        )
        lower = row >= column
        taken, column, row = numbered.data[lower], column[lower], row[lower]
        fronts: list[Front] = []
        local = np.empty(len(order), dtype=np.int64)
        for own, below, children in tree:
            columns = slice(int(start[moved[own[0]]]), int(start[moved[own[-1]] + 1]))
            rows = np.concatenate(
                [np.arange(start[k], start[k + 1]) for k in np.sort(moved[below])] or [order[:0]]
            )
            width = columns.stop - columns.start
            local[columns], local[rows] = np.arange(width), np.arange(width, width + len(rows))
            entries = slice(*np.searchsorted(column, [columns.start, columns.stop]).tolist())
            into = local[row[entries]] + (column[entries] - columns.start) * (width + len(rows))
            fronts.append(
                Front(
                    columns,
                    rows,
                    entries,
                    into,
                    tuple((c, local[fronts[c].rows]) for c in children),
                )
            )
        return cls((matrix.indices, matrix.indptr), order, taken, tuple(fronts))

    def suits(self, matrix: scipy.sparse.csc_array) -> bool:
        """Whether the matrix has this pattern."""
        theirs = matrix.indices, matrix.indptr
        return all(
            a is b or np.array_equal(a, b) for a, b in zip(self.pattern, theirs, strict=True)
        )

    def factorise(self, matrix: scipy.sparse.csc_array) -> MultifrontalFactor | None:
        """The factor of a matrix of this pattern; None of one that is not positive definite."""
        parts = []
        for own, below, negative in self._eliminated(matrix):
            if negative:
                return None
            inverse, _ = scipy.linalg.lapack.dtrtri(own, lower=1)
            parts.append(
                np.asfortranarray(
                    np.vstack(
                        [inverse, scipy.linalg.blas.dtrmm(-1.0, inverse, below, side=1, lower=1)]
                    )
                )
            )
        return MultifrontalFactor(self, tuple(parts))

    def negative_pivots(self, matrix: scipy.sparse.csc_array) -> int:
        """How many eigenvalues of a matrix of this pattern are negative.

        Raises:
            ModelError: a pivot vanishes.
        """
        return sum(negative for _, _, negative in self._eliminated(matrix))

    def _eliminated(
        self, matrix: scipy.sparse.csc_array
    ) -> Iterator[tuple[FloatArray, FloatArray, int]]:
        """Of each front L₁, L₂ and 0, or two that have no meaning and its number of negative
        pivots.
        """
        data = matrix.data[self.taken]
        left: dict[int, FloatArray] = {}
        for number, front in enumerate(self.fronts):
            width = front.columns.stop - front.columns.start
            size = width + len(front.rows)
            # of which those above the diagonal have no meaning
            entries = np.zeros((size, size), order="F")
            entries.T.reshape(-1)[front.into] = data[front.entries]
            for child, at in front.children:
                _add(entries, left.pop(child), at)
            first, below, rest = (
                entries[:width, :width],
                entries[width:, :width],
                entries[width:, width:],
            )
            own, indefinite = scipy.linalg.lapack.dpotrf(first, lower=1, clean=1)
            if indefinite:
                negative, solved = _indefinite(first, below.T)
                left[number] = rest - below @ solved
                yield own, below, negative
                continue
            below = scipy.linalg.blas.dtrsm(1.0, own, below, side=1, lower=1, trans_a=1)
            left[number] = (
                scipy.linalg.blas.dsyrk(-1.0, below, beta=1.0, c=rest, lower=1)
                if rest.size
                else rest
            )
            yield own, below, 0


@dataclass(frozen=True)
class MultifrontalFactor:
    """LLᵀ of a symmetric positive definite matrix.

    Of each front's L₁ (its columns) and L₂ (the later rows) it keeps L₁⁻¹ above -L₂L₁⁻¹: a step of
    a solve is one product.
    """

    elimination: Elimination
    parts: tuple[FloatArray, ...]

    def solve(self, right: FloatArray) -> FloatArray:
        """A⁻¹ right."""
        x = right[self.elimination.order]
        steps = list(zip(self.elimination.fronts, self.parts, strict=True))
        for front, part in steps:
            width = part.shape[1]
            product = part @ x[front.columns]
            x[front.columns] = product[:width]
            x[front.rows] += product[width:]
        for front, part in reversed(steps):
            x[front.columns] = part.T @ np.concatenate([x[front.columns], x[front.rows]])
        return self._restored(x)

    def colour(self, white: FloatArray) -> FloatArray:
        """Pᵀ L white, with PAPᵀ = LLᵀ."""
        x = np.zeros_like(white)
        for front, part in zip(self.elimination.fronts, self.parts, strict=True):
            width = part.shape[1]
            own, _ = scipy.linalg.lapack.dtrtrs(part[:width], white[front.columns], lower=1)
            x[front.columns] += own
            x[front.rows] -= part[width:] @ own
        return self._restored(x)

    def _restored(self, ordered: FloatArray) -> FloatArray:
        """Rows of (n, …) in the matrix's own order."""
        restored = np.empty_like(ordered)
        restored[self.elimination.order] = ordered
        return restored


def _indefinite(matrix: FloatArray, right: FloatArray) -> tuple[int, FloatArray]:
    """Negative eigenvalues of a matrix whose lower triangle is given, and its inverse times (n, r)
    others.

    Of the pivots of Bunch and Kaufman's LDLᵀ those of two rows have one negative eigenvalue each.
    """
    factor, pivots, vanishes = scipy.linalg.lapack.dsytrf(
        matrix, lower=1, lwork=_BLOCK * len(matrix)
    )
    if vanishes:
        raise ModelError("a pivot vanishes: modes cannot be counted at a mode")
    solved, _ = (
        scipy.linalg.lapack.dsytrs(factor, pivots, right, lower=1) if right.size else (right, 0)
    )
    single = pivots > 0
    return int(np.sum(factor.diagonal()[single] < 0) + np.sum(~single) // 2), solved


def _add(entries: FloatArray, left: FloatArray, at: IntArray) -> None:
    """Add what a child left to a front, run by run of neighbouring columns."""
    for start, end in pairwise([0, *(np.flatnonzero(np.diff(at) != 1) + 1).tolist(), len(at)]):
        if end > start:
            entries.T[at[start] : at[end - 1] + 1, at[start:]] += left.T[start:end, start:]


def _alike(matrix: scipy.sparse.csc_array) -> tuple[IntArray, IntArray]:
    """The first column of each group of columns that have one pattern, and the (n,) group of each
    column.
    """
    # Alike columns have alike sums of random numbers of their rows.
    number = np.random.default_rng(0).integers(0, 2**62, matrix.shape[0])
    _, first, group = np.unique(
        np.add.reduceat(number[matrix.indices], matrix.indptr[:-1]),
        return_index=True,
        return_inverse=True,
    )
    return first, group


def _minimum_degree(
    matrix: scipy.sparse.csc_array, first: IntArray, group: IntArray
) -> tuple[IntArray, scipy.sparse.csc_array]:
    """The place of each group in the order of elimination, and the factor's pattern in that
    order.
    """
    count, columns = len(first), matrix[:, first]
    chosen = np.zeros(matrix.shape[0], dtype=bool)
    chosen[first] = True
    kept = chosen[columns.indices]
    row, column = (
        group[columns.indices[kept]],
        np.repeat(np.arange(count), np.diff(columns.indptr))[kept],
    )
    # Definite, and all that is eliminated is negative: nothing cancels.
    value = np.where(row == column, np.bincount(column, minlength=count)[column], -1.0)
    graph = scipy.sparse.csc_matrix((value, (row, column)), shape=(count, count))
    options = {"SymmetricMode": True}
    lu = scipy.sparse.linalg.splu(
        graph, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options
    )
    pattern = lu.L
    pattern.sort_indices()
    return lu.perm_c, pattern


def _tree(
    pattern: scipy.sparse.csc_array, size: IntArray
) -> list[tuple[list[int], IntArray, list[int]]]:
    """Fronts, children first: their columns, later rows and numbers of their children; of groups of
    `size` columns.
    """
    count = len(size)
    own: list[list[int]] = [[k] for k in range(count)]
    below = [pattern.indices[a + 1 : b] for a, b in pairwise(pattern.indptr.tolist())]
    children: list[list[int]] = [[] for _ in range(count)]
    width, height = size.tolist(), [int(size[rows].sum()) for rows in below]
    for k in range(count):
        apart = []
        for child in children[k]:
            together = width[k] + width[child]
            zeros = width[k] + height[k] - height[child]
            if together <= _SMALL or zeros <= _ZEROS * (width[child] + height[child]):
                own[k], width[k] = own[child] + own[k], together
                apart += children[child]
                own[child] = []
            else:
                apart.append(child)
        children[k] = apart
        if len(below[k]):
            children[int(below[k][0])].append(k)
    kept = [k for k in range(count) if own[k]]
    number = {k: place for place, k in enumerate(kept)}
    return [(own[k], below[k], [number[child] for child in children[k]]) for k in kept]
