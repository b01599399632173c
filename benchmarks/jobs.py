"""Jobs in numbers: what the queue costs, how soon a job starts and stops, what REST adds to the core, what a second
worker brings. Targets: started under 100 ms after the POST, stopped under 1 s after the cancel, under 300 ms added to
a real job, two workers at least 1.7 times one on two processors.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from datetime import datetime
from typing import Any
from uuid import UUID

import httpx
import psutil

from benchmarks.jobs_floor import EMPTY, SECOND, Floor, floor
from service.access.keys import create_key, user_named
from service.app.demo import paper
from service.app.supervisor import listening_socket
from service.compute.updating import compute_update
from service.jobs.queue import request_cancel
from service.jobs.tables import Job
from service.store.updating.loading import load_update


class _Quiet:
    """A report to nobody, for the core alone."""

    restored = None

    def __call__(self, _stage: str, _progress: float) -> None: ...

    def checkpoint(self, _data: bytes) -> None: ...


def _row(name: str, value: str, limit: str = "") -> None:
    print(f"  {name:<58} {value:>16}  {limit}")


def _spread(values: Sequence[float]) -> str:
    return f"{1000 * statistics.median(values):.1f} / {1000 * max(values):.1f} ms"


def _stamp(moment: datetime | None) -> float:
    assert moment is not None
    return moment.timestamp()


def queue_costs(here: Floor) -> None:
    """Enqueueing, and an idle worker's answer to one job."""
    times = []
    for _ in range(100):
        began = time.perf_counter()
        here.put(EMPTY, 1)
        times.append(time.perf_counter() - began)
    _row("enqueue one job and commit, median / worst of 100", _spread(times))
    worker = here.worker()
    here.wait(100)
    for job_id in [here.put(EMPTY, 1)[0] for _ in range(30) if not time.sleep(0.15)]:
        times.append(_wait_of(here, job_id))
    _row("idle worker: queued to started, median / worst of 30", _spread(times[100:]))
    _stop(here, worker)


def _wait_of(here: Floor, job_id: UUID) -> float:
    with here.sessions() as session:
        job = session.get_one(Job, job_id)
        while job.finished_at is None:
            time.sleep(0.01)
            session.expire(job)
            session.commit()
        return _stamp(job.started_at) - _stamp(job.queued_at)


def _stop(here: Floor, *workers: subprocess.Popen[bytes]) -> None:
    for worker in workers:
        worker.terminate()
    for worker in workers:
        worker.wait(30)
        here.processes.remove(worker)


def throughput(here: Floor, jobs: int = 200) -> None:
    """Empty jobs a second at one, two and four workers."""
    for count in (1, 2, 4):
        workers = [here.worker() for _ in range(count)]
        time.sleep(6)  # until they are all there
        mine = set(here.put(EMPTY, jobs))
        while sum(job.finished_at is not None for job in here.jobs() if job.id in mine) < jobs:
            time.sleep(0.1)
        rows = [job for job in here.jobs() if job.id in mine]
        seconds = max(_stamp(job.finished_at) for job in rows) - min(_stamp(job.started_at) for job in rows)
        _row(f"empty jobs a second, {count} worker(s)", f"{jobs / seconds:.1f}")
        _stop(here, *workers)


def cancelling(here: Floor, times: int = 20) -> None:
    """From the request to the end of a busy process."""
    worker = here.worker()
    passed = []
    for _ in range(times):
        (job_id,) = here.put(SECOND, 1)
        child = _busy_child(worker.pid)
        began = time.perf_counter()
        with here.sessions.begin() as session:
            request_cancel(session, job_id)
        while child.is_running() and child.status() != psutil.STATUS_ZOMBIE:
            time.sleep(0.002)
        passed.append(time.perf_counter() - began)
        _wait_of(here, job_id)
    _row(f"cancel to the end of the process, median / worst of {times}", _spread(passed), "< 1000 ms")
    _stop(here, worker)


def _busy_child(worker: int) -> psutil.Process:
    """The job's process: a child of the worker's fork server that computes."""
    while True:
        for child in psutil.Process(worker).children(recursive=True):
            try:
                if child.parent() != psutil.Process(worker) and child.cpu_percent(0.1) > 20:
                    return child
            except psutil.NoSuchProcess:
                continue


