"""Materials of shells and beams: MAT1, MAT2, MAT8."""

from dataclasses import dataclass, field

from modalbase.formats.models.bdf.card import Card
from modalbase.formats.models.model import Material, ReadReport

_COUPLING = 1e-6  # of G11 and G22, below which a MAT2 has its axes along its symmetry
_CONSISTENT = 0.01  # of G by E/2(1 + ν), up to which Nastran is silent

FIELDS = {
    "MAT1": {"E": 1, "G": 2, "nu": 3, "density": 4},
    "MAT8": {"E1": 1, "E2": 2, "nu12": 3, "G12": 4, "G13": 5, "G23": 6, "density": 7},
    "MAT2": {"density": 7},
}
"""Fields of constants that stand on the card themselves."""


@dataclass
class BdfMaterials:
    """Materials of a deck, read when a section asks."""

    cards: dict[int, Card]  # by number
    mass_factor: float  # PARAM WTMASS, by which densities are multiplied
    notes: ReadReport  # what is lost
    by_name: dict[str, Material] = field(default_factory=dict)  # those that were asked for, by name

    def get(self, user: Card, index: int, what: str) -> Material:
        """The material that a field of a property names."""
        number = user.integer(index, what)
        name = str(number)
        if name not in self.by_name:
            card = self.cards.get(number)
            if card is None:
                raise user.wrong(
                    index, what, f"a material of the deck; there is no MAT1, MAT2 or MAT8 {number}"
                )
            if card.name not in _READERS:
                raise user.wrong(index, what, f"MAT1, MAT2 or MAT8; {number} is a {card.name}")
            self.by_name[name] = self._read(card)
        return self.by_name[name]

    def _read(self, card: Card) -> Material:
        constants = _READERS[card.name](card, self.notes)
        density = card.real(FIELDS[card.name]["density"], "RHO", 0.0)
        if density < 0:
            raise card.wrong(FIELDS[card.name]["density"], "RHO", "a density that is not negative")
        if density > 0:
            constants["density"] = density * self.mass_factor
        places = {
            name: card.place(index)
            for name, index in FIELDS[card.name].items()
            if name in constants and card.text(index)
        }
        return Material(str(card.integer(0, "MID")), constants, card.where, places)


def _isotropic(card: Card, notes: ReadReport) -> dict[str, float]:
    """E, G and ν: two are given, and the third follows from E = 2 G (1 + ν). Of three that differ
    shells take E and ν, and G across; bars E and G.
    """
    given = {name: card.text(index) != "" for name, index in (("E", 1), ("G", 2), ("nu", 3))}
    if not given["E"] and not given["G"]:
        raise card.wrong(1, "E", "two of E, G and NU")
    nu = card.real(3, "NU", 0.0)
    if given["E"] and given["G"]:
        E, G = card.positive(1, "E"), card.positive(2, "G")
        nu = nu if given["nu"] else E / (2 * G) - 1
    elif given["E"]:
        E = card.positive(1, "E")
        G = E / (2 * (1 + nu)) if nu > -1 else 0.0
    else:
        G = card.positive(2, "G")
        E = 2 * G * (1 + nu)
    if not -1 < nu < 1:
        raise card.wrong(3, "NU", f"a Poisson's ratio between −1 and 1; here it is {nu:g}")
    if sum(given.values()) == 1:
        notes.add(card, "mat1_one_constant")
    elif abs(2 * G * (1 + nu) / E - 1) > _CONSISTENT:
        notes.add(card, "mat1_inconsistent")
    return {"E": E, "nu": nu, "G": G}


def _orthotropic(card: Card, notes: ReadReport) -> dict[str, float]:
    E1, E2 = card.positive(1, "E1"), card.positive(2, "E2")
    nu, G12 = card.real(3, "NU12", 0.0), card.positive(4, "G12")
    if not nu**2 * E2 < E1:
        raise card.wrong(3, "NU12", f"below √(E1/E2) = {(E1 / E2) ** 0.5:.3g}")
    G13, G23 = card.real(5, "G1Z", 0.0), card.real(6, "G2Z", 0.0)
    if not G13 > 0 or not G23 > 0:
        notes.add(card, "mat8_without_shear")
    return {"E1": E1, "E2": E2, "nu12": nu, "G12": G12, "G13": G13 or G12, "G23": G23 or G12}


def _anisotropic(card: Card, notes: ReadReport) -> dict[str, float]:
    """Plane-stress stiffness by its entries; what couples stretch and shear is lost."""
    g11, g12, g13, g22, g23, g33 = (
        card.real(1 + k, f"G{name}", 0.0) for k, name in enumerate(_ENTRIES)
    )
    if not (g11 > 0 and g22 > 0 and g33 > 0 and g12**2 < g11 * g22):
        raise card.error("G11, G22 and G33 must be above zero, and G12² below G11 G22", 1)
    if max(abs(g13), abs(g23)) > _COUPLING * max(g11, g22):
        notes.add(card, "mat2_coupling")
    constants = {"E1": g11 - g12**2 / g22, "E2": g22 - g12**2 / g11, "nu12": g12 / g22, "G12": g33}
    return {**constants, "G13": g33, "G23": g33}


_ENTRIES = ("11", "12", "13", "22", "23", "33")
_READERS = {"MAT1": _isotropic, "MAT2": _anisotropic, "MAT8": _orthotropic}
