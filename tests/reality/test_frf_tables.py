"""FRFs that analysers write as text: magnitude and phase, or real and imaginary parts, with what
their headings say.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

from modalbase.formats.recognise import recognise
from service.compute.frf_rows import EncodedFrf
from service.compute.spectra import decode
from service.platform.errors import Invalid
from service.tasks.import_file.compute import ReadingInputs, read_upload
from tests.support.places import shared_file

HZ = np.arange(1, 201) * 0.5
H = np.exp(0.4j) * HZ**2 / (31.0**2 - HZ**2 + 0.6j * HZ)  # m/s²/N
GRAVITY = 9.80665
DOFS = {
    "response_point": 2,
    "response_direction": 3,
    "reference_point": 1,
    "reference_direction": 3,
}


def read(
    path: Path, mapping: Any = None, *, dry_run: bool = True, quantity: Any = None
) -> list[Any]:
    mapping = json.loads(json.dumps(mapping))
    return list(
        read_upload(
            ReadingInputs(path, quantity, path.name, mapping=mapping, dry_run=dry_run),
            lambda *_: None,
        )
    )


def imported(path: Path, **changes: Any) -> list[EncodedFrf]:
    (found,) = read(path)
    assert found.kind == "frfs"
    frfs = read(path, {**found.mapping, **DOFS, **changes}, dry_run=False)[1:]
    assert all(isinstance(frf, EncodedFrf) for frf in frfs)
    return frfs


def test_magnitude_in_g_and_phase_in_degrees_behind_a_preamble() -> None:
    path = shared_file("REALITY", "reality", "frf_analyser_mag_phase.tsv")
    (found,) = read(path)
    expected = {"magnitude": "Magnitude", "phase": "Phase", "scale": "linear", "phase_unit": "deg"}
    assert found.mapping["frf"] == expected
    assert found.mapping["unit"] == "g/N"
    assert {name: found.mapping[name] for name in DOFS} == DOFS  # "H1 2:+Z/1:+Z" of the heading
    assert (found.table["units_line"], found.table["first_line"]) == (6, 7)
    (frf,) = read(path, found.mapping, dry_run=False)[1:]
    values = decode(frf.spectrum)
    assert (frf.quantity, frf.response_point, frf.reference_point) == ("accelerance", 2, 1)
    assert abs(values[61]) == pytest.approx(2.5007, rel=1e-4)
    hz = 0.5 * np.arange(1, 401)
    peaks = [
        hz[(hz > f - 10) & (hz < f + 10)][np.argmax(np.abs(values[(hz > f - 10) & (hz < f + 10)]))]
        for f in (31, 87, 142)
    ]
    assert peaks == pytest.approx([31, 87, 142], abs=0.5)


def columns(kind: str) -> tuple[list[str], list[str], list[np.ndarray]]:
    """Names, units and columns of H in the writing of an analyser."""
    magnitude, phase = np.abs(H), np.angle(H)
    written: dict[str, tuple[list[str], list[str], list[np.ndarray]]] = {
        "dB": (
            ["Frequency", "Magnitude", "Phase"],
            ["Hz", "dB", "deg"],
            [HZ, 20 * np.log10(magnitude), np.degrees(phase)],
        ),
        "dB re g": (
            ["Freq.", "H1", "Phase"],
            ["Hz", "dB re 1 g/N", "rad"],
            [HZ, 20 * np.log10(magnitude / GRAVITY), phase],
        ),
        "radians": (
            ["Frequenz", "Betrag", "Phase"],
            ["kHz", "m/s²/N", "rad"],
            [HZ / 1000, magnitude, phase],
        ),
        "real, imaginary": (
            ["Hz", "Real", "Imag"],
            ["Hz", "g/N", "g/N"],
            [HZ, H.real / GRAVITY, H.imag / GRAVITY],
        ),
        "mm": (
            ["Phase", "Fréquence", "Amplitude"],
            ["°", "Hz", "(mm/s^2)/N"],
            [np.degrees(phase), HZ, 1000 * magnitude],
        ),
    }
    return written[kind]


@pytest.mark.parametrize("in_brackets", [False, True])
@pytest.mark.parametrize(("separator", "decimal"), [("\t", "."), (";", ","), (",", ".")])
@pytest.mark.parametrize("kind", ["dB", "dB re g", "radians", "real, imaginary", "mm"])
def test_what_analysers_write_is_the_same_frf(
    tmp_path: Path, kind: str, separator: str, decimal: str, in_brackets: bool
) -> None:
    names, units, table = columns(kind)
    rows = [
        separator.join(f"{v:.9e}" for v in row).replace(".", decimal)
        for row in zip(*table, strict=True)
    ]
    if in_brackets:
        heading = [
            separator.join(f"{name} [{unit}]" for name, unit in zip(names, units, strict=True))
        ]
    else:
        heading = [separator.join(names), separator.join(units)]
    path = tmp_path / "H.txt"
    path.write_text("\n".join(["Analyser", "", *heading, *rows, ""]))
    assert recognise(path, "H.txt") == "csv"
    stated = {"unit": "m/s²/N"} if kind == "dB" else {}
    (frf,) = imported(path, **stated)
    np.testing.assert_allclose(decode(frf.spectrum), H, rtol=1e-6)
    assert frf.quantity == "accelerance"


def test_several_columns_are_several_frfs_whose_points_are_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "H.csv"
    heading = "Frequency (Hz);Mag 1 (g/N);Phase 1 (deg);Mag 2 (g/N);Phase 2 (deg)"
    rows = [
        f"{f};{abs(h)};{np.degrees(np.angle(h))};{2 * abs(h)};0"
        for f, h in zip(HZ.tolist(), H, strict=True)
    ]
    path.write_text("\n".join([heading, *rows]))
    (found,) = read(path)
    assert found.mapping["frf"]["magnitude"] == ["Mag 1 (g/N)", "Mag 2 (g/N)"]
    assert found.mapping["response_point"] == [None, None]
    with pytest.raises(Invalid, match="response_point: is empty"):
        read(path, found.mapping, dry_run=False)
    frfs = imported(path, response_point=[2, 3])
    assert [frf.response_point for frf in frfs] == [2, 3]
    np.testing.assert_allclose(decode(frfs[1].spectrum), 2 * GRAVITY * np.abs(H), rtol=1e-6)


def test_the_columns_name_their_degrees_of_freedom(tmp_path: Path) -> None:
    names = [f"H {point}:+Z/1:-Z {part} (g/N)" for point in (2, 3) for part in ("Real", "Imag")]
    rows = [f"{f};{h.real};{h.imag};{h.real};{h.imag}" for f, h in zip(HZ.tolist(), H, strict=True)]
    path = tmp_path / "H.csv"
    path.write_text("\n".join([";".join(["Frequency (Hz)", *names]), *rows]))
    (found,) = read(path)
    assert [found.mapping[name] for name in DOFS] == [[2, 3], 3, 1, -3]


@pytest.mark.parametrize(
    "heading",
    [
        ["omega;Re;Im"],
        ["Hz;Real;Imag", ";m/s²/N;m/s²/N"],
        ["f [Hz];Real;Imag", "# measured against 1 N"],
        ["Frequency;Real;Imag", "Hz;-;-"],
    ],
)
def test_parts_of_frfs_are_no_hits(tmp_path: Path, heading: list[str]) -> None:
    path = tmp_path / "H.csv"
    path.write_text(
        "\n".join(
            [*heading, *(f"{f};{h.real};{h.imag}" for f, h in zip(HZ.tolist(), H, strict=True))]
        )
    )
    (frf,) = imported(path, unit="m/s²/N")
    np.testing.assert_allclose(decode(frf.spectrum), H, rtol=1e-6)


def test_decibels_of_zero_stay_in_the_table(tmp_path: Path) -> None:
    rows = [
        f"{f};{20 * np.log10(abs(h))};{np.degrees(np.angle(h))}"
        for f, h in zip(HZ.tolist(), H, strict=True)
    ]
    path = tmp_path / "H.csv"
    path.write_text("\n".join(["Frequency (Hz);Magnitude (dB);Phase (deg)", "0;-inf;0", *rows]))
    (frf,) = imported(path, unit="m/s²/N")
    assert decode(frf.spectrum).size == HZ.size + 1
    np.testing.assert_allclose(decode(frf.spectrum), [0, *H], rtol=1e-6)


REFUSED = [
    ({"frf": {"magnitude": "M", "phase": "P"}}, "phase_unit: is empty, and the file states none; state deg or rad"),
    ({"frf": {"magnitude": "M", "phase": "P", "phase_unit": "mm"}}, "expected deg or rad"),
    ({"frf": {"magnitude": "M", "phase": "P", "phase_unit": "deg", "scale": "log"}}, "expected linear or dB"),
    ({"frf": {"magnitude": "L", "phase": "P", "phase_unit": "deg"}}, "state .scale.: .dB."),
    ({"frf": {"magnitude": "M (g/N)", "phase": "P", "phase_unit": "deg", "scale": "dB"}},
     "scale: is dB, and the file says linear"),
    ({"frf": {"magnitude": "M", "phase": "A (rad)", "phase_unit": "deg"}}, "phase_unit: is deg, and the file says rad"),
    ({"frf": {"magnitude": "M"}}, "expected .*magnitude"),
    ({"frf": {"variable": "M"}}, "without phase is of no use"),
    ({"frf": {"magnitude": ["M", "L"], "phase": "P", "phase_unit": "deg"}}, "has 2 FRFs of magnitude and 1 of phase"),
    ({"frf": {"magnitude": "X", "phase": "P", "phase_unit": "deg"}}, "X: is not in the file; it has"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "why"), REFUSED)
def test_what_contradicts_or_is_missing_is_named(
    tmp_path: Path, change: dict[str, Any], why: str
) -> None:
    path = tmp_path / "H.csv"
    rows = [
        f"{f};{abs(h)};{np.log10(abs(h))};{abs(h)};0.1;0.1"
        for f, h in zip(HZ.tolist(), H, strict=True)
    ]
    path.write_text("\n".join(["f (Hz);M;L;M (g/N);P;A (rad)", *rows]))
    mapping = {"frequency_hz": {"variable": "f (Hz)"}, **DOFS, **change}
    with pytest.raises(Invalid, match=why):
        read(path, mapping, dry_run=False, quantity="accelerance")


def test_degrees_under_a_heading_of_radians_are_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "H.csv"
    rows = [
        f"{f};{abs(h)};{np.rad2deg(np.angle(h * (-1) ** k))}"
        for k, (f, h) in enumerate(zip(HZ.tolist(), H, strict=True))
    ]
    path.write_text("\n".join(["Frequency (Hz);Magnitude (m/s²/N);Phase (rad)", *rows]))
    (found,) = read(path)
    with pytest.raises(Invalid, match="phase_unit: is rad, and neighbouring lines differ by"):
        read(path, {**found.mapping, **DOFS}, dry_run=False)
    frf = {**found.mapping["frf"], "phase_unit": "deg"}
    _, taken = read(path, {**found.mapping, **DOFS, "frf": frf}, dry_run=False)
    alternating = H * (-1.0) ** np.arange(H.size)
    np.testing.assert_allclose(decode(taken.spectrum), alternating, rtol=1e-6)


def test_a_unit_of_mobility_is_no_accelerance(tmp_path: Path) -> None:
    path = tmp_path / "H.csv"
    path.write_text(
        "\n".join(["f (Hz);Re (m/s/N);Im (m/s/N)", *(f"{f};1.5;0.5" for f in HZ.tolist())])
    )
    (found,) = read(path)
    with pytest.raises(
        Invalid, match="quantity: is accelerance, and the unit 'm/s/N' is that of mobility"
    ):
        read(path, {**found.mapping, **DOFS}, dry_run=False, quantity="accelerance")
    assert imported(path)[0].quantity == "mobility"


def test_parts_of_frfs_in_a_mat_are_no_hits_and_other_spectra_are_named(tmp_path: Path) -> None:
    parts, several = tmp_path / "parts.mat", tmp_path / "several.mat"
    savemat(parts, {"f": HZ, "re": H.real, "im": H.imag})
    (frf,) = imported(parts, unit="m/s²/N")
    np.testing.assert_allclose(decode(frf.spectrum), H, rtol=1e-6)
    savemat(several, {"f": HZ, "H2": H, "H3": 2 * H})
    (found,) = read(several)
    assert found.notes == [
        "H2 alone is taken; import H3 by a mapping of their own where they are FRFs"
    ]


DEGREES = np.degrees(np.angle(H))
LEVEL = 20 * np.log10(np.abs(H))
PARTS_IN_G = np.array([H.real, H.imag]) / GRAVITY
WORDS = [
    ("Frequenz [Hz];Betrag [dB re 1 (m/s²)/N];Phase [°]", (HZ, LEVEL, DEGREES)),
    ("Frequency;Log Mag;Phase\nHz;dB(g/N);Degrees", (HZ, LEVEL - 20 * np.log10(GRAVITY), DEGREES)),
    ("[Hz];[(m/s²)/N];[°]", (HZ, np.abs(H), DEGREES)),
    (
        "Block;1024\nX Unit;Hz;Y Unit;g/N\n\nFrequency (Hz);Real (g/N);Imag (g/N)",
        (HZ, H.real / GRAVITY, H.imag / GRAVITY),
    ),
    ("Frequency [mHz];Level [dB, ref=1e-6 m/s²/N];Phase [°]", (1000 * HZ, LEVEL + 120, DEGREES)),
    ("Freq [Hz];Mag (dBg/N);Phase [°]", (HZ, LEVEL - 20 * np.log10(GRAVITY), DEGREES)),
    ("Frecuencia (Hz);Magnitud dB//1 (m/s²)/N;Fase (grados)", (HZ, LEVEL, DEGREES)),
    ("X Unit: Hz;Y Unit: g/N\nScale;1;1;1\nFrequency;Real;Imag", (HZ, *PARTS_IN_G)),
    ("Units;Hz;g/N;g/N\nFrequency;Real;Imag", (HZ, *PARTS_IN_G)),
    ("dB reference: 1e-6 (m/s²)/N\nf [Hz];Mag [dB];Phase [deg]", (HZ, LEVEL + 120, DEGREES)),
    ("f [Hz];Mag [(m/s²)/N];-Phase [deg]", (HZ, np.abs(H), -DEGREES)),
    ("f [Hz];Mag [(m/s²)/N];Phase lag [gon]", (HZ, np.abs(H), -DEGREES / 0.9)),
    ("f [Hz];Mag [(m/s²)/N];Phase [cycles]", (HZ, np.abs(H), DEGREES / 360)),
    ("f [Hz];Mag [(m/s²)/N];Phase [mrad]", (HZ, np.abs(H), 1000 * np.angle(H))),
    ("f [Hz];Mag [(m/s²)/N];Phase [π rad]", (HZ, np.abs(H), np.angle(H) / np.pi)),
    ("f [Hz];Re [g/N];-Im [g/N]", (HZ, PARTS_IN_G[0], -PARTS_IN_G[1])),
    ("f [Hz];Re conj(H) [g/N];Im conj(H) [g/N]", (HZ, PARTS_IN_G[0], -PARTS_IN_G[1])),
    ("Delta f: 0.5 Hz\nf [Hz];Re [g/N];Im [g/N]", [part[::-1] for part in (HZ, *PARTS_IN_G)]),
    ("Frequenz [Hz];Real [g/N x10-3];Imag [g/N x10-3]", (HZ, *(1000 * PARTS_IN_G))),
]


@pytest.mark.parametrize(("heading", "table"), WORDS)
def test_units_that_say_what_the_columns_are(tmp_path: Path, heading: str, table: Any) -> None:
    path = tmp_path / "H.txt"
    rows = (";".join(map(repr, row)) for row in np.transpose(table).tolist())
    path.write_text("\n".join([heading, *rows]))
    (frf,) = imported(path)
    np.testing.assert_allclose(decode(frf.spectrum), H, rtol=1e-6)


PAIRED = {"real": ["Re H2 (g/N)", "Re H3 (g/N)"], "imaginary": ["Im H2 (g/N)", "Im H3 (g/N)"]}
ALIKE = r"/mapping/frf: has .*import what is alike by a mapping of its own"
THREE = {
    "real": ["Re 2 (1e-3 g/N)", "Re 3 (1e-3 g/N)"],
    "imaginary": ["Im 2 (1e-3 g/N)", "Im 3 (1e-3 g/N)"],
}
COLUMNS = [  # headings of columns that hold H, with g/N where they say it, and what is proposed, or why not
    ("f (Hz);Re H2 (g/N);Re H3 (g/N);Im H3 (g/N);Im H2 (g/N)", "frriii", PAIRED),
    ("f (Hz);Re 2 (g/N);Im 2 (g/N);Re 3 (m/s²/N);Im 3 (m/s²/N)", "fririi", ALIKE),
    ("f (Hz);Re (g/N);Im (m/s/N)", "fri", ALIKE),
    ("f (Hz);Mag 2 (g/N);Phase 2 (deg);Mag 3 (g/N);Phase 3 (rad)", "fmpmp", ALIKE),
    ("f (Hz);Mag 2 (g/N);Phase 2 (deg);Mag 3 (dB re 1 g/N);Phase 3 (deg)", "fmpmp", ALIKE),
    ("f (Hz);Re 2 (1e-3 g/N);Im 2 (1e-3 g/N);Coh 2;Re 3 (1e-3 g/N);Im 3 (1e-3 g/N);Coh 3", "frinrin", THREE),
    ("f (Hz);log10 Mag (g/N);Phase (deg)", "fmp", "frf/scale: is empty, and 'log10 Mag .* names a logarithm"),
    ("f (Hz);Re (g/N);Im (g/N);f (Hz);Re (g/N);Im (g/N)", "frigri",
     r"f \(Hz\) 2: is 1 in row 1 of the data, and f \(Hz\) is 0.5; import the FRFs of each axis"),
    ("Scale;1;0.001;0.001\nf (Hz);Re (g/N);Im (g/N)", "fri",
     r"unit: is 'g/N \(Scale = 0.001\)': whether .*, such as 'g/N', '0.001\*g/N'"),
    ("Offset: 5\nf (Hz);Re (g/N);Im (g/N)", "fri", r"unit: is 'g/N \(Offset = 5\)'"),
    ("f (Hz);Re x1000 (g/N);Im x1000 (g/N)", "fri", r"unit: is 'g/N \(x1000\)'"),
    ("f (Hz);Mag squared (g/N);Phase (deg)", "fmp", "magnitude: is 'Mag squared .*, a square"),
    ("f (Hz);Mag [dB re 1e-6];Phase (deg)", "fmp", "unit: is '1e-06', which is no response"),
    ("dB reference: 1e-6 g/N\nf (Hz);Mag [dB re 1 g/N];Phase (deg)", "fmp", "unit: is .*reference = 1e-6 g/N"),
    ("Resolution: 0.25 Hz\nf (Hz);Re (g/N);Im (g/N)", "fri", "lines 0.5 Hz apart, and line 1 states"),
    ("Force unit: N\nf (Hz);Re;Im", "fri", "unit: is missing: .* line 1 states 'Force unit: N'"),
    ("Mechanical impedance\nf (Hz);Re;Im", "fri", "quantity: is said by the file .* no response"),
]  # fmt: skip


@pytest.mark.parametrize(("heading", "columns", "outcome"), COLUMNS)
def test_what_each_column_says_counts(
    tmp_path: Path, heading: str, columns: str, outcome: Any
) -> None:
    path = tmp_path / "H.csv"
    parts = {"f": HZ, "g": 2 * HZ, "r": H.real, "i": H.imag, "m": np.abs(H), "p": np.angle(H)}
    parts["n"] = np.full(HZ.size, 0.9)
    table = np.transpose([parts[column] for column in columns]).tolist()
    path.write_text("\n".join([heading, *(";".join(map(repr, row)) for row in table)]))
    (found,) = read(path)
    if isinstance(outcome, dict):
        assert found.mapping["frf"] == outcome
        frfs = imported(path, response_point=[2, 3])
        assert len(frfs) == 2
        if "n" in columns:  # coherences beside them, and a power of ten in their unit
            np.testing.assert_allclose(decode(frfs[1].spectrum), 1e-3 * GRAVITY * H, rtol=1e-6)
        return
    points = [2, 3] if isinstance(found.mapping["response_point"], list) else 2
    with pytest.raises(Invalid, match=outcome):
        read(path, {**found.mapping, **DOFS, "response_point": points}, dry_run=False)


@pytest.mark.parametrize(
    ("heading", "unit"),
    [("Scale;1;0.001;0.001\nf (Hz);Re (g/N);Im (g/N)", "0.001*g/N"), ("Type: Mobility\nf (Hz);Re;Im", "g/N")],
)  # fmt: skip
def test_the_unit_of_the_numbers_answers_what_a_file_leaves_open(
    tmp_path: Path, heading: str, unit: str
) -> None:
    path = tmp_path / "H.csv"
    rows = [";".join(map(repr, row)) for row in np.transpose([HZ, *PARTS_IN_G]).tolist()]
    path.write_text("\n".join([heading, *rows]))
    (found,) = read(path)
    mapping = {**found.mapping, **DOFS}
    with pytest.raises(
        Invalid, match=r"/mapping/unit: is 'g/N \(Scale|/quantity: is accelerance, and"
    ):
        read(path, mapping, dry_run=False, quantity="accelerance")
    (frf,) = read(path, {**mapping, "unit": unit}, dry_run=False)[1:]
    factor = 1e-3 if "*" in unit else 1.0
    np.testing.assert_allclose(decode(frf.spectrum), factor * H, rtol=1e-6)


@pytest.mark.parametrize("name", ["gain", "Scale", "conversion_factor", "scale_factor"])
def test_a_factor_beside_a_dataset_is_used_or_asked_for(tmp_path: Path, name: str) -> None:
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "H.h5"
    with h5py.File(path, "w") as file:
        file["f"], file["H"] = HZ, H / GRAVITY
        file["H"].attrs["unit"], file["H"].attrs[name] = "g/N", 10.0
    (found,) = read(path)
    if name == "scale_factor":  # netCDF says what it means
        np.testing.assert_allclose(decode(imported(path)[0].spectrum), 10 * H, rtol=1e-6)
        right = {"unit": "m/s²/N", "instead_of": "g/N"}
        values = decode(imported(path, **right)[0].spectrum)
        np.testing.assert_allclose(values * GRAVITY, 10 * H, rtol=1e-6)
        for wrong, why in (
            ({"unit": "m/s²/N"}, "state .instead_of.: .g/N"),
            (right | {"instead_of": "g"}, "instead_of: is 'g', and the file says 'g/N'"),
        ):
            with pytest.raises(Invalid, match=why):
                imported(path, **wrong)
        return
    with pytest.raises(Invalid, match=rf"unit: is 'g/N \({name} = 10\)'.*, '10\*g/N'"):
        read(path, {**found.mapping, **DOFS}, dry_run=False)
    np.testing.assert_allclose(decode(imported(path, unit="10*g/N")[0].spectrum), 10 * H, rtol=1e-6)


def test_spectra_of_two_sides_and_conjugates_are_known_by_what_they_say(tmp_path: Path) -> None:
    sides, conjugate = tmp_path / "sides.mat", tmp_path / "conjugate.mat"
    savemat(sides, {"f": 0.5 * np.arange(401), "H": np.r_[0, H, H[::-1].conj()], "unit": "g/N"})
    with pytest.raises(Invalid, match=r"has two sides.* export the lower 201 of its 401 lines"):
        imported(sides)
    savemat(conjugate, {"f": HZ, "H_conj": H.conj(), "H_conj_unit": "m/s²/N"})
    np.testing.assert_allclose(decode(imported(conjugate)[0].spectrum), H, rtol=1e-6)


def test_values_that_run_along_lines_are_refused_with_the_way(tmp_path: Path) -> None:
    path = tmp_path / "H.csv"
    lines = {"Frequency [Hz]": HZ, "Real [g/N]": H.real, "Imag [g/N]": H.imag}
    path.write_text(
        "\n".join(";".join([name, *map(repr, row.tolist())]) for name, row in lines.items())
    )
    with pytest.raises(
        Invalid, match=r"200 numbers behind 'Frequency .*export the table transposed"
    ):
        read(path)


def test_units_that_are_not_known_are_asked_for_or_noted(tmp_path: Path) -> None:
    path = tmp_path / "H.csv"
    table = np.transpose([HZ, H.real, H.imag]).tolist()
    rows = [";".join(map(repr, row)) for row in table]
    path.write_text("\n".join(["Frequency [bins];Re (g per N);Im (g per N)", *rows]))
    (found,) = read(path)
    mapping = {**found.mapping, **DOFS}
    with pytest.raises(Invalid, match=r"frequency_hz/unit: is missing, and the file says 'bins'"):
        read(path, mapping, dry_run=False, quantity="accelerance")
    mapping["frequency_hz"]["unit"] = "Hz"
    description, _ = read(path, mapping, dry_run=False, quantity="accelerance")
    assert "taken in SI, as 'g per N' is no unit that is known here" in description.notes[-1]
    description, _ = read(path, {**mapping, "unit": "g/N"}, dry_run=False)
    assert description.notes == []


def test_parts_in_matrices_are_parts(tmp_path: Path) -> None:
    path = tmp_path / "H.mat"
    table = np.stack([H, 2 * H], axis=1)
    savemat(path, {"f": HZ, "H_mag_dB": 20 * np.log10(abs(table)), "H_phase_rad": np.angle(table)})
    frfs = imported(path, response_point=[2, 3], unit="m/s²/N")
    np.testing.assert_allclose([decode(frf.spectrum) for frf in frfs], table.T, rtol=1e-6)


@pytest.mark.parametrize("cell", ["1.5e-3-2.0e-3i", "(1.5e-3+2.0e-3j)"])
def test_complex_numbers_in_a_cell_are_refused(tmp_path: Path, cell: str) -> None:
    path = tmp_path / "H.csv"
    path.write_text("f [Hz];H [g/N]\n" + "".join(f"{f};{cell}\n" for f in HZ))
    with pytest.raises(Invalid, match=r"line 2.*complex.*columns of their own"):
        read(path)


def as_73(path: Path, parts: list[dict[str, Any]]) -> None:
    """A cell array of structures, as MATLAB stores it in HDF5."""
    h5py = pytest.importorskip("h5py")
    pair = np.dtype([("real", float), ("imag", float)])
    with h5py.File(path, "w", userblock_size=512) as file:
        references = file.create_dataset("data", (len(parts), 1), h5py.ref_dtype)
        for k, part in enumerate(parts):
            own = file.create_group(f"#refs#/{k}")
            for name, value in part.items():
                if isinstance(value, str):
                    own[name] = np.frombuffer(value.encode("utf-16-le"), np.uint16)[:, None]
                    own[name].attrs["MATLAB_class"] = np.bytes_("char")
                else:
                    is_complex = np.iscomplexobj(value)
                    own[name] = (value.view(pair) if is_complex else value)[:, None]
            references[k, 0] = own.ref
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\0\2IM")


@pytest.mark.parametrize("version", [5, 7.3])
def test_structures_in_cells(tmp_path: Path, version: float) -> None:
    path = tmp_path / "H.mat"
    parts = [
        {"f": HZ, "H": k * H / GRAVITY, "unit": "g/N", "resp": f"{k}:+Z", "ref": "1:-Z"}
        for k in (2, 3)
    ]
    if version == 5:
        savemat(path, {"data": np.array(parts, dtype=object)})
    else:
        as_73(path, parts)
    (found,) = read(path)
    assert [found.mapping[name] for name in DOFS] == [[2, 3], 3, 1, -3]
    frfs = read(path, found.mapping, dry_run=False)[1:]
    np.testing.assert_allclose([decode(frf.spectrum) for frf in frfs], [2 * H, 3 * H], rtol=1e-6)


def test_arrays_of_unequal_length_in_cells_have_numbers(tmp_path: Path) -> None:
    path = tmp_path / "H.mat"
    parts = [{"f": HZ[:n], "H": H[:n]} for n in (100, 200)]
    savemat(path, {"data": np.array(parts, dtype=object)})
    (found,) = read(path)
    assert {"data(1).f", "data(1).H", "data(2).f", "data(2).H"} == found.variables.keys()
