"""The service under kills.

Three clients work without a pause: one imports a UFF file into a new campaign, one updates the model, one sends messages
to a webhook, each at least once. Each repeats what is not answered, and goes on when what it asked for has ended.
Meanwhile API, workers, PostgreSQL and the processes that workers fork their computations from are killed in turn, each
time after something has ended, so that a slow machine gets on too. Nothing that was acknowledged may be lost, every job
ends once, and no kill is an internal error.
"""

from __future__ import annotations

import random
import subprocess
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import partial
from itertools import count
from typing import Any

import httpx
import psutil
from sqlalchemy import text

from benchmarks.jobs_floor import PATIENCE_SECONDS, Floor, floor
from benchmarks.service import RAW, campaigns_of, client_at
from service.app.demo import paper
from tests.support.receivers import receiver

SETTINGS: dict[str, Any] = {
    "job_lease_seconds": 3.0,
    "webhook_networks": "127.0.0.0/8",
    "webhook_ports": "1024-65535",  # the receiver takes a free one
    "delivery_pause_seconds": 0.5,
}
FRFS = 33  # of the paper's file


@dataclass
class Tally:
    """What was done, and what came of it.

    Attributes:
        killed: how often, by what.
        acknowledged: ids that an answer promised, by kind: `import`, `update`, `message`.
        received: ids of messages, as often as they came.
        states: of all jobs.
        reasons: of the jobs that failed.
        lost: what was promised and is not there, each in words.
        attempts, losses: of all jobs.
    """

    killed: Counter[str] = field(default_factory=Counter)
    acknowledged: dict[str, list[str]] = field(default_factory=lambda: {"import": [], "update": [], "message": []})
    received: list[str] = field(default_factory=list)
    states: Counter[str] = field(default_factory=Counter)
    reasons: Counter[str] = field(default_factory=Counter)
    lost: list[str] = field(default_factory=list)
    attempts: int = 0
    losses: int = 0
    seconds: float = 0.0

    @property
    def ended(self) -> int:
        """How much of what was asked for has ended."""
        return sum(map(len, self.acknowledged.values()))

    def lines(self) -> list[tuple[str, str]]:
        """The table."""
        several = sum(n > 1 for n in Counter(self.received).values())
        return [
            ("killed", _counts(self.killed)),
            ("acknowledged", ", ".join(f"{len(ids)} {kind}s" for kind, ids in self.acknowledged.items())),
            ("of these lost", "; ".join(self.lost) or "none"),
            ("jobs ended as", _counts(self.states)),
            ("reasons of failed jobs", _counts(self.reasons) or "none"),
            ("attempts begun / lost and recovered", f"{self.attempts} / {self.losses}"),
            ("messages received / of these more than once", f"{len(self.received)} / {several}"),
            ("seconds", f"{self.seconds:.0f}"),
        ]


class _Client:
    """A client that does not give up: what is not answered, or not now, is asked again."""

    def __init__(self, http: httpx.Client) -> None:
        self.http = http

    def ask(self, method: str, path: str, **arguments: Any) -> Any:
        """The body of the answer."""
        end = time.monotonic() + PATIENCE_SECONDS
        while time.monotonic() < end:
            try:
                answer = self.http.request(method, path, **arguments)
            except httpx.TransportError:
                answer = None
            if answer is not None and answer.status_code < 500 and answer.status_code != 429:
                if answer.is_error:
                    raise RuntimeError(f"{method} {path}: {answer.status_code} {answer.text}")
                return answer.json()
            time.sleep(0.2)
        raise TimeoutError(f"{method} {path} was not answered in {PATIENCE_SECONDS:g} s")

    def end_of(self, path: str) -> None:
        """Wait until a job has ended."""
        while self.ask("GET", path)["status"] in ("queued", "running"):
            time.sleep(0.1)

    def send_file(self, campaign: str) -> str:
        """Import the paper's file to its end: the import's id."""
        made = self.ask("POST", f"campaigns/{campaign}/imports", content=paper.uff_file(), headers=RAW)
        self.end_of(f"imports/{made['id']}")
        return str(made["id"])


