"""Rows of projects, people, structures, models, campaigns and instruments; and what requests
change, made anew each time.
"""

from typing import Any

from service.pages.example import paper
from tests.support.member_lab import (
    ATTACHED,
    MESH,
    RECIPE,
    attachments_of,
)
from tests.support.members import Body, Lab, Refused, To
from tests.support.places import ROOT
from tests.support.profiles import ANGLE
from tests.support.rest import finished, posted

# What a request changes, made anew each time.


def _made(name: str, path: str, body: Any) -> Any:
    def make(lab: Lab) -> dict[str, str]:
        found = posted(lab.api, lab.filled(path, {}), lab.filled(body, {}))
        return {name: (found["items"][0] if "items" in found else found)["id"]}

    return make


PROJECT = _made("project_id", "projects", {"name": "p {n}"})
STRUCTURE = _made(
    "structure_id", "projects/{project_id}/structures", {**paper.STRUCTURE, "name": "s {n}"}
)
CAMPAIGN = _made(
    "campaign_id", "structures/{structure_id}/campaigns", {**paper.CAMPAIGN, "name": "c {n}"}
)
INSTRUMENT = _made(
    "instrument_id", "projects/{project_id}/instruments", {"kind": "sensor", "serial": "fresh {n}"}
)
MONITOR = _made(
    "monitor_id", "structures/{structure_id}/monitors", {"name": "m {n}", "runs_on": "hand"}
)

SPECIMEN = _made(
    "coupon_id", "coupon-batches/{second_batch_id}/coupons", {"specimen": "s {n}", "E_Pa": 3e10}
)


def cancelled(lab: Lab) -> dict[str, str]:
    """An update that was cancelled."""
    made = posted(lab.api, lab.filled("campaigns/{campaign_id}/update-jobs", {}), RECIPE)
    posted(lab.api, f"update-jobs/{made['id']}/cancel")
    assert finished(lab.api, f"update-jobs/{made['id']}")["status"] == "cancelled"
    return {"job_id": made["id"]}


def cancelled_together(lab: Lab) -> dict[str, str]:
    """The same of two campaigns."""
    campaigns = (lab.ids[name] for name in ("campaign_id", "second_campaign_id"))
    both = {"joint": True, "jobs": [{"campaign_id": each} for each in campaigns]}
    made = posted(lab.api, "update-jobs", both)["joint"]
    posted(lab.api, f"joint-updates/{made['id']}/cancel")
    assert finished(lab.api, f"joint-updates/{made['id']}")["status"] == "cancelled"
    return {"joint_id": made["id"]}


_SECTIONS = (
    '{"1": {"thickness_m": 0.01, "isotropic": {"E_Pa": 7e10, "nu": 0.3, "density_kg_m3": 2700}}}'
)
_WALL = '{"thickness_m": 0.002, "isotropic": {"E_Pa": 7e10, "nu": 0.3, "density_kg_m3": 2700}}'
_OF_SETS = f'{{"flange": {_WALL}, "the_web": {_WALL}}}'
LABELS = {"tags": ["a tag"], "meta": {"client": "ACME"}}
NEW = "another {n}"


def unless_named(name: str, **ids: str) -> To:
    """The row of `unless_named`: the thing of that name which is there is the answer."""
    return To(True, beside={"name": name}, status=200, ids=ids)


FRF_FILTER = {
    "point": 1,
    "direction": 2,
    "reference": 2,
    "quantity": "mobility",
    "import_id": "{import_id}",
}
SUPERSEDED: Any = {"superseded": To(True, ids={"campaign_id": "hits_id"})}
STRUCTURE_ROWS: dict[str, Any] = {
    "name": NEW,
    "geometry": {"length_m": 0.6, "width_m": 0.04, "thickness_m": 0.011},
    "density_kg_m3": 1900.0,
    "laminate": To(
        {"plies": [{**ANGLE["shape"]["material"], "thickness_m": 0.010, "angle_deg": 0}]},
        drop=("material",),
    ),
    "material": {**paper.STRUCTURE["material"], "Ex_Pa": 30e9},
    "inputs": (
        {"thickness_sd_m": 1e-4},
        Refused({"height_sd_m": 1e-4}),
        Refused({"ply_angle_sd_deg": 1}),
    ),
    "pieces": [{"from_m": 0.1, "to_m": 0.2, "thickness_m": 0.012}],
    "shape": To(ANGLE["shape"], drop=("geometry", "material")),
    "retention_days": 365,
    "confirm": To(True, beside={"density_kg_m3": 2.0}, without=422),
    **LABELS,
}
PATCHED = {"laminate": To(STRUCTURE_ROWS["laminate"].value), "shape": To(ANGLE["shape"])}
CAMPAIGN_ROWS: dict[str, Any] = {
    "name": NEW,
    "boundary": "free",
    "performed_at": "2026-03-02T09:30:00Z",
    "temperature_c": 21.5,
    "humidity_percent": 40.0,
    "covariates": {"wind_m_s": 4.2},
    "instruments": {"sensor": {"model": "4508"}},
    "frame": {"origin_m": [0.1, 0, 0], "x_axis": [1, 0, 0], "y_axis": [0, 1, 0]},
    "inputs": {"window_rate_per_s": 2.0},
    "notes": "in rain",
    "confirm": To(True, beside={"instruments": {"sensor_mass_kg": 50}}, without=422),
    **LABELS,
}
INSTRUMENT_ROWS: dict[str, Any] = {
    "serial": "serial {n}",
    "model": "4507",
    "notes": "dropped",
    "calibrations": [{"performed_on": "2026-01-15"}],
}
_ATTACHED = {"filename": To("other.txt", "name"), "caption": "from the left"}


