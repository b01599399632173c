"""Nastran bulk data, as pre-processors and people write it."""

import numpy as np
import pytest

from modalbase.formats.errors import FormatError
from modalbase.formats.models.bdf import read_bdf
from modalbase.formats.models.bdf.card import number
from modalbase.formats.models.model import FiniteElementModel, Where
from tests.unit.formats.models.decks import ENDS, GRIDS, SQUARE, beam, shell

BAR = ENDS + "CBAR,1,1,1,2,0.,0.,1.\n"


def read(text: str, **included: str) -> FiniteElementModel:
    return read_bdf(
        text.encode(), {name.replace("_", "."): value.encode() for name, value in included.items()}
    )


def lost(model: FiniteElementModel) -> dict[str, bool]:
    return {one.card: one.changes for one in model.ignored}


@pytest.mark.parametrize(
    ("text", "value"),
    [("1.5", 1.5), ("4.3-5", 4.3e-5), ("7.85E-9", 7.85e-9), ("1.D3", 1e3), ("-.5+2", -50.0), ("2.1E11", 2.1e11),
     ("+7.", 7.0), ("1.E+3", 1e3), ("NAN", None), ("INF", None), ("1_0.", None), ("1.0.0", None), ("1E999", None),
     ("", None), (".", None), ("--1.", None), ("1-", None)],
)  # fmt: skip
def test_numbers(text, value) -> None:
    assert number(text) == value


def test_the_same_in_small_large_and_free_fields() -> None:
    small = """\
GRID    1               0.      0.      0.
GRID    2               1.      0.      0.
GRID    3               1.      1.      0.
GRID    4               0.      1.      0.
CQUAD4  1       1       1       2       3       4
PSHELL  1       1       1.-2    1               1               .5
MAT1    1       7.+10           .3      2700.
"""
    large = """\
GRID*   1                               0.              0.              *A
*A      0.
GRID*                  2                              1.              0.
*                     0.
grid*   3                               1.000000000000001.00000000000000*
*       0.
GRID    4               0.      1.      0.
CQUAD4  1       1       1       2       3       4
PSHELL* 1               1               .010            1
*                       1                               .5
MAT1*   1               70000000000.                    .3
*       2.7+3
"""
    free = SQUARE.replace("PSHELL,1,1,.01,1,,1", "PSHELL,1,1,.01,1,,1,,.5")
    one, two, three = read(small), read(large), read(free)
    for other in (two, three):
        assert np.array_equal(one.nodes, other.nodes)
        assert np.array_equal(one.elements[0].nodes, other.elements[0].nodes)
        assert one.materials["1"].constants == other.materials["1"].constants
    assert shell(one).plies[0].thickness == shell(two).plies[0].thickness == 0.01
    assert shell(one).extra_mass == shell(two).extra_mass == 0.5


def test_continuations_automatic_named_and_apart() -> None:
    bar = BAR + "PBAR,1,1,1.-4,1.-9,2.-9,3.-9,.1{}"
    automatic = read(bar.format("\n,,,,,,,,\n,.8,.7,.0"))
    named = read(bar.format(",,+A\n+A,,,,,,,,,+B\n+B,.8,.7,0."))
    head, tail = bar.format(",,+A\n@\n+B,.8,.7,0.\n+A,,,,,,,,,+B").split("@")
    apart = read(tail + "\n" + head)
    for model in (automatic, named, apart):
        assert beam(model, "pbar_1").shear == (0.8, 0.7)
    small = read(
        BAR
        + "PBAR    1       1       1.-4    1.-9    2.-9    3.-9    .1              +A\n+A\n+      "
        " .8      .7"
    )
    assert beam(small, "pbar_1").shear == (0.8, 0.7)


