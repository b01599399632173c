"""What all figures share: colours, dashes, axes, a plain layout, and the few kinds of trace they are made of."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from service.show.figures.palette import ON_DARK

MEASURED = "#000000"
INITIAL = "#D55E00"
UPDATED = "#0072B2"
ALARM = "#CC0000"
QUIET = "#777777"
BAND = "rgba(0,114,178,0.15)"
HELD_OUT = "rgba(213,94,0,0.12)"
OUTSIDE = "rgba(119,119,119,0.14)"
GRID = "#dddddd"
NOTHING = "rgba(0,0,0,0)"

Z_95 = 1.959964
"""Half of the central 95 % of a normal distribution, in standard deviations."""

Theme = Literal["light", "dark"]
Figure = dict[str, Any]
"""A Plotly figure: `{"data": [...], "layout": {...}}`, nothing but JSON."""
Trace = dict[str, Any]

LONGEST_NAME, MOST_NAMES = 50, 40
MANY_NAMES = 16  # below an axis, beyond which they stand upright
_NOTHING_LEFT = 1e-290  # magnitude below which a number is drawn as 0: the power of ten that rounds it would overflow
FONT = "system-ui, sans-serif"
_DARK = {
    MEASURED: "#f2f2f2",
    INITIAL: "#E69F00",
    UPDATED: "#56B4E9",
    ALARM: "#FF6B6B",
    QUIET: "#aaaaaa",
    BAND: "rgba(86,180,233,0.25)",
    HELD_OUT: "rgba(230,159,0,0.18)",
    OUTSIDE: "rgba(170,170,170,0.16)",
    GRID: "#3a3f45",
    "#ffffff": "#14171a",
    **ON_DARK,
}


def axis(title: str, **more: Any) -> dict[str, Any]:
    """An axis of a plain Plotly layout, with grid and without a line at zero.

    Args:
        title: with the unit.
        more: other properties of the axis, which come before these.
    """
    return {"title": {"text": title}, "showgrid": True, "gridcolor": GRID, "zeroline": False, **more}


def decades(values: ArrayLike) -> dict[str, Any]:
    """Properties of a logarithmic axis of these values: over more than two decades only powers of ten are named."""
    found = np.asarray(values, dtype=float)
    found = found[np.isfinite(found) & (found > 0)]
    long = found.size > 0 and found.max() > 100 * found.min()
    return {"type": "log", "exponentformat": "power", **({"dtick": 1} if long else {})}


def named_ticks(names: Sequence[str]) -> dict[str, Any]:
    """An axis whose places 0, 1, 2, … have names, every other one where there are many, and so on."""
    step = -(-len(names) // MOST_NAMES) or 1
    return {"tickvals": list(range(0, len(names), step)), "ticktext": list(names[::step]), "showgrid": False}


def layout(title: str, **more: Any) -> dict[str, Any]:
    """A plain Plotly layout, white, with the legend below.

    Args:
        title: of the figure.
        more: axes and other properties, which come before these.
    """
    return {
        "title": {"text": title},
        "font": {"family": FONT, "size": 15, "color": MEASURED},
        "paper_bgcolor": "#ffffff",
        "plot_bgcolor": "#ffffff",
        "hovermode": "closest",
        "legend": {"orientation": "h", "y": -0.15},
        **more,
    }


def shown_name(given: str) -> str:
    """A name given by a person, as Plotly wants text: it takes < for markup. Cut where it is too long for a title."""
    cut = given if len(given) <= LONGEST_NAME else given[: LONGEST_NAME - 1] + "…"
    return escape(cut, quote=False)


def numbers(values: ArrayLike, digits: int = 7) -> list[float | None]:
    """Numbers for JSON, to as many significant digits as a figure can show; what is not finite is None, a gap."""
    found = np.asarray(values, dtype=float).ravel()
    finite = np.isfinite(found)
    some = finite & (np.abs(found) > _NOTHING_LEFT)
    decimals = digits - 1 - np.floor(np.log10(np.abs(found, where=some, out=np.ones_like(found))))
    scale = 10.0 ** np.abs(decimals)  # an exact power, so that a rounded number prints short
    with np.errstate(over="ignore", invalid="ignore"):  # of the two the one is taken that does not overflow
        up, down = np.round(found * scale) / scale, np.round(found / scale) * scale
    rounded = np.where(some, np.where(decimals >= 0, up, down), 0.0).tolist()
    return rounded if finite.all() else [value if here else None for value, here in zip(rounded, finite, strict=True)]


def line(x: Iterable[Any], y: Iterable[Any], name: str, color: str, dash: str = "solid", **more: Any) -> Trace:
    """A curve; it stands in the legend where it has a name."""
    return {
        "type": "scatter",
        "mode": "lines",
        "name": name,
        "x": list(x),
        "y": list(y),
        "line": {"color": color, "width": 1.5, "dash": dash},
        "showlegend": bool(name),
        **more,
    }


def band(
    x: Sequence[Any], low: Sequence[Any], high: Sequence[Any], name: str, color: str = BAND, **more: Any
) -> list[Trace]:
    """The space between two curves: an unseen line, and one filled down to it."""
    return [
        line(x, low, "", NOTHING, hoverinfo="skip", **more),
        {**line(x, high, name, NOTHING, hoverinfo="skip", **more), "fill": "tonexty", "fillcolor": color},
    ]


def marks(x: Iterable[Any], y: Iterable[Any], name: str, color: Any, symbol: str = "circle", **more: Any) -> Trace:
    """Points; they stand in the legend where they have a name."""
    size = more.pop("size", 8)
    return {
        "type": "scatter",
        "mode": "markers",
        "name": name,
        "x": list(x),
        "y": list(y),
        "marker": {"symbol": symbol, "color": color, "size": size},
        "showlegend": bool(name),
        **more,
    }


def words(title: str, sentence: str) -> Figure:
    """A figure that has nothing to draw and says why."""
    note = {"text": sentence, "x": 0.5, "y": 0.5, "xref": "paper", "yref": "paper", "showarrow": False}
    shown = layout(title, xaxis=axis("", visible=False), yaxis=axis("", visible=False), annotations=[note])
    return {"data": [], "layout": shown}


def themed(figure: Figure, theme: Theme) -> Figure:
    """The figure in the colours of a theme: as it is built it is for a light page."""
    return figure if theme == "light" else _exchanged(figure)


def _exchanged(node: Any) -> Any:
    if isinstance(node, dict):
        return {key: value if key in ("x", "y", "z") else _exchanged(value) for key, value in node.items()}
    if isinstance(node, list):
        return [_exchanged(each) for each in node]
    return _DARK.get(node, node) if isinstance(node, str) else node
