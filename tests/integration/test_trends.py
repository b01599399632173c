"""Trends of what a search found: constants and tracked modes over time and temperature; figures,
files, page, command.
"""

import csv
import io
import json
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from math import cos, pi, sin
from pathlib import Path
from typing import Any
from uuid import uuid4

import httpx
import psycopg
import pytest
from hypothesis import strategies as st

import modalbase
from modalbase.client.errors import ClientError
from service.app.supervisor import LocalService
from service.nouns.updates.document import VERSION
from service.platform.db.engine import psycopg_url
from tests.support.command import modalbase_here
from tests.support.laboratory import BEAM
from tests.support.lengths import STRANGE, fuzz, long
from tests.support.rest import client_of, ok, session_client

YEARS, MONTHS = 1, 12
LOSS, PER_KELVIN = -0.012, -0.002  # a year, 1/K: what is made, and must be found


def degrees(month: int) -> float:
    return 12 + 14 * cos(2 * pi * month / 12) + 3 * sin(5.0 * month)


def factor(month: int) -> float:
    """Of all stiffnesses: ageing, temperature, and what a laboratory does not repeat."""
    return 1 + LOSS * month / 12 + PER_KELVIN * (degrees(month) - 12) + 0.0005 * sin(17.0 * month)


def shape(order: int) -> list[dict[str, Any]]:
    return [
        {"point": n, "direction": 3, "real": sin(order * pi * n / 10), "imag": 0.0}
        for n in range(1, 10)
    ]


@pytest.fixture(scope="module")
def api(service: LocalService) -> Iterator[httpx.Client]:
    """A client of one user for all tests here, which change nothing that another looks at."""
    with client_of(service, f"trends {uuid4()}") as client:
        yield client


@pytest.fixture(scope="module")
def bridge(api: httpx.Client) -> str:
    """A structure with monthly campaigns: two modes that cross as the second falls, in ascending
    order of frequency.
    """
    project = ok(api.post("projects", json={"name": "bridges"}), 201)["id"]
    made = ok(api.post(f"projects/{project}/structures", json={**BEAM, "name": "footbridge"}), 201)
    for month in range(MONTHS):
        at = datetime(2023, 1, 15, tzinfo=UTC) + timedelta(days=365.25 / 12 * month)
        body = {
            "name": f"month {month}",
            "boundary": "free",
            "performed_at": at.isoformat(),
            "temperature_c": degrees(month),
            "covariates": {"wind_m_s": 4 + sin(3.0 * month)} if month else {},
        }
        campaign = ok(api.post(f"structures/{made['id']}/campaigns", json=body), 201)["id"]
        hz = factor(month) ** 0.5
        modes = [
            {
                "frequency_hz": 5.0 * hz,
                "damping_ratio": 0.01,
                "frequency_sd_hz": 0.002,
                "shape": shape(1),
            },
            {
                "frequency_hz": 5.2 * hz - 0.02 * month,
                "damping_ratio": 0.012,
                "frequency_sd_hz": 0.002,
                "shape": shape(2),
            },
        ]
        ok(api.post(f"campaigns/{campaign}/mode-sets", json={"name": "typed", "modes": modes}), 201)
    return str(made["id"])


def test_modes_are_tracked_through_a_crossing(api: httpx.Client, bridge: str) -> None:
    trend = ok(api.get("search/modes/trend", params={"filter": f"structure.id = '{bridge}'"}), 200)
    assert (trend["value"], trend["unit"], trend["notes"]) == ("frequency_hz", "Hz", [])
    first, second = trend["series"]
    assert {point["number"] for point in second["points"]} == {1, 2}
    for month, point in enumerate(first["points"]):
        assert point["value"] == pytest.approx(5.0 * factor(month) ** 0.5)
    plain, beside = first["lines"]
    assert (plain["covariates"], beside["covariates"]) == ([], ["temperature_c"])
    low, high = beside["relative_interval_95"]
    assert low < LOSS / 2 < high  # a frequency is the root of a stiffness
    assert high - low < 0.5 * (plain["relative_interval_95"][1] - plain["relative_interval_95"][0])
    effect, sd = beside["effects"]["temperature_c"]
    assert effect / 5.0 == pytest.approx(PER_KELVIN / 2, abs=3 * sd / 5.0 + 2e-5)
    assert (first["time_unit"], first["time_unit_years"]) == ("year", 1)


