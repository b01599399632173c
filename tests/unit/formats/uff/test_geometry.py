"""Grid points and directions in coordinate systems of their own, trace lines, elements, mode
shapes.
"""

import re
from typing import Any

import numpy as np
import pytest

from modalbase.formats.uff import CoordinateSystem, Element, Frf, GridPoint, ModeShape, TraceLine
from tests.support.uff import Read, dataset, set_58, set_164

FRF_ROW = "   1.00000000000e+00   0.00000000000e+00"


def point(
    label: int,
    definition: int = 0,
    displacement: int = 0,
    xyz: tuple[float, float, float] = (1.0, 2.0, 3.0),
) -> str:
    return f"{label:10d}{definition:10d}{displacement:10d}{1:10d}" + "".join(
        f"{x:13.5e}" for x in xyz
    )


def system_18(
    label: int, origin: tuple, on_x: tuple, on_xz: tuple, kind: int = 0, reference: int = 0
) -> list[str]:
    rows = "".join(f"{x:13.5e}" for x in (*origin, *on_x)), "".join(f"{x:13.5e}" for x in on_xz)
    return [f"{label:10d}{kind:10d}{reference:10d}{8:10d}{1:10d}", f"CS{label}", *rows]


def system_2420(label: int, axes: np.ndarray, origin: tuple, kind: int = 0) -> bytes:
    rows = ["".join(f"{x:25.16e}" for x in row) for row in (*axes, origin)]
    return dataset("2420", f"{1:10d}", "Part", f"{label:10d}{kind:10d}{8:10d}", f"CS{label}", *rows)


TURNED = system_18(4, (10, 0, 0), (10, 1, 0), (10, 0, 1))  # x along global y, y along -x, z along z


def test_definition_systems_are_applied(read: Read) -> None:
    reading = read(set_164(1000.0) + dataset("18", *TURNED) + dataset("15", point(1, 4), point(2)))
    (system,) = reading.of(CoordinateSystem)
    np.testing.assert_allclose(system.axes, [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], atol=1e-15)
    one, two = reading.of(GridPoint)
    np.testing.assert_allclose(one.xyz_m, (0.010 - 0.002, 0.001, 0.003), atol=1e-15)
    np.testing.assert_allclose(two.xyz_m, (0.001, 0.002, 0.003), atol=1e-15)
    assert "coordinates in systems 4 brought to the global system" in reading.notes


def test_a_system_given_in_another(read: Read) -> None:
    nested = system_18(5, (0, 1, 0), (1, 1, 0), (0, 1, 1), reference=4)
    reading = read(dataset("15", point(1, 5)) + dataset("18", *TURNED, *nested))
    np.testing.assert_allclose(reading.of(GridPoint)[0].xyz_m, (10 - 1 - 2, 1, 3), atol=1e-12)
    parts = (
        set_164(1000.0)
        + dataset("15", point(1, 5))
        + dataset("18", *TURNED)
        + dataset("18", *nested)
    )
    reading = read(parts)
    np.testing.assert_allclose(reading.of(GridPoint)[0].xyz_m, (7e-3, 1e-3, 3e-3), atol=1e-15)
    # the point of the xz plane need not lie on z
    skewed = system_18(6, (1, 2, 3), (3, 2, 3), (2, 2, 4))
    (system,) = read(dataset("18", *skewed)).of(CoordinateSystem)
    np.testing.assert_allclose(system.axes, np.eye(3), atol=1e-15)


@pytest.mark.parametrize(
    ("kind", "coordinates", "expected"),
    [(1, (2.0, 30.0, 3.0), (3**0.5, 1.0, 3.0)), (2, (2.0, 60.0, 30.0), (1.5, 0.75**0.5, 1.0))],
)
def test_cylindrical_and_spherical_coordinates(
    read: Read, kind: int, coordinates: tuple, expected: tuple
) -> None:
    reading = read(
        system_2420(3, np.eye(3), (0, 0, 0), kind) + dataset("15", point(1, 3, 0, coordinates))
    )
    np.testing.assert_allclose(reading.of(GridPoint)[0].xyz_m, expected, atol=1e-12)


