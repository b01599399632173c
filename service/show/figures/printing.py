"""Print: a Plotly figure of ours drawn with matplotlib as SVG, PNG or PDF.

It knows what our figures are made of (traces of `print_traces`; panels by their axes' domains; linear, logarithmic and date
axes; shapes and annotations) and refuses anything else, so that a print never lacks something without a word.
"""

from __future__ import annotations

import io
import json
import textwrap
from collections.abc import Mapping
from html import unescape
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from service.show.figures.look import MANY_NAMES, Figure
from service.show.figures.print_traces import DASHES, add_trace, color_of

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

WIDTH_INCHES, HEIGHT_INCHES = 7.0, 5.0
DPI = 200
PIXELS_AN_INCH = 100.0
"""How many of a layout's pixels, of its height and margins, make an inch of paper."""
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

Panels = dict[tuple[str, str], "Axes"]


def render(figure: Figure, file_format: Format, dpi: int = DPI) -> bytes:
    """A figure as a file; the same figure gives the same bytes.

    Args:
        figure: of lines, markers, bands, bars and matrices, as the modules of this package build it.
        file_format: `plotly` is its JSON.
        dpi: of a PNG.

    Raises:
        ValueError: the figure holds what this does not draw.
    """
    if file_format == "plotly":
        return json.dumps(figure, allow_nan=False, separators=(",", ":")).encode()
    from matplotlib import rc_context

    metadata = {"svg": {"Date": None}, "png": {"Software": None}, "pdf": {"CreationDate": None}}[file_format]
    buffer = io.BytesIO()
    with rc_context(_RC):
        sheet = draw(figure)
        sheet.savefig(buffer, format=file_format, dpi=dpi, metadata=metadata)
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


def draw(figure: Figure) -> Sheet:
    """A Plotly figure on a sheet of matplotlib, with the traces, axes and colours that the figure states.

    Args:
        figure: of lines, markers, bands, bars and matrices, as the modules of this package build it.

    Raises:
        ValueError: the figure holds what this does not draw, which would otherwise be missing on paper.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure as Sheet

    layout = figure["layout"]
    height = layout["height"] / PIXELS_AN_INCH if "height" in layout else HEIGHT_INCHES
    sheet = Sheet(figsize=(WIDTH_INCHES, height), facecolor=layout.get("paper_bgcolor", "#ffffff"))
    FigureCanvasAgg(sheet)
    panels = _panels(sheet, figure, height)
    below: dict[tuple[str, str], Mapping[str, Any]] = {}
    handles: dict[str, Any] = {}
    for trace in figure["data"]:
        name = _panel_of(trace)
        handle = add_trace(panels[name], trace, below.get(name))
        below[name] = trace
        if trace.get("showlegend", True) and trace.get("name"):
            handles.setdefault(unescape(trace["name"]), handle)
    for shape in layout.get("shapes", ()):
        _shape(panels, shape)
    for note in layout.get("annotations", ()):
        _note(panels, note)
    for (x, y), axes in panels.items():
        _scale(axes, layout[_key(x)], layout[_key(y)])
    sheet.suptitle(_folded(layout["title"]["text"], 110), fontsize=9, y=1 - 0.15 / height, color=_ink(layout))
    if handles:
        columns = _columns(list(handles))
        legend = sheet.legend(
            handles.values(),
            handles.keys(),
            loc="lower center",
            ncols=columns,
            frameon=False,
            fontsize=7,
            markerscale=0.7,
        )
        for text in legend.get_texts():
            text.set_color(_ink(layout))
    return sheet


def _columns(names: list[str]) -> int:
    """How many columns of a legend fit side by side: each is as wide as its longest name and the sample before it."""

    def letters(columns: int) -> int:
        return sum(max(map(len, column), default=0) + 9 for column in np.array_split(names, columns))

    return next((columns for columns in (4, 3, 2) if letters(columns) <= _LEGEND_LETTERS), 1)


def _panels(sheet: Sheet, figure: Figure, height: float) -> Panels:
    """Axes by Plotly's names of their x and y axis, placed by the domains; what shares an axis is scaled together."""
    layout = figure["layout"]
    margin = {"l": 84, "r": 21, "t": 45, "b": 85} | layout.get("margin", {})
    left, right = margin["l"] / 100 / WIDTH_INCHES, 1 - margin["r"] / 100 / WIDTH_INCHES
    bottom, top = margin["b"] / 100 / height, 1 - margin["t"] / 100 / height
    wanted = [_panel_of(trace) for trace in figure["data"]] + _axis_pairs(layout)
    panels: Panels = {}
    for x, y in sorted(dict.fromkeys(wanted)):
        (from_x, to_x), (from_y, to_y) = (layout[_key(each)].get("domain", (0.0, 1.0)) for each in (x, y))
        box = (
            left + from_x * (right - left),
            bottom + from_y * (top - bottom),
            (to_x - from_x) * (right - left),
            (to_y - from_y) * (top - bottom),
        )
        beside = next((axes for (_, other), axes in panels.items() if _together(layout, y, other)), None)
        above = next((axes for (other, _), axes in panels.items() if _together(layout, x, other)), None)
        axes = sheet.add_axes(box, sharex=above, sharey=beside)
        axes.set_facecolor("none" if "overlaying" in layout[_key(y)] else layout["plot_bgcolor"])
        panels[x, y] = axes
    for (x, y), axes in panels.items():
        _dress(panels, axes, layout, x, y)
    return panels


