"""Units of a UFF: by labels, by set 164, and the way from both to SI, with every conversion
stated.
"""

from typing import Any

import pytest

from modalbase.formats.uff import Frf, GridPoint, Units
from tests.support.uff import Read, Reading, axis, set_58, set_164

ROW = "   1.00000000000e+00   0.00000000000e+00"
LARGE = ROW.replace("1.00000000000e+00", "1.0000000000e+308")
G = 9.80665
LBF = 4.4482216152605


def one(reading: Reading) -> Frf:
    assert "refused" not in reading.outcomes, reading.reasons
    return reading.of(Frf)[0]


@pytest.mark.parametrize(
    ("ordinate", "denominator", "quantity", "factor"),
    [
        (axis(12, "m/s2"), axis(13, "N"), "accelerance", 1.0),
        (axis(12, "g"), axis(13, "N"), "accelerance", G),
        (axis(12, "g"), axis(13, "lbf"), "accelerance", G / LBF),
        (axis(12, "g/N"), axis(0), "accelerance", G),
        (axis(12, "g/N"), axis(13, "N"), "accelerance", G),
        (axis(12, "mm/s^2"), axis(13, "N"), "accelerance", 1e-3),
        (axis(12, "m/s^2 x10-3"), axis(13, "N"), "accelerance", 1e-3),
        (axis(0, "g"), axis(0, "N"), "accelerance", G),
        (axis(11, "in/s"), axis(13, "lbf"), "mobility", 0.0254 / LBF),
        (axis(1, "mm/s"), axis(13, "N"), "mobility", 1e-3),
        (axis(8, "mm"), axis(13, "kN"), "receptance", 1e-6),
        (axis(0, "m/N"), axis(0), "receptance", 1.0),
    ],
)
def test_ordinates_by_their_labels(
    read: Read, ordinate: bytes, denominator: bytes, quantity: str, factor: float
) -> None:
    reading = read(set_58(ROW, points=1, ordinate=ordinate, denominator=denominator))
    frf = one(reading)
    assert frf.quantity == quantity
    assert frf.values[0] == pytest.approx(factor, rel=1e-14)
    assert ("multiplied by" in reading.notes) == (factor != 1.0)
    assert ("1 g = 9.80665 m/s²" in reading.notes) == (b" g" in ordinate)


@pytest.mark.parametrize(
    ("header", "reason"),
    [
        (
            {"ordinate": axis(12, "m/s")},
            "its data type says accelerance, its unit 'm/s' says mobility",
        ),
        (
            {"ordinate": axis(12, "dB re 1 g")},
            "its ordinate is in 'dB re 1 g', which is read as no unit",
        ),
        ({"ordinate": axis(12, name="Velocity")}, "its name 'Velocity' another"),
        ({"denominator": axis(13, "m")}, "the unit 'm' of its denominator does not fit"),
        ({"ordinate": axis(0, "N")}, "is no unit of an FRF's response"),
        ({"ordinate": axis(15, "Pa")}, "its ordinate is of type 15, not an acceleration"),
        ({"start": "-5.00000e+00"}, "its first frequency is -5, expected 0 or more"),
        (
            {"ordinate": axis(12, "g"), "row": LARGE},
            "its ordinates are beyond double precision in SI, first at 1",
        ),
        (
            {"ordinate": axis(0), "denominator": axis(0)},
            "neither its data type (0) nor its unit ('NONE')",
        ),
    ],
)
def test_what_contradicts_itself_is_refused(
    read: Read, header: dict[str, Any], reason: str
) -> None:
    reading = read(set_58(header.pop("row", ROW), points=1, **header))
    assert (reading.outcomes, reading.contents) == (["refused"], [])
    assert reason in reading.reasons


@pytest.mark.parametrize(
    ("unit", "factor"), [("Hz", 1.0), ("rad/s", 0.15915494309189535), ("kHz", 1e3), ("rpm", 1 / 60)]
)
def test_frequency_axis(read: Read, unit: str, factor: float) -> None:
    row = ROW.replace("0.0", "2.0")
    reading = read(
        set_58(row + row, start="5.00000e+00", step="2.50000e-01", abscissa=axis(18, unit))
    )
    assert one(reading).frequency.points().tolist() == pytest.approx(
        [5 * factor, 5.25 * factor], rel=1e-12
    )
    uneven = " 5.00000e+00 1.00000e+00 3.00000e+00 5.25000e+00 4.00000e+00 5.00000e+00"
    axis_of = one(read(set_58(uneven, kind=5, even=0, abscissa=axis(18, unit)))).frequency
    assert axis_of.points().tolist() == pytest.approx([5 * factor, 5.25 * factor], rel=1e-12)
    assert (axis_of.start, axis_of.step, axis_of.count) == (
        pytest.approx(5 * factor, rel=1e-12),
        0.0,
        2,
    )
    assert ("converted to Hz" in reading.notes) == (unit != "Hz")


def test_set_164(read: Read) -> None:
    reading = read(set_164(1000.0, 1.0, code=1))
    assert reading.of(Units)[0].length == 1000.0
    assert "units code 1 stands for length and force factors 1 and 1" in reading.notes
    more = set_164().removesuffix(b"    -1\n") + b"  1.0\n    -1\n"
    assert "holds more than the three lines of the format" in read(more).reasons
    for bad in ("0.0000000000000000D+00", "-1.0000000000000000D+00", "1.0000000000000000D+99"):
        reading = read(
            set_164().replace(b" 1.0000000000000000D+00", f"{bad:>23}".encode(), 1) + POINT
        )
        assert reading.outcomes == ["refused", "refused"]
        assert "its units (set 164, dataset 1) were refused" in reading.reasons


@pytest.mark.parametrize(
    ("code", "length", "force"),
    [
        (1, 1.0, 1.0),
        (2, 1 / 0.3048, 1 / LBF),
        (3, 1.0, 1 / G),
        (4, 1 / 0.3048, 1 / (0.45359237 * 0.3048)),  # poundal: lb ft/s²
        (5, 1e3, 1e3),
        (6, 1e2, 1e2),
        (7, 1 / 0.0254, 1 / LBF),
        (8, 1e3, 1 / G),
        (10, 1e3, 1.0),
    ],
)
def test_codes_of_set_164_stand_for_their_factors_within_a_thousandth(
    read: Read, code: int, length: float, force: float
) -> None:
    assert read(set_164(length * 1.0009, force * 1.0009, code)).notes == ""
    for near in (set_164(length * 1.0011, force, code), set_164(length, force / 1.0011, code)):
        assert f"units code {code} stands for" in read(near).notes
    assert read(set_164(1e-12, 1e12)).outcomes == ["read"]


POINT = (
    b"    -1\n    15\n         7         0         0         1  1.00000E+03  2.00000E+00 "
    b" 3.00000E+00\n    -1\n"
)


def test_units_hold_from_where_they_are_stated_to_the_next_ones(read: Read) -> None:
    other = POINT.replace(b"         7", b"         8", 1)
    third = POINT.replace(b"         7", b"         9", 1)
    reading = read(POINT + set_164(1000.0) + other + set_164(10.0) + third)
    assert [point.xyz_m[0] for point in reading.of(GridPoint)] == pytest.approx(
        [1.0, 1.0, 100.0], rel=1e-15
    )
