"""Plates and laminates: their properties and elements."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from modalbase.formats.cell_types import CELL_TYPES, CellType, NastranFields
from modalbase.formats.models.bdf.card import Card
from modalbase.formats.models.bdf.deck import BdfDeck, family
from modalbase.formats.models.check import normals_of, unit
from modalbase.formats.models.model import Elements, Floats, Ply, ShellSection

_BENDING = 1.0, 1e-3  # 12I/T³ of a plate, and how near to it
_SHEAR = 0.833333, 1e-2  # TS/T of a plate, and how near to it
_MOST_PLIES = 2000


class _Layout(NamedTuple):
    """A card's type of element, and where its fields are."""

    cell_type: CellType
    fields: NastranFields


LAYOUTS = {
    card: _Layout(one, fields)
    for one in CELL_TYPES.values()
    for card, fields in one.nastran.items()
}


@dataclass
class _Property:
    """A property as its elements need it; the thickness is None where they state their own."""

    card: Card
    set: str
    plies: tuple[Ply, ...]
    offset: float
    extra_mass: float
    is_isotropic: bool

    @property
    def thickness(self) -> float | None:
        return sum(ply.thickness for ply in self.plies) or None


@dataclass
class _Group:
    """Elements of one kind and one set as they are read."""

    layout: _Layout
    section: _Property
    numbers: list[int] = field(default_factory=list)
    nodes: list[list[int]] = field(default_factory=list)
    cards: list[Card] = field(default_factory=list)
    angles: list[float] = field(default_factory=list)
    offsets: list[float] = field(default_factory=list)
    special: dict[int, int] = field(default_factory=dict)
    own_thickness: dict[int, list[float]] = field(default_factory=dict)


