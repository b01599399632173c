"""The service under load: `python -m benchmarks.soak_load [SECONDS]`, a part of `make soak`.

Five hundred clients with keys of their own, each asking once in ten seconds on average: most look at lists, some read FRFs,
some upload, some start updates. Beside them four hundred streams of events stay open, and somebody asks `/healthz` all the
time. Before, the same lists are asked by one client alone. A worker computes what is started.
"""

from __future__ import annotations

import asyncio
import json
import random
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Awaitable, Callable, Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import psutil

from benchmarks.access_laboratory import MODES
from service.app.demo import paper
from service.app.supervisor import LocalService
from service.settings import Settings

SECONDS = 60.0
CLIENTS, STREAMS, KEYS = 500, 400, 50
PAUSE_SECONDS = 10.0  # between two requests of a client, on average
SHARES = {"list": 0.8, "FRF": 0.12, "upload": 0.06, "job": 0.02}
ALONE = 100  # lists of one client alone, to compare with
RATIO = 20.0
SEED = 14
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
        yield from self.bare_errors[:10]


class Line:
    """A connection that asks one thing after the other; as little work as can be, so that the service is measured."""

    def __init__(self, port: int, key: str) -> None:
        self._port, self._key = port, key
        self._streams: tuple[asyncio.StreamReader, asyncio.StreamWriter] | None = None

    async def ask(self, method: str, path: str, body: bytes = b"", kind: str = "application/json") -> tuple[int, Any]:
        """Status and headers of the answer; it is read to its end."""
        reused = self._streams is not None
        try:
            reader, _ = await self._sent(method, path, body, kind)
            status, headers = await head(reader)
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
        reader, _ = await self._sent("GET", path, b"", "")
        return (await head(reader))[0], reader

    async def _sent(
        self, method: str, path: str, body: bytes, kind: str
    ) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        if self._streams is None:
            self._streams = await asyncio.open_connection("127.0.0.1", self._port)
        lines = [f"{method} {path} HTTP/1.1", "Host: localhost", f"Authorization: Bearer {self._key}"]
        if body:
            lines += [f"Content-Type: {kind}", f"Content-Length: {len(body)}"]
        self._streams[1].write("\r\n".join([*lines, "", ""]).encode() + body)
        await self._streams[1].drain()
        return self._streams

    async def close(self) -> None:
        """Close it; the next request opens another."""
        if self._streams is not None:
            (_, writer), self._streams = self._streams, None
            writer.close()
            with suppress(OSError):  # the other end was faster
                await writer.wait_closed()


async def head(reader: asyncio.StreamReader) -> tuple[int, dict[str, str]]:
    """Status and headers of an answer."""
    first = await reader.readline()
    if not first:
        raise ConnectionResetError("the connection was closed before the answer")
    headers = {}
    while line := (await reader.readline()).decode("latin-1").strip():
        name, _, value = line.partition(":")
        headers[name.lower()] = value.strip()
    return int(first.split()[1]), headers


@dataclass
class _Place:
    """What requests name: one for each key."""

    key: str
    campaign: str  # with an FRF, for reading and uploads
    frf: str
    typed: str  # a campaign with modes alone, which an update takes
    modes: str
    job: str


def _furnished(service: LocalService, number: int) -> _Place:
    key = service.new_key(f"client {number}")
    headers = {"Authorization": f"Bearer {key}"}
    with httpx.Client(base_url=f"{service.url}/api/v1/", headers=headers, timeout=120, trust_env=False) as http:

        def made(path: str, body: Any) -> Any:
            return http.post(path, json=body).raise_for_status().json()

        project = made("projects", {"name": "load"})["id"]
        structure = made(f"projects/{project}/structures", paper.STRUCTURE)["id"]
        campaign = made(f"structures/{structure}/campaigns", paper.CAMPAIGN)["id"]
        frf = made(f"campaigns/{campaign}/frfs", _frfs())["items"][0]["id"]
        typed = made(f"structures/{structure}/campaigns", {**paper.CAMPAIGN, "name": "typed modes"})["id"]
        modes = made(f"campaigns/{typed}/mode-sets", {"name": "m", "modes": MODES})["id"]
        waiting = made(f"campaigns/{typed}/update-jobs?priority=-100", {"mode_set": modes})["id"]
        return _Place(key, campaign, frf, typed, modes, waiting)


def _frfs() -> dict[str, Any]:
    lines = [float(n) for n in range(1, 1601)]
    one = {"response_point": 2, "response_direction": 3, "reference_point": 1, "reference_direction": 3}
    return {"quantity": "accelerance", "frequency_hz": lines, "frfs": [one | {"real": lines, "imag": lines}]}


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
            await line.ask("GET", "/api/v1/projects?limit=5")
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
        choose = random.Random(f"{seed} {number}")
        place = self.places[number % len(self.places)]
        (kind,) = choose.choices(list(SHARES), list(SHARES.values()))
        line = Line(self.port, place.key)
        try:
            while not await self._rested(choose.expovariate(1 / self.pause)):
                began = time.perf_counter()
                status, headers = await self._requests[kind](self, line, place)
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

    async def _list(self, line: Line, _: _Place) -> tuple[int, Any]:
        return await line.ask("GET", "/api/v1/projects?limit=5")

    async def _frf(self, line: Line, place: _Place) -> tuple[int, Any]:
        return await line.ask("GET", f"/api/v1/frfs/{place.frf}/data")

    async def _upload(self, line: Line, place: _Place) -> tuple[int, Any]:
        path = f"/api/v1/campaigns/{place.campaign}/imports?dry_run=true"
        return await line.ask("POST", path, paper.uff_file(), "application/octet-stream")

    async def _job(self, line: Line, place: _Place) -> tuple[int, Any]:
        path = f"/api/v1/campaigns/{place.typed}/update-jobs"
        return await line.ask("POST", path, json.dumps({"mode_set": place.modes}).encode())

    _requests: dict[str, Callable[..., Awaitable[tuple[int, Any]]]] = {  # noqa: RUF012 - nobody changes it
        "list": _list,
        "FRF": _frf,
        "upload": _upload,
        "job": _job,
    }

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
                    _, headers = await self._job(line, place)
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


def load(
    seconds: float = SECONDS,
    clients: int = CLIENTS,
    streams: int = STREAMS,
    keys: int = KEYS,
    seed: int = SEED,
    pause: float = PAUSE_SECONDS,
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
    with ExitStack() as stack:
        data = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="mb-", ignore_cleanup_errors=True)))
        data.chmod(0o755)  # the server may run as a user of its own
        settings = Settings(database_url=database_url, data=data, port=0, log_level="error", access_log=False)
        service = stack.enter_context(LocalService(settings))
        places = [_furnished(service, number) for number in range(keys)]

        async def all_at_once() -> None:
            await _Crowd(service, places, found, pause).run(clients, streams, seconds, seed)

        asyncio.run(all_at_once())
    return found


if __name__ == "__main__":
    result = load(float(sys.argv[1]) if len(sys.argv) > 1 else SECONDS)
    print("\n".join(result.lines()))
    sys.exit(1 if result.bare_errors or result.ratio > RATIO or result.health > 1 else 0)