def soak_kills(kills: int = 100) -> list[str]:
    """Print the table; what was lost."""
    tally = soak(kills)
    for name, value in tally.lines():
        print(f"  {name:<44} {value}")
    return [*tally.lost, *tally.reasons]


def soak(kills: int, seed: int = 11, workers: int = 2) -> Tally:
    """Kill so often, and count what came of it.

    Args:
        kills: how often.
        workers: kept running.
        seed: of the moments and of which worker.
    """
    tally, began = Tally(), time.monotonic()
    with floor() as here, receiver() as hook, ExitStack() as lines:
        first = lines.enter_context(here.client("soak", **SETTINGS))
        address, key = str(first.base_url), first.headers["Authorization"].split()[1]
        others = [lines.enter_context(client_at(address, key)) for _ in range(2)]
        clients, house = [_Client(http) for http in (first, *others)], _House(here, first.base_url.port or 0, workers)
        works = (_imports, _updates, _messages(hook.url))
        with _at_work([partial(work, client, tally) for work, client in zip(works, clients, strict=True)]) as check:
            _kill(house, tally, kills, random.Random(seed), check)
        sent = tally.acknowledged["message"]
        here.until(lambda: set(sent) <= {headers["webhook-id"] for headers, _ in hook.got}, "the last messages")
        tally.received = [headers["webhook-id"] for headers, _ in hook.got]
        here.wait(len(here.jobs()))
        _count(here, clients[0], tally)
    tally.seconds = time.monotonic() - began
    return tally


@contextmanager
def _at_work(works: list[Callable[[threading.Event], None]]) -> Iterator[Callable[[], None]]:
    """Let clients work, each in a thread, until the block ends; what is given raises what a client has ended with."""
    over, broken = threading.Event(), list[Exception]()

    def run(work: Callable[[threading.Event], None]) -> None:
        try:
            work(over)
        except Exception as error:  # noqa: BLE001 - `check` raises it again
            broken.append(error)

    def check() -> None:
        if broken:
            raise broken[0]

    threads = [threading.Thread(target=run, args=(work,)) for work in works]
    for thread in threads:
        thread.start()
    try:
        yield check
    finally:
        over.set()
        for thread in threads:
            thread.join()
    check()


def _imports(client: _Client, tally: Tally, over: threading.Event) -> None:
    (first,) = campaigns_of(client.http, "imports")
    structure = client.ask("GET", f"campaigns/{first}")["structure_id"]
    while True:
        campaign = client.ask("POST", f"structures/{structure}/campaigns", json=paper.CAMPAIGN)["id"]
        tally.acknowledged["import"].append(client.send_file(campaign))
        if over.is_set():
            return


def _updates(client: _Client, tally: Tally, over: threading.Event) -> None:
    (campaign,) = campaigns_of(client.http, "updates")
    client.send_file(campaign)
    modes = client.ask("POST", f"campaigns/{campaign}/mode-sets", json={"name": "published", "modes": paper.MODES})
    for number in count():
        path, headers = f"campaigns/{campaign}/update-jobs", {"Idempotency-Key": f"soak {number}"}
        made = client.ask("POST", path, json={"mode_set": modes["id"]}, headers=headers)
        client.end_of(f"update-jobs/{made['id']}")
        tally.acknowledged["update"].append(made["id"])
        if over.is_set():
            return


def _messages(hook: str) -> Callable[[_Client, Tally, threading.Event], None]:
    def work(client: _Client, tally: Tally, over: threading.Event) -> None:
        project = client.ask("POST", "projects", json={"name": "messages"})["id"]
        webhook = client.ask("POST", "webhooks", json={"project": project, "url": hook})["id"]
        while not over.wait(0.5):
            tally.acknowledged["message"].append(client.ask("POST", f"webhooks/{webhook}/test")["message_id"])

    return work


