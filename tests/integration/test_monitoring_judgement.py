"""Judgements and what becomes of alarms when series change. No worker: these are pure, or one
transaction.
"""

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from typing import Any
from uuid import UUID

import numpy as np
import pytest
from sqlalchemy import func, select, update
from sqlalchemy.orm import Session

from examples.monitoring import structure_body
from fecore.trend import Acknowledgement, Watch
from service.monitoring.scheduler import check
from service.nouns.campaigns.operations import create_campaign
from service.nouns.campaigns.schemas import CampaignIn
from service.nouns.frfs.operations import Frf
from service.nouns.imports.operations import Import
from service.nouns.monitors.alarms import acknowledge, alarm_for, set_state, update_alarms
from service.nouns.monitors.candidates import candidates_of
from service.nouns.monitors.operations import create_monitor
from service.nouns.monitors.runs import monitor_for, newest_series
from service.nouns.monitors.schemas import MonitorIn
from service.nouns.monitors.tables import Alarm, AlarmEvent, MonitorJudgement, MonitorRun
from service.nouns.notifications.tables import Delivery
from service.nouns.storage.originals import Original
from service.nouns.structures.operations import Structure, create_structure
from service.nouns.structures.schemas import StructureIn
from service.platform.access import Member, Project
from service.platform.access.keys import user_named
from service.platform.db.engine import Sessions
from service.platform.errors import Conflict, NotFound
from service.platform.queue.queue import enqueue
from service.platform.queue.tables import Job
from service.platform.settings import Settings
from service.tasks.import_file.task import IMPORTS
from service.tasks.judge.compute import Episode, Judgement
from service.tasks.judge.inputs import ModeEffects
from service.tasks.judge.task import TASK, judge_if_changed
from tests.support.judged import MODES, START, day, judged, observe, values


def test_an_alarm_ends_only_when_it_was_seen() -> None:
    series = values(*[1.0] * 8, 0.95, 0.95, *[1.0] * 12)
    (episode,) = judged(series).episodes
    assert (episode.campaign, episode.state) == ("8", "alarm")
    assert episode.details["value"] == pytest.approx(0.95, abs=0.005)
    seen = Acknowledgement("Ex", day(9.5))
    (episode,) = judged(series, acknowledged=[seen]).episodes
    assert episode.state == "cleared"
    assert judged(series, acknowledged=[seen]).state == "normal"
    (episode,) = judged(series[:10], acknowledged=[seen]).episodes
    assert episode.state == "acknowledged"


def test_an_open_alarm_names_its_other_explanations_and_what_decides() -> None:
    """The second mode alone fell: a mass where the others do not move. A run of before says nothing
    of what moves it.
    """
    fallen = [MODES[0], [156.0, *MODES[1][1:]], MODES[2]]
    rng = np.random.default_rng(3)

    def noisy(modes: Sequence[Any]) -> list[Any]:
        return [[hz * (1 + 1e-4 * rng.standard_normal()), *rest] for hz, *rest in modes]

    series = [observe(i, 1.0, noisy(MODES)) for i in range(8)]
    series += [observe(i, 0.95, noisy(fallen)) for i in range(8, 11)]
    mode_effects = ModeEffects(
        campaign="5",
        stiffness={"Ex": np.full(3, 0.5)},
        support={},
        sites=np.array([[0.1, 0, 0], [0.3, 0, 0], [0.5, 0, 0]]),
        mass=-np.array([[0.0, 0.0, 3.0], [0.1, 3.0, 0.2], [3.0, 0.1, 0.0]]),
    )
    (episode,) = judged(series, mode_effects=mode_effects).episodes
    explanations = episode.details["explanations"]
    assert explanations["ranked"][0]["kind"] == "mass"
    assert "g more near x = 0.3 m (100 %)" in explanations["text"]
    assert "look near there for a sensor" in explanations["text"]
    (before,) = judged(series).episodes
    assert before.details["explanations"] is None


def test_an_acknowledgement_of_what_is_no_alarm_any_more_is_passed_over() -> None:
    result = judged(values(*[1.0] * 9), acknowledged=[Acknowledgement("Ex", day(20))])
    assert (result.state, result.episodes) == ("normal", ())


def test_a_mode_is_the_same_one_though_another_was_missed() -> None:
    watch = Watch({"frequency_3": "fall", "damping_ratio_2": "rise"}, baseline=4)
    missed = [observe(i, 1.0, MODES if i != 5 else [MODES[0], MODES[2]]) for i in range(6)]
    frequency, ratio = judged(missed, watch).document["parameters"]
    assert [p["raw"] for p in frequency["points"]] == [400.0] * 6
    assert [p["campaign_id"] for p in ratio["points"]] == ["0", "1", "2", "3", "4"]
    notes = judged(missed, watch).document["notes"]
    assert "damping_ratio_2 has no value in campaign 5" in notes
    assert any(
        note.startswith("damping_ratio_2: some campaigns state no standard deviation")
        for note in notes
    )


