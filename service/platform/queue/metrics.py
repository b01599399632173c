"""Metrics of all jobs, from their table: the same whichever worker ran them, and none lost with a
worker that died.

Any API process gives the figures of the whole installation, so scrape one, or take the maximum over
several. What a deleted project takes with it looks to Prometheus like a counter's reset.
"""

import threading
import time
from collections.abc import Iterable, Sequence
from typing import Any

from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily
from prometheus_client.registry import Collector
from sqlalchemy import Row, text

from service.platform.db.engine import Sessions

WAIT_BUCKETS = (0.1, 0.5, 1, 5, 15, 60, 300, 1800, 7200, 43200)
RUN_BUCKETS = (0.1, 0.5, 1, 2, 5, 10, 30, 60, 300, 1800, 7200)
FRESH_SECONDS = 5.0  # for which an answer is given again: a scrape must not be a burden

_OPEN = text("""
    SELECT kind, queue, state, count(*) AS jobs, extract(epoch FROM now() - min(queued_at)) AS oldest
    FROM jobs WHERE state IN ('queued', 'running') GROUP BY kind, queue, state
""")


def _counts(duration: str, edges: Sequence[float]) -> str:
    return ", ".join(f"count(*) FILTER (WHERE {duration} <= {edge})" for edge in edges)


_WAIT, _RUN = (
    "extract(epoch FROM started_at - queued_at)",
    "extract(epoch FROM finished_at - started_at)",
)
_ENDED = text(f"""
    SELECT kind, state, count(*) AS jobs, sum(attempt) AS attempts, sum(losses) AS losses,
      coalesce(sum({_WAIT}), 0) AS waited, coalesce(sum({_RUN}), 0) AS ran, count(started_at) AS started,
      ARRAY[{_counts(_WAIT, WAIT_BUCKETS)}] AS wait_counts, ARRAY[{_counts(_RUN, RUN_BUCKETS)}] AS run_counts
    FROM jobs WHERE state NOT IN ('queued', 'running') GROUP BY kind, state
""")


_COUNTERS = (
    ("jobs_ended", "Jobs that have ended", "jobs"),
    ("job_attempts", "Attempts at jobs that have ended", "attempts"),
    ("job_losses", "Attempts lost with a worker that died", "losses"),
)
_TIMES = (
    (
        "wait",
        "From the queue to the start of the last attempt",
        WAIT_BUCKETS,
        "wait_counts",
        "waited",
    ),
    ("run", "From the start of the last attempt to its end", RUN_BUCKETS, "run_counts", "ran"),
)


class JobMetrics(Collector):
    """Collector for a registry of prometheus_client."""

    def __init__(self, sessions: Sessions) -> None:
        self._sessions = sessions
        self._lock = threading.Lock()
        self._read_at = -FRESH_SECONDS
        self._rows: tuple[Sequence[Row[Any]], Sequence[Row[Any]]] = ((), ())

    def collect(self) -> Iterable[Any]:
        """Every metric."""
        unfinished, ended = self._read()
        yield from _open_metrics(unfinished)
        yield from _ended_metrics(ended)

    def describe(self) -> Iterable[Any]:
        """Nothing: the names are known when they are collected, without asking the database at
        registration.
        """
        return ()

    def _read(self) -> tuple[Sequence[Row[Any]], Sequence[Row[Any]]]:
        with self._lock:
            if time.monotonic() - self._read_at >= FRESH_SECONDS:
                with self._sessions() as session:
                    self._rows = session.execute(_OPEN).all(), session.execute(_ENDED).all()
                self._read_at = time.monotonic()
            return self._rows


def _open_metrics(rows: Sequence[Row[Any]]) -> Iterable[Any]:
    def gauge(name: str, words: str) -> GaugeMetricFamily:
        return GaugeMetricFamily(f"modalbase_jobs_{name}", words, labels=["kind", "queue"])

    depth, running = gauge("queued", "Jobs that wait"), gauge("running", "Jobs that run")
    oldest = gauge("oldest_wait_seconds", "Wait of the oldest job that waits")
    for row in rows:
        labels = [row.kind, row.queue]
        if row.state == "queued":
            depth.add_metric(labels, row.jobs)
            oldest.add_metric(labels, max(0.0, float(row.oldest)))
        else:
            running.add_metric(labels, row.jobs)
    return depth, oldest, running


def _ended_metrics(rows: Sequence[Row[Any]]) -> Iterable[Any]:
    labels = ["kind", "outcome"]
    for name, words, column in _COUNTERS:
        counter = CounterMetricFamily(f"modalbase_{name}", words, labels=labels)
        for row in rows:
            counter.add_metric([row.kind, row.state], getattr(row, column))
        yield counter
    for name, words, edges, counts, total in _TIMES:
        times = HistogramMetricFamily(f"modalbase_job_{name}_seconds", words, labels=labels)
        for row in rows:
            buckets = _buckets(edges, getattr(row, counts), row.started)
            times.add_metric([row.kind, row.state], buckets, float(getattr(row, total)))
        yield times


def _buckets(edges: Sequence[float], counts: Sequence[int], total: int) -> list[tuple[str, float]]:
    return [
        *((str(float(edge)), count) for edge, count in zip(edges, counts, strict=True)),
        ("+Inf", total),
    ]
