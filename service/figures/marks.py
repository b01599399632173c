"""What a figure is described with: marks on panels between axes. `screen` makes Plotly's JSON of a
figure, `paper` a print.

Texts are plain; a line break is a line break. `hover` alone is a template of Plotly's: empty where
its own will do, None where nothing is said.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from fecore.quantities import SHOWN
from service.figures.colors import BAND, MEASURED, OUTSIDE, QUIET

Dash = Literal["solid", "dash", "dot"]
Kind = Literal["linear", "log", "powers", "decades", "date"]

_WHOLE = (0.0, 1.0)  # share of a figure
LONGEST_NAME, MOST_NAMES = 50, 40
MANY_NAMES = 16  # below an axis, beyond which they stand upright


@dataclass(frozen=True, eq=False)
class Axis:
    """An axis. Panels that have the same one are scaled together."""

    title: str = ""  # with the unit
    # `powers` is logarithmic with numbers as powers of ten, `decades` names these alone
    kind: Kind = "linear"
    range: Sequence[float] | None = None  # values at its ends; None for what the marks need
    ticks: Mapping[float, str] | None = None  # names by value; None for numbers
    grid: bool = True
    few: bool = False  # with room for four numbers only
    bare: bool = False  # without numbers and grid, where the height alone says something
    hidden: bool = False
    down: bool = False  # values grow downwards

    @property
    def log(self) -> bool:
        """Whether it is logarithmic."""
        return self.kind in ("log", "powers", "decades")


def named_axis(title: str, names: Sequence[str], **more: Any) -> Axis:
    """An axis whose places 0, 1, 2, … have names, every other one where there are many, and so
    on.
    """
    step = -(-len(names) // MOST_NAMES) or 1
    ticks: dict[float, str] = {place: names[place] for place in range(0, len(names), step)}
    return Axis(title, ticks=ticks, grid=False, **more)


def rows_axis(names: Sequence[str]) -> Axis:
    """An axis of named rows, the first one on top."""
    return named_axis("", names, range=(len(names) - 0.4, -0.6))


def decades(values: ArrayLike) -> Kind:
    """The kind of a logarithmic axis of these values: over more than two decades only powers of ten
    are named.
    """
    array = np.asarray(values, dtype=float)
    array = array[np.isfinite(array) & (array > 0)]
    return "decades" if array.size > 0 and array.max() > 100 * array.min() else "powers"


@dataclass(frozen=True, eq=False)
class Panel:
    """A place for marks, between these shares of the figure's width and height."""

    x: Axis
    y: Axis
    across: tuple[float, float] = _WHOLE
    up: tuple[float, float] = _WHOLE
    title: str = ""  # above its left corner
    over: bool = False  # over the panel before, with an axis of its own at the right


@dataclass(frozen=True, eq=False, kw_only=True)
class Common:
    """What all marks may have."""

    panel: Panel | None = None  # None for the figure's first
    hover: str | None = ""
    text: Sequence[str] = ()  # of each point, for `hover`
    ids: Sequence[Any] = ()  # of each point, for a page that opens something
    group: str = ""  # marks that one entry of the legend switches
    meta: str = ""  # a sentence, for a page
    digits: int = 7  # significant ones of y
    listed: bool = True  # in the legend, where it has a name


@dataclass(frozen=True, eq=False)
class Curve(Common):
    """A line through points; with `symbol` the points are marked too, each in a colour of its own
    where `dots` has them.
    """

    x: ArrayLike
    y: ArrayLike
    name: str = ""
    color: str = MEASURED
    dash: Dash = "solid"
    width: float = 1.5
    symbol: str = ""
    size: float = 5
    dots: Sequence[str] = ()


@dataclass(frozen=True, eq=False)
class Band(Common):
    """The space between two curves."""

    x: ArrayLike
    low: ArrayLike
    high: ArrayLike
    name: str = ""
    color: str = BAND


