"""From a hammer's time blocks to elastic constants and damping: one request, one job."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from tests.support.laboratory import MATERIAL
from tests.support.places import shared_file
from tests.support.rest import finished, ok, posted, result_of

WITHIN = {"Ex": 0.01, "Gxy": 0.02, "a0": 0.02, "a1": 0.03}


def campaign_of_hits(api: httpx.Client, folder: Path, truth: dict[str, Any]) -> str:
    """A campaign that holds nothing but the grid and the time blocks of a set."""
    config, known = truth["config"], truth["instruments"]
    project = posted(api, "projects", {"name": folder.name})
    body = {
        "name": folder.name,
        "density_kg_m3": config["rho"],
        "geometry": {"length_m": config["L"], "width_m": config["b"], "thickness_m": config["t"]},
        "material": {**MATERIAL, "nu_xy": config["nuxy"]},
    }
    structure = posted(api, f"projects/{project['id']}/structures", body)
    tour = {"name": "tour", "boundary": config["bc"]}
    campaign = str(posted(api, f"structures/{structure['id']}/campaigns", tour)["id"])
    items = [
        {"label": number, "x_m": x, "y_m": y, "z_m": 0.0} for number, (x, y) in enumerate(truth["points"], start=1)
    ]
    ok(api.put(f"campaigns/{campaign}/grid-points", json={"items": items}))
    window = {"window_rate_per_s": known["window_rate_per_s"]}
    mapping = {
        "sample_rate_hz": known["fs_hz"],
        "hit": {"variable": "hit"},
        "channels": [
            {
                "variable": "force",
                "quantity": "force",
                "point": {"variable": "point"},
                "sensitivity": known["force_V_per_N"],
                **window,
            },
            {
                "variable": "acceleration",
                "quantity": "acceleration",
                "point": known["sensor_point"],
                "sensitivity": known["acceleration_V_per_m_s2"],
                **window,
            },
        ],
    }
    sent = api.post(
        f"campaigns/{campaign}/records",
        content=(folder / "hits.npz").read_bytes(),
        params={"filename": "hits.npz", "mapping": json.dumps(mapping)},
        headers={"Content-Type": "application/octet-stream"},
    )
    ok(sent, 201)
    return campaign


def test_time_blocks_become_parameters_in_one_job(api: httpx.Client) -> None:
    """Of a free beam whose blocks were multiplied with an exponential window, which damps like the body."""
    folder = shared_file("BLIND_OPEN", "blind-open", "hits-free-window")
    truth = json.loads((folder / "truth.json").read_text())
    campaign = campaign_of_hits(api, folder, truth)
    job = f"update-jobs/{posted(api, f'campaigns/{campaign}/update-jobs', {})['id']}"
    assert finished(api, job)["status"] == "succeeded"
    result = result_of(api, job)
    found = {p["name"]: p for p in result["parameters"]}
    for parameter, share in WITHIN.items():
        true = truth["config"][parameter]
        low, high = found[parameter]["interval_95"]
        assert abs(found[parameter]["estimate"] / true - 1) < share, parameter
        assert low <= true <= high, parameter
    frfs = ok(api.get(f"campaigns/{campaign}/frfs"))["items"]
    assert {f["id"] for f in frfs} == {f["id"] for f in result["provenance"]["frfs"]}
    rates = {f["window_rate_per_s"] for f in frfs}
    assert rates == {truth["instruments"]["window_rate_per_s"]}
    judged = ok(api.get(f"processings/{result['provenance']['processing']}"))["result"]["hits"]
    assert len(judged) == len(truth["records"])
    faults = np.array([record["fault"] is not None for record in truth["records"]])
    accepted = np.array([hit["accepted"] for hit in judged])
    assert np.mean(accepted[~faults]) > 0.95
