"""Springs and masses as parts of a model: a row of operators at each place where they act."""

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.body.locate import Surfaces
from fecore.body.mesh import BEAMS, SHELLS, Mesh
from fecore.body.model import Part
from fecore.body.operators import Operators
from fecore.body.supports import Mass, NodeSpring, Spring
from fecore.errors import InputError, OffSpecimenError

KNOWN = "1"
"""Name of the coefficient of masses that are known."""

_ONE = (np.array([[0]]),)


def spring_parts(
    mesh: Mesh, surfaces: Surfaces, springs: tuple[Spring | NodeSpring, ...]
) -> list[Part]:
    """Each spring at unit stiffness: nᵀn at its point or its nodes, or ∫nᵀn ds along its edge."""
    parts = []
    for spring in springs:
        if isinstance(spring, NodeSpring):
            nodes, one = spring.nodes, spring.rows[:, None, None]
        else:
            nodes, rows = _held(mesh, surfaces, spring)
            one = rows[:, :, [spring.direction - 1]]
        parts.append(
            Part(
                Operators(nodes, np.arange(len(nodes)), one),
                np.ones((1, 1, 1)),
                (spring.name,),
                _ONE,
            )
        )
    if len({spring.name for spring in springs}) < len(springs):
        raise InputError("springs", "two have one name")
    return parts


def _held(mesh: Mesh, surfaces: Surfaces, spring: Spring) -> tuple[IntArray, FloatArray]:
    """(e, n) nodes and (e, p, 6, n, 6) rows of u and θ where a spring acts."""
    if spring.edge is not None:
        return _along(mesh, mesh.select(spring.edge), spring.edge)
    assert spring.point is not None, "a spring has an edge or a point"
    return _at(surfaces, spring.point, "springs")


def mass_parts(surfaces: Surfaces, masses: tuple[Mass, ...]) -> list[Part]:
    """Each mass on the motion and turn of its place."""
    parts = []
    for mass in masses:
        if isinstance(mass.where, tuple):
            nodes, rows = _at(surfaces, mass.where, "added_masses")
        else:
            nodes, rows = np.array([[mass.where]]), np.eye(6).reshape(1, 1, 6, 1, 6)
        operators = Operators(nodes, np.zeros(1, dtype=np.int64), rows)
        parts.append(Part(operators, mass.matrix[None], (mass.name or KNOWN,), _ONE))
    return parts


def _at(surfaces: Surfaces, point: tuple[float, ...], field: str) -> tuple[IntArray, FloatArray]:
    """(1, n) nodes and (1, 1, 6, n, 6) rows of u and θ at a point (x, y) or (x, y, z) of the
    surface, which a field names.
    """
    try:
        places = surfaces.find(np.array([[*point, 0.0][:3]]))
    except OffSpecimenError as error:
        raise InputError(field, error.message) from error
    kept = np.flatnonzero(places.functions[0])
    rows = np.array(
        [places.rows(np.eye(3)[[axis]])[0] for axis in range(3)] + list(places.turns()[0])
    )
    return places.nodes[:, kept], rows[None, None, :, kept]


def _along(mesh: Mesh, chosen: IntArray, name: str) -> tuple[IntArray, FloatArray]:
    """(e, n) nodes of the sides of elements along chosen nodes, and (e, 3, 6, n, 6) rows by the
    root of their lengths.
    """
    sides: list[IntArray] = []
    for block in mesh.blocks:
        if block.is_shell:
            for side in SHELLS[block.kind].sides:
                nodes = block.nodes[:, list(side)]
                sides.extend(nodes[np.isin(nodes, chosen).all(axis=1)])
    if not sides:
        raise InputError(
            "spring.edge", f"{name} has no side of an element; give nodes along an edge"
        )
    unique = np.array(list({tuple(sorted(side.tolist())): side for side in sides}.values()))
    points, weights = np.polynomial.legendre.leggauss(3)
    beam = BEAMS[f"beam{unique.shape[1]}"]
    N, by = beam.functions(points), beam.derivatives(points)
    length = np.linalg.norm(np.einsum("pn,enk->epk", by, mesh.nodes[unique]), axis=-1) * weights
    rows = np.sqrt(length)[..., None, None, None] * N[None, :, None, :, None] * np.eye(6)[:, None]
    return unique, rows
