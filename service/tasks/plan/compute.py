"""What a plan computes, in a child process of the API: no database, no web."""

from dataclasses import dataclass, replace
from typing import Any

from fecore.body.constants import Parameter
from fecore.errors import within
from fecore.updating.campaigns import Campaign
from fecore.updating.measurement import Measurement, Recipe, prepare
from fecore.updating.plans import Plan, PlannedCoupons, PlannedTest, plan_tests


@dataclass(frozen=True)
class PlanOrder:
    """Everything that a plan needs."""

    # tests, coupons: that could be made
    tests: tuple[PlannedTest, ...]
    coupons: tuple[PlannedCoupons, ...]
    sent: tuple[dict[str, Any], ...]  # each of them, as it was asked for
    made: tuple[Campaign, ...]  # with the modes as they were stored
    # parameters, count, about: as of `plan_tests`
    parameters: tuple[Parameter, ...]
    count: int | None
    about: str | None


def compute_plan(order: PlanOrder) -> dict[str, Any]:
    """The ranked tests as the contract shows them.

    Raises:
        InputError: tests or campaigns contradict themselves.
        UpdatingError: the campaigns so far have no common estimate.
    """
    campaigns = []
    for number, each in enumerate(order.made):
        with within(f"made.{number}"):
            modes = prepare(
                Measurement(None, each.points, each.modes, axes=each.axes), each.body, Recipe()
            ).modes
        assert modes is not None, "they were handed in"
        campaigns.append(replace(each, modes=modes))
    plan = plan_tests(
        order.tests, campaigns, order.parameters, order.count, order.coupons, order.about
    )
    return _describe(plan, order)


def _describe(plan: Plan, order: PlanOrder) -> dict[str, Any]:
    could: list[PlannedTest | PlannedCoupons] = [*order.tests, *order.coupons]
    requested = {each.name: (each, sent) for each, sent in zip(could, order.sent, strict=True)}
    items = []
    for gain in plan.gains:
        each, sent = requested[gain.name]
        points = (
            [list(each.points[point]) for point in gain.points]
            if isinstance(each, PlannedTest)
            else []
        )
        items.append(
            {
                "name": gain.name,
                "test" if isinstance(each, PlannedTest) else "coupons": sent,
                "information_nats": gain.information,
                "expected_sd": gain.standard_deviations,
                "shrinks_most": min(
                    plan.known, key=lambda n: gain.standard_deviations[n] / plan.known[n]
                ),
                "frequencies_hz": gain.frequencies_hz.tolist(),
                "points_m": points,
                "share_of_all_points": gain.share,
            }
        )
    return {"known_sd": plan.known, "campaigns": [each.name for each in order.made], "items": items}
