"""A campaign that receives one hit after another over HTTP: how long each answer takes that says whether the hit was good.

50 simulated hits (ten points of five) go to a service of its own, one request each.
"""

from __future__ import annotations

import io
import json
import time

import numpy as np

from benchmarks.hammer import Simulated, campaign
from benchmarks.service import RAW, campaign_of, served

POINTS, HITS, SEED = 10, 5, 18
MAPPING = {
    "sample_rate_hz": {"variable": "fs"},
    "channels": [
        {"variable": "force", "quantity": "force", "point": {"variable": "point"}},
        {"variable": "acceleration", "quantity": "acceleration", "point": 9999},
    ],
}


def main() -> None:
    """Print the table."""
    _, _, simulated = campaign(np.random.default_rng(SEED), "free", POINTS, HITS, 0.2)
    with served() as (_, api, _):
        tour, query = campaign_of(api, "live"), {"filename": "hit.npz", "mapping": json.dumps(MAPPING)}
        took, found = [], 0
        for one in simulated:
            body, start = _npz(one), time.perf_counter()
            answer = api.post(f"campaigns/{tour}/records", content=body, params=query, headers=RAW)
            took.append(1e3 * (time.perf_counter() - start))
            found += answer.raise_for_status().json()["hits"][-1]["accepted"] == (one.fault is None)
    middle, most = np.percentile(took, (50, 95))
    print(f"{len(took)} hits of {simulated[0].hit.samples} samples, one request each: p50 {middle:.0f} ms, ", end="")
    print(f"p95 {most:.0f} ms, longest {max(took):.0f} ms; judged as they are: {found} of {len(took)}")


def _npz(one: Simulated) -> bytes:
    file = io.BytesIO()
    np.savez(
        file,
        force=one.hit.force.samples.astype(np.float32),
        acceleration=one.hit.responses[0].samples.astype(np.float32),
        point=np.array(one.hit.force.dof.point),
        fs=np.array(one.hit.sample_rate_hz),
    )
    return file.getvalue()
