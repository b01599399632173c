"""Types of elements: what they become, or why they are refused."""

from dataclasses import dataclass
from typing import Literal

from modalbase.formats.models.inp.lines import Card
from modalbase.formats.models.model import Kind

Role = Literal["shell", "beam", "mass", "inertia", "spring", "rigid", "other"]


@dataclass(frozen=True)
class ElementType:
    """A type of elements."""

    name: str  # as both solvers have it
    role: Role  # what it is for
    # least, most: numbers of its nodes, a node more for a beam's direction
    least: int
    most: int
    kind: Kind | None = None  # of the model's elements
    order: tuple[int, ...] = ()  # of the deck's nodes in the model's
    loss: str = ""  # of a type that is not used: what is lost
    changes: bool = False  # whether modes change by that


def _shell(kind: Kind, nodes: int, names: str) -> dict[str, ElementType]:
    return {name: ElementType(name, "shell", nodes, nodes, kind, tuple(range(nodes))) for name in names.split()}


def _beam(kind: Kind, order: tuple[int, ...], names: str) -> dict[str, ElementType]:
    n = len(order)
    return {name: ElementType(name, "beam", n, n + 1, kind, order) for name in names.split()}


def _special(
    role: Role, least: int, most: int, names: str, loss: str = "", changes: bool = False
) -> dict[str, ElementType]:
    return {name: ElementType(name, role, least, most, loss=loss, changes=changes) for name in names.split()}


TYPES: dict[str, ElementType] = {
    **_shell("tri3", 3, "S3 S3R S3RS STRI3"),
    **_shell("quad4", 4, "S4 S4R S4RS S4RSW S4R5"),
    **_shell("tri6", 6, "S6 STRI65"),
    **_shell("quad8", 8, "S8 S8R S8R5"),
    **_beam("beam2", (0, 1), "B31 B31R B31H B33 B33H"),
    **_beam("beam3", (0, 2, 1), "B32 B32R B32H"),
    **_special("mass", 1, 1, "MASS"),
    **_special("inertia", 1, 1, "ROTARYI"),
    **_special("spring", 2, 2, "SPRINGA SPRING2"),
    **_special("spring", 1, 1, "SPRING1"),
    **_special("rigid", 2, 4, "R3D3 R3D4 RB3D2"),
    **_special("other", 1, 2, "DASHPOTA DASHPOT1 DASHPOT2", "dashpots: damping is measured"),
    **_special("other", 1, 8, "SFM3D3 SFM3D4 SFM3D4R SFM3D6 SFM3D8 SFM3D8R", "surface elements, their mass too", True),
    **_special("other", 1, 2, "CONN3D2", "connectors between nodes", True),
    **_special("other", 1, 1, "DCOUP3D"),
}
"""By name."""

SLENDER = ("B33", "B33H")
"""Beams that are rigid in shear."""

_REFUSED = (
    ("C3D SC6R SC8R CSS8 AC3D DC3D COH3D", "solid elements are not updated by sets"),
    ("CPS CPE CAX DC2D", "elements of a plane or about an axis do not bend in space"),
    ("T2D T3D", "trusses have no stiffness across; use B31 with a small section"),
    ("M3D", "membranes have no stiffness across; use a shell"),
    ("B21 B22 B23", "beams of a plane; use B31"),
    ("B31OS B32OS", "open sections with warping; use B31"),
    ("PIPE ELBOW", "pipes that ovalise; use B31 with SECTION=PIPE"),
    ("F3D", "fluids do not vibrate here"),
    ("S9R5 SAX", "9-node and axisymmetric shells; use S8R"),
)
MATRICES = "another model comes in as matrices: write K and M with *MATRIX GENERATE or MATRIXSTORAGE and import those"


def type_of(card: Card) -> ElementType:
    """The type of a card's elements.

    Raises:
        FormatError: it is none that is read.
    """
    name = card.needs("TYPE").upper()
    if found := TYPES.get(name):
        return found
    for prefixes, reason in _REFUSED:
        if name.startswith(tuple(prefixes.split())):
            raise card.error(f"TYPE={name[:20]}: {reason}; {MATRICES}")
    raise card.error(
        f"TYPE={name[:20]} is unknown; shells (S3 S4 S6 S8R), beams (B31 B32), MASS, ROTARYI and SPRING are read"
    )
