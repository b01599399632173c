"""Files of FRFs: nothing is lost on the way, a fault is named by its place, and each kind is
recognised by its bytes.
"""

import io
import pickle
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import nanoarrow as na
import numpy as np
import pytest
from scipy.io import savemat, wavfile

from modalbase.formats.errors import FormatError
from modalbase.formats.frfs import FrfRow, Frfs, read_csv, read_mat, read_npz, write_csv, write_npz
from modalbase.formats.frfs.arrow import write_arrow
from modalbase.formats.frfs.csv import COLUMNS
from modalbase.formats.frfs.mat import propose_frfs
from modalbase.formats.frfs.table import DOFS
from modalbase.formats.recognise import recognise
from modalbase.formats.records import read_variables
from tests.support.bombs import bomb

RNG = np.random.default_rng(8)
HZ = np.cumsum(RNG.uniform(0.1, 1.0, 20))
VALUES = RNG.standard_normal((2, 20)) + 1j * RNG.standard_normal((2, 20))
GAMMA = RNG.uniform(0.0, 1.0, (2, 20))
ROWS = (FrfRow(7, 3, 1, -3, "drive point", 5), FrfRow(8, -2, 1, -3))
HALF = np.where([[True], [False]], GAMMA, np.nan)
"""Coherence of the first FRF alone."""


@pytest.mark.parametrize("coherence", [None, GAMMA, HALF])
@pytest.mark.parametrize("dtype", [np.complex64, np.complex128])
def test_what_is_written_is_read_back_bit_for_bit(
    tmp_path: Path, dtype: Any, coherence: Any
) -> None:
    sent = Frfs(HZ, VALUES.astype(dtype), ROWS, "mobility", coherence)
    for write in (write_npz, write_csv):
        with (path := tmp_path / write.__name__).open("wb") as file:
            write(sent, file)
        loaded = read_npz(path) if write is write_npz else read_csv(path, "mobility")
        np.testing.assert_array_equal(loaded.frequency_hz, HZ)
        np.testing.assert_array_equal(loaded.values, sent.values)
        assert (loaded.quantity, loaded.has_coherence) == ("mobility", coherence is not None)
        if coherence is not None:
            np.testing.assert_array_equal(loaded.coherence, coherence)
        stated = [(r.label, r.averages) for r in loaded.frfs]
        assert stated == (
            [("drive point", 5), ("", None)] if write is write_npz else [("", None)] * 2
        )
        assert [[getattr(r, d) for d in DOFS] for r in loaded.frfs] == [
            [7, 3, 1, -3],
            [8, -2, 1, -3],
        ]
    assert read_npz(tmp_path / "write_npz").dtype == dtype


@pytest.mark.parametrize("coherence", [None, HALF])
def test_arrow_has_the_columns_of_the_csv_and_a_batch_an_frf(coherence: Any) -> None:
    file = io.BytesIO()
    write_arrow(Frfs(HZ, VALUES, ROWS, "accelerance", coherence), file)
    batches = [b.to_pylist() for b in na.ArrayStream.from_readable(file.getvalue())]
    assert [len(batch) for batch in batches] == [20, 20]
    assert {tuple(row) for batch in batches for row in batch} == {COLUMNS}
    assert [complex(r["real"], r["imag"]) for r in batches[1]] == VALUES[1].tolist()
    gammas = [[None] * 20 if coherence is None else GAMMA[0].tolist(), [None] * 20]
    assert [[r["coherence"] for r in batch] for batch in batches] == gammas


HEAD = (
    "response_point,response_direction,reference_point,reference_direction,frequency_hz,real,imag"
)


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("", "line 1: is '', expected response_point,"),
        (HEAD.replace("imag", "phase") + "\n", "line 1: is .*expected response_point,"),
        (HEAD + ",real\n", "line 1: is .*expected the header"),
        (HEAD + "\n\n , \n", "line 2: is missing"),
        (HEAD + "\n7,3,1,3,10.0,1\n", "line 2: has 6 cells, the header has 7"),
        (HEAD + "\n7,z,1,3,10.0,1,1\n", "line 2, response_direction: is 'z', expected a whole number"),
        (HEAD + "\n7,3,1,3,10.0,1,1\n7,3,1,3,20.0,1,-\n",
         "line 3, imag: is '-', expected a number with a decimal point"),
        (HEAD + "\n7,3,1,3,10,1,1\n8,3,1,3,11,1,1\n",
         r"frequency_hz: the lines of FRF \(8, 3, 1, 3\) are not those of"),
        (HEAD + '\n"7,3', "line 2: has 1 cells, the header has 7"),
        (HEAD + "\n7,3,1,3,10,1,ä\n", "line 2, imag: is 'ä', expected a number"),
    ],
)  # fmt: skip
def test_a_csv_is_refused_by_its_line(tmp_path: Path, text: str, fault: str) -> None:
    (tmp_path / "frfs.csv").write_bytes(text.encode("latin-1"))
    with pytest.raises(FormatError, match=fault) as refused:
        read_csv(tmp_path / "frfs.csv")
    handed_on = pickle.loads(pickle.dumps(refused.value))  # as it comes out of a child process
    assert handed_on.faults == refused.value.faults


