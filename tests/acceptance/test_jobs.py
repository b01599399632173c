"""Whatever is cut off, dies, is purged or restored, no job is lost and none is done twice."""

from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx
import pytest
from sqlalchemy import select, text

from service.pages.example import paper
from service.platform.db.engine import make_engine, make_sessions
from service.platform.queue.child import PURGED
from service.platform.queue.tables import Job
from service.tasks.kinds import KINDS
from tests.support import backups, kills
from tests.support.backups import RECIPE, Laboratory, hits_of_a_point
from tests.support.command import modalbase_here
from tests.support.floor import Floor, floor
from tests.support.lengths import long
from tests.support.outage import outage
from tests.support.rest import campaigns_of, finished, ok, posted


@pytest.mark.long
@pytest.mark.parametrize("others", [False, True])
def test_worker_cut_off_from_the_database_comes_back(others: bool, database: str) -> None:
    """Longer than its lease with another worker there, who takes over what the first one brings too
    late. Short forms: workers cut off in `integration/test_jobs.py`, paused in `test_attempts.py`.
    """
    it = outage(0.5 if others else 3, others=others, jobs=2, database_url=database)
    assert it.same_worker
    assert (it.succeeded, it.results, it.doubled) == (it.jobs, it.jobs, 0), it
    assert it.works_again
    # nothing was done again but what was taken over
    assert it.attempts == it.jobs + (1 if others else 0)


@pytest.mark.long
def test_an_api_that_is_killed_leaves_every_job_that_it_took_and_no_half_one(database: str) -> None:
    """It is killed between the rows of the jobs and the tickets, where another transaction holds it
    up; what it had taken before was there with its answer. The short form is the one transaction of
    `integration/test_jobs.py`.
    """
    with floor(database) as here:
        with here.client("tester") as client:
            (campaign,) = campaigns_of(client, "floor")
            answer = client.post(f"campaigns/{campaign}/update-jobs", json={"seed": 50})
            assert (answer.status_code, stored(here)) == (202, [1, 1, 1])
            batch = {"jobs": [{"campaign_id": campaign}] * 200}
            with ThreadPoolExecutor(1) as pool, here.engine.begin() as holding:
                holding.exec_driver_sql("LOCK TABLE procrastinate_jobs IN SHARE MODE")
                request = pool.submit(client.post, "update-jobs", json=batch)
                here.until(
                    lambda: sessions_of_api(here, "wait_event_type = 'Lock'"),
                    "a request that is held up",
                )
                here.kill(here.processes[0])
                assert isinstance(request.exception(), httpx.TransportError)
        here.until(lambda: not sessions_of_api(here), "that the database notices")
        assert stored(here) == [1, 1, 1]
        assert [str(job.id) for job in here.jobs()] == [answer.json()["id"]]


def stored(here: Floor) -> list[int]:
    """How many jobs there are, and how many tickets."""
    with here.engine.connect() as connection:
        return [
            connection.exec_driver_sql(f"SELECT count(*) FROM {table}").scalar_one()
            for table in ("jobs", "update_jobs", "procrastinate_jobs")
        ]


def sessions_of_api(here: Floor, which: str = "true") -> int:
    """How many connections the API has to the database, of those for which `which` holds."""
    ours = "datname = current_database() AND application_name LIKE 'modalbase%%'"
    query = f"SELECT count(*) FROM pg_stat_activity WHERE {ours} AND {which}"
    with here.engine.connect() as connection:
        return int(connection.exec_driver_sql(query).scalar_one())


@pytest.mark.parametrize("computed", [False, long(True)])
def test_jobs_over_many_campaigns_give_the_single_runs_result(
    api: httpx.Client, computed: bool
) -> None:
    """The same beam in two campaigns: the results of one batch equal that of a job alone, but for
    where they were made. In the short run their recipes do, and what they lack.
    """
    jobs: list[dict[str, Any]] = []
    for campaign in campaigns_of(api, "many", 2):
        if not computed:
            jobs.append({"campaign_id": campaign, "recipe": RECIPE})
            continue
        modes = posted(
            api, f"campaigns/{campaign}/mode-sets", {"name": "published", "modes": paper.MODES}
        )["id"]
        jobs.append({"campaign_id": campaign, "recipe": {**RECIPE, "mode_set": modes}})
    (single,) = results(api, jobs[:1], computed)
    assert results(api, jobs, computed) == [single, single]


def results(api: httpx.Client, jobs: list[dict[str, Any]], computed: bool) -> list[dict[str, Any]]:
    made = ok(api.post("update-jobs", json={"jobs": jobs}))["items"]
    if not computed:
        ended = [finished(api, f"update-jobs/{job['id']}") for job in made]
        return [{name: one[name] for name in ("recipe", "status", "message")} for one in ended]
    found = [
        ok(api.get(f"update-jobs/{finished(api, 'update-jobs/' + job['id'])['id']}/result"))
        for job in made
    ]
    return [{name: value for name, value in one.items() if name != "provenance"} for one in found]


# --- the service under kills, in short
# ----------------------------------------------------------------------------------


@pytest.mark.long
def test_kills_of_every_process_lose_nothing_and_are_no_internal_error() -> None:
    tally = kills.soak(kills=4, workers=1)
    assert tally.killed == {"worker": 1, "fork server": 1, "API": 1, "PostgreSQL": 1}
    assert all(tally.acknowledged.values()), tally
    assert tally.lost == []
    assert tally.reasons == {}
    assert tally.states.keys() == {"succeeded"}
    # nothing was computed again but what was lost
    assert tally.attempts == tally.states.total() + tally.losses


