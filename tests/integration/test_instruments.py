"""Instruments with a calibration history: campaigns name them, and a search lists what an expired
calibration touched.
"""

from typing import Any

import httpx
import pytest

from tests.support.furnished import frfs, record
from tests.support.laboratory import BEAM
from tests.support.rest import ok, pointers

HISTORY = [
    {
        "performed_on": "2026-02-01",
        "valid_until": "2027-01-31",
        "sensitivity": 10.1,
        "unit": "mV/g",
    },
    {"performed_on": "2024-02-01", "valid_until": "2025-01-31"},
]


@pytest.fixture
def tested(api: httpx.Client, project: str) -> dict[str, str]:
    """Campaigns with sensor 4507: calibrated, expired, before any calibration, undated; and one
    with another sensor.
    """
    ids = {"project": project}
    ids["structure"] = ok(api.post(f"projects/{project}/structures", json=BEAM), 201)["id"]
    for name, at, serial in (
        ("good", "2024-06-01T12:00:00Z", "4507"),
        ("last day", "2025-01-31T23:59:59Z", "4507"),
        ("late", "2025-02-01T00:00:00Z", "4507"),
        ("again", "2026-03-01T12:00:00Z", 4507),
        ("early", "2023-06-01T12:00:00Z", "4507"),
        ("undated", None, "4507"),
        ("other", "2025-06-01T12:00:00Z", "352"),
    ):
        body = {
            "name": name,
            "boundary": "free",
            "performed_at": at,
            "instruments": {"sensor": {"serial": serial}},
        }
        ids[name] = ok(api.post(f"structures/{ids['structure']}/campaigns", json=body), 201)["id"]
    made = {"kind": "sensor", "serial": "4507", "model": "352C33", "calibrations": HISTORY}
    ids["sensor"] = ok(api.post(f"projects/{project}/instruments", json=made), 201)["id"]
    ok(
        api.post(f"projects/{project}/instruments", json={**made, "kind": "hammer"}), 201
    )  # another kind, named by nobody
    return ids


def matches(api: httpx.Client, noun: str, text: str, field: str = "name") -> list[str]:
    return [
        row[field]
        for row in ok(api.get(f"search/{noun}", params={"filter": text, "fields": field}), 200)[
            "items"
        ]
    ]


def test_what_an_expired_calibration_touched_is_found(
    api: httpx.Client, tested: dict[str, str]
) -> None:
    mine = f"project.id = '{tested['project']}' AND "
    for text, names in (
        ("instrument.serial = '4507'", ["good", "last day", "late", "again", "early", "undated"]),
        ("instrument.serial = '4507' AND instrument.kind = 'hammer'", []),
        ("instrument.calibration_expired = TRUE", ["late"]),
        ("instrument.calibration_expired = FALSE", ["good", "last day", "again"]),
        ("instrument.calibrated_on IS NULL", ["early", "undated"]),
        ("instrument.calibrated_until > DATE('2026-01-01')", ["again"]),
    ):
        assert matches(api, "campaigns", mine + text) == names, text
    ok(api.post(f"campaigns/{tested['late']}/frfs", json=frfs()), 201)
    assert set(
        matches(api, "frfs", mine + "instrument.calibration_expired = TRUE", "campaign.name")
    ) == {"late"}
    assert matches(api, "structures", mine + "instrument.model = '352C33'") == ["FRP beam"]


