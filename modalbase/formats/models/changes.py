"""What updated numbers change in a deck, numbers of sections and constants of materials set by set,
and where they go.

Fields change in their places, comments and copies of cards stand between lines. Every other byte
stays.
"""

from abc import ABC, abstractmethod
from codecs import BOM_UTF8
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import isclose, isfinite

from modalbase.formats.constants import ROUND_OFF
from modalbase.formats.errors import FormatError
from modalbase.formats.models.files import lines_of
from modalbase.formats.models.model import (
    BeamSection,
    FieldPlace,
    FiniteElementModel,
    Material,
    ShellSection,
)

_SECTION = ("area", "I1", "I2", "J")


@dataclass(frozen=True)
class Number:
    """A number of a set's section: where it stands, its new value, and what a comment says of
    it.
    """

    set: str
    place: FieldPlace
    value: float
    comment: str


@dataclass(frozen=True)
class Changes:
    """What changes."""

    model: FiniteElementModel  # the deck's
    sections: list[Number]  # numbers of sections
    # new constants by set and material's name, those alone that differ
    materials: dict[tuple[str, str], dict[str, float]]

    def groups(self, material: Material) -> list[tuple[dict[str, float], list[str]]]:
        """New constants and the sets that have them; the first keep the material, those that do not
        change before others.
        """
        groups: list[tuple[dict[str, float], list[str]]] = []
        for name in self.model.sets:
            if material.name in self.model.sections[name].materials:
                values = self.materials.get((name, material.name), {})
                own = next((sets for other, sets in groups if _all_same(values, other)), None)
                if own is None:
                    groups.append((values, own := []))
                own.append(name)
        return sorted(groups, key=lambda each: bool(each[0]))

    def comment(self, sets: Sequence[str], constant: str, material: Material, value: float) -> str:
        """What is said of a new constant."""
        before = material.constants[
            ISOTROPIC[constant] if constant not in material.constants else constant
        ]
        return change_comment(f"{constant} of {', '.join(sets)}", before, value)


def change_comment(what: str, before: float, now: float) -> str:
    """A comment on a number that was updated."""
    return f"updated: {what} was {before:.9g}, is {now:.9g}"


def changes_of(model: FiniteElementModel, updated: Mapping[tuple[str, str], float]) -> Changes:
    """What numbers by set and constant change.

    Raises:
        FormatError: a set or constant is none of the deck's, a value is no number, or a section's
            does not stand in the deck as a number of its own.
    """
    changes = Changes(model, [], {})
    by_set: dict[str, dict[str, float]] = {}
    for (name, constant), value in updated.items():
        if name not in model.sections:
            raise FormatError(
                f"{name}.{constant}", f"there is no set {name!r}; there are {', '.join(model.sets)}"
            )
        if not isfinite(value):
            raise FormatError(f"{name}.{constant}", f"is {value}, expected a number")
        by_set.setdefault(name, {})[constant] = value
    for name, values in by_set.items():
        _of_set(changes, name, values)
    return changes


def _of_set(changes: Changes, name: str, values: Mapping[str, float]) -> None:
    section = changes.model.sections[name]
    rest = dict(values)
    if isinstance(section, ShellSection) and "t" in rest:
        changes.sections.extend(_thickness(changes.model, name, section, rest.pop("t")))
    if isinstance(section, BeamSection):
        changes.sections.extend(
            _beam(name, section, {key: rest.pop(key) for key in _SECTION if key in rest})
        )
    factor = rest.pop("factor", 1.0)
    alike = _alike(changes.model, name)
    density = rest.pop("density", 0.0)
    share = density / _mean_density(changes.model, name) if density else 1.0
    for number, materials in enumerate(alike, start=1):
        suffix = "" if number == 1 else f"_{number}"
        own = {
            key.removesuffix(suffix): rest.pop(key)
            for key in list(rest)
            if _numbered(key) == number
        }
        for material in (changes.model.materials[each] for each in materials):
            changed = _as_stated(name, material, own, factor, share)
            if changed:
                changes.materials[name, material.name] = changed
    for key in rest:
        there = ", ".join(
            constant
            for materials in alike
            for constant in changes.model.materials[materials[0]].constants
        )
        raise FormatError(
            f"{name}.{key}",
            f"is none of this set's numbers in the deck; there are t, factor, {there}",
        )


