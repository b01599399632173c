"""Users' models without a server: kept as arrays and made again, made bodies, handed back as
decks.
"""

from dataclasses import replace

import numpy as np
import pytest

from fecore.arrays import FloatArray
from fecore.body.constants import Parameter
from fecore.body.structure import Structure
from fecore.dynamics.eigen import normal_modes
from fecore.errors import InputError, ModelError
from fecore.updating.parameters import parametrise
from modalbase.formats.models.bdf import read_bdf
from modalbase.formats.models.inp import read_inp
from modalbase.formats.models.model import Spring, Support, Where
from service.compute.models.bodies import body_of_model
from service.compute.models.decks import DeckOrder, updated_deck
from service.compute.models.keeping import kept, model_of
from service.nouns.structures.schemas import StructureIn
from service.nouns.updates.bodies import nominal_body
from service.tasks.model.compute import describe
from tests.support.profiles import ANGLE, deck
from tests.support.stored_solids import frequencies
from tests.unit.formats.models.decks import SQUARE

STEEL = b"""*HEADING
plate of steel with a stiffener
*NODE
1, 0., 0., 0.
2, 1., 0., 0.
3, 1., 0.2, 0.
4, 0., 0.2, 0.
5, 2., 0., 0.
6, 2., 0.2, 0.
*ELEMENT, TYPE=S4, ELSET=PLATE
1, 1, 2, 3, 4
2, 2, 5, 6, 3
*ELEMENT, TYPE=B31, ELSET=BAR
3, 1, 2
4, 2, 5
*MATERIAL, NAME=STEEL
*ELASTIC
2.1E11, 0.3
*DENSITY
7850.
*SHELL SECTION, ELSET=PLATE, MATERIAL=STEEL
0.01
*BEAM SECTION, ELSET=BAR, MATERIAL=STEEL, SECTION=RECT
0.02, 0.04
0., 0., 1.
*STEP
*FREQUENCY
6
*END STEP
"""


@pytest.mark.parametrize("content", [deck(), STEEL], ids=["angle", "steel"])
def test_a_model_is_kept_whole(content: bytes) -> None:
    model = read_inp(content)
    data = kept(model)
    again = model_of(data)
    assert kept(again) == data
    assert (again.sections, again.materials, again.links) == (
        model.sections,
        model.materials,
        model.links,
    )
    for one, other in zip(again.elements, model.elements, strict=True):
        np.testing.assert_array_equal(one.nodes, other.nodes)
        np.testing.assert_array_equal(one.axes, other.axes)


def test_the_deck_of_a_shape_is_the_body_of_the_shape() -> None:
    shaped = nominal_body(StructureIn.model_validate(ANGLE), "free")
    np.testing.assert_allclose(
        frequencies(body_of_model(read_inp(deck())), 8), frequencies(shaped, 8), rtol=1e-6
    )


def test_length_width_and_height_are_constants_where_all_walls_lie_along_x() -> None:
    model = read_inp(deck())
    size = body_of_model(model).size
    np.testing.assert_allclose(size, np.ptp(model.nodes, axis=0), rtol=1e-12)
    assert set(body_of_model(model).nominal) >= {"length", "width", "height"}
    # axis 1 of the material stays along x
    along_y = replace(model, nodes=model.nodes[:, [1, 2, 0]])
    assert body_of_model(along_y).size == ()
    # about x
    turned = replace(model, nodes=model.nodes @ [[1, 0, 0], [0, 0.8, 0.6], [0, -0.6, 0.8]])
    assert body_of_model(turned).size == ()
    stretched = replace(body_of_model(turned), size=size)
    with pytest.raises(InputError, match="of a body whose set flange does not lie along x and y"):
        stretched.stiffness_coefficients(np.array(list(stretched.nominal.values())))
    assert body_of_model(read_inp(STEEL)).size == (), "it has a beam"


def test_sets_of_an_isotropic_material_have_one_free_modulus() -> None:
    body = body_of_model(read_inp(STEEL))
    free = [each.name for each in body.default_parameters() if each.tied_to is None]
    assert free == ["plate.E1", "bar.E"]
    named = Parameter("plate.E1"), Parameter("bar.E", prior_mean=1.8e11, fixed=True)
    prior = parametrise(body, named)
    assert prior.reported == ("plate.E1",)
    now = dict(zip(body.nominal, prior.constants(1.1 * prior.prior_mean), strict=True))
    for name, share in {
        "plate.E2": 1.1, "plate.G12": 1.1, "plate.G23": 1.1, "bar.G": 1.8 / 2.1, "plate.nu12": 1.0
    }.items():  # fmt: skip
        assert now[name] == pytest.approx(share * body.nominal[name], rel=1e-12)
    own = parametrise(body, (*named, Parameter("plate.G12")))
    assert own.reported == ("plate.E1", "plate.G12")


