"""What is made anew replaces what was made before of the same records, wherever it is listed or computed with."""

import io
from typing import Any
from zipfile import ZipFile

import httpx
import numpy as np
import pytest

from tests.integration.test_records import npz, post, processed
from tests.support.hammer import Simulated
from tests.support.hammer import campaign as simulated_campaign
from tests.support.rest import finished, ok


@pytest.fixture(scope="module")
def hits() -> list[Simulated]:
    return simulated_campaign(np.random.default_rng(12), "free", 3, 4, 0.3, 0.0)[2]


def ids(items: list[dict[str, Any]]) -> list[str]:
    return [one["id"] for one in items]


def identified(api: httpx.Client, campaign: str, **options: Any) -> dict[str, Any]:
    started = api.post(f"campaigns/{campaign}/identifications", json=options)
    done = finished(api, started.headers["Location"])
    assert done["status"] == "succeeded", done
    return done


def test_frfs_of_a_second_processing_take_the_place_of_the_first(
    api: httpx.Client, campaign: str, hits: list[Simulated]
) -> None:
    ok(post(api, campaign, npz(hits)), 201)
    first = ids(processed(api, campaign, {})["result"]["frfs"])
    good = next(s for s in hits if s.fault is None)
    overrule = {"point": good.hit.force.dof.point, "hit": good.hit.number, "use": False}
    second = processed(api, campaign, {"overrules": [overrule]})
    present = ids(second["result"]["frfs"])
    assert len(present) == len(first)
    assert ids(ok(api.get(f"campaigns/{campaign}/frfs"), 200)["items"]) == present
    both = ok(api.get(f"campaigns/{campaign}/frfs", params={"superseded": True}), 200)["items"]
    assert ids(both) == first + present
    assert [one["superseded_by"] for one in both] == len(first) * [second["id"]] + len(present) * [None]
    assert ok(api.get(f"frfs/{first[0]}"), 200)["superseded_by"] == second["id"]
    assert api.get(f"frfs/{first[0]}/data").status_code == 200

    # All that is computed, drawn, exported and found sees the same set.
    query = {"filter": f"campaign.id = '{campaign}'"}
    assert sorted(row["id"] for row in ok(api.get("search/frfs", params=query), 200)["items"]) == sorted(present)
    with np.load(io.BytesIO(api.get(f"campaigns/{campaign}/frfs/data", params={"format": "npz"}).content)) as file:
        assert len(file["response_point"]) == len(present)
    assert api.get("search/campaigns", params={"filter": f"frf.id = '{first[0]}'"}).json()["items"] == []
    assert len(api.get("search/campaigns", params={"filter": f"frf.id = '{present[0]}'"}).json()["items"]) == 1
    with ZipFile(io.BytesIO(api.get(f"campaigns/{campaign}/archive").content)) as archive:
        rows = archive.read(f"campaigns/{campaign}/frfs.csv").decode().splitlines()
    assert len(rows) == 1 + len(present)


def test_an_frf_none_of_whose_hits_is_good_any_more_leaves_too(
    api: httpx.Client, campaign: str, hits: list[Simulated]
) -> None:
    ok(post(api, campaign, npz(hits)), 201)
    first = processed(api, campaign, {})["result"]["frfs"]
    point = first[0]["reference_point"]
    bad = [{"point": point, "hit": s.hit.number, "use": False} for s in hits if s.hit.force.dof.point == point]
    second = processed(api, campaign, {"overrules": bad})["result"]["frfs"]
    assert len(second) == len(first) - 1
    assert ids(ok(api.get(f"campaigns/{campaign}/frfs"), 200)["items"]) == ids(second)


def test_an_frf_whose_blocks_are_gone_stays(api: httpx.Client, campaign: str, hits: list[Simulated]) -> None:
    stored = ok(post(api, campaign, npz(hits)), 201)["items"]
    first = processed(api, campaign, {})["result"]["frfs"]
    point = first[0]["reference_point"]
    for block in stored:
        if block["force_point"] == point:
            ok(api.delete(f"records/{block['id']}"), 204)
    second = processed(api, campaign, {})["result"]["frfs"]
    assert ids(ok(api.get(f"campaigns/{campaign}/frfs"), 200)["items"]) == [first[0]["id"], *ids(second)]


def test_a_mode_set_of_the_same_settings_takes_the_place_of_the_first(
    api: httpx.Client, campaign: str, hits: list[Simulated]
) -> None:
    ok(post(api, campaign, npz(hits)), 201)
    processed(api, campaign, {})
    first, other, second = (
        identified(api, campaign, **options) for options in ({}, {"highest_order": 20}, {"most_modes": 100})
    )
    present = [other["mode_set"], second["mode_set"]]
    path = f"campaigns/{campaign}/mode-sets"
    assert ids(ok(api.get(path), 200)["items"]) == present
    listed = ok(api.get(path, params={"superseded": True}), 200)["items"]
    assert ids(listed) == [first["mode_set"], *present]
    assert [one["superseded_by"] for one in listed] == [second["mode_set"], None, None]
    found = ok(api.get("search/modes", params={"filter": f"campaign.id = '{campaign}'"}), 200)["items"]
    assert {row["mode_set.id"] for row in found} <= set(present)
    # Who names it has it.
    assert ok(api.get(f"mode-sets/{first['mode_set']}"), 200)["superseded_by"] == second["mode_set"]
    job = ok(api.post(f"campaigns/{campaign}/update-jobs", json={"mode_set": first["mode_set"]}), 202)
    assert job["recipe"]["mode_set"] == first["mode_set"]
    edit = {"name": "by hand", "decisions": [{**_of(listed[0]), "keep": True, "reason": "seen"}]}
    edited = ok(api.post(f"mode-sets/{first['mode_set']}/edits", json=edit), 201)
    assert ids(ok(api.get(path), 200)["items"]) == [*present, edited["id"]]


def _of(mode_set: dict[str, Any]) -> dict[str, Any]:
    return {"frequency_hz": mode_set["modes"][0]["frequency_hz"]}
