"""Colours of figures by what they stand for, and what stands for them on a dark page."""

from typing import Literal

Theme = Literal["light", "dark"]

MEASURED = "#000000"
INITIAL = "#D55E00"
UPDATED = "#0072B2"
ALARM = "#CC0000"
QUIET = "#777777"
GROUND = "#ffffff"
GRID = "#dddddd"
BAND = "rgba(0,114,178,0.15)"
HELD_OUT = "rgba(213,94,0,0.12)"
OUTSIDE = "rgba(119,119,119,0.14)"
NOTHING = "rgba(0,0,0,0)"

PALETTE = (
    "#0072B1",
    "#E69F00",
    "#009E73",
    "#CC79A7",
    "#56B4E9",
    "#D55E01",
    "#8C7A00",
    "#777777",
    "#5B3A8E",
    "#A0522D",
)
"""Of things that are neither measured nor a model: distinct for people of any colour vision (Okabe
and Ito). The first and the sixth differ by one step from those of models, as a dark page exchanges
colours by name.
"""

_DARK = {
    MEASURED: "#f2f2f2",
    INITIAL: "#E69F00",
    UPDATED: "#56B4E9",
    ALARM: "#FF6B6B",
    QUIET: "#aaaaaa",
    GROUND: "#14171a",
    GRID: "#3a3f45",
    BAND: "rgba(86,180,233,0.25)",
    HELD_OUT: "rgba(230,159,0,0.18)",
    OUTSIDE: "rgba(170,170,170,0.16)",
    "#0072B1": "#4477DD",
    "#D55E01": "#E8743B",
    "#8C7A00": "#C8B400",
    "#5B3A8E": "#B39DDB",
    "#A0522D": "#C98A5E",
}


def themed(color: str, theme: Theme) -> str:
    """A colour on a page of a theme: figures are described for a light one."""
    return color if theme == "light" else _DARK.get(color, color)
