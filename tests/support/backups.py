"""A backup of jobs that wait and run.

A service gets jobs of every kind, its worker is killed while two updates run, one of these and a
waiting one are cancelled. `modalbase backup` writes all to a file, `modalbase restore` fills a new
data folder from it, and a worker there runs every job to its end.
"""

import os
import subprocess
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass, field
from datetime import timedelta
from pathlib import Path
from typing import Any
from uuid import UUID

import httpx
import numpy as np
from sqlalchemy import text

from modalbase.formats.uff import Frf, GridPoint, read_file
from modalbase.formats.uff.write import encode
from service.monitoring.scheduler import check
from service.pages.example import paper
from service.platform.db.opening import embedded_server
from service.platform.queue.tables import Job
from tests.support.floor import Floor, floor
from tests.support.places import ROOT
from tests.support.rest import RAW, posted

POINTS = (14, 33)  # hit in the paper's file; so many of its FRFs are enough
RECIPE = {
    "damping_models": ["rayleigh"],
    "parameters": [{"name": "Ex"}, {"name": "Gxy"}, {"name": "Gxz", "fixed": True}],
}
MONITOR: dict[str, Any] = {
    "name": "watch", "modes": "given", "runs_on": "hand", "recipe": RECIPE, "parameters": [{"name": "Ex"}],
    "baseline": {"campaigns": 4},
}  # fmt: skip


DECK = b"""*HEADING
*NODE
1, 0, 0, 0
2, 1, 0, 0
3, 1, 1, 0
4, 0, 1, 0
*ELEMENT, TYPE=S4, ELSET=PLATE
1, 1, 2, 3, 4
*MATERIAL, NAME=STEEL
*ELASTIC
2.1E11, 0.3
*DENSITY
7850
*SHELL SECTION, ELSET=PLATE, MATERIAL=STEEL
0.01
"""


@dataclass
class Tally:
    """What became of the jobs."""

    # jobs by kind and state, as the backup has them; a running one whose end was asked for is
    # `cancelling`
    before: Counter[tuple[str, str]] = field(default_factory=Counter)
    # the same where all of them have ended after the restore
    after: Counter[tuple[str, str]] = field(default_factory=Counter)
    lost: list[str] = field(default_factory=list)  # what did not end as it should, in words


