"""Updates over HTTP: what structure, campaign and recipe state; stepped strips; several tests of
one material.
"""

import io
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import httpx
import numpy as np
import pytest
from pypdf import PdfReader
from sqlalchemy import JSON, Engine, update

import service.app.composition  # noqa: F401  imports every table
from examples.plies import CARBON
from fecore.body.constants import Parameter
from fecore.body.generators import Piece
from fecore.body.laminate import OrthotropicMaterial
from fecore.body.specimen import Specimen
from fecore.body.supports import PointMass
from fecore.updating.campaigns import Campaign
from fecore.updating.forward import ForwardModel
from fecore.updating.parameters import parametrise
from service.app.supervisor import LocalService
from service.pages.example import paper
from service.platform.db.base import Base
from service.platform.errors import NotFinite
from tests.support.cantilever import MEASURED_HZ
from tests.support.rest import finished, mode_rows, ok, posted, result_of, session_client
from tests.support.strips import NOMINAL, STRIP, measured

A0, A1, TAU = 30.0, 1e-5, 0.5
NO_DOUBT = {
    "length_sd_m": 0,
    "width_sd_m": 0,
    "density_sd_kg_m3": 0,
    "nu_xy_sd": 0,
    "fibre_angle_sd_deg": 0,
}


def modes_under_a_window(api: httpx.Client, campaign: str) -> str:
    """Typed modes of a Rayleigh body, whose decay an exponential window of 0.5 s has made
    faster.
    """
    omega = 2 * np.pi * MEASURED_HZ
    ratio = (A0 / omega + A1 * omega) / 2 + 1 / (TAU * omega)
    rows = [
        {"frequency_hz": hz, "damping_ratio": zeta}
        for hz, zeta in zip(MEASURED_HZ.tolist(), ratio.tolist(), strict=True)
    ]
    return str(
        posted(api, f"campaigns/{campaign}/mode-sets", {"name": "typed", "modes": rows})["id"]
    )


def updated(api: httpx.Client, campaign: str, recipe: dict[str, Any]) -> dict[str, Any]:
    answer = api.post(f"campaigns/{campaign}/update-jobs", json=recipe)
    ok(answer, 202)
    job = finished(api, answer.headers["Location"])
    assert job["status"] == "succeeded", job
    return result_of(api, answer.headers["Location"])


def budget_of(result: dict[str, Any], name: str) -> dict[str, dict[str, Any]]:
    (row,) = (row for row in result["parameters"] if row["name"] == name)
    return {entry["source"]: entry for entry in row["budget"]}


def test_what_structure_and_campaign_state_reaches_the_result_of_typed_modes(
    api: httpx.Client, service: LocalService, project: str, beam: dict[str, Any]
) -> None:
    """A campaign without FRFs is updated from its modes alone; the recipe has the last word. A
    result says what its test was like, and the page beside another one does, whatever is edited.
    """
    stated = {**beam, "inputs": {**NO_DOUBT, "thickness_sd_m": 0.3e-3}}
    structure = posted(api, f"projects/{project}/structures", stated)
    assert structure["inputs"] == {
        **stated["inputs"],
        "ply_angle_sd_deg": None,
        "height_sd_m": None,
    }
    body = {
        "name": "typed",
        "boundary": "cantilever",
        "inputs": {"clamp_compliance_sd": 0, "window_time_constant_s": TAU},
    }
    campaign = posted(api, f"structures/{structure['id']}/campaigns", body)
    assert campaign["inputs"]["window_time_constant_s"] == TAU
    mode_set = modes_under_a_window(api, campaign["id"])

    result = updated(api, campaign["id"], {"mode_set": mode_set})
    assert [(o["stage"], o["status"]) for o in result["outcomes"]] == [
        ("elastic", "succeeded"),
        ("damping", "succeeded"),
    ]
    budget = budget_of(result, "Ex")
    assert budget["thickness"]["provenance"] == "0.0003 m, stated"
    assert not {"length", "density", "clamp_rotation", "fibre_angle"} & set(budget)
    estimates = {row["name"]: row["estimate"] for row in result["parameters"]}
    assert estimates["a0"] == pytest.approx(A0, rel=1e-6)  # the window's 2/τ is taken off exactly
    assert estimates["a1"] == pytest.approx(A1, rel=1e-6)
    assert result["provenance"]["inputs"]["thickness_sd_m"] == 0.3e-3
    query = {
        "filter": f"campaign.id = '{campaign['id']}' AND Ex > 1e9",
        "fields": "verdict,Ex,Ex_sd,Ex_low,Ex_high",
    }
    (row,) = ok(api.get("search/results", params=query))["items"]
    (ex,) = (one for one in result["parameters"] if one["name"] == "Ex")
    assert row == {
        "verdict": result["verdict"]["level"],
        "Ex": ex["estimate"],
        "Ex_sd": ex["standard_deviation"],
        **dict(zip(("Ex_low", "Ex_high"), ex["interval_95"], strict=True)),
    }

    first, address = result["provenance"], f"campaigns/{campaign['id']}"
    assert "temperature_c" not in first["test"]
    ok(api.patch(address, json={"temperature_c": 30}, headers={"If-Match": "*"}))
    recipe = {"mode_set": mode_set, "inputs": {"thickness_sd_m": 0, "window_rate_per_s": 0}}
    recipe |= {"parameters": [{"name": "Ex"}]}
    result = updated(api, campaign["id"], recipe)
    assert "thickness" not in budget_of(result, "Ex")
    estimates = {row["name"]: row["estimate"] for row in result["parameters"]}
    assert estimates["a0"] == pytest.approx(A0 + 2 / TAU, rel=1e-6)
    ok(api.patch(address, json={"temperature_c": 12}, headers={"If-Match": "*"}))
    second = result["provenance"]
    assert second["test"]["temperature_c"] == 30
    with session_client(api, base=service.url) as browser:
        jobs = [first["update_job"], second["update_job"]]
        page = browser.get("/ui/compare", params={"job": jobs}).text
        rows = [re.sub(r"<[^>]+>|\s", " ", row).split() for row in page.split("<tr>")]
        assert ["temperature", "–", "30", "°C"] in rows
        assert ["inputs", "thickness", "sd", "0.3000", "mm", "0", "mm"] in rows
        alone = browser.get("/ui/compare", params={"job": jobs[0]}).text
        assert f'name="job" value="{jobs[1]}"' in alone
    assert on_paper(api, f"/api/v1/update-jobs/{jobs[0]}", "FRP-beam")


