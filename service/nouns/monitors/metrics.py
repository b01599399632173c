"""Metrics of monitors, from their tables: how many are in which state, and how many alarms. No
structure and no person is named: who scrapes need not be one of the laboratory.
"""

import threading
import time
from collections.abc import Iterable, Mapping
from typing import Any

from prometheus_client.core import GaugeMetricFamily
from prometheus_client.registry import Collector
from sqlalchemy import func, select

from service.nouns.monitors.tables import Alarm, Monitor, hidden
from service.platform.db.engine import Sessions

FRESH_SECONDS = 5.0  # for which an answer is given again: a scrape must not be a burden
MONITOR_STATES = ("no data", "normal", "pending", "alarm", "acknowledged")
ALARM_STATES = ("alarm", "acknowledged", "cleared", "withdrawn")


class MonitorMetrics(Collector):
    """Collector for a registry of prometheus_client."""

    def __init__(self, sessions: Sessions) -> None:
        self._sessions = sessions
        self._lock = threading.Lock()
        self._read_at = -FRESH_SECONDS
        self._counts: tuple[Mapping[str, int], Mapping[str, int]] = ({}, {})

    def collect(self) -> Iterable[Any]:
        """Both metrics; a state that nothing is in counts 0."""
        monitors, alarms = self._read()
        for name, words, states, counts in (
            ("monitors", "Monitors that are there, by state", MONITOR_STATES, monitors),
            ("alarms", "Alarms of monitors that are there, by state", ALARM_STATES, alarms),
        ):
            gauge = GaugeMetricFamily(f"modalbase_{name}", words, labels=["state"])
            for state in states:
                gauge.add_metric([state], counts.get(state, 0))
            yield gauge

    def describe(self) -> Iterable[Any]:
        """Nothing: the names are known when they are collected, without asking the database at
        registration.
        """
        return ()

    def _read(self) -> tuple[Mapping[str, int], Mapping[str, int]]:
        there = hidden(deleted=False)
        monitors = select(Monitor.state, func.count()).where(there).group_by(Monitor.state)
        alarms = select(Alarm.state, func.count()).join(Monitor).where(there).group_by(Alarm.state)
        with self._lock:
            if time.monotonic() - self._read_at >= FRESH_SECONDS:
                with self._sessions() as session:
                    counted = [dict(session.execute(query).all()) for query in (monitors, alarms)]
                self._counts = counted[0], counted[1]
                self._read_at = time.monotonic()
            return self._counts
