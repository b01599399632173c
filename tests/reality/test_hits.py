"""Hits in tables of text as laboratories export them: the same two seconds in each, and variants of
them.
"""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from modalbase.formats.errors import FormatError
from modalbase.formats.records import blocks_of, propose, read_mapping
from modalbase.formats.records.text import TextRecording, open_recording
from modalbase.formats.tables import Stated
from service.platform.errors import Invalid
from service.tasks.import_file.arrays_of_files import FileDescription
from service.tasks.import_file.compute import ReadingInputs, read_upload
from tests.support.lengths import long
from tests.support.places import shared_file

PLACES = {"force": {"point": 1, "direction": 3}, "acceleration": {"point": 2, "direction": 3}}


def found_in(path: Path, mapping: Any = None, *, dry_run: bool = True) -> list[Any]:
    return list(
        read_upload(
            ReadingInputs(path, None, path.name, mapping=mapping, dry_run=dry_run), lambda *_: None
        )
    )


def completed(
    mapping: dict[str, Any], quantities: tuple[str, ...] = ("force", "acceleration")
) -> dict[str, Any]:
    """A proposal, with what it left empty: points, directions, and quantities and units of columns
    without heading.
    """
    channels = [c for c in mapping["channels"] if c["variable"] != "column 1"]
    filled = []
    for channel, quantity in zip(channels, quantities, strict=True):
        what = channel["quantity"] or quantity
        known = {name: value for name, value in channel.items() if value is not None}
        filled.append({**known, "quantity": what, **PLACES[what]})
    return {**mapping, "channels": filled}


NAMES = [
    *map(long, ("hits_plain.csv", "hits_tab.tsv")),
    "hits_semicolon_comma.csv",
    "hits_preamble.csv",
]


@pytest.mark.parametrize("name", NAMES)
def test_a_hit_is_read_by_what_its_file_says(name: str) -> None:
    path = shared_file("REALITY", "reality", name)
    (found,) = found_in(path)
    assert [c["quantity"] for c in found.mapping["channels"]] == ["force", "acceleration"]
    assert all(c["point"] is None and c["direction"] is None for c in found.mapping["channels"])
    check_hit(found_in(path, completed(found.mapping), dry_run=False))


def test_a_hit_without_any_heading_keeps_its_first_line() -> None:
    path = shared_file("REALITY", "reality", "hits_no_heading.tsv")
    (found,) = found_in(path)
    assert (found.table["heading_lines"], found.table["first_line"]) == ([], 1)
    check_hit(found_in(path, completed(found.mapping), dry_run=False))


def check_hit(items: list[Any]) -> None:
    found, force, response = items
    assert isinstance(found, FileDescription)
    assert force.sample_rate_hz == pytest.approx(2048, rel=1e-6)
    assert force.samples.size == 4096
    assert force.samples.max() == pytest.approx(97, abs=2.5)
    hz = np.fft.rfftfreq(4096, 1 / 2048)
    accelerance = np.abs(np.fft.rfft(response.samples) / np.fft.rfft(force.samples))
    assert accelerance[round(31 / hz[1])] == pytest.approx(2.5, rel=0.05)
    peaks = [
        float(
            hz[(hz > f - 10) & (hz < f + 10)][np.argmax(accelerance[(hz > f - 10) & (hz < f + 10)])]
        )
        for f in (31, 87, 142)
    ]
    assert peaks == pytest.approx([31, 87, 142], abs=1)


# --- variants ------------------------------------------------------------------------------------------------------------

RATE, COUNT = 1000.0, 400
TIME = np.arange(COUNT) / RATE
FORCE = 90 * np.exp(-(((TIME - 0.05) / 0.002) ** 2))
ACCELERATION = (
    12 * np.exp(-20 * np.clip(TIME - 0.05, 0, None)) * np.sin(2 * np.pi * 31 * TIME) * (TIME > 0.05)
)
GRAVITY, POUND = 9.80665, 4.4482216152605


def table(
    columns: list[np.ndarray], separator: str, decimal: str = ".", form: str = "%.7f"
) -> list[str]:
    return [
        separator.join(form % value for value in row).replace(".", decimal)
        for row in zip(*columns, strict=True)
    ]


def read(
    tmp_path: Path, lines: list[str], encoding: str = "utf-8", suffix: str = ".csv", **stated: Any
) -> tuple[TextRecording, Any]:
    path = tmp_path / f"hit{suffix}"
    path.write_bytes("\r\n".join([*lines, ""]).encode(encoding))
    (found,) = found_in(path, {"table": stated} if stated else None)
    return open_recording(path, Stated.of(stated or None, "")), found


