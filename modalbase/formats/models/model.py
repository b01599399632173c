"""A finite element model as a deck states it, numbers in the deck's own units, each with its line;
and what is lost of it.

Readers make it from any deck; nothing after them asks which. Nodes are known by their place in the
table, and by their number to the user.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from modalbase.formats.errors import FormatError
from modalbase.formats.models.losses import LOSSES

ALL_DOFS = tuple(range(6))
"""Displacements along x, y and z, then rotations about them."""

LARGEST = 1e25
"""No number of a file in any units reaches it, and products of several stay finite."""

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Where:
    """The line in which something begins."""

    line: int  # from 1, of its file
    file: str = ""  # of an INCLUDE, empty for the deck itself

    def __str__(self) -> str:
        return f"{self.file} line {self.line}".lstrip()


@dataclass(frozen=True)
class FieldPlace:
    """Where a number stands, so that another can be written there."""

    line: int  # from 1, of its file
    # start, end: columns from 0, the end excluded; the field without the comma behind it
    start: int
    end: int
    file: str = ""  # of an INCLUDE, empty for the deck itself


@dataclass(frozen=True)
class Elements:
    """Elements of one kind and one set, that is of one section."""

    # of elements; corners in order around the element, then the middles of its sides; of a beam its
    # ends, then its middle
    kind: str
    numbers: Integers  # (e,) the user's
    nodes: Integers  # (e, n) rows of the table of nodes
    set: str  # name of the set that the section belongs to
    # (e, 3) axis 1 of the material in a shell, not yet projected on its surface; of a beam axis 1
    # of its section
    axes: Floats
    lines: Integers  # (e,) where each begins
    # (e, n, 3) from the nodes to the beam's axis or the shell's reference surface; None where there
    # are none
    offsets: Floats | None = None
    # (e, n) thickness at the nodes where elements state their own; None where the section's holds
    thickness: Floats | None = None
    # the file of each line, empty for the deck itself; none where all stand there
    files: tuple[str, ...] = ()

    def where(self, k: int) -> str:
        """The place of an element's error; empty where the file has no lines."""
        return (
            str(Where(int(self.lines[k]), self.files[k] if self.files else ""))
            if self.lines[k]
            else ""
        )


@dataclass(frozen=True)
class Material:
    """A material."""

    name: str  # as the deck has it; a number as text
    # `E`, `nu` and `G` of an isotropic one; else `E1`, `E2`, `nu12`, `G12`, `G13`, `G23`, and `E3`,
    # `nu13`, `nu23` where stated; `density` where stated
    constants: Mapping[str, float]
    where: Where
    places: Mapping[str, FieldPlace] = field(default_factory=dict)  # of the constants

    @property
    def is_isotropic(self) -> bool:
        """Whether it is stated by E and ν."""
        return "E" in self.constants


@dataclass(frozen=True)
class Ply:
    """One ply: its material's name, thickness, and angle in degrees from the elements' axis 1 about
    their normal.
    """

    material: str
    thickness: float
    angle_deg: float = 0.0
    place: FieldPlace | None = None


@dataclass(frozen=True)
class ShellSection:
    """Plies from the bottom to the top along the elements' normal."""

    plies: tuple[Ply, ...]  # the stack
    where: Where
    offset: float = 0.0  # from the nodes to the middle of the stack along the normal
    extra_mass: float = 0.0  # non-structural mass per area

    @property
    def materials(self) -> tuple[str, ...]:
        """Names of the plies' materials from the bottom, each once."""
        return tuple(dict.fromkeys(ply.material for ply in self.plies))


@dataclass(frozen=True)
class BeamSection:
    """A beam's section; axes 1 and 2 lie across the beam, axis 2 = tangent × axis 1."""

    material: str  # its name
    area: float  # of the section
    # ∫z² dA, ∫y² dA and ∫yz dA of places y n₁ + z n₂ from the centroid
    inertia: tuple[float, float, float]
    torsion: float  # J
    where: Where
    # factors κ of the areas that resist shear along axes 1 and 2; None where the deck has them
    # rigid in shear
    shear: tuple[float, float] | None = (5 / 6, 5 / 6)
    extra_mass: float = 0.0  # non-structural mass per length
    # of `area`, `I1`, `I2`, `J`, where the deck states them themselves
    places: Mapping[str, FieldPlace] = field(default_factory=dict)

    @property
    def materials(self) -> tuple[str, ...]:
        """Its material's name, alone."""
        return (self.material,)


@dataclass(frozen=True)
class PointMass:
    """A mass that a node carries: its (3, 3) rotary inertia about its own centre, and the offset of
    that from the node.
    """

    node: int
    mass: float
    where: Where
    inertia: tuple[tuple[float, float, float], ...] = ((0.0,) * 3,) * 3
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Spring:
    """A spring from a node's dof (0 … 5, in the model's frame) to the ground, or to the dof of a
    second node.

    Where it lies askew, `direction` is a unit vector in the model's frame: `dof` and `second_dof`
    are then 0 for displacements along it and 3 for turns about it. `arms` reach from its nodes, as
    rigid bodies, to where it acts; None where it acts at the nodes.
    """

    node: int
    dof: int
    stiffness: float
    where: Where
    second: int | None = None
    second_dof: int | None = None
    direction: tuple[float, float, float] | None = None
    arms: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None


