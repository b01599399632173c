"""Where the numbers of an update go in a Nastran deck.

A field changes in place and in its own width, with a comment before its card. Copies of a material,
with free numbers, stand before ENDDATA, and the properties of the sets point to them.
"""

from collections.abc import Iterable, Mapping, Sequence
from textwrap import wrap

from modalbase.formats.errors import FormatError
from modalbase.formats.models.bdf.beams import rod_key
from modalbase.formats.models.bdf.card import Card, cards_of, number, whole
from modalbase.formats.models.bdf.lines import split_deck
from modalbase.formats.models.bdf.materials import FIELDS
from modalbase.formats.models.changes import Constants, Edits, Number, Writing
from modalbase.formats.models.model import FiniteElementModel, Material, Where

_SMALL, _LARGE, _REMARK = 8, 16, 70  # columns
_FIELDS = {**FIELDS, "MAT2": {"G11": 1, "G12": 2, "G22": 4, "G33": 6, "density": 7}}


class BdfWriting(Writing):
    """Files of a Nastran deck as they change."""

    def __init__(
        self, content: bytes, model: FiniteElementModel, included: Mapping[str, bytes]
    ) -> None:
        super().__init__(
            {name: Edits(text, "$", 8) for name, text in {"": content, **included}.items()}
        )
        self._model = model
        self._cards = [
            card
            for card in cards_of(split_deck(content, included or None).bulk)
            if isinstance(card, Card)
        ]
        self._by_place = {card.where: card for card in self._cards}
        numbers = [whole(card.text(0)) or 0 for card in self._cards if card.name.startswith("MAT")]
        self._next = max([*numbers, *map(int, model.materials)], default=0) + 1

    def section(self, number: Number) -> None:
        """Write a number of a property."""
        section = self._model.sections[number.set]
        card = self._card(section.where, number.set)
        index = next(k for k in range(len(card)) if card.place(k) == number.place)
        self._remark(card, number.comment)
        self._real(card, index, number.value)

    def change(
        self, material: Material, values: Constants, sets: list[str], comments: Mapping[str, str]
    ) -> bool:
        """Write constants into a material's card, where it can say them and its lines have room."""
        card = self._card(material.where, sets[0])
        fields = _fields_of(card, material, values)
        if fields is None or not all(card.has_room(index) for index in fields):
            return False
        for comment in comments.values():
            self._remark(card, comment)
        for index, value in fields.items():
            self._real(card, index, value)
        return True

    def copy(
        self, material: Material, values: Constants, sets: list[str], comments: Mapping[str, str]
    ) -> None:
        """Append a material before ENDDATA, and let the properties of sets point to it."""
        card = self._card(material.where, sets[0])
        new, self._next = str(self._next), self._next + 1
        numbers = _fields_of(card, material, values)
        name, fields = card.name, list(card.fields)
        if numbers is None:  # an isotropic material that is no longer
            name, fields = "MAT8", ["", "", "", "", "", "", "", card.text(4)]
            numbers = {index: values[c] for c, index in _FIELDS["MAT8"].items() if c != "density"}
            if "density" in values:
                numbers[7] = _density_on(card, material, values["density"])
        fields += [""] * (max(numbers) + 1 - len(fields))
        for index, value in numbers.items():
            fields[index] = fitted(value, _LARGE)
        fields[0] = new
        remarks = [f"copy of material {material.name} for {', '.join(sets)}", *comments.values()]
        self._append([*(f"$ {each}" for each in remarks), *_large(name, fields)])
        for each in sets:
            for owner, indices in self._owners(each):
                self._remark(owner, f"updated: material of {each} was {material.name}, is {new}")
                for index in indices:
                    if owner.text(index) == card.text(0):
                        self._put(owner, index, new)

    def _append(self, lines: Sequence[str]) -> None:
        """Lines before ENDDATA, or at the end of a deck that has none."""
        deck = self.files[""]
        words = (text.upper().replace(",", " ").split(None, 1)[:1] for text in deck.texts)
        end = next((at for at, word in enumerate(words, start=1) if word == ["ENDDATA"]), None)
        if end is None:
            deck.after(len(deck.texts), lines)
        else:
            deck.before(end, lines)

    def _owners(self, set_name: str) -> Iterable[tuple[Card, Sequence[int]]]:
        """Cards that name the materials of a set, with the fields where they do."""
        section = self._model.sections[set_name]
        card = self._card(section.where, set_name)
        if card.name == "CONROD":
            return [
                (one, (3,))
                for one in self._cards
                if one.name == "CONROD" and rod_key(one) == rod_key(card)
            ]
        if card.name == "PSHELL":
            return [(card, (1, 3, 5, 10))]
        if card.name in ("PCOMP", "PCOMPG"):
            step, shift = (4, 0) if card.name == "PCOMP" else (8, 1)
            return [(card, range(8 + shift, len(card), step))]
        return [(card, (1,))]

    def _card(self, where: Where, set_name: str) -> Card:
        card = self._by_place.get(where)
        if card is None:
            raise FormatError(
                set_name, f"cannot be written: {where} is not here, or not the card that was read"
            )
        return card

    def _remark(self, card: Card, text: str) -> None:
        self.files[card.where.file].remark(card.where.line, *wrap(text, _REMARK))

    def _real(self, card: Card, index: int, value: float) -> None:
        self._put(card, index, fitted(value, _LARGE if card.row(index).is_large else _SMALL))

    def _put(self, card: Card, index: int, text: str) -> None:
        """Put a text into a field, where in it the old one stood."""
        row, place = card.row(index), card.place(index)
        old = self.files[place.file].old(place)
        blanks = len(old) - len(old.lstrip())
        if row.is_free:
            text = old[:blanks] + text
        else:
            width = place.end - place.start
            text = text.rjust(width) if blanks and old.strip() else text.ljust(width)
        self.files[place.file].put((place, text))


