"""Two years of monthly campaigns on a beam that loses stiffness, sent to a running service; when
did the alarm come?

    modalbase up --port 8000                 # in another terminal
    python examples/monitoring.py --url http://127.0.0.1:8000 --key KEY

The beam is the project's own model of a cantilever of fibre reinforced plastic; nothing was
measured. Its stiffness falls by 0.1 % a kelvin with the season's temperature, which swings by ± 10
K. After a year it loses 0.4 % a month of Ex on top, and its damping rises by 2 % a month, as where
a joint works loose. Clamped anew every month, it scatters by 0.3 % in stiffness and 3 % in damping
from one campaign to the next. A campaign is 9 FRFs with 1 % noise.
"""

import argparse
import io
import sys
import time
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from functools import cache
from typing import Any

import httpx
import numpy as np

from fecore.body.laminate import OrthotropicMaterial
from fecore.body.specimen import Specimen
from fecore.frf import Dof, along_z
from fecore.updating.forward import ForwardModel
from fecore.updating.parameters import parametrise

NOMINAL = OrthotropicMaterial(
    Ex=33.0e9, Ey=31.8e9, Gxy=5.7e9, Gxz=4.5e9, Gyz=4.5e9, nu_xy=0.15, density=2012.0
)
BEAM = Specimen(length=0.5, width=0.04, thickness=0.010, material=NOMINAL)
A0, A1 = 5.0, 6.0e-6  # 1/s, s
MONTH = timedelta(days=30.4375)

ROWS = (2, 4, 5, 6, 7, 8, 9, 10, 11)  # elevenths of the length
SENSOR = 9
LINES_HZ = np.arange(5.0, 905.0, 2.0)
NOISE = 0.01  # of each record's rms


@dataclass(frozen=True)
class State:
    """What the beam is like on a day: factors on the nominal Ex, on all stiffness, and on the
    damping.
    """

    stiffness: float = 1.0
    climate: float = 1.0
    damping: float = 1.0


def grid_points() -> dict[int, tuple[float, float, float]]:
    """Nine points in two rows, numbered from the clamped end; the sensor is at the last, a corner
    of the tip.
    """
    return {
        label: (BEAM.length * row / 11, BEAM.width * (0.5 if label % 2 else -0.5), 0.0)
        for label, row in enumerate(ROWS, start=1)
    }


@cache
def frfs(state: State) -> np.ndarray:
    """(9, L) accelerances at the sensor for a hammer at each point, m/s² per N."""
    q = state.climate
    material = replace(
        NOMINAL, Ex=NOMINAL.Ex * q * state.stiffness, Ey=NOMINAL.Ey * q, Gxy=NOMINAL.Gxy * q,
        Gxz=NOMINAL.Gxz * q, Gyz=NOMINAL.Gyz * q,
    )  # fmt: skip
    specimen = replace(BEAM, material=material)
    points = grid_points()
    parameters = parametrise(specimen)
    places = np.array(list(points.values()))[:, :2]
    solved = ForwardModel(specimen, parameters, along_z(points), places, 12).solve(
        parameters.prior_mean
    )
    model = solved.frf_model([Dof(SENSOR, 3)] * len(points), [Dof(point, 3) for point in points])
    rate = state.damping * (A0 + A1 * model.omega**2)
    return model.synthesise(LINES_HZ, rate)


def measured_frfs(state: State, seed: int) -> np.ndarray:
    """The same with noise from a seed."""
    clean = frfs(state)
    random = np.random.default_rng(seed)
    noise = (
        random.standard_normal(clean.shape) + 1j * random.standard_normal(clean.shape)
    ) / np.sqrt(2)
    return clean + NOISE * np.sqrt(np.mean(np.abs(clean) ** 2, axis=1, keepdims=True)) * noise


def as_npz(values: np.ndarray) -> bytes:
    """The FRFs of a campaign as `POST /campaigns/{id}/frfs` takes them."""
    n = values.shape[0]
    buffer = io.BytesIO()
    np.savez(
        buffer,
        frequency_hz=LINES_HZ,
        values=values,
        response_point=np.full(n, SENSOR),
        response_direction=np.full(n, 3),
        reference_point=np.array(list(grid_points())),
        reference_direction=np.full(n, 3),
        quantity=np.array("accelerance"),
    )
    return buffer.getvalue()


def structure_body() -> dict[str, Any]:
    """The beam as the service wants it."""
    names = ("Ex", "Ey", "Gxy", "Gxz", "Gyz")
    material = {f"{name}_Pa": getattr(NOMINAL, name) for name in names} | {"nu_xy": NOMINAL.nu_xy}
    geometry = {"length_m": BEAM.length, "width_m": BEAM.width, "thickness_m": BEAM.thickness}
    return {
        "name": "footbridge stringer",
        "geometry": geometry,
        "density_kg_m3": 2012.0,
        "material": material,
    }


def post_campaign(
    api: httpx.Client, structure: str, body: dict[str, Any], values: np.ndarray
) -> str:
    """Describe a campaign, send its points and FRFs, and say that this is all of it."""
    campaign: str = _post(
        api, f"structures/{structure}/campaigns", {"boundary": "cantilever", **body}
    )["id"]
    send_measurement(api, campaign, values)
    api.post(f"campaigns/{campaign}/complete").raise_for_status()
    return campaign


