"""The service under load: five hundred clients, each asking once in ten seconds on average, beside four hundred streams
of events.

Most clients look at lists, some read FRFs, some upload, some start updates, which a worker computes; somebody asks
`/healthz` all the time. Before, the same lists are asked by one client alone.
"""

from __future__ import annotations

import asyncio
import json
import random
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import psutil

from benchmarks.service import api_of, campaigns_of, post, served
from service.app.demo import paper
from service.app.supervisor import LocalService

SHARES = {"list": 0.8, "FRF": 0.12, "upload": 0.06, "job": 0.02}
ALONE, RATIO = 100, 20.0  # lists of one client alone, and how much longer they may take under load
LIST = "/api/v1/projects?limit=5"
MIB = 2**20


@dataclass
class Load:
    """What came of it.

    Attributes:
        statuses: by kind of request.
        bare_errors: answers of 500 and more that are no 503 with `Retry-After`.
        seconds: of each answer, by kind.
        alone: seconds of the lists before.
        streams: streams that were open at the same time, and events that came.
        health: longest answer of `/healthz`, in s.
        memory: bytes of the API before, at most and after.
    """

    statuses: dict[str, Counter[int]] = field(default_factory=lambda: defaultdict(Counter))
    bare_errors: list[str] = field(default_factory=list)
    seconds: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    alone: list[float] = field(default_factory=list)
    streams: int = 0
    events: int = 0
    health: float = 0.0
    memory: list[int] = field(default_factory=lambda: [0, 0, 0])

    @property
    def ratio(self) -> float:
        """95th percentile of the lists under load over that of one client alone."""
        return float(np.percentile(self.seconds["list"], 95) / np.percentile(self.alone, 95))

    def lines(self) -> Iterator[str]:
        """The table."""
        for kind, counts in sorted(self.statuses.items()):
            times = ""
            if self.seconds[kind]:
                p50, p95, p99 = np.percentile(self.seconds[kind], [50, 95, 99]) * 1000
                times = f"; {p50:.0f} / {p95:.0f} / {p99:.0f} ms (median / 95 % / 99 %)"
            yield f"{kind:<8} " + ", ".join(f"{n} × {s}" for s, n in sorted(counts.items())) + times
        yield f"list of one client alone: {np.percentile(self.alone, 95) * 1000:.1f} ms (95 %); ratio {self.ratio:.1f}"
        yield f"{self.streams} streams open at the same time, {self.events} events"
        yield f"/healthz took {self.health * 1000:.0f} ms at most"
        yield "memory of the API: " + " / ".join(f"{m / MIB:.0f}" for m in self.memory) + " MiB before / most / after"
        yield f"{len(self.bare_errors)} × 5xx but 503 with Retry-After"


def soak_load(seconds: int = 60) -> list[str]:
    """Print the table; what was too much."""
    found = load(seconds)
    print("\n".join(found.lines()))
    slow = [f"ratio {found.ratio:.1f} or /healthz too slow"] * (found.ratio > RATIO or found.health > 1)
    return found.bare_errors[:10] + slow


def load(
    seconds: float = 60.0,
    clients: int = 500,
    streams: int = 400,
    keys: int = 50,
    seed: int = 14,
    pause: float = 10.0,
    database_url: str | None = None,
) -> Load:
    """Put the service under load.

    Args:
        seconds: how long.
        clients: that ask at the same time.
        streams: of events that are open meanwhile.
        keys: among which clients and streams are shared out.
        seed: of who asks what when.
        pause: seconds between two requests of a client, on average.
        database_url: a migrated database; a temporary embedded one by default.
    """
    found = Load()
    with served(database_url=database_url, access_log=False) as service:
        places = [_furnished(service, number) for number in range(keys)]
        crowd = _Crowd(service, places, found, pause)
        asyncio.run(crowd.run(clients, streams, seconds, seed))
    return found


