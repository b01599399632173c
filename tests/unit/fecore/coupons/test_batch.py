"""Batches of coupons: statistics, exclusions, failure codes, and the prior with its coverage."""

import itertools

import numpy as np
import pytest

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
from fecore.errors import InputError

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
    assert statistics([0.1 + 0.2, 0.3, 0.3]).standard_deviation == 0.0  # the scatter of the arithmetic is none
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
    assert prior(Statistics(1, 31.7e9, None), assumed_cv=0.05).standard_deviation == pytest.approx(0.05 * 31.7e9)
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
        [CouponResult(f"T{i}", {"strength_pa": 4e8 + i}, code) for i, code in enumerate(["GIT", "LAB", "LGM"])]
    )
    assert "3 valid specimens" in summary.warnings[0]
    assert "2 of 3" in summary.warnings[1]


def test_every_code_of_the_standard_is_taken_and_no_other() -> None:
    letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
    taken = {"".join(c) for c in itertools.product(letters, repeat=3) if _is_taken("".join(c))}
    assert taken == {"".join(c) for c in itertools.product("ADGLMSXO", "IAWGMVU", "BTLRMVU")}
    assert (set(TYPE), set(AREA), set(LOCATION)) == (set("ADGLMSXO"), set("IAWGMVU"), set("BTLRMVU"))
    assert check_failure_code(" m(dl)gm ") == "M(DL)GM"
    assert check_failure_code("AGM(2)") == "AGM(2)"
    for wrong in ("LG", "LGMX", "A(DL)GM", "M(DM)GM", "", "L-G-M"):
        assert not _is_taken(wrong)


def test_failures_at_grips() -> None:
    assert [failed_at_grip(c) for c in ("GIT", "LAB", "DWL", "LGM", "M(DL)GM")] == [True, True, True, False, False]


def _is_taken(code: str) -> bool:
    try:
        check_failure_code(code)
    except InputError:
        return False
    return True


@pytest.mark.parametrize("n", sorted(OUTLIER_LIMIT))
def test_one_of_twenty_sound_batches_has_an_outlier(n: int) -> None:
    batches = np.random.default_rng(n).standard_normal((2500, n))
    share = np.mean([bool(outliers(row)) for row in batches])
    assert share == pytest.approx(0.05, abs=4 * np.sqrt(0.05 * 0.95 / 2500))  # four standard errors


def test_an_outlier_is_named_with_its_value_also_beside_a_second_one() -> None:
    values = [31.2, 32.1, 31.7, 30.9, 32.6, 31.5, 47.0, 46.0]
    assert outliers(values) == (6, 7)  # the mean and s of all eight hide both: 47.0 is 1.7 s from the mean
    found = summarise([CouponResult(f"A{i}", {"E_Pa": 1e9 * v}) for i, v in enumerate(values)]).warnings
    assert [w.split(":")[1].split(" has")[0] for w in found] == [" specimen A6", " specimen A7"]


def test_three_values_have_no_outlier_and_equal_ones_have_the_odd_one() -> None:
    assert outliers([1.0, 1.0, 5.0]) == ()
    assert outliers([1.0, 1.0, 1.0, 1.0, 1.1]) == (4,)
