"""Monitors of modes: nothing of a finite element model is asked for, and any number of covariates
goes out.
"""

import io
import json
import re
from collections.abc import Iterator, Sequence
from typing import Any
from uuid import uuid4

import httpx
import numpy as np
import pytest

from benchmarks.tracks import BASELINE, CHANGE, COVARIATES, HZ, make
from examples.monitoring import State, measured_frfs, post_campaign
from fecore.trend import ModesOfRun
from service.app.supervisor import LocalService
from tests.reality.test_tower import FAMILIES, runs_of_the_tower
from tests.support.rest import RAW, client_of, finished, ok, session_client
from tests.support.tables import parquet_rows
from tests.support.waiting import until


@pytest.fixture(scope="module")
def client(service: LocalService) -> Iterator[httpx.Client]:
    with client_of(service, f"laboratory {uuid4()}") as client:
        yield client


def new_structure(api: httpx.Client, name: str) -> str:
    project = ok(api.post("projects", json={"name": name}), 201)["id"]
    # no geometry, no material
    return str(ok(api.post(f"projects/{project}/structures", json={"name": name}), 201)["id"])


def type_in(api: httpx.Client, structure: str, runs: Sequence[ModesOfRun]) -> list[str]:
    """A campaign with a mode set of each run; their ids."""
    ids = []
    for run in runs:
        body = {
            "name": f"run {run.label}",
            "boundary": "as_modelled",
            "performed_at": run.performed_at.isoformat(),
            "covariates": dict(run.covariates),
        }
        campaign = ok(api.post(f"structures/{structure}/campaigns", json=body), 201)["id"]
        modes = [
            {
                "frequency_hz": mode.frequency_hz,
                "frequency_sd_hz": mode.frequency_sd_hz,
                "damping_ratio": mode.damping_ratio,
                # one beyond says nothing, and no mode set takes it
                "damping_sd": min(mode.damping_sd or 1.0, 0.99),
                "shape": [
                    {"point": p, "direction": d, "real": v.real, "imag": v.imag}
                    for (p, d), v in mode.shape.items()
                ],
            }
            for mode in run.modes
        ]
        ok(
            api.post(f"campaigns/{campaign}/mode-sets", json={"name": "ambient", "modes": modes}),
            201,
        )
        ids.append(str(campaign))
    return ids


def judged(api: httpx.Client, monitor: str, campaigns: int) -> Any:
    """The series, once so many runs are judged."""

    def so() -> Any:
        series = ok(api.get(f"monitors/{monitor}/series"))
        done = sum(each["state"] != "running" for each in series["campaigns"])
        judgement = series["judgement"]
        settled = judgement is not None and judgement["status"] == "succeeded"
        return series if done == campaigns and settled and series["parameters"] else None

    return until(so, "the series", lambda: ok(api.get(f"monitors/{monitor}/runs"))["items"][:3])


def watch(api: httpx.Client, structure: str, **fields: Any) -> str:
    body = {"name": "deck", "watch": "modes", **fields}
    return str(ok(api.post(f"structures/{structure}/monitors", json=body), 201)["id"])


