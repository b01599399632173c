"""Many clients, streams and slow heads: the concurrency model of docs/limits.md, at ten times its
size.
"""

import asyncio
import re
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack
from uuid import uuid4

import httpx
import pytest
import uvicorn
from fastapi import FastAPI

from service.app.supervisor import LocalService
from service.platform.web import middleware
from tests.support.crowd import at_once, statuses, with_crowd
from tests.support.heavy_load import load
from tests.support.rest import campaigns_of, client_of, ok
from tests.support.waiting import completed

SLOTS, QUEUE = 2, 10


@pytest.fixture(scope="module")
def narrow(new_api: Callable[..., AbstractContextManager[LocalService]]) -> Iterator[LocalService]:
    """A service that answers few requests at a time, with few streams of events; those that may
    wait do, however slow the machine is.
    """
    with new_api(
        database_pool=SLOTS,
        request_queue=QUEUE,
        request_wait_seconds=600,
        event_streams=4,
    ) as running:
        yield running


def test_a_burst_of_one_key_is_answered(service: LocalService) -> None:
    answers = at_once(service, service.new_key(f"burst-{uuid4()}"), "projects?limit=5", 60)
    assert statuses(answers) == {200: 60}


def test_beyond_what_may_wait_the_answer_says_so_and_when_to_come_back(
    narrow: LocalService,
) -> None:
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

    answered, pressed = completed(with_crowd(narrow, hasty, crowd))
    assert statuses(answered) == {200: 10}
    assert 429 in statuses(pressed)


def test_many_streams_of_events_hold_nothing_up(
    service: LocalService, api: httpx.Client, campaign: str
) -> None:
    """40 streams at once; lists and health answer beside them, and each stream sees its job's
    end.
    """
    key = api.headers["Authorization"].removeprefix("Bearer ")

    async def crowd(client: httpx.AsyncClient) -> tuple[list[str], list[httpx.Response]]:
        opened = asyncio.Semaphore(0)
        second = {
            "Authorization": (
                f"Bearer {(await client.post('api-keys', json={'name': 'x'})).json()['key']}"
            )
        }
        jobs = [
            (await client.post(f"campaigns/{campaign}/update-jobs", json={})).json()["id"]
            for _ in range(2)
        ]

        async def watch(job: str, **headers: str) -> str:
            async with client.stream("GET", f"update-jobs/{job}/events", headers=headers) as answer:
                assert answer.status_code == 200, await answer.aread()
                opened.release()
                return (await answer.aread()).decode()

        watching = [
            asyncio.ensure_future(watch(jobs[i % len(jobs)], **(second if i % 2 else {})))
            for i in range(40)
        ]
        lists = await asyncio.gather(*[client.get("projects?limit=5") for _ in range(15)])
        health = await client.get(f"{service.url}/healthz")
        return await asyncio.gather(*watching), [*lists, health]

    stories, answers = completed(with_crowd(service, key, crowd))
    assert statuses(answers) == {200: 16}
    assert all('"status": "failed"' in story for story in stories)


def test_one_key_has_half_of_the_streams_of_events(narrow: LocalService) -> None:
    with ExitStack() as stack:
        api = stack.enter_context(client_of(narrow, "ada"))
        (campaign,) = campaigns_of(api, "p")
        job = f"update-jobs/{ok(api.post(f'campaigns/{campaign}/update-jobs', json={}))['id']}"
        path = f"{job}/events"
        other = {"Authorization": f"Bearer {ok(api.post('api-keys', json={'name': 'b'}))['key']}"}

        reading: list[Iterator[bytes]] = []
        firsts: list[bytes] = []

        def opened(**headers: str) -> httpx.Response:
            answer = stack.enter_context(api.stream("GET", path, headers=headers))
            if answer.is_success:
                reading.append(answer.iter_bytes())  # to leave it would close the stream
                firsts.append(next(reading[-1]))  # it is counted from its first event
            return answer

        assert [opened().status_code for _ in range(3)] == [200, 200, 429]
        assert [opened(**other).status_code for _ in range(3)] == [200, 200, 429]
        refused = opened()
        assert "2 streams of events of this key" in refused.read().decode()
        assert int(refused.headers["Retry-After"]) >= 1
    # who comes back to a job that has not changed since gets nothing until it does
    with client_of(narrow, "ada") as api:
        (last,) = re.findall(rb"^id: (\d+)", firsts[0], re.MULTILINE)
        with api.stream("GET", path, headers={"Last-Event-ID": last}) as answer:
            ok(api.post(f"{job}/cancel"))
            events = answer.read().decode()
        assert re.findall('"status": "([a-z]+)"', events) == ["cancelled"]


def test_many_clients_and_streams_at_once_get_answers(service: LocalService) -> None:
    """The soak under load in short: whoever asks has an answer, which is no bare error."""
    outcome = load(service, 0.5, clients=4, streams=4, keys=1, pause=0.5, alone=2)
    assert outcome.bare_errors == []
    assert outcome.streams == 4
    assert outcome.events >= 4
    assert outcome.statuses["list"].keys() <= {200, 503}
    assert outcome.statuses["list"][200] > 0
    assert outcome.statuses["healthz"].keys() == {200}


@pytest.fixture
def port(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """An application behind the server's protocol, which waits half a second for a head."""
    monkeypatch.setattr(middleware, "HEAD_SECONDS", 0.5)
    app = FastAPI()

    @app.get("/")
    def root() -> str:
        return "here"

    config = uvicorn.Config(app, http=middleware.PatientProtocol, log_config=None)
    with socket.create_server(("127.0.0.1", 0)) as listener:
        running = uvicorn.Server(config)
        thread = threading.Thread(target=running.run, kwargs={"sockets": [listener]})
        thread.start()
        yield listener.getsockname()[1]
        running.should_exit = True
        thread.join()


@pytest.mark.parametrize("sent", [b"", b"GET / HTT", b"GET / HTTP/1.1\r\nHost: x\r\n"])
def test_a_head_that_does_not_come_ends_the_connection(port: int, sent: bytes) -> None:
    with socket.create_connection(("127.0.0.1", port), timeout=30) as line:
        line.sendall(sent)
        assert line.recv(1000) == b""


def test_after_an_answer_too(port: int) -> None:
    with socket.create_connection(("127.0.0.1", port), timeout=30) as line:
        line.sendall(b"GET / HTTP/1.1\r\nHost: x\r\n\r\n")
        answer = b""
        while more := line.recv(1000):
            answer += more
            if answer.endswith(b'"here"'):
                break
        assert answer.startswith(b"HTTP/1.1 200"), "the line was closed before there was an answer"
        line.sendall(b"GET / HTTP/1.1\r\n")
        assert line.recv(1000) == b""
