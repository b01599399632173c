"""Structured meshes of each shell element on any surface, static answers of a structure, and the
published shells of every book.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np
from scipy.sparse.linalg import splu

from fecore.arrays import FloatArray
from fecore.body.laminate import OrthotropicMaterial, Ply
from fecore.body.mesh import CellBlock, Mesh
from fecore.body.sections import ShellSection
from fecore.body.structure import Structure
from fecore.body.supports import Support
from tests.support.bodies import pencil

KINDS = ("quad8", "quad4", "tri6", "tri3")


def isotropic(E: float, nu: float, t: float, density: float = 1.0) -> ShellSection:
    G = E / 2 / (1 + nu)
    return ShellSection((Ply(OrthotropicMaterial(E, E, G, G, G, nu, density), t),))


def grid(
    kind: str, nx: int, ny: int, place: Callable[[FloatArray], FloatArray], name: str = "plate"
) -> Mesh:
    """Elements on the square 0 … 1, whose (n, 2) nodes `place` puts in space; edges x0, x1, y0, y1
    as node sets.
    """
    number: dict[tuple[int, int], int] = {}

    def node(i: int, j: int) -> int:
        return number.setdefault((i, j), len(number))

    def between(p: tuple[int, int], q: tuple[int, int]) -> tuple[int, int]:
        return (p[0] + q[0]) // 2, (p[1] + q[1]) // 2

    elements = []
    for i, j in product(range(0, 2 * nx, 2), range(0, 2 * ny, 2)):
        square = ((i, j), (i + 2, j), (i + 2, j + 2), (i, j + 2))
        halves = (
            (square,)
            if kind.startswith("quad")
            else ((square[0], square[1], square[2]), (square[0], square[2], square[3]))
        )
        for corners in halves:
            sides = [
                between(p, q) for p, q in zip(corners, (*corners[1:], corners[0]), strict=True)
            ]
            nodes = corners if kind in ("quad4", "tri3") else (*corners, *sides)
            elements.append([node(*n) for n in nodes])
    st = np.array(list(number)) / (2 * np.array([nx, ny]))
    edges = {f"{'xy'[a]}{v}": np.flatnonzero(st[:, a] == v) for a in (0, 1) for v in (0, 1)}
    return Mesh(place(st), (CellBlock(kind, np.array(elements), name),), edges)


def static(structure: Structure, forces: FloatArray) -> FloatArray:
    """(nodes, 6) displacement under (nodes, 6) forces."""
    model = structure.model
    K, _ = pencil(structure)
    return model.stiffness.everywhere(splu(K.tocsc()).solve(forces[model.free])[:, None])[..., 0]


def gravity(structure: Structure, acceleration: FloatArray) -> FloatArray:
    """(nodes, 6) forces of the structure's own weight."""
    free = Structure(structure.mesh, structure.sections, with_joints=structure.with_joints)
    _, M = pencil(free)
    motion = np.zeros((len(structure.mesh.nodes), 6))
    motion[:, :3] = acceleration
    return free.model.stiffness.everywhere((M @ motion[free.model.free])[:, None])[..., 0]


def roof(kind: str, n: int) -> float:
    """Scordelis and Lo's roof under its weight: deflection amid the free edge by .3024."""
    angle = np.radians(40)
    mesh = grid(
        kind,
        n,
        n,
        lambda st: np.column_stack(
            [25 * st[:, 0], 25 * np.sin(angle * st[:, 1]), 25 * np.cos(angle * st[:, 1])]
        ),
    )
    supports = (
        Support("x0", ("v", "w")),
        Support("x1", ("u", "ry", "rz")),
        Support("y0", ("v", "rx", "rz")),
    )
    structure = Structure(
        mesh, {"plate": isotropic(4.32e8, 0.0, 0.25, 360.0)}, supports=supports, with_joints=False
    )
    moved = static(structure, gravity(structure, np.array([0.0, 0, -1])))
    (corner,) = np.intersect1d(mesh.node_sets["x1"], mesh.node_sets["y1"])
    return float(-moved[corner, 2] / 0.3024)


def cylinder(kind: str, n: int) -> float:
    """A pinched cylinder with end diaphragms, an eighth: deflection under the force by
    1.8248e-5.
    """
    mesh = grid(
        kind,
        n,
        n,
        lambda st: (
            300
            * np.column_stack(
                [st[:, 0], np.sin(np.pi / 2 * st[:, 1]), np.cos(np.pi / 2 * st[:, 1])]
            )
        ),
    )
    supports = (
        *(Support("x0", ("v", "w")), Support("x1", ("u", "ry", "rz"))),
        *(Support("y0", ("v", "rx", "rz")), Support("y1", ("w", "rx", "ry"))),
    )
    structure = Structure(
        mesh, {"plate": isotropic(3e6, 0.3, 3.0)}, supports=supports, with_joints=False
    )
    (top,) = np.intersect1d(mesh.node_sets["x1"], mesh.node_sets["y0"])
    force = np.zeros((len(mesh.nodes), 6))
    force[top, 2] = -0.25
    return float(-static(structure, force)[top, 2] / 1.8248e-5)


def hemisphere(kind: str, n: int) -> float:
    """A hemisphere with a hole of 18° pulled and pushed, a quarter: the worse deflection by
    .0940.
    """

    def place(st: np.ndarray) -> np.ndarray:
        up, around = np.radians(72) * st[:, 1], np.pi / 2 * st[:, 0]
        return 10 * np.column_stack(
            [np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)]
        )

    mesh = grid(kind, n, n, place)
    at = mesh.node_sets
    top = np.intersect1d(at["x0"], at["y1"])
    mesh = replace(mesh, node_sets={**at, "top": top})
    supports = (
        Support("x0", ("v", "rx", "rz")),
        Support("x1", ("u", "ry", "rz")),
        Support("top", ("w",)),
    )
    section = replace(isotropic(6.825e7, 0.3, 0.04), axis=(1.0, -1.0, 0.0))
    (a,), (b,) = np.intersect1d(at["x0"], at["y0"]), np.intersect1d(at["x1"], at["y0"])
    force = np.zeros((len(mesh.nodes), 6))
    force[a, 0], force[b, 1] = 1, -1
    moved = static(Structure(mesh, {"plate": section}, supports=supports), force)
    return float(min(moved[a, 0], -moved[b, 1]) / 0.0940)


def twisted_beam(kind: str, n: int) -> float:
    """A thin beam twisted by 90°: the worse of two tip loads, by MacNeal and Harder's (Belytschko's
    for this thickness).
    """

    def place(st: np.ndarray) -> np.ndarray:
        across, angle = 1.1 * (st[:, 1] - 0.5), np.pi / 2 * st[:, 0]
        return np.column_stack([12 * st[:, 0], across * np.cos(angle), across * np.sin(angle)])

    mesh = grid(kind, 6 * n, n, place)
    structure = Structure(mesh, {"plate": isotropic(29e6, 0.22, 0.0032)}, supports=(Support("x0"),))
    end = mesh.node_sets["x1"]
    tip = end[np.argmin(np.abs(mesh.nodes[end, 2]))]
    found = []
    for direction, published in ((2, 5256.0), (1, 1294.0)):
        force = np.zeros((len(mesh.nodes), 6))
        force[tip, direction] = 1
        found.append(static(structure, force)[tip, direction] / published)
    return float(min(found))
