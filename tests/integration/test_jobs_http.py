"""Update jobs over HTTP: events, keys of idempotency, another try, many at once, lists, metrics."""

import json
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any
from uuid import uuid4

import httpx
import pytest
from sqlalchemy import text

from service.app.application import create_app
from service.app.supervisor import LocalService
from service.platform.db.engine import make_engine
from service.platform.queue.events import Changes
from service.platform.settings import Settings
from tests.support.rest import ok
from tests.support.waiting import completed, until

NOWHERE = "postgresql://nobody@127.0.0.1:1/nothing"


@pytest.fixture
def start(api: httpx.Client, campaign: str) -> Callable[..., dict[str, Any]]:
    """Starts an update of a campaign without FRFs, which fails soon, with that reason."""

    def post(recipe: dict[str, Any] | None = None, **headers: str) -> dict[str, Any]:
        answer = api.post(f"campaigns/{campaign}/update-jobs", json=recipe or {}, headers=headers)
        made: dict[str, Any] = ok(answer, 202)
        assert answer.headers["Location"] == f"/api/v1/update-jobs/{made['id']}"
        return made

    return post


def events_of(lines: Iterator[str]) -> list[tuple[int, dict[str, Any]]]:
    """Id and data of each event of a stream that ends."""
    events, data = [], {}
    for line in lines:
        if line.startswith("data: "):
            data = json.loads(line[6:])
        elif line.startswith("id: "):
            events.append((int(line[4:]), data))
    return events


def watch(api: httpx.Client, job: str, last: int | None = None) -> list[tuple[int, dict[str, Any]]]:
    headers = {} if last is None else {"Last-Event-ID": str(last)}
    with api.stream("GET", f"update-jobs/{job}/events", headers=headers) as answer:
        assert answer.status_code == 200
        assert answer.headers["content-type"].startswith("text/event-stream")
        return events_of(answer.iter_lines())


def test_events_tell_the_whole_story_and_end(
    api: httpx.Client, start: Callable[..., dict[str, Any]]
) -> None:
    job = start()
    story = watch(api, job["id"])
    ids = [number for number, _ in story]
    assert ids == sorted(set(ids))
    # A job that fails at once may have ended before the stream began.
    assert len(story) == 1 or story[0][1]["status"] in ("queued", "running")
    assert [state["status"] for _, state in story][-1] == "failed"
    assert "no FRFs" in story[-1][1]["error"]["detail"]
    shown = api.get(f"update-jobs/{job['id']}").json()
    assert all(
        shown[name] == value for name, value in story[-1][1].items() if not name.endswith("_at")
    )


def test_who_comes_back_is_told_what_is_new(
    api: httpx.Client, start: Callable[..., dict[str, Any]]
) -> None:
    job = start()
    story = watch(api, job["id"])
    last = story[-1][0]
    assert watch(api, job["id"], last=last - 1) == story[-1:]
    assert watch(api, job["id"], last=10**9) == story[-1:]  # no id of ours: the state of now
    again = api.get(f"update-jobs/{job['id']}/events", headers={"Last-Event-ID": str(last)})
    assert (again.status_code, again.content) == (204, b"")


def test_events_go_on_when_the_notices_are_cut_off(
    api: httpx.Client, start: Callable[..., dict[str, Any]], service: LocalService
) -> None:
    engine = make_engine(service.settings.database_url)
    cut = text(
        "SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity"
        " WHERE datname = current_database() AND application_name = 'modalbase notices'"
    )
    with engine.connect() as connection:
        until(lambda: connection.scalar(cut), "a connection of the API for notices")
    engine.dispose()
    assert watch(api, start()["id"])[-1][1]["status"] == "failed"


def events_of_a_deaf_api(
    api: httpx.Client, service: LocalService, job: str, streams: int
) -> httpx.Response:
    """What an API answers that hears nothing from the database, with the same rows, of so many
    streams.
    """
    app = create_app(Settings(database_url=service.settings.database_url))
    app.state.changes = Changes(NOWHERE, app.state.sessions, streams)
    assert app.state.changes.patience < 1

    async def watched() -> httpx.Response:
        transport = httpx.ASGITransport(app)
        async with httpx.AsyncClient(
            transport=transport, base_url="http://here/api/v1/", headers=api.headers
        ) as client:
            return await client.get(f"update-jobs/{job}/events")

    answer = completed(watched())
    app.state.engine.dispose()
    return answer


def test_events_come_by_looking_where_no_notice_ever_does_and_streams_beyond_the_limit_are_refused(
    api: httpx.Client, start: Callable[..., dict[str, Any]], service: LocalService
) -> None:
    job = start()["id"]
    answer = events_of_a_deaf_api(api, service, job, 10)
    assert answer.status_code == 200
    assert events_of(iter(answer.text.splitlines()))[-1][1]["status"] == "failed"
    assert events_of_a_deaf_api(api, service, job, 0).status_code == 429


def test_retry_runs_the_same_job_again(
    api: httpx.Client,
    start: Callable[..., dict[str, Any]],
    finished: Callable[[str], dict[str, Any]],
) -> None:
    path = f"update-jobs/{start()['id']}"
    first = finished(path)
    assert (first["status"], first["attempt"]) == ("failed", 1)
    again = ok(api.post(f"{path}/retry"), 202)
    assert again["created_at"] == first["created_at"]
    assert (again["error"], again["finished_at"]) == (None, None)
    second = finished(path)
    assert (second["status"], second["attempt"]) == ("failed", 2)


