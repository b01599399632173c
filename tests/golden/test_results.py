"""Results are what they were: updates, joint updates, identifications, processed hits, plans,
coupons, monitors, failures.
"""

import json
from collections.abc import Callable, Iterator
from typing import Any
from uuid import uuid4

import httpx
import numpy as np
import pytest

import modalbase
from examples.joint_update import paper_bar_together
from examples.plies import plate, simulated
from service.app.supervisor import LocalService
from service.pages.example.paper import MODES, STRUCTURE, uff_file
from tests.golden import inputs, truths
from tests.golden.inputs import (
    hits_campaign,
    imported,
    job,
    modes_of,
    new_campaign,
    open_campaign,
    updated,
)
from tests.integration import test_coupons as curves
from tests.integration.test_updates import ANGLES, EXACT, PLY, stored
from tests.support.golden import check
from tests.support.lengths import long
from tests.support.rest import client_of, finished, mode_rows, ok, posted, session_client
from tests.support.strips import STRIP, TRUTH, measured

TWO = [{"name": "Ex"}, {"name": "Gxy"}]
RAYLEIGH = ["rayleigh"]
EVERY_LAW = [
    "mechanism", "rayleigh", "caughey3", "caughey4", "generalised", "mechanism_viscous", "mechanism_constants", "loss_factor",
    "modal",
]  # fmt: skip
TIP = {"name": "tip", "stiffness": 2000.0, "direction": 3, "edge": "end"}
OF_PAPER: dict[str, dict[str, Any]] = {
    "default": {},
    "joint-method": {"method": "joint", "damping_models": RAYLEIGH},
    "sampled": {
        "posterior": "mcmc",
        "seed": 3,
        "parameters": TWO,
        "damping_models": RAYLEIGH,
        "band_hz": [10, 300],
    },
    "shapes": {"use_shapes": True, "parameters": TWO, "damping_models": RAYLEIGH},
    "spring": {
        "springs": [TIP],
        "parameters": [*TWO, {"name": "tip", "prior_sd": 2000.0}],
        "damping_models": ["mechanism_support", "rayleigh"],
    },
    "laws": {"damping_models": EVERY_LAW, "parameters": TWO},
    "linear": {"weighting": "linear", "damping_models": RAYLEIGH, "band_hz": [10, 500]},
    "zones": {
        "zones_m": [0.2],
        "parameters": TWO,
        "hold_out": {"points": [2, 7], "band_hz": [200, 300]},
        "weighting": "log",
        "damping_models": RAYLEIGH,
    },
    "no-damping": {"identification": {"band_hz": [2, 60]}, "damping_models": RAYLEIGH},
    "no-mode": {"identification": {"band_hz": [200, 300]}},
}
"""Recipes, each for the FRFs of the paper's beam."""
IN_OTHERS = {"default", "joint-method", "shapes", "spring", "laws", "linear", "no-damping"}
"""The core's own tests are of these, and the paper's own test has the default."""


@pytest.fixture(scope="module")
def api(service: LocalService) -> Iterator[httpx.Client]:
    """A client of one user for all of them."""
    with client_of(service, f"golden {uuid4()}") as client:
        yield client


@pytest.fixture(scope="module")
def paper(api: httpx.Client, tmp_path_factory: pytest.TempPathFactory) -> str:
    """A campaign with the FRFs of the paper's beam."""
    campaign = new_campaign(api, STRUCTURE)
    (file := tmp_path_factory.mktemp("paper") / "paper_beam.uff").write_bytes(uff_file())
    assert imported(api, campaign, file)["status"] == "succeeded"
    return campaign


@pytest.mark.parametrize("name", [long(name) if name in IN_OTHERS else name for name in OF_PAPER])
def test_updates_of_the_papers_beam(api: httpx.Client, paper: str, name: str) -> None:
    """The whole result of each kind of recipe, by REST as a user reads it."""
    found = updated(api, paper, OF_PAPER[name])
    check(f"update-paper-{name}", found)
    if name == "spring":
        truths.has_no_spring(found["result"])


@pytest.mark.long
def test_a_sampled_posterior_agrees_with_the_gaussian_one(api: httpx.Client, paper: str) -> None:
    """In short it is as it was, above."""
    sampled, gaussian = (
        updated(api, paper, {**OF_PAPER["sampled"], "posterior": posterior})["result"]
        for posterior in ("mcmc", "laplace")
    )
    truths.agree(sampled, gaussian)


