"""Coupons by D3039, and the statistics of a batch."""

import itertools

import numpy as np
import pytest

from fecore.coupons import d3039
from fecore.coupons.batch import (
    AREA,
    LOCATION,
    OUTLIER_LIMIT,
    TYPE,
    CouponResult,
    Statistics,
    check_failure_code,
    failed_at_grip,
    outliers,
    prior,
    statistics,
    summarise,
)
from fecore.coupons.curves import Curve, jump, restarts, split_runs
from fecore.coupons.d3039 import transition_strain
from fecore.errors import InputError
from tests.support.lengths import long

WIDTH = (25.02e-3, 25.00e-3, 24.98e-3)
THICKNESS = (2.01e-3, 2.00e-3, 1.99e-3)

# docs/coupons.md, example 1: strain in µε, force in N, transverse strain in µε, back face in µε
STRAIN = np.array([0, 495, 990, 1510, 2015, 2490, 3020, 5000, 8000, 10000]) * 1e-6
FORCE = np.array([0, 990.0, 1980.0, 3012.0, 4012.0, 4950.0, 5990.0, 9800.0, 15300.0, 19000.0])
TRANSVERSE = np.array([0, -124, -248, -377, -503, -622, -754, -1240, -1960, -2440]) * 1e-6


def example(**others: np.ndarray) -> Curve:
    return Curve(FORCE, STRAIN, **others)


def steady(n: int = 201, modulus: float = 40e9, ultimate: float = 0.01) -> Curve:
    strain = np.linspace(0, ultimate, n)
    return Curve(modulus * strain * 50e-6, strain, transverse_strain=-0.25 * strain)


def test_the_first_worked_example() -> None:
    result = d3039.reduce(example(transverse_strain=TRANSVERSE), WIDTH, THICKNESS)
    assert result.area_m2 == pytest.approx(50e-6, rel=1e-12)
    assert result.strength_pa == pytest.approx(380e6, rel=1e-12)
    assert result.ultimate_strain == pytest.approx(0.010, rel=1e-12)
    assert result.chord_range == pytest.approx((990e-6, 3020e-6), rel=1e-12)
    assert result.modulus_pa == pytest.approx((5990 - 1980) / 50e-6 / 2030e-6, rel=1e-12)
    assert f"{result.modulus_pa / 1e9:.4f}" == "39.5074"
    assert result.poisson_ratio == pytest.approx((754 - 248) / 2030, rel=1e-12)
    assert f"{result.poisson_ratio:.4f}" == "0.2493"
    assert result.bending_percent is None
    assert result.warnings == ()


def test_interpolated_ends_of_the_same_example() -> None:
    result = d3039.reduce(example(), WIDTH, THICKNESS, ends="interpolated")
    low = 1980 + (3012 - 1980) * 10 / 520
    high = 4950 + (5990 - 4950) * 510 / 530
    assert result.chord_range == pytest.approx((1000e-6, 3000e-6), rel=1e-12)
    assert result.modulus_pa == pytest.approx((high - low) / 50e-6 / 2000e-6, rel=1e-12)
    assert f"{result.modulus_pa / 1e9:.4f}" == "39.5091"


def test_a_specimen_that_fails_early_takes_a_quarter_to_a_half_of_its_strain() -> None:
    strain = np.arange(0, 4001, 200) * 1e-6
    stress = 40e9 * strain - 1e12 * strain**2
    result = d3039.reduce(Curve(stress * 50e-6, strain), WIDTH, THICKNESS)
    assert result.chord_range == pytest.approx((1000e-6, 2000e-6))
    # chord of a parabola: 40e9 − 1e12 (ε₁ + ε₂)
    assert result.modulus_pa == pytest.approx(40e9 - 1e12 * 3000e-6, rel=1e-12)
    assert "below 6000" in result.warnings[0]


F, S = steady().force_n, steady().strain
LATE = np.arange(201) >= 150