def test_control_selects_what_holds() -> None:
    holds = "SPC1,1,123456,1\nSPC1,2,3,2,THRU,9\nSPC,3,4,12,0.\nSPCADD,9,1,3\n"
    deck = (
        "SOL 103\nCEND\nTITLE = A plate\n{}  $ remark\nBEGIN,BULK\n"
        + SQUARE
        + holds
        + "ENDDATA\nnothing,counts\n"
    )
    model = read(deck.format("SPC = 2"))
    assert model.title == "A plate"
    assert [(one.nodes.tolist(), one.dofs) for one in model.supports] == [([1, 2, 3], (2,))]
    model = read(deck.format("SUBCASE 1\n  SPC = 1\nSUBCASE 2\n  METHOD = 5\n  SPC = 9"))
    assert [(one.nodes.tolist(), one.dofs) for one in model.supports] == [
        ([3], (0, 1)),
        ([0], (0, 1, 2, 3, 4, 5)),
    ]
    assert "SPC of another subcase" in lost(model)
    assert read(deck.format("METHOD = 5")).supports == ()
    again = read(deck.replace("ENDDATA", "SPCADD,9,2\nENDDATA").format("SPC = 9"))
    # all that SPCADD join
    assert sorted(one.dofs for one in again.supports) == [(0, 1), (0, 1, 2, 3, 4, 5), (2,)]
    assert lost(read(deck.format("SPC = 77")))["SPC"]
    assert lost(read(deck.replace("9,1,3", "9,1,8").format("SPC = 9")))[
        "SPC"
    ]  # a set that SPCADD joins, and is not there
    assert [one.dofs for one in read(SQUARE + "SPC1,1,12,3").supports] == [(0, 1)]
    assert lost(read(SQUARE + "SPC1,1,12,3\nSPC1,2,12,4"))["SPC"]


def test_links_of_a_node_by_one_leader_lead_it_together() -> None:
    # 2 may be held where 1 is too
    links = read(SQUARE + "RBE2,7,1,123,2\nRBE2,8,1,456,2\nSPC1,1,123456,1,2").links
    assert [(one.node, one.leaders, one.dofs) for one in links] == [(1, (0,), (0, 1, 2, 3, 4, 5))]


def test_what_holds_a_led_node_holds_its_leader_at_the_same_place() -> None:
    tied = SQUARE + "GRID,5,,0.,0.,0.\nRBE2,7,1,123,5\nSPC1,1,1236,5,3\n"
    held = {(tuple(one.nodes.tolist()), one.dofs) for one in read(tied).supports}
    assert held == {((4,), (5,)), ((0,), (0, 1, 2)), ((2,), (0, 1, 2, 5))}


def test_permanent_constraints_and_defaults_of_grids() -> None:
    model = read("GRDSET,,,,,,,345\n" + SQUARE.replace("GRID,4,,0.,1.,0.", "GRID,4,,0.,1.,0.,,6"))
    assert {one.dofs: one.nodes.tolist() for one in model.supports} == {
        (2, 3, 4): [0, 1, 2],
        (5,): [3],
    }


def test_a_mark_of_byte_order_and_names_in_utf_8() -> None:
    model = read_bdf(b"\xef\xbb\xbf" + SQUARE.encode())
    assert model.numbers.tolist() == [1, 2, 3, 4]
    assert read("TITLE = Träger\nBEGIN BULK\n" + SQUARE + "ENDDATA\n").title == "Träger"
    latin = "TITLE = Träger\nBEGIN BULK\n" + SQUARE + "ENDDATA\n"
    assert read_bdf(latin.encode("latin-1")).title == "Träger"


def test_include_and_its_places() -> None:
    head, mat = SQUARE.rsplit("MAT1", 1)
    model = read(
        "SOL 103\nCEND\nBEGIN BULK\ninclude 'C:\\decks\\\n  mat.inc'\n" + head + "ENDDATA",
        mat_inc="$\nMAT1" + mat,
    )
    assert model.materials["1"].places["E"].file == "mat.inc"
    assert (model.materials["1"].where, model.materials["1"].places["E"].start) == (
        Where(2, "mat.inc"),
        7,
    )


