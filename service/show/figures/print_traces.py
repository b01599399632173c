"""Traces of a Plotly figure on matplotlib's axes: curves, points, bands, error bars, bars and matrices with their values."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from html import unescape
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DASHES = {"solid": "-", "dash": "--", "dot": ":", "dashdot": "-."}
_SYMBOLS = {
    "circle": "o", "diamond": "D", "square": "s", "x": "x", "cross": "+", "triangle-up": "^", "line-ns": "|",
}  # fmt: skip
_POINTS = 0.75  # of a CSS pixel


def add_trace(axes: Axes, trace: Mapping[str, Any], below: Mapping[str, Any] | None) -> Any:
    """Draw a trace.

    Args:
        axes: where.
        trace: of Plotly.
        below: the trace before it on these axes, down to which a band is filled.

    Returns:
        What stands for it in a legend, or None.

    Raises:
        ValueError: it is of a kind that is not drawn.
    """
    draw = {"scatter": _scatter, "bar": _bar, "heatmap": _heatmap}.get(trace["type"])
    if draw is None:
        raise ValueError(f"a trace of type {trace['type']!r} cannot be printed")
    return draw(axes, trace, below)


def _scatter(axes: Axes, trace: Mapping[str, Any], below: Mapping[str, Any] | None) -> Any:
    x, y = _numbers(trace["x"]), _numbers(trace["y"])
    if trace.get("fill") == "tonexty":
        if below is None:
            raise ValueError("a band has no trace below it")
        color, alpha = color_of(trace["fillcolor"])
        return axes.fill_between(x, _numbers(below["y"]), y, color=color, alpha=alpha, linewidth=0)
    if trace.get("fill") == "toself":
        color, alpha = color_of(trace["fillcolor"])
        return axes.fill(x, y, color=color, alpha=alpha, linewidth=0)[0]
    if "fill" in trace:
        raise ValueError(f"a fill {trace['fill']!r} cannot be printed")
    handle: Any = None
    if "lines" in trace["mode"]:
        line = trace["line"]
        color, alpha = color_of(line["color"])
        dash = DASHES[line.get("dash", "solid")]
        style = "steps-post" if line.get("shape") == "hv" else "default"
        width = _POINTS * line.get("width", 2)
        (handle,) = axes.plot(x, y, dash, color=color, alpha=alpha, linewidth=width, drawstyle=style)
    _error_bars(axes, trace, x, y)
    if "markers" in trace["mode"]:
        dots = _dots(axes, trace["marker"], x, y)
        handle = handle or dots
    if "text" in trace["mode"]:
        for place_x, place_y, text in zip(x, y, trace["text"], strict=True):
            axes.annotate(
                unescape(str(text)), (place_x, place_y), (0, 4), textcoords="offset points", ha="center", fontsize=6,
                color=trace.get("textfont", {}).get("color", "#000000"),
            )  # fmt: skip
    return handle


def _error_bars(axes: Axes, trace: Mapping[str, Any], x: Any, y: Any) -> None:
    for which in ("x", "y"):
        if (error := trace.get(f"error_{which}")) is None:
            continue
        reach: Any = _numbers(error["array"])
        if "arrayminus" in error:
            reach = np.vstack([_numbers(error["arrayminus"]), reach])
        color, _ = color_of(error["color"])
        bars: dict[str, Any] = {f"{which}err": reach}
        axes.errorbar(x, y, **bars, fmt="none", ecolor=color, elinewidth=0.8, capsize=2)


def _dots(axes: Axes, marker: Mapping[str, Any], x: Any, y: Any) -> Any:
    symbol, hollow = marker["symbol"].removesuffix("-open"), marker["symbol"].endswith("-open")
    size = (_POINTS * marker["size"]) ** 2
    if "colorscale" in marker:
        drawn = axes.scatter(
            x, y, s=size, marker=_SYMBOLS[symbol], c=_numbers(marker["color"]), cmap=marker["colorscale"].lower(),
            vmin=marker["cmin"], vmax=marker["cmax"], edgecolors="#777777", linewidths=0.4, zorder=3,
        )  # fmt: skip
        if marker.get("showscale"):
            _color_bar(axes, drawn, marker["colorbar"]["title"]["text"])
        return drawn
    shared = marker["color"] if isinstance(marker["color"], list) else None
    color, alpha = (shared, 1.0) if shared is not None else color_of(marker["color"])
    faces = "none" if hollow else color
    if symbol in ("x", "cross", "line-ns"):
        return axes.scatter(x, y, s=size, marker=_SYMBOLS[symbol], c=color, linewidths=0.8, zorder=3)
    return axes.scatter(
        x,
        y,
        s=size,
        marker=_SYMBOLS[symbol],
        facecolors=faces,
        edgecolors=color,
        alpha=alpha,
        linewidths=0.8 if alpha == 1 else 0,
        zorder=3,
    )


def _bar(axes: Axes, trace: Mapping[str, Any], _: Mapping[str, Any] | None) -> Any:
    lying = trace.get("orientation") == "h"
    places, lengths = (trace["y"], trace["x"]) if lying else (trace["x"], trace["y"])
    color, alpha = color_of(trace["marker"]["color"])
    base = _numbers(trace["base"]) if "base" in trace else 0.0
    if lying:
        return axes.barh(_numbers(places), _numbers(lengths), trace["width"], left=base, color=color, alpha=alpha)
    return axes.bar(_numbers(places), _numbers(lengths), trace["width"], bottom=base, color=color, alpha=alpha)


def _heatmap(axes: Axes, trace: Mapping[str, Any], _: Mapping[str, Any] | None) -> Any:
    z = np.array([[np.nan if value is None else value for value in row] for row in trace["z"]], float)
    x, y = _numbers(trace["x"]), _numbers(trace["y"])
    edges = [np.append(places - 0.5, places[-1] + 0.5) for places in (x, y)]
    drawn = axes.pcolormesh(
        *edges, z, cmap=trace["colorscale"].lower(), vmin=trace["zmin"], vmax=trace["zmax"], edgecolors="#ffffff",
        linewidth=0.5,
    )  # fmt: skip
    size = float(np.clip(60 / max(z.shape), 3, 7))
    for row, texts in enumerate(trace.get("text", ())):
        for column, text in enumerate(texts):
            light = (z[row, column] - trace["zmin"]) / (trace["zmax"] - trace["zmin"]) > 0.6
            ink = "#000000" if light else "#ffffff"
            axes.text(x[column], y[row], text, ha="center", va="center", fontsize=size, color=ink)
    if trace.get("showscale", True):
        _color_bar(axes, drawn, trace["colorbar"]["title"]["text"])
    return None


def _color_bar(axes: Axes, drawn: Any, title: str) -> None:
    inside = axes.inset_axes((1.02, 0.0, 0.025, 1.0))
    axes.figure.colorbar(drawn, cax=inside, label=title)


def _numbers(values: list[Any]) -> Any:
    """Dates as dates, None as NaN."""
    if values and isinstance(values[0], str):
        return [datetime.fromisoformat(value) for value in values]
    return np.array([np.nan if value is None else value for value in values], float)


def color_of(css: str) -> tuple[str | tuple[float, float, float], float]:
    """A colour as matplotlib wants it, and its opacity."""
    if not css.startswith("rgba("):
        return css, 1.0
    red, green, blue, alpha = (float(part) for part in css[5:-1].split(","))
    return (red / 255, green / 255, blue / 255), alpha
