"""Made years of a watched structure, stored as their runs would be.

Modes of a structure (`benchmarks.tracks`) at eight sensors, hour after hour: seasons and days of the
temperature, wind, modes that are missing, spurious ones. Campaigns, mode sets and runs go in by
COPY, as a recording of each is not the point where years are looked at.
"""

from collections.abc import Iterator, Sequence
from datetime import UTC, datetime, timedelta
from typing import Any, NamedTuple
from uuid import UUID, uuid4

import numpy as np
from psycopg.types.json import Jsonb
from sqlalchemy.orm import Session

from benchmarks.tracks import BETWEEN, HZ, PER_KELVIN, PER_WIND, SENSORS, STATED
from fecore import __version__
from service.nouns.campaigns.operations import Campaign
from service.nouns.modes.operations import Mode, ModeSet
from service.nouns.monitors.tables import MonitorRun
from service.platform.db.bytea import copy_rows

COVARIATES = ("temperature_deck_c", "wind_m_s")
START = datetime(2015, 1, 1, tzinfo=UTC)
_MISSING, _SPURIOUS = 0.05, 0.3


class MadeRun(NamedTuple):
    """A run: when, under which conditions, and its modes as (f, sd, ζ, sd, shape)."""

    hour: int
    covariates: dict[str, float]
    modes: list[tuple[float, float, float, float, dict[str, Any]]]


def made_runs(first: int, count: int, seed: int = 0) -> Iterator[MadeRun]:
    """Runs from an hour on; each hour's draws are its own, so parts of the years are alike."""
    own = np.random.default_rng(seed)
    shapes = np.sin(np.outer(np.arange(1, 6), np.pi * SENSORS / 9)) + 0.1 * own.standard_normal(
        (5, 8)
    )
    for hour in range(first, first + count):
        rng = np.random.default_rng([seed, hour])
        temperature = 12 - 10 * np.cos(2 * np.pi * hour / 8766) + 4 * np.sin(np.pi * hour / 12)
        temperature += rng.standard_normal()
        wind = rng.gamma(2.0, 2.5)
        hz = HZ * (1 + PER_KELVIN * (temperature - 15) + PER_WIND * (wind - 5))
        hz = hz * (1 + np.hypot(BETWEEN, STATED) * rng.standard_normal(5))
        modes = []
        for k in np.flatnonzero(rng.random(5) > _MISSING):
            values = shapes[k] + 0.05 * rng.standard_normal(8)
            modes.append((float(hz[k]), float(hz[k] * STATED), 0.01, 0.001, _shape(values)))
        if rng.random() < _SPURIOUS:
            f = float(rng.uniform(1.5, 9))
            modes.append((f, 0.01 * f, 0.03, 0.01, _shape(rng.standard_normal(8))))
        stated = {COVARIATES[0]: float(temperature), COVARIATES[1]: float(wind)}
        yield MadeRun(hour, stated, sorted(modes, key=lambda mode: mode[0]))


def _shape(values: Sequence[float] | np.ndarray) -> dict[str, Any]:
    count = len(values)
    return {
        "point": [int(point) for point in SENSORS],
        "direction": [3] * count,
        "real": [float(value) for value in values],
        "imag": [0.0] * count,
    }


def store_runs(session: Session, structure: UUID, series: UUID, runs: Sequence[MadeRun]) -> None:
    """Campaigns with a mode set each, and a run that has succeeded; all are as old as their
    dates.
    """
    at = [START + timedelta(hours=run.hour) for run in runs]
    campaigns, sets = ([_key(date) for date in at] for _ in range(2))
    names = ("id", "structure_id", "name", "boundary", "performed_at", "instruments", "covariates")
    with copy_rows(session, Campaign, (*names, "notes", "created_at", "updated_at")) as write:
        for key, run, date in zip(campaigns, runs, at, strict=True):
            stated = Jsonb({}), Jsonb(run.covariates)
            name = f"hour {run.hour}"
            write((key, structure, name, "as_modelled", date, *stated, "", date, date))
    with copy_rows(
        session, ModeSet, ("id", "campaign_id", "name", "origin", "excitation")
    ) as write:
        for key, campaign in zip(sets, campaigns, strict=True):
            write((key, campaign, "ambient", "typed", "unmeasured"))
    columns = ("frequency_hz", "damping_ratio", "frequency_sd_hz", "damping_sd", "shape")
    with copy_rows(session, Mode, ("mode_set_id", "number", *columns)) as write:
        for key, run in zip(sets, runs, strict=True):
            for number, (hz, hz_sd, ratio, ratio_sd, shape) in enumerate(run.modes, 1):
                write((key, number, hz, ratio, hz_sd, ratio_sd, Jsonb(shape)))
    of_run = ("series_id", "campaign_id", "revision", "fingerprint", "state", "software", "values")
    with copy_rows(session, MonitorRun, of_run) as write:
        for campaign, key, run in zip(campaigns, sets, runs, strict=True):
            modes = [mode[:4] for mode in run.modes]
            values = {"parameters": {}, "modes": modes, "mode_set": str(key)}
            write((series, campaign, 1, "made", "succeeded", __version__, Jsonb(values)))


def _key(date: datetime) -> UUID:
    """A UUIDv7 of a time."""
    ms, part = int(date.timestamp() * 1000), uuid4().int & ((1 << 62) - 1)
    return UUID(int=ms << 80 | 7 << 76 | 2 << 62 | part)
