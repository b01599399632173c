"""A deck to the neutral model."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from modalbase.formats.models.check import check, gathered, on_independent_nodes
from modalbase.formats.models.equations import links_of
from modalbase.formats.models.inp.carried import PROPERTIES, Carried, add_nonstructural_mass
from modalbase.formats.models.inp.held import NAMES, Constraints, note_prestress, supports
from modalbase.formats.models.inp.lines import (
    MOST_LINES,
    InpReport,
    Keyword,
    card_names,
    folded,
    read_cards,
    squeezed,
)
from modalbase.formats.models.inp.materials import InpMaterials
from modalbase.formats.models.inp.mesh import AT_REST, InpMesh, Move
from modalbase.formats.models.inp.orientations import Part, orientation, transforms
from modalbase.formats.models.inp.sections import BEAMS, SHELLS, Sections
from modalbase.formats.models.model import FiniteElementModel, Floats
from modalbase.formats.uff.text import decoded

MOST_INSTANCES = 1000
"""Each reads its part's lines again, at most `MOST_LINES` together."""

_GENERATORS = frozenset(["NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY"])
_USED = card_names(
    "NODE ELEMENT NSET ELSET SYSTEM HEADING MATERIAL ELASTIC DENSITY ORIENTATION TRANSFORM"
    " DISTRIBUTION DISTRIBUTIONTABLE NODALTHICKNESS BOUNDARY SURFACE COUPLING ENDCOUPLING"
    " NONSTRUCTURALMASS FREQUENCY STEP ENDSTEP ASSEMBLY ENDASSEMBLY"
)


@dataclass
class InpDeck:
    """Cards by where they belong."""

    # cards of each part, by folded name
    parts: dict[str, list[Keyword]] = field(default_factory=dict)
    # card and cards of each instance
    instances: list[tuple[Keyword, list[Keyword]]] = field(default_factory=list)
    own: list[Keyword] = field(default_factory=list)  # those of the assembly and of the model
    # those of each step, with the card *STEP
    steps: list[list[Keyword]] = field(default_factory=list)


def read_inp(content: bytes, included: Mapping[str, bytes] | None = None) -> FiniteElementModel:
    """The model of a deck of Abaqus or CalculiX.

    An element belongs to the set of its section, whose name is the section's ELSET in small
    letters, since names are alike in capitals and without; so a constant is `flange.E1`. Where two
    parts have one name, the second has its part's name before it. Nodes of several instances may
    have one number; those of later instances then have a million more for each.

    Args:
        content: the deck.
        included: files that it includes, by name.

    Raises:
        FormatError: it is no such deck, is broken, or has what is not read; names file, line and
            card.
    """
    deck = _sorted(read_cards(content, included or {}))
    mesh = InpMesh()
    model = _InpReading(deck, mesh, _meshed(deck, mesh)).model()
    check(model)
    return model


def _sorted(cards: list[Keyword]) -> InpDeck:
    """Cards by part, instance and step.

    Raises:
        FormatError: one is not closed, or closed before it begins.
    """
    deck = InpDeck()
    opened: Keyword | None = None
    taken = deck.own
    for card in cards:
        if card.name in ("PARAMETER", *_GENERATORS):
            raise card.error(
                "makes numbers as the solver reads it; write the deck out with numbers, nodes and"
                " elements"
            )
        if card.name in ("PART", "INSTANCE", "STEP"):
            if opened is not None:
                raise card.error(
                    f"stands within {opened.label} of {opened.where}, which is not closed; is the"
                    " file cut?"
                )
            opened = card
            taken = _begun(deck, card)
        elif card.name in ("ENDPART", "ENDINSTANCE", "ENDSTEP"):
            if opened is None or f"END{opened.name}" != card.name:
                raise card.error(f"closes nothing: there is no *{card.name[3:]} before it")
            opened, taken = None, deck.own
        else:
            taken.append(card)
    if opened is not None:
        raise opened.error(f"is not closed by *END {opened.name}; is the file cut?")
    return deck


def _begun(deck: InpDeck, card: Keyword) -> list[Keyword]:
    """Where the cards of a part, instance or step go."""
    if card.name == "STEP":
        deck.steps.append([card])
        return deck.steps[-1]
    if card.name == "INSTANCE":
        deck.instances.append((card, []))
        return deck.instances[-1][1]
    name = folded(card.needs("NAME"))
    if name in deck.parts:
        raise card.error(f"{name} is there already; give it another name")
    deck.parts[name] = []
    return deck.parts[name]


