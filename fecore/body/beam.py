"""A strip as a beam along its axis: sections, St-Venant torsion, and the affine model of `elements.beam3`.

It offers what `fecore.body.model.PlateModel` offers. A measurement point beside the axis moves with the section:
u = u + z θy - y θz, v = v - z θx, w = w + y θx.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from fecore.arrays import FloatArray, IntArray
from fecore.body.affine import AffineMatrix, Pattern
from fecore.body.elements import beam3
from fecore.body.laminate import SHEAR_CORRECTION, OrthotropicMaterial
from fecore.body.mesh import BEYOND_EDGE
from fecore.body.model import ModeKind, rigid_motions
from fecore.body.supports import Boundary, PointMass, Supports
from fecore.errors import InputError, OffSpecimenError

_HELD = {
    "free": (),
    "clamped": beam3.DISPLACEMENTS,
    "simply_supported": ("v", "w", "rx"),
}
_IN_PLANE = ("u", "v", "rz")


@dataclass(frozen=True)
class BeamSection:
    """A rectangular section, `width` along y by `thickness` along z, in m, of an orthotropic material."""

    width: float
    thickness: float
    material: OrthotropicMaterial
    shear_correction: float = SHEAR_CORRECTION

    def __post_init__(self) -> None:
        for name in ("width", "thickness"):
            size = getattr(self, name)
            if not (np.isfinite(size) and size > 0):
                raise InputError(f"geometry.{name}_m", f"is {size}, expected a positive number of metres")

    @property
    def torsion_stiffness(self) -> float:
        """GJ in N·m²; see the module's `torsion_stiffness`."""
        return float(self.coefficients()[3])

    def coefficients(self) -> FloatArray:
        """(6,) as `section_stiffness`."""
        m = self.material
        return section_stiffness(m.Ex, m.Gxy, m.Gxz, self.width, self.thickness, self.shear_correction)

    def inertias(self) -> FloatArray:
        """(5,) as `section_inertia`."""
        return section_inertia(self.material.density, self.width, self.thickness)


def section_stiffness(
    Ex: ArrayLike,
    Gxy: ArrayLike,
    Gxz: ArrayLike,
    width: ArrayLike,
    thickness: ArrayLike,
    shear_correction: float = SHEAR_CORRECTION,
) -> FloatArray:
    """(6, …) EA, GAy, GAz, GJ, EIy, EIz of a rectangle; EIy bends out of plane (along z). Constants of one shape (…)."""
    E, Gy, Gz, b, t = (np.asarray(each) for each in (Ex, Gxy, Gxz, width, thickness))
    area, shear = b * t, shear_correction * b * t
    torsion = torsion_stiffness(Gy, Gz, b, t)
    return np.stack([E * area, shear * Gy, shear * Gz, torsion, E * b * t**3 / 12, E * t * b**3 / 12])


def section_inertia(density: ArrayLike, width: ArrayLike, thickness: ArrayLike) -> FloatArray:
    """(5, …) ρA, ρ(Iy + Iz), ρIy, ρIz of a rectangle, and 1 for the point masses."""
    rho, b, t = (np.asarray(each) for each in (density, width, thickness))
    iy, iz = b * t**3 / 12, t * b**3 / 12
    return np.stack([rho * b * t, rho * (iy + iz), rho * iy, rho * iz, np.ones_like(rho)])


def torsion_stiffness(Gxy: FloatArray, Gxz: FloatArray, width: FloatArray, thickness: FloatArray) -> FloatArray:
    """GJ in N·m², by St-Venant's series for an orthotropic rectangle (Lekhnitskii, *Theory of Elasticity of an
    Anisotropic Body*, section 35):

        GJ = Gxy b t³/3 [1 - 192 t/(π⁵ b') Σ_odd tanh(nπb'/2t)/n⁵],   b' = b √(Gxz/Gxy)
    """
    n = np.arange(1, 200, 2)
    slenderness = width / thickness * np.sqrt(Gxz / Gxy)
    series = np.sum(np.tanh(n * np.pi * slenderness[..., None] / 2) / n**5.0, axis=-1)
    stiffness: FloatArray = Gxy * width * thickness**3 / 3 * (1 - 192 / (np.pi**5 * slenderness) * series)
    return stiffness


@dataclass(frozen=True)
class BeamModel:
    """An affine model of a straight beam by `elements.beam3`.

    Attributes:
        length: m.
        elements: number of elements.
        stiffness: K(c), c as `section_stiffness`; mass: M(m), m as `section_inertia`.
        free_dofs: numbers of the free dofs among all.
        rigid_modes: (dofs, r) exact zero-energy motions.
        has_membrane: whether there are in-plane modes among the model's.
    """

    length: float
    elements: int
    stiffness: AffineMatrix
    mass: AffineMatrix
    free_dofs: IntArray
    rigid_modes: FloatArray
    has_membrane: bool = False

    @property
    def start_motions(self) -> FloatArray:
        """(dofs, 3) rigid heave, roll about x and pitch about the end x = 0, as if nothing held the body."""
        motions = _motions(np.linspace(0, self.length, 2 * self.elements + 1))[self.free_dofs]
        heave, roll, pitch = motions[:, 2:5].T
        return np.column_stack([heave, roll, pitch - self.length / 2 * heave])

    def observation(self, points: FloatArray, directions: IntArray) -> scipy.sparse.csr_array:
        """(p, dofs) displacement or rotation at (p, 2) points (x, y) along (p,) directions 1 … 6.

        Raises:
            InputError: a point lies off the beam's length, or a direction is not 1 … 6.
        """
        return scipy.sparse.csr_array(
            scipy.sparse.csc_array(_observation(self.length, self.elements, points, directions))[:, self.free_dofs]
        )

    def deflection(self, points: FloatArray) -> scipy.sparse.csr_array:
        """(p, dofs) interpolation of w at (p, 2) points."""
        return self.observation(points, np.full(len(points), 3))

    def kinds(self, shapes: FloatArray) -> tuple[ModeKind, ...]:
        """Kind of each (dofs, n) elastic shape by where its motion is largest: w is bending, θx (times the length)
        torsion, u and v in-plane.
        """
        everywhere = np.zeros((6 * (2 * self.elements + 1), shapes.shape[1]))
        everywhere[self.free_dofs] = shapes
        energy = np.sum(everywhere.reshape(-1, 6, shapes.shape[1]) ** 2, axis=0)
        # Torsion has no displacement on the axis at all, so any scale of θx that dwarfs round-off shows it.
        shares = np.array([energy[2], energy[3] * (1e-3 * self.length) ** 2, energy[0] + energy[1]])
        names: tuple[ModeKind, ...] = ("bending", "torsion", "in-plane")
        return tuple(names[int(k)] for k in np.argmax(shares, axis=0))


