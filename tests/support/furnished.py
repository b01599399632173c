"""A project with one thing of each kind that a path of the API can name, and what each operation
asks of a key, judged by hand.
"""

from typing import Any
from uuid import UUID

import httpx
from sqlalchemy import insert

from service.pages.example import paper
from service.platform.db.base import Base
from service.platform.db.engine import Sessions
from service.tasks.kinds import KINDS  # every table is imported by this
from tests.support.rest import RAW, posted

assert KINDS  # it is imported for its tables

MODES = [
    {"frequency_hz": 25.61, "damping_ratio": 0.1556},
    {"frequency_hz": 160.85, "damping_ratio": 0.0284},
]
MONITOR: dict[str, Any] = {
    "name": "watch",
    "recipe": {"parameters": [{"name": "Ex"}], "damping_models": ["rayleigh"]},
    "parameters": [{"name": "Ex"}],
    "baseline": {"campaigns": 4},
}
HOOK = "https://198.51.100.1/hook"  # nobody has this address


def frfs(first: int = 1) -> dict[str, Any]:
    """A body of one FRF of three lines."""
    one = {
        "response_point": first,
        "response_direction": 3,
        "reference_point": 1,
        "reference_direction": 3,
    }
    spectrum = {"real": [1.0, 2.0, 3.0], "imag": [0.0, 0.5, 1.0]}
    return {"quantity": "accelerance", "frequency_hz": [1.0, 2.0, 3.0], "frfs": [one | spectrum]}


def record(hit: int = 1) -> dict[str, Any]:
    """A body of one hit: two channels of 64 samples."""
    pairs = (("f", "force", 1), ("a", "acceleration", 2))
    channels = [
        {"variable": name, "quantity": quantity, "point": point} for name, quantity, point in pairs
    ]
    samples = [0.0, 1.0, 0.5, 0.1] + 60 * [0.0]
    mapping = {"sample_rate_hz": 1000.0, "hit": hit, "channels": channels}
    return {"variables": {"f": samples, "a": samples[::-1]}, "mapping": mapping}


def furnish(client: httpx.Client, sessions: Sessions, mark: str) -> dict[str, str]:
    """Make a project with one thing of each kind: their ids by the name that paths give them.

    Args:
        client: of the project's owner.
        sessions: on the service's database, for the alarm, which otherwise takes a worker and many
            campaigns.
        mark: a part of every name and note, to be looked for where it must not be.
    """

    def made(path: str, body: Any = None, **more: Any) -> Any:
        return posted(client, path, body, **more)

    project = made("projects", {"name": mark, "description": mark})["id"]
    structure = made(f"projects/{project}/structures", {**paper.STRUCTURE, "name": mark})["id"]
    first, second = (
        made(
            f"structures/{structure}/campaigns",
            {**paper.CAMPAIGN, "name": f"{mark} {n}", "notes": mark},
        )["id"]
        for n in (1, 2)
    )
    campaign = f"campaigns/{first}"
    points = [{"label": n, "x_m": 0.1 * n, "y_m": 0, "z_m": 0} for n in (1, 2)]
    client.put(f"{campaign}/grid-points", json={"items": points}).raise_for_status()
    batch = made(f"structures/{structure}/coupon-batches", {"name": mark, "constants": ["Ex"]})[
        "id"
    ]
    attached = made(
        f"{campaign}/attachments", content=mark.encode(), headers=RAW, params={"filename": mark}
    )["id"]
    update = made(f"{campaign}/update-jobs", {})["id"]
    monitor = made(f"structures/{structure}/monitors", {**MONITOR, "name": mark})["id"]
    webhook = made("webhooks", {"project": project, "url": f"{HOOK}?{mark}"})["id"]
    made(f"webhooks/{webhook}/test")
    frf = made(f"{campaign}/frfs", frfs())["items"][0]["id"]
    coupon = made(f"coupon-batches/{batch}/coupons", {"specimen": mark, "E_Pa": 3.3e10})["items"][
        0
    ]["id"]
    both = {"joint": True, "jobs": [{"campaign_id": first}, {"campaign_id": second}]}
    read = made(
        f"{campaign}/imports", content=paper.uff_file(), headers=RAW, params={"filename": mark}
    )
    return {
        "project_id": project,
        "search_id": made(
            "searches", {"project": project, "name": mark, "noun": "frfs", "q": mark}
        )["id"],
        "instrument_id": made(
            f"projects/{project}/instruments", {"kind": "hammer", "serial": mark}
        )["id"],
        "structure_id": structure,
        "campaign_id": first,
        "frf_id": frf,
        "record_id": made(f"{campaign}/records", record())["items"][0]["id"],
        "mode_set_id": made(f"{campaign}/mode-sets", {"name": mark, "modes": MODES})["id"],
        "import_id": read["id"],
        "recording_id": str(_recording(sessions, read, mark)),
        "model_id": made(
            f"structures/{structure}/model",
            content=b"*HEADING\n",
            headers=RAW,
            params={"filename": f"{mark}.inp"},
        )["id"],
        "forecast_id": made(f"structures/{structure}/forecasts", {})["id"],
        "processing_id": made(f"{campaign}/processings", {})["id"],
        "identification_id": made(f"{campaign}/identifications", {})["id"],
        "job_id": update,
        "update_job_id": update,
        "attachment_id": attached,
        "joint_id": made("update-jobs", both)["joint"]["id"],
        "batch_id": batch,
        "coupon_id": coupon,
        "monitor_id": monitor,
        "alarm_id": str(_alarm(sessions, monitor, first, mark)),
        "webhook_id": webhook,
        "delivery_id": (
            client.get(f"webhooks/{webhook}/deliveries").raise_for_status().json()["items"][0]["id"]
        ),
        "key_id": client.get("api-keys").json()["items"][0]["id"],
        "number": "1",
        "name": "parameters",
    }


