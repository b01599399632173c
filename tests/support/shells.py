"""Structured meshes of each shell element on any surface, and the static answers of a structure."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
from scipy.sparse.linalg import splu

from fecore.arrays import FloatArray
from fecore.body.laminate import OrthotropicMaterial, Ply
from fecore.space.mesh import Block, Mesh
from fecore.space.sections import ShellSection
from fecore.space.structure import Structure

KINDS = ("quad8", "quad4", "tri6", "tri3")


def isotropic(E: float, nu: float, t: float, density: float = 1.0) -> ShellSection:
    G = E / 2 / (1 + nu)
    return ShellSection((Ply(OrthotropicMaterial(E, E, G, G, G, nu, density), t),))


def grid(kind: str, nx: int, ny: int, place: Callable[[FloatArray], FloatArray], name: str = "plate") -> Mesh:
    """Elements on the square 0 … 1, whose (n, 2) nodes `place` puts in space; edges x0, x1, y0, y1 as node sets."""
    number: dict[tuple[int, int], int] = {}

    def node(i: int, j: int) -> int:
        return number.setdefault((i, j), len(number))

    def between(p: tuple[int, int], q: tuple[int, int]) -> tuple[int, int]:
        return (p[0] + q[0]) // 2, (p[1] + q[1]) // 2

    elements = []
    for i, j in product(range(0, 2 * nx, 2), range(0, 2 * ny, 2)):
        square = ((i, j), (i + 2, j), (i + 2, j + 2), (i, j + 2))
        halves = (square,) if kind.startswith("quad") else ((square[0], square[1], square[2]), (square[0], square[2], square[3]))
        for corners in halves:
            sides = [between(p, q) for p, q in zip(corners, (*corners[1:], corners[0]), strict=True)]
            nodes = corners if kind in ("quad4", "tri3") else (*corners, *sides)
            elements.append([node(*n) for n in nodes])
    st = np.array(list(number)) / (2 * np.array([nx, ny]))
    edges = {f"{'xy'[a]}{v}": np.flatnonzero(st[:, a] == v) for a in (0, 1) for v in (0, 1)}
    return Mesh(place(st), (Block(kind, np.array(elements), name),), edges)


def matrices(structure: Structure):
    """K and M at the nominal constants."""
    q = np.array(list(structure.nominal.values()))
    model = structure.model
    return model.stiffness.at(structure.stiffness_coefficients(q)), model.mass.at(structure.mass_coefficients(q))


def static(structure: Structure, forces: FloatArray) -> FloatArray:
    """(nodes, 6) displacement under (nodes, 6) forces."""
    model = structure.model
    K, _ = matrices(structure)
    return model.stiffness.everywhere(splu(K.tocsc()).solve(forces[model.free])[:, None])[..., 0]


def gravity(structure: Structure, acceleration: FloatArray) -> FloatArray:
    """(nodes, 6) forces of the structure's own weight."""
    free = Structure(structure.mesh, structure.sections)
    _, M = matrices(free)
    motion = np.zeros((len(structure.mesh.nodes), 6))
    motion[:, :3] = acceleration
    return free.model.stiffness.everywhere((M @ motion[free.model.free])[:, None])[..., 0]
