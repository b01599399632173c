"""Figures of an update: what they draw is what the result says, in every format; where there is
nothing to draw they say why.

One job, the demonstration's, is shared by all (`demo`).
"""

import io
import json
import re
from itertools import islice
from typing import Any
from urllib.parse import unquote
from uuid import uuid4

import numpy as np
import psycopg
import pytest

from service.app.supervisor import LocalService
from service.pages.numbers import minus
from tests.support.laboratory import Done
from tests.support.rest import finished, ok, plain_client, result_of, session_client

BEGINNINGS = {"plotly": b'{"data":', "svg": b"<?xml", "png": b"\x89PNG", "pdf": b"%PDF"}
EXACT = dict.fromkeys((
    "length_sd_m", "width_sd_m", "thickness_sd_m", "density_sd_kg_m3", "nu_xy_sd", "fibre_angle_sd_deg",
    "clamp_compliance_sd", "sensor_mass_sd_kg", "channel_delay_sd_s", "window_rate_per_s",
), 0)  # fmt: skip
"""Nothing that the laboratory states is in doubt, so that the samples are of the parameters
alone.
"""

FIGURE = 'width="672"'  # of a figure on the page of a report, pixels


def traces(figure: dict[str, Any], name: str) -> list[dict[str, Any]]:
    return [trace for trace in figure["data"] if trace["name"] == name]


def test_every_figure_is_listed_and_drawn_as_json_in_print_and_in_both_themes(demo: Done) -> None:
    """Each figure that is listed can be had, and each that cannot says why."""
    items = ok(demo.api.get(f"{demo.path}/figures"))["items"]
    assert [item["name"] for item in items if not item["available"]] == [
        "temperature",
        "stabilisation",
    ]  # one test, typed modes
    # of one figure each: they are drawn alike, and the report has every figure
    prints = iter(["svg", "png", "pdf"])
    for item in items:
        if not item["available"]:
            refused = demo.api.get(demo.address(item))
            assert (refused.status_code, refused.json()["detail"]) == (409, item["reason"])
            continue
        assert item["reason"] is None
        same = {"params": {"format": "plotly"}}
        drawn = demo.api.get(demo.address(item), **same)
        assert drawn.content.startswith(BEGINNINGS["plotly"]), (item["name"], drawn.text)
        for file_format in islice(prints, 1):
            answer = demo.api.get(demo.address(item), params={"format": file_format})
            assert answer.content.startswith(BEGINNINGS[file_format])
            assert (
                answer.headers["content-disposition"]
                == f'inline; filename="{item["name"]}.{file_format}"'
            )
        known = {"If-None-Match": drawn.headers["etag"]}
        assert demo.api.get(demo.address(item), headers=known, **same).status_code == 304
        light, dark = ok(drawn), ok(demo.api.get(demo.address(item), params={"theme": "dark"}))
        assert light["layout"]["paper_bgcolor"] != dark["layout"]["paper_bgcolor"]
        assert [trace.get("y") for trace in light["data"]] == [
            trace.get("y") for trace in dark["data"]
        ]


def test_a_prediction_is_sent_once_and_a_recipe_is_repeated(
    demo: Done, service: LocalService
) -> None:
    path = f"{demo.path}/frfs/data"
    first = demo.api.get(path, params={"format": "npz"})
    again = demo.api.get(
        path, params={"format": "npz"}, headers={"If-None-Match": first.headers["etag"]}
    )
    assert (first.status_code, again.status_code, again.content) == (200, 304, b"")
    campaign, job = (demo.result["provenance"][name] for name in ("campaign", "update_job"))
    with session_client(demo.api, base=service.url) as browser:
        form = browser.get(f"/ui/campaigns/{campaign}/update", params={"like": job})
    assert form.status_code == 200
    (start,) = re.findall(r"data-start='([^']+)'", form.text)
    assert json.loads(start)["mode_set"] == demo.result["provenance"]["mode_set"]


