"""What is written is read back, by our own reader and by pyuff: bit by bit where the format can
hold the bits.
"""

import tempfile
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import pyuff
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from modalbase.formats.uff import (
    Axis,
    CoordinateSystem,
    FileHeader,
    Frf,
    Function,
    GridPoint,
    ModeShape,
    Units,
)
from modalbase.formats.uff.geometry import read_151
from modalbase.formats.uff.text import Refusal
from modalbase.formats.uff.write import encode, write_file
from tests.support.uff import load

IDS = ("label", "two", "three", "four", "five")
QUICK = settings(max_examples=25)
finite = st.floats(allow_nan=False, allow_infinity=False)
sane = st.floats(1e-30, 1e30) | st.floats(-1e30, -1e-30) | st.just(0.0)
text = st.text(st.characters(codec="utf-8", categories=("L", "N", "P", "Zs")), max_size=20)
directions = st.integers(-6, 6)
labels = st.integers(0, 10**9)
axes = st.one_of(
    st.builds(lambda a, d: (a, d), st.floats(0, 1e4), st.floats(1e-3, 1e3)),
    st.sampled_from([(0.0, 0.1953125), (1.0, 1.0), (0.0, 0.06103515625)]),
)


@st.composite
def frfs(draw: st.DrawFn, parts: st.SearchStrategy[float] = finite) -> Frf:
    n = draw(st.integers(1, 20))
    values = np.array(draw(st.lists(parts, min_size=2 * n, max_size=2 * n))).view(np.complex128)
    if draw(st.booleans()):
        axis = Axis(*draw(axes), n) if n > 1 else Axis(draw(axes)[0], 0.0, 1)
    else:
        start, step = draw(axes)
        axis = Axis(
            start,
            0.0,
            n,
            start + step * np.cumsum(draw(hnp.arrays(np.int64, n, elements=st.integers(1, 9)))),
        )
    return Frf(
        0, draw(text).strip(), IDS, draw(labels), draw(directions), draw(labels), draw(directions),
        draw(st.sampled_from(["accelerance", "mobility", "receptance"])), axis, values, draw(st.integers(0, 99)),
    )  # fmt: skip


def read_back(contents: list, **options: object) -> tuple[list, list[dict]]:
    """Contents as our reader and as pyuff find them."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "out.uff"
        write_file(path, contents, **options)
        reading = load(path)
        assert set(reading.outcomes) == {"read"}, reading.reasons
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ResourceWarning)
            theirs = pyuff.UFF(str(path)).read_sets()
        return reading.contents, theirs if isinstance(theirs, list) else [theirs]


def same_bits(a: np.ndarray, b: np.ndarray) -> bool:
    return a.dtype == b.dtype and a.tobytes() == b.tobytes()


@QUICK
@given(frfs())
def test_binary_frfs_come_back_bit_by_bit(frf: Frf) -> None:
    (_, ours), (_, theirs) = read_back([frf])
    assert same_bits(ours.values, frf.values)
    assert same_bits(ours.frequency.points(), frf.frequency.points())
    # pyuff loses the sign of zeros: it adds 1j * imag
    assert np.array_equal(theirs["data"], frf.values)
    assert np.array_equal(theirs["x"], frf.frequency.points())
    for name in (
        "quantity",
        "label",
        "response_point",
        "response_direction",
        "reference_point",
        "reference_direction",
        "load_case",
    ):
        assert getattr(ours, name) == getattr(frf, name), name


@QUICK
@given(frfs(sane))
def test_text_frfs_come_back_to_13_digits(frf: Frf) -> None:
    (_, ours), (_, theirs) = read_back([frf], binary=False)
    for part in ("real", "imag"):
        np.testing.assert_allclose(
            getattr(ours.values, part), getattr(frf.values, part), rtol=5.1e-13
        )
    np.testing.assert_array_equal(theirs["data"], ours.values)
    np.testing.assert_allclose(ours.frequency.points(), frf.frequency.points(), rtol=6e-7)


@QUICK
@given(
    hnp.arrays(
        np.float32,
        st.integers(1, 10).map(lambda n: 2 * n),
        elements={"min_value": -(2**99), "max_value": 2**99},
    )
)
def test_single_precision_comes_back_single(parts: np.ndarray) -> None:
    values = parts.view(np.complex64)
    frf = Frf(0, "x", IDS, 1, 3, 2, 3, "mobility", Axis(0.0, 0.5, len(values)), values)
    (_, ours), (_, theirs) = read_back([frf])
    assert same_bits(ours.values, values)
    np.testing.assert_array_equal(theirs["data"], values)
    (_, ours), _ = read_back([frf], binary=False)
    np.testing.assert_allclose(
        ours.values.astype(np.complex128).view(float), parts.astype(float), rtol=6e-6
    )


@QUICK
@given(
    st.dictionaries(
        st.integers(1, 10**9), st.tuples(finite, finite, finite), min_size=1, max_size=10
    )
)
def test_grid_points_come_back_bit_by_bit(points: dict[int, tuple[float, float, float]]) -> None:
    given_points = [GridPoint(number, xyz) for number, xyz in points.items()]
    (_, *ours), (_, theirs) = read_back(given_points)
    assert [repr(p) for p in ours] == [repr(p) for p in given_points]
    assert theirs["node_nums"].tolist() == list(points)
    for i, name in enumerate("xyz"):
        assert theirs[name].tolist() == [xyz[i] for xyz in points.values()]


@QUICK
@given(
    st.booleans(),
    st.sampled_from([3, 6]),
    st.floats(1e-3, 1e5),
    st.floats(0, 0.99),
    st.integers(0, 2**32),
)
def test_mode_shapes(
    complex_mode: bool, components: int, hz: float, damping: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    values = rng.standard_normal((4, components)) + 1j * complex_mode * rng.standard_normal(
        (4, components)
    )
    mode = ModeShape(
        0,
        "mode",
        2,
        hz,
        damping,
        np.array([1, 2, 30, 4]),
        values,
        "complex" if complex_mode else "normal",
    )
    (_, ours), (_, theirs) = (
        read_back([mode]) if not (complex_mode and components == 6) else (_ours_only(mode), (0, {}))
    )
    assert (ours.kind, ours.mode, ours.label) == (mode.kind, 2, "mode")
    assert ours.points.tolist() == [1, 2, 30, 4]
    np.testing.assert_allclose(ours.values, values, rtol=6e-6, atol=1e-12)
    assert ours.frequency_hz == pytest.approx(hz, rel=2e-6)
    if damping == 0 and not complex_mode:
        assert np.isnan(ours.damping_ratio)  # the format does not distinguish none from unknown
    else:
        assert ours.damping_ratio == pytest.approx(damping, rel=3e-6, abs=1e-9)
    if theirs:
        np.testing.assert_array_equal(theirs["r1"], ours.values[:, 0])


def _ours_only(mode: ModeShape) -> tuple:
    """pyuff cannot read six complex values a node."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "out.uff"
        write_file(path, [mode])
        return tuple(load(path).contents)


