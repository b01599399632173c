"""Joint updates over HTTP: strips of one panel at three angles in one job; the source paper's bar in two tests."""

from collections.abc import Callable
from typing import Any
from uuid import uuid4

import httpx
import numpy as np
import pytest

from fecore.updating.campaigns import Campaign
from service.app.supervisor import LocalService
from tests.support.rest import finished, mode_rows, ok, session_client
from tests.support.strips import NOMINAL, STRIP, TRUTH, measured

PLY = {
    "E1_Pa": NOMINAL.Ex,
    "E2_Pa": NOMINAL.Ey,
    "G12_Pa": NOMINAL.Gxy,
    "G13_Pa": NOMINAL.Gxz,
    "G23_Pa": NOMINAL.Gyz,
    "nu_12": NOMINAL.nu_xy,
}


def stored(api: httpx.Client, project: str, test: Campaign) -> dict[str, Any]:
    """A structure, a campaign with its grid points and modes; the job of a joint update for it."""
    body, modes = test.body, test.modes
    angle = float(np.degrees(body.fibre_angle))
    structure = ok(
        api.post(
            f"projects/{project}/structures",
            json={
                "name": test.specimen,
                "geometry": {"length_m": body.length, "width_m": body.width, "thickness_m": body.thickness},
                "density_kg_m3": NOMINAL.density,
                "laminate": {"plies": [{**PLY, "thickness_m": body.thickness, "angle_deg": angle}]},
            },
        ),
        201,
    )["id"]
    campaign = ok(api.post(f"structures/{structure}/campaigns", json={"name": "tour", "boundary": body.boundary}), 201)[
        "id"
    ]
    points = [{"label": label, "x_m": x, "y_m": y, "z_m": z} for label, (x, y, z) in test.points.items()]
    ok(api.put(f"campaigns/{campaign}/grid-points", json={"items": points}))
    rows = mode_rows(modes, 3e-4)
    mode_set = ok(api.post(f"campaigns/{campaign}/mode-sets", json={"name": "measured", "modes": rows}), 201)["id"]
    return {"campaign_id": campaign, "recipe": {"mode_set": mode_set}}


@pytest.fixture
def jobs(api: httpx.Client, project: str) -> list[dict[str, Any]]:
    random = np.random.default_rng(3)
    cuts = [("strip 0", 0.0), ("strip 90", 90.0), ("strip 45", 45.0)]
    return [stored(api, project, measured(random, name, STRIP, angle)) for name, angle in cuts]


def test_an_update_from_nine_modes_has_its_report_on_paper(api: httpx.Client, jobs: list[dict[str, Any]]) -> None:
    """All nine pairs of shapes in one figure are higher than a page."""
    begun = api.post(f"campaigns/{jobs[0]['campaign_id']}/update-jobs", json=jobs[0]["recipe"])
    location = api.base_url.join(begun.headers["Location"])
    assert finished(api, begun.headers["Location"])["status"] == "succeeded"
    assert len(ok(api.get(f"{location}/result"))["modes"]) == 9
    page = api.get(f"{location}/report").text
    assert "Mode shapes, measured and updated: modes 1 to 5" in page
    assert "Mode shapes, measured and updated: modes 6 to 9" in page
    printed = api.get(f"{location}/report", params={"format": "pdf"})
    assert (printed.status_code, printed.content[:4]) == (200, b"%PDF"), printed.text
    assert printed.content.count(b"/Subtype /Image") == page.count("<img")


def test_strips_at_three_angles_are_one_material(
    api: httpx.Client,
    jobs: list[dict[str, Any]],
    project: str,
    new_client: Callable[[], httpx.Client],
    service: LocalService,
) -> None:
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
    assert finished(api, location)["status"] == "succeeded"
    result = ok(api.get(api.base_url.join(f"{location}/result")), 200)
    found = {row["name"]: row for row in result["parameters"]}
    for name in ("Ey", "Gxy", "Gxz"):
        assert found[name]["standard_deviation"] < 0.3 * found[name]["prior_sd"], name
    held = [row["interval_95"][0] <= TRUTH[name] <= row["interval_95"][1] for name, row in found.items()]
    assert sum(held) >= 5
    assert result["odd_one_out"] is None
    assert [part["campaign_id"] for part in result["campaigns"]] == [job["campaign_id"] for job in jobs]
    assert [part["angle_deg"] for part in result["campaigns"]] == [0, 90, 45]
    assert all(part["predictive_p"] > 0.0025 for part in result["campaigns"])
    assert {own["name"] for own in result["campaigns"][2]["own"]} >= {"length", "thickness", "fibre_angle"}
    # Every figure of it is drawn, and its page shows them with the numbers of a contradiction.
    items = ok(api.get(api.base_url.join(f"{location}/figures")), 200)["items"]
    assert [item["name"] for item in items if not item["available"]] == []
    figures = {item["name"]: ok(api.get(api.base_url.join(item["href"])), 200) for item in items}
    for item in items:
        assert api.get(api.base_url.join(item["href"]), params={"format": "svg"}).content.startswith(b"<?xml")
    single = [trace for trace in figures["campaigns"]["data"] if trace["name"] != "all together, 95 %"]
    drawn = sorted(text for trace in single for text in trace["text"])
    assert drawn == sorted(f"z {a['z']:+.2f}" for part in result["campaigns"] for a in part["alone"].values())
    updated = [trace for trace in figures["frequencies"]["data"] if trace["marker"]["symbol"] == "circle"]
    for trace, part in zip(updated, result["campaigns"], strict=True):
        assert trace["y"] == pytest.approx([mode["error_percent"] for mode in part["modes"]], abs=1e-6)
    with session_client(api, base=service.url) as browser:
        page = browser.get(f"/ui/joint-updates/{answer['joint']['id']}").text
        named = browser.get(f"/ui/projects/{project}").text
        campaign = browser.get(f"/ui/campaigns/{jobs[0]['campaign_id']}").text
    for words in (result["verdict"]["sentence"], "strip 45", f"ui/campaigns/{jobs[2]['campaign_id']}"):
        assert words in page, words
    assert page.count("data-figure=") == len(items)
    assert f"ui/joint-updates/{answer['joint']['id']}" in named
    assert f"ui/joint-updates/{answer['joint']['id']}" in campaign
    # It is listed for who may see the project, and for nobody else.
    listed = ok(api.get(f"projects/{project}/joint-updates"), 200)["items"]
    assert [row["id"] for row in listed] == [answer["joint"]["id"]]
    ok(new_client().get(api.base_url.join(location)), 404)


def test_a_joint_update_without_frfs_says_whose_are_missing(
    api: httpx.Client, campaign: str, new_campaign: Callable[..., str], service: LocalService
) -> None:
    one, two = {"campaign_id": campaign}, {"campaign_id": new_campaign(name="second")}
    begun = api.post("update-jobs", json={"joint": True, "jobs": [one, two]})
    ok(begun, 202)
    ended = finished(api, begun.headers["Location"])
    assert ended["status"] == "failed"
    assert "has no FRFs" in str(ended["error"])
    for path in ("/result", "/figures", "/figures/campaigns"):
        ok(api.get(api.base_url.join(begun.headers["Location"] + path)), 409)
    with session_client(api, base=service.url) as browser:
        page = browser.get(f"/ui/joint-updates/{ended['id']}")
        part = browser.get(f"/ui/joint-updates/{ended['id']}?part=true")
    assert part.headers["HX-Refresh"] == "true"
    assert "<html" not in part.text
    assert page.status_code == 200
    assert "has no FRFs" in page.text
