"""The figure of a monitored parameter: values above, the control chart below, on one axis of time.

Above: raw and covariate-corrected values with ± 1.96 standard deviations, the baseline's mean, and the value beyond which
one campaign alone is outside. Below: the chart's values and their limit. Campaigns and alarms are marks whose `customdata`
are their ids, so that a page can link them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from service.show.figures.look import (
    ALARM,
    BAND,
    INITIAL,
    MEASURED,
    QUIET,
    UPDATED,
    Z_95,
    Figure,
    axis,
    layout,
    shown_name,
)
from service.show.figures.parameters import SHOWN

SIGNS = {"fall": -1, "rise": 1}


def series_figure(document: Mapping[str, Any], parameter: str) -> Figure:
    """The figure of one parameter of a series document.

    Args:
        document: what `GET /monitors/{id}/series` answers.
        parameter: a watched one. One that has no values yet gives empty axes that say so.
    """
    found = [p for p in document["parameters"] if p["name"] == parameter]
    scale, unit = _shown_in(found[0]) if found else (1.0, None)
    title = f"{shown_name(document['structure_name'])} – {shown_name(document['monitor_name'])}: {parameter}"
    shown = layout(
        f"{title} ({found[0]['state'] if found else 'no data'})",
        xaxis=axis("campaign performed (UTC)", type="date", anchor="y2"),
        yaxis=axis(parameter if unit is None else f"{parameter} [{unit}]", domain=[0.42, 1.0]),
        yaxis2=axis("control chart [sd]", domain=[0.0, 0.32]),
    )
    if not found:
        note = "; ".join(document["notes"]) or "no campaign has been judged yet"
        shown["annotations"] = [
            {"text": note, "x": 0.5, "y": 0.7, "xref": "paper", "yref": "paper", "showarrow": False}
        ]
        return {"data": [], "layout": shown}
    row = found[0]
    names = {c["campaign_id"]: shown_name(c["name"]) for c in document["campaigns"]}
    alarms = [a for a in document["alarms"] if a["parameter"] == parameter and a["state"] != "withdrawn"]
    data = [*_values(row, names, scale), *_expectation(row, scale), *_chart(row, names), *_alarms(alarms, row, scale)]
    return {"data": data, "layout": shown}


def _shown_in(row: Mapping[str, Any]) -> tuple[float, str | None]:
    """Factor from SI and unit in which a parameter is drawn; no unit where it is not known."""
    if row["name"].startswith(("damping_ratio_", "zeta")):
        return 100.0, "%"
    return SHOWN.get(row["unit"], (1.0, row["unit"]))


def _values(row: Mapping[str, Any], names: Mapping[str, str], scale: float) -> list[dict[str, Any]]:
    points = row["points"]
    common: dict[str, Any] = {
        "type": "scatter",
        "mode": "markers",
        "x": [p["performed_at"] for p in points],
        "text": [names.get(p["campaign_id"], "") for p in points],
        "customdata": [p["campaign_id"] for p in points],
    }
    half = [Z_95 * scale * p["standard_deviation"] for p in points]
    error = {"type": "data", "array": half, "color": MEASURED, "thickness": 1}
    traces: list[dict[str, Any]] = []
    if row["baseline"] is not None and row["baseline"]["covariates"]:
        marker = {"symbol": "circle-open", "color": QUIET, "size": 8}
        traces.append({**common, "name": "raw", "y": [scale * p["raw"] for p in points], "marker": marker})
        corrected = [None if p["corrected"] is None else scale * p["corrected"] for p in points]
        name = "corrected for " + ", ".join(c["name"].split("_")[0] for c in row["baseline"]["covariates"])
    else:
        corrected, name = [scale * p["raw"] for p in points], "estimate"
    marker = {"symbol": "circle", "color": MEASURED, "size": 8}
    traces.append({**common, "name": name, "y": corrected, "marker": marker, "error_y": error})
    return traces


def _expectation(row: Mapping[str, Any], scale: float) -> list[dict[str, Any]]:
    """The baseline's mean with its uncertainty, and the limits of a single campaign."""
    baseline, points = row["baseline"], row["points"]
    if baseline is None:
        return []
    ends = [points[0]["performed_at"], points[-1]["performed_at"]]
    mean, half = scale * baseline["mean"], Z_95 * scale * baseline["mean_sd"]
    traces = [
        _line(ends, [mean - half] * 2, "", "rgba(0,0,0,0)", "solid"),
        {
            **_line(ends, [mean + half] * 2, "baseline, 95 %", "rgba(0,0,0,0)", "solid"),
            "fill": "tonexty",
            "fillcolor": BAND,
            "showlegend": True,
        },
        {**_line(ends, [mean, mean], "baseline", UPDATED, "dash"), "showlegend": True},
    ]
    judged = [p for p in points if p["judged"] is not None]
    if row["limits"]["score"] is None or not judged:
        return traces
    for i, side in enumerate(_sides(row)):
        reach = [SIGNS[side] * scale * p["judged"]["residual_limit"] for p in judged]
        y = [mean + r for r in reach]
        line = _line([p["performed_at"] for p in judged], y, "limit of one campaign", INITIAL, "dot")
        traces.append({**line, "showlegend": i == 0})
    return traces


