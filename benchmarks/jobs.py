"""Jobs in numbers: what the queue costs, how soon a job starts and stops, what REST adds to the core, what a second
worker brings.

Targets: started under 100 ms after the POST, stopped under 1 s after the cancel, under 300 ms added to a real job, two
workers at least 1.7 times one on two processors.
"""

import os
import statistics
import subprocess
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from datetime import datetime
from typing import Any
from uuid import UUID

import httpx
import psutil

from benchmarks.clock import timed
from benchmarks.jobs_floor import EMPTY, SECOND, Floor, floor
from benchmarks.service import RAW, campaigns_of, ended, post
from benchmarks.tables import Table, load
from service.app.demo import paper
from service.compute.updating import compute_update
from service.jobs.queue import request_cancel
from service.jobs.tables import Job
from service.store.updating.loading import load_update

Row = Callable[..., None]


class _Quiet:
    """A report to nobody, for the core alone."""

    restored = None

    def __call__(self, _stage: str, _progress: float) -> None: ...

    def checkpoint(self, _data: bytes) -> None: ...


def jobs(empty: int = 200, cancelled: int = 20, real: int = 12) -> None:
    """What the queue costs, cancelling, what REST adds to the core, two workers over one."""
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    table = Table(load(), "what:58", "found:16", "target:10")

    def row(name: str, value: str, target: str = "") -> None:
        table.row(name, value, target)

    with floor() as here:
        _queue_costs(here, row)
        _throughput(here, empty, row)
        _cancelling(here, cancelled, row)
    with floor() as here:
        _real_jobs(here, real, row)


def _spread(values: Sequence[float]) -> str:
    return f"{1000 * statistics.median(values):.1f} / {1000 * max(values):.1f} ms"


def _seconds(later: datetime | None, earlier: datetime | None) -> float:
    return (later - earlier).total_seconds()


def _queue_costs(here: Floor, row: Row) -> None:
    """Enqueueing, and an idle worker's answer to one job."""
    enqueued = [timed(lambda: here.put(EMPTY, 1))[1][0] for _ in range(100)]
    row("enqueue one job and commit, median / worst of 100", _spread(enqueued))
    worker = here.worker()
    here.wait(100)
    waits = []
    for _ in range(30):
        time.sleep(0.15)  # until it is idle
        job = _end_of(here, here.put(EMPTY, 1)[0])
        waits.append(_seconds(job.started_at, job.queued_at))
    row("idle worker: queued to started, median / worst of 30", _spread(waits))
    _stop(here, worker)


def _end_of(here: Floor, job_id: UUID) -> Job:
    with here.sessions() as session:
        job = session.get_one(Job, job_id)
        while job.finished_at is None:
            time.sleep(0.01)
            session.expire(job)
            session.commit()
        return job


def _stop(here: Floor, *workers: subprocess.Popen[bytes]) -> None:
    for worker in workers:
        worker.terminate()
    for worker in workers:
        worker.wait(30)
        here.processes.remove(worker)


def _throughput(here: Floor, jobs: int, row: Row) -> None:
    """Empty jobs a second at one, two and four workers."""
    for count in (1, 2, 4):
        workers = [here.worker() for _ in range(count)]
        time.sleep(6)  # until they are all there
        mine = set(here.put(EMPTY, jobs))
        rows = [job for job in here.jobs() if job.id in mine]
        while any(job.finished_at is None for job in rows):
            time.sleep(0.1)
            rows = [job for job in here.jobs() if job.id in mine]
        seconds = max(_seconds(job.finished_at, rows[0].queued_at) for job in rows)
        seconds -= min(_seconds(job.started_at, rows[0].queued_at) for job in rows)
        row(f"empty jobs a second, {count} worker(s)", f"{jobs / seconds:.1f}")
        _stop(here, *workers)


