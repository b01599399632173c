"""Rows of what is measured: imports, time blocks, FRFs, modes, coupons; of forecasts and
updates.
"""

import json
from typing import Any

from tests.support.furnished import frfs, record
from tests.support.member_lab import (
    COUPON,
    CURVE,
    FRFS_CSV,
    FRFS_HDF5,
    FRFS_MAT,
    FRFS_NPY,
    FRFS_NPZ,
    HITS_CSV,
    HITS_NPZ,
    MAPPING,
    MODES,
    MORE_NPZ,
    OF_CSV,
    OF_GIVEN_MODES,
    OF_MAT,
    OF_NPY,
    OF_NPZ,
    RECIPE,
    STIFFER,
)
from tests.support.member_rows_of_things import (
    CAMPAIGN,
    FRF_FILTER,
    NEW,
    SPECIMEN,
    STRUCTURE,
    SUPERSEDED,
    unless_named,
)
from tests.support.members import Body, Refused, To, held

_MAPPING, _ONE_FILE = json.dumps(MAPPING), {"file": ["f.csv", FRFS_CSV]}
_OWN_MAPPING = '{"frequency_hz": {"variable": "x"}}'


def _imports(hits: Any) -> dict[str, Any]:
    """Rows of an import of FRFs of a CSV, and in its place of hits."""
    of_hits = {"*": hits, "?quantity": None}
    return {
        "filename": "other.csv",
        "dry_run": True,
        "quantity": ("receptance", Refused("mobility", of_hits | {"?dry_run": True})),
        "kind": (
            To("hits", beside={"?dry_run": True, "?quantity": None}),
            Refused("frfs", {"?mapping": '{"recording": {}}'}),
        ),
        "mapping": (To(_MAPPING, "status", of_hits), Refused('"x"'), Refused("[1]")),
    }


_DATED = json.dumps({"name": "hour", "boundary": "free", "performed_at": "2026-03-02T09:30:00Z"})
_HEAVY = json.dumps({**json.loads(_DATED), "instruments": {"sensor_mass_kg": 50}})
_CAMPAIGN_OF_FILE: dict[str, Any] = {
    "campaign": To(_DATED, without=422, beside={"?campaign": None}, status=202),
    "quantity": "receptance",
    "kind": Refused("frfs", {"?mapping": '{"recording": {}}'}),
    "mapping": (Refused('"x"'), Refused("[1]")),
    "complete": To(False, status=202),  # monitors wait then: test_campaign_imports.py
    "confirm": To(True, without=422, beside={"?campaign": _HEAVY}, status=202),
}

UPDATED = {"then": "update-jobs/{id}/result"}
_TYPED = {"mode_set": "{mode_set_id}"}
_IDENTIFIED = {"mode_set": None, "identification": RECIPE["identification"]}
RECIPE_ROWS: dict[str, Any] = {
    "method": held("joint", "estimate", _IDENTIFIED),
    "mode_set": held("{second_mode_set_id}", "measured_hz"),
    "identification": (
        held({"band_hz": [5, 300], "highest_order": 10}, "measured_hz", _IDENTIFIED),
        Refused({"highest_order": 10}),
    ),
    "springs": held(
        [{"name": "k", "stiffness": 1e5, "direction": 3, "point_m": [0.4, 0.0]}], "estimate"
    ),
    "zones_m": held([0.25], "initial_hz"),
    "junctions": Refused("off"),
    "parameters": held([{"name": "Ex"}], "estimate"),
    "prior_from_coupon_batch": held("{batch_id}", "prior_mean"),
    "processing": Refused({"estimator": "H2"}),
    "use_shapes": held(True, "estimate"),
    "damping_models": held(["modal"], "coefficients"),
    "weighting": held("relative", "estimate"),
    "band_hz": held([5, 400], "band_hz"),
    "hold_out": held({"points": [4]}, "frac"),
    "reference_temperature_c": held(60.0, "estimate"),
    "inputs": (
        held({"thickness_sd_m": 1e-3}, "standard_deviation"),
        Refused({"height_sd_m": 1e-4}),
    ),
    "posterior": held("mcmc", "standard_deviation"),
    "seed": held(7, "standard_deviation", {"posterior": "mcmc"}),
    "priority": To(3, "priority", waits="never"),
    "confirm": To(True, without=422, beside={"inputs": {"thickness_sd_m": 0.5}}, waits="never"),
}
WINDY = {"campaign_id": "wind_id"}


