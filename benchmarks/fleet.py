"""A fleet of monitors that is rerun by one worker and by two.

What workers do among themselves they do anywhere; PostgreSQL is what all of them share. So its
processor seconds a rerun say how many reruns a second one processor of a server of its own carries,
and how many workers keep it busy.
"""

import os
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path

import httpx
from sqlalchemy import func, select

from benchmarks.clock import timed
from benchmarks.service import ended, processor_s
from benchmarks.tables import Table, load
from examples.monitoring import State, measured_frfs, post_campaign, structure_body
from service.nouns.monitors.tables import MonitorSeries
from tests.support.floor import Floor, floor
from tests.support.rest import posted

PLANNED = 1000 * 120  # reruns of the fleet that is asked about


def fleet(structures: int = 6, campaigns: int = 6) -> None:
    """Monitors' reruns by one worker and two: reruns a second, processor time of workers and of
    PostgreSQL.
    """
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    print(
        "processor seconds of a rerun, and hours of the planned ones: of workers, of PostgreSQL;"
        " and how many workers"
    )
    title = (
        f"keep one of its processors busy; {structures} structures with {campaigns} campaigns,"
        f" {load()}"
    )
    spent = (
        "workers s:.2f",
        "PostgreSQL s:.3f",
        f"{PLANNED:,} reruns, workers h:.0f",
        "PostgreSQL h:.1f",
    )
    table = Table(title, "workers:8", "reruns/s:.2f", *spent, "workers over PostgreSQL:.0f")
    with floor() as here, here.client("fleet") as api:
        project = posted(api, "projects", {"name": "fleet"})["id"]
        workers = [here.modalbase("worker")]  # reads the FRFs too
        made = [_monitor(api, project, n, campaigns) for n in range(structures)]
        monitors = [monitor for monitor, _ in made]
        for count in (1, 2):
            workers += [here.modalbase("worker") for _ in range(count - len(workers))]
            time.sleep(8)  # until it is there
            _warm(api, made[0][1], 4 * count)
            found = _rerun(
                here, api, monitors, campaigns, [worker.pid for worker in workers], 1 + count
            )
            table.row(count, *found)


def _warm(api: httpx.Client, campaign: str, jobs: int) -> None:
    """Updates that do not count, so that every worker has loaded what it needs."""
    made = posted(api, "update-jobs", {"jobs": [{"campaign_id": campaign}] * jobs})["items"]
    for job in made:
        ended(api, f"update-jobs/{job['id']}")


def _monitor(api: httpx.Client, project: str, number: int, campaigns: int) -> tuple[str, str]:
    """A structure with its campaigns, and a monitor that runs when it is asked; the monitor and the
    last campaign.
    """
    structure = posted(
        api, f"projects/{project}/structures", {**structure_body(), "name": f"stringer {number}"}
    )["id"]
    for month in range(campaigns):
        at = datetime(2025, 1, 1, tzinfo=UTC) + timedelta(days=30 * month)
        body = {"name": f"month {month}", "performed_at": at.isoformat(), "temperature_c": 20.0}
        campaign = post_campaign(
            api, structure, body, measured_frfs(State(), seed=1000 * number + month)
        )
    watch = {
        "name": "Ex",
        "parameters": [{"name": "Ex"}],
        "baseline": {"campaigns": 4},
        "runs_on": "hand",
    }
    return str(posted(api, f"structures/{structure}/monitors", watch)["id"]), campaign


def _rerun(
    here: Floor,
    api: httpx.Client,
    monitors: list[str],
    campaigns: int,
    workers: list[int],
    series: int,
) -> tuple[float, ...]:
    """The columns of the table."""
    server = int(Path(here.folder, "postgres", "postmaster.pid").read_text().split("\n", 1)[0])
    before = processor_s(server), processor_s(*workers)

    def rerun() -> None:
        for monitor in monitors:
            posted(api, f"monitors/{monitor}/runs", {"rerun": True, "reason": "the fleet is rerun"})
        query = select(func.count()).where(
            MonitorSeries.number == series, MonitorSeries.assessed_at.is_not(None)
        )
        # a monitor judges a version of its series when all of its runs have ended
        with here.sessions() as session:
            while session.execute(query).scalar_one() < len(monitors):
                session.rollback()
                time.sleep(1)

    seconds, runs = float(timed(rerun)[1][0]), len(monitors) * campaigns
    database, work = (
        after - then
        for after, then in zip((processor_s(server), processor_s(*workers)), before, strict=True)
    )
    hours = PLANNED / runs / 3600  # of the planned reruns, for each second of these
    return (
        runs / seconds,
        work / runs,
        database / runs,
        hours * work,
        hours * database,
        work / database,
    )
