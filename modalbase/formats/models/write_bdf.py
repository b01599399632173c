"""A Nastran deck with the numbers of an update: the user's own file, in which nothing else changes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from modalbase.formats.errors import FormatError
from modalbase.formats.models.bdf.card import Card, number, whole
from modalbase.formats.models.bdf.edit import Edits, fitted, has_field
from modalbase.formats.models.bdf.lines import cards_of, split_deck
from modalbase.formats.models.bdf.sections import rod_key
from modalbase.formats.models.changes import Changes, Number, changes_of
from modalbase.formats.models.model import FiniteElementModel, Material

Constants = Mapping[str, float]

_FIELDS = {
    "MAT1": {"E": 1, "G": 2, "nu": 3, "density": 4},
    "MAT8": {"E1": 1, "E2": 2, "nu12": 3, "G12": 4, "G13": 5, "G23": 6, "density": 7},
    "MAT2": {"G11": 1, "G12": 2, "G22": 4, "G33": 6, "density": 7},
}


def write_bdf(
    content: bytes,
    model: FiniteElementModel,
    updated: Mapping[tuple[str, str], float],
    *,
    included: Mapping[str, bytes] | None = None,
    remarks: Sequence[str] = (),
) -> dict[str, bytes]:
    """The files of a deck that change by an update, by name; the deck's own is empty.

    A field changes in place and in its own width, with a comment before its card. Where sets shared a material that now
    differs, copies of the material with free numbers stand before ENDDATA, and the properties of the sets point to them. All
    else stays as it is, to the byte.

    Args:
        content: the deck.
        model: what `read_bdf` made of it.
        updated: new values by set and constant, in the model's units: `E1`, `E2`, `G12`, `G13`, `G23`, `nu12`, or `E`,
            `nu`, `G`; of a second material of the stack `E1_2` and so on; `density` of the set, `t` of its whole thickness,
            `factor` of all moduli; of beams also `area`, `I1`, `I2`, `J`.
        included: files that the deck includes, by name.
        remarks: comments for the deck's top.

    Raises:
        FormatError: a set or constant is not there, a value is not a number, or the card stands in a file that is not here.
    """
    return _Writer(content, model, included or {}).write(changes_of(model, updated), remarks)


@dataclass
class _Writer:
    content: bytes
    model: FiniteElementModel
    included: Mapping[str, bytes]
    appended: list[str] = field(default_factory=list)
    edits: dict[str, Edits] = field(default_factory=dict)

    def __post_init__(self) -> None:
        lines = split_deck(self.content, self.included or None)
        self.cards = [card for card in cards_of(lines.bulk) if isinstance(card, Card)]
        self.by_place = {(card.rows[0].file, card.line): card for card in self.cards}
        numbers = [whole(card.text(0)) or 0 for card in self.cards if card.name.startswith("MAT")]
        named = [int(name) for name in self.model.materials]
        self.next_number = max([*numbers, *named], default=0) + 1

    def write(self, changes: Changes, remarks: Sequence[str]) -> dict[str, bytes]:
        """All of it."""
        for change in changes.sections:
            self._section(change)
        for name in dict.fromkeys(name for _, name in changes.materials):
            self._material(self.model.materials[name], changes)
        header = [f"$ {line}" for remark in remarks for line in remark.splitlines()]
        if header or self.appended:
            self.edits.setdefault("", Edits.of(self.content))
        return {
            file: edits.result(*((header, self.appended, _line_of_end(self.content)) if not file else ((), (), None)))
            for file, edits in self.edits.items()
        }

    def _edits(self, card: Card) -> Edits:
        """Those of the file that a card stands in."""
        file = card.rows[0].file
        return self.edits.setdefault(file, Edits.of(self.included[file] if file else self.content))

    def _section(self, change: Number) -> None:
        section = self.model.sections[change.set]
        card = self._card(section.line, section.file, change.set)
        index = next(k for k in range(len(card)) if card.place(k) == change.place)
        self._edits(card).remark(card, change.comment)
        self._edits(card).real(card, index, change.value)

    def _material(self, material: Material, changes: Changes) -> None:
        """Change a material for the sets that agree, and copy it for the others."""
        for k, (values, sets) in enumerate(changes.groups(material)):
            if not values:
                continue
            card = self._card(material.line, material.file, sets[0])
            comments = [changes.comment(sets, constant, material, value) for constant, value in values.items()]
            fields = _fields_of(card, material, values)
            if k == 0 and fields is not None and all(has_field(card, index) for index in fields):
                for comment in comments:
                    self._edits(card).remark(card, comment)
                for index, value in fields.items():
                    self._edits(card).real(card, index, value)
            else:
                self._copy(card, material, values, sets, comments)

    def _copy(self, card: Card, material: Material, values: Constants, sets: list[str], comments: list[str]) -> None:
        """Append a material, and point the properties of sets to it."""
        new, self.next_number = self.next_number, self.next_number + 1
        numbers = _fields_of(card, material, values)
        name, fields = card.name, list(card.fields)
        if numbers is None:  # an isotropic material that is no longer
            name, fields = "MAT8", ["", "", "", "", "", "", "", card.text(4)]
            numbers = {index: values[c] for c, index in _FIELDS["MAT8"].items() if c != "density"}
            if "density" in values:
                numbers[7] = _density_on(card, material, values["density"])
        fields += [""] * (max(numbers) + 1 - len(fields))
        for index, value in numbers.items():
            fields[index] = fitted(value, 16)
        fields[0] = str(new)
        self.appended += [f"$ copy of material {material.name} for {', '.join(sets)}"]
        self.appended += [*(f"$ {comment}" for comment in comments), *_large(name, fields)]
        for each in sets:
            for owner, indices in self._owners(each):
                pointing = [index for index in indices if owner.text(index) == card.text(0)]
                self._edits(owner).remark(owner, f"updated: material of {each} was {material.name}, is {new}")
                for index in pointing:
                    self._edits(owner).integer(owner, index, new)

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
        card = self.by_place.get((file, line))
        if card is None:
            name = file or "this deck"
            raise FormatError(
                set_name, f"cannot be written: line {line} of {name} is not here, or not the card that was read"
            )
        return card


def _fields_of(card: Card, material: Material, values: Constants) -> dict[int, float] | None:
    """Fields of a material's card that change; None where the card cannot say the constants."""
    if material.is_isotropic and "E1" in values:
        return None
    before, after = (_on_card(card.name, each) for each in (material.constants, {**material.constants, **values}))
    found = {_FIELDS[card.name][name]: value for name, value in after.items() if value != before[name]}
    if "density" in values:
        found[_FIELDS[card.name]["density"]] = _density_on(card, material, values["density"])
    return found


def _density_on(card: Card, material: Material, density: float) -> float:
    """A density as its card states it, without the factor that PARAM WTMASS makes of it."""
    stated = number(card.text(_FIELDS[card.name]["density"])) or 0.0
    return stated * density / material.constants["density"]


def _on_card(name: str, constants: Constants) -> dict[str, float]:
    """Constants as a card of a kind states them."""
    if name != "MAT2":
        return dict(constants)
    E1, E2, nu = constants["E1"], constants["E2"], constants["nu12"]
    rest = 1 - nu**2 * E2 / E1
    found = {"G11": E1 / rest, "G12": nu * E2 / rest, "G22": E2 / rest, "G33": constants["G12"]}
    return found | {name: constants[name] for name in ("density",) if name in constants}


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