def test_a_change_of_inputs_is_a_version(api: httpx.Client, structure: str) -> None:
    address = f"structures/{structure}"
    before = api.get(address)
    assert ok(before)["inputs"] is None
    patch = {"inputs": {"density_sd_kg_m3": 10.0}}
    after = ok(api.patch(address, json=patch, headers={"If-Match": before.headers["ETag"]}))
    assert (after["version"], after["inputs"]["density_sd_kg_m3"]) == (2, 10.0)


def test_a_clamp_that_is_none_is_shown_as_an_earlier_version_took_it_and_refused_by_its_update(
    api: httpx.Client, campaign: str, rows: Callable[..., list[dict[str, Any]]]
) -> None:
    rows(
        """UPDATE campaigns SET inputs = '{"clamp_compliance_sd": 100}' WHERE id = %s RETURNING id""",
        campaign,
    )
    assert ok(api.get(f"campaigns/{campaign}"))["inputs"]["clamp_compliance_sd"] == 100
    begun = api.post(
        f"campaigns/{campaign}/update-jobs", json={"mode_set": modes_under_a_window(api, campaign)}
    )
    job = finished(api, begun.headers["Location"])
    assert (job["status"], job["error"]["reason"]) == ("failed", "refused")
    assert (
        "expected at most 1: there the clamp turns as easily as the specimen bends"
        in job["message"]
    )


def test_what_a_sensor_of_unknown_mass_leaves_open_ends_at_the_prior(
    api: httpx.Client, campaign: str, imported: Callable[..., dict[str, Any]]
) -> None:
    """A sensor whose mass is known to within 1,000 t: no interval is wider than what was known
    before.
    """
    assert imported(campaign, paper.uff_file())["status"] == "succeeded"
    modes = posted(
        api, f"campaigns/{campaign}/mode-sets", {"name": "published", "modes": paper.MODES}
    )["id"]
    recipe = {
        "mode_set": modes,
        "inputs": {"sensor_mass_sd_kg": 1e6},
        "damping_models": ["rayleigh"],
    }
    job = finished(
        api, api.post(f"campaigns/{campaign}/update-jobs", json=recipe).headers["Location"]
    )
    assert job["status"] == "succeeded", job["error"]
    result = ok(api.get(f"update-jobs/{job['id']}/result"), 200)
    for row in result["parameters"]:
        if row["prior_sd"] is not None:
            relative = row["prior_sd"] / row["prior_mean"]  # priors are even in the logarithm
            # each input's pull is bounded by itself, so what clamp, sensor and the rest add
            # together may be a little more
            assert row["standard_deviation"] / row["estimate"] <= 1.3 * relative, row["name"]


