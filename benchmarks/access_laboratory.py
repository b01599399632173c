"""A project with one thing of each kind that a path of the API can name, for programs that try every route."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any
from uuid import UUID

import httpx
from sqlalchemy import insert

from service.app.demo import paper
from service.app.kinds import KINDS  # every table is imported by this
from service.db.base import Base
from service.db.engine import Sessions

assert KINDS  # it is imported for its tables

FORM = {"Content-Type": "application/octet-stream"}
MODES = [{"frequency_hz": 25.61, "damping_ratio": 0.1556}, {"frequency_hz": 160.85, "damping_ratio": 0.0284}]
MONITOR: dict[str, Any] = {
    "name": "watch",
    "recipe": {"parameters": [{"name": "Ex"}], "damping_models": ["rayleigh"]},
    "parameters": [{"name": "Ex"}],
    "baseline": {"campaigns": 4},
}
HOOK = "https://198.51.100.1/hook"  # nobody has this address
ASKED_FREELY: dict[str, Any] = {
    "webhook_networks": "198.51.100.0/24",  # so the service must be allowed to send there
    "key_requests_a_second": 10**6,
    "key_failures_a_minute": 10**6,
}
"""Settings of a service that is asked as much as can be."""


def frfs(first: int = 1) -> dict[str, Any]:
    """A body of one FRF of three lines."""
    one: dict[str, Any] = {
        "response_point": first,
        "response_direction": 3,
        "reference_point": 1,
        "reference_direction": 3,
    }
    one |= {"real": [1.0, 2.0, 3.0], "imag": [0.0, 0.5, 1.0]}
    return {"quantity": "accelerance", "frequency_hz": [1.0, 2.0, 3.0], "frfs": [one]}


def record(hit: int = 1) -> dict[str, Any]:
    """A body of one hit: two channels of 64 samples."""
    mapping = {
        "sample_rate_hz": 1000.0,
        "hit": hit,
        "channels": [
            {"variable": "f", "quantity": "force", "point": 1},
            {"variable": "a", "quantity": "acceleration", "point": 2},
        ],
    }
    samples = [0.0, 1.0, 0.5, 0.1] + 60 * [0.0]
    return {"variables": {"f": samples, "a": samples[::-1]}, "mapping": mapping}


@dataclass
class Things:
    """Ids of what is in a project, by the name that paths give them, and their bodies' references to each other."""

    ids: dict[str, str]

    def __getitem__(self, name: str) -> str:
        return self.ids[name]


def furnish(client: httpx.Client, sessions: Sessions, mark: str) -> Things:
    """Make a project with one thing of each kind.

    Args:
        client: of the project's owner.
        sessions: on the service's database, for the alarm, which otherwise takes a worker and many campaigns.
        mark: a part of every name and note, to be looked for where it must not be.
    """

    def made(path: str, body: Any = None, **arguments: Any) -> Any:
        answer = client.post(path, json=body, **arguments) if body is not None else client.post(path, **arguments)
        if answer.is_error:
            raise RuntimeError(f"POST {path}: {answer.status_code} {answer.text}")
        return answer.json()

    project = made("projects", {"name": mark, "description": mark})["id"]
    structure = made(f"projects/{project}/structures", {**paper.STRUCTURE, "name": mark})["id"]
    campaign = made(f"structures/{structure}/campaigns", {**paper.CAMPAIGN, "name": mark, "notes": mark})["id"]
    second = made(f"structures/{structure}/campaigns", {**paper.CAMPAIGN, "name": f"{mark} again", "notes": mark})["id"]
    both = [{"campaign_id": campaign}, {"campaign_id": second}]
    points = [{"label": n, "x_m": 0.1 * n, "y_m": 0, "z_m": 0} for n in (1, 2)]
    client.put(f"campaigns/{campaign}/grid-points", json={"items": points}).raise_for_status()
    batch = made(f"structures/{structure}/coupon-batches", {"name": mark, "constants": ["Ex"]})["id"]
    coupons = made(f"coupon-batches/{batch}/coupons", {"specimen": mark, "E_Pa": 3.3e10})
    monitor = made(f"structures/{structure}/monitors", {**MONITOR, "name": mark})["id"]
    webhook = made("webhooks", {"project": project, "url": f"{HOOK}?{mark}"})["id"]
    made(f"webhooks/{webhook}/test")
    (delivery,) = client.get(f"webhooks/{webhook}/deliveries").raise_for_status().json()["items"]
    frf = made(f"campaigns/{campaign}/frfs", frfs())["items"][0]["id"]
    ids = {
        "project_id": project,
        "structure_id": structure,
        "campaign_id": campaign,
        "frf_id": frf,
        "record_id": made(f"campaigns/{campaign}/records", record())["items"][0]["id"],
        "mode_set_id": made(f"campaigns/{campaign}/mode-sets", {"name": mark, "modes": MODES})["id"],
        "import_id": made(
            f"campaigns/{campaign}/imports", content=paper.uff_file(), headers=FORM, params={"filename": mark}
        )["id"],
        "processing_id": made(f"campaigns/{campaign}/processings", {})["id"],
        "identification_id": made(f"campaigns/{campaign}/identifications", {})["id"],
        "job_id": made(f"campaigns/{campaign}/update-jobs", {})["id"],
        "joint_id": made("update-jobs", {"joint": True, "jobs": both})["joint"]["id"],
        "batch_id": batch,
        "coupon_id": coupons["items"][0]["id"],
        "monitor_id": monitor,
        "alarm_id": str(_alarm(sessions, monitor, campaign, mark)),
        "webhook_id": webhook,
        "delivery_id": delivery["id"],
        "key_id": client.get("api-keys").json()["items"][0]["id"],
        "number": "1",
        "name": "parameters",
    }
    return Things(ids)


def _alarm(sessions: Sessions, monitor: str, campaign: str, mark: str) -> UUID:
    table = Base.metadata.tables["alarms"]
    row = {"monitor_id": UUID(monitor), "campaign_id": UUID(campaign), "series": 1, "state": "alarm"}
    row |= {"parameter": "Ex", "details": {"performed_at": "2026-03-02T09:30:00+00:00", "value": 3e10, "note": mark}}
    with sessions.begin() as session:
        made: UUID = session.execute(insert(table).values(row).returning(table.c.id)).scalar_one()
        return made
