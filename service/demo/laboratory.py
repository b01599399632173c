"""A laboratory's session with the service: every step a REST call, nothing else."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import httpx

from service.demo import paper

API = "/api/v1"
POLL_SECONDS = 0.05
TIMEOUT_SECONDS = 300.0

Watch = Callable[[str, float], None]
"""Called with the stage and the share that is done while a job runs."""


class DemoError(Exception):
    """A step of the demonstration failed; the message is the service's."""


@dataclass
class Laboratory:
    """A client of the service that notes how long each step took.

    Attributes:
        client: with the service's URL as base, and a key.
        durations: seconds by step.
    """

    client: httpx.Client
    durations: dict[str, float] = field(default_factory=dict)

    def update_beam(self, watch: Watch) -> dict[str, Any]:
        """The whole main job: from nothing to the result document.

        Raises:
            DemoError: a call or a job failed.
        """
        with self._step("project, structure, campaign"):
            project = self._post("/projects", {"name": "demonstration"})
            structure = self._post(f"/projects/{project['id']}/structures", paper.STRUCTURE)
            campaign = self._post(f"/structures/{structure['id']}/campaigns", paper.CAMPAIGN)
        with self._step("import of 33 FRFs"):
            answer = self.client.post(
                f"{API}/campaigns/{campaign['id']}/imports",
                params={"filename": "paper_beam.uff"},
                content=paper.uff_file(),
                headers={"Content-Type": "application/octet-stream"},
            )
            self._finish(_checked(answer).headers["Location"], watch)
        with self._step("modes and coupons"):
            modes = self._post(f"/campaigns/{campaign['id']}/mode-sets", {"name": "Table 3", "modes": paper.MODES})
            batch = self._post(
                f"/structures/{structure['id']}/coupon-batches",
                {
                    "name": "Table 4",
                    "constants": list(paper.COUPONS_PA),
                    "published": {name: {"mean": mean} for name, mean in paper.COUPONS_PA.items()},
                },
            )
        with self._step("update job"):
            recipe = {"mode_set": modes["id"], "prior_from_coupon_batch": batch["id"]}
            answer = self.client.post(f"{API}/campaigns/{campaign['id']}/update-jobs", json=recipe)
            location = _checked(answer).headers["Location"]
            self._finish(location, watch)
        result: dict[str, Any] = _checked(self.client.get(location + "/result")).json()
        return result

    def _post(self, path: str, body: dict[str, Any]) -> dict[str, Any]:
        made: dict[str, Any] = _checked(self.client.post(API + path, json=body)).json()
        return made

    def _finish(self, location: str, watch: Watch) -> None:
        deadline = time.monotonic() + TIMEOUT_SECONDS
        while time.monotonic() < deadline:
            job = _checked(self.client.get(location)).json()
            watch(job["stage"] or job["status"], job["progress"] or 0.0)
            if job["status"] == "succeeded":
                return
            if job["status"] in ("failed", "cancelled"):
                raise DemoError(f"{location}: {job['status']}: {job['error'] or job['message']}")
            time.sleep(POLL_SECONDS)
        raise DemoError(f"{location} was not done within {TIMEOUT_SECONDS:g} s")

    @contextmanager
    def _step(self, name: str) -> Iterator[None]:
        began = time.perf_counter()
        yield
        self.durations[name] = time.perf_counter() - began


def _checked(answer: httpx.Response) -> httpx.Response:
    if answer.is_error:
        raise DemoError(f"{answer.request.method} {answer.request.url.path}: {answer.status_code} {answer.text}")
    return answer
