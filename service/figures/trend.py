"""Values over time: those that a search found, over time and over a covariate with their lines, and
results beside one another; and the series of a monitored parameter, values above, the control chart
below, on one axis of time.

Of a series: raw and covariate-corrected values with ± 1.96 standard deviations, the baseline's
mean, and the value beyond which one campaign alone is outside; the chart's values and their limit.
Campaigns and alarms are marks whose `ids` are their own, so that a page can link them.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from fecore.normal import Z_95
from fecore.quantities import SHOWN
from service.figures.colors import ALARM, INITIAL, PALETTE, QUIET, UPDATED
from service.figures.marks import (
    Axis,
    Band,
    Curve,
    Dash,
    Figure,
    Mark,
    Panel,
    Points,
    counted,
    mode_words,
    rows_axis,
    shortened,
    words,
)
from service.nouns.campaigns.climate import CLIMATE, label_of_covariate, unit_of_covariate

Row = Mapping[str, Any]

MOST_RESULTS = 60  # rows of a figure of results


def trend_figure(trend: Row) -> Figure:
    """Values over time above, corrected where that can be done, with both lines; as they are over
    the covariate below.

    Args:
        trend: what `GET /search/{noun}/trend` answers.
    """
    series = [one for one in trend["series"] if one["points"]]
    if not series:
        return words(trend["value"], "; ".join(trend["notes"]) or "nothing was found")
    factor, unit = SHOWN.get(trend["unit"] or "1", (1.0, trend["unit"]))
    covariate = next(
        (name for line in series[0]["lines"] for name in line["covariates"]), next(iter(CLIMATE))
    )
    title = trend["value"] if unit == "–" else f"{trend['value']} [{unit}]"
    panels = [
        Panel(Axis("campaign performed (UTC)", "date"), Axis(title), up=(0.52, 1.0)),
        # one axis for both would put them in one place
        Panel(
            Axis(named_covariate(covariate)),
            Axis(title),
            up=(0.0, 0.36),
        ),
    ]
    marks: list[Mark] = []
    for number, one in enumerate(series):
        marks += _over_time(one, factor, PALETTE[number % len(PALETTE)], single=len(series) == 1)
        marks.append(_over(one, covariate, factor, PALETTE[number % len(PALETTE)], panels[1]))
    names = {one["structure_name"] for one in series}
    where = shortened(names.pop()) if len(names) == 1 else counted(len(names), "structure")
    return Figure(f"{where}: {trend['value']} over time", marks, panels, height=640)


def named_covariate(covariate: str) -> str:
    """A condition or covariate with its unit."""
    if covariate in CLIMATE:
        return f"{CLIMATE[covariate].label.lower()} [{CLIMATE[covariate].unit}]"
    return f"{label_of_covariate(covariate)} [{unit_of_covariate(covariate)}]"


def _over_time(one: Row, factor: float, color: str, *, single: bool) -> Iterator[Mark]:
    points, name = one["points"], shortened(f"{one['structure_name']}, {one['name']}")
    times = [point["performed_at"] for point in points]
    look: Any = {"group": name, "text": [shortened(point["campaign_name"]) for point in points]}
    look["ids"] = [point["id"] for point in points]
    values = factor * np.array([point["value"] for point in points])
    corrected = next((line["corrected"] for line in one["lines"] if line["covariates"]), None)
    if corrected is not None:
        as_it_is = f"{name}, as it is", QUIET if single else color, "circle-open"
        yield Points(times, values, *as_it_is, listed=single, **look)
        values = factor * np.array(corrected, dtype=float)
    yield Points(times, values, name, color, error_y=_reach(points, factor), **look)
    for line in one["lines"]:
        beside = (
            " with " + ", ".join(each.split("_")[0] for each in line["covariates"])
            if line["covariates"]
            else ""
        )
        unit, years = one["time_unit"], one["time_unit_years"]
        rate = f"{100 * years * line['relative_per_year']:+.2g} % per {unit}{beside}"
        dash: Dash = "solid" if beside else "dot"
        ends = [factor * value for value in line["ends"]]
        yield Curve(
            [times[0], times[-1]], ends, rate, color, dash, listed=single, hover=None, group=name
        )


def _over(one: Row, covariate: str, factor: float, color: str, panel: Panel) -> Mark:
    """The values as they are over a covariate, where it is known."""
    known = [(point, {**point, **point["covariates"]}[covariate]) for point in one["points"]]
    points = [point for point, at in known if at is not None]
    x = [at for _, at in known if at is not None]
    y = [factor * point["value"] for point in points]
    group = shortened(f"{one['structure_name']}, {one['name']}")
    look: Any = {
        "text": [shortened(point["campaign_name"]) for point in points],
        "error_y": _reach(points, factor),
    }
    return Points(x, y, "", color, panel=panel, group=group, **look)


def _reach(points: Sequence[Row], factor: float) -> Any:
    """Half of each 95 % interval of what differs between campaigns; None where nobody says."""
    sds = [point["standard_deviation"] for point in points]
    return None if any(sd is None for sd in sds) else Z_95 * factor * np.array(sds)


def results_figure(rows: Sequence[Row], constants: Mapping[str, str]) -> Figure:
    """Results beside one another: a row each, a panel for each constant that any of them has, with
    95 % intervals.

    Args:
        rows: of `GET /search/results`: names, and of each constant estimate, `_low` and `_high`.
        constants: the unit of each constant by name.
    """
    present = {
        name: unit for name, unit in constants.items() if any(row[name] is not None for row in rows)
    }
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
            factor * np.array([rows[at][name + end] for at in having], dtype=float)
            for end in ("", "_low", "_high")
        )
        error = np.array([middle - low, high - middle])
        color = PALETTE[place % len(PALETTE)]
        marks.append(Points(middle, having, name, color, panel=panel, error_x=error, listed=False))
    margin = {"l": 40 + 7 * max(len(name) for name in names)}
    title = f"{counted(len(rows), 'result')} with 95 % intervals"
    return Figure(title, marks, panels, height=200 + 24 * max(len(rows), 6), margins=margin)


SIGNS = {"fall": -1, "rise": 1}


def series_figure(document: Row, parameter: str) -> Figure:
    """The figure of one parameter of a series document.

    Args:
        document: what `GET /monitors/{id}/series` answers.
        parameter: a watched one. One that has no values yet gives empty axes that say so.
    """
    row = next((each for each in document["parameters"] if each["name"] == parameter), None)
    scale, unit = (1.0, None) if row is None else shown_in(parameter, row["unit"])
    named = mode_words(parameter)
    time = Axis("campaign performed (UTC)", "date")
    values = Axis(named if unit is None else f"{named} [{unit}]")
    panels = [
        Panel(time, values, up=(0.42, 1.0)),
        Panel(time, Axis("control chart [sd]"), up=(0.0, 0.32)),
    ]
    where = (
        f"{shortened(document['structure_name'])} – {shortened(document['monitor_name'])}: {named}"
    )
    if row is None:
        note = "; ".join(document["notes"]) or "no campaign has been judged yet"
        return Figure(f"{where} (no data)", [], panels, note=note)
    names = {campaign["campaign_id"]: campaign["name"] for campaign in document["campaigns"]}
    alarms = [
        a for a in document["alarms"] if a["parameter"] == parameter and a["state"] != "withdrawn"
    ]
    marks = [*_values(row, names, scale), *_expectation(row, scale), *_chart(row, names, panels[1])]
    return Figure(f"{where} ({row['state']})", [*marks, *_alarms(alarms, row, scale)], panels)


def shown_in(parameter: str, unit: str | None) -> tuple[float, str | None]:
    """Factor from SI and unit in which a parameter is shown; no unit where it is not known."""
    if parameter.startswith(("damping_ratio_", "zeta")):
        return 100.0, "%"
    return SHOWN.get(unit or "", (1.0, unit))


def _times(points: Sequence[Row]) -> list[str]:
    return [point["performed_at"] for point in points]


def _campaigns(points: Sequence[Row], names: Mapping[str, str]) -> dict[str, Any]:
    """Whose campaigns points are, as marks say it."""
    ids = [point["campaign_id"] for point in points]
    return {"ids": ids, "text": [shortened(names.get(each, "")) for each in ids]}


def _values(row: Row, names: Mapping[str, str], scale: float) -> list[Mark]:
    points, look = row["points"], _campaigns(row["points"], names)
    raw = [scale * point["raw"] for point in points]
    error = [Z_95 * scale * point["standard_deviation"] for point in points]
    if row["baseline"] is None or not row["baseline"]["covariates"]:
        return [Points(_times(points), raw, "estimate", error_y=error, **look)]
    corrected = [
        np.nan if point["corrected"] is None else scale * point["corrected"] for point in points
    ]
    name = "corrected for " + ", ".join(
        each["name"].split("_")[0] for each in row["baseline"]["covariates"]
    )
    before = Points(_times(points), raw, "raw", QUIET, "circle-open", **look)
    return [before, Points(_times(points), corrected, name, error_y=error, **look)]


def _expectation(row: Row, scale: float) -> list[Mark]:
    """The baseline's mean with its uncertainty, and the limits of a single campaign."""
    baseline, points = row["baseline"], row["points"]
    if baseline is None:
        return []
    ends = _times([points[0], points[-1]])
    mean, half = scale * baseline["mean"], Z_95 * scale * baseline["mean_sd"]
    marks: list[Mark] = [
        Band(ends, [mean - half] * 2, [mean + half] * 2, "baseline, 95 %", hover=None),
        Curve(ends, [mean, mean], "baseline", UPDATED, "dash", hover=None),
    ]
    judged = [point for point in points if point["judged"] is not None]
    if row["limits"]["score"] is None or not judged:
        return marks
    for sign, listed in _sides(row).items():
        limit = [mean + SIGNS[sign] * scale * point["judged"]["residual_limit"] for point in judged]
        marks.append(
            Curve(
                _times(judged),
                limit,
                "limit of one campaign",
                INITIAL,
                "dot",
                listed=listed,
                hover=None,
            )
        )
    return marks


