"""Tracks of modes that a monitor follows, over time; and a watched parameter over a covariate,
before and after all of them were taken out.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fecore.normal import Z_95
from service.figures.colors import PALETTE, QUIET, UPDATED
from service.figures.marks import (
    Axis,
    Curve,
    Figure,
    Mark,
    Panel,
    Points,
    mode_words,
    shortened,
    words,
)
from service.figures.trend import named_covariate, shown_in

Row = Mapping[str, Any]
FREQUENCY = "frequency"


def tracks_figure(document: Row) -> Figure:
    """Frequencies of all tracks above, and below how far each is from its baseline with the
    covariates taken out, with 95 % intervals. A line stops where a campaign misses the mode.

    Args:
        document: what `GET /monitors/{id}/series` answers.
    """
    rows = [row for row in document["parameters"] if row["name"].startswith(f"{FREQUENCY}_")]
    title = f"{shortened(document['structure_name'])}: modes over time"
    if not rows:
        return words(title, "; ".join(document["notes"]) or "no mode is followed yet")
    time = Axis("campaign performed (UTC)", "date")
    changes = [change for row in rows for change in _changes(row)]
    half = 1.5 * float(np.quantile([abs(change) + error for _, change, error in changes], 0.95))
    panels = [
        Panel(time, Axis("frequency [Hz]", "log"), up=(0.56, 1.0)),
        # a campaign that knows a mode badly does not set the scale
        Panel(time, Axis("change from the baseline [%]", range=(-half, half)), up=(0.0, 0.46)),
    ]
    names = {each["campaign_id"]: each["name"] for each in document["campaigns"]}
    dates = sorted({p["performed_at"] for row in document["parameters"] for p in row["points"]})
    marks: list[Mark] = []
    for place, row in enumerate(rows):
        marks += _track(row, dates, names, PALETTE[place % len(PALETTE)], panels)
    return Figure(title, marks, panels, height=560)


def _changes(row: Row) -> list[tuple[Row, float, float]]:
    """Points of a track, each with its relative change from the baseline, covariates taken out, and
    half of the 95 % interval, per cent.
    """
    mean = _mean(row)
    return [
        (
            point,
            100 * ((point["raw"] if point["corrected"] is None else point["corrected"]) / mean - 1),
            100 * Z_95 * point["standard_deviation"] / mean,
        )
        for point in row["points"]
    ]


def _mean(row: Row) -> float:
    """Of the baseline, or of all while there is none."""
    if row["baseline"]:
        return float(row["baseline"]["mean"])
    return float(np.mean([point["raw"] for point in row["points"]]))


def _track(
    row: Row, dates: Sequence[str], names: Mapping[str, str], color: str, panels: Sequence[Panel]
) -> Iterator[Mark]:
    points = {point["performed_at"]: point for point in row["points"]}
    hz = [points[date]["raw"] if date in points else math.nan for date in dates]
    name = f"mode {row['name'].rsplit('_')[-1]}, {_mean(row):.4g} Hz"
    yield Curve(list(dates), hz, "", color, width=1, symbol="circle", size=4, group=name)
    there, change, error = zip(*_changes(row), strict=True)
    look: Any = {
        "ids": [point["campaign_id"] for point in there],
        "text": [shortened(names.get(point["campaign_id"], "")) for point in there],
    }
    times = [point["performed_at"] for point in there]
    yield Points(
        times, change, name, color, size=5, error_y=error, panel=panels[1], group=name, **look
    )


def covariate_figure(document: Row, parameter: str, covariate: str) -> Figure:
    """A parameter over a covariate: as it is, with the line of the baseline, and once all
    covariates are taken out.

    Args:
        document: what `GET /monitors/{id}/series` answers.
        parameter: a watched one.
        covariate: one that its baseline takes out, or any other that campaigns state.
    """
    row = next((each for each in document["parameters"] if each["name"] == parameter), None)
    named = named_covariate(covariate)
    title = f"{shortened(document['structure_name'])}: {mode_words(parameter)} over {named}"
    stated = {
        each["campaign_id"]: {**each, **each["covariates"]}.get(covariate)
        for each in document["campaigns"]
    }
    points = [p for p in row["points"] if stated.get(p["campaign_id"]) is not None] if row else []
    if row is None or not points:
        return words(title, f"no campaign with a value states {named}")
    x = np.array([stated[point["campaign_id"]] for point in points], dtype=float)
    axis = Axis(named)
    scale, unit = shown_in(parameter, row["unit"])
    value = mode_words(parameter) + (f" [{unit}]" if unit else "")
    error = scale * Z_95 * np.array([point["standard_deviation"] for point in points])
    after = [math.nan if p["corrected"] is None else scale * p["corrected"] for p in points]
    before = [scale * point["raw"] for point in points]
    both = np.array([before, after])
    ends = np.nanmin(both - error), np.nanmax(both + error)
    # axes of their own: one for both would put them in one place
    panels = [
        Panel(replace(axis), Axis(value, range=ends), across=across, title=title)
        for across, title in (((0.0, 0.45), "as measured"), ((0.55, 1.0), "covariates taken out"))
    ]
    names = {each["campaign_id"]: each["name"] for each in document["campaigns"]}
    look: Any = {
        "ids": [point["campaign_id"] for point in points],
        "text": [shortened(names.get(point["campaign_id"], "")) for point in points],
        "error_y": error,
    }
    marks: list[Mark] = [
        Points(x, before, "as measured", QUIET, "circle-open", panel=panels[0], **look)
    ]
    slope = next(
        (
            c
            for c in (row["baseline"] or {"covariates": ()})["covariates"]
            if c["name"] == covariate
        ),
        None,
    )
    if slope is not None:
        span = np.array([x.min(), x.max()])
        line = scale * (row["baseline"]["mean"] + slope["slope"] * (span - slope["centre"]))
        marks.append(Curve(span, line, "baseline", UPDATED, "dash", hover=None))
    marks.append(Points(x, after, "taken out", UPDATED, panel=panels[1], **look))
    return Figure(title, marks, panels, height=380)
