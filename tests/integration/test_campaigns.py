"""Campaigns and their grid points over HTTP."""

from collections.abc import Callable
from typing import Any

import httpx
import pytest

from tests.support.rest import pointers

Checked = Callable[[httpx.Response, int], Any]

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
        "sensor_mass_kg": 0.0048,
        "sensor_point": 30,
        "added_masses": [{"x_m": 0.4, "y_m": 0.01, "mass_kg": 0.05, "rotary_inertia_kg_m2": 4e-6}],
    },
    "frame": {"origin_m": [0.1, 0.0, 0.0], "x_axis": [0.0, 1.0, 0.0], "y_axis": [-1.0, 0.0, 0.0]},
    "notes": "tip mass removed",
}
POINTS = [
    {"label": 1, "x_m": 0.1, "y_m": -0.02, "z_m": 0.005},
    {"label": 7, "x_m": 0.2, "y_m": 0.02, "z_m": 0.005},
]


def test_a_campaign_is_stored_as_it_was_sent(api: httpx.Client, structure: str, checked: Checked) -> None:
    created = api.post(f"structures/{structure}/campaigns", json=FULL)
    body = checked(created, 201)
    assert {key: body[key] for key in FULL} == FULL
    assert checked(api.get(api.base_url.join(created.headers["Location"])), 200) == body


def test_name_and_boundary_are_enough(api: httpx.Client, structure: str, checked: Checked) -> None:
    body = checked(api.post(f"structures/{structure}/campaigns", json={"name": "x", "boundary": "free"}), 201)
    assert body["frame"] == {"origin_m": [0, 0, 0], "x_axis": [1, 0, 0], "y_axis": [0, 1, 0]}
    assert body["instruments"]["sensor_mass_kg"] is None
    assert body["performed_at"] is None


def test_a_patch_changes_what_it_names(api: httpx.Client, campaign: str, checked: Checked) -> None:
    before = api.get(f"campaigns/{campaign}")
    etag = {"If-Match": before.headers["ETag"]}
    change = {"temperature_c": 19.0, "frame": FULL["frame"], "instruments": FULL["instruments"]}
    after = checked(api.patch(f"campaigns/{campaign}", json=change, headers=etag), 200)
    assert after == {**before.json(), **change, "updated_at": after["updated_at"]}
    checked(api.patch(f"campaigns/{campaign}", json={"name": "late"}, headers=etag), 412)
    checked(api.patch(f"campaigns/{campaign}", json={"name": "late"}), 428)
    newer = {"If-Match": api.get(f"campaigns/{campaign}").headers["ETag"]}
    cleared = checked(api.patch(f"campaigns/{campaign}", json={"temperature_c": None}, headers=newer), 200)
    recorded = checked(api.get("audit-events"), 200)["items"][0]
    assert recorded["detail"] == {"was": {"temperature_c": 19.0}, "now": {"temperature_c": None}}
    assert cleared["temperature_c"] is None


def test_a_deleted_campaign_is_gone_until_it_is_restored(
    api: httpx.Client, structure: str, campaign: str, checked: Checked
) -> None:
    typed = {"name": "typed", "modes": [{"frequency_hz": 25.0}]}
    mode_set = checked(api.post(f"campaigns/{campaign}/mode-sets", json=typed), 201)["id"]
    checked(api.post(f"campaigns/{campaign}/restore"), 409)
    checked(api.delete(f"campaigns/{campaign}"), 204)
    for path in (f"campaigns/{campaign}", f"campaigns/{campaign}/frfs", f"mode-sets/{mode_set}"):
        checked(api.get(path), 404)
    checked(api.delete(f"campaigns/{campaign}"), 404)
    checked(api.post(f"campaigns/{campaign}/imports", content=b"x"), 404)
    assert checked(api.get(f"structures/{structure}/campaigns"), 200)["items"] == []
    deleted = checked(api.get(f"structures/{structure}/campaigns", params={"deleted": "true"}), 200)["items"]
    assert [c["id"] for c in deleted] == [campaign]
    assert checked(api.post(f"campaigns/{campaign}/restore"), 200)["deleted_at"] is None
    checked(api.get(f"mode-sets/{mode_set}"), 200)


