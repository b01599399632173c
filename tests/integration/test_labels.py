"""Tags and metadata: stored with a thing, found by a search, and held against what the project
demands.
"""

from collections.abc import Callable, Iterator
from typing import Any
from uuid import uuid4

import httpx
import nanoarrow as na
import psycopg
import pytest

import modalbase
from modalbase.client.errors import ClientError
from service.app.supervisor import LocalService
from service.platform.db.engine import psycopg_url
from tests.support.furnished import frfs
from tests.support.laboratory import BEAM
from tests.support.rest import client_of, ok

Asked = tuple[httpx.Client, dict[str, str]]
CAMPAIGN = {"boundary": "free", "temperature_c": 20.0}


@pytest.fixture
def labelled(api: httpx.Client, service: LocalService) -> dict[str, str]:
    """Campaigns with labels, one of them with FRFs and a result that have some too."""
    return made_labelled(api, service)


@pytest.fixture(scope="module")
def asked(service: LocalService) -> Iterator[Asked]:
    """The same for those who only ask, and a client of their owner."""
    with client_of(service, f"labels {uuid4()}") as client:
        yield client, made_labelled(client, service)


def made_labelled(api: httpx.Client, service: LocalService) -> dict[str, str]:
    project = ok(api.post("projects", json={"name": "tests"}), 201)["id"]
    ids = {"project": project}
    made = ok(
        api.post(
            f"projects/{project}/structures",
            json={**BEAM, "tags": ["bridge"], "meta": {"span": 3, "serial": 2**60}},
        ),
        201,
    )
    ids["structure"] = made["id"]
    stated: list[tuple[str, list[str], dict[str, Any]]] = [
        ("a", ["winter", "night shift"], {"client": "ACME", "wind": {"speed": 3.5}, "dry": True}),
        ("b", ["winter"], {"client": "Acme", "wind": {"speed": 12}, "dry": False}),
        ("c", ["summer"], {"client": 7, "wind": None}),
        ("d", [], {}),
    ]
    for name, tags, meta in stated:
        body = {**CAMPAIGN, "name": name, "tags": tags, "meta": meta}
        ids[name] = ok(api.post(f"structures/{ids['structure']}/campaigns", json=body), 201)["id"]
    for first in (11, 12):
        ok(api.post(f"campaigns/{ids['a']}/frfs", json=frfs(first)), 201)
    ids["job"] = ok(api.post(f"campaigns/{ids['a']}/update-jobs", json={}), 202)["id"]
    row = (
        "INSERT INTO update_results (id, campaign_id, document, prediction) VALUES (%s, %s,"
        " '{}', '')"
    )
    with psycopg.connect(psycopg_url(service.settings.database_url)) as connection:
        connection.execute(row, [ids["job"], ids["a"]])
    return ids


QUESTIONS = [
    ("tag = 'winter'", "ab"),
    ("NOT tag = 'winter'", "cd"),
    ("tag <> 'winter'", "cd"),
    ("tag IN ('summer', 'night shift')", "ac"),
    ("tag NOT IN ('summer', 'night shift')", "bd"),
    ("tag LIKE 'w%' AND tag = 'night shift'", "a"),
    ("tag IS NULL", "d"),
    ("tag IS NOT NULL", "abc"),
    ("structure.tag = 'bridge' AND structure.meta.span > 2", "abcd"),
    ("structure.meta.serial = 1152921504606846976", "abcd"),
    ("meta.client = 'ACME'", "a"),
    ("CASEI(meta.client) = CASEI('acme')", "ab"),
    ("NOT meta.client = 'ACME'", "b"),
    ("meta.client IN ('ACME', 'Acme')", "ab"),
    ("meta.client = 7", "c"),
    ("meta.client IS NULL", "d"),
    ("meta.wind.speed BETWEEN 3 AND 4", "a"),
    ("meta.wind.speed > 4 OR meta.dry", "ab"),
    ("meta.dry = FALSE", "b"),
    ("meta.wind IS NULL", "cd"),
    ("meta.client LIKE 'A%' AND meta.wind.speed < 1e300", "ab"),
]


def test_a_filter_asks_for_tags_and_metadata(asked: Asked) -> None:
    api, labelled = asked
    for condition, matches in QUESTIONS:
        query = {
            "filter": f"({condition}) AND project.id = '{labelled['project']}'",
            "fields": "name",
        }
        items = ok(api.get("search/campaigns", params=query), 200)["items"]
        assert "".join(row["name"] for row in items) == matches, condition


