"""Updates over REST of what is no plain strip: a stack that couples, and steps, a taper and an added mass."""

from dataclasses import replace
from typing import Any

import httpx
import numpy as np
import pytest

from examples.plies import CARBON
from fecore.body.laminate import OrthotropicMaterial
from fecore.body.profile import Piece
from fecore.body.specimen import Specimen
from fecore.body.supports import PointMass
from fecore.updating.forward import ForwardModel
from fecore.updating.parameters import Parameter, parametrise
from tests.support.rest import finished, ok

ANGLES = (45, -45, 45, -45)
PLY = {
    "E1_Pa": CARBON.Ex,
    "E2_Pa": CARBON.Ey,
    "G12_Pa": CARBON.Gxy,
    "G13_Pa": CARBON.Gxz,
    "G23_Pa": CARBON.Gyz,
    "nu_12": CARBON.nu_xy,
    "thickness_m": 0.001,
}
EXACT = {
    f"{name}_sd{unit}": 0
    for name, unit in (
        ("length", "_m"),
        ("width", "_m"),
        ("thickness", "_m"),
        ("density", "_kg_m3"),
        ("nu_xy", ""),
        ("fibre_angle", "_deg"),
        ("ply_angle", "_deg"),
    )
}


def test_a_stepped_strip_with_a_tip_mass_is_updated_as_it_stood(api: httpx.Client, project: str) -> None:
    nominal = OrthotropicMaterial(30e9, 30e9, 5e9, 5e9, 5e9, 0.15, 2000.0)
    pieces, masses = (Piece(0.0, 0.12, 0.008, 0.006),), (PointMass(0.4, 0.0, 0.05, 4e-6, weighed=True),)
    truth = Specimen(0.4, 0.04, 0.005, replace(nominal, Ex=33e9), divisions=(24, 4), pieces=pieces, masses=masses)
    forward = ForwardModel(truth, parametrise(truth, (Parameter("Ex"),)), (), np.zeros((0, 2)), 4, reduced=False)
    hz = forward.solve(np.array([33e9])).frequency_hz[:3]
    described: dict[str, Any] = {
        "name": "stepped",
        "geometry": {"length_m": 0.4, "width_m": 0.04, "thickness_m": 0.005},
        "density_kg_m3": 2000,
        "material": {"Ex_Pa": 30e9, "Ey_Pa": 30e9, "Gxy_Pa": 5e9, "Gxz_Pa": 5e9, "Gyz_Pa": 5e9, "nu_xy": 0.15},
        "pieces": [{"from_m": 0.0, "to_m": 0.12, "thickness_m": 0.008, "end_thickness_m": 0.006}],
        "inputs": {name: sd for name, sd in EXACT.items() if name != "ply_angle_sd_deg"},
    }
    structures = f"projects/{project}/structures"
    beyond = {**described, "pieces": [{"from_m": 0.3, "to_m": 0.5, "thickness_m": 0.008}]}
    assert "beyond the length" in ok(api.post(structures, json=beyond), 422)["errors"][0]["detail"]
    structure = ok(api.post(structures, json=described), 201)
    assert structure["pieces"] == described["pieces"]
    tip = {"x_m": 0.4, "y_m": 0.0, "mass_kg": 0.05, "rotary_inertia_kg_m2": 4e-6}
    campaign = ok(
        api.post(
            f"structures/{structure['id']}/campaigns",
            json={
                "name": "tip mass",
                "boundary": "cantilever",
                "instruments": {"added_masses": [tip]},
                "inputs": {"clamp_compliance_sd": 0},
            },
        ),
        201,
    )
    assert campaign["instruments"]["added_masses"] == [tip]
    rows = [{"frequency_hz": float(each), "frequency_sd_hz": 1e-4 * float(each)} for each in hz]
    mode_set = ok(api.post(f"campaigns/{campaign['id']}/mode-sets", json={"name": "typed", "modes": rows}), 201)["id"]
    recipe = {"mode_set": mode_set, "parameters": [{"name": "Ex"}]}
    jobs = f"campaigns/{campaign['id']}/update-jobs"
    assert ok(api.post(jobs, json={**recipe, "zones_m": [0.5]}), 422)["errors"][0]["pointer"] == "/zones_m"
    begun = api.post(jobs, json={**recipe, "zones_m": [0.2]})
    ok(begun, 202)
    assert finished(api, begun.headers["Location"])["status"] == "succeeded"
    result = ok(api.get(api.base_url.join(begun.headers["Location"] + "/result")), 200)
    # 0.5 %: the frequencies' noise is 0.01 %, the prior of the model's own error 0.2 % of a frequency.
    assert result["parameters"][0]["estimate"] == pytest.approx(33e9, rel=0.005)
    # Without pieces the strip is of one thickness, in a new version.
    address = f"structures/{structure['id']}"
    seen = {"If-Match": api.get(address).headers["ETag"]}
    changed = ok(api.patch(address, json={"pieces": []}, headers=seen), 200)
    assert changed["version"] == 2
    assert not changed["pieces"]
