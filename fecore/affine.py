"""Matrices that are linear in a few coefficients, on one sparsity pattern.

    K(c) = Σ_k c_k K_k

The K_k are assembled once; a new c is a weighted sum of arrays, and K_k itself is the derivative by c_k.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from fecore.arrays import FloatArray, IntArray


@dataclass(frozen=True)
class AffineMatrix:
    """Σ_k c_k A_k, every symmetric A_k on one compressed-column sparsity pattern.

    Attributes:
        indptr, indices: the pattern, as in `scipy.sparse.csc_array`.
        terms: (k, nnz) values of each A_k.
        names: the k coefficients' names.
        blocks: index matrices into the coefficients: each is a symmetric matrix C of coefficients, such as
            [[D11, D12], [D12, D22]], whose part of the sum is ∫BᵀCB. So K(c) ≥ α K(c₀) where every C(c) ≥ α C(c₀).
    """

    indptr: IntArray
    indices: IntArray
    terms: FloatArray
    names: tuple[str, ...]
    blocks: tuple[IntArray, ...]

    @property
    def size(self) -> int:
        """Number of rows and columns."""
        return int(self.indptr.size - 1)

    def at(self, coefficients: FloatArray) -> sparse.csc_array:
        """The matrix at (k,) coefficients."""
        return self._matrix(coefficients @ self.terms)

    def term(self, k: int) -> sparse.csc_array:
        """A_k, the derivative of the matrix by its k-th coefficient."""
        return self._matrix(self.terms[k])

    def project(self, left: FloatArray, right: FloatArray) -> FloatArray:
        """(k, l, r) leftᵀ A_k right of (size, l) and (size, r) vectors."""
        return np.array([left.T @ (self.term(k) @ right) for k in range(len(self.names))])

    def _matrix(self, data: FloatArray) -> sparse.csc_array:
        matrix = sparse.csc_array((data, self.indices, self.indptr), shape=(self.size, self.size))
        matrix.has_sorted_indices = True
        matrix.has_canonical_format = True
        return matrix


@dataclass(frozen=True)
class Pattern:
    """The sparsity pattern of the free dofs, and where in it each entry of each element matrix lands.

    Attributes:
        indptr, indices: the pattern.
        slots: (e·d·d,) place of each entry of the (e, d, d) element matrices in the pattern's data, -1 where held.
        free: numbers of the free dofs among all.
    """

    indptr: IntArray
    indices: IntArray
    slots: IntArray
    free: IntArray

    @classmethod
    def of(cls, elements: IntArray, nodes: int, dofs_per_node: int, free: IntArray) -> Pattern:
        """The pattern of (e, n) elements on so many nodes, found node by node and then spread over the dofs."""
        d = dofs_per_node
        number = np.full(nodes * d, -1)
        number[free] = np.arange(free.size)
        row_node = np.repeat(elements, elements.shape[1], axis=1)
        column_node = np.tile(elements, elements.shape[1])
        keys, pair = np.unique(column_node * nodes + row_node, return_inverse=True)
        column, row = np.divmod(keys, nodes)
        start = np.searchsorted(column, np.arange(nodes + 1))
        degree = np.diff(start)
        # Column dof (j, c) holds its node's neighbours one after the other, d rows each.
        first = d * d * start[column] + d * (np.arange(keys.size) - start[column])
        within = (d * degree[column])[:, None, None] * np.arange(d)[None, None, :] + np.arange(d)[None, :, None]
        place = first[:, None, None] + within
        rows, columns = np.empty(place.size, dtype=np.int64), np.empty(place.size, dtype=np.int64)
        rows[place.ravel()] = np.broadcast_to((d * row)[:, None, None] + np.arange(d)[:, None], place.shape).ravel()
        columns[place.ravel()] = np.broadcast_to((d * column)[:, None, None] + np.arange(d), place.shape).ravel()
        kept = (number[rows] >= 0) & (number[columns] >= 0)
        renumbered = np.where(kept, np.cumsum(kept) - 1, -1)
        indptr = np.concatenate([[0], np.cumsum(np.bincount(number[columns[kept]], minlength=free.size))])
        e, n = elements.shape
        slots = renumbered[place][pair.ravel()].reshape(e, n, n, d, d).transpose(0, 1, 3, 2, 4).ravel()
        return cls(indptr.astype(np.int32), number[rows[kept]].astype(np.int32), slots, free)

    @cached_property
    def _scatters(self) -> dict[int, sparse.csr_array]:
        return {}

    def _scatter(self, entries: int) -> sparse.csr_array:
        """(nnz, entries) ones that add up element entries in their places; with fewer entries the elements share them."""
        if entries not in self._scatters:
            kept = np.flatnonzero(self.slots >= 0)
            places = (self.slots[kept], kept % entries)
            self._scatters[entries] = sparse.csr_array((np.ones(kept.size), places), shape=(self.indices.size, entries))
        return self._scatters[entries]

    def affine(
        self,
        terms: FloatArray,
        names: tuple[str, ...],
        blocks: tuple[IntArray, ...],
        extra: Mapping[str, sparse.csc_array],
    ) -> AffineMatrix:
        """Add up (k, e, d, d) element matrices, or (k, 1, d, d) alike for all elements.

        Whole matrices over all dofs are appended as terms of their own.
        """
        values = terms.reshape(len(terms), -1).T
        data = (self._scatter(len(values)) @ np.ascontiguousarray(values)).T
        more = [self._gather(matrix) for matrix in extra.values()]
        alone = tuple(np.array([[len(names) + i]]) for i in range(len(more)))
        return AffineMatrix(self.indptr, self.indices, np.vstack([data, *more]), (*names, *extra), (*blocks, *alone))

    def _gather(self, matrix: sparse.csc_array) -> FloatArray:
        """Values of a sparse matrix over all dofs, whose entries all lie in the pattern, at the pattern's places."""
        size = self.free.size
        entries = sparse.coo_array(sparse.csc_array(matrix)[self.free][:, self.free])
        keys = np.repeat(np.arange(size), np.diff(self.indptr)) * size + self.indices
        data = np.zeros(self.indices.size)
        np.add.at(data, np.searchsorted(keys, entries.col.astype(np.int64) * size + entries.row), entries.data)
        return data
