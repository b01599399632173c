"""Campaigns, their grid points and mode sets over HTTP."""

from collections.abc import Callable
from typing import Any
from uuid import UUID

import httpx
import numpy as np
import pytest

from fecore.frf import Dof
from service.app.supervisor import LocalService
from service.nouns.modes.operations import load_modes
from service.platform.db.engine import make_engine, make_sessions
from tests.support.rest import ok

FULL: dict[str, Any] = {
    "name": "March, cantilever",
    "boundary": "cantilever",
    "performed_at": "2026-03-02T09:30:00Z",
    "temperature_c": 21.5,
    "humidity_percent": 45.0,
    "instruments": {
        "hammer": {"model": "8206-002", "sensitivity": {"value": 22.7, "unit": "mV/N"}},
        "sensor": {"model": "4507"},
        "analyser": {},
        "sensors": [{"model": "352C65", "serial": "4711", "points": [1, 30]}],
        "sensor_mass_kg": 0.0048,
        "sensor_point": 30,
        "added_masses": [
            {"x_m": 0.4, "y_m": 0.01, "z_m": 0.0, "mass_kg": 0.05, "rotary_inertia_kg_m2": 4e-6}
        ],
    },
    "frame": {"origin_m": [0.1, 0.0, 0.0], "x_axis": [0.0, 1.0, 0.0], "y_axis": [-1.0, 0.0, 0.0]},
    "notes": "tip mass removed",
}
POINTS = [
    {"label": 1, "x_m": 0.1, "y_m": -0.02, "z_m": 0.005},
    {"label": 7, "x_m": 0.2, "y_m": 0.02, "z_m": 0.005},
]


def test_a_campaign_is_stored_as_it_was_sent(api: httpx.Client, structure: str) -> None:
    created = api.post(f"structures/{structure}/campaigns", json=FULL)
    body = ok(created, 201)
    assert {key: body[key] for key in FULL} == FULL
    assert ok(api.get(api.base_url.join(created.headers["Location"])), 200) == body


def test_name_and_boundary_are_enough(api: httpx.Client, structure: str) -> None:
    body = ok(
        api.post(f"structures/{structure}/campaigns", json={"name": "x", "boundary": "free"}), 201
    )
    assert body["frame"] == {"origin_m": [0, 0, 0], "x_axis": [1, 0, 0], "y_axis": [0, 1, 0]}
    assert body["instruments"]["sensor_mass_kg"] is None
    assert body["performed_at"] is None


def test_a_patch_changes_what_it_names(api: httpx.Client, campaign: str) -> None:
    before = api.get(f"campaigns/{campaign}")
    etag = {"If-Match": before.headers["ETag"]}
    change = {"temperature_c": 19.0, "frame": FULL["frame"], "instruments": FULL["instruments"]}
    after = ok(api.patch(f"campaigns/{campaign}", json=change, headers=etag), 200)
    assert after == {**before.json(), **change, "updated_at": after["updated_at"]}
    ok(api.patch(f"campaigns/{campaign}", json={"name": "late"}, headers=etag), 412)
    ok(api.patch(f"campaigns/{campaign}", json={"name": "late"}), 428)
    newer = {"If-Match": api.get(f"campaigns/{campaign}").headers["ETag"]}
    cleared = ok(
        api.patch(f"campaigns/{campaign}", json={"temperature_c": None}, headers=newer), 200
    )
    recorded = ok(api.get("audit-events"), 200)["items"][0]
    assert recorded["detail"] == {"was": {"temperature_c": 19.0}, "now": {"temperature_c": None}}
    assert cleared["temperature_c"] is None


def test_a_deleted_campaign_is_gone_until_it_is_restored(
    api: httpx.Client, structure: str, campaign: str
) -> None:
    typed = {"name": "typed", "modes": [{"frequency_hz": 25.0}]}
    mode_set = ok(api.post(f"campaigns/{campaign}/mode-sets", json=typed), 201)["id"]
    ok(api.post(f"campaigns/{campaign}/restore"), 409)
    ok(api.delete(f"campaigns/{campaign}"), 204)
    for path in (f"campaigns/{campaign}", f"campaigns/{campaign}/frfs", f"mode-sets/{mode_set}"):
        ok(api.get(path), 404)
    ok(api.delete(f"campaigns/{campaign}"), 404)
    ok(api.post(f"campaigns/{campaign}/imports", content=b"x"), 404)
    assert ok(api.get(f"structures/{structure}/campaigns"), 200)["items"] == []
    deleted = ok(api.get(f"structures/{structure}/campaigns", params={"deleted": "true"}), 200)[
        "items"
    ]
    assert [c["id"] for c in deleted] == [campaign]
    assert ok(api.post(f"campaigns/{campaign}/restore"), 200)["deleted_at"] is None
    ok(api.get(f"mode-sets/{mode_set}"), 200)


