"""From blocks of elements to operators over the dofs of nodes: geometry, areas, thickness, rigid
links.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.body.affine import distinct
from fecore.body.elements.shells import Shell, drilling, surface
from fecore.body.laminate import AlongNormal
from fecore.body.mesh import BEAMS, SHELLS, CellBlock
from fecore.body.sections import ShellSection
from fecore.body.supports import Link

_STRAIN_POWERS = np.array([1, 1, 1, 3, 3, 3, 1, 1]) / 2
_MOTION_POWERS = np.array([1, 1, 1, 3, 3, 3, 3]) / 2
"""Of the relative thickness r in rows of strains and motions: so A and S go with r, B with r², D
with r³.
"""


_THIN = 10
"""The drilling of an element wider than so many thicknesses goes down with (t/h)², as bending does:
else it locks warped shells.
"""


@dataclass(frozen=True)
class Operators:
    """Operators of elements, alike ones once."""

    nodes: IntArray  # (e, n) node numbers
    which: IntArray  # (e,) operator of each element
    # (s, p, r, n, 6) rows over the nodes' dofs, times the root of what a point stands for
    rows: FloatArray

    def linked(self, links: Mapping[int, Link], places: FloatArray) -> list[Operators]:
        """The same with every dependent node's dofs by its independent ones'; apart where elements
        have different numbers of nodes.
        """
        touched = np.isin(self.nodes, list(links)).any(axis=1)
        if not touched.any():
            return [self]
        operators = (
            [Operators(self.nodes[~touched], self.which[~touched], self.rows)]
            if not touched.all()
            else []
        )
        linked: dict[int, list[tuple[list[int], FloatArray]]] = defaultdict(list)
        for element in np.flatnonzero(touched):
            nodes, rows = on_independent_nodes(
                self.nodes[element].tolist(), self.rows[self.which[element]], links, places
            )
            linked[len(nodes)].append((nodes, rows))
        for group in linked.values():
            rows = np.array([rows for _, rows in group])
            operators.append(
                Operators(np.array([nodes for nodes, _ in group]), np.arange(len(group)), rows)
            )
        return operators


def shell_operators(
    block: CellBlock,
    nodes: FloatArray,
    shift: FloatArray,
    section: ShellSection,
    with_drilling: bool,
) -> tuple[Operators, Operators, Operators | None]:
    """Strains, motions and drilling of a block of shells.

    Args:
        block: the elements.
        nodes: (n, 3) the mesh's nodes.
        shift: (e, n, 3) rigid links from the mesh's nodes to the elements'.
        section: of the set.
        with_drilling: whether there are rotations about the normal.
    """
    x = nodes[block.nodes] + shift
    r = np.ones(x.shape[:2]) if block.thickness is None else block.thickness
    size = np.abs(x - x[:, :1]).max(initial=1e-300)
    shell, along = SHELLS[block.kind], np.array(section.axis, dtype=float)
    key = [x - x[:, :1], shift, r[..., None] * size]
    if block.axes is not None:
        key.append(np.broadcast_to(size * block.axes[:, None], x.shape))
    chosen, which = distinct(np.concatenate(key, axis=2))
    x, shift, r = x[chosen], shift[chosen], r[chosen]
    if block.axes is not None:
        along = block.axes[chosen]

    def weighed(
        sampled: tuple[FloatArray, FloatArray, FloatArray], powers: FloatArray
    ) -> Operators:
        rows, area, N = sampled
        scale = np.sqrt(area)[..., None] * (r @ N.T)[..., None] ** powers
        return Operators(block.nodes, which, _hung(rows * scale[..., None, None], shift))

    strains = weighed(shell.strains(x, along), _STRAIN_POWERS)
    motion = weighed(_motions(shell, x, along, r, section.normal), _MOTION_POWERS)
    if not with_drilling:
        return strains, motion, None
    twist, area, N = drilling(shell, x, along)
    thin = np.minimum(1, _THIN * section.thickness / np.sqrt(area.sum(axis=1)))[
        :, None, None, None, None
    ]
    return strains, motion, weighed((twist * thin, area, N), _STRAIN_POWERS[:1])


def _motions(
    shell: Shell, x: FloatArray, axis: FloatArray, thickness: FloatArray, normal: AlongNormal | None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(e, p, 7, n, 6) motions, (e, p) areas and (p, n) shape functions at the points of the mass.

    Args:
        shell: the element.
        x: (e, n, 3) nodes.
        axis: axis 1.
        thickness: (e, n) relative, at the nodes.
        normal: how the mass moves with strains; None where it does not.
    """
    natural, weights = shell.mass_rule
    own = surface(shell, x, natural, axis)
    rows = own.motion()
    if normal is not None:
        r = (thickness @ own.N.T)[..., None, None]
        curvature = own.curvature()
        thinner = np.einsum(
            "r,eprnk->epnk", normal.by_strain, own.membrane() + normal.offset * curvature
        )
        rows[:, :, :3] += (normal.spread * r**2 * own.bend[..., None, None])[:, :, None] * rows[
            :, :, 3:6
        ]
        rows[:, :, 2] += (
            r**2 * np.einsum("r,eprnk->epnk", normal.by_curvature, curvature)
            + normal.offset * thinner
        )
        rows[:, :, 5] -= thinner
    return rows, own.area * weights, own.N