def _meshed(deck: InpDeck, mesh: InpMesh) -> list[Part]:
    """The instances and then the deck itself, whose meshes are read."""
    if len(deck.instances) > MOST_INSTANCES:
        raise deck.instances[-1][0].error(
            f"is instance {len(deck.instances)}; at most {MOST_INSTANCES} are read"
        )
    parts: list[Part] = []
    read = 0
    for card, cards in deck.instances:
        name, part = folded(card.needs("NAME")), folded(card.get("PART"))
        if part not in deck.parts:
            there = ", ".join(deck.parts) or "none"
            raise card.error(f"names the part {part!r}, which no *PART has; there are {there}")
        if name in mesh.scopes:
            raise card.error(f"{name} is there already; give it another name")
        every = deck.parts[part] + cards
        read += sum(1 + len(each.rows) for each in every)
        if read > MOST_LINES:
            raise card.error(
                f"takes the lines of all instances above {MOST_LINES}, which is the most that is"
                " read"
            )
        parts.append(Part(mesh, every, name, part, _move(card)))
        mesh.read(every, name, parts[-1].move)
    named = [card for step in deck.steps for card in step if card.name in ("NSET", "ELSET")]
    mesh.read([*deck.own, *named], "")
    return [*parts, Part(mesh, deck.own)]


def _move(card: Keyword) -> Move:
    """Where an instance stands: moved by the first line, then turned about the axis of the
    second.
    """
    if not card.rows:
        return AT_REST
    shift = np.array([*card.first.numbers("a translation"), 0.0, 0.0][:3])
    if len(card.rows) < 2:
        return Move(np.eye(3), shift)
    row = card.rows[1]
    values = row.numbers("two points of an axis, and an angle", 7)
    a, along = np.array(values[:3]), np.array(values[3:6]) - np.array(values[:3])
    if not np.linalg.norm(along) > 0:
        raise row.error("gives one point twice, expected two points of an axis")
    x, y, z = along / np.linalg.norm(along)
    spin = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = np.radians(values[6])
    turn = np.eye(3) + np.sin(angle) * spin + (1 - np.cos(angle)) * spin @ spin
    return Move(turn, turn @ (shift - a) + a)