def test_an_undefined_system_is_refused_and_label_1_without_any_is_global(read: Read) -> None:
    reading = read(dataset("15", point(1, 7)))
    assert (
        "grid point 1 is given in coordinate system 7, which the file does not define"
        in reading.reasons
    )
    reading = read(dataset("15", point(1, 1)))
    assert (
        "coordinate system 1 is not defined in the file; taken as the global system"
        in reading.notes
    )
    damaged = dataset("18", *TURNED).replace(b"CS4", b"CS4\nCS4")
    assert read(damaged + dataset("15", point(1, 1))).outcomes == ["refused", "refused"]


@pytest.mark.parametrize(
    ("stated", "stored"), [(1, 2), (2, -1), (-2, 1), (3, 3), (4, 5), (-5, 4), (0, 0)]
)
def test_directions_along_displacement_systems(read: Read, stated: int, stored: int) -> None:
    data = (
        set_58(FRF_ROW, points=1, response=(7, stated))
        + dataset("15", point(7, 0, 4), point(1))
        + dataset("18", *TURNED)
    )
    if abs(stated) > 3:
        data = data.replace(b"m/s^2", b"NONE ")
    reading = read(data)
    assert reading.of(Frf)[0].response_direction == stored, reading.reasons
    assert ("of the global system" in reading.notes) == (stated not in (0, 3))


def test_a_system_that_is_not_there_is_the_global_one_and_noted_once(read: Read) -> None:
    frf = set_58(FRF_ROW, points=1, response=(1, -3), reference=(2, 3), kind=6)
    reading = read(dataset("15", point(1, 0, 1), point(2, 0, 1)) + frf)
    (taken,) = reading.of(Frf)
    assert (taken.response_direction, taken.reference_direction) == (-3, 3)
    assert (
        reading.reports[-1].notes.count(
            "coordinate system 1 is not defined in the file; taken as the global system"
        )
        == 1
    )


def test_oblique_directions_are_refused(read: Read) -> None:
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    data = system_2420(9, np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]), (0, 0, 0)) + dataset(
        "15", point(7, 0, 9), point(1)
    )
    assert read(data + set_58(FRF_ROW, points=1, response=(7, 3))).outcomes == [
        "read",
        "read",
        "read",
    ]
    assert (
        "30.0° off the nearest global axis"
        in read(data + set_58(FRF_ROW, points=1, response=(7, 1))).reasons
    )


def test_faults_of_set_2411(read: Read) -> None:
    labels, coordinates = (
        f"{1:10d}{0:10d}{0:10d}{11:10d}",
        "".join(f"{x:25.16e}" for x in (0.1, 0.2, 0.3)),
    )
    good = read(dataset("2411", labels, coordinates.replace("e", "D")))
    assert good.of(GridPoint)[0].xyz_m == (0.1, 0.2, 0.3)
    short = read(dataset("2411", labels, " 0.1  .2 3.D-1"))  # in no columns, but three reals
    assert short.of(GridPoint)[0].xyz_m == (0.1, 0.2, 0.3), short.reasons
    for lines in (
        [labels],
        [labels, labels, coordinates],
        [coordinates, labels],
        [labels + "  7", coordinates],
        [labels, coordinates.replace("e-01", "x-01", 1)],
    ):
        assert read(dataset("2411", *lines)).outcomes == ["refused"]


def test_trace_lines_and_elements(read: Read) -> None:
    reading = read(
        dataset(
            "82",
            f"{2:10d}{5:10d}{1:10d}",
            "edge",
            "".join(f"{p:10d}" for p in (1, 2, 0, 3, 4, 0, 0, 0)),
        )
    )
    assert reading.of(TraceLine) == [TraceLine(1, 2, "edge", (1, 2, 0, 3, 4))]
    assert read(dataset("82", f"{2:10d}{5:10d}{1:10d}", "edge", f"{1:10d}{2:10d}")).outcomes == [
        "refused"
    ]
    beam = [
        f"{1:10d}{21:10d}{1:10d}{1:10d}{7:10d}{2:10d}",
        f"{0:10d}{1:10d}{1:10d}",
        f"{5:10d}{6:10d}",
    ]
    quad = [f"{2:10d}{44:10d}{1:10d}{1:10d}{7:10d}{4:10d}", f"{1:10d}{2:10d}{3:10d}{4:10d}"]
    assert read(dataset("2412", *beam, *quad)).of(Element) == [
        Element(1, 21, (5, 6)),
        Element(2, 44, (1, 2, 3, 4)),
    ]
    for count in (-4, 3, 5, 10**9):
        assert read(dataset("2412", quad[0][:50] + f"{count:10d}", quad[1])).outcomes == ["refused"]