def test_a_parameter_that_no_result_has_is_no_data() -> None:
    result = judged(values(*[1.0] * 7), Watch({"Ex": "fall", "a7": "rise"}, baseline=6))
    assert result.state == "no data"
    assert "a7 has no value in campaign 0, 1, 2, 3, 4, 5, 6" in result.document["notes"]
    assert [p["name"] for p in result.document["parameters"]] == ["Ex"]


class World:
    """A monitor with four campaigns in a database without a worker."""

    def __init__(self, session: Session) -> None:
        self.session, self.user = session, user_named(session, "somebody")
        project = Project(name="p")
        session.add(project)
        session.flush()
        session.add(Member(project_id=project.id, user_id=self.user.id, role="owner"))
        session.flush()
        structure = create_structure(
            session, self.user, project.id, StructureIn.model_validate(structure_body())
        )
        body = MonitorIn.model_validate({"name": "m", "mail_to": ["a@b.example"]})
        self.monitor = create_monitor(
            session, self.user, structure.id, body, Settings(smtp_host="mail.example")
        )
        self.series = newest_series(session, self.monitor)
        self.campaigns = [
            create_campaign(
                session,
                self.user,
                structure.id,
                CampaignIn(name=str(i), boundary="free", performed_at=day(i)),
            )
            for i in range(4)
        ]

    def judge(self, *episodes: tuple[int, str]) -> list[tuple[int, str]]:
        """Alarms as (campaign, state) after a judgement with these episodes of Ex."""
        details = {"performed_at": START.isoformat(), "value": 1.0}
        given = [Episode("Ex", str(self.campaigns[i].id), state, details) for i, state in episodes]
        update_alarms(self.session, self.monitor, self.series, given)
        return self.alarms()

    def alarms(self) -> list[tuple[int, str]]:
        number = {campaign.id: i for i, campaign in enumerate(self.campaigns)}
        return [
            (number[a.campaign_id], a.state)
            for a in self.session.scalars(select(Alarm).order_by(Alarm.id))
        ]

    def announced(self) -> list[str]:
        return list(self.session.scalars(select(Delivery.event).order_by(Delivery.id)))

    def history(self) -> list[str]:
        return list(self.session.scalars(select(AlarmEvent.event).order_by(AlarmEvent.id)))


@pytest.fixture
def world(sessions: Sessions) -> Any:
    with sessions.begin() as session:
        yield World(session)


def test_alarms_are_raised_once_and_follow_their_series(world: World) -> None:
    assert world.judge((2, "alarm")) == [(2, "alarm")]
    assert world.judge((2, "alarm")) == [(2, "alarm")]
    assert world.announced() == ["alarm.raised"]
    # a late campaign raises it earlier: the same alarm
    assert world.judge((1, "alarm")) == [(1, "alarm")]
    assert world.history() == ["raised", "moved"]
    alarm = world.session.scalars(select(Alarm)).one()
    acknowledge(world.session, world.user, alarm, "seen")
    with pytest.raises(Conflict, match="the alarm is acknowledged"):
        acknowledge(world.session, world.user, alarm, "again")
    assert world.judge((1, "cleared"), (3, "alarm")) == [(1, "cleared"), (3, "alarm")]
    assert world.judge((1, "cleared")) == [(1, "cleared"), (3, "withdrawn")]
    assert world.announced() == [
        "alarm.raised",
        "alarm.acknowledged",
        "alarm.cleared",
        "alarm.raised",
        "alarm.withdrawn",
    ]


def test_an_alarm_that_came_back_too_late_is_open_again(world: World) -> None:
    """One that was cleared stays so where its campaign is no episode any more; an alarm of another
    parameter is not taken.
    """
    world.judge((1, "alarm"))
    alarm = world.session.scalars(select(Alarm)).one()
    acknowledge(world.session, world.user, alarm, "seen")
    assert world.judge((1, "cleared")) == [(1, "cleared")]
    assert world.judge((1, "acknowledged")) == [(1, "acknowledged")]
    assert world.history()[-1] == "reopened"
    assert world.judge((1, "cleared")) == [(1, "cleared")]
    assert world.judge((3, "alarm")) == [(1, "cleared"), (3, "alarm")]
    world.session.execute(update(Alarm).values(parameter="Ey"))
    assert world.judge((2, "alarm")) == [(1, "cleared"), (3, "withdrawn"), (2, "alarm")]


def test_silence_is_told(world: World) -> None:
    set_state(world.session, world.monitor, "normal")
    set_state(world.session, world.monitor, "no data")
    set_state(world.session, world.monitor, "no data")
    assert world.announced() == ["monitor.no_data"]