def _chart(row: Mapping[str, Any], names: Mapping[str, str]) -> list[dict[str, Any]]:
    """The chart's values of each side, a fall downwards, with the limit."""
    judged = [p for p in row["points"] if p["judged"] is not None]
    if not judged:
        return []
    x = [p["performed_at"] for p in judged]
    traces: list[dict[str, Any]] = []
    for i, side in enumerate(_sides(row)):
        sign, limit = SIGNS[side], row["limits"]["chart"]
        traces.append(
            {
                "type": "scatter",
                "mode": "lines+markers",
                "name": f"chart, {side}",
                "x": x,
                "y": [sign * p["judged"]["chart"][side] for p in judged],
                "text": [names.get(p["campaign_id"], "") for p in judged],
                "customdata": [p["campaign_id"] for p in judged],
                "line": {"color": UPDATED, "width": 1.5},
                "marker": {
                    "symbol": "circle",
                    "size": 7,
                    "color": [ALARM if p["judged"]["outside"] else UPDATED for p in judged],
                },
                "yaxis": "y2",
            }
        )
        line = _line([x[0], x[-1]], [sign * limit] * 2, "limit of the chart", ALARM, "dash")
        traces.append({**line, "yaxis": "y2", "showlegend": i == 0})
    return traces


def _alarms(alarms: Sequence[Mapping[str, Any]], row: Mapping[str, Any], scale: float) -> list[dict[str, Any]]:
    """A mark at the campaign that raised each alarm; its customdata are the alarm's and the campaign's id."""
    places = {p["campaign_id"]: p for p in row["points"]}
    seen = [(a, places[a["campaign_id"]]) for a in alarms if a["campaign_id"] in places]
    if not seen:
        return []
    return [
        {
            "type": "scatter",
            "mode": "markers",
            "name": "alarm",
            "x": [p["performed_at"] for _, p in seen],
            "y": [scale * (p["raw"] if p["corrected"] is None else p["corrected"]) for _, p in seen],
            "text": [a["state"] + (f": {shown_name(a['note'])}" if a["note"] else "") for a, _ in seen],
            "customdata": [[a["alarm_id"], a["campaign_id"]] for a, _ in seen],
            "marker": {"symbol": "diamond-open", "color": ALARM, "size": 16},
        }
    ]


def _sides(row: Mapping[str, Any]) -> list[str]:
    return ["fall", "rise"] if row["direction"] == "both" else [row["direction"]]


def _line(x: Sequence[str], y: Sequence[float], name: str, color: str, dash: str) -> dict[str, Any]:
    return {
        "type": "scatter",
        "mode": "lines",
        "name": name,
        "x": list(x),
        "y": list(y),
        "line": {"color": color, "width": 1.5, "dash": dash},
        "hoverinfo": "skip",
        "showlegend": False,
    }
