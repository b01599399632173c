"""FRFs as laboratories send them: axes, units, points and gaps that a file states count, and what
it lacks is asked for.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

from fecore.errors import InputError
from fecore.modal import Identification
from modalbase.formats.dof_names import dof_in_name
from modalbase.formats.uff import DatasetReport
from service.platform.errors import Invalid
from service.tasks.import_file.arrays_of_files import FileDescription
from service.tasks.import_file.compute import Kept
from tests.support.reality import frfs_in, identified, kept, lines_of, reality, values_of
from tests.support.uff import FRF, axis, load, rows, set_58

HZ = (31.0, 87.0, 142.0)
ZETA = (0.010, 0.008, 0.012)


def requires_modes(found: Identification, zeta: tuple[float, ...] | None = ZETA) -> None:
    np.testing.assert_allclose(found.modes.frequency_hz, HZ, rtol=2e-4)
    if zeta is not None:
        np.testing.assert_allclose(found.modes.damping_ratio, zeta, rtol=0.02)


@pytest.mark.parametrize(
    "name",
    [
        "frf_flipped_point3",
        "frf_huge_1e36",
        "frf_mixed_g_velocity",
        "frf_rad_s",
        "frf_start_25Hz",
        "frf_two_df",
    ],
)
def test_what_is_right_stays_right(name: str) -> None:
    items = kept(reality(f"{name}.unv"))
    assert len(frfs_in(items)) == 5
    assert all(np.isfinite(values_of(frf)).all() for frf in frfs_in(items))
    found = identified(items)
    requires_modes(found)
    assert {dof.point for dof in found.modes.dofs} == {1, 2, 3, 4, 5}


def test_a_flipped_driving_point_is_warned_of() -> None:
    found = identified(kept(reality("frf_flipped_driving_point.unv")))
    requires_modes(found)
    assert any("driving point 1Z/1Z" in warning for warning in found.warnings)


def test_points_and_directions_in_names_alone_are_read() -> None:
    items = kept(reality("uff_named_dofs.unv"))
    dofs = [
        (f.response_point, f.response_direction, f.reference_point, f.reference_direction)
        for f in frfs_in(items)
    ]
    assert dofs == [(point, 3, 1, -3) for point in (1, 2, 3, 4, 5)]
    assert all("by its name '.1.Z-'" in notes_of(items, number) for number in range(1, 6))
    requires_modes(identified(items))


def test_a_last_row_that_is_filled_up_is_read() -> None:
    items = kept(reality("uff_padded_last_row.unv"))
    assert [frf.axis.count for frf in frfs_in(items)] == [397, 398]
    assert "filled up with zeros" in notes_of(items, 1)
    requires_modes(identified(items))


def test_a_line_at_0_hz_that_is_no_number_is_left_out() -> None:
    items = kept(reality("frf_nan_at_0Hz.unv"))
    assert [(f.axis.start_hz, f.axis.count) for f in frfs_in(items)] == [(0.5, 400)] * 5
    assert "its value at 0 Hz is NaN or infinite: this line is left out" in notes_of(items, 3)
    requires_modes(identified(items))


def test_an_axis_of_start_and_increment_and_the_texts_beside_it_are_used() -> None:
    path = reality("lms_testlab_frf.mat")
    mapping = proposed(path)
    (frf,) = frfs_in(kept(path, mapping))
    assert (
        frf.response_point,
        frf.response_direction,
        frf.reference_point,
        frf.reference_direction,
    ) == (2, 3, 1, 3)
    assert (frf.quantity, frf.axis.start_hz, frf.axis.step_hz, frf.axis.count) == (
        "accelerance",
        0.0,
        0.5,
        401,
    )
    size = np.abs(values_of(frf))
    peaks = 1 + np.flatnonzero((size[1:-1] > size[:-2]) & (size[1:-1] > size[2:]))
    np.testing.assert_allclose(lines_of(frf)[peaks], HZ)
    stated = {**mapping, "frequency_hz": {"start": 0, "step": 0.5}}
    np.testing.assert_array_equal(values_of(frfs_in(kept(path, stated))[0]), values_of(frf))
    bare = {name: value for name, value in stated.items() if name != "unit"}
    # the file's own unit counts
    assert values_of(frfs_in(kept(path, bare))[0])[62] == values_of(frf)[62]
    assert "is mobility, and the unit 'g/N' is that of accelerance" in refused(
        path, mapping, quantity="mobility"
    )
    assert "is 1, and the unit 'g/N' makes it 9.80665" in refused(path, {**bare, "factor": 1.0})
    assert "is 'm/s2/N', and the file says 'g/N'" in refused(path, {**mapping, "unit": "m/s2/N"})


def test_a_matrix_asks_for_its_three_points() -> None:
    path = reality("frf_matrix.mat")
    mapping = proposed(path)
    assert mapping["response_point"] == [None, None, None]
    assert [mapping[f"{side}_direction"] for side in ("response", "reference")] == [None, None]
    fault = refused(path, mapping, quantity="receptance")
    assert all(
        f"/mapping/{side}_{what}: is empty" in fault
        for side in ("response", "reference")
        for what in ("point", "direction")
    )
    stated = {**mapping, "response_direction": 3, "reference_point": 1, "reference_direction": 3}
    fault = refused(path, {**stated, "response_point": 1}, quantity="receptance")
    assert "one degree of freedom for 3 FRFs; state a list of their 3 points" in fault
    items = kept(path, {**stated, "response_point": [1, 2, 3]}, quantity="receptance")
    assert [frf.response_point for frf in frfs_in(items)] == [1, 2, 3]
    assert isinstance(items[0], FileDescription)
    assert any("taken in Hz" in note for note in items[0].notes)
    requires_modes(identified(items))


def proposed(path: Path) -> dict[str, Any]:
    (found,) = kept(path, dry_run=True)
    assert isinstance(found, FileDescription)
    return found.mapping


def refused(path: Path, mapping: Any, **stated: Any) -> str:
    with pytest.raises(Invalid) as raised:
        kept(path, mapping, **stated)
    return "; ".join(f"{fault.pointer}: {fault.detail}" for fault in raised.value.faults)


def notes_of(items: list[Kept], number: int) -> str:
    return "; ".join(
        next(i for i in items if isinstance(i, DatasetReport) and i.number == number).notes
    )


# --- variants that are made here
# --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "dof"),
    [
        ("1Z-", (1, -3)),
        (".56.Z", (56, 3)),
        (".k.Z", None),
        ("Point56:+Z", (56, 3)),
        ("P12 -X", (12, -1)),
        ("P:2:+Z", (2, 3)),
        ("7 y", (7, 2)),
        ("node_3_RX-", (3, -4)),
        ("12-X", None),
        ("+3Z-Z", None),
        ("0Z", None),
        ("wing1:12:+Z", None),
        ("NONE", None),
        ("3", None),
        ("", None),
    ],
)
def test_names_of_degrees_of_freedom(name: str, dof: tuple[int, int] | None) -> None:
    assert dof_in_name(name) == dof


def named(
    response: str, reference: str, numbers: tuple[int, int, int, int] = (0, 0, 0, 0)
) -> bytes:
    """An FRF whose record 6 has these names and numbers."""
    whole = set_58(
        *rows(np.arange(1.0, 9.0)), kind=6, points=4, response=numbers[:2], reference=numbers[2:]
    )
    begin = whole.index(b"    4         0")
    places = zip((response, reference), (numbers[:2], numbers[2:]), strict=True)
    row = f"{4:5d}{0:10d}{0:5d}{0:10d}" + "".join(
        f" {name:<10}{p:10d}{d:4d}" for name, (p, d) in places
    )
    return whole[:begin] + row.encode() + whole[whole.index(b"\n", begin) :]


@pytest.mark.parametrize(
    ("names", "numbers", "dofs", "note"),
    [
        (
            ("Point56:+Z", "1Z-"),
            (0, 0, 0, 0),
            (56, 3, 1, -3),
            "its response is 56 +Z by its name 'Point56:+Z'",
        ),
        (("P12 -X", ".1.Y"), (12, 0, 0, 0), (12, -1, 1, 2), "by its name"),
        (("1Z-", "2Z"), (7, 3, 1, -3), (7, 3, 1, -3), "the numbers are used"),
        (
            ("NONE", "NONE"),
            (0, 0, 1, 3),
            (0, 0, 1, 3),
            "its response has no point and no direction",
        ),
    ],
)
def test_numbers_of_record_6_count_and_names_fill_in(
    tmp_path: Path,
    names: tuple[str, str],
    numbers: tuple[int, int, int, int],
    dofs: tuple[int, ...],
    note: str,
) -> None:
    path = tmp_path / "named.unv"
    path.write_bytes(named(*names, numbers))
    found = load(path)
    frf: Any = found.contents[0]
    assert (
        frf.response_point,
        frf.response_direction,
        frf.reference_point,
        frf.reference_direction,
    ) == dofs
    assert note in found.notes


def test_a_name_against_half_a_number_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "named.unv"
    path.write_bytes(named("12X", "1Z", (7, 0, 1, 3)))
    found = load(path)
    assert found.contents == []
    assert "is 7 0 by the numbers of record 6, and '12X' by its name" in found.reasons


def padded(tail: str, points: int = 4) -> bytes:
    """Four complex single values and something behind them in their row."""
    numbers = (
        "".join(f"{v:13.5e}" for v in range(1, 7))
        + "\n"
        + "".join(f"{v:13.5e}" for v in (7, 8))
        + tail
    )
    return set_58(*numbers.split("\n"), kind=5, points=points)


@pytest.mark.parametrize(
    ("tail", "outcome"),
    [
        ("", "read"),
        (" " * 26, "read"),
        ("".join(f"{0.0:13.5e}" for _ in range(4)), "read"),
        (f"{0.0:13.5e}{-0.0:13.5e}", "read"),
        ("  0.00000D+00  0.00000D+00", "read"),
        ("".join(f"{v:13.5e}" for v in (0, 0, 0, 9)), "refused"),
        ("".join(f"{0.0:13.5e}" for _ in range(5)), "refused"),
        ("          NaN          NaN", "refused"),
    ],
)
def test_a_row_is_filled_up_with_blanks_or_zeros_alone(
    tmp_path: Path, tail: str, outcome: str
) -> None:
    path = tmp_path / "padded.unv"
    path.write_bytes(padded(tail))
    found = load(path)
    assert found.outcomes == [outcome], found.reasons
    if outcome == "read":
        content: Any = found.contents[0]
        assert content.values.tolist() == [1 + 2j, 3 + 4j, 5 + 6j, 7 + 8j]


@pytest.mark.parametrize("token", ["NaN", "nan", "-NaN", "Inf", "-Infinity", "1.#QNAN", "-1.#IND"])
@pytest.mark.parametrize("even", [1, 0])
def test_a_gap_is_left_out_at_0_hz_alone(tmp_path: Path, token: str, even: int) -> None:
    path = tmp_path / "gap.unv"
    parts = [[] if even else [0.0], [] if even else [0.5]]

    def file(first: list[Any], second: list[Any], start: str = "0.0") -> Any:
        cells = [*parts[0], *first, *parts[1], *second]
        row = "".join(f"{cell:>13}" if isinstance(cell, str) else f"{cell:13.5e}" for cell in cells)
        path.write_bytes(set_58(row, kind=5, points=2, even=even, start=start, step="0.5"))
        return load(path)

    found = file([token, token], [3.0, 4.0])
    assert (found.contents[0].frequency.points().tolist(), found.contents[0].values.tolist()) == (
        [0.5],
        [3 + 4j],
    )
    assert "its value at 0 Hz is NaN or infinite" in found.notes
    assert file([token, 0.0], [3.0, 4.0]).contents[0].values.size == 1
    assert file([1.0, 2.0], [token, 4.0]).outcomes == ["refused"]
    if even:
        assert (
            "only one at 0 Hz can be left out"
            in file([token, token], [3.0, 4.0], start="2.0").reasons
        )


def test_a_coherence_keeps_to_an_frf_without_its_first_line(tmp_path: Path) -> None:
    """Both without it, as both are no number there."""
    path = tmp_path / "both.unv"
    frf = set_58(f"{'NaN':>13}{'NaN':>13}{1.0:13.5e}{2.0:13.5e}", kind=5, points=2)
    coherence = set_58(f"{'NaN':>13}{0.9:13.5e}", kind=2, points=2, function=6)
    path.write_bytes(frf + coherence)
    found = load(path)
    assert found.outcomes == ["read", "read"], found.reasons
    lines: list[Any] = found.contents
    assert [content.values.size for content in lines] == [1, 1]


@pytest.mark.parametrize("unit", ["V", "mV"])
def test_volts_of_a_uff_are_refused(tmp_path: Path, unit: str) -> None:
    path = tmp_path / "volts.unv"
    samples = rows(np.arange(1.0, 9.0))
    path.write_bytes(
        set_58(
            *samples, kind=4, points=8, function=1, abscissa=axis(17, "s"), ordinate=axis(12, unit)
        )
        + set_58(*rows(np.arange(1.0, 9.0)), points=4, ordinate=axis(12, unit))
    )
    found = load(path)
    assert found.outcomes == ["refused", "refused"]
    assert f"its ordinate is in '{unit}', and a UFF file states no sensitivity" in found.reasons


LINES = np.arange(1.0, 65.0)
VALUES = np.exp(1j * LINES) * np.array([[1.0], [2.0]])
DOFS = {
    "response_point": [4, 5],
    "response_direction": 3,
    "reference_point": 1,
    "reference_direction": -3,
}


def saved(folder: Path, **arrays: Any) -> Path:
    savemat(path := folder / "frfs.mat", arrays)
    return path


@pytest.mark.parametrize(
    ("names", "parts"),
    [(("start_value", "increment"), "x_values"), (("f0", "df"), "axis"), (("x0", "dx"), "head")],
)
def test_even_axes_by_other_names_are_proposed(
    tmp_path: Path, names: tuple[str, str], parts: str
) -> None:
    path = saved(tmp_path, m={parts: {names[0]: 1.0, names[1]: 1.0}, "H": VALUES.T})
    mapping = proposed(path)
    start, step = ({"variable": f"m.{parts}.{name}"} for name in names)
    assert mapping["frequency_hz"] == {"start": start, "step": step}
    items = kept(path, {**mapping, **DOFS}, quantity="mobility")
    for frf, values in zip(frfs_in(items), VALUES, strict=True):
        np.testing.assert_array_equal(lines_of(frf), LINES)
        np.testing.assert_array_equal(values_of(frf), values)


def test_units_in_texts_and_names_of_a_mat(tmp_path: Path) -> None:
    path = saved(
        tmp_path, m={"omega": LINES, "H": VALUES.T, "H_unit": "mm/s^2/N", "omega_unit": "rad/s"}
    )
    mapping = proposed(path)
    assert (mapping["frequency_hz"], mapping["unit"]) == (
        {"variable": "m.omega", "unit": "rad/s"},
        "mm/s^2/N",
    )
    frf = frfs_in(kept(path, {**mapping, **DOFS}))[0]
    assert frf.quantity == "accelerance"
    np.testing.assert_allclose(lines_of(frf), LINES / 2 / np.pi, rtol=1e-12)
    np.testing.assert_allclose(values_of(frf), VALUES[0] * 1e-3, rtol=1e-12)
    hz = {**mapping, **DOFS, "frequency_hz": {"variable": "m.omega", "unit": "Hz"}}
    assert "is 'Hz', and the file says 'rad/s'" in refused(path, hz)


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"unit": "furlong/N"}, "is 'furlong/N', which is no response over a force"),
        ({"unit": "g"}, "is 'g', which is no response over a force"),
        ({"unit": 5}, "expected the text of a unit"),
        ({"unit": "g/N", "factor": 2}, "is 2, and the unit 'g/N' makes it 9.80665"),
        ({"frequency_hz": {"start": 0, "step": 0}}, "has no step above 0"),
        ({"frequency_hz": {"start": 0}}, 'expected {"variable": name} or {"start": …, "step": …}'),
        ({"frequency_hz": {"start": 0, "step": 1, "count": 63}}, "is 63, and frf has 64 lines"),
        ({"frequency_hz": {"start": None, "step": 1}}, "/mapping/frequency_hz: is empty"),
        ({"frequency_hz": {"variable": "f", "unit": "kg"}}, "is 'kg', expected a frequency's"),
        (
            {"response_point": [4, None]},
            "/mapping/response_point: is empty: state a point for each FRF",
        ),
        ({"reference_direction": None}, "/mapping/reference_direction: is empty: state ±1 to ±3"),
        ({"response_point": 4}, "one degree of freedom for 2 FRFs"),
        ({"response_point": [4]}, "one degree of freedom for 2 FRFs"),
    ],
)
def test_a_mapping_of_frfs_that_lacks_or_contradicts(
    tmp_path: Path, change: dict[str, Any], fault: str
) -> None:
    path = saved(tmp_path, f=LINES, H=VALUES.T)
    whole = {"frequency_hz": {"variable": "f"}, "frf": {"variable": "H"}, **DOFS}
    assert fault in refused(path, {**whole, **change}, quantity="accelerance")


def test_a_mat_without_unit_and_quantity_asks_for_it(tmp_path: Path) -> None:
    path = saved(tmp_path, f=LINES, H=VALUES.T)
    mapping = {**proposed(path), **DOFS}
    assert "/quantity: is missing" in refused(path, mapping)
    assert frfs_in(kept(path, {**mapping, "unit": "m/N"}))[0].quantity == "receptance"


@pytest.mark.parametrize("form", ["npz", "csv", "mat"])
def test_a_gap_in_arrays_is_left_out_at_0_hz_alone(tmp_path: Path, form: str) -> None:
    lines, values = np.append(0.0, LINES), np.column_stack(([np.nan, 1.0], VALUES))

    def file(values: np.ndarray) -> tuple[Path, Any]:
        path = tmp_path / f"gap.{form}"
        if form == "npz":
            np.savez(
                path,
                frequency_hz=lines,
                values=values,
                **{name: np.array(dof) for name, dof in DOFS.items()},
            )
        elif form == "mat":
            savemat(path, {"f": lines, "H": values})
            return path, {"frequency_hz": {"variable": "f"}, "frf": {"variable": "H"}, **DOFS}
        else:
            head = "response_point,response_direction,reference_point,reference_direction,frequency_hz,real,imag\n"
            cells = (
                f"{point},3,1,-3,{hz},{value.real},{value.imag}\n"
                for point, row in zip((4, 5), values, strict=True)
                for hz, value in zip(lines, row, strict=True)
            )
            path.write_text(head + "".join(cells))
        return path, None

    path, mapping = file(values)
    items = kept(path, mapping, quantity="receptance")
    assert [lines_of(frf)[0] for frf in frfs_in(items)] == [1.0, 1.0]
    assert isinstance(items[0], FileDescription)
    assert any("1 of 2 FRFs are NaN or infinite at 0 Hz" in note for note in items[0].notes)
    values[1, 7] = np.inf
    path, mapping = file(values)
    assert "first of FRF 2 at line 8 (7 Hz)" in refused(path, mapping, quantity="receptance")


def test_a_list_of_structures_holds_several_frfs(tmp_path: Path) -> None:
    """As Test.Lab writes several blocks: axes and units are the same, names differ."""
    blocks = np.empty(
        (1, 2), dtype=[(name, object) for name in ("x_values", "y_values", "function_record")]
    )
    for column, values in enumerate(VALUES):
        channels = {
            "primary_channel": {"name": f"P:{column + 7}:-Z"},
            "reference_channel": {"name": "P:1:+Z"},
        }
        even = {
            "start_value": 1.0,
            "increment": 1.0,
            "number_of_values": 64.0,
            "quantity": {"label": "Hz"},
        }
        blocks[0, column] = (
            even,
            {"values": values[:, None], "quantity": {"label": "g/N"}},
            channels,
        )
    path = saved(tmp_path, FRF=blocks)
    frfs = frfs_in(kept(path, proposed(path)))
    assert [(f.response_point, f.response_direction, f.reference_point) for f in frfs] == [
        (7, -3, 1),
        (8, -3, 1),
    ]
    for frf, values in zip(frfs, VALUES, strict=True):
        np.testing.assert_allclose(values_of(frf), values * 9.80665, rtol=1e-12)


@pytest.mark.parametrize(
    ("above", "below", "wanted"),
    [
        ("g pk", "N pk", ""),
        ("g (RMS)", "N rms", ""),
        ("g rms", "N pk", "export both as peak"),
        ("g rms", "N", "export both as peak"),
    ],
)
def test_units_of_an_amplitude(tmp_path: Path, above: str, below: str, wanted: str) -> None:
    path = tmp_path / "a.uff"
    axes = {"ordinate": axis(12, above), "denominator": axis(13, below)}
    path.write_bytes(set_58(*rows(np.arange(1.0, 9.0)), kind=6, points=4, **axes))
    items = kept(path)
    if wanted:
        assert not frfs_in(items)
        assert any(wanted in (i.reason or "") for i in items if isinstance(i, DatasetReport))
    else:
        (frf,) = frfs_in(items)
        np.testing.assert_allclose(values_of(frf)[0], (1 + 2j) * 9.80665)


@pytest.mark.parametrize(
    ("content", "wanted"),
    [
        (b"\xff\xfe" + FRF.decode().encode("utf-16-le"), "save it as ANSI or UTF-8"),
        (FRF.replace(b"\n", b"\r"), "save them with LF"),
        (b"Plate A, 2024\n" + FRF, "delete what stands before it"),
    ],
)
def test_text_that_is_no_uff_says_how_to_save_it(
    tmp_path: Path, content: bytes, wanted: str
) -> None:
    path = tmp_path / "a.uff"
    path.write_bytes(content)
    with pytest.raises(InputError, match=wanted):
        kept(path)


def test_points_of_two_components_with_one_number_are_noted(tmp_path: Path) -> None:
    path = tmp_path / "a.uff"
    path.write_bytes(named("plate", "plate", (2, 3, 1, 3)) + named("rib", "plate", (2, 3, 1, 3)))
    items = kept(path)
    assert "do two components number their points alike?" in notes_of(items, 2)
    assert not notes_of(items, 1).count("components")


def test_the_unit_in_the_name_of_an_axis(tmp_path: Path) -> None:
    path = tmp_path / "a.uff"
    axes = {"ordinate": axis(12, name="Acceleration (g)"), "denominator": axis(13, name="F [N]")}
    path.write_bytes(set_58(*rows(np.arange(1.0, 9.0)), kind=6, points=4, **axes))
    (frf,) = frfs_in(kept(path))
    np.testing.assert_allclose(values_of(frf)[0], (1 + 2j) * 9.80665)


@pytest.mark.parametrize(
    ("starts", "outcomes"),
    [
        ([0.0, 0.0, 5.0, 5.0], ["read"] * 4),
        ([-0.5, -0.5, 0.0, 0.5], ["read", "read", "read", "refused"]),
    ],
)
def test_blocks_of_a_hit_begin_together(
    tmp_path: Path, starts: list[float], outcomes: list[str]
) -> None:
    path = tmp_path / "a.uff"
    channels = [(1, axis(13, "N")), (2, axis(12, "m/s^2"))] * 2
    blocks = [
        set_58(
            *rows(np.arange(1.0, 9.0)), kind=4, points=8, function=1, abscissa=axis(17, "s"),
            ordinate=unit, response=(point, 3), reference=(1, 3), start=f"{start:.5e}", step="0.5",
        )
        for start, (point, unit) in zip(starts, channels, strict=True)
    ]  # fmt: skip
    path.write_bytes(b"".join(blocks))
    found = load(path)
    assert found.outcomes == outcomes
    if "refused" in outcomes:
        assert "export the channels of a hit over the same times" in found.reasons
