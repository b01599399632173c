"""One call makes a campaign of a file, with its time and covariates; monitors then run by
themselves.
"""

import hashlib
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from uuid import uuid4

import httpx
import numpy as np
import pytest

import modalbase
from modalbase.client.errors import ClientError, JobFailed
from service.app.supervisor import LocalService
from tests.support.rest import RAW, client_of, finished, ok
from tests.support.waiting import until
from tests.support.wind import WIND, wind

BEGAN = 1_772_443_800  # 2026-03-02T09:30:00Z
FROM_FILE = {
    "performed_at": {"variable": "start_unix_s"},
    "covariates": {
        "wind_m_s": {"variable": "anemometer"},
        "temperature_c": {"variable": "pt100", "sensitivity": 0.01, "offset": -2.5},
    },
}
MAPPING = {**WIND, "recording": FROM_FILE}
CHANNELS = {
    "start_unix_s": np.array(BEGAN),
    "anemometer": np.array([3.0, np.nan, 5.0]),
    "pt100": np.full(60, 0.135),
}
CAMPAIGN = {"name": "an hour", "boundary": "as_modelled"}
Send = Callable[..., httpx.Response]


@pytest.fixture(scope="module")
def api(service: LocalService) -> Iterator[httpx.Client]:
    with client_of(service, f"laboratory {uuid4()}") as client:
        yield client


@pytest.fixture
def structure(api: httpx.Client) -> str:
    project = ok(api.post("projects", json={"name": "bridge"}), 201)["id"]
    return str(ok(api.post(f"projects/{project}/structures", json={"name": "deck"}), 201)["id"])


@pytest.fixture
def send(api: httpx.Client, structure: str) -> Send:
    def send(content: bytes, campaign: Any = CAMPAIGN, mapping: Any = MAPPING, **query: Any) -> Any:
        query |= {"campaign": json.dumps(campaign), "mapping": json.dumps(mapping)}
        path = f"structures/{structure}/imports"
        return api.post(path, content=content, params=query, headers=RAW)

    return send


def test_a_file_becomes_a_campaign_and_a_run_of_its_monitor(
    api: httpx.Client, structure: str, send: Send
) -> None:
    body = {"name": "deck", "watch": "modes", "covariates": ["wind_m_s"]}
    monitor = ok(api.post(f"structures/{structure}/monitors", json=body), 201)["id"]
    content = wind(1, **CHANNELS)
    sent = send(content, filename="hour.npz")
    first = ok(sent, 202)
    assert not first["already_imported"]
    read = finished(api, sent.headers["Location"])
    assert read["status"] == "succeeded", read
    assert (
        "wind_m_s is 4, the mean of 3 samples of anemometer, of which 1 are no numbers"
        in (read["warnings"])
    )
    campaign = ok(api.get(f"campaigns/{read['campaign_id']}"))
    assert campaign["performed_at"] == "2026-03-02T09:30:00Z"
    assert campaign["covariates"] == {"wind_m_s": 4.0}
    assert campaign["temperature_c"] == pytest.approx(11.0)
    run = until(
        lambda: next(
            (
                each
                for each in ok(api.get(f"monitors/{monitor}/runs"))["items"]
                if each["state"] != "running"
            ),
            None,
        ),
        "the run of the monitor",
    )
    assert (run["state"], run["campaign_id"]) == ("succeeded", campaign["id"]), run
    again = ok(send(content, {**CAMPAIGN, "name": "another"}), 200)
    assert (again["id"], again["already_imported"]) == (first["id"], True)
    asked = {"sha256": [hashlib.sha256(content).hexdigest(), 64 * "0"]}
    listed = ok(api.get(f"structures/{structure}/imports", params=asked))["items"]
    assert [each["id"] for each in listed] == [first["id"]]
    assert ok(api.get(f"structures/{structure}/campaigns"))["items"] == [campaign]

    api.delete(f"campaigns/{campaign['id']}", headers={"If-Match": "*"}).raise_for_status()
    assert send(content).status_code == 409
    assert ok(api.get(f"structures/{structure}/imports", params=asked))["items"] == []
    listed = ok(api.get(f"structures/{structure}/imports", params={**asked, "deleted": True}))
    assert [each["id"] for each in listed["items"]] == [first["id"]]
    ok(api.post(f"campaigns/{campaign['id']}/restore"))
    assert ok(send(content), 200)["already_imported"]