def test_a_thickness_that_all_elements_override_says_nothing() -> None:
    """As of a deck whose nodes state theirs: neither mass, drilling nor the description knows it."""
    (plate, *_), (*_, rest) = STEEL.split(b"*ELEMENT, TYPE=B31"), STEEL.split(b"*MATERIAL, NAME")
    thick = plate + b"*MATERIAL, NAME" + rest.split(b"*BEAM SECTION")[0]
    nodes = b"*NODAL THICKNESS\n" + b"".join(b"%d, 0.01\n" % node for node in range(1, 7))
    stated = thick.replace(b"STEEL\n0.01", b"STEEL, NODAL THICKNESS\n0.4") + nodes
    models = read_inp(thick), read_inp(stated)
    plain, own = (body_of_model(model) for model in models)
    assert frequencies(own, 6) == pytest.approx(frequencies(plain, 6), rel=1e-9)  # round-off
    (skin,), (described,) = (
        describe(model, body)["sets"] for model, body in zip(models, (plain, own), strict=True)
    )
    assert described["mass_kg"] == pytest.approx(skin["mass_kg"], rel=1e-12)
    assert described["thickness_m"] == pytest.approx(0.01, rel=1e-12)


def test_a_spring_acts_along_its_direction_at_the_end_of_its_arm() -> None:
    model = read_inp(STEEL)
    spring = Spring(
        0, 0, 5.0, Where(1), direction=(0.0, 0.6, 0.8), arms=((0.1, 0.0, 0.0), (0.0, 0.0, 0.0))
    )
    (attached,) = body_of_model(replace(model, springs=(spring,)), "as_modelled").springs
    np.testing.assert_allclose(attached.rows[0, 0], [0, 0.6, 0.8, 0, -0.08, 0.06])
    # to the ground, which a free body has not
    assert body_of_model(replace(model, springs=(spring,))).springs == ()


def test_a_spring_acts_where_a_support_leaves_its_direction_free() -> None:
    """Along an axis askew to what is held, or by the turn of a held node that it reaches from by an
    arm.
    """
    model, axes = read_inp(STEEL), np.array([[0.6, 0.8, 0], [-0.8, 0.6, 0], [0, 0, 1.0]])
    held, askew = (
        Support(np.array([0]), (0, 1), Where(1)),
        Support(np.array([3]), (0,), Where(1), axes),
    )
    springs = {
        "across": Spring(0, 0, 5.0, Where(2), direction=(0.0, 0.6, 0.8)),
        "by its arm": Spring(0, 0, 6.0, Where(2), arms=((0.0, 0.0, 0.1), (0.0, 0.0, 0.0))),
        "askew": Spring(3, 0, 7.0, Where(2)),
        "along what is held": Spring(0, 0, 8.0, Where(2), direction=(0.6, 0.8, 0.0)),
        "of nothing": Spring(2, 0, 0.0, Where(2)),
    }
    body = body_of_model(
        replace(model, supports=(held, askew), springs=tuple(springs.values())), "as_modelled"
    )
    assert [one.stiffness for one in body.springs] == [5.0, 6.0, 7.0]


def hinged(dofs: str) -> bytes:
    """Two plates of 15 nodes, the second led along an edge by the first."""
    places = {
        (part, i, j): 1 + 15 * part + 3 * i + j
        for part in (0, 1)
        for i in range(5)
        for j in range(3)
    }
    cards = [f"GRID,{n},,{part + i / 4},{j / 10},0." for (part, i, j), n in places.items()]
    for (part, i, j), n in places.items():
        if i < 4 and j < 2:
            cards.append(f"CQUAD4,{n},{part + 1},{n},{n + 3},{n + 4},{n + 1}")
    cards += [f"RBE2,{100 + j},{places[0, 4, j]},{dofs},{places[1, 0, j]}" for j in range(3)]
    cards += ["PSHELL,1,3,.01,3,,3", "PSHELL,2,3,.01,3,,3", "MAT1,3,2.1+11,,.3,7850.", "ENDDATA"]
    return "\n".join(["BEGIN BULK", *cards]).encode()


def plate(*cards: str) -> bytes:
    """A plate of 15 nodes whose deck selects SPC = 1, with more cards."""
    nodes = [f"GRID,{1 + 3 * i + j},,{i / 4},{j / 10},0." for i in range(5) for j in range(3)]
    corners = [1 + 3 * i + j for i in range(4) for j in range(2)]
    cells = [f"CQUAD4,{n},1,{n},{n + 3},{n + 4},{n + 1}" for n in corners]
    properties = ["PSHELL,1,3,.01,3,,3", "MAT1,3,2.1+11,,.3,7850."]
    return "\n".join(
        ["SOL 103", "CEND", "SPC=1", "BEGIN BULK", *cards, *nodes, *cells, *properties, "ENDDATA"]
    ).encode()


