"""A campaign that states its sensor's mass, over HTTP: the sensor moved from point to point, or stood still."""

from dataclasses import replace

import httpx
import pytest

from fecore.body.specimen import Specimen
from fecore.body.supports import PointMass
from fecore.updating.measurement import Measurement
from tests.golden.inputs import new_campaign, put_frfs, put_points
from tests.support.cantilever import COUPONS
from tests.support.laboratory import MATERIAL
from tests.support.moved_sensor import LAW, MASS, TRUE, measured
from tests.support.rest import finished, posted, result_of

BODY = Specimen(0.5, 0.04, 0.010, replace(COUPONS, **TRUE))


def campaign_with(api: httpx.Client, name: str, taken: Measurement) -> str:
    """A campaign whose sensor has a mass and no stated point."""
    geometry = {"length_m": BODY.length, "width_m": BODY.width, "thickness_m": BODY.thickness}
    beam = {"name": "beam", "density_kg_m3": BODY.material.density, "geometry": geometry, "material": MATERIAL}
    project = posted(api, "projects", {"name": f"sensor {name}"})["id"]
    campaign = new_campaign(api, beam, project, instruments={"sensor_mass_kg": MASS})
    put_points(api, campaign, taken.points)
    put_frfs(api, campaign, taken.frfs)
    return campaign


def moved() -> Measurement:
    """Four of the points: each is a body of its own to solve, and the core's test has all."""
    tour = measured(BODY, MASS)
    return replace(tour, frfs=tour.frfs.select(list(range(5, 33, 9))))


def standing() -> Measurement:
    """The same tour the other way round: the hammer goes about and the sensor stands at point 33."""
    still = measured(replace(BODY, masses=(PointMass(0.5, 0.02, MASS),)), 0.0)
    return replace(still, frfs=replace(still.frfs, responses=still.frfs.references, references=still.frfs.responses))


@pytest.mark.parametrize(("name", "taken", "roves"), [("moved", moved, True), ("standing", standing, False)])
def test_the_sensors_mass_is_modelled(api: httpx.Client, name: str, taken, roves: bool) -> None:
    campaign = campaign_with(api, name, taken())
    recipe = {"damping_models": ["rayleigh"], "parameters": [{"name": "Ex"}, {"name": "Gxy"}]}
    location = api.post(f"campaigns/{campaign}/update-jobs", json=recipe).raise_for_status().headers["Location"]
    job = finished(api, location)
    assert job["status"] == "succeeded", job
    result = result_of(api, location)
    rows = {row["name"]: row for row in result["parameters"]}
    for parameter, value in {**TRUE, "a0": LAW[0], "a1": LAW[1]}.items():
        low, high = rows[parameter]["interval_95"]
        assert low < value < high, parameter
    assert rows["Ex"]["estimate"] == pytest.approx(TRUE["Ex"], rel=2e-3)  # massless sensors would leave it 2 % low
    assert any("4.8 g moved with the response" in warning for warning in result["warnings"]) == roves
