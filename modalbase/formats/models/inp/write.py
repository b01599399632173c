"""Updated numbers put back into the user's own deck.

Each changes where it stands, with a comment above its line. Where sets shared a material that now differs, copies of its
cards follow it, and the sections name those. Every other byte stays.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from modalbase.formats.errors import FormatError
from modalbase.formats.models.changes import ISOTROPIC, Changes, changes_of
from modalbase.formats.models.inp.lines import Card, folded, read_cards
from modalbase.formats.models.inp.materials import ENGINEERING, SUBORDINATE
from modalbase.formats.models.model import FiniteElementModel, Material, Place

_MATERIAL = re.compile(r'(\bMATERIAL\s*=\s*)("[^"]*"|[^,\r]*?)(?=\s*(?:,|$))', re.IGNORECASE)
_NAME = re.compile(r'(\bNAME\s*=\s*)("[^"]*"|[^,\r]*?)(?=\s*(?:,|$))', re.IGNORECASE)
LONGEST_NAME = 80
"""Of a material, in both solvers."""


def write_inp(
    content: bytes,
    model: FiniteElementModel,
    updated: Mapping[tuple[str, str], float],
    *,
    included: Mapping[str, bytes] | None = None,
    remarks: Sequence[str] = (),
) -> dict[str, bytes]:
    """The files that change, by name; the deck's own is empty.

    Args:
        content: the deck as it was read.
        model: what it was read to, in its own units.
        updated: numbers in the deck's units by set and constant: those of its materials (`E1`, `nu12`, `density`, …, with
            `_2` of a second material of a laminate from the bottom; `E`, `nu` and `G` of an isotropic one), `t` the whole
            thickness, `factor` of all moduli, and `area`, `I1`, `I2` and `J` of a beam that states them.
        included: files that the deck includes, by name.
        remarks: lines of comment for the deck's head.

    Raises:
        FormatError: a set or constant is none of the deck's, or does not stand there as a number of its own.
    """
    changes = changes_of(model, updated)
    writing = _Writing(content, included or {})
    for numbers in changes.sections:
        writing.put(numbers.place, numbers.value, numbers.comment)
    for name in dict.fromkeys(name for _, name in changes.materials):
        writing.material(model.materials[name], changes)
    found = writing.files()
    if remarks:
        head = "".join(f"** {line}\n" for remark in remarks for line in (remark.splitlines() or [""]))
        found[""] = head.encode("latin-1", "replace") + found.get("", content)
    return found


@dataclass
class _Lines:
    """A file's lines with what changes in them.

    Attributes:
        texts: without the end.
        edits: start, end and text of what is replaced, by line.
        comments: before a line.
        after: lines that follow one.
    """

    texts: list[str]
    edits: dict[int, list[tuple[int, int, str]]] = field(default_factory=dict)
    comments: dict[int, list[str]] = field(default_factory=dict)
    after: dict[int, list[str]] = field(default_factory=dict)

    def line(self, number: int, edits: Iterable[tuple[int, int, str]]) -> str:
        """A line with edits."""
        text = self.texts[number - 1]
        for start, end, new in sorted(edits, reverse=True):
            text = text[:start] + new + text[end:]
        return text

    def commented(self, number: int, comments: Iterable[str]) -> list[str]:
        """Comments with the end that the line has."""
        end = "\r" if self.texts[number - 1].endswith("\r") else ""
        return [f"** {comment}{end}" for comment in comments]

    @property
    def bytes(self) -> bytes:
        """The whole."""
        found: list[str] = []
        for number in range(1, len(self.texts) + 1):
            found += self.commented(number, self.comments.get(number, ()))
            found.append(self.line(number, self.edits.get(number, ())))
            found += self.after.get(number, ())
        return "\n".join(found).encode("latin-1")


class _Writing:
    """Files as they change."""

    def __init__(self, content: bytes, included: Mapping[str, bytes]) -> None:
        self._cards = read_cards(content, included)
        texts = {"": content, **included}
        self._files = {name: _Lines(text.decode("latin-1").split("\n")) for name, text in texts.items()}
        self._names = {folded(card.get("NAME")) for card in self._cards if card.name == "MATERIAL"}

    def files(self) -> dict[str, bytes]:
        """Those that differ from what they were."""
        return {name: lines.bytes for name, lines in self._files.items() if lines.edits or lines.after}

    def put(self, place: Place, value: float, comment: str) -> None:
        """Write a number where another stands."""
        lines = self._files[place.file]
        edit = (place.start, place.end, fitted(value, place.end - place.start))
        lines.edits.setdefault(place.line, []).append(edit)
        lines.comments.setdefault(place.line, []).append(comment)

    def material(self, material: Material, changes: Changes) -> None:
        """Write a material's constants, and copies of it for sets whose constants differ from those that keep it."""
        groups = changes.groups(material)
        for values, sets in groups:
            _require_places(material, values, sets[0])
        for values, sets in groups[1:]:
            self._copy(material, values, sets, changes)
        values, sets = groups[0]
        if values:
            lines = self._files[material.file]
            for line, edits in self._edits(material, values).items():
                lines.edits.setdefault(line, []).extend(edits)
            first = min(material.places[constant].line for constant in material.places)
            for constant, value in values.items():
                line = material.places[constant].line if constant in material.places else first
                lines.comments.setdefault(line, []).append(changes.comment(sets, constant, material, value))

    def _edits(self, material: Material, values: Mapping[str, float]) -> dict[int, list[tuple[int, int, str]]]:
        """What changes in a material's lines, by line.

        Raises:
            FormatError: its constants stand in another file than the material.
        """
        found: dict[int, list[tuple[int, int, str]]] = {}
        for constant, value in values.items():
            if (place := material.places.get(constant)) is not None:
                if place.file != material.file:
                    raise FormatError(
                        material.name, f"has its {constant} in {place.file or 'the deck'}; put it behind its *MATERIAL"
                    )
                edit = (place.start, place.end, fitted(value, place.end - place.start))
                found.setdefault(place.line, []).append(edit)
        if any(constant not in material.places for constant in values):
            found |= self._orthotropic(material, values)
        return found

    def _orthotropic(self, material: Material, values: Mapping[str, float]) -> dict[int, list[tuple[int, int, str]]]:
        """An isotropic material's card as one of engineering constants, out of the plane those of axis 2."""
        place = material.places["E"]
        texts = self._files[material.file].texts
        cards = [
            each for each in self._cards if each.name == "ELASTIC" and each.rows and each.rows[0].line == place.line
        ]
        if len(cards) != 1 or len(cards[0].rows) > 1 or texts[cards[0].line - 1].rstrip().endswith(","):
            raise FormatError(
                material.name,
                f"line {place.line}: is isotropic no longer; state ENGINEERING CONSTANTS there to update it so",
            )
        card = cards[0]
        c = {key: values.get(key, material.constants[own]) for key, own in ISOTROPIC.items()}
        c |= {"E3": c["E2"], "nu13": c["nu12"], "nu23": material.constants["nu"]}
        written = [f"{c[name]:.9g}" for name in ENGINEERING]
        end = "\r" if texts[place.line - 1].endswith("\r") else ""
        row = f"{','.join(written[:8])}{end}\n{written[8]}"
        heading = texts[card.line - 1].rstrip("\r")
        return {
            card.line: [(0, len(heading), "*ELASTIC, TYPE=ENGINEERING CONSTANTS")],
            place.line: [(0, len(texts[place.line - 1].rstrip("\r")), row)],
        }

    def _copy(self, material: Material, values: Mapping[str, float], sets: Sequence[str], changes: Changes) -> None:
        """Append a copy behind the material, and let the sets' sections name it."""
        card, last = self._block(material)
        lines = self._files[material.file]
        name = self._free(f"{material.name}_{sets[0]}")
        comments = [f"copy of {material.name} for {', '.join(sets)}"]
        comments += [changes.comment(sets, constant, material, value) for constant, value in values.items()]
        copied = lines.commented(card.line, comments)
        edits = self._edits(material, values)
        renamed = 0
        for number in range(card.line, last + 1):
            text = lines.line(number, edits.get(number, ()))
            if not renamed:
                text, renamed = _NAME.subn(lambda match: f"{match.group(1)}{_quoted(name)}", text, count=1)
            copied.append(text)
        lines.after.setdefault(last, []).extend(copied)
        for each in sets:
            self._point(changes.model, each, material.name, name)

    def _block(self, material: Material) -> tuple[Card, int]:
        """A material's card, and the last line of those that belong to it."""
        at = next(
            k
            for k, card in enumerate(self._cards)
            if card.name == "MATERIAL" and (card.file, card.line) == (material.file, material.line)
        )
        last = self._cards[at].line
        for card in self._cards[at + 1 :]:
            if card.name not in SUBORDINATE or card.file != material.file:
                break
            last = card.rows[-1].line if card.rows else card.line
        return self._cards[at], last

    def _free(self, wanted: str) -> str:
        """A name that no material has."""
        base = wanted[:LONGEST_NAME]
        name, number = base, 1
        while folded(name) in self._names:
            number += 1
            name = f"{base[: LONGEST_NAME - len(str(number)) - 1]}_{number}"
        self._names.add(folded(name))
        return name

    def _point(self, model: FiniteElementModel, set_name: str, old: str, new: str) -> None:
        """Let a section name another material."""
        section = model.sections[set_name]
        card = next(each for each in self._cards if (each.file, each.line) == (section.file, section.line))
        lines = self._files[card.file]
        comment = f"updated: material of {set_name} was {old}, is {new}"
        if "COMPOSITE" in card.parameters:
            for row in card.rows:
                if len(row.fields) > 2 and folded(row.fields[2]) == folded(old):
                    place = row.place(2)
                    lines.edits.setdefault(row.line, []).append((place.start, place.end, _quoted(new)))
                    lines.comments.setdefault(row.line, []).append(comment)
            return
        number = card.line
        while not (match := _MATERIAL.search(lines.texts[number - 1].rstrip("\r"))):
            number += 1
        lines.edits.setdefault(number, []).append((match.start(2), match.end(2), _quoted(new)))
        lines.comments.setdefault(card.line, []).append(comment)


def _require_places(material: Material, values: Mapping[str, float], set_name: str) -> None:
    for constant in values:
        if constant in material.constants and constant not in material.places:
            raise FormatError(
                f"{set_name}.{constant}",
                f"does not stand as a number of its own in {material.name} of line {material.line}",
            )


def fitted(value: float, width: int) -> str:
    """A number in 9 digits, as wide as the one before it where that is enough.

    >>> fitted(2.41e10, 7), fitted(1850.0, 7), fitted(0.0061234567891, 4)
    ('2.41e+10', '   1850', '0.00612345679')
    """
    return f"{value:.9g}".rjust(width)


def _quoted(name: str) -> str:
    return f'"{name}"' if re.search(r"[^\w.-]", name) else name
