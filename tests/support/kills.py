"""The service under kills.

Three clients work without a pause: one imports a UFF file into a new campaign, one updates the
model, one sends messages to a webhook, each at least once. Each repeats what is not answered, and
goes on when what it asked for has ended. Meanwhile API, workers, PostgreSQL and the processes that
workers fork their computations from are killed in turn, each time after something has ended, so
that a slow machine gets on too. Nothing that was acknowledged may be lost, every job ends once, and
no kill is an internal error.
"""

import random
import subprocess
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from itertools import count
from typing import Any

import httpx
import psutil
from sqlalchemy import text

from service.pages.example import paper
from tests.support.backups import RECIPE
from tests.support.floor import Floor, floor
from tests.support.receivers import receiver
from tests.support.rest import RAW, campaigns_of, ok, plain_client
from tests.support.waiting import until

SETTINGS: dict[str, Any] = {
    "job_lease_seconds": 3.0,
    "webhook_networks": "127.0.0.0/8",
    "webhook_ports": "1024-65535",  # the receiver takes a free one
    "delivery_pause_seconds": 0.5,
}
FRFS = 33  # of the paper's file
# First those over which a message may have to be sent again, half a minute later.
VICTIMS = ("PostgreSQL", "worker", "fork server", "API", "fork server", "worker")


@dataclass
class Tally:
    """What was done, and what came of it."""

    killed: Counter[str] = field(default_factory=Counter)  # how often, by what
    # ids that an answer promised, by kind: `import`, `update`, `message`
    acknowledged: dict[str, list[str]] = field(
        default_factory=lambda: {"import": [], "update": [], "message": []}
    )
    received: list[str] = field(default_factory=list)  # ids of messages, as often as they came
    states: Counter[str] = field(default_factory=Counter)  # of all jobs
    reasons: Counter[str] = field(default_factory=Counter)  # of the jobs that failed
    # what was promised and is not there, each in words
    lost: list[str] = field(default_factory=list)
    # attempts, losses: of all jobs
    attempts: int = 0
    losses: int = 0

    @property
    def ended(self) -> int:
        """How much of what was asked for has ended."""
        return sum(map(len, self.acknowledged.values()))


def soak(kills: int, seed: int = 11, workers: int = 2) -> Tally:
    """Kill so often, and count what came of it.

    Args:
        kills: how often.
        seed: of the moments and of which worker.
        workers: kept running.
    """
    tally, rng = Tally(), random.Random(seed)
    with floor() as here, receiver() as hook, ExitStack() as lines:
        first = lines.enter_context(here.client("soak", **SETTINGS))
        others = [
            lines.enter_context(plain_client(first.base_url, dict(first.headers))) for _ in range(2)
        ]
        clients, house = (
            [_Client(http) for http in (first, *others)],
            _House(here, first.base_url.port or 0, workers),
        )
        with _at_work(clients, tally, hook.url) as check:
            for number in range(kills):
                ended, what = tally.ended, VICTIMS[number % len(VICTIMS)]
                here.until(
                    lambda ended=ended: check() or tally.ended > ended,
                    "the end of something between two kills",
                )
                time.sleep(rng.uniform(0, 1))
                here.until(lambda what=what: house.kill(what, rng), f"a {what} to kill")
                tally.killed[what] += 1
        sent = tally.acknowledged["message"]
        here.until(
            lambda: set(sent) <= {headers["webhook-id"] for headers, _ in hook.got},
            "the last messages",
        )
        tally.received = [headers["webhook-id"] for headers, _ in hook.got]
        here.wait(len(here.jobs()))
        _count(here, clients[0], tally)
    return tally


# --- clients ------------------------------------------------------------------------------------------------------------


class _Client:
    """A client that does not give up: what is not answered, or not now, is asked again."""

    def __init__(self, http: httpx.Client) -> None:
        self.http = http

    def ask(self, method: str, path: str, **arguments: Any) -> Any:
        """The body of the answer."""

        def answer() -> httpx.Response | None:
            try:
                found = self.http.request(method, path, **arguments)
            except httpx.TransportError:
                return None
            return None if found.status_code >= 500 or found.status_code == 429 else found

        (found,) = until(
            lambda: [one] if (one := answer()) is not None else [], f"an answer to {method} {path}"
        )
        return ok(found)

    def to_its_end(self, path: str, kind: str, **arguments: Any) -> str:
        """Begin a job, and wait until it has ended: its id."""
        key = str(self.ask("POST", path, **arguments)["id"])
        until(
            lambda: self.ask("GET", f"{kind}/{key}")["status"] not in ("queued", "running"),
            f"the end of {kind}/{key}",
        )
        return key

    def send_file(self, campaign: str) -> str:
        """Import the paper's file."""
        return self.to_its_end(
            f"campaigns/{campaign}/imports", "imports", content=paper.uff_file(), headers=RAW
        )