@dataclass(frozen=True, eq=False)
class Scale:
    """What colours from Cividis stand for: values at both ends, and a bar with a title, its middle
    and length as shares of the figure's height.
    """

    title: str
    low: float
    high: float
    shown: bool = True
    middle: float = 0.5
    length: float = 1.0


@dataclass(frozen=True, eq=False)
class Points(Common):
    """Points with error bars: (n,) to both sides, or (2, n) below and above. Colours of numbers are
    those of the scale.
    """

    x: ArrayLike
    y: ArrayLike
    name: str = ""
    color: Any = MEASURED
    symbol: str = "circle"
    size: float = 8
    error_x: ArrayLike | None = None
    error_y: ArrayLike | None = None
    scale: Scale | None = None


@dataclass(frozen=True, eq=False)
class Bars(Common):
    """Lying bars at places up, from a base."""

    length: ArrayLike
    place: ArrayLike
    base: ArrayLike
    name: str = ""
    color: str = QUIET
    width: float = 0.7


@dataclass(frozen=True, eq=False)
class Matrix(Common):
    """Cells in the colours of a scale, (n, m) values, NaN where there is none; each with a text
    where there is room.
    """

    values: ArrayLike
    cells: Sequence[Sequence[str]]
    scale: Scale
    name: str = ""


@dataclass(frozen=True, eq=False)
class Rule(Common):
    """A line over a whole panel: upright at a value of x, or level at one of y."""

    at: float
    color: str = QUIET
    dash: Dash = "dot"
    level: bool = False


@dataclass(frozen=True, eq=False)
class Region(Common):
    """A part of a panel below everything else, of its whole height where `up` is None; filled, or
    its outline alone.
    """

    across: tuple[float, float]
    color: str = OUTSIDE
    up: tuple[float, float] | None = None
    outline: bool = False


Mark = Curve | Band | Points | Bars | Matrix | Rule | Region


@dataclass(frozen=True, eq=False)
class Figure:
    """A figure: at least one panel, and marks in the order in which they are drawn and stand in the
    legend.
    """

    title: str
    marks: Sequence[Mark]
    panels: Sequence[Panel]
    height: int | None = None  # pixels; None for the usual one
    margins: Mapping[str, int] | None = (
        None  # pixels beside the panels by `l`, `r`, `t`, `b`, where they are not the usual ones
    )
    note: str = ""  # in the middle of the first panel, where there is nothing to draw
    meta: Mapping[str, Any] | None = None  # what a page needs to know of it, as JSON


def shown_value(value: float, unit: str) -> str:
    """A value in the unit in which it is drawn, to three digits."""
    factor, name = SHOWN.get(unit, (1.0, unit))
    return f"{value * factor:.3g} {name}".removesuffix(" –")


def words(title: str, sentence: str) -> Figure:
    """A figure that has nothing to draw and says why."""
    return Figure(title, [], [Panel(Axis(hidden=True), Axis(hidden=True))], note=sentence)


def shortened(name: str, longest: int = LONGEST_NAME) -> str:
    """A name given by a person, cut where it is too long for a title."""
    return name if len(name) <= longest else name[: longest - 1] + "…"


_OF_MODE = re.compile(r"\b(frequency|damping_ratio|zeta)_?(\d+)\b")


def mode_words(text: str) -> str:
    """A text in which values of modes, as monitors name them, are called as people do.

    >>> mode_words("Ex, frequency_2, zeta1")
    'Ex, mode 2 frequency, mode 1 damping ratio'
    """
    return _OF_MODE.sub(
        lambda m: f"mode {m[2]} {'frequency' if m[1] == 'frequency' else 'damping ratio'}", text
    )


def counted(count: int, noun: str, nouns: str = "") -> str:
    """A number of things in words, with the plural where it is not the noun and an s.

    >>> counted(1, "FRF"), counted(2, "ply", "plies")
    ('1 FRF', '2 plies')
    """
    return f"{count} {noun if count == 1 else nouns or noun + 's'}"
