"""The table of members: each operation with a type of body, each member with a value, and what differs by it.

What a row is, and the effects of members that mean the same everywhere, stand in `tests.support.members`.
"""

import json
from typing import Any

from service.app.demo import paper
from service.store.search.nouns import SEARCHED
from tests.support.furnished import frfs, record
from tests.support.member_lab import (
    COUPON,
    CURVE,
    FRFS_CSV,
    FRFS_MAT,
    FRFS_NPZ,
    HITS_CSV,
    HITS_NPZ,
    HOOK,
    JOINT_RECIPE,
    MAPPING,
    MESH,
    MODES,
    MORE_NPZ,
    OF_CSV,
    OF_MAT,
    OF_NPZ,
    RECIPE,
)
from tests.support.members import Body, Lab, Refused, To
from tests.support.profiles import ANGLE
from tests.support.rest import posted

# What a request changes, made anew each time.


def _made(name: str, path: str, body: Any, headers: Any = None) -> Any:
    def make(lab: Lab) -> dict[str, str]:
        found = posted(lab.api, lab.filled(path, {}), lab.filled(body, {}))
        return {name: (found["items"][0] if "items" in found else found)["id"]}

    return make


PROJECT = _made("project_id", "projects", {"name": "p {n}"})
STRUCTURE = _made("structure_id", "projects/{project_id}/structures", {**paper.STRUCTURE, "name": "s {n}"})
CAMPAIGN = _made("campaign_id", "structures/{structure_id}/campaigns", {**paper.CAMPAIGN, "name": "c {n}"})
INSTRUMENT = _made("instrument_id", "projects/{project_id}/instruments", {"kind": "sensor", "serial": "fresh {n}"})
MONITOR = _made("monitor_id", "structures/{structure_id}/monitors", {"name": "m {n}", "runs_on": "hand"})
KEY = _made("key_id", "api-keys", {"name": "k {n}"})
SPECIMEN = _made("coupon_id", "coupon-batches/{second_batch_id}/coupons", {"specimen": "s {n}", "E_Pa": 3e10})

LABELS = {"tags": ["a tag"], "meta": {"client": "ACME"}}
_NOTHING, _NEW = "id = '00000000-0000-0000-0000-000000000000'", "another {n}"
FRF_FILTER = {"point": 1, "direction": 2, "reference": 2, "quantity": "mobility", "import_id": "{import_id}"}


def _search(noun: str) -> dict[str, Any]:
    files = {"?format": "csv"}
    return {
        "filter": "project.id = '{second_project_id}'",
        "q": "nowhere",
        "sort": "-id",
        "fields": "id",
        "facets": ("project.id", Refused("id", files)),
        "limit": (Refused(1, files), Refused(1, {"?format": "arrow"})),
        "cursor": Refused("x", files),
    }