def require_same(file: TextRecording, found: Any) -> None:
    """The samples in SI, by the units that the file states."""
    variables = file.arrays()
    mapping = read_mapping(completed(found.mapping), file.units)
    force, response = blocks_of(variables, mapping, file.units)
    assert force.sample_rate_hz == pytest.approx(RATE, rel=1e-5)
    np.testing.assert_allclose(force.samples, FORCE, atol=2e-3)
    np.testing.assert_allclose(response.samples, ACCELERATION, atol=2e-3)


HEADINGS = [
    (
        ["ACC (g)", "time_ms", "Hammer [lbf]"],
        None,
        [ACCELERATION / GRAVITY, 1e3 * TIME, FORCE / POUND],
    ),
    (["Time", "Hammer", "ACC"], ["s", "N", "m/s²"], [TIME, FORCE, ACCELERATION]),
    (
        ["Time", "Hammer", "ACC"],
        ["ms", "kN", "mm/s2"],
        [1e3 * TIME, 1e-3 * FORCE, 1e3 * ACCELERATION],
    ),
    (
        ["Zeit", "Kraft", "Beschleunigung"],
        ["[µs]", "[N]", "[g]"],
        [1e6 * TIME, FORCE, ACCELERATION / GRAVITY],
    ),
    (["Temps (s)", "Force (N)", "Accélération (m/s^2)"], None, [TIME, FORCE, ACCELERATION]),
    (["Hammer", "Time", "ACC"], ["(lbf)", "(s)", "(m/s^2)"], [FORCE / POUND, TIME, ACCELERATION]),
]
STYLES = [(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ","), (" ", ",")]
"""Each with one heading; names have spaces too, so every heading is tried with a space."""


@pytest.mark.parametrize(
    ("names", "units", "columns", "separator", "decimal"),
    [
        *((*h, *s) for h, s in zip(HEADINGS, STYLES, strict=True)),
        (*HEADINGS[0], " ", "."),
        *(long(*h, " ", ".") for h in HEADINGS[1:]),
    ],
)
def test_orders_units_and_separators(
    tmp_path: Path,
    names: list[str],
    units: list[str] | None,
    columns: list[np.ndarray],
    separator: str,
    decimal: str,
) -> None:
    lines = [
        separator.join(names),
        *([separator.join(units)] if units else []),
        *table(columns, separator, decimal),
    ]
    file, found = read(tmp_path, lines)
    require_same(file, found)
    assert found.table["decimal"] == decimal


PLAIN = [TIME, FORCE, ACCELERATION]


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "cp1252"])
def test_encodings(tmp_path: Path, encoding: str) -> None:
    lines = [
        "Prüfstand: Müller",
        "",
        "Zeit;Kraft;Beschleunigung",
        "ms;N;m/s²",
        *table([1e3 * TIME, FORCE, ACCELERATION], ";", ","),
    ]
    file, found = read(tmp_path, lines, encoding)
    require_same(file, found)
    assert found.table["encoding"] in (encoding, "utf-16")


SURROUNDED = {
    "preamble of pairs": (["File;a.dat", "Channels;3", "Operator;K. Beck", ""], [], ";", ";".join),
    "trailing separators": ([], [], ";", lambda cells: ";".join([*cells, ""])),
    "quoted cells": ([], [], ",", lambda cells: ",".join(f'"{cell}"' for cell in cells)),
    "footer": ([], ["", "End of measurement", "Max;97;12"], ";", ";".join),
    "comments": (["# measured in June", "# 3 channels"], ["# end"], "\t", "\t".join),
    "text column": ([], [], ";", lambda cells: ";".join([*cells, "ok"])),
    "blank lines": (["", ""], ["", ""], "\t", "\t".join),
}


@pytest.mark.parametrize("kind", SURROUNDED)
def test_what_stands_around_the_columns(tmp_path: Path, kind: str) -> None:
    above, below, separator, row = SURROUNDED[kind]
    names = ["Time (s)", "Hammer (N)", "ACC (m/s²)"]
    body = [row(line.split(separator)) for line in table(PLAIN, separator)]
    half = len(body) // 2
    middle = ["", ""] if kind == "blank lines" else []
    file, found = read(tmp_path, [*above, row(names), *body[:half], *middle, *body[half:], *below])
    require_same(file, found)


