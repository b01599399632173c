"""Matrices of a solver over HTTP: they go in, are solved before a test, and an update finds the
factor of each part.
"""

import io
import zipfile
from functools import cache
from shutil import which
from typing import Any

import httpx
import numpy as np
import pytest

from service.nouns.structures.schemas import StructureIn
from service.nouns.updates.bodies import nominal_body
from tests.integration.test_bodies import FEW_MODES, updated
from tests.integration.test_forecasts import forecast
from tests.integration.test_models import sent
from tests.support import solids
from tests.support.lengths import long
from tests.support.matrices import archived, zipped
from tests.support.profiles import ANGLE, uff
from tests.support.rest import finished, ok, result_of

FACTORS = {"flange": 1.08, "web": 0.93}
MODULI = ("E1", "E2", "G12", "G13", "G23")


@pytest.fixture
def bare(api: httpx.Client, project: str) -> str:
    """A structure that nothing is said of."""
    return str(ok(api.post(f"projects/{project}/structures", json={"name": "bracket"}), 201)["id"])


def body(boundary: str = "free") -> Any:
    return nominal_body(StructureIn.model_validate(ANGLE), boundary)


@cache
def in_mm() -> bytes:
    return zipped(body(), 1e-3)


@cache
def measured() -> bytes:
    """FRFs along both walls at nodes of the mesh, of a body whose walls are stiffer and softer than
    stated.
    """
    true = body()
    truth = {
        f"{wall}.{c}": true.nominal[f"{wall}.{c}"] * f
        for wall, f in FACTORS.items()
        for c in MODULI
    }
    nodes, places = true.mesh.nodes, {}
    for k, x in enumerate(np.linspace(0.03, 0.38, 7)):
        for n, place in (
            (1, (x, 0.025 - 0.004 * (k % 3), -0.038)),
            (2, (x, -0.028, 0.034 - 0.02 * (k % 3))),
        ):
            nearest = nodes[np.argmin(np.linalg.norm(nodes - place, axis=1))]
            places[2 * k + n] = (float(nearest[0]), float(nearest[1]), float(nearest[2]))
    return uff(true, truth, places, 0)


def test_an_update_of_matrices_finds_the_factor_of_each_part(api: httpx.Client, bare: str) -> None:
    """The whole way of matrices: sent, solved before the test, updated, and refused as a deck."""
    model = sent(api, bare, in_mm(), units="mm-N-t", filename="angle.zip")
    assert model["status"] == "succeeded", model["message"]
    contents = model["found"]
    assert (contents["format"], contents["factors"]) == (
        "matrices",
        ["flange.factor", "web.factor"],
    )
    assert contents["mass_kg"] == pytest.approx(0.4 * (0.06 + 0.076) * 0.004 * 1850, rel=1e-6)
    assert contents["size_m"] == pytest.approx([0.4, 0.058, 0.078])
    mesh = ok(api.get(f"structures/{bare}/model/mesh"), 200)
    assert mesh["nodes"]["numbers"][0] == 101
    (block,) = mesh["blocks"]
    assert block["kind"] == "point"
    seen = forecast(api, bare, modes=6)["found"]
    assert seen["rigid_modes"] == 6
    assert all(
        101 <= point["label"] < 101 + contents["counts"]["nodes"] for point in seen["points"]
    )
    low = FEW_MODES | {"identification": {"band_hz": [5, 250]}}
    address, result = updated(api, bare, measured(), "free", low)
    assert result["verdict"]["level"] in ("usable", "with_care")
    rows = {row["name"]: row for row in result["parameters"]}
    for name, value in FACTORS.items():
        low, high = rows[f"{name}.factor"]["interval_95"]
        assert low < value < high, name
        assert rows[f"{name}.factor"]["estimate"] == pytest.approx(value, rel=0.02)
    base = api.base_url.join(address)
    assert "each by its factor" in ok(api.get(f"{base}/deck"), 409)["detail"]
    assert len(ok(api.get(f"{base}/mesh"), 200)["nodes"]["x_m"]) == contents["counts"]["nodes"]