def _recording(sessions: Sessions, read: dict[str, Any], mark: str) -> UUID:
    table = Base.metadata.tables["recordings"]
    row = {
        "campaign_id": UUID(read["campaign_id"]),
        "import_id": UUID(read["id"]),
        "filename": mark,
        "format": "npz",
        "mapping": {"note": mark},
        "sample_rate_hz": 256.0,
        "samples": 4000,
        "channels": [],
        "file_sha256": bytes.fromhex(read["sha256"]),
    }
    with sessions.begin() as session:
        made: UUID = session.execute(insert(table).values(row).returning(table.c.id)).scalar_one()
        return made


def _alarm(sessions: Sessions, monitor: str, campaign: str, mark: str) -> UUID:
    table = Base.metadata.tables["alarms"]
    row = {
        "monitor_id": UUID(monitor),
        "campaign_id": UUID(campaign),
        "series": 1,
        "state": "alarm",
    }
    row |= {
        "parameter": "Ex",
        "details": {"performed_at": "2026-03-02T09:30:00+00:00", "value": 3e10, "note": mark},
    }
    with sessions.begin() as session:
        made: UUID = session.execute(insert(table).values(row).returning(table.c.id)).scalar_one()
        return made


JUDGED = """
public  -       GET /healthz, GET /readyz
read    anyone  GET /projects, GET /api-keys, GET /audit-events, GET /update-jobs, GET /monitors, GET /alarms, GET /webhooks
read    anyone  GET /search/structures, GET /search/campaigns, GET /search/frfs, GET /search/records, GET /search/modes
write   anyone  POST /searches
write   editor  DELETE /searches/{search_id}
read    viewer  GET /searches/{search_id}
read    anyone  GET /searches
read    anyone  GET /search/campaigns/archive
read    viewer  GET /projects/{project_id}/archive, GET /campaigns/{campaign_id}/archive
read    anyone  GET /search/frfs/data, GET /search/results, GET /search/coupons, GET /search/monitors, GET /search/attachments
read    anyone  GET /search/results/trend, GET /search/results/trend/figure, GET /search/results/figure
read    anyone  GET /search/modes/trend, GET /search/modes/trend/figure
read    anyone  POST /session, DELETE /session
write   anyone  POST /projects
jobs    anyone  POST /update-jobs
admin   anyone  POST /api-keys, DELETE /api-keys/{key_id}

admin   administrator  GET /users, GET /users/{user_id}, POST /users/{user_id}/disable, POST /users/{user_id}/enable
admin   administrator  GET /users/{user_id}/api-keys, PATCH /users/{user_id}/api-keys/{key_id}
admin   administrator  DELETE /users/{user_id}/api-keys/{key_id}

read    viewer  GET /projects/{project_id}, GET /projects/{project_id}/storage, GET /projects/{project_id}/members
read    viewer  GET /projects/{project_id}/structures
write   owner   PATCH /projects/{project_id}, POST /projects/{project_id}/restore
admin   owner   DELETE /projects/{project_id}, POST /projects/{project_id}/purge
admin   owner   PUT /projects/{project_id}/members/{member}, DELETE /projects/{project_id}/members/{member}

write   editor  POST /projects/{project_id}/structures, PATCH /structures/{structure_id}, DELETE /structures/{structure_id}
write   editor  POST /structures/{structure_id}/restore, POST /structures/{structure_id}/campaigns
read    viewer  GET /structures/{structure_id}, GET /structures/{structure_id}/versions/{number}
read    viewer  GET /structures/{structure_id}/campaigns, GET /structures/{structure_id}/models, GET /models/{model_id}
read    viewer  GET /structures/{structure_id}/forecasts, GET /forecasts/{forecast_id}
read    viewer  GET /forecasts/{forecast_id}/frfs/data, GET /forecasts/{forecast_id}/mesh
read    viewer  GET /forecasts/{forecast_id}/mesh/shapes
write   editor  POST /structures/{structure_id}/model
read    viewer  GET /structures/{structure_id}/model, GET /structures/{structure_id}/model/mesh
read    viewer  GET /structures/{structure_id}/model/original
admin   owner   POST /structures/{structure_id}/purge, POST /campaigns/{campaign_id}/purge

write   editor  POST /projects/{project_id}/instruments, PATCH /instruments/{instrument_id}, DELETE /instruments/{instrument_id}
write   editor  POST /instruments/{instrument_id}/restore
read    viewer  GET /projects/{project_id}/instruments, GET /instruments/{instrument_id}

write   editor  PATCH /campaigns/{campaign_id}, DELETE /campaigns/{campaign_id}, POST /campaigns/{campaign_id}/restore
write   editor  DELETE /imports/{import_id}
write   editor  POST /campaigns/{campaign_id}/imports, PUT /campaigns/{campaign_id}/grid-points
write   editor  POST /campaigns/{campaign_id}/frfs, POST /campaigns/{campaign_id}/records, DELETE /records/{record_id}
write   editor  POST /mode-sets/{mode_set_id}/edits, POST /campaigns/{campaign_id}/hit-decisions
write   editor  POST /campaigns/{campaign_id}/mode-sets, POST /campaigns/{campaign_id}/complete
read    viewer  GET /campaigns/{campaign_id}/alignment
write   editor  POST /campaigns/{campaign_id}/alignment
write   editor  PUT /campaigns/{campaign_id}/frfs/labels, PUT /update-jobs/{job_id}/labels
read    viewer  GET /update-jobs/{job_id}/labels
read    viewer  GET /campaigns/{campaign_id}, GET /campaigns/{campaign_id}/imports, GET /imports/{import_id}
read    viewer  GET /structures/{structure_id}/imports
write   editor  POST /structures/{structure_id}/imports
read    viewer  GET /imports/{import_id}/original, GET /imports/{import_id}/records, GET /campaigns/{campaign_id}/grid-points
read    viewer  GET /campaigns/{campaign_id}/frfs, GET /campaigns/{campaign_id}/frfs/data, GET /frfs/{frf_id}
read    viewer  GET /frfs/{frf_id}/data, GET /campaigns/{campaign_id}/records, GET /records/{record_id}
read    viewer  GET /campaigns/{campaign_id}/recordings, GET /recordings/{recording_id}
read    viewer  GET /recordings/{recording_id}/spectra, GET /recordings/{recording_id}/deflection
read    viewer  GET /recordings/{recording_id}/transmissibility
read    viewer  GET /records/{record_id}/data, GET /campaigns/{campaign_id}/mode-sets, GET /mode-sets/{mode_set_id}

jobs    editor  POST /campaigns/{campaign_id}/processings, POST /campaigns/{campaign_id}/identifications
jobs    editor  POST /identifications/{identification_id}/cancel, POST /campaigns/{campaign_id}/update-jobs
jobs    editor  POST /update-jobs/{job_id}/cancel, POST /update-jobs/{job_id}/retry
read    viewer  GET /campaigns/{campaign_id}/hit-decisions
read    viewer  GET /campaigns/{campaign_id}/processings, GET /processings/{processing_id}
read    viewer  GET /campaigns/{campaign_id}/identifications, GET /identifications/{identification_id}
read    viewer  GET /identifications/{identification_id}/figures/{name}, GET /campaigns/{campaign_id}/figures/{name}
read    viewer  GET /update-jobs/{job_id}, GET /update-jobs/{job_id}/events, GET /update-jobs/{job_id}/result
read    viewer  GET /update-jobs/{job_id}/frfs/data, GET /update-jobs/{job_id}/figures
read    viewer  GET /update-jobs/{job_id}/cards, GET /update-jobs/{job_id}/deck, GET /update-jobs/{job_id}/report
read    viewer  GET /update-jobs/{job_id}/figures/{name}, GET /projects/{project_id}/joint-updates
read    viewer  GET /update-jobs/{job_id}/mesh, GET /update-jobs/{job_id}/mesh/shapes
jobs    editor  POST /joint-updates/{joint_id}/cancel, POST /joint-updates/{joint_id}/retry
jobs    editor  POST /structures/{structure_id}/plans
jobs    editor  POST /structures/{structure_id}/forecasts, POST /forecasts/{forecast_id}/cancel
read    viewer  GET /joint-updates/{joint_id}, GET /joint-updates/{joint_id}/events, GET /joint-updates/{joint_id}/result
read    viewer  GET /joint-updates/{joint_id}/figures, GET /joint-updates/{joint_id}/figures/{name}

write   editor  POST /structures/{structure_id}/coupon-batches, POST /coupon-batches/{batch_id}/coupons
write   editor  PATCH /coupons/{coupon_id}
read    viewer  GET /structures/{structure_id}/coupon-batches, GET /coupon-batches/{batch_id}
read    viewer  GET /coupon-batches/{batch_id}/coupons, GET /coupon-batches/{batch_id}/summary, GET /coupons/{coupon_id}
read    viewer  GET /coupons/{coupon_id}/curve, GET /coupons/{coupon_id}/curve/data, GET /coupons/{coupon_id}/curve/original
read    viewer  GET /coupons/{coupon_id}/figures/{name}, GET /mode-sets/{mode_set_id}/figures/{name}

write   editor  POST /structures/{structure_id}/monitors, PATCH /monitors/{monitor_id}, DELETE /monitors/{monitor_id}
write   editor  POST /monitors/{monitor_id}/restore, POST /alarms/{alarm_id}/acknowledge
jobs    editor  POST /monitors/{monitor_id}/runs
read    viewer  GET /structures/{structure_id}/monitors, GET /monitors/{monitor_id}, GET /monitors/{monitor_id}/runs
read    viewer  GET /monitors/{monitor_id}/series, GET /monitors/{monitor_id}/series/figure
read    viewer  GET /monitors/{monitor_id}/series/rows, GET /monitors/{monitor_id}/deliveries, GET /alarms/{alarm_id}

write   editor  POST /projects/{project_id}/attachments, POST /structures/{structure_id}/attachments
write   editor  POST /campaigns/{campaign_id}/attachments, POST /update-jobs/{update_job_id}/attachments
write   editor  POST /joint-updates/{joint_id}/attachments
write   editor  POST /monitors/{monitor_id}/attachments, DELETE /attachments/{attachment_id}
write   editor  PATCH /attachments/{attachment_id}
read    viewer  GET /projects/{project_id}/attachments, GET /structures/{structure_id}/attachments
read    viewer  GET /campaigns/{campaign_id}/attachments, GET /update-jobs/{update_job_id}/attachments
read    viewer  GET /monitors/{monitor_id}/attachments, GET /joint-updates/{joint_id}/attachments
read    viewer  GET /attachments/{attachment_id}, GET /attachments/{attachment_id}/file

read    anyone  GET /laboratory, GET /laboratory/logo
admin   administrator  PUT /laboratory, PUT /laboratory/logo, DELETE /laboratory/logo

admin   anyone  POST /webhooks
admin   owner   DELETE /webhooks/{webhook_id}
admin   editor  POST /webhooks/{webhook_id}/test
read    viewer  GET /webhooks/{webhook_id}/deliveries
write   editor  POST /deliveries/{delivery_id}/replay
"""
"""Scope of the key, role in the project of what the path names (or `administrator`, whatever the
role), operations.
"""

