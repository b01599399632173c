"""A judgement follows only what is new, and gives what following all runs at once gives, whatever
the order in which they come, are deleted, restored and corrected.
"""

from datetime import datetime
from typing import Any
from uuid import UUID

import numpy as np
import pytest
from sqlalchemy import select
from sqlalchemy.orm import Session

from benchmarks.made_years import COVARIATES, made_runs, store_runs
from benchmarks.ten_years import judge_all, watched
from service.app.supervisor import LocalService
from service.nouns.campaigns.operations import Campaign
from service.nouns.monitors import followed
from service.nouns.monitors.operations import create_monitor
from service.nouns.monitors.points import EVERY, Part, extremes, points_page
from service.nouns.monitors.presentation import series_document
from service.nouns.monitors.runs import newest_series, next_series
from service.nouns.monitors.schemas import MonitorIn
from service.nouns.monitors.tables import (
    Monitor,
    MonitorPoint,
    MonitorRun,
    MonitorSeries,
    MonitorTracks,
)
from service.nouns.structures.operations import create_structure
from service.nouns.structures.schemas import StructureIn
from service.platform.access import Member, Project
from service.platform.access.keys import user_named
from service.platform.db.base import transaction_time
from service.platform.db.engine import Sessions
from service.platform.settings import Settings
from service.tasks.judge import task
from tests.support.lengths import long

RUNS = 60


def a_monitor(session: Session) -> Monitor:
    user, project = user_named(session, "somebody"), Project(name="p")
    session.add(project)
    session.flush()
    session.add(Member(project_id=project.id, user_id=user.id, role="owner"))
    session.flush()
    structure = create_structure(session, user, project.id, StructureIn(name="deck"))
    body = {
        "name": "deck",
        "watch": "modes",
        "covariates": [*COVARIATES],
        "baseline": {"campaigns": 8},
    }
    return create_monitor(session, user, structure.id, MonitorIn.model_validate(body), Settings())