def test_a_change_of_one_percent_raises_one_alarm_that_the_page_explains(
    client: httpx.Client, service: LocalService
) -> None:
    structure = new_structure(client, "footbridge")
    made = make(np.random.default_rng(2), -0.01).runs
    runs = [run for run in made if 10 <= int(run.label) < BASELINE + CHANGE + 4]
    type_in(client, structure, runs)
    monitor = watch(
        client,
        structure,
        baseline={"campaigns": BASELINE - 20},
        covariates=[*COVARIATES],
        horizon=40,
        runs_on="hand",
    )
    ok(client.post(f"monitors/{monitor}/runs", json={}), 202)
    series = judged(client, monitor, len(runs))
    names = [each["name"] for each in series["parameters"]]
    assert names == [f"{kind}_{n}" for n in range(1, 6) for kind in ("frequency", "damping_ratio")]
    assert series["parameters"][0]["unit"] == "Hz"
    assert series["parameters"][0]["baseline"]["mean"] == pytest.approx(HZ[0], rel=0.01)
    taken_out = {each["name"] for each in series["parameters"][0]["baseline"]["covariates"]}
    assert taken_out == set(COVARIATES)
    assert any(len(each["points"]) < len(runs) for each in series["parameters"])  # gaps
    assert set(series["campaigns"][0]["covariates"]) == set(COVARIATES)
    (raised,) = {each["parameter"] for each in series["alarms"]}
    assert raised.startswith("frequency_")
    first = min(series["alarms"], key=lambda each: str(each["performed_at"]))
    at = next(each for each in series["campaigns"] if each["campaign_id"] == first["campaign_id"])
    assert BASELINE + CHANGE <= int(at["name"].split()[1]) <= BASELINE + CHANGE + 3
    (alarm, *_) = ok(client.get("alarms", params={"monitor": monitor}))["items"]
    assert alarm["details"]["explanations"]["ranked"][0]["kind"] == "one"
    text = alarm["details"]["explanations"]["text"]
    fell, sd = re.search(rf"one mode alone: {raised} (\S+) ± (\S+) %", text).groups()
    assert abs(float(fell) + 1) < 2 * float(sd) < 0.4
    rows = ok(client.get(f"monitors/{monitor}/series/rows", params={"parameter": raised}))["items"]
    assert [row["value"] for row in rows] == [
        point["raw"]
        for each in series["parameters"]
        if each["name"] == raised
        for point in each["points"]
    ]
    query = {"parameter": raised, "format": "parquet"}
    content = client.get(f"monitors/{monitor}/series/rows", params=query).content
    assert [row["value"] for row in parquet_rows(content)] == [row["value"] for row in rows]
    first = client.get(f"monitors/{monitor}/series/rows", params={**query, "limit": len(rows) - 2})
    rest = client.get(f"monitors/{monitor}/series/rows{first.links['next']['url']}")
    both = parquet_rows(first.content) + parquet_rows(rest.content)
    assert [row["value"] for row in both] == [row["value"] for row in rows]
    assert {*COVARIATES, "time", "low", "high", "corrected", "outside"} <= rows[-1].keys()
    with session_client(client, base=service.url) as browser:
        query = {"show": ["frequency_2", raised], "over": COVARIATES[0]}
        page = browser.get(f"ui/monitors/{monitor}", params=query).text
    assert page.count("one mode alone") == 2  # what moved, and what to look at
    assert f">{at['name']}</a>" in page
    for name in (raised, "frequency_2"):
        assert f"parameter={name}&amp;over={COVARIATES[0]}" in page
    for figure in ({"parameter": "frequency"}, {"parameter": raised, "over": COVARIATES[0]}):
        drawn = ok(client.get(f"monitors/{monitor}/series/figure", params=figure))
        assert len(drawn["data"]) > 2
    unknown = {"parameter": raised, "over": "snow_m"}
    wrong = ok(client.get(f"monitors/{monitor}/series/figure", params=unknown), 422)["errors"]
    assert (
        f"stated by none of these campaigns; {', '.join(sorted(COVARIATES))}" in wrong[0]["detail"]
    )
    shown = ok(client.get(f"monitors/{monitor}"))
    assert (shown["watch"], shown["state"], shown["recipe"]) == ("modes", "alarm", {})
    assert [each["name"] for each in shown["parameters"]] == ["frequency", "damping_ratio"]


def test_frfs_are_identified_and_typed_modes_of_other_days_follow_theirs(
    client: httpx.Client,
) -> None:
    structure = new_structure(client, "beam")
    monitor = watch(client, structure, baseline={"campaigns": 4})
    days = [
        {"name": f"day {n}", "performed_at": f"2024-01-1{n}T10:00:00Z", "boundary": "cantilever"}
        for n in range(4)
    ]
    for number, body in enumerate(days[:2]):
        values = measured_frfs(State(stiffness=1.0), number)
        campaign = post_campaign(client, structure, body, values)
    (found,) = until(
        lambda: ok(client.get(f"campaigns/{campaign}/mode-sets"))["items"], "the modes"
    )
    names = ("frequency_hz", "frequency_sd_hz", "damping_ratio", "damping_sd", "shape")
    typed = [{name: mode[name] for name in names} for mode in found["modes"]]
    for body in days[2:]:
        campaign = ok(client.post(f"structures/{structure}/campaigns", json=body), 201)["id"]
        of_day = {"name": "typed", "modes": typed}
        ok(client.post(f"campaigns/{campaign}/mode-sets", json=of_day), 201)
        ok(client.post(f"campaigns/{campaign}/complete"))

    def followed() -> Any:
        series = judged(client, monitor, 4)
        first = next(each for each in series["parameters"] if each["name"] == "frequency_1")
        return (series, first) if len(first["points"]) == 4 else None

    series, first = until(followed, "the fourth day")
    assert {each["state"] for each in series["campaigns"]} == {"succeeded"}
    assert [bool(each["job_id"]) for each in series["campaigns"]] == [True, True, False, False]
    assert not any(each["update_job_id"] for each in series["campaigns"])
    assert first["points"][0]["standard_deviation"] > 0
    assert first["baseline"]["mean"] == pytest.approx(first["points"][3]["raw"], rel=1e-3)