def _numbered(key: str) -> int:
    """Which material of a set a constant belongs to, from 1."""
    last = key.rpartition("_")[2]
    return int(last) if "_" in key and last.isdigit() else 1


def _alike(model: FiniteElementModel, name: str) -> list[list[str]]:
    """A set's materials from the bottom; those that differ in density alone are one, with constants
    in common.
    """
    by_constants: dict[tuple[tuple[str, float], ...], list[str]] = {}
    for each in model.sections[name].materials:
        constants = model.materials[each].constants
        by_constants.setdefault(
            tuple(sorted((k, v) for k, v in constants.items() if k != "density")), []
        ).append(each)
    return list(by_constants.values())


def _mean_density(model: FiniteElementModel, name: str) -> float:
    section = model.sections[name]
    if isinstance(section, BeamSection):
        plies = [(section.material, 1.0)]
    else:
        plies = [(ply.material, ply.thickness) for ply in section.plies]
    mass = sum(t * model.materials[material].constants.get("density", 0.0) for material, t in plies)
    if not mass > 0:
        raise FormatError(
            f"{name}.density", "cannot be written: the materials of the set state none"
        )
    return mass / sum(t for _, t in plies)


def _thickness(
    model: FiniteElementModel, name: str, section: ShellSection, t: float
) -> Iterable[Number]:
    """Plies scaled to a whole thickness."""
    if any(block.thickness is not None for block in model.elements if block.set == name):
        raise FormatError(
            f"{name}.t",
            "cannot be written: the deck states thicknesses element by element or node by node",
        )
    share = t / sum(ply.thickness for ply in section.plies)
    for place, ply in {ply.place: ply for ply in section.plies}.items():
        if place is None:
            raise FormatError(f"{name}.t", "does not stand in the deck as a number")
        value = ply.thickness * share
        if not _same(value, ply.thickness):
            yield Number(
                name, place, value, change_comment(f"thickness of {name}", ply.thickness, value)
            )


def _beam(name: str, section: BeamSection, values: Mapping[str, float]) -> Iterable[Number]:
    stated = dict(zip(_SECTION, (section.area, *section.inertia[:2], section.torsion), strict=True))
    for constant, value in values.items():
        if constant not in section.places:
            raise FormatError(
                f"{name}.{constant}",
                f"does not stand in the deck, which gives the section of {section.where} in"
                " another way",
            )
        if not _same(value, stated[constant]):
            yield Number(
                name,
                section.places[constant],
                value,
                change_comment(f"{constant} of {name}", stated[constant], value),
            )


ISOTROPIC = {"E1": "E", "E2": "E", "G12": "G", "G13": "G", "G23": "G", "nu12": "nu"}
"""Constants of an isotropic material by the names that an orthotropic one has for them."""

_ORTHOTROPIC = {"E": "E1", "G": "G12", "nu": "nu12"}
_SAME = 1e-6
"""Constants of an isotropic material that differ by less, relative, are one."""


def _as_stated(
    name: str, material: Material, values: Mapping[str, float], factor: float, share: float
) -> dict[str, float]:
    """Constants as the deck states them, those alone that differ.

    They are those of an orthotropic material where it is isotropic no longer.

    Raises:
        FormatError: a constant is none of the material's.
    """
    names = ISOTROPIC if material.is_isotropic else _ORTHOTROPIC
    for key in values:
        if key.startswith("angle"):
            raise FormatError(
                f"{name}.{key}",
                "angles are not written back; turn the deck's orientations or plies",
            )
        if names.get(key, key) not in material.constants:
            raise FormatError(
                f"{name}.{key}", f"{material.name} of {material.where} has no such constant"
            )
    now = _isotropic(material, values) if material.is_isotropic else None
    if now is None:
        stated = (
            {key: material.constants.get(own, 0.0) for key, own in ISOTROPIC.items()}
            if material.is_isotropic
            else {}
        )
        now = {
            **(stated or material.constants),
            **{_ORTHOTROPIC.get(key, key): value for key, value in values.items()},
        }
    now |= {key: value * factor for key, value in now.items() if key[0] in "EG"}
    if "density" in material.constants:
        now["density"] = material.constants["density"] * share
    return {
        key: value for key, value in now.items() if not _same(value, material.constants.get(key))
    }


def _all_same(one: Mapping[str, float], other: Mapping[str, float]) -> bool:
    return one.keys() == other.keys() and all(
        _same(value, other[key]) for key, value in one.items()
    )


