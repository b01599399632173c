"""What is unusual in a model, or would be left out of it: a question that names set and value,
which `accept` answers.

Each says what to send, as `accept=density:GAUGE`. A name in `accept` that answers nothing of a
model is refused.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import sqrt

from modalbase.formats.errors import FormatError
from modalbase.formats.models.model import (
    FiniteElementModel,
    Material,
    SkippedCard,
    Where,
    skipped_card,
)
from modalbase.formats.models.units import (
    SIZES,
    UnitSystem,
    extent,
    guess,
    modulus_of,
    units_of,
    within,
)

DENSITIES, MODULI, SPEEDS = (10.0, 2.5e4), (1e6, 2e12), (30.0, 3e4)
"""Usual in solids: kg/m³, Pa, and √(E/ρ) in m/s."""

MOST_NAMED = 20  # questions in one message


@dataclass(frozen=True)
class Question:
    """What is asked of a model."""

    place: str  # of the fault
    what: str  # sentence that names set, value and usual range
    names: tuple[str, ...]  # in `accept`, each of which answers; the first is advised
    effect: str = "takes it as it is"  # of the answer


def plain(name: str) -> str:
    """A name in `accept` as it is compared: capitals without the star of a card."""
    return name.strip().lstrip("*").upper()


def require_answers(
    questions: Iterable[Question], accepted: Sequence[str], skipped: Iterable[SkippedCard] = ()
) -> None:
    """Refuse questions without an answer, and answers without a question.

    Args:
        questions: all of a model.
        accepted: names that the user sends.
        skipped: cards that are not used, which may be named though they change nothing.

    Raises:
        FormatError: as said; every one is named.
    """
    questions, given = list(questions), {plain(name): name for name in accepted}
    known = {plain(name) for question in questions for name in question.names} | {
        plain(one.card) for one in skipped
    }
    faults = [
        (question.place, f"{question.what}; accept={question.names[0]} {question.effect}")
        for question in questions
        if given.keys().isdisjoint(map(plain, question.names))
    ]
    if len(faults) > MOST_NAMED:
        faults[MOST_NAMED:] = [("", f"and {len(faults) - MOST_NAMED} more such questions")]
    named = ", ".join(question.names[0] for question in questions[:MOST_NAMED]) or "none"
    faults += [
        ("accept", f"{name!r} answers nothing that is asked of this model; its questions: {named}")
        for key, name in given.items()
        if key not in known
    ]
    if faults:
        raise FormatError(faults)


def of_cards(model: FiniteElementModel) -> Iterator[Question]:
    """Of cards that would be left out although modes change by that."""
    for one in model.ignored:
        if one.changes:
            where = f"{Where(one.lines[0], one.file)}: " if any(one.lines) else ""
            what = f"{where}{one.card} would be left out ({one.loss}), which changes modes"
            effect = (
                "takes the model without it; else send the matrices of its solver, which have it"
            )
            yield Question("", what, (plain(one.card),), effect)


def of_size(model: FiniteElementModel, length: float = 1.0) -> Iterator[Question]:
    """Of a structure that is unusually small or large, in a unit of so many metres."""
    size = extent(model) * length
    if not within(size, SIZES):
        what = (
            f"the structure is {size:.3g} m large, usual is {_range(SIZES)} (are the units right?)"
        )
        yield Question("units", what, ("size",))


def of_materials(model: FiniteElementModel, units: str) -> Iterator[Question]:
    """Of densities and moduli set by set; the first says which units would fit where others do."""
    u, questions = units_of(units), list[Question]()
    for name in model.sets:
        for each in model.sections[name].materials:
            material = model.materials[each]
            for kind, what in _unusual(material, u):
                if kind == "density" and is_weighed_apart(model, name, material):
                    continue
                sets = sum(each in model.sections[one].materials for one in model.sets)
                others = (
                    f", accept={kind}:{each} all {sets} sets of the material" if sets > 1 else ""
                )
                at = f", {material.where}" if material.where.line else ""
                named = f"in {units} the set {name} (material {each}{at}) has {what}"
                answers = f"{kind}:{name}", f"{kind}:{each}"
                questions.append(Question("", named, answers, f"takes it as it is{others}"))
    better = guess(model) if questions else None
    if better and better.units != units:
        first = questions[0]
        questions[0] = replace(
            first, place="units", what=f"{first.what}; {better.units} would fit: {better.reason}"
        )
    yield from questions


def is_weighed_apart(model: FiniteElementModel, name: str, material: Material) -> bool:
    """Whether a set of no density is a stick's, whose masses are stated apart."""
    apart = model.sections[name].extra_mass > 0 or any(mass.mass > 0 for mass in model.masses)
    return apart and not material.constants.get("density")


def massless(model: FiniteElementModel) -> Iterator[SkippedCard]:
    """Notes of materials without density, which are no question where masses are stated apart.

    Raises:
        FormatError: nothing weighs.
    """
    weights = [material.constants.get("density", 0.0) for material in model.materials.values()]
    apart = [
        *(mass.mass for mass in model.masses),
        *(section.extra_mass for section in model.sections.values()),
    ]
    if not any(value > 0 for value in (*weights, *apart)):
        first = next(iter(model.materials.values()))
        raise FormatError(
            str(first.where),
            f"the material {first.name} has no density, and nothing else has a mass",
        )
    for material in model.materials.values():
        if not material.constants.get("density"):
            at = material.where
            yield skipped_card("massless", "", [at.line], at.file, material=material.name)


def _unusual(material: Material, u: UnitSystem) -> Iterator[tuple[str, str]]:
    density, modulus = (
        material.constants.get("density", 0.0) * u.density,
        modulus_of(material) * u.stress,
    )
    usual = within(density, DENSITIES), within(modulus, MODULI)
    if not density:
        yield "density", f"no density, usual is {_range(DENSITIES)} kg/m³"
    elif not usual[0]:
        yield "density", f"the density {density:.4g} kg/m³, usual is {_range(DENSITIES)}"
    if not usual[1]:
        yield "modulus", f"the modulus {modulus:.4g} Pa, usual is {_range(MODULI)}"
    if all(usual) and not within(speed := sqrt(modulus / density), SPEEDS):
        yield "speed", f"the speed of sound √(E/ρ) {speed:.3g} m/s, usual is {_range(SPEEDS)}"


def _range(limits: tuple[float, float]) -> str:
    return f"{limits[0]:g} to {limits[1]:g}"