def test_covariates_by_name_are_fitted_beside_time(api: httpx.Client, bridge: str) -> None:
    query = {"filter": f"structure.id = '{bridge}'", "covariates": "wind_m_s,temperature_c"}
    (first, _) = ok(api.get("search/modes/trend", params=query))["series"]
    line = first["lines"][1]
    assert (line["covariates"], line["campaigns"]) == (["wind_m_s", "temperature_c"], MONTHS - 1)
    assert [point["covariates"]["wind_m_s"] for point in first["points"]][:2] == [None, 4 + sin(3)]
    table = api.get("search/modes/trend", params={**query, "format": "csv"}).text
    assert table.splitlines()[0].endswith(",corrected,wind_m_s")
    figure = ok(api.get("search/modes/trend/figure", params=query))
    assert "wind [m/s]" in json.dumps(figure["layout"])


def test_a_trend_is_a_table_and_a_figure(api: httpx.Client, bridge: str) -> None:
    query = {"filter": f"structure.id = '{bridge}' AND frequency_hz < 5.05"}
    answer = api.get(
        "search/modes/trend", params={**query, "format": "csv", "value": "damping_ratio"}
    )
    rows = list(csv.DictReader(io.StringIO(answer.text)))
    assert answer.headers["content-type"].startswith("text/csv")
    assert {"structure", "series", "performed_at", "temperature_c", "value", "corrected"} <= rows[
        0
    ].keys()
    assert {row["structure"] for row in rows} == {"footbridge"}
    figure = ok(api.get("search/modes/trend/figure", params=query), 200)
    assert "footbridge" in json.dumps(figure["layout"]["title"])
    assert len(figure["data"]) >= 4
    over, below = (figure["layout"][axis]["domain"] for axis in ("yaxis", "yaxis2"))
    assert over[0] > below[1]
    assert api.get(
        "search/modes/trend/figure", params={**query, "format": "svg"}
    ).content.startswith(b"<?xml")


REFUSED = [
    ("modes", {"value": "Ex"}, "value", "frequency_hz"),
    ("modes", {"covariates": "wind"}, "covariates", "end with its unit"),
    ("modes", {"filter": "nonsense = 1"}, "filter", "nearest"),
]


def test_what_cannot_be_followed_is_refused_in_words(api: httpx.Client, bridge: str) -> None:
    for noun, query, pointer, detail in REFUSED:
        answer = api.get(
            f"search/{noun}/trend", params={"filter": f"structure.id = '{bridge}'", **query}
        )
        assert answer.status_code == 422
        fault = answer.json()["errors"][0]
        assert (fault["pointer"], detail in fault["detail"]) == (pointer, True), fault


def test_nothing_found_is_no_fault(api: httpx.Client, project: str) -> None:
    for noun in ("results", "modes"):
        assert (
            ok(
                api.get(f"search/{noun}/trend", params={"filter": f"project.id = '{project}'"}), 200
            )["series"]
            == []
        )
        figure = ok(
            api.get(f"search/{noun}/trend/figure", params={"filter": f"project.id = '{project}'"}),
            200,
        )
        assert "nothing was found" in json.dumps(figure)


def read_page(service: LocalService, api: httpx.Client, path: str) -> str:
    with session_client(api, base=service.url) as browser:
        answer = browser.get(path)
    assert answer.status_code == 200, answer.text
    return answer.text


@pytest.fixture(scope="module")
def aged(api: httpx.Client, service: LocalService, bridge: str) -> str:
    """The same with a result for each month, the last has two: `flange.E1` ages, `Ex` is of the
    last alone.
    """
    campaigns = ok(api.get(f"structures/{bridge}/campaigns", params={"limit": 100}), 200)["items"]
    jobs = []
    for batch in (campaigns, campaigns[-1:]):
        body = {"jobs": [{"campaign_id": one["id"]} for one in batch]}
        jobs += ok(api.post("update-jobs", json=body), 202)["items"]
    for job in jobs:
        api.post(f"update-jobs/{job['id']}/cancel")
    with psycopg.connect(psycopg_url(service.settings.database_url)) as connection:
        for month, job in zip([*range(MONTHS), MONTHS - 1], jobs, strict=True):
            row = parameter("flange.E1", 30e9 * factor(month))
            document = {
                "version": VERSION,
                "parameters": [row, *([parameter("Ex", 33e9)] if month == MONTHS - 1 else [])],
            }
            constants = {
                "flange.E1": {
                    "estimate": row["estimate"],
                    "sd": 1e9,
                    "low": 0.9 * row["estimate"],
                    "high": None,
                }
            }
            values = [
                job["id"],
                campaigns[month]["id"],
                json.dumps(document),
                json.dumps(constants),
                33e9,
                32e9,
                34e9,
            ]
            connection.execute(
                "INSERT INTO update_results (id, campaign_id, document, constants, prediction, ex,"
                " ex_low, ex_high) VALUES (%s, %s, %s, %s, '', %s, %s, %s)",
                values,
            )
    return bridge