@pytest.mark.parametrize(
    ("curve", "ultimate", "bending", "warning"),
    [
        pytest.param(
            Curve(F, 1.06 * S, strain_back=0.94 * S), 0.01, 6.0, "bending", id="two faces"
        ),
        pytest.param(
            Curve(F, np.where(LATE, np.nan, S)),
            None,
            None,
            "ends at 7450 µε",
            id="a gauge taken off",
        ),
        pytest.param(
            Curve(F, S + 0.19 * LATE),
            None,
            None,
            "jumps at point 151",
            id="an extensometer that jumps",
        ),
        pytest.param(
            Curve(np.r_[F, 50, 20, 0], np.r_[S, 0.001, 0.0, -0.002]),
            0.01,
            None,
            None,
            id="after the maximum force",
        ),
    ],
)
def test_what_befalls_a_gauge_leaves_the_modulus(
    curve: Curve, ultimate: float | None, bending: float | None, warning: str | None
) -> None:
    result = d3039.reduce(curve, WIDTH, THICKNESS)
    assert result.modulus_pa == pytest.approx(40e9, rel=1e-12)
    assert result.strength_pa == pytest.approx(400e6, rel=1e-12)
    assert result.ultimate_strain == (ultimate if ultimate is None else pytest.approx(ultimate))
    assert result.bending_percent == (
        bending if bending is None else pytest.approx(bending, rel=1e-12)
    )
    assert (
        [warning in text for text in result.warnings[:1]] == [True]
        if warning
        else not result.warnings
    )


def test_a_gauge_lost_within_the_chord_and_exchanged_dimensions_are_asked_about() -> None:
    early = np.where(S > 0.004, np.nan, S)
    with pytest.raises(InputError, match="chord_range"):
        d3039.reduce(Curve(F / 2 * np.where(S > 0.004, 1.1, 2), early), WIDTH, THICKNESS)
    assert "are they exchanged" in d3039.reduce(steady(), THICKNESS, WIDTH).warnings[0]


def test_a_knee_is_found_where_it_is_and_nowhere_else() -> None:
    rng = np.random.default_rng(3)
    strain = np.linspace(0, 0.012, 400)
    bilinear = 20e9 * np.minimum(strain, 0.0042) + 14e9 * np.maximum(strain - 0.0042, 0)
    assert transition_strain(strain, bilinear) == pytest.approx(0.0042, rel=1e-9)
    noisy = bilinear + 0.3e6 * rng.standard_normal(strain.size)
    assert transition_strain(strain, noisy) == pytest.approx(0.0042, rel=0.02)
    for smooth in (20e9 * strain, 20e9 * strain - 2e11 * strain**2):
        assert transition_strain(strain, smooth) is None
        assert transition_strain(strain, smooth + 0.3e6 * rng.standard_normal(strain.size)) is None


def test_restarts_are_found_refused_and_split() -> None:
    first, second = steady(61, ultimate=0.003), steady()
    both = Curve(
        np.concatenate([first.force_n, second.force_n]),
        np.concatenate([first.strain, second.strain]),
    )
    assert restarts(both) == (61,)
    with pytest.raises(InputError, match=r"restarted at point 62 \(0 N\)"):
        d3039.reduce(both, WIDTH, THICKNESS)
    runs = split_runs(both)
    assert [len(run) for run in runs] == [61, 201]
    assert d3039.reduce(runs[1], WIDTH, THICKNESS).modulus_pa == pytest.approx(40e9, rel=1e-12)


def test_time_that_goes_back_is_a_restart_too() -> None:
    curve = steady(50)
    timed = Curve(curve.force_n, curve.strain, time_s=np.r_[np.arange(20.0), np.arange(30.0)])
    assert restarts(timed) == (20,)


def test_cracks_that_drop_the_force_but_not_the_strain_are_no_restart() -> None:
    curve = steady()
    force = curve.force_n.copy()
    force[120:130] *= 0.8
    assert restarts(Curve(force, curve.strain)) == ()


def test_the_regression_modulus_is_the_least_squares_slope_of_the_chords_points() -> None:
    result = d3039.reduce(example(), WIDTH, THICKNESS)
    inside = slice(2, 7)  # 990 to 3020 µε
    assert result.regression_modulus_pa == pytest.approx(
        np.polyfit(STRAIN[inside], FORCE[inside] / result.area_m2, 1)[0], rel=1e-12
    )
    # a straight curve, by hand
    assert result.regression_modulus_pa == pytest.approx(result.modulus_pa, rel=2e-3)


