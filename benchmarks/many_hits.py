"""Ten thousand hits through a service: upload, storage and processing, beside reading the same files and transforming them.

Npz files of 50 hits (ten points of five, force and one response of 16,384
samples as float32) go to a service of its own, two at a time, and one processing starts over the default band. What
bounds it is measured in the same run: reading the files and one transform a block; and what PostgreSQL alone needs to store
the same bytes by COPY, over one connection and over two. The first COPY is not shown: it makes the files of the log, which
the others use again. Seconds of the clock, and of the processors: of this script, of API, worker and their children, and of
PostgreSQL.
"""

from __future__ import annotations

import json
import os
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import psutil
import psycopg
from scipy import fft

from benchmarks.measurements import client_of, peak_memory, structure_of
from fecore.arrays import FloatArray
from service.db.engine import psycopg_url
from service.settings import Settings
from service.supervisor import LocalService

SAMPLES, RATE_HZ = 16_384, 12_800.0
AT_A_POINT, IN_A_FILE = 5, 50
SENDERS = 2
MAPPING = {
    "sample_rate_hz": RATE_HZ,
    "hit": {"variable": "hit"},
    "channels": [
        {"variable": "force", "quantity": "force", "point": {"variable": "point"}},
        {"variable": "acceleration", "quantity": "acceleration", "point": 999_999},
    ],
}


def main(hits: int = 10_000) -> None:
    """Print the table."""
    with tempfile.TemporaryDirectory(prefix="mb-") as name:
        folder = Path(name)
        settings = Settings(data=folder / "db", port=0, log_level="error")
        with LocalService(settings) as service, client_of(service) as api:
            files = write_files(folder, hits)
            size = sum(path.stat().st_size for path in files)
            print(
                f"{hits} hits of {SAMPLES} samples in {len(files)} files, {size / 2**20:.0f} MB, load {os.getloadavg()[0]:.1f}"
            )
            print(f"{'':28}{'clock s':>9}{'processor s':>13}{'peak MB':>9}")
            bound = _row("reading and transforms", _alone(files))
            _copied(service, size, 1)
            copied = _row("PostgreSQL alone, one COPY", _copied(service, size, 1))
            twice = _row("PostgreSQL alone, two at once", _copied(service, size, 2))
            campaign = _campaign(api)
            imported = _row("import over HTTP", _watched(service, lambda: _send(api, campaign, files)))
            processed = _row("processing, default band", _watched(service, lambda: _process(api, campaign)))
    for what, clock, processor in (
        ("import", imported.clock, imported.processor),
        ("processing", processed.clock, processed.processor),
        ("both", imported.clock + processed.clock, imported.processor + processed.processor),
    ):
        speed, own = bound.clock / clock, bound.processor / processor
        print(f"speed over reading and transforms alone, {what}: {speed:.2f} by the clock, {own:.2f} by the processors")
    for name, floor in (("one COPY", copied), ("two at once", twice)):
        speed, own = floor.clock / imported.clock, floor.processor / imported.processor
        print(f"speed over PostgreSQL alone, {name}, import: {speed:.2f} by the clock, {own:.2f} by the processors")


@dataclass(frozen=True)
class Cost:
    """Seconds of the clock and of all processors, and the largest resident memory above idle, bytes."""

    clock: float
    processor: float
    memory: float = 0.0


def write_files(folder: Path, hits: int) -> list[Path]:
    """Npz files of hits on a body of one mode, with white noise."""
    rng = np.random.default_rng(1)
    t = np.arange(SAMPLES) / RATE_HZ - 0.05
    pulse = np.exp(-((t / 4e-4) ** 2))
    ring = np.where(t > 0, np.exp(-8 * t) * np.sin(2 * np.pi * 200 * t), 0.0)
    paths = []
    for first in range(0, hits, IN_A_FILE):
        number = np.arange(first, min(first + IN_A_FILE, hits))
        heights = rng.uniform(50, 100, (number.size, 1))
        paths.append(folder / f"{first}.npz")
        np.savez(
            paths[-1],
            force=_noisy(rng, heights * pulse),
            acceleration=_noisy(rng, heights * ring),
            point=1 + number // AT_A_POINT,
            hit=1 + number % AT_A_POINT,
        )
    return paths


def _noisy(rng: np.random.Generator, clean: FloatArray) -> FloatArray:
    return clean.astype(np.float32) + np.float32(0.05) * rng.standard_normal(clean.shape, np.float32)