def test_same_key_same_job_other_body_refused(
    start: Callable[..., dict[str, Any]], api: httpx.Client
) -> None:
    key = {"Idempotency-Key": str(uuid4())}
    first = start({"seed": 1}, **key)
    assert start({"seed": 1}, **key)["id"] == first["id"]
    answer = api.post(
        f"campaigns/{first['campaign_id']}/update-jobs", json={"seed": 2}, headers=key
    )
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["pointer"] == "Idempotency-Key"
    assert start({"seed": 1})["id"] != first["id"]


def test_same_key_sent_many_times_at_once_is_one_job(start: Callable[..., dict[str, Any]]) -> None:
    key = {"Idempotency-Key": str(uuid4())}
    with ThreadPoolExecutor(8) as pool:
        made = list(pool.map(lambda _: start({"seed": 1}, **key)["id"], range(8)))
    assert len(set(made)) == 1


def test_same_key_at_once_for_two_campaigns_is_one_job_and_one_refusal(
    api: httpx.Client, new_campaign: Callable[..., str]
) -> None:
    campaigns, key = [new_campaign(), new_campaign()], {"Idempotency-Key": str(uuid4())}
    with ThreadPoolExecutor(2) as pool:
        answers = list(
            pool.map(
                lambda c: api.post(f"campaigns/{c}/update-jobs", json={}, headers=key), campaigns
            )
        )
    assert sorted(answer.status_code for answer in answers) == [202, 422]


def test_many_campaigns_in_one_call(
    api: httpx.Client, new_campaign: Callable[..., str], finished: Callable[[str], dict[str, Any]]
) -> None:
    campaigns = [new_campaign() for _ in range(3)]
    jobs: list[dict[str, Any]] = [{"campaign_id": campaign} for campaign in campaigns]
    jobs[1]["recipe"] = {"seed": 5}
    body, key = {"recipe": {"seed": 3}, "jobs": jobs}, {"Idempotency-Key": str(uuid4())}
    made = ok(api.post("update-jobs?priority=7", json=body, headers=key), 202)["items"]
    assert [job["campaign_id"] for job in made] == campaigns
    assert [job["recipe"]["seed"] for job in made] == [3, 5, 3]
    assert {job["priority"] for job in made} == {7}
    assert (
        ok(api.post("update-jobs", json=body, headers=key), 202)["items"][0]["id"] == made[0]["id"]
    )
    shorter = {**body, "jobs": jobs[:2]}
    assert api.post("update-jobs", json=shorter, headers=key).status_code == 422
    assert {finished(f"update-jobs/{job['id']}")["status"] for job in made} == {"failed"}


def test_list_by_project_structure_campaign_and_state(
    api: httpx.Client, project: str, structure: str, new_campaign: Callable[..., str]
) -> None:
    first, second = new_campaign(), new_campaign()
    made = ok(
        api.post(
            "update-jobs", json={"jobs": [{"campaign_id": c} for c in (first, second, second)]}
        ),
        202,
    )
    ids = [job["id"] for job in made["items"]]

    def listed(**params: Any) -> list[str]:
        return [job["id"] for job in ok(api.get("update-jobs", params=params), 200)["items"]]

    assert listed() == listed(project=project) == listed(structure=structure) == ids[::-1]
    assert listed(campaign=second) == ids[:0:-1]
    everything = ["queued", "running", "succeeded", "failed", "cancelled"]
    assert listed(campaign=first, status=everything) == ids[:1]
    assert listed(status=["succeeded", "cancelled"]) == []
    assert api.get("update-jobs", params={"project": str(uuid4())}).status_code == 404
    assert api.get("update-jobs", params={"status": "done"}).status_code == 422


@pytest.mark.parametrize("priority", ["-101", "101", "high", "1.5"])
def test_wrong_priorities_are_refused(api: httpx.Client, campaign: str, priority: str) -> None:
    assert (
        api.post(f"campaigns/{campaign}/update-jobs?priority={priority}", json={}).status_code
        == 422
    )


def test_metrics_are_where_prometheus_looks(
    start: Callable[..., dict[str, Any]],
    finished: Callable[[str], dict[str, Any]],
    service: LocalService,
) -> None:
    finished(f"update-jobs/{start()['id']}")
    shown = httpx.get(f"{service.url}/metrics", trust_env=False, timeout=60).text
    assert "# TYPE modalbase_jobs_ended_total counter" in shown
    assert "# TYPE modalbase_job_run_seconds histogram" in shown


def test_job_carries_the_id_of_its_request(
    api: httpx.Client, campaign: str, rows: Callable[..., list[dict[str, Any]]]
) -> None:
    name = f"test-{uuid4()}"
    answer = api.post(f"campaigns/{campaign}/update-jobs", json={}, headers={"X-Request-ID": name})
    assert rows("SELECT request_id FROM jobs WHERE id = %s", answer.json()["id"]) == [
        {"request_id": name}
    ]
