"""Rows of members within members of a body, by path (see `tests.support.members.within`), and the
list of those without.
"""

from typing import Any

from service.pages.example import paper
from tests.support.member_lab import MODES
from tests.support.members import Refused, To, held
from tests.support.profiles import ANGLE


def _rows(
    place: str, values: dict[str, Any], at: str | None = None, beside: dict[str, Any] | None = None
) -> Any:
    """Rows of the members of one place, which have the same beside them."""
    rows = values.items()
    return {
        f"{place}.{name}": (
            value if isinstance(value, To | Refused | tuple) else To(value, at, beside or {})
        )
        for name, value in rows
    }


_PLY = {**ANGLE["shape"]["material"], "thickness_m": 0.010, "angle_deg": 0}
_CONSTANTS = {
    "E1_Pa": 24e9,
    "E2_Pa": 9e9,
    "G12_Pa": 3.1e9,
    "G13_Pa": 3.1e9,
    "G23_Pa": 2.5e9,
    "nu_12": 0.28,
}
_CONSTANTS |= {"density_kg_m3": 1900.0}
_PLIES = {
    "*": {
        **{name: paper.STRUCTURE[name] for name in ("geometry", "density_kg_m3")},
        "name": "s {n}",
    }
}
_PLIES["*"]["laminate"] = {"plies": [_PLY]}
_ANGLE = {"*": {**ANGLE, "name": "s {n}"}}
_PIECES = {"pieces": [{"from_m": 0.1, "to_m": 0.2, "thickness_m": 0.012}]}
_STATED = {"poles": [{"frequency_hz": 250.0, "reason": "r"}]}
STRUCTURE: dict[str, Any] = {
    **_rows("geometry", {"length_m": 0.6, "width_m": 0.05, "thickness_m": 0.012}),
    **_rows(
        "material",
        {"Ex_Pa": 30e9, "Ey_Pa": 30e9, "Gxy_Pa": 5e9, "Gxz_Pa": 4e9, "Gyz_Pa": 4e9, "nu_xy": 0.2},
    ),
    "laminate.plies": To([{**_PLY, "angle_deg": 30}], beside=_PLIES),
    **_rows(
        "laminate.plies", {**_CONSTANTS, "thickness_m": 0.0101, "angle_deg": 30}, beside=_PLIES
    ),
    **_rows(
        "inputs",
        {"length_sd_m": 1e-3, "width_sd_m": 1e-4, "thickness_sd_m": 1e-4, "density_sd_kg_m3": 10.0},
    ),
    **_rows("inputs", {"nu_xy_sd": 0.01, "fibre_angle_sd_deg": 1.0}),
    "inputs.height_sd_m": (To(1e-4, beside=_ANGLE), Refused(1e-4)),
    "inputs.ply_angle_sd_deg": (To(1.0, beside=_PLIES), Refused(1.0)),
    **_rows(
        "pieces",
        {"from_m": 0.12, "to_m": 0.22, "thickness_m": 0.013, "end_thickness_m": 0.011},
        beside=_PIECES,
    ),
    **_rows(
        "shape",
        {"kind": "channel", "length_m": 0.5, "width_m": 0.07, "height_m": 0.09},
        beside=_ANGLE,
    ),
    "shape.ribs_m": Refused([0.1], _ANGLE),
    "shape.material": To({**ANGLE["shape"]["material"], "E1_Pa": 24e9}, beside=_ANGLE),
    **_rows("shape.material", _CONSTANTS, beside=_ANGLE),
    "shape.walls": To(
        {"flange": {"thickness_m": 0.005}, "web": {"thickness_m": 0.004}}, beside=_ANGLE
    ),
    "shape.walls.*.thickness_m": To(0.005, beside=_ANGLE),
    "shape.walls.*.material": To({**ANGLE["shape"]["material"], "E1_Pa": 24e9}, "walls", _ANGLE),
}