def _axis_pairs(layout: Mapping[str, Any]) -> list[tuple[str, str]]:
    """The panels that the axes themselves make: an empty one has axes too."""
    return [(each.get("anchor", "x"), _name(key)) for key, each in layout.items() if key.startswith("yaxis")]


def _together(layout: Mapping[str, Any], one: str, other: str) -> bool:
    return one == other or layout[_key(one)].get("matches") == other or layout[_key(other)].get("matches") == one


def _dress(panels: Panels, axes: Axes, layout: Mapping[str, Any], x: str, y: str) -> None:
    """Titles, ticks and grid; of panels on one axis only the lowest, and the leftmost, have its numbers."""
    along, up = layout[_key(x)], layout[_key(y)]
    below = [other.get_position().y0 for (name, _), other in panels.items() if name == x]
    lowest = axes.get_position().y0 <= min(below)
    axes.tick_params(labelbottom=lowest and along.get("showticklabels", True), colors=_ink(layout), which="both")
    left = min(other.get_position().x0 for (_, name), other in panels.items() if name == y)
    leftmost = axes.get_position().x0 <= left
    axes.tick_params(labelleft=leftmost and up.get("showticklabels", True), left=up.get("showticklabels", True))
    if lowest:
        axes.set_xlabel(along["title"]["text"], color=_ink(layout))
    if leftmost:
        axes.set_ylabel(up["title"]["text"], color=_ink(layout))
    for which, each in (("x", along), ("y", up)):
        if each.get("showgrid", True):
            axes.grid(visible=True, axis=which, color=each["gridcolor"], linewidth=0.5)  # type: ignore[arg-type]
        if each.get("type") == "date":
            (axes.xaxis if which == "x" else axes.yaxis).axis_date()
        if each.get("type") == "log":
            (axes.set_xscale if which == "x" else axes.set_yscale)("log")
            (axes.xaxis if which == "x" else axes.yaxis).set_major_formatter(_power_of_ten)
            (axes.xaxis if which == "x" else axes.yaxis).set_minor_formatter("")
        if "nticks" in each:
            axes.locator_params(axis=which, nbins=each["nticks"])  # type: ignore[arg-type]
        if each.get("visible") is False:
            (axes.xaxis if which == "x" else axes.yaxis).set_visible(False)
    for side in axes.spines.values():
        side.set_color(_ink(layout))
        side.set_linewidth(0.6)
        if along.get("visible") is False and up.get("visible") is False:
            side.set_visible(False)
    axes.set_axisbelow(True)


def _power_of_ten(value: float, _: float) -> str:
    return "10" + str(round(np.log10(value))).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def _scale(axes: Axes, along: Mapping[str, Any], up: Mapping[str, Any]) -> None:
    """Ticks, ranges and proportion, once everything is drawn."""
    for which, each in (("x", along), ("y", up)):
        ticks = axes.xaxis if which == "x" else axes.yaxis
        if "tickvals" in each:
            ticks.set_ticks(each["tickvals"], [unescape(str(text)).replace("<br>", "\n") for text in each["ticktext"]])
            ticks.set_tick_params(length=0)
            if which == "x" and sum(len(str(text)) + 2 for text in each["ticktext"]) > _LETTERS_ACROSS:
                for label in axes.get_xticklabels():
                    upright = len(each["ticktext"]) > MANY_NAMES
                    turned = {"rotation": 90, "va": "center"} if upright else {"rotation": 30}
                    label.set(**turned, ha="right", rotation_mode="anchor")
        if "range" in each:
            low, high = (10.0**end if each.get("type") == "log" else end for end in each["range"])
            (axes.set_xlim if which == "x" else axes.set_ylim)(low, high)
        elif each.get("autorange") == "reversed":
            getattr(axes, f"{which}axis").set_inverted(True)
    if "scaleanchor" in up:
        axes.set_aspect("equal", adjustable="box" if "range" in up else "datalim")