def _chart(row: Row, names: Mapping[str, str], panel: Panel) -> list[Mark]:
    """The chart's values of each side, a fall downwards, with the limit."""
    judged = [point for point in row["points"] if point["judged"] is not None]
    marks: list[Mark] = []
    for side, listed in _sides(row).items() if judged else ():
        values = [SIGNS[side] * point["judged"]["chart"][side] for point in judged]
        dots = [ALARM if point["judged"]["outside"] else UPDATED for point in judged]
        look: Any = _campaigns(judged, names) | {"panel": panel}
        limit = [SIGNS[side] * row["limits"]["chart"]] * 2
        line: Any = {"panel": panel, "listed": listed, "hover": None}
        marks += [
            Curve(
                _times(judged),
                values,
                f"chart, {side}",
                UPDATED,
                symbol="circle",
                size=7,
                dots=dots,
                **look,
            ),
            Curve(
                _times([judged[0], judged[-1]]), limit, "limit of the chart", ALARM, "dash", **line
            ),
        ]
    return marks


def _alarms(alarms: Sequence[Row], row: Row, scale: float) -> list[Mark]:
    """A mark at the campaign that raised each alarm; its ids are the alarm's and the campaign's."""
    places = {point["campaign_id"]: point for point in row["points"]}
    seen = [
        (alarm, places[alarm["campaign_id"]]) for alarm in alarms if alarm["campaign_id"] in places
    ]
    if not seen:
        return []
    values = [
        scale * (point["raw"] if point["corrected"] is None else point["corrected"])
        for _, point in seen
    ]
    text = [
        alarm["state"] + (f": {shortened(alarm['note'])}" if alarm["note"] else "")
        for alarm, _ in seen
    ]
    ids = [[alarm["alarm_id"], alarm["campaign_id"]] for alarm, _ in seen]
    times = _times([point for _, point in seen])
    return [Points(times, values, "alarm", ALARM, "diamond-open", 16, text=text, ids=ids)]


def _sides(row: Row) -> dict[str, bool]:
    """The sides that are watched; the first one stands in the legend for both."""
    return {"fall": True, "rise": False} if row["direction"] == "both" else {row["direction"]: True}
