"""Plans over HTTP: what to measure next, from nothing and from what was measured."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import httpx

from tests.support.rest import ok

FREE_HZ = (165.87, 453.39, 800.44, 886.53)


def test_boundaries_are_ranked_and_what_was_measured_counts(
    api: httpx.Client, structure: str, new_campaign: Callable[..., str], new_client: Callable[[], httpx.Client]
) -> None:
    first = ok(api.post(f"structures/{structure}/plans", json={}), 200)
    assert len(first["items"]) == 5
    gains = [item["information_nats"] for item in first["items"]]
    assert gains == sorted(gains, reverse=True)
    assert gains[-1] > 0
    assert all(item["expected_sd"]["Ex"] < first["known_sd"]["Ex"] for item in first["items"])
    campaign = new_campaign(boundary="free")
    modes = [{"frequency_hz": hz} for hz in FREE_HZ]
    mode_set = ok(api.post(f"campaigns/{campaign}/mode-sets", json={"name": "m", "modes": modes}), 201)["id"]
    made = [{"campaign_id": campaign, "mode_set": mode_set}]
    tests = [{"boundary": "free"}, {"boundary": "cantilever", "highest_hz": 2000, "sensor": 2, "sensor_mass_kg": 0.002}]
    body: dict[str, Any] = {"tests": tests, "points_to_hit": 8}
    before = ok(api.post(f"structures/{structure}/plans", json=body), 200)
    after = ok(api.post(f"structures/{structure}/plans", json=body | {"made": made}), 200)
    assert after["known_sd"]["Ex"] < 0.3 * before["known_sd"]["Ex"]
    again = {item["test"]["boundary"]: item["information_nats"] for item in after["items"]}
    fresh = {item["test"]["boundary"]: item["information_nats"] for item in before["items"]}
    assert again["free"] < 0.3 * fresh["free"]
    assert all(len(item["points_m"]) == 8 for item in after["items"])
    ok(new_client().post(f"structures/{structure}/plans", json={}), 404)
