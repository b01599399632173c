"""One material from two tests over REST: the source paper's bar, clamped and hung freely, as one joint update.

MODALBASE_URL=http://127.0.0.1:8000 MODALBASE_KEY=... python -m examples.joint_update
"""

from __future__ import annotations

import os
import time
from typing import Any

import httpx

from examples.paper.published import (
    DENSITY,
    FREE_LENGTH,
    FREE_MEASURED_HZ,
    POISSON,
    TABLE_3_MEASURED_HZ,
    TABLE_4_COUPONS,
)

MATERIAL = {
    **{f"{name}_Pa": value for name, value in TABLE_4_COUPONS.items()},
    "Gxz_Pa": 4.5e9,
    "Gyz_Pa": 4.5e9,
    "nu_xy": POISSON,
}
EXACT = {"thickness_sd_m": 0, "width_sd_m": 0, "density_sd_kg_m3": 0, "fibre_angle_sd_deg": 0}


def paper_bar_over_rest(api: httpx.Client) -> dict[str, Any]:
    """Store the two tests, update them together, and give the result's document.

    Args:
        api: a client with its base at `/api/v1/` and a key that may write and start jobs.
    """

    def made(path: str, body: dict[str, Any]) -> httpx.Response:
        return api.post(path, json=body).raise_for_status()

    project = made("projects", {"name": "one bar, two tests"}).json()["id"]
    jobs = []
    tests = (("cantilever", 0.5, TABLE_3_MEASURED_HZ), ("free", FREE_LENGTH, FREE_MEASURED_HZ))
    for boundary, length, measured in tests:
        structure = {
            "name": f"bar, {boundary}",
            "geometry": {"length_m": length, "width_m": 0.04, "thickness_m": 0.01012},
            "density_kg_m3": DENSITY,
            "material": MATERIAL,
        }
        owner = made(f"projects/{project}/structures", structure).json()["id"]
        campaign = made(f"structures/{owner}/campaigns", {"name": boundary, "boundary": boundary}).json()["id"]
        modes = [{"frequency_hz": hz} for hz in measured]
        mode_set = made(f"campaigns/{campaign}/mode-sets", {"name": "Table 3", "modes": modes}).json()["id"]
        # The same bar: both campaigns are of the specimen `bar`, though its vibrating lengths differ.
        recipe = {"mode_set": mode_set, "inputs": EXACT}
        jobs.append({"campaign_id": campaign, "specimen": "bar", "recipe": recipe})
    parameters = [{"name": name} for name in ("Ex", "Ey", "Gxy", "Gxz", "Gyz")]
    begun = made("update-jobs", {"joint": True, "jobs": jobs, "recipe": {"parameters": parameters}})
    address = api.base_url.join(begun.headers["Location"])
    while (state := api.get(address).raise_for_status().json())["status"] in ("queued", "running"):
        time.sleep(0.2)
    if state["status"] != "succeeded":
        raise RuntimeError(f"the joint update {state['status']}: {state['message']}")
    document: dict[str, Any] = api.get(f"{address}/result").raise_for_status().json()
    return document


def main() -> None:
    """Run it against the service of the environment and print what it found."""
    url, key = os.environ["MODALBASE_URL"], os.environ["MODALBASE_KEY"]
    with httpx.Client(base_url=f"{url}/api/v1/", headers={"Authorization": f"Bearer {key}"}, timeout=60) as api:
        result = paper_bar_over_rest(api)
    print(result["verdict"]["sentence"])
    for part in result["campaigns"]:
        alone = part["alone"]["Ex"]
        print(
            f"{part['name']}: alone Ex {alone['estimate'] / 1e9:.2f} GPa (z {alone['z']:+.1f}), p {part['predictive_p']:.2g}"
        )
        for own in part["own"]:
            low, high = own["interval_95"]
            print(f"  {own['name']} {own['estimate']:.4g} ({low:.4g} to {high:.4g}) {own['unit']}")


if __name__ == "__main__":
    main()