# --- a purge while jobs wait and run
# ------------------------------------------------------------------------------------

PRIOR = {"posterior": "mcmc"}  # takes long enough to be purged while it runs


def busy_laboratory(here: Floor, lab: Laboratory) -> set[str]:
    """Ids of jobs of a campaign of which one runs and the others wait."""
    modes = lab.post(
        f"campaigns/{lab.campaign}/mode-sets", {"name": "published", "modes": paper.MODES}
    )["id"]
    first = lab.send_file(lab.campaign)
    here.until(lambda: lab.ended(first), "the import")
    lab.post(f"campaigns/{lab.campaign}/records", hits_of_a_point())
    long = lab.post(
        f"campaigns/{lab.campaign}/update-jobs", {**RECIPE, **PRIOR, "mode_set": modes}
    )["id"]
    here.until(lambda: job(here, long).state == "running", "an update that runs")
    waiting = [
        lab.post(f"campaigns/{lab.campaign}/{what}", body)["id"]
        for what, body in (("update-jobs", {}), ("identifications", {}), ("processings", {}))
    ]
    both = [{"campaign_id": campaign} for campaign in (lab.campaign, lab.new_campaign())]
    joint = lab.post("update-jobs", {"joint": True, "jobs": both})["joint"]["id"]
    other = lab.post(f"campaigns/{lab.campaign}/imports", content=paper.uff_file())["id"]
    return {long, *waiting, joint, other}


def job(here: Floor, key: str) -> Job:
    return next(job for job in here.jobs() if str(job.id) == key)


@pytest.mark.long
def test_a_purge_ends_the_jobs_of_what_it_removes() -> None:
    with floor() as here, here.client("soak") as client:
        here.modalbase("worker", worker_concurrency=1)
        kept = Laboratory(client)
        lab = Laboratory(client)
        jobs = busy_laboratory(here, lab)
        client.delete(f"campaigns/{lab.campaign}").raise_for_status()
        lab.post(f"campaigns/{lab.campaign}/purge")
        here.until(lambda: all(job.finished_at for job in here.jobs()), "the end of every job")
        ended = {str(job.id): (job.state, job.message, job.error) for job in here.jobs()}
        assert {key: ended[key] for key in jobs} == dict.fromkeys(
            jobs, ("cancelled", PURGED.detail, None)
        )

        lab = Laboratory(client)
        jobs = busy_laboratory(here, lab)
        client.delete(f"projects/{lab.project}").raise_for_status()
        lab.post(f"projects/{lab.project}/purge")
        assert jobs.isdisjoint(str(job.id) for job in here.jobs())
        file = kept.send_file(kept.campaign)
        here.until(
            lambda: kept.ended(file), "another project's job, in the place of the purged one"
        )
        assert client.get(file).json()["status"] == "succeeded"
        with here.sessions() as session:
            assert session.scalar(text("SELECT count(*) FROM procrastinate_jobs")) == 0
        log = here.log.read_text()
        assert "Traceback" not in log
        assert "internal" not in log


# --- a backup of a service with jobs that wait, run and were cancelled, restored by the command.
# `make so ---------------

EVERY_KIND = {kind.name for kind in KINDS}


@pytest.mark.long
def test_jobs_of_every_kind_run_to_their_end_in_a_restored_service() -> None:
    tally = backups.soak()
    assert tally.lost == []
    assert {kind for kind, state in tally.before if state == "queued"} == EVERY_KIND
    assert tally.before["update", "running"] == tally.before["update", "cancelling"] == 1
    assert tally.after["update", "cancelled"] == 2


OLDER = Path(__file__).parents[1] / "integration" / "files" / "jobs-0057.modalbase"
"""Written at revision 0057, of the service that `keep_waiting` leaves, with an update of one campaign
and one of two that had ended.
"""


@pytest.mark.filterwarnings("ignore::sqlalchemy.exc.SADeprecationWarning")
def test_the_jobs_of_an_older_schema_are_loaded(empty_database: str, tmp_path: Path) -> None:
    """As a worker does before it computes."""
    modalbase_here("restore", OLDER, code=0, MODALBASE_DATABASE_URL=empty_database)
    engine = make_engine(empty_database)
    with make_sessions(engine)() as session:
        jobs = list(session.scalars(select(Job).where(Job.finished_at.is_(None))))
        assert {job.kind for job in jobs} == EVERY_KIND
        for job in jobs:
            (folder := tmp_path / str(job.id)).mkdir()
            next(kind for kind in KINDS if kind.name == job.kind).load(session, job.id, folder)
    engine.dispose()


@pytest.mark.long
def test_the_jobs_of_an_older_schema_run_to_their_end(empty_database: str) -> None:
    """The test above is the short form; what computes and stores them runs everywhere."""
    modalbase_here("restore", OLDER, code=0, MODALBASE_DATABASE_URL=empty_database)
    ended = Counter((job.kind, job.state) for job in backups.ended(empty_database))
    assert {kind for kind, _ in ended} == EVERY_KIND
    assert ended.pop(("update", "cancelled")) == 2
    assert {state for _, state in ended} == {"succeeded"}