SHAPE_55 = [
    *["NONE"] * 5,
    f"{1:10d}{2:10d}{2:10d}{8:10d}{2:10d}{3:10d}",
    f"{2:10d}{4:10d}{1:10d}{1:10d}",
    "  1.00000e+01  0.00000e+00  2.00000e-02  0.00000e+00",
    f"{1:10d}",
    "  1.00000e+00  2.00000e+00  3.00000e+00",
]


def test_set_55(read: Read) -> None:
    (mode,) = read(dataset("55", *SHAPE_55)).of(ModeShape)
    assert (mode.frequency_hz, mode.damping_ratio, mode.kind, mode.mode) == (
        10.0,
        0.02,
        "normal",
        1,
    )
    np.testing.assert_array_equal(mode.values, [[1, 2, 3]])
    rigid = changed_55(7, "  0.00000e+00  0.00000e+00  0.00000e+00  0.00000e+00")
    (mode,) = read(rigid).of(ModeShape)
    assert mode.frequency_hz == 0.0
    assert np.isnan(mode.damping_ratio)
    reading = read(changed_55(7, "  1.00000e+01  0.00000e+00  0.00000e+00  4.00000e-02"))
    assert reading.of(ModeShape)[0].damping_ratio == 0.02
    assert "hysteretic damping ratio 0.04 taken as the viscous ratio 0.02" in reading.notes
    reading = read(changed_55(7, "  1.00000e+01  0.00000e+00  8.00000e-01  0.00000e+00"))
    assert "its viscous damping ratio is 0.8, 80 %: were per cent written?" in reading.notes


def test_a_complex_mode_with_rotations_of_set_2414(read: Read) -> None:
    """λ = -3 + 4i rad/s: |λ|/2π and 3/5."""
    numbers = np.arange(1.0, 13.0)
    rows = ["".join(f"{x:13.5e}" for x in part) for part in (numbers[:6], numbers[6:])]
    integers = "".join(f"{i:10d}" for i in (0, 0, 0, 0, 0, 4, 0, 0))
    eigenvalue = "".join(f"{x:13.5e}" for x in (-3, 4, 0, 0, 0, 0))
    definition = f"{1:10d}{3:10d}{3:10d}{8:10d}{5:10d}{6:10d}"
    blank = f"{0.0:13.5e}" * 6
    lines = [
        f"{1:10d}",
        "mode",
        f"{1:10d}",
        *["NONE"] * 5,
        definition,
        integers,
        integers,
        blank,
        eigenvalue,
        f"{9:10d}",
        *rows,
    ]
    (mode,) = read(dataset("2414", *lines)).of(ModeShape)
    assert (mode.mode, mode.kind, mode.points.tolist()) == (4, "complex", [9])
    assert (mode.frequency_hz, mode.damping_ratio) == pytest.approx(
        (5 / (2 * np.pi), 0.6), rel=1e-12
    )
    np.testing.assert_array_equal(mode.values, [numbers[::2] + 1j * numbers[1::2]])
    for values, why in (
        ((0, 5), "and its frequency is 5 Hz"),
        ((0, 0, 0, 0, 0.3), "viscous one is 0.3"),
    ):
        own = "".join(f"{x:13.5e}" for x in (*values, *[0.0] * (6 - len(values))))
        assert why in read(dataset("2414", *lines[:11], own, *lines[12:])).reasons
    reading = read(dataset("2414", *lines[:2], f"{2:10d}", *lines[3:]))
    assert (reading.outcomes, reading.reasons) == (
        ["ignored"],
        "its data are not at nodes (location 2)",
    )