def test_grid_points_go_in_and_out_as_json_and_csv(api: httpx.Client, campaign: str) -> None:
    path = f"campaigns/{campaign}/grid-points"
    assert ok(api.get(path), 200) == {"items": []}
    stored = api.put(path, json={"items": POINTS[::-1]})
    assert ok(stored, 200) == {"items": POINTS}
    text = api.get(path, headers={"Accept": "text/csv"})
    assert text.headers["content-type"].startswith("text/csv")
    assert text.text == "label,x_m,y_m,z_m\r\n1,0.1,-0.02,0.005\r\n7,0.2,0.02,0.005\r\n"
    assert api.get(path, params={"format": "csv"}).text == text.text
    csv = {"Content-Type": "text/csv; charset=utf-8"}
    assert ok(api.put(path, content=text.content, headers=csv), 200) == {"items": POINTS}
    german = "Punkte\n\npoint;x;y;z\n;mm;mm;m\n1;100,0;-20,0;0,005\n7;200,0;20,0;0,005\n"
    assert ok(api.put(path, content=german.encode(), headers=csv), 200) == {"items": POINTS}
    assert ok(api.put(path, json={"items": []}, headers={"If-Match": "*"}), 200) == {"items": []}
    ok(api.get(path, headers={"Accept": "image/png"}), 406)
    ok(api.get(path, params={"format": "xlsx"}), 422)


def test_grid_points_are_not_overwritten_unseen(api: httpx.Client, campaign: str) -> None:
    path = f"campaigns/{campaign}/grid-points"
    ok(api.put(path, json={"items": POINTS}), 200)
    ok(api.put(path, json={"items": POINTS}), 200)
    ok(api.put(path, json={"items": POINTS[:1]}), 428)
    etag = api.get(path).headers["ETag"]
    ok(api.put(path, json={"items": POINTS[:1]}, headers={"If-Match": etag}), 200)
    ok(api.put(path, json={"items": POINTS}, headers={"If-Match": etag}), 412)
    assert ok(api.get(path), 200) == {"items": POINTS[:1]}


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("", "line 1"),
        ("label,x,y_m\n1,0,0\n", "the header"),
        ("label,x_m\n1,0\n", "line 1"),
        ("label,x_m,y_m,z_m\n1,0,0\n", "line 2"),
        ("label,x_m,y_m,z_m\n1,0,0,0\n\n2,0,zero,0\n", "line 4, y_m"),
        ("label,x_m,y_m,z_m\n1,0,nan,0\n", "line 2, y_m"),
        ("label,x_m,y_m,z_m\n0,0,0,0\n", "line 2, label"),
        ("label,x_m,y_m,z_m\n1,0,0,0\n1,1,0,0\n", "point 1 is there twice"),
        ('label,x_m,y_m,z_m\n"1,0,0,0\n', "line 2"),
        (b"label,x_m,y_m\n1,\xff,0\n", "line 2, x_m"),
    ],
)
def test_a_broken_table_of_points_is_refused_with_its_line(
    api: httpx.Client, campaign: str, content: str | bytes, says: str
) -> None:
    path = f"campaigns/{campaign}/grid-points"
    problem = ok(api.put(path, content=content, headers={"Content-Type": "text/csv"}), 422)
    assert says in str(problem["errors"])
    assert ok(api.get(path), 200) == {"items": []}


def test_points_of_another_media_type_are_refused(api: httpx.Client, campaign: str) -> None:
    answer = api.put(
        f"campaigns/{campaign}/grid-points", content=b"x", headers={"Content-Type": "text/html"}
    )
    ok(answer, 415)


# --- mode sets over HTTP
# ------------------------------------------------------------------------------------------------

SHAPE = [
    {"point": 1, "direction": 3, "real": 1.0, "imag": 0.5},
    {"point": 2, "direction": -3, "real": -0.25, "imag": 0.0},
]


