"""A figure for paper: drawn with matplotlib as SVG, PNG or PDF. The same figure gives the same
bytes.
"""

from __future__ import annotations

import io
import json
import re
import textwrap
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Any, Literal, assert_never

import numpy as np
from numpy.typing import ArrayLike

from service.figures.colors import GRID, GROUND, MEASURED, QUIET, Theme, themed
from service.figures.marks import (
    MANY_NAMES,
    Axis,
    Band,
    Bars,
    Curve,
    Figure,
    Mark,
    Matrix,
    Panel,
    Points,
    Region,
    Rule,
    Scale,
)
from service.figures.screen import screen

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis as Drawn
    from matplotlib.figure import Figure as Sheet

Format = Literal["plotly", "svg", "png", "pdf"]
MEDIA_TYPES: dict[Format, str] = {
    "plotly": "application/json",
    "svg": "image/svg+xml",
    "png": "image/png",
    "pdf": "application/pdf",
}

WIDTH_INCHES, HEIGHT_PIXELS = 7.0, 500
DPI = 200
# how many of a figure's pixels, of its height and margins, make an inch of paper
PIXELS_AN_INCH = 100.0
_MARGINS = {"l": 84, "r": 21, "t": 45, "b": 85}
_LETTERS_ACROSS = 80  # of names below an axis, from which they lean
MOST_SQUARES = 2500  # of a matrix, that a drawing has one by one
_LEGEND_LETTERS = 128  # of a legend's line
_RC: Any = {
    "font.size": 8,
    "text.parse_math": False,  # a $ in a name is a $
    "svg.hashsalt": "modalbase",
    "svg.fonttype": "path",
    "pdf.fonttype": 42,
    "path.simplify_threshold": 0.2,
}


def render(
    figure: Figure, file_format: Format, theme: Theme = "light", *, letters: bool = False
) -> bytes:
    """A figure as a file; `plotly` is the JSON of `screen`. With `letters` a drawing has its words as
    text, for a reader that has the font.
    """
    if file_format == "plotly":
        return json.dumps(screen(figure, theme), allow_nan=False, separators=(",", ":")).encode()
    from matplotlib import rc_context

    metadata = {"svg": {"Date": None}, "png": {"Software": None}, "pdf": {"CreationDate": None}}[
        file_format
    ]
    buffer = io.BytesIO()
    with rc_context(_RC | ({"svg.fonttype": "none"} if letters else {})):
        draw(figure, theme).savefig(buffer, format=file_format, dpi=DPI, metadata=metadata)
    return _without_styles(buffer.getvalue()) if file_format == "svg" else buffer.getvalue()


_SHEET = re.compile(rb"\s*<defs>\s*<style type=\"text/css\">\*\{([^}]*)\}</style>\s*</defs>")
_STYLE = re.compile(rb' style="([^"]*)"')


def _without_styles(svg: bytes) -> bytes:
    """A drawing with attributes in place of styles, which the policy of an answer of the API
    refuses: it would be black.
    """

    def attributes(style: re.Match[bytes]) -> bytes:
        stated = dict(each.split(b":", 1) for each in style[1].split(b";") if b":" in each)
        return b"".join(
            b' %s="%s"' % (name.strip(), value.strip()) for name, value in stated.items()
        )

    usual = _SHEET.search(svg)
    if usual is not None:  # what all elements have, they inherit
        svg = _SHEET.sub(b"", svg).replace(b"<svg ", b"<svg" + attributes(usual) + b" ", 1)
    return _STYLE.sub(attributes, svg)


