"""Set 58 as programs write it: what the format allows is read, and what it does not allow is
refused by name.
"""

import warnings
from pathlib import Path

import numpy as np
import pytest
import pyuff

from modalbase.formats.uff import Frf, Function, UffError
from tests.support.uff import PLAIN, Read, Reading, axis, dataset, header_58, set_58

VALUES = [1 + 2j, 3 + 4j]


def values(reading: Reading) -> list[complex]:
    (frf,) = reading.of(Frf)
    return frf.values.tolist()


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        ([PLAIN], VALUES),
        ([PLAIN.replace("e", "E")], VALUES),
        ([PLAIN.replace("e", "D")], VALUES),
        ([PLAIN.replace("e", "d")], VALUES),
        ([PLAIN + "     "], VALUES),
        ([PLAIN, "", "  "], VALUES),
        (["    1.00000000000-101   2.00000000000+101   3.00000000000e+00   4.00000000000e+00"], [1e-101 + 2e101j, 3 + 4j]),
        (["-1.123456789012e-101-2.1234567890120e+00   3.00000000000e+00   4.00000000000e+00"],
         [-1.123456789012e-101 - 2.123456789012j, 3 + 4j]),
        (["                  1.                   2                  .3               4.E0"], [1 + 2j, 0.3 + 4j]),
    ],
)  # fmt: skip
def test_forms_of_numbers(read: Read, rows: list[str], expected: list[complex]) -> None:
    reading = read(set_58(*rows))
    assert reading.outcomes == ["read"], reading.reasons
    assert values(reading) == expected


@pytest.mark.parametrize(
    ("kind", "rows", "expected"),
    [
        (5, [" 1.00000e+00 2.00000e+00 3.00000e+00 1.50000e+00 4.00000e+00 5.00000e+00"], [2 + 3j, 4 + 5j]),
        (6, [" 1.00000e+00   2.00000000000e+00   3.00000000000e+00", " 1.50000e+00   4.00000000000e+00   5.00000000000e+00"],
         [2 + 3j, 4 + 5j]),
    ],
)  # fmt: skip
def test_uneven_axes(read: Read, kind: int, rows: list[str], expected: list[complex]) -> None:
    reading = read(set_58(*rows, kind=kind, even=0))
    assert values(reading) == expected
    assert reading.of(Frf)[0].frequency.points().tolist() == [1.0, 1.5]


@pytest.mark.parametrize(
    ("rows", "header", "reason"),
    [
        ([PLAIN], {"points": 3}, "holds 4 values where its header declares 6"),
        ([PLAIN], {"points": 1}, "holds more ordinates than the 2 values declared"),
        ([PLAIN], {"points": -2}, "the number of points is -2, expected at least 1"),
        ([PLAIN], {"points": 999999999}, "declares 999999999 points but holds only"),
        ([PLAIN], {"kind": 3}, "the ordinate data type is 3, expected 2, 4, 5 or 6"),
        ([PLAIN], {"even": 2}, "the abscissa spacing is 2"),
        ([PLAIN], {"step": "0.0"}, "the abscissa increment is 0"),
        ([PLAIN], {"step": "nan"}, "'nan' is not a number"),
        ([PLAIN], {"function": 77}, "the function type is 77"),
        ([PLAIN[:40]], {"kind": 4}, "an FRF with real ordinates"),
        ([PLAIN], {"abscissa": axis(17, "s")}, "is over an abscissa of type 17"),
        ([PLAIN], {"denominator": axis(12, "m/s^2")}, "its denominator is of type 12, not a force"),
        ([PLAIN], {"denominator": axis(12, "m/s^2")}, "line 10 (byte "),
        ([" 1.00000e+00 2.00000e+00 3.00000e+00 1.00000e+00 4.00000e+00 5.00000e+00"], {"kind": 5, "even": 0},
         "the abscissa does not increase at point 2"),
        ([PLAIN], {"response": (7, 9)}, "the response direction is 9, expected -6 to 6"),
        ([PLAIN], {"reference": (-7, 3)}, "expected positive labels"),
        ([PLAIN.replace("   2.00000000000e+00", "                 NaN")], {"start": "1.0"}, "(at 1); only one at 0 Hz"),
        ([PLAIN.replace("   2.00000000000e+00", "            Infinity")], {"start": "1.0"}, "is number 1 (at 1)"),
        ([PLAIN.replace("   4.00000000000e+00", "                 NaN")], {}, "'NaN' is not a number"),
        ([PLAIN.replace("   2.00000000000e+00", "********************")], {}, "is not a number"),
        ([PLAIN.replace("2.00000000000e+00", "2.0000000000e+999")], {}, "beyond double precision"),
        ([PLAIN.replace("2.00000000000e+00", "2.00000 00000e+00")], {}, "is not a number"),
        ([PLAIN.replace("2.00000000000e+00", "2_00000000000e+00")], {}, "is not a number"),
        ([PLAIN.replace("2.00000000000e+00", "2.00000000000+00 ")], {}, "is not a number"),
    ],
)  # fmt: skip
def test_what_the_format_does_not_allow_is_refused_by_name(
    read: Read, rows: list[str], header: dict[str, object], reason: str
) -> None:
    reading = read(set_58(*rows, **header))
    assert (reading.outcomes, reading.contents) == (["refused"], [])
    assert reason in reading.reasons