def beam(
    length: float, elements: int, boundary: Boundary, masses: Sequence[PointMass] = (), *, in_plane: bool = True
) -> BeamModel:
    """Assemble the affine model of a beam of equal elements; x runs from 0 to `length`.

    Args:
        length: m.
        elements: their number.
        boundary: how the ends are held.
        masses: point masses.
        in_plane: False holds u, v and θz everywhere, so that out-of-plane bending and torsion are left.

    Raises:
        InputError: a length or number of elements is not positive, or a point mass lies off the beam.
    """
    if not (np.isfinite(length) and length > 0):
        raise InputError("geometry.length_m", f"is {length}, expected a positive number of metres")
    if elements < 1:
        raise InputError("mesh.elements", f"is {elements}, expected at least one element")
    supports = Supports.of(boundary)
    nodes = 2 * elements + 1
    held = np.zeros((nodes, 6), dtype=bool)
    for node, support in ((0, supports.start), (nodes - 1, supports.end)):
        held[node, [beam3.DISPLACEMENTS.index(name) for name in _HELD[support]]] = True
    if boundary == "simply_supported":
        held[0, 0] = True  # one end holds the beam along its axis
    if not in_plane:
        held[:, [beam3.DISPLACEMENTS.index(name) for name in _IN_PLANE]] = True
    free = np.flatnonzero(~held.ravel())
    numbers = 2 * np.arange(elements)[:, None] + np.arange(3)
    pattern = Pattern.of(numbers, nodes, 6, free)
    step = length / elements
    carried = {"point_masses": _point_masses(length, elements, masses)}

    def alone(count: int) -> tuple[IntArray, ...]:
        return tuple(np.array([[k]]) for k in range(count))

    return BeamModel(
        length=length,
        elements=elements,
        stiffness=pattern.affine(beam3.stiffness_terms(step)[:, None], beam3.TERMS, alone(6), {}),
        mass=pattern.affine(beam3.mass_terms(step)[:, None], beam3.MASS_TERMS, alone(4), carried),
        free_dofs=free,
        rigid_modes=rigid_motions(_motions(np.linspace(0, length, nodes)), free, []),
        has_membrane=in_plane,
    )


def _observation(length: float, elements: int, points: FloatArray, directions: IntArray) -> scipy.sparse.csr_array:
    outside = (points[:, 0] < -BEYOND_EDGE * length) | (points[:, 0] > (1 + BEYOND_EDGE) * length)
    if outside.any():
        index = int(np.flatnonzero(outside)[0])
        x, y = points[index]
        raise OffSpecimenError(index, f"({x:g}, {y:g}) m lies off the beam, which spans x 0 … {length:g} m")
    scaled = np.clip(points[:, 0] / length, 0, 1) * elements
    cell = np.minimum(scaled.astype(np.int64), elements - 1)
    N = beam3.shape_functions(2 * (scaled - cell) - 1)
    matrix = scipy.sparse.lil_array((len(points), 6 * (2 * elements + 1)))
    for row, ((_, y), direction) in enumerate(zip(points, directions, strict=True)):
        if not 1 <= direction <= 6:
            raise InputError(f"directions[{row}]", f"is {direction}, expected 1 … 6")
        dof = int(direction) - 1
        carried = {0: ((5, -y),), 2: ((3, y),)}.get(dof, ())  # the section turns with θz and θx
        for node in range(3):
            first = 6 * (2 * cell[row] + node)
            for place, arm in ((dof, 1.0), *carried):
                matrix[row, first + place] = arm * N[row, node]
    return scipy.sparse.csr_array(matrix)


def _point_masses(length: float, elements: int, masses: Sequence[PointMass]) -> scipy.sparse.csc_array:
    size = 6 * (2 * elements + 1)
    total = scipy.sparse.csc_array((size, size))
    for mass in masses:
        place = np.repeat([[mass.x, mass.y]], 5, axis=0)
        N = _observation(length, elements, place, np.arange(1, 6))
        inertia = [mass.mass] * 3 + [mass.rotary_inertia] * 2
        total = total + N.T @ scipy.sparse.diags_array(inertia) @ N
    return scipy.sparse.csc_array(total)


def _motions(x: FloatArray) -> FloatArray:
    """(dofs, 6) rigid motions: three shifts, turns about x, y and z."""
    x = x - x.mean()
    one, none = np.ones_like(x), np.zeros_like(x)
    shifts = [
        (one, none, none, none, none, none),
        (none, one, none, none, none, none),
        (none, none, one, none, none, none),
    ]
    turns = [(none, none, none, one, none, none), (none, none, -x, none, one, none), (none, x, none, none, none, one)]
    return np.column_stack([np.column_stack(motion).ravel() for motion in (*shifts, *turns)])
