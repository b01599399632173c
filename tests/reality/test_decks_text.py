"""Nastran decks as laboratories send them: text, dummy materials, massless sticks, cards that are
not read.
"""

import re

import numpy as np
import pytest

from fecore.errors import ModelError
from fecore.modes import MeasuredModes
from fecore.updating.forecasts import ForecastOrder, forecast
from fecore.updating.measurement import Measurement
from fecore.updating.pipeline import update
from service.platform.errors import Invalid
from tests.support.imported import imported
from tests.support.places import shared_file

FIRST_HZ = 5.6143  # of the beam with a tip mass; sqrt(3 EI / L³ / (m + 0.2357 mb)) / 2π = 5.61


def reality(name: str) -> str:
    return shared_file("REALITY", "reality", name).read_text()


@pytest.mark.parametrize(
    ("name", "noted"),
    [
        ("deck_continuation_plain.bdf", None),
        ("deck_continuation_letter.bdf", None),
        ("deck_deqatn_commas.bdf", ("DEQATN", [32])),
        ("deck_no_enddata.bdf", ("ENDDATA", [31])),
    ],
)
def test_text_of_nastran(name: str, noted: tuple[str, list[int]] | None) -> None:
    model = imported(name, reality(name))
    np.testing.assert_allclose(model.frequencies(3)[:2], FIRST_HZ, rtol=1e-4)
    if noted:
        assert model.notes()[noted[0]] == (noted[1], False)


def stick(
    *, pbar: str = "", more: str = "", control: str = "", end: str = "ENDDATA\n", rho: str = "2.7-9"
) -> str:
    """A beam of ten elements with a mass of 2 kg at its tip, mm-N-t."""
    grids = "".join(f"GRID,{k + 1},,{100.0 * k},0.,0.\n" for k in range(11))
    bars = "".join(f"CBAR,{k},1,{k},{k + 1},0.,1.,0.\n" for k in range(1, 11))
    plain = "PBAR           1       1    400. 13333.3 13333.3  22500.\n"
    return (
        f"SOL 103\nCEND\nSPC = 1\n{control}METHOD = 1\nBEGIN"
        f" BULK\nEIGRL,1,,,6\n{grids}{bars}{pbar or plain}"
        f"MAT1,1,70000.,,.33,{rho}\nCONM2,101,11,,2.0-3\nSPC1,1,123456,1\n{more}{end}"
    )


PBAR = (
    "PBAR           1       1    400. 13333.3 13333.3  22500.                {:8}\n{:8}     10.    "
    " 10.\n"
)


@pytest.mark.parametrize(
    ("mark", "own"),
    [("+BA1", "+BA1"), ("*BA1", "+BA1"), (" BA1", "+BA1"), ("QBA1", "+BA1"), ("QBA1", "*BA1"), ("BA1", "+BA1"),
     ("+", "+"), ("", "+"), ("", ""), ("QXXXXXXX", "+XXXXXXX"), ("+", "+A")],
)  # fmt: skip
def test_names_of_continuations(mark: str, own: str) -> None:
    model = imported("a.bdf", stick(pbar=PBAR.format(mark, own)))
    np.testing.assert_allclose(model.frequencies(3)[0], FIRST_HZ, rtol=1e-4)


def test_a_continuation_far_from_its_card_has_its_name() -> None:
    card, rest = PBAR.format("QBA1", "+BA1").splitlines(keepends=True)
    model = imported("a.bdf", stick(pbar=card, more=rest))
    np.testing.assert_allclose(model.frequencies(3)[0], FIRST_HZ, rtol=1e-4)
    large = (
        "PBAR*                  1               1            400.         13333.3QB1\n"
        "*B1              13333.3          22500.\n"
    )
    np.testing.assert_allclose(
        imported("a.bdf", stick(pbar=large)).frequencies(3)[0], FIRST_HZ, rtol=1e-4
    )


@pytest.mark.parametrize(
    "text",
    [
        (
            "DEQATN  8       F(A,B,C)=A+B;\n        G=A**2,\n+      "
            " H=1,2,3,4,5,6,7,8,9,10,11,12\nGRID,60,,0.,0.,0.\n"
        ),
        "DEQATN,8,F(A,B,C,D,E,F,G,H,I,J,K)=A\n",
        "DEQATN  9       f(a,b)=a+b,\n",
    ],
)
def test_equations_are_no_fields(text: str) -> None:
    model = imported("a.bdf", stick(more=text))
    assert model.notes()["DEQATN"][1] is False
    assert model.frequencies(3)[0] == pytest.approx(FIRST_HZ, rel=1e-4)


