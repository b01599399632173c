"""Every operation of the OpenAPI document: who gets in where, what is drawn from the document, and junk.

The operations are taken from the service's own document, so a new one is tested from its first day. `make soak` asks the
same at length and prints what came of it.
"""

from __future__ import annotations

import json
import os
import random
from collections.abc import Callable, Iterator
from typing import Any

import httpx
import pytest

from benchmarks.service import ASKED_FREELY
from benchmarks.soak import fuzz
from service.app.supervisor import LocalService
from service.settings import Settings
from tests.support import access, furnished

SEED = 20_150
REQUESTS_AN_OPERATION = 6
IDS = ("00000000-0000-0000-0000-000000000000", "x", "%00", "%F0%9F%98%80", "..%2f", "1e999")
TEXTS = ("", "\0", "\ud800", "😀" * 300, "NaN", "-1", "9" * 400, "'; --", "../..", "2026-02-30T25:00:00Z")
JUNK: tuple[Any, ...] = (
    *TEXTS, None, True, -1, 0, 2**63, -(2**80), 1e308, -0.0, [], {}, [None] * 40, [[]], {"": 1}, {"a": {"b": [{}]}},
)  # fmt: skip
RAW = (
    b"", b"null", b"[]", b"{", b"[NaN]", b'{"name": Infinity}', b'"\\ud800"', b"\xff\xfe", b"1" * 5000, b"[" * 3000,
    b"    -1\n    58\n", b"PK\x03\x04junk", b"a,b\n1,\n", b"--x\r\n\r\n--x--",
)  # fmt: skip
KINDS = (
    "application/json", "application/x-npz", "text/csv", "multipart/form-data; boundary=x", "multipart/form-data",
    "application/octet-stream", "text/plain", "", "x",
)  # fmt: skip
HEADERS = (
    {},
    {"If-Match": "*"},
    {"If-Match": '"x"'},
    {"Accept": "x;q=y"},
    {"Range": "bytes=9-1"},
    {"Last-Event-ID": "x"},
)


@pytest.fixture(scope="module")
def service(new_database: Callable[[], str]) -> Iterator[LocalService]:
    """One that is asked freely, and runs no jobs."""
    settings = Settings(database_url=new_database(), port=0, log_level="error", **ASKED_FREELY)
    with LocalService(settings, worker=False) as running:
        yield running


@pytest.fixture(scope="module")
def asked(service: LocalService) -> Iterator[access.Round]:
    """Every kind of caller, with own, foreign and random ids."""
    with access.asking_of(service) as asked:
        yield asked


def test_nothing_leaks_and_every_operation_is_judged(asked: access.Round) -> None:
    found = asked.run(long="MODALBASE_TEST_LONG" in os.environ)
    assert found.leaks == []
    assert min(found.calls.values()) > 0
    assert {200, 401, 403, 404} <= found.statuses.keys()


def test_a_wrong_judgement_and_a_missing_one_are_found(asked: access.Round, monkeypatch: pytest.MonkeyPatch) -> None:
    judged = furnished.judgements()
    judged["GET /projects/{project_id}"] = ("read", "editor")
    judged["GET /structures/{structure_id}"] = ("write", "viewer")
    del judged["GET /alarms"]
    monkeypatch.setattr(furnished, "judgements", lambda: judged)
    only = ["GET /projects/{project_id}", "GET /structures/{structure_id}"]
    leaks = asked.run(only=only).leaks
    assert any(leak.startswith("GET /alarms: nobody has judged") for leak in leaks)
    assert any(
        leak.startswith("GET /projects/{project_id}, viewer, own id: should be 403; it is 200") for leak in leaks
    )
    assert any(leak.startswith("GET /structures/{structure_id}, owner, read alone, own id") for leak in leaks)


def test_no_request_that_the_document_allows_or_forbids_is_an_error_or_an_undocumented_answer(
    service: LocalService,
) -> None:
    found = fuzz(service, examples=1)
    assert found.faults == {}
    assert len(found.answered) > 30  # else nothing got anywhere
    assert {200, 201, 404, 422} <= found.statuses.keys()


