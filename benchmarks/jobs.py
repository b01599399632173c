"""Jobs in numbers: how soon one starts and stops, what REST adds to the core, what a second worker
brings.
"""

import os
import statistics
import subprocess
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from datetime import datetime
from itertools import chain
from typing import Any
from uuid import UUID

import httpx
import psutil

from benchmarks.clock import timed
from benchmarks.service import ended
from benchmarks.tables import Table, load
from service.nouns.updates.tables import UpdateJob
from service.pages.example import paper
from service.platform.queue.queue import request_cancel
from service.tasks.update.compute import compute_update
from service.tasks.update.loading import load_update
from tests.support.floor import Floor, floor
from tests.support.rest import RAW, campaigns_of, posted
from tests.support.working import look, wait

Row = tuple[str, str, str]  # what, what was found, and the target


class _Quiet:
    """A report to nobody, for the core alone."""

    restored = None

    def __call__(self, _stage: str, _progress: float) -> None: ...

    def checkpoint(self, _data: bytes) -> None: ...


def jobs(empty: int = 200, cancelled: int = 20, real: int = 12) -> None:
    """What the queue costs, cancelling, what REST adds to the core, two workers over one."""
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    table = Table(load(), "what:58", "found:16", "target:10")
    with floor() as here:
        for row in chain(_starts(here), _throughput(here, empty), _cancelling(here, cancelled)):
            table.row(*row)
    with floor() as here:
        for row in _real_jobs(here, real):
            table.row(*row)


def _spread(values: Sequence[float]) -> str:
    return f"{1000 * statistics.median(values):.1f} / {1000 * max(values):.1f} ms"


def _starts(here: Floor) -> Iterator[Row]:
    """Queueing, and an idle worker's answer to one job."""
    queued = [timed(lambda: here.put("empty", 1))[1][0] for _ in range(100)]
    yield "enqueue one job and commit, median / worst of 100", _spread(queued), ""
    worker, waits = here.worker(), []
    here.wait(100)
    for _ in range(30):
        time.sleep(0.15)  # until it is idle
        job = wait(here.sessions, here.put("empty", 1)[0])
        waits.append((job.started_at - job.queued_at).total_seconds())
    yield "idle worker: queued to started, median / worst of 30", _spread(waits), ""
    _stop(here, worker)


def _stop(here: Floor, *workers: subprocess.Popen[bytes]) -> None:
    for worker in workers:
        worker.terminate()
    for worker in workers:
        worker.wait(30)
        here.processes.remove(worker)


def _throughput(here: Floor, jobs: int) -> Iterator[Row]:
    """Empty jobs a second at one, two and four workers."""
    for count in (1, 2, 4):
        workers = [here.worker() for _ in range(count)]
        time.sleep(6)  # until they are all there
        before = len(here.jobs())
        mine = set(here.put("empty", jobs))
        here.wait(before + jobs)
        rows = [job for job in here.jobs() if job.id in mine]
        took = max(job.finished_at for job in rows) - min(job.started_at for job in rows)
        yield f"empty jobs a second, {count} worker(s)", f"{jobs / took.total_seconds():.1f}", ""
        _stop(here, *workers)


def _cancelling(here: Floor, times: int) -> Iterator[Row]:
    """From the request to the end of a busy process."""
    worker, passed = here.worker(), []
    for _ in range(times):
        (job_id,) = here.put("busy", 1)
        child = _busy_child(here, worker.pid, job_id)
        began = time.perf_counter()
        with here.sessions.begin() as session:
            request_cancel(session, job_id)
        while child.is_running() and child.status() != psutil.STATUS_ZOMBIE:
            time.sleep(0.002)
        passed.append(time.perf_counter() - began)
        wait(here.sessions, job_id)
    yield (
        f"cancel to the end of the process, median / worst of {times}",
        _spread(passed),
        "< 1000 ms",
    )
    _stop(here, worker)


def _busy_child(here: Floor, worker: int, job_id: UUID) -> psutil.Process:
    """The job's process: the youngest child of the worker's fork server, once it computes."""
    here.until(lambda: "step" in (look(here.sessions, job_id).stage or ""), "the computation")
    parent = psutil.Process(worker)
    children = [child for child in parent.children(recursive=True) if child.parent() != parent]
    return max(children, key=lambda child: child.create_time())


def _real_jobs(here: Floor, jobs: int) -> Iterator[Row]:
    """Real updates over REST against the core alone, and one worker against two."""
    with here.client("benchmark") as api:
        first, (campaign,) = here.modalbase("worker"), campaigns_of(api, "benchmark")
        ended(api, api.post(f"campaigns/{campaign}/imports", content=paper.uff_file(), headers=RAW))
        modes = posted(
            api, f"campaigns/{campaign}/mode-sets", {"name": "published", "modes": paper.MODES}
        )["id"]
        recipe = {"mode_set": modes}
        # the first one warms the caches of files
        runs = [_run(api, campaign, recipe) for _ in range(jobs + 1)][1:]
        wall, started, ids = zip(*runs, strict=True)
        with here.sessions() as session:
            inputs = load_update(session, session.get_one(UpdateJob, UUID(ids[-1])), here.folder)
        bare = [
            timed(lambda: list(compute_update(inputs, _Quiet())))[1][0] for _ in range(jobs + 1)
        ][1:]
        yield "POST to started, over REST, median / worst", _spread(started), "< 100 ms"
        yield "real job over REST, median / worst", _spread(wall), ""
        yield "the same by the core alone, median / worst", _spread(bare), ""
        added = 1000 * (statistics.median(wall) - statistics.median(bare))
        yield "REST, queue, process and storage add", f"{added:.0f} ms", "< 300 ms"
        one = _batch(api, campaign, recipe, 2 * jobs)
        second = here.modalbase("worker")
        time.sleep(8)  # until it is there
        two = _batch(api, campaign, recipe, 2 * jobs)
        yield "real jobs a second, one worker / two", f"{one:.2f} / {two:.2f}", ""
        yield (
            "two workers over one",
            f"{two / one:.2f}",
            f">= 1.7; two bare cores here: {_two_cores():.2f}",
        )
        _stop(here, first, second)


def _run(api: httpx.Client, campaign: str, recipe: dict[str, Any]) -> tuple[float, float, str]:
    """Seconds from the POST to the result in hand, and to the start; the job's id."""
    sent, began = time.time(), time.perf_counter()
    job = ended(api, api.post(f"campaigns/{campaign}/update-jobs", json=recipe))
    api.get(f"update-jobs/{job['id']}/result").raise_for_status()
    seconds = time.perf_counter() - began
    return seconds, datetime.fromisoformat(job["started_at"]).timestamp() - sent, job["id"]


def _batch(api: httpx.Client, campaign: str, recipe: dict[str, Any], jobs: int) -> float:
    """Real jobs a second."""
    began = time.perf_counter()
    made = posted(
        api, "update-jobs", {"recipe": recipe, "jobs": [{"campaign_id": campaign}] * jobs}
    )["items"]
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
