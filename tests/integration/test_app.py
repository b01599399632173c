"""The API as a client meets it: problems, limits, health, documentation without internet."""

import hashlib
import json
import re
import socket
from base64 import b64encode
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from typing import Any

import httpx
import psycopg
import pytest
from fastapi import FastAPI
from sqlalchemy import make_url

from service.app.application import create_app
from service.app.supervisor import LocalService, listening_socket
from service.platform.access.keys import create_key, user_named
from service.platform.settings import Settings
from service.platform.web.openapi import undescribed
from tests.support.rest import campaigns_of
from tests.support.waiting import completed, until

JSON = {"Content-Type": "application/json"}


def is_problem(answer: httpx.Response, status: int) -> dict[str, object]:
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    body: dict[str, object] = answer.json()
    assert body["status"] == status
    assert body["title"]
    assert body["request_id"] == answer.headers["x-request-id"]
    return body


@pytest.mark.parametrize(
    ("body", "pointer", "says"),
    [
        (b'{"name": ', "", "not JSON: Expecting value at line 1, column 10"),
        (b"", "", "Field required"),
        (b"\xff\xfe", "", "not UTF-8"),
        (b'{"name": NaN}', "/name", "is NaN"),
        (b'{"name": {"a~b/c": [1, -Infinity]}}', "/name/a~0b~1c/1", "is -Infinity"),
        (b'{"name": 1e999}', "/name", "double precision"),
        (rb'{"name": "a\u0000b"}', "/name", "NUL"),
        (rb'{"name": "\ud800"}', "/name", "lone surrogate"),
        (rb'{"a\u0000": 1, "name": "x"}', "", "NUL"),
        (b'{"name": "x", "name": "x"}', "", "the field 'name' is there more than once"),
        (
            b'{"name": {"a": [{"b/c": 1, "d": 2, "b/c": 3}]}}',
            "/name/a/0",
            "the field 'b/c' is there more than once",
        ),
        (rb'{"name": "x", "\u006eame": "y"}', "", "the field 'name' is there more than once"),
        (rb'{"name": "x", "\ud800": 1, "\ud800": 2}', "", "lone surrogate"),
        (b'{"name": 9223372036854775808}', "/name", "64-bit"),
        (b'{"name": ' + b"9" * 5000 + b"}", "", "thousands of digits"),
        (b"[" * 20_000, "", "nested too deeply"),
        (
            b'{"name": ' + b"[" * 70 + b"]" * 70 + b"}",
            "/name" + "/0" * 63,
            "nested more than 64 deep",
        ),
        (b"[" * 200_000, "", "more than 50000 values"),
        (
            b'{"name": "x", "description": "' + b"y" * 10_001 + b'"}',
            "/description",
            "expected at most 10000",
        ),
        (
            b'{"name": "x", "description": "' + b"y" * 100_001 + b'"}',
            "/description",
            "at most 100000 are read",
        ),
        (b'{"name": "x", "colour": 1}', "/colour", "is no member here; there is name, description"),
        (b'{"name": 5}', "/name", "valid string"),
        (b'{"name": ""}', "/name", "at least 1"),
        (b'{"name": " \\t"}', "/name", "match pattern"),
        (b"[]", "", "valid dictionary"),
        (b'{"name": NaN, "description": Infinity}', "/name", "is NaN"),
        (b'{"name": NaN, "description": Infinity}', "/description", "is Infinity"),
    ],
)
def test_wrong_bodies_are_422_with_a_pointer(
    api: httpx.Client, body: bytes, pointer: str, says: str
) -> None:
    problem = is_problem(api.post("projects", content=body, headers=JSON), 422)
    errors = problem["errors"]
    assert isinstance(errors, list)
    assert any(error["pointer"] == pointer and says in error["detail"] for error in errors), errors


def test_of_many_faults_the_first_are_listed_and_the_rest_counted(api: httpx.Client) -> None:
    wrong = {"name": "x", **{f"unknown_{i}": i for i in range(900)}}
    answer = api.post("projects", json=wrong)
    problem = is_problem(answer, 422)
    assert len(problem["errors"]) == 50
    assert "and 850 more faults" in str(problem["detail"])
    assert len(answer.content) < 20_000


