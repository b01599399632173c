"""Types of elements: their nodes, and what each is called in the files that have it.

Nodes are corners in order around the element, then the middles of its sides; of a beam its ends,
then its middle.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple


class NastranFields(NamedTuple):
    """Fields of an element's card, from 0 behind its name."""

    grids: tuple[int, ...]  # in our order
    angle: int
    offset: int
    thickness: tuple[int, ...]  # at the corners
    flag: int  # of the thicknesses


@dataclass(frozen=True)
class CellType:
    """A type of element.

    Attributes:
        name: ours, as structures and their meshes have it.
        dimension: 0 of a point, 1 of a beam, 2 of a shell.
        nodes: how many.
        corners: how many of them are corners, or ends of a beam.
        vtk: types of VTK, each with the nodes that it has there: those in the middle of a face come
            last and are left out. The first is written.
        uff: descriptor of set 2412 that is written. Of shells the last digit stands for the type in
            every family: plane stress, plates, membranes, thin shells.
        gmsh: types of gmsh, as `vtk`.
        abaqus: names in Abaqus and CalculiX.
        abaqus_order: places of their nodes there in our order, where it is another.
        nastran: cards of Nastran with their fields.
    """

    name: str
    dimension: int
    nodes: int
    corners: int
    vtk: Mapping[int, int]
    uff: int = 0
    gmsh: Mapping[int, int] = field(default_factory=dict)
    abaqus: tuple[str, ...] = ()
    abaqus_order: tuple[int, ...] = ()
    nastran: Mapping[str, NastranFields] = field(default_factory=dict)

    @property
    def around(self) -> list[int]:
        """Places of the nodes in the order of set 2412: around the element, a middle between its
        ends.
        """
        ring = [place for k in range(self.corners) for place in (k, self.corners + k)]
        return [place for place in ring if place < self.nodes]


_TRIANGLE = NastranFields((2, 3, 4), 5, 6, (10, 11, 12), 9)
_QUAD = NastranFields((2, 3, 4, 5), 6, 7, (10, 11, 12, 13), 9)

_ALL = (
    CellType("point", 0, 1, 1, {1: 1}, gmsh={15: 1}),
    CellType(
        *("beam2", 1, 2, 2, {3: 2}),
        uff=21,
        gmsh={1: 2},
        abaqus=("B31", "B31R", "B31H", "B33", "B33H"),
    ),
    CellType(
        *("beam3", 1, 3, 2, {21: 3}),
        uff=24,
        gmsh={8: 3},
        abaqus=("B32", "B32R", "B32H"),
        abaqus_order=(0, 2, 1),
    ),
    CellType(
        *("tri3", 2, 3, 3, {5: 3}),
        uff=41,
        gmsh={2: 3},
        abaqus=("S3", "S3R", "S3RS", "STRI3"),
        nastran={"CTRIA3": _TRIANGLE, "CTRIAR": _TRIANGLE},
    ),
    CellType(
        *("tri6", 2, 6, 3, {22: 6, 34: 7}),
        uff=42,
        gmsh={9: 6},
        abaqus=("S6", "STRI65"),
        nastran={"CTRIA6": NastranFields((2, 3, 4, 5, 6, 7), 8, 9, (10, 11, 12), 13)},
    ),
    CellType(
        *("quad4", 2, 4, 4, {9: 4}),
        uff=44,
        gmsh={3: 4},
        abaqus=("S4", "S4R", "S4RS", "S4RSW", "S4R5"),
        nastran={"CQUAD4": _QUAD, "CQUADR": _QUAD},
    ),
    CellType(
        *("quad8", 2, 8, 4, {23: 8, 28: 9}),
        uff=45,
        gmsh={16: 8, 10: 9},
        abaqus=("S8", "S8R", "S8R5"),
        nastran={"CQUAD8": NastranFields((2, 3, 4, 5, 6, 7, 8, 9), 14, 15, (10, 11, 12, 13), 16)},
    ),
)
CELL_TYPES: Mapping[str, CellType] = {one.name: one for one in _ALL}
"""By name."""

ELEMENT_NAMES = ", ".join(one.name for one in _ALL if one.dimension)
"""Their names, for sentences."""


class Solid(NamedTuple):
    """A type of element that fills space, which no structure has: reading passes over its nodes."""

    nodes: int
    vtk: tuple[int, ...]
    gmsh: tuple[int, ...]


SOLIDS = (
    *(
        Solid(4, (10,), (4,)),
        Solid(8, (11, 12), (5,)),
        Solid(6, (13,), (6,)),
        Solid(5, (14,), (7,)),
    ),
    *(Solid(10, (24,), (11,)), Solid(20, (25,), (17,)), Solid(15, (26,), (18,))),
    *(
        Solid(13, (27,), (19,)),
        Solid(27, (29,), (12,)),
        Solid(18, (32,), (13,)),
        Solid(14, (), (14,)),
    ),
)
"""Tetrahedra, hexahedra, wedges and pyramids: linear, without and with nodes in faces."""


def shells() -> Iterator[CellType]:
    """The types of shells."""
    return (one for one in _ALL if one.dimension == 2)
