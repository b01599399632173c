"""Do plans come true? What tests and coupons were to bring, beside what the update finds once they
are made.

Strips of a simulated panel (`tests.support.strips`), every laboratory input drawn and the moduli of
each specimen, and of the coupons' panel, off the material's by a scatter of 2 %, each coupon by 5
%. One or two strips are made; the plan foretells what another brings, or a cantilever of the same,
or coupons. Then it is made, and the default update has it all.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from benchmarks.tables import Table
from fecore.body.specimen import OrientedSpecimen
from fecore.coupons.batch import Statistics, prior
from fecore.updating.campaigns import Campaign, CampaignsResult, update_campaigns
from fecore.updating.layout import Coupon
from fecore.updating.plans import Forecast, PlannedCoupons, PlannedTest, plan_tests
from tests.support.strips import NOMINAL, STRIP, TRUTH, measured

SCATTER, OF_COUPONS, PIECES = 0.02, 0.05, 5
CONSTANTS = ("Ex", "Gxy")
SO_FAR = {"one strip": ((0.0, "free"),), "two strips": ((0.0, "free"), (90.0, "free"))}
MORE = {"free at 45°": (45.0, "free"), "cantilever of it": (0.0, "cantilever"), "coupons": None}
HIGHEST_HZ = {"free": 3900.0, "cantilever": 4000.0}  # nine modes, as are measured
_SEEN = 0.8  # of the prior's standard deviation: what is less known is hardly asked of the tests


def planned(draws: int = 8, seed: int = 36) -> list[str]:
    """What plans predict beside what the update finds once they are made: standard deviations of
    what the tests show.
    """
    columns = (
        "found/predicted, median:.2f",
        "least:.2f",
        "most:.2f",
        "nats found:.2f",
        "predicted:.2f",
    )
    table = Table("", "so far:11", "more:18", *columns)
    for number, (made, cuts) in enumerate(SO_FAR.items()):
        ratios, gains = (
            defaultdict[str, list[float]](list),
            defaultdict[str, list[tuple[float, float]]](list),
        )
        for draw in range(draws):
            for more, found, forecast, gain in _drawn(
                cuts, np.random.default_rng([seed, number, draw])
            ):
                ratios[more] += [found[name] / forecast.standard_deviations[name] for name in found]
                gains[more].append((gain, forecast.information))
        for more, each in ratios.items():
            low, middle, high = np.quantile(each, [0.0, 0.5, 1.0])
            table.row(made, more, middle, low, high, *np.mean(gains[more], axis=0))
    return []


def _drawn(
    cuts: Sequence[tuple[float, str]], random: np.random.Generator
) -> list[tuple[str, dict[str, float], Forecast, float]]:
    """For each plan: the standard deviations of constants that the tests show, its forecast, and
    the information found.
    """
    # of specimens: the same dimensions in each of their campaigns
    seeds = random.integers(2**31, size=len(cuts) + 1)
    made = [
        _measured(int(seed), f"{k}", *cut)
        for k, (seed, cut) in enumerate(zip(seeds, cuts, strict=False))
    ]
    relative = prior(Statistics(PIECES, 1.0, OF_COUPONS)).standard_deviation
    asked = PlannedCoupons("coupons", CONSTANTS, relative, PIECES)
    tests = {name: _planned(name, *cut) for name, cut in MORE.items() if cut}
    plan = plan_tests(list(tests.values()), made, coupons=[asked])
    before, rows = update_campaigns(made), []
    panel = _scattered(random)
    for forecast in plan.forecasts:
        if forecast.name == "coupons":
            means = {
                n: panel[n] * (1 + OF_COUPONS / PIECES**0.5 * random.standard_normal())
                for n in CONSTANTS
            }
            after = update_campaigns(
                made,
                coupons=[Coupon(n, m, relative * m, "coupons", PIECES) for n, m in means.items()],
            )
        else:
            angle, boundary = MORE[forecast.name] or (0.0, "")
            own = seeds[0 if boundary == "cantilever" else -1]
            test = _measured(int(own), forecast.name, angle, boundary)
            after = update_campaigns([*made, replace(test, specimen=tests[forecast.name].specimen)])
        shown = [
            p for p in after.parameters if p.standard_deviation < _SEEN * (p.prior_sd or np.inf)
        ]
        volumes = [_log_volume(each) for each in (before, after)]
        rows.append(
            (
                forecast.name,
                {p.name: p.standard_deviation for p in shown},
                forecast,
                volumes[0] - volumes[1],
            )
        )
    return rows


def _scattered(random: np.random.Generator) -> dict[str, float]:
    """Constants of one specimen, or of the panel that the coupons are cut from."""
    return {
        n: v * (1 + (SCATTER * random.standard_normal() if n != "nu_xy" else 0.0))
        for n, v in TRUTH.items()
    }


def _measured(seed: int, name: str, angle: float, boundary: str) -> Campaign:
    random = np.random.default_rng(seed)
    truth = _scattered(random)
    one = measured(random, name, STRIP, angle, boundary=boundary, truth=truth)
    return replace(one, body=replace(one.body, divisions=None))  # type: ignore[type-var]


def _planned(name: str, angle: float, boundary: str) -> PlannedTest:
    body = OrientedSpecimen(*STRIP, NOMINAL, boundary, fibre_angle=float(np.radians(angle)))  # type: ignore[arg-type]
    points = tuple(
        (float(x), y) for x in np.linspace(0.1, 0.98, 9) * STRIP[0] for y in (-0.0135, 0.0, 0.0135)
    )
    specimen = "0" if boundary == "cantilever" else name
    return PlannedTest(name, body, HIGHEST_HZ[boundary], points, 26, specimen=specimen)


def _log_volume(result: CampaignsResult) -> float:
    """½ ln |C| of the material's constants, in their logarithms."""
    known = {p.name: p for p in result.parameters}
    sds = [
        known[n].standard_deviation / (known[n].estimate if n != "nu_xy" else 1.0)
        for n in result.posterior.names
    ]
    return float(np.linalg.slogdet(result.posterior.correlation)[1] / 2 + np.log(sds).sum())