def test_a_body_of_nothing_but_unknown_fields_is_cheap(api: httpx.Client) -> None:
    wrong = json.dumps({"name": "x", **{f"u{i}": 0 for i in range(49_000)}}).encode()
    answer = api.post("projects", content=wrong, headers=JSON)
    assert is_problem(answer, 422)["errors"] == [
        {"pointer": "", "detail": "has 49001 members, at most 1000 are read"}
    ]
    more = json.dumps({"name": "x", **{f"unknown_{i}": i for i in range(200_000)}}).encode()
    assert is_problem(api.post("projects", content=more, headers=JSON), 413)


@pytest.mark.parametrize(
    ("query", "name"),
    [
        ({"limit": "0"}, "limit"),
        ({"limit": "9" * 30}, "limit"),
        ({"cursor": "\0"}, "cursor"),
        ({"cursor": "é"}, "cursor"),
    ],
)
def test_wrong_parameters_are_422(api: httpx.Client, query: dict[str, str], name: str) -> None:
    problem = is_problem(api.get("projects", params=query), 422)
    assert problem["errors"][0]["pointer"] == name


@pytest.mark.parametrize(
    "path", ["nowhere", "projects/1", "projects/01a1fd61-dc65-7a99-9916-7e787830264d"]
)
def test_unknown_things_are_404(api: httpx.Client, path: str) -> None:
    is_problem(api.get(path), 404)


def test_an_address_that_is_none_names_the_ones_that_are(
    service: LocalService, api: httpx.Client
) -> None:
    assert (
        is_problem(api.get("nowhere"), 404)["detail"]
        == "no such address: /api/v1/nowhere; /docs lists all that there are"
    )
    with httpx.Client(
        base_url=service.url, trust_env=False, timeout=60, follow_redirects=True
    ) as client:
        assert client.get("/").url.path == "/sign-in"  # where a browser begins


def test_wrong_method_is_405(api: httpx.Client) -> None:
    answer = api.delete("projects")
    assert "DELETE is not possible" in str(is_problem(answer, 405)["detail"])
    assert answer.headers["allow"]


@pytest.mark.parametrize(
    "kind", [None, "application/x-www-form-urlencoded", "text/plain; charset=utf-8"]
)
def test_a_body_that_is_not_said_to_be_json_is_415(api: httpx.Client, kind: str | None) -> None:
    """As `curl -d` sends it, which says that it is a form."""
    headers = {} if kind is None else {"Content-Type": kind}
    problem = is_problem(api.post("projects", content=b'{"name": "x"}', headers=headers), 415)
    assert "expected JSON and `Content-Type: application/json`" in str(problem["detail"])


@pytest.mark.parametrize(
    "header",
    [None, "", "Bearer", "Bearer x", "Basic eDp5", "Bearer mb_000000000000_", "Bearer mb_é_x"],
)
def test_without_a_valid_key_401(service: LocalService, header: str | None) -> None:
    headers = {} if header is None else {b"Authorization": header.encode("latin-1")}
    answer = httpx.get(
        f"{service.url}/api/v1/projects", headers=headers, trust_env=False, timeout=60
    )
    is_problem(answer, 401)
    assert answer.headers["www-authenticate"] == "Bearer"


@pytest.fixture(scope="module")
def small(new_api: Callable[..., AbstractContextManager[LocalService]]) -> Iterator[LocalService]:
    """A service with low limits, and with all switched off that can be."""
    with new_api(
        json_limit_bytes=1000,
        upload_limit_bytes=5000,
        docs=False,
        pages=False,
        metrics=False,
        allowed_hosts="Lab.example, *.inside.example, [fd00::7]",
    ) as running:
        yield running


@pytest.mark.parametrize(
    ("path", "to"),
    [
        ("/ui", "ui/"),
        ("/ui/update-jobs/?status=failed", "../../ui/update-jobs?status=failed"),
        ("/api/v1/projects/", "../../../api/v1/projects"),
        ("/guide", "guide/"),
        ("/", "ui/"),
    ],
)
def test_redirects_stay_on_this_host_and_below_its_prefix(
    api: httpx.Client, path: str, to: str
) -> None:
    answer = api.get(api.base_url.join(path), headers={"Host": "evil.example"})
    assert answer.status_code == 307
    assert answer.headers["location"].removeprefix("./") == to
    assert api.get(answer.url.join(to)).status_code < 400


