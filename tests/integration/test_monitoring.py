"""Monitors over real HTTP, with a real worker: what becomes of every kind of campaign, and who gets
a message.
"""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from itertools import count
from typing import Any
from uuid import UUID, uuid4

import httpx
import numpy as np
import psutil
import pytest
from sqlalchemy import select

from examples.monitoring import (
    State,
    measured_frfs,
    post_campaign,
    send_measurement,
    structure_body,
)
from service.app.supervisor import LocalService
from service.monitoring.scheduler import check
from service.nouns.monitors.alarms import set_state
from service.nouns.monitors.tables import Monitor
from service.platform.db.engine import make_engine, make_sessions
from tests.support.rest import client_of, ok
from tests.support.waiting import until

START = datetime(2024, 1, 15, 10, tzinfo=UTC)

RECIPE = {
    "identification": {"band_hz": [5, 500], "highest_order": 10},
    "damping_models": ["rayleigh"],
    "parameters": [
        {"name": "Ex"},
        {"name": "Gxy", "tied_to": "Ex"},
        {"name": "Gxz", "tied_to": "Ex"},
    ],
}
UPDATES = {"recipe": RECIPE, "parameters": [{"name": "Ex"}]}
"""What a monitor of updates has; each takes three times as long as an identification."""
TYPED = {  # of the beam: others are explained at length
    "name": "by hand",
    "modes": [{"frequency_hz": f, "damping_ratio": 0.02} for f in (26.16, 163.23, 453.81)],
}
WATCH = {
    "name": "m",
    "watch": "modes",
    "parameters": [{"name": "frequency_1"}],
    "baseline": {"campaigns": 4},
}


def frfs(stiffness: float, seed: int) -> np.ndarray:
    return measured_frfs(State(stiffness=stiffness), seed)


def day(number: int) -> str:
    return (START + timedelta(days=30 * number)).isoformat()


class Lab:
    """A structure with a monitor, and what one does with them."""

    def __init__(self, service: LocalService, api: httpx.Client, **monitor: Any) -> None:
        self.service, self.api = service, api
        self.project = ok(api.post("projects", json={"name": "lab"}), 201)["id"]
        self.structure = ok(
            api.post(f"projects/{self.project}/structures", json=structure_body()), 201
        )["id"]
        self.monitor = self.watch(**monitor)
        self.baseline: list[str] = []

    def watch(self, **fields: Any) -> str:
        body = {**WATCH, **fields}
        answer = self.api.post(f"structures/{self.structure}/monitors", json=body)
        return str(ok(answer, 201)["id"])

    def campaign(self, number: int, stiffness: float = 1.0, **fields: Any) -> str:
        """A campaign of day `number`, complete, with FRFs of its own."""
        seed = fields.pop("seed", number)
        body = {"name": f"day {number}", "performed_at": day(number), **fields}
        return post_campaign(self.api, self.structure, body, frfs(stiffness, seed))

    def empty(self, number: int) -> str:
        body = {"name": "empty", "boundary": "cantilever", "performed_at": day(number)}
        return str(
            ok(self.api.post(f"structures/{self.structure}/campaigns", json=body), 201)["id"]
        )

    def typed(self, number: int) -> str:
        """A campaign with modes too, which are the same each day: no job identifies them."""
        campaign = self.campaign(number)
        ok(self.api.post(f"campaigns/{campaign}/mode-sets", json=TYPED), 201)
        return campaign

    def series(self, **params: Any) -> Any:
        return ok(self.api.get(f"monitors/{self.monitor}/series", params=params))

    def runs(self) -> list[dict[str, Any]]:
        return list(ok(self.api.get(f"monitors/{self.monitor}/runs"))["items"])

    def until(self, condition: Callable[[Any], bool]) -> Any:
        """The series, as soon as it is so; the worker's own look, which sees what notifies nobody,
        comes too seldom to be waited for.
        """
        asked = count()

        def so() -> Any:
            if next(asked) % 8 == 0:
                look_after(self.service, self.monitor)
            series = self.series()
            return series if condition(series) else None

        return until(so, "the series", self.series)

    def judged(self, campaigns: list[str]) -> Any:
        """The series, once it is made of exactly these campaigns."""
        return self.until(lambda s: bool(s["parameters"]) and order(s) == campaigns)


def order(series: Any, parameter: int = 0) -> list[str]:
    return [p["campaign_id"] for p in series["parameters"][parameter]["points"]]


def points(series: Any) -> dict[str, Any]:
    return {p["campaign_id"]: p for p in series["parameters"][0]["points"]}


