"""A deck's own files with updated numbers: fields change in their places, comments and copies of cards stand between lines.

Every other byte stays.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from codecs import BOM_UTF8
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence

from modalbase.formats.models.changes import Changes, Number
from modalbase.formats.models.files import lines_of
from modalbase.formats.models.model import Material, Place

Constants = Mapping[str, float]
Fields = Sequence[tuple[Place, str]]


class Edits:
    """The lines of a file with what changes in them.

    Attributes:
        texts: lines as they were, without their ends.
        sign: begins a comment.
        tab: columns of a tab, where places count them.
    """

    def __init__(self, content: bytes, sign: str, tab: int = 0) -> None:
        self.texts, self.sign, self.tab = lines_of(content), sign, tab
        self._content = content
        self._fields: defaultdict[int, list[tuple[Place, str]]] = defaultdict(list)
        self._before: defaultdict[int, list[str]] = defaultdict(list)
        self._after: defaultdict[int, list[str]] = defaultdict(list)

    @property
    def is_changed(self) -> bool:
        """Whether anything changes."""
        return bool(self._fields or self._before or self._after)

    def old(self, place: Place) -> str:
        """What stood in a field; empty where the line ends before it."""
        return self._parted(place.line)[0][place.start : place.end]

    def put(self, *fields: tuple[Place, str]) -> None:
        """Let texts stand in fields instead."""
        for place, text in fields:
            self._fields[place.line].append((place, text))

    def remark(self, line: int, *said: str) -> None:
        """Put comments before a line."""
        self._before[line] += (f"{self.sign} {each}" for each in said)

    def before(self, line: int, texts: Iterable[str]) -> None:
        """Put lines before one."""
        self._before[line] += texts

    def after(self, line: int, texts: Iterable[str]) -> None:
        """Put lines after one."""
        self._after[line] += texts

    def line(self, number: int, fields: Fields) -> str:
        """A line with fields of its own."""
        if not fields:
            return self.texts[number - 1]
        code, comment = self._parted(number)
        for place, text in sorted(fields, key=lambda each: each[0].start, reverse=True):
            rest = code[place.end :]
            code = code[: place.start].ljust(place.start, "," if "," in code else " ") + text + rest
            code = code if rest else code.rstrip()
        return code + comment

    def result(self, head: Iterable[str] = ()) -> bytes:
        """The file with its changes, and lines before all of it."""
        ends = [raw[len(raw.rstrip(b"\r\n")) :].decode() for raw in self._content.splitlines(keepends=True)]
        newline = (ends or ["\n"])[0] or "\n"
        found = [f"{line}{newline}" for line in head]
        for number, end in enumerate(ends, start=1):
            after = self._after[number]
            found += [f"{line}{newline}" for line in self._before[number]]
            found.append(
                self.line(number, self._fields[number]).replace("\n", newline) + (end or newline if after else end)
            )
            found += [f"{line}{newline}" for line in after]
        mark = BOM_UTF8 if self._content.startswith(BOM_UTF8) else b""
        return mark + "".join(found).encode("latin-1", "replace")

    def _parted(self, number: int) -> tuple[str, str]:
        """A line up to a comment, and the rest."""
        code, sign, comment = self.texts[number - 1].partition(self.sign)
        return code.expandtabs(self.tab) if self.tab else code, sign + comment


class Writing(ABC):
    """Files of a deck as they change, by name; the deck's own is empty."""

    def __init__(self, files: Mapping[str, Edits]) -> None:
        self.files = files

    def write(self, changes: Changes, remarks: Sequence[str]) -> dict[str, bytes]:
        """Those that change; remarks are comments for the deck's head."""
        for number in changes.sections:
            self.section(number)
        for name in dict.fromkeys(name for _, name in changes.materials):
            self._material(changes.model.materials[name], changes)
        head = [f"{self.files[''].sign} {line}" for remark in remarks for line in remark.splitlines() or [""]]
        return {
            name: file.result(() if name else head)
            for name, file in self.files.items()
            if file.is_changed or (head and not name)
        }

    def _material(self, material: Material, changes: Changes) -> None:
        """Change a material for the sets that agree, and copy it for the others."""
        for k, (values, sets) in enumerate(changes.groups(material)):
            comments = {name: changes.comment(sets, name, material, value) for name, value in values.items()}
            if values and (k or not self.change(material, values, sets, comments)):
                self.copy(material, values, sets, comments)

    @abstractmethod
    def section(self, number: Number) -> None:
        """Write a number of a section."""

    @abstractmethod
    def change(self, material: Material, values: Constants, sets: list[str], comments: Mapping[str, str]) -> bool:
        """Write constants where the material stands; False where its card cannot say them."""

    @abstractmethod
    def copy(self, material: Material, values: Constants, sets: list[str], comments: Mapping[str, str]) -> None:
        """Append a material with other constants, and let the sections of sets name it."""
