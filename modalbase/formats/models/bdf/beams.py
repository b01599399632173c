"""Bars, beams and rods, and their properties."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from inspect import signature
from math import pi

import numpy as np

from modalbase.formats.constants import ROUND_OFF
from modalbase.formats.models.bdf.card import Card
from modalbase.formats.models.bdf.deck import BdfDeck, family
from modalbase.formats.models.model import ALL_DOFS, BeamSection, Elements, Floats, Link
from modalbase.formats.models.shapes import NASTRAN, is_real

_OF_ELEMENT = {
    "CBAR": ("PBAR", "PBARL"),
    "CBEAM": ("PBEAM", "PBEAML"),
    "CROD": ("PROD",),
    "CTUBE": ("PTUBE",),
}
_STATIONS = ("YES", "YESA", "NO")
_LEAST = 1e-6
"""Share of a round bar's stiffness that stands for none, so that a rod is a beam."""


@dataclass(frozen=True)
class Property:
    """A section, its set, and where its centroid lies from the elements' ends, along axes 1 and
    2.
    """

    set: str
    section: BeamSection
    centroid: tuple[float, float] = (0.0, 0.0)


class BeamSections:
    """Sections of a deck, read when an element asks."""

    def __init__(self, deck: BdfDeck, extra: Mapping[tuple[str, int], float]) -> None:
        """Of a deck, and non-structural mass per length by family and number of property."""
        self._deck, self._extra = deck, extra
        self._read: dict[tuple[str | int, ...], Property] = {}

    def get(self, element: Card, number: int) -> Property:
        """The property of an element."""
        kinds = _OF_ELEMENT[element.name]
        key = (kinds[0], number)
        if key not in self._read:
            card = next(
                (
                    self._deck.profiles[kind][number]
                    for kind in kinds
                    if number in self._deck.profiles[kind]
                ),
                None,
            )
            if card is None:
                raise element.wrong(
                    1, "PID", f"a property of it; there is no {' or '.join(kinds)} {number}"
                )
            self._read[key] = self._of(card, number)
        return self._read[key]

    def rod(self, card: Card) -> Property:
        """The section of a CONROD, which states it itself; the set has the number of the first of
        its kind.
        """
        key: tuple[str | int, ...] = ("CONROD", *rod_key(card))
        if key not in self._read:
            values = [
                card.real(4, "A"),
                0.0,
                0.0,
                0.0,
                card.real(5, "J", 0.0),
                card.real(7, "NSM", 0.0),
            ]
            section = self._section(card, values, mid=3)
            self._read[key] = Property(f"conrod_{card.text(0)}", self._resisting(card, section))
        return self._read[key]

    def _of(self, card: Card, number: int) -> Property:
        parsed = getattr(self, f"_{card.name.lower()}")(card)
        section, centroid = parsed if isinstance(parsed, tuple) else (parsed, (0.0, 0.0))
        extra = section.extra_mass + self._extra.get((family(card.name), number), 0.0)
        section = self._resisting(card, replace(section, extra_mass=extra))
        return Property(self._deck.labels.of(card.name, number), section, centroid)

    def _section(
        self,
        card: Card,
        values: list[float],
        shear: tuple[float, float] | None = None,
        mid: int = 1,
    ) -> BeamSection:
        """A section of A, I1, I2, I12, J and NSM; Nastran's I1 is ∫y², of bending in the plane of
        axis 1.
        """
        area, first, second, mixed, torsion, extra = values
        if not area > 0:
            raise card.error(f"the area is {area:g}, expected above zero")
        if min(first, second, torsion) < 0 or mixed**2 > first * second:
            raise card.error(
                "the moments I1, I2, I12 and J are of no section; expected I1, I2, J ≥ 0 and I12² ≤"
                " I1 I2"
            )
        material = self._deck.materials.get(card, mid, "MID")
        if not material.is_isotropic:
            raise card.wrong(mid, "MID", f"a MAT1; {material.name} is not isotropic")
        mass = extra * self._deck.mass_factor
        inertia = (second, first, mixed)
        return BeamSection(
            material.name, area, inertia, torsion, card.where, shear=shear, extra_mass=mass
        )

    def _resisting(self, card: Card, section: BeamSection) -> BeamSection:
        """With a little of what a rod has none of."""
        round_bar = section.area**2 / (4 * pi)
        first, second, mixed = section.inertia
        if first > 0 and second > 0 and section.torsion > 0:
            return section
        self._deck.notes.add(card, "beam_without_inertia", card.name, least=_LEAST)
        inertia = (first or _LEAST * round_bar, second or _LEAST * round_bar, mixed)
        shear = section.shear if first > 0 or second > 0 else (_LEAST, _LEAST)
        torsion = section.torsion or 2 * _LEAST * round_bar
        return replace(section, inertia=inertia, torsion=torsion, shear=shear)

    def _shears(self, card: Card, first: float, second: float) -> tuple[float, float] | None:
        """K1 and K2; zero is rigid in shear."""
        if first > 0 and second > 0:
            return first, second
        if first > 0 or second > 0:
            self._deck.notes.add(card, "beam_shear", card.name)
        return None

    def _prod(self, card: Card) -> BeamSection:
        values = [
            card.real(2, "A"),
            0.0,
            0.0,
            0.0,
            card.real(3, "J", 0.0),
            card.real(5, "NSM", 0.0),
        ]
        return self._section(card, values)

    def _ptube(self, card: Card) -> BeamSection:
        outer = card.positive(2, "OD")
        wall = card.real(3, "T", 0.0) or outer / 2
        if not 0 < wall <= outer / 2:
            raise card.wrong(3, "T", "a wall of at most half the diameter OD")
        if card.text(5) and card.real(5, "OD2") != outer:
            self._deck.notes.add(card, "tube_tapers")
        inner = outer - 2 * wall
        area, torsion = pi * (outer**2 - inner**2) / 4, pi * (outer**4 - inner**4) / 32
        return self._section(card, [area, 0.0, 0.0, 0.0, torsion, card.real(4, "NSM", 0.0)])

    def _pbar(self, card: Card) -> BeamSection:
        names = ("A", "I1", "I2", "J", "NSM")
        area, first, second, torsion, extra = (
            card.real(2 + k, name, 0.0) for k, name in enumerate(names)
        )
        mixed = card.real(18, "I12", 0.0)
        shear = self._shears(card, card.real(16, "K1", 0.0), card.real(17, "K2", 0.0))
        section = self._section(card, [area, first, second, mixed, torsion, extra], shear)
        fields = (("area", 2), ("I2", 3), ("I1", 4), ("J", 5))  # I1 here is ∫z², Nastran's I2
        return replace(
            section, places={name: card.place(index) for name, index in fields if card.text(index)}
        )

    def _pbarl(self, card: Card) -> BeamSection:
        return self._shaped(card)[0]  # a bar's centroid and shear centre are one

    def _pbeaml(self, card: Card) -> tuple[BeamSection, tuple[float, float]]:
        section, centroid = self._shaped(card)
        if max(map(abs, centroid)) < ROUND_OFF * section.area**0.5:
            return section, (0.0, 0.0)
        self._note_centre(card)
        return section, centroid

    def _shaped(self, card: Card) -> tuple[BeamSection, tuple[float, float]]:
        kind, first = card.text(3), 8
        if kind not in NASTRAN:
            raise card.wrong(
                3, "TYPE", f"one of {', '.join(NASTRAN)}; else state the numbers with PBAR or PBEAM"
            )
        count = len(signature(NASTRAN[kind]).parameters)
        dimensions = [card.positive(first + k, f"DIM{k + 1}") for k in range(count)]
        extra = card.real(first + count, "NSM", 0.0)
        self._note_taper(card, first + count + 1, dimensions)
        try:
            shape = NASTRAN[kind](*dimensions)
        except (ValueError, ZeroDivisionError, OverflowError) as error:
            raise card.error(f"the dimensions are of no {kind}", first) from error
        if not is_real(shape):
            raise card.error(f"the dimensions are of no {kind}; look at their order", first)
        zz, yy, yz = shape.inertia
        values = [shape.area, yy, zz, yz, shape.torsion, extra]
        return self._section(card, values, shape.shear), shape.centroid

    def _note_taper(self, card: Card, after: int, dimensions: list[float]) -> None:
        """Note further stations of a PBEAML whose dimensions differ."""
        if card.name != "PBEAML":
            return
        at = after
        while at < len(card) and card.text(at) in _STATIONS:
            own = [
                card.real(at + 2 + k, f"DIM{k + 1}", value) for k, value in enumerate(dimensions)
            ]
            if own != dimensions:
                self._deck.notes.add(card, "pbeaml_tapers")
                return
            at += 3 + len(dimensions)

    def _note_centre(self, card: Card) -> None:
        self._deck.notes.add(card, "shear_centre", card.name)

    def _pbeam(self, card: Card) -> tuple[BeamSection, tuple[float, float]]:
        """End A, and where the section varies the mean over the stations' lengths."""
        names = ("A", "I1", "I2", "I12", "J", "NSM")
        start = [card.real(2 + k, name, 0.0) for k, name in enumerate(names)]
        stations, at = [(0.0, start)], 8
        if card.text(at) not in _STATIONS:
            at += 8  # stress points
        while card.text(at) in _STATIONS:
            place = card.real(at + 1, "X/XB", 1.0)
            own = [
                card.real(at + 2 + k, name, value)
                for k, (name, value) in enumerate(zip(names, start, strict=True))
            ]
            stations.append((place, own))
            at += 16 if card.text(at) == "YES" else 8
        values = _mean(stations) if any(own != start for _, own in stations) else start
        if values is not start:
            self._deck.notes.add(card, "pbeam_tapers")
        shear = self._shears(card, card.real(at, "K1", 1.0), card.real(at + 1, "K2", 1.0))
        centroid = card.real(at + 12, "N1(A)", 0.0), card.real(at + 13, "N2(A)", 0.0)
        if centroid != (0.0, 0.0):
            self._note_centre(card)
        if any(card.text(at + 8 + k) and card.real(at + 8 + k, "M1(A)") for k in range(4)):
            self._deck.notes.add(card, "mass_off_axis")
        section = self._section(card, values, shear)
        fields = (("area", 2), ("I2", 3), ("I1", 4), ("J", 6)) if values is start else ()
        places = {name: card.place(index) for name, index in fields if card.text(index)}
        return replace(section, places=places), centroid


