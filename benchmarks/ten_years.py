"""A structure that is watched for ten years, hour after hour: what a look, a page and a row cost
then.

Campaigns with made modes are stored (`benchmarks.made_years`), and judged as a worker judges them,
in this process. Ten structures are ten times the bytes; a look at each is by itself.
"""

import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any
from uuid import UUID

import numpy as np
from sqlalchemy import select, text, update
from sqlalchemy.orm import Session

from benchmarks.clock import now
from benchmarks.made_years import COVARIATES, made_runs, store_runs
from benchmarks.service import api_of, served
from benchmarks.tables import Table, load
from service.app.supervisor import LocalService
from service.monitoring.scheduler import check
from service.nouns.monitors.candidates import candidates_of
from service.nouns.monitors.runs import newest_series
from service.nouns.monitors.tables import Monitor, MonitorJudgement, MonitorSeries
from service.platform.db.base import transaction_time
from service.platform.db.engine import Sessions, make_engine, make_sessions
from service.platform.queue.tables import Job
from service.tasks.judge.task import TASK, judge_if_changed
from tests.support.rest import posted, session_client

WATCH = {
    "name": "deck",
    "watch": "modes",
    "covariates": [*COVARIATES],
    "runs_on": "hand",
}


def judge_all(session: Session, monitor: Monitor, series: MonitorSeries) -> int:
    """Judge as a worker does until nothing is left to judge; how many judgements that took."""
    for count in range(10_000):
        judge_if_changed(session, monitor, series, transaction_time(session))
        newest = select(MonitorJudgement.id).order_by(MonitorJudgement.id.desc()).limit(1)
        key = session.scalars(newest).one()
        if session.get_one(Job, key, populate_existing=True).state != "queued":
            return count
        inputs = TASK.load(session, key, Path())
        TASK.store(session, key, TASK.compute(inputs, lambda *_: None))
        session.execute(update(Job).where(Job.id == key).values(state="succeeded"))
    raise AssertionError("it judges for ever")


def ten_years(runs: int = 87_600, asked: int = 20) -> None:
    """Hourly runs of one structure: a look, bytes a run, and how fast pages and series answer.

    Args:
        runs: how many, an hour apart.
        asked: how often each address is asked.
    """
    print(f"{runs:,} runs of one structure, {load()}")
    with served(worker=False) as service:
        watched(service, runs, asked)


def watched(service: LocalService, runs: int, asked: int) -> None:
    """The same of a service without a worker."""
    with api_of(service) as api:
        project = posted(api, "projects", {"name": "ten years"})["id"]
        structure = posted(api, f"projects/{project}/structures", {"name": "footbridge"})["id"]
        few = {"baseline": {"campaigns": min(100, runs // 2)}, "horizon": min(1000, runs)}
        key = posted(api, f"structures/{structure}/monitors", {**WATCH, **few})["id"]
        engine = make_engine(service.settings.database_url or "")
        sessions = make_sessions(engine)
        with sessions() as session:
            before = _sizes(session)
        table = Table("", "what:46", "seconds:.3f", "of the processor:.3f")
        for first in range(0, runs, 5000):
            _stored(sessions, key, first, min(5000, runs - first))
        table.row("all runs judged, in parts", *_timed(lambda: _judged(sessions, key)))
        table.row("a look where nothing is new", *_timed(lambda: _looked(sessions, key)))
        table.row("its campaigns of two days", *_timed(lambda: _candidates(sessions, key)))
        whole = _timed(lambda: _candidates(sessions, key, recent=False))
        table.row("all its campaigns, once a day", *whole)
        _stored(sessions, key, runs, 1)
        table.row("one more run judged", *_timed(lambda: _judged(sessions, key)))
        with sessions() as session:
            grown = {name: size - before.get(name, 0) for name, size in _sizes(session).items()}
        address = f"monitors/{key}/series"
        part = {"from": "2015-01-02T00:00:00Z", "to": "2015-01-04T00:00:00Z"}
        answers = Table("", "answer:46", "median s:.3f", "95 % s:.3f", "kB:.0f")
        with session_client(api, base=service.url) as browser:
            for name, client, path, query in (
                ("the series, thinned", api, address, {}),
                ("two days of it", api, address, part),
                ("1,000 flat rows", api, f"{address}/rows", {}),
                (
                    "the figure of a frequency",
                    api,
                    f"{address}/figure",
                    {"parameter": "frequency_1"},
                ),
                ("all tracks", api, f"{address}/figure", {"parameter": "frequency"}),
                ("the monitor's page", browser, f"ui/monitors/{key}", {}),
                ("the structure's page", browser, f"ui/structures/{structure}", {}),
            ):
                taken, size = [], 0
                for _ in range(asked):
                    begin = time.perf_counter()
                    answer = client.get(path, params=query).raise_for_status()
                    taken.append(time.perf_counter() - begin)
                    size = len(answer.content)
                answers.row(name, *np.quantile(taken, [0.5, 0.95]).tolist(), size / 1e3)
        engine.dispose()
    sizes = Table("", "table:30", "MB:.1f", "bytes a run:.0f")
    for name, size in sorted(grown.items(), key=lambda each: -each[1])[:10]:
        sizes.row(name, size / 1e6, size / runs)
    total = sum(grown.values())
    sizes.row("all", total / 1e6, total / runs)


def _stored(sessions: Sessions, monitor: str, first: int, count: int) -> None:
    with sessions.begin() as session:
        row = session.get_one(Monitor, UUID(monitor))
        runs = list(made_runs(first, count))
        store_runs(session, row.structure_id, newest_series(session, row).id, runs)


def _judged(sessions: Sessions, monitor: str) -> None:
    with sessions.begin() as session:
        row = session.get_one(Monitor, UUID(monitor))
        judge_all(session, row, newest_series(session, row))


def _looked(sessions: Sessions, monitor: str) -> None:
    with sessions.begin() as session:
        check(session, UUID(monitor), timedelta(0))


def _candidates(sessions: Sessions, monitor: str, *, recent: bool = True) -> None:
    with sessions.begin() as session:
        row, at = session.get_one(Monitor, UUID(monitor)), datetime.now(UTC)
        candidates_of(session, row, at, timedelta(0), recent=recent)


def _timed(action: Callable[[], Any]) -> Sequence[float]:
    begin = now()
    action()
    return [float(value) for value in now() - begin]


def _sizes(session: Session) -> dict[str, int]:
    session.execute(text("ANALYZE"))
    query = "SELECT relname, pg_total_relation_size(oid) FROM pg_class WHERE relkind = 'r'"
    public = f"{query} AND relnamespace = 'public'::regnamespace"
    return {name: int(size) for name, size in session.execute(text(public))}
