"""What a structure carries: masses and springs at grids, and mass that is spread over
properties.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping

import numpy as np

from modalbase.formats.models.bdf.card import Card, numbered, whole
from modalbase.formats.models.bdf.deck import PLATES, PROFILES, BdfDeck, Case, family
from modalbase.formats.models.model import Floats, PointMass, Spring

_LOWER = ((0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2))  # I11 I21 I22 I31 I32 I33
_ROUND_OFF = 1e-6  # of an inertia that is not quite one

Vector = tuple[float, float, float]


def read_masses(deck: BdfDeck) -> Iterator[PointMass]:
    """CONM2: mass, place of its centre, and inertia about that.

    Raises:
        FormatError: a mass is negative, or an inertia is of no body.
    """
    grids, mass_factor = deck.grids, deck.mass_factor
    for card in deck.elements("CONM2"):
        card.integer(0, "EID")
        row = grids.row(card, 1, "G")
        mass = card.real(3, "M", 0.0)
        if mass < 0:
            raise card.wrong(3, "M", "a mass that is not negative")
        absolute = card.text(2) == "-1"
        axes = np.eye(3) if absolute else grids.system(card, 2, "CID").axes_at(grids.places[row])
        offset = np.array([card.real(4 + k, f"X{k + 1}", 0.0) for k in range(3)])
        offset = offset - grids.places[row] if absolute else offset @ axes
        inertia = np.zeros((3, 3))
        for k, (i, j) in enumerate(_LOWER):
            value = card.real(8 + k, f"I{i + 1}{j + 1}", 0.0)
            inertia[i, j] = inertia[j, i] = value if i == j else -value
        if np.linalg.eigvalsh(inertia)[0] < -_ROUND_OFF * np.abs(inertia).max():
            raise card.error(
                "the inertia I11 … I33 is of no body: a principal moment is negative", 8
            )
        turned = mass_factor * (axes.T @ inertia @ axes)
        rows = tuple(_vector(one) for one in turned)
        yield PointMass(row, mass * mass_factor, card.where, rows, _vector(offset))


class Springs:
    """Reader of springs, with what PBUSH and PELAS state; two PELAS may stand on a card.

    Attributes:
        masses: of bushes that were read, half at each end.
    """

    def __init__(self, deck: BdfDeck) -> None:
        self._deck = deck
        self.masses: list[PointMass] = []
        self.grids, self.notes = deck.grids, deck.notes
        self.bushes = numbered(deck.take("PBUSH"), "property", "PID")
        self.properties: dict[int, float] = {}
        for card in deck.take("PELAS"):
            for at in (0, 4):
                if at == 0 or card.text(at):
                    stiffness = card.real(at + 1, "K")
                    if self.properties.setdefault(card.integer(at, "PID"), stiffness) != stiffness:
                        raise card.error("the property is there twice, with two stiffnesses", at)

    def read(self) -> Iterator[Spring]:
        """CELAS1, CELAS2 and CBUSH."""
        for card in self._deck.elements("CELAS1", "CELAS2", "CBUSH"):
            yield from self.bush(card) if card.name == "CBUSH" else self.scalar(card)

    def scalar(self, card: Card) -> Iterator[Spring]:
        """CELAS1 and CELAS2: between components of two grids, or to the ground."""
        number = card.integer(0, "EID")
        if card.name == "CELAS2":
            stiffness = card.real(1, "K")
        else:
            own = card.integer(1, "PID", number)
            if own not in self.properties:
                raise card.wrong(1, "PID", f"a property of it; there is no PELAS {own}")
            stiffness = self.properties[own]
        ends = [(at, at + 1) for at in (2, 4) if card.text(at) not in ("", "0")]
        if not ends:
            raise card.wrong(2, "G1", "a grid")
        attached = []
        for at, component in ends:
            row, dofs = self.grids.row(card, at, f"G{at // 2}"), card.dofs(component, f"C{at // 2}")
            if len(dofs) != 1:
                raise card.wrong(component, f"C{at // 2}", "one component of 1 … 6")
            attached.append((row, dofs[0]))
        if stiffness < 0:
            raise card.error(f"the stiffness is {stiffness:g}, expected not below zero")
        if stiffness > 0:
            yield self._spring(card, stiffness, *attached)

    def _spring(
        self,
        card: Card,
        stiffness: float,
        first: tuple[int, int],
        second: tuple[int, int] | None = None,
    ) -> Spring:
        """Between dofs of the grids' own axes; a single direction must do for both ends."""
        row, dof = first
        axis = self.grids.axes(row)[dof % 3]
        other, other_dof = second or (None, None)
        if other is not None and other_dof is not None:
            apart = self.grids.axes(other)[other_dof % 3]
            if not np.allclose(axis, apart, atol=1e-9) and {row, other} & set(
                self.grids.displacement
            ):
                self.notes.add(card, "spring_askew", card.name)
        if np.allclose(axis, np.eye(3)[dof % 3], atol=1e-12):
            return Spring(row, dof, stiffness, card.where, other, other_dof)
        far = None if other_dof is None else 3 * (other_dof // 3)
        return Spring(
            row,
            3 * (dof // 3),
            stiffness,
            card.where,
            second=other,
            second_dof=far,
            direction=_vector(axis),
        )

    def bush(self, card: Card) -> Iterator[Spring]:
        """CBUSH: up to six springs between two grids, as bodies that reach to where it lies, or to
        the ground.
        """
        number = card.integer(0, "EID")
        property_number = card.integer(1, "PID", number)
        if property_number not in self.bushes:
            raise card.wrong(1, "PID", f"a property of it; there is no PBUSH {property_number}")
        a = self.grids.row(card, 2, "GA")
        b = self.grids.row(card, 3, "GB") if card.text(3) else None
        own = self.bushes[property_number]
        stiffness = _bush_stiffness(own)
        self._weigh(own, card, [a] if b is None else [a, b])
        axes = self._bush_axes(card, a, b, set(stiffness))
        arms = self._arms(card, a, b)
        for dof, value in stiffness.items():
            if value < 0:
                raise own.error(f"K{dof + 1} is {value:g}, expected not below zero")
            axis = axes[dof % 3]
            plain = np.allclose(axis, np.eye(3)[dof % 3], atol=1e-12)
            kind = dof if plain else 3 * (dof // 3)
            far = None if b is None else kind
            yield Spring(
                a,
                kind,
                value,
                card.where,
                b,
                far,
                direction=None if plain else _vector(axis),
                arms=arms,
            )

    def _weigh(self, own: Card, card: Card, ends: list[int]) -> None:
        """Take the mass of a bush, of the line that is marked M."""
        at = next((at for at in range(1, len(own), 8) if own.text(at) == "M"), None)
        mass = 0.0 if at is None else own.real(at + 1, "M", 0.0)
        if mass < 0:
            raise own.error(f"M is {mass:g}, expected not below zero")
        if mass and len(ends) < 2:
            self.notes.add(card, "bush_mass_at_ground")
        if mass:
            half = mass * self._deck.mass_factor / 2
            self.masses += [PointMass(row, half, card.where) for row in ends]

    def _bush_axes(self, card: Card, a: int, b: int | None, dofs: set[int]) -> Floats:
        if card.text(7):
            return self.grids.system(card, 7, "CID").axes_at(self.grids.places[a])
        along = np.zeros(3) if b is None else self.grids.places[b] - self.grids.places[a]
        size = float(np.linalg.norm(along))
        if not size > 0:
            raise card.wrong(
                7, "CID", "a coordinate system, since it joins grids in one place or has one alone"
            )
        if card.is_integer(4) and not card.text(5):
            across = self.grids.places[self.grids.row(card, 4, "G0")] - self.grids.places[a]
        else:
            across = np.array(
                [card.real(4 + k, f"X{k + 1}", 0.0) for k in range(3)]
            ) @ self.grids.axes(a)
        if not np.linalg.norm(np.cross(along, across)) > 1e-8 * size * np.linalg.norm(across):
            if dofs - {0, 3}:
                raise card.wrong(
                    4, "X1", "a direction across it, or a CID, since K2, K3, K5 or K6 is given"
                )
            across = np.eye(3)[np.argmin(np.abs(along))]
        x = along / size
        z = np.cross(x, across)
        z /= np.linalg.norm(z)
        return np.array([x, np.cross(z, x), z])

    def _arms(self, card: Card, a: int, b: int | None) -> tuple[Vector, Vector] | None:
        """From both grids to where the bush lies."""
        first = self.grids.places[a]
        second = first if b is None else self.grids.places[b]
        share = card.real(8, "S", 0.5)
        place = (1 - share) * first + share * second
        if card.text(9) and card.integer(9, "OCID") >= 0:
            system = self.grids.system(card, 9, "OCID")
            place = system.place(
                np.array([[card.real(10 + k, f"S{k + 1}", 0.0) for k in range(3)]])
            )[0]
        arms = _vector(place - first), _vector(place - second)
        return arms if any(map(any, arms)) else None


def _bush_stiffness(card: Card) -> dict[int, float]:
    """Stiffness by dof, of the line that is marked K."""
    for at in range(1, len(card), 8):
        if card.text(at) == "K":
            return {
                k: card.real(at + 1 + k, f"K{k + 1}") for k in range(6) if card.text(at + 1 + k)
            }
    return {}


def _vector(values: Floats) -> Vector:
    x, y, z = values.tolist()
    return x, y, z


def nonstructural_masses(deck: BdfDeck) -> Mapping[tuple[str, int], float]:
    """Mass per area of shells and per length of beams by family and number of property, of the set
    that the deck selects.
    """
    masses: dict[tuple[str, int], float] = defaultdict(float)
    cards, joining = deck.take("NSM", "NSM1", "NSML", "NSML1"), deck.take("NSMADD")
    selected = _selected(joining, deck.case)
    for card in cards:
        if deck.case.is_stated and card.integer(0, "SID") not in selected:
            deck.notes.add(card, "mass_not_selected", card.name)
            continue
        kind = card.text(1)
        if card.name.startswith("NSML") or kind not in (*PLATES, *PROFILES):
            deck.notes.add(card, "mass_by_kind", card.name, what=kind or "nothing")
            continue
        plates = {number for number, plate in deck.plates.items() if plate.name == kind}
        for number, value in _values(card, plates if kind in PLATES else set(deck.profiles[kind])):
            masses[family(kind), number] += value * deck.mass_factor
    return masses


def _selected(joined: Iterable[Card], case: Case) -> set[int]:
    number = case.number("NSM")
    if number is None:
        return set()
    joining = [card for card in joined if card.integer(0, "SID") == number]
    return {whole(text) or 0 for card in joining for _, text in card.words(1)} or {number}


def _values(card: Card, known: set[int]) -> list[tuple[int, float]]:
    """Number and mass of each property of a card."""
    if card.name == "NSM":
        return [
            (card.integer(at, "ID"), card.real(at + 1, "VALUE"))
            for at in range(2, len(card), 2)
            if card.text(at)
        ]
    value = card.real(2, "VALUE")
    fields = list(card.words(3))
    if fields and fields[0][1] == "ALL":
        return [(number, value) for number in known]
    if len(fields) >= 3 and fields[1][1] == "THRU":
        low, high = card.integer(fields[0][0], "ID"), card.integer(fields[2][0], "ID")
        return [(number, value) for number in known if low <= number <= high]
    return [(card.integer(index, "ID"), value) for index, _ in fields]