Work = Iterator[str]  # what a client does, id by id of what was acknowledged


def _imports(client: _Client) -> Work:
    (first,) = campaigns_of(client.http, "imports")
    structure = client.ask("GET", f"campaigns/{first}")["structure_id"]
    while True:
        yield client.send_file(
            client.ask("POST", f"structures/{structure}/campaigns", json=paper.CAMPAIGN)["id"]
        )


def _updates(client: _Client) -> Work:
    (campaign,) = campaigns_of(client.http, "updates")
    client.send_file(campaign)
    modes = client.ask(
        "POST", f"campaigns/{campaign}/mode-sets", json={"name": "published", "modes": paper.MODES}
    )
    for number in count():
        once, recipe = {"Idempotency-Key": f"soak {number}"}, {**RECIPE, "mode_set": modes["id"]}
        yield client.to_its_end(
            f"campaigns/{campaign}/update-jobs", "update-jobs", json=recipe, headers=once
        )


def _messages(client: _Client, hook: str) -> Work:
    project = client.ask("POST", "projects", json={"name": "messages"})["id"]
    webhook = client.ask("POST", "webhooks", json={"project": project, "url": hook})["id"]
    while True:
        time.sleep(0.5)
        yield client.ask("POST", f"webhooks/{webhook}/test")["message_id"]


@contextmanager
def _at_work(clients: Sequence[_Client], tally: Tally, hook: str) -> Iterator[Callable[[], None]]:
    """Let clients work, each in a thread, until the block ends; what is given raises what a client
    has ended with.
    """
    over, broken = threading.Event(), list[Exception]()
    works = {
        "import": _imports(clients[0]),
        "update": _updates(clients[1]),
        "message": _messages(clients[2], hook),
    }

    def run(kind: str, work: Work) -> None:
        try:
            for key in work:
                tally.acknowledged[kind].append(key)
                if over.is_set():
                    return
        except Exception as error:  # noqa: BLE001 - `check` raises it again
            broken.append(error)

    def check() -> None:
        if broken:
            raise broken[0]

    threads = [threading.Thread(target=run, args=each) for each in works.items()]
    for thread in threads:
        thread.start()
    try:
        yield check
    finally:
        over.set()
        for thread in threads:
            thread.join()
    check()


# --- kills --------------------------------------------------------------------------------------------------------------


class _House:
    """The service's processes, each started again when it is killed."""

    def __init__(self, here: Floor, port: int, workers: int) -> None:
        self.here, self.port, self.api = here, port, here.processes[0]
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
        elif not (busy := self._busy()):
            return False
        elif what == "worker":
            number = rng.choice(busy)
            self.here.kill(self.workers[number])
            self.workers[number] = self._worker()
        else:
            return _kill_fork_server(self.workers[rng.choice(busy)].pid)
        return True

    def _busy(self) -> list[int]:
        """Workers with a job; not where two have died with it already, for after the third it is
        given up.
        """
        running = [job for job in self.here.jobs() if job.state == "running" and job.losses < 2]
        pids = {int((job.worker or "::").split(":")[1]) for job in running}
        return [number for number, worker in enumerate(self.workers) if worker.pid in pids]


def _kill_fork_server(worker: int) -> bool:
    for child in psutil.Process(worker).children():
        if "forkserver import" in " ".join(child.cmdline()):
            child.kill()
            return True
    return False


def _count(here: Floor, client: _Client, tally: Tally) -> None:
    jobs = {str(job.id): job for job in here.jobs()}
    tally.states = Counter(job.state for job in jobs.values())
    tally.reasons = Counter(
        str((job.error or {})["reason"]) for job in jobs.values() if job.state == "failed"
    )
    tally.attempts, tally.losses = (
        sum(getattr(job, n) for job in jobs.values()) for n in ("attempt", "losses")
    )
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
    stored = text(
        "SELECT count(f.id) FROM imports i JOIN frfs f USING (campaign_id) WHERE i.id = :id"
    )
    with here.sessions() as session:
        for key in tally.acknowledged["import"]:
            if (found := session.scalar(stored, {"id": key})) != FRFS:
                tally.lost.append(f"import {key} has {found} FRFs")
    tally.lost += [
        f"message {key}" for key in tally.acknowledged["message"] if key not in set(tally.received)
    ]