def _row(name: str, cost: Cost) -> Cost:
    memory = f"{cost.memory / 2**20:9.0f}" if cost.memory else f"{'':9}"
    print(f"{name:28}{cost.clock:9.1f}{cost.processor:13.1f}{memory}", flush=True)
    return cost


def _alone(files: Sequence[Path]) -> Cost:
    clock, processor = time.perf_counter(), time.process_time()
    for path in files:
        with np.load(path) as arrays:
            for name in ("force", "acceleration"):
                for block in arrays[name]:
                    fft.rfft(block.astype(float))
    return Cost(time.perf_counter() - clock, time.process_time() - processor)


def _copied(service: LocalService, size: int, connections: int) -> Cost:
    """What PostgreSQL needs to store so many bytes, as many in each transaction as a file has."""
    url = psycopg_url(service.settings.database_url or "")
    block = os.urandom(4 * SAMPLES)
    transactions = size // (2 * IN_A_FILE * len(block))

    def store(count: int) -> None:
        with psycopg.connect(url) as connection:
            for _ in range(count):
                with (
                    connection.cursor() as cursor,
                    cursor.copy("COPY copied (data) FROM STDIN (FORMAT BINARY)") as copy,
                ):
                    copy.set_types(["bytea"])
                    for _ in range(2 * IN_A_FILE):
                        copy.write_row((block,))
                connection.commit()

    with psycopg.connect(url, autocommit=True) as connection:
        connection.execute("CREATE TABLE copied (id uuid PRIMARY KEY DEFAULT uuidv7(), data bytea)")
        connection.execute("ALTER TABLE copied ALTER COLUMN data SET STORAGE EXTERNAL")
        with _measured(service) as cost, ThreadPoolExecutor(connections) as pool:
            list(pool.map(store, [transactions // connections] * connections))
        connection.execute("DROP TABLE copied")
    return cost[0]


def _campaign(api: httpx.Client) -> str:
    tour = {"name": "many hits", "boundary": "free"}
    return str(api.post(f"structures/{structure_of(api)}/campaigns", json=tour).raise_for_status().json()["id"])


def _send(api: httpx.Client, campaign: str, files: Sequence[Path]) -> None:
    query = {"filename": "hits.npz", "mapping": json.dumps(MAPPING)}
    headers = {"Content-Type": "application/octet-stream"}

    def send(path: Path) -> None:
        with path.open("rb") as file:
            body = iter(lambda: file.read(1 << 20), b"")
            api.post(f"campaigns/{campaign}/records", content=body, params=query, headers=headers).raise_for_status()

    with ThreadPoolExecutor(SENDERS) as pool:
        list(pool.map(send, files))


def _process(api: httpx.Client, campaign: str) -> None:
    answer = api.post(f"campaigns/{campaign}/processings", json={}).raise_for_status()
    where = api.base_url.join(answer.headers["Location"])
    while (state := _state(api, where))["status"] in ("queued", "running"):
        time.sleep(0.5)
    assert state["status"] == "succeeded", state["error"]


def _state(api: httpx.Client, where: Any) -> dict[str, Any]:
    state: dict[str, Any] = api.get(where).raise_for_status().json()
    return state


def _watched(service: LocalService, work: Any) -> Cost:
    with peak_memory(service) as peak, _measured(service) as cost:
        work()
    return Cost(cost[0].clock, cost[0].processor, float(peak[1]))


@contextmanager
def _measured(service: LocalService) -> Iterator[list[Cost]]:
    """What the block takes, of this script, the service's processes and PostgreSQL's together."""
    found: list[Cost] = []
    clock, processor = time.perf_counter(), _processor_s(service)
    yield found
    found.append(Cost(time.perf_counter() - clock, _processor_s(service) - processor))


def _processor_s(service: LocalService) -> float:
    """Seconds of this process, and of all others that live or were waited for by one of them."""
    server = int((service.settings.data / "postgres" / "postmaster.pid").read_text().split("\n", 1)[0])
    total = time.process_time()
    for root in (server, *(process.pid for process in service.processes.values())):
        for each in (psutil.Process(root), *psutil.Process(root).children(recursive=True)):
            try:
                used = each.cpu_times()
            except psutil.NoSuchProcess:
                continue
            total += used.user + used.system + used.children_user + used.children_system
    return total