def _shape(panels: Panels, shape: Mapping[str, Any]) -> None:
    """A rectangle or a line, in the units of a panel's axes or, along one of them, over the whole panel."""
    x, y = shape["xref"].removesuffix(" domain"), shape["yref"].removesuffix(" domain")
    axes = panels[x, y]
    over_x, over_y = (shape[ref].endswith(" domain") for ref in ("xref", "yref"))
    transform = {
        (False, False): axes.transData,
        (False, True): axes.get_xaxis_transform(),
        (True, False): axes.get_yaxis_transform(),
        (True, True): axes.transAxes,
    }[over_x, over_y]
    drawn = shape.get("line", {"color": "rgba(0,0,0,0)", "width": 0})
    color, alpha = color_of(drawn["color"])
    style: dict[str, Any] = {"transform": transform, "clip_on": True}
    from matplotlib.lines import Line2D
    from matplotlib.patches import Rectangle

    if shape["type"] == "line":
        ends = [shape["x0"], shape["x1"]], [shape["y0"], shape["y1"]]
        style |= {"linestyle": DASHES[drawn.get("dash", "solid")], "linewidth": 0.75 * drawn["width"]}
        axes.add_line(Line2D(*ends, color=color, alpha=alpha, **style))
    elif shape["type"] == "rect":
        size = shape["x1"] - shape["x0"], shape["y1"] - shape["y0"]
        face, opacity = color_of(shape.get("fillcolor", "rgba(0,0,0,0)"))
        edge = (*np.array(_rgb(color)), alpha)
        axes.add_patch(
            Rectangle(
                (shape["x0"], shape["y0"]), *size, facecolor=(*_rgb(face), opacity), edgecolor=edge, zorder=0.4,
                linewidth=0.75 * drawn["width"], **style,
            )
        )  # fmt: skip
    else:
        raise ValueError(f"a shape of type {shape['type']!r} cannot be printed")


def _folded(text: str, columns: int) -> str:
    """A text on lines of so many letters; matplotlib's own folding reads TeX even where it shall not."""
    return textwrap.fill(unescape(text), columns)


def _note(panels: Panels, note: Mapping[str, Any]) -> None:
    font = note.get("font", {})
    ends = {"left": "left", "center": "center", "right": "right"}
    style: dict[str, Any] = {
        "ha": ends[note.get("xanchor", "center")],
        "va": {"top": "top", "middle": "center", "bottom": "bottom"}[note.get("yanchor", "middle")],
        "fontsize": 0.55 * font.get("size", 15),
        "color": font.get("color", "#000000"),
        "rotation": -note.get("textangle", 0),
    }
    text = "\n".join(_folded(line, 120) for line in note["text"].split("<br>"))
    if note["xref"] == "paper":
        axes = next(iter(panels.values()))
        boxes = [panel.get_position() for panel in panels.values()]
        left, bottom = min(box.x0 for box in boxes), min(box.y0 for box in boxes)
        right, top = max(box.x1 for box in boxes), max(box.y1 for box in boxes)
        axes.figure.text(left + note["x"] * (right - left), bottom + note["y"] * (top - bottom), text, **style)
        return
    x, y = note["xref"].removesuffix(" domain"), note["yref"].removesuffix(" domain")
    axes = panels[x, y]
    place = axes.transAxes if note["xref"].endswith(" domain") else axes.transData
    axes.text(note["x"], note["y"], text, transform=place, **style)


def _rgb(color: Any) -> tuple[float, float, float]:
    from matplotlib.colors import to_rgb

    return to_rgb(color)


def _ink(layout: Mapping[str, Any]) -> str:
    return str(layout["font"].get("color", "#000000"))


def _panel_of(trace: Mapping[str, Any]) -> tuple[str, str]:
    return trace.get("xaxis", "x"), trace.get("yaxis", "y")


def _key(name: str) -> str:
    """Plotly's key of an axis in a layout: y2 stands under yaxis2."""
    return f"{name[0]}axis{name[1:]}"


def _name(key: str) -> str:
    return key.replace("axis", "")
