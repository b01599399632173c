"""Quantities as people type them: numbers, units, decimal commas; what could be two numbers is
asked about.
"""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.platform.web.quantities import UNITS
from service.platform.web.typed import (
    DIMENSIONS,
    AmbiguousError,
    UnreadableError,
    are_alike,
    in_words,
    read,
    read_numbers,
    read_points,
    read_whole,
    size_of,
)

READ = [
    ("1850 kg/m3", "kg/m³", "kg/m³", 1850.0),
    ("1850kg/m^3", "kg/m³", "kg/m³", 1850.0),
    ("1.85 g/cm³", "kg/m³", "kg/m³", 1850.0),
    ("1,85 g/cc", "kg/m³", "kg/m³", 1850.0),
    ("1850 kg·m⁻³", "kg/m³", "kg/m³", 1850.0),
    ("1.85e-9 t/mm³", "kg/m³", "kg/m³", 1850.0),
    ("21,5", "°C", "°C", 21.5),
    ("21.5 °C", "°C", "°C", 21.5),
    ("70 °F", "°C", "°C", 190 / 9),
    ("70 F", "°C", "°C", 190 / 9),
    ("294.65 K", "°C", "°C", 21.5),
    ("−3,5", "°C", "°C", -3.5),
    ("500 mm", "mm", "m", 0.5),
    ("0.5 m", "mm", "m", 0.5),
    ("10.12", "mm", "m", 0.01012),
    ("20 in", "mm", "m", 0.508),
    ("33 GPa", "GPa", "Pa", 33e9),
    ("33000 MPa", "GPa", "Pa", 33e9),
    ("33 kN/mm²", "GPa", "Pa", 33e9),
    ("33 gpa", "GPa", "Pa", 33e9),
    ("2.1·10^11 Pa", "GPa", "Pa", 2.1e11),
    ("2.1 x 10¹¹ Pa", "GPa", "Pa", 2.1e11),
    ("1e3", "Hz", "Hz", 1000.0),
    ("1.2 kHz", "Hz", "Hz", 1200.0),
    ("2.5 1/s", "1/s", "1/s", 2.5),
    ("2.5 s⁻¹", "1/s", "1/s", 2.5),
    ("2 %", "", "", 0.02),
    ("55 %", "%", "%", 55.0),
    ("1 850", "kg/m³", "kg/m³", 1850.0),
    ("1\u202f850,25", "", "", 1850.25),
    ("1'850", "", "", 1850.0),
    ("1.850,5", "", "", 1850.5),
    ("1,850.5", "", "", 1850.5),
    ("1,234,567", "", "", 1234567.0),
    ("1.850", "mm", "mm", 1.85),
    ("0,850", "", "", 0.85),
    ("12,3456", "", "", 12.3456),
    ("90°", "°", "°", 90.0),
    ("12 h", "days", "days", 0.5),
]


@pytest.mark.parametrize(("text", "unit", "to", "value"), READ, ids=[case[0] for case in READ])
def test_a_quantity_is_read_as_it_was_typed(text: str, unit: str, to: str, value: float) -> None:
    assert math.isclose(read(text, unit, to), value, rel_tol=1e-15)


@pytest.mark.parametrize(
    ("text", "unit", "to", "readings"),
    [
        ("2,012 g/cm3", "kg/m³", "kg/m³", ["2.012 g/cm3"]),
        ("-1,850e1", "mm", "m", ["-1850e1", "-1.850e1"]),
        ("1,850", "GPa", "Pa", ["1.850"]),
        ("1,850", "mm", "m", ["1850", "1.850"]),
        ("1,850", "1/s", "1/s", ["1850", "1.850"]),
    ],
)
def test_of_two_numbers_those_are_offered_that_the_quantity_may_be(
    text: str, unit: str, to: str, readings: list[str]
) -> None:
    with pytest.raises(AmbiguousError) as refused:
        read(text, unit, to)
    assert refused.value.usual(unit, to) == readings


