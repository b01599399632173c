"""Files as a whole: broken framing is refused before anything is yielded; other people's files, and
damaged ones.
"""

import pickle
from collections import Counter
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
import pyuff

from modalbase.formats.uff import (
    Axis,
    CoordinateSystem,
    Element,
    FileHeader,
    Frf,
    Function,
    GridPoint,
    Limits,
    ModeShape,
    TimeResponse,
    TraceLine,
    UffError,
    Units,
    read_file,
)
from modalbase.formats.uff.function import read_58
from modalbase.formats.uff.scan import scan
from modalbase.formats.uff.text import Refusal, real_block
from tests.support import uff_damage
from tests.support.places import shared_file
from tests.support.uff import FRF, POINT, POINTS, Read, Reading, dataset, load

TYPE_58B = "    58b{order:6d}     2{lines:12d}{count:12d}     0     0           0           0\n"


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
        (b"    -1", "ends or is blank after an opening delimiter"),
        (POINTS[:-4], "the file ends inside dataset 1"),
        (POINTS + b"    -1\n", "ends or is blank after an opening delimiter"),
        (b"    -1\n" + POINTS, "stands '-1', expected its type"),
        (POINTS.replace(POINT.encode(), POINT.encode() + b"\n    -1\n" + POINT.encode()),
         "between two datasets stands"),
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
)  # fmt: skip
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
    # from before a line end to after the blanks of the next delimiter
    whole = range(len(POINTS) - 1, len(POINTS) + 5)
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
        reading = read(data)
        assert set(reading.outcomes) == {"read"}
        assert len(reading.of(GridPoint)) == 1
    reading = read(odd + FRF)
    assert (len(reading.of(GridPoint)), len(reading.of(Frf))) == (1, 1)
    assert "its closing delimiter is not in columns 5 and 6" in reading.notes


def test_a_dataset_whose_delimiters_were_lost_in_another_is_named(read: Read) -> None:
    data = dataset("734", "1 2 3") + POINTS
    merged = data.replace(b"    -1\n    -1\n", b"    -1x    -1\n")
    reading = read(merged)
    assert reading.outcomes == ["refused"]
    assert "holds what was the beginning of another dataset" in reading.reasons


def test_limits(read: Read) -> None:
    with pytest.raises(UffError, match="more than 1 datasets"):
        read(POINTS + FRF, Limits(datasets=1))
    with pytest.raises(UffError, match="more than 10 bytes of blank lines"):
        read(POINTS + b"\n" * 12 + FRF, Limits(blank_bytes=10))
    assert "nearly all are blank" in read(dataset("15", POINT, *[""] * 10_001)).reasons
    odd = read(POINTS.removesuffix(b"    -1\n") + b"   -1\n")
    assert "its closing delimiter is not in columns 5 and 6" in odd.notes
    reading = read(POINTS + FRF, Limits(dataset_bytes=200))
    assert reading.outcomes == ["read", "refused"]
    assert "more than the 200 allowed" in reading.reasons


def test_reports_name_type_offset_and_place(read: Read) -> None:
    before, row = POINTS + dataset("734", "1"), b"   1.00000000000e+00"
    reading = read(before + FRF.replace(b"2.00000000000e+00", b"2.000000*0000e+00"))
    reported = [(report.number, report.type, report.outcome) for report in reading.reports]
    assert reported == [(1, "15", "read"), (2, "734", "ignored"), (3, "58", "refused")]
    assert reading.reports[2].offset == len(before)
    place = len(before) + FRF.index(row)
    assert f"line 12 (byte {place}): '2.000000*0000e+00' is not a number" in reading.reasons


def test_a_file_that_is_cut_while_it_is_read_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "file.uff"
    path.write_bytes(POINTS + FRF)
    contents = read_file(path)
    path.write_bytes(POINTS)
    with pytest.raises(UffError, match="the file became shorter while it was read") as refused:
        list(contents)
    # as it comes out of a child process
    assert str(pickle.loads(pickle.dumps(refused.value))) == str(refused.value)


