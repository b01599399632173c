"""The concurrency model of docs/limits.md, at ten times its size."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from uuid import uuid4

import httpx
import pytest

from service.app.supervisor import LocalService
from service.settings import Settings
from tests.support.crowd import at_once, statuses, with_crowd
from tests.support.laboratory import BEAM
from tests.support.rest import client_of, ok

SLOTS, QUEUE = 4, 20


@pytest.fixture(scope="module")
def narrow(new_database: Callable[[], str]) -> Iterator[LocalService]:
    """A service that answers few requests at a time, with few streams of events; those that may wait do, however slow the
    machine is.
    """
    settings = Settings(
        database_url=new_database(),
        port=0,
        log_level="error",
        database_pool=SLOTS,
        request_queue=QUEUE,
        request_wait_seconds=600,
        event_streams=4,
    )
    with LocalService(settings, worker=False) as running:
        yield running


def test_a_burst_of_one_key_is_answered(service: LocalService) -> None:
    answers = at_once(service, service.new_key(f"burst-{uuid4()}"), "projects?limit=5", 200)
    assert statuses(answers) == {200: 200}


def test_beyond_what_may_wait_the_answer_says_so_and_when_to_come_back(narrow: LocalService) -> None:
    key = narrow.new_key("hasty")
    answers = at_once(narrow, key, "projects?limit=5", 10 * (SLOTS + QUEUE))
    counted = statuses(answers)
    assert set(counted) <= {200, 429, 503}
    assert counted[200] >= SLOTS + QUEUE // 2, counted
    assert counted[429] + counted[503] > 0, counted
    for refused in (answer for answer in answers if answer.status_code != 200):
        assert int(refused.headers["Retry-After"]) >= 1
        assert "wait" in refused.json()["detail"]
        assert "database" not in refused.json()["detail"]
    assert statuses(at_once(narrow, key, "projects", 1)) == {200: 1}


def test_one_key_in_a_hurry_does_not_hold_up_another(narrow: LocalService) -> None:
    """While one key has far more requests than may wait, each of another key's is answered."""
    hasty, calm = narrow.new_key("hasty"), narrow.new_key("calm")
    assert statuses(at_once(narrow, calm, "projects", 1)) == {200: 1}

    async def crowd(client: httpx.AsyncClient) -> tuple[list[httpx.Response], list[httpx.Response]]:
        pressing = [asyncio.ensure_future(client.get("projects")) for _ in range(10 * QUEUE)]
        own = {"Authorization": f"Bearer {calm}"}
        answered = [await client.get("projects", headers=own) for _ in range(10)]
        return answered, await asyncio.gather(*pressing)

    answered, pressed = asyncio.run(with_crowd(narrow, hasty, crowd))
    assert statuses(answered) == {200: 10}
    assert 429 in statuses(pressed)


def test_many_streams_of_events_hold_nothing_up(service: LocalService, api: httpx.Client, campaign: str) -> None:
    """200 streams at once; lists and health answer beside them, and each stream sees its job's end."""
    key = api.headers["Authorization"].removeprefix("Bearer ")

    async def crowd(client: httpx.AsyncClient) -> tuple[list[str], list[httpx.Response]]:
        opened = asyncio.Semaphore(0)
        second = {"Authorization": f"Bearer {(await client.post('api-keys', json={'name': 'x'})).json()['key']}"}
        jobs = [(await client.post(f"campaigns/{campaign}/update-jobs", json={})).json()["id"] for _ in range(5)]

        async def watch(job: str, **headers: str) -> str:
            async with client.stream("GET", f"update-jobs/{job}/events", headers=headers) as answer:
                assert answer.status_code == 200, await answer.aread()
                opened.release()
                return (await answer.aread()).decode()

        watching = [asyncio.ensure_future(watch(jobs[i % len(jobs)], **(second if i % 2 else {}))) for i in range(200)]
        lists = await asyncio.gather(*[client.get("projects?limit=5") for _ in range(30)])
        health = await client.get(f"{service.url}/healthz")
        return await asyncio.gather(*watching), [*lists, health]

    stories, answers = asyncio.run(with_crowd(service, key, crowd))
    assert statuses(answers) == {200: 31}
    assert all('"status": "failed"' in story for story in stories)


def test_one_key_has_half_of_the_streams_of_events(narrow: LocalService) -> None:
    with ExitStack() as stack:
        api = stack.enter_context(client_of(narrow, "ada"))
        project = ok(api.post("projects", json={"name": "p"}))["id"]
        structure = ok(api.post(f"projects/{project}/structures", json=BEAM))["id"]
        campaign = ok(api.post(f"structures/{structure}/campaigns", json={"name": "c", "boundary": "free"}))["id"]
        path = f"update-jobs/{ok(api.post(f'campaigns/{campaign}/update-jobs', json={}))['id']}/events"
        other = {"Authorization": f"Bearer {ok(api.post('api-keys', json={'name': 'b'}))['key']}"}

        reading: list[Iterator[bytes]] = []

        def opened(**headers: str) -> httpx.Response:
            answer = stack.enter_context(api.stream("GET", path, headers=headers))
            if answer.is_success:
                reading.append(answer.iter_bytes())  # to leave it would close the stream
                next(reading[-1])  # it is counted from its first event
            return answer

        assert [opened().status_code for _ in range(3)] == [200, 200, 429]
        assert [opened(**other).status_code for _ in range(3)] == [200, 200, 429]
        refused = opened()
        assert "2 streams of events of this key" in refused.read().decode()
        assert int(refused.headers["Retry-After"]) >= 1
