"""Materials of a deck."""

from dataclasses import replace

from modalbase.formats.models.inp.lines import DataLine, Keyword, card_names, folded
from modalbase.formats.models.model import FieldPlace, Material

_LAMINA = ("E1", "E2", "nu12", "G12", "G13", "G23")
ENGINEERING = ("E1", "E2", "E3", "nu12", "nu13", "nu23", "G12", "G13", "G23")
"""Engineering constants in the order of the card, the last on a second line."""

_KINDS = {
    "ISO": ("E", "nu"),
    "ISOTROPIC": ("E", "nu"),
    "LAMINA": _LAMINA,
    "ENGINEERINGCONSTANTS": ENGINEERING,
}

SUBORDINATE = card_names(
    "ELASTIC DENSITY EXPANSION DAMPING CONDUCTIVITY SPECIFICHEAT PLASTIC CREEP CYCLICHARDENING"
    " FAILSTRESS FAILSTRAIN DAMAGEINITIATION DAMAGEEVOLUTION DAMAGESTABILIZATION HYPERELASTIC"
    " HYPERFOAM USERMATERIAL DEPVAR VISCOELASTIC DEFORMATIONPLASTICITY RATEDEPENDENT"
    " COMPRESSIVEFAILURE ELECTRICALCONDUCTIVITY MAGNETICPERMEABILITY USEROUTPUTVARIABLES"
    " FLUIDCONSTANTS SPECIFICGASCONSTANT MOHRCOULOMB POTENTIAL HARDENING LATENTHEAT POROUSELASTIC"
    " VISCOUS ANISOTROPICHYPERELASTIC DRUCKERPRAGER NOCOMPRESSION"
)
"""Cards that belong to the material before them."""

NONLINEAR = card_names(
    "HYPERELASTIC HYPERFOAM USERMATERIAL ANISOTROPICHYPERELASTIC POROUSELASTIC NOCOMPRESSION"
)
"""Those that replace *ELASTIC."""


class InpMaterials:
    """Materials as they are read.

    Attributes:
        by_name: by the user's name.
        hot: cards that have constants at several temperatures, of which the first are taken.
    """

    def __init__(self) -> None:
        self.by_name: dict[str, Material] = {}
        self.hot: list[Keyword] = []
        self._names: dict[str, str] = {}
        self._nonlinear: dict[str, Keyword] = {}

    def read(self, cards: list[Keyword]) -> None:
        """Take the materials of cards."""
        current: Material | None = None
        for card in cards:
            if card.name == "MATERIAL":
                current = self._begun(card)
            elif card.name in NONLINEAR and current is not None:
                self._nonlinear[current.name] = card
            elif card.name in ("ELASTIC", "DENSITY"):
                if current is None:
                    raise card.error("stands before any *MATERIAL, to which it would belong")
                constants, places = _elastic(card) if card.name == "ELASTIC" else _density(card)
                if len(card.rows) > (2 if "E3" in constants else 1):
                    self.hot.append(card)
                if again := set(constants) & set(current.constants):
                    raise card.error(
                        f"states {', '.join(sorted(again))} of {current.name} a second time"
                    )
                constants, places = {**current.constants, **constants}, {**current.places, **places}
                current = replace(current, constants=constants, places=places)
                self.by_name[current.name] = current

    def _begun(self, card: Keyword) -> Material:
        name = card.needs("NAME").strip('"')
        if before := self._names.get(folded(name)):
            raise card.error(
                f"{name} is there already, in {self.by_name[before].where}; give it another name"
            )
        self._names[folded(name)] = name
        self.by_name[name] = Material(name, {}, card.where)
        return self.by_name[name]

    def add(self, material: Material) -> str:
        """A material that a section states itself, which no other card means by its name; the name
        that it has here.
        """
        name = material.name
        while name in self.by_name and self.by_name[name].where != material.where:
            name += "_section"
        self.by_name[name] = replace(material, name=name)
        return name

    def named(self, name: str, where: Keyword | DataLine) -> str:
        """The user's name of a complete material.

        Raises:
            FormatError: it is missing, or has no elastic constants.
        """
        own = self._names.get(folded(name))
        if own is None:
            there = ", ".join(self.by_name) or "none"
            raise where.error(
                f"names the material {name!r}, which no *MATERIAL has; there are {there}"
            )
        if own in self._nonlinear:
            card = self._nonlinear[own]
            raise card.error(
                f"makes {own} nonlinear; give *ELASTIC constants for small motions about the state"
                " measured"
            )
        material = self.by_name[own]
        if not {"E", "E1"} & set(material.constants):
            raise where.error(
                f"names the material {own} of {material.where}, which has no *ELASTIC"
            )
        return own


def _elastic(card: Keyword) -> tuple[dict[str, float], dict[str, FieldPlace]]:
    """Constants of *ELASTIC, and their places."""
    kind = card.get("TYPE").replace(" ", "").upper() or "ISO"
    if kind not in _KINDS:
        raise card.error(
            f"TYPE={card.get('TYPE')}: expected ISO, LAMINA or ENGINEERING CONSTANTS; state the"
            " same stiffness by those"
        )
    names = _KINDS[kind]
    where = [(card.first, column) for column in range(min(len(names), 8))]
    if len(names) > 8:
        if len(card.rows) < 2:
            raise card.error(
                "has one data line, expected two: E1, E2, E3, ν12, ν13, ν23, G12, G13, and"
                " below G23"
            )
        where.append((card.rows[1], 0))
    constants, places = {}, {}
    for name, (row, column) in zip(names, where, strict=True):
        fields = row.fields
        if column >= len(fields):
            raise row.error(
                f"has {len(fields)} fields, expected {', '.join(names[:8])}: {name} is missing"
            )
        constants[name], places[name] = row.number(fields[column], name), row.place(column)
        if name[0] in "EG" and not 0 < constants[name] < 1e20:
            raise row.error(
                f"{name} is {constants[name]:g}, expected a modulus above 0 and below 1e20"
            )
    _definite(constants, card.first)
    if kind.startswith("ISO"):
        constants["G"] = constants["E"] / (2 * (1 + constants["nu"]))
    return constants, places


def _definite(constants: dict[str, float], row: DataLine) -> None:
    """Raise where a material would give energy when strained."""
    if "E" in constants and not -1 < constants["nu"] <= 0.5:
        raise row.error(f"ν is {constants['nu']:g}, expected −1 < ν ≤ 0.5")
    for pair in ("12", "13", "23"):
        nu = constants.get(f"nu{pair}")
        if nu is not None and not nu**2 < constants[f"E{pair[0]}"] / constants[f"E{pair[1]}"]:
            limit = (constants[f"E{pair[0]}"] / constants[f"E{pair[1]}"]) ** 0.5
            raise row.error(
                f"ν{pair} is {nu:g}, expected less than √(E{pair[0]}/E{pair[1]}) = {limit:.4g}"
            )


def _density(card: Keyword) -> tuple[dict[str, float], dict[str, FieldPlace]]:
    fields = card.first.fields
    value = card.first.number(fields[0] if fields else "", "the density")
    if not 0 <= value < 1e12:
        raise card.first.error(
            f"is {value:g}, expected a density that is not negative and below 1e12"
        )
    return {"density": value}, {"density": card.first.place(0)}