ARRAYS: dict[str, Any] = {
    "frequency_hz": HZ,
    "values": VALUES,
    **{name: np.array([getattr(row, name) for row in ROWS]) for name in DOFS},
    "quantity": np.array("accelerance"),
}


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"values": VALUES.real}, r"values: is float64 of shape \(2, 20\), expected complex64 or complex128"),
        ({"values": VALUES[:, :0]}, "values: is complex128 of shape"),
        ({"frequency_hz": HZ[None]}, r"frequency_hz: is float64 of shape \(1, 20\), expected real numbers \(L,\)"),
        ({"response_point": np.array([7.0, 8.0])},
         r"response_point: is float64 of shape \(2,\), expected integers \(2,\)"),
        ({"reference_point": np.array([2**63, 1], np.uint64)}, "reference_point: is beyond the range of 64-bit"),
        ({"quantity": np.array("mobility")}, "quantity: is mobility in the file and accelerance beside it"),
        ({"quantity": np.array(3)}, "quantity: is int64 of shape .*expected one text"),
        ({"label": np.array("drive point")}, r"label: is <U11 of shape \(\), expected texts \(2,\)"),
        ({"label": np.array(["a\nb", ""])}, "label: a label has at most 200 printable characters"),
        ({"coherence": np.ones((2, 20), int)}, "coherence: is int64, expected real numbers"),
        ({"coherence": GAMMA[0]}, r"coherence: has shape \(1, 20\), values have \(2, 20\)"),
        ({"temperature": np.array(20.0)}, "temperature.npy: is no array that is read here"),
        ({"values": np.array([{}], object)}, "values: (cannot be read|claims)"),
    ],
)  # fmt: skip
def test_an_npz_is_refused_by_the_name_of_the_array(
    tmp_path: Path, change: dict[str, Any], fault: str
) -> None:
    path = tmp_path / "frfs.npz"
    np.savez(path, **{**ARRAYS, **change})
    with pytest.raises(FormatError, match=fault):
        read_npz(path, quantity="accelerance")


def test_an_npz_of_one_frf_needs_no_second_dimension(tmp_path: Path) -> None:
    one = {name: ARRAYS[name][:1] for name in DOFS}
    np.savez(tmp_path / "one.npz", frequency_hz=HZ, values=VALUES[0], coherence=GAMMA[0], **one)
    with pytest.raises(FormatError, match="quantity: is missing"):
        read_npz(tmp_path / "one.npz")
    loaded = read_npz(tmp_path / "one.npz", limit_bytes=10_000, quantity="mobility")
    assert (loaded.values.shape, loaded.quantity) == ((1, 20), "mobility")
    np.testing.assert_array_equal(loaded.coherence, GAMMA[:1])


def _claims(archive: zipfile.ZipFile) -> None:
    with archive.open("values.npy", "w") as stream:
        header = {"descr": "<c16", "fortran_order": False, "shape": (10**6, 10**6)}
        np.lib.format.write_array_header_1_0(stream, header)


def _twice(archive: zipfile.ZipFile) -> None:
    archive.writestr("values.npy", b"no array")
    with pytest.warns(UserWarning, match="Duplicate name"):
        archive.writestr("values.npy", b"no array")


@pytest.mark.parametrize(
    ("write", "fault"),
    [
        (_claims, "values: claims 16000000000000 bytes and has 0"),
        (lambda archive: archive.writestr("values.npy", b"no array"), "values: cannot be read"),
        (
            lambda archive: archive.writestr("values.npy", b"\x93NUMPY\x09\x00"),
            "values: cannot be read",
        ),
        (
            lambda archive: archive.writestr("values.npy", bytes(2000)),
            "unpacks to more than the 1000 bytes",
        ),
        (_twice, "values: is in the file twice"),
        (
            lambda _: None,
            "frequency_hz: is missing; values: is missing; response_point: is missing",
        ),
    ],
)
def test_an_archive_that_holds_something_else_is_refused(
    tmp_path: Path, write: Callable[[zipfile.ZipFile], object], fault: str
) -> None:
    with zipfile.ZipFile(path := tmp_path / "frfs.npz", "w") as archive:
        write(archive)
    with pytest.raises(FormatError, match=fault):
        read_npz(path, limit_bytes=1000)
    path.write_bytes(b"no archive")
    with pytest.raises(FormatError, match="the file is not an npz archive"):
        read_npz(path)


