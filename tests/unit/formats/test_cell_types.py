"""The table of types of elements, and the core's elements by the same names."""

import pytest

from fecore.body.mesh import ELEMENTS
from modalbase.formats.cell_types import CELL_TYPES, CellType, shells

each = pytest.mark.parametrize("one", CELL_TYPES.values(), ids=lambda one: one.name)


def test_every_element_of_the_core_is_in_the_table_and_the_other_way_round() -> None:
    assert ELEMENTS.keys() | {"point"} == CELL_TYPES.keys()


@each
def test_a_type_has_the_nodes_of_its_element(one: CellType) -> None:
    if one.dimension:
        element = ELEMENTS[one.name]
        assert (len(element.corners), len(element.sides[0]) >= 2) == (one.nodes, True)
        assert element.raised == "" or element.raised in ELEMENTS
        assert bool(element.raised) != bool(element.halving), "a finer mesh has neither or both"


@each
def test_every_type_can_be_drawn_and_read(one: CellType) -> None:
    assert one.vtk, "VTK has no such cell: viewers show no mesh with it"
    assert one.gmsh, "gmsh has no such element"
    assert not one.dimension or one.abaqus, "no deck has it"
    assert sorted(one.abaqus_order or range(one.nodes)) == list(range(one.nodes))
    for fields in one.nastran.values():
        assert (len(fields.grids), len(fields.thickness)) == (one.nodes, one.corners)


def test_set_2412_goes_around_an_element() -> None:
    assert CELL_TYPES["beam3"].around == [0, 2, 1]
    assert CELL_TYPES["tri3"].around == [0, 1, 2]
    assert CELL_TYPES["quad8"].around == [0, 4, 1, 5, 2, 6, 3, 7]
    digits = [one.uff % 10 for one in shells() if one.uff]
    assert len(digits) == len(set(digits)), "the last digit is of one shell"