def _attachments(noun: str) -> dict[str, Body]:
    """Rows of what is attached to a noun, and of the list of it."""
    path = f"/{attachments_of(noun)}"
    form = {"file": To(["a.txt", b"another"], "sha256"), "body.caption": "from the right"}
    return {
        f"GET {path}": Body(),
        f"POST {path} application/octet-stream": Body(_ATTACHED, b"notes"),
        f"POST {path} multipart/form-data": Body(
            {**_ATTACHED, **form},
            {"file": ["a.txt", b"notes"]},
            short=("file", "body.caption"),
        ),
    }


THINGS: dict[str, Body] = {
    **{name: body for noun in ATTACHED for name, body in _attachments(noun).items()},
    "PATCH /attachments/{attachment_id}": Body({"caption": NEW}, {"caption": "c"}),
    "PUT /laboratory": Body({"name": NEW, "address": "Test hall {n}"}, {}),
    "POST /projects": Body(
        {"name": NEW, "description": "x", **LABELS, "unless_named": unless_named("project_id")},
        {"name": "p {n}"},
    ),
    "GET /projects": Body(),
    "PATCH /projects/{project_id}": Body(
        {
            "name": NEW,
            "description": "x",
            "archived": To(True, "archived_at"),
            "schemas": {"campaign": {"required": ["temperature_c"]}},
            **LABELS,
        },
        {},
        fresh=PROJECT,
    ),
    "POST /api-keys": Body(
        {"name": NEW, "scopes": ["read"], "expires_at": "2999-01-01T00:00:00Z"},
        {"name": "k {n}", "scopes": ["jobs"]},
    ),
    "GET /api-keys": Body(),
    "GET /audit-events": Body({"project": "{second_project_id}"}),
    "GET /projects/{project_id}/members": Body(),
    "PUT /projects/{project_id}/members/{member}": Body({"role": "viewer"}, {}),
    "GET /users": Body({"name": "{member}"}),
    "POST /session": Body(),
    "GET /users/{user_id}/api-keys": Body(),
    "PATCH /users/{user_id}/api-keys/{key_id}": Body({"expires_at": "2999-01-01T00:00:00Z"}, {}),
    "POST /projects/{project_id}/structures": Body(
        {
            **STRUCTURE_ROWS,
            "model": Refused("{model_id}", drop=("geometry", "material")),
            "unless_named": unless_named("structure_id"),
        },
        {**paper.STRUCTURE, "name": "s {n}"},
    ),
    "GET /projects/{project_id}/structures": Body(),
    "PATCH /structures/{structure_id}": Body(
        {
            **STRUCTURE_ROWS,
            **PATCHED,
            "model": To("{second_model_id}", ids={"structure_id": "bare_id"}),
        },
        {},
        fresh=STRUCTURE,
    ),
    "DELETE /structures/{structure_id}": Body(),
    "POST /structures/{structure_id}/model multipart/form-data": Body(
        {
            "file": To(["m.bdf", MESH.replace(".01", ".02")], "thickness_m"),
            "filename": "other.bdf",
            "units": To("m-N-kg", "status", beside={"?units": None}),
            "sections": Refused(_SECTIONS),
            "body.sections": Refused(_SECTIONS),
            "accept": Refused("NOTHING"),
            "confirm": To(
                True, without=422, beside={"?sections": _SECTIONS.replace("0.01", "2.0")}
            ),
        },
        {"file": ["m.bdf", MESH]},
        {"units": "m-N-kg"},
        ids={"structure_id": "sent_id"},
        then="",
        short=("file", "body.sections"),
    ),
    "POST /structures/{structure_id}/model application/octet-stream": Body(
        {
            "filename": "other.msh",
            "units": To("mm-N-t", "status", beside={"?units": None}),
            "sections": To(_OF_SETS, "status", beside={"?sections": None}),
            "accept": To("clamp", "status", beside={"?accept": None}),
            "confirm": To(
                True, without=422, beside={"?sections": _OF_SETS.replace("0.002", "2.0")}
            ),
        },
        (ROOT / "tests/corpus/meshes/gmsh-4.1.msh").read_bytes(),
        {"units": "mm-N-t", "filename": "m.msh", "sections": _OF_SETS, "accept": "clamp"},
        ids={"structure_id": "sent_id"},
        then="",
        short=("accept", "confirm"),
    ),
    "GET /structures/{structure_id}/models": Body(ids={"structure_id": "bare_id"}),
    "GET /structures/{structure_id}/model/mesh": Body({"boundary": "cantilever"}),
    "POST /structures/{structure_id}/campaigns": Body(
        {**CAMPAIGN_ROWS, "unless_named": unless_named("campaign_id")},
        {"name": "c {n}", "boundary": "cantilever"},
    ),
    "GET /structures/{structure_id}/campaigns": Body(),
    "PATCH /campaigns/{campaign_id}": Body(CAMPAIGN_ROWS, {}, fresh=CAMPAIGN),
    "DELETE /campaigns/{campaign_id}": Body(),
    "POST /projects/{project_id}/instruments": Body(
        {"kind": "hammer", **INSTRUMENT_ROWS}, {"kind": "sensor", "serial": "i {n}"}
    ),
    "GET /projects/{project_id}/instruments": Body(),
    "PATCH /instruments/{instrument_id}": Body(INSTRUMENT_ROWS, {}, fresh=INSTRUMENT),
    "DELETE /instruments/{instrument_id}": Body(),
}
