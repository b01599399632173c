"""Matrices that are linear in a few coefficients, made of strains:

    A(c) = Σ_elements Bᵀ C(c) B,     C(c) = Σ_k c_k C_k

An element has one strain operator B, whatever the number of coefficients, and a set has small
matrices C_k. So A(c) is one product an element, and xᵀA_ky = Σ (Bx)ᵀC_k(By) for all k comes from
the strains of x and y; no A_k is kept. Mass, springs and point masses are of the same form, with
motions in the place of strains. Congruent elements share one operator.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from fecore.arrays import BoolArray, FloatArray, IntArray

_ALIKE = 1e-10  # of the largest entry: by how much rounding may part what is congruent
_STRAINS = 1 << 20  # numbers (8 MiB) that the strains of some vectors may take at a time


@dataclass(frozen=True)
class Group:
    """Elements that share their coefficients."""

    nodes: IntArray  # (e, n) node numbers
    # (s, p, r, d) rows of strains at p points over the d = n × (dofs of a node) dofs, by the root
    # of a point's weight
    operators: FloatArray
    which: IntArray  # (e,) operator of each element
    terms: FloatArray  # (k, r, r) C_k
    coefficients: IntArray  # (k,) their numbers among the matrix's coefficients

    def matrices(self, coefficients: FloatArray) -> FloatArray:
        """(s, d·d) matrices of the distinct elements at all (k,) coefficients of the whole."""
        count, points, rows, dofs = self.operators.shape
        C = np.tensordot(coefficients[self.coefficients], self.terms, 1)
        stressed = (C @ self.operators).reshape(count, points * rows, dofs)
        strained = self.operators.reshape(count, points * rows, dofs)
        return np.asarray((strained.transpose(0, 2, 1) @ stressed).reshape(count, -1))

    def parts(self, vectors: int) -> Iterator[Group]:
        """The group in parts, so few elements in each that the strains of so many vectors take
        little memory.
        """
        _, points, rows, _ = self.operators.shape
        many = max(1, _STRAINS // max(1, points * rows * vectors))
        for first in range(0, len(self.nodes), many):
            part = slice(first, first + many)
            yield replace(self, nodes=self.nodes[part], which=self.which[part])

    def strains(self, motion: FloatArray) -> FloatArray:
        """(r, e·p, m) strains of (nodes, dofs of a node, m) motions."""
        count, points, rows, dofs = self.operators.shape
        local = motion[self.nodes].reshape(len(self.nodes), dofs, -1)
        flat = self.operators.reshape(count, points * rows, dofs)
        strains = flat[0] @ local if count == 1 else flat[self.which] @ local
        return strains.reshape(len(local) * points, rows, -1).transpose(1, 0, 2)

    def forces(self, stresses: FloatArray, dofs_of_node: int) -> FloatArray:
        """(e, n, dofs of a node, m) forces at the elements' nodes that are in balance with (r, e·p,
        m) stresses.
        """
        count, points, rows, dofs = self.operators.shape
        flat = self.operators.reshape(count, points * rows, dofs).transpose(0, 2, 1)
        local = stresses.transpose(1, 0, 2).reshape(len(self.nodes), points * rows, -1)
        forces = flat[0] @ local if count == 1 else flat[self.which] @ local
        return forces.reshape(len(local), -1, dofs_of_node, local.shape[2])


def distinct(items: FloatArray) -> tuple[IntArray, IntArray]:
    """Numbers of the different ones of (e, …) items, and the (e,) place of each item's among
    them.
    """
    flat = items.reshape(len(items), -1)
    close = _ALIKE * float(np.abs(flat).max(initial=0.0))
    if np.abs(flat - flat[0]).max() <= close:
        return np.zeros(1, dtype=np.int64), np.zeros(len(flat), dtype=np.int64)
    # Alike ones have alike sums under random weights, and sorting numbers is cheap.
    sums = flat @ np.random.default_rng(0).standard_normal(flat.shape[1])
    order = np.argsort(sums)
    first = np.concatenate([[True], np.diff(sums[order]) > close * np.sqrt(flat.shape[1])])
    which = np.empty(len(flat), dtype=np.int64)
    which[order] = np.cumsum(first) - 1
    chosen = order[first]
    if np.abs(flat - flat[chosen[which]]).max() > 10 * close:  # unlike ones had like sums
        return np.arange(len(flat)), np.arange(len(flat))
    return chosen, which


@dataclass(frozen=True)
class Pattern:
    """The sparsity pattern of the free dofs, and where in it each entry of each element matrix
    lands.
    """

    # indptr, indices: the pattern, as in `scipy.sparse.csc_array`
    indptr: IntArray
    indices: IntArray
    free: BoolArray  # (nodes, dofs of a node) whether each dof is free
    numbers: IntArray  # (nodes, dofs of a node) number of each free dof
    pairs: IntArray
    above: IntArray

    @classmethod
    def of(
        cls, connectivities: Sequence[IntArray], free: BoolArray
    ) -> tuple[Pattern, list[IntArray]]:
        """The pattern of (e, n) elements of several kinds, found node by node and spread over the
        dofs; and their slots.
        """
        nodes, dofs = free.shape
        keys = [(c.T[None] * nodes + c.T[:, None]).ravel() for c in connectivities]
        pairs = np.sort(np.concatenate(keys))
        pairs = pairs[np.concatenate([[True], pairs[1:] > pairs[:-1]])]
        column, row = np.divmod(pairs, nodes)
        number = np.cumsum(free).reshape(nodes, dofs) - 1
        # The column of a free dof holds the free dofs of its node's neighbours, one node after the
        # other.
        rows = free.sum(axis=1)[row]
        before = np.cumsum(rows) - rows
        above = (
            before
            - before[np.minimum(np.searchsorted(column, np.arange(nodes)), len(before) - 1)][column]
        )
        height = np.bincount(column, weights=rows, minlength=nodes).astype(np.int64)
        indptr = np.concatenate([[0], np.cumsum(np.repeat(height[:, None], dofs, axis=1)[free])])
        pattern = cls(indptr.astype(np.int32), np.empty(0, np.int32), free, number, pairs, above)
        indices = np.empty(int(indptr[-1]) + 1, dtype=np.int32)
        slots = [pattern.slots(connectivity) for connectivity in connectivities]
        for own, connectivity in zip(slots, connectivities, strict=True):
            indices[own] = _by_entry(number, connectivity.T)[:, :, None, None]
        return cls(pattern.indptr, indices[:-1], free, number, pairs, above), slots

    @property
    def size(self) -> int:
        """Number of free dofs."""
        return int(self.indptr.size - 1)

    def slots(self, connectivity: IntArray) -> IntArray:
        """(n, d, n, d, e) place of each entry of (e, n) elements' matrices in the pattern; of a
        held dof after the last.
        """
        nodes_of = connectivity.T  # (n, e): long arrays innermost
        n, e = nodes_of.shape
        nodes = len(self.free)
        pair = np.searchsorted(self.pairs, nodes_of[None] * nodes + nodes_of[:, None])
        nowhere = int(self.indptr[-1])
        first = _by_entry(np.where(self.free, self.indptr[self.numbers], nowhere), nodes_of)
        within = _by_entry(np.where(self.free, np.cumsum(self.free, axis=1) - 1, nowhere), nodes_of)
        down = self.above[pair].reshape(n, 1, n, e) + within[:, :, None]
        slots = down[:, :, :, None] + first
        np.minimum(slots, nowhere, out=slots)
        return np.asarray(slots)


@dataclass(frozen=True)
class AffineMatrix:
    """A(c) over the free dofs, symmetric, on one compressed-column sparsity pattern."""

    pattern: Pattern
    groups: tuple[Group, ...]  # the elements
    slots: tuple[IntArray, ...]  # where each group's entries land
    names: tuple[str, ...]  # the coefficients' names
    # index matrices into the coefficients: each is a symmetric matrix C of coefficients, such as
    # [[D11, D12], [D12, D22]], whose part of the sum is ∫BᵀCB. So A(c) ≥ α A(c₀) where every C(c) ≥
    # α C(c₀).
    blocks: tuple[IntArray, ...]

    @property
    def size(self) -> int:
        """Number of rows and columns."""
        return self.pattern.size

    def at(self, coefficients: FloatArray) -> scipy.sparse.csc_array:
        """The matrix at (k,) coefficients."""
        data = np.zeros(self.pattern.indices.size + 1)
        for group, slots in zip(self.groups, self.slots, strict=True):
            if not coefficients[group.coefficients].any():
                continue
            entries, places = (
                group.matrices(coefficients).T,
                slots.reshape(group.operators.shape[3] ** 2, -1),
            )
            used = entries.any(axis=1)
            if not used.all():  # two thirds of a mass matrix are nothing
                entries, places = entries[used], places[used]
            each = entries if len(group.operators) == 1 else entries[:, group.which]
            np.add.at(data, places.ravel(), np.broadcast_to(each, places.shape).ravel())
        return self._matrix(data[:-1])

    def term(self, k: int) -> scipy.sparse.csc_array:
        """A_k, the derivative of the matrix by its k-th coefficient."""
        return self.at(np.eye(1, len(self.names), k)[0])

    def project(self, vectors: FloatArray, right: slice) -> FloatArray:
        """(k, l, r) leftᵀ A_k right of (size, l) vectors and r columns of them, from their
        strains.
        """
        return self.forms(self.everywhere(vectors), right)

    def forms(self, motion: FloatArray, right: slice) -> FloatArray:
        """The same of (nodes, dofs of a node, l) motions, which may move what is held."""
        vectors = motion.shape[2]
        forms = np.zeros((len(self.names), vectors, len(range(*right.indices(vectors)))))
        # The middle of these times itself is one triangle, which BLAS takes half the time for; and
        # that of the strains i and j is the transpose of that of j and i.
        first, last, _ = right.indices(vectors)
        for group in (part for whole in self.groups for part in whole.parts(vectors)):
            x = group.strains(motion)
            y, middles = x[..., right], dict[tuple[int, int], FloatArray]()
            for i, j in np.argwhere(group.terms.any(axis=0)).tolist():
                turned = middles.pop((j, i), None)
                middle = middles[i, j] = x[i][:, right].T @ y[j] if turned is None else turned.T
                product = np.vstack([x[i][:, :first].T @ y[j], middle, x[i][:, last:].T @ y[j]])
                for k in np.flatnonzero(group.terms[:, i, j]):
                    forms[group.coefficients[k]] += group.terms[k, i, j] * product
        return forms

    def force(self, coefficients: FloatArray, motion: FloatArray) -> FloatArray:
        """(size, m) A(c) times (nodes, dofs of a node, m) motions, which may move what is held."""
        force = np.zeros_like(motion)
        for group in self.groups:
            dofs = group.operators.shape[3]
            each = group.matrices(coefficients).reshape(-1, dofs, dofs)[group.which]
            moved = motion[group.nodes]
            own = each @ moved.reshape(len(each), dofs, -1)
            np.add.at(force, group.nodes, own.reshape(moved.shape))
        return force[self.pattern.free]

    def about(self, nodes: IntArray) -> AffineMatrix:
        """The part of the elements that have one of some nodes, for forms."""
        groups, slots = [], []
        for group, all_of in zip(self.groups, self.slots, strict=True):
            at = np.isin(group.nodes, nodes).any(axis=1)
            if at.any():
                groups.append(replace(group, nodes=group.nodes[at], which=group.which[at]))
                slots.append(all_of[..., at])
        return replace(self, groups=tuple(groups), slots=tuple(slots))

    def everywhere(self, vectors: FloatArray) -> FloatArray:
        """(nodes, dofs of a node, m) motions of (size, m) vectors over the free dofs; nothing where
        a dof is held.
        """
        motion = np.zeros((*self.pattern.free.shape, vectors.shape[1]))
        motion[self.pattern.free] = vectors
        return motion

    def _matrix(self, data: FloatArray) -> scipy.sparse.csc_array:
        pattern = self.pattern
        matrix = scipy.sparse.csc_array(
            (data, pattern.indices, pattern.indptr), shape=(self.size, self.size)
        )
        matrix.has_sorted_indices = True
        matrix.has_canonical_format = True
        return matrix


def _by_entry(values: IntArray, nodes_of: IntArray) -> IntArray:
    """(n, d, e) of each element's dofs from (nodes, d) of all, for (n, e) node numbers."""
    return np.ascontiguousarray(values[nodes_of].transpose(0, 2, 1))