def test_the_frf_figure_draws_the_measured_and_the_predicted_values(demo: Done) -> None:
    point = demo.figure("frf")["layout"]["meta"]["points"][7]
    figure = demo.figure("frf", point=point)
    meta = figure["layout"]["meta"]
    chosen = {"point": meta["response"], "reference": meta["reference"], "format": "npz"}
    assert point in (meta["response"], meta["reference"])
    with np.load(
        io.BytesIO(demo.api.get(f"{demo.path}/frfs/data", params=chosen).content)
    ) as predicted:
        updated, frequency = predicted["values"][0], predicted["frequency_hz"]
    stored = demo.api.get(
        f"campaigns/{demo.result['provenance']['campaign']}/frfs/data", params=chosen
    )
    with np.load(io.BytesIO(stored.content)) as arrays:
        measured = arrays["values"][0]
    for name, values in (("measured", measured), ("updated", updated)):
        magnitude, phase = traces(figure, name)
        np.testing.assert_allclose(magnitude["x"], frequency, rtol=1e-6)
        # printed to five digits
        np.testing.assert_allclose(magnitude["y"], np.abs(values), rtol=1e-4)
        drawn = np.array([np.nan if y is None else y for y in phase["y"]])
        np.testing.assert_allclose(drawn[~np.isnan(drawn)], np.degrees(np.angle(values)), atol=0.06)
    low, high = demo.result["band_hz"]
    (cut,) = traces(demo.figure("frf", point=point, fmin=100, fmax=200), "measured")[:1]
    assert (cut["x"][0], cut["x"][-1]) == (100, 200)
    edges = {shape["x0"] for shape in figure["layout"]["shapes"]} | {
        shape["x1"] for shape in figure["layout"]["shapes"]
    }
    assert edges <= {low, high, frequency[0], frequency[-1]}


def test_matrix_and_parameters_are_the_results(demo: Done) -> None:
    (mac,) = demo.figure("mac")["data"]
    np.testing.assert_allclose(mac["z"], demo.result["correlation"]["mac_matrix"], rtol=1e-4)
    figure = demo.figure("parameters")
    drawn = {
        name: (place, low, high)
        for trace in traces(figure, "updated, 95 %") + traces(figure, "updated, not identifiable")
        for name, place, low, high in zip(
            trace["customdata"],
            trace["x"],
            trace["error_x"]["arrayminus"],
            trace["error_x"]["array"],
            strict=True,
        )
    }
    assert set(drawn) == {row["name"] for row in demo.result["parameters"]}
    for row in demo.result["parameters"]:
        place, low, high = drawn[row["name"]]
        share = 100 / (row["initial"] or row["estimate"])
        expected = [
            row["estimate"] * share,
            row["interval_95"][0] * share,
            row["interval_95"][1] * share,
        ]
        np.testing.assert_allclose([place, place - low, place + high], expected, rtol=1e-5)


def test_the_interval_lies_about_the_updated_frf_and_is_wide_where_it_is_not_sure(
    demo: Done,
) -> None:
    figure = demo.figure("frf")
    updated = np.array(traces(figure, "updated")[0]["y"])
    (high,) = traces(figure, "updated, 95 %")
    low = figure["data"][figure["data"].index(high) - 1]
    below, above = updated / np.array(low["y"]), np.array(high["y"]) / updated
    np.testing.assert_allclose(below, above, rtol=1e-3)  # a factor; four of five printed digits
    assert (above >= 1).all()
    hz = np.array(high["x"])
    resonance = demo.result["modes"][4]["updated_hz"]
    # A mode's frequency is sure to the discrepancy: next to its peak |H| is less sure than on the
    # slope far below it.
    near, far = (np.abs(hz - at).argmin() for at in (0.99 * resonance, 0.8 * resonance))
    assert above[near] - 1 > 2 * (above[far] - 1)