@pytest.mark.long
def test_campaigns_of_matrices_update_together(api: httpx.Client, bare: str) -> None:
    assert (
        sent(api, bare, zipped(body()), units="m-N-kg", filename="angle.zip")["status"]
        == "succeeded"
    )
    assert (
        "whose nodes have no walls"
        in ok(api.post(f"structures/{bare}/plans", json={}), 422)["errors"][0]["detail"]
    )
    content, jobs = measured(), list[dict[str, Any]]()
    for name in ("before", "after"):
        campaign_in = {"name": name, "boundary": "free", "inputs": {"window_rate_per_s": 0}}
        campaign = ok(api.post(f"structures/{bare}/campaigns", json=campaign_in), 201)["id"]
        finished(
            api, api.post(f"campaigns/{campaign}/imports", content=content).headers["Location"]
        )
        recipe = {"identification": FEW_MODES["identification"]}
        jobs.append({"campaign_id": campaign, "recipe": recipe})
    begun = api.post("update-jobs", json={"joint": True, "jobs": jobs})
    done = finished(api, begun.headers["Location"])
    assert done["status"] == "succeeded", done["error"]
    result = result_of(api, begun.headers["Location"])
    rows = {row["name"]: row for row in result["parameters"]}
    for name, value in FACTORS.items():
        assert rows[f"{name}.factor"]["estimate"] == pytest.approx(value, rel=0.02)
    with_angle = {"joint": True, "jobs": [jobs[0], {**jobs[1], "angle_deg": 3}]}
    assert (
        "lies as it is stated"
        in ok(api.post("update-jobs", json=with_angle), 422)["errors"][0]["detail"]
    )


def test_matrices_that_hold_the_body_are_as_modelled(api: httpx.Client, bare: str) -> None:
    assert (
        sent(api, bare, archived(body("cantilever")), units="m-N-kg", filename="a.npz")["status"]
        == "succeeded"
    )
    held = forecast(api, bare, modes=3, boundary="as_modelled")
    assert held["found"]["rigid_modes"] == 0
    page = api.get(str(api.base_url.copy_with(path=f"/ui/structures/{bare}"))).text
    assert "flange.factor, web.factor" in page
    assert held["found"]["sentence"] in page
    refused = ok(api.post(f"structures/{bare}/forecasts", json={"boundary": "free"}), 422)
    assert "the matrices hold the body" in refused["detail"]
    clamped = ok(api.post(f"structures/{bare}/forecasts", json={"boundary": "cantilever"}), 422)
    assert "this structure is matrices" in clamped["detail"]


def test_what_is_wrong_with_matrices_is_said_by_file(api: httpx.Client, bare: str) -> None:
    whole = in_mm()
    assert "matrices have none" in sent(api, bare, whole, filename="a.zip")["message"]
    missing = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(whole)) as archive, zipfile.ZipFile(missing, "w") as less:
        for name in archive.namelist():
            if not name.endswith("nodes.csv"):
                less.writestr(name, archive.read(name))
    model = sent(api, bare, missing.getvalue(), units="mm-N-t", filename="a.zip")
    assert (model["status"], "nodes.csv" in model["message"]) == ("failed", True)


@pytest.mark.skipif(which("ccx") is None, reason="CalculiX is not installed")
@pytest.mark.parametrize("updates", [False, long(True)])
def test_matrices_of_solids_that_calculix_stores(
    api: httpx.Client, bare: str, updates: bool
) -> None:
    """K of each part of 20-node bricks, as a user stores it; the long run updates by FRFs of
    CalculiX's modes with other moduli.
    """
    model = sent(api, bare, solids.stored_matrices(), units="mm-N-t", filename="solids.zip")
    assert model["status"] == "succeeded", model["message"]
    assert model["found"]["factors"] == ["plate.factor", "rib.factor"]
    assert model["found"]["mass_kg"] == pytest.approx(
        1850 * 0.3 * (0.06 * 0.008 + 0.008 * 0.03), rel=1e-6
    )
    seen = forecast(api, bare, modes=8)["found"]
    expected, _ = solids.solved(dict.fromkeys(solids.MODULI, 1.0), [1])
    # Of each part the other's modulus is a millionth.
    assert [mode["frequency_hz"] for mode in seen["model_modes"]] == pytest.approx(
        expected[6:14], rel=2e-6
    )
    if not updates:
        return
    truth = {"plate": 1.06, "rib": 0.9}
    _, result = updated(api, bare, solids.measured(truth), "free", {"damping_models": ["rayleigh"]})
    rows = {row["name"]: row for row in result["parameters"]}
    for name, value in truth.items():
        low, high = rows[f"{name}.factor"]["interval_95"]
        assert low < value < high, rows[f"{name}.factor"]
        assert rows[f"{name}.factor"]["estimate"] == pytest.approx(value, rel=0.01)
