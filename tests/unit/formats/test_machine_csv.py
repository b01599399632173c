"""Testing machines' text files: encodings, separators, units, restarts, and what is refused with
its line.
"""

import contextlib
import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from modalbase.formats.errors import FormatError
from modalbase.formats.machine_csv import Column, MachineFile, read_machine_csv

LOAD = {"force": Column("Load", "force"), "strain": Column("Strain", "strain")}


def read(
    text: str, encoding: str = "utf-8", columns: dict[str, Column] | None = None, **options: str
) -> MachineFile:
    return read_machine_csv(text.encode(encoding), LOAD if columns is None else columns, **options)


def test_a_german_export_with_preamble_units_below_and_decimal_commas() -> None:
    text = (
        "Prüfbericht;Ä 12\r\nDatum;21.11.2026\r\n\r\nZeit;Load;Strain\r\ns;kN;µm/m\r\n"
        "0,0;0,000;0,0\r\n0,1;1,250;500,5\r\n\r\n0,2;2,500;1001,0\r\nEnde der Prüfung\r\n"
    )
    parsed = read(text, "cp1252")
    np.testing.assert_allclose(parsed.runs[0].columns["force"], [0, 1250, 2500], rtol=1e-15)
    np.testing.assert_allclose(parsed.runs[0].columns["strain"], [0, 500.5e-6, 1001e-6], rtol=1e-12)
    assert (parsed.encoding, parsed.delimiter, parsed.decimal) == ("cp1252", ";", ",")
    assert (parsed.runs[0].lines[0], parsed.runs[0].lines[-1]) == (6, 9)
    assert parsed.notes == ("line 10: 'Ende der Prüfung' is no data",)


@pytest.mark.parametrize(
    ("encoding", "name"),
    [("utf-8-sig", "utf-8-sig"), ("utf-16", "utf-16"), ("utf-8", "utf-8"), ("cp1252", "cp1252")],
)
def test_encodings_and_inches_and_pounds(encoding: str, name: str) -> None:
    text = "Load (lbf),Strain (µm/m),Ext (in)\n100,1000,0.002\n200,2000,0.004\n"
    columns = {**LOAD, "extension": Column("Ext", "length")}
    parsed = read(text, encoding, columns)
    assert parsed.encoding == name
    np.testing.assert_allclose(
        parsed.runs[0].columns["force"], [444.82216152605, 889.6443230521], rtol=1e-14
    )
    np.testing.assert_allclose(
        parsed.runs[0].columns["extension"], [0.0508e-3, 0.1016e-3], rtol=1e-14
    )
    assert parsed.units == {"force": "lbf", "strain": "µm/m", "extension": "in"}


def test_a_stated_encoding_and_letters_of_full_width() -> None:
    columns = {"force": Column("試験力", "force"), "strain": Column("ひずみ", "strain")}
    text = "試験力（ｋＮ）,ひずみ ［％］\n1,0.1\n2,0.2\n"
    with pytest.raises(FormatError, match=r"nor cp1252 text; .*state its `encoding`"):
        read(text, "shift_jis", columns)
    with pytest.raises(FormatError, match=r"no line has .*; it was read as cp1252: state its"):
        read("Нагрузка (N),Strain (%)\n1,0.1\n", "cp1251", LOAD)
    with pytest.raises(FormatError, match="is stated as gbk, and the file is not"):
        read_machine_csv(b"\xff\xff", columns, encoding="gbk")
    parsed = read_machine_csv(text.encode("shift_jis"), columns, encoding="shift_jis")
    np.testing.assert_allclose(parsed.runs[0].columns["force"], [1000, 2000], rtol=1e-15)
    np.testing.assert_allclose(parsed.runs[0].columns["strain"], [1e-3, 2e-3], rtol=1e-15)
    assert (parsed.encoding, parsed.units) == ("shift_jis", {"force": "kN", "strain": "%"})


UNITS = [
    ("stress", "psi", 6894.757293168361),
    ("stress", "ksi", 6894757.293168361),
    ("stress", "MPa", 1e6),
    ("force", "kN", 1e3),
    ("force", "N", 1.0),
    ("strain", "%", 1e-2),
    ("strain", "mm/mm", 1.0),
    ("strain", "με", 1e-6),  # Greek mu, as some machines write it
    ("length", "mm", 1e-3),
    ("time", "min", 60.0),
]


