"""Sections of a deck, and the elements that have them."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from modalbase.formats.cell_types import CELL_TYPES
from modalbase.formats.constants import ROUND_OFF
from modalbase.formats.models.check import normals_of, unit
from modalbase.formats.models.inp.beams import beam_section, directions
from modalbase.formats.models.inp.lines import DataLine, Keyword, folded
from modalbase.formats.models.inp.materials import InpMaterials
from modalbase.formats.models.inp.mesh import InpElement, InpMesh
from modalbase.formats.models.inp.orientations import Orientation, Part, axis_of_shells
from modalbase.formats.models.model import (
    BeamSection,
    Elements,
    Floats,
    Integers,
    Ply,
    ShellSection,
    Where,
)

SHELLS = ("SHELLSECTION", "SHELLGENERALSECTION")
BEAMS = ("BEAMSECTION", "BEAMGENERALSECTION")
MOST_PLIES = 1000
ALIKE_DEG = 0.05
"""Angles of a ply may differ so much between elements where they are read from orientations, for
rounding.
"""


class Sections:
    """Sections and their elements as they are read.

    Attributes:
        by_name: sections by the name of their set.
        blocks: elements.
    """

    def __init__(self, mesh: InpMesh, materials: InpMaterials) -> None:
        self.by_name: dict[str, ShellSection | BeamSection] = {}
        self.blocks: dict[tuple[str, str], list[Elements]] = {}
        self.members: dict[str, list[int]] = {}
        self._mesh, self._materials = mesh, materials
        self._places = np.array(mesh.places).reshape(-1, 3)
        self._of: dict[int, Keyword] = {}
        self._names: dict[Where, str] = {}

    def read(self, card: Keyword, part: Part, thickness: Mapping[int, float]) -> None:
        """Take a section's card.

        Args:
            card: of the section.
            part: what it belongs to.
            thickness: of nodes that *NODAL THICKNESS names, by row.
        """
        chosen = part.elements(card.needs("ELSET"), card)
        role = "shell" if card.name in SHELLS else "beam"
        for at in chosen:
            element = self._mesh.elements[at]
            if element.type.role != role:
                raise card.error(
                    f"has element {element.number} of {element.row.where}, which is no {role}"
                    " element"
                )
            if at in self._of:
                before = self._of[at].where
                raise card.error(
                    f"gives element {element.number} a section, which has that of {before}"
                )
            self._of[at] = card
        if not chosen:
            return
        name = self._name(card, part)
        self.members.setdefault(name, []).extend(chosen)
        kinds: dict[str, list[int]] = {}
        for at in chosen:
            kinds.setdefault(self._mesh.elements[at].type.kind, []).append(at)
        (self._shells if role == "shell" else self._beams)(card, part, name, kinds, thickness)

    def _name(self, card: Keyword, part: Part) -> str:
        """Of the set: the deck's ELSET in small letters, with the part's before it where two have
        one name.
        """
        key = card.where
        if key not in self._names:
            own = "_".join(folded(card.get("ELSET")).split())
            longer = (
                f"{'_'.join(folded(part.name).split())}.{own}"
                if part.name
                else f"{own}_{card.where.line}"
            )
            self._names[key] = own if own not in self._names.values() else longer
        return self._names[key]

    def _shells(
        self,
        card: Keyword,
        part: Part,
        name: str,
        kinds: Mapping[str, list[int]],
        thickness: Mapping[int, float],
    ) -> None:
        system = part.system(card.get("ORIENTATION"), card)
        by_nodes = "NODALTHICKNESS" in card.parameters
        stack = self._stack(card, by_nodes)
        if (
            system is None
            and "COMPOSITE" in card.parameters
            and (first := _named_orientation(stack[0]))
        ):
            system = part.system(first, card)
        rows = {kind: np.array(chosen) for kind, chosen in kinds.items()}
        parts = [
            (kind, chosen, *self._shell_axes(kind, chosen, system)) for kind, chosen in rows.items()
        ]
        plies = tuple(self._ply(row, parts, part, card) for row in stack)
        total = sum(ply.thickness for ply in plies)
        section = ShellSection(plies, card.where, -_offset(card) * total)
        self.by_name[name] = section
        for kind, chosen, axes, _ in parts:
            nodes = self._nodes(chosen)
            own = self._nodal(card, nodes, thickness, None if by_nodes else total)
            if own is not None and (section.offset or len(plies) > 1):
                raise card.error(
                    "has OFFSET or plies where *NODAL THICKNESS names its nodes; give the thickness"
                    " by sets"
                )
            self._add(name, kind, chosen, nodes, axes, thickness=own)

    def _nodal(
        self, card: Keyword, nodes: Integers, thickness: Mapping[int, float], else_: float | None
    ) -> Floats | None:
        """Thickness at the elements' nodes; None where *NODAL THICKNESS names none of them.

        That card goes before the section's own thickness, as CalculiX has it.
        """
        used = np.unique(nodes).tolist()
        missing = [node for node in used if node not in thickness]
        if missing and else_ is None:
            raise card.error(
                "has NODAL THICKNESS, but *NODAL THICKNESS gives none to node"
                f" {self._mesh.numbers[missing[0]]}"
            )
        if len(missing) == len(used):
            return None
        return np.array(
            [[thickness.get(node, else_ or 0.0) for node in row] for row in nodes.tolist()]
        )

    def _shell_axes(
        self, kind: str, chosen: Integers, system: Orientation | None
    ) -> tuple[Floats, Floats]:
        """(e, 3) axis 1 and normals."""
        corners = self._places[self._nodes(chosen)[:, : CELL_TYPES[kind].corners]]
        normals = unit(normals_of(corners))
        axes = axis_of_shells(system, chosen, corners.mean(axis=1), normals)
        has_area = np.linalg.norm(normals, axis=1) > 0
        is_across = np.linalg.norm(np.cross(axes, normals), axis=1) > 1e-6
        if np.any(bad := has_area & ~is_across):
            element = self._mesh.elements[chosen[int(np.argmax(bad))]]
            raise element.row.error(
                f"has element {element.number}, on whose normal axis 1 of its orientation lies;"
                " state another *ORIENTATION"
            )
        return np.array(axes), normals

    def _stack(self, card: Keyword, by_nodes: bool) -> list[tuple[DataLine, float, str, str]]:
        """Row, thickness, material and angle or orientation of each ply."""
        if "COMPOSITE" not in card.parameters:
            if card.name == "SHELLGENERALSECTION" and not card.get("MATERIAL"):
                raise card.error(
                    "states stiffnesses by numbers; give MATERIAL= and a thickness, or COMPOSITE"
                )
            if card.get("SHELLTHICKNESS"):
                raise card.error(
                    "has SHELL THICKNESS from a distribution; give the thickness by sets or by"
                    " NODAL THICKNESS"
                )
            row = (
                DataLine(card.label, "1", card.where) if by_nodes and not card.rows else card.first
            )
            return [
                (
                    row,
                    self._thickness(row, row.fields[0] if row.fields else "", by_nodes),
                    card.needs("MATERIAL"),
                    "",
                )
            ]
        if by_nodes:
            raise card.error("is COMPOSITE with NODAL THICKNESS; give the plies by sets")
        if len(card.rows) > MOST_PLIES:
            raise card.error(f"has {len(card.rows)} plies, at most {MOST_PLIES} are read")
        plies = []
        for row in [card.first, *card.rows[1:]]:
            fields = [*row.fields, "", "", ""]
            if not fields[2]:
                raise row.error(
                    "names no material; expected thickness, points, material, angle or orientation"
                )
            plies.append((row, self._thickness(row, fields[0], False), fields[2], fields[3]))
        return plies + plies[::-1] if "SYMMETRIC" in card.parameters else plies

    def _thickness(self, row: DataLine, text: str, by_nodes: bool) -> float:
        value = row.number(text, "the thickness")
        if not (0 < value < 1e9 or by_nodes):
            raise row.error(f"the thickness is {value:g}, expected a length above 0")
        return value if value > 0 else 1.0  # which the nodes' own takes the place of

    def _ply(
        self,
        stacked: tuple[DataLine, float, str, str],
        parts: list[tuple[str, Integers, Floats, Floats]],
        part: Part,
        card: Keyword,
    ) -> Ply:
        row, thickness, material, angle = stacked
        name = self._materials.named(material, row if "COMPOSITE" in card.parameters else card)
        other = _named_orientation(stacked)
        degrees = (
            self._angle(part.system(other, row), parts, row)
            if other
            else row.number(angle or "0", "the angle")
        )
        return Ply(name, thickness, degrees, row.place(0))

    def _angle(
        self,
        system: Orientation | None,
        parts: list[tuple[str, Integers, Floats, Floats]],
        row: DataLine,
    ) -> float:
        """Angle in degrees from the section's axis 1 to that of a ply's own orientation, about the
        normals.
        """
        angles = []
        for kind, chosen, axes, normals in parts:
            own, _ = self._shell_axes(kind, chosen, system)
            first = axes - np.sum(axes * normals, axis=1, keepdims=True) * normals
            sine = np.sum(np.cross(first, own) * normals, axis=1)
            angles.append(np.degrees(np.arctan2(sine, np.sum(first * own, axis=1))))
        every = np.concatenate(angles)
        apart = (every - every[0] + 180) % 360 - 180
        if np.abs(apart).max() > ALIKE_DEG:
            raise row.error(
                f"turns its ply by {every[0]:.2f}° in one element and"
                f" {every[np.argmax(np.abs(apart))]:.2f}° in another; give the section an"
                " ORIENTATION and the plies angles, or split the set"
            )
        return float(np.round(every[0] + apart.mean(), 9))

    def _beams(
        self,
        card: Keyword,
        part: Part,
        name: str,
        kinds: Mapping[str, list[int]],
        thickness: Mapping[int, float],
    ) -> None:
        if any(
            node in thickness
            for chosen in kinds.values()
            for at in chosen
            for node in self._mesh.elements[at].nodes
        ):
            raise card.error(
                "is a beam whose nodes *NODAL THICKNESS names; give its dimensions by sets"
            )
        every = [self._mesh.elements[at] for chosen in kinds.values() for at in chosen]
        section, first, centroid = beam_section(card, name, every, self._materials)
        self.by_name[name] = section
        for kind, chosen in kinds.items():
            nodes = self._nodes(np.array(chosen))
            axes, second = directions(
                self._places, [self._mesh.elements[at] for at in chosen], first @ part.move.turn.T
            )
            offsets = None
            if np.hypot(*centroid) > ROUND_OFF * section.area**0.5:
                arm = centroid[0] * axes + centroid[1] * second
                offsets = np.repeat(arm[:, None], nodes.shape[1], axis=1)
            self._add(name, kind, np.array(chosen), nodes, axes, offsets=offsets)

    def _nodes(self, chosen: Integers) -> Integers:
        elements: list[InpElement] = [self._mesh.elements[at] for at in chosen.tolist()]
        return np.array(
            [[element.nodes[k] for k in element.type.order] for element in elements], dtype=np.int64
        )

    def _add(
        self,
        name: str,
        kind: str,
        chosen: Integers,
        nodes: Integers,
        axes: Floats,
        *,
        thickness: Floats | None = None,
        offsets: Floats | None = None,
    ) -> None:
        elements = [self._mesh.elements[at] for at in chosen.tolist()]
        numbers = np.array([element.number for element in elements], dtype=np.int64)
        lines = np.array([element.row.where.line for element in elements], dtype=np.int64)
        files = tuple(element.row.where.file for element in elements)
        block = Elements(
            kind,
            numbers,
            nodes,
            name,
            axes,
            lines,
            offsets=offsets,
            thickness=thickness,
            files=files,
        )
        self.blocks.setdefault((name, kind), []).append(block)

    def joined(self) -> tuple[Elements, ...]:
        """The blocks, one of each set and kind.

        Raises:
            FormatError: an element has no section.
        """
        for at, element in enumerate(self._mesh.elements):
            if element.type.role in ("shell", "beam") and at not in self._of:
                raise element.row.error(
                    f"has element {element.number}, which no *{element.type.role.upper()} SECTION"
                    " has; give its set one"
                )
        return tuple(
            _together(blocks, self.by_name[name]) for (name, _), blocks in self.blocks.items()
        )


def _together(blocks: list[Elements], section: ShellSection | BeamSection) -> Elements:
    """One block of those of several instances."""
    if len(blocks) == 1:
        return blocks[0]
    first = blocks[0]
    # a section's own, so that all have them or none
    offsets = [b.offsets for b in blocks if b.offsets is not None]
    thickness = []
    if isinstance(section, ShellSection) and any(b.thickness is not None for b in blocks):
        total = sum(ply.thickness for ply in section.plies)
        thickness = [
            np.full(b.nodes.shape, total) if b.thickness is None else b.thickness for b in blocks
        ]
    columns = zip(*((b.numbers, b.nodes, b.axes, b.lines) for b in blocks), strict=True)
    numbers, nodes, axes, lines = (np.concatenate(column) for column in columns)
    files = tuple(file for b in blocks for file in b.files)
    merged = Elements(first.kind, numbers, nodes, first.set, axes, lines, files=files)
    if offsets:
        merged = replace(merged, offsets=np.concatenate(offsets))
    return replace(merged, thickness=np.concatenate(thickness)) if thickness else merged


def _named_orientation(stacked: tuple[DataLine, float, str, str]) -> str:
    """The orientation that a ply names instead of an angle; empty where it states an angle or
    none.
    """
    angle = stacked[3]
    try:
        float(angle or "0")
    except ValueError:
        return angle
    return ""


def _offset(card: Keyword) -> float:
    """Of the nodes from the middle, in thicknesses."""
    text = card.get("OFFSET").upper()
    named = {"": 0.0, "SPOS": 0.5, "SNEG": -0.5, "MID": 0.0, "MIDDLE": 0.0}
    if text in named:
        return named[text]
    try:
        value = float(text)
    except ValueError:
        raise card.error(f"has OFFSET={text}, expected a number, SPOS or SNEG") from None
    if not abs(value) <= 1000:
        raise card.error(f"has OFFSET={text}, expected a number of thicknesses of at most 1000")
    return value
