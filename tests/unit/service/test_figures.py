"""Figures of results that lack something, or have what few have: each panel, curve and mark is
there where there is data.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fecore.correlation import CRITERIA
from fecore.dynamics.damping_laws import RAYLEIGH, CaugheySeries, GeneralisedProportional
from fecore.trend import Watch
from service.figures.coupon import coupon_figure
from service.figures.frfs import (
    FrfCurves,
    HitShown,
    PointShown,
    PointValues,
    Spread,
    frf_figure,
    hits_figure,
    points_figure,
)
from service.figures.marks import Figure, Region
from service.figures.modes import MOST_ROWS, ShapePair, shapes_figure
from service.figures.paper import draw, render
from service.figures.screen import numbers, screen
from service.figures.temperature import temperature_figure
from service.figures.trend import series_figure
from service.figures.updates import OTHERS, budget_figure, parameters_figure
from service.nouns.monitors.runs import unit_of
from service.platform.errors import Conflict, NotFound
from service.reports.figure_data import FigureQuery, UpdateFigures, _row_at
from service.reports.figures import FIGURES, _shapes, draw_figure, draw_sheets
from service.tasks.judge.inputs import Observation
from tests.support.judged import judged, observe, values
from tests.support.lengths import long


def names(figure: Figure) -> list[str]:
    return [trace["name"] for trace in screen(figure)["data"] if trace["name"]]


HZ = np.linspace(10, 100, 7)
FRF = FrfCurves("point 3", "accelerance", HZ, np.exp(1j * HZ))


SURE = Spread(np.ones(7), np.ones(7))


@pytest.mark.parametrize(
    ("more", "panels", "shades"),
    [
        ({}, 2, 0), ({"coherence": np.ones(7)}, 3, 0), ({"measured": np.zeros(7, complex)}, 2, 0), ({"spread": SURE}, 2, 0),
        ({"band_hz": (20, 90)}, 2, 4), ({"held_band_hz": (30, 40)}, 2, 2),
        ({"models": {"updated": FRF.measured}, "spread": SURE}, 2, 0),
    ],
)  # fmt: skip
def test_an_frf_alone_with_coherence_with_models(
    more: dict[str, Any], panels: int, shades: int
) -> None:
    curves = replace(FRF, **more)
    figure = frf_figure(curves)
    assert len(figure.panels) == panels
    assert sum(isinstance(mark, Region) for mark in figure.marks) == shades
    of_models = (["updated, 95 %"], ["updated", "updated"]) if "models" in more else ([], [])
    assert names(figure) == [*of_models[0], "measured", "measured", *of_models[1]]
    assert (figure.panels[0].y.range is not None) == bool(curves.measured.any())


def a_point(mean: np.ndarray | None, coherence: np.ndarray | None) -> PointShown:
    hit = HitShown(
        1, good=True, why="", sentence="", force=np.ones(9), response=np.ones(9), frf=FRF.measured
    )
    return PointShown(
        "p", "acceleration", "accelerance", 100.0, HZ, (0.0, 0.01), [hit], mean, coherence
    )


def test_hits_with_and_without_an_average_and_its_coherence() -> None:
    none, one, both = (
        hits_figure(a_point(*given))
        for given in ((None, None), (HZ + 0j, None), (HZ + 0j, np.ones(7)))
    )
    assert ["average of the good hits" in names(figure) for figure in (none, one, both)] == [
        False,
        True,
        True,
    ]
    shown = [screen(figure) for figure in (none, one, both)]
    assert ["yaxis4" in figure["layout"] for figure in shown] == [False, False, True]
    assert [figure["data"][-1]["yaxis"] for figure in shown] == ["y3", "y3", "y4"]
    assert [figure["layout"]["xaxis3"]["anchor"] for figure in shown] == ["y3", "y3", "y4"]


def test_a_pulse_is_drawn_sample_by_sample_and_what_is_zoomed_to_too() -> None:
    """Half a sine of 0.6 ms among 65,536 samples is as wide as it was; what comes into view comes
    in full.
    """
    rate, count, begin = 51_200.0, 65_536, 0.01
    times = np.arange(count) / rate
    force = np.where(
        (times >= begin) & (times < begin + 6e-4), 100 * np.sin(np.pi * (times - begin) / 6e-4), 0.0
    )
    ringing = np.exp(-times) * np.sin(2 * np.pi * 700 * times)
    lines = np.linspace(0, rate / 2, count // 2 + 1)
    hit = HitShown(
        1, good=True, why="", sentence="", force=force, response=ringing, frf=1 / (700 - lines + 1j)
    )
    point = PointShown(
        "p", "acceleration", "accelerance", rate, lines, (begin, begin + 6e-4), [hit], None, None
    )

    def drawn(figure: Figure, number: int) -> tuple[np.ndarray, np.ndarray]:
        trace = screen(figure)["data"][number]
        return np.array(trace["x"]), np.array(trace["y"])

    ms, newtons = drawn(hits_figure(point), 0)
    above = ms[newtons > 50]
    # half of the sine is above half of its height
    assert above[-1] - above[0] == pytest.approx(0.4, abs=2e3 / rate)
    inside = (times >= begin) & (times <= begin + 6e-4)
    assert np.isin(np.round(1e3 * times[inside], 2), np.round(ms, 2)).all()
    assert ms.size < 2000
    low, high = 0.5, 0.51
    whole, near = (
        drawn(hits_figure(point, window), 1)[0] for window in ((None, None), (low, high))
    )
    seen = np.sum((times >= low) & (times <= high))
    assert np.sum((whole >= low) & (whole <= high)) < seen / 10
    assert np.sum((near >= low) & (near <= high)) >= seen
    close = drawn(hits_figure(point, hertz=(650, 750)), 2)[0]
    assert np.sum((close >= 650) & (close <= 750)) >= np.sum((lines >= 650) & (lines <= 750))


TENSION = {
    "area_m2": 1e-4, "chord_range": [0.001, 0.003], "modulus_pa": 50e9, "transition_strain": None, "poisson_ratio": None,
    "ultimate_strain": None, "strength_pa": 250e6,
}  # fmt: skip
SHEAR = TENSION | {
    "offset_strain": None, "offset_strength_pa": 30e6, "maximum_stress_strain": None, "maximum_stress_pa": 40e6
}  # fmt: skip


@pytest.mark.parametrize(
    ("shear", "found", "more"),
    [
        (False, {}, []),
        (False, {"transition_strain": 0.004}, ["transition"]),
        (False, {"ultimate_strain": 0.005}, ["strength, 250.0 MPa at 0.5 %"]),
        (False, {"poisson_ratio": 0.2}, ["Poisson's ratio ν = 0.200"]),
        (True, {}, []),
        (True, {"offset_strain": 0.003}, ["0.2 % offset, 30.0 MPa"]),
        (True, {"maximum_stress_strain": 0.005}, ["maximum, 40.0 MPa at 0.5 %"]),
    ],
)
def test_a_coupon_s_curve_has_what_its_standard_could_read_off(
    shear: bool, found: dict[str, Any], more: list[str]
) -> None:
    strain = np.linspace(0, 0.005, 50)
    series = {"strain": strain, "force": 5e6 * strain, "transverse_strain": -0.2 * strain}
    figure = coupon_figure("A1", series, (SHEAR if shear else TENSION) | found, shear=shear)
    assert names(figure)[3:] == more  # after the curve, its chord and the chord's bounds
    assert len(figure.panels) == (1 if shear else 2)


def test_constants_and_damping_over_temperature_have_a_panel_each() -> None:
    row = {"unit": "Pa", "law": None, "estimate": [2.0, 1.8], "low": [1.9, 1.7], "high": [2.1, 1.9]}
    rows = [{**row, "name": "Ex"}, {**row, "name": "a0", "law": "rayleigh"}]
    curve = {"reference_c": 20.0, "temperature_c": [20.0, 50.0], "constants": rows}
    shown = screen(temperature_figure(curve, [{"name": "Ex", "identifiable": True}]))
    axes = {trace["name"]: trace["yaxis"] for trace in shown["data"] if trace["name"]}
    assert axes == {"Ex": "y", "a0 (rayleigh)": "y2"}
    low, high = shown["layout"]["yaxis2"]["domain"], shown["layout"]["yaxis"]["domain"]
    assert low[1] < high[0]


def test_points_of_which_none_was_held_out_have_one_symbol() -> None:
    one = np.array([0.9])
    by_criterion = {CRITERIA[name]: one for name in ("sac", "frac")}
    for held, symbols in ((False, ["circle", "circle"]), (True, ["diamond", "diamond"])):
        figure = screen(
            points_figure(
                PointValues([3], one, one, by_criterion, [held]), (0.0, 1.0), (-0.05, 0.05)
            )
        )
        assert [trace["marker"]["symbol"] for trace in figure["data"]] == symbols


def a_row(**more: Any) -> dict[str, Any]:
    return {
        "name": "Ex", "unit": "Pa", "estimate": 2e9, "initial": 2e9, "standard_deviation": 1e8, "identifiable": True,
        "interval_95": [1.8e9, 2.2e9], "prior_mean": None, "prior_sd": None, "budget": [],
    } | more  # fmt: skip


def test_a_prior_is_drawn_where_there_was_one_and_small_sources_are_added_up() -> None:
    known = a_row(prior_mean=2e9, prior_sd=1e8)
    assert [names(parameters_figure([row], "t")) for row in (a_row(), known)] == [
        ["updated, 95 %"],
        ["prior, 95 %", "updated, 95 %"],
    ]
    for count, last in ((2, "s 1"), (12, OTHERS)):
        budget: list[dict[str, Any]] = [
            {"source": f"s_{k}", "share": (1 - 0.01 * k) / count} for k in range(count)
        ]
        figure = budget_figure([a_row(budget=budget)])
        assert names(figure)[-1] == last
        whole = 100 * sum(entry["share"] for entry in budget)
        assert sum(trace["x"][0] for trace in screen(figure)["data"]) == pytest.approx(
            whole, abs=0.01
        )  # of four digits each


def a_series(baseline: Any, score: float | None, judged: Any) -> dict[str, Any]:
    point = {
        "performed_at": "2026-03-02T12:00:00+00:00", "campaign_id": "c", "standard_deviation": 1e8, "raw": 2e9,
        "corrected": 2e9, "judged": judged,
    }  # fmt: skip
    row = a_row(
        state="ok",
        points=[point],
        baseline=baseline,
        direction="fall",
        limits={"score": score, "chart": 4.0},
    )
    return {
        "parameters": [row], "structure_name": "s", "monitor_name": "m", "alarms": [], "notes": [],
        "campaigns": [{"campaign_id": "c", "name": "March"}],
    }  # fmt: skip


def test_a_series_is_drawn_before_its_baseline_and_before_it_is_judged() -> None:
    baseline = {"mean": 2e9, "mean_sd": 1e7, "covariates": []}
    judged = {"residual_limit": 1e8, "chart": {"fall": 1.0}, "outside": True}
    steps = [
        names(series_figure(a_series(*given), "Ex"))
        for given in (
            (None, None, None),
            (baseline, 3.0, None),
            (baseline, None, judged),
            (baseline, 3.0, judged),
        )
    ]
    known, chart = ["estimate", "baseline, 95 %", "baseline"], ["chart, fall", "limit of the chart"]
    assert steps == [
        ["estimate"],
        known,
        [*known, *chart],
        [*known, "limit of one campaign", *chart],
    ]
    assert names(series_figure(a_series(None, None, None), "Gxy")) == []


def test_a_shape_without_measured_points_or_with_one_has_no_line() -> None:
    places = np.array([[0.0, 0.0], [1.0, 0.5]])  # in no row of a grid
    for measured in (np.zeros(0), np.array([1.0])):
        figure = screen(
            shapes_figure(
                [ShapePair(1, "m", "u", measured + 0j, np.array([1.0, -1.0]))], [7, 8], places
            )
        )
        of_mode = {
            mode: [trace for trace in figure["data"] if trace["mode"] == mode]
            for mode in ("lines", "markers")
        }
        assert len(of_mode["lines"]) == 2  # of the model's two points, at rest and moved
        assert all(len(trace["x"]) == 3 for trace in of_mode["lines"])
        assert [trace["customdata"] for trace in of_mode["markers"]] == (
            [[7], [7, 8]] if measured.size else [[7, 8]]
        )


def many_modes(count: int) -> UpdateFigures:
    """A result of so many measured modes, each with its partner in the model."""
    random = np.random.default_rng(count)
    modes = [
        {
            "number": k + 1,
            "measured_hz": 10.0 * k,
            "updated_hz": 10.0 * k,
            "mac": 1.0,
            "kind": "bending",
        }
        for k in range(count)
    ]
    shapes = random.standard_normal((count, 6))
    data = UpdateFigures(None, None)
    vars(data)["document"] = {"modes": modes, "provenance": {"frfs": []}}
    vars(data)["arrays"] = {
        "shapes_measured": shapes, "shapes_updated": shapes, "shape_pairs": np.array([(k, k) for k in range(count)]),
        "shape_points": np.arange(6), "shape_places_m": random.random((6, 2)),
    }  # fmt: skip
    return data


@pytest.mark.parametrize(
    ("count", "sheets"),
    [(1, [1]), (8, [8]), (9, [5, 4]), (16, [8, 8]), (40, [8] * 5), (41, [8] * 5)],
)
def test_shapes_of_many_modes_go_over_pages(count: int, sheets: list[int]) -> None:
    figures = draw_sheets(many_modes(count), "shapes")
    numbers = [[mode["number"] for mode in (figure.meta or {})["modes"]] for figure in figures]
    assert [len(rows) for rows in numbers] == sheets
    assert [number for rows in numbers for number in rows] == list(range(1, min(count, 40) + 1))
    assert max(sheets) <= MOST_ROWS
    if count == 41:
        assert draw_figure(FIGURES, many_modes(41), "shapes", FigureQuery()).title.endswith(
            "the first 40 of 41 pairs"
        )


# --- numbers of a figure are JSON, whatever was measured
# ----------------------------------------------------------------


def test_numbers_are_rounded_and_what_json_lacks_is_a_gap() -> None:
    given = [1.23456789, -6.02214076e23, 1e-320, 1e-300, 1.7e308, 0.0, math.nan, math.inf]
    rounded = numbers(given)
    assert rounded == [
        1.234568,
        pytest.approx(-6.022141e23),
        0.0,
        0.0,
        pytest.approx(1.7e308),
        0.0,
        None,
        None,
    ]
    json.dumps(rounded, allow_nan=False)


def a_result(arrays: dict[str, Any] | None = None, **document: Any) -> UpdateFigures:
    """What a job's figures are drawn from, as if it had been read."""
    data = UpdateFigures(None, None)
    vars(data).update(document=document, light=document, arrays=arrays or {})
    return data


