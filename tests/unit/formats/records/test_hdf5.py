"""Datasets of an HDF5 give back what was written, whole or in parts."""

import contextlib
import sys
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modalbase.formats.errors import FormatError
from modalbase.formats.frfs.mat import frfs_of
from modalbase.formats.records import blocks_of, read_mapping
from modalbase.formats.records.hdf5 import hdf5_arrays, open_hdf5
from modalbase.formats.records.variables import read_named, read_variables
from modalbase.formats.records.wav import FRAMES
from service.compute.recordings import mapped_channels
from service.tasks.look.compute import look_at

RATE, LONG = 256.0, 2 * FRAMES + 1000
DATA = np.random.default_rng(8).standard_normal((3, LONG)).astype(np.float32)
SENSOR = {"quantity": "acceleration", "direction": 3}


def hdf5(path: Path, data: np.ndarray = DATA, **more: Any) -> Path:
    with h5py.File(path, "w") as file:
        daq = file.create_dataset("daq/data", data=data, **more)
        daq.attrs["units"], daq.attrs["rate"] = "g", RATE
        file["daq/gain"] = np.arange(3.0)
        file.attrs["measured_on"] = "2026-05-04 03:02:01"
    return path


@pytest.mark.parametrize("layout", [{}, {"chunks": True, "compression": "gzip"}])
@pytest.mark.parametrize("shape", ["rows", "columns", "deep"])
def test_columns_of_a_dataset_are_channels(tmp_path: Path, layout: Any, shape: str) -> None:
    data = {"rows": DATA, "columns": DATA.T, "deep": DATA[:, None]}[shape]
    file = open_hdf5(hdf5(tmp_path / "a.h5", data, **layout))
    assert file.names == ["daq.data column 1", "daq.data column 2", "daq.data column 3", "daq.gain"]
    assert file.units == {f"daq.data column {k}": "g" for k in (1, 2, 3)}
    assert file.rate_of(file.names[:3], "daq.data@rate") == RATE
    wanted = ["daq.data column 3", "daq.data column 1"]
    parts = list(file.chunks(wanted))
    assert max(part.size for part in parts) <= FRAMES
    np.testing.assert_array_equal(np.concatenate(parts, axis=1), DATA[[2, 0]])
    with pytest.raises(FormatError, match=r"daq.gain: is float64 \[3\], expected"):
        file.rate_of([*wanted, "daq.gain"], "daq.data@rate")


def test_a_mapping_names_attributes_and_a_unit_that_contradicts_is_refused(tmp_path: Path) -> None:
    path = hdf5(tmp_path / "a.h5")
    channel = {"variable": "daq.data column 2", "point": 4, **SENSOR}
    mapping = {"sample_rate_hz": {"variable": "daq.data@rate"}, "channels": [channel]}
    mapped = mapped_channels(path, mapping, "hdf5", kind="responses")
    part = next(iter(mapped.chunks()))
    np.testing.assert_allclose(part[0], DATA[1, : part.size] * 9.80665, rtol=1e-6)  # float32
    wrong = {**mapping, "channels": [{**channel, "unit": "m/s²"}]}
    with pytest.raises(FormatError, match="unit: is 'm/s²', and the file states 'g'"):
        mapped_channels(path, wrong, "hdf5", kind="responses")
    with pytest.raises(FormatError, match=r"daq\.data@speed: is not in the file"):
        mapped_channels(
            path,
            {**mapping, "sample_rate_hz": {"variable": "daq.data@speed"}},
            "hdf5",
            kind="responses",
        )
    look = look_at(path, "a.h5", "responses")
    assert look.performed_at == datetime(2026, 5, 4, 3, 2, 1)
    assert [c["unit"] for c in look.mapping["channels"]] == ["g", "g", "g", None]


