"""The table of quantities: each row says all of itself, and each constant of a body has one."""

import pytest

from fecore.body.laminate import Ply
from fecore.body.specimen import LayeredSpecimen, OrientedSpecimen, Specimen
from fecore.quantities import CONSTANTS, QUANTITIES, SHOWN, WRITTEN, quantity_of
from fecore.updating.inputs import Inputs, tolerance_of
from fecore.updating.result import amount
from tests.support.cantilever import COUPONS

SIZE = (0.5, 0.04, 0.01)
BODIES = (
    Specimen(*SIZE, COUPONS, zones=(0.2,)),
    OrientedSpecimen(*SIZE, COUPONS, clamp_compliance=0.01),
    LayeredSpecimen(*SIZE, (Ply(COUPONS, 0.01, 30.0),), 2000.0),
)


@pytest.mark.parametrize("name", QUANTITIES)
def test_a_quantity_says_all_of_itself(name: str) -> None:
    row = QUANTITIES[name]
    assert row.unit, f"{name} has no unit"
    assert row.meaning, f"{name} has no meaning"
    if row.usual is not None:
        assert row.usual[0] <= row.likely[0] < row.likely[1] <= row.usual[1], name
        assert row.mistaken, f"nothing is said of units in which people write {name}"
    if row.input:
        assert hasattr(Inputs(), f"{row.input}_sd"), f"{name} is of no input"
        assert QUANTITIES[row.input].tolerance, f"{row.input} has no tolerance"
        assert tolerance_of(f"flange.{name}_2") == row.input
    if row.tolerance:
        assert hasattr(Inputs(), f"{name}_sd"), f"{name} is no input"


@pytest.mark.parametrize("body", BODIES, ids=lambda body: type(body).__name__)
def test_every_constant_of_a_body_has_a_row(body: Specimen) -> None:
    for constant in (*body.nominal, *body.structure.nominal):
        assert quantity_of(constant) is not None, f"{constant} has no row in fecore.quantities"


def test_a_name_that_is_free_measures_nothing() -> None:
    assert quantity_of("foot") is None
    assert quantity_of("strength") is None  # of coupons, and no constant of a body
    assert set(CONSTANTS) < set(QUANTITIES)


def test_units_are_shown_as_people_write_them() -> None:
    assert {unit: shown for unit, (_, shown) in SHOWN.items()}["Pa"] == "GPa"
    assert WRITTEN["kg"] == (1e3, "g")
    assert [amount("E1_2", 33e9), amount("angle_1", 0.5), amount("foot", 3.0)] == [
        "33 GPa",
        "28.6°",
        "3",
    ]