def test_a_refused_row_is_named_by_its_line() -> None:
    good = b"1.0 2.0 \n3.0 4.0 \n"
    for body, count, line in (
        (b"1.0 2.0 \n3.0 abc \n", 4, 21),
        (good + b"5.0 6.0 \n", 4, 22),
        (good, 6, 22),
    ):
        with pytest.raises(Refusal) as refused:
            real_block(body, (4, 4), count, 20)
        assert refused.value.line == line
    assert real_block(good, (4, 4), 4, 20)[0].tolist() == [1, 2, 3, 4]


# --- real files ---------------------------------------------------------------------------------------------------------

COUNTS: dict[str, dict[type, int]] = {
    "murml-uff/UFF58B.FRF": {Frf: 1},
    "murml-uff/coords.unv": {GridPoint: 26, TraceLine: 3},
    "pyuff/2411-and-2414.uff": {FileHeader: 1, GridPoint: 441, Element: 400, ModeShape: 10},
    "pyuff/Artemis-export---Geometry-RPBC_setup_05_14102016_105117.uff": {
        GridPoint: 74,
        TraceLine: 2,
        Element: 108,
    },
    "pyuff/NX-simulation-output.uff": {
        FileHeader: 1,
        Units: 1,
        CoordinateSystem: 18,
        GridPoint: 18,
        Element: 17,
        ModeShape: 176,
    },
    "pyuff/Sample_UFF58_ascii.uff": {Function: 1},
    "pyuff/Sample_UFF58b_bin.uff": {Function: 1},
    "pyuff/TestLab-161-164-18-15-82.uff": {
        FileHeader: 1,
        Units: 1,
        CoordinateSystem: 36,
        GridPoint: 36,
        TraceLine: 3,
    },
    "pyuff/binary8byte.uff": {TimeResponse: 1},
    "pyuff/groups_test.uff": {Units: 1, CoordinateSystem: 1, GridPoint: 74, Element: 341},
    "pyuff/measurement_v1.uff": {Frf: 3},
    "pyuff/mesh_Oros-modal_uff15_uff2412.uff": {CoordinateSystem: 1, GridPoint: 96, Element: 72},
    "pyuff/non_ascii_header.uff": {Frf: 1},
    "pyuff/sample_dataset58_psd.uff": {Function: 1},
    "pyuff/sample_dataset58_psd_crlf.unv": {Function: 1},
    "pyuff/time-history-not-all-columns-filled.uff": {TimeResponse: 1},
    "pyuff/uff55-sample_test-record10.uff": {ModeShape: 1},
    "pyuff/uff55_translation.uff": {ModeShape: 3},
    "pyuff/uff55_translation_rotation.uff": {ModeShape: 1},
}
IGNORED = {
    "murml-uff/coords.unv": {"734"},
    "pyuff/NX-simulation-output.uff": {"2400"},
    "pyuff/groups_test.uff": {"2467"},
}


def corpus_file(name: str) -> Reading:
    """What a file of the corpus holds."""
    return load(shared_file("UFF_CORPUS", "uff-corpus", name))


@pytest.mark.parametrize("name", COUNTS)
def test_counts(name: str) -> None:
    reading = corpus_file(name)
    assert Counter(type(content) for content in reading.contents) == COUNTS[name]
    assert {r.type for r in reading.reports if r.outcome != "read"} == IGNORED.get(name, set())
    assert all(r.reason for r in reading.reports if r.outcome == "ignored")
    assert "refused" not in reading.outcomes


def test_whatever_else_the_corpus_holds_is_read_or_refused_with_a_reason(uff_corpus: Path) -> None:
    """The corpus is other people's and may grow."""
    for path in sorted(
        path for path in uff_corpus.glob("*/*") if str(path.relative_to(uff_corpus)) not in COUNTS
    ):
        with suppress(UffError):  # no UFF file; the error says why
            reading = load(path)
            assert reading.outcomes, path
            assert all(report.reason for report in reading.reports if report.outcome != "read"), (
                path
            )


