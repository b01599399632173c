"""What each operation of the API asks of a key and of its user, judged by hand, and a body that it takes."""

from __future__ import annotations

from typing import Any

from benchmarks.access_laboratory import HOOK, MODES, MONITOR, frfs, record
from service.app.demo import paper

JUDGED = """
public  -       GET /healthz, GET /readyz
read    anyone  GET /projects, GET /api-keys, GET /audit-events, GET /update-jobs, GET /monitors, GET /alarms, GET /webhooks
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
read    viewer  GET /structures/{structure_id}/campaigns
admin   owner   POST /structures/{structure_id}/purge, POST /campaigns/{campaign_id}/purge

write   editor  PATCH /campaigns/{campaign_id}, DELETE /campaigns/{campaign_id}, POST /campaigns/{campaign_id}/restore
write   editor  POST /campaigns/{campaign_id}/imports, PUT /campaigns/{campaign_id}/grid-points
write   editor  POST /campaigns/{campaign_id}/frfs, POST /campaigns/{campaign_id}/records, DELETE /records/{record_id}
write   editor  POST /campaigns/{campaign_id}/mode-sets, POST /campaigns/{campaign_id}/complete
read    viewer  GET /campaigns/{campaign_id}, GET /campaigns/{campaign_id}/imports, GET /imports/{import_id}
read    viewer  GET /imports/{import_id}/original, GET /imports/{import_id}/records, GET /campaigns/{campaign_id}/grid-points
read    viewer  GET /campaigns/{campaign_id}/frfs, GET /campaigns/{campaign_id}/frfs/data, GET /frfs/{frf_id}
read    viewer  GET /frfs/{frf_id}/data, GET /campaigns/{campaign_id}/records, GET /records/{record_id}
read    viewer  GET /records/{record_id}/data, GET /campaigns/{campaign_id}/mode-sets, GET /mode-sets/{mode_set_id}

jobs    editor  POST /campaigns/{campaign_id}/processings, POST /campaigns/{campaign_id}/identifications
jobs    editor  POST /identifications/{identification_id}/cancel, POST /campaigns/{campaign_id}/update-jobs
jobs    editor  POST /update-jobs/{job_id}/cancel, POST /update-jobs/{job_id}/retry
read    viewer  GET /campaigns/{campaign_id}/processings, GET /processings/{processing_id}
read    viewer  GET /campaigns/{campaign_id}/identifications, GET /identifications/{identification_id}
read    viewer  GET /identifications/{identification_id}/figures/{name}, GET /campaigns/{campaign_id}/figures/{name}
read    viewer  GET /update-jobs/{job_id}, GET /update-jobs/{job_id}/events, GET /update-jobs/{job_id}/result
read    viewer  GET /update-jobs/{job_id}/frfs/data, GET /update-jobs/{job_id}/figures
read    viewer  GET /update-jobs/{job_id}/cards, GET /update-jobs/{job_id}/report
read    viewer  GET /update-jobs/{job_id}/figures/{name}, GET /projects/{project_id}/joint-updates
jobs    editor  POST /joint-updates/{joint_id}/cancel, POST /structures/{structure_id}/plans
read    viewer  GET /joint-updates/{joint_id}, GET /joint-updates/{joint_id}/events, GET /joint-updates/{joint_id}/result
read    viewer  GET /joint-updates/{joint_id}/figures, GET /joint-updates/{joint_id}/figures/{name}

write   editor  POST /structures/{structure_id}/coupon-batches, POST /coupon-batches/{batch_id}/coupons
write   editor  PATCH /coupons/{coupon_id}
read    viewer  GET /structures/{structure_id}/coupon-batches, GET /coupon-batches/{batch_id}
read    viewer  GET /coupon-batches/{batch_id}/coupons, GET /coupon-batches/{batch_id}/summary, GET /coupons/{coupon_id}
read    viewer  GET /coupons/{coupon_id}/curve, GET /coupons/{coupon_id}/curve/data, GET /coupons/{coupon_id}/curve/original
read    viewer  GET /coupons/{coupon_id}/figures/{name}

write   editor  POST /structures/{structure_id}/monitors, PATCH /monitors/{monitor_id}, DELETE /monitors/{monitor_id}
write   editor  POST /monitors/{monitor_id}/restore, POST /alarms/{alarm_id}/acknowledge
jobs    editor  POST /monitors/{monitor_id}/runs
read    viewer  GET /structures/{structure_id}/monitors, GET /monitors/{monitor_id}, GET /monitors/{monitor_id}/runs
read    viewer  GET /monitors/{monitor_id}/series, GET /monitors/{monitor_id}/series/figure
read    viewer  GET /monitors/{monitor_id}/deliveries, GET /alarms/{alarm_id}

admin   anyone  POST /webhooks
admin   owner   DELETE /webhooks/{webhook_id}
admin   editor  POST /webhooks/{webhook_id}/test
read    viewer  GET /webhooks/{webhook_id}/deliveries
write   editor  POST /deliveries/{delivery_id}/replay
"""
"""Scope of the key, role in the project of what the path names (or `administrator`, whatever the role), operations."""

BODIES: dict[str, Any] = {
    "POST /projects": {"name": "p"},
    "PATCH /projects/{project_id}": {"name": "p"},
    "PUT /projects/{project_id}/members/{member}": {"role": "viewer"},
    "PATCH /users/{user_id}/api-keys/{key_id}": {"expires_at": "2999-01-01T00:00:00Z"},
    "POST /api-keys": {"name": "k", "scopes": ["admin"]},
    "POST /projects/{project_id}/structures": paper.STRUCTURE,
    "PATCH /structures/{structure_id}": {"name": "s"},
    "POST /structures/{structure_id}/campaigns": paper.CAMPAIGN,
    "PATCH /campaigns/{campaign_id}": {"notes": "n"},
    "PUT /campaigns/{campaign_id}/grid-points": {"items": [{"label": 1, "x_m": 0, "y_m": 0, "z_m": 0}]},
    "POST /campaigns/{campaign_id}/frfs": frfs(),
    "POST /campaigns/{campaign_id}/records": record(),
    "POST /campaigns/{campaign_id}/processings": {},
    "POST /campaigns/{campaign_id}/mode-sets": {"name": "m", "modes": MODES},
    "POST /campaigns/{campaign_id}/identifications": {},
    "POST /structures/{structure_id}/coupon-batches": {"name": "b", "constants": ["Ex"]},
    "POST /coupon-batches/{batch_id}/coupons": {"specimen": "A", "E_Pa": 3e10},
    "PATCH /coupons/{coupon_id}": {"excluded": False},
    "POST /campaigns/{campaign_id}/update-jobs": {},
    "POST /update-jobs": {"jobs": [{"campaign": "00000000-0000-0000-0000-000000000000"}]},
    "POST /structures/{structure_id}/monitors": MONITOR,
    "POST /structures/{structure_id}/plans": {"tests": [{"boundary": "free", "highest_hz": 300}]},
    "PATCH /monitors/{monitor_id}": {"name": "m"},
    "POST /monitors/{monitor_id}/runs": {},
    "POST /alarms/{alarm_id}/acknowledge": {"note": "n"},
    "POST /webhooks": {"project": "00000000-0000-0000-0000-000000000000", "url": HOOK},
}


def judgements() -> dict[str, tuple[str, str]]:
    """Scope and role by operation, from `JUDGED`."""
    found = {}
    for line in filter(None, JUDGED.split("\n")):
        scope, role, operations = line.split(maxsplit=2)
        found.update({operation.strip(): (scope, role) for operation in operations.split(",")})
    return found
