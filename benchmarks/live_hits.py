"""A campaign that receives one hit after another over HTTP: how long each answer takes that says whether the hit was good.

50 simulated hits (ten points of five) go to a service of its own, one request each.
"""

from __future__ import annotations

import io
import json
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.hammer import Simulated, campaign
from benchmarks.measurements import client_of, structure_of
from service.settings import Settings
from service.supervisor import LocalService

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
    with tempfile.TemporaryDirectory(prefix="mb-") as folder:
        settings = Settings(data=Path(folder) / "db", port=0, log_level="error")
        with LocalService(settings) as service, client_of(service) as api:
            tour = {"name": "live", "boundary": "free"}
            made = api.post(f"structures/{structure_of(api)}/campaigns", json=tour).raise_for_status().json()
            took, found = [], 0
            for one in simulated:
                body, query = _npz(one), {"filename": "hit.npz", "mapping": json.dumps(MAPPING)}
                start = time.perf_counter()
                answer = api.post(f"campaigns/{made['id']}/records", content=body, params=query, headers=RAW)
                took.append(1e3 * (time.perf_counter() - start))
                judged: dict[str, Any] = answer.raise_for_status().json()["hits"][-1]
                found += judged["accepted"] == (one.fault is None)
    samples = simulated[0].hit.samples
    print(f"{len(took)} hits of {samples} samples, one request each: p50 {np.percentile(took, 50):.0f} ms, ", end="")
    print(
        f"p95 {np.percentile(took, 95):.0f} ms, longest {max(took):.0f} ms; judged as they are: {found} of {len(took)}"
    )


RAW = {"Content-Type": "application/octet-stream"}


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
