"""A service of its own for a benchmark, what its processes and PostgreSQL take, and what a laboratory puts into it."""

import json
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

from service.app.demo import paper
from service.app.supervisor import LocalService
from service.db.engine import psycopg_url
from service.settings import Settings

RAW = {"Content-Type": "application/octet-stream"}
ASKED_FREELY: dict[str, Any] = {
    "webhook_networks": "198.51.100.0/24",  # so the service must be allowed to send there
    "key_requests_a_second": 10**6,
    "key_failures_a_minute": 10**6,
}
"""Settings of a service that is asked as much as can be."""


@contextmanager
def served(*, worker: bool = True, **settings: Any) -> Iterator[LocalService]:
    """A service on an empty database, or on a migrated one that the settings name."""
    with tempfile.TemporaryDirectory(prefix="mb-", ignore_cleanup_errors=True) as folder:
        data = Path(folder)
        data.chmod(0o755)  # the server may run as a user of its own
        with LocalService(Settings(data=data, port=0, log_level="error", **settings), worker=worker) as service:
            yield service


@contextmanager
def api_of(service: LocalService, name: str = "benchmark") -> Iterator[httpx.Client]:
    """A client with a key of its own."""
    with client_at(f"{service.url}/api/v1/", service.new_key(name)) as api:
        yield api


def client_at(url: str, key: str) -> httpx.Client:
    """A client of an API at an address, with a key."""
    return httpx.Client(base_url=url, headers={"Authorization": f"Bearer {key}"}, timeout=600, trust_env=False)


def post(api: httpx.Client, path: str, body: Any = None, **more: Any) -> Any:
    """The answer to a POST, which must succeed."""
    answer = api.post(path, **({"json": body} if body is not None else {}), **more)
    if answer.is_error:
        raise RuntimeError(f"POST {path}: {answer.status_code} {answer.text}")
    return answer.json() if answer.content else None


def campaigns_of(api: httpx.Client, name: str, count: int = 1) -> list[str]:
    """Ids of new campaigns of the paper's beam, without FRFs, in a project of their own."""
    project = post(api, "projects", {"name": name})["id"]
    structure = post(api, f"projects/{project}/structures", paper.STRUCTURE)["id"]
    path = f"structures/{structure}/campaigns"
    return [str(post(api, path, {**paper.CAMPAIGN, "name": f"{name} {n}"})["id"]) for n in range(count)]


def ended(api: httpx.Client, answer: httpx.Response | str) -> dict[str, Any]:
    """The last state of a job at an address or that an answer names, which must succeed; its events are followed.

    Asking again and again would keep a processor busy that the job needs.
    """
    location = api.base_url.join(answer if isinstance(answer, str) else answer.raise_for_status().headers["Location"])
    state: dict[str, Any] = {}
    if "update-jobs" in location.path:
        with api.stream("GET", f"{location}/events") as stream:
            for line in stream.iter_lines():
                state = json.loads(line[6:]) if line.startswith("data: ") else state
    while (state := state or api.get(location).raise_for_status().json())["status"] in ("queued", "running"):
        state = time.sleep(0.05) or {}
    assert state["status"] == "succeeded", state
    return state


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


def processor_s(*roots: int) -> float:
    """Seconds of processes, of all that live below them, and of those that were waited for."""
    total = 0.0
    for each in _family(roots):
        try:
            used = each.cpu_times()
        except psutil.NoSuchProcess:
            continue
        total += used.user + used.system + used.children_user + used.children_system
    return total


def _processor_s(service: LocalService) -> float:
    server = int((service.settings.data / "postgres" / "postmaster.pid").read_text().split("\n", 1)[0])
    return time.process_time() + processor_s(server, *(process.pid for process in service.processes.values()))


def copied(service: LocalService, transactions: Sequence[Sequence[bytes]], connections: int = 1) -> Cost:
    """What PostgreSQL alone needs to store these bytes by COPY, over one connection or several."""
    url = psycopg_url(service.settings.database_url)

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
