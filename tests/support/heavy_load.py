"""The service under load: five hundred clients, each asking once in ten seconds on average, beside
four hundred streams of events.

Most clients look at lists, some read FRFs, some upload, some start updates, which a worker
computes; somebody asks `/healthz` all the time. Before, the same lists are asked by one client
alone.
"""

import asyncio
import json
import random
import time
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from typing import Any

import httpx
import psutil

from service.app.supervisor import LocalService
from service.pages.example import paper
from tests.support.rest import ONCE, RAW, campaigns_of, client_of, posted
from tests.support.waiting import completed

SHARES = {"list": 0.8, "FRF": 0.12, "upload": 0.06, "job": 0.02}
SEED = 14  # of who asks what when
FILE = paper.uff_file()


@dataclass
class Load:
    """What came of it."""

    # by kind of request
    statuses: dict[str, Counter[int]] = field(default_factory=lambda: defaultdict(Counter))
    # answers of 500 and more that are no 503 with `Retry-After`
    bare_errors: list[str] = field(default_factory=list)
    # of each answer, by kind
    seconds: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    alone: list[float] = field(default_factory=list)  # seconds of the lists before
    streams: int = 0  # streams that were open at the same time, and events that came
    events: int = 0
    health: float = 0.0  # longest answer of `/healthz`, in s
    # bytes of the API before, at most and after
    memory: list[int] = field(default_factory=lambda: [0, 0, 0])


def load(
    service: LocalService,
    seconds: float = 60.0,
    clients: int = 500,
    streams: int = 400,
    keys: int = 50,
    pause: float = 10.0,
    alone: int = 100,
) -> Load:
    """Put a service under load.

    Args:
        service: that keeps no log of what is asked.
        seconds: how long.
        clients: that ask at the same time.
        streams: of events that are open meanwhile.
        keys: among which clients and streams are shared out.
        pause: seconds between two requests of a client, on average.
        alone: lists of one client alone, before.
    """
    found = Load()
    crowd = _Crowd(service, [_furnished(service, number) for number in range(keys)], found, pause)
    completed(crowd.run(clients, streams, seconds, alone))
    return found


@dataclass
class _Place:
    """What requests name, one for each key: a campaign with an FRF, one with modes alone, which an
    update takes, and a job.
    """

    key: str
    campaign: str
    frf: str
    typed: str
    modes: str
    job: str

    def request(self, kind: str) -> tuple[str, str, dict[str, Any]]:
        """What a client of that kind asks."""
        file, job = {"content": FILE, "headers": RAW}, {"json": {"mode_set": self.modes}}
        method, path, how = {
            "list": ("GET", "projects?limit=5", {}),
            "FRF": ("GET", f"frfs/{self.frf}/data", {}),
            "upload": ("POST", f"campaigns/{self.campaign}/imports?dry_run=true", file),
            "job": ("POST", f"campaigns/{self.typed}/update-jobs", job),
        }[kind]
        return method, f"/api/v1/{path}", how


def _furnished(service: LocalService, number: int) -> _Place:
    lines = [float(n) for n in range(1, 1601)]
    one = {
        "response_point": 2,
        "response_direction": 3,
        "reference_point": 1,
        "reference_direction": 3,
    }
    frfs = {
        "quantity": "accelerance",
        "frequency_hz": lines,
        "frfs": [one | {"real": lines, "imag": lines}],
    }
    with client_of(service, f"client {number}") as api:
        campaign, typed = campaigns_of(api, "load", 2)
        frf = posted(api, f"campaigns/{campaign}/frfs", frfs)["items"][0]["id"]
        modes = posted(
            api, f"campaigns/{typed}/mode-sets", {"name": "m", "modes": paper.MODES[:2]}
        )["id"]
        waiting = posted(api, f"campaigns/{typed}/update-jobs?priority=-100", {"mode_set": modes})[
            "id"
        ]
        return _Place(
            str(api.headers["Authorization"]).split()[1], campaign, frf, typed, modes, waiting
        )