STRUCTURE_ROWS: dict[str, Any] = {
    "name": _NEW,
    "geometry": {"length_m": 0.6, "width_m": 0.04, "thickness_m": 0.011},
    "density_kg_m3": 1900.0,
    "laminate": To(
        {"plies": [{"material": ANGLE["shape"]["material"], "thickness_m": 0.010, "angle_deg": 0}]}, drop=("material",)
    ),
    "material": {**paper.STRUCTURE["material"], "Ex_Pa": 30e9},
    "inputs": ({"thickness_sd_m": 1e-4}, Refused({"height_sd_m": 1e-4}), Refused({"ply_angle_sd_deg": 1})),
    "pieces": [{"from_m": 0.1, "to_m": 0.2, "thickness_m": 0.012}],
    "shape": To(ANGLE["shape"], drop=("geometry", "material")),
    "confirm": To(True, beside={"density_kg_m3": 2.0}, without=422),
    **LABELS,
}
PATCHED = {"laminate": To(STRUCTURE_ROWS["laminate"].value), "shape": To(ANGLE["shape"])}
CAMPAIGN_ROWS: dict[str, Any] = {
    "name": _NEW,
    "boundary": "free",
    "performed_at": "2026-03-02T09:30:00Z",
    "temperature_c": 21.5,
    "humidity_percent": 40.0,
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
_OF_AN_UPDATE = {"then": "update-jobs/{id}/result", "ids": {"campaign_id": "campaign_id"}}
RECIPE_ROWS: dict[str, Any] = {
    "method": To("joint", "starts", drop=("mode_set",)),
    "mode_set": To("{second_mode_set_id}", "mode_set"),
}
MEMBERS: dict[str, Body] = {
    "POST /projects": Body({"name": _NEW, "description": "x", **LABELS}, {"name": "p {n}"}),
    "GET /projects": Body(),
    "PATCH /projects/{project_id}": Body(
        {
            "name": _NEW,
            "description": "x",
            "archived": To(True, "archived_at"),
            "schemas": {"campaign": {"required": ["temperature_c"]}},
            **LABELS,
        },
        {},
        fresh=PROJECT,
    ),
    "POST /api-keys": Body(
        {"name": _NEW, "scopes": ["read"], "expires_at": "2999-01-01T00:00:00Z"}, {"name": "k {n}", "scopes": ["jobs"]}
    ),
    "GET /api-keys": Body(),
    "GET /audit-events": Body({"project": "{second_project_id}"}),
    "GET /projects/{project_id}/members": Body(),
    "PUT /projects/{project_id}/members/{member}": Body({"role": "viewer"}, {}),
    "GET /users": Body({"name": "{member}"}),
    "GET /users/{user_id}/api-keys": Body(),
    "PATCH /users/{user_id}/api-keys/{key_id}": Body({"expires_at": "2999-01-01T00:00:00Z"}, {}),
    "POST /projects/{project_id}/structures": Body(
        {**STRUCTURE_ROWS, "model": Refused("{model_id}", drop=("geometry", "material"))},
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
            "sections": Refused('{"1": {"thickness_m": 0.01}}'),
            "accept": Refused("NOTHING"),
            "confirm": To(True, without=422, beside={"sections": {"1": {"thickness_m": 2.0}}}),
        },
        {"file": ["m.bdf", MESH]},
        {"units": "m-N-kg"},
        ids={"structure_id": "sent_id"},
        then="",
    ),
    "GET /structures/{structure_id}/models": Body(ids={"structure_id": "bare_id"}),
    "GET /structures/{structure_id}/model/mesh": Body({"boundary": "cantilever"}),
    "POST /structures/{structure_id}/campaigns": Body(CAMPAIGN_ROWS, {"name": "c {n}", "boundary": "cantilever"}),
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

_MAPPING, _ONE_FILE = json.dumps(MAPPING), {"file": ["f.csv", FRFS_CSV]}
_OWN_MAPPING = '{"frequency_hz": {"variable": "x"}}'


def _imports(body: Any, hits: Any) -> dict[str, Any]:
    """Rows of an import of FRFs of a CSV, and in its place of hits."""
    of_hits = {"*": hits, "?quantity": None}
    return {
        "filename": "other.csv",
        "dry_run": True,
        "quantity": ("receptance", Refused("mobility", of_hits | {"?dry_run": True})),
        "kind": (To("frfs", beside=of_hits | {"?dry_run": True}), Refused("frfs", {"?mapping": '{"recording": {}}'})),
        "mapping": (To(_MAPPING, "status", of_hits), Refused('"x"'), Refused("[1]")),
    }


UPDATED = {"then": "update-jobs/{id}/result"}
_TYPED = {"mode_set": "{mode_set_id}"}
RECIPE_ROWS: dict[str, Any] = {
    "method": To("joint", "estimate", {"mode_set": None}),
    "mode_set": To("{second_mode_set_id}", "measured_hz"),
    "identification": To({"band_hz": [5, 300], "highest_order": 10}, "measured_hz", {"mode_set": None}),
    "springs": To([{"name": "k", "stiffness": 1e5, "direction": 3, "point_m": [0.4, 0.0]}], "estimate"),
    "zones_m": To([0.25], "initial_hz"),
    "junctions": Refused("off"),
    "parameters": To([{"name": "Ex"}], "estimate"),
    "prior_from_coupon_batch": To("{batch_id}", "prior_mean"),
    "processing": Refused({"estimator": "H2"}),
    "use_shapes": To(True, "estimate"),
    "damping_models": To(["stiffness"], "coefficients"),
    "weighting": To("relative", "estimate"),
    "band_hz": To([5, 400], "band_hz"),
    "hold_out": To({"points": [4]}, "frac"),
    "inputs": (To({"thickness_sd_m": 1e-3}, "standard_deviation"), Refused({"height_sd_m": 1e-4})),
    "posterior": To("mcmc", "standard_deviation"),
    "seed": To(7, "standard_deviation", {"posterior": "mcmc"}),
    "priority": To(3, "priority"),
    "confirm": To(True, without=422, beside={"parameters": [{"name": "Ex", "prior_mean": 33.0}]}),
}
FIGURE = {"theme": (), "format": ()}
_DATA = {"fmin": 100, "fmax": 50, "stride": 2}
MEMBERS |= {
    "POST /campaigns/{campaign_id}/imports multipart/form-data": Body(
        {
            **_imports(None, {"file": ["h.csv", HITS_CSV]}),
            "file": To(["f.csv", FRFS_CSV.replace(b"7", b"8")], "sha256"),
            "body.mapping": To(MAPPING, "status", {"*": {"file": ["h.csv", HITS_CSV]}, "?quantity": None}),
        },
        _ONE_FILE,
        {"quantity": "mobility"},
        fresh=CAMPAIGN,
        then="",
    ),
    "POST /campaigns/{campaign_id}/imports application/octet-stream": Body(
        _imports(FRFS_CSV, HITS_CSV), FRFS_CSV, {"quantity": "mobility", "filename": "f.csv"}, fresh=CAMPAIGN, then=""
    ),
    "GET /campaigns/{campaign_id}/imports": Body(ids={"campaign_id": "small_id"}),
    "GET /campaigns/{campaign_id}/grid-points": Body(
        {"limit": Refused(1, {"?format": "csv"}), "cursor": Refused("1", {"?format": "csv"}), "format": ()}
    ),
    "PUT /campaigns/{campaign_id}/grid-points": Body(
        {"items": [{"label": 4, "x_m": 0, "y_m": 0, "z_m": 0}]}, {"items": []}, fresh=CAMPAIGN
    ),
    "PUT /campaigns/{campaign_id}/grid-points text/csv": Body({}, b"label,x_m,y_m,z_m\n1,0,0,0\n", fresh=CAMPAIGN),
    "POST /campaigns/{campaign_id}/alignment": Body(
        {"pairs": To([{"label": n, "x_m": 0.05 * n, "y_m": 0.01 * (n % 2), "z_m": 0} for n in (1, 2, 3, 4)], "rms_m")},
        {},
    ),
    "POST /campaigns/{campaign_id}/records": Body(
        {"filename": "other.json", "mapping": Refused(_MAPPING), "dry_run": To(True, "")}, record(), fresh=CAMPAIGN
    ),
    "POST /campaigns/{campaign_id}/records multipart/form-data": Body(
        {
            "filename": "other.npz",
            "mapping": To(_MAPPING, without=422, status=201, beside={"*": {"file": ["h.npz", HITS_NPZ]}}),
            "body.mapping": To(MAPPING, without=422, status=201, beside={"*": {"file": ["h.npz", HITS_NPZ]}}),
            "file": To(["h.npz", MORE_NPZ], "sha256"),
            "dry_run": To(True, ""),
        },
        {"file": ["h.npz", HITS_NPZ], "mapping": MAPPING},
        fresh=CAMPAIGN,
    ),
    "POST /campaigns/{campaign_id}/records application/octet-stream": Body(
        {
            "filename": "other.npz",
            "mapping": To(_MAPPING, status=201, without=422, beside={"?mapping": None}),
            "dry_run": To(True, ""),
        },
        HITS_NPZ,
        {"filename": "h.npz", "mapping": _MAPPING},
        fresh=CAMPAIGN,
    ),
    "GET /campaigns/{campaign_id}/records": Body({"point": 9, "hit": 2}, ids={"campaign_id": "hits_id"}),
    "POST /campaigns/{campaign_id}/frfs": Body(
        {
            "quantity": Refused("mobility"),
            "mapping": Refused(_OWN_MAPPING),
            "body.quantity": "mobility",
            "frequency_hz": To([2.0, 3.0, 4.0], "start_hz"),
            "frfs": To(frfs(5)["frfs"], "response_point"),
        },
        frfs(),
        fresh=CAMPAIGN,
    ),
    "POST /campaigns/{campaign_id}/frfs application/x-npz": Body(
        {
            "quantity": ("mobility", To("mobility", without=422, beside={"?quantity": None})),
            "mapping": To(json.dumps(OF_NPZ), "response_point"),
        },
        FRFS_NPZ,
        {"quantity": "accelerance"},
        fresh=CAMPAIGN,
    ),
    "POST /campaigns/{campaign_id}/frfs text/csv": Body(
        {"quantity": "mobility", "mapping": To(json.dumps(OF_CSV), "response_point")},
        FRFS_CSV,
        {"quantity": "accelerance"},
        fresh=CAMPAIGN,
    ),
    "POST /campaigns/{campaign_id}/frfs application/x-matlab-data": Body(
        {"quantity": "mobility", "mapping": To(json.dumps({**OF_MAT, "response_point": 8}), "response_point")},
        FRFS_MAT,
        {"quantity": "accelerance", "mapping": json.dumps(OF_MAT)},
        fresh=CAMPAIGN,
    ),
    "GET /campaigns/{campaign_id}/frfs": Body(
        {**FRF_FILTER, "fmin": 100, "fmax": 0.5}, ids={"campaign_id": "small_id"}
    ),
    "PUT /campaigns/{campaign_id}/frfs/labels": Body(
        {
            **{name: To(value, "count") for name, value in {**FRF_FILTER, "fmin": 100, "fmax": 0.5}.items()},
            "tags": ["t {n}"],
            "meta": {"a": 1},
        },
        {"tags": ["u"]},
        ids={"campaign_id": "small_id"},
        then="campaigns/{small_id}/frfs",
    ),
    "GET /campaigns/{campaign_id}/frfs/data": Body(
        {
            "point": To(1, status=404),
            "direction": To(2, status=404),
            "reference": 2,
            "quantity": To("mobility", status=404),
            "import_id": To("{import_id}", status=404),
            **_DATA,
        }
    ),
    "GET /frfs/{frf_id}/data": Body(_DATA, ids={"frf_id": "measured_frf_id"}),
    "GET /records/{record_id}/data": Body(),
    "POST /campaigns/{campaign_id}/hit-decisions": Body(
        {"point": To(2, status=422), "direction": To(2, status=422), "hit": 2, "good": False, "why": "a cable"},
        {"point": 1, "hit": 1, "good": True, "why": "w"},
        ids={"campaign_id": "hits_id"},
    ),
    "GET /campaigns/{campaign_id}/hit-decisions": Body(ids={"campaign_id": "hits_id"}),
    "POST /campaigns/{campaign_id}/processings": Body(
        {
            "estimator": To("H2", "later"),
            "windows": To({"force_length_s": 0.01, "rate_per_s": 50}, "later"),
            "band_hz": To([10, 200], "later"),
            "delay_s": To(0.001, "later"),
            "false_discovery": To(0.9, "hits"),
            "overrules": To([{"point": 1, "hit": 1, "use": False}], "hits"),
        },
        {},
        ids={"campaign_id": "hits_id"},
        then="campaigns/{hits_id}/frfs",
    ),
    "GET /campaigns/{campaign_id}/processings": Body(ids={"campaign_id": "hits_id"}),
    "POST /campaigns/{campaign_id}/mode-sets": Body({"name": _NEW, "modes": MODES[:1]}, {"name": "m", "modes": MODES}),
    "GET /campaigns/{campaign_id}/mode-sets": Body(),
    "POST /mode-sets/{mode_set_id}/edits": Body(
        {"name": _NEW, "decisions": To([{"frequency_hz": 160.0, "keep": False, "reason": "r"}], "modes")},
        {"name": "e", "decisions": [{"frequency_hz": 26.0, "keep": False, "reason": "r"}]},
    ),
    "GET /mode-sets/{mode_set_id}": Body(),
    "POST /campaigns/{campaign_id}/identifications": Body(
        {
            "band_hz": To([5, 300], "modes"),
            "highest_order": To(20, "found"),
            "most_modes": To(1, "modes"),
            "threshold": To(0.999, "modes"),
            "name": To(_NEW, "name"),
            "include_doubtful": To(True, "modes"),
        },
        {"band_hz": [5, 500], "highest_order": 10},
        then="campaigns/{campaign_id}/mode-sets?limit=1",
    ),
    "GET /campaigns/{campaign_id}/identifications": Body(),
    "POST /structures/{structure_id}/coupon-batches": Body(
        {
            "name": _NEW,
            "constants": ["Ey"],
            "sets": (Refused(["web"]), To(["web"], ids={"structure_id": "angle_id"})),
            "published": {"Ex": {"mean": 30e9}},
            "conditions": {"speed": "2 mm/min"},
            "confirm": To(True, without=422, beside={"published": {"Ex": {"mean": 33.0}}}),
        },
        {"name": "b {n}", "constants": ["Ex"]},
    ),
    "GET /structures/{structure_id}/coupon-batches": Body(),
    "POST /coupon-batches/{batch_id}/coupons": Body(
        {
            "specimen": _NEW,
            "standard": To("D3518", beside={"*": {"specimen": "s {n}", "strength_Pa": 3e8}}),
            "E_Pa": 3.1e10,
            "G_Pa": To(5e9, beside={"*": {"specimen": "s {n}", "standard": "D3518", "strength_Pa": 3e8}}),
            "nu": 0.2,
            "strength_Pa": 3e8,
            "ultimate_strain": 0.01,
            "failure_code": "AGM",
            "excluded": To(True, without=422, beside={"exclusion_reason": "slipped"}),
            "exclusion_reason": To("slipped", without=422, beside={"excluded": True}),
            "confirm": To(True, without=422, beside={"E_Pa": 33.0}),
        },
        {"specimen": "s {n}", "E_Pa": 3.3e10},
    ),
    "POST /coupon-batches/{batch_id}/coupons multipart/form-data": Body(
        {
            "file": To(["other.csv", CURVE.replace(",500", ",600")], "E_Pa"),
            "coupon": To({**COUPON, "dimensions": {"unit": "mm", "width": [26.0], "thickness": [2.0]}}, "E_Pa"),
            "confirm": To(
                True,
                without=422,
                beside={"coupon": {**COUPON, "dimensions": {"unit": "m", "width": [25], "thickness": [2]}}},
            ),
        },
        {"file": ["curve.csv", CURVE], "coupon": COUPON},
    ),
    "GET /coupon-batches/{batch_id}/coupons": Body(),
    "PATCH /coupons/{coupon_id}": Body(
        {
            "excluded": To(True, without=422, beside={"exclusion_reason": "slipped"}),
            "exclusion_reason": To("slipped", without=422, beside={"excluded": True}),
        },
        {},
        fresh=SPECIMEN,
    ),
    "GET /coupons/{coupon_id}/curve/data": Body(ids={"coupon_id": "curve_id"}),
    "POST /structures/{structure_id}/forecasts": Body(
        {
            "boundary": To("free", "model_modes"),
            "modes": To(4, "model_modes"),
            "highest_hz": To(100, "model_modes"),
            "points": To([{"label": n, "x_m": 0.05 * n, "y_m": 0.01, "z_m": 0} for n in range(1, 9)], "points"),
            "points_to_measure": To(3, "points"),
            "references": To(2, "points"),
            "damping_ratio": To(0.05, "real"),
            "line_spacing_hz": To(10, "frequency_hz"),
        },
        {"modes": 3, "damping_ratio": 0.01, "line_spacing_hz": 5},
        then="forecasts/{id}/frfs/data",
    ),
    "GET /structures/{structure_id}/forecasts": Body(),
    "POST /campaigns/{campaign_id}/update-jobs": Body(RECIPE_ROWS, {**RECIPE, **_TYPED}, **UPDATED),
}

_OF_RESULT = {
    "campaign": "{second_campaign_id}",
    "structure": "{second_structure_id}",
    "project": "{second_project_id}",
}


def _filters(more: Any) -> dict[str, Any]:
    """Rows of what narrows an answer that then has nothing."""
    return {"filter": To("campaign.name = 'nothing'", **more), "q": To("nowhere", **more)}


def _of(*rows: tuple[Any, Any]) -> Any:
    """Rows of a parameter of figures: the value where a figure uses it; another figure refuses it."""
    (figure, value), (other, _) = rows
    return To(value, ids={"name": figure}), Refused(value, ids={"name": other})


MEMBERS |= {
    "POST /update-jobs": Body(
        {
            "recipe": To({**JOINT_RECIPE, "parameters": [{"name": "Ex"}]}, "estimate"),
            "jobs": To([{"campaign_id": "{campaign_id}"}], "campaigns", {"joint": True}),
            "joint": To(False, "items"),
            "scatter": To(0.2, "standard_deviation"),
            "coupon_batches": To(["{batch_id}"], "standard_deviation"),
            "priority": To(3, "priority"),
            "confirm": To(True, without=422, beside={"recipe": {"parameters": [{"name": "Ex", "prior_mean": 33.0}]}}),
        },
        {
            "recipe": JOINT_RECIPE,
            "joint": True,
            "jobs": [{"campaign_id": "{campaign_id}"}, {"campaign_id": "{second_campaign_id}"}],
        },
        then="joint-updates/{id}/result",
    ),
    "GET /update-jobs": Body({**_OF_RESULT, "status": "failed"}),
    "GET /update-jobs/{job_id}/events": Body({"Last-Event-ID": To("{job_version}", status=204)}),
    "GET /joint-updates/{joint_id}/events": Body({"Last-Event-ID": To("{joint_version}", status=204)}),
    "GET /update-jobs/{job_id}/result": Body({"include": "convergence"}),
    "PUT /update-jobs/{job_id}/labels": Body(LABELS, {}),
    "GET /projects/{project_id}/joint-updates": Body(),
    "POST /structures/{structure_id}/plans": Body(
        {
            "tests": To([{"boundary": "free", "highest_hz": 400}], "items"),
            "made": To([{"campaign_id": "{campaign_id}", "mode_set": "{mode_set_id}"}], "known_sd"),
            "points_to_hit": To(2, "points_m"),
            "coupons": To([{"constants": ["Ex"]}], "items"),
            "about": To("Gxy", "information_nats"),
        },
        {"tests": [{"boundary": "free", "highest_hz": 300}]},
    ),
    **{f"GET /search/{noun}": Body(_search(noun)) for noun in SEARCHED},
    "GET /search/results/trend": Body({**_filters({}), "value": "Gxy", "covariates": "humidity_percent"}),
    "GET /search/modes/trend": Body({**_filters({}), "value": "damping_ratio", "covariates": "humidity_percent"}),
    "GET /search/results/trend/figure": Body({**_filters({}), "value": "Gxy", "covariates": "humidity_percent"}),
    "GET /search/modes/trend/figure": Body(
        {**_filters({}), "value": "damping_ratio", "covariates": "humidity_percent"}
    ),
    "GET /search/results/figure": Body({**_filters({}), "sort": "-id"}),
    "GET /search/frfs/data": Body(
        {"filter": "campaign.id = '{second_campaign_id}'", "q": To("nowhere", status=404), **_DATA},
        query={"filter": "campaign.id = '{campaign_id}'"},
    ),
    "GET /search/campaigns/archive": Body(_filters({"status": 404})),
    "POST /searches": Body(
        {
            "project": To("{second_project_id}", "project_id"),
            "name": _NEW,
            "noun": "campaigns",
            "filter": "quantity = 'mobility'",
            "q": "word",
            "sort": "-id",
            "fields": "id",
        },
        {"project": "{project_id}", "name": "s {n}", "noun": "frfs"},
    ),
    "GET /searches": Body(),
    "GET /update-jobs/{job_id}/frfs/data": Body(
        {"model": "initial", "point": To(1, status=404), "direction": To(2, status=404), "reference": 2, **_DATA}
    ),
    "GET /update-jobs/{job_id}/cards": Body({"element": "shell"}),
    "GET /update-jobs/{job_id}/figures/{name}": Body(
        {
            "point": _of(("frf", 2), ("mac", 2)),
            "reference": _of(("frf", 3), ("shapes", 3)),
            "fmin": _of(("csac", 50), ("parameters", 50)),
            "fmax": _of(("frf", 300), ("mac", 300)),
            "measured": _of(("shapes", 1), ("frf", 1)),
            "model": _of(("shapes", 1), ("csf", 1)),
        },
        ids={"name": "frf"},
    ),
    "GET /update-jobs/{job_id}/mesh": Body({"at": (To("points", beside={"?format": "vtu"}), Refused("points"))}),
    "GET /update-jobs/{job_id}/mesh/shapes": Body({"measured": To(1, without=422), "model": To(1, without=422)}),
    "GET /update-jobs/{job_id}/report": Body(),
    "GET /joint-updates/{joint_id}/figures/{name}": Body(ids={"name": "parameters"}),
    "GET /forecasts/{forecast_id}/frfs/data": Body(),
    "GET /forecasts/{forecast_id}/mesh": Body({"at": (To("points", beside={"?format": "vtu"}), Refused("points"))}),
    "GET /forecasts/{forecast_id}/mesh/shapes": Body({"model": 2}),
    "GET /campaigns/{campaign_id}/figures/{name}": Body(
        {
            "point": To(1, status=404),
            "direction": To(2, status=404),
            "response": (Refused(1), To(9, status=404, ids={"campaign_id": "hits_id", "name": "hits"})),
            "reference": (2, Refused(2, ids={"campaign_id": "hits_id", "name": "hits"})),
            "fmin": (100, Refused(2, ids={"campaign_id": "hits_id", "name": "hits"})),
            "fmax": (100, Refused(2, ids={"campaign_id": "hits_id", "name": "hits"})),
        },
        ids={"name": "frf"},
    ),
    "GET /identifications/{identification_id}/figures/{name}": Body(ids={"name": "stabilisation"}),
    "GET /mode-sets/{mode_set_id}/figures/{name}": Body(
        {"mode_set": (To("{second_mode_set_id}", ids={"name": "mac"}), Refused("{second_mode_set_id}"))},
        ids={"name": "shapes"},
    ),
    "GET /coupons/{coupon_id}/figures/{name}": Body(ids={"coupon_id": "curve_id", "name": "curve"}),
    "GET /monitors/{monitor_id}/series/figure": Body({"parameter": "a0", "series": To(99, status=404)}),
    "POST /structures/{structure_id}/monitors": Body(
        {
            "name": _NEW,
            "recipe": {**RECIPE, "seed": 3},
            "modes": "given",
            "priors": "last",
            "boundary": "free",
            "parameters": [{"name": "Gxy"}],
            "baseline": {"campaigns": 7},
            "covariates": ["temperature_c"],
            "false_alarm_rate": 0.02,
            "horizon": 12,
            "pending": 2,
            "chart": {"kind": "cusum"},
            "expected_interval_days": 31,
            "runs_on": "hand",
            "schedule": To("0 3 * * 1", without=422, beside={"runs_on": "schedule"}),
            "mail_to": ["a@example.org"],
            "active": False,
            "confirm": To(True, without=422, beside={"recipe": {"parameters": [{"name": "Ex", "prior_mean": 33.0}]}}),
        },
        {"name": "m {n}"},
        ids={"structure_id": "second_structure_id"},
    ),
    "GET /structures/{structure_id}/monitors": Body(),
    "GET /monitors": Body({"state": "alarm"}),
    "PATCH /monitors/{monitor_id}": Body(
        {"name": _NEW, "active": False, "expected_interval_days": 31, "mail_to": ["a@example.org"]}, {}, fresh=MONITOR
    ),
    "DELETE /monitors/{monitor_id}": Body(),
    "POST /monitors/{monitor_id}/runs": Body(
        {
            "campaign": To("{second_campaign_id}", "campaign_id", {"*": {"campaign": "{campaign_id}"}}),
            "rerun": To(True, "series"),
            "reason": To("why", "", {"rerun": True}),
        },
        {},
    ),
    "GET /monitors/{monitor_id}/runs": Body({"series": To(99)}),
    "GET /monitors/{monitor_id}/series": Body({"series": To(99, status=404)}),
    "GET /alarms": Body({"state": "cleared", "monitor": "{second_monitor_id}", "project": "{second_project_id}"}),
    "POST /alarms/{alarm_id}/acknowledge": Body({"note": "n {n}"}, {"note": "first"}),
    "GET /monitors/{monitor_id}/deliveries": Body(),
    "POST /webhooks": Body(
        {"project": To("{second_project_id}", "project_id"), "url": f"{HOOK}?other", "events": ["alarm.raised"]},
        {"project": "{project_id}", "url": HOOK},
    ),
    "GET /webhooks": Body({"project": "{second_project_id}"}),
    "GET /webhooks/{webhook_id}/deliveries": Body(),
}
