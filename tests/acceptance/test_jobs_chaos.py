"""Whatever dies, no job is lost and none is done twice. The large numbers are in `python -m benchmarks jobs_chaos`."""

from __future__ import annotations

import signal
import time

import httpx
import pytest

from benchmarks.jobs_chaos import chaos
from benchmarks.jobs_floor import floor, laboratory
from benchmarks.jobs_hundred import hundred
from benchmarks.jobs_outage import outage
from service.access.keys import create_key, user_named
from service.supervisor import listening_socket


def test_forty_jobs_among_killed_workers_apis_and_a_crashed_database() -> None:
    tally = chaos(40, milliseconds=100, pace_seconds=0.05, kill_seconds=(1.0, 2.0))
    assert (tally.rows, tally.results, tally.doubled) == (40, 40, 0), tally
    assert tally.states == {"succeeded": 40}, tally
    assert tally.workers_killed >= 1
    assert tally.apis_killed == 2
    assert len(tally.database_away_seconds) == 1


@pytest.mark.parametrize("others", [False, True], ids=["alone", "with another worker"])
def test_worker_cut_off_from_the_database_comes_back(others: bool) -> None:
    """Longer than its lease with another worker there, who takes over what the first one brings too late."""
    it = outage(5 if others else 3, others=others, jobs=3)
    assert it.same_worker
    assert (it.succeeded, it.results, it.doubled) == (it.jobs, it.jobs, 0), it
    assert it.back_seconds > 0  # it worked again
    assert it.attempts == it.jobs + (1 if others else 0)  # nothing was done again but what was taken over


def test_job_runs_although_the_api_was_killed_right_after_it_took_it() -> None:
    with floor() as here:
        with listening_socket("127.0.0.1", 0) as free:
            port = free.getsockname()[1]
        api = here.api(port)
        with here.sessions.begin() as session:
            key = create_key(session, user_named(session, "tester"), "test")[1]
        headers = {"Authorization": f"Bearer {key}"}
        with httpx.Client(base_url=f"http://127.0.0.1:{port}/api/v1/", headers=headers, trust_env=False) as client:
            (campaign,) = laboratory(client)
            answer = client.post(f"campaigns/{campaign}/update-jobs", json={"seed": 50})
            here.kill(api)
        assert answer.status_code == 202
        worker = here.worker()
        here.wait(60, 1)
        (job,) = here.jobs()
        assert (str(job.id), job.state) == (answer.json()["id"], "succeeded")
        assert here.results() == [job.id]
        worker.send_signal(signal.SIGTERM)
        assert worker.wait(30) == 0


def test_api_killed_while_it_takes_jobs_leaves_no_half_one() -> None:
    """Rows of both tables and tickets are there for the same jobs, whatever moment the kill came at."""
    with floor() as here:
        with listening_socket("127.0.0.1", 0) as free:
            port = free.getsockname()[1]
        api = here.api(port)
        with here.sessions.begin() as session:
            key = create_key(session, user_named(session, "tester"), "test")[1]
        headers = {"Authorization": f"Bearer {key}"}
        with httpx.Client(base_url=f"http://127.0.0.1:{port}/api/v1/", headers=headers, trust_env=False) as client:
            (campaign,) = laboratory(client)
            batch = {"jobs": [{"campaign_id": campaign}] * 200}
            with client.stream("GET", "projects"):
                pass
            client.timeout = httpx.Timeout(0.15)  # the request is in the midst of its transaction
            with pytest.raises(httpx.TransportError):
                client.post("update-jobs", json=batch)
            here.kill(api)
        time.sleep(0.5)  # the database notices
        with here.engine.connect() as connection:
            counts = [
                connection.exec_driver_sql(f"SELECT count(*) FROM {table}").scalar_one()
                for table in ("jobs", "update_jobs", "procrastinate_jobs")
            ]
        assert counts in ([0, 0, 0], [200, 200, 200])


def test_jobs_over_many_campaigns_give_the_single_runs_result() -> None:
    it = hundred(4)
    assert (it.succeeded, it.equal) == (4, 4)
