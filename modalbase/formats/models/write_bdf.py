"""A Nastran deck with the numbers of an update: the user's own file, in which nothing else changes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import isclose, isfinite

from modalbase.formats.errors import FormatError
from modalbase.formats.models.bdf.card import Card, number, whole
from modalbase.formats.models.bdf.edit import Edits, fitted
from modalbase.formats.models.bdf.lines import cards_of, split_deck
from modalbase.formats.models.bdf.sections import rod_key
from modalbase.formats.models.model import BeamSection, FiniteElementModel, Material, ShellSection

Constants = dict[str, float]

_ISOTROPIC = ("E", "nu", "G")
_ORTHOTROPIC = ("E1", "E2", "nu12", "G12", "G13", "G23")
_OF_BEAM = ("area", "I1", "I2", "J")
_FIELDS = {
    "MAT1": {"E": 1, "G": 2, "nu": 3, "density": 4},
    "MAT8": {"E1": 1, "E2": 2, "nu12": 3, "G12": 4, "G13": 5, "G23": 6, "density": 7},
    "MAT2": {"G11": 1, "G12": 2, "G22": 4, "G33": 6, "density": 7},
}
_SAME = 1e-9


def write_bdf(
    content: bytes, model: FiniteElementModel, updated: Mapping[str, Mapping[str, float]], notes: Sequence[str] = ()
) -> bytes:
    """The deck that a model was read from, with updated constants.

    A field changes in place and in its own width, with a comment before its card. Where sets shared a material that now
    differs, copies of the material with free numbers stand before ENDDATA, and the properties of the sets point to them. All
    else stays as it is, to the byte.

    Args:
        content: the deck.
        model: what `read_bdf` made of it.
        updated: new values by set and constant, in the model's units: `E1`, `E2`, `G12`, `G13`, `G23`, `nu12`, or `E`,
            `nu`, `G`; of a second material of the stack `E1_2` and so on; `density` of the set, `t` of its whole thickness; of
            beams also `area`, `I1`, `I2`, `J`.
        notes: comments for the deck's top.

    Raises:
        FormatError: a set or constant is not there, a value is not a number, or the card stands in an INCLUDE file.
    """
    return _Writer(content, model).write(updated, notes)


@dataclass
class _Use:
    """What a set needs a material to be."""

    set: str
    constants: Constants


@dataclass
class _Writer:
    content: bytes
    model: FiniteElementModel
    appended: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        lines = split_deck(self.content, None)
        self.cards = [card for card in cards_of(lines.bulk) if isinstance(card, Card)]
        self.by_line = {card.line: card for card in self.cards}
        self.edits = Edits.of(self.content)
        self.end = _line_of_end(self.content)
        numbers = [whole(card.text(0)) or 0 for card in self.cards if card.name.startswith("MAT")]
        named = [int(name) for name in self.model.materials]
        self.next_number = max([*numbers, *named], default=0) + 1

    def write(self, updated: Mapping[str, Mapping[str, float]], notes: Sequence[str]) -> bytes:
        """All of it."""
        self._check(updated)
        uses: dict[str, list[_Use]] = {name: [] for name in self.model.materials}
        for set_name in self.model.sets:
            own = dict(updated.get(set_name, {}))
            for material, constants in self._materials(set_name, own).items():
                uses[material].append(_Use(set_name, constants))
            self._thickness(set_name, own)
            self._beam(set_name, own)
        for name, users in uses.items():
            self._material(self.model.materials[name], users)
        return self.edits.result([f"$ {note}" for note in notes], self.appended, self.end)

    def _check(self, updated: Mapping[str, Mapping[str, float]]) -> None:
        for set_name, constants in updated.items():
            section = self.model.sections.get(set_name)
            if section is None:
                raise FormatError(set_name, f"is no set of the deck; there are {', '.join(self.model.sets)}")
            allowed = {*_OF_BEAM, *_ISOTROPIC, "density"} if isinstance(section, BeamSection) else _of_shell(section)
            for name, value in constants.items():
                if name not in allowed:
                    raise FormatError(
                        f"{set_name}.{name}", f"is no constant of it; there are {', '.join(sorted(allowed))}"
                    )
                if not isfinite(value):
                    raise FormatError(f"{set_name}.{name}", f"is {value}, expected a number")

    def _materials(self, set_name: str, own: Constants) -> dict[str, Constants]:
        """Constants that a set needs of each of its materials."""
        section = self.model.sections[set_name]
        names = _names(section)
        share = own["density"] / _density(self.model, section) if "density" in own else 1.0
        found = {}
        for k, name in enumerate(names, start=1):
            suffix = "" if k == 1 else f"_{k}"
            stated = {c: own[c + suffix] for c in (*_ISOTROPIC, *_ORTHOTROPIC) if c + suffix in own}
            constants = _updated(dict(self.model.materials[name].constants), stated)
            if "density" in constants:
                constants["density"] *= share
            found[name] = constants
        return found

    def _thickness(self, set_name: str, own: Constants) -> None:
        section = self.model.sections[set_name]
        if "t" not in own or not isinstance(section, ShellSection):
            return
        if any(block.set == set_name and block.thickness is not None for block in self.model.elements):
            raise FormatError(f"{set_name}.t", "cannot be written: elements of the set state thicknesses of their own")
        card = self._card(section.line, section.file, set_name)
        ratio = own["t"] / sum(ply.thickness for ply in section.plies)
        if isclose(ratio, 1.0, rel_tol=_SAME):
            return
        places = {ply.place: ply.thickness for ply in section.plies if ply.place is not None}
        fields = {(place.line, place.start): thickness for place, thickness in places.items()}
        self.edits.remark(card, f"updated: {set_name}.t = {own['t']:.6g}, before {own['t'] / ratio:.6g}")
        for index in range(len(card)):
            place = card.place(index)
            if (place.line, place.start) in fields and card.text(index):
                self.edits.real(card, index, fields[place.line, place.start] * ratio)

    def _beam(self, set_name: str, own: Constants) -> None:
        section = self.model.sections[set_name]
        if not isinstance(section, BeamSection):
            return
        for name in _OF_BEAM:
            if name not in own:
                continue
            place = section.places.get(name)
            if place is None:
                raise FormatError(f"{set_name}.{name}", "cannot be written: the deck does not state it by itself")
            card = self._card(section.line, section.file, set_name)
            index = next(k for k in range(len(card)) if card.place(k) == place)
            before = card.text(index)
            self.edits.remark(card, f"updated: {set_name}.{name} = {own[name]:.6g}, before {before}")
            self.edits.real(card, index, own[name])

    def _material(self, material: Material, users: list[_Use]) -> None:
        """Change a material for the sets that agree, and copy it for the others."""
        groups: list[list[_Use]] = []
        for use in users:
            group = next((one for one in groups if _same(one[0].constants, use.constants)), None)
            if group is None:
                groups.append([use])
            else:
                group.append(use)
        groups.sort(key=lambda group: not _same(group[0].constants, material.constants))  # what stays keeps the card
        for k, group in enumerate(groups):
            constants = group[0].constants
            if _same(constants, material.constants):
                continue
            card = self._card(material.line, material.file, group[0].set)
            sets = ", ".join(use.set for use in group)
            values = _fields_of(card, material, constants)
            if k == 0 and values is not None and all(self.edits.has_field(card, index) for index in values):
                for index, value in values.items():
                    before = card.text(index) or "empty"
                    text = self.edits.real(card, index, value)
                    self.edits.remark(card, f"updated: {_name_of(card, index)} of {sets} = {text}, before {before}")
            else:
                self._copy(card, material, constants, group)

    def _copy(self, card: Card, material: Material, constants: Constants, group: list[_Use]) -> None:
        """Append a material, and point the properties of sets to it."""
        new, self.next_number = self.next_number, self.next_number + 1
        values = _fields_of(card, material, constants)
        name, fields = card.name, list(card.fields)
        if values is None:  # an isotropic material that is no longer
            name, fields = "MAT8", ["", "", "", "", "", "", "", card.text(4)]
            values = {index: constants[c] for c, index in _FIELDS["MAT8"].items() if c != "density"}
            if "density" in constants and not isclose(
                constants["density"], material.constants["density"], rel_tol=_SAME
            ):
                values[7] = (number(card.text(4)) or 0.0) * constants["density"] / material.constants["density"]
        fields += [""] * (max(values) + 1 - len(fields))
        for index, value in values.items():
            fields[index] = fitted(value, 16)
        fields[0] = str(new)
        sets = ", ".join(use.set for use in group)
        self.appended += [f"$ updated: material {material.name} for {sets}", *_large(name, fields)]
        for use in group:
            for owner, indices in self._owners(use.set):
                pointing = [index for index in indices if owner.text(index) == card.text(0)]
                self.edits.remark(owner, f"updated: material {new} by {material.name}")
                for index in pointing:
                    self.edits.integer(owner, index, new)

    def _owners(self, set_name: str) -> Iterable[tuple[Card, Sequence[int]]]:
        """Cards that name the materials of a set, with the fields where they do."""
        section = self.model.sections[set_name]
        card = self._card(section.line, section.file, set_name)
        if card.name == "CONROD":
            return [(one, (3,)) for one in self.cards if one.name == "CONROD" and rod_key(one) == rod_key(card)]
        if card.name == "PSHELL":
            return [(card, (1, 3, 5, 10))]
        if card.name in ("PCOMP", "PCOMPG"):
            step, shift = (4, 0) if card.name == "PCOMP" else (8, 1)
            return [(card, range(8 + shift, len(card), step))]
        return [(card, (1,))]

    def _card(self, line: int, file: str, set_name: str) -> Card:
        if file:
            raise FormatError(set_name, f"cannot be written: its card stands in line {line} of the INCLUDE file {file}")
        card = self.by_line.get(line)
        if card is None:
            raise FormatError(set_name, f"cannot be written: line {line} of this deck is not the card that was read")
        return card


def _of_shell(section: ShellSection) -> set[str]:
    found = {"t", "density"}
    for k in range(1, len(_names(section)) + 1):
        found |= {name if k == 1 else f"{name}_{k}" for name in (*_ISOTROPIC, *_ORTHOTROPIC)}
    return found


def _names(section: ShellSection | BeamSection) -> list[str]:
    """Materials of a section, from the bottom."""
    if isinstance(section, BeamSection):
        return [section.material]
    return list(dict.fromkeys(ply.material for ply in section.plies))


def _density(model: FiniteElementModel, section: ShellSection | BeamSection) -> float:
    """Mean density."""
    if isinstance(section, BeamSection):
        plies = [(section.material, 1.0)]
    else:
        plies = [(ply.material, ply.thickness) for ply in section.plies]
    mass = sum(model.materials[name].constants.get("density", 0.0) * t for name, t in plies)
    if not mass > 0:
        raise FormatError("density", "cannot be written: the materials of the set state none")
    return mass / sum(t for _, t in plies)


def _updated(constants: Constants, stated: Constants) -> Constants:
    """Constants with those that are stated; an isotropic material stays so as long as they agree."""
    if "E" not in constants:
        return {**constants, **{name: value for name, value in stated.items() if name in _ORTHOTROPIC}}
    E, nu, G = (constants[name] for name in _ISOTROPIC)
    if not set(stated) & set(_ORTHOTROPIC):
        E, nu = stated.get("E", E), stated.get("nu", nu)
        tied = isclose(constants["G"], constants["E"] / (2 * (1 + constants["nu"])), rel_tol=1e-6)
        return {**constants, "E": E, "nu": nu, "G": stated.get("G", E / (2 * (1 + nu)) if tied else G)}
    rest = {name: value for name, value in constants.items() if name not in _ISOTROPIC}
    plane = {"E1": E, "E2": E, "nu12": nu, "G12": G, "G13": G, "G23": G} | stated
    same = isclose(plane["E1"], plane["E2"], rel_tol=_SAME)
    if same and all(isclose(plane["G12"], plane[name], rel_tol=_SAME) for name in ("G13", "G23")):
        return {"E": plane["E1"], "nu": plane["nu12"], "G": plane["G12"], **rest}
    return {**{name: plane[name] for name in _ORTHOTROPIC}, **rest}


def _same(one: Mapping[str, float], other: Mapping[str, float]) -> bool:
    return set(one) == set(other) and all(isclose(one[name], other[name], rel_tol=_SAME) for name in one)


def _fields_of(card: Card, material: Material, constants: Constants) -> dict[int, float] | None:
    """Fields of a material's card that change; None where the card cannot say the constants."""
    if ("E" in constants) != (card.name == "MAT1"):
        return None
    before = _as_stated(card.name, material.constants)
    after = _as_stated(card.name, constants)
    if "density" in after:
        stated = number(card.text(_FIELDS[card.name]["density"])) or 0.0
        after["density"], before["density"] = stated * after["density"] / before["density"], stated
    fields = _FIELDS[card.name]
    found = {fields[name]: value for name, value in after.items() if not isclose(value, before[name], rel_tol=_SAME)}
    if card.name == "MAT1":
        tied = isclose(after["G"], after["E"] / (2 * (1 + after["nu"])), rel_tol=1e-6)
        if tied and sum(card.text(index) != "" for index in (1, 2, 3)) < 3:  # the third follows
            found = {index: value for index, value in found.items() if card.text(index)}
    return found