NO_LINES = {"frequency_hz": np.zeros(0)}


OLDER = (
    "this result was computed by an earlier version, which kept no data for this figure; run the"
    " update again"
)


MODES = [{"number": 1, "measured_hz": 10.0}, {"number": 2, "measured_hz": 20.0}]


@pytest.mark.parametrize(
    ("name", "data", "why"),
    [
        ("frf", a_result(NO_LINES, outcomes=[]),
         "this update predicts no FRFs, because its damping was not fitted to any"),
        ("frf", a_result(NO_LINES, outcomes=[{"stage": "damping", "message": "no modes"}]),
         "this update predicts no FRFs, because its damping was not fitted to any: no modes"),
        ("csac", a_result({"frequency_hz": np.ones(3)}), OLDER),
        ("mac", a_result(correlation={"mac_matrix": None}), "the measured modes have no shapes, so there is no MAC"),
        ("sensitivities", a_result({"shape_points": np.zeros(0)}), OLDER),
        ("automac", a_result(correlation={"mac_matrix": [[1.0]]}), OLDER),
        ("shapes", a_result(provenance={"frfs": [{}]}), OLDER),
        ("shapes", a_result(provenance={"frfs": []}),
         "there are no FRFs and the modes have no shapes, so there is nothing to draw"),
        ("posterior", a_result(posterior={"method": "gaussian"}), OLDER),
        ("budget", a_result(parameters=[{"budget": []}]),
         "this result does not say what the variance of its parameters is made of"),
        ("damping", a_result(damping_models=[], outcomes=[]),
         "no damping law was fitted: no measured mode has a damping ratio"),
        ("damping", a_result(damping_models=[{"name": "rayleigh", "curve": None}]), OLDER),
        ("stabilisation", a_result(identification=None),
         "this update was given its modes and identified none, so there is no stabilisation diagram"),
    ],
)  # fmt: skip
def test_a_figure_says_why_there_is_nothing_to_draw(
    name: str, data: UpdateFigures, why: str
) -> None:
    with pytest.raises(Conflict) as refused:
        draw_figure(FIGURES, data, name, FigureQuery())
    assert str(refused.value) == why


