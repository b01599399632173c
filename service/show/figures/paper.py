"""A figure for paper: drawn with matplotlib as SVG, PNG or PDF. The same figure gives the same bytes."""

from __future__ import annotations

import io
import json
import textwrap
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from service.show.figures.colors import GRID, GROUND, MEASURED, Theme, themed
from service.show.figures.marks import MANY_NAMES, Axis, Figure, Panel
from service.show.figures.screen import screen

if TYPE_CHECKING:  # matplotlib is loaded by the first print: every start of an API or a worker would wait for it
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
PIXELS_AN_INCH = 100.0  # how many of a figure's pixels, of its height and margins, make an inch of paper
_MARGINS = {"l": 84, "r": 21, "t": 45, "b": 85}
_LETTERS_ACROSS = 80  # of names below an axis, from which they lean
_LEGEND_LETTERS = 128  # of a legend's line
_RC: Any = {
    "font.size": 8,
    "text.parse_math": False,  # a $ in a name is a $
    "svg.hashsalt": "modalbase",
    "svg.fonttype": "path",
    "pdf.fonttype": 42,
    "path.simplify_threshold": 0.2,
}


def render(figure: Figure, file_format: Format, theme: Theme = "light", dpi: int = DPI) -> bytes:
    """A figure as a file; `plotly` is the JSON of `screen`, `dpi` the resolution of a PNG."""
    if file_format == "plotly":
        return json.dumps(screen(figure, theme), allow_nan=False, separators=(",", ":")).encode()
    from matplotlib import rc_context

    metadata = {"svg": {"Date": None}, "png": {"Software": None}, "pdf": {"CreationDate": None}}[file_format]
    buffer = io.BytesIO()
    with rc_context(_RC):
        draw(figure, theme).savefig(buffer, format=file_format, dpi=dpi, metadata=metadata)
    return buffer.getvalue()


def pixels(figure: Figure, dpi: int = DPI) -> Any:
    """A figure as (height, width, 3) bytes of red, green and blue, for a program that stores pictures itself."""
    from matplotlib import rc_context

    with rc_context(_RC):
        sheet = draw(figure)
        sheet.set_dpi(dpi)
        canvas: Any = sheet.canvas
        canvas.draw()
        return np.ascontiguousarray(np.asarray(canvas.buffer_rgba())[..., :3])


def draw(figure: Figure, theme: Theme = "light") -> Sheet:
    """A figure on a sheet of matplotlib."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure as Sheet

    from service.show.figures.paper_marks import Pen

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
        axes.text(0, 1, _folded(panel.title, 120), transform=axes.transAxes, va="bottom", fontsize=7.15, color=ink)
    if figure.note:
        axes = panels[figure.panels[0]]
        middle: Any = {"transform": axes.transAxes, "ha": "center", "va": "center", "fontsize": 8.25, "color": ink}
        axes.text(0.5, 0.5, _folded(figure.note, 120), **middle)
    sheet.suptitle(_folded(figure.title, 110), fontsize=9, y=1 - 0.15 / height, color=ink)
    if handles:
        look: Any = {"ncols": _columns(list(handles)), "frameon": False, "fontsize": 7, "markerscale": 0.7}
        sheet.legend(handles.values(), handles.keys(), loc="lower center", labelcolor=ink, **look)
    return sheet


def _columns(names: list[str]) -> int:
    """How many columns of a legend fit side by side: each is as wide as its longest name and the sample before it."""

    def letters(columns: int) -> int:
        return sum(max(map(len, column), default=0) + 9 for column in np.array_split(names, columns))

    return next((columns for columns in (4, 3, 2) if letters(columns) <= _LEGEND_LETTERS), 1)


def _folded(text: str, columns: int) -> str:
    """A text on lines of so many letters; matplotlib's own folding reads TeX even where it shall not."""
    return "\n".join(textwrap.fill(line, columns) for line in text.split("\n"))


def _panels(sheet: Sheet, figure: Figure, theme: Theme) -> dict[Panel, Axes]:
    """Axes of each panel; what shares an axis is scaled together. Of panels on one axis only the lowest, and the leftmost, have
    its numbers.
    """
    margin = _MARGINS | dict(figure.margins or {})
    wide, high = PIXELS_AN_INCH * WIDTH_INCHES, figure.height or HEIGHT_PIXELS
    left, bottom = margin["l"] / wide, margin["b"] / high
    width, height = 1 - margin["r"] / wide - left, 1 - margin["t"] / high - bottom
    drawn: dict[Panel, Axes] = {}
    for panel in figure.panels:
        (from_x, to_x), (from_y, to_y) = panel.across, panel.up
        box = left + from_x * width, bottom + from_y * height, (to_x - from_x) * width, (to_y - from_y) * height
        beside = next((axes for other, axes in drawn.items() if other.y is panel.y), None)
        above = next((axes for other, axes in drawn.items() if other.x is panel.x), None)
        axes = drawn[panel] = sheet.add_axes(box, sharex=above, sharey=beside)
        axes.set_facecolor("none" if panel.over else themed(GROUND, theme))
        lowest = panel.up[0] <= min(other.up[0] for other in figure.panels if other.x is panel.x)
        leftmost = panel.across[0] <= min(other.across[0] for other in figure.panels if other.y is panel.y)
        _dress(axes.xaxis, panel.x, theme, named=lowest)
        _dress(axes.yaxis, panel.y, theme, named=leftmost)
        for side in axes.spines.values():
            side.set(color=themed(MEASURED, theme), linewidth=0.6, visible=not (panel.x.hidden and panel.y.hidden))
        axes.set_axisbelow(True)
    return drawn


def _dress(drawn: Drawn, axis: Axis, theme: Theme, *, named: bool) -> None:
    """Title, ticks and grid."""
    ink, axes = themed(MEASURED, theme), drawn.axes
    which: Any = drawn.axis_name  # type: ignore[attr-defined]  # x or y; matplotlib's types lack it
    labels = {"labelbottom" if which == "x" else "labelleft": named and not axis.bare}
    axes.tick_params(axis=which, which="both", colors=ink, **labels, **({"left": False} if axis.bare else {}))
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
            turned = {"rotation": 90, "va": "center"} if len(names) > MANY_NAMES else {"rotation": 30}
            for label in drawn.get_ticklabels():
                label.set(**turned, ha="right", rotation_mode="anchor")
    if axis.range is not None:
        (drawn.axes.set_xlim if across else drawn.axes.set_ylim)(*axis.range)
    elif axis.down:
        drawn.set_inverted(True)
