"""A fleet of monitors that is rerun by one worker and by two: reruns a second, and what each step that they share costs.

What workers do among themselves they do anywhere; PostgreSQL is what all of them share. So its processor seconds a rerun say
how many reruns a second one processor of a server of its own carries, and how many workers keep it busy.
"""

import os
import statistics
import time
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from uuid import UUID

import httpx
from sqlalchemy import func, select

from benchmarks.clock import timed
from benchmarks.jobs_floor import EMPTY, Floor, floor
from benchmarks.service import ended, post, processor_s
from benchmarks.tables import Table, load
from examples.monitoring import State, measured_frfs, post_campaign, structure_body
from service.monitoring.scheduler import check
from service.monitoring.tables import MonitorSeries
from service.store.updating.loading import load_update
from service.store.updating.tables import UpdateJob

PLANNED = 1000 * 120  # reruns of the fleet that is asked about


def fleet(structures: int = 6, campaigns: int = 6) -> None:
    """Monitors' reruns by one worker and two, and what each step costs that they share."""
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    print(
        "processor seconds of a rerun, and hours of the planned ones: of workers, of PostgreSQL; and how many workers"
    )
    title = f"keep one of its processors busy; {structures} structures with {campaigns} campaigns, {load()}"
    spent = ("workers s:.2f", "PostgreSQL s:.3f", f"{PLANNED:,} reruns, workers h:.0f", "PostgreSQL h:.1f")
    table = Table(title, "workers:8", "reruns/s:.2f", *spent, "workers over PostgreSQL:.0f")
    with floor() as here, here.client("fleet") as api:
        project = post(api, "projects", {"name": "fleet"})["id"]
        workers = [here.modalbase("worker")]  # reads the FRFs too
        made = [_monitor(api, project, n, campaigns) for n in range(structures)]
        monitors = [monitor for monitor, _ in made]
        for count in (1, 2):
            workers += [here.modalbase("worker") for _ in range(count - len(workers))]
            time.sleep(8)  # until it is there
            _warm(api, made[0][1], 4 * count)
            found = _rerun(here, api, monitors, campaigns, [worker.pid for worker in workers], 1 + count)
            table.row(count, *found)
        _shared_steps(here, monitors)


def _warm(api: httpx.Client, campaign: str, jobs: int) -> None:
    """Updates that do not count, so that every worker has loaded what it needs."""
    made = post(api, "update-jobs", {"jobs": [{"campaign_id": campaign}] * jobs})["items"]
    for job in made:
        ended(api, f"update-jobs/{job['id']}")


def _monitor(api: httpx.Client, project: str, number: int, campaigns: int) -> tuple[str, str]:
    """A structure with its campaigns, and a monitor that runs when it is asked; the monitor and the last campaign."""
    structure = post(api, f"projects/{project}/structures", {**structure_body(), "name": f"stringer {number}"})["id"]
    for month in range(campaigns):
        at = datetime(2025, 1, 1, tzinfo=UTC) + timedelta(days=30 * month)
        body = {"name": f"month {month}", "performed_at": at.isoformat(), "temperature_c": 20.0}
        campaign = post_campaign(api, structure, body, measured_frfs(State(), seed=1000 * number + month))
    watch = {"name": "Ex", "parameters": [{"name": "Ex"}], "baseline": {"campaigns": 4}, "runs_on": "hand"}
    return str(post(api, f"structures/{structure}/monitors", watch)["id"]), campaign


def _judged(here: Floor, series: int, monitors: int) -> None:
    """Until so many monitors have judged a version of their series, which they do when all of its runs have ended."""
    query = select(func.count()).where(MonitorSeries.number == series, MonitorSeries.assessed_at.is_not(None))

    def all_judged() -> bool:
        with here.sessions() as session:
            return session.execute(query).scalar_one() >= monitors

    here.until(lambda: all_judged() or time.sleep(1), f"the judgement of series {series}")


def _rerun(
    here: Floor, api: httpx.Client, monitors: list[str], campaigns: int, workers: list[int], series: int
) -> tuple[float, ...]:
    """The columns of the table."""
    server = int(Path(here.folder, "postgres", "postmaster.pid").read_text().split("\n", 1)[0])
    before = processor_s(server), processor_s(*workers)

    def rerun() -> None:
        for monitor in monitors:
            post(api, f"monitors/{monitor}/runs", {"rerun": True, "reason": "the fleet is rerun"})
        _judged(here, series, len(monitors))

    seconds, runs = float(timed(rerun)[1][0]), len(monitors) * campaigns
    database, work = (
        after - then for after, then in zip((processor_s(server), processor_s(*workers)), before, strict=True)
    )
    hours = PLANNED / runs / 3600  # of the planned reruns, for each second of these
    return runs / seconds, work / runs, database / runs, hours * work, hours * database, work / database


def _shared_steps(here: Floor, monitors: list[str]) -> None:
    """Milliseconds by the clock of what asks PostgreSQL, median."""

    def look(monitor: str) -> None:
        with here.sessions() as session:
            check(session, UUID(monitor), timedelta(0))
            session.rollback()

    def read(job: UUID) -> None:
        with here.sessions() as session:
            load_update(session, job, here.folder)

    with here.sessions() as session:
        jobs = session.scalars(select(UpdateJob.id).order_by(UpdateJob.id.desc()).limit(20)).all()
    steps: dict[str, list[Callable[[], object]]] = {
        "the scheduler looks at a monitor": [lambda m=m: look(m) for m in monitors for _ in range(5)],  # type: ignore[misc]
        "a job is queued": [lambda: here.put(EMPTY, 1) for _ in range(20)],
        "a worker reads what an update needs": [lambda job=job: read(job) for job in jobs],  # type: ignore[misc]
    }
    for name, calls in steps.items():
        print(f"  {name}: {1000 * statistics.median(timed(call)[1][0] for call in calls):.1f} ms", flush=True)