def test_lines_modes_and_points_that_a_result_has_not() -> None:
    two = np.array([[0.9, 0.8], [1.0, 0.9]])
    arrays = {"band_lines_hz": np.array([10.0, 20.0]), "csac": two, "frequency_hz": np.ones(2)}
    data = a_result(arrays, modes=MODES)
    with pytest.raises(
        NotFound, match="line of the fitted band, 10 to 20 Hz, between 12 and 13 Hz"
    ):
        draw_figure(FIGURES, data, "csac", FigureQuery(fmin=12, fmax=13))
    assert screen(draw_figure(FIGURES, data, "csac", FigureQuery(fmin=12)))["data"][0]["x"] == [
        20.0
    ]
    shapes = {"shapes_updated": np.ones((3, 1)), "shape_pairs": np.array([[0, 0]])}
    single = _shapes(a_result(shapes, modes=MODES), FigureQuery(measured=2))
    assert "this mode has no partner" in single.note
    pairs = a_result(
        {
            "responses": np.array([[1, 3], [2, 3], [2, 3]]),
            "references": np.array([[3, 3], [1, 3], [2, 3]]),
        }
    )
    assert [
        _row_at(pairs, FigureQuery(point=point, reference=other))
        for point, other in ((2, 2), (2, 1), (3, 1))
    ] == [
        2,
        1,
        0,
    ]
    with pytest.raises(
        NotFound, match="FRF at point 1 and 1 in this result; there are points 1, 2, 3"
    ):
        _row_at(pairs, FigureQuery(point=1, reference=1))


