"""`Idempotency-Key` of every operation that creates, taken from the service's own document."""

import json
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any
from uuid import uuid4

import httpx
import pytest
from sqlalchemy import Engine, func, literal, select, text, union_all

from modalbase import connect
from service.app.supervisor import LocalService
from service.nouns.updates.schemas import UpdateJobOut
from service.pages.example import paper
from service.platform.db.base import Base
from service.platform.db.engine import make_engine, make_sessions
from service.platform.db.schema import upgrade
from tests.integration.test_db import fill
from tests.support.access import operations
from tests.support.furnished import BODIES, HOOK, furnish, record
from tests.support.rest import RAW, client_of, ok
from tests.support.waiting import PATIENCE


@dataclass
class Place:
    """A furnished project of a service that runs no jobs."""

    api: httpx.Client
    engine: Engine
    ids: dict[str, str]
    document: dict[str, Any]
    other: httpx.Client

    def rows(self) -> dict[str, int]:
        """How many rows each table has."""
        counts = (
            select(literal(each.name), func.count()).select_from(each)
            for each in Base.metadata.sorted_tables
        )
        with self.engine.connect() as connection:
            return dict(connection.execute(union_all(*counts)).all())


@pytest.fixture(scope="module")
def place(idle: LocalService) -> Iterator[Place]:
    engine = make_engine(idle.settings.database_url, pool_size=2)
    document = httpx.get(f"{idle.url}/openapi.json", timeout=PATIENCE, trust_env=False).json()
    with client_of(idle, "owner") as api, client_of(idle, "owner") as other:
        yield Place(api, engine, furnish(api, make_sessions(engine), "once"), document, other)
    engine.dispose()


def creating(document: dict[str, Any]) -> list[str]:
    """The operations that create: each POST that is answered 201, or 202 while a job does the
    work; and whatever else takes a key.
    """
    return [
        name
        for name, operation in operations(document).items()
        if (name.startswith("POST") and operation["responses"].keys() & {"201", "202"})
        or "Idempotency-Key" in str(operation.get("parameters"))
    ]


def request_of(name: str, ids: dict[str, str]) -> dict[str, Any]:
    """What an operation is sent."""
    if name.endswith(("/imports", "/model")):
        params = {"filename": f"{uuid4()}.inp"}
        if name.startswith("POST /structures/{structure_id}/imports"):
            params["campaign"] = json.dumps({"name": "sent at once", "boundary": "cantilever"})
        return {"content": paper.uff_file(), "headers": RAW, "params": params}
    project = {"project": ids["project_id"]}
    own: dict[str, Any] = {
        "POST /update-jobs": {"jobs": [{"campaign_id": ids["campaign_id"]}]},
        "POST /webhooks": {**project, "url": HOOK},
        "POST /searches": {**project, "name": "n", "noun": "frfs", "q": "x"},
        "POST /projects/{project_id}/instruments": {"kind": "sensor", "serial": str(uuid4())},
        "POST /campaigns/{campaign_id}/records": record(hit=7),
    }
    body = own.get(name, BODIES.get(name))
    return {} if body is None else {"json": body}


def test_every_operation_that_creates_takes_a_key_and_makes_one(place: Place) -> None:
    """A new operation that forgets the key, or what it made, fails here."""
    names = creating(place.document)
    assert len(names) > 25
    with place.engine.begin() as connection:  # one that waits is not sent again
        connection.execute(text("UPDATE deliveries SET state = 'failed'"))
    for name in names:
        headers = [one["name"].lower() for one in operations(place.document)[name]["parameters"]]
        assert "idempotency-key" in headers, name
        sent = request_of(name, place.ids)
        key = {"headers": {**sent.pop("headers", {}), "Idempotency-Key": "the same for all"}}
        path = name.removeprefix("POST /").format(**place.ids)
        first = place.api.post(path, **sent, **key)
        assert first.is_success, f"{name}: {first.text}"
        before = place.rows()
        again = place.api.post(path, **sent, **key)
        assert again.status_code == first.status_code, name
        assert again.content == first.content, name
        kept = ("location", "etag", "set-cookie", "content-type")
        assert [again.headers.get(one) for one in kept] == [
            first.headers.get(one) for one in kept
        ], name
        assert place.rows() == before, name


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("POST /projects", {"name": "another"}),
        ("POST /projects/{project_id}/structures", {"density_kg_m3": 1901.0}),
        ("POST /campaigns/{campaign_id}/update-jobs", {"seed": 5}),
        ("POST /campaigns/{campaign_id}/frfs", {"quantity": "mobility"}),
        ("POST /campaigns/{campaign_id}/records", record(hit=9)),
        ("POST /campaigns/{campaign_id}/mode-sets", {"name": "another"}),
        ("POST /campaigns/{campaign_id}/processings", {"delay_s": 0.001}),
    ],
)
def test_a_key_with_another_body_is_refused(
    place: Place, name: str, change: dict[str, Any]
) -> None:
    path, body = name.removeprefix("POST /").format(**place.ids), BODIES[name]
    if path.endswith("/records"):
        body = record(hit=8)
    key = {"Idempotency-Key": str(uuid4())}
    ok(place.api.post(path, json=body, headers=key))
    before = place.rows()
    answer = place.api.post(path, json={**body, **change}, headers=key)
    assert [one["pointer"] for one in ok(answer, 422)["errors"]] == ["Idempotency-Key"]
    assert place.rows() == before