def test_modes_are_stored_by_frequency(api: httpx.Client, campaign: str) -> None:
    modes = [
        {"frequency_hz": 160.06, "damping_ratio": 0.0284, "shape": SHAPE},
        {"frequency_hz": 25.63},
    ]
    created = api.post(f"campaigns/{campaign}/mode-sets", json={"name": "paper", "modes": modes})
    body = ok(created, 201)
    assert body["origin"] == "typed"
    assert [(m["number"], m["frequency_hz"], m["damping_ratio"]) for m in body["modes"]] == [
        (1, 25.63, None),
        (2, 160.06, 0.0284),
    ]
    assert [m["shape"] for m in body["modes"]] == [None, SHAPE]
    assert ok(api.get(api.base_url.join(created.headers["Location"])), 200) == body
    assert ok(api.get(f"campaigns/{campaign}/mode-sets"), 200)["items"] == [body]


def test_the_core_gets_modes_with_shared_dofs_and_covariance(
    api: httpx.Client, service: LocalService, campaign: str
) -> None:
    sd = {"frequency_sd_hz": 0.1, "damping_sd": 0.002}
    zero_x = {"point": 1, "direction": 1, "real": 0.0, "imag": 0.0}
    third = {"point": 3, "direction": 3, "real": 1.0, "imag": 0.0}
    modes = [
        {"frequency_hz": 160.0, "damping_ratio": 0.03, **sd, "shape": [*SHAPE, zero_x]},
        {"frequency_hz": 25.0, "damping_ratio": 0.1, **sd, "shape": [*SHAPE[::-1], zero_x, third]},
    ]
    made = ok(api.post(f"campaigns/{campaign}/mode-sets", json={"name": "x", "modes": modes}), 201)
    engine = make_engine(service.settings.database_url)
    with make_sessions(engine)() as session:
        measured = load_modes(session, UUID(made["id"]))
    engine.dispose()
    np.testing.assert_array_equal(measured.frequency_hz, [25.0, 160.0])
    assert measured.dofs == (Dof(1, 3), Dof(2, 3))
    np.testing.assert_array_equal(measured.shapes, [[1 + 0.5j, 0.25], [1 + 0.5j, 0.25]])
    np.testing.assert_allclose(np.diag(measured.covariance), [0.01, 0.01, 4e-6, 4e-6], rtol=1e-14)


def test_a_mode_set_goes_out_as_set_55_and_comes_back(
    api: httpx.Client, new_campaign: Callable[..., str], imported: Callable[..., dict[str, Any]]
) -> None:
    points = {"items": [{"label": n, "x_m": 0.1 * n, "y_m": 0, "z_m": 0} for n in (1, 2)]}
    shapes = [[(1, 3, 1.0, 0.0), (2, -3, 0.25, 0.0)], [(1, 3, 0.5, -0.125), (2, 3, -1.0, 0.0)]]
    modes = [
        {
            "frequency_hz": f,
            "damping_ratio": z,
            "shape": [
                dict(zip(("point", "direction", "real", "imag"), v, strict=True)) for v in shape
            ],
        }
        for f, z, shape in zip((12.5, 80.0), (0.015625, 0.03125), shapes, strict=True)
    ]
    first, second = new_campaign(), new_campaign()
    ok(api.put(f"campaigns/{first}/grid-points", json=points), 200)
    made = ok(api.post(f"campaigns/{first}/mode-sets", json={"name": "hand", "modes": modes}), 201)
    file = api.get(f"mode-sets/{made['id']}", params={"format": "uff"}).raise_for_status()
    assert file.headers["content-type"].startswith("text/x-uff")
    assert imported(second, file.content)["counts"] == {
        "frfs": 0,
        "grid_points": 2,
        "modes": 2,
        "records": 0,
        "recordings": 0,
    }
    (back,) = ok(api.get(f"campaigns/{second}/mode-sets"), 200)["items"]
    for sent, got in zip(modes, back["modes"], strict=True):
        # a complex mode travels as its eigenvalue, in columns of 12 characters
        assert got["frequency_hz"] == pytest.approx(sent["frequency_hz"], rel=1e-6)
        assert got["damping_ratio"] == pytest.approx(sent["damping_ratio"], rel=1e-5)
        there = {(v["point"], v["direction"]): complex(v["real"], v["imag"]) for v in got["shape"]}
        for v in sent["shape"]:
            sign = 1 if v["direction"] > 0 else -1
            assert there[v["point"], 3] == sign * complex(v["real"], v["imag"])


