"""Updated numbers go back into the user's own deck, and nothing else changes."""

import difflib
import subprocess
from pathlib import Path
from shutil import which

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modalbase.formats.errors import FormatError
from modalbase.formats.models.inp import read_inp
from modalbase.formats.models.model import FiniteElementModel
from modalbase.formats.models.units import guess
from modalbase.formats.models.write import write_deck
from tests.unit.formats.models.decks import (
    CAE,
    MATERIAL,
    OPEN,
    PLATE,
    beam,
    grid,
    open_deck,
    quads,
    shell,
)

Updated = dict[tuple[str, str], float]


def written(deck: str, updated: Updated) -> str:
    content = deck.encode()
    return write_deck(content, read_inp(content), updated).get("", content).decode()


def constants(model: FiniteElementModel, name: str) -> dict[str, float]:
    return dict(model.materials[shell(model, name).plies[0].material].constants)


def kept(before: str, after: str) -> list[str]:
    """Lines of the deck that are gone."""
    marks = difflib.ndiff(before.splitlines(keepends=True), after.splitlines(keepends=True))
    return [line[2:].rstrip("\r\n") for line in marks if line.startswith("- ")]


def test_numbers_change_in_place() -> None:
    changed = written(
        PLATE,
        {
            ("plate", "E1"): 2.41e10,
            ("plate", "G12"): 3.21e9,
            ("plate", "t"): 0.0051,
            ("plate", "E2"): 8.5e9,
        },
    )
    expected = PLATE.replace(
        "2.3e10, 8.5e9, 0.27, 3.0e9, 3.0e9",
        "** updated: E1 of plate was 2.3e+10, is 2.41e+10\n** updated: G12 of plate was 3e+09, is"
        " 3.21e+09\n2.41e+10, 8.5e9, 0.27,3.21e+09, 3.0e9",
    ).replace("\n0.005\n", "\n** updated: thickness of plate was 0.005, is 0.0051\n0.0051\n")
    assert changed == expected
    assert (
        write_deck(
            PLATE.encode(),
            read_inp(PLATE.encode()),
            {("plate", "E1"): 2.3e10, ("plate", "t"): 0.005},
        )
        == {}
    )


def test_sets_that_shared_a_material_get_copies() -> None:
    content = open_deck("i-1")
    model = read_inp(content)
    updated = {
        ("flange", "E1"): 2.5e10,
        ("web", "E1"): 2.2e10,
        ("web", "density"): 1900.0,
        ("flange", "t"): 0.0062,
    }
    changed = write_deck(content, model, updated)[""]
    again = read_inp(changed)
    assert set(again.materials) == {"GFRP", "GFRP_web"}
    assert constants(again, "flange") == {**constants(model, "flange"), "E1": 2.5e10}
    assert constants(again, "web") == {**constants(model, "web"), "E1": 2.2e10, "density": 1900.0}
    assert shell(again, "flange").plies[0].thickness == 0.0062
    assert shell(again, "web").plies[0].thickness == 0.006
    assert kept(content.decode(), changed.decode()) == [
        "2.3e+10,8.5e+09,8.5e+09,0.27,.3,.35,3e+09,3e+09,",
        "6.000000e-03",
        "*SHELL SECTION,ELSET=WEB,MATERIAL=GFRP,ORIENTATION=OWEB",
    ]


def test_a_set_that_was_not_updated_keeps_the_material() -> None:
    content = open_deck("box-1")
    changed = write_deck(content, read_inp(content), {("flange", "factor"): 0.9})[""]
    again = read_inp(changed)
    assert constants(again, "web") == constants(read_inp(content), "web")
    assert constants(again, "flange")["G23"] == pytest.approx(0.9 * 2.4e9, rel=1e-9)
    assert constants(again, "flange")["nu12"] == 0.27
    assert shell(again, "flange").plies[0].material == "GFRP_flange"


@pytest.mark.parametrize("name", OPEN)
def test_an_open_deck_is_read_and_keeps_every_other_byte(name: str) -> None:
    content = open_deck(name)
    model = read_inp(content)
    assert model.sets == ("flange", "web")
    assert model.title.startswith(name.partition("-")[0])
    assert not [each for each in model.ignored if each.changes]
    gfrp = model.materials["GFRP"]
    assert (gfrp.constants["E1"], gfrp.constants["G23"], gfrp.constants["density"]) == (
        2.3e10,
        2.4e9,
        1850,
    )
    for block in model.elements:
        assert block.kind == "quad8"
        np.testing.assert_array_equal(block.axes, np.tile([1.0, 0, 0], (len(block.numbers), 1)))
        assert shell(model, block.set).plies[0].thickness in (0.004, 0.005, 0.006, 0.008, 0.01)
    offered = guess(model)
    assert offered is not None
    assert offered.units == "m-N-kg"
    assert ", and GFRP would be fibre reinforced plastic (E 23 GPa" in offered.reason
    changed = write_deck(content, model, {("flange", "E1"): 2.5e10, ("web", "E1"): 2.5e10})[""]
    rest = [line for line in changed.split(b"\n") if not line.startswith(b"** updated")]
    assert [line.replace(b"2.5e+10", b"2.3e+10") for line in rest] == content.split(b"\n")


