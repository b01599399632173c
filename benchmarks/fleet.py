"""A fleet of monitors that is rerun, and recordings of a watched structure, by one worker and by
two.

What workers do among themselves they do anywhere; PostgreSQL is what all of them share. So its
processor seconds a rerun say how many reruns a second one processor of a server of its own carries,
and how many workers keep it busy.
"""

import io
import json
import os
import time
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from uuid import UUID

import httpx
import numpy as np
from sqlalchemy import func, select

from benchmarks import output_only
from benchmarks.clock import timed
from benchmarks.service import ended, processor_s
from benchmarks.tables import Table, load
from examples.monitoring import State, measured_frfs, post_campaign, structure_body
from fecore.arrays import FloatArray
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


def hourly(recordings: int = 24, seconds: int = 600) -> None:
    """Recordings of eight sensors at 256 Hz become campaigns, spectra, modes and a judgement, by one
    worker and two: recordings an hour, processor time of workers and of PostgreSQL.
    """
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    made = [output_only.recording(seed)[0][:, : int(seconds * output_only.RATE)] for seed in (1, 2)]
    table = Table(
        f"{recordings} recordings of {seconds} s, of each; {load()}",
        *("workers:8", "read/h:.0f", "s of workers:.2f", "of PostgreSQL:.3f"),
        *("judged/h:.0f", "s of workers:.2f", "of PostgreSQL:.3f"),
    )
    with floor() as here, here.client("hourly") as api:
        project = posted(api, "projects", {"name": "hourly"})["id"]
        workers = [here.modalbase("worker")]
        # a few first that do not count, so that every worker has loaded what it needs
        for count, hours in ((1, 4), (1, recordings), (2, 8), (2, recordings)):
            workers += [here.modalbase("worker") for _ in range(count - len(workers))]
            time.sleep(8)  # until it is there
            name = f"{count} {hours}"
            structure = posted(api, f"projects/{project}/structures", {"name": name})["id"]
            watch = {"name": "deck", "watch": "modes", "runs_on": "hand"}
            monitor = posted(api, f"structures/{structure}/monitors", watch)["id"]

            def read(structure: str = structure, hours: int = hours) -> None:
                sent = [
                    _send(api, structure, np.roll(made[hour % 2], 1000 * hour, axis=1), hour)
                    for hour in range(hours)
                ]
                for each in sent:
                    ended(api, each)

            def judge(monitor: str = monitor) -> None:
                posted(api, f"monitors/{monitor}/runs", {})
                _until_judged(here, monitor)

            pids = [worker.pid for worker in workers]
            figures = (*_hourly(here, pids, hours, read), *_hourly(here, pids, hours, judge))
            if hours == recordings:
                table.row(count, *figures)


def _send(api: httpx.Client, structure: str, samples: FloatArray, hour: int) -> httpx.Response:
    """Send one recording as a campaign of its own."""
    file = io.BytesIO()
    np.savez(file, data=samples.T.astype(np.float32), fs=output_only.RATE)
    at = datetime(2026, 1, 1, tzinfo=UTC) + timedelta(hours=hour)
    sensor = {"quantity": "acceleration", "unit": "m/s²", "direction": 3}
    mapping = {
        "recording": {},
        "sample_rate_hz": {"variable": "fs"},
        "channels": [
            {"variable": f"data column {k}", "point": k, **sensor}
            for k in range(1, len(samples) + 1)
        ],
    }
    campaign = {"name": at.isoformat(), "boundary": "as_modelled", "performed_at": at.isoformat()}
    return api.post(
        f"structures/{structure}/imports",
        content=file.getvalue(),
        headers={"Content-Type": "application/octet-stream"},
        params={
            "filename": f"{hour}.npz",
            "campaign": json.dumps(campaign),
            "mapping": json.dumps(mapping),
        },
    )


def _until_judged(here: Floor, monitor: str) -> None:
    query = select(MonitorSeries.assessed_at).where(MonitorSeries.monitor_id == UUID(monitor))
    with here.sessions() as session:
        while session.execute(query).scalar_one_or_none() is None:
            session.rollback()
            time.sleep(0.2)


def _hourly(
    here: Floor, workers: list[int], recordings: int, work: Callable[[], None]
) -> tuple[float, float, float]:
    """Recordings an hour, and processor seconds of workers and of PostgreSQL for each."""
    server = int(Path(here.folder, "postgres", "postmaster.pid").read_text().split("\n", 1)[0])
    before = processor_s(*workers), processor_s(server)
    seconds = float(timed(work)[1][0])
    after = processor_s(*workers), processor_s(server)
    used = [(now - then) / recordings for now, then in zip(after, before, strict=True)]
    return 3600 * recordings / seconds, used[0], used[1]