def test_systems_of_coordinates_in_a_chain() -> None:
    deck = """\
CORD2R,1,,1.,0.,0.,1.,0.,1.
,1.,1.,0.
CORD2C,2,1,0.,0.,0.,0.,0.,1.
,1.,0.,0.
CORD2S,3,2,0.,0.,5.,0.,0.,6.
,1.,0.,5.
CORD1R,4,1,2,3
GRID,1,,0.,0.,0.
GRID,2,1,1.,0.,0.,2
GRID,3,2,1.,90.,0.,2
GRID,4,3,2.,90.,90.,3
GRID,5,4,0.,0.,1.
CROD,1,1,1,2
CROD,2,1,2,3
CROD,3,1,3,4
CROD,4,1,4,5
PROD,1,1,1.-4
MAT1,1,7.+10,,.3
"""
    model = read(deck)
    # System 1 lies at (1, 0, 0) with x along the model's y, hence y along −x.
    assert model.nodes[1] == pytest.approx([1, 1, 0])
    assert model.nodes[2] == pytest.approx([0, 0, 0], abs=1e-12)
    assert model.nodes[3] == pytest.approx([-1, 0, 5])
    # z of system 4 runs from grid 1 to grid 2
    assert model.nodes[4] == pytest.approx(model.nodes[1] / np.sqrt(2))
    assert model.node_axes[1] == pytest.approx(np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]]))
    assert model.node_axes[2] == pytest.approx(
        np.array([[-1, 0, 0], [0, -1, 0], [0, 0, 1]]), abs=1e-12
    )
    # Radius, the angle from the axis downwards, the angle around it.
    assert model.node_axes[3] == pytest.approx(
        np.array([[-1, 0, 0], [0, 0, -1], [0, -1, 0]]), abs=1e-12
    )


def test_supports_and_springs_in_the_systems_of_their_grids() -> None:
    deck = (
        SQUARE.replace("GRID,3,,1.,1.,0.", "GRID,3,,1.,1.,0.,7")
        + "CORD2C,7,,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n"
    )
    model = read(deck + "SPC1,1,1,1,3\nCELAS2,9,1000.,3,1\n")
    (skew,) = [one for one in model.supports if one.axes is not None]
    assert skew.nodes.tolist() == [2]
    assert skew.axes[0] == pytest.approx(np.array([1, 1, 0]) / np.sqrt(2))
    assert model.springs[0].direction == pytest.approx(np.array([1, 1, 0]) / np.sqrt(2))
    assert [one.axes for one in read(deck + "SPC1,1,123,1,3\n").supports] == [None]


def test_wtmass_makes_masses_of_weights() -> None:
    more = "CONM2,7,3,0,2.,.1,0.,0.\n,5.,,6.,,,7.\n"
    weights = read(SQUARE.replace(".01,1,,1", ".01,1,,1,,4.") + more + "PARAM,WTMASS,.5")
    assert weights.materials["1"].constants["density"] == 1350
    assert shell(weights).extra_mass == 2
    assert (weights.masses[0].mass, weights.masses[0].inertia[2][2]) == (1, 3.5)
    control = read("SOL 103\nCEND\nPARAM,WTMASS,.25\nBEGIN BULK\n" + SQUARE + "ENDDATA")
    assert control.materials["1"].constants["density"] == 675


def test_material_axes_of_shells() -> None:
    turned = read(SQUARE.replace("1,2,3,4\nPSHELL", "1,2,3,4,30.\nPSHELL"))
    assert turned.elements[0].axes[0] == pytest.approx([np.cos(np.pi / 6), 0.5, 0])
    backwards = read(SQUARE.replace("1,2,3,4\nPSHELL", "4,3,2,1,30.\nPSHELL"))  # the normal is −z
    assert backwards.elements[0].axes[0] == pytest.approx([np.cos(np.pi / 6), -0.5, 0])
    system = "CORD2R,5,,0.,0.,0.,0.,0.,1.\n,1.,1.,.5\n"
    projected = read(SQUARE.replace("1,2,3,4\nPSHELL", "1,2,3,4,5\nPSHELL") + system)
    assert projected.elements[0].axes[0] == pytest.approx(np.array([1, 1, 0]) / np.sqrt(2))
    upright = "CORD2R,5,,0.,0.,0.,1.,0.,0.\n,0.,0.,1.\n"
    assert read(SQUARE.replace("1,2,3,4\nPSHELL", "1,2,3,4,5\nPSHELL") + upright).elements[0].axes[
        0
    ] == pytest.approx([1, 0, 0])


