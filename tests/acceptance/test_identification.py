"""Identification of measured structures over HTTP: any body, large sets, a job that ends when it is
asked to.
"""

import json
from html import unescape
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

import modalbase
from modalbase.objects.jobs import ModeSet
from tests.golden.inputs import imported, new_campaign
from tests.support.command import modalbase_here
from tests.support.places import shared_file
from tests.support.rest import finished, ok, posted, session_client
from tests.support.waiting import until


def campaign_of(api: httpx.Client, file: Path) -> str:
    """A campaign of a structure of which nothing is known but its name, with the FRFs of a file."""
    campaign = new_campaign(api, {"name": file.stem}, boundary="free")
    state = imported(api, campaign, file)
    assert state["status"] == "succeeded", state
    return campaign


def started(api: httpx.Client, campaign: str, body: dict[str, Any]) -> str:
    """The path of a new identification."""
    return f"identifications/{posted(api, f'campaigns/{campaign}/identifications', body)['id']}"


@pytest.mark.long
def test_an_aeroplane_is_imported_and_identified_without_an_invented_geometry(
    api: httpx.Client,
) -> None:
    """In a band with six of its modes; the corpus has all of them. The dam below is the short form."""
    file = shared_file("BLIND_OPEN", "blind-open", "real-like-aeroplane.uff")
    campaign = campaign_of(api, file)
    job = finished(api, started(api, campaign, {"name": "all", "band_hz": [10, 55]}))
    assert job["status"] == "succeeded", job
    true_hz = [
        mode["f_hz"] for mode in json.loads(file.with_suffix(".truth.json").read_text())["modes"]
    ]
    found_hz = [mode["frequency_hz"] for mode in job["result"]["modes"]]
    assert found_hz == pytest.approx([hz for hz in true_hz if 10 < hz < 55], rel=0.002)
    assert all(mode["reason"] for mode in job["result"]["doubtful"])
    kept = ok(api.get(f"mode-sets/{job['mode_set']}"))
    assert len(kept["modes"]) == len(job["result"]["modes"])
    assert all(len(mode["shape"]) == 74 for mode in kept["modes"])
    figure = ok(api.get(f"identifications/{job['id']}/figures/stabilisation"))
    *traces, fitted = [trace for trace in figure["data"] if "marker" in trace]
    orders = [order for trace in traces for order in trace["y"]]
    assert fitted["name"] == "fitted pole"
    assert len(fitted["x"]) >= len(job["result"]["modes"])
    assert all(
        np.isclose(fitted["x"], mode["frequency_hz"], rtol=1e-5).any()
        for mode in job["result"]["modes"]
    )
    assert sorted(orders) == sorted(job["result"]["stabilisation"]["order"])
    marked = [line["x0"] for line in figure["layout"]["shapes"] if line["line"]["dash"] == "solid"]
    assert marked == pytest.approx([mode["frequency_hz"] for mode in job["result"]["modes"]])
    assert api.get(
        f"identifications/{job['id']}/figures/stabilisation?format=png"
    ).content.startswith(b"\x89PNG")
    refused = api.post(f"campaigns/{campaign}/update-jobs", json={})
    assert refused.status_code == 422
    assert "geometry" in refused.text


def test_a_job_that_is_cancelled_half_way_ends(api: httpx.Client) -> None:
    campaign = campaign_of(api, shared_file("MEASURED", "measured", "dam0.unv"))
    job = started(api, campaign, {})
    shares: set[float] = set()

    def half_way() -> bool:
        state = ok(api.get(job))
        assert state["status"] in ("queued", "running"), state
        shares.add(state["progress"])
        return bool(state["progress"] > 0.1)

    until(half_way, "a search that is under way", lambda: ok(api.get(job)))
    assert (
        "has no result: it is running" in ok(api.get(f"{job}/figures/stabilisation"), 409)["detail"]
    )
    ok(api.post(f"{job}/cancel"), 202)
    ended = finished(api, job)
    assert ended["status"] == "cancelled"
    assert ended["mode_set"] is None


def test_a_band_and_doubtful_modes_are_options(api: httpx.Client) -> None:
    campaign = campaign_of(api, shared_file("MEASURED", "measured", "dam0.unv"))
    job = finished(
        api,
        started(
            api, campaign, {"band_hz": [2.2, 7.6], "threshold": 0.99, "include_doubtful": True}
        ),
    )
    assert job["status"] == "succeeded", job
    whole = ok(api.get(f"mode-sets/{job['mode_set']}"))
    assert_doubt_is_seen_with_the_modes(api, whole, job["result"])
    kept = whole["modes"]
    assert len(kept) == len(job["result"]["modes"]) + len(job["result"]["doubtful"])
    for true in (2.482, 2.958, 3.497, 4.081, 4.166, 4.632):
        assert sum(abs(mode["frequency_hz"] / true - 1) < 0.003 for mode in kept) == 1
    figure = ok(api.get(f"identifications/{job['id']}/figures/stabilisation"))
    *traces, fitted = [trace for trace in figure["data"] if "marker" in trace]
    assert fitted["name"] == "fitted pole"
    orders = [order for trace in traces for order in trace["y"]]
    assert sorted(orders) == sorted(job["result"]["stabilisation"]["order"])
    refused = ok(api.post(f"campaigns/{campaign}/update-jobs", json={}), 422)
    assert "geometry" in str(refused)
    wrong = api.post(f"campaigns/{campaign}/identifications", json={"band_hz": [5.0, 2.0]})
    assert wrong.status_code == 422
    assert pytest.approx(2.2) == job["options"]["band_hz"][0]


def assert_doubt_is_seen_with_the_modes(
    api: httpx.Client, kept: dict[str, Any], found: dict[str, Any]
) -> None:
    """Whoever sees the modes, by script, command or page, sees what is doubted of them and every
    warning.
    """
    assert found["doubtful"]
    assert found["warnings"]
    poles = sorted((*found["modes"], *found["doubtful"]), key=lambda pole: pole["frequency_hz"])
    evidence = [{part: pole[part] for part in ("probability", "features")} for pole in poles]
    assert {part: (found | {"evidence": evidence})[part] for part in kept["details"]} == kept[
        "details"
    ]
    assert [
        {part: mode[part] for part in ("probability", "features")} for mode in kept["modes"]
    ] == evidence
    url, key = str(api.base_url).removesuffix("/api/v1/"), api.headers["authorization"].split()[1]
    with modalbase.connect(url, key) as lab:
        printed = str(ModeSet(lab, {"id": kept["id"]}).refresh())
    command = modalbase_here(
        "modes",
        kept["campaign_id"],
        "--mode-set",
        kept["id"],
        MODALBASE_URL=url,
        MODALBASE_API_KEY=key,
    )
    with session_client(api, base=url) as browser:
        page = browser.get(f"/ui/campaigns/{kept['campaign_id']}").text
    for text in (printed, command.stdout + command.stderr, unescape(page)):
        for said in (*(mode["reason"] for mode in found["doubtful"]), *found["warnings"]):
            assert said in text