def _same(one: float, other: float | None) -> bool:
    return other is not None and isclose(one, other, rel_tol=ROUND_OFF)


def _isotropic(material: Material, values: Mapping[str, float]) -> dict[str, float] | None:
    """E and ν, and G where the deck states it; None where the values are those of no isotropic
    material.
    """
    updated: dict[str, float] = {}
    for key, value in values.items():
        own = ISOTROPIC.get(key, key)
        if abs(updated.setdefault(own, value) - value) > _SAME * abs(value):
            return None
    now = {key: updated.get(key, value) for key, value in material.constants.items()}
    if "G" in material.places:
        return now
    G = now.pop("G")
    if "G" in updated:
        now["nu"] = now["E"] / (2 * G) - 1
    return (
        now
        if -1 < now["nu"] <= 0.5 and abs(now["nu"] - updated.get("nu", now["nu"])) < _SAME
        else None
    )


Constants = Mapping[str, float]
Fields = Sequence[tuple[FieldPlace, str]]


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
        self._fields: defaultdict[int, list[tuple[FieldPlace, str]]] = defaultdict(list)
        self._before: defaultdict[int, list[str]] = defaultdict(list)
        self._after: defaultdict[int, list[str]] = defaultdict(list)

    @property
    def is_changed(self) -> bool:
        """Whether anything changes."""
        return bool(self._fields or self._before or self._after)

    def old(self, place: FieldPlace) -> str:
        """What stood in a field; empty where the line ends before it."""
        return self._split(place.line)[0][place.start : place.end]

    def put(self, *fields: tuple[FieldPlace, str]) -> None:
        """Let texts stand in fields instead."""
        for place, text in fields:
            self._fields[place.line].append((place, text))

    def remark(self, line: int, *comments: str) -> None:
        """Put comments before a line."""
        self._before[line] += (f"{self.sign} {each}" for each in comments)

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
        code, comment = self._split(number)
        for place, text in sorted(fields, key=lambda each: each[0].start, reverse=True):
            rest = code[place.end :]
            code = code[: place.start].ljust(place.start, "," if "," in code else " ") + text + rest
            code = code if rest else code.rstrip()
        return code + comment

    def result(self, head: Iterable[str] = ()) -> bytes:
        """The file with its changes, and lines before all of it."""
        ends = [
            raw[len(raw.rstrip(b"\r\n")) :].decode()
            for raw in self._content.splitlines(keepends=True)
        ]
        newline = (ends or ["\n"])[0] or "\n"
        lines = [f"{line}{newline}" for line in head]
        for number, end in enumerate(ends, start=1):
            after = self._after[number]
            lines += [f"{line}{newline}" for line in self._before[number]]
            lines.append(
                self.line(number, self._fields[number]).replace("\n", newline)
                + (end or newline if after else end)
            )
            lines += [f"{line}{newline}" for line in after]
        mark = BOM_UTF8 if self._content.startswith(BOM_UTF8) else b""
        # Numbers in what we say have a minus sign, which Latin-1 lacks; the user's own text has
        # none.
        return mark + "".join(lines).replace("−", "-").encode("latin-1", "replace")

    def _split(self, number: int) -> tuple[str, str]:
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
        head = [
            f"{self.files[''].sign} {line}"
            for remark in remarks
            for line in remark.splitlines() or [""]
        ]
        return {
            name: file.result(() if name else head)
            for name, file in self.files.items()
            if file.is_changed or (head and not name)
        }

    def _material(self, material: Material, changes: Changes) -> None:
        """Change a material for the sets that agree, and copy it for the others."""
        for k, (values, sets) in enumerate(changes.groups(material)):
            comments = {
                name: changes.comment(sets, name, material, value) for name, value in values.items()
            }
            if values and (k or not self.change(material, values, sets, comments)):
                self.copy(material, values, sets, comments)

    @abstractmethod
    def section(self, number: Number) -> None:
        """Write a number of a section."""

    @abstractmethod
    def change(
        self, material: Material, values: Constants, sets: list[str], comments: Mapping[str, str]
    ) -> bool:
        """Write constants where the material stands; False where its card cannot say them."""

    @abstractmethod
    def copy(
        self, material: Material, values: Constants, sets: list[str], comments: Mapping[str, str]
    ) -> None:
        """Append a material with other constants, and let the sections of sets name it."""
