"""Testing machines' exports as laboratories send them, each with the modulus that is right, and
variants of them.
"""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fecore.errors import InputError
from modalbase.formats.errors import FormatError
from modalbase.formats.machine_csv import Column, read_machine_csv
from service.nouns.coupons.reduction import Reduced, reduce_curve
from service.nouns.coupons.schemas import CurveCouponIn
from tests.support.places import shared_file

DIMENSIONS = {"unit": "mm", "width": [20.04], "thickness": [1.55]}
EXTENSION = DIMENSIONS | {"gauge_length": 80.0}


def reduced(
    path: Path, columns: dict[str, Any], dimensions: dict[str, Any] = EXTENSION, **about: Any
) -> Reduced:
    request = {"specimen": "A1", "dimensions": dimensions, "columns": columns, **about}
    return reduce_curve(path, CurveCouponIn.model_validate_json(json.dumps(request)))


FILES = [
    ("coupon_apostrophe.csv", {"time": "Zeit", "force": "Kraft", "strain": "Weg"}, EXTENSION, {}),
    ("coupon_blanks.dat", {"time": "Zeit", "force": "Kraft", "strain": "Dehnung"}, EXTENSION, {}),
    (
        "coupon_german_tab.TRA",
        {"time": "Prüfzeit", "force": "Standardkraft", "strain": "Standardweg"},
        EXTENSION,
        {},
    ),
    (
        "coupon_strain1_heading.csv",
        {"time": "Time", "force": "Load", "strain": "Tensile strain (Strain 1)"},
        DIMENSIONS,
        {},
    ),
    ("coupon_strain1_heading.csv", {"force": "Load", "strain": "Tensile strain"}, DIMENSIONS, {}),
    (
        "coupon_untared.csv",
        {"force": "Load", "strain": "Extension"},
        EXTENSION,
        {"zero": {"strain": "first"}},
    ),
    (
        "coupon_untared.csv",
        {"force": "Load", "strain": "Extension"},
        EXTENSION,
        {"zero": {"strain": 18.25}},
    ),
]


@pytest.mark.parametrize(("name", "columns", "dimensions", "about"), FILES)
def test_the_modulus_and_strength_of_a_file(
    name: str, columns: dict[str, Any], dimensions: dict[str, Any], about: dict[str, Any]
) -> None:
    found = reduced(shared_file("REALITY", "reality", name), columns, dimensions, **about)
    # the chord's ends are the nearest points
    assert found.coupon.E_Pa == pytest.approx(70.0e9, rel=3e-3)
    assert found.coupon.strength_Pa == pytest.approx(560e6, rel=1e-6)
    assert not found.reading["notes"]


def test_an_extension_that_was_not_tared_is_refused_with_the_way() -> None:
    path = shared_file("REALITY", "reality", "coupon_untared.csv")
    with pytest.raises(
        InputError, match=r'begins at .*m/m \(mm in the file\).*"zero": \{"strain": "first"\}'
    ):
        reduced(path, {"force": "Load", "strain": "Extension"})


def rows(decimals: int = 4) -> list[tuple[str, ...]]:
    """Time s, extension mm and force N of a bar of 70 GPa, 20 x 1.5 mm, gauge 80 mm, to 1 %
    strain.
    """
    strains = [i * 1e-4 for i in range(101)]
    return [tuple(f"{v:.{decimals}f}" for v in (1e4 * s, 80 * s, 70e3 * s * 30)) for s in strains]


def grouped(number: str, mark: str, decimal: str) -> str:
    integer, _, fraction = number.partition(".")
    return f"{int(integer):,}".replace(",", mark) + decimal + fraction


BAR = {"unit": "mm", "width": [20.0], "thickness": [1.5], "gauge_length": 80.0}
NAMES = {"time": "Zeit", "strain": "Weg", "force": "Kraft"}


@pytest.mark.parametrize("separator", [";", "\t"])
@pytest.mark.parametrize(
    ("mark", "decimal"),
    [("'", "."), ("’", "."), ("\u202f", ","), ("\xa0", ","), (" ", ","), (".", ","), (",", ".")],
)
def test_thousands_of_every_country(
    tmp_path: Path, separator: str, mark: str, decimal: str
) -> None:
    lines = ["Prüfung;5", "", separator.join(("Zeit (s)", "Weg [mm]", "Kraft_N"))]
    lines += [
        separator.join(grouped(cell, mark, decimal) for cell in row) + separator for row in rows()
    ]
    path = tmp_path / "bar.txt"
    path.write_text("\r\n".join([*lines, "", "Ende der Prüfung"]), "utf-8")
    found = reduced(path, NAMES, BAR)
    assert found.coupon.E_Pa == pytest.approx(70e9, rel=1e-4)
    assert found.reading["decimal"] == decimal