def test_correlation_by_line_and_by_point_is_the_results(demo: Done) -> None:
    correlation = demo.result["correlation"]
    for name in ("csac", "csf"):
        initial, updated = demo.figure(name)["data"]
        low, high = demo.result["band_hz"]
        assert low <= updated["x"][0] < updated["x"][-1] <= high
        assert np.mean(updated["y"]) == pytest.approx(correlation[f"{name}_mean"], abs=1e-4)
        assert np.mean(initial["y"]) == pytest.approx(
            correlation["initial"][f"{name}_mean"], abs=1e-4
        )
    data = demo.figure("sac")["data"]
    drawn = {(t["yaxis"], t["marker"]["symbol"]): t for t in data}
    for axis, name in (("y", "sac"), ("y2", "frac")):
        assert drawn[axis, "circle"]["marker"]["color"] == pytest.approx(
            correlation[name], abs=1e-4
        )
        held = correlation["held_out"]["frfs"]
        assert drawn[axis, "diamond"]["marker"]["color"] == pytest.approx(held[name], abs=1e-4)
        assert sorted(drawn[axis, "diamond"]["customdata"]) == held["points"]
    provenance = demo.result["provenance"]
    places = ok(
        demo.api.get(f"campaigns/{provenance['campaign']}/grid-points", params={"limit": 100})
    )["items"]
    at = {point["label"]: (point["x_m"], point["y_m"]) for point in places}
    circle = drawn["y", "circle"]
    assert [at[label] for label in circle["customdata"]] == [
        pytest.approx(place) for place in zip(circle["x"], circle["y"], strict=True)
    ]


def test_shapes_give_the_results_mac(demo: Done) -> None:
    meta = demo.figure("shapes")["layout"]["meta"]
    for mode, row in zip(meta["modes"], demo.result["modes"], strict=True):
        pairs = [
            pair
            for pair in zip(mode["measured"], mode["updated"], strict=True)
            if pair[0] is not None
        ]
        measured, updated = np.array(pairs).T
        assert max(np.abs(measured)) == pytest.approx(1)
        mac = (measured @ updated) ** 2 / (measured @ measured) / (updated @ updated)
        assert mac == pytest.approx(row["mac"], abs=2e-3)  # of the real part of the measured shape
    # A cell of the MAC is a pair of shapes, partners or not: its value is that of the shapes that
    # are drawn.
    (mac,) = demo.figure("mac")["data"]
    for row, column in ((0, 0), (1, 2)):
        number = dict(zip(("measured", "model"), mac["customdata"][row][column], strict=True))
        (mode,) = demo.figure("shapes", **number)["layout"]["meta"]["modes"]
        pairs = [
            pair
            for pair in zip(mode["measured"], mode["updated"], strict=True)
            if pair[0] is not None
        ]
        measured, updated = np.array(pairs).T
        expected = (measured @ updated) ** 2 / (measured @ measured) / (updated @ updated)
        assert expected == pytest.approx(mac["z"][row][column], abs=2e-3)
    (automac,) = demo.figure("automac")["data"]
    assert np.diag(automac["z"]) == pytest.approx(1)
    np.testing.assert_allclose(automac["z"], np.transpose(automac["z"]), atol=1e-6)


