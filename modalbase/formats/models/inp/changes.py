"""What updated numbers change in a deck: numbers of sections, and constants of materials set by set."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from modalbase.formats.errors import FormatError
from modalbase.formats.models.model import BeamSection, FiniteElementModel, Material, Place, ShellSection

_SECTION = ("area", "I1", "I2", "J")


@dataclass(frozen=True)
class Number:
    """A number of a section: where it stands, its new value, and what a comment says of it."""

    place: Place
    value: float
    comment: str


@dataclass(frozen=True)
class Changes:
    """What changes.

    Attributes:
        model: the deck's.
        sections: numbers of sections.
        materials: new constants by set and material's name, those alone that differ.
    """

    model: FiniteElementModel
    sections: list[Number]
    materials: dict[tuple[str, str], dict[str, float]]

    def groups(self, material: Material) -> list[tuple[tuple[tuple[str, float], ...], list[str]]]:
        """New constants and the sets that have them; the first keep the material, those that do not change before others."""
        found: dict[tuple[tuple[str, float], ...], list[str]] = {}
        for name in self.model.sets:
            if material.name in materials_of(self.model, name):
                values = tuple(self.materials.get((name, material.name), {}).items())
                found.setdefault(tuple(sorted(values)), []).append(name)
        return sorted(found.items(), key=lambda each: bool(each[0]))

    def comment(self, sets: Sequence[str], constant: str, material: Material, value: float) -> str:
        """What is said of a new constant."""
        return said(f"{constant} of {', '.join(sets)}", material.constants[constant], value)


def said(what: str, before: float, now: float) -> str:
    """A comment on a number that was updated."""
    return f"updated: {what} was {before:.9g}, is {now:.9g}"


def materials_of(model: FiniteElementModel, name: str) -> tuple[str, ...]:
    """Names of the materials of a set, from the bottom of a laminate."""
    section = model.sections[name]
    if isinstance(section, BeamSection):
        return (section.material,)
    return tuple(dict.fromkeys(ply.material for ply in section.plies))


def changes_of(model: FiniteElementModel, updated: Mapping[tuple[str, str], float]) -> Changes:
    """What numbers by set and constant change.

    Raises:
        FormatError: a set or constant is none of the deck's, or does not stand there as a number of its own.
    """
    found = Changes(model, [], {})
    by_set: dict[str, dict[str, float]] = {}
    for (name, constant), value in updated.items():
        if name not in model.sections:
            raise FormatError(f"{name}.{constant}", f"there is no set {name!r}; there are {', '.join(model.sets)}")
        by_set.setdefault(name, {})[constant] = value
    for name, values in by_set.items():
        _of_set(found, name, values)
    return found


def _of_set(found: Changes, name: str, values: Mapping[str, float]) -> None:
    section = found.model.sections[name]
    rest = dict(values)
    if isinstance(section, ShellSection) and "t" in rest:
        found.sections.extend(_thickness(found.model, name, section, rest.pop("t")))
    if isinstance(section, BeamSection):
        found.sections.extend(_beam(name, section, {key: rest.pop(key) for key in _SECTION if key in rest}))
    factor = rest.pop("factor", 1.0)
    alike = _alike(found.model, name)
    mean = _mean_density(found.model, name)
    share = rest.pop("density") / mean if "density" in rest else 1.0
    for number, materials in enumerate(alike, start=1):
        suffix = "" if number == 1 else f"_{number}"
        own = {key.removesuffix(suffix): rest.pop(key) for key in list(rest) if _numbered(key) == number}
        for material in (found.model.materials[each] for each in materials):
            changed = _as_stated(name, material, own, factor, share)
            if changed:
                found.materials[name, material.name] = changed
    for key in rest:
        there = ", ".join(constant for materials in alike for constant in found.model.materials[materials[0]].constants)
        raise FormatError(f"{name}.{key}", f"is none of this set's numbers in the deck; there are t, factor, {there}")


def _numbered(key: str) -> int:
    """Which material of a set a constant belongs to, from 1."""
    last = key.rpartition("_")[2]
    return int(last) if "_" in key and last.isdigit() else 1


def _alike(model: FiniteElementModel, name: str) -> list[list[str]]:
    """A set's materials from the bottom; those that differ in density alone are one, with constants in common."""
    found: dict[tuple[tuple[str, float], ...], list[str]] = {}
    for each in materials_of(model, name):
        constants = model.materials[each].constants
        found.setdefault(tuple(sorted((k, v) for k, v in constants.items() if k != "density")), []).append(each)
    return list(found.values())