@dataclass(frozen=True)
class Link:
    """A dependent node, whose dofs (0 … 5) independent ones (`leaders`) lead: one as a rigid body,
    or several as their weighted mean.

    The dofs are along the model's axes, or along those (3, 3, as rows) of `axes`.
    """

    node: int
    leaders: tuple[int, ...]
    dofs: tuple[int, ...]
    where: Where
    weights: tuple[float, ...] = ()
    axes: Floats | None = None
    # (n + 1, 6, 6) the dependent dofs by the motions of the leaders, in the model's frame, and,
    # last, by the node's other dofs: linear equations, in place of a body or a mean
    equations: Floats | None = None


@dataclass(frozen=True)
class Support:
    """Nodes whose dofs (0 … 5) are held, along the model's axes or along those (3, 3, as rows) of
    `axes`.
    """

    nodes: Integers
    dofs: tuple[int, ...]
    where: Where
    axes: Floats | None = None


@dataclass(frozen=True)
class SkippedCard:
    """Cards that were not used."""

    kind: str  # id of its row in `modalbase.formats.models.losses`
    card: str  # name, such as `*CONTACT PAIR` or `PLOAD4`
    lines: tuple[int, ...]  # where they stand in `file`
    loss: str  # what is lost by that, in a sentence
    # whether modes and frequencies change; such a card stops an import unless the user accepts it
    # by name
    changes: bool = False
    file: str = ""  # of an INCLUDE, empty for the deck itself


def skipped_card(
    kind: str, card: str, lines: Sequence[int], file: str = "", **values: object
) -> SkippedCard:
    """Cards that were not used, with what is lost by a row of `LOSSES`."""
    row = LOSSES[kind]
    name, loss = (each.format(card=card, **values) for each in (row.card, row.loss))
    return SkippedCard(kind, name, tuple(lines), loss, row.changes, file)


@dataclass(frozen=True)
class FiniteElementModel:
    """What a deck says."""

    format: str  # `inp`, `bdf`, `uff`, `mesh`
    title: str  # the heading
    numbers: Integers  # (n,) the user's numbers of the nodes
    nodes: Floats  # (n, 3) coordinates in the model's frame
    elements: tuple[Elements, ...]  # blocks
    sections: Mapping[str, ShellSection | BeamSection]  # of each set of elements
    materials: Mapping[str, Material]  # by name
    # named nodes, rows of the table
    node_sets: Mapping[str, Integers] = field(default_factory=dict)
    # (3, 3) axes, as rows, of nodes whose displacements a deck states in a system of their own, by
    # row
    node_axes: Mapping[int, Floats] = field(default_factory=dict)
    # masses, springs, links, supports: what it carries and what holds it
    masses: tuple[PointMass, ...] = ()
    springs: tuple[Spring, ...] = ()
    links: tuple[Link, ...] = ()
    supports: tuple[Support, ...] = ()
    ignored: tuple[SkippedCard, ...] = ()  # what was not used

    @property
    def sets(self) -> tuple[str, ...]:
        """Names of the sets of elements, in the order of the blocks."""
        return tuple(dict.fromkeys(block.set for block in self.elements))


class Placed(Protocol):
    """What stands in a line: a card, or a row of one."""

    @property
    def where(self) -> Where:
        """Where it begins."""


class IncompleteError(FormatError):
    """A model lacks what one of its parts needs; cards that were not read may be why."""

    def after(self, skipped: Iterable[SkippedCard]) -> IncompleteError:
        """The same after the cards that were not read, which come first."""
        unread = [
            (
                str(Where(each.lines[0], each.file)),
                f"{each.card}: {each.loss}; this may be why the model is incomplete, and matrices of"
                " its solver would have it",
            )
            for each in skipped
            if each.changes
        ]
        return IncompleteError([*unread, *self.faults])


class ReadReport:
    """Cards that were not used, or not as their solver would."""

    def __init__(self) -> None:
        self._noted: defaultdict[SkippedCard, list[int]] = defaultdict(list)

    def add(self, of: Placed | Where, kind: str, card: str = "", **values: object) -> None:
        """Note a card, or a line of one, with what is lost by its row of `LOSSES`."""
        where = of if isinstance(of, Where) else of.where
        self._noted[skipped_card(kind, card, (), where.file, **values)].append(where.line)

    @property
    def skipped(self) -> tuple[SkippedCard, ...]:
        """All of it, what changes modes first."""
        every = [replace(each, lines=tuple(lines)) for each, lines in self._noted.items()]
        return tuple(sorted(every, key=lambda each: not each.changes))
