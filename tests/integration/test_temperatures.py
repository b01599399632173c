"""Campaigns at several temperatures over HTTP: their constants at one, the curve, its figure and
its page.
"""

from typing import Any

import httpx
import numpy as np
import pytest

from service.app.supervisor import LocalService
from tests.support.rest import finished, mode_rows, ok, posted, result_of, session_client
from tests.support.warm import SIZE, STATED, campaign, constants

PARAMETERS = [
    {"name": "Ex"},
    {"name": "Gxy"},
    {"name": "a1.per_K", "prior_sd": 0.02},
]


@pytest.fixture
def jobs(api: httpx.Client, project: str) -> list[dict[str, Any]]:
    """Jobs of a joint update of one strip at 20 and 50 °C."""
    moduli = {f"{name}_Pa": getattr(STATED, name) for name in ("Ex", "Ey", "Gxy", "Gxz", "Gyz")}
    body = {
        "name": "strip",
        "geometry": dict(zip(("length_m", "width_m", "thickness_m"), SIZE, strict=True)),
        "density_kg_m3": STATED.density,
        "material": {**moduli, "nu_xy": STATED.nu_xy},
    }
    structure, random, jobs = (
        posted(api, f"projects/{project}/structures", body)["id"],
        np.random.default_rng(4),
        [],
    )
    for temperature in (20.0, 50.0):
        test = campaign(temperature, random)
        about = {"name": test.name, "boundary": "free", "temperature_c": temperature}
        key = posted(api, f"structures/{structure}/campaigns", about)["id"]
        points = [
            {"label": label, "x_m": x, "y_m": y, "z_m": z}
            for label, (x, y, z) in test.points.items()
        ]
        ok(api.put(f"campaigns/{key}/grid-points", json={"items": points}))
        sent = {"name": "measured", "modes": mode_rows(test.modes, 3e-4)}
        jobs.append(
            {
                "campaign_id": key,
                "recipe": {"mode_set": posted(api, f"campaigns/{key}/mode-sets", sent)["id"]},
            }
        )
    return jobs


def test_one_strip_at_two_temperatures_is_one_material_with_a_curve(
    api: httpx.Client, jobs: list[dict[str, Any]], service: LocalService
) -> None:
    begun = api.post(
        "update-jobs", json={"joint": True, "jobs": jobs, "recipe": {"parameters": PARAMETERS}}
    )
    ok(begun, 202)
    job, at = (
        finished(api, begun.headers["Location"]),
        str(api.base_url.join(begun.headers["Location"])),
    )
    assert job["status"] == "succeeded", job
    result = ok(api.get(f"{at}/result"))
    assert (result["verdict"]["level"], result["reference_temperature_c"]) == ("usable", 23.0)
    rows = {row["name"]: row for row in result["parameters"]}
    low, high = rows["Gxy"]["interval_95"]
    assert low < constants(23.0)["Gxy"] < high
    assert rows["Gxy.per_K"]["unit"] == "1/K"
    assert "Gxy.per_K" not in result["campaigns"][0]["alone"]
    assert {row["name"] for row in result["curve"]["constants"]} > {"Ex", "Gxy"}
    assert len(result["curve"]["temperature_c"]) == len(result["curve"]["constants"][0]["low"])
    figure = ok(api.get(f"{at}/figures/temperature"))
    assert {"Ex", "Gxy"} <= {trace["name"] for trace in figure["data"]}
    with session_client(api, base=service.url) as browser:
        page = browser.get(f"/ui/joint-updates/{job['id']}").text
    assert "given at 23" in page
    assert "%/K" in page


def test_a_single_update_holds_at_its_own_temperature_or_where_the_recipe_says(
    api: httpx.Client, jobs: list[dict[str, Any]]
) -> None:
    key, recipe = jobs[1]["campaign_id"], {**jobs[1]["recipe"], "parameters": PARAMETERS[:2]}
    results = []
    for more in ({}, {"reference_temperature_c": 23.0}):
        begun = api.post(f"campaigns/{key}/update-jobs", json={**recipe, **more})
        assert finished(api, begun.headers["Location"])["status"] == "succeeded"
        results.append(result_of(api, begun.headers["Location"]))
    own, there = results
    assert (own["reference_temperature_c"], own["curve"]) == (50.0, None)
    assert there["curve"]["reference_c"] == there["reference_temperature_c"] == 23.0
    wider = [result["parameters"][1]["standard_deviation"] for result in results]
    assert wider[1] > 1.2 * wider[0]


def test_a_reference_where_nobody_states_a_temperature_is_refused(
    api: httpx.Client, jobs: list[dict[str, Any]]
) -> None:
    key = jobs[0]["campaign_id"]
    known = {"If-Match": api.get(f"campaigns/{key}").headers["ETag"]}
    ok(api.patch(f"campaigns/{key}", json={"temperature_c": None}, headers=known))
    refused = api.post(
        f"campaigns/{key}/update-jobs", json={**jobs[0]["recipe"], "reference_temperature_c": 23.0}
    )
    ok(refused, 422)
    assert "temperature_c" in refused.text
    of_one = {
        "jobs": [
            {**jobs[1], "recipe": {**jobs[1]["recipe"], "reference_temperature_c": 23.0}},
            jobs[0],
        ]
    }
    assert "common `recipe`" in api.post("update-jobs", json={"joint": True, **of_one}).text
