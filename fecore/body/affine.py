"""Matrices that are linear in a few coefficients, on one sparsity pattern.

    K(c) = Σ_k c_k K_k

The K_k are element matrices on one pattern. For a new c the element matrices are summed first and then assembled, once,
which where all elements are congruent means one element matrix; K_k itself is the derivative by c_k.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from fecore.arrays import FloatArray, IntArray


@dataclass(frozen=True)
class Pattern:
    """The sparsity pattern of the free dofs, and where in it each entry of each element matrix lands.

    Attributes:
        indptr, indices: the pattern, as in `scipy.sparse.csc_array`.
        slots: (d·d·e,) place of each entry of the element matrices in the pattern's data, element after element for
            the first entry, then for the second; where a dof is held, the place after the last.
        free: numbers of the free dofs among all.
    """

    indptr: IntArray
    indices: IntArray
    slots: IntArray
    free: IntArray

    @classmethod
    def of(cls, elements: IntArray, nodes: int, dofs_per_node: int, free: IntArray) -> Pattern:
        """The pattern of (e, n) elements on so many nodes, found node by node and then spread over the dofs."""
        is_free = np.zeros((nodes, dofs_per_node), dtype=bool)
        is_free.reshape(-1)[free] = True
        number = np.cumsum(is_free).reshape(nodes, -1) - 1
        nodes_of = elements.T  # (n, e): long arrays innermost
        keys, pair = np.unique(nodes_of[None] * nodes + nodes_of[:, None], return_inverse=True)
        column, row = np.divmod(keys, nodes)
        # The column of a free dof holds the free dofs of its node's neighbours, one node after the other.
        rows = is_free.sum(axis=1)[row]
        before = np.cumsum(rows) - rows
        above = before - before[np.searchsorted(column, np.arange(nodes))][column]
        height = np.bincount(column, weights=rows, minlength=nodes).astype(np.int64)
        indptr = np.concatenate([[0], np.cumsum(np.repeat(height[:, None], dofs_per_node, axis=1)[is_free])])
        nowhere = int(indptr[-1])
        first = _by_entry(np.where(is_free, indptr[number], nowhere), nodes_of)
        within = _by_entry(np.where(is_free, np.cumsum(is_free, axis=1) - 1, nowhere), nodes_of)
        n, e = nodes_of.shape
        down = above[pair].reshape(n, 1, n, e) + within[:, :, None]
        slots = down[:, :, :, None] + first
        np.minimum(slots, nowhere, out=slots)
        indices = np.empty(nowhere + 1, dtype=np.int32)
        indices[slots] = _by_entry(number, nodes_of)[:, :, None, None]
        return cls(indptr.astype(np.int32), indices[:-1], slots.ravel(), free)

    def assemble(self, elements: FloatArray) -> FloatArray:
        """Values at the pattern's places of (e, d·d) element matrices, or of (1, d·d) alike for all elements."""
        slots = self.slots.reshape(elements.shape[1], -1)
        used = elements.any(axis=0)  # two thirds of a mass matrix are nothing
        each = np.broadcast_to(elements[:, used].T, (int(used.sum()), slots.shape[1]))
        summed = np.bincount(slots[used].ravel(), weights=each.ravel(), minlength=self.indices.size + 1)
        return np.asarray(summed[:-1], dtype=float)

    def find(self, matrix: scipy.sparse.csc_array) -> tuple[IntArray, FloatArray]:
        """Entries of a sparse matrix over all dofs, which all lie in the pattern: their places in it, and values."""
        if matrix.nnz == 0:
            return np.empty(0, dtype=np.int64), np.empty(0)
        size = self.free.size
        entries = scipy.sparse.coo_array(scipy.sparse.csc_array(matrix)[self.free][:, self.free])
        keys = np.repeat(np.arange(size), np.diff(self.indptr)) * size + self.indices
        return np.searchsorted(keys, entries.col.astype(np.int64) * size + entries.row), entries.data

    def affine(
        self,
        terms: FloatArray,
        names: tuple[str, ...],
        blocks: tuple[IntArray, ...],
        extra: Mapping[str, scipy.sparse.csc_array],
        zone: IntArray | None = None,
    ) -> AffineMatrix:
        """Σ_k c_k A_k of (k, e, d, d) element matrices, or (k, 1, d, d) alike for all elements.

        Whole matrices over all dofs are appended as terms of their own. With the (e,) number of each element's zone every zone
        has coefficients of its own, one zone's after the other's.
        """
        count, zones = len(names), 1 if zone is None else int(zone.max()) + 1
        alone = tuple(np.array([[count * zones + i]]) for i in range(len(extra)))
        whole = tuple(self.find(matrix) for matrix in extra.values())
        if zones > 1:
            names = tuple(f"{name} in zone {z + 1}" for z in range(zones) for name in names)
            blocks = tuple(block + z * count for z in range(zones) for block in blocks)
        elements = terms.reshape(*terms.shape[:2], -1)
        return AffineMatrix(self, elements, whole, (*names, *extra), (*blocks, *alone), zone if zones > 1 else None)


