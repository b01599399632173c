"""Updates of laminates by their plies over REST: a stack that couples bending with twisting and membrane forces."""

from __future__ import annotations

from typing import Any

import httpx
import numpy as np
import pytest

from examples.plies import CARBON, TRUTH, plate, simulated
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


def test_an_unsymmetric_stack_is_updated_by_its_plies(api: httpx.Client, project: str) -> None:
    body = plate(*ANGLES)
    modes, points = simulated(body, np.random.default_rng(4))
    described: dict[str, Any] = {
        "name": "plate",
        "geometry": {"length_m": body.length, "width_m": body.width, "thickness_m": body.thickness},
        "density_kg_m3": body.density,
        "laminate": {"plies": [{**PLY, "angle_deg": angle} for angle in ANGLES]},
        "inputs": EXACT,
    }
    structure = ok(api.post(f"projects/{project}/structures", json=described), 201)["id"]
    campaign = ok(api.post(f"structures/{structure}/campaigns", json={"name": "tour", "boundary": "free"}), 201)["id"]
    grid = [{"label": label, "x_m": x, "y_m": y, "z_m": z} for label, (x, y, z) in points.items()]
    ok(api.put(f"campaigns/{campaign}/grid-points", json={"items": grid}))
    assert modes.shapes is not None
    rows = [
        {
            "frequency_hz": float(hz),
            "frequency_sd_hz": 1e-4 * float(hz),
            "damping_ratio": 0.01,
            "damping_sd": 1e-4,
            "shape": [
                {"point": dof.point, "direction": 3, "real": float(value.real), "imag": 0.0}
                for dof, value in zip(modes.dofs, shape, strict=True)
            ],
        }
        for hz, shape in zip(modes.frequency_hz, modes.shapes, strict=True)
    ]
    mode_set = ok(api.post(f"campaigns/{campaign}/mode-sets", json={"name": "measured", "modes": rows}), 201)["id"]
    # One homogenised layer cannot be this stack; the answer says which constants to name.
    jobs = f"campaigns/{campaign}/update-jobs"
    refused = ok(api.post(jobs, json={"mode_set": mode_set, "parameters": [{"name": "Ex"}]}), 422)
    assert "E1, E2, G12" in refused["errors"][0]["detail"]
    begun = api.post(jobs, json={"mode_set": mode_set})
    ok(begun, 202)
    assert finished(api, begun.headers["Location"])["status"] == "succeeded"
    result = ok(api.get(api.base_url.join(begun.headers["Location"] + "/result")), 200)
    found = {row["name"]: row for row in result["parameters"]}
    for name in ("E1", "E2", "G12"):
        assert found[name]["estimate"] == pytest.approx(TRUTH[name], rel=0.02)
        assert found[name]["unit"] == "Pa"
    ok(api.get(api.base_url.join(begun.headers["Location"] + "/cards")), 409)
