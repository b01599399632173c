"""A file whose framing is broken is refused as a whole, by the call itself, before anything is yielded."""

import pickle
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import pyuff

from modalbase.formats.uff import Frf, GridPoint, Limits, UffError, read_file
from modalbase.formats.uff.text import Refusal, real_block
from tests.support.uff import Reading, dataset, set_58

POINT = "         1         0         0         1  1.00000E+00  2.00000E+00  3.00000E+00"
POINTS = dataset("15", POINT)
FRF = set_58("   1.00000000000e+00   2.00000000000e+00   3.00000000000e+00   4.00000000000e+00")
TYPE_58B = "    58b{order:6d}     2{lines:12d}{count:12d}     0     0           0           0\n"
Read = Callable[..., Reading]


def binary(order: int = 1, lines: int = 11, count: int = 32) -> bytes:
    head = FRF.split(b"\n")[2:13]
    type_line = TYPE_58B.format(order=order, lines=lines, count=count).encode()
    return b"    -1\n" + type_line + b"\n".join(head) + b"\n" + b"\x00" * 32 + b"    -1\n"


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", "the file is empty"),
        (b"x", "not a UFF file: it opens with 'x'"),
        (b"\n", "nothing but blank lines"),
        (b"time,x\n0,1\n", "not a UFF file: it opens with 'time,x'"),
        (b"    -1", "ends or is blank after an opening delimiter"),
        (POINTS[:-4], "the file ends inside dataset 1"),
        (POINTS + b"    -1\n", "ends or is blank after an opening delimiter"),
        (b"    -1\n" + POINTS, "stands '-1', expected its type"),
        (
            POINTS.replace(POINT.encode(), POINT.encode() + b"\n    -1\n" + POINT.encode()),
            "between two datasets stands",
        ),
        (POINTS.replace(POINT.encode(), b"    -1\n    -1\n" + POINT.encode()), "expected its type in columns 1 to 6"),
        (b"    -1\n    15b\n    -1\n", "of the binary sets only 58b is known"),
        (binary(order=3), "the byte order is 3, expected 1 (little endian) or 2 (big endian)"),
        (binary(lines=12), "the count of ASCII header lines is 12, expected 11"),
        (binary(count=31), "declares 31 bytes of binary data, but no delimiter stands behind them"),
        (binary(count=10**11), "declares 100000000000 bytes"),
        (b"    -1\n    15\n" + b"1" * 300_000 + b"\n    -1\n", "a line is longer than 4096 bytes"),
        (b"1" * 5000, "a line is longer than 4096 bytes"),
        (b"    -1\n   734\n" + b"   -1\n" * 1002, "more than 1000 lines of -1 in dataset 1"),
        (binary()[:400], "the file ends inside the header of dataset 1"),
    ],
)
def test_broken_framing(tmp_path: Path, data: bytes, reason: str) -> None:
    path = tmp_path / "file.uff"
    path.write_bytes(data)
    with pytest.raises(UffError) as error:
        read_file(path)  # the call alone: nothing has been asked of the iterator
    assert reason in error.value.reason
    assert 0 <= error.value.offset <= len(data)


@pytest.mark.parametrize("good", [POINTS + FRF, binary()], ids=["text", "binary"])
def test_every_cut_inside_a_dataset_is_refused(tmp_path: Path, good: bytes) -> None:
    path = tmp_path / "file.uff"
    whole = range(len(POINTS) - 1, len(POINTS) + 5)  # from before a line end to after the blanks of the next delimiter
    for size in range(len(good)):
        path.write_bytes(good[:size])
        if (good.startswith(POINTS) and size in whole) or size == len(good) - 1:
            assert list(read_file(path))
        else:
            with pytest.raises(UffError):
                read_file(path)


