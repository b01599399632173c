"""The updated model goes back into a solver: CalculiX finds the frequencies that the job states."""

import re
import shutil
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import psycopg
import pytest
from psycopg.types.json import Jsonb

from fecore.body.laminate import OrthotropicMaterial
from fecore.body.specimen import Specimen
from modalbase.formats.decks import Deck, write_shells
from service.app.supervisor import LocalService
from service.pages.example import paper
from service.platform.db.engine import psycopg_url
from tests.support.calculix import ccx, frequencies
from tests.support.command import modalbase_here
from tests.support.plates import solve
from tests.support.rest import finished, ok, posted, result_of

needs_ccx = pytest.mark.skipif(
    shutil.which("ccx") is None, reason="CalculiX (ccx) is not installed"
)


def errors(found: np.ndarray[Any, Any], updated: list[float]) -> np.ndarray[Any, Any]:
    """Share by which the next frequency of the deck is off each of the job's."""
    stated = np.array(updated)
    return np.abs(found[:, None] / stated - 1).min(axis=0)


@pytest.fixture
def job(api: httpx.Client, project: str) -> dict[str, Any]:
    """A finished update of the paper's beam with a sensor at a point, from modes alone."""
    structure = posted(api, f"projects/{project}/structures", {**paper.STRUCTURE})
    fields = {
        "name": "sensor",
        "boundary": "cantilever",
        "instruments": {"sensor_mass_kg": 0.004, "sensor_point": 1},
    }
    campaign = posted(api, f"structures/{structure['id']}/campaigns", fields)
    points = {"items": [{"label": 1, "x_m": 0.41, "y_m": 0.011, "z_m": 0}]}
    ok(api.put(f"campaigns/{campaign['id']}/grid-points", json=points))
    modes = posted(
        api, f"campaigns/{campaign['id']}/mode-sets", {"name": "Table 3", "modes": paper.MODES}
    )
    made = ok(
        api.post(f"campaigns/{campaign['id']}/update-jobs", json={"mode_set": modes["id"]}), 202
    )
    state = finished(api, f"update-jobs/{made['id']}")
    assert state["status"] == "succeeded", state
    return {**made, "result": result_of(api, f"update-jobs/{made['id']}")}


def test_the_cards_say_where_they_are_from(
    api: httpx.Client, job: dict[str, Any], service: LocalService, tmp_path: Path
) -> None:
    estimates = {row["name"]: row["estimate"] for row in job["result"]["parameters"]}
    abaqus = ok_text(api, f"update-jobs/{job['id']}/cards?format=abaqus")
    assert job["id"] in abaqus.splitlines()[0]
    assert re.search(r"^\*\* result SHA-256 [0-9a-f]{64}$", abaqus, re.MULTILINE)
    card = abaqus.split("*ELASTIC, TYPE=ENGINEERING CONSTANTS\n")[1].splitlines()[0].split(",")
    assert [float(card[0]), float(card[6]), float(card[7])] == pytest.approx(
        [estimates["Ex"], estimates["Gxy"], estimates["Gxz"]], rel=1e-8
    )
    nastran = ok_text(api, f"update-jobs/{job['id']}/cards?format=nastran")
    assert nastran.startswith("$ modalbase ")
    assert nastran.endswith("ENDDATA\n")
    problem = api.get(f"update-jobs/{job['id']}/cards?format=nastran&element=solid")
    assert (problem.status_code, problem.json()["errors"][0]["pointer"]) == (422, "element")
    key = api.headers["authorization"].split()[1]
    around = {"MODALBASE_URL": service.url, "MODALBASE_API_KEY": key}
    modalbase_here("cards", job["id"], "--out", "beam.bdf", cwd=tmp_path, code=0, **around)
    assert (tmp_path / "beam.bdf").read_text() == nastran
    assert "C3D20R" in ok_text(api, f"update-jobs/{job['id']}/cards?element=solid")
    spring = {"name": "tip", "stiffness": 2000.0, "direction": 3, "edge": "end"}
    with psycopg.connect(psycopg_url(service.settings.database_url)) as connection:
        connection.execute(
            "UPDATE update_jobs SET recipe = recipe || %s WHERE id = %s",
            [Jsonb({"springs": [spring]}), job["id"]],
        )
    problem = api.get(f"update-jobs/{job['id']}/cards")
    assert (problem.status_code, "elastic supports (tip)" in problem.json()["detail"]) == (
        409,
        True,
    )


@pytest.mark.long
@needs_ccx
def test_calculix_finds_the_frequencies(api: httpx.Client, job: dict[str, Any]) -> None:
    """Here and below: `integration/test_matrices.py` and `formats/models/test_write_inp.py` have
    CalculiX read and solve decks in the short run.
    """
    updated = [mode["updated_hz"] for mode in job["result"]["modes"]]
    for element, most in (("solid", 0.002), ("shell", 0.01)):
        deck = ok_text(api, f"update-jobs/{job['id']}/cards?element={element}")
        assert errors(frequencies(ccx(deck.splitlines())), updated).max() < most, element


def ok_text(api: httpx.Client, path: str) -> str:
    answer = api.get(path)
    assert answer.status_code == 200, answer.text
    return answer.text


def test_a_job_without_a_result_or_with_springs_has_no_deck(
    api: httpx.Client, campaign: str
) -> None:
    made = ok(api.post(f"campaigns/{campaign}/update-jobs", json={}), 202)
    assert finished(api, f"update-jobs/{made['id']}")["status"] == "failed"
    refused = api.get(f"update-jobs/{made['id']}/cards")
    assert refused.status_code == 409
    assert "has no result" in refused.json()["detail"]


@pytest.mark.long
@needs_ccx
def test_a_plate_on_simple_supports_is_held_alike() -> None:
    """Shells without a clamp against our own model, at random constants."""
    rng = np.random.default_rng(20)
    moduli = tuple(float(m) for m in rng.uniform(0.8, 1.2, 5) * [30e9, 12e9, 5e9, 4e9, 3e9])
    material = OrthotropicMaterial(*moduli, nu_xy=0.2, density=1900.0)
    specimen = Specimen(0.6, 0.09, 0.008, material, "simply_supported", divisions=(30, 6))
    found = solve(specimen.structure, specimen.section, 12).frequency_hz
    ours = found[found > 1.0][:6]
    deck = Deck(0.6, 0.09, 0.008, moduli, 0.2, 1900.0, "simply_supported", 14)
    assert (
        errors(
            frequencies(ccx(write_shells(deck, corrected=True).splitlines())), ours.tolist()
        ).max()
        < 0.002
    )
