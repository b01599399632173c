"""Formats are recognised by what is in a file; a name only decides where that could be two."""

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat, wavfile

from benchmarks.soak import bomb
from modalbase.formats import FormatError
from modalbase.formats.recognise import recognise
from modalbase.formats.records import read_variables


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
    ("content", "name", "found"),
    [
        (written("npz"), "a.uff", "npz"),
        (written("5"), "", "mat"),
        (written("4"), "a.mat", "mat"),
        (b"\x89HDF\r\n\x1a\n", "", "mat"),
        (written("wav"), "", "wav"),
        (b"    -1\n    15\n", "a.csv", "uff"),
        (b"\xef\xbb\xbf\r\n    -1\r\n", "", "uff"),
        (b"time;force\n0,0;1,5\n", "", "csv"),
        (b"time\tforce\n0\t1\n", "a.txt", "csv"),
        (b"time;force\n0;1\n", "a.unv", "uff"),
        (b"one line, of words\nand another\n", "", "uff"),
        (b"\0,1\n2,\0\n", "", "uff"),
        (b"force\n1\n", "a.CSV", "csv"),
        (b"", "", "uff"),
    ],
)
def test_a_format_is_recognised_by_content(tmp_path: Path, content: bytes, name: str, found: str) -> None:
    path = tmp_path / "original"
    path.write_bytes(content)
    assert recognise(path, name) == found


def test_a_mat_is_inflated_no_further_than_allowed(tmp_path: Path) -> None:
    """A .mat of 1.9 MB took 2.3 GB: scipy inflates all of it before anything can be asked."""
    path = tmp_path / "bomb.mat"
    path.write_bytes(bomb("mat", 1, mib=4))
    assert path.stat().st_size < 10_000
    assert read_variables(path, limit_bytes=5 << 20)["a"].shape == (1, (4 << 20) // 8 + 1)
    with pytest.raises(FormatError, match="more than the 1000000 that are allowed"):
        read_variables(path, limit_bytes=1_000_000)


@pytest.mark.parametrize("cut", [1, 40, 90, 900])
def test_an_array_that_is_cut_short_inside_a_sound_zip_is_said_in_one_line(tmp_path: Path, cut: int) -> None:
    whole, path = io.BytesIO(), tmp_path / "cut.npz"
    np.save(whole, np.arange(100.0))
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("force.npy", whole.getvalue()[:-cut])
    with pytest.raises(FormatError, match=r"\Aforce: [^\n]+\Z"):
        read_variables(path)


def test_a_name_with_a_nul_is_refused_since_no_database_holds_it(tmp_path: Path) -> None:
    path = tmp_path / "hit.csv"
    path.write_bytes(b"for\0ce,acc\n1,2\n")
    with pytest.raises(FormatError, match="a variable whose name holds a NUL character"):
        read_variables(path)