@pytest.mark.parametrize(
    ("host", "known"),
    [
        ("lab.example", True),
        ("LAB.example.:8443", True),
        ("a.inside.example", True),
        ("[fd00::7]:8000", True),
        ("localhost:1", True),
        ("[::1]", True),
        ("inside.example", False),
        ("notlab.example", False),
        ("lab.example.evil.example", False),
        ("evil.example", False),
        ("[::1", False),
        ("", False),
    ],
)
def test_a_service_answers_to_its_names_alone_where_they_are_listed(
    small: LocalService, host: str, known: bool
) -> None:
    with httpx.Client(
        base_url=small.url, headers={"Host": host}, trust_env=False, timeout=60
    ) as client:
        assert client.get("/readyz").is_success  # probes know no name
        answer = client.get("/api/v1/projects")
    if known:
        is_problem(answer, 401)
    else:
        assert "MODALBASE_ALLOWED_HOSTS" in str(is_problem(answer, 421)["detail"])


def test_small_parts_of_an_answer_go_out_at_once() -> None:
    """Asyncio asks that of a connection that has its protocol; without, each answer took 40 ms more."""
    with listening_socket("127.0.0.1", 0) as listener:
        assert listener.proto == socket.IPPROTO_TCP


def test_body_over_the_limit_is_413(small: LocalService) -> None:
    headers = {"Authorization": f"Bearer {small.new_key('k')}", **JSON}
    with httpx.Client(
        base_url=f"{small.url}/api/v1/", headers=headers, trust_env=False, timeout=60
    ) as client:
        long = json.dumps({"name": "x", "description": "y" * 2000}).encode()
        is_problem(client.post("projects", content=long), 413)
        # of undeclared length
        is_problem(client.post("projects", content=iter([long[:900], long[900:]])), 413)
        assert client.get("projects").json()["items"] == []
        (campaign,) = campaigns_of(client, "x")
        uploads_over_the_limit_are_413(client, f"campaigns/{campaign}")


def uploads_over_the_limit_are_413(client: httpx.Client, campaign: str) -> None:
    """Of a body whose length nobody declared, the limit is found on the way; nothing of it is
    stored.
    """
    block = b"    -1\n" * 300
    raw = {"Content-Type": "application/octet-stream"}
    is_problem(client.post(f"{campaign}/imports", content=iter([block] * 3), headers=raw), 413)
    form = {"Content-Type": "multipart/form-data; boundary=x"}
    head = b'--x\r\nContent-Disposition: form-data; name="file"; filename="a.uff"\r\n\r\n'
    is_problem(
        client.post(f"{campaign}/imports", content=iter([head, *[block] * 3]), headers=form), 413
    )
    npz = {"Content-Type": "application/x-npz"}
    is_problem(client.post(f"{campaign}/frfs", content=iter([block] * 3), headers=npz), 413)
    points = "label,x_m,y_m\n" + "".join(f"{n},0,0\n" for n in range(1, 200))
    refused = client.put(
        f"{campaign}/grid-points", content=points, headers={"Content-Type": "text/csv"}
    )
    assert (
        is_problem(refused, 413)["detail"]
        == f"the body has {len(points)} bytes, the operator allows 1000"
    )
    assert client.get(f"{campaign}/imports").json()["items"] == []


def test_a_request_that_is_broken_off_is_no_error_of_ours(
    service: LocalService, api: httpx.Client, campaign: str
) -> None:
    """Nothing is stored, and neither log nor metrics say 500, which somebody would be called
    for.
    """
    key = api.headers["authorization"]
    head = (
        f"POST /api/v1/campaigns/{campaign}/imports HTTP/1.1\r\nHost: x\r\nAuthorization:"
        f" {key}\r\nContent-Type: application/octet-stream\r\nContent-Length: 1000000\r\nExpect:"
        " 100-continue\r\n\r\n"
    )
    with socket.create_connection(("127.0.0.1", httpx.URL(service.url).port)) as line:
        line.sendall(head.encode())
        assert line.recv(1000).startswith(b"HTTP/1.1 100 Continue")  # the service has begun to read
        line.sendall(b"    -1\n" * 1000)
    count = 'modalbase_http_request_seconds_count{method="POST",route="/campaigns/{campaign_id}/imports",status="%s"}'

    def metrics() -> str:
        return httpx.get(f"{service.url}/metrics", trust_env=False, timeout=60).text

    until(lambda: count % 499 in metrics(), "the end of the request", metrics)
    assert count % 500 not in metrics()
    assert api.get(f"campaigns/{campaign}/imports").json()["items"] == []


