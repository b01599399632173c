"""Whatever is cut off or dies, no job is lost and none is done twice; `test_kills.py` kills every process in turn."""

import signal
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import httpx
import pytest

from benchmarks.jobs_floor import Floor, floor
from benchmarks.jobs_outage import outage
from benchmarks.service import campaigns_of
from service.access.keys import create_key, user_named
from service.app.demo import paper
from service.app.supervisor import listening_socket
from tests.support.rest import client_at, finished, ok
from tests.support.waiting import PATIENCE


@pytest.mark.parametrize("others", [False, True], ids=["alone", "with another worker"])
def test_worker_cut_off_from_the_database_comes_back(others: bool, database: str) -> None:
    """Longer than its lease with another worker there, who takes over what the first one brings too late."""
    it = outage(0.5 if others else 3, others=others, jobs=2, database_url=database)
    assert it.same_worker
    assert (it.succeeded, it.results, it.doubled) == (it.jobs, it.jobs, 0), it
    assert it.back_seconds > 0  # it worked again
    assert it.attempts == it.jobs + (1 if others else 0)  # nothing was done again but what was taken over


def test_job_runs_although_the_api_was_killed_right_after_it_took_it(database: str) -> None:
    with floor(database) as here:
        with listening_socket("127.0.0.1", 0) as free:
            port = free.getsockname()[1]
        api = here.api(port)
        with here.sessions.begin() as session:
            key = create_key(session, user_named(session, "tester"), "test")[1]
        with client_at(f"http://127.0.0.1:{port}", key) as client:
            (campaign,) = campaigns_of(client, "floor")
            answer = client.post(f"campaigns/{campaign}/update-jobs", json={"seed": 50})
            here.kill(api)
        assert answer.status_code == 202
        worker = here.worker()
        here.wait(1)
        (job,) = here.jobs()
        assert (str(job.id), job.state) == (answer.json()["id"], "succeeded")
        assert here.results() == [job.id]
        worker.send_signal(signal.SIGTERM)
        assert worker.wait(PATIENCE) == 0


def test_api_killed_while_it_takes_jobs_leaves_no_half_one(database: str) -> None:
    """It is killed between the rows of the jobs and the tickets, where another transaction holds it up."""
    with floor(database) as here:
        with listening_socket("127.0.0.1", 0) as free:
            port = free.getsockname()[1]
        api = here.api(port)
        with here.sessions.begin() as session:
            key = create_key(session, user_named(session, "tester"), "test")[1]
        with client_at(f"http://127.0.0.1:{port}", key) as client:
            (campaign,) = campaigns_of(client, "floor")
            batch = {"jobs": [{"campaign_id": campaign}] * 200}
            with ThreadPoolExecutor(1) as pool, here.engine.begin() as holding:
                holding.exec_driver_sql("LOCK TABLE procrastinate_jobs IN SHARE MODE")
                request = pool.submit(client.post, "update-jobs", json=batch)
                here.until(lambda: sessions_of_api(here, "wait_event_type = 'Lock'"), "a request that is held up")
                here.kill(api)
                assert isinstance(request.exception(), httpx.TransportError)
        here.until(lambda: not sessions_of_api(here), "that the database notices")
        with here.engine.connect() as connection:
            counts = [
                connection.exec_driver_sql(f"SELECT count(*) FROM {table}").scalar_one()
                for table in ("jobs", "update_jobs", "procrastinate_jobs")
            ]
        assert counts == [0, 0, 0]


def sessions_of_api(here: Floor, which: str = "true") -> int:
    """How many connections the API has to the database, of those for which `which` holds."""
    ours = "datname = current_database() AND application_name LIKE 'modalbase%%'"
    query = f"SELECT count(*) FROM pg_stat_activity WHERE {ours} AND {which}"
    with here.engine.connect() as connection:
        return int(connection.exec_driver_sql(query).scalar_one())


def test_jobs_over_many_campaigns_give_the_single_runs_result(api: httpx.Client) -> None:
    """The same beam in three campaigns: the results of one batch equal that of a job alone, but for where they were made."""
    project = ok(api.post("projects", json={"name": "many"}))["id"]
    structure = ok(api.post(f"projects/{project}/structures", json=paper.STRUCTURE))["id"]
    jobs = []
    for _ in range(3):
        campaign = ok(api.post(f"structures/{structure}/campaigns", json=paper.CAMPAIGN))["id"]
        sent = api.post(f"campaigns/{campaign}/imports", params={"filename": "a.uff"}, content=paper.uff_file())
        finished(api, sent.headers["location"])
        modes = ok(api.post(f"campaigns/{campaign}/mode-sets", json={"name": "published", "modes": paper.MODES}))["id"]
        jobs.append({"campaign_id": campaign, "recipe": {"mode_set": modes}})
    (single,) = results(api, jobs[:1])
    assert results(api, jobs[1:]) == [single, single]


def results(api: httpx.Client, jobs: list[dict[str, Any]]) -> list[dict[str, Any]]:
    made = ok(api.post("update-jobs", json={"jobs": jobs}))["items"]
    found = [ok(api.get(f"update-jobs/{finished(api, 'update-jobs/' + job['id'])['id']}/result")) for job in made]
    return [{name: value for name, value in one.items() if name != "provenance"} for one in found]