# --- formats are recognised by what is in a file
# ------------------------------------------------------------------------


def written(kind: str) -> bytes:
    file = io.BytesIO()
    if kind == "npz":
        np.savez(file, force=np.zeros(3))
    elif kind in ("4", "5"):
        savemat(file, {"force": np.zeros(3)}, format=kind)
    else:
        wavfile.write(file, 8000, np.zeros((64, 2), np.int16))
    return file.getvalue()


@pytest.mark.parametrize(
    ("content", "name", "format_name"),
    [
        (written("npz"), "a.uff", "npz"),
        (written("5"), "", "mat"),
        (written("4"), "a.mat", "mat"),
        (b"\x89HDF\r\n\x1a\n", "", "hdf5"),
        (written("wav"), "", "wav"),
        (b"    -1\n    15\n", "a.csv", "uff"),
        (b"\xef\xbb\xbf\r\n    -1\r\n", "", "uff"),
        (b"time;force\n0,0;1,5\n", "", "csv"),
        (b"time\tforce\n0\t1\n", "a.txt", "csv"),
        (b"time;force\n0;1\n", "a.unv", "uff"),
        (b"one line, of words\nand another\n", "", "uff"),
        (b"force\n1\n", "a.CSV", "csv"),
        (b"hello", "a.wav", "wav"),
        (b"", "", "uff"),
    ],
    # a .mat holds the time of its writing
    ids=lambda given: f"{len(given)}b" if isinstance(given, bytes) else None,
)
def test_a_format_is_recognised_by_content(
    tmp_path: Path, content: bytes, name: str, format_name: str
) -> None:
    path = tmp_path / "original"
    path.write_bytes(content)
    assert recognise(path, name) == format_name


