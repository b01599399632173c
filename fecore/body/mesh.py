"""A mesh: nodes in space, and blocks of elements of one kind and one set. It is the only geometry
there is.

Generators and readers of files make meshes; nothing after them asks which.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from fecore.arrays import FloatArray, IntArray
from fecore.body.elements.beams import Beam
from fecore.body.elements.quads import QUADS
from fecore.body.elements.shells import Shell
from fecore.body.elements.triangles import TRIANGLES
from fecore.errors import InputError

_SHELLS: tuple[Shell, ...] = (*QUADS, *TRIANGLES)
SHELLS: Mapping[str, Shell] = {shell.name: shell for shell in _SHELLS}
"""Shell elements by their kind."""

BEAMS: Mapping[str, Beam] = {beam.name: beam for beam in (Beam(2), Beam(3))}
"""Beam elements by their kind."""

ELEMENTS: Mapping[str, Shell | Beam] = {**SHELLS, **BEAMS}
"""All elements by their kind."""

_NODES = {**{name: len(each.corners) for name, each in ELEMENTS.items()}, "point": 1}


@dataclass(frozen=True)
class CellBlock:
    """Elements of one kind and one set."""

    # of `SHELLS` or `BEAMS`; `point` for nodes of a body that has no elements
    kind: str
    # (e, n) node numbers from 0: corners in order around the element, then the middles of its sides
    nodes: IntArray
    set: str  # the set's name, to which a section belongs
    # (e, n) thickness at the elements' nodes by that of the section, where they step or taper
    thickness: FloatArray | None = None
    # (e, 3) axis 1 of each element, not yet projected, where it is not the section's
    axes: FloatArray | None = None
    # (e, n, 3) rigid links from the nodes to where the elements lie, m, where they lie elsewhere
    offsets: FloatArray | None = None

    def __post_init__(self) -> None:
        if self.kind not in _NODES:
            raise InputError("mesh.kind", f"is {self.kind!r}, expected one of {', '.join(_NODES)}")
        if self.nodes.ndim != 2 or self.nodes.shape[1] != _NODES[self.kind]:
            raise InputError(
                "mesh.nodes",
                f"of a block of {self.kind} have the shape {self.nodes.shape}, expected (e,"
                f" {_NODES[self.kind]})",
            )

    @property
    def element(self) -> Shell | Beam | None:
        """What its elements are; None of points."""
        return ELEMENTS.get(self.kind)

    @property
    def is_shell(self) -> bool:
        """Whether its elements are shells."""
        return self.kind in SHELLS


@dataclass(frozen=True)
class Mesh:
    """Nodes and elements of a structure."""

    nodes: FloatArray  # (n, 3) coordinates, m
    blocks: tuple[CellBlock, ...]  # the elements
    # named nodes, such as the edges of a generated body
    node_sets: Mapping[str, IntArray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.nodes.ndim != 2 or self.nodes.shape[1] != 3 or not np.all(np.isfinite(self.nodes)):
            raise InputError(
                "mesh.nodes",
                f"have the shape {self.nodes.shape}, expected finite (n, 3) coordinates in m",
            )
        if not self.blocks:
            raise InputError("mesh.blocks", "is empty, expected elements")
        for block in self.blocks:
            beyond = np.flatnonzero((block.nodes < 0) | (block.nodes >= len(self.nodes)))
            if beyond.size:
                raise InputError(
                    "mesh.nodes",
                    f"of set {block.set} name node {block.nodes.ravel()[beyond[0]]}, which is not"
                    " there",
                )

    @property
    def sets(self) -> tuple[str, ...]:
        """Names of the sets, in the order of the blocks."""
        return tuple(dict.fromkeys(block.set for block in self.blocks))

    @property
    def size(self) -> float:
        """Length of the diagonal of the box around all nodes, m."""
        return float(np.linalg.norm(np.ptp(self.nodes, axis=0)))

    def select(self, where: str | Box) -> IntArray:
        """Numbers of the nodes of a named set or in a box.

        Raises:
            InputError: there is no such set, or no node in the box.
        """
        if isinstance(where, str):
            if where not in self.node_sets:
                raise InputError(
                    "nodes",
                    f"there is no set {where!r}; there are {', '.join(self.node_sets) or 'none'}",
                )
            return np.asarray(self.node_sets[where])
        nodes = where.holds(self.nodes)
        if not nodes.size:
            raise InputError("nodes", f"none lies between {where.low} and {where.high} m")
        return nodes


@dataclass(frozen=True)
class Box:
    """A box of space between two corners, m; it holds what lies within a billionth of its faces
    too.
    """

    low: tuple[float, float, float]
    high: tuple[float, float, float]

    def holds(self, points: FloatArray) -> IntArray:
        """Numbers of (p, 3) points in the box."""
        margin = 1e-9 * float(np.max(np.ptp(points, axis=0), initial=1e-3))
        within = (points >= np.array(self.low) - margin) & (points <= np.array(self.high) + margin)
        return np.flatnonzero(within.all(axis=1))
