"""Files that are made to cost, ten of each format at once: `python -m benchmarks.soak_bombs [COUNT]`, a part of `make soak`.

Each goes to `POST …/imports`, and to `POST …/records` or `POST …/frfs` where these take its format. The API reads none of
them: its memory may grow by less than 60 MB, `/healthz` answers within 0.3 s meanwhile, and every file is refused in words.
"""

from __future__ import annotations

import http.client
import io
import json
import multiprocessing
import struct
import sys
import tempfile
import time
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import psutil

from benchmarks.access_laboratory import ASKED_FREELY
from modalbase.formats.recognise import FORMATS
from service.app.demo import paper
from service.app.supervisor import LocalService
from service.settings import Settings

COUNT, LARGE = 10, 512
MIB = 1024 * 1024
MOST_GROWTH, MOST_SECONDS = 60e6, 0.3
MAPPING = json.dumps(
    {
        "sample_rate_hz": 1000,
        "channels": [
            {"variable": "a", "quantity": "force", "point": 1},
            {"variable": "b", "quantity": "acceleration", "point": 2},
        ],
    }
)
ALIASES = {"npz": ("records", "frfs"), "mat": ("records", "frfs"), "csv": ("records", "frfs"), "wav": ("records",)}
TYPES = {"npz": "application/x-npz", "mat": "application/x-matlab-data", "csv": "text/csv", "wav": "audio/wav"}


def bomb(form: str, number: int, mib: int = LARGE) -> bytes:
    """A file that is small, or costs little to send, and is large once it is read; each number is another file."""
    if form == "npz":
        return _npz(number, mib)
    if form == "mat":
        return _mat(number, mib)
    if form == "csv":  # a table of its columns times its lines
        names = ",".join(f"a{number}_{i}" for i in range(mib * 500))
        return f"{names}\n{'1,1' * 3}\n".encode() + b"1\n" * (mib * 200)
    if form == "wav":  # every count becomes a number of eight bytes
        samples = bytes([number]) * (mib * MIB // 16)
        head = struct.pack("<4sI4s4sIHHIIHH4sI", b"RIFF", 36 + len(samples), b"WAVE", b"fmt ", 16, 1, 1, 8000, 8000, 1, 8,
                           b"data", len(samples))  # fmt: skip
        return head + samples
    return b"    -1\n" + b"\n" * (mib * MIB // 20 + number) + b"    15\n    -1\n"


def _npz(number: int, mib: int) -> bytes:
    packed, header = io.BytesIO(), io.BytesIO()
    count = mib * MIB // 8 + number
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (count,)})
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in ("a", "b"):
            with archive.open(f"{name}.npy", "w") as member:
                member.write(header.getvalue())
                for block in _zeros(8 * count):
                    member.write(block)
    return packed.getvalue()


def _mat(number: int, mib: int) -> bytes:
    """A .mat of version 7 with a vector of zeros, which scipy would inflate as a whole."""
    count = mib * MIB // 8 + number
    inner = (
        struct.pack("<IIII", 6, 8, 6, 0) + struct.pack("<IIii", 5, 8, 1, count) + struct.pack("<HHI", 1, 1, ord("a"))
    )
    inner += struct.pack("<II", 9, 8 * count)
    squeeze = zlib.compressobj()
    parts = [squeeze.compress(struct.pack("<II", 14, len(inner) + 8 * count) + inner)]
    parts += [squeeze.compress(block) for block in _zeros(8 * count)]
    data = b"".join([*parts, squeeze.flush()])
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<HH", 0x0100, 0x4D49)
    return head + struct.pack("<II", 15, len(data)) + data


def _zeros(size: int) -> Iterator[bytes]:
    block = bytes(MIB)
    for left in range(size, 0, -MIB):
        yield block[:left]


@dataclass
class Outcome:
    """What came of the bombs.

    Attributes:
        growth: bytes by which the API's memory grew at most.
        slowest: seconds that `/healthz` took at most.
        ends: statuses of imports, and of answers of the aliases, by format.
        faults: what ended without words.
    """

    growth: int = 0
    slowest: float = 0.0
    ends: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)