def test_a_recording_without_a_force_is_processed_and_identified(client: httpx.Client) -> None:
    rng, rate, file = np.random.default_rng(1), 50.0, io.BytesIO()
    recording = rng.standard_normal((3, 30_000))
    decay = np.exp(-0.6 * np.arange(1000) / rate)
    for hz, shape in ((3.0, (1.0, 0.6, -0.4)), (8.0, (0.8, -0.7, 1.0))):
        response = decay * np.cos(2 * np.pi * hz * np.arange(1000) / rate)
        modal = np.convolve(rng.standard_normal(30_000), response)[:30_000]
        recording += np.outer(shape, modal)
    np.savez(file, a_1=recording[0], a_2=recording[1], a_3=recording[2])
    channel = {"quantity": "acceleration", "sensitivity": 1, "direction": 3}
    mapping = {
        "recording": {},
        "sample_rate_hz": rate,
        "channels": [{**channel, "variable": f"a_{n}", "point": n} for n in (1, 2, 3)],
    }
    structure = new_structure(client, "mast")
    monitor = watch(client, structure, baseline={"campaigns": 4})
    body = {"name": "night", "boundary": "free", "performed_at": "2026-11-02T03:00:00Z"}
    campaign = ok(client.post(f"structures/{structure}/campaigns", json=body), 201)["id"]
    sent = client.post(
        f"campaigns/{campaign}/imports",
        content=file.getvalue(),
        params={"filename": "night.npz", "mapping": json.dumps(mapping)},
        headers=RAW,
    )
    assert finished(client, sent.headers["Location"])["status"] == "succeeded"
    ok(client.post(f"campaigns/{campaign}/complete"))

    def ran() -> Any:
        runs = ok(client.get(f"monitors/{monitor}/runs"))["items"]
        return runs if runs and runs[0]["state"] != "running" else None

    (run,) = until(ran, "the run")
    assert run["state"] == "succeeded", run
    modes = ok(client.get(f"campaigns/{campaign}/mode-sets"))["items"][0]
    assert modes["excitation"] == "unmeasured"
    assert [mode["frequency_hz"] for mode in modes["modes"]] == pytest.approx([3, 8], rel=0.01)
    # all of it up to the lines' end, whose share of the sampling rate is 1/2.56: noise of 1 is white
    noise = 2 / 2.56
    expected = np.sqrt((recording**2).mean() - 1 + noise)
    amplitude = {"amplitude_rms_m_s2": pytest.approx(expected, rel=0.03)}  # a modal part lies above
    assert modes["details"]["amplitude"] == amplitude
    (shown,) = ok(client.get(f"monitors/{monitor}/series"))["campaigns"]
    assert shown["covariates"] == amplitude


@pytest.mark.parametrize(
    ("fields", "names"),
    [
        ({"recipe": {"seed": 5}}, "recipe"),
        ({"priors": "last"}, "priors"),
        ({"parameters": [{"name": "Ex"}]}, "Ex"),
        ({"parameters": [{"name": "frequency"}, {"name": "frequency_2"}]}, "frequency_2"),
        ({"covariates": ["wind"]}, "wind"),
        ({"watch": "update", "parameters": [{"name": "frequency"}]}, "frequency"),
    ],
)
def test_what_a_monitor_of_modes_does_not_take_is_named(
    client: httpx.Client, fields: dict[str, Any], names: str
) -> None:
    structure = new_structure(client, f"refusing {uuid4()}")
    body = {"name": "deck", "watch": "modes", **fields}
    answer = client.post(f"structures/{structure}/monitors", json=body)
    assert answer.status_code == 422
    assert names in answer.text


def test_covariates_of_a_campaign_have_names_with_units(client: httpx.Client) -> None:
    structure = new_structure(client, "windy")
    body = {"name": "a", "boundary": "free"}
    address = f"structures/{structure}/campaigns"
    named = {"wind_m_s": 4.2, "temperature_deck_c": 11}
    made = ok(client.post(address, json={**body, "covariates": {**named, "temperature_c": 3}}), 201)
    assert (made["covariates"], made["temperature_c"]) == (named, 3)
    for wrong in ({"wind": 4.2}, {"wind_m_s": "strong"}, {"_m_s": 1}, {"wind_m_s": None}):
        assert client.post(address, json={**body, "covariates": wrong}).status_code == 422
    twice = {**body, "temperature_c": 4, "covariates": {"temperature_c": 3}}
    assert client.post(address, json=twice).status_code == 422


@pytest.mark.long
def test_five_modes_of_a_tower_are_watched(client: httpx.Client) -> None:
    """Runs that another code identified, with gaps and company: in short those of `tests/reality`,
    and made ones above.
    """
    runs = runs_of_the_tower()[:60]
    structure = new_structure(client, "tower")
    type_in(client, structure, runs)
    monitor = watch(
        client,
        structure,
        baseline={"campaigns": 40},
        covariates=["temperature_1_c", "wind_m_s"],
        runs_on="hand",
    )
    ok(client.post(f"monitors/{monitor}/runs", json={}), 202)
    series = judged(client, monitor, len(runs))
    medians = [
        np.median([point["raw"] for point in each["points"]])
        for each in series["parameters"]
        if each["name"].startswith("frequency")
    ]
    assert all(any(low < hz < high for hz in medians) for low, high in FAMILIES)
    assert series["alarms"] == []