@pytest.mark.parametrize(
    "held",
    [
        "SPC1           1  12 456       1\nSPC1,1,3,1\n",
        "SPC1,1,1 2 3 4 5 6,1\n",
        "SPC,1,1,12 3456\n",
    ],
)
def test_components_with_blanks(held: str) -> None:
    model = imported("a.bdf", stick().replace("SPC1,1,123456,1\n", held))
    assert model.frequencies(3)[0] == pytest.approx(FIRST_HZ, rel=1e-4)


def test_a_grid_that_repeats_another() -> None:
    model = imported("a.bdf", stick(more="GRID           3           200.0      0.      0.\n"))
    assert model.notes()["GRID twice"][1] is False
    with pytest.raises(Invalid, match="GRID 3: the grid is there twice"):
        imported("a.bdf", stick(more="GRID,3,,201.,0.,0.\n"))


def test_a_deck_that_ends_within_a_line_may_be_cut() -> None:
    with pytest.raises(
        Invalid,
        match=r"within a line and without ENDDATA; it seems to be cut\. Add the line ENDDATA",
    ):
        imported("a.bdf", stick(end="").rstrip())


def test_a_dummy_material_is_asked_about() -> None:
    deck = reality("deck_dummy_density.bdf")
    with pytest.raises(
        Invalid, match=r"set pbarl_2 .*density 0.1 kg/m³, usual is 10 to 25000; accept="
    ) as caught:
        imported("a.bdf", deck)
    (answer,) = re.findall(r"accept=(\S+)", str(caught.value))
    assert answer == "density:pbarl_2"
    accepted = [
        imported("a.bdf", deck, accept=[n]) for n in (answer, "density:2", "DENSITY:PBARL_2")
    ]
    assert accepted[0].frequencies(3)[0] == pytest.approx(15.42, rel=0.015)
    assert accepted[0].document == accepted[1].document == accepted[2].document
    with pytest.raises(Invalid, match="accept: 'density:pshell_1' answers nothing"):
        imported("a.bdf", deck, accept=[answer, "density:pshell_1"])


def test_a_massless_stick() -> None:
    model = imported("a.bdf", reality("deck_massless_stick.bdf"))
    # its ten elements are 0.13 % stiff
    np.testing.assert_allclose(model.frequencies()[:2], 5.9550, rtol=2e-3)
    assert model.notes()["density"] == ([29], False)
    assert model.document["mass_kg"] == pytest.approx(2.0)
    for rho in ("", "0.", "0.0"):
        np.testing.assert_allclose(
            imported("a.bdf", stick(rho=rho)).frequencies()[:2], 5.9550, rtol=2e-3
        )
    with pytest.raises(Invalid, match="no density, and nothing else has a mass"):
        imported("a.bdf", stick(rho="").replace("CONM2,101,11,,2.0-3\n", ""))


def test_sticks_of_soft_and_stiff_material_are_asked_about() -> None:
    for modulus, said in (("7.+12", "7e+18 Pa"), ("0.5", "5e+05 Pa")):
        deck = stick().replace("70000.", modulus)
        with pytest.raises(
            Invalid, match=re.escape(f"has the modulus {said}, usual is 1e+06 to 2e+12")
        ):
            imported("a.bdf", deck)
        assert imported("a.bdf", deck, accept=["modulus:pbar_1"]).frequencies(3)[0] > 0


def test_a_mass_that_equations_alone_join() -> None:
    """They lead displacements without an arm: the mass stands as on the grid that leads."""
    deck = reality("deck_mpc_mass.bdf")
    on_grid = re.sub(r"(?m)^(MPC|GRID +50 ).*\n", "", deck).replace("102      50", "102      11")
    first, second = (imported("a.bdf", text) for text in (deck, on_grid))
    np.testing.assert_allclose(first.frequencies(4), second.frequencies(4), rtol=1e-9)
    assert first.document["mass_kg"] == pytest.approx(second.document["mass_kg"])


def test_what_was_not_read_is_told_first() -> None:
    aside = "GRID,50,,1000.,0.,10.\nCONM2,102,50,,1.-3\nRSPLINE,7,,10,50,123456,11\n"
    with pytest.raises(Invalid) as caught:
        imported("a.bdf", stick(more=aside))
    first, second = caught.value.faults
    assert first.detail.startswith("line 34: RSPLINE: not used: a rigid element")
    assert second.detail.startswith("line 33: a mass is on node 50")
    scalar = stick(more="SPOINT,99\nCELAS2,98,1.,11,1,99,0\n")
    with pytest.raises(Invalid, match=r"SPOINT: not used: scalar points; .*there is no GRID 99"):
        imported("a.bdf", scalar)
    apart = stick(
        more="CFAST,88,1,PROP,1,2,3\nGRID,70,,0.,5.,0.\nGRID,71,,9.,5.,0.\nCBAR,70,1,70,71,0.,0.,1.\n"
    )
    with pytest.raises(Invalid, match=r"CFAST: not used: fasteners.*the model falls into 2 parts"):
        imported("a.bdf", apart)
    with pytest.raises(Invalid) as plain:
        imported("a.bdf", stick(more="SPOINT,99\nPBAR,1,1,1.\n"))
    assert "SPOINT" not in str(plain.value)


