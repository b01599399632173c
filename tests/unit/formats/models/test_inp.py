"""Decks of Abaqus and CalculiX become the neutral model."""

import numpy as np
import pytest

from modalbase.formats.models.inp import read_inp
from modalbase.formats.models.model import FiniteElementModel
from tests.unit.formats.models.decks import CAE, MATERIAL, PLATE, beam, grid, shell


def read(text: str, **included: str) -> FiniteElementModel:
    return read_inp(
        text.encode(), {name.replace("_", "."): each.encode() for name, each in included.items()}
    )


def test_assembly_of_abaqus_cae() -> None:
    model = read(CAE)
    assert model.sets == ("set-1", "rib.set-1")
    skin, wall = shell(model, "set-1"), shell(model, "rib.set-1")
    assert [(ply.material, ply.thickness, ply.angle_deg) for ply in skin.plies] == [
        ("Carbon epoxy", 0.001, 45.0),
        ("Carbon epoxy", 0.001, -45.0),
    ]
    assert wall.offset == pytest.approx(-0.001, rel=1e-15)
    block = next(each for each in model.elements if each.set == "rib.set-1")
    assert len(block.numbers) == 4
    c, s = np.cos(np.radians(30)), np.sin(np.radians(30))
    # turned with its instance
    np.testing.assert_allclose(block.axes[:2], [[c, 0, s]] * 2, atol=1e-15)
    np.testing.assert_allclose(block.axes[2:], [[c, s, 0]] * 2, atol=1e-15)
    place = dict(zip(model.numbers.tolist(), model.nodes.tolist(), strict=True))
    assert len(place) == len(model.numbers) == 9 + 6 + 6 + 1
    # node 4 of Rib-1, turned up
    np.testing.assert_allclose(place[1_000_004], [0, 0.1, 0.1], atol=1e-15)
    np.testing.assert_allclose(place[2_000_004], [0, 0.3, 0], atol=1e-15)
    assert [mass.mass for mass in model.masses] == [0.25]
    assert model.masses[0].node == 21
    assert [(s.node, s.dof, s.stiffness) for s in model.springs] == [(17, 2, 1.5e4)]


def test_constraints_of_abaqus_cae() -> None:
    model = read(CAE)
    coupling = next(link for link in model.links if link.node == 21)
    assert (coupling.leaders, coupling.dofs) == ((0, 1, 2, 3, 4, 5), (0, 1, 2, 3, 4, 5))
    dependent = {link.node: link.leaders for link in model.links if link.node != 21}
    assert dependent == {9: (3,), 10: (4,), 11: (5,), 15: (6,), 16: (7,)}
    held = [(support.nodes.tolist(), support.dofs) for support in model.supports]
    # 15 is led by 6, at its place
    assert held == [([0, 3, 6], (0, 1, 2)), ([6, 18], (0, 1, 2, 3, 4, 5))]
    assert {each.loss for each in model.ignored} == {"requests for output"}


def test_include_continuation_and_fortran_numbers() -> None:
    text = PLATE.replace(grid(2, 1), grid(2, 1).replace("0.1,", "1.D-1,")).replace(
        MATERIAL, "*INCLUDE, INPUT=data/M.INP\n"
    )
    text = text.replace(
        "*SHELL SECTION, ELSET=PLATE, MATERIAL=GFRP",
        "*Shell Section,\n elset=Plate,\n MATERIAL = gfrp",
    )
    text = text.replace("1, 1, 2, 5, 4", "1, 1, 2,\n5, 4")
    model = read(text.replace("\n", "\r\n"), m_inp=MATERIAL)
    np.testing.assert_array_equal(model.nodes, read(PLATE).nodes)
    np.testing.assert_array_equal(model.elements[0].nodes, read(PLATE).elements[0].nodes)
    assert (model.title, model.sets, model.elements[0].lines.tolist()) == (
        "A plate",
        ("plate",),
        [11, 13],
    )
    place = model.materials["GFRP"].places["G12"]
    assert (place.file, place.line) == ("m.inp", 3)
    assert MATERIAL.splitlines()[2][place.start : place.end] == " 3.0e9"


