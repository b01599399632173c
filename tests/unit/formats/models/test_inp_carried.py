"""Couplings, systems, distributions and ties of decks, and what they refuse or name."""

import numpy as np
import pytest

from modalbase.formats.errors import FormatError
from modalbase.formats.models.model import FiniteElementModel
from tests.unit.formats.models.decks import CAE, PLATE, grid, shell
from tests.unit.formats.models.test_inp import beams, read


def with_cards(cards: str) -> FiniteElementModel:
    return read(PLATE.replace("*STEP", f"{cards}\n*STEP", 1))


def test_data_begin_below_a_card_that_ends_with_a_comma() -> None:
    """As CalculiX takes them; Abaqus has parameters go on there."""
    held = read(
        PLATE.replace(
            "*STEP\n", "*BOUNDARY,\n1, 1, 6\n4, 1\n*STEP,\n** remark\nINC=9\n*BOUNDARY,\n*STATIC\n"
        )
    )
    assert [(one.nodes.tolist(), one.dofs) for one in held.supports] == [
        ([0], (0, 1, 2, 3, 4, 5)),
        ([3], (0,)),
    ]


def test_a_set_of_a_step_is_held() -> None:
    (held,) = read(
        PLATE.replace("*FREQUENCY", "*NSET, NSET=ROOT\n1, 4\n*BOUNDARY\nROOT, 1\n*FREQUENCY")
    ).supports
    assert held.nodes.tolist() == [0, 3]


def test_a_beam_of_its_own_constants_whose_set_has_a_materials_name() -> None:
    card = (
        "*ELEMENT, TYPE=B31, ELSET=GFRP\n9, 1, 2\n*BEAM GENERAL SECTION, ELSET=GFRP,"
        " SECTION=GENERAL, DENSITY=1000.\n"
    )
    beam = card + "1e-4, 1e-9, 0., 1e-9, 2e-9\n0., 0., 1.\n7e10, 2.7e10\n"
    model = read(PLATE.replace("*SHELL SECTION", beam + "*SHELL SECTION"))
    constants = {
        name: model.materials[section.materials[0]].constants
        for name, section in model.sections.items()
    }
    assert (constants["plate"]["E1"], constants["gfrp"]["E"]) == (2.3e10, 7e10)


def losses_of(model: FiniteElementModel) -> dict[str, str]:
    return {each.card: each.loss for each in model.ignored if each.changes}


REFERENCE = "*NODE\n9, 0.1, 0.05, 0.3\n"


def test_kinematic_coupling_of_a_side_along_turned_axes() -> None:
    model = with_cards(
        f"{REFERENCE}*ORIENTATION, NAME=C, SYSTEM=CYLINDRICAL\n0.,0.,0.,0.,0.,1.\n*SURFACE,"
        " NAME=SIDE\nPLATE, E3\n*COUPLING, REF NODE=9, SURFACE=SIDE, CONSTRAINT NAME=K,"
        " ORIENTATION=C\n*KINEMATIC\n1\n3, 4"
    )
    assert [(link.node, link.leaders, link.dofs) for link in model.links] == [
        (3, (6,), (0, 2, 3)),
        (4, (6,), (0, 2, 3)),
        (5, (6,), (0, 2, 3)),
    ]
    assert model.links[1].axes is not None
    np.testing.assert_allclose(model.links[1].axes[0], np.array([1, 1, 0]) / 2**0.5, rtol=1e-15)


def test_distributing_coupling_within_a_radius() -> None:
    cards = (
        f"{REFERENCE}*SURFACE, NAME=ALL, TYPE=NODE\nNALL, 1.\n*COUPLING, REF NODE=9, SURFACE=ALL,"
        " CONSTRAINT NAME=K"
    )
    model = with_cards(f"{cards}, INFLUENCE RADIUS=0.31\n*DISTRIBUTING\n1, 3")
    assert [(link.node, link.leaders, link.dofs) for link in model.links] == [
        (6, (1, 4), (0, 1, 2))
    ]
    model = with_cards(f"{cards}\n*DISTRIBUTING, WEIGHTING METHOD=LINEAR")
    assert losses_of(model)["*DISTRIBUTING"].startswith("weights that fall")
    with pytest.raises(FormatError, match=r"\*COUPLING couples no node"):
        with_cards(f"{cards}, INFLUENCE RADIUS=0.01\n*DISTRIBUTING")


def test_distributing_coupling_by_an_element() -> None:
    model = with_cards(
        f"{REFERENCE}*ELEMENT, TYPE=DCOUP3D, ELSET=D\n99, 9\n*DISTRIBUTING COUPLING, ELSET=D\n1,"
        " 2.\n2\n6, 0.5"
    )
    (link,) = model.links
    assert (link.node, link.leaders, link.weights) == (6, (0, 1, 5), (2.0, 1.0, 0.5))