def test_offsets_and_thicknesses_of_elements() -> None:
    quad = SQUARE.replace("1,2,3,4\nPSHELL", "1,2,3,4,0.,.2\n,,,.01,.02,,.04\nPSHELL")
    model = read(quad)
    assert model.elements[0].offsets[0] == pytest.approx(np.tile([0, 0, 0.2], (4, 1)))
    assert model.elements[0].thickness[0].tolist() == [0.01, 0.02, 0.01, 0.04]
    relative = read(SQUARE.replace("1,2,3,4\nPSHELL", "1,2,3,4\n,,1,2.,,,\nPSHELL"))
    assert relative.elements[0].thickness[0].tolist() == [0.02, 0.01, 0.01, 0.01]
    own = read(
        SQUARE.replace(".01,1,,1", ",1,,1").replace(
            "1,2,3,4\nPSHELL", "1,2,3,4\n,,,.01,.01,.03,.03\nPSHELL"
        )
    )
    assert shell(own).plies[0].thickness == pytest.approx(0.02)
    sharp = read(
        SQUARE.replace("1,2,3,4\nPSHELL", "1,2,3,4\n,,,0.,0.,.01,.01\nPSHELL")
    )  # an edge that tapers to nothing
    assert sharp.elements[0].thickness[0].tolist() == [0, 0, 0.01, 0.01]


def test_quadratic_elements_and_triangles() -> None:
    middles = (
        "GRID,5,,.5,0.,0.\nGRID,6,,1.,.5,0.\nGRID,7,,.5,1.,0.\nGRID,8,,0.,.5,0.\nGRID,9,,.5,.5,0.\n"
    )
    rest = "PSHELL,1,1,.01,1,,1\nMAT1,1,7.+10,,.3,2700.\n"
    quad = read(GRIDS + middles + "CQUAD8,1,1,1,2,3,4,5,6\n,7,8,,,,.03,45.,.1\n" + rest)
    assert quad.elements[0].kind == "quad8"
    assert quad.elements[0].nodes[0].tolist() == list(range(8))
    assert quad.elements[0].thickness[0].tolist() == [
        0.01,
        0.01,
        0.01,
        0.03,
        0.01,
        0.01,
        0.02,
        0.02,
    ]
    assert quad.elements[0].axes[0] == pytest.approx(np.array([1, 1, 0]) / np.sqrt(2))
    tri = read(
        GRIDS
        + middles
        + "CTRIA6,1,1,1,2,3,5,6,9\n,90.\nCTRIA3,2,1,1,3,4\nCTRIAR,3,1,1,3,4\n"
        + rest
    )
    assert [(one.kind, len(one.numbers)) for one in tri.elements] == [("tri6", 1), ("tri3", 2)]
    assert tri.elements[0].axes[0] == pytest.approx([0, 1, 0], abs=1e-12)
    bare = read(GRIDS + "CQUAD8,1,1,1,2,3,4,,\n,,,,,,,45.,.1\n" + rest)
    assert bare.elements[0].kind == "quad4"
    assert bare.elements[0].offsets[0, 0] == pytest.approx([0, 0, 0.1])


def test_laminates() -> None:
    fibre = "MAT8,2,1.4+11,9.+9,.3,5.+9,,3.+9,1600.\n"
    base = SQUARE.split("PSHELL")[0] + fibre
    deck = base + "PCOMP,1,-.002,3.,,,,,{}\n,2,.001,45.,YES,,,-45.\n,2,.002,90.\n"
    model = read(deck.format(""))
    section = shell(model, "pcomp_1")
    assert [(ply.thickness, ply.angle_deg) for ply in section.plies] == [
        (0.001, 45),
        (0.001, -45),
        (0.002, 90),
    ]
    assert section.offset == pytest.approx(0.0)
    assert section.extra_mass == 3
    assert model.materials["2"].constants["G13"] == 5e9
    assert not lost(model)["MAT8 without G1Z, G2Z"]
    symmetric = shell(read(deck.format("SYM")), "pcomp_1")
    assert [ply.angle_deg for ply in symmetric.plies] == [45, -45, 90, 90, -45, 45]
    assert symmetric.offset == pytest.approx(0.002)
    assert lost(read(deck.format("MEM")))["PCOMP LAM=MEM"]
    listed = read(base + "PCOMPG,1\n,101,2,.001,45.\n,102,2,.002,90.\n")
    assert [(ply.thickness, ply.angle_deg) for ply in shell(listed, "pcompg_1").plies] == [
        (0.001, 45),
        (0.002, 90),
    ]
    assert shell(listed, "pcompg_1").offset == 0


