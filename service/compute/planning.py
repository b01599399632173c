"""What a plan computes, in a child process of the API: no database, no web."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from fecore.updating.campaigns import Campaign
from fecore.updating.measurement import Measurement, prepare
from fecore.updating.parameters import Parameter
from fecore.updating.plans import Plan, PlannedTest, plan_tests
from fecore.updating.recipe import Recipe


@dataclass(frozen=True)
class PlanOrder:
    """Everything that a plan needs: `made` with the modes as they were stored, `sent` as each test was asked for."""

    tests: tuple[PlannedTest, ...]
    sent: tuple[dict[str, Any], ...]
    made: tuple[Campaign, ...]
    parameters: tuple[Parameter, ...]
    count: int | None


def compute_plan(order: PlanOrder) -> dict[str, Any]:
    """The ranked tests as the contract shows them.

    Raises:
        InputError: tests or campaigns contradict themselves.
        UpdatingError: the campaigns so far have no common estimate.
    """
    campaigns = []
    for each in order.made:
        modes = prepare(Measurement(None, each.points, each.modes), each.body, Recipe()).modes
        assert modes is not None, "they were handed in"
        campaigns.append(replace(each, modes=modes))
    plan = plan_tests(order.tests, campaigns, order.parameters, order.count)
    return _describe(plan, order)


def _describe(plan: Plan, order: PlanOrder) -> dict[str, Any]:
    by_test = {test.name: (test, sent) for test, sent in zip(order.tests, order.sent, strict=True)}
    items = []
    for forecast in plan.forecasts:
        test, sent = by_test[forecast.name]
        items.append(
            {
                "name": forecast.name,
                "test": sent,
                "information_nats": forecast.information,
                "expected_sd": forecast.standard_deviations,
                "shrinks_most": min(plan.known, key=lambda n: forecast.standard_deviations[n] / plan.known[n]),
                "frequencies_hz": forecast.frequencies_hz.tolist(),
                "points_m": [list(test.points[point]) for point in forecast.points],
                "share_of_all_points": forecast.share,
            }
        )
    return {"known_sd": plan.known, "campaigns": [each.name for each in order.made], "items": items}
