"""A service of its own for a benchmark, and what its processes and PostgreSQL take."""

import json
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import psutil
import psycopg

from modalbase.formats.uff import Axis, Frf, GridPoint
from service.app.supervisor import LocalService
from service.platform.db.engine import psycopg_url
from service.platform.settings import Settings
from tests.support.rest import client_at


@contextmanager
def served(*, worker: bool = True, **settings: Any) -> Iterator[LocalService]:
    """A service on an empty database, or on a migrated one that the settings name."""
    with tempfile.TemporaryDirectory(prefix="mb-", ignore_cleanup_errors=True) as folder:
        data = Path(folder)
        data.chmod(0o755)  # the server may run as a user of its own
        with LocalService(
            Settings(data=data, port=0, log_level="error", **settings), worker=worker
        ) as service:
            yield service


@contextmanager
def api_of(service: LocalService, name: str = "benchmark") -> Iterator[httpx.Client]:
    """A client with a key of its own, which keeps its connection."""
    with client_at(service.url, service.new_key(name), limits=httpx.Limits()) as api:
        yield api


def ended(api: httpx.Client, answer: httpx.Response | str) -> dict[str, Any]:
    """The last state of a job at an address or that an answer names, which must succeed; its events
    are followed.

    Asking again and again would keep a processor busy that the job needs.
    """
    location = api.base_url.join(
        answer if isinstance(answer, str) else answer.raise_for_status().headers["Location"]
    )
    state: dict[str, Any] = {}
    if "update-jobs" in location.path:
        with api.stream("GET", f"{location}/events") as stream:
            for line in stream.iter_lines():
                state = json.loads(line[6:]) if line.startswith("data: ") else state
    while (state := state or api.get(location).raise_for_status().json())["status"] in (
        "queued",
        "running",
    ):
        state = time.sleep(0.05) or {}
    assert state["status"] == "succeeded", state
    return state


@dataclass
class Cost:
    """Seconds of the clock and of all processors; memory of API, worker and children: peak, and
    above idle, bytes.
    """

    clock: float = 0.0
    processor: float = 0.0
    peak: float = 0.0
    above_idle: float = 0.0


@contextmanager
def measured(service: LocalService) -> Iterator[Cost]:
    """What a block takes, of this process, the service's and PostgreSQL's together; filled in at
    its end.
    """
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
    server = int(
        (service.settings.data / "postgres" / "postmaster.pid").read_text().split("\n", 1)[0]
    )
    return time.process_time() + processor_s(
        server, *(process.pid for process in service.processes.values())
    )


def copied(service: LocalService, transactions: Sequence[Sequence[bytes]]) -> Cost:
    """What PostgreSQL alone needs to store these bytes by COPY."""
    with psycopg.connect(psycopg_url(service.settings.database_url), autocommit=True) as connection:
        connection.execute("CREATE TABLE copied (id uuid PRIMARY KEY DEFAULT uuidv7(), data bytea)")
        connection.execute("ALTER TABLE copied ALTER COLUMN data SET STORAGE EXTERNAL")
        # as `original_chunks`
        connection.execute("ALTER TABLE copied SET (toast_tuple_target = 8160)")
        command = "COPY copied (data) FROM STDIN (FORMAT BINARY)"
        with measured(service) as cost:
            for rows in transactions:
                with (
                    connection.transaction(),
                    connection.cursor() as cursor,
                    cursor.copy(command) as copy,
                ):
                    copy.set_types(["bytea"])
                    for row in rows:
                        copy.write_row((row,))
        connection.execute("DROP TABLE copied")
    return cost


def contents(
    frfs: int, lines: int, step_hz: float = 1.0, seed: int = 1
) -> Iterator[GridPoint | Frf]:
    """What a UFF file of random FRFs, each of a point of its own, is written from."""
    rng, axis = np.random.default_rng(seed), Axis(0.0, step_hz, lines)
    yield from (GridPoint(n, (0.001 * n, 0.0, 0.0)) for n in range(1, frfs + 1))
    for n in range(1, frfs + 1):
        real, imaginary = rng.standard_normal((2, lines))
        label = f"FRF {n}Z/1Z"
        ids = (label, "NONE", "NONE", "NONE", "NONE")
        yield Frf(0, label, ids, n, 3, 1, 3, "accelerance", axis, real + 1j * imaginary)
