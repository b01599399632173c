"""The main job as a laboratory does it: over HTTP against a running service, on files of another finite element code."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any
from uuid import uuid4

import httpx
import pytest

from service.supervisor import LocalService

SHARED = Path(__file__).parents[3] / "shared"
BLIND = Path(os.environ.get("BLIND_OPEN", SHARED / "blind-open"))
LAB_SESSION = SHARED / "tools" / "lab-session"

NOMINAL = {"Ex_Pa": 33.05e9, "Ey_Pa": 31.80e9, "Gxy_Pa": 5.73e9, "Gxz_Pa": 4.5e9, "Gyz_Pa": 4.5e9, "nu_xy": 0.15}
TOLERANCE = {"Ex": 0.005, "Gxy": 0.01, "a0": 0.01, "a1": 0.01}


def blind(name: str) -> tuple[Path, dict[str, Any]]:
    file = BLIND / f"{name}.uff"
    if not file.exists():
        pytest.skip(f"{file} is not there; set BLIND_OPEN to the folder of the independent test data")
    return file, json.loads(file.with_suffix(".truth.json").read_text())


def finished(api: httpx.Client, location: str) -> dict[str, Any]:
    address = api.base_url.copy_with(path=location)
    for _ in range(1200):
        job = api.get(address).raise_for_status().json()
        if job["status"] not in ("queued", "running"):
            return job
        time.sleep(0.05)
    raise AssertionError(f"{location} is still {job['status']} after a minute")


def result_of(api: httpx.Client, location: str) -> dict[str, Any]:
    return api.get(api.base_url.copy_with(path=location + "/result")).raise_for_status().json()


def posted(api: httpx.Client, path: str, body: Any) -> Any:
    return api.post(path, json=body).raise_for_status().json()


def campaign_with(api: httpx.Client, file: bytes, geometry: dict[str, float], boundary: str) -> str:
    project = posted(api, "projects", {"name": f"acceptance {uuid4()}"})
    structure = posted(
        api,
        f"projects/{project['id']}/structures",
        {"name": "beam", "density_kg_m3": 2012.0, "geometry": geometry, "material": NOMINAL},
    )
    campaign = posted(api, f"structures/{structure['id']}/campaigns", {"name": "tour", "boundary": boundary})
    answer = api.post(f"campaigns/{campaign['id']}/imports?filename=beam.uff", content=file).raise_for_status()
    assert finished(api, answer.headers["Location"])["status"] == "succeeded"
    return campaign["id"]


def typed_modes(truth: dict[str, Any]) -> list[dict[str, float]]:
    top = 0.95 * truth["config"]["fmax"]
    seen = [mode for mode in truth["modes"] if mode["out_of_plane"] and 1 < mode["f_hz"] < top]
    return [{"frequency_hz": mode["f_hz"], "damping_ratio": mode["zeta"]} for mode in seen]


@pytest.mark.parametrize("name", ["cantilever-1pct", "free-1pct"])
def test_independent_data_give_their_constants_back(api: httpx.Client, name: str) -> None:
    file, truth = blind(name)
    config = truth["config"]
    geometry = {"length_m": config["L"], "width_m": config["b"], "thickness_m": config["t"]}
    campaign = campaign_with(api, file.read_bytes(), geometry, config["bc"])
    modes = posted(api, f"campaigns/{campaign}/mode-sets", {"name": "typed in", "modes": typed_modes(truth)})
    answer = api.post(f"campaigns/{campaign}/update-jobs", json={"mode_set": modes["id"]}).raise_for_status()
    assert answer.status_code == 202
    job = finished(api, answer.headers["Location"])
    assert job["status"] == "succeeded", job
    result = result_of(api, answer.headers["Location"])
    found = {row["name"]: row for row in result["parameters"]}
    for parameter, tolerance in TOLERANCE.items():
        assert found[parameter]["estimate"] == pytest.approx(config[parameter], rel=tolerance), parameter
    for parameter in ("Ex", "Ey", "Gxy", "Gxz", "a0", "a1"):
        low, high = found[parameter]["interval_95"]
        assert low <= config[parameter] <= high, parameter
    assert not found["Ey"]["identifiable"]
    assert all(abs(mode["error_percent"]) < 0.1 for mode in result["modes"])
    assert min(result["correlation"]["sac"]) > 0.99
    assert len(result["provenance"]["frfs"]) == 33


@pytest.mark.parametrize("name", ["cantilever-1pct", "free-1pct"])
def test_the_laboratorys_own_script_runs_unchanged(service: LocalService, name: str) -> None:
    file, _ = blind(name)
    if not LAB_SESSION.exists():
        pytest.skip(f"{LAB_SESSION} is not there")
    command = [sys.executable, str(LAB_SESSION), "--url", service.url, "--key", service.new_key("laboratory")]
    command += [str(file), "--truth", str(file.with_suffix(".truth.json")), "--modes", "typed"]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert ended.returncode == 0, ended.stdout + ended.stderr


def test_the_same_recipe_and_inputs_give_the_same_bits(api: httpx.Client) -> None:
    file, truth = blind("cantilever-1pct")
    config = truth["config"]
    geometry = {"length_m": config["L"], "width_m": config["b"], "thickness_m": config["t"]}
    campaign = campaign_with(api, file.read_bytes(), geometry, config["bc"])
    modes = posted(api, f"campaigns/{campaign}/mode-sets", {"name": "typed in", "modes": typed_modes(truth)})
    results = []
    for _ in range(2):
        answer = api.post(f"campaigns/{campaign}/update-jobs", json={"mode_set": modes["id"]}).raise_for_status()
        finished(api, answer.headers["Location"])
        results.append(result_of(api, answer.headers["Location"]))
    for result in results:
        del result["provenance"]  # when, where, how long
    assert results[0] == results[1]
