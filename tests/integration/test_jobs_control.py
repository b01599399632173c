"""What can be asked of jobs: turns and limits, cancellation, another try, checkpoints, metrics; and
clearing up.
"""

import hashlib
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path
from typing import Any
from uuid import UUID

import psutil
import pytest
from prometheus_client import CollectorRegistry, generate_latest
from sqlalchemy import func, select, text, update

from service.platform.access.tables import Project
from service.platform.db.engine import Sessions
from service.platform.queue import queue
from service.platform.queue.dispatch import begin_next
from service.platform.queue.metrics import JobMetrics
from service.platform.queue.queue import enqueue
from service.platform.queue.tables import Job, JobCheckpoint
from tests.support import job_kinds
from tests.support.waiting import PATIENCE, until
from tests.support.working import Gate, held, items, put, wait, worker

TICKETS = text("SELECT count(*) FROM procrastinate_jobs")


def queued(sessions: Sessions, **counts: int) -> dict[str, list[UUID]]:
    """Jobs of new projects: so many of each, project by project."""
    jobs: dict[str, list[UUID]] = {}
    for name, count in counts.items():
        with sessions.begin() as session:
            session.add(project := Project(name=name))
            session.flush()
            jobs[name] = [
                enqueue(session, kind=job_kinds.KINDS["echo"], project_id=project.id).id
                for _ in range(count)
            ]
    return jobs


def take(sessions: Sessions, limit: int | None = None) -> UUID | None:
    with sessions.begin() as session:
        job = begin_next(session, ["jobs"], "a worker", limit)
        return None if job is None else job.id


def end(sessions: Sessions, job_id: UUID | None, state: str = "succeeded") -> None:
    with sessions.begin() as session:
        session.execute(
            update(Job)
            .where(Job.id == job_id)
            .values(state=state, finished_at=func.clock_timestamp())
        )


def test_projects_take_turns(sessions: Sessions) -> None:
    jobs = queued(sessions, many=20, one=1)
    taken = [take(sessions) for _ in range(4)]
    assert taken == [jobs["many"][0], jobs["one"][0], jobs["many"][1], jobs["many"][2]]


def test_projects_take_turns_also_where_one_job_runs_at_a_time(sessions: Sessions) -> None:
    jobs = queued(sessions, many=20, few=2)
    order = []
    for _ in range(5):
        order.append(take(sessions))
        end(sessions, order[-1])
    many, few = jobs["many"], jobs["few"]
    assert order == [many[0], few[0], many[1], few[1], many[2]]


def test_priority_counts_within_a_project_and_not_between(sessions: Sessions) -> None:
    jobs = queued(sessions, calm=3, hasty=2)
    with sessions.begin() as session:
        session.execute(update(Job).where(Job.id == jobs["calm"][2]).values(priority=5))
        session.execute(update(Job).where(Job.id.in_(jobs["hasty"])).values(priority=100))
    taken = [take(sessions) for _ in range(5)]
    assert taken == [
        jobs["calm"][2],
        jobs["hasty"][0],
        jobs["calm"][0],
        jobs["hasty"][1],
        jobs["calm"][1],
    ]


def test_a_job_that_workers_died_with_goes_after_the_others(sessions: Sessions) -> None:
    jobs = queued(sessions, one=3)["one"]
    with sessions.begin() as session:
        session.execute(update(Job).where(Job.id == jobs[0]).values(losses=1, priority=100))
    assert [take(sessions) for _ in range(3)] == [jobs[1], jobs[2], jobs[0]]


def test_limit_of_a_project_holds_when_many_claim_at_once(sessions: Sessions) -> None:
    jobs = queued(sessions, many=10, one=1)
    with ThreadPoolExecutor(4) as pool:
        taken = [job for job in pool.map(lambda _: take(sessions, 3), range(12)) if job is not None]
    assert sorted(taken) == sorted([*jobs["many"][:3], *jobs["one"]])
    assert [take(sessions, 5) is not None for _ in range(3)] == [True, True, False]
    assert len({take(sessions) for _ in range(5)}) == 5


def test_a_job_cancelled_before_its_work_starts_leaves_its_place(
    sessions: Sessions, database: str
) -> None:
    (first,), (second,) = put(sessions, "stubborn"), put(sessions, "echo")
    with worker(database, work="work_where_an_abort_comes_first"):
        assert wait(sessions, first).state == "cancelled"
        assert wait(sessions, second).state == "succeeded"