def test_a_number_that_may_be_two_is_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "bar.csv"
    path.write_text("Weg (mm);Kraft (N)\n" + "".join(f"{i};{i},{i:03d}\n" for i in range(100, 201)))
    with pytest.raises(
        InputError, match="may be a decimal comma or grouped thousands; state decimal"
    ):
        reduced(path, {"strain": "Weg", "force": "Kraft"}, BAR)


HEADINGS = [
    ("Strain 1 (Strain (%))", "", "%"),
    ("Strain 1 (left)", "(%)", "%"),
    ("Tensile strain (Strain)", "%", "%"),
    ("Strain [%]", "", "%"),
    ("Axial strain (Strain 2)", "mm/mm", "mm/mm"),
]


@pytest.mark.parametrize(("heading", "below", "unit"), HEADINGS)
def test_a_name_in_brackets_is_no_unit(heading: str, below: str, unit: str) -> None:
    text = f"Load;{heading}\nN;{below}\n1;0.1\n2;0.2\n"
    columns = {"force": Column("Load", "force"), "strain": Column(heading, "strain")}
    assert read_machine_csv(text.encode(), columns).units == {"force": "N", "strain": unit}


def test_an_extension_beside_a_name_in_brackets_is_asked_for_its_unit() -> None:
    text = "Load (N);Extension (Crosshead)\n1;0.1\n2;0.2\n"
    columns = {"force": Column("Load", "force"), "x": Column("Extension", "length")}
    with pytest.raises(
        FormatError, match=r"columns.x.unit: is stated neither by you nor in the file"
    ):
        read_machine_csv(text.encode(), columns)


def test_times_of_day_are_seconds_over_midnight() -> None:
    text = "Time,Load (N),Strain (%)\n23:59:59.5,1,0.1\n00:00:00.5,2,0.2\n00:00:01.5,3,0.3\n"
    columns = {
        n: Column(h, q)
        for n, h, q in (("time", "Time", "time"), ("f", "Load", "force"), ("s", "Strain", "strain"))
    }  # type: ignore[arg-type]
    found = read_machine_csv(text.encode(), columns)
    assert found.runs[0].columns["time"].tolist() == [0.0, 1.0, 2.0]


def test_units_above_the_names_count_and_two_that_differ_are_refused() -> None:
    columns = {"force": Column("Load", "force"), "strain": Column("Strain", "strain")}
    found = read_machine_csv(b"kN;%\nLoad;Strain\n1;0.1\n2;0.2\n", columns)
    assert found.units == {"force": "kN", "strain": "%"}
    with pytest.raises(FormatError, match="as kN and as N"):
        read_machine_csv(b"N;%\nLoad (kN);Strain\n1;0.1\n2;0.2\n", columns)


@pytest.mark.parametrize(
    ("zero", "why"),
    [
        ({"time": "first"}, "zero has time"),
        ({"strain_back": "first"}, "zero has strain_back, which columns does not name"),
    ],
)
def test_a_zero_that_says_nothing_is_refused(zero: dict[str, Any], why: str) -> None:
    columns = {"force": "Load", "strain": "Extension", "time": "Time"}
    with pytest.raises(ValueError, match=why):
        CurveCouponIn.model_validate(
            {"specimen": "A", "dimensions": EXTENSION, "columns": columns, "zero": zero}
        )


def test_a_small_offset_is_noted(tmp_path: Path) -> None:
    path = tmp_path / "bar.csv"
    body = "\n".join(f"{float(w) + 0.06:.4f};{f}" for _, w, f in rows())
    path.write_text(f"Weg (mm);Kraft (N)\n{body}\n")
    found = reduced(path, {"strain": "Weg", "force": "Kraft"}, BAR)
    assert "was not tared" in found.reading["notes"][0]
    assert not reduced(
        path, {"strain": "Weg", "force": "Kraft"}, BAR, zero={"strain": "first"}
    ).reading["notes"]


def test_a_force_that_was_not_tared_is_noted(tmp_path: Path) -> None:
    path = tmp_path / "bar.csv"
    body = "\n".join(f"{w};{float(f) + 500:.4f}" for _, w, f in rows())
    path.write_text(f"Weg (mm);Kraft (N)\n{body}\n")
    columns = {"strain": "Weg", "force": "Kraft"}
    assert (
        "force begins at 500 N with hardly any strain, and counts"
        in reduced(path, columns, BAR).reading["notes"][0]
    )
    tared = reduced(path, columns, BAR, zero={"force": "first"})
    assert tared.coupon.strength_Pa == pytest.approx(700e6)
    assert not tared.reading["notes"]


