"""A figure for the screen: Plotly's JSON, for pages, notebooks (`plotly.io.from_json`) and REST."""

from collections.abc import Iterator
from html import escape
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from service.figures.colors import GRID, GROUND, MEASURED, NOTHING, QUIET, Theme, themed
from service.figures.marks import (
    Axis,
    Band,
    Bars,
    Curve,
    Figure,
    Mark,
    Matrix,
    Points,
    Region,
    Rule,
    Scale,
)

# magnitude below which a number is drawn as 0: the power of ten that rounds it would overflow
_NOTHING_LEFT = 1e-290

Json = dict[str, Any]


def screen(figure: Figure, theme: Theme = "light") -> Json:
    """The figure as `{"data": [...], "layout": {...}}`, nothing but JSON."""
    return _Screen(figure, theme).figure()


def numbers(values: ArrayLike, digits: int = 7) -> list[float | None]:
    """Numbers for JSON, to as many significant digits as a figure can show; what is not finite is
    None, a gap.
    """
    array = np.asarray(values, dtype=float).ravel()
    finite = np.isfinite(array)
    some = finite & (np.abs(array) > _NOTHING_LEFT)
    decimals = digits - 1 - np.floor(np.log10(np.abs(array, where=some, out=np.ones_like(array))))
    scale = 10.0 ** np.abs(decimals)  # an exact power, so that a rounded number prints short
    # of the two the one is taken that does not overflow
    with np.errstate(over="ignore", invalid="ignore"):
        up, down = np.round(array * scale) / scale, np.round(array / scale) * scale
    rounded = np.where(some, np.where(decimals >= 0, up, down), 0.0).tolist()
    return (
        rounded
        if finite.all()
        else [value if here else None for value, here in zip(rounded, finite, strict=True)]
    )


def _values(values: ArrayLike, digits: int = 7) -> list[Any]:
    """Whole numbers and dates as they are."""
    array = np.asarray(values)
    return array.tolist() if array.dtype.kind in "iuU" else numbers(array, digits)


def _text(plain: str) -> str:
    """A text as Plotly wants it: it takes < for markup."""
    return escape(plain, quote=False).replace("\n", "<br>")