def test_functions_of_other_programs_hold_what_pyuff_reads(uff_corpus: Path) -> None:
    """A guard against a dialect that our reader understands otherwise than others do."""
    compared = 0
    for path in sorted(uff_corpus.glob("pyuff/*58*")):
        theirs = pyuff.UFF(str(path)).read_sets()
        frames = [frame for frame in scan(path, Limits()) if frame.type in ("58", "58b")]
        sets = [each for each in np.atleast_1d(theirs) if each["type"] == 58]
        for frame, other in zip(frames, sets, strict=True):
            ours = read_58(frame, path.read_bytes()[frame.start : frame.end])
            np.testing.assert_array_equal(ours.values, other["data"].astype(ours.values.dtype))
            np.testing.assert_array_equal(ours.axis.points(), other["x"])
            assert ours.response_point == other["rsp_node"]
            compared += 1
    assert compared >= 3


def test_text_and_binary_of_one_measurement_read_alike() -> None:
    (text,), (binary,) = (
        corpus_file(f"pyuff/Sample_UFF58{n}.uff").of(Function) for n in ("_ascii", "b_bin")
    )
    assert text.values.dtype == binary.values.dtype == np.float32
    assert len(text.values) == len(binary.values) == 79292
    np.testing.assert_allclose(text.values, binary.values, rtol=6e-6)  # E13.5 holds six digits
    np.testing.assert_array_equal(text.abscissa.points(), binary.abscissa.points())
    assert (text.name, text.unit, text.label) == ("time response", "Pa", "Mic 01.0Scalar")
    assert text.label == binary.label


def test_line_ends_do_not_matter() -> None:
    lf, crlf = (
        corpus_file(f"pyuff/sample_dataset58_psd{n}").of(Function)[0] for n in (".uff", "_crlf.unv")
    )
    np.testing.assert_array_equal(lf.values, crlf.values)
    np.testing.assert_array_equal(lf.abscissa.points(), np.arange(3201.0))
    assert lf.name == "power spectral density"
    assert lf.unit == "g²/Hz"


def test_measured_frfs_peak_at_their_resonances() -> None:
    frfs = corpus_file("pyuff/measurement_v1.uff").of(Frf)
    assert {f.quantity for f in frfs} == {"accelerance"}
    assert [(f.response_point, f.response_direction, f.reference_point) for f in frfs] == [
        (1, 1, n) for n in (1, 2, 3)
    ]
    response, hz = np.max([np.abs(f.values) for f in frfs], axis=0), frfs[0].frequency.points()
    for resonance in (51.5, 142.2, 278.7, 460.4, 687.2, 958.5):
        near = np.abs(hz - resonance) < 15
        assert abs(hz[near][np.argmax(response[near])] - resonance) < 1.5  # lines are 1 Hz apart


def test_units_and_dofs_of_measured_frfs() -> None:
    """Of a binary mobility; and of one whose header says general and whose label the units."""
    reading = corpus_file("murml-uff/UFF58B.FRF")
    (frf,) = reading.of(Frf)
    assert (frf.quantity, frf.response_point, frf.values.dtype) == ("mobility", 192, np.complex64)
    assert (frf.frequency.points()[0], frf.frequency.points()[-1]) == (0.0, 20000.0)
    assert frf.id_lines[3].startswith("@2173,1822")
    assert "assumed" in reading.notes
    (frf,) = corpus_file("pyuff/non_ascii_header.uff").of(Frf)
    assert frf.quantity == "accelerance"
    np.testing.assert_allclose(
        frf.values[:2], [4.07994e-01, -5.99924e-02 - 5.53260e-02j], rtol=1e-7
    )


def test_a_simulations_mode_shapes_and_coordinates() -> None:
    """Coordinates of set 2411 are in the part's system, whatever system it names."""
    reading = corpus_file("pyuff/NX-simulation-output.uff")
    points = {p.number: p.xyz_m for p in reading.of(GridPoint)}
    expected = (2.0940900802612305e-2, 1.3069399833679199e-2, 1.01075216497076e-3)
    np.testing.assert_allclose(points[9581], expected, rtol=1e-12)
    # a straight bar along z
    assert {round(x, 9) for x, _, _ in points.values()} == {round(2.0940900802612305e-2, 9)}
    first = reading.of(ModeShape)[0]
    assert (first.frequency_hz, first.kind, first.values.shape) == (23383.2, "normal", (18, 3))
    np.testing.assert_array_equal(first.values[0], [1.95655e-02, 1.30354e01, -1.92335e-07])