def test_data_lines_of_an_included_file_belong_to_the_card_before() -> None:
    text = PLATE.replace("*STEP", "*BOUNDARY\n1, 1, 6\n*INCLUDE, INPUT=more.inp\n3, 2\n*STEP", 1)
    model = read(text, more_inp="4, 3\n*NSET, NSET=A\n")
    assert [(s.nodes.tolist(), s.dofs) for s in model.supports] == [
        ([0], (0, 1, 2, 3, 4, 5)),
        ([3], (2,)),
    ]
    assert "a" in model.node_sets


def test_nested_and_generated_sets() -> None:
    text = PLATE.replace(
        "*SHELL SECTION, ELSET=PLATE",
        "*NSET, NSET=ENDS\nLEFT, RIGHT\n*NSET, NSET=LEFT, GENERATE\n1, 900000000, 3\n*NSET,"
        " NSET=RIGHT\n3, 6\n*NSET, NSET=LEFT\n2\n*ELSET, ELSET=A\n1\n*ELSET, ELSET=ALL\nA,"
        " 2\n*NSET, NSET=OF, ELSET=A\n*SHELL SECTION, ELSET=ALL",
    )
    model = read(text)
    assert model.node_sets["ends"].tolist() == [0, 1, 2, 3, 5]
    assert model.node_sets["of"].tolist() == [0, 1, 3, 4]
    assert model.sets == ("all",)


@pytest.mark.parametrize(
    ("orientation", "expected"),
    [
        # CalculiX projects axis 1
        ("SYSTEM=RECTANGULAR\n0.,1.,0.,-1.,0.,0.", [[0, 1, 0], [0, 1, 0]]),
        ("SYSTEM=RECTANGULAR\n1.,0.,0.,0.,1.,0.\n3, 90.", [[0, 1, 0], [0, 1, 0]]),
        # axis 1 is the normal, 2 projected
        ("SYSTEM=RECTANGULAR\n0.,0.,1.,1.,0.,0.\n1, 90.", [[0, 1, 0], [0, 1, 0]]),
        ("SYSTEM=Z RECTANGULAR\n0.,0.,1.,0.,1.,0.\n3, 0.", [[0, 1, 0], [0, 1, 0]]),
        # with an origin of its own
        ("SYSTEM=RECTANGULAR\n3.,1.,0.,2.,2.,0.,2.,1.,0.", [[1, 0, 0], [1, 0, 0]]),
        ("SYSTEM=CYLINDRICAL\n0.,0.,0.,0.,0.,1.", [[2**-0.5, 2**-0.5, 0], [3 / 10**0.5, 1 / 10**0.5, 0]]),
    ],
)  # fmt: skip
def test_orientations(orientation: str, expected: list[list[float]]) -> None:
    text = PLATE.replace(
        "*SHELL SECTION, ELSET=PLATE,",
        f"*ORIENTATION, NAME=O, {orientation}\n*SHELL SECTION, ORIENTATION=O, ELSET=PLATE,",
    )
    np.testing.assert_allclose(read(text).elements[0].axes, expected, atol=1e-12)


def test_axis_along_the_normal_without_an_orientation() -> None:
    turned = "\n".join(
        f"{n}, {z.strip()}, {x.strip()}, {y.strip()}"
        for n, x, y, z in (line.split(",") for line in grid(2, 1).splitlines())
    )
    model = read(PLATE.replace(grid(2, 1), turned))
    np.testing.assert_array_equal(model.elements[0].axes, [[0, 0, 1]] * 2)


