"""The figures of the correlation criteria, made of their table: by line, by pair of lines, by degree
of freedom, by point.
"""

from collections.abc import Callable, Iterator

import numpy as np

from fecore.correlation import CRITERIA, FEWEST_PAIRS, Criterion, correlate, paired_lines
from fecore.frf import Dof
from service.figures.frfs import (
    PointValues,
    agreement_figure,
    dof_name,
    dofs_figure,
    line_pairs_figure,
    points_figure,
)
from service.figures.marks import Figure
from service.platform.errors import NotFound
from service.reports.figure_data import FigureQuery, UpdateFigures
from service.reports.named_figure import NamedFigure, no_mac

LINES = ("fmin", "fmax")
_BY_POINT = [each for each in CRITERIA.values() if each.axis == "FRF"]


def _lines(criterion: Criterion) -> Callable[[UpdateFigures, FigureQuery], Figure]:
    def draw(data: UpdateFigures, query: FigureQuery) -> Figure:
        hz = data.arrays["band_lines_hz"]
        low, high = query.fmin or 0.0, np.inf if query.fmax is None else query.fmax
        kept = (hz >= low) & (hz <= high)
        if not kept.any():
            raise NotFound(
                f"line of the fitted band, {hz[0]:g} to {hz[-1]:g} Hz, between {low:g} and"
                f" {high:g} Hz"
            )
        initial, updated = data.arrays[criterion.name][:, kept].astype(float)
        return agreement_figure(
            criterion,
            hz[kept],
            initial,
            updated,
            [mode["measured_hz"] for mode in data.document["modes"]],
        )

    return draw


def _line_pairs(criterion: Criterion) -> Callable[[UpdateFigures, FigureQuery], Figure]:
    def draw(data: UpdateFigures, _: FigureQuery) -> Figure:
        hz = data.arrays["band_lines_hz"]
        initial, updated = data.arrays[criterion.name].astype(float)
        return line_pairs_figure(criterion, hz[paired_lines(hz.size)], initial, updated)

    return draw


def _too_few_pairs(data: UpdateFigures) -> str | None:
    known = len(data.arrays.get("shape_pairs", ())) >= FEWEST_PAIRS
    return no_mac(data) or (None if known else "fewer than two modes are paired")


def _dofs(criterion: Criterion) -> Callable[[UpdateFigures, FigureQuery], Figure]:
    def draw(data: UpdateFigures, _: FigureQuery) -> Figure:
        arrays = data.arrays
        measured, model = arrays["shape_pairs"].T
        shapes = arrays["shapes_measured"][measured].astype(complex)
        there = arrays["shapes_updated"][model, : shapes.shape[1]].astype(complex)
        along = arrays["shape_directions"]
        axes = np.argmax(np.abs(along), axis=1)
        signs = np.sign(along[np.arange(len(along)), axes]).astype(int)
        dofs = [
            dof_name(Dof(int(point), int(sign * (axis + 1))))
            for point, sign, axis in zip(arrays["shape_points"], signs, axes, strict=True)
        ]
        values = correlate("shapes", shapes, there)[criterion.name]
        return dofs_figure(criterion, dofs[: values.size], values)

    return draw


def _by_point(data: UpdateFigures, _: FigureQuery) -> Figure:
    arrays, correlation = data.arrays, data.document["correlation"]
    parts = [(arrays["fitted"].tolist(), correlation, False)]
    if correlation["held_out"]["frfs"] is not None:
        parts.append((arrays["held"].tolist(), correlation["held_out"]["frfs"], True))
    rows = [row for places, _, _ in parts for row in places]
    places = dict(zip(arrays["shape_points"].tolist(), arrays["shape_places_m"], strict=True))
    labels = [data.moving_point(row) for row in rows]
    at = np.array([places[label] for label in labels])
    values = {
        each: np.array(
            [np.nan if v is None else v for _, criteria, _ in parts for v in criteria[each.member]],
            dtype=float,
        )
        for each in _BY_POINT
    }
    held = [is_held for places, _, is_held in parts for _ in places]
    return points_figure(PointValues(labels, at[:, 0], at[:, 1], values, held), *data.plan)


def criteria_figures() -> Iterator[tuple[str, NamedFigure]]:
    """The figure of each criterion; those of FRFs share one, the last."""
    for name, each in CRITERIA.items():
        title = f"{each.label}: {each.says}"
        if each.axis == "line":
            yield (
                each.figure,
                NamedFigure(
                    *(
                        f"{title} by line",
                        _lines(each),
                        UpdateFigures.require_prediction,
                        (name,),
                        LINES,
                    ),
                    tab="correlation",
                    width=0.8,
                ),
            )
        elif each.axis == "pair of lines":
            yield (
                each.figure,
                NamedFigure(
                    *(
                        f"{title} between any two lines",
                        _line_pairs(each),
                        UpdateFigures.require_prediction,
                        (name,),
                    ),
                    tab="correlation",
                ),
            )
        elif each.axis == "dof":
            yield (
                each.figure,
                NamedFigure(
                    *(f"{title} by degree of freedom", _dofs(each), _too_few_pairs),
                    ("shapes_measured", "shape_directions"),
                    tab="correlation",
                    width=0.8,
                ),
            )
    yield (
        _BY_POINT[0].figure,
        NamedFigure(
            f"{' and '.join(each.label for each in _BY_POINT)} by point on the specimen",
            *(_by_point, UpdateFigures.require_prediction, ("fitted", "shape_points")),
            tab="correlation",
        ),
    )