@dataclass(frozen=True)
class AffineMatrix:
    """Σ_k c_k A_k, every symmetric A_k on one compressed-column sparsity pattern.

    Attributes:
        pattern: the pattern.
        elements: (k, e, d·d) element matrices of the first terms, or (k, 1, d·d) alike for all elements.
        whole: places in the pattern, and values there, of each of the l last terms, which have few entries.
        names: the k + l coefficients' names.
        blocks: index matrices into the coefficients: each is a symmetric matrix C of coefficients, such as
            [[D11, D12], [D12, D22]], whose part of the sum is ∫BᵀCB. So K(c) ≥ α K(c₀) where every C(c) ≥ α C(c₀).
        zone: (e,) zone of each element, where zones have coefficients of their own; None else.
    """

    pattern: Pattern
    elements: FloatArray
    whole: tuple[tuple[IntArray, FloatArray], ...]
    names: tuple[str, ...]
    blocks: tuple[IntArray, ...]
    zone: IntArray | None = None

    @property
    def size(self) -> int:
        """Number of rows and columns."""
        return int(self.pattern.free.size)

    def at(self, coefficients: FloatArray) -> scipy.sparse.csc_array:
        """The matrix at (k + l,) coefficients."""
        own = len(self.names) - len(self.whole)
        data = self.pattern.assemble(self._summed(coefficients[:own]))
        for coefficient, (places, values) in zip(coefficients[own:], self.whole, strict=True):
            data[places] += coefficient * values
        return self._matrix(data)

    def _summed(self, coefficients: FloatArray) -> FloatArray:
        """(e, d·d) element matrices at the coefficients of the elements, or (1, d·d) alike for all."""
        count, e, entries = self.elements.shape
        if self.zone is None:
            summed: FloatArray = (coefficients @ self.elements.reshape(count, -1)).reshape(e, entries)
            return summed
        of_element = coefficients.reshape(-1, count)[self.zone]
        if e == 1:
            return np.asarray(of_element @ self.elements[:, 0])
        return np.asarray(np.einsum("ek,ked->ed", of_element, self.elements))

    def term(self, k: int) -> scipy.sparse.csc_array:
        """A_k, the derivative of the matrix by its k-th coefficient."""
        return self._matrix(self._terms[k])

    def project(self, left: FloatArray, right: FloatArray) -> FloatArray:
        """(k, l, r) leftᵀ A_k right of (size, l) and (size, r) vectors."""
        return np.array([left.T @ (term @ right) for term in self._compact])

    @cached_property
    def _terms(self) -> tuple[FloatArray, ...]:
        """(nnz,) values of each term, made when a derivative is first asked for."""
        alone = np.zeros((len(self.whole), self.pattern.indices.size))
        for row, (places, values) in zip(alone, self.whole, strict=True):
            row[places] = values
        if self.zone is None:
            return (*(self.pattern.assemble(term) for term in self.elements), *alone)
        inside = [(self.zone == z)[:, None] for z in range(int(self.zone.max()) + 1)]
        return (
            *(self.pattern.assemble(np.where(part, term, 0.0)) for part in inside for term in self.elements),
            *alone,
        )

    @cached_property
    def _compact(self) -> tuple[scipy.sparse.csc_array, ...]:
        """The terms without the pattern's places that they leave empty: most of it, where there are membrane dofs."""
        compact = tuple(self._matrix(values).copy() for values in self._terms)
        for term in compact:
            term.eliminate_zeros()
        return compact

    def _matrix(self, data: FloatArray) -> scipy.sparse.csc_array:
        pattern = self.pattern
        matrix = scipy.sparse.csc_array((data, pattern.indices, pattern.indptr), shape=(self.size, self.size))
        matrix.has_sorted_indices = True
        matrix.has_canonical_format = True
        return matrix


def _by_entry(values: IntArray, nodes_of: IntArray) -> IntArray:
    """(n, d, e) of each element's dofs from (nodes, d) of all, for (n, e) node numbers."""
    return np.ascontiguousarray(values[nodes_of].transpose(0, 2, 1))