def test_laminates_of_a_part() -> None:
    deck = CAE.replace('0.001, 3, "Carbon epoxy", -45.', "0.001, 3, Glass, -45.").replace(
        "** ---", '*Material, name=Glass\n*Density\n1900.,\n*Elastic, type=LAMINA\n4e10, 9e9, 0.25, 4e9, 4e9, 3e9\n** ---', 1
    )  # fmt: skip
    changed = written(
        deck,
        {
            ("set-1", "E1"): 1.3e11,
            ("set-1", "E1_2"): 4.1e10,
            ("set-1", "t"): 0.0022,
            ("set-1", "density"): 1800.0,
        },
    )
    again = read_inp(changed.encode())
    plies = shell(again, "set-1").plies
    assert [ply.material for ply in plies] == ["Carbon epoxy_set-1", "Glass"]
    assert [ply.thickness for ply in plies] == [0.0011, 0.0011]
    carbon, glass = (again.materials[ply.material].constants for ply in plies)
    assert (carbon["E1"], glass["E1"]) == (1.3e11, 4.1e10)
    # nine digits are written
    assert carbon["density"] == pytest.approx(1600 * 1800 / 1750, rel=1e-8)
    assert glass["density"] == pytest.approx(1900 * 1800 / 1750, rel=1e-8)
    assert again.materials[shell(again, "rib.set-1").plies[0].material].constants["E1"] == 1.2e11
    np.testing.assert_array_equal(again.nodes, read_inp(deck.encode()).nodes)
    assert '0.0011, 3,"Carbon epoxy_set-1", 45., Ply-1' in changed


def test_isotropic_materials_and_beams() -> None:
    deck = PLATE.replace("TYPE=LAMINA\n2.3e10, 8.5e9, 0.27, 3.0e9, 3.0e9, 2.4e9", "TYPE=ISO\n7.0e10, 0.3").replace(
        "*STEP",
        "*ELEMENT, TYPE=B31, ELSET=RIB\n9, 1, 2\n*BEAM GENERAL SECTION, ELSET=RIB, SECTION=GENERAL, DENSITY=1900.\n"
        "1e-3, 2e-7, 0., 3e-7, 5e-8\n0., 1., 0.\n7e10, 2.6e10\n*STEP", 1,
    )  # fmt: skip
    updated = {
        ("plate", "E1"): 6.9e10,
        ("plate", "E2"): 6.9e10,
        ("plate", "G12"): 2.6e10,
        ("rib", "I1"): 2.1e-7,
        ("rib", "G"): 2.5e10,
    }
    again = read_inp(written(deck, updated).encode())
    plate = constants(again, "plate")
    assert (plate["E"], plate["nu"]) == (6.9e10, pytest.approx(6.9 / 5.2 - 1, rel=1e-8))
    assert beam(again, "rib").inertia == (2.1e-7, 3e-7, 0.0)
    assert again.materials["rib"].constants["G"] == 2.5e10
    with pytest.raises(
        FormatError, match=r"^rib.density: does not stand as a number of its own in rib"
    ):
        written(deck, {("rib", "density"): 1800.0})


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_an_isotropic_material_that_is_so_no_longer(end: str) -> None:
    deck = PLATE.replace(
        "*ELASTIC, TYPE=LAMINA\n2.3e10, 8.5e9, 0.27, 3.0e9, 3.0e9, 2.4e9", "*ELASTIC\n7.0e10, 0.3"
    )
    deck = deck.replace("\n", end)
    again = read_inp(written(deck, {("plate", "E1"): 7.2e10, ("plate", "E2"): 6.8e10}).encode())
    G = 7e10 / 2.6
    expected = {
        "E1": 7.2e10,
        "E2": 6.8e10,
        "E3": 6.8e10,
        "nu12": 0.3,
        "nu13": 0.3,
        "nu23": 0.3,
        "density": 1850.0,
    }
    changed = constants(again, "plate")
    assert changed == {
        **expected,
        **{key: pytest.approx(G, rel=1e-8) for key in ("G12", "G13", "G23")},
    }
    stiff = read_inp(
        written(
            deck, {("plate", "E1"): 8e10, ("plate", "E2"): 8e10, ("plate", "G12"): 2.4e10}
        ).encode()
    )
    assert constants(stiff, "plate")["G12"] == 2.4e10  # an isotropic material would have ν = 0.67