def draw(figure: Figure, theme: Theme = "light") -> Sheet:
    """A figure on a sheet of matplotlib."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure as Sheet

    ink = themed(MEASURED, theme)
    height = (figure.height or HEIGHT_PIXELS) / PIXELS_AN_INCH
    sheet = Sheet(figsize=(WIDTH_INCHES, height), facecolor=themed(GROUND, theme))
    FigureCanvasAgg(sheet)
    panels = _panels(sheet, figure, theme)
    handles: dict[str, Any] = {}
    for mark in figure.marks:
        handle = Pen(panels[mark.panel or figure.panels[0]], theme).draw(mark)
        if mark.listed and (name := getattr(mark, "name", "")):
            handles.setdefault(name, handle)
    for panel, axes in panels.items():
        _scale(axes.xaxis, panel.x)
        _scale(axes.yaxis, panel.y)
        axes.text(
            0,
            1,
            _folded(panel.title, 120),
            transform=axes.transAxes,
            va="bottom",
            fontsize=7.15,
            color=ink,
        )
    if figure.note:
        axes = panels[figure.panels[0]]
        middle: Any = {
            "transform": axes.transAxes,
            "ha": "center",
            "va": "center",
            "fontsize": 8.25,
            "color": ink,
        }
        axes.text(0.5, 0.5, _folded(figure.note, 120), **middle)
    sheet.suptitle(_folded(figure.title, 110), fontsize=9, y=1 - 0.15 / height, color=ink)
    if handles:
        look: Any = {
            "ncols": _columns(list(handles)),
            "frameon": False,
            "fontsize": 7,
            "markerscale": 0.7,
        }
        sheet.legend(handles.values(), handles.keys(), loc="lower center", labelcolor=ink, **look)
    return sheet


def _columns(names: list[str]) -> int:
    """How many columns of a legend fit side by side: each is as wide as its longest name and the
    sample before it.
    """

    def letters(columns: int) -> int:
        return sum(
            max(map(len, column), default=0) + 9 for column in np.array_split(names, columns)
        )

    return next((columns for columns in (4, 3, 2) if letters(columns) <= _LEGEND_LETTERS), 1)


def _folded(text: str, columns: int) -> str:
    """A text on lines of so many letters; matplotlib's own folding reads TeX even where it shall
    not.
    """
    return "\n".join(textwrap.fill(line, columns) for line in text.split("\n"))


def _panels(sheet: Sheet, figure: Figure, theme: Theme) -> dict[Panel, Axes]:
    """Axes of each panel; what shares an axis is scaled together. Of panels on one axis only the
    lowest, and the leftmost, have its numbers.
    """
    margin = _MARGINS | dict(figure.margins or {})
    wide, high = PIXELS_AN_INCH * WIDTH_INCHES, figure.height or HEIGHT_PIXELS
    left, bottom = margin["l"] / wide, margin["b"] / high
    width, height = 1 - margin["r"] / wide - left, 1 - margin["t"] / high - bottom
    drawn: dict[Panel, Axes] = {}
    for panel in figure.panels:
        (from_x, to_x), (from_y, to_y) = panel.across, panel.up
        box = (
            left + from_x * width,
            bottom + from_y * height,
            (to_x - from_x) * width,
            (to_y - from_y) * height,
        )
        beside = next((axes for other, axes in drawn.items() if other.y is panel.y), None)
        above = next((axes for other, axes in drawn.items() if other.x is panel.x), None)
        axes = drawn[panel] = sheet.add_axes(box, sharex=above, sharey=beside)
        axes.set_facecolor("none" if panel.over else themed(GROUND, theme))
        lowest = panel.up[0] <= min(other.up[0] for other in figure.panels if other.x is panel.x)
        leftmost = panel.across[0] <= min(
            other.across[0] for other in figure.panels if other.y is panel.y
        )
        _dress(axes.xaxis, panel.x, theme, named=lowest)
        _dress(axes.yaxis, panel.y, theme, named=leftmost)
        for side in axes.spines.values():
            side.set(
                color=themed(MEASURED, theme),
                linewidth=0.6,
                visible=not (panel.x.hidden and panel.y.hidden),
            )
        axes.set_axisbelow(True)
    return drawn


def _dress(drawn: Drawn, axis: Axis, theme: Theme, *, named: bool) -> None:
    """Title, ticks and grid."""
    ink, axes = themed(MEASURED, theme), drawn.axes
    which: Any = drawn.axis_name  # type: ignore[attr-defined]  # x or y; matplotlib's types lack it
    labels = {"labelbottom" if which == "x" else "labelleft": named and not axis.bare}
    axes.tick_params(
        axis=which, which="both", colors=ink, **labels, **({"left": False} if axis.bare else {})
    )
    if named:
        drawn.set_label_text(axis.title, color=ink)
    if axis.grid and not axis.bare:
        drawn.grid(visible=True, color=themed(GRID, theme), linewidth=0.5)
    if axis.kind == "date":
        drawn.axis_date()
    if axis.log:
        axes.set(**{f"{which}scale": "log"})
        drawn.set_major_formatter(_power_of_ten)
        drawn.set_minor_formatter("")
    if axis.few:
        axes.locator_params(axis=which, nbins=4)
    drawn.set_visible(not axis.hidden)


def _power_of_ten(value: float, _: float) -> str:
    return "10" + str(round(np.log10(value))).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def _scale(drawn: Drawn, axis: Axis) -> None:
    """Ticks and range, once everything is drawn."""
    across = drawn.axis_name == "x"  # type: ignore[attr-defined]
    if axis.ticks is not None:
        names = list(axis.ticks.values())
        drawn.set_ticks(list(axis.ticks), names)
        drawn.set_tick_params(length=0)
        if across and sum(len(name) + 2 for name in names) > _LETTERS_ACROSS:
            turned = (
                {"rotation": 90, "va": "center"} if len(names) > MANY_NAMES else {"rotation": 30}
            )
            for label in drawn.get_ticklabels():
                label.set(**turned, ha="right", rotation_mode="anchor")
    if axis.range is not None:
        (drawn.axes.set_xlim if across else drawn.axes.set_ylim)(*axis.range)
    elif axis.down:
        drawn.set_inverted(True)


_DASHES = {"solid": "-", "dash": "--", "dot": ":"}
_SYMBOLS = {
    "circle": "o",
    "diamond": "D",
    "square": "s",
    "x": "x",
    "cross": "+",
    "triangle-up": "^",
}
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
                return self.axes.fill_between(
                    _values(mark.x), _values(mark.low), _values(mark.high), **look
                )
            case Points():
                return self._points(mark)
            case Bars():
                places, lengths = _values(mark.place), _values(mark.length)
                return self.axes.barh(
                    places, lengths, mark.width, left=mark.base, color=self._color(mark.color)
                )
            case Matrix():
                return self._matrix(mark)
            case Rule():
                rule = self.axes.axhline if mark.level else self.axes.axvline
                return rule(
                    mark.at,
                    color=self._color(mark.color),
                    linestyle=_DASHES[mark.dash],
                    linewidth=_POINTS,
                )
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
            self._dots(
                mark.symbol, mark.size, x, y, [self._color(each) for each in mark.dots] or color
            )
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
        faces = (
            {}
            if thin
            else {"edgecolors": color, "facecolors": "none" if shape != symbol else color}
        )
        # seen through, an edge would be a ring
        width = 0 if isinstance(color, tuple) and color[3] < 1 else 0.8
        look: Any = {"marker": _SYMBOLS[shape], "s": area, "linewidths": width, "zorder": 3}
        return self.axes.scatter(x, y, **look, **(faces or {"c": color}))

    def _scaled(self, mark: Points, x: Any, y: Any, scale: Scale) -> Any:
        look: Any = {"cmap": "cividis", "vmin": scale.low, "vmax": scale.high}
        look |= (
            {"linewidths": 1} if mark.symbol in _THIN else {"edgecolors": QUIET, "linewidths": 0.4}
        )
        area, colors = (_POINTS * mark.size) ** 2, _values(mark.color)
        drawn = self.axes.scatter(
            x, y, s=area, marker=_SYMBOLS[mark.symbol], c=colors, zorder=3, **look
        )
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
            # as a picture within a drawing: thousands of squares took 4 MB and most of the time
            "rasterized": values.size > MOST_SQUARES,
        }
        drawn = self.axes.pcolormesh(*edges, values, **look)
        size = float(np.clip(60 / max(values.shape), 3, 7))
        for (row, column), value in np.ndenumerate(values):
            if not (text := mark.cells[row][column]):
                continue  # to make thousands of empty ones takes longer than all else of a report
            ink = "#000000" if (value - scale.low) / (scale.high - scale.low) > 0.6 else "#ffffff"
            middle: Any = {"ha": "center", "va": "center", "fontsize": size, "color": ink}
            self.axes.text(column, row, text, **middle)
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
            {"facecolor": "none", "edgecolor": color, "linewidth": _POINTS}
            if mark.outline
            else {"facecolor": color}
        )
        box = Rectangle(
            (left, bottom), right - left, top - bottom, zorder=0.4, transform=place, **look
        )
        return self.axes.add_patch(box)


def _values(values: ArrayLike) -> Any:
    """Dates as dates, None as NaN."""
    array = np.asarray(values)
    if array.dtype.kind == "U":
        return [datetime.fromisoformat(each) for each in array.tolist()]
    return array.astype(float)