@pytest.mark.long
@pytest.mark.parametrize(
    "name", ["cantilever-1pct", "cantilever-5pct-sensor-mass", "free-1pct", "paper-like"]
)
def test_updates_of_open_sets(api: httpx.Client, name: str) -> None:
    """In short the paper's own test is updated, in `test_shown.py`."""
    found = updated(api, open_campaign(api, name), {})
    check(f"update-{name}", found)
    if name == "paper-like":
        truths.is_no_rayleigh_body(api, found["result"])


@pytest.mark.parametrize("name", ["hits-cantilever", long("hits-free-window")])
def test_updates_of_open_sets_of_hits(api: httpx.Client, name: str) -> None:
    """From raw hits to a result in one job; no other document has both."""
    recipe = {} if name == "hits-free-window" else {"parameters": TWO, "damping_models": RAYLEIGH}
    found = updated(api, campaign := hits_campaign(api, name), recipe)
    processing = ok(api.get(f"processings/{found['result']['provenance']['processing']}"))
    check(f"update-{name}", {**found, "processing": processing})
    if name == "hits-free-window":
        truths.comes_from_hits(api, campaign, found["result"], processing["result"]["hits"])


def test_hits_of_one_point(api: httpx.Client) -> None:
    campaign = hits_campaign(api, "hits-plate-one-point")
    _, refused = job(api, f"campaigns/{campaign}/processings", {})  # each is an overload
    wanted = [{"point": 6, "hit": hit, "use": True} for hit in (1, 2, 4)]
    _, overruled = job(api, f"campaigns/{campaign}/processings", {"overrules": wanted})
    check("processing-hits-plate-one-point", {"refused": refused, "overruled": overruled})


@pytest.mark.parametrize("name", ["bridge", long("plate"), long("aeroplane")])
def test_identifications_of_open_sets_with_faults(api: httpx.Client, name: str) -> None:
    campaign = new_campaign(api)
    read = imported(api, campaign, inputs.open_file(f"real-like-{name}.uff"))
    body = {"name": "first", **({"band_hz": [5, 40]} if name == "aeroplane" else {})}
    _, state = job(api, f"campaigns/{campaign}/identifications", body)
    check(f"identification-{name}", {"import": read, "identification": state})


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "band"),
    [
        ("angle", (20, 330)),
        ("box", (50, 500)),
        ("channel", (20, 320)),
        ("i", (10, 260)),
        ("panel", (5, 140)),
    ],
)
def test_identifications_of_open_structures(
    api: httpx.Client, name: str, band: tuple[float, float]
) -> None:
    """Their first modes: all of them take ten times as long. In short those of sets with faults."""
    campaign = new_campaign(api, boundary="free")
    read = imported(api, campaign, inputs.open_file(f"structures/{name}-1.uff"))
    _, state = job(api, f"campaigns/{campaign}/identifications", {"name": "first", "band_hz": band})
    check(f"identification-{name}", {"import": read, "identification": state})


@pytest.mark.parametrize("name", [long("moved"), "standing"])
def test_updates_with_a_sensor_of_some_mass(api: httpx.Client, name: str) -> None:
    """A sensor's mass at no stated point: its place follows from the FRFs."""
    campaign = truths.campaign_with(api, name, getattr(truths, name)())
    found = updated(api, campaign, {"damping_models": RAYLEIGH, "parameters": TWO})
    check(f"update-sensor-{name}", found)
    truths.has_its_sensors_mass(found["result"], roves=name == "moved")


@pytest.mark.long
def test_an_update_of_an_unsymmetric_stack(api: httpx.Client) -> None:
    body = plate(*ANGLES)
    modes, points = simulated(body, np.random.default_rng(4))
    described = {
        "name": "plate",
        "geometry": {"length_m": body.length, "width_m": body.width, "thickness_m": body.thickness},
        "density_kg_m3": body.density,
        "laminate": {"plies": [{**PLY, "angle_deg": angle} for angle in ANGLES]},
        "inputs": EXACT,
    }
    campaign = new_campaign(api, described, boundary="free")
    inputs.put_points(api, campaign, points)
    check(
        "update-plies",
        updated(api, campaign, {"mode_set": modes_of(api, campaign, mode_rows(modes, 1e-4))}),
    )