def _fields_of(card: Card, material: Material, values: Constants) -> dict[int, float] | None:
    """Fields of a material's card that change; None where the card cannot say the constants."""
    if material.is_isotropic and "E1" in values:
        return None
    before, after = (
        _on_card(card.name, each) for each in (material.constants, {**material.constants, **values})
    )
    fields = {
        _FIELDS[card.name][name]: value for name, value in after.items() if value != before[name]
    }
    if "density" in values:
        fields[_FIELDS[card.name]["density"]] = _density_on(card, material, values["density"])
    return fields


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
    entries = {"G11": E1 / rest, "G12": nu * E2 / rest, "G22": E2 / rest, "G33": constants["G12"]}
    return entries | {name: constants[name] for name in ("density",) if name in constants}


def _large(name: str, fields: Sequence[str]) -> list[str]:
    """A card in fields of 16 columns."""
    while fields and not fields[-1]:
        fields = fields[:-1]
    rows = [fields[at : at + 4] for at in range(0, len(fields), 4)]
    heads = [f"{name}*", *("*" for _ in rows[1:])]
    return [
        head.ljust(8) + "".join(text.ljust(16) for text in row).rstrip()
        for head, row in zip(heads, rows, strict=True)
    ]


def fitted(value: float, width: int) -> str:
    """A real in at most so many columns, as near to the value as these allow; it has a point, as
    Nastran asks.
    """
    best, distance = "", float("inf")
    for text in _candidates(value, width):
        read_back = number(text)
        if len(text) <= width and read_back is not None and abs(read_back - value) < distance:
            best, distance = text, abs(read_back - value)
    if not best:
        raise ValueError(f"{value} does not fit into {width} columns")
    return best


def _candidates(value: float, width: int) -> list[str]:
    """Fixed, then with an exponent, each from few digits to many."""
    fixed, exponential = [], []
    for digits in range(width):
        text = f"{value:.{digits}f}"
        text = text if "." in text else text + "."
        fixed.append(
            text.replace("0.", ".", 1) if text.lstrip("-").startswith("0.") and digits else text
        )
        mantissa, exponent = f"{value:.{digits}e}".split("e")
        mantissa = mantissa if "." in mantissa else mantissa + "."
        exponential.append(f"{mantissa}{int(exponent):+d}")
    return fixed + exponential
