"""The figure of a monitored parameter: values above, the control chart below, on one axis of time.

Above: raw and covariate-corrected values with ± 1.96 standard deviations, the baseline's mean, and the value beyond which
one campaign alone is outside. Below: the chart's values and their limit. Campaigns and alarms are marks whose `ids` are
their own, so that a page can link them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fecore.normal import Z_95
from service.show.figures.colors import ALARM, INITIAL, QUIET, UPDATED
from service.show.figures.marks import Axis, Band, Curve, Figure, Mark, Panel, Points, shortened
from service.show.figures.parameters import SHOWN

SIGNS = {"fall": -1, "rise": 1}
Row = Mapping[str, Any]


def series_figure(document: Row, parameter: str) -> Figure:
    """The figure of one parameter of a series document.

    Args:
        document: what `GET /monitors/{id}/series` answers.
        parameter: a watched one. One that has no values yet gives empty axes that say so.
    """
    row = next((each for each in document["parameters"] if each["name"] == parameter), None)
    scale, unit = (1.0, None) if row is None else _shown_in(row)
    time = Axis("campaign performed (UTC)", "date")
    values = Axis(parameter if unit is None else f"{parameter} [{unit}]")
    panels = [Panel(time, values, up=(0.42, 1.0)), Panel(time, Axis("control chart [sd]"), up=(0.0, 0.32))]
    where = f"{shortened(document['structure_name'])} – {shortened(document['monitor_name'])}: {parameter}"
    if row is None:
        note = "; ".join(document["notes"]) or "no campaign has been judged yet"
        return Figure(f"{where} (no data)", [], panels, note=note)
    names = {campaign["campaign_id"]: campaign["name"] for campaign in document["campaigns"]}
    alarms = [a for a in document["alarms"] if a["parameter"] == parameter and a["state"] != "withdrawn"]
    marks = [*_values(row, names, scale), *_expectation(row, scale), *_chart(row, names, panels[1])]
    return Figure(f"{where} ({row['state']})", [*marks, *_alarms(alarms, row, scale)], panels)


def _shown_in(row: Row) -> tuple[float, str | None]:
    """Factor from SI and unit in which a parameter is drawn; no unit where it is not known."""
    if row["name"].startswith(("damping_ratio_", "zeta")):
        return 100.0, "%"
    return SHOWN.get(row["unit"], (1.0, row["unit"]))


def _times(points: Sequence[Row]) -> list[str]:
    return [point["performed_at"] for point in points]


def _campaigns(points: Sequence[Row], names: Mapping[str, str]) -> dict[str, Any]:
    """Whose campaigns points are, as marks say it."""
    ids = [point["campaign_id"] for point in points]
    return {"ids": ids, "text": [shortened(names.get(each, "")) for each in ids]}


def _values(row: Row, names: Mapping[str, str], scale: float) -> list[Mark]:
    points, said = row["points"], _campaigns(row["points"], names)
    raw = [scale * point["raw"] for point in points]
    error = [Z_95 * scale * point["standard_deviation"] for point in points]
    if row["baseline"] is None or not row["baseline"]["covariates"]:
        return [Points(_times(points), raw, "estimate", error_y=error, **said)]
    corrected = [np.nan if point["corrected"] is None else scale * point["corrected"] for point in points]
    name = "corrected for " + ", ".join(each["name"].split("_")[0] for each in row["baseline"]["covariates"])
    before = Points(_times(points), raw, "raw", QUIET, "circle-open", **said)
    return [before, Points(_times(points), corrected, name, error_y=error, **said)]


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
        marks.append(Curve(_times(judged), limit, "limit of one campaign", INITIAL, "dot", listed=listed, hover=None))
    return marks


def _chart(row: Row, names: Mapping[str, str], panel: Panel) -> list[Mark]:
    """The chart's values of each side, a fall downwards, with the limit."""
    judged = [point for point in row["points"] if point["judged"] is not None]
    marks: list[Mark] = []
    for side, listed in _sides(row).items() if judged else ():
        values = [SIGNS[side] * point["judged"]["chart"][side] for point in judged]
        dots = [ALARM if point["judged"]["outside"] else UPDATED for point in judged]
        said: Any = _campaigns(judged, names) | {"panel": panel}
        limit = [SIGNS[side] * row["limits"]["chart"]] * 2
        line: Any = {"panel": panel, "listed": listed, "hover": None}
        marks += [
            Curve(_times(judged), values, f"chart, {side}", UPDATED, symbol="circle", size=7, dots=dots, **said),
            Curve(_times([judged[0], judged[-1]]), limit, "limit of the chart", ALARM, "dash", **line),
        ]
    return marks


def _alarms(alarms: Sequence[Row], row: Row, scale: float) -> list[Mark]:
    """A mark at the campaign that raised each alarm; its ids are the alarm's and the campaign's."""
    places = {point["campaign_id"]: point for point in row["points"]}
    seen = [(alarm, places[alarm["campaign_id"]]) for alarm in alarms if alarm["campaign_id"] in places]
    if not seen:
        return []
    values = [scale * (point["raw"] if point["corrected"] is None else point["corrected"]) for _, point in seen]
    text = [alarm["state"] + (f": {shortened(alarm['note'])}" if alarm["note"] else "") for alarm, _ in seen]
    ids = [[alarm["alarm_id"], alarm["campaign_id"]] for alarm, _ in seen]
    times = _times([point for _, point in seen])
    return [Points(times, values, "alarm", ALARM, "diamond-open", 16, text=text, ids=ids)]


def _sides(row: Row) -> dict[str, bool]:
    """The sides that are watched; the first one stands in the legend for both."""
    return {"fall": True, "rise": False} if row["direction"] == "both" else {row["direction"]: True}
