"""Geometry, supports, springs and masses of a plate to an affine finite element system.

The stiffness is linear in the section's coefficients and the springs, the mass in the section's inertias,

    K(c) = Σ_k c_k K_k,     M(m) = Σ_j m_j M_j,

so the K_k and M_j are assembled once; see `fecore.body.affine`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
import scipy

from fecore.arrays import BoolArray, FloatArray, IntArray
from fecore.body.affine import AffineMatrix, Pattern
from fecore.body.elements import shell8
from fecore.body.elements.shell8 import Shell8
from fecore.body.laminate import Section
from fecore.body.mesh import RectangleMesh
from fecore.body.profile import Profile
from fecore.body.supports import Boundary, PointMass, Spring, Supports
from fecore.errors import InputError, OffSpecimenError

__all__ = ["Boundary", "ModeKind", "Model", "PlateModel", "PointMass", "Spring", "Supports", "plate"]

ModeKind = Literal["rigid", "bending", "torsion", "in-plane"]

_DOF_OF_DIRECTION = {1: "u", 2: "v", 3: "w", 4: "rx", 5: "ry"}


class Model(Protocol):
    """What every finite element model of a specimen offers; shapes and matrices are over its free dofs."""

    @property
    def stiffness(self) -> AffineMatrix:
        """K(c): section coefficients first, then the springs by name."""
        ...

    @property
    def mass(self) -> AffineMatrix:
        """M(m): section inertias first, then 1 for the point masses."""
        ...

    @property
    def rigid_modes(self) -> FloatArray:
        """(dofs, r) exact zero-energy motions of the supported body."""
        ...

    @property
    def start_motions(self) -> FloatArray:
        """(dofs, 3) rigid heave, roll about x and pitch about the edge x = 0, as if nothing held the body."""
        ...

    @property
    def has_membrane(self) -> bool:
        """Whether there are in-plane modes among the model's."""
        ...

    def observation(self, points: FloatArray, directions: IntArray) -> scipy.sparse.csr_array:
        """(p, dofs) displacement at (p, 2) points along (p,) directions 1 … 6."""
        ...

    def deflection(self, points: FloatArray) -> scipy.sparse.csr_array:
        """(p, dofs) deflection w at (p, 2) points."""
        ...

    def kinds(self, shapes: FloatArray) -> tuple[ModeKind, ...]:
        """What kind of motion each column of (dofs, n) elastic shapes is."""
        ...