class Line:
    """A connection that asks one thing after the other; as little work as can be, so that the service is measured."""

    def __init__(self, port: int, key: str) -> None:
        self._port, self._key = port, key
        self._streams: tuple[asyncio.StreamReader, asyncio.StreamWriter] | None = None

    async def ask(self, method: str, path: str, body: bytes = b"", kind: str = "application/json") -> tuple[int, Any]:
        """Status and headers of the answer; it is read to its end."""
        reused = self._streams is not None
        try:
            status, headers, reader = await self._sent(method, path, body, kind)
        except ConnectionError:
            await self.close()
            if not reused:  # else the service has closed an idle line at this very moment, as it may
                raise
            return await self.ask(method, path, body, kind)
        try:
            if headers.get("transfer-encoding") == "chunked":
                while size := int((await reader.readline()).strip() or b"0", 16):
                    await reader.readexactly(size + 2)
                await reader.readline()
            else:
                await reader.readexactly(int(headers.get("content-length", 0)))
        except BaseException:
            await self.close()
            raise
        if headers.get("connection") == "close":
            await self.close()
        return status, headers

    async def watch(self, path: str) -> tuple[int, asyncio.StreamReader]:
        """Status of a stream, and the stream."""
        status, _, reader = await self._sent("GET", path, b"", "")
        return status, reader

    async def _sent(
        self, method: str, path: str, body: bytes, kind: str
    ) -> tuple[int, dict[str, str], asyncio.StreamReader]:
        """Status and headers of the answer, and what is to be read of it."""
        if self._streams is None:
            self._streams = await asyncio.open_connection("127.0.0.1", self._port)
        reader, writer = self._streams
        lines = [f"{method} {path} HTTP/1.1", "Host: localhost", f"Authorization: Bearer {self._key}"]
        lines += [f"Content-Type: {kind}", f"Content-Length: {len(body)}"] if body else []
        writer.write("\r\n".join([*lines, "", ""]).encode() + body)
        await writer.drain()
        if not (first := await reader.readline()):
            raise ConnectionResetError("the connection was closed before the answer")
        headers = {}
        while line := (await reader.readline()).decode("latin-1").strip():
            name, _, value = line.partition(":")
            headers[name.lower()] = value.strip()
        return int(first.split()[1]), headers, reader

    async def close(self) -> None:
        """Close it; the next request opens another."""
        if self._streams is not None:
            (_, writer), self._streams = self._streams, None
            writer.close()
            with suppress(OSError):  # the other end was faster
                await writer.wait_closed()


@dataclass
class _Place:
    """What requests name, one for each key: a campaign with an FRF, one with modes alone, which an update takes, and a job."""

    key: str
    campaign: str
    frf: str
    typed: str
    modes: str
    job: str

    def request(self, kind: str) -> tuple[Any, ...]:
        """What a client of that kind asks."""
        if kind == "list":
            return "GET", LIST
        if kind == "FRF":
            return "GET", f"/api/v1/frfs/{self.frf}/data"
        if kind == "upload":
            path = f"/api/v1/campaigns/{self.campaign}/imports?dry_run=true"
            return "POST", path, paper.uff_file(), "application/octet-stream"
        return "POST", f"/api/v1/campaigns/{self.typed}/update-jobs", json.dumps({"mode_set": self.modes}).encode()


def _furnished(service: LocalService, number: int) -> _Place:
    lines = [float(n) for n in range(1, 1601)]
    one = {"response_point": 2, "response_direction": 3, "reference_point": 1, "reference_direction": 3}
    frfs = {"quantity": "accelerance", "frequency_hz": lines, "frfs": [one | {"real": lines, "imag": lines}]}
    with api_of(service, f"client {number}") as api:
        campaign, typed = campaigns_of(api, "load", 2)
        frf = post(api, f"campaigns/{campaign}/frfs", frfs)["items"][0]["id"]
        modes = post(api, f"campaigns/{typed}/mode-sets", {"name": "m", "modes": paper.MODES[:2]})["id"]
        waiting = post(api, f"campaigns/{typed}/update-jobs?priority=-100", {"mode_set": modes})["id"]
        return _Place(str(api.headers["Authorization"]).split()[1], campaign, frf, typed, modes, waiting)