class _Crowd:
    def __init__(
        self, service: LocalService, places: list[_Place], load: Load, pause: float
    ) -> None:
        self.url, self.places, self.load, self.pause = service.url, places, load, pause
        self.api = psutil.Process(service.processes["api"].pid)
        self.over = asyncio.Event()
        self.open = 0

    async def run(self, clients: int, streams: int, seconds: float, alone: int) -> None:
        """One client alone, then all at once. No connection is used twice: the service may close an
        idle one at that moment.
        """
        async with httpx.AsyncClient(
            base_url=self.url, limits=ONCE, timeout=600, trust_env=False
        ) as self.http:
            for _ in range(alone):
                await self._ask("list", self.places[0], self.load.alone)
            self.load.memory[0] = self.api.memory_info().rss
            watching = [
                asyncio.create_task(self._watch(self.places[n % len(self.places)]))
                for n in range(streams)
            ]
            while self.open < streams and not any(task.done() for task in watching):
                await asyncio.sleep(0.05)
            self.load.streams = self.open
            asking = [asyncio.create_task(self._client(n)) for n in range(clients)]
            asking.append(asyncio.create_task(self._health()))
            await asyncio.sleep(seconds)
            self.over.set()
            await asyncio.gather(*asking)
            for task in watching:
                task.cancel()
            ended = await asyncio.gather(*watching, return_exceptions=True)
            self.load.bare_errors += [
                f"a stream: {error!r}" for error in ended if isinstance(error, Exception)
            ]
            await asyncio.sleep(1)
            self.load.memory[2] = self.api.memory_info().rss

    async def _ask(self, kind: str, place: _Place, seconds: list[float]) -> httpx.Response:
        began = time.perf_counter()
        method, path, how = place.request(kind)
        headers = {"Authorization": f"Bearer {place.key}", **how.pop("headers", {})}
        answer = await self.http.request(method, path, headers=headers, **how)
        seconds.append(time.perf_counter() - began)
        return answer

    async def _client(self, number: int) -> None:
        choose, place = random.Random(f"{SEED} {number}"), self.places[number % len(self.places)]
        (kind,) = choose.choices(list(SHARES), list(SHARES.values()))
        try:
            while not await self._rested(choose.expovariate(1 / self.pause)):
                answer = await self._ask(kind, place, self.load.seconds[kind])
                self.load.statuses[kind][answer.status_code] += 1
                if answer.status_code >= 500 and not (
                    answer.status_code == 503 and "retry-after" in answer.headers
                ):
                    self.load.bare_errors.append(f"{kind}: {answer.status_code}")
        except httpx.TransportError as error:
            self.load.bare_errors.append(f"{kind}: {error!r}")

    async def _rested(self, seconds: float) -> bool:
        """Wait; whether it is over now."""
        try:
            await asyncio.wait_for(self.over.wait(), seconds)
        except TimeoutError:
            return False
        return True

    async def _watch(self, place: _Place) -> None:
        """Watch a job; when it has ended, the next one."""
        while True:
            job = place.job
            await self._events(place, job)
            if place.job == job:
                place.job = ""
                answer = await self._ask("job", place, [])
                place.job = answer.headers["location"].rsplit("/", 1)[1]
            while not place.job:
                await asyncio.sleep(0.05)

    async def _events(self, place: _Place, job: str) -> None:
        headers = {"Authorization": f"Bearer {place.key}"}
        async with self.http.stream(
            "GET", f"/api/v1/update-jobs/{job}/events", headers=headers
        ) as answer:
            self.load.statuses["stream"][answer.status_code] += 1
            if answer.status_code not in (200, 204):
                raise RuntimeError(f"a stream of events: {answer.status_code}")
            self.open += 1
            try:
                async for line in answer.aiter_lines():
                    if line.startswith("data:"):
                        self.load.events += 1
                        # the load would be of jobs that end at once
                        if json.loads(line[5:])["status"] == "failed":
                            self.load.bare_errors.append(f"a job failed: {job}")
            finally:
                self.open -= 1

    async def _health(self) -> None:
        while not await self._rested(0.1):
            began = time.perf_counter()
            answer = await self.http.get("/healthz")
            self.load.health = max(self.load.health, time.perf_counter() - began)
            self.load.memory[1] = max(self.load.memory[1], self.api.memory_info().rss)
            self.load.statuses["healthz"][answer.status_code] += 1