@dataclass(frozen=True)
class PlateModel:
    """An affine finite element model of a rectangular specimen by `Shell8`.

    Attributes:
        mesh: the mesh.
        element: with membrane dofs or without.
        stiffness: K(c) over the free dofs, c as `stiffness_coefficients` makes it.
        mass: M(m) over the free dofs, m as `mass_coefficients` makes it.
        springs: the springs, whose stiffnesses are the last coefficients of K.
        free_dofs: numbers of the free dofs among all.
        rigid_modes: (dofs, r) exact zero-energy motions of the supported body.
    """

    mesh: RectangleMesh
    element: Shell8
    stiffness: AffineMatrix
    mass: AffineMatrix
    springs: tuple[Spring, ...]
    free_dofs: IntArray
    rigid_modes: FloatArray

    @property
    def has_membrane(self) -> bool:
        """Whether there are in-plane modes among the model's."""
        return self.element.membrane

    @property
    def start_motions(self) -> FloatArray:
        """(dofs, 3) rigid heave, roll about x and pitch about the edge x = 0, as if nothing held the body."""
        heave, roll, pitch = _motions(self.mesh, self.element)[self.free_dofs, -3:].T
        return np.column_stack([heave, roll, pitch - self.mesh.length / 2 * heave])

    def stiffness_coefficients(self, section: Section) -> FloatArray:
        """(k,) coefficients of `stiffness` by name: D11 D12 D22 D66 D16 D26 S55 S44 S45, after A and B if there are
        membrane dofs, and the springs' stiffnesses.

        Raises:
            InputError: the laminate couples bending and membrane forces and the model has no membrane dofs.
        """
        if section.is_coupled and not self.element.membrane:
            raise InputError("laminate", "couples bending and membrane forces (B ≠ 0); the model needs membrane dofs")
        values = section.coefficients()
        return np.array([*(values[name] for name in self.element.terms), *(s.stiffness for s in self.springs)])

    def mass_coefficients(self, section: Section) -> FloatArray:
        """(j,) coefficients of `mass`: the section's inertias, and 1 for the point masses."""
        inertia = dict(zip(("I0", "I1", "I2"), section.inertia, strict=True))
        return np.array([*(inertia[name[:2]] for name in self.element.mass_terms_names), 1.0])

    def observation(self, points: FloatArray, directions: IntArray) -> scipy.sparse.csr_array:
        """(p, dofs) displacement or rotation of the mid-surface at (p, 2) points along (p,) directions 1 … 6.

        It interpolates with the element's own shape functions, never from the nearest node.

        Raises:
            InputError: a point lies off the specimen, or the model does not have a direction.
        """
        names = self.element.displacements
        for index, direction in enumerate(directions):
            if _DOF_OF_DIRECTION.get(int(direction)) not in names:
                raise InputError(f"directions[{index}]", f"is {direction}; this model has {', '.join(names)} alone")
        dof = np.array([names.index(_DOF_OF_DIRECTION[int(direction)]) for direction in directions], dtype=np.int64)
        return scipy.sparse.csr_array(
            scipy.sparse.csc_array(_interpolation(self.mesh, self.element, points, dof))[:, self.free_dofs]
        )

    def deflection(self, points: FloatArray) -> scipy.sparse.csr_array:
        """(p, dofs) matrix that interpolates w at (p, 2) points.

        Raises:
            InputError: a point lies off the specimen.
        """
        return self.observation(points, np.full(len(points), 3))

    def kinds(self, shapes: FloatArray) -> tuple[ModeKind, ...]:
        """Kind of each (dofs, n) elastic shape by the larger share of its motion over the nodes: in-plane (u, v)
        against w, and of w the part odd in y (torsion) against the even part (bending).
        """
        names = self.element.displacements
        everywhere = np.zeros((len(self.mesh.nodes) * len(names), shapes.shape[1]))
        everywhere[self.free_dofs] = shapes
        motion = everywhere.reshape(len(self.mesh.nodes), len(names), -1)
        w = motion[:, names.index("w")]
        mirrored = w[_mirror(self.mesh)]
        even, odd = np.sum((w + mirrored) ** 2, axis=0) / 4, np.sum((w - mirrored) ** 2, axis=0) / 4
        flat = np.zeros_like(even)
        if self.element.membrane:
            flat = np.sum(motion[:, : names.index("w")] ** 2, axis=(0, 1))
        return tuple(
            "in-plane" if p > e + o else "torsion" if o > e else "bending"
            for p, e, o in zip(flat, even, odd, strict=True)
        )