class _InpReading:
    """The model's members, taken from the cards of one part after the other; the last is the deck
    itself.
    """

    def __init__(self, deck: InpDeck, mesh: InpMesh, parts: list[Part]) -> None:
        self._deck, self._mesh, self._parts = deck, mesh, parts
        self._report, self._materials = InpReport(), InpMaterials()
        self._materials.read([card for part in parts for card in part.cards])
        for card in self._materials.hot:
            self._report.note(card, "other_temperatures")
        self._sections = Sections(mesh, self._materials)
        self._carried = Carried(mesh, self._report)

    def model(self) -> FiniteElementModel:
        """The whole."""
        mesh, deck, report = self._mesh, self._deck, self._report
        axes: dict[int, Floats] = {}
        for part in self._parts:
            axes |= transforms(part)
        constraints = Constraints(mesh, report, axes)
        self._take_systems(constraints)
        for part in self._parts:
            self._properties(part, axes)
        blocks = self._sections.joined()
        self._carried.complete()
        for row in mesh.node_rows:
            if row.text.count(",") > 3 and len(row.fields) > 4:
                report.note(row, "node_normals")
        for element in mesh.elements:
            if element.type.loss:
                report.lost(element.row, element.type.loss, element.type.changes)
        # by card, which the instances of a part share
        nonstructural: dict[int, tuple[Keyword, list[Part]]] = {}
        for part in self._parts:
            for card in part.named(*NAMES):
                constraints.read(card, part)
            for card in part.named("NONSTRUCTURALMASS"):
                nonstructural.setdefault(id(card), (card, []))[1].append(part)
        for card, parts in nonstructural.values():
            add_nonstructural_mass(card, self._sections, parts, blocks, report)
        initial = [(card, part) for part in self._parts for card in part.named("BOUNDARY")]
        held = supports(initial, deck.steps, self._parts[-1], axes, report)
        note_prestress(deck.steps, report)
        self._note_unused()
        used = {name for section in self._sections.by_name.values() for name in section.materials}
        places = np.array(mesh.places).reshape(-1, 3)
        links = gathered([*constraints.links, *links_of(constraints.equations, places, axes)])
        return FiniteElementModel(
            "inp",
            self._title(),
            self._numbers(),
            places,
            blocks,
            self._sections.by_name,
            {name: material for name, material in self._materials.by_name.items() if name in used},
            self._node_sets(),
            axes,
            tuple(self._carried.masses),
            tuple(self._carried.springs),
            links,
            tuple(on_independent_nodes((*constraints.supports, *held), links, places)),
            report.skipped,
        )

    def _take_systems(self, constraints: Constraints) -> None:
        """Give each part its orientations, those of the deck itself where it has no other; and note
        its surfaces.
        """
        whole = self._parts[-1]
        for part in reversed(self._parts):
            part.systems |= whole.systems
            tables = {folded(card.get("NAME")): card for card in part.named("DISTRIBUTION")}
            for card in part.named("ORIENTATION", "SURFACE"):
                name = folded(card.needs("NAME"))
                if card.name == "SURFACE":
                    constraints.surfaces[part.scope, name] = card, part
                else:
                    part.systems[name] = orientation(card, part, tables)

    def _properties(self, part: Part, axes: dict[int, Floats]) -> None:
        thickness = self._thickness(part)
        for card in part.named(*SHELLS, *BEAMS, *PROPERTIES.values()):
            if card.name in PROPERTIES.values():
                self._carried.read(card, part, axes)
            else:
                self._sections.read(card, part, thickness)
                self._note_section(card, part)

    def _note_section(self, card: Keyword, part: Part) -> None:
        """Note what a section says beyond what is read, or in two ways."""
        for parameter in ("DENSITY", "BENDING ONLY", "MEMBRANE ONLY", "STIFFNESS MODIFIER"):
            if card.name in SHELLS and squeezed(parameter) in card.parameters:
                self._report.note(card, "section_parameter", parameter=parameter)
        if card.get("SECTION").upper() == "CIRC" and len(card.first.fields) == 1 and not part.scope:
            self._report.note(card, "circ")

    def _thickness(self, part: Part) -> dict[int, float]:
        """Of the nodes that *NODAL THICKNESS names, by row."""
        thicknesses: dict[int, float] = {}
        for row in (row for card in part.named("NODALTHICKNESS") for row in card.rows):
            name, value = [*row.fields, "", ""][:2]
            thickness = row.number(value, "the thickness")
            if not 0 < thickness < 1e9:
                raise row.error(f"the thickness is {thickness:g}, expected a length above 0")
            thicknesses |= dict.fromkeys(part.nodes(name, row).tolist(), thickness)
        return thicknesses

    def _note_unused(self) -> None:
        used = _USED | NAMES | set(SHELLS) | set(BEAMS) | set(PROPERTIES.values())
        deck = self._deck
        steps = [step[1:] for step in deck.steps]
        for cards in (deck.own, *steps, *deck.parts.values(), *(own for _, own in deck.instances)):
            for card in cards:
                if card.name not in used:
                    self._report.unused(card)

    def _title(self) -> str:
        heading = next(
            (card for card in self._deck.own if card.name == "HEADING" and card.rows), None
        )
        text = heading.rows[0].text if heading else ""
        return decoded(text.encode("latin-1"))[:200]

    def _numbers(self) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
        """The user's numbers of nodes; where instances share one, a million more for each instance
        before.
        """
        numbers = np.array(self._mesh.numbers, dtype=np.int64)
        if len(np.unique(numbers)) == len(numbers):
            return numbers
        step = 10 ** len(str(int(np.abs(numbers).max())))
        for k, scope in enumerate([name for name in self._mesh.scopes if name]):
            rows = np.fromiter(self._mesh.scopes[scope].nodes.values(), dtype=np.int64)
            numbers[rows] += k * max(step, 1_000_000)
        own = np.fromiter(self._mesh.scopes[""].nodes.values(), dtype=np.int64)
        numbers[own] += (len(self._mesh.scopes) - 1) * max(step, 1_000_000)
        return numbers

    def _node_sets(self) -> dict[str, np.ndarray[tuple[int], np.dtype[np.int64]]]:
        """All named sets; of an instance with its name before them, unless it is the only one."""
        one_instance = len(self._mesh.scopes) == 2
        sets = {}
        for scope, own in self._mesh.scopes.items():
            for name, defined in own.node_sets.items():
                full = (
                    f"{scope}.{name}"
                    if scope and not (one_instance and name not in self._mesh.scopes[""].node_sets)
                    else name
                )
                sets[full] = self._mesh.select("node", name, scope, defined[0].card)
        return sets
