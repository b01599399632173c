"""Bodies in space over HTTP: a shape goes in, FRFs along several directions, and the constants of
each wall come out.
"""

import tempfile
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from fecore.updating.posterior import prior_of_scatter
from modalbase.formats.uff import Element, GridPoint, ModeShape
from tests.support.places import shared_file
from tests.support.profiles import ANGLE, TRUTH, measured
from tests.support.rest import finished, ok, result_of
from tests.support.uff import load

FEW_MODES: dict[str, Any] = {
    "identification": {"band_hz": [5, 395]},
    "damping_models": ["rayleigh"],
}


def made(api: httpx.Client, project: str, **shape: Any) -> dict[str, Any]:
    """A structure like the angle, with other members of its shape."""
    body = {**ANGLE, "shape": {**ANGLE["shape"], **shape}}
    return ok(api.post(f"projects/{project}/structures", json=body), 201)


def updated(
    api: httpx.Client,
    structure: str,
    content: bytes,
    boundary: str,
    recipe: dict[str, Any] | None = None,
    **campaign: Any,
) -> tuple[str, Any]:
    """The address of an update, with an empty recipe where none is stated, and its result."""
    sent = {"name": boundary, "boundary": boundary, "inputs": {"window_rate_per_s": 0}, **campaign}
    key = ok(api.post(f"structures/{structure}/campaigns", json=sent), 201)["id"]
    queued = api.post(f"campaigns/{key}/imports", params={"filename": "test.uff"}, content=content)
    report = finished(api, queued.headers["Location"])
    assert (report["status"], report["warnings"]) == ("succeeded", [])
    job = api.post(f"campaigns/{key}/update-jobs", json=recipe or {})
    done = finished(api, job.headers["Location"])
    assert done["status"] == "succeeded", done["error"]
    return job.headers["Location"], result_of(api, job.headers["Location"])


@pytest.mark.long
@pytest.mark.parametrize("boundary", ["cantilever", "free", "simply_supported"])
def test_constants_of_each_wall_come_back_from_an_empty_recipe(
    api: httpx.Client, project: str, boundary: str
) -> None:
    """The main promise of bodies in space, as a user meets it: FRFs go in, the constants of each
    wall come out within their intervals. With coupons of one wall it always runs, below.
    """
    structure = made(api, project)
    address, result = updated(api, structure["id"], measured(boundary=boundary), boundary)
    assert result["verdict"]["level"] in ("usable", "with_care")
    constants = {row["name"]: row for row in result["parameters"]}
    assert list(constants)[:10] == [
        f"{s}.{c}" for s in ("flange", "web") for c in ("E1", "E2", "G12", "G13", "G23")
    ]
    require_truth(constants)
    assert constants["flange.E1"]["unit"] == "Pa"
    sources = {entry["source"] for entry in constants["web.E1"]["budget"]}
    largest = "clamp" if boundary == "cantilever" else "web.density"
    assert {"model of the joints", "common material of the sets", "web.t", largest} <= sources
    assert min(mode["mac"] for mode in result["modes"] if mode["mac"] is not None) > 0.95
    assert len(result["provenance"]["frfs"]) == 28
    query = {
        "filter": f"id = '{address.rpartition('/')[2]}' AND flange.E1_sd > 0",
        "fields": "flange.E1",
    }
    (row,) = ok(api.get("search/results", params=query), 200)["items"]
    assert row["flange.E1"] == constants["flange.E1"]["estimate"]
    get_shown(api, address)


def require_truth(constants: dict[str, Any]) -> None:
    """Each constant that is not as it was stated is within its interval."""
    for name, value in TRUTH.items():
        low, high = constants[name]["interval_95"]
        assert low < value < high, name