class _House:
    """The service's processes, each started again when it is killed."""

    def __init__(self, here: Floor, port: int, workers: int) -> None:
        self.here, self.port = here, port
        self.api = here.processes[0]
        self.workers = [self._worker() for _ in range(workers)]

    def _worker(self) -> subprocess.Popen[bytes]:
        return self.here.modalbase("worker", **SETTINGS)

    def kill(self, what: str, rng: random.Random) -> bool:
        """Kill one; False where there is nothing to kill now."""
        for number, worker in enumerate(self.workers):
            if worker.poll() is not None:  # it found no database when it started, and ended
                self.here.processes.remove(worker)
                self.workers[number] = self._worker()
        if what == "API":
            self.here.kill(self.api)
            self.api = self.here.api(self.port, **SETTINGS)
        elif what == "PostgreSQL":
            self.here.crash_database()
        else:
            if not (busy := self._busy()):
                return False
            number = rng.choice(busy)
            if what == "worker":
                self.here.kill(self.workers[number])
                self.workers[number] = self._worker()
            else:
                return _kill_fork_server(self.workers[number].pid)
        return True

    def _busy(self) -> list[int]:
        """Workers with a job; not where two have died with it already, for after the third it is given up."""
        running = [job for job in self.here.jobs() if job.state == "running" and job.losses < 2]
        pids = {int((job.worker or "::").split(":")[1]) for job in running}
        return [number for number, worker in enumerate(self.workers) if worker.pid in pids]


def _kill_fork_server(worker: int) -> bool:
    for child in psutil.Process(worker).children():
        if "forkserver import" in " ".join(child.cmdline()):
            child.kill()
            return True
    return False


def _kill(house: _House, tally: Tally, kills: int, rng: random.Random, check: Callable[[], None]) -> None:
    # First those over which a message may have to be sent again, half a minute later.
    kinds = ("PostgreSQL", "worker", "fork server", "API", "fork server", "worker")
    for number in range(kills):
        ended = tally.ended

        def more(ended: int = ended) -> bool:
            check()
            return tally.ended > ended

        house.here.until(more, "the end of something between two kills")
        time.sleep(rng.uniform(0, 1))
        what = kinds[number % len(kinds)]
        house.here.until(lambda what=what: house.kill(what, rng), f"a {what} to kill")
        tally.killed[what] += 1


def _count(here: Floor, client: _Client, tally: Tally) -> None:
    jobs = {str(job.id): job for job in here.jobs()}
    tally.states = Counter(job.state for job in jobs.values())
    tally.reasons = Counter(str((job.error or {})["reason"]) for job in jobs.values() if job.state == "failed")
    tally.attempts = sum(job.attempt for job in jobs.values())
    tally.losses = sum(job.losses for job in jobs.values())
    for kind in ("import", "update"):
        for key in tally.acknowledged[kind]:
            if key not in jobs or jobs[key].state != "succeeded":
                tally.lost.append(f"{kind} {key} is {jobs[key].state if key in jobs else 'gone'}")
    updates = sum(job.kind == "update" for job in jobs.values())
    if updates != len(tally.acknowledged["update"]):  # a repeated request has made a second one
        tally.lost.append(f"{updates} update jobs for {len(tally.acknowledged['update'])} requests")
    for key in tally.acknowledged["update"]:
        if not client.ask("GET", f"update-jobs/{key}/result")["parameters"]:
            tally.lost.append(f"update {key} has no parameters")
    stored = text("SELECT count(f.id) FROM imports i JOIN frfs f USING (campaign_id) WHERE i.id = :id")
    with here.sessions() as session:
        for key in tally.acknowledged["import"]:
            if (found := session.scalar(stored, {"id": key})) != FRFS:
                tally.lost.append(f"import {key} has {found} FRFs")
    tally.lost += [f"message {key}" for key in tally.acknowledged["message"] if key not in set(tally.received)]


def _counts(counter: Counter[str]) -> str:
    return ", ".join(f"{n} {what}" for what, n in sorted(counter.items()))
