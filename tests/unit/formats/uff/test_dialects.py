"""What other programs write beside the standard goes in as far as it can be proven right, with a
note that says so.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from modalbase.formats.uff import (
    Frf,
    Function,
    GridPoint,
    Limits,
    PowerSpectrum,
    TimeResponse,
    TraceLine,
    UffError,
    read_file,
)
from modalbase.formats.uff.channels import Spectra
from tests.support.uff import (
    FRF,
    PLAIN,
    POINTS,
    Read,
    Reading,
    axis,
    dataset,
    function,
    header_58,
    set_58,
    set_164,
)

SECONDS = axis(17, "s")
VALUES = [1 + 2j, 3 + 4j]


def of_frf(reading: Reading) -> list[complex]:
    (frf,) = reading.of(Frf)
    return frf.values.tolist()


def frequencies(reading: Reading) -> list[float]:
    return reading.of(Frf)[0].frequency.points().tolist()


def of_block(reading: Reading) -> list[float]:
    (block,) = reading.of(TimeResponse)
    return [block.samples[0], block.sample_rate_hz]


# a third of a µs apart: rows of (E13.5, E20.12) twice
LISTED = [
    "".join(f"{4 * k / 3:13.5e}{1.0:20.12e}" for k in (first, first + 1))
    for first in range(0, 10, 2)
]
ONE = "   1.00000000000e+00   0.00000000000e+00"
TRACE = dataset(
    "82", f"{1:10d}{3:10d}{0:10d}", "line", "".join(f"{p:10d}" for p in (1, 2, 0, 3, 4, 0, 0, 0))
)
RUN_TOGETHER = f"{1:10d}{0:10d}{0:10d}{1:10d}-1.00000E-101-2.00000E+000-3.000000E-01"
UNSTATED = set_58(ONE, points=1, ordinate=axis(0), denominator=axis(0))
TAKEN: dict[str, tuple[bytes, Callable[[Reading], object], object, str]] = {
    "words between datasets": (POINTS + b"Workpiece\n" + FRF, of_frf, VALUES, "the text 'Workpiece', which is no dataset"),
    "a trace line that is longer": (
        TRACE, lambda reading: reading.of(TraceLine)[0].points, (1, 2, 0, 3, 4), "declares 3 points and holds 5"),
    "a reference of -1": (
        set_58(PLAIN, reference=(-1, 0)), lambda reading: reading.of(Frf)[0].reference_point, 0, "-1, read as 0"),
    "rows of other widths": (set_58(" 1.0e+00 2.0e+00", " 3.0e+00 4.0e+00"), of_frf, VALUES, "separated by blanks"),
    # the second is a column short and the third one long: none is cut up
    "rows that together fill the columns": (
        set_58(PLAIN, PLAIN[1:], " " + PLAIN, points=6), of_frf, VALUES * 3, "separated by blanks"),
    "singles beyond their range": (set_58("  1.00000e-42  2.00000e+00  3.00000e+00  4.00000e+00", kind=5), of_frf,
        [1e-42 + 2j, 3 + 4j], "kept as doubles"),
    "coordinates that run together": (
        dataset("15", RUN_TOGETHER), lambda reading: reading.of(GridPoint)[0].xyz_m, (-1e-101, -2.0, -0.3), ""),
    "coordinates without units": (
        POINTS, lambda reading: reading.of(GridPoint)[0].xyz_m, (1.0, 2.0, 3.0), "no set 164: coordinates taken as metres"),
    "an abscissa of an unknown unit": (set_58(ONE, points=1, start="5.00000e+00", abscissa=axis(18, "bins")),
        frequencies, [5.0], "the unit of the abscissa is 'bins'; Hz assumed"),
    "an ordinate of an unknown unit": (set_164(1000.0) + set_58(ONE, points=1, ordinate=axis(12, "EU")), of_frf,
        [1e-3], "has the unknown unit label 'EU'; units of set 164 (USER_DEFINED) assumed"),
    "labels that contradict the units": (set_164(1000.0) + set_58(ONE, points=1), of_frf, [1.0],
        "contradict set 164, by which the factor is 0.001; the labels are used"),
    "a ratio over another force": (
        set_58(ONE, points=1, ordinate=axis(12, "m/s2/N"), denominator=axis(13, "kN")), of_frf, [1.0],
        "its ordinate is in 'm/s2/N', and its denominator in 'kN'"),
    "exponents that do not fit": (set_58(ONE, points=1, ordinate=axis(12, "m/s2", (2, 0, 0))), of_frf, [1.0],
        "the unit exponents (2, 0, 0) of its ordinate do not fit its data type 12"),
    "decimal commas": (set_58(PLAIN.replace(".", ",")), of_frf, VALUES, ""),
    "a moment in one word": (
        set_58(ONE, points=1, reference=(1, 5), denominator=axis(13, "Nm")), of_frf, [1.0], ""),
    "a time block with the word for an amplitude": (
        function(1, np.ones(2), abscissa=SECONDS, ordinate=axis(12, "g pk")), of_block, [9.80665, 1.0],
        "is taken as a time block"),
    "times listed to six digits, in µs": (
        set_58(*LISTED, kind=4, even=0, points=10, function=1, abscissa=axis(17, "us"), ordinate=axis(12, "g")), of_block,
        [9.80665, 3e6 / 4], ""),
    "complex samples that are real": (
        function(1, np.ones(2) + 0j, abscissa=SECONDS, ordinate=axis(12, "m/s2")), of_block, [1.0, 1.0], ""),
}  # fmt: skip


@pytest.mark.parametrize("name", TAKEN)
def test_what_is_taken_is_noted(read: Read, name: str) -> None:
    file, taken, value, note = TAKEN[name]
    reading = read(file)
    assert set(reading.outcomes) == {"read"}, reading.reasons
    assert taken(reading) == pytest.approx(value, rel=1e-15)
    assert note in reading.notes


def test_an_frf_that_states_nothing_is_what_the_user_states(read: Read) -> None:
    reading = read(UNSTATED, Limits(quantity="mobility"))
    assert reading.of(Frf)[0].quantity == "mobility"
    assert "mobility as stated for the import" in reading.notes


@pytest.mark.parametrize("text", [b"Workpiece 1", b"  1.0 2.0", b"a\nb\nc\nd\ne", b"    15"])
def test_what_may_be_data_between_datasets_is_not(tmp_path: Path, text: bytes) -> None:
    path = tmp_path / "file.uff"
    path.write_bytes(POINTS + text + b"\n" + FRF)
    with pytest.raises(UffError, match="between two datasets stands"):
        read_file(path)


@pytest.mark.parametrize(
    ("counted", "ends"), [(32, b"\n"), (33, b"\n"), (34, b"\r\n"), (36, b"\r\n\r\n")]
)
def test_a_binary_count_may_hold_the_line_ends(read: Read, counted: int, ends: bytes) -> None:
    values = np.array([1.0, 2.0, 3.0, 4.0])
    head = (
        b"\n".join(line.encode() if isinstance(line, str) else line for line in header_58()) + b"\n"
    )
    type_line = f"    58b     1     2          11{counted:12d}     0     0           0           0\n".encode()
    reading = read(b"    -1\n" + type_line + head + values.tobytes() + ends + b"    -1\n" + FRF)
    assert reading.outcomes == ["read", "read"]
    np.testing.assert_array_equal(reading.of(Frf)[0].values, [1 + 2j, 3 + 4j])
    assert ("line ends included" in reading.notes) == (counted != 32)


def test_time_blocks_are_read_in_si(read: Read) -> None:
    samples = np.sin(np.arange(64.0))
    force = function(
        1, samples, abscissa=SECONDS, ordinate=axis(13, "lbf"), step="1.00000e-03", reference=(7, 3)
    )
    metric = function(
        1,
        samples,
        abscissa=SECONDS,
        ordinate=axis(12, "NONE"),
        step="1.00000e-03",
        reference=(7, 3),
    )
    pressure = function(1, samples, abscissa=SECONDS, ordinate=axis(15, "Pa"), step="1.00000e-03")
    reading = read(set_164(length=1000.0) + force + metric + pressure)
    hammer, sensor = reading.of(TimeResponse)
    np.testing.assert_allclose(hammer.samples, 4.4482216152605 * samples, rtol=1e-12)
    # by set 164: the file is in mm
    np.testing.assert_allclose(sensor.samples, samples / 1000, rtol=1e-12)
    assert "units of set 164 (USER_DEFINED) assumed" in reading.notes
    assert "units of SI (the file has no set 164) assumed" in read(metric).notes
    assert (hammer.quantity, sensor.quantity) == ("force", "acceleration")
    assert hammer.sample_rate_hz == 1000.0
    assert reading.of(Function)[0].name == "time response"  # a pressure stays what it was
    others = ((1, axis(15, "N*m")), (2, axis(15, "N*m")), (2, axis(15, "NONE")))
    kept = [
        read(function(n, samples**2, ordinate=o, abscissa=SECONDS if n == 1 else axis(18, "Hz")))
        for n, o in others
    ]
    assert [len(one.of(Function)) for one in kept] == [1, 1, 1]  # and so does a moment


BLOCK = np.sin(np.arange(64.0))
UNEVEN = [f"{0.0:13.5e}{1.0:20.12e}{1.0:13.5e}{2.0:20.12e}", f"{3.0:13.5e}{3.0:20.12e}"]
NEWTONS = {"abscissa": SECONDS, "ordinate": axis(13, "N"), "step": "1.00000e-03"}


@pytest.mark.parametrize(
    ("file", "reason"),
    [
        (function(1, BLOCK, **{**NEWTONS, "step": "0.00000e+00"}), "increment"),
        (set_58(*UNEVEN, kind=4, even=0, points=3, function=1, **NEWTONS),
         "without an even time step: its sample rate is missing"),
        (function(1, 1e308 * (0.5 + BLOCK**2 / 2), **{**NEWTONS, "ordinate": axis(13, "lbf")}),
         "its samples are beyond double precision in SI, first at 1"),
        (function(1, BLOCK, **{**NEWTONS, "ordinate": axis(13, "m/s^2")}),
         "its data type says force, its unit 'm/s^2' says acceleration"),
        (function(1, BLOCK + 1j, **NEWTONS), "is a time block of complex samples"),
        (function(1, BLOCK, **{**NEWTONS, "abscissa": axis(18, "Hz")}), "is a time block over 'Hz', expected seconds"),
        (function(1, np.r_[BLOCK, 1.0], **NEWTONS).replace(b"1.000000000000e+00", b"               nan"),
         "'nan' is not a number"),
    ],
)  # fmt: skip
def test_a_time_block_without_a_rate_or_of_two_minds_is_refused(
    read: Read, file: bytes, reason: str
) -> None:
    reading = read(file)
    assert reading.outcomes == ["refused"]
    assert reason in reading.reasons


def ended(reading: Reading, frf: Frf | None = None) -> list:
    """What the power spectra of a file make at its end."""
    spectra = Spectra()
    if frf is not None:
        spectra.note(frf)
    for item in reading.of(PowerSpectrum):
        spectra.take(item)
    assert all(spectra.holds(report) for report in reading.reports)
    return list(spectra.finish())


def test_spectra_that_make_no_frf_say_why(read: Read) -> None:
    hz = np.arange(256.0)
    force, cross = 4.0 / (1 + (hz / 200) ** 2), (1 + 1j) * np.ones(256)
    ends = {"response": (7, 3), "reference": (1, 3)}
    of_force = function(2, force, response=(1, 3), reference=(1, 3), ordinate=axis(13, "N^2"))
    quiet = function(2, 1e-6 * force, response=(7, 3), reference=(7, 3), ordinate=axis(12, "m/s^2"))

    def reasons(file: bytes, frf: Frf | None = None) -> list[str]:
        reports = ended(read(file), frf)
        assert {report.outcome for report in reports} == {"ignored"}
        return [report.reason for report in reports]

    unneeded = "is an auto spectrum that no cross spectrum needs"
    lost, spectrum = reasons(function(3, cross, **ends) + of_force)
    assert "without an auto spectrum of the motion at its response" in lost
    assert spectrum == unneeded
    assert "of the force at its reference" in reasons(function(3, cross, **ends))[0]
    assert "makes a coherence above 1" in reasons(function(3, cross, **ends) + of_force + quiet)[0]
    loud = function(2, 1e4 * force, response=(7, 3), reference=(7, 3), ordinate=axis(12, "m/s^2"))
    # real: its impulse response is the same before the hit as after
    bell = np.exp(-(((hz - 128) / 20) ** 2)) + 0j
    assert (
        "before the hit as much as after it"
        in reasons(function(3, bell, **ends) + of_force + loud)[0]
    )
    (known,) = read(function(4, cross, **ends)).of(Frf)
    assert (
        reasons(function(3, cross, **ends) + of_force + quiet, known)[0]
        == "is the cross spectrum of an FRF that the file has itself"
    )
    elsewhere = function(
        2, force, response=(1, 3), reference=(1, 3), ordinate=axis(13, "N^2"), step="1.00010e+00"
    )
    assert "of the force at its reference" in reasons(function(3, cross, **ends) + elsewhere)[0]
    assert not Spectra().holds(read(FRF).reports[0])


def test_a_cross_spectrum_takes_the_auto_spectra_stated_last_before_it_else_the_first_after_it(
    read: Read,
) -> None:
    """Hits of several points in one file: each has auto spectra of its own, of the same
    channels.
    """
    hz = np.arange(256.0)
    exact = 1 / ((300.0 / 6) ** 2 - hz**2 + 2j * hz)

    def of(dof: int, size: float) -> bytes:
        level = np.full(256, size) if dof == 1 else size * np.abs(exact) ** 2
        return function(
            2,
            level,
            response=(dof, 3),
            reference=(dof, 3),
            ordinate=axis(13 if dof == 1 else 8, "NONE"),
        )

    cross = function(3, exact, response=(7, 3), reference=(1, 3))
    for before, after, force in (((4.0, 2.0), (8.0,), 2.0), ((), (2.0, 4.0), 2.0)):
        parts = [[of(1, size) + of(7, 16 / size) for size in sizes] for sizes in (before, after)]
        frf, *_ = ended(read(b"".join((*parts[0], cross, *parts[1]))))
        assert isinstance(frf, Frf)
        np.testing.assert_allclose(frf.values, exact / force, rtol=1e-9)


@pytest.mark.parametrize(
    ("conjugated", "units"),
    [(False, ("N^2", "mm/s^2")), (True, ("N^2/Hz", "(mm/s^2)^2/Hz"))],
)
def test_power_spectra_make_the_frf_whichever_channel_is_conjugated(
    read: Read, conjugated: bool, units: tuple[str, str]
) -> None:
    hz = np.arange(0.0, 256.0)
    omega = 2 * np.pi * hz
    exact = -(omega**2) * sum(
        a / (w**2 - omega**2 + 2j * 0.02 * w * omega) for a, w in ((1.0, 300.0), (-0.6, 900.0))
    )
    force = 4.0 / (1 + (hz / 200) ** 2)
    noise = 0.01 * np.abs(exact).max() ** 2 * force
    motion = np.abs(exact) ** 2 * force + noise
    cross = exact * force
    ends = {"response": (7, 3), "reference": (1, 3)}
    reading = read(
        function(2, force, response=(1, 3), reference=(1, 3), ordinate=axis(13, units[0]))
        + function(2, 1e6 * motion, response=(7, 3), reference=(7, 3), ordinate=axis(12, units[1]))
        + function(3, 1e3 * (cross.conj() if conjugated else cross), **ends)
    )
    frf, coherence, *reports = ended(reading)
    assert isinstance(frf, Frf)
    assert isinstance(coherence, Function)
    np.testing.assert_allclose(frf.values, exact, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(
        coherence.values,
        np.abs(exact) ** 2 * force / np.maximum(motion, 1e-300),
        rtol=1e-9,
        atol=1e-9,
    )
    assert (frf.quantity, frf.response_point, frf.reference_point) == ("accelerance", 7, 1)
    assert [r.outcome for r in reports] == ["read", "read", "read"]