STRAIN = np.arange(0.0, 0.0101, 1e-4)
FORCE = 60e9 * 20.04e-3 * 1.55e-3 * STRAIN


def curve(path: Path, names: str, rows: Iterable[str]) -> Path:
    path.write_text("\n".join([names, *rows]) + "\n")
    return path


def test_an_unloading_loop_is_two_runs(tmp_path: Path) -> None:
    there = np.r_[0:25, 25:8:-1, 8:101]
    rows = (f"{FORCE[i]:.3f},{100 * STRAIN[i]:.4f}" for i in there)
    path = curve(tmp_path / "a.csv", "Load (N),Strain (%)", rows)
    columns = {"force": "Load", "strain": "Strain"}
    with pytest.raises(InputError, match=r"unloaded and loaded again.*2 \(lines 44 to 136\)"):
        reduced(path, columns, DIMENSIONS)
    found = reduced(path, columns, DIMENSIONS, run=2)
    assert found.coupon.E_Pa == pytest.approx(60e9, rel=1e-4)
    assert (found.reading["runs"], found.reading["first_line"]) == (2, 44)


def test_columns_by_number_have_the_units_of_their_headings(tmp_path: Path) -> None:
    rows = (f"{f:.3f},{e},{0.9 * f:.3f},{1e3 * e:.4f}" for f, e in zip(FORCE, STRAIN, strict=True))
    names = "Piece 1,,Piece 2,\nLoad,Strain,Load,Strain\nN,mm/mm,N,\u2030"
    path = curve(tmp_path / "a.csv", names, rows)
    found = reduced(path, {"force": 3, "strain": 4}, DIMENSIONS)
    assert found.coupon.E_Pa == pytest.approx(54e9, rel=1e-4)


def test_a_gauge_that_drops_out_is_named(tmp_path: Path) -> None:
    strain = np.where((STRAIN > 0.00145) & (STRAIN < 0.0018), 0.0, STRAIN)
    rows = (f"{f:.3f},{100 * e:.4f}" for f, e in zip(FORCE, strain, strict=True))
    path = curve(tmp_path / "a.csv", "Load (N),Strain (%)", rows)
    with pytest.raises(InputError, match=r"reaches 1400 µε only.*jumps at point 16"):
        reduced(path, {"force": "Load", "strain": "Strain"}, DIMENSIONS)


def table(names: str, force: float = 1.0, strain: float = 100.0, swap: bool = False) -> str:
    """A heading, and the curve in N and % times a factor."""
    rows = zip(force * FORCE, strain * STRAIN, strict=True)
    return "\n".join(
        [names, *(f"{e:.7f};{f:.5f}" if swap else f"{f:.5f};{e:.7f}" for f, e in rows)]
    )


AGAIN = [
    ("Load;Strain\nN;%", "Strain;Load\n%;N", True, 1.0),  # the columns of a later table are its own
    ("Load;Strain\n\nCH1;CH2\nN;%", "Load;Strain\n\nCH1;CH2\nN;%", False, 1.0),
    ("Load (N);Strain (%)", "Load (kN);Strain (%)", False, 1e-3),
]


@pytest.mark.parametrize(("first", "second", "swap", "scale"), AGAIN)
def test_a_later_table_is_a_run_by_its_own_header(
    tmp_path: Path, first: str, second: str, swap: bool, scale: float
) -> None:
    path = tmp_path / "a.csv"
    path.write_text(f"{table(first)}\nPiece 2\n{table(second, 0.9 * scale, swap=swap)}\n")
    columns = {"force": "Load", "strain": "Strain"}
    if scale != 1:
        with pytest.raises(InputError, match="as N and as kN; which is right"):
            reduced(path, columns, DIMENSIONS, run=2)
        return
    found = reduced(path, columns, DIMENSIONS, run=2)
    assert found.coupon.E_Pa == pytest.approx(54e9, rel=1e-4)
    assert found.coupon.strength_Pa == pytest.approx(540e6, rel=1e-4)