def test_members_in_another_order_and_defaults_that_are_stated_are_the_same_request(
    place: Place,
) -> None:
    path, key = (
        f"campaigns/{place.ids['campaign_id']}/update-jobs",
        {"Idempotency-Key": str(uuid4())},
    )
    typed = {**key, "Content-Type": "application/json"}
    first = ok(place.api.post(path, content=b'{"seed": 3, "band_hz": [1, 9]}', headers=typed))
    same = place.api.post(
        path, content=b'{"band_hz":[1.0,9.0],"posterior":"laplace","seed":3}', headers=typed
    )
    assert ok(same) == first


def test_files_are_compared_by_what_is_in_them(place: Place) -> None:
    path, key = f"campaigns/{place.ids['campaign_id']}/imports", {"Idempotency-Key": str(uuid4())}
    file = paper.uff_file()

    def sent(content: bytes) -> httpx.Response:
        return place.api.post(
            path, files={"file": ("a.uff", content)}, headers=key, params={"dry_run": True}
        )

    first = ok(sent(file), 202)
    assert ok(sent(file), 202) == first  # in another multipart body, which has another boundary
    assert ok(sent(file + b"\n"), 422)["errors"][0]["pointer"] == "Idempotency-Key"


def test_a_file_that_is_not_read_yet_is_queued_once(place: Place) -> None:
    path, key = f"campaigns/{place.ids['campaign_id']}/frfs", {"Idempotency-Key": str(uuid4())}
    headers = {**key, "Content-Type": "text/csv"}
    params = {"quantity": "accelerance"}
    first, second = (
        ok(place.api.post(path, content=b"x,y\n", headers=headers, params=params), 202)
        for _ in "12"
    )
    assert first["id"] == second["id"]
    other = place.api.post(path, content=b"x,z\n", headers=headers, params=params)
    assert ok(other, 422)["errors"][0]["pointer"] == "Idempotency-Key"


def test_a_refused_request_leaves_its_key_free(place: Place) -> None:
    key = {"Idempotency-Key": str(uuid4())}
    assert place.api.post("projects", json={"name": ""}, headers=key).status_code == 422
    ok(place.api.post("projects", json={"name": "mended"}, headers=key), 201)


def test_a_secret_is_answered_again_to_its_own_key_alone_and_is_not_stored(place: Place) -> None:
    key = {"Idempotency-Key": str(uuid4())}
    made = ok(place.api.post("api-keys", json={"name": "k"}, headers=key), 201)
    assert ok(place.api.post("api-keys", json={"name": "k"}, headers=key), 201) == made
    # another key of the same user
    other = place.other.post("api-keys", json={"name": "k"}, headers=key)
    assert "another API key" in ok(other, 409)["detail"]
    with place.engine.connect() as connection:
        answers = connection.scalars(text("SELECT answer FROM idempotency_keys")).all()
    secret = made["key"].split("_", 2)[2].encode()  # it may hold underscores of its own
    assert answers
    assert not any(secret in bytes(answer) for answer in answers)


def test_who_has_lost_the_role_gets_no_answer_from_memory(place: Place) -> None:
    structure, key = (
        f"structures/{place.ids['structure_id']}/campaigns",
        {"Idempotency-Key": str(uuid4())},
    )
    made = ok(place.api.post(structure, json=paper.CAMPAIGN, headers=key), 201)
    ok(place.api.post(structure, json=paper.CAMPAIGN, headers=key), 201)
    role = text("UPDATE members SET role = :role WHERE project_id = :project")
    project = place.ids["project_id"]
    with place.engine.begin() as connection:
        connection.execute(role, {"role": "viewer", "project": project})
    try:
        assert place.api.post(structure, json=paper.CAMPAIGN, headers=key).status_code == 403
    finally:
        with place.engine.begin() as connection:
            connection.execute(role, {"role": "owner", "project": project})
    assert ok(place.api.post(structure, json=paper.CAMPAIGN, headers=key), 201) == made