def test_a_series_is_judged_when_something_is_new_and_not_again(world: World) -> None:
    session, monitor, series = world.session, world.monitor, world.series
    monitor.expected_interval_days = 30.0
    values = {"parameters": {}, "modes": []}
    plain_frf(session, world.campaigns[0].id)
    run = MonitorRun(
        series_id=series.id, campaign_id=world.campaigns[0].id, revision=1, fingerprint=""
    )
    run.state, run.values = "running", values
    session.add(run)
    session.flush()

    def queued(at: float) -> int:
        judge_if_changed(session, monitor, series, day(at))
        waiting = session.scalars(
            select(Job).where(Job.kind == "judge", Job.state == "queued")
        ).all()
        for job in waiting:
            job.state = "failed"
        session.flush()
        return len(waiting)

    assert queued(0.5) == 0  # a run is under way
    run.state = "succeeded"
    session.flush()
    set_state(session, monitor, "normal")
    assert queued(0.5) == 1
    assert monitor.state == "normal"
    assert queued(1.4) == 0  # nothing new; what failed once fails again
    assert monitor.state == "no data"
    assert [queued(1.6), queued(2.4), queued(2.6)] == [1, 0, 1]  # it is late, and later
    world.campaigns[0].temperature_c = 20.0
    session.flush()
    assert queued(2.6) == 1


def test_a_deleted_monitor_raises_no_alarm_and_hides_those_it_has(world: World) -> None:
    """A judgement that was under way when the monitor was deleted changes nothing and announces
    nothing.
    """
    session, monitor = world.session, world.monitor
    world.judge((2, "alarm"))
    alarm = session.scalars(select(Alarm)).one()
    job = enqueue(
        session, kind=TASK, project_id=session.get_one(Structure, monitor.structure_id).project_id
    )
    session.add(MonitorJudgement(id=job.id, series_id=world.series.id, digest="d"))
    session.flush()
    monitor_for.hide(session, world.user, monitor)
    with pytest.raises(NotFound, match=r"alarm"):
        alarm_for(session, world.user, alarm.id)
    with pytest.raises(NotFound, match=r"alarm"):
        acknowledge(session, world.user, alarm, "seen")
    details = {"performed_at": START.isoformat(), "value": 1.0}
    result = Judgement(
        {"state": "alarm"}, (Episode("Ex", str(world.campaigns[3].id), "alarm", details),), "alarm"
    )
    TASK.store(session, job.id, iter([result]))
    assert (world.alarms(), world.announced(), monitor.state) == (
        [(2, "alarm")],
        ["alarm.raised"],
        "no data",
    )
    monitor_for.restore(session, world.user, monitor)
    assert alarm_for(session, world.user, alarm.id) is alarm
    TASK.store(session, job.id, iter([result]))
    # the same alarm, raised by another campaign
    assert (world.alarms(), monitor.state) == ([(3, "alarm")], "alarm")


def test_a_deleted_monitor_is_not_looked_after(world: World) -> None:
    session, monitor = world.session, world.monitor
    plain_frf(session, world.campaigns[0].id)
    monitor_for.hide(session, world.user, monitor)
    check(session, monitor.id, timedelta(0))
    assert session.scalars(select(MonitorRun)).all() == []
    monitor_for.restore(session, world.user, monitor)
    check(session, monitor.id, timedelta(0))
    assert [run.state for run in session.scalars(select(MonitorRun))] == ["running"]


def test_a_campaign_settles_before_it_counts_as_complete(world: World) -> None:
    """Without a word that it is complete: not while something was added just now, or while an
    import is on its way.
    """
    session, monitor, campaign = world.session, world.monitor, world.campaigns[0]
    plain_frf(session, campaign.id)
    # when its row was made, by the clock of the database
    now = session.scalars(select(func.now())).one()

    def complete(later: float) -> bool:
        return candidates_of(
            session, monitor, now + timedelta(seconds=later), timedelta(seconds=30)
        )[0].complete

    assert [complete(later) for later in (0, 29, 31)] == [False, False, True]
    session.add(Original(sha256=b"1", size=1))
    session.flush()
    job = enqueue(
        session,
        kind=IMPORTS.kind,
        project_id=session.get_one(Structure, monitor.structure_id).project_id,
    )
    session.add(Import(id=job.id, campaign_id=campaign.id, filename="", sha256=b"1", dry_run=False))
    session.flush()
    assert not complete(31)
    job.state = "failed"
    session.flush()
    assert complete(31)


def test_a_schedule_is_kept(world: World) -> None:
    session, monitor = world.session, world.monitor
    plain_frf(session, world.campaigns[0].id)
    monitor.runs_on, monitor.schedule = "schedule", "0 3 * * *"
    for wait, states in ((timedelta(hours=1), []), (timedelta(seconds=-1), ["running"])):
        monitor.next_run_at = datetime.now(UTC) + wait
        check(session, monitor.id, timedelta(0))
        assert [run.state for run in session.scalars(select(MonitorRun))] == states
    assert monitor.next_run_at > datetime.now(UTC)


def plain_frf(session: Session, campaign: UUID) -> None:
    points = {
        "response_point": 1,
        "response_direction": 3,
        "reference_point": 1,
        "reference_direction": 3,
    }
    axis = {
        "start_hz": 1,
        "end_hz": 2,
        "step_hz": 1,
        "lines": 2,
        "dtype": "<c8",
        "sha256": b"2",
        "data": b"",
    }
    session.add(Frf(campaign_id=campaign, label="", quantity="accelerance", **points, **axis))
    session.flush()