@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf])
def test_no_column_of_the_database_takes_a_number_that_json_lacks(
    engine: Engine, number: float
) -> None:
    """Whichever kind of job stores it: of every table the columns that hold documents."""
    columns = [
        column
        for table in Base.metadata.tables.values()
        for column in table.columns
        if isinstance(column.type, JSON)
    ]
    assert {column.table.name for column in columns} >= {
        "update_results",
        "processings",
        "identifications",
        "mode_sets",
        "monitor_series",
        "monitor_runs",
    }
    for column in columns:
        with (
            pytest.raises(NotFinite, match="no finite number at /a/1;"),
            engine.connect() as connection,
        ):
            connection.execute(update(column.table).values({column: {"a": [1.0, float(number)]}}))


# --- updates over REST of what is no plain strip
# ------------------------------------------------------------------------

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


def test_a_stepped_strip_with_a_tip_mass_is_updated_as_it_stood(
    api: httpx.Client, project: str
) -> None:
    nominal = OrthotropicMaterial(30e9, 30e9, 5e9, 5e9, 5e9, 0.15, 2000.0)
    pieces, masses = (
        (Piece(0.0, 0.12, 0.008, 0.006),),
        (PointMass(0.4, 0.0, 0.05, 4e-6, weighed=True),),
    )
    truth = Specimen(
        0.4, 0.04, 0.005, replace(nominal, Ex=33e9), divisions=(24, 4), pieces=pieces, masses=masses
    )
    forward = ForwardModel(
        truth, parametrise(truth, (Parameter("Ex"),)), (), np.zeros((0, 2)), 4, reduced=False
    )
    hz = forward.solve(np.array([33e9])).frequency_hz[:3]
    described: dict[str, Any] = {
        "name": "stepped",
        "geometry": {"length_m": 0.4, "width_m": 0.04, "thickness_m": 0.005},
        "density_kg_m3": 2000,
        "material": {
            "Ex_Pa": 30e9,
            "Ey_Pa": 30e9,
            "Gxy_Pa": 5e9,
            "Gxz_Pa": 5e9,
            "Gyz_Pa": 5e9,
            "nu_xy": 0.15,
        },
        "pieces": [{"from_m": 0.0, "to_m": 0.12, "thickness_m": 0.008, "end_thickness_m": 0.006}],
        "inputs": {name: sd for name, sd in EXACT.items() if name != "ply_angle_sd_deg"},
    }
    structures = f"projects/{project}/structures"
    beyond = {**described, "pieces": [{"from_m": 0.3, "to_m": 0.5, "thickness_m": 0.008}]}
    assert "beyond the length" in ok(api.post(structures, json=beyond), 422)["errors"][0]["detail"]
    structure = ok(api.post(structures, json=described), 201)
    assert structure["pieces"] == described["pieces"]
    tip = {"x_m": 0.4, "y_m": 0.0, "z_m": 0.0, "mass_kg": 0.05, "rotary_inertia_kg_m2": 4e-6}
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
    mode_set = ok(
        api.post(f"campaigns/{campaign['id']}/mode-sets", json={"name": "typed", "modes": rows}),
        201,
    )["id"]
    recipe = {"mode_set": mode_set, "parameters": [{"name": "Ex"}]}
    jobs = f"campaigns/{campaign['id']}/update-jobs"
    assert (
        ok(api.post(jobs, json={**recipe, "zones_m": [0.5]}), 422)["errors"][0]["pointer"]
        == "/zones_m"
    )
    begun = api.post(jobs, json={**recipe, "zones_m": [0.2]})
    ok(begun, 202)
    assert finished(api, begun.headers["Location"])["status"] == "succeeded"
    result = result_of(api, begun.headers["Location"])
    # 0.5 %: the frequencies' noise is 0.01 %, the prior of the model's own error 0.2 % of a
    # frequency.
    assert result["parameters"][0]["estimate"] == pytest.approx(33e9, rel=0.005)
    # Without pieces the strip is of one thickness, in a new version.
    address = f"structures/{structure['id']}"
    seen = {"If-Match": api.get(address).headers["ETag"]}
    changed = ok(api.patch(address, json={"pieces": []}, headers=seen), 200)
    assert changed["version"] == 2
    assert not changed["pieces"]


# --- joint updates over HTTP
# --------------------------------------------------------------------------------------------