def beam_operators(
    nodes: IntArray,
    kind: str,
    places: FloatArray,
    axis: FloatArray,
    shift: FloatArray | None = None,
) -> tuple[Operators, Operators]:
    """Strains and motions of (e, n) beams; `axis` is n₁, (3,) or (e, 3), `shift` (e, n, 3) links to
    the beam's own axis.
    """
    arm = np.zeros((*nodes.shape, 3)) if shift is None else shift
    x = places[nodes] + arm
    n1 = np.broadcast_to(axis, (len(x), 3))
    chosen, which = distinct(
        np.concatenate(
            [x - x[:, :1], arm, np.broadcast_to(n1[:, None] * np.abs(x - x[:, :1]).max(), x.shape)],
            axis=2,
        )
    )
    operators = []
    for rows, length, _ in (
        BEAMS[kind].strains(x[chosen], n1[chosen]),
        BEAMS[kind].motions(x[chosen], n1[chosen]),
    ):
        operators.append(
            Operators(
                nodes, which, _hung(rows * np.sqrt(length)[..., None, None, None], arm[chosen])
            )
        )
    return operators[0], operators[1]


def _hung(rows: FloatArray, shift: FloatArray) -> FloatArray:
    """Rows over nodes from which the elements hang by (e, n, 3) rigid links r: u + θ × r, of which
    a · (θ × r) = θ · (r × a).
    """
    if shift.any():
        rows[..., 3:] += np.cross(shift[:, None, None], rows[..., :3])
    return rows


def on_independent_nodes(
    nodes: list[int], rows: FloatArray, links: Mapping[int, Link], places: FloatArray
) -> tuple[list[int], FloatArray]:
    """One element's nodes and (p, r, n, 6) rows, with each dependent node replaced by its independent
    ones, as long as there is one.
    """
    while any(node in links for node in nodes):
        columns: dict[int, FloatArray] = {}
        for place, node in enumerate(nodes):
            own = rows[:, :, place]
            parts: list[tuple[int, FloatArray]] = [(node, np.eye(6))]
            if node in links:
                link = links[node]
                parts = list(zip(link.independent, link.matrices(places), strict=True))
                if link.own.any() or not parts or link.equations is not None:
                    parts.append((_OWN + node, link.own))
            for target, matrix in parts:
                columns[target] = columns.get(target, 0) + own @ matrix
        nodes = list(columns)
        rows = np.stack([columns[node] for node in nodes], axis=2)
    return [node % _OWN for node in nodes], rows


_OWN = 1 << 40  # marks the dofs that a dependent node keeps