def test_budget_posterior_damping_and_convergence_are_the_results(demo: Done) -> None:
    budget = demo.figure("budget")["data"]
    # small shares are not listed
    assert np.sum([bar["x"] for bar in budget], axis=0) == pytest.approx(100, abs=0.5)
    noise = next(bar for bar in budget if bar["name"] == "model discrepancy")
    for name, share in zip(noise["customdata"], noise["x"], strict=True):
        row = next(row for row in demo.result["parameters"] if row["name"] == name)
        assert share == pytest.approx(
            sum(100 * e["share"] for e in row["budget"] if e["source"] == "model discrepancy"),
            abs=0.01,
        )
    corner = demo.figure("posterior")
    density = traces(corner, "updated")[0]
    area = np.trapezoid(density["y"], density["x"])
    ex = demo.result["parameters"][0]
    inside = (np.array(density["x"]) >= ex["interval_95"][0] / 1e9) & (
        np.array(density["x"]) <= ex["interval_95"][1] / 1e9
    )
    assert area == pytest.approx(1, abs=0.01)
    # Of 65 points, so that the sum is not the integral.
    assert np.trapezoid(np.where(inside, density["y"], 0), density["x"]) == pytest.approx(
        0.95, abs=0.03
    )
    measured = next(t for t in demo.figure("damping")["data"] if t["name"].startswith("measured"))
    assert measured["y"] == pytest.approx(
        [100 * mode["measured_damping"] for mode in demo.result["modes"]]
    )
    law = demo.result["damping_models"][0]
    curve = next(t for t in demo.figure("damping")["data"] if t["name"].startswith("rayleigh"))
    omega = 2 * np.pi * np.array(curve["x"])
    expected = 100 * (
        law["coefficients"]["a0"] / (2 * omega) + law["coefficients"]["a1"] * omega / 2
    )
    np.testing.assert_allclose(curve["y"], expected, rtol=1e-4)
    convergence = demo.figure("convergence")["data"]
    chosen = next(t for t in convergence if t["name"].endswith("chosen"))
    whole = ok(demo.api.get(f"{demo.path}/result", params={"include": "convergence"}))
    assert chosen["y"] == pytest.approx([step["cost"] for step in whole["convergence"]], rel=1e-6)


def test_sensitivities_say_which_mode_tells_of_which_parameter(demo: Done) -> None:
    (cells,) = demo.figure("sensitivities")["data"]
    names = demo.figure("sensitivities")["layout"]["yaxis"]["ticktext"]
    rows = {name.split()[0]: np.array(row) for name, row in zip(names, cells["z"], strict=True)}
    parameters = {row["name"]: row for row in demo.result["parameters"]}
    assert all(
        name.endswith("data" if parameters[name.split()[0]]["identifiable"] else "prior")
        for name in names
    )
    kinds = [mode["kind"] for mode in demo.result["modes"]]
    ex = parameters["Ex"]
    sd_of_log = np.sqrt(np.log1p((ex["prior_sd"] / ex["prior_mean"]) ** 2))
    # Of a slender strip f goes with √Ex in bending; its clamp and shear take a little of the strain
    # energy.
    bends = rows["Ex"][[kind == "bending" for kind in kinds]]
    np.testing.assert_allclose(bends, 100 * sd_of_log / 2, rtol=0.05)
    assert kinds[int(np.argmax(rows["Gxy"]))] == "torsion"
    assert rows["Gxy"].max() > 10 * rows["Ex"][int(np.argmax(rows["Gxy"]))]


def test_a_job_whose_damping_failed_draws_what_it_has_and_says_why_not_the_rest(demo: Done) -> None:
    provenance = demo.result["provenance"]
    # One mode in the band cannot fix the two coefficients of Rayleigh's law.
    recipe = {
        "mode_set": provenance["mode_set"],
        "damping_models": ["rayleigh"],
        "band_hz": [2, 60],
        "parameters": [{"name": "Ex"}, {"name": "Gxy"}],
    }
    answer = demo.api.post(f"campaigns/{provenance['campaign']}/update-jobs", json=recipe)
    assert finished(demo.api, answer.headers["Location"])["status"] == "succeeded"
    failed = Done(demo.api, result_of(demo.api, answer.headers["Location"]))
    assert {o["stage"]: o["status"] for o in failed.result["outcomes"]} == {
        "elastic": "succeeded",
        "damping": "failed",
    }
    items = {item["name"]: item for item in ok(demo.api.get(f"{failed.path}/figures"))["items"]}
    for name in (
        "parameters",
        "sensitivities",
        "budget",
        "posterior",
        "shapes",
        "mac",
        "automac",
        "comac",
        "convergence",
    ):
        assert items[name]["available"], name
    report = demo.api.get(f"{failed.path}/report").text
    assert "No FRF is predicted, as the damping was not fitted" in report
    assert report.count(FIGURE) == 9
    for name in ("frf", "csac", "csf", "fdac", "sac", "damping"):
        refused = demo.api.get(f"{failed.path}/figures/{name}")
        assert refused.status_code == 409
        assert "cannot fix the 2 coefficients" in refused.json()["detail"]