def rod_key(card: Card) -> tuple[str, ...]:
    """What CONROD of one set have in common: material, area, torsion, extra mass."""
    return tuple(card.text(index) for index in (3, 4, 5, 7))


def _mean(stations: list[tuple[float, list[float]]]) -> list[float]:
    """Mean of what varies from station to station."""
    ordered = sorted(stations, key=lambda one: one[0])
    if ordered[-1][0] < 1:
        ordered.append((1.0, ordered[-1][1]))
    places, values = zip(*ordered, strict=True)
    mean: list[float] = np.trapezoid(values, places, axis=0).tolist()
    return mean


_RODS = {"CROD": (2, 3), "CTUBE": (2, 3), "CONROD": (1, 2)}
_ELEMENTS = ("CBAR", "CBEAM", *_RODS)
_DEFAULTS = {"CBAR": "BAROR", "CBEAM": "BEAMOR"}


_Row = tuple[int, tuple[int, int], Card, Floats, Floats]
"""Of an element: number, rows of its ends, card, direction of axis 1, and offsets of its ends."""


class Beams:
    """Reader of beams.

    Attributes:
        sections: of the sets that elements use, by name.
        ends: places of the nodes of released ends, whose rows follow those of the grids.
        links: of these nodes by the grids.
    """

    def __init__(self, deck: BdfDeck, extra: Mapping[tuple[str, int], float]) -> None:
        """Of a deck, and non-structural mass per length by family and number of property."""
        self.sections: dict[str, BeamSection] = {}
        self.ends: list[Floats] = []
        self.links: list[Link] = []
        self._deck, self._properties = deck, BeamSections(deck, extra)
        self._defaults = {
            element: card for element, name in _DEFAULTS.items() for card in deck.take(name)
        }

    def blocks(self) -> list[Elements]:
        """Elements by set, in the order in which these appear."""
        by_set: dict[str, list[_Row]] = {}
        for card in self._deck.elements(*_ELEMENTS):
            number = card.integer(0, "EID")
            own = self._property(card, number)
            self.sections[own.set] = own.section
            ends = _RODS.get(card.name, (2, 3))
            a, b = (
                self._deck.grids.row(card, index, f"G{end}")
                for index, end in zip(ends, "AB", strict=True)
            )
            if card.name in _RODS:
                axis, offsets = self._rod(a, b)
            else:
                axis, offsets, a, b = self._bar(card, own, a, b)
            by_set.setdefault(own.set, []).append((number, (a, b), card, axis, offsets))
        return [_block(name, rows) for name, rows in by_set.items()]

    def _property(self, card: Card, number: int) -> Property:
        if card.name == "CONROD":
            return self._properties.rod(card)
        default = self._defaults.get(card.name)
        if not card.text(1) and default is not None and default.text(1):
            number = default.integer(1, "PID")
        return self._properties.get(card, card.integer(1, "PID", number))

    def _rod(self, a: int, b: int) -> tuple[Floats, Floats]:
        along = self._deck.grids.places[b] - self._deck.grids.places[a]
        across = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
        return across / (np.linalg.norm(along) or 1.0), np.zeros((2, 3))

    def _bar(self, card: Card, own: Property, a: int, b: int) -> tuple[Floats, Floats, int, int]:
        """Axis 1, offsets of the ends, and their rows; a released end is a node of its own."""
        frames = self._deck.grids.axes(a), self._deck.grids.axes(b)
        default = self._defaults.get(card.name)
        source = card if any(map(card.text, (4, 5, 6))) or default is None else default
        kinds = (card.text(7) or (default.text(7) if default else "")) or "GGG"
        if len(kinds) != 3 or set(kinds) - set("GBOE"):
            kinds = "GGG"  # BIT of a beam is a number
        axis = self._orientation(card, source, a, frames[0] if kinds[0] == "G" else np.eye(3))
        along = self._deck.grids.places[b] - self._deck.grids.places[a]
        element = _axes(along, axis) if "O" in kinds[1:] or "E" in kinds[1:] else np.eye(3)
        arms = np.zeros((2, 3))
        if any(map(card.text, range(10, 16))):
            stated = [card.real(10 + k, f"W{k % 3 + 1}{'AB'[k // 3]}", 0.0) for k in range(6)]
            for end in (0, 1):
                frame = (
                    element
                    if kinds[1 + end] in "OE"
                    else frames[end]
                    if kinds[1 + end] == "G"
                    else np.eye(3)
                )
                arms[end] = np.array(stated[3 * end : 3 * end + 3]) @ frame
        along = along + arms[1] - arms[0]
        offsets = _straight(card, own.centroid, along, axis, arms)
        rows = [a, b]
        for end in (0, 1):
            if released := card.dofs(8 + end, f"P{'AB'[end]}", "0"):
                rows[end] = self._released(card, rows[end], arms[end], released, _axes(along, axis))
                offsets[end] -= arms[end]
        return axis, offsets, rows[0], rows[1]

    def _released(
        self, card: Card, row: int, arm: Floats, dofs: tuple[int, ...], axes: Floats
    ) -> int:
        """The row of a new node at the end of a bar, which a grid leads in all but some dofs along
        the bar's axes.
        """
        new = len(self._deck.grids.places) + len(self.ends)
        self.ends.append(self._deck.grids.places[row] + arm)
        held = tuple(dof for dof in ALL_DOFS if dof not in dofs)
        self.links.append(Link(new, (row,), held, card.where, axes=axes))
        return new

    def _orientation(self, card: Card, source: Card, a: int, frame: Floats) -> Floats:
        """The direction v in the model's frame, from a grid G0 or by its components."""
        if source.is_integer(4) and not source.text(5) and not source.text(6):
            return np.asarray(
                self._deck.grids.places[self._deck.grids.row(source, 4, "G0")]
                - self._deck.grids.places[a]
            )
        if not any(map(source.text, (4, 5, 6))):
            raise card.wrong(
                4, "X1", "a direction X1, X2, X3 or a grid G0 for the section's plane 1"
            )
        return np.array([source.real(4 + k, f"X{k + 1}", 0.0) for k in range(3)]) @ frame