def changed_55(line: int, text: str) -> bytes:
    return dataset("55", *SHAPE_55[:line], text, *SHAPE_55[line + 1 :])


def mode_55(ids: str, analysis: int, *parameters: float) -> bytes:
    """A mode whose ID line says something, by its analysis type and parameters."""
    definition = "".join(f"{n:10d}" for n in (1, analysis, 2, 8, 5 if analysis == 3 else 2, 3))
    counts = "".join(f"{n:10d}" for n in (2, len(parameters), 1, 1))
    values = "".join(f"{x:13.5e}" for x in parameters)
    shape = f"{1:13.5e}" * (6 if analysis == 3 else 3)
    return dataset("55", ids, *["NONE"] * 4, definition, counts, values, f"{1:10d}", shape)


IDS_55 = [  # what ID lines and parameters state, and what is read, or why not
    ("Frequency: 31.0 Hz, Damping: 1.0 %", 2, (31.0, 1.0, 0.01, 0.0), (31.0, 0.01)),
    ("Freq 31 Hz Damp 1 %", 2, (31.0, 1.0, 0.0, 0.0), (31.0, 0.01)),
    ("Frequency: 31.0 Hz", 3, (-1.94779, 194.769), (31.0, 0.01)),
    ("Frequency: 31.0 Hz", 3, (-0.31, 30.998), "make 4.93.* Hz, and its ID lines say 31 Hz"),
    ("Eigenvalue in Hz", 3, (-0.31, 30.998), "say that its eigenvalue is in Hz"),
    ("Frequency: 31.0 Hz", 2, (194.779, 1.0, 0.01, 0.0), "make 194.78 Hz"),
    ("Damping: 0.5 %", 2, (31.0, 1.0, 0.5, 0.0), "make 50 %, and its ID lines say 0.5 %"),
    ("Mode 1", 4, (31.0, 1.0, 0.01, 0.0), r"transient, no mode shape; .* type 2 .* or 3"),
]


@pytest.mark.parametrize(("ids", "analysis", "parameters", "outcome"), IDS_55)
def test_what_id_lines_say_of_a_mode_counts(
    read: Read, ids: str, analysis: int, parameters: tuple[float, ...], outcome: Any
) -> None:
    reading = read(mode_55(ids, analysis, *parameters))
    if isinstance(outcome, str):
        assert re.search(outcome, reading.reasons)
        return
    (mode,) = reading.of(ModeShape)
    assert (mode.frequency_hz, mode.damping_ratio) == pytest.approx(outcome, rel=1e-4)


COMPLEX_55 = "".join(f"{n:10d}" for n in (1, 3, 2, 8, 5, 3))  # a complex mode


def test_the_conjugate_of_a_mode_is_no_second_one(read: Read) -> None:
    pair = [
        dataset("55", *SHAPE_55[:5], COMPLEX_55, f"{2:10d}{2:10d}{1:10d}{1:10d}", f"{-1:13.5e}{w:13.5e}",
                f"{1:10d}", f"{1:13.5e}" * 6)
        for w in (9, -9)
    ]  # fmt: skip
    reading = read(b"".join(pair))
    assert reading.outcomes == ["read", "ignored"]
    assert "it is the conjugate of a mode" in reading.reasons


