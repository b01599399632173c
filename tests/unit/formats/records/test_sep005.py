"""Time series of SDyPy's SEP 5 to time blocks and back."""

from typing import Any

import numpy as np
import pytest

from modalbase.formats.errors import FormatError
from modalbase.formats.records import Place, records_from_sep005, records_to_sep005

RNG = np.random.default_rng(5)
FORCE, RESPONSE = RNG.standard_normal((2, 3, 256))
HAMMER: dict[str, Any] = {"name": "hammer", "data": FORCE, "fs": 2048, "unit_str": "N"}
SENSOR: dict[str, Any] = {"name": "acc", "data": RESPONSE, "fs": 2048, "unit_str": "g"}
PLACES = {"hammer": 4, "acc": Place(33, -3)}


def test_series_become_blocks_in_si() -> None:
    blocks = records_from_sep005([SENSOR, HAMMER], PLACES, hit=7)
    assert [(b.quantity, b.point, b.direction, b.force_point, b.hit) for b in blocks] == [
        row for n in (7, 8, 9) for row in (("force", 4, 3, 4, n), ("acceleration", 33, -3, 4, n))
    ]
    np.testing.assert_array_equal(blocks[2].samples, FORCE[1])
    np.testing.assert_allclose(blocks[3].samples, 9.80665 * RESPONSE[1], rtol=1e-15)
    assert {b.sample_rate_hz for b in blocks} == {2048.0}


@pytest.mark.parametrize(
    ("unit", "factor"),
    [("m/s²", 1.0), ("m/s^2", 1.0), ("mm/s**2", 1e-3), ("g", 9.80665), ("m s-2", 1.0)],
)
def test_units_as_people_write_them(unit: str, factor: float) -> None:
    series = [HAMMER, {**SENSOR, "data": RESPONSE[0], "unit_str": unit}]
    block = records_from_sep005([{**series[0], "data": FORCE[0]}, series[1]], PLACES)[1]
    np.testing.assert_allclose(block.samples, factor * RESPONSE[0], rtol=1e-14)


def test_volts_with_a_sensitivity_and_an_axis_in_place_of_the_rate() -> None:
    time = 3.0 + np.arange(256) / 2048
    series = [
        {
            "name": "hammer",
            "data": 0.002 * FORCE[0],
            "time": time,
            "unit_str": "V",
            "quantity": "force",
        },
        {**SENSOR, "data": RESPONSE[0]},
    ]
    force = records_from_sep005(series, PLACES, sensitivities={"hammer": 0.002})[0]
    np.testing.assert_allclose(force.samples, FORCE[0], rtol=1e-12)
    assert force.sensitivity == 0.002
    assert force.sample_rate_hz == pytest.approx(2048, rel=1e-9)


def test_there_and_back_is_the_same() -> None:
    blocks = records_from_sep005([HAMMER, SENSOR], PLACES)
    series = records_to_sep005(blocks)
    for one in series:  # what SEP 5 asks of every channel
        assert {"data", "name", "unit_str", "fs"} <= one.keys()
        assert isinstance(one["data"], np.ndarray)
    again = records_from_sep005(series[:2], {"hammer": 4, "acc": Place(33, -3)}, hit=1)
    for one, two in zip(again, blocks[:2], strict=True):
        np.testing.assert_array_equal(one.samples, two.samples)
        assert (one.point, one.direction, one.force_point, one.hit) == (
            two.point,
            two.direction,
            two.force_point,
            two.hit,
        )


@pytest.mark.parametrize(
    ("series", "places", "text"),
    [
        ([HAMMER], PLACES, "have no response"),
        (
            [SENSOR, {**SENSOR, "name": "b"}],
            {**PLACES, "b": 2},
            "exactly one channel that measures a force",
        ),
        (
            [{k: v for k, v in HAMMER.items() if k != "fs"}, SENSOR],
            PLACES,
            r"series.0.fs: is missing, and so is time",
        ),
        ([HAMMER, {**SENSOR, "fs": 1024}], PLACES, "differ in sampling rate: 1024 Hz, 2048 Hz"),
        (
            [HAMMER, {**SENSOR, "time": np.arange(256) / 512}],
            PLACES,
            "the axis in time says 512 Hz",
        ),
        ([HAMMER, {**SENSOR, "time": np.arange(256) ** 2}], PLACES, "not an evenly rising axis"),
        ([HAMMER, {**SENSOR, "time": np.arange(7)}], PLACES, "has 7 values, the data 256"),
        ([HAMMER, {**SENSOR, "unit_str": "bar"}], PLACES, "is 'bar', expected one of N, kN"),
        ([HAMMER, {**SENSOR, "unit_str": "V"}], PLACES, "is V: state `quantity`"),
        ([HAMMER, SENSOR], {"hammer": 4}, "places.acc: is missing"),
        ([HAMMER, {**SENSOR, "name": "hammer"}], PLACES, "a name twice"),
        ([HAMMER, {**SENSOR, "data": np.array(["a"])}], PLACES, "holds no numbers"),
        ([HAMMER, {**SENSOR, "data": [[1.0], [1.0, 2.0]]}], PLACES, "holds no numbers"),
        ([HAMMER, {**SENSOR, "data": RESPONSE[:2]}], PLACES, "are not alike"),
        (
            [HAMMER, {**SENSOR, "data": np.where(RESPONSE > 2, np.nan, RESPONSE)}],
            PLACES,
            "holds NaN or infinity",
        ),
        ([HAMMER, "acc"], PLACES, "series.1: is a str"),
        ([HAMMER, {**SENSOR, "fs": 0}], PLACES, "expected samples a second"),
    ],
)
def test_what_cannot_be_right_is_named(series: Any, places: dict[str, Any], text: str) -> None:
    with pytest.raises(FormatError, match=text):
        records_from_sep005(series, places)
