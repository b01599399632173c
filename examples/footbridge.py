"""Three years of a footbridge: fills a service with made campaigns on two stringers, and asks it
ten questions.

    modalbase up --port 8000                 # in another terminal
    python -m examples.footbridge --url http://127.0.0.1:8000 --key KEY

Nothing was measured: the stringers are those of `examples/monitoring.py`, with 9 FRFs a campaign
and 1 % noise. The stiffness of both falls by 0.1 % a kelvin; Ex of the north one falls by 1 % a
year on top. Their sensor was calibrated for a year from April 2023, and again in October 2024, and
nobody noticed the months between. From 2025 on another hammer is used.
"""

import argparse
from datetime import UTC, datetime
from math import cos, pi
from typing import Any

import numpy as np

import modalbase
from examples.monitoring import (
    LINES_HZ,
    MONTH,
    SENSOR,
    State,
    grid_points,
    measured_frfs,
    structure_body,
)

START, MONTHS = datetime(2023, 4, 15, 10, tzinfo=UTC), 36
LOSS = {"north stringer": 0.01, "south stringer": 0.0}
"""Share of Ex that each stringer loses a year."""
PER_KELVIN = 0.001
HAMMERS = ("8206-002", "086C03")
CALIBRATIONS = [
    {
        "performed_on": "2023-04-01",
        "valid_until": "2024-03-31",
        "sensitivity": 10.2,
        "unit": "mV/g",
    },
    {
        "performed_on": "2024-10-01",
        "valid_until": "2026-12-31",
        "sensitivity": 10.1,
        "unit": "mV/g",
    },
]
SERIAL = "30517"

QUESTIONS = [
    ("campaigns above 25 °C", "campaigns", "temperature_c > 25"),
    ("winters of the north stringer", "campaigns", "tag = 'winter' AND structure.name = 'north stringer'"),
    ("what was measured with the other hammer", "campaigns", "hammer <> '8206-002'"),
    ("what the expired calibration touched", "campaigns", "instrument.calibration_expired = TRUE"),
    ("driving-point FRFs of sensor 30517", "frfs", "driving_point = TRUE AND instrument.serial = '30517'"),
    ("FRFs of 2024 with the force at point 3", "frfs", "reference_point = 3 AND T_DURING(campaign.performed_at, "
     "INTERVAL('2024-01-01', '2024-12-31'))"),
    ("first bending modes", "modes", "frequency_hz < 50"),
    ("usable results below 32.5 GPa", "results", "Ex < 32.5e9 AND verdict <> 'do_not_use'"),
    ("first bending of each stringer over three years", "modes", "frequency_hz < 50"),
    ("Ex of each stringer over three years", "results", "Ex > 0"),
]  # fmt: skip
"""In words, the noun, and the filter; the last two are followed over time."""


def degrees(when: datetime) -> float:
    """Air temperature of a day, °C: 12 on average, 28 in July."""
    return round(12 + 16 * cos(2 * pi * (when.timetuple().tm_yday - 196) / 365.25), 1)


def campaign_of(number: int, campaigns: int) -> tuple[dict[str, Any], datetime]:
    """What is stated of a campaign, and when it was, of so many in three years."""
    when = START + MONTH * MONTHS * number / campaigns
    season = (
        "winter" if when.month in (12, 1, 2) else "summer" if when.month in (6, 7, 8) else "between"
    )
    instruments = {
        "hammer": {"model": HAMMERS[when.year >= 2025]},
        "sensor": {"model": "4507", "serial": SERIAL},
    }
    stated = {
        "performed_at": when.isoformat(),
        "temperature_c": degrees(when),
        "instruments": instruments,
    }
    return {**stated, "tags": [season], "meta": {"client": "City of Steg"}}, when


def fill(lab: modalbase.Laboratory, project_name: str, campaigns: int = MONTHS) -> None:
    """Send so many campaigns of each stringer, update its model to each, and wait for the
    results.
    """
    project = lab.project(project_name, create=True)
    project.add_instrument("sensor", SERIAL, model="4507", calibrations=CALIBRATIONS)
    jobs = []
    for name, loss in LOSS.items():
        structure = project.new_structure(**{**structure_body(), "name": name})
        for number in range(campaigns):
            stated, when = campaign_of(number, campaigns)
            years = (when - START).days / 365.25
            campaign = structure.new_campaign(f"{when:%Y-%m}", "cantilever", **stated)
            campaign.set_grid_points([(label, *place) for label, place in grid_points().items()])
            state = State(stiffness=1 - loss * years, climate=1 - PER_KELVIN * (degrees(when) - 15))
            campaign.add_frfs(_frfs(measured_frfs(state, seed=len(jobs))))
            jobs.append(campaign.update())
    for job in jobs:
        job.wait().check()


def _frfs(values: np.ndarray) -> modalbase.Frfs:
    points = list(grid_points())
    return modalbase.Frfs.from_arrays(
        LINES_HZ,
        values,
        response=[(SENSOR, 3)] * len(points),
        reference=[(point, 3) for point in points],
    )


def ask(lab: modalbase.Laboratory, project_name: str) -> None:
    """Print the answer to each question."""
    within = f" AND project.name = '{project_name}'"
    for words, noun, text in QUESTIONS[:-2]:
        print(f"{words}: {lab.find(noun, text + within).count}")
    for words, noun, text in QUESTIONS[-2:]:
        print(f"\n{words}\n{lab.find(noun, text + within).trend()}")


def main() -> None:
    """Fill a service and ask it."""
    arguments = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    arguments.add_argument("--url")
    arguments.add_argument("--key")
    arguments.add_argument("--project", default="footbridge")
    arguments.add_argument("--campaigns", type=int, default=MONTHS, help="of each stringer")
    given = arguments.parse_args()
    with modalbase.connect(given.url, given.key) as lab:
        fill(lab, given.project, given.campaigns)
        ask(lab, given.project)


if __name__ == "__main__":
    main()