@pytest.mark.parametrize("binary", [True, False])
def test_functions(binary: bool) -> None:
    x = np.array([1.0, 1.5, 4.0])
    function = Function(
        0, "coh", IDS, 6, 2, 3, 1, -3, Axis(1.0, 0.0, 3, x), "Hz", np.array([0.25, 0.5, 1.0]), ""
    )
    (_, ours), (_, theirs) = read_back([function], binary=binary)
    assert (ours.name, ours.unit, ours.abscissa_unit) == ("coherence", "", "Hz")
    assert same_bits(ours.values, function.values)
    np.testing.assert_array_equal(theirs["x"], x)


def test_header_and_units() -> None:
    header = FileHeader(0, "BEAM", "a beam", "modalbase", "21-Nov-15 09:00:00")
    # of the file that was read; what is written is in SI
    inches = Units(0, 7, "in", 39.37, 0.2248, 1.0, 0.0)
    (ours, units), theirs = read_back([header, inches])
    assert ours == replace(header, dataset=1)
    assert (units.length, units.force) == (1.0, 1.0)
    assert theirs[0]["model_name"] == "BEAM"


@pytest.mark.parametrize(
    "label", ["-1", "    -1", "a    -1", "two\nlines", "x" * 200, "±" * 79, "\x00\x85"]
)
def test_labels_cannot_break_the_framing(label: str) -> None:
    frf = Frf(0, label, IDS, 1, 3, 2, 3, "mobility", Axis(0.0, 1.0, 1), np.array([1 + 1j]))
    for binary in (True, False):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "out.uff"
            write_file(path, [frf], binary=binary)
            (ours,) = load(path).of(Frf)
            assert ours.values.tolist() == [1 + 1j]
            assert ours.label == "".join(
                c if c.isprintable() else " " for c in label
            ).strip().encode()[:80].decode(errors="ignore")


def test_what_cannot_be_written_is_refused() -> None:
    axis = Axis(0.0, 1.0, 1)
    frf = Frf(0, "x", IDS, 1, 3, 2, 3, "mobility", axis, np.array([np.nan + 0j]))
    for content, message in (
        (frf, "NaN or infinite"),
        (
            replace(frf, frequency=Axis(np.nan, 1.0, 1), values=np.array([1j])),
            "nan cannot be written",
        ),
        (
            ModeShape(0, "x", 7, 1.0, 0.1, np.array([1]), np.full((1, 3), np.nan + 0j), "normal"),
            "mode 7 holds NaN",
        ),
        (GridPoint(1, (np.inf, 0.0, 0.0)), "grid point 1 is at"),
        (GridPoint(10**11, (0.0, 0.0, 0.0)), "does not fit into 10 columns"),
        (
            Function(0, "x", IDS, 1, 0, 0, 0, 0, axis, "s" * 21, np.array([1.0]), ""),
            "does not fit into 20 columns",
        ),
    ):
        with pytest.raises(ValueError, match=message):
            b"".join(encode([content]))
    system = CoordinateSystem(0, 1, "x", "cartesian", np.zeros(3), np.eye(3))
    with pytest.raises(TypeError, match="CoordinateSystem is not written"):
        b"".join(encode([system]))


def test_a_file_of_nothing_has_units_and_a_header_has_seven_lines() -> None:
    assert b"".join(encode([])).split()[1] == b"164"
    lines = b"".join(b"line %d\n" % n for n in range(9))
    with pytest.raises(Refusal, match="holds 9 lines, expected 7"):
        read_151(lines, 1)