@pytest.mark.long
def test_strips_at_three_angles_are_one_material(api: httpx.Client, project: str) -> None:
    """A joint update against a truth of a finer model. In short the paper's bar is one material."""
    random = np.random.default_rng(3)
    cuts = [("strip 0", 0.0), ("strip 90", 90.0), ("strip 45", 45.0)]
    jobs = [stored(api, project, measured(random, name, STRIP, angle)) for name, angle in cuts]
    body = {"joint": True, "jobs": jobs}
    key = {"Idempotency-Key": str(uuid4())}
    begun = api.post("update-jobs", json=body, headers=key)
    answer = ok(begun, 202)
    assert answer["items"] == []
    again = ok(api.post("update-jobs", json=body, headers=key), 202)
    assert again["joint"]["id"] == answer["joint"]["id"]
    other = api.post("update-jobs", json={**body, "scatter": 0}, headers=key)
    assert ok(other, 422)["errors"][0]["pointer"] == "Idempotency-Key"
    location = begun.headers["Location"]
    state = finished(api, location)
    assert state["status"] == "succeeded"
    result = ok(api.get(api.base_url.join(f"{location}/result")), 200)
    found = {row["name"]: row for row in result["parameters"]}
    for name in ("Ey", "Gxy", "Gxz"):
        assert found[name]["standard_deviation"] < 0.3 * found[name]["prior_sd"], name
    held = [
        row["interval_95"][0] <= TRUTH[name] <= row["interval_95"][1] for name, row in found.items()
    ]
    assert sum(held) >= 5
    assert result["odd_one_out"] is None
    assert [part["campaign_id"] for part in result["campaigns"]] == [
        job["campaign_id"] for job in jobs
    ]
    assert [part["angle_deg"] for part in result["campaigns"]] == [0, 90, 45]
    assert all(part["predictive_p"] > 0.0025 for part in result["campaigns"])
    assert {own["name"] for own in result["campaigns"][2]["own"]} >= {
        "length",
        "thickness",
        "fibre_angle",
    }
    check("joint-strips", {"job": state, "result": result})


def test_a_joint_update_of_the_papers_bar(
    api: httpx.Client, new_client: Callable[[], httpx.Client], service: LocalService
) -> None:
    """t = 10.12 mm: alone the cantilever gives 31.0, the bar hung freely 32.3; with a root that
    yields they agree. Its figures and pages are there.
    """
    key = api.headers["Authorization"].removeprefix("Bearer ")
    with modalbase.connect(str(api.base_url).removesuffix("/api/v1/"), key) as lab:
        result = paper_bar_together(lab)
    assert result["parameters"][0]["estimate"] == pytest.approx(32.46e9, rel=0.005)
    assert all(abs(part["alone"]["Ex"]["z"]) <= 2 for part in result["campaigns"])
    (root,) = (own for own in result["campaigns"][0]["own"] if own["name"] == "clamp_compliance")
    assert root["interval_95"][0] < 0.0117 < root["interval_95"][1]
    assert root["estimate"] == pytest.approx(0.0117, rel=0.1)
    (project,) = (
        row["id"] for row in ok(api.get("projects"))["items"] if row["name"] == "one bar, two tests"
    )
    # It is listed for who may see the project, and for nobody else.
    (joint,) = ok(api.get(f"projects/{project}/joint-updates"))["items"]
    location = f"joint-updates/{joint['id']}"
    ok(new_client().get(location), 404)
    # Every figure of it is drawn but that over temperature, and its page shows them with the
    # numbers of a contradiction.
    listed = ok(api.get(f"{location}/figures"))["items"]
    assert [item["name"] for item in listed if not item["available"]] == ["temperature"]
    items = [item for item in listed if item["available"]]
    figures = {item["name"]: ok(api.get(api.base_url.join(item["href"])), 200) for item in items}
    check("joint-paper", {**result, "figures": figures})
    drawing = api.get(api.base_url.join(items[0]["href"]), params={"format": "svg"}).content
    assert drawing.startswith(b"<?xml")
    assert b"style" not in drawing  # which the policy refuses: it would be black
    single = [
        trace for trace in figures["campaigns"]["data"] if trace["name"] != "all together, 95 %"
    ]
    drawn = sorted(text for trace in single for text in trace["text"])
    assert drawn == sorted(
        f"z {a['z']:+.2f}" for part in result["campaigns"] for a in part["alone"].values()
    )
    circles = [
        trace for trace in figures["frequencies"]["data"] if trace["marker"]["symbol"] == "circle"
    ]
    for trace, part in zip(circles, result["campaigns"], strict=True):
        assert trace["y"] == pytest.approx(
            [mode["error_percent"] for mode in part["modes"]], abs=1e-6
        )
    with session_client(api, base=service.url) as browser:
        page = browser.get(f"/ui/joint-updates/{joint['id']}").text
        named = browser.get(f"/ui/projects/{project}").text
        campaign = browser.get(f"/ui/campaigns/{result['campaigns'][0]['campaign_id']}").text
    for words in (
        result["verdict"]["sentence"],
        result["campaigns"][1]["name"],
        f"ui/campaigns/{result['campaigns'][1]['campaign_id']}",
    ):
        assert words in page, words
    assert page.count("data-figure=") == len(items)
    assert f"ui/joint-updates/{joint['id']}" in named
    assert f"ui/joint-updates/{joint['id']}" in campaign


