"""Linear equations between dofs of nodes, Σ a u = 0, as links: of each the first term's dof depends
on the others.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from modalbase.formats.errors import FormatError
from modalbase.formats.models.model import Floats, Link, Where

_WRITTEN = 1e-5  # digits to which coefficients are written, by the largest


class Term(NamedTuple):
    """A term of an equation."""

    node: int  # row of the table
    dof: int  # 0 … 5, along the node's own axes
    factor: float


class Equation(NamedTuple):
    """Terms whose sum is zero."""

    where: Where
    terms: Sequence[Term]


def links_of(
    equations: Iterable[Equation], places: Floats, axes: Mapping[int, Floats]
) -> list[Link]:
    """A link of each node whose dofs the first terms name.

    Equations that say what a rigid body does are one.

    Args:
        equations: terms of one dof are added.
        places: (n, 3) of the nodes.
        axes: (3, 3) as rows, of nodes that have their own.

    Raises:
        FormatError: two begin with one dof, or those of a node do not settle what depends.
    """
    by_node: dict[int, list[Equation]] = defaultdict(list)
    for equation in equations:
        sums: dict[tuple[int, int], float] = defaultdict(float)
        for term in equation.terms:
            sums[term.node, term.dof] += term.factor
        if not any(sums.values()):
            continue  # it says that nothing is nothing
        by_node[equation.terms[0].node].append(equation)
    return [_link(node, own, places, axes) for node, own in by_node.items()]


def _link(
    node: int, equations: Sequence[Equation], places: Floats, axes: Mapping[int, Floats]
) -> Link:
    where = equations[0].where
    dofs = sorted({equation.terms[0].dof for equation in equations})
    leaders = sorted(
        {term.node for equation in equations for term in equation.terms if term.factor} - {node}
    )
    place_of = {other: place for place, other in enumerate([*leaders, node])}
    rows = np.zeros((len(equations), len(place_of), 6))
    for row, equation in zip(rows, equations, strict=True):
        for term in equation.terms:
            if term.factor:
                row[place_of[term.node], term.dof] += term.factor
    A = rows[:, -1, dofs]
    if len(dofs) < len(equations) or not np.linalg.matrix_rank(A) == len(dofs):
        raise FormatError(
            str(equations[-1].where),
            "begins with a dof that another equation begins with, or that they do not settle; the"
            " first term of each is what depends",
        )
    matrices = np.zeros((len(place_of), 6, 6))
    rows[:, -1, dofs] = 0
    matrices[:, dofs] = np.moveaxis(
        -np.linalg.solve(A, rows.reshape(len(A), -1)).reshape(rows.shape), 1, 0
    )
    for place, leader in enumerate(leaders):
        if leader in axes:
            matrices[place] = matrices[place] @ np.kron(np.eye(2), axes[leader])
    plain = Link(node, tuple(leaders), tuple(dofs), where, axes=axes.get(node))
    return plain if _is_rigid(plain, matrices, places) else replace(plain, equations=matrices)


def _is_rigid(link: Link, matrices: Floats, places: Floats) -> bool:
    """Whether equations are those of a rigid body that one node leads."""
    if len(link.leaders) != 1 or matrices[-1].any():
        return False
    x, y, z = places[link.node] - places[link.leaders[0]]
    body = np.eye(6)
    body[:3, 3:] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
    if link.axes is not None:
        body = np.kron(np.eye(2), link.axes) @ body
    rows = list(link.dofs)
    apart = np.abs(matrices[0, rows] - body[rows])
    return bool(np.all(apart <= _WRITTEN * np.abs(body[rows]).max(axis=1, keepdims=True)))
