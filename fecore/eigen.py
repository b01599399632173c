"""Undamped modes of K φ = λ M φ: block Lanczos with shift-invert and full reorthogonalisation.

With a shift σ below the wanted eigenvalues, the operator (K - σM)⁻¹M has the eigenvalues 1/(λ - σ), so the lowest
modes are its largest and converge first. A block of start vectors catches repeated and close modes together (Grimes,
Lewis and Simon, SIAM J. Matrix Anal. Appl. 15, 1994). Rigid-body modes are known exactly, so the iteration is kept
M-orthogonal to them and they are returned with λ = 0. The basis is orthogonalised in full, twice and once more after
scaling, so no ghost modes appear; and the inertia of K - μM (Sylvester: its negative eigenvalues are the modes below
μ) proves that none is missing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.linalg import eigh

from fecore.arrays import FloatArray
from fecore.errors import InputError, ModelError
from fecore.factor import Factor, factorise, negative_eigenvalues

_BLOCK = 3
_FIRST_LOOK = 2  # vectors a wanted mode before which nothing can have converged
_MOST_STEPS = 60  # blocks; beyond it the iteration has failed
_TOLERANCE = 1e-11  # relative residual of 1/(λ - σ); the eigenvalue's own error is its square
_INDEFINITE = 1e-8  # share of a block's energy that round-off may make of nothing
_DEPENDENT = 1e-12  # a direction that shrank so much in orthogonalisation is round-off


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
    factor: Factor

    @property
    def omega(self) -> FloatArray:
        """(n,) natural circular frequencies, rad/s."""
        return np.sqrt(self.eigenvalue)

    @property
    def frequency_hz(self) -> FloatArray:
        """(n,) natural frequencies, Hz."""
        return self.omega / (2 * np.pi)


def modes_below(stiffness: sparse.csc_array, mass: sparse.csc_array, eigenvalue: float) -> int:
    """Number of modes with λ < `eigenvalue`, from the inertia of K - λM."""
    return negative_eigenvalues(stiffness - eigenvalue * mass)


def normal_modes(
    stiffness: sparse.csc_array,
    mass: sparse.csc_array,
    count: int,
    rigid_modes: FloatArray | None = None,
    *,
    prove: bool = True,
) -> NormalModes:
    """The `count` lowest modes of K φ = λ M φ, rigid-body modes included.

    Args:
        stiffness: (dofs, dofs) K, positive semi-definite.
        mass: (dofs, dofs) M, positive definite.
        count: how many modes.
        rigid_modes: (dofs, r) a basis of the null space of K; None where K is definite.
        prove: count the modes by a second factorisation, and so prove that none is missing.

    Raises:
        InputError: there are not so many modes.
        ModelError: K - σM is not positive definite, the iteration does not converge, or a mode is missing.
    """
    rigid = mass_orthonormal(rigid_modes, mass)
    free = rigid.shape[1]
    wanted = count - free
    if wanted < 1 or wanted > stiffness.shape[0] - free:
        raise InputError(
            "count",
            f"is {count}, expected at least {free + 1} and at most {stiffness.shape[0]}: "
            f"the model has {stiffness.shape[0]} dofs and {free} rigid-body modes",
        )
    shift = _shift(stiffness, mass, rigid) if free else 0.0
    factor = factorise(stiffness - shift * mass if shift else stiffness)
    value, vectors = _lanczos(factor, mass, rigid, wanted, _BLOCK)
    eigenvalue = shift + 1 / value
    if prove and _missing(stiffness, mass, eigenvalue, free):
        # A root of higher multiplicity than the block's width: a wider block holds all of it.
        value, vectors = _lanczos(factor, mass, rigid, wanted, wanted + _BLOCK)
        eigenvalue = shift + 1 / value
        missing = _missing(stiffness, mass, eigenvalue, free)
        if missing:
            raise ModelError(f"{missing} of the {count} lowest modes were not found, though the iteration converged")
    shapes = np.hstack([rigid, vectors])
    return NormalModes(np.concatenate([np.zeros(free), eigenvalue]), shapes, free, shift, factor)


def mass_orthonormal(vectors: FloatArray | None, mass: sparse.csc_array) -> FloatArray:
    """(dofs, r) M-orthonormal basis of the span of (dofs, r) vectors; none for None."""
    if vectors is None or vectors.shape[1] == 0:
        return np.zeros((mass.shape[0], 0))
    scaled: FloatArray = vectors / np.linalg.norm(vectors, axis=0)
    for _ in range(2):  # the second pass removes what the Gram matrix squared of the round-off
        lower = np.linalg.cholesky(scaled.T @ (mass @ scaled))
        scaled = scaled @ np.linalg.inv(lower).T
    return scaled


def _shift(stiffness: sparse.csc_array, mass: sparse.csc_array, rigid: FloatArray) -> float:
    """A negative shift of about the first elastic eigenvalue, so that K - σM is definite and well conditioned.

    That eigenvalue's scale is the Rayleigh quotient after one inverse iteration with a shift far below everything.
    """
    tiny = -1e-9 * float(np.median(stiffness.diagonal() / mass.diagonal()))
    start = np.random.default_rng(0).standard_normal(mass.shape[0])
    vector = factorise(stiffness - tiny * mass).solve(mass @ (start - rigid @ (rigid.T @ (mass @ start))))
    vector = vector - rigid @ (rigid.T @ (mass @ vector))
    return -float((vector @ (stiffness @ vector)) / (vector @ (mass @ vector)))


def _lanczos(
    factor: Factor, mass: sparse.csc_array, rigid: FloatArray, wanted: int, width: int
) -> tuple[FloatArray, FloatArray]:
    """The `wanted` largest eigenpairs of (K - σM)⁻¹M outside the rigid modes, descending, M-orthonormal."""
    dofs, free = rigid.shape
    basis = _Basis(rigid, mass)
    random = np.random.default_rng(0)
    basis.append(basis.orthonormalise(random.standard_normal((dofs, min(width, dofs - free)))))
    projected = np.zeros((0, 0))
    for _ in range(_MOST_STEPS):
        done = projected.shape[0]
        image = factor.solve(basis.mass_images[:, free + done :])
        column = basis.mass_images[:, free:].T @ image
        size = len(column)
        grown = np.empty((size, size))
        grown[:done, :done] = projected
        grown[:, done:] = column
        grown[done:, :] = column.T
        projected = grown
        block = basis.orthonormalise(image)
        exhausted = block.vectors.shape[1] == 0
        if size >= wanted and (exhausted or size >= _FIRST_LOOK * wanted):
            value, small = eigh(projected)
            value, small = value[: -wanted - 1 : -1], small[:, : -wanted - 1 : -1]
            residual = np.linalg.norm(block.coupling @ small[done:], axis=0)
            if exhausted or np.all(residual <= _TOLERANCE * value):
                return value, basis.vectors[:, free:] @ small
        if exhausted:  # the space is invariant, and what is missing lies outside it
            block = basis.orthonormalise(random.standard_normal((dofs, min(width, dofs - free - size))))
        basis.append(block)
    raise ModelError(f"block Lanczos did not find {wanted} modes in a basis of {projected.shape[0]} vectors")


@dataclass(frozen=True)
class _Block:
    """(dofs, b) M-orthonormal vectors X, their images MX, and R of the block that they were made from: … + XR."""

    vectors: FloatArray
    mass_images: FloatArray
    coupling: FloatArray


class _Basis:
    """An M-orthonormal basis that grows by blocks, with the images of its vectors under M."""

    def __init__(self, vectors: FloatArray, mass: sparse.csc_array) -> None:
        # M is symmetric: its columns are its rows, and products by rows are the faster ones. Its pattern is K's, so
        # most of what it stores is zero.
        self._mass = sparse.csr_array((mass.data, mass.indices, mass.indptr), shape=mass.shape, copy=True)
        self._mass.eliminate_zeros()
        self._store = np.array([vectors.T, (self._mass @ vectors).T])
        self._size = vectors.shape[1]

    @property
    def vectors(self) -> FloatArray:
        """(dofs, s) basis."""
        return self._store[0, : self._size].T

    @property
    def mass_images(self) -> FloatArray:
        """(dofs, s) M times the basis."""
        return self._store[1, : self._size].T

    def append(self, block: _Block) -> None:
        """Take in a block."""
        size, width = self._size, block.vectors.shape[1]
        if size + width > self._store.shape[1]:
            grown = np.empty((2, 2 * size + 8 * width, len(block.vectors)))
            grown[:, :size] = self._store[:, :size]
            self._store = grown
        self._store[0, size : size + width] = block.vectors.T
        self._store[1, size : size + width] = block.mass_images.T
        self._size += width

    def orthonormalise(self, block: FloatArray) -> _Block:
        """M-orthonormal basis of what of `block` lies outside the space.

        Twice is enough for orthogonality to round-off (Kahan and Parlett); once more after scaling restores what a
        block that shrank has lost.
        """
        image = self._mass @ block
        scale = float(np.einsum("di,di->i", block, image).max(initial=0))
        for _ in range(2):
            inside = self.mass_images.T @ block
            block = block - self.vectors @ inside
            image = image - self.mass_images @ inside
        weight, turn = np.linalg.eigh(block.T @ image)
        if weight.min(initial=0) < -_INDEFINITE * scale:
            raise ModelError("the mass matrix is not positive definite: is the density right?")
        keep = weight > _DEPENDENT**2 * scale
        root, turn = np.sqrt(weight[keep]), turn[:, keep]
        scaled = block @ (turn / root)
        scaled = scaled - self.vectors @ (self.mass_images.T @ scaled)
        image = self._mass @ scaled
        # The squares lost the block's nearly dependent directions in round-off; measured again they are right.
        weight, again = np.linalg.eigh(scaled.T @ image)
        keep = weight > _INDEFINITE
        second, again = np.sqrt(weight[keep]), again[:, keep]
        coupling = (second[:, None] * again.T) @ (root[:, None] * turn.T)
        return _Block(scaled @ (again / second), image @ (again / second), coupling)


def _missing(stiffness: sparse.csc_array, mass: sparse.csc_array, eigenvalue: FloatArray, rigid: int) -> int:
    """How many modes lie below the last gap between well-separated modes and were not found (Sturm)."""
    gaps = np.flatnonzero(eigenvalue[1:] > eigenvalue[:-1] * (1 + 1e-6))
    if gaps.size == 0:
        return 0
    last = int(gaps[-1])
    counted = modes_below(stiffness, mass, float(np.sqrt(eigenvalue[last] * eigenvalue[last + 1])))
    return counted - last - 1 - rigid