@pytest.mark.parametrize(
    ("file", "reason"),
    [
        (dataset("15"), "holds no grid point"),
        (dataset("15", point(0)), "the grid point label is 0, expected a positive number"),
        (dataset("15", point(-3)), "the grid point label is -3"),
        (dataset("15", point(1), point(1, xyz=(9.0, 9.0, 9.0))), "grid point 1 is given twice"),
        (dataset("15", point(1)[:60]), "coordinates of grid point 1: '' is not a number"),
        (dataset("15", point(1) + "  1.0"), "more than 3 values in the line"),
        (dataset("15", point(1).replace("1.00000e+00", "        NaN")), "'NaN' is not a number"),
        (dataset("15", point(1).replace("         1", "       1.5", 1)), "grid point is '1.5', expected a whole number"),
        (changed_55(5, f"{1:10d}{2:10d}{2:10d}{8:10d}{2:10d}{-3:10d}"), "declares -3 values a node"),
        (changed_55(6, f"{2:10d}{-4:10d}{1:10d}{1:10d}"), "declares 2 integer and -4 real parameters"),
        (changed_55(7, "  1.00000e+01  0.00000e+00  2.00000e+00  0.00000e+00"), "viscous damping ratio is 2"),
        (changed_55(9, "  1.00000e+00  2.00000e+00"), "'' is not a number"),
        (changed_55(8, "         x"), "'x' stands where the label of a node is expected"),
        (changed_55(7, " -1.00000e+01  0.00000e+00  2.00000e-02  0.00000e+00"), "its frequency is -10 Hz"),
        (changed_55(5, f"{1:10d}{2:10d}{2:10d}{8:10d}{3:10d}{3:10d}"), "the data type of this set 55 is 3"),
        (dataset("55", *SHAPE_55[:8]), "holds no node"),
        (dataset("55", *SHAPE_55, *SHAPE_55[8:]), "gives a node twice"),
        (dataset("55", *SHAPE_55[:5], COMPLEX_55, f"{1:10d}{1:10d}{1:10d}", "  1.00000e+01", *SHAPE_55[8:]),
         "states no eigenvalue"),
        (
            dataset("55", *SHAPE_55[:5], COMPLEX_55, f"{2:10d}{2:10d}{1:10d}{1:10d}", "  0.00000e+00  0.00000e+00",
                    f"{1:10d}", "  1.00000e+00  2.00000e+00"),
            "its eigenvalue is 0",
        ),
        (dataset("2412"), "holds no element"),
        (dataset("82", f"{2:10d}{2:10d}{1:10d}", "edge", f"{1:10d}{'x':>10}"), "a point is 'x', expected a label or 0"),
        (dataset("15", point(1, -2)), "names the coordinate systems -2 and 0"),
        (dataset("18", *system_18(4, (0, 0, 0), (1, 0, 0), (2, 0, 0))), "lie on one line"),
        (dataset("18", *system_18(4, (0, 0, 0), (1, 0, 0), (0, 0, 1), kind=3)), "has type 3 and method 1"),
        (dataset("18", *system_18(4, (0, 0, 0), (1, 0, 0), (0, 0, 1), reference=9)), "coordinate system 4"),
        (dataset("18"), "holds no coordinate system"),
        (dataset("18", *TURNED, *TURNED), "defines a coordinate system twice"),
        (system_2420(3, np.eye(3), (0, 0, 0), 7), "has type 7, expected 0, 1 or 2"),
        (system_2420(3, np.eye(3) + 0.1, (0, 0, 0)), "are not orthonormal"),
    ],
)  # fmt: skip
def test_what_contradicts_itself_is_refused(read: Read, file: bytes, reason: str) -> None:
    reading = read(file)
    assert (reading.outcomes, reading.contents) == (["refused"], [])
    assert reason in reading.reasons


@pytest.mark.parametrize(
    ("numbers", "reason"),
    [((1, 1, 2, 8, 2, 3), "its data are static, no mode shape"), ((1, 5, 2, 8, 2, 3), "a frequency response"),
     ((1, 2, 4, 8, 2, 6), "its data characteristic is 4")],
)  # fmt: skip
def test_data_that_are_no_mode_shape_are_left_out(
    read: Read, numbers: tuple[int, ...], reason: str
) -> None:
    reading = read(changed_55(5, "".join(f"{n:10d}" for n in numbers)))
    assert (reading.outcomes, reading.contents) == (["ignored"], [])
    assert reason in reading.reasons


def test_points_given_twice_and_directions_along_curved_axes(read: Read) -> None:
    assert "1 grid points are given twice" in read(dataset("15", point(1), point(1))).notes
    curved = system_2420(3, np.eye(3), (0, 0, 0), 1)
    frf = set_58(FRF_ROW, points=1, response=(1, 3), reference=(1, 3), kind=6)
    reading = read(curved + dataset("15", point(1, 0, 3)) + frf)
    assert "along axes of the cylindrical system 3" in reading.reasons
