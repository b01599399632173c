"""Waiting for jobs."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from modalbase.client.display import stages
from modalbase.client.errors import JobFailed

if TYPE_CHECKING:
    from modalbase.client.connection import Connection

ENDED = ("succeeded", "failed", "cancelled")
FIRST_PAUSE, LONGEST_PAUSE, GROWTH = 0.05, 1.0, 1.3  # s

Watch = Callable[[str, float], None]
"""Called with a job's stage and the share that is done."""


def wait_for(
    service: Connection, path: str, what: str, watch: Watch | None = None
) -> dict[str, Any]:
    """Wait until a job has ended, in whatever way, and show a live bar on standard error meanwhile.

    The job is asked for at growing intervals, from 50 ms to a second.

    Args:
        service: the connection.
        path: of the job, such as `update-jobs/{id}`.
        what: shown beside the bar.
        watch: called with the stage and the share that is done, each time the job is asked for.

    Returns:
        Its last state.

    Raises:
        ClientError: the service does not answer or refuses.
    """
    pause = FIRST_PAUSE
    with stages(what) as show:
        while True:
            job = service.get(path)
            show(job)
            if watch is not None:
                watch(job["stage"] or job["status"], job["progress"] or 0.0)
            if job["status"] in ENDED:
                return job
            time.sleep(pause)
            pause = min(pause * GROWTH, LONGEST_PAUSE)


def require_success(job: dict[str, Any], what: str) -> None:
    """Return where a job has succeeded.

    Args:
        job: its last state.
        what: begins the error, such as `the update`.

    Raises:
        JobFailed: the job failed or was cancelled; with the reason that it states.
    """
    if job["status"] != "succeeded":
        raise JobFailed(f"{what} {job['status']}: {reason_of(job)}", job)


def reason_of(job: Mapping[str, Any]) -> str:
    """Why a job did not succeed, in the service's words."""
    error = job["error"] or {}
    return str(error.get("detail") or job["message"] or "no reason given")
