"""A mesh with sections, joints, supports, springs and masses as an affine finite element model.

    K(c) = Σ_k c_k K_k,     M(m) = Σ_j m_j M_j

The coefficients are the sections', set after set, then the joints', then the springs' stiffnesses;
those of the mass likewise, with 1 for masses that are known (`fecore.body.affine`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy

from fecore.arrays import BoolArray, FloatArray, IntArray
from fecore.body.affine import AffineMatrix, Group, Pattern
from fecore.body.joints import Joints
from fecore.body.locate import Places, Surfaces
from fecore.body.mesh import Mesh
from fecore.body.operators import Operators, on_independent_nodes
from fecore.body.supports import DISPLACEMENTS, Link, rigid_motions
from fecore.errors import InputError, OffSpecimenError

_ALONG = 1e-6  # component of a unit direction that is round-off


@dataclass(frozen=True)
class Part:
    """Elements whose coefficients are known by name; parts that share a name share the
    coefficient.
    """

    operators: Operators  # their rows
    terms: FloatArray  # (k, r, r) C_k
    names: tuple[str, ...]  # of the k coefficients
    blocks: tuple[IntArray, ...]  # index matrices into the k


@dataclass(frozen=True)
class Model:
    """An affine finite element model."""

    mesh: Mesh
    joints: Joints  # the joint model, without junctions where they are left out
    surfaces: Surfaces  # the shells as they lie in space, on which points are found
    dofs: tuple[int, ...]  # numbers of the dofs of a node among u, v, w, θx, θy, θz
    stiffness: AffineMatrix  # K(c) over the free dofs
    mass: AffineMatrix  # M(m) over the free dofs
    rigid_modes: FloatArray  # (dofs, r) exact zero-energy motions of the supported body
    links: tuple[Link, ...] = ()  # nodes that others lead, or that are held along axes of their own

    @property
    def free(self) -> BoolArray:
        """(nodes, dofs of a node) which dofs are free."""
        return self.stiffness.pattern.free

    @cached_property
    def motions(self) -> FloatArray:
        """(dofs, 6) rigid motions, as if nothing held the body: shifts along x, y, z, turns about
        axes through the nodes' centre.
        """
        return np.asarray(rigid_motions(self.mesh.nodes, self.links)[:, list(self.dofs)][self.free])

    @property
    def is_one_body(self) -> bool:
        """Whether the equations of its links have all rigid motions."""
        motions = rigid_motions(self.mesh.nodes, self.links)
        return not any(
            motions[link.node][list(link.dofs)].any()
            for link in self.links
            if link.equations is not None
        )

    @cached_property
    def unfolded(self) -> scipy.sparse.csr_array:
        """(6 × nodes, dofs) motion of every node, dependent ones too, by the free dofs."""
        nodes, column = np.nonzero(self.free)
        rows, values = 6 * nodes + np.array(self.dofs)[column], np.ones(nodes.size)
        count, size = 6 * len(self.free), self.stiffness.size
        whole = scipy.sparse.csr_array((values, (rows, np.arange(size))), shape=(count, size))
        links = {link.node: link for link in self.links}
        if not links:
            return whole
        follows = scipy.sparse.lil_array((count, count))
        follows.setdiag(
            np.repeat(~np.isin(np.arange(len(self.free)), list(links)), 6).astype(float)
        )
        for node in links:
            independent, moved = on_independent_nodes(
                [node], np.eye(6)[None, :, None], links, self.mesh.nodes
            )
            for place, other in enumerate(independent):
                follows[6 * node : 6 * node + 6, 6 * other : 6 * other + 6] = moved[0, :, place]
        return scipy.sparse.csr_array(follows @ whole)

    def everywhere(self, shapes: FloatArray) -> FloatArray:
        """(nodes, 6, n) motion of every node in (dofs, n) shapes; 0 where it is held."""
        return np.asarray((self.unfolded @ shapes).reshape(len(self.free), 6, -1))

    def at_nodes(self, shapes: FloatArray) -> FloatArray:
        """(n, nodes, 3) displacement along x, y and z of the nodes in (dofs, n) shapes; 0 where a
        node is held.
        """
        return np.ascontiguousarray(self.everywhere(shapes)[:, :3].transpose(2, 0, 1))

    def observe(self, points: FloatArray, directions: FloatArray) -> scipy.sparse.csr_array:
        """(p, dofs) displacement at (p, 3) points along (p, 3) unit directions: (u₀ + θ × (p − x₀))
        · n.

        A point belongs to the nearest point x₀ of the surface, whose element interpolates u₀ and θ.

        Args:
            points: m.
            directions: unit vectors.

        Raises:
            OffSpecimenError: a point lies further from the surface than half the wall and the reach
                of the body.
            InputError: the model has no motion along a direction.
        """
        blind = np.flatnonzero(~self.can_move_along(directions))
        if blind.size:
            names = ", ".join(DISPLACEMENTS[dof] for dof in self.dofs)
            raise InputError(
                f"directions[{blind[0]}]",
                f"is {directions[blind[0]]}; this model has {names} alone",
            )
        return self._rows(self.surfaces.find(points), directions)

    def observe_nodes(self, numbers: IntArray, axis: int) -> scipy.sparse.csr_array:
        """(p, dofs) displacement of (p,) nodes along an axis from 0."""
        return self.unfolded[6 * numbers + axis]

    def can_move_along(self, directions: FloatArray) -> BoolArray:
        """(p,) whether (p, 3) unit directions lie in those in which the model's nodes move."""
        missing = [axis for axis in range(3) if axis not in self.dofs]
        return np.asarray(np.abs(directions[:, missing]).max(axis=1, initial=0.0) < _ALONG)

    def displacement(self, points: FloatArray) -> scipy.sparse.csr_array:
        """(3p, dofs) displacement along x, y and z of the middle surface nearest to (p, 3) points,
        one point after the other.

        Raises:
            OffSpecimenError: as of `observe`.
        """
        places = self.surfaces.find(np.repeat(points, 3, axis=0))
        return self._rows(
            replace(places, arm=np.zeros_like(places.arm)), np.tile(np.eye(3), (len(points), 1))
        )

    def slopes(self, points: FloatArray, directions: FloatArray) -> scipy.sparse.csr_array:
        """(3p, dofs) change of `observe` per metre that a point moves along x, y and z, as the
        surface turns there: n × θ.

        Raises:
            OffSpecimenError: as of `observe`.
        """
        places = self.surfaces.find(points)
        across = np.cross(directions[:, None], np.eye(3))  # (p, 3, 3): (n × θ)_i = -(n × e_i) · θ
        rows = -np.einsum("pik,pknd->pind", across, places.turns())
        return self._matrix(np.repeat(places.nodes, 3, axis=0), rows.reshape(-1, *rows.shape[2:]))

    def _rows(self, places: Places, directions: FloatArray) -> scipy.sparse.csr_array:
        """(p, dofs) displacement of places that have been found along (p, 3) directions."""
        return self._matrix(places.nodes, places.rows(directions))

    def _matrix(self, nodes: IntArray, rows: FloatArray) -> scipy.sparse.csr_array:
        """(p, dofs) of (p, n, 6) coefficients of the motions of (p, n) nodes."""
        columns = 6 * nodes[..., None] + np.arange(6)
        points = np.broadcast_to(np.arange(len(rows))[:, None, None], rows.shape)
        kept = rows != 0
        shape = len(rows), 6 * len(self.free)
        return (
            scipy.sparse.csr_array((rows[kept], (points[kept], columns[kept])), shape=shape)
            @ self.unfolded
        )


