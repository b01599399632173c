"""Figures of results that lack something, or have what few have: each panel, curve and mark is there where there is data."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from service.show.figures.budget import OTHERS, budget_figure
from service.show.figures.correlation import PointValues, points_figure
from service.show.figures.coupon import coupon_figure
from service.show.figures.frf import FrfCurves, Spread, frf_figure
from service.show.figures.hits import HitShown, PointShown, hits_figure
from service.show.figures.marks import Figure, Region
from service.show.figures.parameters import parameters_figure
from service.show.figures.screen import screen
from service.show.figures.series import series_figure
from service.show.figures.shapes import MOST_ROWS, ShapePair, shapes_figure
from service.show.reports.as_pdf import as_pdf
from service.show.reports.blocks import Picture, Report
from service.show.results.figure_data import UpdateFigures
from service.show.results.figure_frf import Wanted
from service.show.results.figures import FIGURES, draw_figure, draw_sheets


def names(figure: Figure) -> list[str]:
    return [trace["name"] for trace in screen(figure)["data"] if trace["name"]]


HZ = np.linspace(10, 100, 7)
FRF = FrfCurves("point 3", "accelerance", HZ, np.exp(1j * HZ))


@pytest.mark.parametrize(
    ("curves", "panels", "shades", "curves_named"),
    [
        (FRF, 2, 0, ["measured", "measured"]),
        (replace(FRF, coherence=np.ones(7)), 3, 0, ["measured", "measured"]),
        (replace(FRF, measured=np.zeros(7, complex)), 2, 0, ["measured", "measured"]),
        (replace(FRF, spread=Spread(np.ones(7), np.ones(7))), 2, 0, ["measured", "measured"]),
        (replace(FRF, band_hz=(20, 90)), 2, 4, ["measured", "measured"]),
        (replace(FRF, held_band_hz=(30, 40)), 2, 2, ["measured", "measured"]),
        (
            replace(FRF, models={"updated": FRF.measured}, spread=Spread(np.ones(7), np.ones(7))),
            2,
            0,
            ["updated, 95 %", "measured", "measured", "updated", "updated"],
        ),
    ],
)
def test_an_frf_alone_with_coherence_with_models(
    curves: FrfCurves, panels: int, shades: int, curves_named: list[str]
) -> None:
    figure = frf_figure(curves)
    assert len(figure.panels) == panels
    assert sum(isinstance(mark, Region) for mark in figure.marks) == shades
    assert names(figure) == curves_named
    assert (figure.panels[0].y.range is not None) == bool(curves.measured.any())


def a_point(mean: np.ndarray | None, coherence: np.ndarray | None) -> PointShown:
    hit = HitShown(1, good=True, why="", sentence="", force=np.ones(9), response=np.ones(9), frf=FRF.measured)
    return PointShown("p", "acceleration", "accelerance", 100.0, HZ, (0.0, 0.01), [hit], mean, coherence)


def test_hits_with_and_without_an_average_and_its_coherence() -> None:
    none, one, both = (hits_figure(a_point(*given)) for given in ((None, None), (HZ + 0j, None), (HZ + 0j, np.ones(7))))
    assert ["average of the good hits" in names(figure) for figure in (none, one, both)] == [False, True, True]
    shown = [screen(figure) for figure in (none, one, both)]
    assert ["yaxis4" in figure["layout"] for figure in shown] == [False, False, True]
    assert [figure["data"][-1]["yaxis"] for figure in shown] == ["y3", "y3", "y4"]
    assert [figure["layout"]["xaxis3"]["anchor"] for figure in shown] == ["y3", "y3", "y4"]


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


def test_points_of_which_none_was_held_out_have_one_symbol() -> None:
    one = np.array([0.9])
    for held, symbols in ((False, ["circle", "circle"]), (True, ["diamond", "diamond"])):
        figure = screen(points_figure(PointValues([3], one, one, one, one, [held]), 1.0, 0.1))
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
        budget: list[dict[str, Any]] = [{"source": f"s_{k}", "share": (1 - 0.01 * k) / count} for k in range(count)]
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
    row = a_row(state="ok", points=[point], baseline=baseline, direction="fall", limits={"score": score, "chart": 4.0})
    return {
        "parameters": [row], "structure_name": "s", "monitor_name": "m", "alarms": [], "notes": [],
        "campaigns": [{"campaign_id": "c", "name": "March"}],
    }  # fmt: skip


def test_a_series_is_drawn_before_its_baseline_and_before_it_is_judged() -> None:
    baseline = {"mean": 2e9, "mean_sd": 1e7, "covariates": []}
    judged = {"residual_limit": 1e8, "chart": {"fall": 1.0}, "outside": True}
    steps = [
        names(series_figure(a_series(*given), "Ex"))
        for given in ((None, None, None), (baseline, 3.0, None), (baseline, None, judged), (baseline, 3.0, judged))
    ]
    known, chart = ["estimate", "baseline, 95 %", "baseline"], ["chart, fall", "limit of the chart"]
    assert steps == [["estimate"], known, [*known, *chart], [*known, "limit of one campaign", *chart]]
    assert names(series_figure(a_series(None, None, None), "Gxy")) == []


def test_a_shape_without_measured_points_or_with_one_has_no_line() -> None:
    places = np.array([[0.0, 0.0], [1.0, 0.5]])  # no two in a row of the grid
    for measured in (np.zeros(0), np.array([1.0])):
        figure = screen(shapes_figure([ShapePair(1, "m", "u", measured + 0j, np.array([1.0, -1.0]))], [7, 8], places))
        assert {trace["mode"] for trace in figure["data"]} == {"markers"}
        assert [trace["customdata"] for trace in figure["data"]] == ([[7], [7, 8]] if measured.size else [[7, 8]])


def many_modes(count: int) -> UpdateFigures:
    """A result of so many measured modes, each with its partner in the model."""
    random = np.random.default_rng(count)
    modes = [
        {"number": k + 1, "measured_hz": 10.0 * k, "updated_hz": 10.0 * k, "mac": 1.0, "kind": "bending"}
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
    ("count", "sheets"), [(1, [1]), (8, [8]), (9, [5, 4]), (16, [8, 8]), (40, [8] * 5), (41, [8] * 5)]
)
def test_shapes_of_many_modes_go_over_pages(count: int, sheets: list[int]) -> None:
    figures = draw_sheets(many_modes(count), "shapes")
    numbers = [[mode["number"] for mode in (figure.meta or {})["modes"]] for figure in figures]
    assert [len(rows) for rows in numbers] == sheets
    assert [number for rows in numbers for number in rows] == list(range(1, min(count, 40) + 1))
    printed = as_pdf(Report("r", "", [Picture(figure, 0.9) for figure in figures]))
    assert printed.count(b"/Subtype /Image") == len(sheets)
    assert max(sheets) <= MOST_ROWS


def test_a_figure_that_is_higher_than_a_page_is_drawn_smaller() -> None:
    figure = draw_figure(FIGURES, many_modes(41), "shapes", Wanted())
    assert figure.title.endswith("the first 40 of 41 pairs")
    assert as_pdf(Report("r", "", [Picture(figure, 1.0)])).count(b"/Type /Page\n") == 1