def test_delimiters_with_odd_blanks(read: Read) -> None:
    padded = POINTS.replace(b"    -1", b"    -1".ljust(80))
    odd = POINTS.replace(b"    -1", b"  -1 \t")
    for data in (
        padded,
        b"\n\n" + POINTS + b"\r\n\r\n" + FRF.replace(b"\n", b"\r\n") + b"\x1a",
        b"\xef\xbb\xbf" + POINTS,
    ):
        found = read(data)
        assert set(found.outcomes) == {"read"}
        assert len(found.of(GridPoint)) == 1
    found = read(odd + FRF)
    assert (len(found.of(GridPoint)), len(found.of(Frf))) == (1, 1)
    assert "its closing delimiter is not in columns 5 and 6" in found.notes


def test_a_dataset_whose_delimiters_were_lost_in_another_is_named(read: Read) -> None:
    data = dataset("734", "1 2 3") + POINTS
    merged = data.replace(b"    -1\n    -1\n", b"    -1x    -1\n")
    found = read(merged)
    assert found.outcomes == ["refused"]
    assert "holds what was the beginning of another dataset" in found.reasons


def test_limits(read: Read) -> None:
    with pytest.raises(UffError, match="more than 1 datasets"):
        read(POINTS + FRF, Limits(datasets=1))
    with pytest.raises(UffError, match="more than 10 bytes of blank lines"):
        read(POINTS + b"\n" * 12 + FRF, Limits(blank_bytes=10))
    assert "nearly all are blank" in read(dataset("15", POINT, *[""] * 10_001)).reasons
    odd = read(POINTS.removesuffix(b"    -1\n") + b"   -1\n")
    assert "its closing delimiter is not in columns 5 and 6" in odd.notes
    found = read(POINTS + FRF, Limits(dataset_bytes=200))
    assert found.outcomes == ["read", "refused"]
    assert "more than the 200 allowed" in found.reasons


def test_reports_name_type_offset_and_place(read: Read) -> None:
    bad = FRF.replace(b"2.00000000000e+00", b"2.000000*0000e+00")
    found = read(POINTS + dataset("734", "1") + bad)
    assert [(r.number, r.type, r.outcome) for r in found.reports] == [
        (1, "15", "read"),
        (2, "734", "ignored"),
        (3, "58", "refused"),
    ]
    assert found.reports[2].offset == len(POINTS) + len(dataset("734", "1"))
    place = (POINTS + dataset("734", "1") + bad).index(b"   1.00000000000e+00")
    assert f"line 12 (byte {place}): '2.000000*0000e+00' is not a number" in found.reasons


def test_a_file_that_is_cut_while_it_is_read_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "file.uff"
    path.write_bytes(POINTS + FRF)
    contents = read_file(path)
    path.write_bytes(POINTS)
    with pytest.raises(UffError, match="the file became shorter while it was read") as refused:
        list(contents)
    assert str(pickle.loads(pickle.dumps(refused.value))) == str(refused.value)  # as it comes out of a child process


def test_what_pyuff_reads_otherwise_is_refused(read: Read, monkeypatch: pytest.MonkeyPatch) -> None:
    """The guard against a dialect that file and reader share: it objects to another number and to one that is lost."""
    theirs = pyuff.UFF.read_sets
    monkeypatch.setattr(pyuff.UFF, "read_sets", lambda self: {**theirs(self), "node_nums": np.array([2])})
    assert "pyuff reads another 'node_nums' from it than its columns hold" in read(POINTS).reasons
    monkeypatch.setattr(pyuff.UFF, "read_sets", lambda _: {})
    assert "pyuff finds no" in read(POINTS).reasons
    monkeypatch.setattr(pyuff.UFF, "read_sets", lambda self: [theirs(self)])
    found = read(POINTS)
    assert found.outcomes == ["read"]
    assert "pyuff cannot read this dataset; it was read by its columns alone" in found.notes


def test_a_refused_row_is_named_by_its_line() -> None:
    good = b"1.0 2.0 \n3.0 4.0 \n"
    for body, count, line in ((b"1.0 2.0 \n3.0 abc \n", 4, 21), (good + b"5.0 6.0 \n", 4, 22), (good, 6, 22)):
        with pytest.raises(Refusal) as refused:
            real_block(body, (4, 4), count, 20)
        assert refused.value.line == line
    assert real_block(good, (4, 4), 4, 20)[0].tolist() == [1, 2, 3, 4]