def uff_contents(content: bytes) -> list[Any]:
    """What a UFF file holds."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "shapes.uff")
        path.write_bytes(content)
        file = load(path)
    assert set(file.outcomes) == {"read"}
    return list(file.contents)


def get_shown(api: httpx.Client, address: str) -> None:
    """Everything that is drawn and written of a result is there."""
    base = api.base_url.join(address)
    listed = ok(api.get(f"{base}/figures"), 200)["items"]
    drawn = [figure["name"] for figure in listed if figure["available"]]
    assert {"frf", "parameters", "shapes", "mac", "sac"} <= set(drawn)
    # the others are drawn in the report
    for name in {"parameters", "stabilisation"} & set(drawn):
        assert ok(api.get(f"{base}/figures/{name}"), 200)["data"], name
    shapes = ok(api.get(f"{base}/figures/shapes"), 200)["layout"]["meta"]
    assert shapes["z_m"][:2] == [-0.04, 0.034]
    written = uff_contents(api.get(f"{base}/mesh", params={"format": "uff"}).content)
    shown = ok(api.get(f"{base}/mesh"), 200)
    modes = [each for each in written if isinstance(each, ModeShape)]
    assert len(modes) == len(shown["model"]) + len(shown["measured"])
    assert modes[-1].label.startswith(f"measured mode {shown['measured'][-1]['number']}, expanded")
    assert len(modes[-1].points) == len(shown["nodes"]["x_m"])
    at_points = uff_contents(
        api.get(f"{base}/mesh", params={"format": "uff", "at": "points"}).content
    )
    assert {each.number: each.xyz_m[0] for each in at_points if isinstance(each, GridPoint)} == {
        point["label"]: point["x_m"] for point in shown["points"]
    }
    report = api.get(f"{base}/report").text
    assert "400 × 60 × 80 mm (length × width × height), 1850 kg/m³" in report
    assert "angle: flange 4 mm, web 4 mm" in report
    for name in ("cards", "deck"):
        assert "/model/mesh?format=uff" in ok(api.get(f"{base}/{name}"), 409)["detail"]


@pytest.mark.long
def test_two_campaigns_of_a_body_are_updated_together(api: httpx.Client, project: str) -> None:
    """A joint update over HTTP of a body of walls, with coupons of one of them."""
    structure = made(api, project)["id"]
    keys = []
    for boundary in ("free", "cantilever"):
        sent = {"name": boundary, "boundary": boundary, "inputs": {"window_rate_per_s": 0}}
        keys.append(ok(api.post(f"structures/{structure}/campaigns", json=sent), 201)["id"])
        queued = api.post(
            f"campaigns/{keys[-1]}/imports",
            params={"filename": "t.uff"},
            content=measured(boundary=boundary),
        )
        assert finished(api, queued.headers["Location"])["status"] == "succeeded"
    few = {"identification": FEW_MODES["identification"]}
    jobs = [{"campaign_id": key, "recipe": few} for key in keys]
    turned = {"joint": True, "jobs": [jobs[0], {**jobs[1], "angle_deg": 3}], "coupon_batches": []}
    faults = ok(api.post("update-jobs", json=turned), 422)["errors"]
    assert [(each["pointer"], "lies as it is stated" in each["detail"]) for each in faults] == [
        ("/jobs/1/angle_deg", True)
    ]
    wrong = {"joint": True, "jobs": jobs, "recipe": {"parameters": [{"name": "rib.E1"}]}}
    assert "flange.E1" in ok(api.post("update-jobs", json=wrong), 422)["errors"][0]["detail"]
    batch = of_web(api, structure)
    begun = api.post("update-jobs", json={"joint": True, "jobs": jobs, "coupon_batches": [batch]})
    done = finished(api, begun.headers["Location"])
    assert done["status"] == "succeeded", done["error"]
    result = result_of(api, begun.headers["Location"])
    constants = {row["name"]: row for row in result["parameters"]}
    assert list(constants) == [
        f"{s}.{c}" for s in ("flange", "web") for c in ("E1", "E2", "G12", "G13", "G23")
    ]
    require_truth(constants)
    assert {row["name"] for row in result["campaigns"][0]["own"]} >= {
        "flange.t",
        "web.density",
        "height",
        "length",
    }
    assert result["conflicts"] == []
    # The web is one more piece of the batch's material, which is known to 0.22 GPa; the modes alone
    # know it to 0.75.
    assert 0.8 * COUPON_SD < constants["web.E2"]["standard_deviation"] < 1.1 * COUPON_SD
    assert constants["web.E2"]["budget"][0]["source"] == "coupons"


def of_web(api: httpx.Client, structure: str) -> str:
    """A batch of coupons across the web alone, which say nothing wrong."""
    batch = {
        "name": "web, 90°",
        "constants": ["Ey"],
        "sets": ["web"],
        "published": {"Ey": {"mean": TRUTH["web.E2"], "standard_deviation": COUPON_SD, "n": 20}},
    }
    return str(ok(api.post(f"structures/{structure}/coupon-batches", json=batch), 201)["id"])


COUPON_SD = 0.2e9


def test_coupons_of_one_wall_are_the_prior_of_its_constants(
    api: httpx.Client, project: str
) -> None:
    """A prior that reached another wall would pass as a measurement of it; and a sensor on a wall
    is a mass there.
    """
    structure = made(api, project)["id"]
    unknown = {"name": "rib", "constants": ["Ex"], "sets": ["web", "rib"]}
    (fault,) = ok(api.post(f"structures/{structure}/coupon-batches", json=unknown), 422)["errors"]
    assert (fault["pointer"], fault["detail"]) == (
        "/sets/1",
        "is rib; the structure has flange, web",
    )
    batch = of_web(api, structure)
    assert ok(api.get(f"coupon-batches/{batch}"), 200)["sets"] == ["web"]
    low = {"identification": {"band_hz": [5, 250]}}
    recipe = {"prior_from_coupon_batch": batch, **FEW_MODES, **low}
    sensor = {"sensor_mass_kg": 0.002, "sensor_point": 2}
    address, result = updated(api, structure, measured(), "free", recipe, instruments=sensor)
    constants = {row["name"]: row for row in result["parameters"]}
    assert "sensor_mass" in {each["source"] for row in constants.values() for each in row["budget"]}
    assert constants["web.E2"]["prior_mean"] == TRUTH["web.E2"]
    # one more piece than the twenty
    assert COUPON_SD < constants["web.E2"]["prior_sd"] < 1.1 * COUPON_SD
    assert constants["flange.E2"]["prior_mean"] == ANGLE["shape"]["material"]["E2_Pa"]
    require_truth(constants)
    assert constants["web.E2"]["standard_deviation"] <= constants["web.E2"]["prior_sd"]
    get_shown(api, address)


def test_a_shape_is_kept_in_versions(api: httpx.Client, project: str) -> None:
    structure = made(api, project)
    assert structure["shape"]["walls"]["web"]["thickness_m"] == 0.004
    address = f"structures/{structure['id']}"
    edit = {"If-Match": api.get(address).headers["ETag"]}
    longer = {**ANGLE["shape"], "length_m": 0.5}
    changed = ok(api.patch(address, json={"shape": longer}, headers=edit), 200)
    assert (changed["version"], changed["shape"]["length_m"]) == (2, 0.5)
    assert ok(api.get(f"{address}/versions/1"), 200)["shape"]["length_m"] == 0.4
    edit = {"If-Match": api.get(address).headers["ETag"]}
    flat = {"length_m": 0.5, "width_m": 0.04, "thickness_m": 0.01}
    changed = ok(api.patch(address, json={"geometry": flat}, headers=edit), 200)
    assert (changed["version"], changed["shape"], changed["geometry"]) == (3, None, flat)


def test_the_mesh_of_a_shape_as_files(api: httpx.Client, project: str) -> None:
    address = f"structures/{made(api, project)['id']}/model/mesh"
    shown = ok(api.get(address), 200)
    answer = api.get(address, headers={"Accept": "application/x-uff"})
    elements = [each for each in uff_contents(answer.content) if isinstance(each, Element)]
    assert len(elements) == sum(len(block["numbers"]) for block in shown["blocks"])
    assert {each.descriptor for each in elements} == {45}
    vtu = api.get(address, params={"format": "vtu"})
    assert f'NumberOfPoints="{len(shown["nodes"]["numbers"])}"'.encode() in vtu.content
    assert api.get(address, headers={"If-None-Match": vtu.headers["ETag"]}).status_code == 200
    again = api.get(
        address, params={"format": "vtu"}, headers={"If-None-Match": vtu.headers["ETag"]}
    )
    assert again.status_code == 304
    assert (
        "expected one of json, vtu, uff"
        in ok(api.get(address, params={"format": "stl"}), 422)["detail"]
    )


WRONG: list[tuple[Callable[[dict[str, Any]], Any], str, str]] = [
    (lambda s: s.update(kind="z"), "/shape/kind", "'i'"),
    (lambda s: s.update(height_m=None), "/shape/walls", "height_m: is missing"),
    (lambda s: s.update(height_m=0.006), "/shape/walls", "no room for walls"),
    (lambda s: s.update(length_m=80), "/shape/walls", "are all dimensions in m?"),
    (lambda s: s.update(ribs_m=[0.01]), "/shape/ribs_m", "angle has no ribs"),
    (lambda s: s.update(kind="panel"), "/shape/ribs_m", "at least one rib"),
    (lambda s: s["walls"].pop("web"), "/shape/walls", "angle has flange and web"),
    (lambda s: s["walls"].update(web={}), "/shape/walls", "web states neither"),
    (lambda s: s.pop("material"), "/shape/walls", "flange states no material"),
    (lambda s: s["material"].update(nu_12=2), "/shape/material/nu_12", "positive definite"),
    (
        lambda s: s["material"].update(density_kg_m3=1.85),
        "/shape/material/density_kg_m3",
        "did you mean 1850",
    ),
    (lambda s: s["walls"]["web"].update(thickness_m=4), "/shape/walls", "no room for walls"),
]


@pytest.mark.parametrize(("change", "pointer", "words"), WRONG)
def test_what_is_wrong_with_a_shape_is_said_at_its_member(
    api: httpx.Client,
    project: str,
    change: Callable[[dict[str, Any]], Any],
    pointer: str,
    words: str,
) -> None:
    body = deepcopy(ANGLE)
    change(body["shape"])
    problem = ok(api.post(f"projects/{project}/structures", json=body), 422)
    faults = {fault["pointer"]: fault["detail"] for fault in problem["errors"]}
    assert words in faults[pointer]


def test_a_shape_leaves_no_room_for_a_strip(api: httpx.Client, project: str) -> None:
    body = {**ANGLE, "geometry": {"length_m": 0.5, "width_m": 0.04, "thickness_m": 0.01}}
    assert (
        "has its own geometry"
        in ok(api.post(f"projects/{project}/structures", json=body), 422)["detail"]
    )
    weightless = {name: value for name, value in ANGLE.items() if name != "density_kg_m3"}
    structure = ok(api.post(f"projects/{project}/structures", json=weightless), 201)["id"]
    campaign = ok(
        api.post(f"structures/{structure}/campaigns", json={"name": "c", "boundary": "free"}), 201
    )["id"]
    problem = ok(api.post(f"campaigns/{campaign}/update-jobs", json={}), 422)
    assert "wall flange: a model needs it" in problem["detail"]
    heavy = made(api, project)["id"]
    campaign = ok(
        api.post(f"structures/{heavy}/campaigns", json={"name": "c", "boundary": "free"}), 201
    )["id"]
    along = {"springs": [{"name": "bed", "stiffness": 1e4, "direction": 3, "edge": "lower"}]}
    problem = ok(api.post(f"campaigns/{campaign}/update-jobs", json=along), 422)["errors"][0]
    assert (problem["pointer"], problem["detail"]) == (
        "/springs/0/edge",
        "is lower; this body in space has start, end",
    )


def test_a_plan_says_which_test_or_coupons_would_find_a_wall_s_constant(
    api: httpx.Client, project: str
) -> None:
    structure = made(api, project)["id"]
    plain = {"boundary": "free", "highest_hz": 1000}
    coupons = {"constants": ["Ey"], "sets": ["web"], "pieces": 5}
    sent = {
        "tests": [plain],
        "coupons": [coupons],
        "points_to_hit": 6,
    }
    plan = ok(api.post(f"structures/{structure}/plans", json={**sent, "about": "web.E2"}), 200)
    items = {item["name"]: item for item in plan["items"]}
    assert set(items) == {"coupons 1: Ey of web", "1: angle, free"}
    # before any test, how far walls differ is only known by its prior
    scatters, probability = prior_of_scatter(0.15)
    variance = np.log1p(0.3**2) + probability @ np.log1p(scatters**2)
    assert plan["known_sd"]["web.E2"] == pytest.approx(8.5e9 * variance**0.5)
    cut, free = items["coupons 1: Ey of web"], items["1: angle, free"]
    assert cut["shrinks_most"] == "web.E2"
    # one more piece than five
    assert cut["expected_sd"]["web.E2"] == pytest.approx(0.05 * 8.5e9 * 1.5518, rel=0.05)
    # as far as walls of one material are alike
    assert cut["expected_sd"]["flange.E2"] < 0.85 * plan["known_sd"]["flange.E2"]
    assert cut["expected_sd"]["flange.G12"] == pytest.approx(plan["known_sd"]["flange.G12"])
    assert len(free["points_m"]) == 6
    faces = {round(max(-0.04, min(z, 0.04)), 3) for _, _, z in free["points_m"]}
    assert free["frequencies_hz"]
    assert len(faces) > 1
    for item in plan["items"]:  # a mean over how far walls may differ, not of the mean variance
        assert item["information_nats"] == pytest.approx(
            np.log(plan["known_sd"]["web.E2"] / item["expected_sd"]["web.E2"]), rel=0.1
        )
    low = {**plain, "highest_hz": 200}
    for wrong, pointer, words in (
        ({"about": "rib.E1", "tests": [low]}, "/about", "flange.E1"),
        (
            {"coupons": [{"constants": ["Ey"], "sets": ["rib"]}]},
            "/coupons/0/sets",
            "name rib; the sets of this body: flange",
        ),
        (
            {"tests": [{**low, "points_m": [[0.1, 0.2, 0.3]]}]},
            "/tests/0/points_m/0",
            "off the specimen",
        ),
        (
            {"tests": [{**low, "added_masses": [{"x_m": 9, "y_m": 0, "mass_kg": 1}]}]},
            "/tests/0/added_masses",
            "off the",
        ),
        (
            {"tests": [{**low, "highest_hz": 1}]},
            "/tests/0/highest_hz",
            "is 1 Hz, below the first mode",
        ),
        (
            {"tests": [{**low, "damping_ratio": 1e-300}]},
            "/tests/0/damping_ratio",
            "expected at least 1e-6",
        ),
    ):
        error = ok(api.post(f"structures/{structure}/plans", json=wrong), 422)["errors"][0]
        assert error["pointer"] == pointer
        assert words in error["detail"]


@pytest.mark.long
def test_the_open_i_profile_from_its_file(api: httpx.Client, project: str) -> None:
    """By its first modes: all of them take ten times as long."""
    content = shared_file("BLIND_OPEN", "blind-open", "structures/i-1.uff").read_bytes()
    wall = {"thickness_m": 0.006}
    structure = made(
        api,
        project,
        kind="i",
        length_m=1.5,
        width_m=0.06,
        height_m=0.12,
        walls={"flange": wall, "web": wall},
    )
    recipe = {**FEW_MODES, "identification": {"band_hz": [10, 260]}}
    _, result = updated(api, structure["id"], content, "free", recipe)
    flange = next(row for row in result["parameters"] if row["name"] == "flange.E1")
    assert flange["identifiable"]
    assert flange["interval_95"][0] < 24_381_645_391 < flange["interval_95"][1]


def test_a_wall_can_be_watched(api: httpx.Client, project: str) -> None:
    structure = ok(api.post(f"projects/{project}/structures", json=ANGLE), 201)["id"]
    body = {"name": "m", "parameters": [{"name": "web.E1"}]}
    monitor = ok(api.post(f"structures/{structure}/monitors", json=body), 201)
    assert [(each["name"], each["direction"]) for each in monitor["parameters"]] == [
        ("web.E1", "fall")
    ]
    usual = ok(api.post(f"structures/{structure}/monitors", json={"name": "usual"}), 201)[
        "parameters"
    ]
    watched = ["flange.E1", "flange.G12", "web.E1", "web.G12", "a0", "a1"]
    assert sorted(each["name"] for each in usual) == sorted(watched)
    body["parameters"] = [{"name": "webb.E1"}]
    problem = ok(api.post(f"structures/{structure}/monitors", json=body), 422)
    assert "is not updated by the recipe" in problem["detail"]
