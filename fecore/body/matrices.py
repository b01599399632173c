"""A body that is matrices of any solver: K = K_0 + Σ c_k K_k, M = M_0 + Σ m_j M_j, whose constants
are the factors, 1 as it comes.

There are no elements: a measured point belongs to the nearest node, and moves as that does. (With a
rigid link to the node it would follow turns about the normal, which solvers' shells resist by a
penalty alone.)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
import scipy

from fecore.arrays import ROUND_OFF, BoolArray, FloatArray, IntArray
from fecore.body.affine import AffineMatrix, Pattern
from fecore.body.carried import mass_parts, spring_parts
from fecore.body.constants import Body, Parameter
from fecore.body.joints import Joints
from fecore.body.locate import TOLERANCE, Places, Surfaces
from fecore.body.mesh import CellBlock, Mesh
from fecore.body.model import Model, assemble
from fecore.body.supports import Mass, NodeSpring, PointMass, Spring, rigid_motions
from fecore.errors import InputError
from fecore.quantities import kind_of

UNSCALED = "0"
"""Name of the matrix that no factor scales."""

_STIFF = 1e-8  # of the forces that cancel: below it a motion is one that nothing resists
_TILTED = 1e-6  # share of a shift that is none of the motions that nothing resists
_DOFS = 6  # of a node at most


@dataclass(frozen=True)
class SumOfMatrices(AffineMatrix):
    """A(c) = Σ c_k A_k of sparse matrices, each positive semidefinite but for the whole's A_0."""

    matrices: tuple[scipy.sparse.csc_array, ...]

    def at(self, coefficients: FloatArray) -> scipy.sparse.csc_array:
        """The matrix at (k,) coefficients."""
        total = scipy.sparse.csc_array((self.size, self.size))
        for coefficient, matrix in zip(coefficients, self.matrices, strict=True):
            total = total + coefficient * matrix
        total.sort_indices()
        return total

    def project(self, vectors: FloatArray, right: slice) -> FloatArray:
        """(k, l, r) leftᵀ A_k right of (size, l) vectors and r columns of them."""
        return np.array([vectors.T @ (matrix @ vectors[:, right]) for matrix in self.matrices])


@dataclass(frozen=True)
class Nodes(Surfaces):
    """Nodes without elements between them."""

    def nearest(self, points: FloatArray) -> Places:
        """The nearest node of each point."""
        _, node = scipy.spatial.cKDTree(self.mesh.nodes).query(points)
        foot, count = self.mesh.nodes[node], len(points)
        arm = points - foot
        distance = np.linalg.norm(arm, axis=1)
        return Places(
            nodes=node[:, None].astype(np.int64),
            functions=np.ones((count, 1)),
            shift=np.zeros((count, 1, 3)),
            foot=foot,
            arm=np.zeros_like(arm),
            distance=distance,
            thickness=np.zeros(count),
            offset=np.zeros(count),
            block=np.zeros(count, dtype=np.int64),
            normal=arm / np.maximum(distance, 1e-300)[:, None],
            on_beam=np.ones(count, dtype=bool),
        )


