"""A beam that works loose: eight campaigns over HTTP, one alarm, announced once, though a worker
dies over it; and the whole series as it was.
"""

import json
from datetime import UTC, datetime, timedelta

import httpx
import psycopg
import pytest

from examples.monitoring import State, measured_frfs, post_campaign, structure_body
from service.app.supervisor import LocalService
from service.platform.db.engine import psycopg_url
from tests.integration.test_monitoring import look_after
from tests.support.golden import check
from tests.support.receivers import receiver, signature_holds
from tests.support.rest import client_of, ok
from tests.support.waiting import until

MONITOR = {
    "name": "stringer",
    "recipe": {
        "identification": {"band_hz": [5, 500], "highest_order": 10},
        "damping_models": ["rayleigh"],
        "parameters": [{"name": "Ex"}, {"name": "Gxy"}],
    },
    "parameters": [{"name": "Ex"}, {"name": "a1"}],
    "baseline": {"campaigns": 5},
    "covariates": ["temperature_c"],
}
TEMPERATURE = (15.0, 22.0, None, 9.0, 18.0, 25.0, 17.0, None)
UNKNOWN = (2, 7)  # campaigns whose temperature nobody measured, in the baseline and after it
WHO = "who looks after the stringer"  # and has nothing else
LOOSE = 6  # first campaign with 4 % less stiffness


def campaign(api: httpx.Client, structure: str, number: int) -> str:
    temperature = TEMPERATURE[number]
    climate = 1 - 0.001 * ((15.0 if temperature is None else temperature) - 15.0)
    stiffness = 0.96 if number >= LOOSE else 1.0
    state = State(stiffness, climate, damping=1 + 0.01 * (number % 3))
    when = datetime(2024, 1, 15, 10, tzinfo=UTC) + timedelta(days=30 * number)
    body = {
        "name": f"campaign {number}",
        "performed_at": when.isoformat(),
        "temperature_c": temperature,
    }
    return post_campaign(api, structure, body, measured_frfs(state, number))


def kill_while_it_judges(service: LocalService, project: str) -> None:
    """SIGKILL to the worker in the middle of a judgement, whose result has to wait; another one is
    started, and takes over at once what a lease would keep for half a minute.
    """
    running = (
        "SELECT count(*) FROM jobs WHERE state = 'running' AND kind = 'judge' AND project_id = %s"
        " AND stage <> 'starting'"
    )
    silent = "UPDATE procrastinate_workers SET last_heartbeat = last_heartbeat - interval '1 day'"
    url = psycopg_url(service.settings.database_url)
    with psycopg.connect(url, autocommit=True) as beside, psycopg.connect(url) as holding:
        holding.execute("LOCK TABLE monitor_series IN SHARE MODE")
        until(
            lambda: beside.execute(running, [project]).fetchone()[0],
            "a judgement that runs",
        )
        service.processes["worker"].kill()
        service.processes["worker"].wait()
        beside.execute(silent)
    lines: list[str] = []
    until(
        lambda: lines.extend(service.tend()) or "the worker runs again" in lines,
        "another worker",
        lambda: lines,
    )