def outcome(series: Any, campaign: str) -> Any:
    return {c["campaign_id"]: c for c in series["campaigns"]}.get(campaign)


@pytest.fixture(scope="module")
def client(service: LocalService) -> Iterator[httpx.Client]:
    with client_of(service, f"laboratory {uuid4()}") as client:
        yield client


def look_after(service: LocalService, monitor: str) -> None:
    """The worker's look at a monitor, which comes by itself some time, now and to its end."""
    engine = make_engine(service.settings.database_url)
    with make_sessions(engine).begin() as session:
        # after a look that is under way
        session.get_one(Monitor, UUID(monitor), with_for_update=True)
        check(session, UUID(monitor), timedelta(0))
    engine.dispose()


@contextmanager
def worker_stopped(service: LocalService) -> Iterator[None]:
    """Nothing is stored and nothing is judged in this block.

    A worker that is stopped in the middle of a look at a monitor would keep its row from the API
    for ever.
    """
    worker, engine = service.processes["worker"], make_engine(service.settings.database_url)
    with make_sessions(engine).begin() as session:
        session.scalars(select(Monitor.id).with_for_update()).all()
        worker.send_signal(signal.SIGSTOP)
        until(
            lambda: psutil.Process(worker.pid).status() == psutil.STATUS_STOPPED,
            "the worker to stop",
        )
    engine.dispose()
    try:
        yield
    finally:
        worker.send_signal(signal.SIGCONT)


@pytest.fixture(scope="module")
def lab(service: LocalService, client: httpx.Client) -> Lab:
    """A lab whose monitor has its baseline: days 0 to 3."""
    lab = Lab(service, client, runs_on="hand")
    lab.baseline = [lab.campaign(i) for i in range(4)]
    lab.monitor = lab.watch()  # after them, so that they are judged together
    lab.judged(lab.baseline)
    return lab


def test_a_campaign_without_frfs_is_run_when_they_come_and_an_earlier_one_put_before_it(
    lab: Lab, service: LocalService
) -> None:
    campaign = lab.empty(5)
    look_after(service, lab.monitor)
    # nobody has said that it is complete, and nothing is in it
    assert outcome(lab.series(), campaign) is None
    (run,) = ok(lab.api.post(f"campaigns/{campaign}/complete"))["runs"]
    lacking = "the campaign has no FRFs, no time blocks, no recording and no mode set"
    assert (run["state"], run["message"]) == ("refused", lacking)
    assert campaign not in points(lab.series())
    send_measurement(lab.api, campaign, frfs(1.0, 5))
    series = lab.until(lambda s: campaign in points(s))
    assert outcome(series, campaign)["revision"] == 2
    assert any(f"campaign {campaign} was run again" in note for note in series["notes"])
    early = lab.campaign(4, seed=10)
    series = lab.judged([*lab.baseline, early, campaign])
    assert (
        f"put into time order: {early} came after later campaigns; the states were judged anew"
        in series["notes"]
    )
    delete(lab, early)
    delete(lab, campaign)


def test_another_boundary_is_refused(lab: Lab) -> None:
    campaign = lab.campaign(6, boundary="free", seed=0)
    run = outcome(lab.series(), campaign)
    assert run["state"] == "refused"
    assert "held 'free'; this monitor compares campaigns held 'cantilever'" in run["message"]
    delete(lab, campaign)


def test_the_same_measurement_counts_once(lab: Lab) -> None:
    again = lab.campaign(7, seed=1)
    assert (
        outcome(lab.series(), again)["message"]
        == f"holds the same FRFs as campaign {lab.baseline[1]}; a measurement counts once"
    )
    same_moment = lab.campaign(2, seed=99)
    assert (
        outcome(lab.series(), same_moment)["message"]
        == f"was performed at the same moment as campaign {lab.baseline[2]}; correct one of the"
        " dates"
    )
    runs = lab.runs()
    for body in ({}, {"campaign": lab.baseline[0]}, {"campaign": again}):
        assert ok(lab.api.post(f"monitors/{lab.monitor}/runs", json=body))["items"] == []
    ok(lab.api.post(f"campaigns/{lab.baseline[0]}/complete"))
    assert lab.runs() == runs
    delete(lab, again)
    delete(lab, same_moment)


