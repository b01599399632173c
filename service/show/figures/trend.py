"""What a search found: values over time and over a covariate with their lines, and results beside one another."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from fecore.normal import Z_95
from service.show.figures.colors import PALETTE, QUIET
from service.show.figures.marks import (
    Axis,
    Curve,
    Dash,
    Figure,
    Mark,
    Panel,
    Points,
    counted,
    rows_axis,
    shortened,
    words,
)
from service.show.figures.parameters import SHOWN

Row = Mapping[str, Any]

AXES = {"temperature_c": "temperature [°C]", "humidity_percent": "humidity [%]"}
MOST_RESULTS = 60  # rows of a figure of results


def trend_figure(trend: Row) -> Figure:
    """Values over time above, corrected where that can be done, with both lines; as they are over the covariate below.

    Args:
        trend: what `GET /search/{noun}/trend` answers.
    """
    series = [one for one in trend["series"] if one["points"]]
    if not series:
        return words(trend["value"], "; ".join(trend["notes"]) or "nothing was found")
    factor, unit = SHOWN.get(trend["unit"] or "1", (1.0, trend["unit"]))
    covariate = next((name for line in series[0]["lines"] for name in line["covariates"]), "temperature_c")
    title = trend["value"] if unit == "–" else f"{trend['value']} [{unit}]"
    panels = [
        Panel(Axis("campaign performed (UTC)", "date"), Axis(title), up=(0.52, 1.0)),
        Panel(Axis(AXES[covariate]), Axis(title), up=(0.0, 0.36)),  # one axis for both would put them in one place
    ]
    marks: list[Mark] = []
    for number, one in enumerate(series):
        marks += _over_time(one, factor, PALETTE[number % len(PALETTE)], alone=len(series) == 1)
        marks.append(_over(one, covariate, factor, PALETTE[number % len(PALETTE)], panels[1]))
    names = {one["structure_name"] for one in series}
    where = shortened(names.pop()) if len(names) == 1 else counted(len(names), "structure")
    return Figure(f"{where}: {trend['value']} over time", marks, panels, height=640)


def _over_time(one: Row, factor: float, color: str, *, alone: bool) -> Iterator[Mark]:
    points, name = one["points"], shortened(f"{one['structure_name']}, {one['name']}")
    times = [point["performed_at"] for point in points]
    said: Any = {"group": name, "text": [shortened(point["campaign_name"]) for point in points]}
    said["ids"] = [point["id"] for point in points]
    values = factor * np.array([point["value"] for point in points])
    corrected = next((line["corrected"] for line in one["lines"] if line["covariates"]), None)
    if corrected is not None:
        as_it_is = f"{name}, as it is", QUIET if alone else color, "circle-open"
        yield Points(times, values, *as_it_is, listed=alone, **said)
        values = factor * np.array(corrected, dtype=float)
    yield Points(times, values, name, color, error_y=_reach(points, factor), **said)
    for line in one["lines"]:
        beside = " with " + ", ".join(each.split("_")[0] for each in line["covariates"]) if line["covariates"] else ""
        rate = f"{100 * line['relative_per_year']:+.2g} % a year{beside}"
        dash: Dash = "solid" if beside else "dot"
        ends = [factor * value for value in line["ends"]]
        yield Curve([times[0], times[-1]], ends, rate, color, dash, listed=alone, hover=None, group=name)


def _over(one: Row, covariate: str, factor: float, color: str, panel: Panel) -> Mark:
    """The values as they are over a covariate, where it is known."""
    points = [point for point in one["points"] if point[covariate] is not None]
    x, y = [point[covariate] for point in points], [factor * point["value"] for point in points]
    group = shortened(f"{one['structure_name']}, {one['name']}")
    said: Any = {"text": [shortened(point["campaign_name"]) for point in points], "error_y": _reach(points, factor)}
    return Points(x, y, "", color, panel=panel, group=group, **said)


def _reach(points: Sequence[Row], factor: float) -> Any:
    """Half of each 95 % interval of what differs between campaigns; None where nobody says."""
    sds = [point["standard_deviation"] for point in points]
    return None if any(sd is None for sd in sds) else Z_95 * factor * np.array(sds)


def results_figure(rows: Sequence[Row], constants: Mapping[str, str]) -> Figure:
    """Results beside one another: a row each, a panel for each constant that any of them has, with 95 % intervals.

    Args:
        rows: of `GET /search/results`: names, and of each constant estimate, `_low` and `_high`.
        constants: the unit of each constant by name.
    """
    present = {name: unit for name, unit in constants.items() if any(row[name] is not None for row in rows)}
    if not present:
        return words("Results", "nothing was found")
    names = [shortened(f"{row['structure.name']}, {row['campaign.name']}", 40) for row in rows]
    panels, marks, width = [], list[Mark](), 1 / len(present)
    up = rows_axis(names)
    bare = rows_axis([""] * len(names))
    for place, (name, unit) in enumerate(present.items()):
        factor, shown = SHOWN.get(unit, (1.0, unit))
        across = (place * width, (place + 0.88) * width)
        panel = Panel(Axis(f"{name} [{shown}]", few=True), bare if place else up, across=across)
        panels.append(panel)
        having = [at for at, row in enumerate(rows) if row[name] is not None]
        middle, low, high = (
            factor * np.array([rows[at][name + end] for at in having], dtype=float) for end in ("", "_low", "_high")
        )
        error = np.array([middle - low, high - middle])
        color = PALETTE[place % len(PALETTE)]
        marks.append(Points(middle, having, name, color, panel=panel, error_x=error, listed=False))
    margin = {"l": 40 + 7 * max(len(name) for name in names)}
    title = f"{counted(len(rows), 'result')} with 95 % intervals"
    return Figure(title, marks, panels, height=200 + 24 * max(len(rows), 6), margins=margin)
