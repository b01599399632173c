"""Forecasts over HTTP: a structure is solved before it is measured, and says where to hit."""

import io
from typing import Any

import httpx
import numpy as np
import pytest

from modalbase.formats.uff import Element, Frf, GridPoint, ModeShape
from tests.integration.test_bodies import uff_contents
from tests.integration.test_models import sent
from tests.support.profiles import ANGLE, deck, points
from tests.support.rest import finished, ok

STRIP: dict[str, Any] = {
    "name": "strip",
    "geometry": {"length_m": 0.5, "width_m": 0.04, "thickness_m": 0.01},
    "density_kg_m3": 1850,
    "material": {
        "Ex_Pa": 3e10,
        "Ey_Pa": 9e9,
        "Gxy_Pa": 3e9,
        "Gxz_Pa": 3e9,
        "Gyz_Pa": 3e9,
        "nu_xy": 0.3,
    },
}


@pytest.fixture
def strip(api: httpx.Client, project: str) -> str:
    return str(ok(api.post(f"projects/{project}/structures", json=STRIP), 201)["id"])


def forecast(api: httpx.Client, structure: str, **order: Any) -> dict[str, Any]:
    """A forecast after its end."""
    queued = api.post(f"structures/{structure}/forecasts", json=order)
    ok(queued, 202)
    return finished(api, queued.headers["Location"])


def test_a_strip_says_its_modes_and_where_to_hit_it(api: httpx.Client, strip: str) -> None:
    done = forecast(
        api, strip, modes=4, damping_ratio=0.01, line_spacing_hz=0.5, points_to_measure=6
    )
    assert done["status"] == "succeeded", done["message"]
    prediction = done["found"]
    # An Euler-Bernoulli cantilever; shear lowers the second mode by half a per cent.
    euler = (
        np.array([1.875104, 4.694091]) ** 2
        / (2 * np.pi * 0.5**2)
        * np.sqrt(3e10 * 0.01**2 / 12 / 1850)
    )
    bending = [
        mode["frequency_hz"] for mode in prediction["model_modes"] if mode["kind"] == "bending"
    ]
    np.testing.assert_allclose(bending[:2], euler, rtol=0.01)
    assert (len(prediction["model_modes"]), prediction["rigid_modes"]) == (4, 0)
    (reference,) = [point for point in prediction["points"] if point["reference"]]
    assert (reference["x_m"], abs(reference["y_m"])) == (0.5, 0.02)  # the corner moves in all modes
    assert f"at point {reference['label']} along z shows mode" in prediction["sentence"]
    assert sum(point["measured"] for point in prediction["points"]) == prediction["frfs"] == 6
    listed = ok(api.get(f"structures/{strip}/forecasts"), 200)["items"]
    assert [each["id"] for each in listed] == [done["id"]]
    address = f"forecasts/{done['id']}"
    contents = uff_contents(api.get(f"{address}/frfs/data", params={"format": "uff"}).content)
    frfs = [each for each in contents if isinstance(each, Frf)]
    assert {each.number for each in contents if isinstance(each, GridPoint)} == {
        p["label"] for p in prediction["points"]
    }
    assert {(each.reference_point, each.reference_direction) for each in frfs} == {
        (reference["label"], 3)
    }
    hz, driving = frfs[0].frequency.points(), max(frfs, key=lambda each: np.abs(each.values).max())
    first = hz < bending[1] / 2
    assert hz[first][np.argmax(np.abs(driving.values[first]))] == pytest.approx(bending[0], abs=0.5)
    with np.load(
        io.BytesIO(api.get(f"{address}/frfs/data", params={"format": "npz"}).content)
    ) as arrays:
        assert arrays["values"].shape == (6, len(hz))