class _Screen:
    """A figure on its way: its axes have Plotly's names x, x2, …, its colours are a theme's."""

    def __init__(self, figure: Figure, theme: Theme) -> None:
        self._figure, self._theme = figure, theme
        self._names: dict[Axis, str] = {}
        for which in "xy":
            axes = dict.fromkeys(getattr(panel, which) for panel in figure.panels)
            self._names |= {
                axis: f"{which}{k if k > 1 else ''}" for k, axis in enumerate(axes, start=1)
            }

    def figure(self) -> Json:
        figure, ground = self._figure, self._color(GROUND)
        layout: Json = {
            "title": {"text": _text(figure.title)},
            "font": {"family": "system-ui, sans-serif", "size": 15, "color": self._color(MEASURED)},
            "paper_bgcolor": ground,
            "plot_bgcolor": ground,
            "hovermode": "closest",
            "legend": {"orientation": "h", "y": -0.15},
            **{
                f"{name[0]}axis{name[1:]}": self._axis(axis, name)
                for axis, name in self._names.items()
            },
            "shapes": [
                self._shape(mark) for mark in figure.marks if isinstance(mark, Rule | Region)
            ],
        }
        optional = {
            "annotations": list(self._notes()),
            "height": figure.height,
            "margin": figure.margins,
            "meta": figure.meta,
            "barmode": "overlay" if any(isinstance(mark, Bars) for mark in figure.marks) else None,
        }
        layout |= {name: value for name, value in optional.items() if value}
        return {
            "data": [trace for mark in figure.marks for trace in self._traces(mark)],
            "layout": layout,
        }

    def _color(self, color: str) -> str:
        return themed(color, self._theme)

    def _axis(self, axis: Axis, name: str) -> Json:
        across = name[0] == "x"
        panels = [panel for panel in self._figure.panels if axis in (panel.x, panel.y)]
        at = min(panels, key=lambda panel: panel.up[0] if across else panel.across[0])
        layout: Json = {
            "title": {"text": _text(axis.title)},
            "showgrid": axis.grid and not axis.bare,
            "gridcolor": self._color(GRID),
            "zeroline": False,
            "domain": list(at.across if across else at.up),
            "anchor": self._names[at.y if across else at.x],
        }
        if axis.kind != "linear":
            layout["type"] = "log" if axis.log else "date"
        if axis.range is not None:
            layout["range"] = _values(np.log10(axis.range) if axis.log else axis.range)
        if axis.ticks is not None:
            layout |= {
                "tickvals": list(axis.ticks),
                "ticktext": [_text(each) for each in axis.ticks.values()],
            }
        special: tuple[tuple[bool, Json], ...] = (
            (axis.kind in ("powers", "decades"), {"exponentformat": "power"}),
            (axis.kind == "decades", {"dtick": 1}),
            (axis.bare, {"showticklabels": False, "rangemode": "tozero"}),
            (axis.few, {"nticks": 4}),
            (axis.hidden, {"visible": False}),
            (axis.down, {"autorange": "reversed"}),
            (at.over and not across, {"overlaying": "y", "side": "right"}),
        )
        for applies, properties in special:
            layout |= properties if applies else {}
        return layout

    def _notes(self) -> Iterator[Json]:
        for panel in self._figure.panels:
            if panel.title:
                yield {
                    "text": _text(panel.title), "x": 0.0, "y": 1.0, "xref": f"{self._names[panel.x]} domain",
                    "yref": f"{self._names[panel.y]} domain", "showarrow": False, "xanchor": "left", "yanchor": "bottom",
                    "font": {"size": 13},
                }  # fmt: skip
        if self._figure.note:
            middle = sum(self._figure.panels[0].up) / 2
            place = {"x": 0.5, "y": middle, "xref": "paper", "yref": "paper"}
            yield {"text": _text(self._figure.note), "showarrow": False, **place}

    def _place(self, mark: Mark) -> tuple[str, str]:
        panel = mark.panel or self._figure.panels[0]
        return self._names[panel.x], self._names[panel.y]

    def _shape(self, mark: Rule | Region) -> Json:
        x, y = self._place(mark)
        color = self._color(mark.color)
        if isinstance(mark, Rule):
            line = {"color": color, "width": 1, "dash": mark.dash}
            along = [mark.at, mark.at]
            (x0, x1), (y0, y1) = ([0, 1], along) if mark.level else (along, [0, 1])
            x, y = (f"{x} domain", y) if mark.level else (x, f"{y} domain")
            return {
                "type": "line",
                "xref": x,
                "yref": y,
                "x0": x0,
                "x1": x1,
                "y0": y0,
                "y1": y1,
                "line": line,
            }
        (x0, x1), (y0, y1) = mark.across, mark.up or (0, 1)
        shape: Json = {
            "type": "rect",
            "layer": "below",
            "xref": x,
            "yref": y if mark.up else f"{y} domain",
        }
        shape |= {
            "x0": x0,
            "x1": x1,
            "y0": y0,
            "y1": y1,
            "line": {"width": int(mark.outline), "color": color},
        }
        return shape if mark.outline else {**shape, "fillcolor": color}

    def _traces(self, mark: Mark) -> Iterator[Json]:
        match mark:
            case Curve():
                line = {"color": self._color(mark.color), "width": mark.width, "dash": mark.dash}
                drawn: Json = {"mode": "lines+markers" if mark.symbol else "lines", "line": line}
                if mark.symbol:
                    dots = [self._color(each) for each in mark.dots] or self._color(mark.color)
                    drawn["marker"] = {"symbol": mark.symbol, "size": mark.size, "color": dots}
                yield self._trace(
                    mark,
                    "scatter",
                    mark.name,
                    x=_values(mark.x),
                    y=_values(mark.y, mark.digits),
                    **drawn,
                )
            case Band():
                # An unseen line, and one that is filled down to it.
                unseen = {
                    "mode": "lines",
                    "line": {"color": NOTHING, "width": 0},
                    "x": _values(mark.x),
                }
                filled = {"fill": "tonexty", "fillcolor": self._color(mark.color)}
                yield self._trace(mark, "scatter", "", **unseen, y=_values(mark.low, mark.digits))
                yield self._trace(
                    mark,
                    "scatter",
                    mark.name,
                    **unseen,
                    y=_values(mark.high, mark.digits),
                    **filled,
                )
            case Points():
                yield self._points(mark)
            case Bars():
                places = {
                    "x": numbers(mark.length),
                    "y": _values(mark.place),
                    "base": numbers(mark.base),
                }
                look = {
                    "orientation": "h",
                    "width": mark.width,
                    "marker": {"color": self._color(mark.color)},
                }
                yield self._trace(mark, "bar", mark.name, **places, **look)
            case Matrix():
                yield self._matrix(mark)

    def _trace(self, mark: Mark, kind: str, name: str, **more: Any) -> Json:
        x, y = self._place(mark)
        trace = {
            "type": kind,
            "name": _text(name),
            "showlegend": bool(name) and mark.listed,
            "xaxis": x,
            "yaxis": y,
            **more,
        }
        hover: Json = {"hoverinfo": "skip"} if mark.hover is None else {}
        if mark.hover:
            hover = {"hovertemplate": f"{mark.hover}<extra></extra>"}
        text = [_text(each) for each in mark.text]
        optional = {
            "text": text,
            "customdata": list(mark.ids),
            "legendgroup": mark.group,
            "meta": mark.meta,
        }
        return trace | hover | {name: value for name, value in optional.items() if value}

    def _points(self, mark: Points) -> Json:
        marker: Json = {"symbol": mark.symbol, "size": mark.size}
        if (scale := mark.scale) is None:
            marker["color"] = self._color(mark.color)
        else:
            marker |= {
                "color": numbers(mark.color, 4),
                **_scale(scale, "c"),
                "showscale": scale.shown,
            }
            marker["line"] = {"color": self._color(QUIET), "width": 0.5}
        properties: Json = {
            "mode": "markers",
            "x": _values(mark.x),
            "y": _values(mark.y, mark.digits),
            "marker": marker,
        }
        for which, error in (("error_x", mark.error_x), ("error_y", mark.error_y)):
            if error is not None:
                below, above = np.broadcast_to(np.asarray(error, float), (2, np.shape(error)[-1]))
                properties[which] = {
                    "type": "data",
                    "array": numbers(above),
                    "color": marker["color"],
                    "thickness": 1.5,
                }
                if np.ndim(error) == 2:
                    properties[which] |= {"symmetric": False, "arrayminus": numbers(below)}
        return self._trace(mark, "scatter", mark.name, **properties)

    def _matrix(self, mark: Matrix) -> Json:
        rows = [numbers(row, 5) for row in np.atleast_2d(mark.values)]
        down, across = np.shape(mark.values)
        places = {"x": list(range(across)), "y": list(range(down)), "z": rows, "xgap": 1, "ygap": 1}
        cells = {"text": [list(row) for row in mark.cells], "texttemplate": "%{text}"}
        return self._trace(mark, "heatmap", mark.name, **places, **cells, **_scale(mark.scale, "z"))


def _scale(scale: Scale, letter: str) -> Json:
    bar = {"title": {"text": _text(scale.title)}, "len": scale.length, "y": scale.middle}
    return {
        "colorscale": "Cividis",
        f"{letter}min": scale.low,
        f"{letter}max": scale.high,
        "colorbar": bar,
    }