# --- the figure of a watched series: what it draws is what the judgement says, on the screen and in
# print -------------


def of_series(watch: Watch, observations: Sequence[Observation]) -> dict[str, Any]:
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
    given = of_series(
        watch, [observe(i, e, temperature_c=float(i % 5)) for i, e in enumerate(levels)]
    )
    figure = series_figure(given, "Ex")
    shown = screen(figure)
    traces = {trace["name"]: trace for trace in shown["data"]}
    points = given["parameters"][0]["points"]
    corrected = traces["corrected for temperature"]
    assert corrected["y"] == [pytest.approx(1e-9 * p["corrected"]) for p in points]
    assert corrected["customdata"] == [str(i) for i in range(10)]
    assert corrected["error_y"]["array"] == [
        pytest.approx(1.959964e-9 * p["standard_deviation"]) for p in points
    ]
    assert traces["raw"]["y"] == [pytest.approx(1e-9 * p["raw"]) for p in points]
    assert traces["alarm"]["customdata"] == [["A", "8"]]
    assert traces["chart, fall"]["y"][-1] == pytest.approx(-points[-1]["judged"]["chart"]["fall"])
    assert json.loads(render(figure, "plotly")) == shown
    outside = [
        p["judged"]["score"] < -given["parameters"][0]["limits"]["score"]
        for p in points
        if p["judged"]
    ]
    beyond = [
        p["judged"]["residual"] < -p["judged"]["residual_limit"] for p in points if p["judged"]
    ]
    assert outside == beyond == [False, False, True, True]