def plate(
    mesh: RectangleMesh,
    supports: Supports,
    masses: Sequence[PointMass] = (),
    springs: Sequence[Spring] = (),
    *,
    membrane: bool = False,
    profile: Profile | None = None,
    zones: Sequence[float] = (),
) -> PlateModel:
    """Assemble the affine model of a rectangular specimen.

    Args:
        mesh: the mesh.
        supports: held edges.
        masses: point masses.
        springs: elastic supports.
        membrane: give the nodes u and v too, for in-plane modes and for laminates with B ≠ 0.
        profile: steps and tapers of thickness; the section is that where the relative thickness is 1.
        zones: x of the lines between zones whose stiffness has coefficients of its own.

    Raises:
        InputError: a point mass or a spring lies off the specimen, or a spring acts on nothing that can move.
    """
    element = Shell8(membrane)
    coordinates = mesh.nodes[mesh.elements]
    free = _free_dofs(mesh, element, supports)
    pattern = Pattern.of(mesh.elements, len(mesh.nodes), len(element.displacements), free)
    elastic = _spring_matrices(mesh, element, springs, free)
    carried = {"point_masses": _point_mass_matrix(mesh, element, masses)}
    ratio = None if profile is None else profile.ratio
    middle = coordinates[:, :, 0].mean(axis=1)
    zone = np.searchsorted(np.array(zones), middle) if len(zones) else None
    return PlateModel(
        mesh=mesh,
        element=element,
        stiffness=pattern.affine(
            element.stiffness_terms(coordinates, ratio), element.terms, element.blocks, elastic, zone
        ),
        mass=pattern.affine(
            element.mass_terms(coordinates, ratio), element.mass_terms_names, element.mass_blocks, carried
        ),
        springs=tuple(springs),
        free_dofs=free,
        rigid_modes=rigid_motions(_motions(mesh, element), free, list(elastic.values())),
    )


def deflection_at(model: Model, labels: Sequence[int], places: FloatArray) -> scipy.sparse.csr_array:
    """`Model.deflection` at (p, 2) places with labels, which an error names.

    Raises:
        InputError: a place lies off the specimen.
    """
    try:
        return model.deflection(places)
    except OffSpecimenError as error:
        raise InputError(
            "grid_points",
            f"point {labels[error.index]} at {error.message}; check the structure's dimensions and the points' coordinates",
        ) from error


def rigid_motions(motions: FloatArray, free: IntArray, springs: Sequence[scipy.sparse.csc_array]) -> FloatArray:
    """(dofs, r) combinations of rigid motions that move no held dof and stretch no spring, over the free dofs."""
    held = np.ones(len(motions), dtype=bool)
    held[free] = False
    resisted = np.vstack([motions[held], *(spring @ motions for spring in springs)])
    if resisted.shape[0] == 0 or not resisted.any():
        return motions[free]
    # The triangle has the same right singular vectors; the left ones would be as many as the dofs.
    _, singular, directions = np.linalg.svd(np.linalg.qr(resisted, mode="r"), full_matrices=True)
    rank = int(np.sum(singular > 1e-9 * singular[0]))
    remaining: FloatArray = motions[free] @ directions[rank:].T
    return remaining


def _free_dofs(mesh: RectangleMesh, element: Shell8, supports: Supports) -> IntArray:
    names = element.displacements
    held: BoolArray = np.zeros((len(mesh.nodes), len(names)), dtype=bool)
    # A simple support on an edge along y keeps w constant along it, so it holds θx = ∂w/∂y too; and v.
    along_y, along_x = {"w", "rx"}, {"w", "ry"}
    in_plane = {"simply_supported": ("v", "u"), "simply_supported_normal": ("u", "v")}
    edges = (
        (supports.start, mesh.nodes_at_x(0), along_y, 0),
        (supports.end, mesh.nodes_at_x(mesh.length), along_y, 0),
        (supports.lower, mesh.nodes_at_y(-mesh.width / 2), along_x, 1),
        (supports.upper, mesh.nodes_at_y(mesh.width / 2), along_x, 1),
    )
    for support, nodes, bending, side in edges:
        if support != "free":
            stays = set(names) if support == "clamped" else bending | {in_plane[support][side]}
            kept = [i for i, name in enumerate(names) if name in stays]
            held[nodes[:, None], kept] = True
    return np.flatnonzero(~held.ravel())


def _interpolation(mesh: RectangleMesh, element: Shell8, points: FloatArray, dof: IntArray) -> scipy.sparse.csr_array:
    """(p, all dofs) interpolation of a dof at each point."""
    number, natural = mesh.locate(points)
    N = shell8.shape_functions(natural)
    d = len(element.displacements)
    columns = (d * mesh.elements[number] + dof[:, None]).ravel()
    rows = np.repeat(np.arange(len(points)), 8)
    return scipy.sparse.csr_array((N.ravel(), (rows, columns)), shape=(len(points), d * len(mesh.nodes)))