def test_a_mat2_of_an_orthotropic_plate() -> None:
    E1, E2, nu, G = 40e9, 10e9, 0.25, 4e9
    rest = 1 - nu**2 * E2 / E1
    values = (E1 / rest, nu * E2 / rest, 0, E2 / rest, 0, G)
    card = "MAT2,1," + ",".join(f"{value:.6E}" for value in values) + ",1900.\n"
    constants = read(SQUARE.split("MAT1")[0] + card).materials["1"].constants
    assert [constants[name] for name in ("E1", "E2", "nu12", "G12")] == pytest.approx(
        [E1, E2, nu, G], rel=1e-5
    )
    coupled = card.replace("0.000000E+00", "1.000000E+09", 1)
    assert lost(read(SQUARE.split("MAT1")[0] + coupled))["MAT2 with G13, G23"]


@pytest.mark.parametrize(
    ("card", "constants"),
    [("MAT1,1,7.+10,,.25", (7e10, 0.25, 2.8e10)), ("MAT1,1,7.+10,2.8+10", (7e10, 0.25, 2.8e10)),
     ("MAT1,1,,2.8+10,.25", (7e10, 0.25, 2.8e10)), ("MAT1,1,7.+10,2.+10,.25", (7e10, 0.25, 2e10))],
)  # fmt: skip
def test_an_isotropic_material_by_two_constants(card, constants) -> None:
    stored = read(SQUARE.split("MAT1")[0] + card).materials["1"].constants
    assert tuple(stored[name] for name in ("E", "nu", "G")) == pytest.approx(constants)


def test_nonstructural_mass_of_the_set_that_is_selected() -> None:
    cards = (
        "NSM,1,PSHELL,1,2.\nNSM1,1,PSHELL,3.,ALL\nNSM1,2,PSHELL,5.,1,THRU,4\nNSML,1,PSHELL,1,9.\n"
    )
    deck = "CEND\n{}\nBEGIN BULK\n" + SQUARE + cards + "ENDDATA\n"
    model = read(deck.format("NSM = 1"))
    assert shell(model).extra_mass == 5
    assert lost(model)["NSML"]
    assert shell(read(deck.format("NSM = 2"))).extra_mass == 5
    assert shell(read(deck.format(""))).extra_mass == 0
    both = read(deck.replace("ENDDATA", "NSMADD,9,1\nNSMADD,9,2\nENDDATA").format("NSM = 9"))
    assert shell(both).extra_mass == 10


def test_nonstructural_mass_of_properties_of_one_number() -> None:
    """A bar, a rod and a shell may each have a property 1; a PBARL is a bar's."""
    properties = "PBARL,1,1,,BAR\n,.02,.01\nPROD,1,1,1.-4\nNSM1,1,PSHELL,3.,1\nNSM1,1,PBAR,5.,1\n"
    model = read(SQUARE + "CBAR,7,1,1,3,0.,0.,1.\nCROD,8,1,2,4\n" + properties)
    assert [
        shell(model).extra_mass,
        *(beam(model, name).extra_mass for name in ("pbarl_1", "prod_1")),
    ] == [3, 5, 0]


@pytest.mark.parametrize(
    ("comment", "name"),
    [('$HMNAME PROP                  1"wing skin" 4', "wing_skin"),
     ("$ Elements and Element Properties for region : flange.top", "flange_top"),
     ("$ Femap Property 1 : Haut (extérieure)", "Haut_extérieure"),
     ("$ Femap with NX Nastran Property 1 : web", "web"),
     ("$ANSA_NAME_COMMENT;1;PSHELL;rib 3;;NO;NO", "rib_3"),
     ("$*  NX Property: spar", "spar"),
     ("$* Property: 1 name: rib 3", "rib_3"), ('$ Pset: "shell" will be imported as: "pshell.1"', "shell"),
     ("$ nothing of note: here", "pshell_1")],
)  # fmt: skip
def test_sets_are_named_as_the_pre_processor_does(comment, name) -> None:
    assert read(SQUARE.replace("PSHELL", f"{comment}\nPSHELL")).sets == (name,)