def test_plies_whose_orientations_have_names() -> None:
    section = (
        "*ORIENTATION, NAME=O0\n1.,0.,0.,0.,1.,0.\n*ORIENTATION,"
        " NAME=O60\n1.,0.,0.,0.,1.,0.\n3,60.\n*SHELL SECTION, ELSET=PLATE, COMPOSITE,"
        " OFFSET=-0.5\n.001,,GFRP,O0\n.002,,GFRP,O60\n"
    )
    model = read(PLATE.replace("*SHELL SECTION, ELSET=PLATE, MATERIAL=GFRP\n0.005\n", section))
    plies = shell(model, "plate").plies
    assert [(ply.thickness, ply.angle_deg) for ply in plies] == [
        (0.001, 0.0),
        (0.002, pytest.approx(60, rel=1e-9)),
    ]
    assert shell(model, "plate").offset == pytest.approx(0.0015, rel=1e-12)


def test_thickness_at_nodes() -> None:
    model = read(PLATE.replace("*STEP", "*NODAL THICKNESS\n1, 0.006\n4, 0.006\n*STEP", 1))
    np.testing.assert_array_equal(
        model.elements[0].thickness, [[0.006, 0.005, 0.005, 0.006], [0.005, 0.005, 0.005, 0.005]]
    )
    by_nodes = PLATE.replace("MATERIAL=GFRP\n0.005\n", "MATERIAL=GFRP, NODAL THICKNESS\n0.\n")
    model = read(by_nodes.replace("*STEP", "*NODAL THICKNESS\nNALL, 0.006\n*STEP", 1))
    assert np.unique(model.elements[0].thickness).tolist() == [0.006]
    assert shell(model, "plate").plies[0].thickness > 0


def beams(section: str, kind: str = "B31", element: str = "1, 1, 2") -> FiniteElementModel:
    nodes = "1, 0., 0.\n2, 2., 0.\n3, 1., 0.\n4, 0., 1., 1."
    return read(
        f"*NODE\n{nodes}\n*ELEMENT, TYPE={kind}, ELSET=Ribs\n{element}\n{MATERIAL}{section}\n"
    )


@pytest.mark.parametrize(
    ("kind", "sizes", "area", "inertia", "torsion"),
    [
        ("RECT", "0.02, 0.03", 6e-4, (4.5e-8, 2e-8, 0), 4.697e-8),  # Roark's β = 0.196 of 3 by 2
        ("CIRC", "0.02, 0.02", np.pi * 1e-4, (np.pi / 4 * 1e-8, np.pi / 4 * 1e-8, 0), np.pi / 2 * 1e-8),
        ("PIPE", "0.02, 0.01", np.pi * 3e-4, (np.pi / 4 * 15e-8, np.pi / 4 * 15e-8, 0), np.pi / 2 * 15e-8),
        ("BOX", "0.04, 0.02, .002, .002, .002, .002", 2.24e-4, (4 * 8e-8 / 12 - 36 * 16**3 * 1e-12 / 12,
            2 * 64e-8 / 12 - 16 * 36**3 * 1e-12 / 12, 0), 4 * (0.038 * 0.018) ** 2 / (0.112 / 0.002) + 0.112 * 0.002**3 / 3),
        ("I", "0.05, 0.1, 0.06, 0.06, 0.005, 0.005, 0.005", 1.05e-3, (0.06 * 0.1**3 / 12 - 0.055 * 0.09**3 / 12,
            0.01 * 0.06**3 / 12 + 0.09 * 0.005**3 / 12, 0), (0.12 + 0.095) * 0.005**3 / 3),
    ],
)  # fmt: skip
def test_profiles(
    kind: str, sizes: str, area: float, inertia: tuple[float, float, float], torsion: float
) -> None:
    model = beams(f"*BEAM SECTION, ELSET=RIBS, MATERIAL=GFRP, SECTION={kind}\n{sizes}\n0., 1., 0.")
    section = beam(model, "ribs")
    assert section.area == pytest.approx(area, rel=1e-12)
    np.testing.assert_allclose(section.inertia, inertia, rtol=1e-12, atol=1e-20)
    assert section.torsion == pytest.approx(torsion, rel=2e-3)
    np.testing.assert_array_equal(model.elements[0].axes, [[0, 1, 0]])
    assert model.elements[0].offsets is None