def test_grid_points_go_in_and_out_as_json_and_csv(api: httpx.Client, campaign: str, checked: Checked) -> None:
    path = f"campaigns/{campaign}/grid-points"
    assert checked(api.get(path), 200) == {"items": []}
    stored = api.put(path, json={"items": POINTS[::-1]})
    assert checked(stored, 200) == {"items": POINTS}
    text = api.get(path, headers={"Accept": "text/csv"})
    assert text.headers["content-type"].startswith("text/csv")
    assert text.text == "label,x_m,y_m,z_m\r\n1,0.1,-0.02,0.005\r\n7,0.2,0.02,0.005\r\n"
    assert api.get(path, params={"format": "csv"}).text == text.text
    csv = {"Content-Type": "text/csv; charset=utf-8"}
    assert checked(api.put(path, content=text.content, headers=csv), 200) == {"items": POINTS}
    assert checked(api.put(path, json={"items": []}, headers={"If-Match": "*"}), 200) == {"items": []}
    checked(api.get(path, headers={"Accept": "image/png"}), 406)
    checked(api.get(path, params={"format": "xlsx"}), 422)


def test_grid_points_are_not_overwritten_unseen(api: httpx.Client, campaign: str, checked: Checked) -> None:
    path = f"campaigns/{campaign}/grid-points"
    checked(api.put(path, json={"items": POINTS}), 200)
    checked(api.put(path, json={"items": POINTS}), 200)
    checked(api.put(path, json={"items": POINTS[:1]}), 428)
    etag = api.get(path).headers["ETag"]
    checked(api.put(path, json={"items": POINTS[:1]}, headers={"If-Match": etag}), 200)
    checked(api.put(path, json={"items": POINTS}, headers={"If-Match": etag}), 412)
    assert checked(api.get(path), 200) == {"items": POINTS[:1]}


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("", "line 1"),
        ("label;x_m;y_m\n1;0,1;0\n", "line 1"),
        ("label,x_m\n1,0\n", "line 1"),
        ("label,x_m,y_m,z_m\n1,0,0\n", "line 2"),
        ("label,x_m,y_m,z_m\n1,0,0,0\n\n2,0,zero,0\n", "line 4, y_m"),
        ("label,x_m,y_m,z_m\n1,0,nan,0\n", "line 2, y_m"),
        ("label,x_m,y_m,z_m\n0,0,0,0\n", "line 2, label"),
        ("label,x_m,y_m,z_m\n1,0,0,0\n1,1,0,0\n", "point 1 is there twice"),
        ('label,x_m,y_m,z_m\n"1,0,0,0\n', "CSV"),
        (b"label,x_m,y_m\n1,\xff,0\n", "UTF-8"),
    ],
)
def test_a_broken_table_of_points_is_refused_with_its_line(
    api: httpx.Client, campaign: str, checked: Checked, content: str | bytes, says: str
) -> None:
    path = f"campaigns/{campaign}/grid-points"
    problem = checked(api.put(path, content=content, headers={"Content-Type": "text/csv"}), 422)
    assert says in str(problem["errors"])
    assert checked(api.get(path), 200) == {"items": []}


@pytest.mark.parametrize(
    ("body", "pointer"),
    [
        ('{"items": [{"label": 1, "x_m": NaN, "y_m": 0}]}', "/items/0/x_m"),
        ('{"items": [{"label": 1.5, "x_m": 0, "y_m": 0}]}', "/items/0/label"),
        ('{"items": [{"label": 1, "x_m": 0, "y_m": 0}, {"label": 1, "x_m": 0, "y_m": 0}]}', "/items"),
        ('{"points": []}', "/items"),
        ("[", ""),
    ],
)
def test_broken_json_points_are_refused_with_their_pointer(
    api: httpx.Client, campaign: str, checked: Checked, body: str, pointer: str
) -> None:
    json = {"Content-Type": "application/json"}
    problem = checked(api.put(f"campaigns/{campaign}/grid-points", content=body, headers=json), 422)
    assert pointer in pointers(problem)


def test_points_of_another_media_type_are_refused(api: httpx.Client, campaign: str, checked: Checked) -> None:
    answer = api.put(f"campaigns/{campaign}/grid-points", content=b"x", headers={"Content-Type": "text/html"})
    checked(answer, 415)


@pytest.mark.parametrize("collection", ["grid-points", "frfs", "mode-sets"])
def test_a_pointer_escapes_slashes_and_tildes(
    api: httpx.Client, campaign: str, checked: Checked, collection: str
) -> None:
    """RFC 6901: whoever follows the pointer comes to the field that is wrong, whatever it is called."""
    send = api.put if collection == "grid-points" else api.post
    problem = checked(send(f"campaigns/{campaign}/{collection}", json={"a/b": 1, "~c": 2}), 422)
    assert {"/a~1b", "/~0c"} <= pointers(problem)
