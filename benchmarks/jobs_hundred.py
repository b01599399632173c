"""A hundred update jobs over a hundred campaigns, on two workers: every result equals the single run's."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import httpx

from benchmarks.jobs_floor import floor
from service.access.keys import create_key, user_named
from service.app.demo import paper
from service.app.supervisor import listening_socket


@dataclass
class Hundred:
    """What came of the jobs.

    Attributes:
        campaigns: as many jobs.
        succeeded: jobs that did.
        equal: results that are the single run's, bit for bit, apart from where and when they were made.
        seconds: from the one call that queued them to the end of the last.
    """

    campaigns: int
    succeeded: int
    equal: int
    seconds: float


def hundred(campaigns: int, *, workers: int = 2) -> Hundred:
    """Measure the same beam in so many campaigns, update one, then all of them in one call."""
    with floor() as here:
        with listening_socket("127.0.0.1", 0) as free:
            port = free.getsockname()[1]
        here.api(port)
        with here.sessions.begin() as session:
            key = create_key(session, user_named(session, "hundred"), "hundred")[1]
        for _ in range(workers):
            here.modalbase("worker")
        headers = {"Authorization": f"Bearer {key}"}
        with httpx.Client(
            base_url=f"http://127.0.0.1:{port}/api/v1/", headers=headers, timeout=60, trust_env=False
        ) as api:
            return compared(api, campaigns)


def compared(api: httpx.Client, campaigns: int) -> Hundred:
    """The same at a service that runs."""
    jobs = _jobs(api, campaigns)
    (single,) = _results(api, jobs[:1])
    began = time.monotonic()
    results = _results(api, jobs)
    seconds = time.monotonic() - began
    equal = sum(result == single for result in results)
    return Hundred(campaigns, sum(result is not None for result in results), equal, seconds)


def _jobs(api: httpx.Client, campaigns: int) -> list[dict[str, Any]]:
    """A job for each of so many new campaigns with imported FRFs and a mode set of its own."""
    project = _post(api, "projects", {"name": "hundred"})["id"]
    structure = _post(api, f"projects/{project}/structures", paper.STRUCTURE)["id"]
    file, jobs, imports = paper.uff_file(), [], []
    for _ in range(campaigns):
        campaign = _post(api, f"structures/{structure}/campaigns", paper.CAMPAIGN)["id"]
        answer = api.post(
            f"campaigns/{campaign}/imports", content=file, headers={"Content-Type": "application/octet-stream"}
        )
        imports.append(answer.raise_for_status().json()["id"])
        modes = _post(api, f"campaigns/{campaign}/mode-sets", {"name": "published", "modes": paper.MODES})["id"]
        jobs.append({"campaign_id": campaign, "recipe": {"mode_set": modes}})
    for made in imports:
        while api.get(f"imports/{made}").raise_for_status().json()["status"] != "succeeded":
            time.sleep(0.1)
    return jobs


def _results(api: httpx.Client, jobs: list[dict[str, Any]]) -> list[dict[str, Any] | None]:
    """Queue the jobs in one call, and what their results say about the beam; None for a job that did not succeed."""
    waiting = [job["id"] for job in _post(api, "update-jobs", {"jobs": jobs})["items"]]
    results: list[dict[str, Any] | None] = []
    for job in waiting:
        while (state := api.get(f"update-jobs/{job}").raise_for_status().json())["status"] in ("queued", "running"):
            time.sleep(0.2)
        result = api.get(f"update-jobs/{job}/result").json() if state["status"] == "succeeded" else None
        if result is not None:
            del result["provenance"]
        results.append(result)
    return results


def _post(api: httpx.Client, path: str, body: dict[str, Any]) -> Any:
    return api.post(path, json=body).raise_for_status().json()


def main() -> None:
    """Print what came of a hundred."""
    it = hundred(100)
    print(
        f"  {it.campaigns} campaigns: {it.succeeded} succeeded, {it.equal} equal to the single run, {it.seconds:.0f} s"
    )
