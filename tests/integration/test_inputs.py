"""What a laboratory says of its inputs, over HTTP: structure, campaign and recipe state them, the update job uses them."""

from collections.abc import Callable
from typing import Any

import httpx
import numpy as np
import pytest
from sqlalchemy import JSON, Engine, update

import service.app.composition  # noqa: F401  imports every table
from service.app.demo import paper
from service.db.base import Base
from service.errors import NotFinite
from tests.support.cantilever import MEASURED_HZ
from tests.support.rest import finished, ok, pointers, posted, result_of

A0, A1, TAU = 30.0, 1e-5, 0.5
EXACT = {"length_sd_m": 0, "width_sd_m": 0, "density_sd_kg_m3": 0, "nu_xy_sd": 0, "fibre_angle_sd_deg": 0}


def modes_under_a_window(api: httpx.Client, campaign: str) -> str:
    """Typed modes of a Rayleigh body, whose decay an exponential window of 0.5 s has made faster."""
    omega = 2 * np.pi * MEASURED_HZ
    ratio = (A0 / omega + A1 * omega) / 2 + 1 / (TAU * omega)
    rows = [
        {"frequency_hz": hz, "damping_ratio": zeta}
        for hz, zeta in zip(MEASURED_HZ.tolist(), ratio.tolist(), strict=True)
    ]
    return str(posted(api, f"campaigns/{campaign}/mode-sets", {"name": "typed", "modes": rows})["id"])


def updated(api: httpx.Client, campaign: str, recipe: dict[str, Any]) -> dict[str, Any]:
    answer = api.post(f"campaigns/{campaign}/update-jobs", json=recipe)
    ok(answer, 202)
    job = finished(api, answer.headers["Location"])
    assert job["status"] == "succeeded", job
    return result_of(api, answer.headers["Location"])


def budget_of(result: dict[str, Any], name: str) -> dict[str, dict[str, Any]]:
    (row,) = (row for row in result["parameters"] if row["name"] == name)
    return {entry["source"]: entry for entry in row["budget"]}


def test_what_structure_and_campaign_state_reaches_the_result_of_typed_modes(
    api: httpx.Client, project: str, beam: dict[str, Any]
) -> None:
    """A campaign without FRFs is updated from its modes alone; the recipe has the last word."""
    stated = {**beam, "inputs": {**EXACT, "thickness_sd_m": 0.3e-3}}
    structure = posted(api, f"projects/{project}/structures", stated)
    assert structure["inputs"] == {**stated["inputs"], "ply_angle_sd_deg": None}
    body = {
        "name": "typed",
        "boundary": "cantilever",
        "inputs": {"clamp_compliance_sd": 0, "window_time_constant_s": TAU},
    }
    campaign = posted(api, f"structures/{structure['id']}/campaigns", body)
    assert campaign["inputs"]["window_time_constant_s"] == TAU
    mode_set = modes_under_a_window(api, campaign["id"])

    result = updated(api, campaign["id"], {"mode_set": mode_set})
    assert [(o["stage"], o["status"]) for o in result["outcomes"]] == [
        ("elastic", "succeeded"),
        ("damping", "succeeded"),
    ]
    budget = budget_of(result, "Ex")
    assert budget["thickness"]["provenance"] == "0.0003 m, stated"
    assert not {"length", "density", "clamp_rotation", "fibre_angle"} & set(budget)
    found = {row["name"]: row["estimate"] for row in result["parameters"]}
    assert found["a0"] == pytest.approx(A0, rel=1e-6)  # the window's 2/τ is taken off exactly
    assert found["a1"] == pytest.approx(A1, rel=1e-6)
    assert result["provenance"]["inputs"]["thickness_sd_m"] == 0.3e-3

    recipe = {"mode_set": mode_set, "inputs": {"thickness_sd_m": 0, "window_rate_per_s": 0}}
    result = updated(api, campaign["id"], recipe)
    assert "thickness" not in budget_of(result, "Ex")
    found = {row["name"]: row["estimate"] for row in result["parameters"]}
    assert found["a0"] == pytest.approx(A0 + 2 / TAU, rel=1e-6)


def test_a_change_of_inputs_is_a_version(api: httpx.Client, structure: str) -> None:
    address = f"structures/{structure}"
    before = api.get(address)
    assert ok(before)["inputs"] is None
    patch = {"inputs": {"density_sd_kg_m3": 10.0}}
    after = ok(api.patch(address, json=patch, headers={"If-Match": before.headers["ETag"]}))
    assert (after["version"], after["inputs"]["density_sd_kg_m3"]) == (2, 10.0)