def soak() -> Tally:
    """Back up a service with jobs of every kind, restore it elsewhere, and let them end there."""
    tally = Tally()
    with tempfile.TemporaryDirectory(prefix="mb-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        folder.chmod(0o755)  # the server may run as a user of its own
        with floor() as here:
            keep_waiting(here)
            before = here.jobs()
            run("backup", str(folder / "backup"), MODALBASE_DATABASE_URL=here.url)
        run("restore", str(folder / "backup"), "--data", str(folder / "data"))
        with embedded_server(folder / "data") as url:
            after = {job.id: job for job in ended(url)}
    for job in before:
        state = "cancelling" if job.state == "running" and job.cancel_requested else job.state
        expected = "cancelled" if state.startswith("cancel") else "succeeded"
        tally.before[job.kind, state] += 1
        tally.after[job.kind, after[job.id].state] += 1
        if after[job.id].state != expected:
            tally.lost.append(
                f"{job.kind} {job.id}, {state}, is {after[job.id].state}: {after[job.id].message}"
            )
    return tally


def ended(database_url: str) -> list[Job]:
    """Let the jobs of a restored database end."""
    with floor(database_url) as there:
        # until the jobs that the killed worker had are taken over
        there.modalbase("worker", job_lease_seconds=5.0)
        there.until(
            lambda: all(job.finished_at for job in there.jobs()), "the end of every restored job"
        )
        return there.jobs()


def keep_waiting(here: Floor) -> None:
    """Leave a service with jobs of every kind that wait, two that run without a worker, one
    cancelled and one to cancel.
    """
    with here.client("soak") as client:
        lab = Laboratory(client)
        worker, first = here.modalbase("worker"), lab.send_file(lab.campaign)
        here.until(lambda: lab.ended(first), "the first import")
        monitor = lab.judged_once()
        here.until(lambda: _judgements(here) == 1, "the first judgement")
        here.kill(worker)
        lab.queue_others()
        with here.sessions.begin() as session:
            # what a worker's scheduler does, without a worker
            check(session, UUID(monitor), timedelta(0))
        updates = [
            lab.post(f"campaigns/{lab.campaign}/update-jobs?priority=100", lab.recipe)["id"]
            for _ in range(4)
        ]
        lab.post(f"update-jobs/{updates.pop()}/cancel")
        worker = here.modalbase("worker", worker_concurrency=2)
        here.until(
            lambda: sum(job.state == "running" for job in here.jobs()) == 2, "two running jobs"
        )
        here.kill(worker)
        running = [str(job.id) for job in here.jobs() if job.state == "running"]
        lab.post(f"update-jobs/{running[0]}/cancel")


class Laboratory:
    """A small laboratory: the paper's beam with FRFs at few points, its modes, and what is asked of
    them.
    """

    def __init__(self, client: httpx.Client) -> None:
        self.client = client
        self.project = self.post("projects", {"name": "soak"})["id"]
        self.structure = self.post(f"projects/{self.project}/structures", paper.STRUCTURE)["id"]
        self.campaign = self.new_campaign()
        self.recipe: dict[str, Any] = {}

    def post(self, path: str, body: Any = None, **more: Any) -> Any:
        """What a POST answers."""
        return posted(self.client, path, body, **more)

    def new_campaign(self) -> str:
        """Another campaign of the beam."""
        body = {**paper.CAMPAIGN, "performed_at": "2026-03-02T09:30:00Z", "temperature_c": 20.0}
        return str(self.post(f"structures/{self.structure}/campaigns", body)["id"])

    def send_file(self, campaign: str) -> str:
        """Upload a few FRFs of the paper's: the import's address."""
        return f"imports/{self.post(f'campaigns/{campaign}/imports', content=small_file(), headers=RAW)['id']}"

    def ended(self, path: str) -> bool:
        """Has this job ended?"""
        state = self.client.get(path).raise_for_status().json()["status"]
        return state not in ("queued", "running")

    def judged_once(self) -> str:
        """State modes, and have a monitor run and judge: its id."""
        modes = self.post(
            f"campaigns/{self.campaign}/mode-sets", {"name": "published", "modes": paper.MODES}
        )
        self.recipe = {**RECIPE, "mode_set": modes["id"]}
        monitor = self.post(f"structures/{self.structure}/monitors", MONITOR)["id"]
        self.post(f"monitors/{monitor}/runs", {"campaign": self.campaign})
        return str(monitor)

    def queue_others(self) -> None:
        """Ask for a job of each other kind, and give the monitor what to judge anew."""
        hits, imported = self.new_campaign(), self.new_campaign()
        self.post(f"campaigns/{hits}/records", hits_of_a_point())
        self.post(f"campaigns/{hits}/processings", {})
        self.send_file(imported)
        self.post(f"campaigns/{self.campaign}/identifications", {})
        plate = self.post(f"projects/{self.project}/structures", {"name": "plate"})["id"]
        model = self.client.post(
            f"structures/{plate}/model",
            params={"filename": "p.inp", "units": "m-N-kg"},
            content=DECK,
        )
        model.raise_for_status()
        self.post(
            f"structures/{self.client.get(f'campaigns/{self.campaign}').json()['structure_id']}/forecasts",
            {},
        )
        modes = self.post(
            f"campaigns/{imported}/mode-sets", {"name": "published", "modes": paper.MODES}
        )["id"]
        jobs = [
            {"campaign_id": self.campaign, "recipe": {"mode_set": self.recipe["mode_set"]}},
            {"campaign_id": imported, "recipe": {"mode_set": modes}},
        ]
        self.post(
            "update-jobs",
            {"joint": True, "jobs": jobs, "recipe": {"parameters": RECIPE["parameters"]}},
        )
        path = f"campaigns/{self.campaign}"
        etag = self.client.get(path).raise_for_status().headers["ETag"]
        self.client.patch(
            path, json={"temperature_c": 21.0}, headers={"If-Match": etag}
        ).raise_for_status()


def small_file() -> bytes:
    """FRFs at a few points of the paper's file, as UFF."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "paper.uff")
        file.write_bytes(paper.uff_file())
        kept = [
            one
            for one in read_file(file)
            if isinstance(one, GridPoint)
            or (isinstance(one, Frf) and one.reference_point in POINTS)
        ]
    return b"".join(encode(kept))


def hits_of_a_point() -> dict[str, Any]:
    """Three hits of one point as a body of records: a half sine of 2 ms, and two modes that it
    rings.
    """
    rate, samples = 2048.0, 512
    t = np.arange(samples) / rate - 0.05
    force = np.where((t > 0) & (t < 0.002), np.sin(np.pi * t / 0.002), 0.0)
    modes = sum(np.exp(-0.01 * w * t) * np.sin(w * t) for w in 2 * np.pi * np.array([90.0, 310.0]))
    ring = np.convolve(force, np.where(t >= 0, modes, 0.0))[int(0.05 * rate) :][:samples]
    random = np.random.default_rng(4)
    mapping = {
        "sample_rate_hz": rate,
        "channels": [
            {"variable": "f", "quantity": "force", "point": 1},
            {"variable": "a", "quantity": "acceleration", "point": 2},
        ],
    }
    heights = (80.0, 100.0, 120.0)
    noise = random.normal(0, 0.01, (2, 3, samples))
    return {
        "variables": {
            "f": [(h * force + n).tolist() for h, n in zip(heights, noise[0], strict=True)],
            "a": [(h * ring + n).tolist() for h, n in zip(heights, noise[1], strict=True)],
        },
        "mapping": mapping,
    }


def run(*words: str, **env: str) -> None:
    """A command of a process of its own, as an operator gives it.

    Raises:
        RuntimeError: it did not end well.
    """
    command = [sys.executable, "-m", "service", *words]
    ended = subprocess.run(
        command, cwd=ROOT, env=os.environ | env, capture_output=True, text=True, check=False
    )
    if ended.returncode != 0:
        raise RuntimeError(f"{' '.join(words)}: {ended.returncode} {ended.stdout} {ended.stderr}")


def _judgements(here: Floor) -> int:
    with here.sessions() as session:
        return int(
            session.scalar(
                text("SELECT count(*) FROM jobs WHERE kind = 'judge' AND state = 'succeeded'")
            )
            or 0
        )