def stored(session: Session, series: MonitorSeries) -> tuple[dict[UUID, Any], list[Any]]:
    """Tracks by campaign, and points."""
    session.expire_all()
    query = select(MonitorRun.campaign_id, MonitorTracks.numbers, MonitorTracks.identity_sd)
    query = query.join(MonitorTracks, MonitorTracks.run_id == MonitorRun.id)
    rows: Any = session.execute(query.where(MonitorTracks.series_id == series.id))
    order = (MonitorPoint.performed_at, MonitorPoint.parameter)
    points = session.scalars(
        select(MonitorPoint).where(MonitorPoint.series_id == series.id).order_by(*order)
    )
    return {campaign: (numbers, sds) for campaign, numbers, sds in rows}, [*points]


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Series of some ten runs are long ones."""
    for name, value in {"WINDOW": 10, "BETWEEN": 5, "BEYOND": 0, "FOLLOWED_AT_ONCE": 25}.items():
        monkeypatch.setattr(task, name, value)
    monkeypatch.setattr(followed, "STATES_APART", 7)


@pytest.mark.parametrize(("seed", "count"), [(1, 24), long(2, 90)])
@pytest.mark.usefixtures("short")
def test_any_order_gives_what_all_at_once_gives(
    sessions: Sessions, seed: int, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(seed)
    with sessions.begin() as session:
        monitor = a_monitor(session)
        series = newest_series(session, monitor)
        runs = list(made_runs(0, count, seed))
        order = [int(at) for at in np.argsort(np.arange(count) + rng.exponential(8, count))]
        while order:
            part, order = order[: (size := int(rng.integers(1, 30)))], order[size:]
            store_runs(session, monitor.structure_id, series.id, [runs[at] for at in sorted(part)])
            some = rng.choice(session.scalars(select(Campaign.id)).all(), 2)
            for key in some.tolist():
                campaign = session.get_one(Campaign, key)
                now = transaction_time(session)
                campaign.deleted_at = None if campaign.deleted_at else now
            other = session.scalars(select(Campaign).limit(1).offset(len(part) // 2)).one()
            other.covariates = {**other.covariates, COVARIATES[1]: float(rng.uniform(1, 9))}
            session.flush()
            judge_all(session, monitor, series)
        assert (series.document or {})["state"] != "no data"
        tracks, points = stored(session, series)
        # the same runs in a series of their own, all at once
        for name in ("WINDOW", "FOLLOWED_AT_ONCE"):
            monkeypatch.setattr(task, name, 10 * count)
        again = next_series(session, monitor, 2, "all at once")
        for run in session.scalars(select(MonitorRun).where(MonitorRun.series_id == series.id)):
            copy = {name: getattr(run, name) for name in ("campaign_id", "revision", "state")}
            copy |= {name: getattr(run, name) for name in ("fingerprint", "software", "values")}
            session.add(MonitorRun(series_id=again.id, **copy))
        session.flush()
        assert judge_all(session, monitor, again) == 1
        whole_tracks, whole = stored(session, again)
        assert {key: tracks[key] for key in whole_tracks} == whole_tracks
        assert [(p.parameter, p.performed_at, p.campaign_id, p.raw) for p in points] == [
            (p.parameter, p.performed_at, p.campaign_id, p.raw) for p in whole
        ]
        for one, other_point in zip(points, whole, strict=True):
            assert one.condition == other_point.condition
            judged = one.judged or {"chart": {}, "score": 0.0}
            expected = other_point.judged or {"chart": {}, "score": 0.0}
            # sums over other numbers of campaigns: rounding
            assert judged["score"] == pytest.approx(expected["score"], abs=1e-9)
            assert judged["chart"] == pytest.approx(expected["chart"], abs=1e-9)


@pytest.mark.usefixtures("short")
def test_a_long_series_is_followed_in_parts_and_shown_thinned(sessions: Sessions) -> None:
    with sessions.begin() as session:
        monitor = a_monitor(session)
        series = newest_series(session, monitor)
        store_runs(session, monitor.structure_id, series.id, list(made_runs(0, RUNS)))
        assert judge_all(session, monitor, series) == 3  # of 25 runs at most
        assert judge_all(session, monitor, series) == 0
        whole = series_document(session, monitor, series, Part(limit=EVERY))
        assert (whole["total"], whole["stride"], len(whole["campaigns"])) == (RUNS, 1, RUNS)
        thin = series_document(session, monitor, series, Part(limit=20))
        assert (thin["total"], thin["stride"], len(thin["campaigns"])) == (RUNS, 3, 20)
        assert thin["campaigns"][-1] == whole["campaigns"][-1]
        few = 20 * len(whole["parameters"])
        assert series_document(session, monitor, series, Part(values=few)) == thin
        name, points = whole["parameters"][0]["name"], whole["parameters"][0]["points"]
        begin = datetime.fromisoformat(whole["campaigns"][40]["performed_at"])
        late = series_document(session, monitor, series, Part(begin))
        assert late["campaigns"] == whole["campaigns"][40:]
        pieces = extremes(session, series, monitor, name, Part())
        assert pieces == points  # fewer than pieces are all there
        rows, cursor = [], None
        while cursor is not None or not rows:
            page, cursor = points_page(session, series, cursor, Part(limit=7), [name])
            rows += page
        assert [row.raw for row in rows] == [point["raw"] for point in points]
        kept = select(MonitorTracks).where(MonitorTracks.state.is_not(None))
        assert len(session.scalars(kept).all()) == RUNS // 7 + 1


@pytest.mark.long
def test_the_benchmark_of_years_runs(
    idle: LocalService, capsys: pytest.CaptureFixture[str]
) -> None:
    """A short form of it, whose numbers nobody looks at; of what it asks the tests above are the short
    form.
    """
    watched(idle, 30, 1)
    printed = capsys.readouterr().out
    assert "one more run judged" in printed
    assert "the structure's page" in printed