def _mean_density(model: FiniteElementModel, name: str) -> float:
    section = model.sections[name]
    if isinstance(section, BeamSection):
        return model.materials[section.material].constants["density"]
    mass = sum(ply.thickness * model.materials[ply.material].constants["density"] for ply in section.plies)
    return mass / sum(ply.thickness for ply in section.plies)


def _thickness(model: FiniteElementModel, name: str, section: ShellSection, t: float) -> Iterable[Number]:
    """Plies scaled to a whole thickness."""
    if any(block.thickness is not None for block in model.elements if block.set == name):
        raise FormatError(f"{name}.t", "cannot be written: the deck states the thickness at nodes, by *NODAL THICKNESS")
    share = t / sum(ply.thickness for ply in section.plies)
    for place, ply in {ply.place: ply for ply in section.plies}.items():
        if place is None:
            raise FormatError(f"{name}.t", "does not stand in the deck as a number")
        value = ply.thickness * share
        if value != ply.thickness:
            yield Number(place, value, said(f"thickness of {name}", ply.thickness, value))


def _beam(name: str, section: BeamSection, values: Mapping[str, float]) -> Iterable[Number]:
    stated = dict(zip(_SECTION, (section.area, *section.inertia[:2], section.torsion), strict=True))
    for constant, value in values.items():
        if constant not in section.places:
            raise FormatError(
                f"{name}.{constant}",
                f"does not stand in the deck, which gives the section of line {section.line} by dimensions",
            )
        if value != stated[constant]:
            yield Number(section.places[constant], value, said(f"{constant} of {name}", stated[constant], value))


_ISOTROPIC = {"E1": "E", "E2": "E", "G12": "G", "G13": "G", "G23": "G", "nu12": "nu"}
_ORTHOTROPIC = {"E": "E1", "G": "G12", "nu": "nu12"}


def _as_stated(
    name: str, material: Material, values: Mapping[str, float], factor: float, share: float
) -> dict[str, float]:
    """Constants as the deck states them, those alone that differ.

    Raises:
        FormatError: an isotropic material would be so no longer, or a constant is none of its.
    """
    names = _ISOTROPIC if material.is_isotropic else _ORTHOTROPIC
    wanted: dict[str, float] = {}
    for key, value in values.items():
        own = names.get(key, key)
        if own not in material.constants:
            raise FormatError(f"{name}.{key}", f"{material.name} of line {material.line} has no such constant")
        if abs(wanted.setdefault(own, value) - value) > 1e-6 * abs(value):
            raise FormatError(
                f"{name}.{key}",
                f"differs from another {own} of {material.name}, which the deck states as isotropic (line {material.line}); "
                "state ENGINEERING CONSTANTS there to update them apart",
            )
    now = {**material.constants, **wanted}
    now |= {key: value * factor for key, value in now.items() if key[0] in "EG"}
    now["density"] *= share
    if material.is_isotropic and "G" not in material.places:
        if "G" in wanted:
            now["nu"] = now["E"] / (2 * now["G"]) - 1
        del now["G"]
    changed = {key: value for key, value in now.items() if value != material.constants[key]}
    for key in changed:
        if key not in material.places:
            raise FormatError(
                f"{name}.{key}", f"does not stand as a number of its own in {material.name} of line {material.line}"
            )
    return changed