def test_a_knee_within_the_chord_is_named_with_its_strain() -> None:
    strain = np.linspace(0, 0.01, 501)
    stress = np.where(strain < 2000e-6, 40e9 * strain, 80e6 + 30e9 * (strain - 2000e-6))
    result = d3039.reduce(Curve(stress * 50e-6, strain), WIDTH, THICKNESS)
    # of neither part: that is why it is said
    assert result.modulus_pa == pytest.approx(35e9, rel=1e-9)
    (warning,) = result.warnings
    assert "knee at 2000 µε" in warning
    below = d3039.reduce(
        Curve(stress * 50e-6, strain), WIDTH, THICKNESS, chord_range=(500e-6, 1500e-6)
    )
    assert (below.modulus_pa, below.warnings) == (pytest.approx(40e9, rel=1e-9), ())


def test_a_knee_that_a_later_bend_hides_in_the_whole_curve_is_found_near_the_chord() -> None:
    strain = np.linspace(0, 0.02, 2001)
    stress = np.minimum(40e9 * strain, 80e6 + 30e9 * (strain - 2000e-6))
    stress = stress - 4e11 * np.maximum(strain - 8000e-6, 0) ** 2
    (warning,) = d3039.reduce(Curve(stress * 50e-6, strain), WIDTH, THICKNESS).warnings
    assert "knee at 20" in warning


def test_noise_yield_and_a_machine_that_changes_its_rate_are_no_jumps() -> None:
    rng = np.random.default_rng(3)
    noisy = np.linspace(0, 0.012, 400) + rng.normal(0, 20e-6, 400)
    rates = np.concatenate([np.linspace(0, 0.002, 200), np.linspace(0.0029, 0.02, 20)])
    yielding = np.concatenate(
        [np.linspace(0, 0.004, 200), 0.004 + 0.03 * np.linspace(0.005, 1, 200) ** 2]
    )
    assert [jump(x) for x in (noisy, rates, yielding, STRAIN)] == [None] * 4


# --- batches of coupons
# -------------------------------------------------------------------------------------------------

# docs/coupons.md, example 2: GPa
MODULI = (31.2, 32.1, 31.7, 30.9, 32.6)


def specimens() -> list[CouponResult]:
    return [CouponResult(f"T{i + 1}", {"modulus_pa": m * 1e9}, "LGM") for i, m in enumerate(MODULI)]


def test_the_worked_batch() -> None:
    found = summarise(specimens()).properties["modulus_pa"]
    assert found.n == 5
    assert found.mean == pytest.approx(31.70e9, rel=1e-12)
    # deviations −0.5, 0.4, 0, −0.8, 0.9: squares 0.25 + 0.16 + 0 + 0.64 + 0.81 = 1.86
    assert found.standard_deviation == pytest.approx(1e9 * np.sqrt(1.86 / 4), rel=1e-12)
    assert f"{found.cv_percent:.3f}" == "2.151"


def test_equal_values_do_not_scatter_and_none_about_zero_has_a_share() -> None:
    # the scatter of the arithmetic is none
    assert statistics([0.1 + 0.2, 0.3, 0.3]).standard_deviation == 0.0
    assert statistics([0.1 + 0.2, 0.3, 0.3]).cv_percent == 0.0
    assert statistics([-1.0, 1.0]).cv_percent is None
    assert statistics([1.0]).cv_percent is None


def test_the_prior_of_the_worked_batch() -> None:
    p = prior(statistics([m * 1e9 for m in MODULI]))
    assert p.between_specimens == pytest.approx(0.68191e9, rel=1e-5)
    # √(1 + 1/5) · 2.77645 / 1.95996 = 1.55179
    assert p.standard_deviation == pytest.approx(0.68191e9 * 1.55179, rel=1e-5)


@pytest.mark.parametrize("n", [3, 5, 12])
def test_the_prior_holds_the_next_piece_of_the_material(n: int) -> None:
    rng = np.random.default_rng(n)
    held = 0
    for _ in range(4000):
        x = 30 + 1.5 * rng.standard_normal(n + 1)
        p = prior(statistics(x[:n].tolist()))
        held += abs(x[n] - p.mean) < 1.959964 * p.standard_deviation
    assert held / 4000 == pytest.approx(0.95, abs=0.012)  # 3.5 standard errors


