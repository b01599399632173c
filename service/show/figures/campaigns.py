"""Campaigns of a joint update beside one another: what each says alone of the shared constants, and its frequencies' errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from service.show.figures.look import (
    ALARM,
    BAND,
    INITIAL,
    MEASURED,
    QUIET,
    UPDATED,
    Z_95,
    Figure,
    Trace,
    axis,
    layout,
    marks,
    named_ticks,
    numbers,
    shown_name,
)

_LONGEST = 22  # letters of a campaign's name beside a row
FAR_Z = 2.0
"""|z| from which on a campaign's own estimate is drawn as one that differs."""


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
    names = [f"{parameter['name']}  {_short(part['name'])}" for parameter, part in rows]
    data = [*_joint(rows), *_alone(rows)]
    said = ", ".join(f"{shown_name(part['name'])}: p {_probability(part['predictive_p'])}" for part in campaigns)
    shown = layout(
        f"Each campaign alone, beside all together ({said})",
        xaxis=axis("share of the joint estimate [%]"),
        yaxis=axis("", range=[len(rows) - 0.4, -0.6], **named_ticks(names)),
        margin={"l": 40 + 7 * max((len(name) for name in names), default=0)},
        height=200 + 24 * max(len(rows), 6),
    )
    return {"data": data, "layout": shown}


def _short(name: str) -> str:
    """A campaign's name as the label of a row."""
    return shown_name(name if len(name) <= _LONGEST else name[: _LONGEST - 1] + "…")


def _probability(value: float | None) -> str:
    return "–" if value is None else f"{value:.2g}"


_Row = tuple[Mapping[str, Any], Mapping[str, Any]]


def _joint(rows: Sequence[_Row]) -> list[Trace]:
    """The joint estimate's 95 % interval behind each row."""
    low = [100 * parameter["interval_95"][0] / parameter["estimate"] for parameter, _ in rows]
    high = [100 * parameter["interval_95"][1] / parameter["estimate"] for parameter, _ in rows]
    x: list[float | None] = []
    y: list[float | None] = []
    for place, (left, right) in enumerate(zip(low, high, strict=True)):
        x += [left, right, right, left, left, None]
        y += [place - 0.5, place - 0.5, place + 0.5, place + 0.5, place - 0.5, None]
    return [
        {
            "type": "scatter", "mode": "lines", "fill": "toself", "fillcolor": BAND, "x": numbers(_gaps(x)),
            "y": numbers(_gaps(y)), "line": {"color": BAND, "width": 0}, "name": "all together, 95 %", "hoverinfo": "skip",
            "showlegend": True,
        }
    ]  # fmt: skip


def _gaps(values: Sequence[float | None]) -> Any:
    return np.array([np.nan if value is None else value for value in values], dtype=float)


def _alone(rows: Sequence[_Row]) -> list[Trace]:
    """Estimates of single campaigns with 95 % intervals; those far from the joint one stand out."""
    traces = []
    for far, color, symbol, name in (
        (False, MEASURED, "circle", "one campaign alone, 95 %"),
        (True, ALARM, "diamond", f"differs, |z| above {FAR_Z:g}"),
    ):
        chosen = [
            (place, parameter, part["alone"][parameter["name"]])
            for place, (parameter, part) in enumerate(rows)
            if (abs(part["alone"][parameter["name"]]["z"]) > FAR_Z) is far
        ]
        if not chosen:
            continue
        middle = [100 * found["estimate"] / parameter["estimate"] for _, parameter, found in chosen]
        reach = [100 * Z_95 * found["standard_deviation"] / parameter["estimate"] for _, parameter, found in chosen]
        error = {"type": "data", "array": numbers(reach), "color": color, "thickness": 1.2}
        trace = marks(numbers(middle), [place for place, _, _ in chosen], name, color, symbol, error_x=error)
        z = [f"z {found['z']:+.2f}" for _, _, found in chosen]
        traces.append({**trace, "text": z, "hovertemplate": "%{x:.1f} %, %{text}<extra></extra>"})
    return traces


def errors_figure(campaigns: Sequence[Mapping[str, Any]]) -> Figure:
    """How far each campaign's frequencies lie from the model's, before and after, in one panel a campaign.

    Args:
        campaigns: the parts of a joint result, each with `modes`.
    """
    data: list[Trace] = []
    axes: dict[str, Any] = {}
    notes = []
    count = len(campaigns)
    for number, part in enumerate(campaigns):
        place = "" if number == 0 else str(number + 1)
        top = 1 - number / count
        modes = [mode for mode in part["modes"] if mode["updated_hz"] is not None]
        labels = [f"{mode['number']}<br>{mode['measured_hz']:.4g} Hz" for mode in modes]
        axes[f"xaxis{place}"] = axis(
            "", anchor=f"y{place}", range=[-0.6, max(len(modes), 1) - 0.4], **named_ticks(labels)
        )
        domain = [top - 0.7 / count, top - 0.1 / count]
        axes[f"yaxis{place}"] = axis("error [%]", domain=domain, anchor=f"x{place}")
        for key, color, symbol in (("initial_hz", INITIAL, "diamond-open"), ("updated_hz", UPDATED, "circle")):
            error = [np.nan if mode[key] is None else 100 * (mode[key] / mode["measured_hz"] - 1) for mode in modes]
            name = key.removesuffix("_hz") if number == 0 else ""
            panel = {"xaxis": f"x{place}", "yaxis": f"y{place}"}
            trace = marks(list(range(len(modes))), numbers(error), name, color, symbol, **panel)
            data.append({**trace, "hovertemplate": "%{y:+.3f} %<extra></extra>"})
        notes.append(
            {
                "text": shown_name(part["name"]), "x": 0.0, "y": 1.0, "xref": f"x{place} domain", "yref": f"y{place} domain",
                "showarrow": False, "xanchor": "left", "yanchor": "bottom", "font": {"size": 13},
            }
        )  # fmt: skip
    shown = layout(
        "Errors of the frequencies of the initial and the updated model",
        annotations=notes,
        height=150 + 170 * count,
        shapes=[_zero(number) for number in range(count)],
        **axes,
    )
    return {"data": data, "layout": shown}


def _zero(number: int) -> dict[str, Any]:
    place = "" if number == 0 else str(number + 1)
    line = {"color": QUIET, "width": 1, "dash": "dot"}
    return {
        "type": "line", "xref": f"x{place} domain", "yref": f"y{place}", "x0": 0, "x1": 1, "y0": 0, "y1": 0, "line": line,
    }  # fmt: skip
