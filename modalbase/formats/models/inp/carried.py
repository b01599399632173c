"""What a structure carries: masses at points, rotary inertia, springs, and mass that is spread."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from modalbase.formats.models.check import sizes
from modalbase.formats.models.inp.lines import DataLine, InpReport, Keyword
from modalbase.formats.models.inp.mesh import InpElement, InpMesh
from modalbase.formats.models.inp.orientations import Orientation, Part
from modalbase.formats.models.inp.sections import Sections
from modalbase.formats.models.model import BeamSection, Elements, Floats, PointMass, Spring, Where

PROPERTIES = {"mass": "MASS", "inertia": "ROTARYINERTIA", "spring": "SPRING"}
"""The card that elements of a role need."""


class Carried:
    """Masses and springs as they are read."""

    def __init__(self, mesh: InpMesh, report: InpReport) -> None:
        self.masses: list[PointMass] = []
        self.springs: list[Spring] = []
        self._mesh, self._report = mesh, report
        self._done: set[int] = set()

    def read(self, card: Keyword, part: Part, axes: dict[int, Floats]) -> None:
        """Take a card *MASS, *ROTARY INERTIA or *SPRING; `axes` are those of nodes, by row."""
        role = next(role for role, name in PROPERTIES.items() if name == card.name)
        chosen = part.elements(card.needs("ELSET"), card)
        for at in chosen:
            element = self._mesh.elements[at]
            if element.type.role != role:
                raise card.error(f"has element {element.number}, whose type is {element.type.name}")
            if at in self._done:
                raise card.error(f"has element {element.number}, which has a {card.label} already")
            self._done.add(at)
        elements = [self._mesh.elements[at] for at in chosen]
        {"mass": self._mass, "inertia": self._inertia, "spring": self._spring}[role](
            card, part, elements, axes
        )

    def _mass(
        self, card: Keyword, part: Part, elements: list[InpElement], axes: dict[int, Floats]
    ) -> None:
        del part, axes
        if card.get("TYPE").upper() not in ("", "ISOTROPIC"):
            raise card.error(
                f"has TYPE={card.get('TYPE')}: a mass is alike along all axes; give it by one"
                " number"
            )
        mass = card.first.numbers("a mass")[0]
        if not 0 <= mass < 1e12:
            raise card.first.error(f"is a mass of {mass:g}, expected one of at least 0")
        self.masses += [PointMass(element.nodes[0], mass, card.where) for element in elements]

    def _inertia(
        self, card: Keyword, part: Part, elements: list[InpElement], axes: dict[int, Floats]
    ) -> None:
        del axes
        a, b, c, ab, ac, bc = [
            *card.first.numbers("I11, I22, I33, I12, I13, I23", 3),
            0.0,
            0.0,
            0.0,
        ][:6]
        tensor = np.array([[a, ab, ac], [ab, b, bc], [ac, bc, c]])
        if np.linalg.eigvalsh(tensor).min() < -1e-9 * np.abs(tensor).max():
            raise card.first.error("is an inertia below 0 about some axis")
        system = part.system(card.get("ORIENTATION"), card)
        for element in elements:
            turn = np.eye(3) if system is None else self._axes(system, element)
            rows = tuple(tuple(row) for row in (turn.T @ tensor @ turn).tolist())
            self.masses.append(PointMass(element.nodes[0], 0.0, card.where, rows))

    def _axes(self, system: Orientation, element: InpElement) -> Floats:
        """(3, 3) of a system at an element's first node."""
        axes: Floats = system.at(np.array([self._mesh.places[element.nodes[0]]]))[0]
        return axes

    def _spring(
        self, card: Keyword, part: Part, elements: list[InpElement], axes: dict[int, Floats]
    ) -> None:
        if "NONLINEAR" in card.parameters:
            self._report.note(card, "spring_not_linear")
            return
        system = part.system(card.get("ORIENTATION"), card)
        for element in elements:
            if element.type.name == "SPRINGA":
                self.springs.append(self._axial(card, element))
                continue
            if len(card.rows) < 2:
                raise card.error(
                    "has one data line, expected the dofs and below them the stiffness"
                )
            dofs = [card.first.whole(text, "a dof") for text in card.first.fields]
            if len(dofs) < len(element.nodes) or any(not 1 <= dof <= 6 for dof in dofs):
                raise card.first.error(f"expected {len(element.nodes)} dof(s) from 1 to 6")
            k = _stiffness(card.rows[1])
            turned = axes.get(element.nodes[0]) if system is None else self._axes(system, element)
            self.springs.append(_between(element, dofs, k, card.where, turned))

    def _axial(self, card: Keyword, element: InpElement) -> Spring:
        a, b = (np.array(self._mesh.places[node]) for node in element.nodes)
        length = float(np.linalg.norm(b - a))
        if not length > 0:
            raise element.row.error(
                f"puts both nodes of the spring {element.number} at one place; use SPRING2"
            )
        x, y, z = ((b - a) / length).tolist()
        stiffness = _stiffness(card.rows[-1] if card.rows else card.first)
        first, second = element.nodes
        return Spring(
            first, 0, stiffness, card.where, second=second, second_dof=0, direction=(x, y, z)
        )

    def complete(self) -> None:
        """Raise where an element of a mass or spring has no value."""
        for at, element in enumerate(self._mesh.elements):
            if element.type.role in PROPERTIES and at not in self._done:
                raise element.row.error(
                    f"has element {element.number} of {element.type.name}, to which no card gives a"
                    " value"
                )