def _straight(
    card: Card, centroid: tuple[float, float], along: Floats, axis: Floats, arms: Floats
) -> Floats:
    """Offsets of the ends to the centroid of a bar whose axis 1 lies across it."""
    if not np.any(along):
        raise card.error("its length is zero; both ends are in one place")
    if not np.linalg.norm(np.cross(along, axis)) > 1e-8 * np.linalg.norm(axis) * np.linalg.norm(
        along
    ):
        raise card.error("the orientation vector is along the beam; give a direction across it", 4)
    _, y, z = _axes(along, axis)
    return np.asarray(arms + centroid[0] * y + centroid[1] * z)


def _axes(along: Floats, axis: Floats) -> Floats:
    """(3, 3) x, y and z of a bar, as rows."""
    x = along / (np.linalg.norm(along) or 1.0)
    y = axis - (axis @ x) * x
    y = y / (np.linalg.norm(y) or 1.0)
    return np.array([x, y, np.cross(x, y)])


def _block(name: str, rows: list[_Row]) -> Elements:
    numbers, nodes, cards, axes, arms = zip(*rows, strict=True)
    offsets = np.array(arms) if np.any(arms) else None
    lines, files = (
        np.array([card.where.line for card in cards]),
        tuple(card.where.file for card in cards),
    )
    first = np.array(numbers), np.array(nodes), name, np.array(axes), lines
    return Elements("beam2", *first, offsets=offsets, files=files)