def of_responses(name: str, value: Any) -> Any:
    """Rows of a member of recordings, which is refused where there are hits alone."""
    return {name: (To(value, "spectra", ids=WINDY), Refused(value))}


DATA = {"fmin": 100, "fmax": 50, "stride": 2}
FILES: dict[str, Body] = {
    "POST /campaigns/{campaign_id}/imports multipart/form-data": Body(
        {
            **_imports({"file": ["h.csv", HITS_CSV]}),
            "file": To(["f.csv", FRFS_CSV.replace(b"7", b"8")], "sha256"),
            "body.mapping": To(
                MAPPING, "status", {"*": {"file": ["h.csv", HITS_CSV]}, "?quantity": None}
            ),
        },
        _ONE_FILE,
        {"quantity": "mobility"},
        fresh=CAMPAIGN,
        then="",
        short=("body.mapping",),
    ),
    "POST /campaigns/{campaign_id}/imports application/octet-stream": Body(
        _imports(HITS_CSV),
        FRFS_CSV,
        {"quantity": "mobility", "filename": "f.csv"},
        fresh=CAMPAIGN,
        then="",
        short=("kind", "mapping"),
    ),
    "GET /campaigns/{campaign_id}/imports": Body(ids={"campaign_id": "small_id"}),
    "GET /structures/{structure_id}/imports": Body({"sha256": 64 * "0", "deleted": True}),
    "POST /structures/{structure_id}/imports application/octet-stream": Body(
        {**_CAMPAIGN_OF_FILE, "filename": "other.csv"},
        FRFS_CSV,
        {"quantity": "mobility", "filename": "f.csv", "campaign": _DATED},
        fresh=STRUCTURE,
        then="",
        short=("campaign", "confirm"),
    ),
    "POST /structures/{structure_id}/imports multipart/form-data": Body(
        {
            **_CAMPAIGN_OF_FILE,
            "filename": "other.csv",
            "file": To(["f.csv", FRFS_CSV.replace(b"7", b"8")], "sha256"),
            "body.campaign": To(_DATED, without=422, beside={"?campaign": None}, status=202),
            "body.mapping": To(
                MAPPING, "status", {"*": {"file": ["h.csv", HITS_CSV]}, "?quantity": None}
            ),
        },
        _ONE_FILE,
        {"quantity": "mobility", "campaign": _DATED},
        fresh=STRUCTURE,
        then="",
        short=("body.campaign",),
    ),
    "GET /campaigns/{campaign_id}/grid-points": Body(
        {"limit": Refused(1, {"?format": "csv"}), "cursor": Refused("1", {"?format": "csv"})}
    ),
    "PUT /campaigns/{campaign_id}/grid-points": Body(
        {"items": [{"label": 4, "x_m": 0, "y_m": 0, "z_m": 0}]}, {"items": []}, fresh=CAMPAIGN
    ),
    "PUT /campaigns/{campaign_id}/grid-points text/csv": Body(
        {}, b"label,x_m,y_m,z_m\n1,0,0,0\n", fresh=CAMPAIGN
    ),
    "POST /campaigns/{campaign_id}/alignment": Body(
        {
            "pairs": To(
                [
                    {"label": n, "x_m": 0.05 * n, "y_m": 0.01 * (n % 2), "z_m": 0}
                    for n in (1, 2, 3, 4)
                ],
                "rms_m",
            )
        },
        {},
        short=("pairs",),
    ),
    "POST /campaigns/{campaign_id}/records": Body(
        {
            "filename": "other.json",
            "mapping": Refused(_MAPPING),
            "body.mapping": To({**record()["mapping"], "sample_rate_hz": 2000.0}, ""),
            "variables": To(dict(zip("af", record()["variables"].values(), strict=True)), ""),
            "dry_run": To(True, ""),
        },
        record(),
        fresh=CAMPAIGN,
    ),
    "POST /campaigns/{campaign_id}/records multipart/form-data": Body(
        {
            "filename": "other.npz",
            "mapping": To(
                _MAPPING, without=422, status=201, beside={"*": {"file": ["h.npz", HITS_NPZ]}}
            ),
            "body.mapping": To(
                MAPPING, without=422, status=201, beside={"*": {"file": ["h.npz", HITS_NPZ]}}
            ),
            "file": To(["h.npz", MORE_NPZ], "sha256"),
            "dry_run": To(True, ""),
        },
        {"file": ["h.npz", HITS_NPZ], "mapping": MAPPING},
        fresh=CAMPAIGN,
        short=("body.mapping", "file"),
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
        short=("mapping",),
    ),
    "GET /campaigns/{campaign_id}/records": Body(
        {"point": 9, "hit": 2}, ids={"campaign_id": "hits_id"}
    ),
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
        short=("quantity",),
    ),
    "POST /campaigns/{campaign_id}/frfs text/csv": Body(
        {"quantity": "mobility", "mapping": To(json.dumps(OF_CSV), "response_point")},
        FRFS_CSV,
        {"quantity": "accelerance"},
        fresh=CAMPAIGN,
        short=("mapping",),
    ),
    "POST /campaigns/{campaign_id}/frfs application/x-matlab-data": Body(
        {
            "quantity": "mobility",
            "mapping": To(json.dumps({**OF_MAT, "response_point": 8}), "response_point"),
        },
        FRFS_MAT,
        {"quantity": "accelerance", "mapping": json.dumps(OF_MAT)},
        fresh=CAMPAIGN,
        short=("mapping",),
    ),
    "POST /campaigns/{campaign_id}/frfs application/x-npy": Body(
        {
            "quantity": "mobility",
            "mapping": To(json.dumps({**OF_NPY, "response_point": 8}), "response_point"),
        },
        FRFS_NPY,
        {"quantity": "accelerance", "mapping": json.dumps(OF_NPY)},
        fresh=CAMPAIGN,
        short=("mapping",),
    ),
    "POST /campaigns/{campaign_id}/frfs application/x-hdf5": Body(
        {"quantity": "mobility", "mapping": To(json.dumps(OF_NPZ), "response_point")},
        FRFS_HDF5,
        {"quantity": "accelerance"},
        fresh=CAMPAIGN,
        short=("mapping",),
    ),
    "GET /campaigns/{campaign_id}/frfs": Body(
        {**FRF_FILTER, "fmin": 100, "fmax": 0.5, **SUPERSEDED}, ids={"campaign_id": "small_id"}
    ),
    "PUT /campaigns/{campaign_id}/frfs/labels": Body(
        {
            **{
                name: To(value, "count")
                for name, value in {**FRF_FILTER, "fmin": 100, "fmax": 0.5}.items()
            },
            "superseded": To(True, "count", ids={"campaign_id": "hits_id"}),
            "tags": ["t {n}"],
            "meta": {"a": 1},
        },
        {"tags": ["u"]},
        ids={"campaign_id": "small_id"},
        then="campaigns/{small_id}/frfs",
        short=("quantity", "superseded", "tags", "meta"),
    ),
    "GET /campaigns/{campaign_id}/frfs/data": Body(
        {
            "point": To(1, status=404),
            "direction": To(2, status=404),
            "reference": 2,
            "quantity": To("mobility", status=404),
            "import_id": To("{import_id}", status=404),
            **DATA,
            # as FRFs of other lines may be among them
            "superseded": To(True, beside={"format": "uff"}, ids={"campaign_id": "hits_id"}),
        }
    ),
    "GET /frfs/{frf_id}/data": Body(DATA, ids={"frf_id": "measured_frf_id"}),
    "GET /records/{record_id}/data": Body(),
    "GET /campaigns/{campaign_id}/recordings": Body(ids=WINDY),
    "GET /recordings/{recording_id}/spectra": Body(),
    "GET /recordings/{recording_id}/deflection": Body({"frequency_hz": 40}),
    "GET /recordings/{recording_id}/transmissibility": Body(
        {"references": To(["99:3"], status=422)}
    ),
    "POST /campaigns/{campaign_id}/hit-decisions": Body(
        {
            "point": To(2, status=422),
            "direction": To(2, status=422),
            "hit": 2,
            "good": To(False, beside={"hit": 3}),
            "why": "a cable",
        },
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
            **of_responses("references", [{"point": 2, "direction": 3}]),
            **of_responses("lag_s", 0.5),
        },
        {},
        ids={"campaign_id": "hits_id"},
        then="campaigns/{hits_id}/frfs",
        short=("overrules", "references"),
    ),
    "GET /campaigns/{campaign_id}/processings": Body(ids={"campaign_id": "hits_id"}),
    "POST /campaigns/{campaign_id}/mode-sets": Body(
        {
            "name": NEW,
            "modes": MODES[:1],
            "excitation": "unmeasured",
            "unless_named": unless_named("mode_set_id"),
        },
        {"name": "m {n}", "modes": MODES},
    ),
    "GET /campaigns/{campaign_id}/mode-sets": Body({"superseded": True}),
    "POST /mode-sets/{mode_set_id}/edits": Body(
        {
            "name": NEW,
            "decisions": To([{"frequency_hz": 163.23, "keep": False, "reason": "r"}], "modes"),
        },
        {"name": "e", "decisions": [{"frequency_hz": 26.16, "keep": False, "reason": "r"}]},
    ),
    "GET /mode-sets/{mode_set_id}": Body(ids={"mode_set_id": "identified_id"}),
    "POST /campaigns/{campaign_id}/identifications": Body(
        {
            "band_hz": To([5, 300], "modes"),
            "highest_order": To(20, "frequency_hz"),
            "most_modes": To(1, "modes"),
            "threshold": To(0.9999, "status"),
            "name": To(NEW, "name"),
            "include_doubtful": To(True, "status", {"threshold": 0.9999}),
            "poles": held([{"frequency_hz": 250.0, "reason": "r"}], "modes"),
        },
        {"band_hz": [5, 500], "highest_order": 10},
        then="campaigns/{campaign_id}/mode-sets?limit=1",
        short=("threshold", "poles", "poles.reason"),
    ),
    "GET /campaigns/{campaign_id}/identifications": Body(),
    "POST /structures/{structure_id}/coupon-batches": Body(
        {
            "name": NEW,
            "constants": ["Ey"],
            "sets": (Refused(["web"]), To(["web"], ids={"structure_id": "angle_id"})),
            "published": {"Ex": {"mean": 30e9}},
            "conditions": {"speed": "2 mm/min"},
            "unless_named": unless_named("batch_id"),
            "confirm": To(True, without=422, beside={"published": {"Ex": {"mean": 33.0}}}),
        },
        {"name": "b {n}", "constants": ["Ex"]},
    ),
    "GET /structures/{structure_id}/coupon-batches": Body(),
    "POST /coupon-batches/{batch_id}/coupons": Body(
        {
            "specimen": NEW,
            "standard": To("D3518", beside={"*": {"specimen": "s {n}", "strength_Pa": 3e8}}),
            "E_Pa": 3.1e10,
            "G_Pa": To(
                5e9, beside={"*": {"specimen": "s {n}", "standard": "D3518", "strength_Pa": 3e8}}
            ),
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
            "file": To(["other.csv", STIFFER], "E_Pa"),
            "coupon": To(
                {**COUPON, "dimensions": {"unit": "mm", "width": [26.0], "thickness": [2.0]}},
                "E_Pa",
            ),
            "confirm": To(
                True,
                without=422,
                beside={
                    "coupon": {
                        **COUPON,
                        "dimensions": {"unit": "m", "width": [25], "thickness": [2]},
                    }
                },
            ),
        },
        {"file": ["curve.csv", CURVE], "coupon": COUPON},
        short=("coupon",),
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
            "modes": (To(4, "model_modes"), Refused(4, {"highest_hz": 100})),
            "highest_hz": To(100, "model_modes", {"modes": None}),
            "points": To(
                [{"label": n, "x_m": 0.05 * n, "y_m": 0.01, "z_m": 0} for n in range(1, 9)],
                "points",
            ),
            "points_to_measure": To(3, "points"),
            "references": To(2, "points"),
            "damping_ratio": To(0.05, "real"),
            "line_spacing_hz": To(10, "frequency_hz"),
        },
        {"modes": 3, "damping_ratio": 0.01, "line_spacing_hz": 5},
        then="forecasts/{id}/frfs/data",
        short=("modes", "points_to_measure"),
    ),
    "GET /structures/{structure_id}/forecasts": Body(),
    "POST /campaigns/{campaign_id}/update-jobs": Body(
        RECIPE_ROWS, {**OF_GIVEN_MODES, **_TYPED}, **UPDATED
    ),
}