TWICE = """\
*PART, NAME=P
*NODE
1, 0., 0., 0.
2, 100., 0., 0.
3, 100., 50., 0.
4, 0., 50., 0.
*ELEMENT, TYPE=S4, ELSET=SKIN
1, 1, 2, 3, 4
*SHELL SECTION, ELSET=SKIN, MATERIAL=AL
2.
*NONSTRUCTURAL MASS, ELSET=SKIN, UNITS={units}
{value}
*END PART
*ASSEMBLY, NAME=A
*INSTANCE, NAME=P-1, PART=P
*END INSTANCE
*INSTANCE, NAME=P-2, PART=P
100., 0., 0.
*END INSTANCE
*END ASSEMBLY
*MATERIAL, NAME=AL
*ELASTIC
70000., 0.3
*DENSITY
2.7e-9
*BOUNDARY
P-1.1, 1, 6
P-2.1, 1, 6
*STEP
*FREQUENCY
3
*END STEP
{more}"""


@pytest.mark.parametrize(
    ("units", "value", "mass"), [("MASS PER AREA", "1.e-9", 0.01), ("TOTAL MASS", "1.e-6", 0.002)]
)
def test_spread_mass_of_two_instances(units: str, value: str, mass: float) -> None:
    deck = TWICE.format(units=units, value=value, more="")
    model = imported("a.inp", deck)
    assert model.document["mass_kg"] == pytest.approx(2 * 2700 * 0.1 * 0.05 * 0.002 + mass)


def test_steps_that_ask_for_modes_again_are_noted() -> None:
    again = "*STEP\n*BOUNDARY, OP=NEW\n*FREQUENCY\n3\n*END STEP\n"
    deck = TWICE.format(units="MASS PER AREA", value="1.e-9", more=again)
    assert imported("a.inp", deck).notes()["*FREQUENCY"] == ([35], False)


MASS_ASIDE = "GRID,30,,1000.,0.,{z}\nCONM2,102,30,,1.-4{inertia}\n"


