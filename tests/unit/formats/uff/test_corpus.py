"""Real files: every one of the corpus is read with the right counts, or reported for what it is."""

from collections import Counter
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from modalbase.formats.uff import (
    CoordinateSystem,
    Element,
    FileHeader,
    Frf,
    Function,
    GridPoint,
    ModeShape,
    TimeResponse,
    TraceLine,
    UffError,
    Units,
)
from tests.support.places import shared_file
from tests.support.uff import Reading, load

COUNTS: dict[str, dict[type, int]] = {
    "murml-uff/UFF58B.FRF": {Frf: 1},
    "murml-uff/coords.unv": {GridPoint: 26, TraceLine: 3},
    "pyuff/2411-and-2414.uff": {FileHeader: 1, GridPoint: 441, Element: 400, ModeShape: 10},
    "pyuff/Artemis-export---Geometry-RPBC_setup_05_14102016_105117.uff": {GridPoint: 74, TraceLine: 2, Element: 108},
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
    found = corpus_file(name)
    assert Counter(type(content) for content in found.contents) == COUNTS[name]
    assert {r.type for r in found.reports if r.outcome != "read"} == IGNORED.get(name, set())
    assert all(r.reason for r in found.reports if r.outcome == "ignored")
    assert "refused" not in found.outcomes


def test_whatever_else_the_corpus_holds_is_read_or_refused_with_a_reason(uff_corpus: Path) -> None:
    """The corpus is other people's and may grow."""
    for path in sorted(path for path in uff_corpus.glob("*/*") if str(path.relative_to(uff_corpus)) not in COUNTS):
        with suppress(UffError):  # no UFF file; the error says why
            found = load(path)
            assert found.outcomes, path
            assert all(report.reason for report in found.reports if report.outcome != "read"), path


def test_text_and_binary_of_one_measurement_read_alike() -> None:
    (text,), (binary,) = (corpus_file(f"pyuff/Sample_UFF58{n}.uff").of(Function) for n in ("_ascii", "b_bin"))
    assert text.values.dtype == binary.values.dtype == np.float32
    assert len(text.values) == len(binary.values) == 79292
    np.testing.assert_allclose(text.values, binary.values, rtol=6e-6)  # E13.5 holds six digits
    np.testing.assert_array_equal(text.abscissa.points(), binary.abscissa.points())
    assert (text.name, text.unit, text.label) == ("time response", "Pa", "Mic 01.0Scalar")
    assert text.label == binary.label


def test_line_ends_do_not_matter() -> None:
    lf, crlf = (corpus_file(f"pyuff/sample_dataset58_psd{n}").of(Function)[0] for n in (".uff", "_crlf.unv"))
    np.testing.assert_array_equal(lf.values, crlf.values)
    np.testing.assert_array_equal(lf.abscissa.points(), np.arange(3201.0))
    assert lf.name == "power spectral density"
    assert lf.unit == "g²/Hz"


def test_measured_frfs_peak_at_their_resonances() -> None:
    frfs = corpus_file("pyuff/measurement_v1.uff").of(Frf)
    assert {f.quantity for f in frfs} == {"accelerance"}
    assert [(f.response_point, f.response_direction, f.reference_point) for f in frfs] == [
        (1, 1, 1),
        (1, 1, 2),
        (1, 1, 3),
    ]
    response = np.max([np.abs(f.values) for f in frfs], axis=0)
    hz = frfs[0].frequency.points()
    for resonance in (51.5, 142.2, 278.7, 460.4, 687.2, 958.5):
        near = np.abs(hz - resonance) < 15
        assert abs(hz[near][np.argmax(response[near])] - resonance) < 1.5  # lines are 1 Hz apart


def test_binary_frf_of_a_mobility() -> None:
    found = corpus_file("murml-uff/UFF58B.FRF")
    (frf,) = found.of(Frf)
    assert (frf.quantity, frf.response_point, frf.values.dtype) == ("mobility", 192, np.complex64)
    assert (frf.frequency.points()[0], frf.frequency.points()[-1]) == (0.0, 20000.0)
    assert frf.id_lines[3].startswith("@2173,1822")
    assert "assumed" in found.notes


def test_units_in_the_label_where_the_header_says_general() -> None:
    (frf,) = corpus_file("pyuff/non_ascii_header.uff").of(Frf)
    assert frf.quantity == "accelerance"
    np.testing.assert_allclose(frf.values[:2], [4.07994e-01, -5.99924e-02 - 5.53260e-02j], rtol=1e-7)


def test_coordinates_of_set_2411_are_in_the_parts_system_whatever_system_it_names() -> None:
    points = {p.number: p.xyz_m for p in corpus_file("pyuff/NX-simulation-output.uff").of(GridPoint)}
    np.testing.assert_allclose(
        points[9581], (2.0940900802612305e-2, 1.3069399833679199e-2, 1.01075216497076e-3), rtol=1e-12
    )
    assert {round(x, 9) for x, _, _ in points.values()} == {round(2.0940900802612305e-2, 9)}  # a straight bar along z


def test_mode_shapes_of_a_simulation() -> None:
    found = corpus_file("pyuff/NX-simulation-output.uff")
    first = found.of(ModeShape)[0]
    assert (first.frequency_hz, first.kind, first.values.shape) == (23383.2, "normal", (18, 3))
    np.testing.assert_array_equal(first.values[0], [1.95655e-02, 1.30354e01, -1.92335e-07])


def test_complex_eigenvalue_of_set_55() -> None:
    (mode,) = corpus_file("pyuff/uff55-sample_test-record10.uff").of(ModeShape)
    size = abs(-0.1111111 + 41.11111j)
    assert mode.frequency_hz == pytest.approx(size / (2 * np.pi), rel=1e-12)
    assert mode.damping_ratio == pytest.approx(0.1111111 / size, rel=1e-12)
    assert mode.points.tolist() == [111111, 60101]
    np.testing.assert_array_equal(mode.values[1], [0, 0, -4.111111e-02 - 1.111111e-02j])


def test_a_licence_is_no_uff_file() -> None:
    with pytest.raises(Exception, match="not a UFF file: it opens with 'MIT License'"):
        corpus_file("pyuff/LICENSE")


@pytest.mark.parametrize("name", ["paper-like", "cantilever-1pct", "cantilever-5pct-sensor-mass", "free-1pct"])
def test_independent_frfs_of_beams(name: str) -> None:
    found = load(shared_file("BLIND_OPEN", "blind-open", f"{name}.uff"))
    assert Counter(type(c) for c in found.contents) == {FileHeader: 1, Units: 1, GridPoint: 33, Frf: 33}
    assert set(found.outcomes) == {"read"}
    assert found.notes == ""
    for frf in found.of(Frf):
        assert (frf.quantity, frf.values.dtype) == ("accelerance", np.complex128)
        assert (frf.response_direction, frf.reference_direction) == (3, 3)