def parameter(name: str, value: float) -> dict[str, Any]:
    return {
        "name": name,
        "unit": "Pa",
        "estimate": value,
        "interval_95": [0.9 * value, 1.1 * value],
        "comparable": {"estimate": value, "standard_deviation": 1e-4 * value},
    }


def test_a_constant_of_a_set_is_followed_over_results(
    api: httpx.Client,
    service: LocalService,
    aged: str,
    tmp_path: Path,
    new_client: Callable[[], httpx.Client],
) -> None:
    condition = f"structure.id = '{aged}'"
    trend = ok(
        api.get("search/results/trend", params={"filter": condition, "value": "flange.E1"}), 200
    )
    (series,) = trend["series"]
    assert (trend["unit"], len(series["points"])) == ("Pa", MONTHS)
    assert trend["notes"] == ["1 left out, as the campaign has a newer one that is found"]
    low, high = series["lines"][1]["relative_interval_95"]
    assert low < LOSS / (1 + LOSS * YEARS / 2) < high
    (one,) = ok(api.get("search/results/trend", params={"filter": condition}), 200)["series"]
    assert (len(one["points"]), one["lines"], len(one["notes"])) == (1, [], 2)
    answer = api.get("search/results/trend", params={"filter": condition, "value": "flange.E2"})
    assert "there is Ex, flange.E1" in answer.json()["errors"][0]["detail"]
    assert (
        ok(new_client().get("search/results/trend", params={"filter": condition}), 200)["series"]
        == []
    )  # others see nothing

    page = read_page(service, api, "/ui/search?noun=results&trend=flange.E1&for=" + condition)
    assert "beside temperature" in page
    assert page.count("data-figure=") == 2
    figure = ok(api.get("search/results/figure", params={"filter": condition}), 200)
    assert "13 results" in json.dumps(figure["layout"]["title"])
    key = api.headers["Authorization"].removeprefix("Bearer ")
    with modalbase.connect(service.url, key) as lab:
        results = lab.find("results", condition)
        assert "footbridge" in str(results.trend("flange.E1"))
        frame = results.trend("flange.E1").to_pandas()
        assert frame["corrected"].std() < frame["value"].std()
        assert (
            results.trend("flange.E1").figure().save(tmp_path / "trend.pdf").stat().st_size > 1000
        )
        assert results.figure().save(tmp_path / "results.svg").stat().st_size > 1000
        with pytest.raises(ClientError, match="have no trend"):
            lab.find("campaigns").trend("Ex")

    place = {"MODALBASE_URL": service.url, "MODALBASE_API_KEY": key}
    shown = modalbase_here("find", "results", condition, "--trend", "flange.E1", **place)
    assert "beside temperature" in shown.stdout, shown.stderr
    modalbase_here(
        "find",
        "results",
        condition,
        "--trend",
        "flange.E1",
        "--out",
        str(tmp_path / "trend.csv"),
        **place,
    )
    assert len((tmp_path / "trend.csv").read_text(encoding="utf-8").splitlines()) == MONTHS + 1
    earlier = "UPDATE update_results SET document = '{\"version\": 2}' WHERE id = %s"
    with psycopg.connect(psycopg_url(service.settings.database_url)) as connection:
        connection.execute(earlier, [series["points"][0]["id"]])
    trend = ok(
        api.get("search/results/trend", params={"filter": condition, "value": "flange.E1"}), 200
    )
    assert len(trend["series"][0]["points"]) == MONTHS - 1
    assert trend["notes"][1] == "1 left out, as an earlier version stored it: run the update again"