def test_eight_clients_at_once_with_one_key_make_one(place: Place) -> None:
    path, key = f"projects/{place.ids['project_id']}/structures", {"Idempotency-Key": str(uuid4())}
    with ThreadPoolExecutor(8) as pool:
        answers = list(
            pool.map(lambda _: place.api.post(path, json=paper.STRUCTURE, headers=key), range(8))
        )
    assert len({ok(answer, 201)["id"] for answer in answers}) == 1


def test_keys_of_update_jobs_come_along(empty: Engine) -> None:
    upgrade(empty, "0055_sensitivities")
    with empty.begin() as connection:
        (job,) = fill(connection)["update_jobs"]
        user = connection.scalar(text("SELECT id FROM users LIMIT 1"))
        connection.execute(
            text(
                "UPDATE update_jobs SET idempotency_key = 'k1', recipe = '{\"seed\": 4}' WHERE id"
                " = :id"
            ),
            {"id": job["id"]},
        )
        connection.execute(
            text(
                "INSERT INTO audit_events (user_id, action, subject_type, subject_id, detail)"
                " VALUES (:user, 'update_job.create', 'update_job', :id, '{}')"
            ),
            {"id": job["id"], "user": user},
        )
    upgrade(empty, "head")
    with empty.connect() as connection:
        row = connection.execute(text("SELECT * FROM idempotency_keys")).mappings().one()
    assert (row["user_id"], row["key"], row["request_sha256"]) == (user, "k1", None)
    assert row["operation"] == "/campaigns/{campaign_id}/update-jobs"
    status, headers, body = json.loads(bytes(row["answer"]))
    assert (status, dict(headers)["location"]) == (202, f"/api/v1/update-jobs/{job['id']}")
    carried = UpdateJobOut.model_validate_json(body)
    assert (carried.id, carried.recipe.seed) == (job["id"], 4)


MODE = {"frequency_hz": 25.61, "damping_ratio": 0.01}


@pytest.mark.parametrize(
    ("path", "body"),
    [
        ("projects", {}),
        ("projects/{project_id}/structures", paper.STRUCTURE),
        ("structures/{structure_id}/campaigns", paper.CAMPAIGN),
        ("structures/{structure_id}/coupon-batches", {"constants": ["Ex"]}),
        ("structures/{structure_id}/monitors", BODIES["POST /structures/{structure_id}/monitors"]),
        ("campaigns/{campaign_id}/mode-sets", {"modes": [MODE]}),
    ],
)
def test_eight_at_once_make_one_unless_it_is_there(
    place: Place, path: str, body: dict[str, Any]
) -> None:
    name, at = str(uuid4()), path.format(**place.ids)

    def make(_: int) -> httpx.Response:
        return place.api.post(at, json={**body, "name": name}, params={"unless_named": True})

    with ThreadPoolExecutor(8) as pool:
        answers = list(pool.map(make, range(8)))
    assert sorted(answer.status_code for answer in answers) == 7 * [200] + [201]
    assert len({ok(answer)["id"] for answer in answers}) == 1
    assert len({answer.headers["location"] for answer in answers}) == 1


def test_the_librarys_create_makes_one_of_eight_at_once(place: Place) -> None:
    name = str(uuid4())
    stated = {member: value for member, value in paper.STRUCTURE.items() if member != "name"}

    def make(_: int) -> tuple[str, str, str]:
        key = place.api.headers["authorization"].removeprefix("Bearer ")
        with connect(str(place.api.base_url).removesuffix("/api/v1/"), key) as lab:
            project = lab.project(name, create=True)
            structure = project.structure(create=True, which="beam", **stated)
            campaign = structure.campaign("March", create=True, boundary="free")
            return project.id, structure.id, campaign.id

    with ThreadPoolExecutor(8) as pool:
        assert len(set(pool.map(make, range(8)))) == 1


def test_one_file_of_eight_clients_at_once_is_imported_once(place: Place) -> None:
    made = ok(
        place.api.post(f"structures/{place.ids['structure_id']}/campaigns", json=paper.CAMPAIGN),
        201,
    )["id"]
    content = paper.uff_file()

    def send(_: int) -> httpx.Response:
        return place.api.post(
            f"campaigns/{made}/imports", content=content, headers=RAW, params={"filename": "a.uff"}
        )

    with ThreadPoolExecutor(8) as pool:
        answers = list(pool.map(send, range(8)))
    assert sorted(answer.status_code for answer in answers) == 7 * [200] + [202]
    assert len({ok(answer)["id"] for answer in answers}) == 1