def test_killed_workers_job_goes_on_where_it_was_and_nothing_else_of_it_stays(
    sessions: Sessions, database: str, gate: Gate, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folders = tmp_path / ("long" * 30)  # no path of a socket in it would be short enough
    folders.mkdir()
    monkeypatch.setenv("TMPDIR", str(folders))  # for the workers
    (job_id,) = put(sessions, "chain")
    with worker(database, gate, job_lease_seconds=2) as first:
        held(sessions, job_id, 20)
        until(lambda: saved_step(sessions, job_id) == 20, "the checkpoint of step 20")
        family = psutil.Process(first.pid).children(recursive=True)
        assert len(family) >= 2  # the fork server, and the computation
        first.kill()
        first.wait()
        _, alive = psutil.wait_procs(family, timeout=PATIENCE)
        assert [process for process in alive if process.status() != psutil.STATUS_ZOMBIE] == []
    (left,) = folders.glob("modalbase-worker-*/*/input.txt")
    gate.open(job_id, 20)
    with worker(database, job_lease_seconds=2, worker_concurrency=2, project_job_limit=1):
        job = wait(sessions, job_id)
        assert (job.state, job.attempt, job.losses) == ("succeeded", 2, 1)
        (result,) = items(sessions, job_id)
        assert result["begun at"] == 20
        digest = b""
        for step in range(40):
            digest = hashlib.sha256(digest + bytes([step])).digest()
        assert result["digest"] == digest.hex()  # the same bits as without the kill
        assert not left.parent.parent.exists()
        assert len(list(folders.glob("modalbase-worker-*/"))) == 1
        require_limit_kept(sessions)
    with sessions() as session:
        assert session.scalar(select(func.count()).select_from(JobCheckpoint)) == 0
        assert session.scalar(TICKETS) == 0


def require_limit_kept(sessions: Sessions) -> None:
    """A job that the limit of one held back starts when there is room, where two might run."""
    ended = [wait(sessions, job_id) for job_id in queued(sessions, many=4)["many"]]
    spans = sorted(
        (job.started_at, job.finished_at) for job in ended if job.started_at and job.finished_at
    )
    assert len(spans) == 4
    assert all(first[1] <= second[0] for first, second in pairwise(spans))


def saved_step(sessions: Sessions, job_id: UUID) -> int | None:
    with sessions() as session:
        saved = queue.load_checkpoint(session, job_id)
    return None if saved is None else int.from_bytes(saved[:2])


def test_checkpoint_of_an_attempt_that_is_no_longer_the_present_one_is_not_kept(
    sessions: Sessions,
) -> None:
    queued(sessions, one=1)
    with sessions.begin() as session:
        job = begin_next(session, ["jobs"], "a worker", None)
        queue.save_checkpoint(session, job, b"first")
        queue.save_checkpoint(session, Job(id=job.id, attempt=7), b"of another time line")
        queue.save_checkpoint(session, job, b"second")
        assert queue.load_checkpoint(session, job.id) == b"second"


def test_metrics_by_kind_and_outcome(sessions: Sessions) -> None:
    for job_id in queued(sessions, one=2)["one"]:
        assert take(sessions) == job_id
        end(sessions, job_id)
    (failed,) = put(sessions, "refusing")
    assert take(sessions) == failed
    end(sessions, failed, "failed")
    put(sessions, "slow", 3)
    registry = CollectorRegistry()
    registry.register(JobMetrics(sessions))
    shown = generate_latest(registry).decode().splitlines()
    assert 'modalbase_jobs_queued{kind="slow",queue="jobs"} 3.0' in shown
    assert 'modalbase_jobs_ended_total{kind="echo",outcome="succeeded"} 2.0' in shown
    assert 'modalbase_job_attempts_total{kind="refusing",outcome="failed"} 1.0' in shown
    for name in ("wait", "run"):
        assert f'modalbase_job_{name}_seconds_count{{kind="echo",outcome="succeeded"}} 2.0' in shown
        assert (
            f'modalbase_job_{name}_seconds_bucket{{kind="echo",le="+Inf",outcome="succeeded"}} 2.0'
            in shown
        )


def test_store_that_lost_its_connection_is_gone_through_again() -> None:
    from service.platform.queue.attempt import Replay
    from service.platform.queue.child import Item

    made: list[Any] = []
    replay = Replay(Item(made.append(i) or i, 1) for i in range(4))
    first = iter(replay)
    assert [next(first), next(first)] == [0, 1]
    assert list(iter(replay)) == [0, 1, 2, 3]
    assert list(iter(replay)) == [0, 1, 2, 3]
    assert made == [0, 1, 2, 3]  # the child computed each once


def test_results_too_large_to_keep_are_passed_on_once() -> None:
    from service.platform.queue.attempt import KEPT_BYTES, Replay
    from service.platform.queue.child import Item

    replay = Replay(Item(i, KEPT_BYTES // 2) for i in range(4))
    assert list(iter(replay)) == [0, 1, 2, 3]
    assert not replay.complete
    with pytest.raises(RuntimeError, match="gone"):
        next(iter(replay))