def _stiffness(row: DataLine) -> float:
    k = row.numbers("a stiffness")[0]
    if not 0 <= k < 1e25:
        raise row.error(f"is a stiffness of {k:g}, expected one of at least 0")
    return k


def _between(
    element: InpElement, dofs: list[int], k: float, where: Where, turned: Floats | None
) -> Spring:
    """A spring between dofs, or from one to the ground."""
    first = dofs[0] - 1
    second, second_dof = (element.nodes[1], dofs[1] - 1) if len(element.nodes) > 1 else (None, None)
    if turned is None:
        return Spring(element.nodes[0], first, k, where, second, second_dof)
    if second_dof is not None and second_dof != first:
        raise element.row.error(
            f"joins two different dofs in turned axes by the spring {element.number}; use the"
            " model's axes"
        )
    x, y, z = turned[first % 3].tolist()
    kind = first - first % 3
    last = None if second is None else kind
    return Spring(
        element.nodes[0], kind, k, where, second=second, second_dof=last, direction=(x, y, z)
    )


def add_nonstructural_mass(
    card: Keyword,
    sections: Sections,
    parts: Sequence[Part],
    blocks: Iterable[Elements],
    report: InpReport,
) -> None:
    """Take *NONSTRUCTURAL MASS, of all instances that have it, into the sections of the sets that
    it covers as a whole.
    """
    units = card.get("UNITS").replace(" ", "").upper()
    chosen = {each for part in parts for each in part.elements(card.needs("ELSET"), card)}
    value = card.first.numbers("a mass")[0]
    if not 0 <= value < 1e12:
        raise card.first.error(f"is a mass of {value:g}, expected one of at least 0")
    names = [name for name, members in sections.members.items() if chosen & set(members)]
    whole = all(chosen >= set(sections.members[name]) for name in names)
    beams = {isinstance(sections.by_name[name], BeamSection) for name in names}
    fits = {
        "MASSPERAREA": beams == {False},
        "MASSPERLENGTH": beams == {True},
        "TOTALMASS": len(beams) == 1,
    }
    if not whole or not fits.get(units, False):
        report.note(card, "spread_mass")
        return
    if units == "TOTALMASS":
        places = np.array(parts[0].mesh.places)
        total = sum(float(sizes(block, places).sum()) for block in blocks if block.set in names)
        value *= len(parts) / total
    for name in names:
        section = sections.by_name[name]
        sections.by_name[name] = replace(section, extra_mass=section.extra_mass + value)