def test_hits_and_frfs_of_an_hdf5_are_those_of_other_arrays(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    spectra = DATA[:, :64] + 1j * DATA[:, 64:128]
    with h5py.File(path, "w") as file:
        file["hits/force"], file["hits/acc"] = DATA[:2, :512], DATA[1:, :512]
        file["hits/acc"].attrs["unit"] = "g"
        file["frf/H"], file["frf/f"] = spectra, np.arange(64.0)
        file["frf/H"].attrs["unit"] = "g/N"
        file["note"] = "tour"
    arrays, texts = read_named(path)
    assert texts == {"note": "tour", "hits.acc@unit": "g", "frf.H@unit": "g/N"}
    channels = [
        {"variable": "hits.force", "quantity": "force", "point": 4},
        {"variable": "hits.acc", "point": 33, **SENSOR},
    ]
    mapping = read_mapping({"sample_rate_hz": RATE, "channels": channels}, {"hits.acc": "g"})
    blocks = blocks_of(arrays, mapping)
    np.testing.assert_allclose(blocks[1].samples, DATA[1, :512] * 9.80665, rtol=1e-6)  # float32
    document = {
        "frequency_hz": {"variable": "frf.f"},
        "frf": {"variable": "frf.H"},
        "response_point": [1, 2, 3],
        "reference_point": 4,
    }
    frfs = frfs_of(arrays, document, None, texts)
    assert frfs.quantity == "accelerance"
    np.testing.assert_allclose(frfs.values, spectra * 9.80665, rtol=1e-6)  # complex64


def external(path: Path) -> None:
    path.with_suffix(".raw").write_bytes(bytes(8000))
    with h5py.File(path, "w") as file:
        file.create_dataset("d/a", (1000,), "f8", external=str(path.with_suffix(".raw")))


def virtual(path: Path) -> None:
    layout = h5py.VirtualLayout((1000,), "f8")
    layout[:] = h5py.VirtualSource("other.h5", "a", (1000,))
    with h5py.File(path, "w") as file:
        file.create_virtual_dataset("d/a", layout)


def huge(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file.create_dataset("d/a", (1 << 40,), "f8", chunks=(1 << 20,))


def words(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["d/a"] = "nothing but words"


def twice(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["d/a"], file["d.a"] = DATA[0], DATA[1]


def linked(path: Path) -> None:
    """A link to another file is not followed."""
    hdf5(path.with_name("other.h5"))
    with h5py.File(path, "w") as file:
        file["d"] = h5py.ExternalLink("other.h5", "daq/data")


@pytest.mark.parametrize(
    ("write", "message"),
    [
        (external, "d.a: has its values in other files"),
        (virtual, "d.a: has its values in other files"),
        (huge, r"d.a: (claims|declares) \d+ bytes, more than"),
        (words, "holds no (dataset|numeric)"),
        (twice, "d.a: is the name of two datasets"),
        (linked, "holds no (dataset|numeric)"),
    ],
)
def test_what_an_hdf5_may_not_hold(
    tmp_path: Path, write: Callable[[Path], None], message: str
) -> None:
    write(path := tmp_path / "a.h5")
    with pytest.raises(FormatError, match=message):
        open_hdf5(path)
    with pytest.raises(FormatError, match=message):
        read_variables(path, limit_bytes=1 << 26)


def test_without_h5py_the_error_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = hdf5(tmp_path / "a.h5", DATA[:, :64])
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(FormatError, match=r"h5py reads: pip install 'modalbase\[server\]'"):
        hdf5_arrays(path, None)


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_a_damaged_file_is_refused_or_read(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("damaged") / "a.h5"
    hdf5(path, DATA[:, :300], chunks=True, compression="gzip")
    whole = path.read_bytes()
    at = data.draw(st.integers(0, len(whole) - 1))
    noise = data.draw(st.binary(max_size=8))
    path.write_bytes(whole[:at] + noise + (whole[at + len(noise) :] if noise else b""))
    with contextlib.suppress(FormatError):
        read_variables(path, limit_bytes=1 << 26)
        file = open_hdf5(path)
        for name in file.names:
            list(file.chunks([name]))