def test_modes_without_shapes_cannot_be_a_set_55(api: httpx.Client, campaign: str) -> None:
    body = {"name": "x", "modes": [{"frequency_hz": 10}]}
    made = ok(api.post(f"campaigns/{campaign}/mode-sets", json=body), 201)
    problem = ok(api.get(f"mode-sets/{made['id']}", params={"format": "uff"}), 409)
    assert "mode 1 has no shape" in problem["detail"]
    ok(api.get(f"mode-sets/{made['id']}", params={"format": "npz"}), 422)


def test_poles_kept_and_dropped_by_hand_are_a_new_set_that_says_who_and_why(
    api: httpx.Client, campaign: str
) -> None:
    modes = [
        {"frequency_hz": hz, "damping_ratio": 0.01, "frequency_sd_hz": 0.01, "shape": SHAPE}
        for hz in (25.63, 50.0, 160.06)
    ]
    first = ok(
        api.post(f"campaigns/{campaign}/mode-sets", json={"name": "typed", "modes": modes}), 201
    )
    decisions = [{"frequency_hz": 50.0, "keep": False, "reason": "hum of the mains"}]
    edit = {"name": "checked", "decisions": decisions}
    created = api.post(f"mode-sets/{first['id']}/edits", json=edit)
    edited = ok(created, 201)
    assert edited["origin"] == "edited"
    assert [(mode["number"], mode["frequency_hz"]) for mode in edited["modes"]] == [
        (1, 25.63),
        (2, 160.06),
    ]
    assert edited["modes"][1]["shape"] == SHAPE
    assert edited["details"]["edited_from"] == first["id"]
    [decision] = edited["details"]["decisions"]
    assert (decision["frequency_hz"], decision["keep"], decision["reason"]) == (
        50.0,
        False,
        "hum of the mains",
    )
    assert decision["by"]
    assert decision["at"]
    assert ok(api.get(f"mode-sets/{first['id']}"), 200) == first
    assert edited["details"]["dropped"] == [
        {
            "frequency_hz": 50.0,
            "damping_ratio": 0.01,
            "frequency_sd_hz": 0.01,
            "damping_sd": None,
            "reason": "hum of the mains",
        }
    ]
    back = [
        {"frequency_hz": 50.0, "keep": True, "reason": "it moves with the mass"},
        {"frequency_hz": 25.63, "keep": False, "reason": "of the supports"},
    ]
    again = ok(
        api.post(f"mode-sets/{edited['id']}/edits", json={"name": "again", "decisions": back}), 201
    )
    assert [mode["frequency_hz"] for mode in again["modes"]] == [50.0, 160.06]
    compared = ("frequency_hz", "damping_ratio", "frequency_sd_hz", "shape")
    assert all(again["modes"][0][part] == first["modes"][1][part] for part in compared)
    assert [pole["frequency_hz"] for pole in again["details"]["dropped"]] == [25.63]
    assert [each["keep"] for each in again["details"]["decisions"]] == [False, True, False]
    assert again["details"]["edited_from"] == edited["id"]
    nowhere = {"name": "x", "decisions": [{"frequency_hz": 99.0, "keep": False, "reason": "none"}]}
    refused = ok(api.post(f"mode-sets/{first['id']}/edits", json=nowhere), 422)
    assert "no pole of the set is there; it has 25.63, 50, 160.06 Hz" in str(refused)
    assert refused["errors"][0]["pointer"] == "/decisions/0/frequency_hz"
    twice = edit | {
        "decisions": [*decisions, {"frequency_hz": 50.0, "keep": True, "reason": "a mode"}]
    }
    refused = ok(api.post(f"mode-sets/{first['id']}/edits", json=twice), 422)
    assert refused["errors"] == [
        {"pointer": "/decisions/1", "detail": "is a second one on 50 Hz; expected one"}
    ]
    none = [{"frequency_hz": hz, "keep": False, "reason": "noise"} for hz in (25.63, 50.0, 160.06)]
    assert "keep at least one" in str(
        ok(api.post(f"mode-sets/{first['id']}/edits", json=edit | {"decisions": none}), 422)
    )