def answers_of(app: FastAPI, key: str, *paths: str) -> list[httpx.Response]:
    """What an application in this process answers, one after the other."""

    async def ask() -> list[httpx.Response]:
        transport, headers = httpx.ASGITransport(app), {"Authorization": f"Bearer {key}"}
        async with httpx.AsyncClient(
            transport=transport, base_url="http://test", headers=headers
        ) as client:
            return [await client.get(path) for path in paths]

    return completed(ask())


def test_without_a_database_503_and_nothing_of_how_it_is_reached(
    new_database: Callable[[], str],
) -> None:
    url = new_database()
    app = create_app(Settings(database_url=url))
    with app.state.sessions.begin() as session:
        key = create_key(session, user_named(session, "k"), "test")[1]
    paths = "/readyz", "/api/v1/projects", "/healthz"
    assert [answer.status_code for answer in answers_of(app, key, *paths)] == [200, 200, 200]
    admin = make_url(url).set(database="postgres").render_as_string(hide_password=False)
    with psycopg.connect(admin, autocommit=True) as connection:
        connection.execute(f"DROP DATABASE {make_url(url).database} WITH (FORCE)")
    ready, projects, health = answers_of(app, key, *paths)
    assert is_problem(ready, 503)["detail"] == "the database does not answer"
    assert is_problem(projects, 503)["detail"] == "the database does not answer; try again"
    assert health.status_code == 200
    app.state.engine.dispose()


def test_when_all_connections_are_taken_503(new_database: Callable[[], str]) -> None:
    app = create_app(Settings(database_url=new_database(), database_pool=1))
    engine, wrong = app.state.engine, "mb_000000000000_x"
    engine.pool._timeout = 0.05  # in place of half a minute

    with engine.connect(), engine.connect(), engine.connect():
        (answer,) = answers_of(app, wrong, "/api/v1/projects")
        assert is_problem(answer, 503)["detail"] == "the database does not answer; try again"
    (answer,) = answers_of(app, wrong, "/api/v1/projects")
    assert is_problem(answer, 401)
    engine.dispose()


def test_request_id_is_the_clients_where_sane(api: httpx.Client) -> None:
    assert (
        api.get("projects", headers={"X-Request-ID": "lab-42"}).headers["x-request-id"] == "lab-42"
    )
    assert re.fullmatch(
        "[0-9a-f]{32}", api.get("projects", headers={"X-Request-ID": "a b"}).headers["x-request-id"]
    )


def test_health_metrics_and_documentation_need_no_key_and_no_internet(
    service: LocalService,
) -> None:
    with httpx.Client(base_url=service.url, trust_env=False, timeout=60) as client:
        assert client.get("/healthz").json()["status"] == "ok"
        assert client.get("/readyz").json() == {"status": "ok"}
        assert "modalbase_http_request_seconds_bucket" in client.get("/metrics").text
        assert all(
            path.startswith("/api/v1/") or path in ("/healthz", "/readyz")
            for path in client.get("/openapi.json").json()["paths"]
        )


def test_no_page_asks_another_host(service: LocalService) -> None:
    """What a page names is here, and its policy lets a browser ask nobody else, whatever the
    scripts want.
    """
    with httpx.Client(
        base_url=service.url, trust_env=False, timeout=60, follow_redirects=True
    ) as client:
        for path in ("/docs", "/redoc"):
            answer = client.get(path)
            assert "://" not in answer.text
            for named in re.findall(r'(?:src|href|url)(?:=|: )["\']([^"\']+)', answer.text):
                assert client.get(f"/{named}").is_success, named
            policy = dict(
                rule.split(" ", 1) for rule in answer.headers["content-security-policy"].split("; ")
            )
            assert (
                policy.pop("default-src")
                == policy["frame-ancestors"]
                == policy["base-uri"]
                == "'none'"
            )
            scripts = re.findall(r"<script>(.*?)</script>", answer.text, flags=re.DOTALL)
            digests = [
                b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts
            ]
            allowed = {"'self'", "'none'", "data:", *(f"'sha256-{digest}'" for digest in digests)}
            assert allowed.issuperset(word for words in policy.values() for word in words.split())
            # else the bundle shows a picture of its makers' server
            assert '"validatorUrl": null' in answer.text