def test_rows_behind_other_headings_are_no_points_of_the_curve(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(f"{table('Load (N);Strain (%)')}\n\nMaximum (N);Modulus (GPa)\n19000;60.1\n")
    columns = {"force": "Load", "strain": "Strain"}
    with pytest.raises(
        InputError, match=r"runs counts: 1 \(lines 2 to 102\), 2 \(lines 105 to 105"
    ):
        reduced(path, columns, DIMENSIONS)
    assert reduced(path, columns, DIMENSIONS, run=1).coupon.E_Pa == pytest.approx(60e9, rel=1e-4)


DOUBTED = [
    ("Load (N);Strain (%)", 1.0, -28.0, {}, "is -2800 µε at the maximum force.*transverse gauge"),
    (
        "Load (kN);Strain (%)",
        1.0,
        100.0,
        {},
        "give E_Pa 6e.13 and .*is a unit or a dimension another",
    ),
    (
        "Load (N);Strain (mV/V)",
        1.0,
        2e3,
        {},
        "strain.unit: is stated neither by you nor|no unit of strain",
    ),
    ("Load (N);Strain (%)", 1.0, 100.0, EXTENSION, "'%' is a strain, not an elongation; leave the"),
]


@pytest.mark.parametrize(("names", "force", "strain", "dimensions", "why"), DOUBTED)
def test_what_cannot_be_is_asked_for(
    tmp_path: Path, names: str, force: float, strain: float, dimensions: Any, why: str
) -> None:
    path = tmp_path / "a.csv"
    path.write_text(table(names, force, strain))
    with pytest.raises(InputError, match=why):
        reduced(path, {"force": "Load", "strain": "Strain"}, dimensions or DIMENSIONS)


def test_a_transverse_strain_of_the_wrong_sign_is_named(tmp_path: Path) -> None:
    rows = (f"{f:.4f};{e:.7f};{0.3 * e:.7f}" for f, e in zip(FORCE, STRAIN, strict=True))
    path = curve(tmp_path / "a.csv", "Load (N);Axial (m/m);Lateral (m/m)", rows)
    columns = {"force": "Load", "strain": "Axial", "transverse_strain": "Lateral"}
    warnings = reduced(path, columns, DIMENSIONS).reduction["warnings"]
    assert any("Poisson's ratio is -0.300" in warning for warning in warnings)
    with pytest.raises(InputError, match=r"grows with the force.*turn its sign"):
        reduced(path, columns, DIMENSIONS, standard="D3518")


CURVE = "\n".join(f"{70e3 * e * 30:.3f};{100 * e:.6f}" for e in np.linspace(0, 0.01, 101))
STATED = [  # lines above or in the heading of a bar of 20 x 1.5 mm, and what they meet
    ("Breite b0;20,5;mm\nKraft;Dehnung\nN;%", ""),
    ("Breite b0;25,0;mm\nKraft;Dehnung\nN;%", r"dimensions.width: is 20 mm, and line 1 states 'Breite b0: 25,0 mm'"),
    ("Area: 50 mm²\nKraft;Dehnung\nN;%", r"dimensions.width: and thickness make an area of 30 mm², and line 1"),
    ("Scale;0.001;1\nKraft;Dehnung\nN;%", r"columns.force.unit: is 'N \(Scale = 0.001\)': .*such as 'N', '0.001\*N'"),
    ("Offset;0;5\nKraft;Dehnung\nN;%", r"columns.strain.unit: is '% \(Offset = 5\)'"),
    ("Kraft x1000 (N);Dehnung (%)", r"columns.force.unit: is 'N \(x1000\)'"),
    ("Kraft (MN);Dehnung (%)", "columns: give E_Pa 7e[+]16 .*no material has"),
]  # fmt: skip


@pytest.mark.parametrize(("heading", "why"), STATED)
def test_what_lines_above_a_curve_state_counts(tmp_path: Path, heading: str, why: str) -> None:
    path, columns = tmp_path / "bar.csv", {"force": "Kraft", "strain": "Dehnung"}
    path.write_text(f"{heading}\n{CURVE}\n")
    dimensions = {name: value for name, value in BAR.items() if name != "gauge_length"}
    columns["force"] = heading.split(" (")[0] if "x1000" in heading else "Kraft"
    if not why:
        assert reduced(path, columns, dimensions).coupon.E_Pa == pytest.approx(70e9, rel=1e-4)
        return
    with pytest.raises(InputError, match=why):
        reduced(path, columns, dimensions)
    if "N \\(" in why:  # whoever sends it says what the numbers are in
        stated = {**columns, "force": {"header": columns["force"], "unit": "1e-3*N"}}
        found = reduced(path, stated, dimensions)
        assert found.coupon.E_Pa == pytest.approx(70e6, rel=1e-4)