@pytest.mark.long
def test_a_joint_update_from_frfs(api: httpx.Client, project: str) -> None:
    campaigns = [
        open_campaign(api, name, project)
        for name in ("cantilever-1pct", "cantilever-5pct-sensor-mass")
    ]
    jobs = [{"campaign_id": each, "specimen": "one"} for each in campaigns]
    address, state = job(api, "update-jobs", {"joint": True, "jobs": jobs})
    check("joint-frfs", {"job": state, "result": ok(api.get(f"{address}/result"))})


def test_plans(api: httpx.Client, structure: str, new_campaign: Callable[..., str]) -> None:
    """What the next test would add, before any and after one."""
    path = f"structures/{structure}/plans"
    campaign = new_campaign(boundary="free")
    typed = modes_of(
        api, campaign, [{"frequency_hz": hz} for hz in (165.87, 453.39, 800.44, 886.53)]
    )
    heavy = {"boundary": "cantilever", "highest_hz": 500, "sensor": 2, "sensor_mass_kg": 0.002}
    body = {"tests": [{"boundary": "free"}, heavy], "points_to_hit": 3}
    made = [{"campaign_id": campaign, "mode_set": typed}]
    check(
        "plans",
        {
            "default": ok(api.post(path, json={})),
            "after": ok(api.post(path, json={**body, "made": made})),
        },
    )


def test_coupons(api: httpx.Client, structure: str) -> None:
    batches = f"structures/{structure}/coupon-batches"
    found = {}
    shear = [
        (0.6 * g, 100 * t, -0.4 * g)
        for g, t in zip(curves.SHEAR_GAMMA, curves.SHEAR_TAU, strict=True)
    ]
    for name, constants, rows in (
        ("D3039", ["Ex", "nu_xy"], curves.CURVE),
        ("D3518", ["Gxy"], shear),
    ):
        batch = posted(api, batches, {"name": name, "constants": constants})["id"]
        coupon = json.dumps({**curves.COUPON, "standard": name})
        files = {"file": ("A1.csv", curves.machine_file(rows))}
        sent = ok(
            api.post(f"coupon-batches/{batch}/coupons", files=files, data={"coupon": coupon}), 201
        )
        for number, modulus in enumerate([38.2, 39.1, 39.9, 61.0]):
            value = {"standard": name, "E_Pa" if name == "D3039" else "G_Pa": 1e9 * modulus}
            posted(api, f"coupon-batches/{batch}/coupons", {"specimen": f"B{number}", **value})
        path = f"coupons/{sent['items'][0]['id']}"
        found[name] = {
            "coupon": sent,
            "curve": ok(api.get(f"{path}/curve")),
            "figure": ok(api.get(f"{path}/figures/curve")),
            "summary": ok(api.get(f"coupon-batches/{batch}/summary")),
        }
    published = {"Ex": {"mean": 33e9}, "Ey": {"mean": 31.8e9, "standard_deviation": 1e9}}
    batch = posted(
        api, batches, {"name": "Table 4", "constants": ["Ex", "Ey"], "published": published}
    )["id"]
    check("coupons", {**found, "published": ok(api.get(f"coupon-batches/{batch}/summary"))})


TIP_MASS = {"x_m": 0.5, "y_m": 0.0, "mass_kg": 0.05, "rotary_inertia_kg_m2": 4e-6}
FROM_MODES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "no-frfs": ({}, {}),
    "no-mode-in-band": ({}, {"modes": MODES, "band_hz": [60, 90]}),
    "added-mass": (
        {"added_masses": [TIP_MASS]},
        {"modes": MODES[:2], "damping_models": ["modal"], "parameters": TWO},
    ),
}
"""Instruments and recipes for the paper's beam without FRFs, some of which fail."""


@pytest.mark.parametrize("name", ["no-frfs", long("no-mode-in-band"), long("added-mass")])
def test_updates_without_frfs(api: httpx.Client, name: str) -> None:
    """Modes alone: what fails says so, and what can be found is; masses are in the updates of
    `tests/integration` too.
    """
    instruments, recipe = FROM_MODES[name]
    campaign, recipe = new_campaign(api, STRUCTURE, instruments=instruments), dict(recipe)
    if modes := recipe.pop("modes", None):
        recipe["mode_set"] = modes_of(api, campaign, modes)
    check(f"update-{name}", updated(api, campaign, recipe))