def _cancelling(here: Floor, times: int, row: Row) -> None:
    """From the request to the end of a busy process."""
    worker, passed = here.worker(), []
    for _ in range(times):
        (job_id,) = here.put(SECOND, 1)
        child = _busy_child(here, worker.pid, job_id)
        began = time.perf_counter()
        with here.sessions.begin() as session:
            request_cancel(session, job_id)
        while child.is_running() and child.status() != psutil.STATUS_ZOMBIE:
            time.sleep(0.002)
        passed.append(time.perf_counter() - began)
        _end_of(here, job_id)
    row(f"cancel to the end of the process, median / worst of {times}", _spread(passed), "< 1000 ms")
    _stop(here, worker)


def _busy_child(here: Floor, worker: int, job_id: UUID) -> psutil.Process:
    """The job's process: the youngest child of the worker's fork server, once it computes."""
    here.until(lambda: any(job.id == job_id and "step" in (job.stage or "") for job in here.jobs()), "the computation")
    parent = psutil.Process(worker)
    children = [child for child in parent.children(recursive=True) if child.parent() != parent]
    return max(children, key=lambda child: child.create_time())


def _real_jobs(here: Floor, jobs: int, row: Row) -> None:
    """Real updates over REST against the core alone, and one worker against two."""
    with here.client("benchmark") as api:
        first, (campaign,) = here.modalbase("worker"), campaigns_of(api, "benchmark")
        ended(api, api.post(f"campaigns/{campaign}/imports", content=paper.uff_file(), headers=RAW))
        modes = post(api, f"campaigns/{campaign}/mode-sets", {"name": "published", "modes": paper.MODES})["id"]
        recipe = {"mode_set": modes}
        runs = [_run(api, campaign, recipe) for _ in range(jobs + 1)][1:]  # the first one warms the caches of files
        wall, started = [run[0] for run in runs], [run[1] for run in runs]
        with here.sessions() as session:
            inputs = load_update(session, UUID(runs[-1][2]), here.folder)
        bare = [timed(lambda: list(compute_update(inputs, _Quiet())))[1][0] for _ in range(jobs + 1)][1:]
        row("POST to started, over REST, median / worst", _spread(started), "< 100 ms")
        row("real job over REST, median / worst", _spread(wall))
        row("the same by the core alone, median / worst", _spread(bare))
        added = 1000 * (statistics.median(wall) - statistics.median(bare))
        row("REST, queue, process and storage add", f"{added:.0f} ms", "< 300 ms")
        one = _batch(api, campaign, recipe, 2 * jobs)
        second = here.modalbase("worker")
        time.sleep(8)  # until it is there
        two = _batch(api, campaign, recipe, 2 * jobs)
        row("real jobs a second, one worker / two", f"{one:.2f} / {two:.2f}")
        row("two workers over one", f"{two / one:.2f}", f">= 1.7; two bare cores here: {_two_cores():.2f}")
        _stop(here, first, second)


def _run(api: httpx.Client, campaign: str, recipe: dict[str, Any]) -> tuple[float, float, str]:
    """Seconds from the POST to the result in hand, and to the start; the job's id."""
    posted, began = time.time(), time.perf_counter()
    job = ended(api, api.post(f"campaigns/{campaign}/update-jobs", json=recipe))
    api.get(f"update-jobs/{job['id']}/result").raise_for_status()
    seconds = time.perf_counter() - began
    return seconds, datetime.fromisoformat(job["started_at"]).timestamp() - posted, job["id"]


def _batch(api: httpx.Client, campaign: str, recipe: dict[str, Any], jobs: int) -> float:
    """Real jobs a second."""
    began = time.perf_counter()
    made = post(api, "update-jobs", {"recipe": recipe, "jobs": [{"campaign_id": campaign}] * jobs})["items"]
    for job in made:
        ended(api, f"update-jobs/{job['id']}")
    return jobs / (time.perf_counter() - began)


def _two_cores() -> float:
    """What two processes at once bring over one on this machine now: the limit for two workers."""
    command = ["python3", "-c", "sum(i * i for i in range(6_000_000))"]

    def run(count: int) -> None:
        with ThreadPoolExecutor(count) as pool:
            list(pool.map(lambda _: subprocess.run(command, check=True), range(count)))

    one, two = (timed(lambda count=count: run(count))[1][0] for count in (1, 2))
    return float(2 * one / two)