def test_rigid_elements_and_pins() -> None:
    model = with_cards(
        "*NODE\n8, 0., 0., 0.\n9, 0.1, 0., 0.\n*ELEMENT, TYPE=RB3D2, ELSET=R\n50, 1, 4\n*RIGID BODY, ELSET=R, REF NODE=1\n"
        "*RIGID BODY, PIN NSET=ONE, REF NODE=2\n*NSET, NSET=ONE\n9\n*MPC\nPIN, 8, 1\nLINK, 3, 6\nPIN, 6, 3"

    )  # fmt: skip
    assert [(link.node, link.leaders, link.dofs) for link in model.links] == [
        (3, (0,), (0, 1, 2, 3, 4, 5)),
        (7, (1,), (0, 1, 2)),
        (6, (0,), (0, 1, 2)),
    ]
    assert [(each.lines, each.loss) for each in model.ignored if each.changes] == [
        ((31,), "a constraint of type LINK between nodes"),
        ((32,), "PIN between nodes that are apart"),
    ]


def test_tie_of_nodes_that_lie_on_no_node() -> None:
    moved = "*Instance, name=Rib-1, part=Rib\n 0.05, 0.1,"
    text = CAE.replace("*Instance, name=Rib-1, part=Rib\n          0.,          0.1,", moved)
    assert text != CAE
    with pytest.raises(FormatError, match=r"line 105: \*TIE: a tie of 3 node.*falls into 2 parts"):
        read(text)
    (loss,) = [
        each
        for each in read(text.replace("Rib-2.Edge, ENC", "Foot, 1, 6\nRib-2.Edge, ENC")).ignored
        if each.changes
    ]
    assert (loss.card, loss.loss) == (
        "*TIE",
        "a tie of 3 node(s) that lie on no node of the other surface",
    )


def test_systems_of_nodes() -> None:
    lines = grid(2, 1).splitlines()
    turned = "\n".join(
        f"{n}, {float(y):g}, {-float(x):g}, {z}"
        for n, x, y, z in (line.split(",") for line in lines)
    )
    nodes = "*NODE, NSET=NALL\n" + grid(2, 1)
    model = read(
        PLATE.replace(nodes, f"*SYSTEM\n1., 0., 0., 1., 1., 0.\n*NODE, NSET=NALL\n{turned}")
    )
    np.testing.assert_allclose(model.nodes, read(PLATE).nodes + np.eye(3)[0], atol=1e-15)
    polar = "\n".join(
        f"{line.split(',')[0]}, {float(np.hypot(x, y))!r},"
        f" {float(np.degrees(np.arctan2(y, x)))!r}, 0."
        for line, (x, y, _) in zip(lines, read(PLATE).nodes.tolist(), strict=True)
    )
    model = read(PLATE.replace(nodes, f"*NODE, SYSTEM=C\n{polar}"))
    np.testing.assert_allclose(model.nodes, read(PLATE).nodes, atol=1e-15)


def test_orientations_by_element_as_composite_layups_have_them() -> None:
    cards = (
        "*DISTRIBUTION TABLE, NAME=T\nCOORD3D, COORD3D\n*DISTRIBUTION, NAME=D, LOCATION=ELEMENT,"
        " TABLE=T\n, 0., 1., 0., -1., 0., 0.\n2, 1., 1., 0., -1., 1., 0.\n*ORIENTATION, NAME=O,"
        " SYSTEM=RECTANGULAR\nD\n3, 0.\n"
    )
    text = PLATE.replace(
        "*SHELL SECTION, ELSET=PLATE,", f"{cards}*SHELL SECTION, ORIENTATION=O, ELSET=PLATE,"
    )
    np.testing.assert_allclose(
        read(text).elements[0].axes, [[0, 1, 0], [2**-0.5, 2**-0.5, 0]], atol=1e-15
    )


def test_springs_and_inertia_along_axes() -> None:
    orientation = "*ORIENTATION, NAME=O\n0.,1.,0.,-1.,0.,0.\n"
    model = with_cards(
        f"{orientation}*ELEMENT, TYPE=SPRING1, ELSET=S\n20, 1\n*SPRING, ELSET=S,"
        " ORIENTATION=O\n4\n7.\n*ELEMENT, TYPE=ROTARYI, ELSET=R\n21, 1\n*ROTARY INERTIA, ELSET=R,"
        " ORIENTATION=O\n1., 2., 3."
    )
    (spring,) = model.springs
    assert (spring.dof, spring.second, spring.direction) == (3, None, (0.0, 1.0, 0.0))
    np.testing.assert_allclose(model.masses[0].inertia, np.diag([2.0, 1.0, 3.0]), atol=1e-15)