@pytest.mark.parametrize("sign", ["#", "%", "# "])
def test_a_heading_may_be_a_comment(tmp_path: Path, sign: str) -> None:
    lines = [
        f"{sign}first run",
        f"{sign}time_s force_N acc_g",
        *table([TIME, FORCE, ACCELERATION / GRAVITY], " ", ".", "%.8e"),
    ]
    require_same(*read(tmp_path, lines, suffix=".txt"))


def stamp(seconds: float, form: str) -> str:
    total = 36_000 * 2.4 - 0.1 + seconds  # over midnight
    day, rest = divmod(total, 86_400)
    hours, minutes = divmod(int(rest) // 60, 60)
    return form.format(day=3 + int(day), clock=f"{hours:02d}:{minutes:02d}:{rest % 60:09.6f}")


@pytest.mark.parametrize(
    ("form", "separator", "decimal"),
    [
        ("{clock}", ";", ","),
        ("{clock}", ",", "."),
        ("2024-03-{day:02d} {clock}", "\t", "."),
        ("2024-03-{day:02d}T{clock}Z", ",", "."),
        ("{day:02d}.03.2024 {clock}", ";", ","),
    ],
)
def test_time_stamps_are_a_time_axis(
    tmp_path: Path, form: str, separator: str, decimal: str
) -> None:
    stamps = [stamp(t, form) for t in TIME.tolist()]
    stamps = [s.rpartition(".")[0] + decimal + s.rpartition(".")[2] for s in stamps]
    body = [
        f"{s}{separator}{rest}"
        for s, rest in zip(stamps, table(PLAIN[1:], separator, decimal), strict=True)
    ]
    require_same(*read(tmp_path, [separator.join(("Time", "Hammer (N)", "ACC (m/s²)")), *body]))


def test_a_rate_in_the_preamble_stands_for_a_time_axis(tmp_path: Path) -> None:
    for first in (
        "Sample rate;1000,0",
        "Sampling rate (kHz);1,0",
        "Delta_X;0,001",
        "Abtastrate: 1000 Hz",
    ):
        lines = [first, "", "Hammer (N);ACC (m/s²)", *table(PLAIN[1:], ";", ",")]
        file, found = read(tmp_path, lines)
        assert found.mapping["sample_rate_hz"] == {"variable": "sample_rate_hz"}
        require_same(file, found)


def lvm(columns: str, decimal: str, rows: list[str], names: str) -> list[str]:
    return [
        "LabVIEW Measurement\t", "Writer_Version\t2", "Reader_Version\t2", "Separator\tTab",
        f"Decimal_Separator\t{decimal}", "Multi_Headings\tNo", f"X_Columns\t{columns}", "Time_Pref\tAbsolute",
        "Date\t2024/03/03", f"Time\t10:00:00{decimal}1234567", "***End_of_Header***\t", "\t", "Channels\t2\t\t",
        "Samples\t400\t400\t", "Date\t2024/03/03\t2024/03/03\t", "Y_Unit_Label\tN\tg\t", "X_Dimension\tTime\tTime\t",
        f"X0\t0{decimal}0E+0\t0{decimal}0E+0\t", f"Delta_X\t0{decimal}001000\t0{decimal}001000\t",
        "***End_of_Header***\t\t\t", names, *rows,
    ]  # fmt: skip


@pytest.mark.parametrize("decimal", [".", ","])
@pytest.mark.parametrize("columns", ["One", "No"])
def test_labview_measurement_files(tmp_path: Path, columns: str, decimal: str) -> None:
    rows = table([TIME, FORCE, ACCELERATION / GRAVITY], "\t", decimal, "%.7f")
    if columns == "No":
        rows = ["\t" + row.partition("\t")[2] for row in rows]
    file, found = read(
        tmp_path, lvm(columns, decimal, rows, "X_Value\tHammer\tACC\tComment"), suffix=".lvm"
    )
    assert file.units["ACC"] == "g"
    require_same(file, found)


def test_two_lines_of_names_where_one_does_not_tell_columns_apart(tmp_path: Path) -> None:
    lines = [
        "Time;Hammer;ACC",
        "Value;Value;Value",
        "s;N;g",
        *table([TIME, FORCE, ACCELERATION / GRAVITY], ";"),
    ]
    file, found = read(tmp_path, lines)
    assert file.names == ["Time Value", "Hammer Value", "ACC Value"]
    require_same(file, found)


REFUSED = [
    (
        ["Hammer;ACC", *["1,234;2,345"] * 70],
        "may be a decimal comma or grouped thousands; state decimal",
    ),
    (["Hammer,ACC", *["0,003456,1,234567"] * 70], r"line 2: .*4|decimal commas between comma"),
    (["0,003456,1,234567"] * 70, "line 1: .*may have decimal commas between commas"),
    (
        ["Time;Hammer", *["1.0;2.0"] * 70, "1.0;OVER", "1.0;2.0"],
        "line 72, Hammer: 'OVER' is no number",
    ),
    (
        ["Time;Hammer", *["1.0;2.0"] * 70, "pause", *["1.0;2.0"] * 70],
        "line 72: 'pause' is no row of the table, and data follow",
    ),
    (["Time;Hammer;ACC", *["1.0;2.0;3.0"] * 70, "1.0;2.0"], "line 72: has 2 cells, .*was it cut"),
    (["nothing", "but words"], "no line of it holds numbers in columns"),
    ([], "it is empty|holds no"),
]


@pytest.mark.parametrize(("lines", "why"), REFUSED)
def test_what_is_refused_names_its_line_and_the_way(
    tmp_path: Path, lines: list[str], why: str
) -> None:
    path = tmp_path / "hit.csv"
    path.write_text("\n".join(lines))
    with pytest.raises(Invalid, match=why) as refused:
        found_in(path)
    assert not any(word in str(refused.value) for word in ("float(", "codec", "Error", "None"))


def test_what_a_table_leaves_open_can_be_stated(tmp_path: Path) -> None:
    lines = ["Time;Hammer;ACC", *[f"{i};{i},234;2,34{i % 10}" for i in range(1, 100)]]
    file, found = read(tmp_path, lines, decimal=",")
    assert file.arrays()["Hammer"][0] == 1.234
    assert found.table["decimal"] == ","
    with pytest.raises(Invalid, match=r"table.decimal|decimal.*expected"):
        read(tmp_path, lines, decimal="'")
    with pytest.raises(Invalid, match="is unknown; it has separator"):
        read(tmp_path, lines, comma=True)


@pytest.mark.parametrize(
    ("keep", "has", "lacks"), [(1, "force", "a response"), (2, "acceleration", "a force")]
)
def test_force_and_response_in_two_files_belong_in_one(
    tmp_path: Path, keep: int, has: str, lacks: str
) -> None:
    heading = ["Time (s);Hammer (N)", "", "Time (s);ACC (m/s²)"]
    lines = [heading[keep * 2 - 2], *table([TIME, PLAIN[keep]], ";")]
    file, found = read(tmp_path, lines)
    assert f"the file holds {has} alone; all channels of a hit belong in one file" in found.notes[0]
    mapping = completed(found.mapping, (has,))
    with pytest.raises(
        FormatError,
        match=f"mapping.channels: lack {lacks}; all channels of a hit belong in one file",
    ):
        read_mapping(mapping, file.units)


def test_a_contradictory_unit_is_refused_with_both(tmp_path: Path) -> None:
    file, found = read(tmp_path, ["Time;Hammer (lbf);ACC (g)", "s;N;g", *table(PLAIN, ";")])
    mapping = completed(found.mapping)
    mapping["channels"][0]["unit"] = None
    with pytest.raises(Exception, match="'N' and 'lbf'"):
        read_mapping(mapping, file.units)


def test_a_long_recording_is_read_part_by_part(tmp_path: Path) -> None:
    hit = np.tile(FORCE, 12)
    time, response = np.arange(hit.size) / RATE, np.tile(ACCELERATION, 12)
    path = tmp_path / "tour.txt"
    path.write_text(
        "\n".join(
            [
                "Time (s);Hammer (N);ACC (g)",
                *table([time, hit, response / GRAVITY], ";", ",", "%.6f"),
            ]
        )
    )
    (found,) = found_in(path)
    assert "recording" in found.mapping
    mapping = completed(found.mapping)
    blocks = found_in(path, json.loads(json.dumps(mapping)), dry_run=False)
    assert blocks[0].table["decimal"] == ","
    assert {b.quantity for b in blocks[1:]} == {"force", "acceleration"}
    assert len(blocks) >= 1 + 2 * 9
    assert max(
        float(np.abs(b.samples).max()) for b in blocks[1:] if b.quantity == "acceleration"
    ) == pytest.approx(float(np.abs(ACCELERATION).max()), rel=0.01)


def test_a_proposal_of_a_table_without_names_says_no_quantity(tmp_path: Path) -> None:
    file, found = read(tmp_path, table(PLAIN, "\t"))
    assert propose(file.arrays(), file.units) == found.mapping
    assert all(c["quantity"] is None for c in found.mapping["channels"])
    assert math.isfinite(file.arrays()["column 3"].sum())


def test_settings_between_units_and_data_are_no_names(tmp_path: Path) -> None:
    above = ["Channels: 3", "Zeit 1 - Standardmessrate\tHammer\tACC 1", "s\tN\tg"]
    below = ["50 Hz\t1000 Hz\t1000 Hz", "SENSOR=a\tb\tc"]
    file, found = read(
        tmp_path, [*above, *below, *table([TIME, FORCE, ACCELERATION / GRAVITY], "\t", ",")]
    )
    assert (found.table["heading_lines"], found.table["units_line"]) == ([2], 3)
    require_same(file, found)


def test_a_line_that_says_one_unit_is_none_of_columns(tmp_path: Path) -> None:
    lines = ["X-Unit: s", "Y-Unit: N ; g", "Time;Force;Accel", *table(PLAIN, ";")]
    _, found = read(tmp_path, lines)
    assert [(c["variable"], c["unit"]) for c in found.mapping["channels"]] == [
        ("Force", None),
        ("Accel", None),
    ]


@pytest.mark.parametrize("name", ["X [s]", "Timestamp", "Zeitstempel (s)"])
def test_the_time_is_known_by_its_unit_or_name(tmp_path: Path, name: str) -> None:
    numbers = np.arange(1.0, COUNT + 1)
    lines = [f"Line;{name};Hammer (N);ACC (m/s²)", *table([numbers, *PLAIN], ";")]
    file, found = read(tmp_path, lines)
    assert found.mapping["sample_rate_hz"] == {"variable": name}
    require_same(file, found)


@pytest.mark.parametrize(
    ("heading", "listed"),
    [
        ("Var1;Var2;Var3", [("Var1", None), ("Var2", None), ("Var3", None)]),
        ("Time;Force [N];Roof [V]", [("Force [N]", "force"), ("Roof [V]", None)]),
        ("Time;Force [N];Roof", [("Force [N]", "force"), ("Roof", None)]),
    ],
)
def test_columns_of_which_nothing_is_known_are_asked_for(
    tmp_path: Path, heading: str, listed: list[Any]
) -> None:
    _, found = read(tmp_path, [heading, *table(PLAIN, ";")])
    assert [(c["variable"], c["quantity"]) for c in found.mapping["channels"]] == listed


@pytest.mark.parametrize(
    "rate", ["Sample Rate;1000 S/s", "Sample Rate;1 kS/s", "Scan rate: 1000 scans/sec"]
)
def test_samples_a_second_are_a_rate(tmp_path: Path, rate: str) -> None:
    require_same(*read(tmp_path, [rate, "Hammer (N);ACC (m/s²)", *table(PLAIN[1:], ";")]))


def test_two_rates_of_columns_are_none_of_the_table(tmp_path: Path) -> None:
    for second, proposed in (("2048", {"variable": "sample_rate_hz"}), ("1024", None)):
        lines = [f"Sample rate;2048;{second}", "Hammer (N);ACC (g)", *table(PLAIN[1:], ";")]
        _, found = read(tmp_path, lines)
        assert found.mapping.get("sample_rate_hz") == proposed


def test_a_gap_in_the_time_axis_is_named(tmp_path: Path) -> None:
    lines = table(PLAIN, ";")
    lines[9] = "NaN;0;0"
    file, found = read(tmp_path, ["Time (s);Hammer (N);ACC (g)", *lines])
    assert found.mapping["sample_rate_hz"] == {"variable": "Time (s)"}
    with pytest.raises(
        FormatError, match="row 10 of the data has no number; state the rate as a number"
    ):
        blocks_of(file.arrays(), read_mapping(completed(found.mapping), file.units), file.units)


def test_the_sensitivity_that_a_refusal_advises_is_taken(tmp_path: Path) -> None:
    file, found = read(
        tmp_path, ["Time (s);Hammer (N);ACC (mV)", *table([*PLAIN[:2], 10 * ACCELERATION], ";")]
    )
    mapping = completed(found.mapping)
    with pytest.raises(FormatError, match=r'such as "2.25 mV/\(m/s²\)"'):
        read_mapping(mapping, file.units)
    mapping["channels"][1]["sensitivity"] = "10 mV/(m/s²)"
    _, response = blocks_of(file.arrays(), read_mapping(mapping, file.units), file.units)
    np.testing.assert_allclose(response.samples, ACCELERATION, atol=2e-3)


TWO_AXES = ["Time 1 (s);Force (N);Time 2 (s);Acc (ms-2)", "X_Value;Hammer (N);X_Value;Acc (ms-2)"]


@pytest.mark.parametrize("heading", TWO_AXES)
@pytest.mark.parametrize(("late", "rate"), [(0.0, 1.0), (0.01, 1.0), (0.0, 0.5)])
def test_channels_on_two_clocks_are_refused(
    tmp_path: Path, heading: str, late: float, rate: float
) -> None:
    """The second begins later, or has half the rate and ends at the middle of the table."""
    path = tmp_path / "two.csv"
    rows = (
        f"{k / 2048};{float(k == 40)};"
        + (f"{late + k / 2048 / rate};{k % 7}.5" if k < 256 * rate else ";")
        for k in range(256)
    )
    path.write_text("\n".join([heading, *rows]))
    (found,) = found_in(path)
    mapping = completed(found.mapping)
    assert len(mapping["channels"]) == 2
    if (late, rate) == (0.0, 1.0):
        (force, response) = found_in(path, mapping, dry_run=False)[1:]
        assert force.samples.size == response.samples.size == 256
        return
    with pytest.raises(Invalid, match="export them on one time axis"):
        found_in(path, mapping, dry_run=False)


def test_a_slow_group_beside_takes_no_rows_away(tmp_path: Path) -> None:
    path = tmp_path / "slow.csv"
    rows = (
        f"{k / 2048};{float(k == 3)};{k % 7}.5;" + (f"{k / 10};20.5" if k < 5 else ";")
        for k in range(64)
    )
    path.write_text("\n".join(["Zeit 1 [s];Kraft [N];Beschl [m/s²];Zeit 2 [s];Temp [°C]", *rows]))
    (found,) = found_in(path)
    assert found.table["first_line"] == 2
    mapping = completed({**found.mapping, "channels": found.mapping["channels"][:2]})
    force, response = found_in(path, mapping, dry_run=False)[1:]
    assert (force.samples.size, force.samples[3], response.samples[1]) == (64, 1.0, 1.5)


BESIDE = [  # what a table states beside a hit, and what is refused or noted
    ("Scale;1;10;1\nTime (s);Hammer (N);Acc (g)", r"channels/0/unit: is 'N \(Scale = 10\)'.*, '10\*N'"),
    ("Offset;0;0;5\nTime (s);Hammer (N);Acc (g)", r"channels/1/unit: is 'g \(Offset = 5\)'"),
    ("Gain;1;1;1\nTime (s);Hammer (N);Acc (g)", ""),
    ("Time (s);Hammer (x10) (N);Acc (g)", r"channels/0/unit: is 'N \(x10\)'"),
    ("Time (s);-Hammer (N);Acc (g)", r"channels/0/unit: is 'N \(inverted\)'"),
    ("Time (s);-Z Hammer (N);Acc x12 (g)", ""),
    ("Sample rate: 4096 Hz\nTime (s);Hammer (N);Acc (g)", "sample_rate_hz: is 2048 by .*, and the preamble states 4096"),
    ("Number of samples: 4096\nTime (s);Hammer (N);Acc (g)", "note: the table has 512: was it cut?"),
    ("Window: Exponential, 5 1/s\nTime (s);Hammer (N);Acc (g)", "note: window_rate_per_s"),
]  # fmt: skip


@pytest.mark.parametrize(("heading", "outcome"), BESIDE)
def test_what_stands_beside_a_hit_counts(tmp_path: Path, heading: str, outcome: str) -> None:
    path, t = tmp_path / "hit.csv", np.arange(512) / 2048
    table = np.stack([t, 90 * np.exp(-(((t - 0.125) / 1e-3) ** 2)), np.sin(200 * t)], axis=1)
    path.write_text("\n".join([heading, *(";".join(map(repr, row)) for row in table.tolist())]))
    (found,) = found_in(path)
    mapping = completed(found.mapping)
    if outcome and not outcome.startswith("note"):
        with pytest.raises(Invalid, match=outcome):
            found_in(path, mapping, dry_run=False)
        mapping |= {"sample_rate_hz": 2048}
        for channel, unit in zip(mapping["channels"], ("N", "g"), strict=True):
            channel["unit"] = unit
    found, force, _ = found_in(path, mapping, dry_run=False)
    assert force.samples.max() == pytest.approx(90, rel=1e-3)
    assert outcome.removeprefix("note: ") in "; ".join(found.notes) or outcome[:4] != "note"