def test_included_files_and_line_ends() -> None:
    deck = PLATE.replace(MATERIAL, "*INCLUDE, INPUT=m.inp\n").replace("\n", "\r\n").encode()
    included = {"m.inp": MATERIAL.replace("\n", "\r\n").rstrip().encode()}
    changed = write_deck(
        deck,
        read_inp(deck, included),
        {("plate", "E1"): 2.4e10},
        included=included,
        remarks=["from job 7: −8.7 %", "two\nlines"],
    )
    assert set(changed) == {"", "m.inp"}
    assert changed[""] == b"** from job 7: -8.7 %\r\n** two\r\n** lines\r\n" + deck
    assert b"2.4e10" not in changed["m.inp"]
    assert changed["m.inp"].count(b"\r\n") == included["m.inp"].count(b"\r\n") + 1
    assert read_inp(changed[""], changed).materials["GFRP"].constants["E1"] == 2.4e10


@pytest.mark.parametrize(
    ("updated", "message"),
    [
        ({("skin", "E1"): 1.0}, r"^skin.E1: there is no set 'skin'; there are plate"),
        ({("plate", "E3"): 1.0}, r"^plate.E3: GFRP of line 13 has no such constant"),
        ({("plate", "E1_2"): 1.0}, r"^plate.E1_2: is none of this set's numbers"),
        (
            {("plate", "angle_1"): 1.0},
            r"^plate.angle_1: angles are not written back; turn the deck's orientations",
        ),
    ],
)
def test_numbers_that_the_deck_has_not(updated: Updated, message: str) -> None:
    with pytest.raises(FormatError, match=message):
        written(PLATE, updated)


@settings(max_examples=20)
@given(
    st.dictionaries(
        st.tuples(st.sampled_from(["set-1", "rib.set-1"]), st.sampled_from(["E1", "E2", "G12", "G13", "G23", "density", "t"])),
        st.floats(0.9, 1.1),
    )
)  # fmt: skip
def test_it_reads_back(ratios: dict[tuple[str, str], float]) -> None:
    model = read_inp(CAE.encode())

    def value(of: FiniteElementModel, name: str, constant: str) -> float:
        return (
            sum(ply.thickness for ply in shell(of, name).plies)
            if constant == "t"
            else constants(of, name)[constant]
        )

    updated = {
        (name, constant): value(model, name, constant) * ratio
        for (name, constant), ratio in ratios.items()
    }
    again = read_inp(written(CAE, updated).encode())
    for name in model.sets:
        for constant in ("E1", "E2", "G12", "G13", "G23", "density", "t"):
            expected = updated.get((name, constant), value(model, name, constant))
            assert value(again, name, constant) == pytest.approx(expected, rel=1e-8)
    np.testing.assert_array_equal(again.nodes, model.nodes)
    assert again.supports[0].nodes.tolist() == model.supports[0].nodes.tolist()


def frequencies(folder: Path, content: bytes) -> list[float]:
    """Of the deck's modes as CalculiX finds them, Hz."""
    (folder / "deck.inp").write_bytes(content)
    subprocess.run(["ccx", "-i", "deck"], cwd=folder, check=True, capture_output=True)
    rows = [line.split() for line in (folder / "deck.dat").read_text().splitlines()]
    return [float(row[3]) for row in rows if len(row) == 5 and row[0].isdigit()]


@pytest.mark.skipif(which("ccx") is None, reason="CalculiX is not installed")
def test_the_solver_reads_it_and_all_frequencies_follow(tmp_path: Path) -> None:
    constants = "ENGINEERING CONSTANTS\n2.3e10, 8.5e9, 8.5e9, 0.27, 0.3, 0.35, 3e9, 3e9\n2.4e9,"
    sets = "*ELSET, ELSET=FLANGE, GENERATE\n1, 16\n*ELSET, ELSET=WEB, GENERATE\n17, 32\n"
    walls = [
        f"*SHELL SECTION, ELSET={name}, MATERIAL=GFRP\n0.005\n"
        for name in ("PLATE", "FLANGE", "WEB")
    ]
    deck = (
        PLATE.replace(grid(2, 1), grid(8, 4))
        .replace(quads(2, 1), quads(8, 4))
        .replace(walls[0], sets + "".join(walls[1:]))
    )
    content = deck.replace("LAMINA\n2.3e10, 8.5e9, 0.27, 3.0e9, 3.0e9, 2.4e9", constants).encode()
    changed = write_deck(
        content,
        read_inp(content),
        {("flange", "factor"): 1.21, ("web", "factor"): 1.21 * (1 + 1e-7)},
    )[""]
    assert b"NAME=GFRP_web" in changed
    before, after = (
        np.array(frequencies(tmp_path, content)),
        np.array(frequencies(tmp_path, changed)),
    )
    elastic = before > 1.0
    assert elastic.sum() > 3
    np.testing.assert_allclose(after[elastic] / before[elastic], 1.1, rtol=1e-6)