def _point_mass_matrix(mesh: RectangleMesh, element: Shell8, masses: Sequence[PointMass]) -> scipy.sparse.csc_array:
    """Σ m NᵀN over the masses, and their rotary inertia on the interpolated rotations."""
    size = len(element.displacements) * len(mesh.nodes)
    total = scipy.sparse.csc_array((size, size))
    if not masses:
        return total
    places = np.array([[mass.x, mass.y] for mass in masses])
    for dof, name in enumerate(element.displacements):
        inertia = [mass.rotary_inertia if name in ("rx", "ry") else mass.mass for mass in masses]
        N = _interpolation(mesh, element, places, np.full(len(masses), dof))
        total = total + N.T @ scipy.sparse.diags_array(inertia) @ N
    return scipy.sparse.csc_array(total)


def _spring_matrices(
    mesh: RectangleMesh, element: Shell8, springs: Sequence[Spring], free: IntArray
) -> dict[str, scipy.sparse.csc_array]:
    """By name, the stiffness of each spring at unit stiffness: NᵀN at its point, or ∫NᵀN ds along its edge."""
    matrices: dict[str, scipy.sparse.csc_array] = {}
    for spring in springs:
        if spring.name in matrices or spring.name in element.terms:
            raise InputError("springs", f"two are named {spring.name}, or it is the name of a section coefficient")
        name = _DOF_OF_DIRECTION.get(spring.direction)
        if name not in element.displacements:
            raise InputError("spring.direction", f"of {spring.name}: the model has {', '.join(element.displacements)}")
        points, weights = _places(mesh, spring)
        dof = np.full(len(points), element.displacements.index(name))
        N = _interpolation(mesh, element, points, dof)
        matrix = scipy.sparse.csc_array(N.T @ scipy.sparse.diags_array(weights) @ N)
        if matrix[free][:, free].count_nonzero() == 0:
            raise InputError("spring", f"{spring.name} acts on a support that is already held")
        matrices[spring.name] = matrix
    return matrices


def _places(mesh: RectangleMesh, spring: Spring) -> tuple[FloatArray, FloatArray]:
    """Points at which a spring acts, and their weights: 1, or metres of edge."""
    if spring.edge is not None:
        return mesh.edge_quadrature(spring.edge)
    return np.array([spring.point]), np.ones(1)


def _motions(mesh: RectangleMesh, element: Shell8) -> FloatArray:
    """(all dofs, r) rigid motions: shifts along x, y and turn about z where there are u and v; heave, roll, pitch."""
    x, y = mesh.nodes[:, 0] - mesh.length / 2, mesh.nodes[:, 1]
    one, none = np.ones_like(x), np.zeros_like(x)
    bending = [(none, none, one, none, none), (none, none, y, one, none), (none, none, -x, none, one)]
    if not element.membrane:
        return np.column_stack([np.column_stack(motion[2:]).ravel() for motion in bending])
    flat = [(one, none, none, none, none), (none, one, none, none, none), (-y, x, none, none, none)]
    return np.column_stack([np.column_stack(motion).ravel() for motion in (*flat, *bending)])


def _mirror(mesh: RectangleMesh) -> IntArray:
    """(n,) number of the node at (x, -y) of each node."""
    x, y = mesh.nodes.T
    scale = np.array([mesh.length, mesh.width]) * 1e-9
    grid = np.rint(np.column_stack([x, y]) / scale).astype(np.int64)
    here, there = np.lexsort((grid[:, 1], grid[:, 0])), np.lexsort((-grid[:, 1], grid[:, 0]))
    mirror = np.empty_like(here)
    mirror[here] = there
    return mirror