def real_jobs(here: Floor, jobs: int = 12) -> None:
    """Real updates over REST against the core alone, and one worker against two."""
    with listening_socket("127.0.0.1", 0) as free:
        port = free.getsockname()[1]
    here.api(port)
    with here.sessions.begin() as session:
        key = create_key(session, user_named(session, "benchmark"), "benchmark")[1]
    headers = {"Authorization": f"Bearer {key}"}
    with httpx.Client(base_url=f"http://127.0.0.1:{port}/api/v1/", headers=headers, timeout=60, trust_env=False) as api:
        first = here.modalbase("worker")
        campaign, modes = _campaign(api)
        recipe = {"mode_set": modes}
        _run(api, campaign, recipe)  # the first one warms the caches of files
        wall, started, job_id = [], [], ""
        for _ in range(jobs):
            seconds, to_start, job_id = _run(api, campaign, recipe)
            wall.append(seconds)
            started.append(to_start)
        bare = _bare(here, UUID(job_id), jobs)
        _row("POST to started, over REST, median / worst", _spread(started), "< 100 ms")
        _row("real job over REST, median / worst", _spread(wall))
        _row("the same by the core alone, median / worst", _spread(bare))
        _row(
            "REST, queue, process and storage add",
            f"{1000 * (statistics.median(wall) - statistics.median(bare)):.0f} ms",
            "< 300 ms",
        )
        one = _batch(api, campaign, recipe, 2 * jobs)
        second = here.modalbase("worker")
        time.sleep(8)
        two = _batch(api, campaign, recipe, 2 * jobs)
        _row("real jobs a second, one worker / two", f"{one:.2f} / {two:.2f}")
        _row("two workers over one", f"{two / one:.2f}", f">= 1.7; two bare cores here: {_two_cores():.2f}")
        _stop(here, first, second)


def _campaign(api: httpx.Client) -> tuple[str, str]:
    project = api.post("projects", json={"name": "benchmark"}).raise_for_status().json()["id"]
    structure = api.post(f"projects/{project}/structures", json=paper.STRUCTURE).raise_for_status().json()["id"]
    campaign = api.post(f"structures/{structure}/campaigns", json=paper.CAMPAIGN).raise_for_status().json()["id"]
    kind = {"Content-Type": "application/octet-stream"}
    answer = api.post(f"campaigns/{campaign}/imports", content=paper.uff_file(), headers=kind).raise_for_status()
    _imported(api, answer.headers["Location"])
    body = {"name": "published", "modes": paper.MODES}
    return campaign, api.post(f"campaigns/{campaign}/mode-sets", json=body).raise_for_status().json()["id"]


def _finish(api: httpx.Client, location: str) -> dict[str, Any]:
    """Follow a job's events to its end: asking again and again would keep a processor busy that the job needs."""
    job: dict[str, Any] = {}
    with api.stream("GET", api.base_url.copy_with(path=f"{location}/events")) as stream:
        for line in stream.iter_lines():
            if line.startswith("data: "):
                job = json.loads(line[6:])
    if job["status"] != "succeeded":
        raise RuntimeError(job["message"])
    return job


def _imported(api: httpx.Client, location: str) -> None:
    while api.get(api.base_url.copy_with(path=location)).raise_for_status().json()["status"] != "succeeded":
        time.sleep(0.1)


def _run(api: httpx.Client, campaign: str, recipe: dict[str, Any]) -> tuple[float, float, str]:
    """Seconds from the POST to the result in hand, and to the start."""
    posted, began = time.time(), time.perf_counter()
    answer = api.post(f"campaigns/{campaign}/update-jobs", json=recipe).raise_for_status()
    job = _finish(api, answer.headers["Location"])
    api.get(f"update-jobs/{job['id']}/result").raise_for_status()
    seconds = time.perf_counter() - began
    return seconds, datetime.fromisoformat(job["started_at"]).timestamp() - posted, job["id"]


def _bare(here: Floor, job_id: UUID, times: int) -> list[float]:
    """The same computation in this process, its inputs at hand."""
    with here.sessions() as session:
        inputs = load_update(session, job_id, here.folder)
    passed = []
    for _ in range(times + 1):
        began = time.perf_counter()
        list(compute_update(inputs, _Quiet()))
        passed.append(time.perf_counter() - began)
    return passed[1:]


def _batch(api: httpx.Client, campaign: str, recipe: dict[str, Any], jobs: int) -> float:
    """Real jobs a second."""
    body = {"recipe": recipe, "jobs": [{"campaign_id": campaign}] * jobs}
    began = time.perf_counter()
    made = api.post("update-jobs", json=body).raise_for_status().json()["items"]
    for job in made:
        _finish(api, f"/api/v1/update-jobs/{job['id']}")
    return jobs / (time.perf_counter() - began)


def _two_cores() -> float:
    """What two processes at once bring over one on this machine now: the limit for two workers."""
    command = ["python3", "-c", "sum(i * i for i in range(6_000_000))"]

    def run(_: int) -> None:
        subprocess.run(command, check=True)

    times = []
    for count in (1, 2):
        began = time.perf_counter()
        with ThreadPoolExecutor(count) as pool:
            list(pool.map(run, range(count)))
        times.append((time.perf_counter() - began) / count)
    return times[0] / times[1]


def main() -> None:
    """Print the table."""
    print(f"  load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors")
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    with floor() as here:
        queue_costs(here)
        throughput(here)
        cancelling(here)
    with floor() as here:
        real_jobs(here)