class _Thrower:
    def __init__(self, service: LocalService) -> None:
        headers = {"Authorization": f"Bearer {service.new_key('bombs')}"}
        self.api = httpx.Client(base_url=f"{service.url}/api/v1/", headers=headers, timeout=600, trust_env=False)
        project = self._made("projects", {"name": "bombs"})
        structure = self._made(f"projects/{project}/structures", paper.STRUCTURE)
        self.campaign = f"campaigns/{self._made(f'structures/{structure}/campaigns', paper.CAMPAIGN)}"
        self.found = Outcome()

    def _made(self, path: str, body: dict[str, Any]) -> str:
        return str(self.api.post(path, json=body).raise_for_status().json()["id"])

    def throw(self, where: str, form: str, content: bytes) -> None:
        """Send one file, and wait for its end."""
        query = {"filename": f"bomb.{form}"} if where != "frfs" else {"quantity": "accelerance"}
        if form != "uff" and where != "frfs":
            query["mapping"] = MAPPING
        headers = {"Content-Type": "application/octet-stream" if where == "imports" else TYPES[form]}
        answer = self.api.post(f"{self.campaign}/{where}", params=query, content=content, headers=headers)
        state = answer.json()
        if location := answer.headers.get("location"):
            state = self._end(location.removeprefix("/api/v1/"))
        status, words = state.get("status"), state.get("detail") or (state.get("error") or {}).get("detail")
        self.found.ends[f"{where} {form} {status}"] += 1
        if status in (200, 201, "succeeded", 500) or not words or "internal" in words:
            self.found.faults.append(f"{where} {form} {status}: {words}")

    def _end(self, location: str) -> dict[str, Any]:
        while True:
            state: dict[str, Any] = self.api.get(location).raise_for_status().json()
            if state["status"] not in ("queued", "running"):
                return state
            time.sleep(0.1)


def _watch(address: tuple[str, int], pid: int, channel: Connection) -> None:
    """Look at memory and health until something is sent, then send back the most of both. In a process of its own, whose
    interpreter nobody else holds up.
    """
    process, growth, slowest = psutil.Process(pid), 0, 0.0
    before = process.memory_info().rss
    channel.send(None)
    while not channel.poll(0.02):
        line = http.client.HTTPConnection(*address, timeout=60)
        began = time.perf_counter()
        line.request("GET", "/healthz")
        assert line.getresponse().status == 200
        slowest = max(slowest, time.perf_counter() - began)
        line.close()
        growth = max(growth, process.memory_info().rss - before)
    channel.send((growth, slowest))


@contextmanager
def watched(service: LocalService, found: Outcome) -> Iterator[None]:
    """Within this, the API is looked at."""
    own = multiprocessing.get_context("spawn")
    here, there = own.Pipe()
    host, _, port = service.url.removeprefix("http://").partition(":")
    process = own.Process(target=_watch, args=((host, int(port)), service.processes["api"].pid, there))
    process.start()
    here.recv()
    try:
        yield
    finally:
        here.send(None)
        found.growth, found.slowest = here.recv()
        process.join()


def throw(service: LocalService, count: int = COUNT, mib: int = LARGE) -> Outcome:
    """Throw so many bombs of each format, all at once."""
    thrower = _Thrower(service)
    kinds = [(where, form) for form in FORMATS for where in ("imports", *ALIASES.get(form, ()))]
    files = {(form, n): bomb(form, n, mib) for form in FORMATS for n in range(count)}
    for where in ("imports", "records", "frfs"):  # each route is loaded when it is first asked for
        thrower.throw(where, "csv", b"nothing")
    with watched(service, thrower.found), ThreadPoolExecutor(len(kinds) * count) as threads:
        every = [(where, form, n) for where, form in kinds for n in range(count)]
        sent = [threads.submit(thrower.throw, where, form, files[form, n]) for where, form, n in every]
    for one in sent:
        one.result()
    thrower.api.close()
    return thrower.found


@contextmanager
def running() -> Iterator[LocalService]:
    """A service on a temporary database, whose jobs may take as much memory as a small machine has."""
    with tempfile.TemporaryDirectory(prefix="mb-", ignore_cleanup_errors=True) as folder:
        Path(folder).chmod(0o755)  # the server may run as a user of its own
        settings = Settings(data=Path(folder), port=0, log_level="error", job_memory_bytes=1024 * MIB, **ASKED_FREELY)
        with LocalService(settings) as service:
            yield service


def main(count: int = COUNT) -> None:
    """Print what came of so many bombs of each format; exit 1 where that is too much."""
    with running() as service:
        found = throw(service, count)
    print(f"API memory grew by {found.growth / 1e6:.0f} MB, /healthz took {1e3 * found.slowest:.0f} ms at most")
    print("\n".join(f"{count} × {end}" for end, count in sorted(found.ends.items())))
    print(f"{len(found.faults)} faults", *found.faults, sep="\n")
    sys.exit(1 if found.faults or found.growth > MOST_GROWTH or found.slowest > MOST_SECONDS else 0)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
