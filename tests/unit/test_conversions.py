"""FRFs and tables in the words of other libraries, where these are installed."""

import numpy as np
import pytest

import modalbase
from modalbase.objects.thing import Table


@pytest.fixture
def frfs() -> modalbase.Frfs:
    rng = np.random.default_rng(2)
    values = rng.standard_normal((2, 5)) + 1j * rng.standard_normal((2, 5))
    pairs = {"response": [(1, 3), (2, -3)], "reference": [(5, 3), (5, 3)]}
    return modalbase.Frfs.from_arrays(np.linspace(10.0, 14.0, 5), values, **pairs)


def test_an_array_of_xarray_has_points_and_lines(frfs: modalbase.Frfs) -> None:
    pytest.importorskip("xarray")
    array = frfs.to_xarray()
    assert array.dims == ("frf", "frequency_hz")
    np.testing.assert_array_equal(array.values, frfs.values)
    np.testing.assert_array_equal(array.sel(frequency_hz=12.0).values, frfs.values[:, 2])
    assert list(array.response_point.values) == [1, 2]
    assert list(array.reference_point.values) == [5, 5]


def test_a_model_of_sdypy_keeps_what_it_was_given(frfs: modalbase.Frfs) -> None:
    ema = pytest.importorskip("sdypy.EMA")
    model = ema.Model(**frfs.to_sdypy(), lower=10, upper=14)
    pairs = {"response": [(1, 3), (2, -3)], "reference": [(5, 3), (5, 3)]}
    back = modalbase.Frfs.from_sdypy(model, **pairs)
    assert back.quantity == frfs.quantity == "accelerance"
    np.testing.assert_array_equal(back.values, frfs.values[:, : back.frequency_hz.size])
    np.testing.assert_array_equal(back.frequency_hz, frfs.frequency_hz[: back.frequency_hz.size])
    assert back.frequency_hz.size >= 4  # the model cuts at its upper frequency


def test_a_table_becomes_a_data_frame() -> None:
    pandas = pytest.importorskip("pandas")
    rows = [{"name": "Ex", "estimate": 31.0e9}, {"name": "a0", "estimate": None}]
    frame = Table(rows).to_pandas()
    assert isinstance(frame, pandas.DataFrame)
    assert list(frame["name"]) == ["Ex", "a0"]
    assert frame["estimate"][0] == 31.0e9
    assert np.isnan(frame["estimate"][1])