_SENSORS = {"instruments": {"sensors": [{"points": [1]}]}}
_MASSES = {"instruments": {"added_masses": [{"x_m": 0.1, "y_m": 0.0, "mass_kg": 0.01}]}}
_FRAME = {"frame": {"origin_m": [0.1, 0, 0], "x_axis": [1, 0, 0], "y_axis": [0, 1, 0]}}
CAMPAIGN: dict[str, Any] = {
    **_rows("instruments", {name: {"model": "4508"} for name in ("hammer", "sensor", "analyser")}),
    **_rows(
        "instruments",
        {"sensors": [{"points": [2]}], "sensor_mass_kg": 0.01, **_MASSES["instruments"]},
    ),
    "instruments.sensor_point": To(2, beside={"instruments": {"sensor_mass_kg": 0.01}}),
    **_rows(
        "instruments.sensors", {"model": "4508", "serial": "31", "points": [2]}, beside=_SENSORS
    ),
    **_rows(
        "instruments.added_masses",
        {"x_m": 0.2, "y_m": 0.01, "z_m": 0.01, "mass_kg": 0.02},
        beside=_MASSES,
    ),
    "instruments.added_masses.rotary_inertia_kg_m2": To(1e-6, beside=_MASSES),
    **_rows(
        "frame",
        {"origin_m": [0.2, 0, 0], "x_axis": [-1, 0, 0], "y_axis": [0, -1, 0]},
        beside=_FRAME,
    ),
    **_rows(
        "inputs",
        {"clamp_compliance_sd": 0.01, "sensor_mass_sd_kg": 1e-3, "channel_delay_sd_s": 1e-5},
    ),
    **_rows("inputs", {"window_rate_per_s": 2.0, "window_time_constant_s": 0.5}),
    "inputs.window_rate_sd_per_s": To(0.1, beside={"inputs": {"window_rate_per_s": 2.0}}),
}

_CALIBRATED = {"calibrations": [{"performed_on": "2026-01-15", "sensitivity": 0.01, "unit": "V/N"}]}
_CALIBRATION = {
    "performed_on": "2026-01-16",
    "valid_until": "2027-01-15",
    "sensitivity": 0.02,
    "certificate": "7",
}
_SHAPED = {"modes": [{**MODES[0], "shape": [{"point": 1, "direction": 3, "real": 1.0}]}]}
_PUBLISHED = {"published": {"Ex": {"mean": 33e9, "standard_deviation": 1e9, "n": 5}}}
_PAIRS = [{"label": n, "x_m": 0.05 * n, "y_m": 0.01 * (n % 2), "z_m": 0} for n in (1, 2, 3, 4)]
_POINTS = [{"label": n, "x_m": 0.05 * n, "y_m": 0.01, "z_m": 0} for n in range(1, 9)]
_WINDOWS = {"windows": {"force_length_s": 0.01, "rate_per_s": 50}}
_OVERRULED = {"overrules": [{"point": 1, "hit": 1, "use": False}]}
_REFERENCE, _WINDY = {"references": [{"point": 1, "direction": 3}]}, {"campaign_id": "wind_id"}
# of hits that are processed anew for an update, which other tests hold
_ANEW = {
    name: To(value, beside={"*": {}}, ids={"campaign_id": "long_id"}, waits="never")
    for name, value in {
        "estimator": "H2",
        "windows": {"force_length_s": 0.01, "rate_per_s": 50},
        "band_hz": [10, 200],
        "delay_s": 0.001,
        "false_discovery": 0.9,
        "overrules": [{"point": 1, "hit": 1, "use": False}],
    }.items()
}
_WEIGHED = {
    "tests": [
        {
            "boundary": "free",
            "highest_hz": 300,
            "added_masses": _MASSES["instruments"]["added_masses"],
        }
    ]
}
_COUPONS = {"coupons": [{"constants": ["Ex"]}]}
_CUSUM, _WATCHED = {"chart": {"kind": "cusum"}}, {"parameters": [{"name": "Ex"}]}
PLANNED: dict[str, Any] = {
    "highest_hz": 400,
    "boundary": "cantilever",
    "noise": 0.05,
    "damping_ratio": 0.02,
    "line_spacing_hz": 1.0,
}
PLANNED |= {
    "points_m": [[0.1, 0.01], [0.3, 0.01]],
    "sensor_mass_kg": 0.01,
    **_MASSES["instruments"],
}
PLANNED |= {"sensor": 1, "structure_id": "{second_structure_id}"}