@pytest.mark.long
def test_one_alarm_told_once_though_a_worker_dies_over_it(service: LocalService) -> None:
    """An alarm is stored and sent once, whoever dies; its series is the golden one. In short alarms
    are raised once in `tests/integration/test_monitoring_judgement.py`, and workers die over other
    jobs.
    """
    with receiver() as hook, client_of(service, WHO) as api:
        project = ok(api.post("projects", json={"name": "bridge"}))["id"]
        structure = ok(api.post(f"projects/{project}/structures", json=structure_body()))["id"]
        monitor = ok(
            api.post(f"structures/{structure}/monitors", json={**MONITOR, "runs_on": "hand"})
        )["id"]
        secret = ok(api.post("webhooks", json={"project": project, "url": hook.url}))["secret"]
        made = [campaign(api, structure, number) for number in range(len(TEMPERATURE))]
        ok(api.post(f"monitors/{monitor}/runs", json={}))
        kill_while_it_judges(service, project)
        until(lambda: ok(api.get(f"monitors/{monitor}"))["state"] == "alarm", "the alarm")
        until(lambda: hook.got, "the message")
        check_series(api, monitor, made)
        acknowledge(api, monitor)
        look_after(service, monitor)
        until(
            lambda: ok(api.get(f"monitors/{monitor}"))["state"] == "acknowledged",
            "the acknowledgement",
        )
        hook.wait_for(2)
        documents = {
            "series": ok(api.get(f"monitors/{monitor}/series")),
            "monitor": ok(api.get(f"monitors/{monitor}")),
            "alarms": ok(api.get("alarms")),
            "figure": ok(api.get(f"monitors/{monitor}/series/figure", params={"parameter": "Ex"})),
        }
        jobs = ok(api.get("update-jobs"))["items"]
    assert len(jobs) == len(TEMPERATURE)
    assert {job["status"] for job in jobs} == {"succeeded"}
    assert [event["type"] for event in hook.events()] == ["alarm.raised", "alarm.acknowledged"]
    assert all(signature_holds(secret, *got) for got in hook.got)
    message = json.loads(hook.got[0][1])["data"]
    assert (message["alarm"]["parameter"], message["alarm"]["campaign_id"]) == ("Ex", made[LOOSE])
    assert message["monitor"]["id"] == monitor
    explained = message["alarm"]["details"]["explanations"]
    likely = [
        each["kind"]
        for each in explained["ranked"]
        if each["evidence"] > explained["ranked"][0]["evidence"] - 3
    ]
    assert "stiffness" in likely  # a clamp that yields looks nearly the same
    assert set(likely) <= {"stiffness", "support"}
    assert "What decides: " in explained["text"]
    check("monitor", documents)


def check_series(api: httpx.Client, monitor: str, made: list[str]) -> None:
    series = ok(api.get(f"monitors/{monitor}/series"))
    assert [c["campaign_id"] for c in series["campaigns"]] == made
    ex, a1 = series["parameters"]
    assert (ex["state"], a1["state"]) == ("alarm", "normal")
    assert ex["baseline"]["campaign_ids"] == [
        c for i, c in enumerate(made[:LOOSE]) if i != UNKNOWN[0]
    ]
    assert f"left out of the baseline, a covariate is missing: {made[UNKNOWN[0]]}" in ex["notes"]
    assert any(
        "a covariate was not measured" in note and made[UNKNOWN[1]] in note for note in ex["notes"]
    )
    (slope,) = ex["baseline"]["covariates"]
    assert slope["slope"] / 33.0e9 == pytest.approx(-0.001, rel=0.02)
    known, unknown = ex["points"][LOOSE:]
    assert known["corrected"] / ex["baseline"]["mean"] == pytest.approx(0.96, rel=1e-3)
    assert known["judged"]["outside"]
    # at any temperature of the baseline
    assert unknown["judged"]["residual_limit"] > 2 * known["judged"]["residual_limit"]
    drawn = api.get(
        f"monitors/{monitor}/series/figure", params={"parameter": "Ex", "format": "pdf"}
    )
    assert drawn.is_success, drawn.text
    assert drawn.content.startswith(b"%PDF")


def acknowledge(api: httpx.Client, monitor: str) -> None:
    (alarm,) = ok(api.get("alarms", params={"monitor": monitor}))["items"]
    seen = ok(api.post(f"alarms/{alarm['id']}/acknowledge", json={"note": "bolt 3 was loose"}))
    assert (seen["state"], seen["note"], seen["acknowledged_by"]) == (
        "acknowledged",
        "bolt 3 was loose",
        WHO,
    )
    assert [step["event"] for step in seen["history"]] == ["raised", "acknowledged"]
    assert api.post(f"alarms/{alarm['id']}/acknowledge", json={"note": "again"}).status_code == 409