def test_two_properties_of_one_name_stay_two_sets() -> None:
    two = (
        SQUARE
        + "CQUAD4,2,2,1,2,3,4\n$ Femap Property 2 : skin\nPSHELL,2,1,.02,1,,1\n$ Femap Property 1 :"
        " skin\n"
    )
    assert read(two).sets == ("skin", "skin_2")


def test_masses_off_their_grids() -> None:
    system = "CORD2R,5,,0.,0.,0.,0.,0.,1.\n,0.,1.,0.\n"  # x along the model's y
    model = read(
        SQUARE + system + "CONM2,7,3,5,2.,.1,0.,0.\n,5.,1.,6.,0.,0.,7.\nCONM2,8,3,-1,2.,1.5,1.,0.\n"
    )
    first, second = model.masses
    assert first.offset == pytest.approx((0, 0.1, 0))
    assert np.array(first.inertia) == pytest.approx(np.array([[6, 1, 0], [1, 5, 0], [0, 0, 7]]))
    assert second.offset == pytest.approx((0.5, 0, 0))


def test_springs_between_grids_and_to_the_ground() -> None:
    bushes = "CBUSH,21,5,1,3,0.,0.,1.\nPBUSH,5,K,100.,,,200.\nCBUSH,22,6,1,,,,,0\nPBUSH,6,GE,.1\n,,K,,,300.\n"
    model = read(SQUARE + "PELAS,3,50.,,,4,60.\nCELAS1,11,3,1,3,2,3\nCELAS1,12,4,2,1\n" + bushes)
    between, ground, along, turn, lifted = model.springs
    assert (between.node, between.dof, between.stiffness, between.second, between.second_dof) == (
        0,
        2,
        50,
        1,
        2,
    )
    assert (ground.stiffness, ground.second) == (60, None)
    assert (along.dof, along.stiffness, turn.dof, turn.stiffness) == (0, 100, 3, 200)
    assert along.direction == pytest.approx(np.array([1, 1, 0]) / np.sqrt(2))
    assert np.array(along.arms) == pytest.approx(np.array([[0.5, 0.5, 0], [-0.5, -0.5, 0]]))
    assert (lifted.dof, lifted.stiffness, lifted.direction, lifted.arms) == (2, 300, None, None)


def test_a_bush_weighs_half_at_each_end() -> None:
    bush = "PBUSH,5,K,100.\n,,M,4.\nPARAM,WTMASS,.5\nCBUSH,21,5,1,{},0.,0.,1.,0\n"
    model = read(SQUARE + bush.format(3))
    assert [(one.node, one.mass) for one in model.masses] == [(0, 1), (2, 1)]
    assert lost(read(SQUARE + bush.format("")))["PBUSH M to the ground"]


def test_rigid_elements() -> None:
    far = "GRID,11,,0.,0.,1.\nGRID,12,,0.,1.,1.\nGRID,13,,1.,0.,1.\n"
    model = read(
        SQUARE
        + far
        + "RBE2,31,1,123,11,.001\nRBE3,32,,12,123456,1.,123,1,2\n,2.,123,4\nRBAR,33,2,13,123456\n"
    )
    rigid, mean, bar = model.links
    assert (rigid.node, rigid.leaders, rigid.dofs) == (4, (0,), (0, 1, 2))
    assert (mean.node, mean.leaders, mean.weights) == (5, (0, 1, 3), (1, 1, 2))
    assert (bar.node, bar.leaders, bar.dofs) == (6, (1,), (0, 1, 2, 3, 4, 5))


