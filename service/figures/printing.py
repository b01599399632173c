"""Print: a Plotly figure of ours drawn with matplotlib as SVG, PNG or PDF.

It knows what our figures are made of (scatter traces with lines, markers, error bars and filled bands, stacked panels with
shared x, dates, annotations) and refuses anything else, so that a print never lacks something without a word.
"""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from datetime import datetime
from html import unescape
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from service.figures.look import Figure

if TYPE_CHECKING:  # matplotlib is loaded by the first print: every start of an API or a worker would wait for it
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Sheet

Format = Literal["plotly", "svg", "png", "pdf"]
MEDIA_TYPES: dict[Format, str] = {
    "plotly": "application/json",
    "svg": "image/svg+xml",
    "png": "image/png",
    "pdf": "application/pdf",
}

SIZE_INCHES = (7.0, 5.0)
DPI = 200
_DASHES = {"solid": "-", "dash": "--", "dot": ":", "dashdot": "-."}
_SYMBOLS = {"circle": "o", "diamond": "D", "square": "s", "x": "x", "cross": "+"}
_POINTS = 0.75  # of a CSS pixel
_RC: Any = {
    "font.size": 8,
    "text.parse_math": False,  # a $ in a name is a $
    "svg.hashsalt": "modalbase",
    "svg.fonttype": "path",
    "pdf.fonttype": 42,
}


def render(figure: Figure, file_format: Format) -> bytes:
    """A figure as a file; the same figure gives the same bytes.

    Raises:
        ValueError: the figure holds what this does not draw.
    """
    if file_format == "plotly":
        return json.dumps(figure, allow_nan=False).encode()
    from matplotlib import rc_context

    metadata = {"svg": {"Date": None}, "png": {"Software": None}, "pdf": {"CreationDate": None}}[file_format]
    buffer = io.BytesIO()
    with rc_context(_RC):
        sheet = draw(figure)
        sheet.savefig(buffer, format=file_format, dpi=DPI, metadata=metadata)
    return buffer.getvalue()


def draw(figure: Figure) -> Sheet:
    """A Plotly figure on a sheet of matplotlib, with the traces, axes and colours that the figure states.

    Args:
        figure: of lines, markers and bands, as `service.figures.series` builds it.

    Raises:
        ValueError: the figure holds what this does not draw, which would otherwise be missing on paper.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure as Sheet

    layout = figure["layout"]
    sheet = Sheet(figsize=SIZE_INCHES)
    FigureCanvasAgg(sheet)
    panels = _panels(sheet, layout)
    below: dict[str, Mapping[str, Any]] = {}
    handles: dict[str, Any] = {}
    for trace in figure["data"]:
        name = trace.get("yaxis", "y")
        handle = _trace(panels[name], trace, below.get(name))
        below[name] = trace
        if trace.get("showlegend", True) and trace.get("name"):
            handles.setdefault(trace["name"], handle)
    for note in layout.get("annotations", ()):
        sheet.text(note["x"], note["y"], note["text"], ha="center", wrap=True)
    sheet.suptitle(unescape(layout["title"]["text"]), fontsize=9, y=0.97)
    if handles:
        sheet.legend(
            handles.values(), handles.keys(), loc="lower center", ncols=4, frameon=False, fontsize=7, markerscale=0.7
        )
    return sheet


def _panels(sheet: Sheet, layout: Mapping[str, Any]) -> dict[str, Axes]:
    """Axes by Plotly's name of their y axis, stacked by their domains, sharing x."""
    left, right, bottom, top = 0.12, 0.97, 0.17, 0.91
    panels: dict[str, Axes] = {}
    for key in sorted(k for k in layout if k.startswith("yaxis")):
        low, high = layout[key].get("domain", (0.0, 1.0))
        shared = next(iter(panels.values()), None)
        box = (left, bottom + low * (top - bottom), right - left, (high - low) * (top - bottom))
        axes = sheet.add_axes(box, sharex=shared)
        axes.set_ylabel(layout[key]["title"]["text"])
        axes.grid(visible=True, color="#dddddd", linewidth=0.5)
        axes.set_axisbelow(True)
        panels[key.replace("axis", "")] = axes
    lowest = min(panels.values(), key=lambda axes: axes.get_position().y0)
    for axes in panels.values():
        axes.tick_params(labelbottom=axes is lowest)
    lowest.set_xlabel(layout["xaxis"]["title"]["text"])
    if layout["xaxis"].get("type") == "date":
        lowest.xaxis_date()
    return panels


def _trace(axes: Axes, trace: Mapping[str, Any], below: Mapping[str, Any] | None) -> Any:
    if trace["type"] != "scatter":
        raise ValueError(f"a trace of type {trace['type']!r} cannot be printed")
    x, y = _numbers(trace["x"]), _numbers(trace["y"])
    if trace.get("fill") == "tonexty":
        if below is None:
            raise ValueError("a band has no trace below it")
        color, alpha = _color(trace["fillcolor"])
        return axes.fill_between(x, _numbers(below["y"]), y, color=color, alpha=alpha, linewidth=0)
    line, marker = trace.get("line", {}), trace.get("marker", {})
    lines, markers = "lines" in trace["mode"], "markers" in trace["mode"]
    handle: Any = None
    if lines:
        color, alpha = _color(line["color"])
        dash = _DASHES[line.get("dash", "solid")]
        (handle,) = axes.plot(x, y, dash, color=color, alpha=alpha, linewidth=_POINTS * line.get("width", 2))
    if "error_y" in trace:
        error = trace["error_y"]
        axes.errorbar(x, y, _numbers(error["array"]), fmt="none", ecolor=error["color"], elinewidth=0.8, capsize=2)
    if markers:
        symbol, hollow = marker["symbol"].removesuffix("-open"), marker["symbol"].endswith("-open")
        size = (_POINTS * marker["size"]) ** 2
        faces = "none" if hollow else marker["color"]
        dots = axes.scatter(
            x, y, s=size, marker=_SYMBOLS[symbol], facecolors=faces, edgecolors=marker["color"], zorder=3
        )
        handle = handle or dots
    return handle


def _numbers(values: list[Any]) -> Any:
    """Dates as dates, None as NaN."""
    if values and isinstance(values[0], str):
        return [datetime.fromisoformat(value) for value in values]
    return np.array([np.nan if value is None else value for value in values], float)


def _color(css: str) -> tuple[str | tuple[float, float, float], float]:
    """A colour as matplotlib wants it, and its opacity."""
    if not css.startswith("rgba("):
        return css, 1.0
    red, green, blue, alpha = (float(part) for part in css[5:-1].split(","))
    return (red / 255, green / 255, blue / 255), alpha