class Shells:
    """Reader of shells.

    Attributes:
        sections: of the sets that elements use, by name.
    """

    def __init__(self, deck: BdfDeck, extra: Mapping[tuple[str, int], float]) -> None:
        """Of a deck, and non-structural mass per area by family and number of property."""
        self.sections: dict[str, ShellSection] = {}
        self._deck, self._extra = deck, extra
        self._read: dict[int, _Property] = {}

    def blocks(self) -> list[Elements]:
        """Elements by kind and set, in the order in which these appear."""
        groups: dict[tuple[str, int], _Group] = {}
        for card in self._deck.elements(*LAYOUTS):
            layout = LAYOUTS[card.name]
            if layout.cell_type.nodes > layout.cell_type.corners:
                layout = _without_middles(card, layout)
            number = card.integer(0, "EID")
            own = card.integer(1, "PID", number)
            group = groups.get((layout.cell_type.name, own))
            if group is None:
                group = groups[layout.cell_type.name, own] = _Group(
                    layout, self._property(card, own)
                )
            self._take(group, card, number)
        return [self._block(group) for group in groups.values()]

    def _take(self, group: _Group, card: Card, number: int) -> None:
        layout, at = LAYOUTS[card.name], len(group.numbers)
        rows, fields = self._deck.grids.by_text, card.fields
        try:  # what almost all elements are
            nodes = [rows[fields[index]] for index in group.layout.fields.grids]
        except (KeyError, IndexError):
            nodes = [
                self._deck.grids.row(card, i, f"G{k}")
                for k, i in enumerate(group.layout.fields.grids, start=1)
            ]
        if len(set(nodes)) < len(nodes):
            raise card.error("a grid stands in it twice; a corner less makes a CTRIA3", 2)
        group.numbers.append(number)
        group.nodes.append(nodes)
        group.cards.append(card)
        angle = 0.0
        if card.text(layout.fields.angle):
            if card.is_integer(layout.fields.angle):
                self._deck.grids.system(card, layout.fields.angle, "MCID")
                group.special[at] = card.integer(layout.fields.angle, "MCID")
            else:
                angle = card.real(layout.fields.angle, "THETA")
        group.angles.append(angle)
        group.offsets.append(card.real(layout.fields.offset, "ZOFFS", 0.0))
        if len(card) > layout.fields.thickness[0]:
            self._thickness(group, card, layout, at)

    def _thickness(self, group: _Group, card: Card, layout: _Layout, at: int) -> None:
        """Thicknesses that an element states at its corners."""
        if not any(card.text(index) for index in layout.fields.thickness):
            return
        whole = group.section.thickness
        relative = card.integer(layout.fields.flag, "TFLAG", 0) == 1
        default = 1.0 if relative else whole
        own = [
            card.real(index, f"T{k}", default)
            for k, index in enumerate(layout.fields.thickness, start=1)
        ]
        for k, value in enumerate(own):
            if value < 0 or not any(own):  # an edge may taper to nothing
                raise card.wrong(
                    layout.fields.thickness[k],
                    f"T{k + 1}",
                    "a thickness that is not negative, and not zero all round",
                )
        if relative and whole is None:
            raise card.error("TFLAG is 1, but the property states no thickness", layout.fields.flag)
        group.own_thickness[at] = [value * (whole or 1.0) for value in own] if relative else own

    def _property(self, card: Card, number: int) -> _Property:
        if number not in self._read:
            source = self._deck.plates.get(number)
            if source is None:
                raise card.wrong(
                    1, "PID", f"a property of shells; there is no PSHELL or PCOMP {number}"
                )
            reader = self._plate if source.name == "PSHELL" else self._laminate
            self._read[number] = reader(source, self._deck.labels.of(source.name, number))
        return self._read[number]

    def _plate(self, card: Card, name: str) -> _Property:
        bending_only = not card.text(1)
        material = self._deck.materials.get(card, 3 if bending_only else 1, "MID1")
        thickness = card.positive(2, "T") if card.text(2) else 0.0
        notes = self._deck.notes
        if bending_only:
            notes.add(card, "pshell_without_mid1")
        elif not card.text(3):
            notes.add(card, "pshell_without_mid2")
        elif card.text(3) not in (card.text(1), "-1") or card.text(10):
            notes.add(card, "pshell_with_mid2")
        if card.text(3) == "-1":
            notes.add(card, "pshell_of_plane_strain")
        if abs(card.real(4, "12I/T**3", 1.0) - _BENDING[0]) > _BENDING[1]:
            notes.add(card, "pshell_inertia")
        if card.text(3) and not card.text(5):
            notes.add(card, "pshell_without_mid3")
        elif card.text(5) and (
            abs(card.real(6, "TS/T", _SHEAR[0]) - _SHEAR[0]) > _SHEAR[1]
            or card.text(5) != card.text(1)
        ):
            notes.add(card, "pshell_shear")
        ply = Ply(material.name, thickness, place=card.place(2))
        return _Property(
            card,
            name,
            (ply,),
            card.real(12, "ZOFFS", 0.0),
            self._mass(card, 7),
            material.is_isotropic,
        )

    def _laminate(self, card: Card, name: str) -> _Property:
        step = 8 if card.name == "PCOMPG" else 4
        lamina = card.text(7)
        plies: list[Ply] = []
        material, thickness, place = "", 0.0, card.place(9)
        shift = 1 if step == 8 else 0
        isotropic = True
        for at in range(8, len(card), step):
            if not any(card.text(at + shift + k) for k in range(3)):
                if any(card.text(k) for k in range(at + 1, len(card))) or plies:
                    continue
                break
            if card.text(at + shift):
                ply_material = self._deck.materials.get(card, at + shift, "MID")
                material, isotropic = ply_material.name, isotropic and ply_material.is_isotropic
            elif not material:
                raise card.wrong(at + shift, "MID1", "the material of the first ply")
            if card.text(at + shift + 1) or not plies:
                thickness, place = card.positive(at + shift + 1, "T"), card.place(at + shift + 1)
            plies.append(Ply(material, thickness, card.real(at + shift + 2, "THETA", 0.0), place))
            if len(plies) > _MOST_PLIES:
                raise card.error(f"more than {_MOST_PLIES} plies")
        if not plies:
            raise card.error("it has no plies")
        if lamina == "SYM":
            plies += plies[::-1]
        elif lamina and lamina not in ("BLANK", "NO"):
            self._deck.notes.add(card, "laminate_option", card.name, lamina=lamina)
        total = sum(ply.thickness for ply in plies)
        offset = card.real(1, "Z0", -total / 2) + total / 2
        return _Property(card, name, tuple(plies), offset, self._mass(card, 2), isotropic)

    def _mass(self, card: Card, index: int) -> float:
        """Non-structural mass per area of a property."""
        extra = self._extra.get((family(card.name), card.integer(0, "PID")), 0.0)
        return card.real(index, "NSM", 0.0) * self._deck.mass_factor + extra

    def _block(self, group: _Group) -> Elements:
        section, nodes = group.section, np.array(group.nodes, dtype=np.int64)
        normals, sides = _frames(self._deck.grids.places[nodes])
        axes = _turned(sides, normals, np.radians(group.angles))
        for at, number in group.special.items():
            axes[at] = (
                self._projected(group.cards[at], number, nodes[at], normals[at], section)
                or axes[at]
            )
        offsets = None
        if any(group.offsets):
            arms = np.array(group.offsets)[:, None] * normals
            offsets = np.repeat(arms[:, None, :], nodes.shape[1], axis=1)
        thickness = self._thicknesses(group)
        self._store(section, thickness)
        numbers, lines = (
            np.array(each, dtype=np.int64)
            for each in (group.numbers, [card.where.line for card in group.cards])
        )
        files = tuple(card.where.file for card in group.cards)
        kind = group.layout.cell_type.name
        return Elements(
            kind,
            numbers,
            nodes,
            section.set,
            axes,
            lines,
            offsets=offsets,
            thickness=thickness,
            files=files,
        )

    def _projected(
        self, card: Card, number: int, nodes: Floats, normal: Floats, section: _Property
    ) -> tuple[float, float, float] | None:
        """Axis 1 of a coordinate system on an element; None where it has none and needs none."""
        axis = self._deck.grids.systems[number].axes_at(
            self._deck.grids.places[nodes].mean(axis=0)
        )[0]
        flat = axis - (axis @ normal) * normal
        size = float(np.linalg.norm(flat))
        if size < 1e-6:
            if section.is_isotropic:
                return None
            raise card.error(
                f"axis 1 of the system {number} (MCID) stands on the element; it gives plies no"
                " direction"
            )
        x, y, z = (flat / size).tolist()
        return x, y, z

    def _thicknesses(self, group: _Group) -> Floats | None:
        """(e, n) at the nodes, where elements state their own; a side's middle has the mean of its
        ends.
        """
        if not group.own_thickness:
            if group.section.thickness is None:
                raise group.cards[0].error(
                    f"neither it nor {group.section.card.title} ({group.section.card.where}) states"
                    " a thickness"
                )
            return None
        corners = len(group.layout.fields.thickness)
        thickness = np.full((len(group.numbers), corners), group.section.thickness or np.nan)
        for at, own in group.own_thickness.items():
            thickness[at] = own
        bare = np.flatnonzero(np.isnan(thickness).any(axis=1))
        if bare.size:
            raise group.cards[bare[0]].error(
                f"neither it nor {group.section.card.title} states a thickness"
            )
        if len(group.layout.fields.grids) > corners:
            thickness = np.hstack([thickness, (thickness + np.roll(thickness, -1, axis=1)) / 2])
        return thickness

    def _store(self, section: _Property, thickness: Floats | None) -> None:
        plies = section.plies
        if section.thickness is None and thickness is not None and section.set not in self.sections:
            plies = (Ply(plies[0].material, float(thickness.mean())),)
        shell = ShellSection(plies, section.card.where, section.offset, section.extra_mass)
        self.sections.setdefault(section.set, shell)


