"""Geometry, supports and masses to an affine finite element system.

The stiffness is linear in the section's coefficients and the mass in its inertias,

    K(c) = Σ_k c_k K_k,     M(m) = Σ_j m_j M_j,

so the K_k and M_j are assembled once, a new section is a weighted sum of arrays on one sparsity pattern, and the
derivative of K by a coefficient is K_k itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from scipy import sparse

from fecore.arrays import BoolArray, FloatArray, IntArray
from fecore.elements import shell8
from fecore.errors import InputError
from fecore.laminate import Section
from fecore.mesh import RectangleMesh

EdgeSupport = Literal["free", "clamped", "simply_supported"]
Boundary = Literal["cantilever", "free", "simply_supported"]


@dataclass(frozen=True)
class Supports:
    """How each edge of the rectangle is held: `start` is x = 0, `end` x = L, `lower` and `upper` y = ∓b/2.

    A simply supported edge holds w and the rotation along the edge's own tangent direction ("hard" support).
    """

    start: EdgeSupport = "free"
    end: EdgeSupport = "free"
    lower: EdgeSupport = "free"
    upper: EdgeSupport = "free"

    @classmethod
    def of(cls, boundary: Boundary) -> Supports:
        """The supports of a strip by the name of its boundary.

        Raises:
            InputError: the name is not a known boundary.
        """
        if boundary not in get_args(Boundary):
            raise InputError("boundary", f"is {boundary!r}, expected one of {', '.join(get_args(Boundary))}")
        if boundary == "cantilever":
            return cls(start="clamped")
        if boundary == "simply_supported":
            return cls(start="simply_supported", end="simply_supported")
        return cls()


@dataclass(frozen=True)
class PointMass:
    """A mass in kg at (x, y) in m, with a rotary inertia in kg·m² about x and y: an accelerometer, say."""

    x: float
    y: float
    mass: float
    rotary_inertia: float = 0.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.mass) and self.mass >= 0):
            raise InputError("point_mass.mass", f"is {self.mass}, expected a mass in kg that is not negative")
        if not (np.isfinite(self.rotary_inertia) and self.rotary_inertia >= 0):
            raise InputError("point_mass.rotary_inertia", f"is {self.rotary_inertia}, expected kg·m², not negative")
        if not (np.isfinite(self.x) and np.isfinite(self.y)):
            raise InputError("point_mass", f"a mass of {self.mass:g} kg has no place; expected finite x and y in m")


@dataclass(frozen=True)
class AffineMatrix:
    """Σ_k c_k A_k, every symmetric A_k on one compressed-column sparsity pattern.

    Attributes:
        indptr, indices: the pattern, as in `scipy.sparse.csc_array`.
        terms: (k, nnz) values of each A_k.
        names: the k coefficients' names.
    """

    indptr: IntArray
    indices: IntArray
    terms: FloatArray
    names: tuple[str, ...]

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

    def quadratic_forms(self, shapes: FloatArray) -> FloatArray:
        """(k, n) forms φ_iᵀ A_k φ_i of the columns of the (size, n) shapes."""
        return np.array([np.einsum("di,di->i", shapes, self.term(k) @ shapes) for k in range(len(self.names))])

    def _matrix(self, data: FloatArray) -> sparse.csc_array:
        return sparse.csc_array((data, self.indices, self.indptr), shape=(self.size, self.size))


@dataclass(frozen=True)
class PlateModel:
    """An affine finite element model of a rectangular specimen, bending only.

    Attributes:
        mesh: the mesh.
        stiffness: K(c) over the free dofs, c as `stiffness_coefficients` makes it.
        mass: M(m) over the free dofs, m as `mass_coefficients` makes it.
        free_dofs: numbers of the free dofs among all 3·nodes.
        rigid_modes: (dofs, r) exact zero-energy motions of the supported body, r = 3 for a free one.
    """

    mesh: RectangleMesh
    stiffness: AffineMatrix
    mass: AffineMatrix
    free_dofs: IntArray
    rigid_modes: FloatArray

    def deflection(self, points: FloatArray) -> sparse.csr_array:
        """(p, dofs) matrix that interpolates w at (p, 2) points with the element's shape functions.

        Raises:
            InputError: a point lies off the specimen.
        """
        return sparse.csr_array(_deflection(self.mesh, points)[:, self.free_dofs])


def stiffness_coefficients(section: Section) -> FloatArray:
    """(9,) coefficients of `PlateModel.stiffness`: D11 D12 D22 D66 D16 D26 S55 S44 S45.

    Raises:
        InputError: the laminate couples bending and membrane forces, which a bending model cannot represent.
    """
    if section.is_coupled:
        raise InputError(
            "laminate", "couples bending and membrane forces (B ≠ 0); this model is for symmetric laminates"
        )
    D, S = section.D, section.S
    return np.array([D[0, 0], D[0, 1], D[1, 1], D[2, 2], D[0, 2], D[1, 2], S[0, 0], S[1, 1], S[0, 1]])


def mass_coefficients(section: Section) -> FloatArray:
    """(3,) coefficients of `PlateModel.mass`: I0, I2, and 1 for the point masses."""
    return np.array([section.inertia[0], section.inertia[2], 1.0])


def plate(mesh: RectangleMesh, supports: Supports, masses: Sequence[PointMass] = ()) -> PlateModel:
    """Assemble the affine model of a rectangular specimen.

    Raises:
        InputError: a point mass lies off the specimen.
    """
    coordinates = mesh.nodes[mesh.elements]
    dofs = (shell8.DOFS_PER_NODE * mesh.elements[:, :, None] + np.arange(shell8.DOFS_PER_NODE)).reshape(-1, 24)
    free = _free_dofs(mesh, supports)
    stiffness_terms = shell8.stiffness_terms(coordinates)
    mass_terms = shell8.mass_terms(coordinates)
    pattern = _Pattern.of(dofs, free, shell8.DOFS_PER_NODE * len(mesh.nodes))
    point_term = pattern.gather(_point_mass_matrix(mesh, masses)[free][:, free])
    return PlateModel(
        mesh=mesh,
        stiffness=pattern.affine(stiffness_terms, shell8.TERMS),
        mass=pattern.affine(mass_terms, shell8.MASS_TERMS, extra={"point_masses": point_term}),
        free_dofs=free,
        rigid_modes=_rigid_modes(mesh, free),
    )


@dataclass(frozen=True)
class _Pattern:
    """The sparsity pattern of the free dofs, and where in it each entry of each element matrix lands."""

    indptr: IntArray
    indices: IntArray
    slots: IntArray
    kept: BoolArray

    @classmethod
    def of(cls, dofs: IntArray, free: IntArray, total: int) -> _Pattern:
        number = np.full(total, -1)
        number[free] = np.arange(free.size)
        rows = np.repeat(number[dofs], dofs.shape[1], axis=1).ravel()
        columns = np.tile(number[dofs], dofs.shape[1]).ravel()
        kept = (rows >= 0) & (columns >= 0)
        keys, slots = np.unique(columns[kept] * free.size + rows[kept], return_inverse=True)
        indptr = np.searchsorted(keys, np.arange(free.size + 1) * free.size)
        return cls(indptr, keys % free.size, slots, kept)

    def affine(
        self, terms: FloatArray, names: tuple[str, ...], extra: dict[str, FloatArray] | None = None
    ) -> AffineMatrix:
        data = [np.bincount(self.slots, term.ravel()[self.kept], minlength=self.indices.size) for term in terms]
        extra = extra or {}
        return AffineMatrix(self.indptr, self.indices, np.array([*data, *extra.values()]), (*names, *extra))

    def gather(self, matrix: sparse.csc_array) -> FloatArray:
        """Values of a sparse matrix, whose entries all lie in the pattern, at the pattern's places."""
        size = self.indptr.size - 1
        entries = matrix.tocoo()
        keys = np.repeat(np.arange(size), np.diff(self.indptr)) * size + self.indices
        data = np.zeros(self.indices.size)
        np.add.at(data, np.searchsorted(keys, entries.col.astype(np.int64) * size + entries.row), entries.data)
        return data