def test_one_published_mean_gets_the_assumed_scatter_and_says_so() -> None:
    p = prior(Statistics(None, 31.7e9, None))
    assert p.standard_deviation == pytest.approx(0.30 * 31.7e9)
    assert p.between_specimens is None
    assert "30 % assumed" in p.basis
    assert prior(Statistics(1, 31.7e9, None), assumed_cv=0.05).standard_deviation == pytest.approx(
        0.05 * 31.7e9
    )
    assert prior(Statistics(None, 31.7e9, 0.5e9)).standard_deviation == 0.5e9


def test_excluded_specimens_are_kept_with_their_reason_and_do_not_count() -> None:
    batch = [*specimens(), CouponResult("T6", {"modulus_pa": 12e9}, "GIT", "slipped in the grips")]
    summary = summarise(batch)
    assert summary.properties["modulus_pa"].n == 5
    assert summary.excluded == (("T6", "slipped in the grips"),)
    assert summary.warnings == ()
    with pytest.raises(InputError, match="without a reason"):
        CouponResult("T7", {}, None, "  ")


def test_warnings_below_five_specimens_and_for_failures_at_the_grips() -> None:
    summary = summarise(
        [
            CouponResult(f"T{i}", {"strength_pa": 4e8 + i}, code)
            for i, code in enumerate(["GIT", "LAB", "LGM"])
        ]
    )
    assert "3 valid specimens" in summary.warnings[0]
    assert "2 of 3" in summary.warnings[1]


def test_every_code_of_the_standard_is_taken_and_no_other() -> None:
    letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
    taken = {"".join(c) for c in itertools.product(letters, repeat=3) if _is_taken("".join(c))}
    assert taken == {"".join(c) for c in itertools.product("ADGLMSXO", "IAWGMVU", "BTLRMVU")}
    assert (set(TYPE), set(AREA), set(LOCATION)) == (
        set("ADGLMSXO"),
        set("IAWGMVU"),
        set("BTLRMVU"),
    )
    assert check_failure_code(" m(dl)gm ") == "M(DL)GM"
    assert check_failure_code("AGM(2)") == "AGM(2)"
    for wrong in ("LG", "LGMX", "A(DL)GM", "M(DM)GM", "", "L-G-M"):
        assert not _is_taken(wrong)


def test_failures_at_grips() -> None:
    assert [failed_at_grip(c) for c in ("GIT", "LAB", "DWL", "LGM", "M(DL)GM")] == [
        True,
        True,
        True,
        False,
        False,
    ]


def _is_taken(code: str) -> bool:
    try:
        check_failure_code(code)
    except InputError:
        return False
    return True


@pytest.mark.parametrize("count", [500, long(2500)])
@pytest.mark.parametrize("n", sorted(OUTLIER_LIMIT))
def test_one_of_twenty_sound_batches_has_an_outlier(n: int, count: int) -> None:
    batches = np.random.default_rng(n).standard_normal((count, n))
    share = np.mean([bool(outliers(row)) for row in batches])
    assert share == pytest.approx(
        0.05, abs=4 * np.sqrt(0.05 * 0.95 / count)
    )  # four standard errors


def test_an_outlier_is_named_with_its_value_also_beside_a_second_one() -> None:
    values = [31.2, 32.1, 31.7, 30.9, 32.6, 31.5, 47.0, 46.0]
    # the mean and s of all eight hide both: 47.0 is 1.7 s from the mean
    assert outliers(values) == (6, 7)
    found = summarise(
        [CouponResult(f"A{i}", {"E_Pa": 1e9 * v}) for i, v in enumerate(values)]
    ).warnings
    assert [w.split(":")[1].split(" has")[0] for w in found] == [" specimen A6", " specimen A7"]


def test_three_values_have_no_outlier_and_equal_ones_have_the_odd_one() -> None:
    assert outliers([1.0, 1.0, 5.0]) == ()
    assert outliers([1.0, 1.0, 1.0, 1.0, 1.1]) == (4,)