def test_what_a_filter_cannot_ask_is_refused(api: httpx.Client) -> None:
    refusals = [
        ("tag > 'a'", "IN or LIKE"),
        ("tag = 3", "a text in single quotes"),
        ("CASEI(tag) = 'a'", "CASEI takes a text"),
        ("meta = 'x'", "name a member"),
        ("meta.a = DATE('2026-03-01')", "a number, TRUE or FALSE"),
        ("meta..a = 1", "no field"),
        ("meta.a BETWEEN 'x' AND 3", "expected a text"),
        ("mode.tag = 'x'", "no field"),
        ("meta.a = 1e999", "expected a number"),
        (r"tag LIKE 'a\'", "ends in a single"),
    ]
    for condition, words in refusals:
        answer = api.get("search/campaigns", params={"filter": condition})
        assert answer.status_code == 422, condition
        assert words in answer.json()["errors"][0]["detail"], condition
    answer = api.get("search/campaigns", params={"sort": "meta.client"})
    assert "has no order" in answer.json()["errors"][0]["detail"]


def test_labels_are_columns_of_every_format(asked: Asked) -> None:
    api, labelled = asked
    fields = "name,tag,meta.client,meta.wind"
    query = {
        "filter": f"structure.id = '{labelled['structure']}'",
        "fields": fields,
        "sort": "name",
    }
    first = ok(api.get("search/campaigns", params=query), 200)["items"][0]
    assert first == {
        "name": "a",
        "tag": ["winter", "night shift"],
        "meta.client": "ACME",
        "meta.wind": {"speed": 3.5},
    }
    lines = api.get("search/campaigns", params={**query, "format": "csv"}).text.splitlines()
    assert lines[1] == 'a,"winter, night shift",ACME,"{""speed"": 3.5}"'
    assert lines[4] == "d,,,"
    content = api.get("search/campaigns", params={**query, "format": "arrow"}).content
    rows = na.ArrayStream.from_readable(content).read_all().to_pylist()
    assert rows[2] == {"name": "c", "tag": "summer", "meta.client": "7", "meta.wind": None}


def test_frfs_and_results_take_labels(
    service: LocalService, api: httpx.Client, labelled: dict[str, str]
) -> None:
    key = api.headers["Authorization"].removeprefix("Bearer ")
    with modalbase.connect(service.url, key) as lab:
        campaign = lab.campaign(labelled["a"])
        assert (campaign.tags, campaign.meta["client"]) == (["winter", "night shift"], "ACME")
        assert campaign.label_frfs(tags=["steel tip"], meta={"tip": "steel"}, point=12) == 1
        rows = list(lab.find("frfs", "tag = 'steel tip' AND meta.tip = 'steel'"))
        assert [row["response_point"] for row in rows if row["campaign.id"] == labelled["a"]] == [
            12
        ]
        job = lab.job(labelled["job"])
        assert job.labels == {"tags": [], "meta": {}}
        assert job.label(tags=["approved"]) == {"tags": ["approved"], "meta": {}}
        assert [row["id"] for row in lab.find("results", "tag = 'approved'")] == [labelled["job"]]
        assert campaign.change(tags=["autumn"]).tags == ["autumn"]
        assert lab.campaign(f"{BEAM['name']}/b").change(tags=["found by name"]).tags == [
            "found by name"
        ]
        structure = lab.structure(labelled["structure"]).change(meta={"span": 4})
        assert (structure.version, structure.tags, structure.meta) == (1, ["bridge"], {"span": 4})
    stale = api.put(f"update-jobs/{labelled['job']}/labels", json={}, headers={"If-Match": '"x"'})
    assert stale.status_code == 412


def test_labels_that_cannot_be_are_refused(asked: Asked) -> None:
    api, labelled = asked
    path = f"structures/{labelled['structure']}/campaigns"
    bodies: list[dict[str, Any]] = [
        {"tags": ["a", "a"]},
        {"tags": ["a,b"]},
        {"tags": [" a"]},
        {"tags": [""]},
        {"tags": ["x" * 101]},
        {"tags": [str(n) for n in range(51)]},
        {"tags": None},
        {"meta": []},
        {"meta": {"x": "y" * 10_000}},
        {"meta": {"x": "\0"}},
        {"meta": {"x": 10**400}},
    ]
    for labels in bodies:
        answer = api.post(path, json={**CAMPAIGN, "name": "n", **labels})
        assert answer.status_code == 422, labels
        assert answer.json()["errors"][0]["pointer"].startswith("/" + next(iter(labels))), labels


def demand(api: httpx.Client, project: str, schemas: dict[str, Any]) -> httpx.Response:
    etag = api.get(f"projects/{project}").headers["ETag"]
    return api.patch(f"projects/{project}", json={"schemas": schemas}, headers={"If-Match": etag})