@pytest.mark.parametrize(
    ("campaign", "mapping", "pointer"),
    [
        (CAMPAIGN, WIND, "campaign/performed_at"),
        ({"boundary": "free"}, MAPPING, "campaign/name"),
        ({**CAMPAIGN, "covariates": {"wind": 3}}, MAPPING, "campaign/covariates"),
        ([], MAPPING, "campaign"),
        (CAMPAIGN, [], "mapping"),
    ],
)
def test_what_is_refused_makes_no_campaign(
    api: httpx.Client, structure: str, send: Send, campaign: Any, mapping: Any, pointer: str
) -> None:
    answer = send(wind(2, **CHANNELS), campaign, mapping)
    assert (answer.status_code, answer.json()["errors"][0]["pointer"]) == (422, pointer)
    assert ok(api.get(f"structures/{structure}/campaigns"))["items"] == []
    assert ok(api.get(f"structures/{structure}/imports"))["items"] == []


@pytest.mark.parametrize(
    ("stated", "pointer", "words"),
    [
        ({"performed_at": "file"}, "performed_at", "does not state when it began"),
        ({"performed_at": {"variable": "a1"}}, "performed_at/variable", "no seconds since 1970"),
        ({"performed_at": {"variable": "b"}}, "performed_at/variable", "the file has a1, a2, a3"),
        ({"covariates": {"wind": {"variable": "a1"}}}, "covariates/wind", "end with its unit"),
        ({"covariates": {"wind_m_s": "a1"}}, "covariates/wind_m_s", "expected {"),
        (
            {"covariates": {"wind_m_s": {"variable": "a1", "sensitivity": 0}}},
            "covariates/wind_m_s/sensitivity",
            "not 0",
        ),
        (
            {"covariates": {"wind_m_s": {"variable": "speed [km/h]"}}},
            "covariates/wind_m_s",
            "says that speed [km/h] is in km/h: state sensitivity",
        ),
    ],
)
def test_what_a_mapping_takes_wrongly_from_the_file_is_named(
    api: httpx.Client, send: Send, stated: Any, pointer: str, words: str
) -> None:
    content = wind(3, **{**CHANNELS, "speed [km/h]": np.full(60, 9.0)})
    dated = {**CAMPAIGN, "performed_at": "2026-03-02T09:30:00Z"}
    sent = ok(send(content, dated, {**WIND, "recording": stated}), 202)
    error = finished(api, f"imports/{sent['id']}")["error"]
    assert error["errors"][0]["pointer"] == f"/mapping/recording/{pointer}"
    assert words in error["errors"][0]["detail"]
    campaign = ok(api.get(f"campaigns/{sent['campaign_id']}"))
    assert (campaign["covariates"], campaign["temperature_c"]) == ({}, None)


def test_the_library_sends_a_recording_once(service: LocalService, tmp_path: Path) -> None:
    key = service.new_key("bridge warden")
    file, broken = tmp_path / "hour.npz", tmp_path / "broken.npz"
    file.write_bytes(wind(4, **CHANNELS))
    broken.write_bytes(b"no archive")
    with modalbase.connect(service.url, key) as lab:
        structure = lab.new_project("bridge").new_structure("deck")
        dated = {"performed_at": "2026-03-02T09:30:00Z", "covariates": {"wind_m_s": 6.0}}
        sent = structure.add_recording(file, "free", mapping=MAPPING, **dated)
        (campaign,) = structure.campaigns()
        # what is stated counts more than a mean of the file
        assert (campaign.name, campaign.covariates) == ("hour", {"wind_m_s": 6.0})
        assert structure.add_recording(file, "free", mapping=MAPPING, **dated) == sent
        with pytest.raises(JobFailed):
            structure.add_recording(broken, "free", mapping=MAPPING, **dated)
        with pytest.raises(ClientError, match="there is no 'dry_run'"):
            structure.add_recording(file, "free", how={"dry_run": True})
        # mended, it takes the campaign that it had left empty, and what is stated now
        (left,) = (each for each in structure.campaigns() if each.name == "broken")
        broken.write_bytes(wind(5, **CHANNELS))
        dated["covariates"] = {"wind_m_s": 7.0}
        assert structure.add_recording(broken, "free", mapping=MAPPING, **dated).succeeded
        assert [each.name for each in structure.campaigns()] == ["hour", "broken"]
        assert left.refresh().covariates == {"wind_m_s": 7.0}
        states = [each.fields["status"] for each in structure.imports()]
        assert states == ["succeeded", "failed", "succeeded"]