@pytest.mark.parametrize(
    "path", ["/docs", "/healthz", "/api/v1/projects", "/nowhere", "/openapi.json", "/metrics"]
)
def test_every_answer_has_the_headers_that_protect_a_browser(
    service: LocalService, path: str
) -> None:
    headers = httpx.get(service.url + path, trust_env=False, timeout=60).headers
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["x-frame-options"] == "DENY"
    assert headers["referrer-policy"] == "no-referrer"
    assert "default-src 'none'" in headers["content-security-policy"]
    assert "server" not in headers


def test_documentation_pages_and_metrics_can_be_switched_off(small: LocalService) -> None:
    with httpx.Client(base_url=small.url, trust_env=False, timeout=60) as client:
        for path in (
            "/",
            "/docs",
            "/redoc",
            "/openapi.json",
            "/metrics",
            "/static-offline-docs/favicon.png",
            "/ui/",
            "/sign-in",
        ):
            assert client.get(path).status_code == 404, path
        assert client.get("/readyz").is_success


def test_a_float_of_integer_value_is_an_integer(api: httpx.Client, structure: str) -> None:
    """As numpy writes them."""
    body = {
        "name": "c",
        "boundary": "free",
        "instruments": {"sensor_mass_kg": 0, "sensor_point": 3.0},
    }
    made = api.post(f"structures/{structure}/campaigns", json=body).raise_for_status().json()
    assert made["instruments"]["sensor_point"] == 3


def test_openapi_describes_everything_and_lists_every_error(service: LocalService) -> None:
    document = httpx.get(f"{service.url}/openapi.json", trust_env=False, timeout=60).json()
    assert undescribed(document) == []
    stated = {"application/problem+json": {"schema": {"$ref": "#/components/schemas/Problem"}}}
    for path, operations in document["paths"].items():
        for method, operation in operations.items():
            errors = {
                code: answer for code, answer in operation["responses"].items() if code[0] in "45"
            }
            assert all(answer["content"] == stated for answer in errors.values()), path
            if path.startswith("/api/"):
                assert errors.keys() >= {"401", "403", "404", "422", "429", "503"}, path
                assert ("415" in errors) == ("requestBody" in operation), (path, method)
            sizes = [
                one["schema"] for one in operation.get("parameters", []) if one["name"] == "limit"
            ]
            # grid points come whole where none is stated
            sizes = [size for size in sizes if "default" in size]
            # their rows are large
            rows = 20 if path.endswith(("/processings", "/identifications")) else 100
            most = (1000, 1, 10_000) if "/series" in path else (rows, 1, 1000)
            assert all(
                (size["default"], size["minimum"], size["maximum"]) == most for size in sizes
            ), path
    assert [tag["name"] for tag in document["tags"]][:4] == [
        "projects",
        "structures",
        "campaigns",
        "grid points",
    ]
    result = document["paths"]["/api/v1/update-jobs/{job_id}/result"]["get"]["responses"]["200"]
    (reference,) = result["content"]["application/json"]["schema"].values()
    shown = document["components"]["schemas"][reference.rsplit("/", 1)[1]]["properties"]
    assert list(shown)[:2] == ["verdict", "warnings"]


def test_the_documentation_page_makes_up_no_names(service: LocalService) -> None:
    """Swagger shows `additionalProp1` for every object whose members it does not know and that has
    no example.
    """

    def open_ones(node: Any, place: str) -> Iterator[str]:
        if isinstance(node, dict):
            if node.get("additionalProperties") not in (None, False) and "examples" not in node:
                yield place
            for key, part in node.items():
                yield from open_ones(part, f"{place}/{key}")
        elif isinstance(node, list):
            for i, part in enumerate(node):
                yield from open_ones(part, f"{place}/{i}")

    document = httpx.get(f"{service.url}/openapi.json", trust_env=False, timeout=60).json()
    assert list(open_ones(document, "")) == []