WITHIN: dict[str, dict[str, Any]] = {
    "POST /projects/{project_id}/structures": STRUCTURE,
    "POST /structures/{structure_id}/campaigns": CAMPAIGN,
    "POST /projects/{project_id}/instruments": _rows(
        "calibrations", {**_CALIBRATION, "unit": "mV/N"}, None, _CALIBRATED
    ),
    "POST /campaigns/{campaign_id}/mode-sets": {
        **_rows(
            "modes",
            {
                "frequency_hz": 27.0,
                "damping_ratio": 0.03,
                "frequency_sd_hz": 0.1,
                "damping_sd": 1e-3,
            },
        ),
        "modes.shape": To(_SHAPED["modes"][0]["shape"]),
        **_rows(
            "modes.shape", {"point": 2, "direction": 1, "real": 2.0, "imag": 1.0}, "modes", _SHAPED
        ),
    },
    "POST /mode-sets/{mode_set_id}/edits": (
        _rows("decisions", {"frequency_hz": 163.23, "keep": True}, "modes")
        | {"decisions.reason": To("another")}
    ),
    "POST /campaigns/{campaign_id}/identifications": {
        "poles.frequency_hz": held(300.0, "modes", _STATED),
        "poles.damping_ratio": held(0.02, "modes", _STATED),
        "poles.reason": To("another", beside=_STATED, waits="never"),
    },
    "POST /structures/{structure_id}/coupon-batches": _rows(
        "published.*", {"mean": 30e9, "standard_deviation": 2e9, "n": 6}, None, _PUBLISHED
    ),
    "POST /campaigns/{campaign_id}/alignment": _rows(
        "pairs", {"x_m": 0.06, "y_m": 0.02, "z_m": 0.01}, "rms_m", {"pairs": _PAIRS}
    ),
    "POST /campaigns/{campaign_id}/processings": {
        **_rows("windows", {"force_length_s": 0.02, "rate_per_s": 20.0}, "later", _WINDOWS),
        **_rows("overrules", {"hit": 2, "use": True}, "hits", _OVERRULED),
        "references.point": To(2, "spectra", _REFERENCE, ids=_WINDY),
        "references.direction": To(1, "spectra", _REFERENCE, ids=_WINDY),
    },
    "POST /structures/{structure_id}/forecasts": _rows(
        "points", {"label": 77, "x_m": 0.06, "y_m": 0.015}, beside={"points": _POINTS}
    ),
    "POST /campaigns/{campaign_id}/update-jobs": {
        **_rows("processing", _ANEW),
        "hold_out.points": held([4], "frac"),
        "hold_out.band_hz": held([50, 100], "frac"),
    },
    "POST /structures/{structure_id}/plans": {
        **_rows("tests", PLANNED),
        **_rows("tests.added_masses", {"x_m": 0.2, "mass_kg": 0.02}, beside=_WEIGHED),
        **_rows("coupons", {"constants": ["Ey"], "pieces": 10, "scatter": 0.1}, beside=_COUPONS),
        "coupons.sets": Refused(["web"], _COUPONS),
    },
    "POST /structures/{structure_id}/monitors": {
        **_rows("parameters", {"name": "Gxy", "direction": "rise"}, "parameters", _WATCHED),
        **_rows("baseline", {"campaigns": 7, "since": "2024-02-01T00:00:00Z"}),
        **_rows(
            "chart", {"kind": "cusum", "weight": (0.2, Refused(0.2, _CUSUM)), "jump_share": 0.3}
        ),
        "chart.reference": (To(0.7, beside=_CUSUM), Refused(0.7)),
    },
}

_WITHOUT = {
    "BatchJobIn": "angle_deg campaign_id recipe specimen",
    "ColumnIn": "header unit",
    "CurveCouponIn": (
        "chord_range chord_start columns decimal delimiter dimensions encoding ends excluded"
        " exclusion_reason failure_code run specimen standard zero"
    ),
    "Dimensions": "gauge_length thickness transverse_gauge_length unit width",
    "ForecastPointIn": "direction z_m",
    "FrfIn": (
        "averages coherence imag label real reference_direction reference_point"
        " response_direction response_point"
    ),
    "GridPoint": "label x_m y_m z_m",
    "IdentificationRecipeIn": "band_hz highest_order include_doubtful most_modes threshold",
    "InputsIn": (
        "channel_delay_sd_s clamp_compliance_sd density_sd_kg_m3 "
        "fibre_angle_sd_deg height_sd_m length_sd_m nu_xy_sd ply_angle_sd_deg sensor_mass_sd_kg "
        "thickness_sd_m width_sd_m window_rate_per_s window_rate_sd_per_s window_time_constant_s"
    ),
    "MadeTestIn": "campaign_id mode_set",
    "OverruleIn": "direction point",
    "PairIn": "label",
    "ParameterIn": "fixed name prior_mean prior_sd tied_to",
    "SpringIn": "direction edge name point_m stiffness",
    "Wall": "plies",
}
WITHOUT_ROW = {
    f"{schema}.{member}" for schema, members in _WITHOUT.items() for member in members.split()
}
"""`Schema.member` of those that have no row in any operation. It may only become shorter, but for
bodies whose schemas get names, by which members are counted.
"""
