"""The figure of a watched series: what it draws is what the judgement says, on the screen and in print."""

import json
from collections.abc import Sequence
from typing import Any

import pytest

from fecore.dynamics.damping_laws import RAYLEIGH, CaugheySeries, GeneralisedProportional
from fecore.trend import Watch
from service.compute.judging import Observation
from service.monitoring.runs import unit_of
from service.show.figures.paper import draw, render
from service.show.figures.screen import screen
from service.show.figures.trend import series_figure
from tests.support.judged import judged, observe, values


def document(watch: Watch, observations: Sequence[Observation]) -> dict[str, Any]:
    result = judged(observations, watch).document
    alarm = {"alarm_id": "A", "parameter": "Ex", "campaign_id": "8", "state": "alarm", "note": None}
    return {
        **result,
        "parameters": [{**row, "unit": unit_of(row["name"])} for row in result["parameters"]],
        "structure_name": "bridge",
        "monitor_name": "stringer",
        "campaigns": [{"campaign_id": o.campaign, "name": f"c{o.campaign}"} for o in observations],
        "alarms": [alarm, {**alarm, "state": "withdrawn"}],
    }


def test_the_figure_shows_the_series() -> None:
    watch = Watch({"Ex": "both"}, baseline=6, covariates=("temperature_c",))
    levels = [1.0] * 8 + [0.95] * 2
    given = document(watch, [observe(i, e, temperature_c=float(i % 5)) for i, e in enumerate(levels)])
    figure = series_figure(given, "Ex")
    shown = screen(figure)
    traces = {trace["name"]: trace for trace in shown["data"]}
    points = given["parameters"][0]["points"]
    corrected = traces["corrected for temperature"]
    assert corrected["y"] == [pytest.approx(1e-9 * p["corrected"]) for p in points]
    assert corrected["customdata"] == [str(i) for i in range(10)]
    assert corrected["error_y"]["array"] == [pytest.approx(1.959964e-9 * p["standard_deviation"]) for p in points]
    assert traces["raw"]["y"] == [pytest.approx(1e-9 * p["raw"]) for p in points]
    assert traces["alarm"]["customdata"] == [["A", "8"]]
    assert traces["chart, fall"]["y"][-1] == pytest.approx(-points[-1]["judged"]["chart"]["fall"])
    assert json.loads(render(figure, "plotly")) == shown
    outside = [p["judged"]["score"] < -given["parameters"][0]["limits"]["score"] for p in points if p["judged"]]
    beyond = [p["judged"]["residual"] < -p["judged"]["residual_limit"] for p in points if p["judged"]]
    assert outside == beyond == [False, False, True, True]


def test_the_figure_is_printed_as_it_is() -> None:
    given = document(Watch({"Ex": "fall"}, baseline=6), values(*[1.0] * 8, 0.95, 0.95))
    figure = series_figure(given, "Ex")
    above, below = draw(figure).axes
    assert above.get_ylabel() == "Ex [GPa]"
    chart = next(line for line in below.lines if len(line.get_ydata()) == 4)
    drawn = next(t["y"] for t in screen(figure)["data"] if t["name"] == "chart, fall")
    assert list(chart.get_ydata()) == pytest.approx(drawn, rel=1e-6)  # printed to seven digits
    assert len(above.collections) >= 3  # estimates, their intervals, the alarm, the baseline's band
    for file_format in ("svg", "png", "pdf"):
        assert render(figure, file_format) == render(figure, file_format)


def test_names_are_drawn_as_they_are() -> None:
    """Neither TeX, which matplotlib would read between dollars, nor markup, which Plotly would."""
    given = document(Watch({"Ex": "fall"}, baseline=6), values(*[1.0] * 8, 0.95, 0.95))
    given |= {"structure_name": r"$\frac{1 and $x_{ <b>", "monitor_name": "m" * 200}
    figure = series_figure(given, "Ex")
    title = screen(figure)["layout"]["title"]["text"]
    assert title == r"$\frac{1 and $x_{ &lt;b&gt; – " + "m" * 49 + "…: Ex (alarm)"
    assert draw(figure).get_suptitle() == title.replace("&lt;", "<").replace("&gt;", ">")
    for file_format in ("svg", "png", "pdf"):
        assert len(render(figure, file_format)) > 10_000


@pytest.mark.parametrize(
    ("parameter", "label", "factor"),
    [("a1", "a1 [µs]", 1e6), ("frequency_2", "frequency_2 [Hz]", 1), ("damping_ratio_2", "damping_ratio_2 [%]", 100)],
)
def test_axes_have_units(parameter: str, label: str, factor: float) -> None:
    given = document(Watch({"Ex": "fall"}, baseline=6), values(*[1.0] * 8))
    row = {**given["parameters"][0], "name": parameter, "unit": unit_of(parameter)}
    figure = screen(series_figure({**given, "parameters": [row], "alarms": []}, parameter))
    assert figure["layout"]["yaxis"]["title"]["text"] == label
    assert "UTC" in figure["layout"]["xaxis"]["title"]["text"]
    assert figure["data"][0]["y"] == [pytest.approx(factor * p["raw"]) for p in row["points"]]


def test_units_are_those_of_the_results() -> None:
    laws = (RAYLEIGH, CaugheySeries("caughey4", (0, 1, 2, 3)), GeneralisedProportional(("constant", "root"), 1.0))
    for law in laws:
        for name, unit in zip(law.coefficient_names, law.coefficient_units, strict=True):
            assert unit_of(name) == unit
    assert [unit_of(name) for name in ("Ex", "nu_xy", "density", "zeta3", "spring")] == ["Pa", "1", "kg/m³", "1", None]


def test_the_figure_of_nothing_says_so() -> None:
    figure = series_figure({**document(Watch({"Ex": "fall"}), values(1.0)), "parameters": []}, "Ex")
    shown = screen(figure)
    assert shown["data"] == []
    assert shown["layout"]["annotations"][0]["text"] == "no campaign has been judged yet"
    assert render(figure, "svg").startswith(b"<?xml")
