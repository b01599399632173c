"""Undamped modes of K φ = λ M φ: block Lanczos with shift-invert and full reorthogonalisation.

With a shift σ below the wanted eigenvalues, the operator (K - σM)⁻¹M has the eigenvalues 1/(λ - σ), so the lowest
modes are its largest and converge first. A block of start vectors catches repeated and close modes together (Grimes,
Lewis and Simon, SIAM J. Matrix Anal. Appl. 15, 1994). Rigid-body modes are known exactly, so the iteration is kept
M-orthogonal to them and they are returned with λ = 0. The basis is orthogonalised in full, twice, so no ghost modes
appear; and the inertia of K - μM (Sylvester: its negative eigenvalues are the modes below μ) proves that none is
missing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.linalg import eigh
from scipy.sparse.linalg import SuperLU, splu

from fecore.arrays import FloatArray
from fecore.errors import ModelError

_BLOCK = 4
_MAX_BASIS = 40  # blocks; beyond it the iteration has failed
_TOLERANCE = 1e-12  # relative residual of 1/(λ - σ)


@dataclass(frozen=True)
class NormalModes:
    """Undamped modes, in ascending order, rigid-body modes first.

    Attributes:
        eigenvalue: (n,) λ = ω², rad²/s².
        shapes: (dofs, n) mass-normalised shapes, φᵀMφ = 1.
        rigid: number of rigid-body modes.
        shift: σ of the factorisation, rad²/s².
        factor: factorisation of K - σM, for residual terms and derivatives.
    """

    eigenvalue: FloatArray
    shapes: FloatArray
    rigid: int
    shift: float
    factor: SuperLU

    @property
    def omega(self) -> FloatArray:
        """(n,) natural circular frequencies, rad/s."""
        return np.sqrt(self.eigenvalue)

    @property
    def frequency_hz(self) -> FloatArray:
        """(n,) natural frequencies, Hz."""
        return self.omega / (2 * np.pi)


def factorise(matrix: sparse.csc_array) -> SuperLU:
    """Factorise a sparse symmetric matrix without pivoting, so that the signs of the pivots give its inertia.

    Raises:
        ModelError: the matrix is singular.
    """
    try:
        return splu(
            sparse.csc_matrix(matrix),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError as error:
        raise ModelError(
            f"the stiffness cannot be factorised ({error}); are the supports and constants right?"
        ) from error


def modes_below(stiffness: sparse.csc_array, mass: sparse.csc_array, eigenvalue: float) -> int:
    """Number of modes with λ < `eigenvalue`, from the inertia of K - λM."""
    return int(np.sum(factorise(stiffness - eigenvalue * mass).U.diagonal() < 0))


def normal_modes(
    stiffness: sparse.csc_array, mass: sparse.csc_array, count: int, rigid_modes: FloatArray | None = None
) -> NormalModes:
    """The `count` lowest modes of K φ = λ M φ, rigid-body modes included.

    Args:
        stiffness: (dofs, dofs) K, positive semi-definite.
        mass: (dofs, dofs) M, positive definite.
        count: how many modes.
        rigid_modes: (dofs, r) a basis of the null space of K; None where K is definite.

    Raises:
        ModelError: K - σM cannot be factorised, the iteration does not converge, or a mode is missing.
    """
    rigid = _mass_orthonormal(rigid_modes, mass)
    wanted = count - rigid.shape[1]
    if wanted < 1 or wanted > stiffness.shape[0] - rigid.shape[1]:
        raise ModelError(
            f"{count} modes cannot be had from {stiffness.shape[0]} dofs with {rigid.shape[1]} rigid modes"
        )
    shift = _shift(stiffness, mass) if rigid.shape[1] else 0.0
    factor = factorise(stiffness - shift * mass)
    value, vectors = _lanczos(factor, mass, rigid, wanted)
    eigenvalue = shift + 1 / value
    order = np.argsort(eigenvalue)
    eigenvalue, vectors = eigenvalue[order], vectors[:, order]
    _prove_complete(stiffness, mass, eigenvalue, rigid.shape[1])
    shapes = np.hstack([rigid, vectors])
    return NormalModes(np.concatenate([np.zeros(rigid.shape[1]), eigenvalue]), shapes, rigid.shape[1], shift, factor)


def _mass_orthonormal(vectors: FloatArray | None, mass: sparse.csc_array) -> FloatArray:
    if vectors is None or vectors.shape[1] == 0:
        return np.zeros((mass.shape[0], 0))
    scaled = vectors / np.linalg.norm(vectors, axis=0)
    lower = np.linalg.cholesky(scaled.T @ (mass @ scaled))
    return np.linalg.solve(lower, scaled.T).T


def _shift(stiffness: sparse.csc_array, mass: sparse.csc_array) -> float:
    """A negative shift, far below the elastic modes on the scale of the matrices, so that K - σM is definite."""
    return -1e-9 * float(np.median(stiffness.diagonal() / mass.diagonal()))


def _lanczos(factor: SuperLU, mass: sparse.csc_array, rigid: FloatArray, wanted: int) -> tuple[FloatArray, FloatArray]:
    """The `wanted` largest eigenpairs of (K - σM)⁻¹M outside the rigid modes, M-orthonormal."""
    dofs = mass.shape[0]
    block: FloatArray = np.random.default_rng(0).standard_normal((dofs, _BLOCK))
    basis, mass_basis = np.zeros((dofs, 0)), np.zeros((dofs, 0))
    rigid_mass = mass @ rigid
    projected = np.zeros((0, 0))
    block, _ = _orthonormalise(block, [(rigid, rigid_mass)], mass)
    for _ in range(_MAX_BASIS):
        mass_block = mass @ block
        basis, mass_basis = np.hstack([basis, block]), np.hstack([mass_basis, mass_block])
        image = factor.solve(np.ascontiguousarray(mass_block))
        column = mass_basis.T @ image
        size = basis.shape[1]
        grown = np.zeros((size, size))
        grown[: size - block.shape[1], : size - block.shape[1]] = projected
        grown[:, size - block.shape[1] :] = column
        grown[size - block.shape[1] :, :] = column.T
        projected = grown
        following, coupling = _orthonormalise(image, [(rigid, rigid_mass), (basis, mass_basis)], mass)
        value, small = eigh(projected)
        value, small = value[::-1], small[:, ::-1]
        if size >= wanted:
            residual = np.linalg.norm(coupling @ small[size - block.shape[1] :, :wanted], axis=0)
            if np.all(residual <= _TOLERANCE * value[:wanted]):
                return value[:wanted], basis @ small[:, :wanted]
        if following.shape[1] == 0:
            break
        block = following
    raise ModelError(f"block Lanczos found fewer than {wanted} modes in a basis of {basis.shape[1]} vectors")


def _orthonormalise(
    block: FloatArray, against: list[tuple[FloatArray, FloatArray]], mass: sparse.csc_array
) -> tuple[FloatArray, FloatArray]:
    """M-orthonormal basis of the part of `block` outside the given spaces, and the coupling R of block = … + QR.

    Twice is enough for orthogonality to round-off (Kahan and Parlett).
    """
    scale = np.sqrt(np.einsum("di,di->i", block, mass @ block)).max()
    for _ in range(2):
        for space, mass_space in against:
            block = block - space @ (mass_space.T @ block)
    gram = block.T @ (mass @ block)
    weight, vectors = eigh(gram)
    keep = weight > (1e-14 * scale) ** 2
    root = np.sqrt(weight[keep])
    orthonormal: FloatArray = block @ (vectors[:, keep] / root)
    for space, mass_space in against:
        orthonormal = orthonormal - space @ (mass_space.T @ orthonormal)
    # The small eigenvalues of the Gram matrix carry squared round-off: one more pass restores orthonormality.
    lower = np.linalg.cholesky(orthonormal.T @ (mass @ orthonormal))
    orthonormal = np.linalg.solve(lower, orthonormal.T).T
    return orthonormal, lower.T @ (root[:, None] * vectors[:, keep].T)


def _prove_complete(stiffness: sparse.csc_array, mass: sparse.csc_array, eigenvalue: FloatArray, rigid: int) -> None:
    """Sturm check just above the last well-separated mode.

    Raises:
        ModelError: the inertia counts more modes than were found.
    """
    ratio = eigenvalue[1:] / eigenvalue[:-1]
    gaps = np.flatnonzero(ratio > 1 + 1e-6)
    if gaps.size == 0:
        return
    last = int(gaps[-1])
    counted = modes_below(stiffness, mass, float(np.sqrt(eigenvalue[last] * eigenvalue[last + 1])))
    if counted != last + 1 + rigid:
        raise ModelError(f"{counted} modes lie below the {last + 2}th found, {last + 1 + rigid} of which were found")
