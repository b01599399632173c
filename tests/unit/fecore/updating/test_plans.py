"""Where to hit next: forecasts that come true, and points that keep what the whole tour would
show.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from fecore.body.specimen import OrientedSpecimen
from fecore.body.supports import PointMass
from fecore.updating.campaigns import update_campaigns
from fecore.updating.layout import Coupon
from fecore.updating.plans import PlannedCoupons, PlannedTest, best_points, plan_tests
from tests.support.lengths import long
from tests.support.strips import NOMINAL, STRIP, TRUTH, measured, tour


def strip(angle: float, specimen: str, boundary: str = "free") -> PlannedTest:
    body = OrientedSpecimen(
        *STRIP, NOMINAL, boundary, divisions=(16, 3), fibre_angle=float(np.radians(angle))
    )  # type: ignore[arg-type]
    return PlannedTest(
        f"{specimen}, {boundary}", body, 3000.0, tour(*STRIP[:2]), 32, specimen=specimen
    )


@pytest.mark.long
def test_what_a_test_will_show_is_foreseen() -> None:
    """A strip is measured; the plan foresees what one more at 90° brings; it is measured, and the
    plan was right. In short what coupons will bring is.
    """
    random = np.random.default_rng(3)
    first, second = (
        measured(random, "strip 0", STRIP, 0.0, modes=7),
        measured(random, "strip 90", STRIP, 90.0, modes=7),
    )
    plan = plan_tests(
        [strip(0, "strip 0"), strip(0, "strip 0", "cantilever"), strip(90, "strip 90")], [first]
    )
    best = plan.gains[0]
    assert best.name == "strip 90, free"
    same = {each.name: each for each in plan.gains}["strip 0, free"]
    assert same.information < 0.25 * best.information
    # the scatter between specimens is a part
    assert best.standard_deviations["Ey"] < 0.2 * plan.known["Ey"]
    alone, both = update_campaigns([first]), update_campaigns([first, second])
    for result, foreseen in ((alone, plan.known), (both, best.standard_deviations)):
        for parameter in result.parameters:
            # Of the estimate at another point, with the discrepancy marginalised: alike, not the
            # same.
            assert parameter.standard_deviation == pytest.approx(
                foreseen[parameter.name], rel=0.4
            ), parameter.name


@pytest.mark.parametrize("angles", [(0,), long((0, 90))])
def test_what_coupons_will_bring_is_foreseen(angles: tuple[int, ...]) -> None:
    """Beside one strip they are one more piece, beside two one more specimen that scatters: the
    same in plan and update.
    """
    random = np.random.default_rng(5)
    made = [measured(random, f"strip {angle}", STRIP, angle, modes=7) for angle in angles]
    asked = PlannedCoupons("five", ("Ex", "Gxy"), 0.05, pieces=5)
    plan = plan_tests([strip(0, "strip 0")], made, coupons=[asked])
    (foreseen,) = (each for each in plan.gains if each.name == "five")
    result = update_campaigns(
        made, coupons=[Coupon(n, TRUTH[n], 0.05 * TRUTH[n], "five", 5) for n in asked.constants]
    )
    for parameter in result.parameters:
        found = parameter.standard_deviation
        assert found == pytest.approx(foreseen.standard_deviations[parameter.name], rel=0.4), (
            parameter.name
        )
    # Beside two the mean of five counts as such; as one more piece the coupons would say half as
    # much of Ex.
    assert foreseen.information > (0.1 if len(angles) == 1 else 0.3)


@pytest.mark.parametrize(("count", "chosen"), [(2, {1, 2}), (4, {0, 1, 2, 3}), (9, {0, 1, 2, 3})])
def test_exchanges_find_a_pair_that_no_greedy_choice_begins_with(
    count: int, chosen: set[int]
) -> None:
    """Point 0 is the best alone; 1 and 2 together say more than 0 with any other."""

    def information(points: Sequence[int]) -> float:
        together = 5.0 if {1, 2} <= set(points) else 0.0
        return sum((3.0, 2.0, 0.5, 0.1)[p] for p in points) + together

    def blind(points: Sequence[int]) -> float:
        return information(points) if len(points) > 1 else float(points[0] == 3)

    assert set(best_points(information, range(4), count)) == chosen
    assert set(best_points(blind, range(4), count)) == chosen


def test_a_second_specimen_makes_the_first_one_that_scatters() -> None:
    """One alone counts as the material; beside another of its kind both scatter, and less is known
    of what neither determines alone.
    """
    made = measured(np.random.default_rng(5), "strip 0", STRIP, 0.0, modes=7)
    plan = plan_tests([strip(0, "strip 0"), strip(0, "strip 1")], [made])
    again, other = (
        next(each.standard_deviations["Ex"] for each in plan.gains if each.name == f"{name}, free")
        for name in ("strip 0", "strip 1")
    )
    assert again < plan.known["Ex"] < other


def test_an_added_mass_is_in_the_forecast() -> None:
    plain = strip(0, "s", "cantilever")
    heavy = replace(
        plain, name="heavy", body=replace(plain.body, masses=(PointMass(STRIP[0], 0.0, 0.02),))
    )
    plan = {each.name: each for each in plan_tests([plain, heavy]).gains}
    assert plan["heavy"].frequencies_hz[0] < 0.9 * plan[plain.name].frequencies_hz[0]