def observed_at(
    model: Model, labels: Sequence[int], places: FloatArray, directions: FloatArray
) -> scipy.sparse.csr_array:
    """`Model.observe` at (p, 3) places with labels, which an error names.

    Raises:
        InputError: a place lies off the specimen.
    """
    try:
        return model.observe(places, directions)
    except OffSpecimenError as error:
        raise InputError(
            "grid_points",
            f"point {labels[error.index]} at {error.message}; check the structure's dimensions and"
            " the points' coordinates",
        ) from error


def assemble(
    stiffness: Sequence[Part], mass: Sequence[Part], free: BoolArray, dofs: tuple[int, ...]
) -> tuple[AffineMatrix, AffineMatrix]:
    """K(c) and M(m) of parts, on one pattern over the free dofs of the (nodes, dofs of a node)."""
    different = {id(part.operators.nodes): part.operators.nodes for part in (*stiffness, *mass)}
    pattern, slots_of = Pattern.of(list(different.values()), free)
    slots = dict(zip(different, slots_of, strict=True))
    K, M = (_matrix(parts, pattern, slots, dofs) for parts in (stiffness, mass))
    return K, M


def idle(stiffness: AffineMatrix, mass: AffineMatrix) -> BoolArray:
    """(dofs,) whether nothing resists a dof and nothing weighs in it, as a turn of a mass that
    hangs on springs alone: no mode has it.
    """
    free = stiffness.pattern.free
    acts = np.zeros_like(free)
    for group in (*stiffness.groups, *mass.groups):
        rows = np.abs(group.operators[:, :, group.terms.any(axis=(0, 1))]).max(
            axis=(1, 2), initial=0.0
        )
        own = (rows > _ALONG * rows.max(initial=0.0))[group.which].reshape(*group.nodes.shape, -1)
        for node, dof in np.ndindex(own.shape[1:]):
            acts[group.nodes[own[:, node, dof], node], dof] = True
    return np.asarray(~acts[free])