@pytest.mark.long
def test_every_figure_of_a_sampled_posterior_is_drawn_and_the_corner_shows_the_samples(
    demo: Done,
) -> None:
    """Samples are drawn nowhere else, and are held against the intervals of the result."""
    provenance = demo.result["provenance"]
    recipe = {
        "mode_set": provenance["mode_set"], "damping_models": ["rayleigh"], "posterior": "mcmc", "seed": 3,
        "parameters": [{"name": "Ex"}, {"name": "Gxy"}], "inputs": EXACT,
    }  # fmt: skip
    answer = demo.api.post(f"campaigns/{provenance['campaign']}/update-jobs", json=recipe)
    assert finished(demo.api, answer.headers["Location"])["status"] == "succeeded"
    sampled = Done(demo.api, result_of(demo.api, answer.headers["Location"]))
    items = {
        item["name"]: item["available"]
        for item in ok(demo.api.get(f"{sampled.path}/figures"))["items"]
    }
    assert [name for name, available in items.items() if not available] == [
        "temperature",
        "stabilisation",
    ]
    drawn = {name: sampled.figure(name) for name, available in items.items() if available}
    assert all(figure["data"] for figure in drawn.values())
    rows = {row["name"]: row for row in sampled.result["parameters"]}
    cloud = next(
        trace
        for trace in drawn["posterior"]["data"]
        if (trace["xaxis"], trace["yaxis"]) == ("x", "y2")
    )
    for axis, name in (("x", "Ex"), ("y", "Gxy")):
        values = 1e9 * np.array(cloud[axis])
        low, high = rows[name]["interval_95"]
        assert len(values) > 200
        # Of n independent samples 95 % lie in the interval, give or take four times their binomial
        # standard deviation.
        assert np.mean((values > low) & (values < high)) == pytest.approx(
            0.95, abs=4 * np.sqrt(0.95 * 0.05 / 200)
        )
    described = sampled.result["posterior"]
    places = [described["names"].index(name) for name in ("Ex", "Gxy")]
    stated = described["correlation"][places[0]][places[1]]
    seen = np.corrcoef(cloud["x"], cloud["y"])[0, 1]
    assert seen == pytest.approx(stated, abs=4 / np.sqrt(200))
    for name in ("parameters", "posterior"):
        assert demo.api.get(f"{sampled.path}/figures/{name}", params={"format": "svg"}).is_success


def test_the_report_says_what_the_result_says_and_stands_alone(demo: Done) -> None:
    """A report is read without the service beside it; paper has a test of its own."""
    page = demo.api.get(f"{demo.path}/report")
    assert page.headers["content-type"] == "text/html; charset=utf-8"
    assert "unsafe" not in page.headers["content-security-policy"]
    assert "<script" not in page.text
    assert not re.findall(r'(?:src|href)="(?!data:)', page.text)
    provenance = demo.result["provenance"]
    sentences = [
        demo.result["verdict"]["sentence"],
        *(finding["sentence"] for finding in demo.result["findings"]),
        *(finding["advice"] for finding in demo.result["findings"]),
    ]
    sentences += [
        provenance["update_job"],
        provenance["software"]["modalbase"],
        provenance["frfs"][-1]["sha256"],
    ]
    sentences += [
        "pultruded FRP beam",
        "Brüel &amp; Kjær",
        "cantilever",
        "checked by",
        "prior from coupon batch",
        "31.7",
    ]
    for words in sentences:
        shown = " ".join(words[:1].upper() + words[1:] for words in (words, "")).strip()
        assert minus(words) in page.text or minus(shown) in page.text, words
    # every figure but the stabilisation diagram and that of the parameters, which is their table
    assert page.text.count(FIGURE) == 15
    before_data, _, _ = page.text.partition(">Data<")
    words = re.sub(
        r"<[^>]*>", " ", re.sub(r'"data:[^"]*"|<style>.*</style>', "", before_data, flags=re.DOTALL)
    )
    assert not re.findall(
        r"\b(?:null|None|nan|[0-9a-f]{8}-[0-9a-f]{4}-.*|[0-9a-f]{32,})\b|[{}_`]", words
    )


