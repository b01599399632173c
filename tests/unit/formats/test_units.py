"""Units as engineers write them: their factors to SI and dimensions, and where they stand in
names.
"""

import pytest

from modalbase.formats.units import (
    ACCELERATION,
    FORCE,
    VELOCITY,
    VOLTAGE,
    Dimension,
    Measured,
    factor_of,
    known_units,
    read_unit,
    unit_in_name,
)

G = 9.80665
LBF = 4.4482216152605
ACCELERANCE = Dimension(0, -1, 0)


@pytest.mark.parametrize(
    ("factor", "dimension", "texts"),
    [
        (
            1.0,
            ACCELERATION,
            ["m/s2", "m/s^2", "m/s**2", "m/s²", "m/s/s", "M/SEC2", "m s^-2", "m s-2"],
        ),
        (1e-3, ACCELERATION, ["mm/s2"]),
        (0.0254, ACCELERATION, ["in/s^2"]),
        (G, ACCELERATION, ["g", "G", "gn", "g's"]),
        (0.0254, VELOCITY, ["ips"]),
        (1e-3, VELOCITY, ["mm/s"]),
        (1e3, VELOCITY, ["m/ms"]),
        (1 / 60, VELOCITY, ["m/min"]),
        (1.0, VELOCITY, ["m·Hz"]),
        (1e-6, Dimension(1, 0, 0), ["µm", "\u03bcm", "um"]),
        (1e-9, Dimension(1, 0, 0), ["nm"]),
        (1e-2, Dimension(1, 0, 0), ["cm"]),
        (0.0254, Dimension(1, 0, 0), ["inch"]),
        (25.4e-6, Dimension(1, 0, 0), ["mil"]),
        (0.3048, Dimension(1, 0, 0), ["ft"]),
        (1e-3, Dimension(1, 0, 1), ["m.kHz^-1"]),
        (0.017453292519943295, Dimension(0, 0, -1), ["deg/s"]),
        (1.0, Dimension(0, 0, 0), ["rad^3"]),
        (1.0, Dimension(3, 0, 0), ["m³"]),
        (1e9, Dimension(-3, 0, 0), ["mm-3"]),
        (1e-6, Dimension(2, 0, -2), ["(mm/s)^2"]),
        (0.0254**2, Dimension(2, 0, -2), ["ips2"]),  # a square, as of the spectrum of a velocity
        (1.0, FORCE, ["kg m s-2", "newton", "Newtons", "N"]),
        (10.0, FORCE, ["daN"]),
        (LBF, FORCE, ["lb", "lbf"]),
        (G, FORCE, ["kp", "kgf"]),
        (1e-3, FORCE, ["mN"]),
        (1e6, FORCE, ["MN"]),
        (1e3, FORCE, ["kN"]),
        (1.0, Dimension(2, 1, -2), ["N*m", "N-m"]),
        (G, ACCELERANCE, ["g/N"]),
        (G / LBF, ACCELERANCE, ["g/lbf"]),
        (1.0, ACCELERANCE, ["(m/s^2)/N", "(1/N)*(m/s²)", "m/s2/N", "m/(N s^2)", "1/kg"]),
        (0.0254 / LBF, ACCELERANCE, ["in/s**2/lbf"]),
    ],
)
def test_labels(factor: float, dimension: Dimension, texts: list[str]) -> None:
    for label in map(read_unit, texts):
        assert label is not None
        assert (label.factor, label.dimension) == (pytest.approx(factor, rel=1e-12), dimension)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "NONE",
        "EU",
        "m//s",
        "m/",
        "(m",
        "m)",
        "*",
        "m^",
        "m^x",
        "m^4",
        "m^-",
        "m 2 3",
        "dB",
        "m/s^2^",
        "²",
    ],
)
def test_labels_that_say_nothing(text: str) -> None:
    assert read_unit(text) is None