def test_corrections_are_judged_and_deletions_leave(lab: Lab) -> None:
    """What a laboratory mends later is judged as if it had always been so."""
    campaign = lab.campaign(8, 0.97)
    series = lab.until(lambda s: campaign in points(s))
    assert points(series)[campaign]["judged"]["outside"]
    assert series["state"] == "alarm"
    runs = lab.runs()
    change(lab.api, f"campaigns/{campaign}", {"performed_at": day(9)})
    lab.until(
        lambda s: campaign in points(s) and points(s)[campaign]["performed_at"][:10] == day(9)[:10]
    )
    assert lab.runs() == runs  # a date needs no new run
    delete(lab, campaign)
    series = lab.judged(lab.baseline)
    (mark,) = [a for a in series["alarms"] if a["campaign_id"] == campaign]
    assert mark["state"] == "withdrawn"
    ok(lab.api.post(f"campaigns/{campaign}/restore"))
    instruments = {"sensor_mass_kg": 1e-6, "sensor_point": 9}
    change(lab.api, f"campaigns/{campaign}", {"instruments": instruments})
    again = (2, "succeeded")
    lab.until(
        lambda s: (
            campaign in points(s)
            and (outcome(s, campaign)["revision"], outcome(s, campaign)["state"]) == again
        )
    )
    delete(lab, campaign)


def test_runs_by_hand_a_rerun_priors_that_follow_and_a_changed_structure(
    client: httpx.Client, service: LocalService
) -> None:
    """A rerun leaves the old version; priors follow the last estimate in time order; a changed
    structure ends the series.
    """
    given = {"watch": "update", **UPDATES, "modes": "given"}
    lab = Lab(service, client, **given, runs_on="hand", priors="last")
    scheduled = lab.watch(runs_on="schedule", schedule="0 3 * * 1")
    path, first = f"monitors/{lab.monitor}/runs", lab.typed(0)
    for monitor in (lab.monitor, scheduled):
        look_after(service, monitor)
    assert lab.runs() == []
    shown = ok(client.get(f"monitors/{scheduled}"))
    at = datetime.fromisoformat(shown["next_run_at"])
    assert (at.weekday(), at.hour, at.minute) == (0, 3, 0)
    assert datetime.now(UTC) < at <= datetime.now(UTC) + timedelta(days=7)
    (run,) = ok(client.post(path, json={}), 202)["items"]
    assert (run["state"], run["campaign_id"]) == ("running", first)
    old = lab.judged([first])

    with worker_stopped(service):
        answer = client.post(path, json={"rerun": True, "reason": "new software"})
        (run,) = ok(answer, 202)["items"]
        assert (run["series"], run["revision"], run["campaign_id"]) == (2, 1, first)
        assert lab.series()["series"] == 1  # until the new one is judged
    new = lab.until(lambda s: s["series"] == 2)
    assert [v["reason"] for v in new["versions"]] == ["first series", "new software"]
    kept = lab.series(series=1)
    assert {**kept, "versions": [], "current": True} == {**old, "versions": []}
    assert new["parameters"] == old["parameters"]
    ok(client.get(f"monitors/{lab.monitor}/series", params={"series": 3}), 404)
    of_first = ok(client.get(path, params={"series": 1}))["items"]
    assert [one["series"] for one in of_first] == [1]

    made = [first, lab.typed(1)]
    ok(client.post(path, json={}), 202)
    series = lab.judged(made)
    before, after = (
        {p["name"]: p for p in ok(client.get(f"update-jobs/{job}"))["recipe"]["parameters"]}
        for job in (outcome(series, one)["update_job_id"] for one in made)
    )
    assert before["Ex"]["prior_mean"] is None
    assert after["Ex"]["prior_mean"] == points(series)[first]["raw"]
    assert after["Ex"]["prior_sd"] == pytest.approx(0.3 * 33.0e9)  # as wide as ever
    assert after["Gxy"]["tied_to"] == "Ex"

    change(client, f"structures/{lab.structure}", {"density_kg_m3": 2000.0})
    late = lab.typed(2)
    ok(client.post(path, json={}), 202)
    series = lab.series()
    assert (
        "is now in version 2, this monitor's series is of version 1"
        in outcome(series, late)["message"]
    )
    assert outcome(series, first)["state"] == "succeeded"
    assert order(series) == made