def test_a_deck_is_solved_with_its_own_supports_and_numbers(
    api: httpx.Client, project: str
) -> None:
    structure = ok(api.post(f"projects/{project}/structures", json={"name": "bracket"}), 201)["id"]
    assert sent(api, structure, deck(), units="m-N-kg")["status"] == "succeeded"
    held = forecast(api, structure, modes=5, boundary="as_modelled")
    assert held["found"]["rigid_modes"] == 0
    assert {point["direction"] for point in held["found"]["points"]} <= {2, 3}
    assert "no FRFs" in ok(api.get(f"forecasts/{held['id']}/frfs/data"), 409)["detail"]
    address = f"forecasts/{held['id']}/mesh"
    mesh, nodes = (
        ok(api.get(address), 200),
        ok(api.get(f"structures/{structure}/model/mesh"), 200)["nodes"],
    )
    assert (mesh["measured"], [mode["number"] for mode in mesh["model"]]) == ([], [1, 2, 3, 4, 5])
    assert mesh["nodes"]["x_m"] == pytest.approx(nodes["x_m"])
    for point in mesh["points"]:
        assert nodes["y_m"][nodes["numbers"].index(point["label"])] == pytest.approx(point["y_m"])
    shape = ok(api.get(f"{address}/shapes", params={"model": 1}), 200)
    moved = np.array(shape["nodes"]["real"]).reshape(-1, 3)
    assert np.linalg.norm(moved, axis=1).max() == pytest.approx(1, abs=1e-4)
    clamped = np.isclose(nodes["x_m"], 0)
    assert np.abs(moved[clamped]).max() == 0
    assert ok(api.get(f"{address}/shapes", params={"model": 6}), 404)
    contents = uff_contents(api.get(address, params={"format": "uff"}).content)
    assert {each.number for each in contents if isinstance(each, GridPoint)} == set(
        nodes["numbers"]
    )
    assert sum(isinstance(each, Element) for each in contents) == 140
    shapes = [each for each in contents if isinstance(each, ModeShape)]
    assert [each.frequency_hz for each in shapes] == pytest.approx(
        [mode["frequency_hz"] for mode in held["found"]["model_modes"]], rel=1e-5
    )
    vtu = api.get(address, params={"format": "vtu", "at": "points"})
    assert vtu.content.count(b'Name="model mode ') == 5


def test_points_are_chosen_among_those_that_are_stated(api: httpx.Client, project: str) -> None:
    structure = ok(api.post(f"projects/{project}/structures", json=ANGLE), 201)["id"]
    own = [{"label": 100 + n, "x_m": x, "y_m": y, "z_m": z} for n, (x, y, z) in points().items()]
    own[0]["direction"] = 1
    done = forecast(
        api,
        structure,
        boundary="free",
        highest_hz=420,
        points=own,
        points_to_measure=14,
        references=2,
    )
    assert done["status"] == "succeeded", done["message"]
    chosen = {point["label"]: point for point in done["found"]["points"]}
    assert set(chosen) == {each["label"] for each in own}
    assert chosen[101]["direction"] == 1
    # of the flange, and of the web
    assert (chosen[103]["direction"], chosen[102]["direction"]) == (3, 2)
    assert sum(point["reference"] for point in chosen.values()) == 2
    assert max(mode["frequency_hz"] for mode in done["found"]["model_modes"]) < 420
    assert {mode["kind"] for mode in done["found"]["model_modes"]} & {
        "torsion",
        "walls",
        "bending y",
        "bending z",
    }


def test_what_cannot_be_forecast_is_said(api: httpx.Client, project: str, strip: str) -> None:
    low = forecast(api, strip, highest_hz=5)
    assert low["status"] == "failed"
    assert "the first is at" in low["message"]
    off = forecast(api, strip, points=[{"label": 7, "x_m": 2.0, "y_m": 0.0}])
    assert "mm off the specimen" in off["message"]
    bare = ok(api.post(f"projects/{project}/structures", json={"name": "bare"}), 201)["id"]
    assert (
        "states no geometry" in ok(api.post(f"structures/{bare}/forecasts", json={}), 422)["detail"]
    )
    held = forecast(api, strip, boundary="as_modelled")
    assert "boundary is 'as_modelled', expected one of cantilever" in held["message"].replace(
        ":", ""
    )
    twice = {"points": [{"label": 7, "x_m": 0.1, "y_m": 0.0}] * 2}
    assert (
        "is there twice" in ok(api.post(f"structures/{strip}/forecasts", json=twice), 422)["detail"]
    )


def test_a_forecast_can_be_cancelled(api: httpx.Client, strip: str) -> None:
    queued = api.post(f"structures/{strip}/forecasts", json={"highest_hz": 20_000})
    job = ok(queued, 202)
    cancelled = ok(api.post(f"forecasts/{job['id']}/cancel"), 202)
    assert cancelled["id"] == job["id"]
    assert finished(api, queued.headers["Location"])["status"] == "cancelled"
    assert ok(api.get(f"forecasts/{job['id']}/mesh"), 409)