def _as_stated(name: str, constants: Mapping[str, float]) -> Constants:
    """Constants as a card of a kind states them."""
    if name != "MAT2":
        return dict(constants)
    E1, E2, nu = constants["E1"], constants["E2"], constants["nu12"]
    rest = 1 - nu**2 * E2 / E1
    found = {"G11": E1 / rest, "G12": nu * E2 / rest, "G22": E2 / rest, "G33": constants["G12"]}
    return found | {name: constants[name] for name in ("density",) if name in constants}


def _name_of(card: Card, index: int) -> str:
    return next(name for name, at in _FIELDS[card.name].items() if at == index)


def _large(name: str, fields: Sequence[str]) -> list[str]:
    """A card in fields of 16 columns."""
    while fields and not fields[-1]:
        fields = fields[:-1]
    rows = [fields[at : at + 4] for at in range(0, len(fields), 4)]
    heads = [f"{name}*", *("*" for _ in rows[1:])]
    return [
        head.ljust(8) + "".join(text.ljust(16) for text in row).rstrip() for head, row in zip(heads, rows, strict=True)
    ]


def _line_of_end(content: bytes) -> int | None:
    """The line of ENDDATA, from 1."""
    for at, line in enumerate(content.splitlines(), start=1):
        if line.upper().replace(b",", b" ").split(None, 1)[:1] == [b"ENDDATA"]:
            return at
    return None