def test_a_plate_of_one_material_that_bears_spread_mass_in_part() -> None:
    spread = "*NONSTRUCTURAL MASS, ELSET={}, UNITS=MASS PER AREA\n1.5"
    assert shell(with_cards(spread.format("PLATE")), "plate").extra_mass == 1.5
    model = with_cards("*ELSET, ELSET=ONE\n1\n" + spread.format("ONE"))
    assert losses_of(model) == {
        "*NONSTRUCTURAL MASS": (
            "spread mass on part of a set, on shells and beams at once, or in other units"
        )
    }


NAMED = {
    "hot constants": ("*MATERIAL, NAME=B\n*ELASTIC\n1e9, .3, 20.\n9e8, .3, 80.", "*ELASTIC", "constants at other temperatures"),
    "springs that are not linear": (
        "*ELEMENT, TYPE=SPRING1, ELSET=S\n20, 1\n*SPRING, ELSET=S, NONLINEAR\n3\n0., 0.\n1., 1.", "*SPRING", "a spring that"),
    "stresses": ("*INITIAL CONDITIONS, TYPE=STRESS\nPLATE, 1e6", "*INITIAL CONDITIONS", "stresses, which stiffen"),
    "connectors": ("*ELEMENT, TYPE=CONN3D2, ELSET=C\n20, 1, 2", "*ELEMENT", "connectors between nodes"),
    "motion of another model": ("*BOUNDARY, SUBMODEL\nNALL, 1, 3", "*BOUNDARY", "motion that another model prescribes"),
    "a node that turns": (f"{REFERENCE}*NODE\n10, 0., 0., 1.\n*RIGID BODY, NSET=NALL, REF NODE=9, ROT NODE=10", "*RIGID BODY",
        "the ROT NODE: supports and masses"),
}  # fmt: skip


@pytest.mark.parametrize("name", NAMED)
def test_what_changes_modes_is_named(name: str) -> None:
    cards, card, loss = NAMED[name]
    assert losses_of(with_cards(cards))[card].startswith(loss)


def test_round_sections_state_a_radius_or_a_diameter() -> None:
    model = beams("*BEAM SECTION, ELSET=RIBS, MATERIAL=GFRP, SECTION=CIRC\n0.01")
    assert losses_of(model)["*BEAM SECTION"].startswith("whether CIRC states a radius")


BAD_BEAMS = {
    "too thick walls": ("MATERIAL=GFRP, SECTION=PIPE\n0.01, 0.02",
        r"\*BEAM SECTION expected radius, wall: 2 lengths above 0"),
    "a flat rectangle": ("MATERIAL=GFRP, SECTION=RECT\n0.01, 0.", r"expected a, b: 2 lengths above 0"),
    "too few sizes": ("MATERIAL=GFRP, SECTION=I\n0.01, 0.02", r"expected l, h, b1, b2, t1, t2, t3: 7 lengths"),
    "an unknown profile": ("MATERIAL=GFRP, SECTION=HEX\n0.01", r"SECTION=HEX is unknown, expected CIRC, RECT"),
    "a section by numbers": ("MATERIAL=GFRP, SECTION=GENERAL\n1., 1., 0., 1., 1.",
        r"\*BEAM GENERAL SECTION states a beam"),
    "a direction along the beam": ("MATERIAL=GFRP, SECTION=RECT\n.1, .1\n1., 0., 0.",
        r"along which its direction n1 lies"),
    "no direction": ("MATERIAL=GFRP, SECTION=RECT\n.1, .1\n0., 0., 0.", r"the direction n1 is zero"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD_BEAMS)
def test_bad_beams(name: str) -> None:
    section, message = BAD_BEAMS[name]
    with pytest.raises(FormatError, match=rf"^line \d+: .*{message}"):
        beams(f"*BEAM SECTION, ELSET=RIBS, {section}")


def test_bad_general_sections() -> None:
    card = "*BEAM GENERAL SECTION, ELSET=RIBS, SECTION=GENERAL{}\n1., 1., {}, 1., 1.\n0., 1., 0.{}"
    for density, mixed, rest, message in [
        (", DENSITY=1.", "2.", "\n1., 1.", "expected A, I11, I12, I22 and J of a real section"),
        (", DENSITY=-1.", "0.", "\n1., 1.", "no density below 0"),
        (", DENSITY=x", "0.", "\n1., 1.", "has DENSITY=x, expected a number"),
        (", DENSITY=1.", "0.", "", "has no line of E and G, the third"),
        (", DENSITY=1.", "0.", "\n1., -1.", "expected E and G above 0"),
    ]:
        with pytest.raises(FormatError, match=message):
            beams(card.format(density, mixed, rest))
    without = beams(card.format("", "0.", "\n1., 1."))  # of a stick whose masses stand apart
    assert without.materials["ribs"].constants["density"] == 0