def binary_58(
    data: bytes, *, order: int = 1, count: int | None = None, tail: bytes = b"", **header: object
) -> bytes:
    lines = header_58(**header)
    size = len(data) if count is None else count
    head = f"    58b{order:6d}{2:6d}{11:12d}{size:12d}{0:6d}{0:6d}{0:12d}{0:12d}\n".encode()
    text = b"".join((x if isinstance(x, bytes) else x.encode()) + b"\n" for x in lines)
    return b"    -1\n" + head + text + data + tail + b"    -1\n"


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize(("kind", "item"), [(5, "f4"), (6, "f8")])
@pytest.mark.parametrize("tail", [b"", b"\n", b"\r\n"])
def test_binary_of_either_order_and_precision(
    read: Read, order: int, kind: int, item: str, tail: bytes
) -> None:
    data = np.array([1, 2, 3, 4], ("<" if order == 1 else ">") + item).tobytes()
    reading = read(binary_58(data, order=order, kind=kind, tail=tail))
    assert (values(reading), reading.notes) == (VALUES, "")
    assert reading.of(Frf)[0].values.dtype == (np.complex64 if kind == 5 else np.complex128)


def test_binary_that_pyuff_wrote_with_its_own_byte_count(tmp_path: Path, read: Read) -> None:
    path, x = tmp_path / "pyuff.uff", np.arange(50.0)
    data = np.exp(1j * x)
    header = {
        "binary": 1,
        "func_type": 4,
        "rsp_node": 1,
        "rsp_dir": 3,
        "ref_node": 2,
        "ref_dir": 3,
        "abscissa_spacing": 1,
    }
    types = {
        "abscissa_spec_data_type": 18,
        "ordinate_spec_data_type": 12,
        "orddenom_spec_data_type": 13,
    }
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)  # pyuff leaves files open
        pyuff.UFF(str(path)).write_sets(
            pyuff.prepare_58(**header, **types, id1="x", x=x, data=data), mode="add"
        )
    reading = read(path.read_bytes())
    np.testing.assert_array_equal(reading.of(Frf)[0].values, data)
    assert "its header declares 400 bytes of data; the 800 bytes" in reading.notes


def test_binary_faults(read: Read) -> None:
    data = np.array([1, 2, 3, 4], "<f8")
    short = read(binary_58(data.tobytes(), points=3)).reasons
    assert short.startswith("line 7 (byte ")
    assert "declares 3 points of 16 bytes but holds 32 bytes" in short
    assert (
        "is 3; only 2 (IEEE 754)"
        in read(binary_58(data.tobytes()).replace(b"1     2  ", b"1     3  ", 1)).reasons
    )
    data[3] = np.nan
    assert (
        "1 points are NaN or infinite, the first is number 2 (at 1)"
        in read(binary_58(data.tobytes())).reasons
    )
    with pytest.raises(UffError, match="no delimiter stands behind them"):
        read(binary_58(data.tobytes(), count=24))


def test_binary_in_the_other_byte_order_than_stated(read: Read) -> None:
    random = np.random.default_rng(1)
    # the latter over ten decades
    for data in (random.standard_normal(400), 10 ** random.uniform(-6.5, 6.5, 400)):
        reading = read(binary_58(data.astype(">f8").tobytes(), order=1, points=200))
        assert "the byte order in its header is wrong" in reading.reasons


def test_numbers_that_are_none_in_the_stated_byte_order_are_in_the_other(read: Read) -> None:
    data = (np.linspace(1.0, 2.0, 64) * (1 + 1j)).astype(">c16").tobytes()
    # read backwards, a NaN
    data = b"".join(data[i : i + 6] + b"\xff\x7f" for i in range(0, len(data), 8))
    reading = read(binary_58(data, points=64))
    assert (
        "its numbers make no sense as little endian, and do the other way round" in reading.reasons
    )