def _matrix(
    parts: Sequence[Part], pattern: Pattern, slots: dict[int, IntArray], dofs: tuple[int, ...]
) -> AffineMatrix:
    number: dict[str, int] = {}
    groups, places, blocks = [], [], {}
    for part in parts:
        rows = part.operators.rows[..., list(dofs)]
        used = rows.any(axis=(0, 1, 3, 4))
        terms = part.terms[:, used][:, :, used]
        acts: BoolArray = np.asarray(terms.any(axis=(1, 2)))
        if not acts.any():  # what moves with dofs that this model has not
            continue
        for name in np.array(part.names)[acts].tolist():
            number.setdefault(name, len(number))
        coefficients = np.array([number.get(name, -1) for name in part.names])
        for block in part.blocks:
            index = coefficients[block[np.ix_(acts[block].any(axis=1), acts[block].any(axis=0))]]
            if index.size:
                blocks[index.tobytes()] = index
        operators = rows[:, :, used].reshape(*rows.shape[:2], int(used.sum()), -1)
        groups.append(
            Group(
                part.operators.nodes,
                operators,
                part.operators.which,
                terms[acts],
                coefficients[acts],
            )
        )
        places.append(slots[id(part.operators.nodes)])
    return AffineMatrix(
        pattern, tuple(groups), tuple(places), tuple(number), tuple(blocks.values())
    )


def unresisted(
    motions: FloatArray, used: IntArray, free: BoolArray, stiffness: AffineMatrix, first: int
) -> FloatArray:
    """(dofs, r) combinations of rigid motions that move no held dof and stretch no spring.

    Args:
        motions: (nodes, d, 6) of all nodes.
        used: numbers of the nodes that elements use.
        free: (nodes, d) which dofs are free.
        stiffness: K; its coefficients from `first` on are springs.
        first: as said.
    """
    motions = motions[..., motions[free].any(axis=0)]  # of fewer dofs than six a node some are none
    everywhere = np.where(free[..., None], motions, 0.0)
    springs = [group for group in stiffness.groups if np.all(group.coefficients >= first)]
    stretched = [group.strains(everywhere).reshape(-1, motions.shape[-1]) for group in springs]
    resisted = np.vstack([motions[used][~free[used]], *stretched])
    moving = motions[free]
    if not resisted.any():
        return np.asarray(moving)
    _, singular, directions = np.linalg.svd(np.linalg.qr(resisted, mode="r"), full_matrices=True)
    rank = int(np.sum(singular > 1e-9 * singular[0]))
    return np.asarray(moving @ directions[rank:].T)