def test_each_frf_has_the_sensor_that_stood_at_its_point(
    api: httpx.Client, tested: dict[str, str]
) -> None:
    """Two sensors at stated points, the third elsewhere: by model and number, and what an expired
    one touched.
    """
    project, late = tested["project"], tested["late"]
    expired = {"kind": "sensor", "serial": "old", "calibrations": [HISTORY[1]]}
    ok(api.post(f"projects/{project}/instruments", json=expired), 201)
    stood = [
        {"model": "4507", "serial": "old", "points": [2, 5]},
        {"model": "4507", "serial": "new", "points": [3]},
    ]
    change = {"instruments": {"sensor": {"model": "352C33", "serial": "352"}, "sensors": stood}}
    tag = api.get(f"campaigns/{late}").headers["ETag"]
    ok(api.patch(f"campaigns/{late}", json=change, headers={"If-Match": tag}), 200)
    for point in (1, 2, 3, 4):
        ok(api.post(f"campaigns/{late}/frfs", json=frfs(point)), 201)
    mine = f"project.id = '{project}' AND "
    for text, points in (
        ("sensor = '4507'", [2, 3]),
        ("sensor <> '4507'", [1, 4]),
        ("NOT sensor LIKE '45%'", [1, 4]),
        ("CASEI(sensor_serial) = CASEI('NEW')", [3]),
        ("sensor_serial IN ('352', 'old')", [1, 2, 4]),
        ("sensor = '4507' AND sensor_serial = '352'", []),  # of one sensor
        ("driving_point = TRUE AND sensor = '352C33'", [1]),
        ("frf.sensor_serial = 'old' OR response_point = 4", [2, 4]),
        ("instrument.serial = 'old' AND instrument.calibration_expired = TRUE", [2]),
    ):
        assert matches(api, "frfs", mine + text, "response_point") == points, text
    ok(api.post(f"projects/{project}/instruments", json={"kind": "sensor", "serial": "352"}), 201)
    for point in (2, 4):
        body = record(point)
        body["mapping"]["channels"][1]["point"] = point
        ok(api.post(f"campaigns/{late}/records", json=body), 201)
    for serial, points in (("old", [2]), ("352", [4])):  # the hammer's blocks are of no sensor
        assert (
            matches(api, "records", mine + f"instrument.serial = '{serial}'", "point") == points
        ), serial
    for text, names in (
        ("frf.sensor = '4507'", ["late"]),
        ("frf.sensor_serial = 'new' AND frf.response_point = 2", []),
    ):
        assert matches(api, "campaigns", mine + text) == names, text
    shown = api.get(
        "search/frfs",
        params={"filter": mine + "lines = 3", "fields": "sensor_serial", "sort": "sensor"},
    )
    assert [row["sensor_serial"] for row in ok(shown, 200)["items"]] == ["352", "352", "old", "new"]


def test_a_new_calibration_is_kept_in_time_order_and_counts(
    api: httpx.Client, tested: dict[str, str]
) -> None:
    address = f"instruments/{tested['sensor']}"
    answer = api.get(address)
    before = ok(answer, 200)["calibrations"]
    assert [one["performed_on"] for one in before] == ["2024-02-01", "2026-02-01"]
    extended = [*before, {"performed_on": "2025-01-15", "valid_until": "2026-01-14"}]
    change: dict[str, Any] = {
        "json": {"calibrations": extended},
        "headers": {"If-Match": answer.headers["ETag"]},
    }
    assert [one["performed_on"] for one in ok(api.patch(address, **change), 200)["calibrations"]][
        1
    ] == "2025-01-15"
    mine = f"project.id = '{tested['project']}' AND "
    assert matches(api, "campaigns", mine + "instrument.calibration_expired = TRUE") == []
    assert api.patch(address, **change).status_code == 412


def test_an_instrument_is_refused_and_hidden_in_words(
    api: httpx.Client, tested: dict[str, str]
) -> None:
    path = f"projects/{tested['project']}/instruments"
    twice = api.post(path, json={"kind": "sensor", "serial": "4507"})
    assert twice.status_code == 409
    assert "sensor '4507' already" in twice.json()["detail"]
    for body, pointer in (
        ({"kind": "ruler", "serial": "1"}, "/kind"),
        ({"kind": "hammer", "serial": ""}, "/serial"),
        (
            {"kind": "hammer", "serial": "1", "calibrations": [{"performed_on": "2026-02-30"}]},
            "/calibrations/0/performed_on",
        ),
        (
            {
                "kind": "hammer",
                "serial": "1",
                "calibrations": [{"performed_on": "2026-02-03", "sensitivity": 0}],
            },
            "/calibrations/0/sensitivity",
        ),
        (
            {
                "kind": "hammer",
                "serial": "1",
                "calibrations": [{"performed_on": "2026-02-03", "valid_until": "2026-02-02"}],
            },
            "/calibrations/0",
        ),
    ):
        answer = api.post(path, json=body)
        assert answer.status_code == 422
        assert pointer in pointers(answer.json())
    ok(api.delete(f"instruments/{tested['sensor']}"), 204)
    mine = f"project.id = '{tested['project']}' AND "
    assert matches(api, "campaigns", mine + "instrument.serial = '4507'") == []
    assert [one["kind"] for one in ok(api.get(path), 200)["items"]] == ["hammer"]
    assert [one["id"] for one in ok(api.get(path, params={"deleted": True}), 200)["items"]] == [
        tested["sensor"]
    ]
    ok(api.post(f"instruments/{tested['sensor']}/restore"), 200)
    assert "late" in matches(api, "campaigns", mine + "instrument.serial = '4507'")
    assert {one["kind"] for one in ok(api.get(path), 200)["items"]} == {"sensor", "hammer"}