def test_the_figure_is_printed_as_it_is() -> None:
    given = of_series(Watch({"Ex": "fall"}, baseline=6), values(*[1.0] * 8, 0.95, 0.95))
    figure = series_figure(given, "Ex")
    above, below = draw(figure).axes
    assert above.get_ylabel() == "Ex [GPa]"
    chart = next(line for line in below.lines if len(line.get_ydata()) == 4)
    drawn = next(t["y"] for t in screen(figure)["data"] if t["name"] == "chart, fall")
    assert list(chart.get_ydata()) == pytest.approx(drawn, rel=1e-6)  # printed to seven digits
    assert len(above.collections) >= 3  # estimates, their intervals, the alarm, the baseline's band


@pytest.mark.parametrize("file_format", [long("pdf"), "svg"])
def test_a_figure_is_printed_the_same_again(file_format: str) -> None:
    figure = frf_figure(FRF)
    assert render(figure, file_format) == render(figure, file_format)


def test_names_are_drawn_as_they_are() -> None:
    """Neither TeX, which matplotlib would read between dollars, nor markup, which Plotly would."""
    given = of_series(Watch({"Ex": "fall"}, baseline=6), values(*[1.0] * 8, 0.95, 0.95))
    given |= {"structure_name": r"$\frac{1 and $x_{ <b>", "monitor_name": "m" * 200}
    figure = series_figure(given, "Ex")
    title = screen(figure)["layout"]["title"]["text"]
    assert title == r"$\frac{1 and $x_{ &lt;b&gt; – " + "m" * 49 + "…: Ex (alarm)"
    assert draw(figure).get_suptitle() == title.replace("&lt;", "<").replace("&gt;", ">")
    assert len(render(figure, "svg")) > 10_000


