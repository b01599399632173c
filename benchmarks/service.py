"""A service of its own for a benchmark, and what its processes and PostgreSQL take."""

from __future__ import annotations

import os
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import psutil
import psycopg

from service.app.supervisor import LocalService
from service.db.engine import psycopg_url
from service.settings import Settings

STRUCTURE = {
    "name": "beam",
    "geometry": {"length_m": 0.5, "width_m": 0.04, "thickness_m": 0.01},
    "density_kg_m3": 2012,
    "material": {"Ex_Pa": 33e9, "Ey_Pa": 32e9, "Gxy_Pa": 6e9, "Gxz_Pa": 5e9, "Gyz_Pa": 5e9, "nu_xy": 0.15},
}
RAW = {"Content-Type": "application/octet-stream"}


@contextmanager
def served() -> Iterator[tuple[LocalService, httpx.Client, Path]]:
    """A service on an empty database, a client with a key of its own, and a folder that ends with them."""
    with tempfile.TemporaryDirectory(prefix="mb-") as folder:
        settings = Settings(data=Path(folder) / "db", port=0, log_level="error")
        with LocalService(settings) as service:
            headers = {"Authorization": f"Bearer {service.new_key('benchmark')}"}
            address = f"{service.url}/api/v1/"
            with httpx.Client(base_url=address, headers=headers, timeout=600, trust_env=False) as api:
                yield service, api, Path(folder)


def post(api: httpx.Client, path: str, body: object) -> Any:
    """The answer to a JSON body."""
    return api.post(path, json=body).raise_for_status().json()


def campaign_of(api: httpx.Client, name: str) -> str:
    """Id of a new campaign of a new beam."""
    project = post(api, "projects", {"name": name})["id"]
    structure = post(api, f"projects/{project}/structures", STRUCTURE)["id"]
    return str(post(api, f"structures/{structure}/campaigns", {"name": name, "boundary": "cantilever"})["id"])


def ended(api: httpx.Client, answer: httpx.Response) -> dict[str, Any]:
    """The last state of the job that an answer names, which must succeed."""
    location = api.base_url.join(answer.raise_for_status().headers["Location"])
    while (state := api.get(location).raise_for_status().json())["status"] in ("queued", "running"):
        time.sleep(0.05)
    assert state["status"] == "succeeded", state["error"]
    return dict(state)


def load() -> str:
    """The machine's load, for the head of a table."""
    return f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors"


@dataclass
class Cost:
    """Seconds of the clock and of all processors; memory of API, worker and children: peak, and above idle, bytes."""

    clock: float = 0.0
    processor: float = 0.0
    peak: float = 0.0
    above_idle: float = 0.0


@contextmanager
def measured(service: LocalService) -> Iterator[Cost]:
    """What a block takes, of this process, the service's and PostgreSQL's together; filled in at its end."""
    cost, done, idle = Cost(), threading.Event(), _resident(service)

    def watch() -> None:
        while not done.wait(0.05):
            cost.peak = max(cost.peak, _resident(service))

    thread = threading.Thread(target=watch)
    thread.start()
    clock, processor = time.perf_counter(), _processor_s(service)
    try:
        yield cost
    finally:
        cost.clock, cost.processor = time.perf_counter() - clock, _processor_s(service) - processor
        done.set()
        thread.join()
        cost.above_idle = cost.peak - idle


def _family(roots: Sequence[int]) -> Iterator[psutil.Process]:
    for root in roots:
        yield from (psutil.Process(root), *psutil.Process(root).children(recursive=True))


def _resident(service: LocalService) -> float:
    total = 0.0
    for each in _family([process.pid for process in service.processes.values()]):
        try:
            total += each.memory_info().rss
        except psutil.NoSuchProcess:
            continue
    return total


def _processor_s(service: LocalService) -> float:
    """Seconds of this process, and of all others that live or were waited for by one of them."""
    server = int((service.settings.data / "postgres" / "postmaster.pid").read_text().split("\n", 1)[0])
    total = time.process_time()
    for each in _family([server, *(process.pid for process in service.processes.values())]):
        try:
            used = each.cpu_times()
        except psutil.NoSuchProcess:
            continue
        total += used.user + used.system + used.children_user + used.children_system
    return total


def copied(service: LocalService, transactions: Sequence[Sequence[bytes]], connections: int = 1) -> Cost:
    """What PostgreSQL alone needs to store these bytes by COPY, over one connection or several."""
    url = psycopg_url(service.settings.database_url or "")

    def store(share: Sequence[Sequence[bytes]]) -> None:
        command = "COPY copied (data) FROM STDIN (FORMAT BINARY)"
        with psycopg.connect(url, autocommit=True) as connection:
            for rows in share:
                with connection.transaction(), connection.cursor() as cursor, cursor.copy(command) as copy:
                    copy.set_types(["bytea"])
                    for row in rows:
                        copy.write_row((row,))

    with psycopg.connect(url, autocommit=True) as connection:
        connection.execute("CREATE TABLE copied (id uuid PRIMARY KEY DEFAULT uuidv7(), data bytea)")
        connection.execute("ALTER TABLE copied ALTER COLUMN data SET STORAGE EXTERNAL")
        connection.execute("ALTER TABLE copied SET (toast_tuple_target = 8160)")  # as `original_chunks`
        with measured(service) as cost, ThreadPoolExecutor(connections) as pool:
            list(pool.map(store, [transactions[first::connections] for first in range(connections)]))
        connection.execute("DROP TABLE copied")
    return cost