def test_what_a_browser_opens_and_cannot_be_made_is_said_on_a_page(
    demo: Done, service: LocalService
) -> None:
    """A script gets the problem document of the same status and words, whatever went wrong."""
    looked_for = {"Accept": "text/html,application/xhtml+xml,application/xml;q=0.9,*/*;q=0.8"}
    job = demo.path.removeprefix("update-jobs/")
    expected = [
        (f"update-jobs/{uuid4()}/report?format=pdf", 404, "no update job"),
        (f"{demo.path}/figures/stabilisation?format=png", 409, "stabilisation diagram"),
        (f"{demo.path}/report?format=odt", 422, "format"),
        (f"{demo.path}/report?format=pdf", 500, "an unexpected error"),
    ]
    with (
        session_client(demo.api, base=service.url) as browser,
        psycopg.connect(service.settings.database_url, autocommit=True) as database,
    ):
        (kept,) = (
            database.execute(
                "SELECT prediction FROM update_results WHERE id = %s", [job]
            ).fetchone()
            or ()
        )
        damage = "UPDATE update_results SET prediction = %s WHERE id = %s"
        database.execute(damage, [b"no archive", job])
        try:
            answers = [
                browser.get(f"/api/v1/{path}", headers=looked_for) for path, _, _ in expected
            ]
            problems = [demo.api.get(path) for path, _, _ in expected]
        finally:
            database.execute(damage, [kept, job])
        for answer, problem, (path, status, words) in zip(answers, problems, expected, strict=True):
            assert (answer.status_code, problem.status_code) == (status, status), path
            assert answer.headers["content-type"] == "text/html; charset=utf-8", path
            assert problem.headers["content-type"] == "application/problem+json", path
            assert "script-src 'self'" in answer.headers["content-security-policy"]
            assert answer.headers["x-request-id"] in answer.text
            assert words in answer.text, path
            assert words in problem.text, path
    with plain_client(service.url) as nobody:
        report = f"/api/v1/{demo.path}/report?format=pdf"
        redirect = nobody.get(report, headers=looked_for)
        assert (redirect.status_code, unquote(redirect.headers["location"])) == (
            303,
            f"../../../../sign-in?next={report[1:]}",
        )
        assert nobody.get(report).status_code == 401


@pytest.mark.parametrize(
    ("name", "query", "status", "said"),
    [
        ("nonsense", {}, 404, "there are frf"),
        ("frf", {"point": 999}, 404, "there are points 1, 2"),
        ("frf", {"point": "x"}, 422, "point"),
        ("frf", {"fmin": 5000}, 422, "no line"),
        ("frf", {"fmin": 50, "fmax": 20}, 422, "above fmax"),
        ("mac", {"format": "gif"}, 422, "format"),
        ("shapes", {"measured": 99}, 404, "measured mode 99"),
    ],
)
def test_what_cannot_be_drawn_is_refused_in_words(
    demo: Done, name: str, query: dict[str, Any], status: int, said: str
) -> None:
    answer = demo.api.get(f"{demo.path}/figures/{name}", params=query)
    assert answer.status_code == status, answer.text
    assert said in answer.text