def _free_dofs(mesh: RectangleMesh, supports: Supports) -> IntArray:
    held = np.zeros((len(mesh.nodes), shell8.DOFS_PER_NODE), dtype=bool)
    w, turn_x, turn_y = 0, 1, 2
    edges = (
        (supports.start, mesh.nodes_at_x(0), turn_x),
        (supports.end, mesh.nodes_at_x(mesh.length), turn_x),
        (supports.lower, mesh.nodes_at_y(-mesh.width / 2), turn_y),
        (supports.upper, mesh.nodes_at_y(mesh.width / 2), turn_y),
    )
    for support, nodes, tangential in edges:
        if support == "clamped":
            held[nodes] = True
        elif support == "simply_supported":
            held[nodes, w] = True
            held[nodes, tangential] = True
    return np.flatnonzero(~held.ravel())


def _deflection(mesh: RectangleMesh, points: FloatArray) -> sparse.csr_array:
    element, natural = mesh.locate(points)
    N = shell8.shape_functions(natural)
    rows = np.repeat(np.arange(len(points)), 8)
    columns = shell8.DOFS_PER_NODE * mesh.elements[element].ravel()
    return sparse.csr_array((N.ravel(), (rows, columns)), shape=(len(points), shell8.DOFS_PER_NODE * len(mesh.nodes)))


def _point_mass_matrix(mesh: RectangleMesh, masses: Sequence[PointMass]) -> sparse.csc_array:
    """Σ m NᵀN over the masses, and their rotary inertia on the interpolated rotations."""
    size = shell8.DOFS_PER_NODE * len(mesh.nodes)
    if not masses:
        return sparse.csc_array((size, size))
    w = _deflection(mesh, np.array([[mass.x, mass.y] for mass in masses])).tocoo()
    total = sparse.csc_array((size, size))
    for dof, inertia in ((0, "mass"), (1, "rotary_inertia"), (2, "rotary_inertia")):
        N = sparse.csr_array((w.data, (w.row, w.col + dof)), shape=w.shape)
        total = total + N.T @ sparse.diags_array([getattr(mass, inertia) for mass in masses]) @ N
    return sparse.csc_array(total)


def _rigid_modes(mesh: RectangleMesh, free: IntArray) -> FloatArray:
    """Rigid motions (heave, roll about x, pitch about y) that the supports leave; others would stretch a support."""
    x, y = mesh.nodes.T
    one, none = np.ones_like(x), np.zeros_like(x)
    heave, roll, pitch = (one, none, none), (y, one, none), (-(x - mesh.length / 2), none, one)
    motions = np.column_stack([np.column_stack(motion).ravel() for motion in (heave, roll, pitch)])
    held = np.setdiff1d(np.arange(len(motions)), free)
    if held.size == 0:
        return motions
    # A combination that does not move the held dofs is a rigid motion of the supported body.
    _, singular, directions = np.linalg.svd(motions[held], full_matrices=True)
    rank = int(np.sum(singular > 1e-9 * max(1.0, singular[0])))
    remaining: FloatArray = motions[free] @ directions[rank:].T
    return remaining