def test_impossible_inputs_are_refused_by_their_field(
    api: httpx.Client, structure: str, project: str, beam: dict[str, Any], new_campaign: Callable[..., str]
) -> None:
    negative = api.post(f"projects/{project}/structures", json={**beam, "inputs": {"width_sd_m": -1e-3}})
    assert (negative.status_code, pointers(negative.json())) == (422, {"/inputs/width_sd_m"})
    both = {"window_rate_per_s": 2.0, "window_time_constant_s": 0.5}
    body = {"name": "twice", "boundary": "cantilever", "inputs": both}
    twice = api.post(f"structures/{structure}/campaigns", json=body)
    assert (twice.status_code, pointers(twice.json())) == (422, {"/inputs"})
    recipe = api.post(f"campaigns/{new_campaign()}/update-jobs", json={"inputs": both})
    assert (recipe.status_code, pointers(recipe.json())) == (422, {"/inputs"})


def test_a_clamp_that_is_none_is_refused_at_every_door(
    api: httpx.Client,
    structure: str,
    new_campaign: Callable[..., str],
    rows: Callable[..., list[dict[str, Any]]],
) -> None:
    soft = {"clamp_compliance_sd": 100}
    campaign = new_campaign()
    described = {"name": "soft", "boundary": "cantilever", "inputs": soft}
    jobs = [{"campaign_id": campaign, "recipe": {"inputs": soft}}, {"campaign_id": new_campaign()}]
    doors = {
        f"campaigns/{campaign}/update-jobs": ({"inputs": soft}, "/inputs"),
        f"structures/{structure}/campaigns": (described, "/inputs"),
        f"structures/{structure}/monitors": ({"name": "m", "recipe": {"inputs": soft}}, "/inputs"),
        "update-jobs": ({"joint": True, "jobs": jobs}, "/jobs/0/recipe/inputs"),
    }
    for path, (body, at) in doors.items():
        refused = ok(api.post(path, json=body), 422)
        assert pointers(refused) == {f"{at}/clamp_compliance_sd"}, path
    changed = api.patch(f"campaigns/{campaign}", json={"inputs": soft}, headers={"If-Match": "*"})
    assert pointers(ok(changed, 422)) == {"/inputs/clamp_compliance_sd"}

    # An earlier version took it: what it stored is shown, and an update says what is wrong.
    rows("""UPDATE campaigns SET inputs = '{"clamp_compliance_sd": 100}' WHERE id = %s RETURNING id""", campaign)
    assert ok(api.get(f"campaigns/{campaign}"))["inputs"]["clamp_compliance_sd"] == 100
    begun = api.post(f"campaigns/{campaign}/update-jobs", json={"mode_set": modes_under_a_window(api, campaign)})
    job = finished(api, begun.headers["Location"])
    assert (job["status"], job["error"]["reason"]) == ("failed", "refused")
    assert "expected at most 1: there the clamp turns as easily as the specimen bends" in job["message"]


def test_a_result_that_json_cannot_hold_is_refused_by_its_place(
    api: httpx.Client, campaign: str, imported: Callable[..., dict[str, Any]]
) -> None:
    """A sensor whose mass is known to within 1,000 t leaves the moduli open: their intervals end at infinity."""
    assert imported(campaign, paper.uff_file())["status"] == "succeeded"
    modes = posted(api, f"campaigns/{campaign}/mode-sets", {"name": "published", "modes": paper.MODES})["id"]
    recipe = {"mode_set": modes, "inputs": {"sensor_mass_sd_kg": 1e6}, "damping_models": ["rayleigh"]}
    job = finished(api, api.post(f"campaigns/{campaign}/update-jobs", json=recipe).headers["Location"])
    assert (job["status"], job["error"]["reason"], job["error"]["type"]) == ("failed", "refused", "NotFinite")
    assert job["message"].startswith("the result has no finite number at /parameters/0/interval_95/1"), job["message"]


@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf])
def test_no_column_of_the_database_takes_a_number_that_json_lacks(engine: Engine, number: float) -> None:
    """Whichever kind of job stores it: of every table the columns that hold documents."""
    columns = [
        column for table in Base.metadata.tables.values() for column in table.columns if isinstance(column.type, JSON)
    ]
    assert {column.table.name for column in columns} >= {
        "update_results",
        "joint_updates",
        "processings",
        "identifications",
        "mode_sets",
        "monitor_series",
        "monitor_runs",
    }
    for column in columns:
        with pytest.raises(NotFinite, match="no finite number at /a/1;"), engine.connect() as connection:
            connection.execute(update(column.table).values({column: {"a": [1.0, float(number)]}}))
