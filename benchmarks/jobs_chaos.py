"""Jobs while workers, the API and PostgreSQL are killed: no job is lost, none is done twice, all finish.

Jobs are sent over REST by a client that repeats what was not answered, under an idempotency key. Meanwhile a random
worker is killed after every few jobs and another takes its place, the API is killed twice, PostgreSQL crashes once.
"""

from __future__ import annotations

import random
import subprocess
import threading
import time
from collections import Counter
from dataclasses import dataclass, field

import httpx

from benchmarks.jobs_floor import PATIENCE_SECONDS, Floor, floor, laboratory
from service.access.keys import create_key, user_named
from service.app.supervisor import listening_socket

LEASE_SECONDS = 3.0
LOOK_SECONDS = 0.1


@dataclass
class Tally:
    """What happened, and the outcome."""

    jobs: int
    seconds: float = 0.0
    workers_started: int = 0
    workers_killed: int = 0
    workers_ended: int = 0
    apis_killed: int = 0
    database_away_seconds: list[float] = field(default_factory=list)
    repeated_requests: int = 0
    states: Counter[str] = field(default_factory=Counter)
    attempts: int = 0
    losses: int = 0
    rows: int = 0
    results: int = 0
    doubled: int = 0

    def lines(self) -> list[tuple[str, str]]:
        """The table."""
        away = ", ".join(f"{seconds:.1f} s" for seconds in self.database_away_seconds)
        return [
            ("jobs sent / rows", f"{self.jobs} / {self.rows}"),
            ("workers started / killed", f"{self.workers_started} / {self.workers_killed}"),
            ("workers that found no database and ended", f"{self.workers_ended}"),
            ("API killed", f"{self.apis_killed}"),
            ("PostgreSQL crashed, away for", f"{len(self.database_away_seconds)}: {away}"),
            ("requests repeated by the client", f"{self.repeated_requests}"),
            ("attempts begun", f"{self.attempts}"),
            ("attempts lost and recovered", f"{self.losses}"),
            ("ended as", ", ".join(f"{n} {state}" for state, n in sorted(self.states.items()))),
            ("results / of these doubled", f"{self.results} / {self.doubled}"),
            ("seconds from first job to last", f"{self.seconds:.1f}"),
        ]


class _Sender:
    """A client that does not give up: what was not answered is sent again under the same key."""

    def __init__(self, port: int, key: str, tally: Tally) -> None:
        self.client = httpx.Client(
            base_url=f"http://127.0.0.1:{port}/api/v1/",
            headers={"Authorization": f"Bearer {key}"},
            timeout=60,
            trust_env=False,
        )
        self.tally = tally
        self.sent = 0
        self.killed = threading.Event()  # a worker was

    def send_all(self, campaign: str, jobs: int, milliseconds: int, pace_seconds: float) -> None:
        for number in range(jobs):
            if number == jobs - 1:
                self.killed.wait()  # so that work is left for the workers that live
            self.send(campaign, number, milliseconds)
            self.sent += 1
            time.sleep(pace_seconds)

    def send(self, campaign: str, number: int, milliseconds: int) -> None:
        for _ in range(600):
            try:
                answer = self.client.post(
                    f"campaigns/{campaign}/update-jobs",
                    json={"seed": milliseconds},
                    headers={"Idempotency-Key": f"chaos {number}"},
                )
            except httpx.TransportError:
                answer = None
            if answer is not None and answer.status_code < 500:
                answer.raise_for_status()
                return
            self.tally.repeated_requests += 1
            time.sleep(0.2)
        raise TimeoutError(f"job {number} could not be sent")


def chaos(
    jobs: int,
    *,
    workers: int = 3,
    milliseconds: int = 300,
    pace_seconds: float = 0.2,
    kill_jobs: tuple[int, int] = (3, 8),
    seed: int = 7,
) -> Tally:
    """Send jobs and make trouble until all have ended.

    Args:
        jobs: how many.
        workers: kept running.
        milliseconds: processor time of a job.
        pace_seconds: between two jobs sent.
        kill_jobs: fewest and most jobs that end between two killed workers, so that a slow machine gets on too.
        seed: of the choice of victims and moments.
    """
    tally, rng = Tally(jobs), random.Random(seed)
    with floor() as here:
        with listening_socket("127.0.0.1", 0) as free:
            port = free.getsockname()[1]
        api = here.api(port)
        with here.sessions.begin() as session:
            key = create_key(session, user_named(session, "chaos"), "chaos")[1]
        sender = _Sender(port, key, tally)
        (campaign,) = laboratory(sender.client)
        staff = [here.worker(job_lease_seconds=LEASE_SECONDS) for _ in range(workers)]
        tally.workers_started = workers
        began = time.monotonic()
        sending = threading.Thread(
            target=sender.send_all, args=(campaign, jobs, milliseconds, pace_seconds), daemon=True
        )
        sending.start()
        next_kill = 1
        trouble = {0.2: "api", 0.4: "database", 0.7: "api"}  # when this share of the jobs is sent
        while (ended := _ended(here)) < jobs or trouble:
            if time.monotonic() - began > PATIENCE_SECONDS + 3 * jobs:
                raise TimeoutError(f"{ended} of {jobs} jobs have ended")
            time.sleep(LOOK_SECONDS)
            if ended >= next_kill and (at_work := _at_work(here, staff)):
                next_kill = ended + rng.randint(*kill_jobs)
                victim = rng.choice(at_work)
                here.kill(staff[victim])
                staff[victim] = here.worker(job_lease_seconds=LEASE_SECONDS)
                tally.workers_killed += 1
                sender.killed.set()
                tally.workers_started += 1
            for number, worker in enumerate(staff):
                if worker.poll() is not None:  # it started while there was no database; a service manager does the same
                    staff[number] = here.worker(job_lease_seconds=LEASE_SECONDS)
                    tally.workers_ended += 1
                    tally.workers_started += 1
            for share in [share for share in trouble if sender.sent >= share * jobs]:
                if trouble.pop(share) == "api":
                    here.kill(api)
                    api = here.api(port)
                    tally.apis_killed += 1
                else:
                    tally.database_away_seconds.append(here.crash_database())
        sending.join()
        sender.client.close()
        tally.seconds = time.monotonic() - began
        _count(here, tally)
    return tally


def _ended(here: Floor) -> int:
    return sum(job.finished_at is not None for job in here.jobs())


def _at_work(here: Floor, staff: list[subprocess.Popen[bytes]]) -> list[int]:
    """Which workers have had a job already: to kill one that is still starting proves nothing.

    Without those at a job that two have died with already: after the third it would be given up.
    """
    had = [(int(job.worker.split(":")[1]), job) for job in here.jobs() if job.worker]
    seen = {process for process, _ in had}
    spared = {process for process, job in had if job.finished_at is None and job.losses >= 2}
    return [number for number, worker in enumerate(staff) if worker.pid in seen - spared]


def _count(here: Floor, tally: Tally) -> None:
    jobs, results = here.jobs(), Counter(here.results())
    tally.rows = len(jobs)
    tally.states = Counter(job.state for job in jobs)
    tally.attempts, tally.losses = sum(job.attempt for job in jobs), sum(job.losses for job in jobs)
    tally.results, tally.doubled = results.total(), sum(n > 1 for n in results.values())


def main() -> None:
    """Print the table of 300 jobs, three workers and a killing after every few."""
    for name, value in chaos(300).lines():
        print(f"  {name:<42} {value}")