@pytest.mark.parametrize(
    ("parameter", "label", "factor"),
    [
        ("a1", "a1 [µs]", 1e6),
        ("frequency_2", "mode 2 frequency [Hz]", 1),
        ("damping_ratio_2", "mode 2 damping ratio [%]", 100),
    ],
)
def test_axes_have_units(parameter: str, label: str, factor: float) -> None:
    given = of_series(Watch({"Ex": "fall"}, baseline=6), values(*[1.0] * 8))
    row = {**given["parameters"][0], "name": parameter, "unit": unit_of(parameter)}
    figure = screen(series_figure({**given, "parameters": [row], "alarms": []}, parameter))
    assert figure["layout"]["yaxis"]["title"]["text"] == label
    assert "UTC" in figure["layout"]["xaxis"]["title"]["text"]
    assert figure["data"][0]["y"] == [pytest.approx(factor * p["raw"]) for p in row["points"]]


def test_units_are_those_of_the_results() -> None:
    laws = (
        RAYLEIGH,
        CaugheySeries("caughey4", (0, 1, 2, 3)),
        GeneralisedProportional(("constant", "root"), 1.0),
    )
    for law in laws:
        for name, unit in zip(law.coefficient_names, law.coefficient_units, strict=True):
            assert unit_of(name) == unit
    assert [unit_of(name) for name in ("Ex", "nu_xy", "density", "zeta3", "spring")] == [
        "Pa",
        "1",
        "kg/m³",
        "1",
        None,
    ]


def test_the_figure_of_nothing_says_so() -> None:
    figure = series_figure(
        {**of_series(Watch({"Ex": "fall"}), values(1.0)), "parameters": []}, "Ex"
    )
    shown = screen(figure)
    assert shown["data"] == []
    assert shown["layout"]["annotations"][0]["text"] == "no campaign has been judged yet"
    assert render(figure, "svg").startswith(b"<?xml")