def test_bytes_of_a_delimiter_inside_binary_data(read: Read) -> None:
    data = b"    -1\n " + np.array([2, 3, 4], "<f8").tobytes()
    reading = read(binary_58(data))
    assert reading.outcomes == ["read"]
    assert reading.of(Frf)[0].values.tolist()[1] == 3 + 4j


@pytest.mark.parametrize("encoding", ["utf-8", "cp1252", "latin-1"])
def test_labels_with_umlauts(read: Read, encoding: str) -> None:
    label = "Träger Prüfung ± m/s²".encode(encoding)
    data = dataset(
        "58", *header_58(first=label, ordinate=axis(12, "m/s²".encode(encoding), (1, 0, 0))), PLAIN
    )
    reading = read(data)
    assert reading.of(Frf)[0].label == "Träger Prüfung ± m/s²"
    assert values(reading) == VALUES
    assert reading.notes == ""


@pytest.mark.parametrize(
    ("name", "pad_by_bytes"), [("加速度", True), ("加速度", False), (10 * "加速", False)]
)
def test_unit_label_behind_a_name_of_many_bytes(read: Read, name: str, pad_by_bytes: bool) -> None:
    width = 20 - (len(name.encode()) - len(name) if pad_by_bytes else 0)
    record = f"{12:10d}    1    0    0 {name:<{width}} {'mm/s^2':<20}".encode()
    reading = read(dataset("58", *header_58(ordinate=record), PLAIN))
    assert values(reading) == pytest.approx([x * 1e-3 for x in VALUES], rel=1e-15)


def test_bytes_of_no_encoding_do_no_harm(read: Read) -> None:
    reading = read(dataset("58", *header_58(first=bytes(range(128, 200))), PLAIN))
    assert values(reading) == VALUES


def test_blank_degrees_of_freedom_are_noted_and_what_goes_beyond_the_record_is_refused(
    read: Read,
) -> None:
    lines = header_58()
    sixth = lines[5] if isinstance(lines[5], str) else lines[5].decode()
    reading = read(dataset("58", *lines[:5], sixth[:76], *lines[6:], PLAIN))
    assert reading.of(Frf)[0].reference_direction == 0
    assert "the reference direction is blank, read as 0" in reading.notes
    reading = read(dataset("58", *lines[:5], sixth.ljust(80) + "17", *lines[6:], PLAIN))
    assert "record 6 goes beyond column 80 with '17'" in reading.reasons
    assert "ends inside its 11 header lines" in read(dataset("58", *lines[:9])).reasons
    for kind, name in ((6, "coherence"), (21, "partial coherence"), (26, "multiple coherence")):
        assert read(set_58(PLAIN, function=kind)).notes == f"a {name} with complex ordinates"


def test_a_name_that_runs_over_its_columns_leaves_the_unit_where_two_blanks_part_them(
    read: Read,
) -> None:
    name = axis(0)[:26] + "Beschleunigung Prüfling mit Meißel".encode("cp1252")
    (frf,) = read(set_58(PLAIN, ordinate=name + b"   mm/s")).of(Frf)
    assert (frf.quantity, frf.values.tolist()) == ("mobility", [1e-3 + 2e-3j, 3e-3 + 4e-3j])
    (function,) = read(set_58(PLAIN, function=6, ordinate=name + b" mm/s")).of(Function)
    assert function.unit != "mm/s"  # one blank may be part of the name
    (function,) = read(set_58(PLAIN, function=6, ordinate=name + b"  mm/s  peak")).of(Function)
    assert function.unit == "mm/s  peak"
    # two blanks within the columns part nothing
    wide = axis(0)[:26] + "Kraft  groß".encode().ljust(20) + b" mm/s"
    (function,) = read(set_58(PLAIN, function=6, ordinate=wide)).of(Function)
    assert function.unit == "mm/s"


def test_degrees_of_freedom_fill_their_columns(read: Read) -> None:
    lines = header_58()
    lines[5] = (
        f"{4:5d}{1234567890:10d}{12345:5d}{2000000001:10d}{'N' * 10:>11}{1111111111:10d}{-6:4d}"
        f" {'N' * 10}{2222222:10d}{-5:4d}"
    )
    lines[8], lines[9] = axis(12), axis(13)
    (frf,) = read(dataset("58", *lines, PLAIN)).of(Frf)
    assert (frf.load_case, frf.response_point, frf.response_direction) == (
        2000000001,
        1111111111,
        -6,
    )
    assert (frf.reference_point, frf.reference_direction, frf.dataset) == (2222222, -5, 1)
    assert frf.id_lines == ("FRF", "NONE", "21-Nov-15 09:00:00", "NONE", "NONE")