class _Crowd:
    def __init__(self, service: LocalService, places: list[_Place], load: Load, pause: float) -> None:
        self.port, self.places, self.load, self.pause = int(service.url.rsplit(":", 1)[1]), places, load, pause
        self.api = psutil.Process(service.processes["api"].pid)
        self.over = asyncio.Event()
        self.open = 0

    async def run(self, clients: int, streams: int, seconds: float, seed: int) -> None:
        """One client alone, then all at once."""
        line = Line(self.port, self.places[0].key)
        for _ in range(ALONE):
            began = time.perf_counter()
            await line.ask("GET", LIST)
            self.load.alone.append(time.perf_counter() - began)
        await line.close()
        self.load.memory[0] = self.api.memory_info().rss
        watching = [asyncio.create_task(self._watch(self.places[n % len(self.places)])) for n in range(streams)]
        while self.open < streams and not any(task.done() for task in watching):
            await asyncio.sleep(0.05)
        self.load.streams = self.open
        asking = [asyncio.create_task(self._client(n, seed)) for n in range(clients)]
        asking.append(asyncio.create_task(self._health()))
        await asyncio.sleep(seconds)
        self.over.set()
        await asyncio.gather(*asking)
        for task in watching:
            task.cancel()
        ended = await asyncio.gather(*watching, return_exceptions=True)
        self.load.bare_errors += [f"a stream: {error!r}" for error in ended if isinstance(error, Exception)]
        await asyncio.sleep(1)
        self.load.memory[2] = self.api.memory_info().rss

    async def _client(self, number: int, seed: int) -> None:
        choose, place = random.Random(f"{seed} {number}"), self.places[number % len(self.places)]
        (kind,) = choose.choices(list(SHARES), list(SHARES.values()))
        line = Line(self.port, place.key)
        try:
            while not await self._rested(choose.expovariate(1 / self.pause)):
                began = time.perf_counter()
                status, headers = await line.ask(*place.request(kind))
                self.load.seconds[kind].append(time.perf_counter() - began)
                self.load.statuses[kind][status] += 1
                if status >= 500 and not (status == 503 and "retry-after" in headers):
                    self.load.bare_errors.append(f"{kind}: {status}")
        except (OSError, EOFError) as error:
            self.load.bare_errors.append(f"{kind}: {error!r}")
        finally:
            await line.close()

    async def _rested(self, seconds: float) -> bool:
        """Wait; whether it is over now."""
        try:
            await asyncio.wait_for(self.over.wait(), seconds)
        except TimeoutError:
            return False
        return True

    async def _watch(self, place: _Place) -> None:
        """Watch a job; when it has ended, the next one."""
        line = Line(self.port, place.key)
        try:
            while True:
                job = place.job
                await self._events(line, job)
                await line.close()
                if place.job == job:
                    place.job = ""
                    _, headers = await line.ask(*place.request("job"))
                    place.job = headers["location"].rsplit("/", 1)[1]
                while not place.job:
                    await asyncio.sleep(0.05)
        finally:
            await line.close()

    async def _events(self, line: Line, job: str) -> None:
        status, reader = await line.watch(f"/api/v1/update-jobs/{job}/events")
        self.load.statuses["stream"][status] += 1
        if status not in (200, 204):
            raise RuntimeError(f"a stream of events: {status}")
        self.open += 1
        try:
            while status == 200 and (text := await reader.readline()) not in (b"", b"0\r\n"):
                if text.startswith(b"data:"):
                    self.load.events += 1
                    if json.loads(text[5:])["status"] == "failed":  # else the load would be of jobs that end at once
                        self.load.bare_errors.append(f"a job failed: {job}")
        finally:
            self.open -= 1

    async def _health(self) -> None:
        line = Line(self.port, "none")
        while not await self._rested(0.1):
            began = time.perf_counter()
            status, _ = await line.ask("GET", "/healthz")
            self.load.health = max(self.load.health, time.perf_counter() - began)
            self.load.memory[1] = max(self.load.memory[1], self.api.memory_info().rss)
            self.load.statuses["healthz"][status] += 1
        await line.close()
