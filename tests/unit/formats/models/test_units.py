"""Units of decks: scaled by dimension, guessed from materials, asked about where they are
unusual.
"""

import re
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from modalbase.formats.errors import FormatError
from modalbase.formats.models.inp import read_inp
from modalbase.formats.models.model import FiniteElementModel
from modalbase.formats.models.questions import massless, of_materials, of_size, require_answers
from modalbase.formats.models.units import COMMON, guess, in_si, units_of
from tests.unit.formats.models.decks import PLATE, beam, shell
from tests.unit.formats.models.test_inp import CARRIED


def deck(units: str, *, E: float = 7e10, density: float = 2700.0, size: float = 0.1) -> str:
    """An aluminium frame with a mass, springs and a beam, written in units."""
    u = units_of(units)
    stress, rho, m = E / u.stress, density / u.density, size / u.length
    return f"""\
*NODE
1, 0., 0., 0.
2, {m!r}, 0., 0.
3, {m!r}, {m!r}, 0.
4, 0., {m!r}, 0.
*ELEMENT, TYPE=S4, ELSET=PLATE
1, 1, 2, 3, 4
*ELEMENT, TYPE=B31, ELSET=RIB
2, 1, 2
*ELEMENT, TYPE=MASS, ELSET=M
3, 3
*ELEMENT, TYPE=ROTARYI, ELSET=R
4, 3
*ELEMENT, TYPE=SPRING1, ELSET=S
5, 4
*ELEMENT, TYPE=SPRING1, ELSET=T
6, 4
*MATERIAL, NAME=METAL
*ELASTIC
{stress!r}, 0.33
*DENSITY
{rho!r}
*SHELL SECTION, ELSET=PLATE, MATERIAL=METAL
{0.002 / u.length!r}
*BEAM SECTION, ELSET=RIB, MATERIAL=METAL, SECTION=T
{0.02 / u.length!r}, {0.03 / u.length!r}, {0.03 / u.length!r}, {0.002 / u.length!r}, {0.002 / u.length!r}
*NODAL THICKNESS
3, {0.003 / u.length!r}
*NONSTRUCTURAL MASS, ELSET=PLATE, UNITS=MASS PER AREA
{1.5 / u.mass * u.length**2!r}
*NONSTRUCTURAL MASS, ELSET=RIB, UNITS=MASS PER LENGTH
{0.2 / u.mass * u.length!r}
*MASS, ELSET=M
{0.25 / u.mass!r}
*ROTARY INERTIA, ELSET=R
{1e-3 / u.mass / u.length**2!r}, {2e-3 / u.mass / u.length**2!r}, {3e-3 / u.mass / u.length**2!r}
*SPRING, ELSET=S
3
{5e4 / u.force * u.length!r}
*SPRING, ELSET=T
4
{70 / u.force / u.length!r}
"""


def numbers(model: FiniteElementModel) -> Iterator[float]:
    """Every number of a model that has a unit."""
    yield from model.nodes.ravel().tolist()
    for block in model.elements:
        yield from ([] if block.offsets is None else block.offsets.ravel().tolist())
        yield from ([] if block.thickness is None else block.thickness.ravel().tolist())
    section, rib = shell(model, "plate"), beam(model, "rib")
    yield from (section.plies[0].thickness, section.offset, section.extra_mass)
    yield from (rib.area, *rib.inertia, rib.torsion, rib.extra_mass)
    yield from model.materials["METAL"].constants.values()
    for mass in model.masses:
        yield from (mass.mass, *(value for row in mass.inertia for value in row), *mass.offset)
    yield from (spring.stiffness for spring in model.springs)


@pytest.mark.parametrize("units", COMMON)
def test_one_structure_in_all_units(units: str) -> None:
    expected = read_inp(deck("m-N-kg").encode())
    model_si = in_si(read_inp(deck(units).encode()), units)
    np.testing.assert_allclose(
        list(numbers(model_si)), list(numbers(expected)), rtol=1e-12, atol=1e-18
    )
    assert not [*of_materials(read_inp(deck(units).encode()), units)]
    offered = guess(read_inp(deck(units).encode()))
    assert offered is not None
    assert offered.units == units
    assert re.search(r"METAL would be aluminium \(E 70 GPa, density 2700 kg/m³\)", offered.reason)


def test_offsets_of_shells() -> None:
    text = PLATE.replace("MATERIAL=GFRP\n", "MATERIAL=GFRP, OFFSET=SPOS\n").replace(
        "*STEP", CARRIED + "*STEP", 1
    )
    model = read_inp(text.encode())
    model_si = in_si(model, "mm-N-t")
    assert shell(model_si, "plate").offset == pytest.approx(-2.5e-6, rel=1e-12)
    assert model_si.springs[0].direction == model.springs[0].direction


