"""Exact derivatives of eigenvalues and shapes by parameters, repeated roots included.

With K' = ∂K/∂θ, M' = ∂M/∂θ and mass-normalised shapes (Nelson, AIAA J. 14, 1976; Lee and Jung, J.
Sound Vib. 202, 1997):

    G_jk = φ_jᵀ(K' - λ_k M')φ_k,    ∂λ_k = G_kk,    [K - λ_k M  MΦ; ΦᵀM  0] [∂φ_k; ν] = [-(K' - λ_k M')φ_k; -½ΦᵀM'φ_k]

where Φ holds the modes of λ_k's cluster: itself alone, or all modes of a repeated root. Inside a
cluster single shapes have no derivative, as any rotation of them is as good; what has one is the
sum over the cluster, of which all FRFs are made. Its part is carried by G, whose eigenvalues are
the cluster's eigenvalue derivatives in the direction of θ.

All functions take sparse matrices over the dofs, or dense ones over a reduced basis.
"""

from collections.abc import Sequence

import numpy as np
import scipy

from fecore.arrays import BoolArray, FloatArray
from fecore.dynamics.eigen import NormalModes
from fecore.dynamics.synthesis import Matrix

_REPEATED = 1e-8  # relative distance of eigenvalues below which they count as one


def same_cluster(eigenvalue: FloatArray) -> BoolArray:
    """(n, n) whether two of (n,) ascending eigenvalues belong to one repeated root; rigid-body
    modes all do.
    """
    step = np.diff(eigenvalue, prepend=-np.inf) > _REPEATED * np.maximum(
        eigenvalue, np.finfo(float).tiny
    )
    label = np.cumsum(step)
    return np.asarray(label[:, None] == label)


def mode_forms(modes: NormalModes, terms: Sequence[Matrix], weights: FloatArray) -> FloatArray:
    """(p, n, n) forms φ_jᵀA'φ_k of A' = Σ_k weights_kp A_k for each of p parameters, from k
    matrices and (k, p) weights.
    """
    phi = modes.shapes
    forms = np.zeros((weights.shape[1], phi.shape[1], phi.shape[1]))
    for term, weight in zip(terms, weights, strict=True):
        if weight.any():
            forms += weight[:, None, None] * (phi.T @ (term @ phi))
    return forms


def eigenvalue_derivatives(
    modes: NormalModes, stiffness_forms: FloatArray, mass_forms: FloatArray
) -> FloatArray:
    """(p, n, n) matrices G inside each cluster and 0 outside; the diagonal holds ∂λ of single
    roots.
    """
    G = stiffness_forms - modes.eigenvalue * mass_forms
    inside = same_cluster(modes.eigenvalue)
    rigid = np.arange(modes.eigenvalue.size) < modes.rigid
    inside &= ~rigid  # a rigid-body mode stays at 0
    symmetric: FloatArray = np.where(inside, (G + G.transpose(0, 2, 1)) / 2, 0.0)
    return symmetric


def mode_shape_derivatives(
    stiffness: Matrix,
    mass: Matrix,
    modes: NormalModes,
    stiffness_by: Sequence[Matrix],
    mass_by: Sequence[Matrix],
) -> FloatArray:
    """(p, dofs, n) ∂φ, without the rotation inside a cluster of repeated roots."""
    derivative = np.empty((len(stiffness_by), *modes.shapes.shape))
    inside = same_cluster(modes.eigenvalue)
    for first in np.unique(np.argmax(inside, axis=1)):
        cluster = np.flatnonzero(inside[first])
        phi, value = modes.shapes[:, cluster], float(np.mean(modes.eigenvalue[cluster]))
        tops = [
            -(K @ phi - (M @ phi) * modes.eigenvalue[cluster])
            for K, M in zip(stiffness_by, mass_by, strict=True)
        ]
        bottoms = [-(phi.T @ (M @ phi)) / 2 for M in mass_by]
        right = np.vstack([np.hstack(tops), np.hstack(bottoms)])
        solution = _bordered_solve(stiffness - value * mass, mass @ phi, right)[: len(phi)]
        derivative[:, :, cluster] = solution.reshape(len(phi), len(tops), cluster.size).transpose(
            1, 0, 2
        )
    return derivative


def _bordered_solve(matrix: Matrix, border: FloatArray, right: FloatArray) -> FloatArray:
    size = border.shape[1]
    scale = abs(matrix).max() / np.abs(border).max()
    border = border * scale  # of the matrix's own size, for the sake of the pivots
    right = np.vstack([right[:-size], right[-size:] * scale])
    if scipy.sparse.issparse(matrix):
        edge = scipy.sparse.csc_array(border)
        whole = scipy.sparse.csc_matrix(
            scipy.sparse.block_array([[matrix, edge], [edge.T, None]], format="csc")
        )
        solution: FloatArray = scipy.sparse.linalg.splu(whole).solve(right)
        return solution
    dense = np.block([[np.asarray(matrix), border], [border.T, np.zeros((size, size))]])
    return np.linalg.solve(dense, right)