@pytest.mark.parametrize(("quantity", "unit", "si"), UNITS)
def test_units_stated_by_the_caller_or_by_the_file(quantity, unit: str, si: float) -> None:
    stated = read("x\n2\n3\n", columns={"x": Column("X", quantity, unit)})
    written = read(f"X [{unit}]\n2\n3\n", columns={"x": Column("x", quantity)})
    for parsed in (stated, written):
        np.testing.assert_allclose(parsed.runs[0].columns["x"], [2 * si, 3 * si], rtol=1e-14)


def test_columns_by_number_in_a_file_without_header() -> None:
    columns = {"force": Column(2, "force", "N"), "strain": Column(1, "strain", "%")}
    parsed = read("0.1\t10\n0.2\t20\n", columns=columns)
    np.testing.assert_allclose(parsed.runs[0].columns["force"], [10, 20])
    assert parsed.delimiter == "\t"


def test_a_header_that_comes_again_begins_a_run() -> None:
    half = "Load (N);Strain (%)\n1;0.1\n2;0.2\n"
    parsed = read(half + "\n" + half + "3;0.3\n")
    assert [run.columns["force"].size for run in parsed.runs] == [2, 3]
    assert parsed.notes == ("restarted at line 6",)


def test_time_that_goes_back_begins_a_run() -> None:
    columns = {**LOAD, "time": Column("t", "time")}
    parsed = read(
        "t (s)\tLoad (N)\tStrain (%)\n0\t1\t0\n1\t2\t.1\n0\t1\t0\n1\t3\t.2\n2\t4\t.3\n",
        columns=columns,
    )
    assert [run.columns["time"].tolist() for run in parsed.runs] == [[0, 1], [0, 1, 2]]


def test_empty_cells_are_not_measured_and_counted() -> None:
    parsed = read("Load (N);Strain (%)\n1;0.1\n2;\n")
    assert np.isnan(parsed.runs[0].columns["strain"][1])
    assert parsed.notes == ("1 empty cells, taken as not measured",)


def test_grouped_thousands() -> None:
    assert read('Load (N),Strain (%)\n"1,234.5",0.1\n"12,345.5",0.2\n').runs[0].columns[
        "force"
    ].tolist() == [
        1234.5,
        12345.5,
    ]
    assert read("Load (N);Strain (µε)\n1,234,567;100\n").runs[0].columns["force"].tolist() == [
        1234567
    ]
    assert read("Load (N);Strain (%)\n1.234,5;0,1\n").runs[0].columns["force"].tolist() == [1234.5]
    text = "Load (N);Strain (µε)\n1,234;100\n2,345;200\n"
    with pytest.raises(FormatError, match="state decimal"):
        read(text)
    assert read(text, decimal=",").runs[0].columns["force"].tolist() == [1.234, 2.345]
    assert read(text, decimal=".").runs[0].columns["force"].tolist() == [1234, 2345]


REFUSED = [
    ("Load;Strain (%)\n1;2\n", "stated neither by you nor in the file"),
    ("Load (kg);Strain (%)\n1;2\n", "'kg' is no unit of force"),
    (
        "Load;Strain\nkN;permille\n1;0.1\n2;0.2\n",
        r"columns.strain.unit.*line 2 has 'permille' there",
    ),
    ("Load (N);Strain (mm)\n1;2\n", "'mm' is an elongation, not a strain; state the gauge length"),
    ("Load (kN);Strain (%)\nN;%\n1;2\n", "kN and as N"),
    (
        "Force (N);Strain (%)\n1;2\n",
        "no line has the header Load; its columns are Force \\(N\\), Strain \\(%\\)",
    ),
    ("Load (N);Load (kN);Strain (%)\n1;2;3\n", "twice; give the column's number"),
    ("Load (N);Strain (%)\n1;2\n2;OVER\n", "line 3, column strain: 'OVER' is not a number"),
    ("Load (N);Strain (%)\n1;2\n2\n", "line 3: has 1 cells"),
    ("Load (N),Strain (%)\n1,5,0,1\n", "decimal commas between comma-separated cells"),
    ("Load (N);Strain (%)\n", "no line with a number"),
    ("Load (N);Strain (%)\n1,5;2\n1.5;3\n", "state decimal"),
    ("", "no line has the header"),
    (
        "Load (N);Strain (%)\n1.234,5;1\n1,234.5;2\n",
        "some numbers have a decimal point and some a decimal comma",
    ),
    ("Load (N);Strain (%)\n1.2.3;1\n", "'1.2.3' is not a number with a decimal '.'"),
    ('Load (N);Strain (%)\n"' + "1" * 140_000 + '";1\n', "line 2: cannot be split into cells"),
]