def test_centroid_away_from_the_nodes() -> None:
    model = beams(
        "*BEAM SECTION, ELSET=RIBS, MATERIAL=GFRP, SECTION=T\n0.06, 0.05, 0.05, 0.01, 0.01\n0.,"
        " 1., 0."
    )
    centroid = -(0.005 * 6e-4 + 0.03 * 4e-4) / 1e-3
    np.testing.assert_allclose(model.elements[0].offsets, [[[0, 0, centroid]] * 2], rtol=1e-12)
    model = beams(
        "*BEAM SECTION, ELSET=RIBS, MATERIAL=GFRP, SECTION=RECT, OFFSET1=0.5\n0.02, 0.03\n0.,"
        " 1., 0."
    )
    np.testing.assert_allclose(model.elements[0].offsets, [[[0, -0.01, 0]] * 2], rtol=1e-12)


def test_directions_and_order_of_beams() -> None:
    section = "*BEAM SECTION, ELSET=RIBS, MATERIAL=GFRP, SECTION=RECT\n0.02, 0.03"
    model = beams(section, "B32", "1, 1, 3, 2")
    np.testing.assert_array_equal(model.elements[0].nodes, [[0, 1, 2]])
    np.testing.assert_array_equal(model.elements[0].axes, [[0, 0, -1]])
    model = beams(section, "B31", "1, 1, 2, 4")
    np.testing.assert_allclose(model.elements[0].axes, [[0, 2**-0.5, 2**-0.5]], rtol=1e-15)
    assert beam(beams(section, "B33"), "ribs").shear is None


def test_beam_by_its_constants() -> None:
    model = beams(
        "*BEAM GENERAL SECTION, ELSET=RIBS, SECTION=GENERAL, DENSITY=1900.\n1e-3, 2e-7, 1e-8, 3e-7,"
        " 5e-8\n\n7e10, 2.6e10"
    )
    section = beam(model, "ribs")
    assert (section.area, section.inertia, section.torsion) == (1e-3, (2e-7, 3e-7, 1e-8), 5e-8)
    assert set(section.places) == {"area", "I1", "I2", "J"}
    material = model.materials[section.material]
    assert (material.constants["E"], material.constants["G"], material.constants["density"]) == (
        7e10,
        2.6e10,
        1900,
    )


CARRIED = """\
*ELEMENT, TYPE=ROTARYI, ELSET=TURN
11, 2
*ROTARY INERTIA, ELSET=TURN
1e-3, 2e-3, 3e-3, 1e-4
*ELEMENT, TYPE=SPRINGA, ELSET=AXIAL
12, 1, 6
*SPRING, ELSET=AXIAL

3e5
*ELEMENT, TYPE=SPRING2, ELSET=PAIR
13, 1, 2
*SPRING, ELSET=PAIR
3, 3
2e5
*NONSTRUCTURAL MASS, ELSET=PLATE, UNITS=TOTAL MASS
0.04,
*TRANSFORM, NSET=NALL, TYPE=C
0., 0., 0., 0., 0., 1.
*BOUNDARY
2, 1
5, 1, 3
*EQUATION
2
1, 4, 1., 1, 4, -1.
"""


def test_what_a_structure_carries() -> None:
    model = read(PLATE.replace("*STEP", CARRIED + "*STEP", 1))
    assert model.masses[0].inertia == ((1e-3, 1e-4, 0.0), (1e-4, 2e-3, 0.0), (0.0, 0.0, 3e-3))
    axial, pair = model.springs
    np.testing.assert_allclose(axial.direction or (), np.array([2, 1, 0]) / 5**0.5, rtol=1e-15)
    assert (axial.node, axial.second, axial.stiffness) == (0, 5, 3e5)
    assert (pair.node, pair.second, pair.dof, pair.direction) == (0, 1, 0, (0.0, 0.0, 1.0))
    assert shell(model, "plate").extra_mass == pytest.approx(0.04 / 0.02, rel=1e-12)
    turned, plain = sorted(model.supports, key=lambda each: each.axes is None)
    np.testing.assert_allclose(turned.axes, np.eye(3), atol=1e-15)
    assert (plain.nodes.tolist(), plain.dofs) == ([4], (0, 1, 2))
    np.testing.assert_allclose(model.node_axes[4][0], np.array([1, 1, 0]) / 2**0.5, rtol=1e-15)