def test_equations_and_rigid_elements_that_say_the_same() -> None:
    far = SQUARE + "GRID,11,,0.,0.,1.,7\nCORD2R,7,,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n"
    body = "MPC,1,11,1,2.,1,1,-2.\n,,1,5,-2.\nMPC,1,11,2,1.,1,2,-1.\n,,1,4,1.\n"
    for cards in (body, "RBE2,31,1,12,11\n", "RBE1,31,1,123456\n,UM,11,12\n"):
        (link,) = read(far + cards).links
        assert (link.node, link.leaders, link.dofs, link.equations) == (4, (0,), (0, 1), None)
    (link,) = read(far + "RBAR,31,1,11,1234,56\n").links
    assert (link.node, link.leaders, len(link.dofs)) == (4, (0,), 6)
    lever, roller = read(far + "MPC,1,11,3,1.,1,2,2.\n,,3,3,.5\nMPC,1,2,2,.5,2,1,-1.\n").links
    assert (lever.leaders, roller.leaders) == ((0, 2), ())
    assert lever.equations is not None
    assert roller.equations is not None
    assert [(*place,) for place in np.argwhere(lever.equations)] == [(0, 2, 1), (1, 2, 2)]
    assert [lever.equations[0, 2, 1], lever.equations[1, 2, 2], roller.equations[0, 1, 0]] == [-2, -0.5, 2]  # fmt: skip
    selected = "CEND\n{}\nBEGIN BULK\n" + far + body + "MPCADD,9,1\nENDDATA"
    assert len(read(selected.format("MPC = 9")).links) == 1
    assert lost(read(selected.format("METHOD = 1"))) == {"MPC of another set": False}
    with pytest.raises(FormatError, match="line 12: begins with a dof that another equation"):
        read(far + "MPC,1,11,3,1.,1,3,-1.\nMPC,1,11,3,1.,2,3,-1.\n")
    with pytest.raises(FormatError, match="holds node 11 in what the equation of line 11 has"):
        read(far + "MPC,1,11,3,1.,1,2,-1.\nSPC1,1,3,11\n")


def test_what_is_lost_is_named_and_stops_where_modes_change() -> None:
    harmless = "CAERO1,1\nSPLINE1,2\nFLFACT,3\nPLOAD4,1,1,5.\nEIGRL,1\nCVISC,5,1,1,2\nPARAM,K6ROT,100.\nSUPORT,1,123456\n"
    assert set(lost(read(SQUARE + harmless)).values()) == {False}
    changing = "RSPLINE,1,2,3\nCGAP,9\nCFAST,8\nMATT1,1\nCSHEAR,7\nASET1,3,1\nPARAM,K6ROT,1.+5\nNEWCARD,1\n"
    assert set(lost(read(SQUARE + changing)).values()) == {True}
    stiffened = "CEND\nSUBCASE 2\nMETHOD = 1\nSTATSUB(PRELOAD) = 1\nBEGIN BULK\n"
    (note,) = [one for one in read(stiffened + SQUARE + "ENDDATA\n").ignored if one.changes]
    assert (note.card, note.lines) == ("STATSUB", (4,))
    assert lost(read(SQUARE.replace(",,.3,", ",,,")))["MAT1 with E or G alone"]
    unselected = read("CEND\nMETHOD=1\nBEGIN BULK\n" + SQUARE + "MPC,1,2,3,1.\nENDDATA")
    assert lost(unselected) == {"MPC of another set": False}
    (note,) = read(SQUARE + "NEWCARD,1\nNEWCARD,2\n").ignored
    assert (note.card, note.lines) == ("NEWCARD", (8, 9))
    integers = read(SQUARE.replace(",.01,", ",1,"))
    assert shell(integers).plies[0].thickness == 1
    assert "integers for reals" in lost(integers)


@pytest.mark.parametrize(
    ("plate", "note", "changes"),
    [("PSHELL,1,1,.01,1", "PSHELL without MID3", False), ("PSHELL,1,1,.01", "PSHELL without MID2", True),
     ("PSHELL,1,1,.01,1,50.,1", "PSHELL 12I/T**3", True), ("PSHELL,1,1,.01,1,,1,2.", "PSHELL MID3, TS/T", True),
     ("PSHELL,1,,.01,1,,1", "PSHELL without MID1", True), ("PSHELL,1,1,.01,-1", "PSHELL with MID2 = -1", True)],
)  # fmt: skip
def test_plates_of_another_kind(plate, note, changes) -> None:
    assert lost(read(SQUARE.replace("PSHELL,1,1,.01,1,,1", plate)))[note] is changes