@pytest.mark.parametrize(
    ("density", "modulus", "message"),
    [
        (
            0.8,
            2.1e11,
            (
                r"^in m-N-kg the set plate \(material METAL, line 18\) has the density 0.8 kg/m³,"
                r" usual is 10 to 25000"
            ),
        ),
        (
            7.85e-9,
            2.1e5,
            (
                "^units: in m-N-kg the set plate .* density 7.85e-09 kg/m³.* mm-N-t would fit: .*"
                " steel"
            ),
        ),
        (2700.0, 70.0, r"the modulus 70 Pa, usual is 1e\+06 to 2e\+12; accept=modulus:plate"),
        (
            12.0,
            1.9e12,
            (
                r"the speed of sound .* 3.98e\+05 m/s, usual is 30 to 30000; accept=speed:plate"
                r" takes it"
            ),
        ),
    ],
)
def test_unusual_values_are_asked(density: float, modulus: float, message: str) -> None:
    model = read_inp(deck("m-N-kg", E=modulus, density=density, size=100.0).encode())
    questions = [*of_materials(model, "m-N-kg")]
    with pytest.raises(FormatError, match=message):
        require_answers(questions, ())
    require_answers(questions, [name for question in questions for name in question.names[:1]])
    require_answers(questions, [f" {question.names[1].upper()}" for question in questions])


def test_answers_of_no_question() -> None:
    model = read_inp(deck("m-N-kg", density=0.8).encode())
    questions = [*of_materials(model, "m-N-kg")]
    with pytest.raises(
        FormatError, match=r"density 0.8 .*accept: 'density:web' answers nothing .*: density:plate"
    ):
        require_answers(questions, ["density:web"])
    with pytest.raises(
        FormatError, match=r"^accept: 'CONTACT' answers nothing .* its questions: none$"
    ):
        require_answers([], ["CONTACT"])


def test_many_questions_are_cut() -> None:
    model = read_inp(deck("m-N-kg", density=0.8).encode())
    questions = 30 * [*of_materials(model, "m-N-kg")]
    with pytest.raises(FormatError) as caught:
        require_answers(questions, [])
    assert len(caught.value.faults) == 21
    assert caught.value.faults[-1][1] == f"and {len(questions) - 20} more such questions"


def test_no_density_is_asked_unless_masses_are_stated_apart() -> None:
    bare = deck("m-N-kg").replace("*DENSITY\n2700.0\n", "")
    model = read_inp(bare.encode())
    assert not [*of_materials(model, "m-N-kg")]
    (note,) = massless(model)
    assert (note.card, note.lines, note.changes) == ("density", (18,), False)
    assert in_si(model, "m-N-kg").materials["METAL"].constants["density"] == 0
    massless_plate = replace(
        model,
        masses=(),
        sections={k: replace(s, extra_mass=0.0) for k, s in model.sections.items()},
    )
    with pytest.raises(
        FormatError,
        match=r"^line 18: the material METAL has no density, and nothing else has a mass",
    ):
        next(massless(massless_plate))
    heavy = replace(
        model.materials["METAL"],
        name="STEEL",
        constants={**model.materials["METAL"].constants, "density": 7800.0},
    )
    mixed = replace(
        massless_plate,
        materials={**massless_plate.materials, "STEEL": heavy},
        sections={
            **massless_plate.sections,
            "rib": replace(beam(massless_plate, "rib"), material="STEEL"),
        },
    )
    (question,) = of_materials(mixed, "m-N-kg")
    assert question.what.endswith("has no density, usual is 10 to 25000 kg/m³")


def test_units_are_guessed_by_most_elements() -> None:
    model = read_inp(deck("mm-N-t").encode())
    dummy = replace(
        model.materials["METAL"],
        name="DUMMY",
        constants={"E": 10.0, "nu": 0.3, "G": 3.0, "density": 1e-13},
    )
    sections = {**model.sections, "rib": replace(beam(model, "rib"), material="DUMMY")}
    mixed = replace(model, materials={**model.materials, "DUMMY": dummy}, sections=sections)
    offered = guess(mixed)
    assert offered is not None
    assert offered.units == "mm-N-t"
    assert "DUMMY would be no usual material" in offered.reason
    (question,) = of_materials(mixed, "mm-N-t")
    assert question.names == ("density:rib", "density:DUMMY")


def test_a_structure_as_large_as_a_town_is_asked() -> None:
    model = read_inp(deck("mm-N-t", size=300.0).encode())
    (question,) = of_size(model)
    assert (
        question.what
        == "the structure is 4.24e+05 m large, usual is 0.001 to 10000 (are the units right?)"
    )
    assert not [*of_size(model, 1e-3)]
    require_answers([question], ["size"])


@pytest.mark.parametrize("name", ["", "mm-n-t", "mm-N-t-s"])
def test_names_that_are_no_units(name: str) -> None:
    with pytest.raises(
        FormatError, match="names no units, expected length-force-mass, such as m-N-kg, mm-N-t"
    ):
        units_of(name)