def test_complex_eigenvalue_of_set_55() -> None:
    (mode,) = corpus_file("pyuff/uff55-sample_test-record10.uff").of(ModeShape)
    size = abs(-0.1111111 + 41.11111j)
    assert mode.frequency_hz == pytest.approx(size / (2 * np.pi), rel=1e-12)
    assert mode.damping_ratio == pytest.approx(0.1111111 / size, rel=1e-12)
    assert mode.points.tolist() == [111111, 60101]
    np.testing.assert_array_equal(mode.values[1], [0, 0, -4.111111e-02 - 1.111111e-02j])


@pytest.mark.parametrize("name", ["paper-like", "free-1pct"])
def test_independent_frfs_of_beams(name: str) -> None:
    reading = load(shared_file("BLIND_OPEN", "blind-open", f"{name}.uff"))
    assert Counter(type(c) for c in reading.contents) == {
        FileHeader: 1,
        Units: 1,
        GridPoint: 33,
        Frf: 33,
    }
    assert set(reading.outcomes) == {"read"}
    assert reading.notes == ""
    for frf in reading.of(Frf):
        assert (frf.quantity, frf.values.dtype) == ("accelerance", np.complex128)
        assert (frf.response_direction, frf.reference_direction) == (3, 3)


# --- damaged files ------------------------------------------------------------------------------------------------------


def test_no_silent_change(tmp_path: Path) -> None:
    table, silent = uff_damage.run(150, 1, tmp_path)
    assert [(name, kind) for name, kind, _ in silent] == []
    assert sum(counts.total() for counts in table.values()) == 150
    assert all(counts for counts in table.values())


def test_the_verdict_knows_a_silent_change(tmp_path: Path) -> None:
    """The judge is judged: two changed ordinates without a word, or a lost dataset, do not pass."""
    path = tmp_path / "file.uff"
    data = uff_damage.originals()["text double even"]
    path.write_bytes(data)
    sound, damaged = uff_damage.load(path), uff_damage.load(path)
    frf = damaged.contents[3][0]
    frf.values[:2] += 1
    assert uff_damage.judge(sound, damaged, "byte flip") == "SILENT CHANGE"
    frf.values[:2] -= 1
    damaged.reports.pop()
    damaged.contents.pop()
    assert uff_damage.judge(sound, damaged, "byte flip") == "SILENT CHANGE"


@pytest.mark.long
def test_floods_stay_within_bounds(tmp_path: Path) -> None:
    """Of 20 to 40 MB each; a tenth of the datasets that are taken, and so of the memory. In short
    limits are kept, above.
    """
    assert Limits().datasets == 200_000
    files = {kind: flood() for kind, flood in uff_damage.FLOODS.items()}
    for kind, (memory, outcome) in uff_damage.flood(files, tmp_path, most=20_000).items():
        assert "refused" in outcome, kind
        assert memory < (12 if "empty datasets" in kind else 120), kind


def test_memory_follows_the_largest_dataset_not_the_file(tmp_path: Path) -> None:
    axis = Axis(0.5, 0.5, 10_000)
    frf = Frf(
        0,
        "FRF 1Z/1Z",
        ("beam", "", "", "", ""),
        1,
        3,
        1,
        -3,
        "accelerance",
        axis,
        np.ones(10_000, dtype=complex),
    )
    many = b"".join(uff_damage.encode([frf] * 100, binary=True))
    memory, outcome = uff_damage.flood({"16 MB": many}, tmp_path)["16 MB"]
    assert outcome.count("read: None") == 101  # with the units
    assert memory < 10  # 3; 17 where the contents are kept