@dataclass(frozen=True)
class MatrixBody(Body):
    """Matrices with a table of nodes."""

    nodes: FloatArray  # (n, 3) m
    dofs: IntArray  # (d, 2) row of the node, and dof 0 … 5, of each row of the matrices
    # stiffness, mass: (d, d) symmetric, SI, by the factor's name; `UNSCALED` is what no factor
    # scales
    stiffness: Mapping[str, scipy.sparse.csc_array]
    mass: Mapping[str, scipy.sparse.csc_array]
    springs: tuple[Spring | NodeSpring, ...] = ()  # elastic supports
    masses: tuple[Mass, ...] = ()  # what it carries

    @cached_property
    def nominal(self) -> dict[str, float]:
        """The factors, `skin.factor` of a stiffness and `skin.mass_factor` of a mass."""
        factors = {f"{name}.factor": 1.0 for name in self.stiffness if name != UNSCALED}
        return factors | {f"{name}.mass_factor": 1.0 for name in self.mass if name != UNSCALED}

    @property
    def has_elements(self) -> bool:
        """None."""
        return False

    def carrying(self, masses: Sequence[PointMass]) -> Self:
        """The body with more masses."""
        return replace(self, masses=(*self.masses, *(mass.on_surface() for mass in masses)))

    def default_parameters(self) -> tuple[Parameter, ...]:
        """The factors of its stiffness."""
        return tuple(Parameter(name) for name in self.nominal if kind_of(name) == "factor")

    @property
    def model_error(self) -> float:
        """0: what a solver's model is wrong by is not known here."""
        return 0.0

    def stiffness_coefficients(self, constants: FloatArray) -> FloatArray:
        """(k, …) 1 of K_0, and the factors."""
        return self._coefficients(self.stiffness, "factor", constants)

    def mass_coefficients(self, constants: FloatArray) -> FloatArray:
        """(j, …) 1 of M_0 and of known masses, and the factors."""
        rows = self._coefficients(self.mass, "mass_factor", constants)
        return np.concatenate([rows, np.ones((len(self._carried[1].names), *rows.shape[1:]))])

    def _coefficients(
        self, matrices: Mapping[str, object], kind: str, constants: FloatArray
    ) -> FloatArray:
        of, one = dict(zip(self.nominal, constants, strict=True)), np.ones(constants.shape[1:])
        return np.stack([one if name == UNSCALED else of[f"{name}.{kind}"] for name in matrices])

    def are_physical(self, constants: FloatArray) -> BoolArray:
        """(…) whether all factors are positive."""
        return np.asarray(np.all(constants > 0, axis=0))

    @cached_property
    def model(self) -> Model:
        """The matrices, with springs and masses.

        Raises:
            InputError: a spring or mass is at no node, or acts on nothing that moves.
        """
        stiffness, mass = (
            self._sum(own, carried)
            for own, carried in zip((self.stiffness, self.mass), self._carried, strict=True)
        )
        whole = np.concatenate(
            [np.ones(len(self.stiffness)), [spring.stiffness for spring in self.springs]]
        )
        rigid = _unresisted(stiffness.at(whole), self.shown_motions)
        surfaces = self.surfaces
        return Model(
            surfaces.mesh,
            Joints(surfaces.mesh, (), {}),
            surfaces,
            tuple(self._used),
            stiffness=stiffness,
            mass=mass,
            rigid_modes=rigid,
        )

    @cached_property
    def shown_motions(self) -> FloatArray:
        """(d, r) orthonormal rigid motions that the rows show, as if nothing held the body: of
        displacements along z alone a shift and two turns, fewer on a line.
        """
        motions = rigid_motions(self.nodes)
        reach = float(np.abs(motions[:, :3, 3:]).max(initial=0.0)) or 1.0
        motions[..., 3:] /= reach  # so that turns are no smaller than shifts
        shown, singular, _ = np.linalg.svd(motions[:, self._used][self._free], full_matrices=False)
        return np.asarray(shown[:, singular > ROUND_OFF * singular.max(initial=0.0)])

    @property
    def is_free(self) -> bool:
        """Whether the matrices resist no motion of the whole that the rows show; of one kind of dof
        alone, no shift or turn of all rows, as chains resist their tilt.
        """
        rigid = self.model.rigid_modes
        if len(self._used) > 1:
            return bool(rigid.shape[1] == self.shown_motions.shape[1])
        along = np.ones(len(self.dofs)) / np.sqrt(len(self.dofs))
        return bool(np.linalg.norm(along - rigid @ (rigid.T @ along)) < _TILTED)

    @property
    def _used(self) -> list[int]:
        """Dofs that any node has."""
        return [int(dof) for dof in np.unique(self.dofs[:, 1])]

    @cached_property
    def _free(self) -> BoolArray:
        free = np.zeros((len(self.nodes), _DOFS), dtype=bool)
        free[tuple(self.dofs.T)] = True
        return free[:, self._used]

    @cached_property
    def surfaces(self) -> Nodes:
        """The nodes, on which points are found."""
        every = np.arange(len(self.nodes))[:, None]
        mesh = Mesh(self.nodes, (CellBlock("point", every, "nodes"),))
        apart = scipy.spatial.cKDTree(self.nodes).query(self.nodes, k=min(2, len(self.nodes)))[0]
        reach = max(TOLERANCE, float(np.median(apart[..., -1])) / 2)
        return Nodes(mesh, (np.zeros((len(self.nodes), 1, 3)),), (0.0,), (0.0,), (reach,) * 3)

    @cached_property
    def _carried(self) -> tuple[AffineMatrix, AffineMatrix]:
        """Springs and masses at the nodes nearest to them."""
        surfaces, nothing = self.surfaces, AffineMatrix(self._pattern, (), (), (), ())
        if not self.springs and not self.masses:
            return nothing, nothing
        springs, masses = (
            spring_parts(surfaces.mesh, surfaces, self.springs),
            mass_parts(surfaces, self.masses),
        )
        K, M = assemble(springs, masses, self._free, tuple(self._used))
        for spring in self.springs:
            if spring.name not in K.names or not K.term(K.names.index(spring.name)).data.any():
                raise InputError(
                    "spring", f"{spring.name} acts on nothing that moves in this model"
                )
        return K, M

    @cached_property
    def _pattern(self) -> Pattern:
        """Numbers of the dofs, node by node; where entries lie is each matrix's own."""
        free = self._free
        none, numbers = np.zeros(0, dtype=np.int32), np.cumsum(free).reshape(free.shape) - 1
        return Pattern(
            np.zeros(len(self.dofs) + 1, dtype=np.int32), none, free, numbers, none, none
        )

    def _sum(
        self, own: Mapping[str, scipy.sparse.csc_array], carried: AffineMatrix
    ) -> SumOfMatrices:
        """Matrices in the order of nodes and dofs, and what is carried after them."""
        order = np.lexsort((self.dofs[:, 1], self.dofs[:, 0]))
        matrices = [scipy.sparse.csc_array(matrix[order][:, order]) for matrix in own.values()]
        matrices += [carried.term(k) for k in range(len(carried.names))]
        names = (*own, *carried.names)
        blocks = tuple(np.array([[k]]) for k in range(len(names)))
        return SumOfMatrices(self._pattern, (), (), names, blocks, tuple(matrices))


def _unresisted(stiffness: scipy.sparse.csc_array, motions: FloatArray) -> FloatArray:
    """(d, r) combinations of (d, m) rigid motions that the matrix answers with no force, but for
    rounding.
    """
    scale = (abs(stiffness) @ np.abs(motions)).max(axis=1, initial=0.0)
    forces = (stiffness @ motions) / np.maximum(scale, 1e-300)[:, None]
    _, singular, turn = np.linalg.svd(np.linalg.qr(forces, mode="r"), full_matrices=True)
    return np.asarray(motions @ turn[singular <= _STIFF * np.sqrt(len(forces))].T)
