"""Campaigns of a joint update beside one another: what each says alone of the shared constants, and its frequencies' errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fecore.normal import Z_95
from service.show.figures.colors import ALARM, BAND, INITIAL, MEASURED, UPDATED
from service.show.figures.marks import Axis, Bars, Figure, Mark, Panel, Points, Rule, named_axis, rows_axis, shortened

_LONGEST = 22  # letters of a campaign's name beside a row
FAR_Z = 2.0  # |z| from which on a campaign's own estimate is drawn as one that differs

_Row = tuple[Mapping[str, Any], Mapping[str, Any]]


def alone_figure(parameters: Sequence[Mapping[str, Any]], campaigns: Sequence[Mapping[str, Any]]) -> Figure:
    """What each campaign says of each shared constant by itself, as a share of the joint estimate.

    Args:
        parameters: the shared ones, as a joint result has them.
        campaigns: its parts, each with `alone` and `predictive_p`.
    """
    rows = [
        (parameter, part)
        for parameter in parameters
        for part in campaigns
        if part["alone"].get(parameter["name"]) is not None
    ]
    names = [f"{parameter['name']}  {shortened(part['name'], _LONGEST)}" for parameter, part in rows]
    said = ", ".join(f"{shortened(part['name'])}: p {_probability(part['predictive_p'])}" for part in campaigns)
    return Figure(
        f"Each campaign alone, beside all together ({said})",
        [_joint(rows), *_alone(rows)],
        [Panel(Axis("share of the joint estimate [%]"), rows_axis(names))],
        height=200 + 24 * max(len(rows), 6),
        margins={"l": 40 + 7 * max((len(name) for name in names), default=0)},
    )


def _probability(value: float | None) -> str:
    return "–" if value is None else f"{value:.2g}"


def _joint(rows: Sequence[_Row]) -> Mark:
    """The joint estimate's 95 % interval behind each row."""
    low, high = (
        np.array([100 * row["interval_95"][end] / row["estimate"] for row, _ in rows], dtype=float) for end in (0, 1)
    )
    return Bars(high - low, range(len(rows)), low, "all together, 95 %", BAND, width=1, hover=None)


def _alone(rows: Sequence[_Row]) -> list[Mark]:
    """Estimates of single campaigns with 95 % intervals; those far from the joint one stand out."""
    marks: list[Mark] = []
    for far, color, symbol, name in (
        (False, MEASURED, "circle", "one campaign alone, 95 %"),
        (True, ALARM, "diamond", f"differs, |z| above {FAR_Z:g}"),
    ):
        chosen = [
            (place, parameter["estimate"], part["alone"][parameter["name"]])
            for place, (parameter, part) in enumerate(rows)
            if (abs(part["alone"][parameter["name"]]["z"]) > FAR_Z) is far
        ]
        if not chosen:
            continue
        middle = [100 * found["estimate"] / joint for _, joint, found in chosen]
        reach = [100 * Z_95 * found["standard_deviation"] / joint for _, joint, found in chosen]
        said: Any = {"text": [f"z {found['z']:+.2f}" for *_, found in chosen], "hover": "%{x:.1f} %, %{text}"}
        marks.append(Points(middle, [place for place, *_ in chosen], name, color, symbol, error_x=reach, **said))
    return marks


def errors_figure(campaigns: Sequence[Mapping[str, Any]]) -> Figure:
    """How far each campaign's frequencies lie from the model's, before and after, in one panel a campaign.

    Args:
        campaigns: the parts of a joint result, each with `modes`.
    """
    marks: list[Mark] = []
    panels = []
    for number, part in enumerate(campaigns):
        modes = [mode for mode in part["modes"] if mode["updated_hz"] is not None]
        labels = [f"{mode['number']}\n{mode['measured_hz']:.4g} Hz" for mode in modes]
        x = named_axis("", labels, range=(-0.6, max(len(modes), 1) - 0.4))
        up = 1 - (number + 0.7) / len(campaigns), 1 - (number + 0.1) / len(campaigns)
        panel = Panel(x, Axis("error [%]"), up=up, title=shortened(part["name"]))
        panels.append(panel)
        for key, color, symbol in (("initial_hz", INITIAL, "diamond-open"), ("updated_hz", UPDATED, "circle")):
            error = [np.nan if mode[key] is None else 100 * (mode[key] / mode["measured_hz"] - 1) for mode in modes]
            name = key.removesuffix("_hz") if number == 0 else ""
            marks.append(Points(range(len(modes)), error, name, color, symbol, panel=panel, hover="%{y:+.3f} %"))
        marks.append(Rule(0, level=True, panel=panel))
    title = "Errors of the frequencies of the initial and the updated model"
    return Figure(title, marks, panels, height=150 + 170 * len(campaigns))