def send_measurement(api: httpx.Client, campaign: str, values: np.ndarray) -> None:
    """Grid points and FRFs of a campaign."""
    points = [
        {"label": label, "x_m": x, "y_m": y, "z_m": z} for label, (x, y, z) in grid_points().items()
    ]
    api.put(f"campaigns/{campaign}/grid-points", json={"items": points}).raise_for_status()
    npz = {"Content-Type": "application/x-npz"}
    api.post(f"campaigns/{campaign}/frfs", content=as_npz(values), headers=npz).raise_for_status()


def _post(api: httpx.Client, path: str, body: Any) -> dict[str, Any]:
    made: dict[str, Any] = api.post(path, json=body).raise_for_status().json()
    return made


def month(number: int, months: int) -> tuple[dict[str, Any], State, int]:
    """Campaign body, state of the beam and seed of a month; the last month is now."""
    when = datetime.now(UTC).replace(microsecond=0) - MONTH * (months - 1 - number)
    weather, clamp, joint = np.random.default_rng(1000 + number).standard_normal(3)
    kelvin = 10.0 * np.sin(2 * np.pi * number / 12) + 2.0 * weather
    worn = max(0, number - 12)
    state = State(
        stiffness=(1 - 0.004 * worn) * (1 + 0.003 * clamp),
        climate=1 - 0.001 * kelvin,
        damping=(1 + 0.02 * worn) * (1 + 0.03 * joint),
    )
    body = {
        "name": f"{when:%Y-%m}",
        "performed_at": when.isoformat(),
        "temperature_c": round(15 + kelvin, 1),
    }
    return body, state, number


def wait_until_judged(
    api: httpx.Client, monitor: str, campaigns: int, seconds: float = 600
) -> dict[str, Any]:
    """The series, once so many campaigns have been judged."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        series: dict[str, Any] = api.get(f"monitors/{monitor}/series").raise_for_status().json()
        done = sum(c["state"] != "running" for c in series["campaigns"])
        points = [len(p["points"]) for p in series["parameters"]]
        print(f"\r{done} of {campaigns} campaigns run", end="", file=sys.stderr, flush=True)
        if points and min(points) == campaigns:
            print(file=sys.stderr)
            return series
        time.sleep(0.5)
    raise SystemExit(f"the series was not judged within {seconds:g} s; is a worker running?")


def main() -> None:
    """Send the campaigns and print what the monitor made of them."""
    arguments = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    arguments.add_argument("--url", default="http://127.0.0.1:8000")
    arguments.add_argument("--key", required=True)
    arguments.add_argument("--months", type=int, default=24)
    given = arguments.parse_args()
    headers = {"Authorization": f"Bearer {given.key}"}
    with httpx.Client(base_url=f"{given.url}/api/v1/", headers=headers, timeout=60) as api:
        name = (
            # its months end now: each run has a project
            f"footbridge, simulated {datetime.now(UTC):%Y-%m-%d %H:%M:%S}"
        )
        project = _post(api, "projects", {"name": name})["id"]
        structure = _post(api, f"projects/{project}/structures", structure_body())["id"]
        watch = {
            "name": "stringer 1",
            "parameters": [{"name": "Ex"}, {"name": "a0"}, {"name": "a1"}],
            "baseline": {"campaigns": 12},
            "covariates": ["temperature_c"],
            "expected_interval_days": 31,
        }
        monitor = _post(api, f"structures/{structure}/monitors", watch)["id"]
        for number in range(given.months):
            body, state, seed = month(number, given.months)
            post_campaign(api, structure, body, measured_frfs(state, seed))
        report(wait_until_judged(api, monitor, given.months))


def report(series: dict[str, Any]) -> None:
    """Print the series and its alarms."""
    names = {c["campaign_id"]: c["name"] for c in series["campaigns"]}
    print(f"{series['monitor_name']}: {series['state']}")
    for row in series["parameters"]:
        print(f"\n{row['name']}: {row['state']}")
        for point in row["points"]:
            judged = point["judged"]
            verdict = "baseline" if judged is None else f"score {judged['score']:+.1f}"
            outside = "  outside" if judged is not None and judged["outside"] else ""
            print(
                f"  {names[point['campaign_id']]}  {point['raw']:.5g} ±"
                f" {point['standard_deviation']:.1g}  {verdict}{outside}"
            )
        if (rate := row["rate"]) is not None:
            low, high = (100 * value for value in rate["relative_interval_95"])
            print(f"  changes by {low:+.1f} to {high:+.1f} % a year")
        if (change := row["change_point"]) is not None:
            first, last = (date[:7] for date in change["date_interval"])
            print(f"  the change ({change['pattern']}) began between {first} and {last}")
    for alarm in series["alarms"]:
        print(
            f"\nALARM: {alarm['parameter']}, raised by the campaign of"
            f" {names[alarm['campaign_id']]} ({alarm['state']})"
        )


if __name__ == "__main__":
    main()