@pytest.fixture
def ids(api: httpx.Client, structure: str, campaign: str) -> dict[str, str]:
    """Things that exist, so that junk gets past the lookups."""
    points = {"items": [{"label": 1, "x_m": 0.1, "y_m": 0, "z_m": 0}]}
    api.put(f"campaigns/{campaign}/grid-points", json=points).raise_for_status()
    frf = {"response_point": 1, "response_direction": 3, "reference_point": 1, "reference_direction": 3}
    frf |= {"real": [1.0, 2.0, 3.0], "imag": [0.0, 0.5, 1.0]}
    frfs = {"quantity": "accelerance", "frequency_hz": [1.0, 2.0, 3.0], "frfs": [frf]}
    stored = api.post(f"campaigns/{campaign}/frfs", json=frfs).raise_for_status().json()["items"][0]["id"]
    modes = {"name": "m", "modes": [{"frequency_hz": 2.0, "damping_ratio": 0.01}]}
    mode_set = api.post(f"campaigns/{campaign}/mode-sets", json=modes).raise_for_status().json()["id"]
    body = {"name": "b", "constants": ["Ex"]}
    batch = api.post(f"structures/{structure}/coupon-batches", json=body).raise_for_status().json()["id"]
    coupon = api.post(f"coupon-batches/{batch}/coupons", json={"specimen": "A", "E_Pa": 3e10}).raise_for_status().json()
    project = api.get("projects").json()["items"][0]["id"]
    return {
        "project_id": project,
        "structure_id": structure,
        "campaign_id": campaign,
        "frf_id": stored,
        "mode_set_id": mode_set,
        "batch_id": batch,
        "coupon_id": coupon["items"][0]["id"],
    }


def operations(document: dict[str, Any]) -> Iterator[tuple[str, str, dict[str, Any]]]:
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            yield method.upper(), path, operation


def resolved(document: dict[str, Any], schema: dict[str, Any]) -> dict[str, Any]:
    while "$ref" in schema:
        schema = document["components"]["schemas"][schema["$ref"].rsplit("/", 1)[1]]
    return schema


def a_body(document: dict[str, Any], operation: dict[str, Any], choose: random.Random) -> tuple[bytes, str]:
    """Raw junk, or an object with the right names and junk in some of them."""
    content = operation.get("requestBody", {}).get("content", {})
    if choose.random() < 0.3 or "application/json" not in content:
        return choose.choice(RAW), choose.choice([*content, *KINDS])
    schema = resolved(document, content["application/json"]["schema"])
    names = list(schema.get("properties", {})) or ["name"]
    body = {name: choose.choice(JUNK) for name in choose.sample(names, choose.randint(1, len(names)))}
    return json.dumps(choose.choice([body, [body], body])).encode(), "application/json"


def requests(document: dict[str, Any], ids: dict[str, str]) -> Iterator[tuple[str, str, dict[str, Any]]]:
    choose = random.Random(SEED)
    for method, path, operation in operations(document):
        for attempt in range(REQUESTS_AN_OPERATION):
            url, query = path, {}
            for parameter in operation.get("parameters", []):
                name = parameter["name"]
                if parameter["in"] == "path":
                    known = ids.get(name)
                    url = url.replace(f"{{{name}}}", known if known and attempt % 3 else choose.choice(IDS))
                elif parameter["in"] == "query" and choose.random() < 0.6:
                    query[name] = choose.choice(TEXTS).encode("utf-8", "surrogatepass")
            content, kind = a_body(document, operation, choose)
            how: dict[str, Any] = {"params": query, "headers": {**choose.choice(HEADERS), "Content-Type": kind}}
            if method not in ("GET", "HEAD", "DELETE"):
                how["content"] = content
            yield method, url, how


def test_no_documented_route_answers_500_to_junk(api: httpx.Client, ids: dict[str, str]) -> None:
    root = api.base_url.copy_with(path="/")
    document = api.get(root.join("openapi.json")).json()
    statuses: dict[int, int] = {}
    # What exists stays until the end, or all that follows would only be 404.
    last = [one for one in requests(document, ids) if one[0] == "DELETE"]
    first = [one for one in requests(document, ids) if one[0] != "DELETE"]
    for method, url, how in [*first, *last]:
        answer = api.request(method, str(root).rstrip("/") + url, **how)
        statuses[answer.status_code] = statuses.get(answer.status_code, 0) + 1
        said = f"{method} {url} {how} -> {answer.status_code} {answer.text[:500]}"
        assert answer.status_code < 500, said
        if answer.is_client_error:
            assert answer.headers["content-type"] == "application/problem+json", said
    assert {200, 404, 422} <= statuses.keys()  # else the junk never got anywhere