def _without_middles(card: Card, layout: _Layout) -> _Layout:
    """The layout of corners alone, where an element leaves out the middles of its sides."""
    corners = layout.cell_type.corners
    left_out = [not card.text(index) for index in layout.fields.grids[corners:]]
    if not any(left_out):
        return layout
    if not all(left_out):
        index = layout.fields.grids[corners + left_out.index(True)]
        raise card.wrong(
            index, f"G{index - 1}", "a grid; the middles of all sides, or of none, can be left out"
        )
    return next(
        each
        for each in LAYOUTS.values()
        if each.cell_type.nodes == each.cell_type.corners == corners
    )


def _frames(places: Floats) -> tuple[Floats, Floats]:
    """(e, 3) unit normals, and directions of the first side on the surface; of no length where an
    element has no size.
    """
    corners = places[:, : 4 if places.shape[1] in (4, 8) else 3]
    normals = unit(normals_of(corners))
    side = corners[:, 1] - corners[:, 0]
    return normals, unit(side - np.einsum("ek,ek->e", side, normals)[:, None] * normals)


def _turned(directions: Floats, normals: Floats, angles: Floats) -> Floats:
    """Directions turned about normals."""
    c, s = np.cos(angles)[:, None], np.sin(angles)[:, None]
    return np.asarray(c * directions + s * np.cross(normals, directions))