PLY_OF_STRIPS = {
    "E1_Pa": NOMINAL.Ex,
    "E2_Pa": NOMINAL.Ey,
    "G12_Pa": NOMINAL.Gxy,
    "G13_Pa": NOMINAL.Gxz,
    "G23_Pa": NOMINAL.Gyz,
    "nu_12": NOMINAL.nu_xy,
}


def stored(api: httpx.Client, project: str, test: Campaign) -> dict[str, Any]:
    """A structure, a campaign with its grid points and modes; the job of a joint update for it."""
    body, modes = test.body, test.modes
    angle = float(np.degrees(body.fibre_angle))
    structure = ok(
        api.post(
            f"projects/{project}/structures",
            json={
                "name": test.specimen,
                "geometry": {
                    "length_m": body.length,
                    "width_m": body.width,
                    "thickness_m": body.thickness,
                },
                "density_kg_m3": NOMINAL.density,
                "laminate": {
                    "plies": [{**PLY_OF_STRIPS, "thickness_m": body.thickness, "angle_deg": angle}]
                },
            },
        ),
        201,
    )["id"]
    campaign = ok(
        api.post(
            f"structures/{structure}/campaigns", json={"name": "tour", "boundary": body.boundary}
        ),
        201,
    )["id"]
    points = [
        {"label": label, "x_m": x, "y_m": y, "z_m": z} for label, (x, y, z) in test.points.items()
    ]
    ok(api.put(f"campaigns/{campaign}/grid-points", json={"items": points}))
    rows = mode_rows(modes, 3e-4)
    mode_set = ok(
        api.post(f"campaigns/{campaign}/mode-sets", json={"name": "measured", "modes": rows}), 201
    )["id"]
    return {"campaign_id": campaign, "recipe": {"mode_set": mode_set}}


@pytest.mark.long
def test_an_update_from_nine_modes_has_its_report_on_paper(api: httpx.Client, project: str) -> None:
    """All nine pairs of shapes in one figure are higher than a page. In short the report of typed
    modes above, and pages of figures in `tests/unit/service/test_figures.py`.
    """
    strip = measured(np.random.default_rng(3), "strip 0", STRIP, 0.0)
    job = stored(api, project, strip)
    begun = api.post(f"campaigns/{job['campaign_id']}/update-jobs", json=job["recipe"])
    assert finished(api, begun.headers["Location"])["status"] == "succeeded"
    assert len(result_of(api, begun.headers["Location"])["modes"]) == 9
    more = on_paper(api, begun.headers["Location"], "strip-0")
    assert 5 <= len(more) < 15
    words = " ".join(" ".join(more).split())
    for numbers in ("1 to 5", "6 to 9"):
        assert f"Mode shapes, measured and updated: modes {numbers}" in words


def on_paper(api: httpx.Client, address: str, name: str) -> list[str]:
    """Texts of the pages of an update's report as PDF but for the first, which has what matters."""
    printed = api.get(f"{api.base_url.join(address)}/report", params={"format": "pdf"})
    assert (printed.status_code, printed.content[:4]) == (200, b"%PDF"), printed.text
    assert printed.headers["content-type"] == "application/pdf"
    assert printed.headers["content-disposition"].startswith(f'inline; filename="report-{name}-')
    assert b"<pdfaid:part>2" in printed.content  # PDF/A
    first, *more = (page.extract_text() for page in PdfReader(io.BytesIO(printed.content)).pages)
    assert {"Verdict", "Parameters", "Correlation"} <= set(first.split())
    return more


def test_a_joint_update_without_frfs_says_whose_are_missing(
    api: httpx.Client, campaign: str, new_campaign: Callable[..., str], service: LocalService
) -> None:
    one, two = {"campaign_id": campaign}, {"campaign_id": new_campaign(name="second")}
    begun = api.post("update-jobs", json={"joint": True, "jobs": [one, two]})
    ok(begun, 202)
    ended = finished(api, begun.headers["Location"])
    assert ended["status"] == "failed"
    assert "has no FRFs" in str(ended["error"])
    for path in ("/result", "/figures/campaigns"):
        ok(api.get(api.base_url.join(begun.headers["Location"] + path)), 409)
    listed = ok(api.get(api.base_url.join(begun.headers["Location"] + "/figures")), 200)["items"]
    assert {row["available"] for row in listed} == {False}
    assert all("has no FRFs" in row["reason"] for row in listed)
    with session_client(api, base=service.url) as browser:
        page = browser.get(f"/ui/joint-updates/{ended['id']}")
    assert page.status_code == 200
    assert "data-job" not in page.text  # nothing more is to come
    assert "has no FRFs" in page.text
