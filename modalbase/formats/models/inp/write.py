"""Where the numbers of an update go in a deck of Abaqus or CalculiX.

Copies of a material's cards follow it.
"""

import re
from collections.abc import Mapping

from modalbase.formats.errors import FormatError
from modalbase.formats.models.changes import ISOTROPIC, Constants, Edits, Number, Writing
from modalbase.formats.models.inp.lines import Keyword, folded, read_cards
from modalbase.formats.models.inp.materials import ENGINEERING, SUBORDINATE
from modalbase.formats.models.model import FieldPlace, FiniteElementModel, Material, Where

_MATERIAL = re.compile(r'(\bMATERIAL\s*=\s*)("[^"]*"|[^,]*?)(?=\s*(?:,|$))', re.IGNORECASE)
_NAME = re.compile(r'(\bNAME\s*=\s*)("[^"]*"|[^,]*?)(?=\s*(?:,|$))', re.IGNORECASE)
LONGEST_NAME = 80
"""Of a material, in both solvers."""


class InpWriting(Writing):
    """Files of an Abaqus or CalculiX deck as they change."""

    def __init__(
        self, content: bytes, model: FiniteElementModel, included: Mapping[str, bytes]
    ) -> None:
        super().__init__(
            {name: Edits(text, "**") for name, text in {"": content, **included}.items()}
        )
        self._model = model
        self._cards = read_cards(content, included)
        self._names = {folded(card.get("NAME")) for card in self._cards if card.name == "MATERIAL"}

    def section(self, number: Number) -> None:
        """Write a number of a section where it stands."""
        file, place = self.files[number.place.file], number.place
        file.put((place, _fitted(number.value, place)))
        file.remark(place.line, number.comment)

    def change(
        self, material: Material, values: Constants, sets: list[str], comments: Mapping[str, str]
    ) -> bool:
        """Write constants where the material's stand."""
        file = self.files[material.where.file]
        file.put(*self._fields(material, values, sets))
        first = min(place.line for place in material.places.values())
        for constant, comment in comments.items():
            place = material.places.get(constant)
            file.remark(first if place is None else place.line, comment)
        return True

    def _fields(
        self, material: Material, values: Constants, sets: list[str]
    ) -> list[tuple[FieldPlace, str]]:
        """What stands in a material's lines instead.

        Raises:
            FormatError: a constant does not stand as a number of its own, or stands in another file
                than the material.
        """
        fields = []
        for constant, value in values.items():
            place = material.places.get(constant)
            if place is None and constant in material.constants:
                raise FormatError(
                    f"{sets[0]}.{constant}",
                    f"does not stand as a number of its own in {material.name} of {material.where}",
                )
            if place is not None and place.file != material.where.file:
                raise FormatError(
                    material.name,
                    f"has its {constant} in {place.file or 'the deck'}; put it behind its"
                    " *MATERIAL",
                )
            if place is not None:
                fields.append((place, _fitted(value, place)))
        if any(constant not in material.places for constant in values):
            fields += self._orthotropic(material, values)
        return fields

    def _orthotropic(self, material: Material, values: Constants) -> list[tuple[FieldPlace, str]]:
        """An isotropic material's card as one of engineering constants, out of the plane those of
        axis 2.
        """
        place = material.places["E"]
        texts = self.files[material.where.file].texts
        cards = [
            each
            for each in self._cards
            if each.name == "ELASTIC"
            and each.rows
            and each.rows[0].where == Where(place.line, place.file)
        ]
        if (
            len(cards) != 1
            or len(cards[0].rows) > 1
            or texts[cards[0].where.line - 1].rstrip().endswith(",")
        ):
            raise FormatError(
                material.name,
                f"line {place.line}: is isotropic no longer; state ENGINEERING CONSTANTS there to"
                " update it so",
            )
        line = cards[0].where.line
        c = {key: values.get(key, material.constants[own]) for key, own in ISOTROPIC.items()}
        c |= {"E3": c["E2"], "nu13": c["nu12"], "nu23": material.constants["nu"]}
        *row, last = (f"{c[name]:.9g}" for name in ENGINEERING)
        return [
            (FieldPlace(line, 0, len(texts[line - 1])), "*ELASTIC, TYPE=ENGINEERING CONSTANTS"),
            (FieldPlace(place.line, 0, len(texts[place.line - 1])), f"{','.join(row)},\n{last}"),
        ]

    def copy(
        self, material: Material, values: Constants, sets: list[str], comments: Mapping[str, str]
    ) -> None:
        """Append a copy behind the material, and let the sets' sections name it."""
        card, last = self._block(material)
        file = self.files[material.where.file]
        name = self._free(f"{material.name}_{sets[0]}")
        copied = [
            f"** {comment}"
            for comment in (f"copy of {material.name} for {', '.join(sets)}", *comments.values())
        ]
        fields = self._fields(material, values, sets)
        renamed = 0
        for number in range(card.where.line, last + 1):
            text = file.line(number, [each for each in fields if each[0].line == number])
            if not renamed:
                text, renamed = _NAME.subn(
                    lambda match: f"{match.group(1)}{_quoted(name)}", text, count=1
                )
            copied.append(text)
        file.after(last, copied)
        for each in sets:
            self._point(each, material.name, name)

    def _block(self, material: Material) -> tuple[Keyword, int]:
        """A material's card, and the last line of those that belong to it."""
        at = next(
            k
            for k, card in enumerate(self._cards)
            if card.name == "MATERIAL" and card.where == material.where
        )
        last = self._cards[at].where.line
        for card in self._cards[at + 1 :]:
            if card.name not in SUBORDINATE or card.where.file != material.where.file:
                break
            last = (card.rows[-1] if card.rows else card).where.line
        return self._cards[at], last

    def _free(self, preferred: str) -> str:
        """A name that no material has."""
        base = preferred[:LONGEST_NAME]
        name, number = base, 1
        while folded(name) in self._names:
            number += 1
            name = f"{base[: LONGEST_NAME - len(str(number)) - 1]}_{number}"
        self._names.add(folded(name))
        return name

    def _point(self, set_name: str, old: str, new: str) -> None:
        """Let a section name another material."""
        section = self._model.sections[set_name]
        card = next(each for each in self._cards if each.where == section.where)
        file = self.files[card.where.file]
        comment = f"updated: material of {set_name} was {old}, is {new}"
        if "COMPOSITE" in card.parameters:
            for row in card.rows:
                if len(row.fields) > 2 and folded(row.fields[2]) == folded(old):
                    file.put((row.place(2), _quoted(new)))
                    file.remark(row.where.line, comment)
            return
        number = card.where.line
        while not (match := _MATERIAL.search(file.texts[number - 1])):
            number += 1
        file.put((FieldPlace(number, match.start(2), match.end(2)), _quoted(new)))
        file.remark(card.where.line, comment)


def _fitted(value: float, place: FieldPlace) -> str:
    """A number in 9 digits, as wide as the one before it where that is enough."""
    return f"{value:.9g}".rjust(place.end - place.start)


def _quoted(name: str) -> str:
    return f'"{name}"' if re.search(r"[^\w.-]", name) else name