REFUSED = [
    ("1,850", "kg/m³", "“1,850” is 1850 or 1.850"),
    ("1,850e3", "kg/m³", "1850 or 1.850"),
    ("18 503 0", "kg/m³", "parted unevenly"),
    ("1,85.0", "", "parted unevenly"),
    ("1850 kg", "kg/m³", "“kg” is no unit of this field; there is kg/m3, g/cm3"),
    ("12 kg", "mm", "“kg” is no unit of this field; there is mm, cm, m"),
    ("2 Hz", "1/s", "“Hz” is no unit of this field"),
    ("1850 kg/m3 or so", "kg/m³", "is no unit of this field"),
    ("about 20", "°C", "“about 20” is no number in °C"),
    ("", "°C", "is no number"),
    ("nan", "", "is no number"),
    ("inf", "", "is no number"),
    ("١٢", "", "is no number"),
    ("3/4", "", "is no unit"),
    ("1e999", "", "beyond what can be computed with"),
    ("1e-320", "", "beyond what can be computed with"),
    ("1" * 300, "", "is no number"),
]


@pytest.mark.parametrize(("text", "unit", "words"), REFUSED, ids=[case[0][:20] for case in REFUSED])
def test_what_is_no_quantity_of_its_field_is_refused_in_words(
    text: str, unit: str, words: str
) -> None:
    with pytest.raises(UnreadableError) as refused:
        read(text, unit, "m" if unit == "mm" else unit)
    assert words in str(refused.value)


@given(
    st.text(max_size=30)
    | st.from_regex(r"[+-]?[0-9.,' ]{1,12}(e[0-9]{1,4})? ?(kg/m3|mm|%|°F)?", fullmatch=True)
)
def test_any_text_is_read_or_refused(text: str) -> None:
    for unit, to in (("kg/m³", "kg/m³"), ("mm", "m"), ("°C", "°C"), ("", "")):
        try:
            value = read(text, unit, to)
        except UnreadableError:
            continue
        assert math.isfinite(value)
        assert math.isclose(
            read(in_words(value, unit, to, 17), unit, to), value, rel_tol=1e-12, abs_tol=1e-12
        )


@given(
    st.floats(-1e12, 1e12).filter(lambda x: abs(x) > 1e-9), st.sampled_from(DIMENSIONS), st.data()
)
def test_a_number_with_a_unit_is_that_number_times_its_size(
    number: float, kind: dict[str, str], data: st.DataObject
) -> None:
    unit, to = (data.draw(st.sampled_from(sorted(filter(None, kind)))) for _ in range(2))
    if "°C" not in kind and "°C" not in kind and are_alike(unit, to):
        assert math.isclose(
            read(f"{number!r} {unit}", to, to), number * size_of(unit, to), rel_tol=1e-12
        )


def test_every_unit_of_the_contract_can_be_typed() -> None:
    assert all(read(f"2 {unit}", unit, unit) == 2.0 for unit in UNITS.values())


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("−90, 0, 90", [-0.09, 0.0, 0.09]),
        ("-90; 0; 90 mm", [-0.09, 0.0, 0.09]),
        ("25,02 25,00", [0.02502, 0.025]),
        ("25 mm 3 cm", [0.025, 0.03]),
        ("25,02, 24,98", [0.02502, 0.02498]),
        ("120", [0.12]),
    ],
)
def test_lists_are_read(text: str, values: list[float]) -> None:
    assert read_numbers(text, "mm", "m") == values


@pytest.mark.parametrize("text", ["1,2,3", "1,5", "25.02,25.00", "1 mm; 2; 3"])
def test_a_list_that_could_be_another_is_asked_about(text: str) -> None:
    with pytest.raises(UnreadableError, match=r"semicolons|write it once"):
        read_numbers(text, "mm", "m")


@pytest.mark.parametrize(
    "line",
    ["1, 0.5, -20", "1; 0,5; -20", "1\t0,5\t-20", "1 0.5 -20", "1,0.5,-20", "1; 0.0005 m; -2 cm"],
)
def test_points_are_read_as_they_are_separated(line: str) -> None:
    assert read_points(f"\n{line}\n") == [{"label": 1, "x_m": 0.0005, "y_m": -0.02, "z_m": 0.0}]


def test_a_line_that_is_no_point_is_named() -> None:
    with pytest.raises(UnreadableError, match="line 2: “2; 5” is no line of number, x, y and z"):
        read_points("1; 0; 0\n2; 5")
    with pytest.raises(UnreadableError, match="line 1: “1,850” is 1850 or"):
        read_points("1; 1,850; 0")


def test_whole_numbers() -> None:
    assert (read_whole("12"), read_whole("1e3"), read_whole("12,0")) == (12, 1000, 12)
    for text in ("12.5", "1,5", "9007199254740993", "12 %", "3 m"):
        with pytest.raises(UnreadableError):
            read_whole(text)