def test_a_constant_of_a_set_is_searched(api: httpx.Client, aged: str) -> None:
    mine = f"structure.id = '{aged}' AND "

    def count(text: str) -> int:
        return int(ok(api.get("search/results", params={"filter": mine + text}), 200)["count"])

    softest = min(30e9 * factor(month) for month in range(MONTHS))
    assert count(f"flange.E1 <= {softest + 1}") == 2
    assert count(f"flange.E1 > {softest + 1}") == MONTHS - 1
    assert count("result.flange.E1_sd = 1e9 AND flange.E1_high IS NULL") == MONTHS + 1
    assert count("web.E1 IS NULL AND NOT web.E1 > 0") == 0
    shown = {
        "filter": mine + "flange.E1 > 0",
        "fields": "flange.E1,flange.E1_sd",
        "sort": "-flange.E1",
    }
    rows = ok(api.get("search/results", params=shown), 200)["items"]
    assert rows == sorted(rows, key=lambda row: -row["flange.E1"])
    answer = api.get("search/results", params={"filter": "flange.strength > 0"})
    assert "there is no field 'flange.strength'" in answer.json()["errors"][0]["detail"]


@pytest.fixture
def newcomer(new_client: Callable[[], httpx.Client]) -> httpx.Client:
    """Somebody who has nothing."""
    return new_client()


@pytest.mark.parametrize("examples", [25, long(250)])
def test_no_trend_is_an_error_of_the_service(newcomer: httpx.Client, examples: int) -> None:
    values = ["Ex", "frequency_hz", "damping_ratio", "flange.E1"]
    covariates = ["", "temperature_c,humidity_percent", "humidity_percent"]
    text = st.text(STRANGE, max_size=20)
    asked = st.fixed_dictionaries(
        {
            "value": st.one_of(st.sampled_from(values), text),
            "covariates": st.one_of(st.sampled_from(covariates), text),
        }
    )
    paths = [f"search/{n}/trend{end}" for n in ("results", "modes") for end in ("", "/figure")]

    def ask(of: tuple[str, dict[str, str]]) -> None:
        answer = newcomer.get(of[0], params=of[1])
        assert answer.status_code in (200, 422), answer.text

    fuzz(examples, st.tuples(st.sampled_from(paths), asked), ask)


def test_unusual_modes_are_followed(api: httpx.Client, project: str) -> None:
    """Extreme frequencies, shapes of nothing, campaigns of one moment, unknown climate: lines or
    notes, and no error.
    """
    structure = ok(api.post(f"projects/{project}/structures", json=BEAM), 201)["id"]
    nothing = [{"point": n, "direction": 3, "real": 0.0, "imag": 0.0} for n in range(1, 10)]
    # at a point that the other shapes do not have
    nothing.append({**nothing[0], "point": 99, "real": 1.0})
    for number, hz in enumerate([1e-3, 1e-3, 5.0, 5.0, 1e5, 1e5, 5.0, 5.0, 5.0]):
        body: dict[str, Any] = {
            "name": str(number),
            "boundary": "free",
            "performed_at": "2025-01-01T00:00:00Z",
        }
        body["temperature_c"] = None if number % 2 else 20.0
        campaign = ok(api.post(f"structures/{structure}/campaigns", json=body), 201)["id"]
        mode = {
            "frequency_hz": hz,
            "damping_ratio": 0.0,
            "frequency_sd_hz": 1e-12,
            "shape": nothing if number % 2 else shape(1),
        }
        ok(
            api.post(
                f"campaigns/{campaign}/mode-sets",
                json={"name": "typed", "modes": [mode, {"frequency_hz": hz}]},
            ),
            201,
        )
    query = {"filter": f"project.id = '{project}'"}
    for value in ("frequency_hz", "damping_ratio"):
        series = ok(api.get("search/modes/trend", params={**query, "value": value}), 200)["series"]
        assert sum(len(one["points"]) for one in series) == (18 if value == "frequency_hz" else 9)
        assert all(one["notes"] for one in series)
        ok(api.get("search/modes/trend/figure", params={**query, "value": value}), 200)
        assert api.get(
            "search/modes/trend/figure", params={**query, "value": value, "format": "png"}
        ).is_success