def test_all_supports_and_springs_of_a_line_hold() -> None:
    """An SPC holds two grids, each in its own way; a CBUSH has a stiffness along each axis; an
    include counts lines anew.
    """
    deck = plate(
        "SPC,1,1,123456,,3,123",
        "CBUSH,900,7,4,15,,,,0",
        "PBUSH,7,K,1.+4,2.+4,3.+4",
        "INCLUDE 'held.inc'",
    )
    model = read_bdf(deck, {"held.inc": b"\n\n\n\nSPC1,1,12,15\n"})
    body = body_of_model(model, "as_modelled")
    held = {
        int(body.mesh.node_sets[one.where][0]): one.dofs
        for one in body.supports
        if isinstance(one.where, str)
    }
    assert held == {0: tuple(range(6)), 2: (0, 1, 2), 14: (0, 1)}
    assert sorted(spring.stiffness for spring in body.springs) == [1e4, 2e4, 3e4]
    assert len({spring.name for spring in body.springs}) == 3
    assert solved(body)[0] > 1.0
    assert [str(one.where) for one in model.supports] == ["line 5", "line 5", "held.inc line 5"]


def test_a_node_that_is_led_in_part_is_held_in_the_rest_along_its_own_axes() -> None:
    turned = plate(
        "CORD2R,5,0,0.,0.,0.,0.,.6,.8", "+,1.,0.,0.", "GRID,90,,0.,0.,.2", "SPC1,1,123456,90"
    )
    turned = turned.replace(b",0.0,0.1,0.\n", b",0.0,0.1,0.,5\n")
    cards = b"RBE2,91,90,12456,2\nSPC1,1,3,2\nRBE2,92,90,123456,1,3\n"
    divided, whole = (
        body_of_model(read_bdf(turned.replace(b"ENDDATA", more + b"ENDDATA")), "as_modelled")
        for more in (cards, b"RBE2,92,90,123456,1,2,3\n")
    )
    np.testing.assert_allclose(solved(divided), solved(whole), rtol=1e-9)
    assert [one.independent for one in divided.links if one.node == 1] == [(15,)]


def test_a_mechanism_is_named() -> None:
    with pytest.raises(
        ModelError,
        match=r"mechanism: nothing resists a motion of 12 of 30 nodes, of pshell_2, .* \(2, ",
    ):
        frequencies(body_of_model(read_bdf(hinged("123"))), 3)
    # and the mesh is coarse
    beam = 4.73**2 / (2 * np.pi * 2.0**2) * np.sqrt(2.1e11 * 0.01**2 / 12 / 7850)
    assert frequencies(body_of_model(read_bdf(hinged("123456"))), 3)[0] == pytest.approx(
        beam, rel=0.03
    )


def test_supports_askew_hold_along_their_axes() -> None:
    model, axes = read_inp(STEEL), np.array([[0.6, 0.8, 0], [-0.8, 0.6, 0], [0, 0, 1.0]])
    held = Support(np.array([0, 3]), (0, 1, 2), Where(9), axes)
    (support,) = body_of_model(replace(model, supports=(held,)), "as_modelled").supports
    assert support.dofs == (0, 1, 2)
    one, other = replace(held, dofs=(0,)), Support(np.array([3]), (2, 5), Where(10), axes)
    first, second = body_of_model(replace(model, supports=(one, other)), "as_modelled").links
    assert ((first.node, first.dofs), (second.node, second.dofs)) == ((0, (0,)), (3, (0, 2, 5)))
    fixed = replace(model, supports=(Support(np.array([1, 2]), tuple(range(6)), Where(8)), one))
    stiff = [Spring(node, 0, 1e13, Where(9), direction=tuple(axes[0])) for node in (0, 3)]
    sprung = replace(fixed, supports=fixed.supports[:1], springs=tuple(stiff))
    askew, by_springs = (body_of_model(each, "as_modelled") for each in (fixed, sprung))
    np.testing.assert_allclose(solved(askew), solved(by_springs), rtol=1e-5)
    with pytest.raises(InputError, match="the support of line 9 holds a node along other axes"):
        body_of_model(replace(model, supports=(one, replace(other, axes=axes.T))), "as_modelled")


def solved(body: Structure) -> FloatArray:
    q, model = np.array(list(body.nominal.values())), body.model
    K = model.stiffness.at(
        np.append(body.stiffness_coefficients(q), [spring.stiffness for spring in body.springs])
    )
    return normal_modes(K, model.mass.at(body.mass_coefficients(q)), 6).frequency_hz


@pytest.mark.parametrize(
    ("content", "name"),
    [(STEEL, "plate.inp"), (f"BEGIN BULK\n{SQUARE}ENDDATA\n".encode(), "plate.bdf")],
)
def test_a_deck_of_one_isotropic_material_is_written_by_its_modulus(
    content: bytes, name: str
) -> None:
    read = read_inp if name.endswith("inp") else read_bdf
    plate, *_ = read(content).sets
    E = 1.9e11
    constants = dict.fromkeys((f"{plate}.E1", f"{plate}.E2"), E) | dict.fromkeys(
        (f"{plate}.G12", f"{plate}.G13", f"{plate}.G23"), E / 2.6
    )
    order = DeckOrder(
        content, name, "m-N-kg", "free", constants, 3, with_joints=True, remarks=("a remark",)
    )
    written = read(updated_deck(order))
    (material,) = written.sections[plate].materials
    assert written.materials[material].constants["E"] == pytest.approx(E)
    assert written.materials[material].constants["nu"] == pytest.approx(0.3)
