"""Where to hit next: a strip has been hung freely and measured; which test would add most?

python -m examples.where_to_hit_next
"""

import numpy as np

from examples.one_material import paper_bar
from examples.paper.published import TABLE_4_COUPONS, material
from fecore.body.specimen import OrientedSpecimen
from fecore.updating.plans import Plan, PlannedTest, plan_tests


def tests_that_could_be_made() -> list[PlannedTest]:
    """Another boundary of the bar, a strip cut across it, one at 45°, and a plate of the same
    laminate.
    """
    laminate = material(TABLE_4_COUPONS)

    def test(
        name: str, size: tuple[float, float], angle: float, highest_hz: float, specimen: str
    ) -> PlannedTest:
        body = OrientedSpecimen(
            *size, 0.01012, laminate, "free", fibre_angle=float(np.radians(angle))
        )
        points = tuple(
            (x, y) for x in np.linspace(0, size[0], 11) for y in (-size[1] / 2, 0.0, size[1] / 2)
        )
        return PlannedTest(name, body, highest_hz, points, 32, specimen=specimen)

    return [
        test("the bar free, up to 2 kHz", (0.501, 0.04), 0, 2000, "bar"),
        test("a strip at 90°", (0.25, 0.04), 90, 4000, "strip 90"),
        test("a strip at 45°", (0.25, 0.04), 45, 4000, "strip 45"),
        test("a plate", (0.4, 0.3), 0, 1000, "plate"),
    ]


def plan() -> Plan:
    """The plan after the paper's own two tests, eight points each."""
    return plan_tests(tests_that_could_be_made(), paper_bar(), count=8)


if __name__ == "__main__":
    found = plan()
    for each in found.forecasts:
        shares = ", ".join(
            f"{name} {sd / found.known[name]:.2f}" for name, sd in each.standard_deviations.items()
        )
        print(
            f"{each.name}: {each.information:.1f} nats; standard deviations over what they are now:"
            f" {shares}"
        )
        print(f"    hit points {', '.join(str(point) for point in each.points)}")
