"""Campaigns as a monitor's judgement sees them, and which of their modes are the same."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from fecore.trend.tracking import SAME_MODE


@dataclass(frozen=True)
class Observation:
    """One campaign of the series."""

    campaign: str  # its id
    performed_at: datetime  # when it was measured
    values: Mapping[str, Any]  # of `service.monitoring.runs`
    covariates: Mapping[str, float]  # by name; NaN where not measured


def same_mode(number: int, observation: Observation, everyone: Sequence[Observation]) -> int | None:
    """Which mode of this campaign, from 0, is the n-th of the earliest one: the nearest in frequency, not further than 15 %.

    Modes of another kind of motion, where the results say it, are others, so that bending may pass torsion.
    """
    first = min(everyone, key=lambda o: o.performed_at)
    if number > len(first.values["modes"]):
        return None
    kind, wanted = _kind(first, number - 1), first.values["modes"][number - 1][0]
    hz, there = _alike(observation, kind), _alike(first, kind)
    if not hz:
        return None
    nearest = min(hz, key=lambda i: abs(hz[i] - wanted))
    rival = min(there.values(), key=lambda f: abs(f - hz[nearest]))
    return nearest if rival == wanted and abs(hz[nearest] / wanted - 1) <= SAME_MODE else None


def _alike(observation: Observation, kind: str | None) -> dict[int, float]:
    """Frequencies of a campaign's modes that may be of a kind, by their numbers from 0."""
    rows = enumerate(observation.values["modes"])
    return {i: row[0] for i, row in rows if kind is None or _kind(observation, i) in (None, kind)}


def _kind(observation: Observation, mode: int) -> str | None:
    """Kind of motion of a mode; None where the run is of a version that kept none, or the mode has no partner."""
    kinds = observation.values.get("kinds")
    return None if kinds is None else kinds[mode]
