"""What all figures share: colours, dashes and a plain layout."""

from __future__ import annotations

from typing import Any

MEASURED = "#000000"
INITIAL = "#D55E00"
UPDATED = "#0072B2"
ALARM = "#CC0000"
QUIET = "#777777"
BAND = "rgba(0,114,178,0.15)"

Figure = dict[str, Any]
"""A Plotly figure: `{"data": [...], "layout": {...}}`, nothing but JSON."""


def axis(title: str, **more: Any) -> dict[str, Any]:
    """An axis of a plain Plotly layout, with grid and without a line at zero.

    Args:
        title: with the unit.
        more: other properties of the axis, which come before these.
    """
    return {"title": {"text": title}, "showgrid": True, "gridcolor": "#dddddd", "zeroline": False, **more}


def layout(title: str, **more: Any) -> dict[str, Any]:
    """A plain Plotly layout, white, with the legend below.

    Args:
        title: of the figure.
        more: axes and other properties, which come before these.
    """
    return {
        "title": {"text": title},
        "font": {"family": "system-ui, sans-serif", "size": 15},
        "plot_bgcolor": "#ffffff",
        "hovermode": "closest",
        "legend": {"orientation": "h", "y": -0.15},
        **more,
    }