def test_a_deleted_monitor_is_gone_until_it_is_restored_and_follows_modes_that_were_typed_in(
    service: LocalService, client: httpx.Client
) -> None:
    lab = Lab(service, client, runs_on="hand")
    watched = [{"name": "Ex"}, {"name": "frequency_1"}, {"name": "damping_ratio_1"}]
    update = {**UPDATES, "watch": "update", "parameters": watched}
    working = lab.watch(name="works", modes="given", **update)
    path = f"monitors/{working}"
    ok(client.post(f"{path}/restore"), 409)
    etag = client.get(path).headers["ETag"]
    ok(client.delete(path, headers={"If-Match": '"another"'}), 412)
    ok(client.delete(path, headers={"If-Match": etag}), 204)
    for gone in (
        path,
        f"{path}/series",
        f"{path}/series/figure",
        f"{path}/runs",
        f"{path}/deliveries",
    ):
        ok(client.get(gone), 404)
    ok(client.delete(path), 404)
    ok(client.patch(path, json={"name": "n"}, headers={"If-Match": "*"}), 404)
    ok(client.post(f"{path}/runs", json={}), 404)
    ok(client.get("alarms", params={"monitor": working}), 404)
    everywhere = ("monitors", f"structures/{lab.structure}/monitors")
    for listed in everywhere:
        assert working not in ids(client, listed)
        assert working in ids(client, listed, deleted="true")
        assert lab.monitor not in ids(client, listed, deleted="true")
    between = lab.campaign(1)
    assert ok(client.post(f"campaigns/{between}/complete"))["runs"] == []
    shown = ok(client.post(f"{path}/restore"))
    assert (shown["deleted_at"], shown["name"]) == (None, "works")
    lab.monitor = working
    series = lab.until(lambda s: outcome(s, between))
    assert "no mode set that was typed in" in outcome(series, between)["message"]
    ok(client.post(f"campaigns/{between}/mode-sets", json=TYPED), 201)
    series = lab.judged([between])
    assert [p["points"][0]["raw"] for p in series["parameters"][1:]] == [26.16, 0.02]
    acts = [
        e["action"] for e in ok(client.get("audit-events"))["items"] if e["subject_id"] == working
    ]
    assert sorted(acts) == ["monitor.create", "monitor.delete", "monitor.restore"]


def ids(client: httpx.Client, path: str, **params: str) -> list[str]:
    return [m["id"] for m in ok(client.get(path, params={"limit": 1000, **params}))["items"]]


def test_an_undated_campaign_is_not_complete_and_a_monitor_comes_to_rest(
    lab: Lab, client: httpx.Client
) -> None:
    """What else cannot be meant is in `tests/corpus/test_requests.py`."""
    body = {"name": "x", "boundary": "free"}
    undated = ok(client.post(f"structures/{lab.structure}/campaigns", json=body), 201)["id"]
    assert "no performed_at" in ok(client.post(f"campaigns/{undated}/complete"), 409)["detail"]
    ok(client.patch(f"monitors/{lab.monitor}", json={"name": "n"}), 428)
    by_hand = f"monitors/{lab.watch(runs_on='hand', watch='update', **UPDATES)}"
    empty = lab.empty(9)
    (run,) = ok(client.post(f"{by_hand}/runs", json={"campaign": empty}))["items"]
    assert (run["state"], run["message"]) == ("refused", "the campaign has no FRFs")
    delete(lab, empty)
    change(client, by_hand, {"active": False})
    act, *_ = ok(client.get("audit-events"))["items"]
    assert (act["action"], act["detail"]) == (
        "monitor.change",
        {"was": {"active": True}, "now": {"active": False}},
    )


def test_monitors_come_worst_first(service: LocalService) -> None:
    with client_of(service, f"other {uuid4()}") as own:
        lab = Lab(service, own, runs_on="hand")
        names = {
            lab.monitor: "no data",
            lab.watch(runs_on="hand"): "normal",
            lab.watch(runs_on="hand"): "alarm",
        }
        engine = make_engine(service.settings.database_url)
        with make_sessions(engine).begin() as session:
            for key, state in names.items():
                set_state(session, session.get_one(Monitor, UUID(key)), state)
        engine.dispose()
        page = ok(own.get("monitors", params={"limit": 2}))
        rest = ok(own.get("monitors", params={"limit": 2, "cursor": page["next_cursor"]}))
        assert [m["state"] for m in (*page["items"], *rest["items"])] == [
            "alarm",
            "no data",
            "normal",
        ]
        assert rest["next_cursor"] is None
        assert [
            m["state"] for m in ok(own.get("monitors", params={"state": "alarm"}))["items"]
        ] == ["alarm"]


def change(api: httpx.Client, path: str, body: Any) -> None:
    etag = api.get(path).headers["ETag"]
    ok(api.patch(path, json=body, headers={"If-Match": etag}))


def delete(lab: Lab, campaign: str) -> None:
    """Delete a campaign, so that the next test finds the baseline alone."""
    ok(lab.api.delete(f"campaigns/{campaign}"), 204)