def test_a_mat_is_inflated_no_further_than_allowed(tmp_path: Path) -> None:
    """A .mat of 1.9 MB took 2.3 GB: scipy inflates all of it before anything can be asked."""
    path = tmp_path / "bomb.mat"
    path.write_bytes(bomb("mat", 1, mib=4))
    assert path.stat().st_size < 10_000
    assert read_variables(path, limit_bytes=5 << 20)["a"].shape == (1, (4 << 20) // 8 + 1)
    with pytest.raises(FormatError, match="more than the 1000000 that are allowed"):
        read_variables(path, limit_bytes=1_000_000)


@pytest.mark.parametrize("cut", [1, 40, 90, 900])
def test_an_array_that_is_cut_short_inside_a_sound_zip_is_said_in_one_line(
    tmp_path: Path, cut: int
) -> None:
    whole, path = io.BytesIO(), tmp_path / "cut.npz"
    np.save(whole, np.arange(100.0))
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("force.npy", whole.getvalue()[:-cut])
    with pytest.raises(FormatError, match=r"\Aforce: [^\n]+\Z"):
        read_variables(path)


def test_a_name_with_a_nul_is_refused_since_no_database_holds_it(tmp_path: Path) -> None:
    path = tmp_path / "hit.csv"
    path.write_bytes(b"for\0ce,acc\n1,2\n")
    with pytest.raises(FormatError, match="holds NUL bytes; it is not text"):
        read_variables(path)


# --- FRFs and coherences of an analyser's .mat, by a mapping
# ----------------------------------------------------------


RANDOM = np.random.default_rng(3)
LINES = np.arange(1.0, 65.0)
H = RANDOM.standard_normal((3, 64)) + 1j * RANDOM.standard_normal((3, 64))
COHERENCE = RANDOM.uniform(0.5, 1.0, (3, 64))
MAPPING: dict[str, Any] = {
    "frequency_hz": {"variable": "m.f"},
    "frf": {"variable": "m.H"},
    "coherence": {"variable": "m.coh"},
    "response_point": 33,
    "reference_point": {"variable": "m.points"},
    "factor": 9.80665,
}


def structure(path: Path) -> None:
    beside = {"points": [4, 5, 7], "endless": np.full(3, np.inf), "name": "tour"}
    savemat(path, {"m": {"f": LINES, "H": H.T, "coh": COHERENCE.T, **beside}})


def newer(path: Path) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        compound = np.empty((3, 64), dtype=[("real", "f8"), ("imag", "f8")])
        compound["real"], compound["imag"] = H.real, H.imag
        file["m/f"], file["m/coh"], file["m/points"] = (
            LINES[None],
            COHERENCE,
            np.array([[4.0, 5.0, 7.0]]),
        )
        file["m/H"] = compound
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: TEST")


@pytest.mark.parametrize("write", [structure, newer])
def test_a_structure_of_frfs_and_coherences(tmp_path: Path, write: Any) -> None:
    path = tmp_path / "tour.mat"
    write(path)
    loaded = read_mat(path, MAPPING, "accelerance")
    np.testing.assert_allclose(loaded.values, H * 9.80665, rtol=1e-14)
    np.testing.assert_array_equal(loaded.coherence, COHERENCE)
    np.testing.assert_array_equal(loaded.frequency_hz, LINES)
    dofs = [
        (r.response_point, r.response_direction, r.reference_point, r.reference_direction)
        for r in loaded.frfs
    ]
    assert dofs == [(33, 3, 4, 3), (33, 3, 5, 3), (33, 3, 7, 3)]
    bare = {k: v for k, v in MAPPING.items() if k not in ("coherence", "reference_point", "factor")}
    parts = read_mat(
        path,
        {**bare, "reference_point": [4] * 3, "frf": {"real": "m.coh", "imaginary": "m.coh"}},
        "mobility",
    )
    np.testing.assert_array_equal(parts.values, (1 + 1j) * COHERENCE)
    assert (parts.coherence, {row.reference_point for row in parts.frfs}) == (None, {4})
    with pytest.raises(FormatError, match=r"mapping\.reference_point: is missing"):
        read_mat(path, bare, "accelerance")
    proposal = propose_frfs(read_variables(path))
    assert {k: proposal[k] for k in ("frequency_hz", "frf", "coherence")} == {
        k: MAPPING[k] for k in ("frequency_hz", "frf", "coherence")
    }


def test_a_proposal_prefers_the_frf_to_other_spectra() -> None:
    """As one analyser names what it exports; its coherence exceeds 1 at 0 Hz."""
    variables = {
        "Freq_domain": LINES[:, None],
        "Hf_Cross_Spec_chan_2": H[:1].T,
        "Hf_chan_2": H[:1].T,
        "Hf_coh_chan_2": 1.2 * np.ones((LINES.size, 1)),
        "Lin_Spec": np.full((LINES.size, 1), 0.5),
    }
    proposal = propose_frfs(variables)
    assert [proposal[k]["variable"] for k in ("frequency_hz", "frf", "coherence")] == [
        "Freq_domain",
        "Hf_chan_2",
        "Hf_coh_chan_2",
    ]
    assert "coherence" not in propose_frfs({k: variables[k] for k in ("Freq_domain", "Hf_chan_2")})


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"frf": {"variable": "m.coh"}}, "is real: an FRF without phase"),
        ({"frf": {"variable": "m.Q"}}, "is not in the file; it has m.H"),
        ({"frf": {"real": "m.coh", "imaginary": "m.points"}}, "none of it the 64 frequencies"),
        ({"coherence": {"variable": "m.f"}}, "has 1 functions, frf 3"),
        ({"reference_point": [1, 2]}, "no whole number for each of the 3 FRFs"),
        ({"response_direction": 0}, "is no direction"),
        ({"factor": 0}, "expected a number other than 0"),
        ({"reference_point": ["a", 5, 7]}, "no whole number for each of the 3 FRFs"),
        ({"reference_point": [[4], [5, 7]]}, "no whole number for each of the 3 FRFs"),
        (
            {"reference_point": {"variable": "m.f", "row": 1}},
            "no whole number for each of the 3 FRFs",
        ),
        ({"reference_point": {"variable": "m.endless"}}, "no whole number for each of the 3 FRFs"),
        (
            {"frf": {"real": "m.H", "imaginary": "m.H"}},
            "m.H: is complex, expected the real numbers of frf",
        ),
        (
            {"frf": {"real": "m.coh", "imaginary": "m.f"}},
            "mapping.frf: has 3 FRFs of real and 1 of imaginary",
        ),
        ({"frf": "m.H"}, r"mapping.frf: is 'm.H', expected \{\"variable\": name\}, "),
        (
            {"frequency_hz": "m.f"},
            r"mapping.frequency_hz: is 'm.f', expected \{\"variable\": name\}",
        ),
        (
            {"frequency_hz": {"variable": "m.H"}},
            "m.H: is complex, expected the real numbers of frequency_hz",
        ),
        ({"sensor": 1}, "is not an object of"),
    ],
)
def test_a_mapping_that_does_not_fit_is_named(
    tmp_path: Path, change: dict[str, Any], fault: str
) -> None:
    path = tmp_path / "tour.mat"
    structure(path)
    with pytest.raises(FormatError, match=fault):
        read_mat(path, {**MAPPING, **change}, "accelerance")
    with pytest.raises(FormatError, match=r'suggests .*"frf": {"variable": "m.H"}'):
        read_mat(path, None, "accelerance")
