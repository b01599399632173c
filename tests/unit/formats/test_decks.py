"""Decks read back as a solver would: supports, masses and cards. Acceptance has CalculiX find their
modes.
"""

import re
from dataclasses import replace

import numpy as np
import pytest

from modalbase.formats.decks import Deck, Mass, write_nastran, write_shells, write_solids

MODULI = (30e9, 12e9, 5e9, 4e9, 3e9)
PLACES = ((0.41, 0.011), (0.6, 0.1), (0.2, -0.03))
"""Of point masses: inside, at a corner, inside."""
DECK = Deck(0.6, 0.2, 0.00812345, MODULI, 0.25, 1900.0, "cantilever", 6, remarks=("job 7",))
LOADED = replace(DECK, alpha_beta=(0.5, 1e-6), masses=tuple(Mass(*at, 0.004) for at in PLACES))


def _block(deck: str, card: str) -> list[list[float]]:
    """The numbers below a card of an .inp, continued lines joined."""
    body = deck.split(f"{card}\n")[1].split("\n*")[0].replace(",\n", ",")
    return [[float(cell) for cell in line.split(",")] for line in body.splitlines()]


def _nodes(deck: str) -> np.ndarray:
    return np.array(_block(deck, "*NODE, NSET=ALL"))[:, 1:]


def _elements(deck: str, kind: str) -> np.ndarray:
    return np.array(_block(deck, f"*ELEMENT, TYPE={kind}, ELSET=BODY"), int)[:, 1:] - 1


@pytest.mark.parametrize(
    ("boundary", "shell", "solid", "spc"),
    [
        ("cantilever", {"ROOT": ["1,6"]}, {"ROOT": ["1,2"], "ROOTLINE": ["3,3"]}, {"123456"}),
        ("simply_supported", {"START": ["2,4"], "END": ["2,4"]},
         {"START": ["2,2"], "STARTLINE": ["3,3"], "END": ["2,2"], "ENDLINE": ["3,3"]}, {"2346"}),
        ("free", {}, {}, set()),
    ],
)  # fmt: skip
def test_the_edges_are_held_as_the_boundary_says(
    boundary: str, shell: dict[str, list[str]], solid: dict[str, list[str]], spc: set[str]
) -> None:
    deck = replace(DECK, boundary=boundary)
    at = {"ROOT": 0.0, "START": 0.0, "END": deck.length}
    for text, expected in ((write_shells(deck), shell), (write_solids(deck), solid)):
        held: dict[str, list[str]] = {}
        for name, first, last in re.findall(r"^([A-Z]+),(\d),(\d)$", text, re.MULTILINE):
            held.setdefault(name, []).append(f"{first},{last}")
        assert held == expected
        for name in held:
            members = (
                np.concatenate([np.array(row, int) for row in _block(text, f"*NSET, NSET={name}")])
                - 1
            )
            line = name.endswith("LINE")
            nodes = _nodes(text)
            edge = np.abs(nodes[:, 0] - at[name.removesuffix("LINE")]) < 1e-12
            assert set(members) == set(
                np.flatnonzero(edge & (np.abs(nodes[:, 2]) < 1e-12) if line else edge)
            )
    nastran = write_nastran(deck)
    rows = re.findall(r"^SPC1,1,(\d+),(\d+)$", nastran, re.MULTILINE)
    assert ({dofs for dofs, _ in rows}, "SPC = 1" in nastran) == (spc, bool(spc))
    assert {int(node) for _, node in rows} == {
        n + 1
        for n, (x, *_) in enumerate(_nodes(write_shells(deck)))
        if x in [at[name] for name in shell]
    }


def test_cards_carry_the_constants() -> None:
    plain, shells = write_solids(DECK), write_shells(LOADED, corrected=True)
    assert _block(plain, "*ELASTIC, TYPE=ENGINEERING CONSTANTS") == [
        [30e9, 12e9, 12e9, 0.25, 0.25, 0.25, 5e9, 4e9],
        [3e9],
    ]
    np.testing.assert_allclose(
        np.hstack(_block(shells, "*ELASTIC, TYPE=ENGINEERING CONSTANTS"))[-2:],
        [5 / 6 * 4e9, 5 / 6 * 3e9],
        rtol=1e-8,
    )
    assert shells.startswith("** job 7\n** G13 and G23 are 5/6")
    assert "*DAMPING, ALPHA=0.5, BETA=1e-06\n" in shells
    assert "*DAMPING" not in plain
    nastran, bare = write_nastran(LOADED), write_nastran(DECK)
    assert (
        "MAT8*,1,3.E+10,1.2E+10,0.25\n*,5.E+09,4.E+09,3.E+09,1900.\nPSHELL*,1,1,0.00812345,1\n*,1.0,1,0.833333333\n"
        in nastran
    )
    assert "PARAM,ALPHA1,0.5\nPARAM,ALPHA2,1.E-06\n" in nastran
    assert "ALPHA1" not in bare


def test_masses_hang_on_the_nodes_of_their_places() -> None:
    shells, solids, nastran = write_shells(LOADED), write_solids(LOADED), write_nastran(LOADED)
    for text in (shells, solids):
        for number, at in enumerate(PLACES, 1):
            ((_, node),) = _block(text, f"*ELEMENT, TYPE=MASS, ELSET=MASS{number}")
            np.testing.assert_allclose(_nodes(text)[int(node) - 1], [*at, 0.0], atol=1e-12)
    grid = {
        int(n): (float(x), float(y))
        for n, x, y in re.findall(r"^GRID\*,(\d+),,([^,]+),(.+)$", nastran, re.MULTILINE)
    }
    hung = re.findall(r"^CONM2,\d+,(\d+),0,(.+)$", nastran, re.MULTILINE)
    np.testing.assert_allclose([grid[int(node)] for node, _ in hung], PLACES, atol=1e-12)
    assert {mass for _, mass in hung} == {"0.004"}


def test_nastran_has_the_mesh_of_the_shells_in_fields_that_it_reads() -> None:
    nastran, shells = write_nastran(LOADED), write_shells(LOADED)
    quads = re.findall(r"^CQUAD8,\d+,1,(.+)\n,(\d+),(\d+),", nastran, re.MULTILINE)
    connectivity = [
        [int(n) - 1 for n in (*six.split(","), seven, eight)] for six, seven, eight in quads
    ]
    np.testing.assert_array_equal(connectivity, _elements(shells, "S8R"))
    for line in nastran.split("BEGIN BULK\n")[1].splitlines():
        wide = 16 if line.split(",")[0].endswith("*") else 8
        for cell in line.split(",")[1:]:
            assert len(cell) <= wide, line