BODIES: dict[str, Any] = {
    "PUT /laboratory": {"name": "l"},
    "PATCH /attachments/{attachment_id}": {"caption": "c"},
    "POST /projects": {"name": "p"},
    "PATCH /projects/{project_id}": {"name": "p"},
    "PUT /projects/{project_id}/members/{member}": {"role": "viewer"},
    "PATCH /users/{user_id}/api-keys/{key_id}": {"expires_at": "2999-01-01T00:00:00Z"},
    "POST /api-keys": {"name": "k", "scopes": ["admin"]},
    "POST /projects/{project_id}/structures": paper.STRUCTURE,
    "PATCH /structures/{structure_id}": {"name": "s"},
    "POST /structures/{structure_id}/campaigns": paper.CAMPAIGN,
    "POST /projects/{project_id}/instruments": {"kind": "sensor", "serial": "1"},
    "PATCH /instruments/{instrument_id}": {"notes": "n"},
    "PATCH /campaigns/{campaign_id}": {"notes": "n"},
    "PUT /campaigns/{campaign_id}/grid-points": {
        "items": [{"label": 1, "x_m": 0, "y_m": 0, "z_m": 0}]
    },
    "POST /campaigns/{campaign_id}/frfs": frfs(),
    "POST /campaigns/{campaign_id}/records": record(),
    "POST /campaigns/{campaign_id}/processings": {},
    "POST /campaigns/{campaign_id}/hit-decisions": {
        "point": 1,
        "hit": 1,
        "good": False,
        "why": "a cable was touched",
    },
    "POST /campaigns/{campaign_id}/alignment": {},
    "POST /campaigns/{campaign_id}/mode-sets": {"name": "m", "modes": MODES},
    "POST /mode-sets/{mode_set_id}/edits": {
        "name": "e",
        "decisions": [
            {"frequency_hz": MODES[0]["frequency_hz"], "keep": True, "reason": "seen by hand"}
        ],
    },
    "POST /campaigns/{campaign_id}/identifications": {},
    "POST /structures/{structure_id}/coupon-batches": {"name": "b", "constants": ["Ex"]},
    "POST /coupon-batches/{batch_id}/coupons": {"specimen": "A", "E_Pa": 3e10},
    "PATCH /coupons/{coupon_id}": {"excluded": False},
    "POST /campaigns/{campaign_id}/update-jobs": {},
    "PUT /campaigns/{campaign_id}/frfs/labels": {"tags": ["t"]},
    "PUT /update-jobs/{job_id}/labels": {"tags": ["t"]},
    "POST /update-jobs": {"jobs": [{"campaign": "00000000-0000-0000-0000-000000000000"}]},
    "POST /structures/{structure_id}/monitors": MONITOR,
    "POST /structures/{structure_id}/plans": {"tests": [{"boundary": "free", "highest_hz": 300}]},
    "POST /structures/{structure_id}/forecasts": {},
    "PATCH /monitors/{monitor_id}": {"name": "m"},
    "POST /monitors/{monitor_id}/runs": {},
    "POST /alarms/{alarm_id}/acknowledge": {"note": "n"},
    "POST /searches": {
        "project": "00000000-0000-0000-0000-000000000000",
        "name": "n",
        "noun": "frfs",
    },
    "POST /webhooks": {"project": "00000000-0000-0000-0000-000000000000", "url": HOOK},
}


def judgements() -> dict[str, tuple[str, str]]:
    """Scope and role by operation, from `JUDGED`."""
    found = {}
    for line in filter(None, JUDGED.split("\n")):
        scope, role, operations = line.split(maxsplit=2)
        found.update({operation.strip(): (scope, role) for operation in operations.split(",")})
    return found
