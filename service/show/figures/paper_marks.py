"""Marks on matplotlib's axes: curves, points, bands, error bars, bars, matrices with their values, rules and regions."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Any, assert_never

import numpy as np
from numpy.typing import ArrayLike

from service.show.figures.colors import QUIET, Theme, themed
from service.show.figures.marks import Band, Bars, Curve, Mark, Matrix, Points, Region, Rule, Scale

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_DASHES = {"solid": "-", "dash": "--", "dot": ":"}
_SYMBOLS = {"circle": "o", "diamond": "D", "square": "s", "x": "x", "cross": "+", "triangle-up": "^"}
_THIN = ("x", "cross")  # symbols without an inside
_POINTS = 0.75  # of a CSS pixel


@dataclass(frozen=True)
class Pen:
    """Draws marks on the axes of a panel in the colours of a theme."""

    axes: Axes
    theme: Theme

    def draw(self, mark: Mark) -> Any:
        """Draw a mark; what stands for it in a legend, or None."""
        match mark:
            case Curve():
                return self._curve(mark)
            case Band():
                look: Any = {"color": self._color(mark.color), "linewidth": 0}
                return self.axes.fill_between(_values(mark.x), _values(mark.low), _values(mark.high), **look)
            case Points():
                return self._points(mark)
            case Bars():
                places, lengths = _values(mark.place), _values(mark.length)
                return self.axes.barh(places, lengths, mark.width, left=mark.base, color=self._color(mark.color))
            case Matrix():
                return self._matrix(mark)
            case Rule():
                rule = self.axes.axhline if mark.level else self.axes.axvline
                return rule(mark.at, color=self._color(mark.color), linestyle=_DASHES[mark.dash], linewidth=_POINTS)
            case Region():
                return self._region(mark)
            case _:
                assert_never(mark)

    def _color(self, color: str) -> Any:
        """As matplotlib wants it, with its opacity."""
        css = themed(color, self.theme)
        if not css.startswith("rgba("):
            return css
        red, green, blue, alpha = (float(part) for part in css[5:-1].split(","))
        return red / 255, green / 255, blue / 255, alpha

    def _curve(self, mark: Curve) -> Any:
        x, y, color = _values(mark.x), _values(mark.y), self._color(mark.color)
        width = _POINTS * mark.width
        (handle,) = self.axes.plot(x, y, _DASHES[mark.dash], color=color, linewidth=width)
        if mark.symbol:
            self._dots(mark.symbol, mark.size, x, y, [self._color(each) for each in mark.dots] or color)
        return handle

    def _points(self, mark: Points) -> Any:
        x, y = _values(mark.x), _values(mark.y)
        if mark.scale is not None:
            return self._scaled(mark, x, y, mark.scale)
        color = self._color(mark.color)
        errors: Any = {"xerr": mark.error_x, "yerr": mark.error_y}
        self.axes.errorbar(x, y, **errors, fmt="none", ecolor=color, elinewidth=0.8, capsize=2)
        return self._dots(mark.symbol, mark.size, x, y, color)

    def _dots(self, symbol: str, size: float, x: Any, y: Any, color: Any) -> Any:
        shape, area = symbol.removesuffix("-open"), (_POINTS * size) ** 2
        thin = shape in _THIN
        faces = {} if thin else {"edgecolors": color, "facecolors": "none" if shape != symbol else color}
        width = 0 if isinstance(color, tuple) and color[3] < 1 else 0.8  # seen through, an edge would be a ring
        look: Any = {"marker": _SYMBOLS[shape], "s": area, "linewidths": width, "zorder": 3}
        return self.axes.scatter(x, y, **look, **(faces or {"c": color}))

    def _scaled(self, mark: Points, x: Any, y: Any, scale: Scale) -> Any:
        look: Any = {"cmap": "cividis", "vmin": scale.low, "vmax": scale.high}
        look |= {"linewidths": 1} if mark.symbol in _THIN else {"edgecolors": QUIET, "linewidths": 0.4}
        area, colors = (_POINTS * mark.size) ** 2, _values(mark.color)
        drawn = self.axes.scatter(x, y, s=area, marker=_SYMBOLS[mark.symbol], c=colors, zorder=3, **look)
        self._bar_of(drawn, scale)
        return drawn

    def _matrix(self, mark: Matrix) -> None:
        values, scale = np.atleast_2d(np.asarray(mark.values, float)), mark.scale
        edges = [np.arange(count + 1) - 0.5 for count in reversed(values.shape)]
        look: Any = {
            "cmap": "cividis",
            "vmin": scale.low,
            "vmax": scale.high,
            "edgecolors": "#ffffff",
            "linewidth": 0.5,
        }
        drawn = self.axes.pcolormesh(*edges, values, **look)
        size = float(np.clip(60 / max(values.shape), 3, 7))
        for (row, column), value in np.ndenumerate(values):
            ink = "#000000" if (value - scale.low) / (scale.high - scale.low) > 0.6 else "#ffffff"
            middle: Any = {"ha": "center", "va": "center", "fontsize": size, "color": ink}
            self.axes.text(column, row, mark.cells[row][column], **middle)
        self._bar_of(drawn, scale)

    def _bar_of(self, drawn: Any, scale: Scale) -> None:
        if scale.shown:
            inside = self.axes.inset_axes((1.02, 0.0, 0.025, 1.0))
            self.axes.figure.colorbar(drawn, cax=inside, label=scale.title)

    def _region(self, mark: Region) -> Any:
        from matplotlib.patches import Rectangle

        (left, right), (bottom, top) = mark.across, mark.up or (0, 1)
        place = self.axes.transData if mark.up else self.axes.get_xaxis_transform()
        color = self._color(mark.color)
        look: Any = (
            {"facecolor": "none", "edgecolor": color, "linewidth": _POINTS} if mark.outline else {"facecolor": color}
        )
        box = Rectangle((left, bottom), right - left, top - bottom, zorder=0.4, transform=place, **look)
        return self.axes.add_patch(box)


def _values(values: ArrayLike) -> Any:
    """Dates as dates, None as NaN."""
    found = np.asarray(values)
    if found.dtype.kind == "U":
        return [datetime.fromisoformat(each) for each in found.tolist()]
    return found.astype(float)
