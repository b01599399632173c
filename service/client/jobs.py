"""Waiting for jobs."""

from __future__ import annotations

import time
from typing import Any

from service.client.connection import Connection
from service.client.display import stages
from service.client.errors import ClientError, Exit

ENDED = ("succeeded", "failed", "cancelled")
FIRST_PAUSE, LONGEST_PAUSE, GROWTH = 0.05, 1.0, 1.3  # s


def wait_for(service: Connection, path: str, what: str) -> dict[str, Any]:
    """The last state of the job at a path, once it has ended, in whatever way; a live bar meanwhile."""
    pause = FIRST_PAUSE
    with stages(what) as show:
        while True:
            job: dict[str, Any] = service.get(path)
            show(job)
            if job["status"] in ENDED:
                return job
            time.sleep(pause)
            pause = min(pause * GROWTH, LONGEST_PAUSE)


def require_success(job: dict[str, Any], what: str) -> None:
    """Stop where a job did not succeed.

    Raises:
        ClientError: with the job's own words.
    """
    if job["status"] != "succeeded":
        error = job["error"] or {}
        raise ClientError(
            f"{what} {job['status']}: {error.get('detail') or job['message'] or 'no reason given'}", Exit.FAILED
        )