@pytest.mark.parametrize(
    ("quantity", "factor", "texts"),
    [
        ("acceleration", G, ["g", "G", "(g)", "[g]", "g0"]),
        ("acceleration", 1.0, ["M/S^2", "m/s^2", "m/s²", "m·s⁻²", "m s-2"]),
        ("acceleration", 1e-3 * G, ["mg"]),
        ("acceleration", 0.3048, ["ft/s2", "FT/S^2"]),
        ("force", 1e3, ["kN", "KN", "kn"]),
        ("force", LBF, ["lbf", "LBF", "Lbf", "lbs"]),
        ("voltage", 1e-3, ["mV", "MV", "mv"]),
        ("voltage", 1.0, ["V", "v", "Volts"]),
        ("time", 1e-3, ["ms", "msec", "MS"]),
        ("time", 1e-6, ["µs", "\u03bcs", "us"]),
        ("length", 1e-3, ["mm", "MM"]),
        ("frequency", 1 / 6.283185307179586, ["rad/s", "rad/sec"]),
        ("frequency", 1 / 360, ["deg/s"]),
        ("frequency", 1e3, ["kHz", "KHZ"]),
        ("stress", 1e6, ["MPa", "Mpa", "MPA", "N/mm²", "N/mm^2"]),
        ("strain", 1e-6, ["µε", "με", "um/m", "microstrain", "µm/m"]),
        ("strain", 1e-2, ["%"]),
        ("strain", 1.0, ["mm/mm", "in/in", "m/m"]),
    ],
)
def test_factors_of_a_quantity(quantity: Measured, factor: float, texts: list[str]) -> None:
    for text in texts:
        assert factor_of(quantity, text) == pytest.approx(factor, rel=1e-12), text
        assert factor_of("mass", text) is None


def test_milli_and_mega_are_told_apart_or_not_at_all() -> None:
    assert (factor_of("force", "MN"), factor_of("force", "mN")) == (1e6, 1e-3)
    assert [read_unit(text) for text in ("mn", "mPa", "mpa", "msi")] == [None] * 4


def test_a_sensitivity_has_a_dimension() -> None:
    unit = read_unit("mV/g")
    assert unit is not None
    assert (unit.factor, unit.dimension) == (
        pytest.approx(1e-3 / G),
        VOLTAGE.times(ACCELERATION, -1),
    )
    assert unit.quantity is None


@pytest.mark.parametrize(
    ("name", "quantity", "bare", "unit"),
    [
        ("ACC (g)", None, "ACC", "g"),
        ("Hammer [lbf]", None, "Hammer", "lbf"),
        ("Kraft{kN}", None, "Kraft", "kN"),
        ("a <mm/s²>", None, "a", "mm/s²"),
        ("acc [(m/s^2)] 2", None, "acc 2", "(m/s^2)"),
        ("Force (N) (ch 1)", None, "Force (ch 1)", "N"),
        ("Strain 1 (Strain gauge)", None, "Strain 1 (Strain gauge)", ""),
        ("ACC (1)", None, "ACC (1)", ""),
        ("ACC (left)", "acceleration", "ACC (left)", ""),
        ("time_ms", "time", "time", "ms"),
        ("Time, s", "time", "Time", "s"),
        ("F / kN", "force", "F", "kN"),
        ("Kraft in N", "force", "Kraft", "N"),
        ("acc_mm/s2", "acceleration", "acc", "mm/s2"),
        ("acc_1_m_s2", "acceleration", "acc_1", "m/s2"),
        ("x_acc_g", "acceleration", "x_acc", "g"),
        ("acc_s", "acceleration", "acc_s", ""),
        ("hammer_g", "force", "hammer_g", ""),
        ("force_1", "force", "force_1", ""),
    ],
)
def test_units_in_names(name: str, quantity: Measured | None, bare: str, unit: str) -> None:
    assert unit_in_name(name, quantity) == (bare, unit)


def test_units_are_listed_for_a_message() -> None:
    assert known_units("acceleration").startswith("m/s², mm/s², in/s², g, ")