def test_rigid_bodies_and_equal_dofs() -> None:
    more = (
        "*NODE\n7, 0., 0., 0.\n8, 0.1, 0.05, 0.2\n*NSET, NSET=LEFT\n1, 4\n*RIGID BODY, NSET=LEFT,"
        " REF NODE=8\n*EQUATION\n2\n7, 1, 1., 1, 1, -1.\n2\n7, 2, 1.,\n1, 2, -1.\n*KINEMATIC"
        " COUPLING, REF NODE=8\n3, 1, 3\n*EQUATION\n2\n2, 1, 1., 3, 1, -1.\n"
    )
    model = read(PLATE.replace("*STEP", more + "*STEP", 1))
    links = [(link.node, link.leaders, link.dofs) for link in model.links]
    assert links == [
        (0, (7,), (0, 1, 2, 3, 4, 5)),
        (3, (7,), (0, 1, 2, 3, 4, 5)),
        (2, (7,), (0, 1, 2)),
        (6, (0,), (0, 1)),
        (1, (2,), (0,)),
    ]
    assert all(link.equations is None for link in model.links)
    assert not model.ignored
    centred = more.replace("REF NODE=8\n*E", "REF NODE=8, POSITION=CENTER OF MASS\n*E")
    normal = centred.replace("0.05, 0.2\n", "0.05, 0.2, 0., 1., 0.\n")
    noted = read(PLATE.replace("*STEP", normal + "*STEP", 1)).ignored
    assert {(one.kind, one.changes) for one in noted} == {
        ("moved_reference", True),
        ("node_normals", True),
    }
    sets = "*EQUATION\n2\nLEFT, 1, 1., LEFT, 2, -1.\n*EQUATION\n1\nLEFT, 3, 1.\n"
    model = read(PLATE.replace("*STEP", f"*NSET, NSET=LEFT\n1, 4\n{sets}*STEP", 1))
    assert [(s.nodes.tolist(), s.dofs) for s in model.supports] == [([0], (2,)), ([3], (2,))]
    (ignored,) = model.ignored
    assert ignored.changes
    assert (ignored.card, ignored.loss[:30]) == ("*EQUATION", "an equation between sets of se")


def test_steps_before_that_of_the_modes() -> None:
    steps = (
        "*BOUNDARY\n1, 1, 6\n*STEP, NLGEOM\n*STATIC\n*BOUNDARY\n3, 3\n*CLOAD\n6, 3, 1.\n*END"
        " STEP\n*STEP, PERTURBATION\n*FREQUENCY\n5\n*BOUNDARY{}\n4, ENCASTRE\n*END"
        " STEP\n*STEP\n*STATIC\n*BOUNDARY\n5, 1\n*END STEP\n"
    )
    start = PLATE.partition("*STEP")[0]
    model = read(start + steps.format(""))
    assert [support.nodes.tolist() for support in model.supports] == [[0], [2], [3]]
    assert [each.loss for each in model.ignored if each.changes] == [
        "a state of stress before the modes, which stiffens or softens"
    ]
    assert [s.nodes.tolist() for s in read(start + steps.format(", OP=NEW")).supports] == [[3]]
    linear = steps.format("").replace(", NLGEOM", ", NLGEOM=NO")
    assert not [each for each in read(start + linear).ignored if each.changes]


def test_unknown_cards_are_named_and_stop() -> None:
    text = PLATE.replace(
        "*STEP",
        "*FLUX CAPACITOR, ELSET=PLATE\n1.21\n*PLASTIC\n1e8\n*Flux Capacitor\n*CONTACT PAIR\n*STEP",
        1,
    )
    skipped = {each.card: each for each in read(text).ignored}
    assert skipped["*FLUX CAPACITOR"].lines == (20, 24)
    assert skipped["*FLUX CAPACITOR"].changes
    assert skipped["*CONTACT PAIR"].changes
    assert not skipped["*PLASTIC"].changes