NO_COLUMN = [
    ({"columns": {}}, "columns: names none, expected at least one"),
    ({"columns": {"force": Column(0, "force", "N")}}, "columns: are numbered from 1"),
    ({"decimal": "'"}, 'decimal: is "\'", expected . or ,'),
    ({"delimiter": "|"}, "delimiter: is '|', expected a tab, ; , or a blank"),
]


@pytest.mark.parametrize(("arguments", "message"), NO_COLUMN)
def test_arguments_that_say_nothing_are_refused(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(FormatError, match=re.escape(message)):
        read("Load (N);Strain (%)\n1;2\n", **arguments)


def test_remarks_are_quoted_up_to_twenty_and_what_stands_above_bare_numbers_is_none() -> None:
    parsed = read("Load (N);Strain (%)\n1;2\n" + "Pause;\n" * 23)
    assert (len(parsed.notes), parsed.notes[-1]) == (21, "and 3 more such lines")
    columns = {"force": Column(1, "force", "N"), "strain": Column(2, "strain", "%")}
    parsed = read("Machine A;\n1;2\nEnd;\n", columns=columns)
    assert parsed.notes == ("line 3: 'End' is no data",)


@pytest.mark.parametrize(("text", "message"), REFUSED)
def test_what_is_refused_and_where(text: str, message: str) -> None:
    with pytest.raises(FormatError, match=message):
        read(text)


@pytest.mark.parametrize("data", [b"Load\0(N)", b"\x81\x8d\xff", b"\xff\xfeA"])
def test_what_is_no_text(data: bytes) -> None:
    with pytest.raises(FormatError, match="file"):
        read_machine_csv(data, LOAD)


@settings(max_examples=60)
@given(st.binary(max_size=300))
def test_any_bytes_give_a_result_or_an_input_error(data: bytes) -> None:
    with contextlib.suppress(FormatError):
        assert read_machine_csv(b"Load (N);Strain (%)\n" + data, LOAD).runs


VALUE = st.floats(-1e5, 1e5).map(lambda v: round(v, 4))


@settings(max_examples=60)
@given(
    st.lists(st.tuples(VALUE, VALUE), min_size=1, max_size=20),
    st.sampled_from([("\t", "."), (";", "."), (",", "."), ("\t", ","), (";", ",")]),
    st.sampled_from(["\n", "\r\n", "\r"]),
    st.booleans(),
)
def test_what_is_written_is_read(
    rows: list[tuple[float, float]], style: tuple[str, str], end: str, bom: bool
) -> None:
    delimiter, decimal = style
    body = [delimiter.join(f"{v:.4f}".replace(".", decimal) for v in row) for row in rows]
    text = end.join([f"Load (N){delimiter}Strain (%)", "", *body, ""])
    parsed = read(text, "utf-8-sig" if bom else "utf-8")
    assert len(parsed.runs) == 1
    np.testing.assert_allclose(
        parsed.runs[0].columns["force"], [r[0] for r in rows], rtol=0, atol=0
    )
    np.testing.assert_allclose(
        parsed.runs[0].columns["strain"], [r[1] * 0.01 for r in rows], rtol=1e-15
    )


def test_a_line_of_units_is_read_column_by_column() -> None:
    columns = {"force": Column("Load", "force"), "strain": Column("Strain", "strain", "%")}
    parsed = read_machine_csv(b"Load;Strain\nkN;(lost)\n1;0.1\n2;0.2\n", columns)
    assert parsed.units == {"force": "kN", "strain": "%"}
    assert parsed.runs[0].columns["force"].tolist() == [1000.0, 2000.0]