def test_a_mass_on_springs_without_turns() -> None:
    """What nothing turns and what weighs nothing in turns has no mode, and is no fault."""
    springs = "".join(f"CELAS2,{60 + k},10.,11,{k},30,{k}\n" for k in (1, 2, 3))
    deck = stick(more=MASS_ASIDE.format(z="0.", inertia="") + springs)
    np.testing.assert_allclose(imported("a.bdf", deck).frequencies(2), 5.492, rtol=1e-3)
    for inertia, more, said in [
        ("\n,1.,,1.,,,1.", springs, r"nothing resists a turn of 1 of 12 nodes.*\(1, 0, 0\) m"),
        (
            "",
            springs[: len(springs) // 3],
            r"nothing resists a motion of 1 of 12 nodes.*\(1, 0, 0\) m",
        ),
    ]:
        model = imported("a.bdf", stick(more=MASS_ASIDE.format(z="0.", inertia=inertia) + more))
        with pytest.raises(ModelError, match=said):
            model.frequencies(2)


def test_connectors_beyond_all_digits_are_named() -> None:
    bush = "CBUSH,60,9,11,30,1.,0.,0.\nPBUSH,9,K" + ",1.+{0}" * 6 + "\n"
    more = MASS_ASIDE.format(z="100.", inertia="") + bush
    for digits in (9, 12):
        found = imported("a.bdf", stick(more=more.format(digits))).frequencies(1)
        assert found[0] == pytest.approx(5.491, rel=1e-3)
    with pytest.raises(
        ModelError, match=r"stiffnesses from .* N/m stand side by side.*or join it rigidly"
    ):
        imported("a.bdf", stick(more=more.format(17))).frequencies(1)


def test_a_straight_stick_twists_without_displacements() -> None:
    """A torsion mode of a stick is forecast, and no point is said to show it."""
    inertia = stick(rho="").replace(
        "CONM2,101,11,,2.0-3\n", "CONM2,101,11,,2.0-3\n,10.,,10.,,,10.\n"
    )
    found = forecast(imported("a.bdf", inertia).body, ForecastOrder())
    torsion = np.sqrt(70000 / 2.66 * 22500 / 1000 / 10) / (2 * np.pi)
    np.testing.assert_allclose(found.frequency_hz[2], torsion, rtol=1e-3)
    assert not found.seen[2].any()
    assert np.isfinite(found.mac).all()


@pytest.mark.parametrize(
    ("before", "after"),
    [("+BA1         10.     10.\n", PBAR.format("QBA1", "").splitlines(keepends=True)[0])],
)
def test_a_continuation_before_its_card(before: str, after: str) -> None:
    assert imported("a.bdf", stick(pbar=before + after)).frequencies(1)[0] == pytest.approx(
        FIRST_HZ, rel=1e-4
    )


@pytest.mark.parametrize(
    ("deck", "said"),
    [
        (stick().replace("BEGIN BULK\n", ""), "line 6: a card stands before any BEGIN BULK; add this line before"),
        (stick().replace("CEND\n", "").replace("BEGIN BULK\n", ""), "a card stands before any BEGIN BULK"),
        (stick(pbar="PBAR           1       1   400,0 13333,3 13333,3 22500,0\n"), "a decimal comma has to be a point"),
        (stick(pbar=PBAR.format("+BA1", "+BA2")), r"'\+BA2' continues no card; behind its first character"),
        (stick(pbar="PBAR*                  1               1            400.         13333.3\n         13333.3\n"),
         r"second half of a line of large fields begins with \*"),
    ],
)  # fmt: skip
def test_texts_that_are_refused_with_their_cure(deck: str, said: str) -> None:
    with pytest.raises(Invalid, match=said):
        imported("a.bdf", deck)


@pytest.mark.parametrize(
    "text",
    [" DEQATN 8       F(A,B)=A+B,1,2,3,4,5,6,7,8,9,10\n", "DEQATN,8,F(A,B)=A;\n,C=MAX(A,B,1,2,3,4,5,6,7,8,9,10)\n",
     "DEQATN  8       F(A,B)=A+B;\n   C=MAX(A,B,1,2,3,4,5,6,7,8,9,10)\n"],
)  # fmt: skip
def test_equations_of_other_columns(text: str) -> None:
    model = imported("a.bdf", stick(more=text + " GRID,60,,0.,0.,0.\n"))
    assert model.notes()["DEQATN"] == ([32], False)


def test_hinges_and_equations_as_a_beam_of_two_halves_has_them() -> None:
    """Both ends held: with a hinge amid, odd modes are those of a beam that is held at one end."""
    ends = "SPC1,1,123456,11\n"
    hinged = stick(more=ends).replace("CBAR,6,1,6,7,0.,1.,0.", "CBAR,6,1,6,7,0.,1.,0.\n,56")
    slider = stick(more=ends).replace("CBAR,6,1,6,7", "GRID,60,,500.,0.,0.\nCBAR,6,1,60,7")
    equations = "".join(f"MPC,3,60,{k},1.,6,{k},-1.\n" for k in (1, 2, 3, 4))
    slider = slider.replace("SPC = 1\n", "SPC = 1\nMPC = 3\n").replace(
        "ENDDATA", equations + "ENDDATA"
    )
    first, second = (imported("a.bdf", deck).frequencies(6) for deck in (hinged, slider))
    np.testing.assert_allclose(first, second, rtol=1e-6)
    half = 1.8751**2 * np.sqrt(70000 * 13333.3 / (2.7e-9 * 400) / 500**4) / (2 * np.pi)
    np.testing.assert_allclose(first[:2], half, rtol=0.01)


def test_a_lever_between_two_held_beams_is_updated() -> None:
    """Its supports hold together with the equation, and some elements lie near none of them."""
    more = "GRID,50,,0.,500.,0.\nGRID,51,,300.,500.,0.\nGRID,52,,600.,500.,0.\nSPC1,1,123456,50\n"
    bars = "CBAR,60,1,50,51,0.,1.,0.\nCBAR,61,1,51,52,0.,1.,0.\nMPC,3,52,2,1.,11,2,2.\n"
    model = imported("a.bdf", stick(more=more + bars).replace("SPC = 1\n", "SPC = 1\nMPC = 3\n"))
    hz = forecast(model.body, ForecastOrder(modes=5)).finer_hz
    assert hz is not None
    points = {k + 1: (0.1 * k, 0.0, 0.0) for k in range(1, 11, 2)}
    measured = Measurement(None, points, modes=MeasuredModes(hz * np.sqrt(1.08), np.full(5, 0.01)))
    (E, *_) = update(measured, model.body).parameters
    assert E.estimate == pytest.approx(1.08 * 7e10, rel=2e-3)


def test_a_roller_askew_by_an_equation() -> None:
    """It holds what a support along its own axes does, and the body is not free to move there."""
    c, s = np.cos(1.0), np.sin(1.0)
    roller = stick(more=f"MPC,3,11,2,{c:.6f},11,1,{-s:.6f}\n").replace(
        "SPC = 1\n", "SPC = 1\nMPC = 3\n"
    )
    turned = f"CORD2R,7,,0.,0.,0.,0.,0.,1.\n,{c:.6f},{s:.6f},0.\nSPC1,1,2,11\n"
    support = stick(more=turned).replace("GRID,11,,1000.0,0.,0.", "GRID,11,,1000.0,0.,0.,7")
    first, second = (imported("a.bdf", deck) for deck in (roller, support))
    np.testing.assert_allclose(first.frequencies(4), second.frequencies(4), rtol=1e-5)
    assert first.document["mass_kg"] == pytest.approx(second.document["mass_kg"])
    free = imported("a.bdf", roller, boundary="free").body.model
    assert free.rigid_modes.shape[1] == 5


def test_a_truss_does_not_shear() -> None:
    """Rods whose turns are held, as trusses state it, resist stretch alone, on a finer mesh too."""
    up, along = 20.0 * 70000 / 200, 2 * 20.0 * 70000 / 250 * 0.6**2
    grids = "".join(
        f"GRID,{k},,{x},0.,{z},,2456\n"
        for k, x, z in ((1, -150.0, 0.0), (2, 0.0, 0.0), (3, 150.0, 0.0), (4, 0.0, 200.0))
    )
    deck = (
        f"{grids}CROD,1,1,1,4\nCROD,2,1,2,4\nCONROD,3,3,4,1,20.\nPROD,1,1,20.\nSPC1,1,13,1,2,3\n"
        "MAT1,1,70000.,,.33,1.-12\nCONM2,9,4,,1.-3\n"
    )
    found = forecast(imported("a.bdf", deck, accept=["density:1"]).body, ForecastOrder())
    hz = np.sqrt(np.array([along, up + 2 * 5600 * 0.8**2]) / 1e-3) / (2 * np.pi)
    np.testing.assert_allclose(found.frequency_hz[:2], hz, rtol=1e-3)
    assert found.finer_hz is not None
    np.testing.assert_allclose(found.finer_hz[:2], hz, rtol=1e-3)


def test_shells_bend_by_e_and_nu() -> None:
    """Of a MAT1 whose G does not fit, G acts across the shell alone."""
    plate = "".join(f"GRID,{3 * i + j + 1},,{50.0 * i},{50.0 * j},0.\n" for i in range(7) for j in range(3)) + "".join(
        f"CQUAD4,{2 * i + j + 1},1,{3 * i + j + 1},{3 * i + j + 4},{3 * i + j + 5},{3 * i + j + 2}\n"
        for i in range(6)
        for j in range(2)
    )  # fmt: skip
    deck = plate + "PSHELL,1,1,1.,1,,1\nMAT1,1,70000.,{},.33,2.7-9\n"
    fits, differs = (imported("a.bdf", deck.format(G), boundary="free") for G in ("", "20000."))
    np.testing.assert_allclose(differs.frequencies(4), fits.frequencies(4), rtol=1e-3)
    assert differs.notes()["MAT1 with E, G, NU"][1] is False


def test_a_mean_of_an_edge_turns_with_it() -> None:
    """RBE3 of the nodes of one edge, which lie on a line, carries a mass as RBE2 does."""
    grids = "".join(
        f"GRID,{3 * i + j + 1},,{50.0 * i},{25.0 * j},0.\n" for i in range(9) for j in range(3)
    )
    shells = "".join(
        f"CQUAD4,{2 * i + j + 1},1,{3 * i + j + 1},{3 * i + j + 4},{3 * i + j + 5},{3 * i + j + 2}\n"
        for i in range(8)
        for j in range(2)
    )
    rest = (
        "PSHELL,1,1,3.,1,,1\nMAT1,1,70000.,,.33,2.7-9\nSPC1,1,123456,1,2,3\n"
        "GRID,90,,410.,25.,5.\nCONM2,91,90,,2.-4\n"
    )
    first, second = (
        imported("a.bdf", f"{grids}{shells}{rest}{link}").frequencies(4)
        for link in ("RBE3,92,,90,123456,1.,123456,25,26\n,27\n", "RBE2,92,90,123456,25,26,27\n")
    )
    np.testing.assert_allclose(first, second, rtol=3e-3)  # RBE2 holds the edge straight