def test_a_project_demands_what_is_stated(api: httpx.Client, labelled: dict[str, str]) -> None:
    hammer = {"required": ["tip"], "properties": {"tip": {"enum": ["steel", "nylon"]}}}
    schemas = {
        "campaign": {
            "required": ["temperature_c", "humidity_percent"],
            "properties": {
                "instruments": {"required": ["hammer"], "properties": {"hammer": hammer}}
            },
        },
        "frfs": {"properties": {"meta": {"required": ["analyst"]}}},
        "result": {"properties": {"tags": {"minItems": 1}}},
        "structure": {"properties": {"name": {"pattern": "^[A-Z]{2}-"}}},
    }
    assert ok(demand(api, labelled["project"], schemas), 200)["schemas"] == schemas
    path = f"structures/{labelled['structure']}/campaigns"
    bad = api.post(path, json={**CAMPAIGN, "name": "n", "instruments": {"hammer": {"tip": "wood"}}})
    assert [fault["pointer"] for fault in bad.json()["errors"]] == [
        "/humidity_percent",
        "/instruments/hammer/tip",
    ]
    assert "the project demands it of each campaign" in bad.json()["errors"][0]["detail"]
    good = {
        **CAMPAIGN,
        "name": "n",
        "humidity_percent": 50,
        "instruments": {"hammer": {"tip": "nylon"}},
    }
    campaign = ok(api.post(path, json=good), 201)
    address, tag = (
        f"campaigns/{campaign['id']}",
        {"If-Match": api.get(f"campaigns/{campaign['id']}").headers["ETag"]},
    )
    cleared = api.patch(address, json={"temperature_c": None}, headers=tag)
    assert cleared.json()["errors"][0]["pointer"] == "/temperature_c"
    assert api.get(address).json()["temperature_c"] == 20.0
    frf = api.put(f"campaigns/{labelled['a']}/frfs/labels", json={"tags": ["x"]})
    assert frf.json()["errors"][0]["pointer"] == "/meta/analyst"
    labels = f"update-jobs/{labelled['job']}/labels"
    refused = api.put(labels, json={}, headers={"If-Match": api.get(labels).headers["ETag"]})
    assert refused.json()["errors"][0]["pointer"] == "/tags"
    named = api.post(f"projects/{labelled['project']}/structures", json={**BEAM, "name": "beam"})
    assert named.json()["errors"][0]["pointer"] == "/name"
    ok(demand(api, labelled["project"], {}), 200)
    ok(api.post(path, json={**CAMPAIGN, "name": "free again"}), 201)


def test_a_schema_that_cannot_be_is_refused(api: httpx.Client, project: str) -> None:
    deep: dict[str, Any] = {}
    for _ in range(150):
        deep = {"not": deep}
    schemas: list[dict[str, Any]] = [
        {"campaign": {"type": "nonsense"}},
        {"campaign": {"$ref": "http://127.0.0.1:9/schema"}},
        {"campaign": {"$ref": "#/$defs/a", "$defs": {"a": {}}}},
        {"campaign": {"$schema": "http://127.0.0.1:9/schema"}},
        {"campaign": {"pattern": "(?=a)b"}},
        {"campaign": {"description": "x" * 20_000}},
        {"campaign": deep},
        {"mode": {}},
        {"campaign": []},
    ]
    for one in schemas:
        answer = demand(api, project, one)
        assert answer.status_code == 422, one
        assert answer.json()["errors"][0]["pointer"].startswith("/schemas"), one


def test_others_learn_nothing_of_labels(
    asked: Asked, new_client: Callable[[], httpx.Client]
) -> None:
    (_, labelled), stranger = asked, new_client()
    for condition in (
        "tag = 'winter'",
        "NOT tag = 'x'",
        "meta.client = 'ACME'",
        "structure.tag = 'bridge'",
    ):
        assert ok(stranger.get("search/campaigns", params={"filter": condition}), 200)["count"] == 0
    assert stranger.put(f"campaigns/{labelled['a']}/frfs/labels", json={}).status_code == 404
    assert stranger.get(f"update-jobs/{labelled['job']}/labels").status_code == 404


def test_the_library_says_what_the_project_demands(
    service: LocalService, api: httpx.Client, labelled: dict[str, str]
) -> None:
    ok(demand(api, labelled["project"], {"campaign": {"required": ["humidity_percent"]}}), 200)
    key = api.headers["Authorization"].removeprefix("Bearer ")
    with modalbase.connect(service.url, key) as lab:
        with pytest.raises(ClientError, match="humidity_percent"):
            lab.structure(labelled["structure"]).new_campaign("n", "free")
        with pytest.raises(ClientError, match="there is no 'pint'"):
            lab.campaign(labelled["a"]).label_frfs(tags=["x"], pint=3)
