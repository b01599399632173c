"""What an update found: its parameters beside what was known before, what their variance is made
of, their posterior; damping laws; how the fits came to their end; campaigns of a joint update
beside one another.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle
from typing import Any

import numpy as np
import scipy

from fecore.arrays import FloatArray
from fecore.normal import Z_95
from fecore.quantities import SHOWN
from modalbase.client.results import deviations
from service.figures.colors import ALARM, BAND, INITIAL, MEASURED, PALETTE, QUIET, UPDATED
from service.figures.marks import (
    Axis,
    Bars,
    Curve,
    Dash,
    Figure,
    Mark,
    Panel,
    Points,
    Rule,
    decades,
    named_axis,
    rows_axis,
    shortened,
    shown_value,
)

_Row = tuple[float, Mapping[str, Any]]  # with its place up the figure


def parameters_figure(parameters: Sequence[Mapping[str, Any]], title: str) -> Figure:
    """Prior and posterior of every parameter with their 95 % intervals, each as a share of its
    initial value.

    Args:
        parameters: as a result document has them. One that had no initial value is drawn as a share
            of its estimate.
        title: of the figure.
    """
    prior: list[_Row] = []
    sure: list[_Row] = []
    unsure: list[_Row] = []
    for place, row in enumerate(parameters):
        (sure if row["identifiable"] else unsure).append((place + 0.15, row))
        if row["prior_sd"]:
            reach = Z_95 * row["prior_sd"]
            interval = [row["prior_mean"] - reach, row["prior_mean"] + reach]
            prior.append(
                (place - 0.15, {**row, "estimate": row["prior_mean"], "interval_95": interval})
            )
    marks = [
        *_drawn(prior, "prior", "prior, 95 %", INITIAL, "diamond-open"),
        *_drawn(sure, "updated", "updated, 95 %", UPDATED, "circle"),
        *_drawn(unsure, "updated", "updated, not identifiable", QUIET, "circle-open"),
        Rule(100),
    ]
    names = [f"{row['name']}  {shown_value(row['estimate'], row['unit'])}" for row in parameters]
    panel = Panel(Axis("share of the initial value [%]"), rows_axis(names))
    return Figure(title, marks, [panel], height=190 + 42 * max(len(names), 3), margins={"l": 130})


def _drawn(rows: Sequence[_Row], label: str, name: str, color: str, symbol: str) -> list[Mark]:
    """Estimates with their intervals at places up the figure, in per cent of each row's initial
    value.
    """
    if not rows:
        return []
    per_cent = np.array([100 / (row["initial"] or row["estimate"]) for _, row in rows])
    middle = per_cent * [row["estimate"] for _, row in rows]
    # (of what is negative, such as a change per kelvin, the lower end is the larger share)
    low, high = np.sort(
        per_cent * np.array([row["interval_95"] for _, row in rows], dtype=float).T, axis=0
    )
    hover: Any = {
        "ids": [row["name"] for _, row in rows],
        "hover": "%{customdata}, " + label + ": %{x:.1f} %",
    }
    error = np.array([middle - low, high - middle])
    return [
        Points(middle, [place for place, _ in rows], name, color, symbol, error_x=error, **hover)
    ]


MOST_SOURCES = 9
OTHERS = "other sources"


def budget_figure(parameters: Sequence[Mapping[str, Any]]) -> Figure:
    """A bar for each parameter, divided by the shares of its variance.

    Args:
        parameters: as a result document has them, with `budget`; those without one are left out.
    """
    rows = [row for row in parameters if row["budget"]]
    percent: dict[str, np.ndarray] = {}  # of each source, by parameter
    for place, row in enumerate(rows):
        for entry in row["budget"]:
            percent.setdefault(entry["source"], np.zeros(len(rows)))[place] += 100 * entry["share"]
    sources = sorted(percent, key=lambda source: -percent[source].sum())
    if len(sources) > MOST_SOURCES:
        named = sources[: MOST_SOURCES - 1]
        percent[OTHERS] = sum(
            (percent[source] for source in sources[len(named) :]), np.zeros(len(rows))
        )
        sources = [*named, OTHERS]
    bars, base = [], np.zeros(len(rows))
    for source, color in zip(sources, PALETTE, strict=False):
        name = source.replace("_", " ")
        hover = f"%{{customdata}}, {name}: %{{x:.1f}} %"
        ids = [row["name"] for row in rows]
        bars.append(
            Bars(percent[source], range(len(rows)), base, name, color, hover=hover, ids=ids)
        )
        base = base + percent[source]
    return Figure(
        "What the variance of each parameter is made of",
        bars,
        [
            Panel(
                Axis("share of the variance [%]", range=(0, 100)),
                rows_axis([_named(row) for row in rows]),
            )
        ],
        height=230 + 36 * max(len(rows), 3),
        margins={"l": 120, "b": 120},
    )


def _named(row: Mapping[str, Any]) -> str:
    if not row["estimate"]:
        return f"{row['name']}  ± –"
    sides = deviations(row["estimate"], row["standard_deviation"], row["interval_95"])
    percent = [f"{100 * each / abs(row['estimate']):.2g}" for each in sides]
    return f"{row['name']}  " + (
        f"± {percent[0]} %" if len(percent) == 1 else f"+{percent[0]} −{percent[1]} %"
    )


MOST_PARAMETERS = 8
_SHORT = 7  # letters of a parameter's name that leave room for its unit beside it
_RADII = (1.0, 2.4477)  # of what holds 39 % and 95 % of two Gaussian variables
_SHOWN_SAMPLES = 600
_CLOUD = "rgba(0,114,178,0.35)"
_GAP = 0.12  # between panels, as a share of a panel with its gap
_REACH = 3.2  # standard deviations that are drawn


@dataclass(frozen=True)
class Marginal:
    """One parameter, in the unit in which it is drawn.

    Its posterior is Gaussian to either side of the estimate, in the logarithm where it must be
    positive; between the two sides the standard deviation changes smoothly.
    """

    title: str  # name and unit
    estimate: float  # value
    below: float  # standard deviations to either side, in the coordinate
    above: float
    log: bool  # whether the coordinate is the logarithm
    prior: tuple[float, float] | None  # mean and standard deviation, or None

    def at(self, z: FloatArray) -> FloatArray:
        """Values so many standard deviations from the estimate."""
        reach = (self.below + (self.above - self.below) * scipy.special.ndtr(2 * z)) * z
        moved: FloatArray = self.estimate * np.exp(reach) if self.log else self.estimate + reach
        return moved

    def density(self, z: FloatArray) -> FloatArray:
        """The density at these values, in 1 over the drawn unit: the Gaussian one over the slope of
        the values.
        """
        density: FloatArray = np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi) / np.gradient(self.at(z), z)
        return density


def marginal(row: Mapping[str, Any]) -> Marginal:
    """The marginal of a parameter of a result, of which its 95 % interval is the central part."""
    factor, unit = SHOWN.get(row["unit"], (1.0, row["unit"]))
    (low, high), estimate = row["interval_95"], row["estimate"]
    log = row["unit"] == "Pa" and low > 0
    to = np.log if log else (lambda value: factor * value)
    below, above = (max(float(abs(to(end) - to(estimate))) / Z_95, 1e-9) for end in (low, high))
    prior = (factor * row["prior_mean"], factor * row["prior_sd"]) if row["prior_sd"] else None
    title = row["name"] + ("\n" if len(row["name"]) > _SHORT else " ") + f"[{unit}]"
    return Marginal(title, factor * estimate, below, above, log, prior)


def posterior_figure(
    parameters: Sequence[Mapping[str, Any]],
    correlation: FloatArray,
    samples: FloatArray | None = None,
) -> Figure:
    """A corner plot.

    Args:
        parameters: p rows of a result document, in the order of `correlation`; the first eight are
            drawn.
        correlation: (p, p) of the posterior.
        samples: (n, p) of it, SI, drawn in place of contours; None where the posterior is Gaussian.
    """
    count = min(len(parameters), MOST_PARAMETERS)
    marginals = [marginal(row) for row in parameters[:count]]
    factors = [SHOWN.get(row["unit"], (1.0, ""))[0] for row in parameters[:count]]
    drawn = (
        None
        if samples is None
        else samples[:: -(-len(samples) // _SHOWN_SAMPLES), :count] * factors
    )
    size = (1 - _GAP / count * (count - 1)) / count
    starts = [i * (size + _GAP / count) for i in range(count)]
    limits = [
        (float(of.at(np.array([-_REACH]))[0]), float(of.at(np.array([_REACH]))[0]))
        for of in marginals
    ]
    columns, rows = (
        [Axis(of.title, range=ends, few=True) for of, ends in zip(marginals, limits, strict=True)]
        for _ in "xy"
    )
    marks: list[Mark] = []
    panels: list[Panel] = []
    for i, of in enumerate(marginals):
        up = 1 - starts[i] - size, 1 - starts[i]
        *beside, own = (
            Panel(
                columns[j], rows[i] if j < i else Axis(bare=True), (starts[j], starts[j] + size), up
            )
            for j in range(i + 1)
        )
        panels += [*beside, own]
        marks += _diagonal(of, limits[i], own, first=i == 0)
        for j, panel in enumerate(beside):
            if drawn is None:
                marks += _pair(marginals[j], of, float(correlation[j, i]), panel)
            else:
                marks.append(
                    Points(drawn[:, j], drawn[:, i], "", _CLOUD, size=3, panel=panel, hover=None)
                )
    title = "Posterior: densities and correlations"
    return Figure(title, marks, panels, height=150 + 115 * count, margins={"l": 95})


def _diagonal(
    of: Marginal, limits: tuple[float, float], panel: Panel, *, first: bool
) -> list[Mark]:
    z = np.linspace(-_REACH, _REACH, 65)
    look: dict[str, Any] = {"panel": panel, "digits": 5, "hover": None}
    curve = Curve(of.at(z), of.density(z), "updated" if first else "", UPDATED, **look)
    if of.prior is None:
        return [curve]
    mean, sd = of.prior
    values = np.linspace(*limits, 41)
    density = np.exp(-(((values - mean) / sd) ** 2) / 2) / (sd * np.sqrt(2 * np.pi))
    return [Curve(values, density, "prior" if first else "", INITIAL, "dot", **look), curve]


def _pair(across: Marginal, up: Marginal, correlation: float, panel: Panel) -> list[Mark]:
    """Contours that hold 39 % and 95 % of two Gaussian variables, drawn where they lie in
    values.
    """
    angle = np.linspace(0, 2 * np.pi, 61)
    first, second = (
        np.cos(angle),
        correlation * np.cos(angle) + np.sqrt(max(1 - correlation**2, 0.0)) * np.sin(angle),
    )
    inner, outer = ((across.at(radius * first), up.at(radius * second)) for radius in _RADII)
    look: dict[str, Any] = {"panel": panel, "digits": 5, "hover": f"correlation {correlation:+.2f}"}
    return [Curve(*inner, "", UPDATED, **look), Curve(*outer, "", UPDATED, "dash", **look)]


# how far the axis goes beyond the measured ratios: a law may leave them far below and above
_ABOUT = 4.0


def damping_figure(laws: Sequence[Mapping[str, Any]], modes: Sequence[Mapping[str, Any]]) -> Figure:
    """ζ over frequency, both logarithmic: the first law is the one whose coefficients are reported.

    Args:
        laws: as a result document has them, each with its `curve`.
        modes: of the result, with measured ratios and, where they are known, their standard
            deviations.
    """
    marks: list[Mark] = [
        _law(law, UPDATED if k == 0 else PALETTE[1 + (k - 1) % 9], k == 0)
        for k, law in enumerate(laws)
    ]
    seen = [mode for mode in modes if mode["measured_damping"]]
    ratios = np.array([100 * mode["measured_damping"] for mode in seen])
    spread = np.array([100 * Z_95 * (mode["measured_damping_sd"] or 0.0) for mode in seen])
    name = "measured, 95 %" if spread.any() else "measured"
    look: Any = {
        "text": [f"mode {mode['number']}" for mode in seen],
        "hover": "%{text}: %{y:.3g} %",
    }
    error = np.array([np.minimum(spread, 0.95 * ratios), spread])
    marks.append(
        Points(
            [mode["measured_hz"] for mode in seen], ratios, name, MEASURED, error_y=error, **look
        )
    )
    ends = (ratios.min() / _ABOUT, ratios.max() * _ABOUT) if seen else None
    panel = Panel(Axis("frequency [Hz]", "log"), Axis("ζ [%]", "log", ends))
    return Figure("Damping ratios: measured, and the laws", marks, [panel])


def _law(law: Mapping[str, Any], color: str, reported: bool) -> Mark:
    hz, ratios = law["curve"]["frequency_hz"], np.array(law["curve"]["damping_ratio"], dtype=float)
    ratios = np.where(ratios > 0, 100 * ratios, np.nan)
    name = (
        law["name"]
        + (" (reported)" if reported else "")
        + (" (preferred)" if law["preferred"] else "")
    )
    if law["by_mechanism"]:  # it has a ratio at modes alone
        return Points(hz, ratios, name, color, "square-open" if reported else "triangle-up-open", 7)
    dash: Dash = "solid" if law["preferred"] else "dash"
    return Curve(hz, ratios, name, color, dash, 2.0 if reported or law["preferred"] else 1.0)


MOST_CONSTANTS = 8
_ROOM = 0.1


def convergence_figure(
    starts: Sequence[Mapping[str, Any]],
    parameters: Mapping[str, Sequence[float]],
    coefficients: Mapping[str, Sequence[float]],
) -> Figure:
    """Cost, elastic constants and damping coefficients over the iterations.

    Args:
        starts: every start of stage 1 with `cost` by iteration, `chosen`, and `failure` in words or
            None.
        parameters: of the chosen start, by name and iteration; drawn as shares of their last
            values.
        coefficients: of the damping law, in the same way; empty where damping was not fitted.
    """
    axes = [
        Axis("cost of stage 1", decades([cost for start in starts for cost in start["cost"]])),
        Axis("constants, % of the last"),
        *([Axis("damping, % of the last")] if coefficients else []),
    ]
    height = (1 - _ROOM * (len(axes) - 1)) / len(axes)
    tops = [1 - k * (height + _ROOM) for k in range(len(axes))]
    x = Axis("iteration")
    panels = [Panel(x, y, up=(top - height, top)) for y, top in zip(axes, tops, strict=True)]
    names = list(parameters)[:MOST_CONSTANTS]
    curves = [
        _cost(number, start) for number, start in enumerate(starts, start=1) if len(start["cost"])
    ]
    curves += _shares({name: parameters[name] for name in names}, PALETTE[1:], panels[1])
    curves += _shares(coefficients, cycle(reversed(PALETTE)), panels[-1])
    return Figure("Convergence of all starts", curves, panels, height=200 + 170 * len(panels))


def _cost(number: int, start: Mapping[str, Any]) -> Curve:
    chosen, failed = start["chosen"], start["failure"]
    name = f"start {number}" + (", chosen" if chosen else ", failed" if failed else "")
    look: Any = {"color": UPDATED} if chosen else {"color": QUIET, "dash": "dot"}
    return Curve(
        range(len(start["cost"])), start["cost"], name, symbol="x" if failed else "circle", **look
    )


def _shares(
    series: Mapping[str, Sequence[float]], colors: Iterable[str], panel: Panel
) -> list[Curve]:
    """Each series as shares of its last value."""
    look: Any = {"symbol": "circle", "panel": panel}
    per_cent = {
        name: [100 * value / (values[-1] or 1.0) for value in values]
        for name, values in series.items()
    }
    pairs = zip(per_cent.items(), colors, strict=False)
    return [
        Curve(range(len(values)), values, name, color, **look) for (name, values), color in pairs
    ]


_LONGEST = 22  # letters of a campaign's name beside a row
FAR_Z = 2.0  # |z| from which on a campaign's own estimate is drawn as one that differs

_Own = tuple[Mapping[str, Any], Mapping[str, Any]]


def single_estimates_figure(
    parameters: Sequence[Mapping[str, Any]], campaigns: Sequence[Mapping[str, Any]]
) -> Figure:
    """What each campaign says of each shared constant by itself, as a share of the joint estimate.

    Args:
        parameters: the shared ones, as a joint result has them.
        campaigns: its parts, each with `alone` and `predictive_p`.
    """
    rows = [
        (parameter, part)
        for parameter in parameters
        for part in campaigns
        if part["alone"].get(parameter["name"]) is not None
    ]
    names = [f"{parameter['name']}  {_both_ends(part['name'])}" for parameter, part in rows]
    probabilities = ", ".join(
        f"{shortened(part['name'])}: p {_probability(part['predictive_p'])}" for part in campaigns
    )
    return Figure(
        f"Each campaign alone, beside all together ({probabilities})",
        [_joint(rows), *_single_estimates(rows)],
        [Panel(Axis("share of the joint estimate [%]"), rows_axis(names))],
        height=200 + 24 * max(len(rows), 6),
        margins={"l": 40 + 7 * max((len(name) for name in names), default=0)},
    )


def _both_ends(name: str) -> str:
    """A campaign's name, in the middle cut where it is too long: it begins as those of the same
    structure do.
    """
    return name if len(name) <= _LONGEST else f"{name[:10]}…{name[11 - _LONGEST :]}"


def _probability(value: float | None) -> str:
    return "–" if value is None else f"{value:.2g}"


def _joint(rows: Sequence[_Own]) -> Mark:
    """The joint estimate's 95 % interval behind each row."""
    ends = [[100 * end / row["estimate"] for end in row["interval_95"]] for row, _ in rows]
    low, high = np.sort(np.array(ends, dtype=float), axis=1).T
    return Bars(high - low, range(len(rows)), low, "all together, 95 %", BAND, width=1, hover=None)


def _single_estimates(rows: Sequence[_Own]) -> list[Mark]:
    """Estimates of single campaigns with 95 % intervals; those far from the joint one stand out."""
    marks: list[Mark] = []
    for far, color, symbol, name in (
        (False, MEASURED, "circle", "one campaign alone, 95 %"),
        (True, ALARM, "diamond", f"differs, |z| above {FAR_Z:g}"),
    ):
        chosen = [
            (place, parameter["estimate"], part["alone"][parameter["name"]])
            for place, (parameter, part) in enumerate(rows)
            if (abs(part["alone"][parameter["name"]]["z"]) > FAR_Z) is far
        ]
        if not chosen:
            continue
        middle = [100 * own["estimate"] / joint for _, joint, own in chosen]
        reach = [100 * Z_95 * own["standard_deviation"] / abs(joint) for _, joint, own in chosen]
        look: Any = {
            "text": [f"z {own['z']:+.2f}" for *_, own in chosen],
            "hover": "%{x:.1f} %, %{text}",
        }
        marks.append(
            Points(
                middle, [place for place, *_ in chosen], name, color, symbol, error_x=reach, **look
            )
        )
    return marks


def errors_figure(campaigns: Sequence[Mapping[str, Any]]) -> Figure:
    """How far each campaign's frequencies lie from the model's, before and after, in one panel a
    campaign.

    Args:
        campaigns: the parts of a joint result, each with `modes`.
    """
    marks: list[Mark] = []
    panels = []
    for number, part in enumerate(campaigns):
        modes = [mode for mode in part["modes"] if mode["updated_hz"] is not None]
        labels = [f"{mode['number']}\n{mode['measured_hz']:.4g} Hz" for mode in modes]
        x = named_axis("", labels, range=(-0.6, max(len(modes), 1) - 0.4))
        up = 1 - (number + 0.7) / len(campaigns), 1 - (number + 0.1) / len(campaigns)
        panel = Panel(x, Axis("error [%]"), up=up, title=shortened(part["name"]))
        panels.append(panel)
        for key, color, symbol in (
            ("initial_hz", INITIAL, "diamond-open"),
            ("updated_hz", UPDATED, "circle"),
        ):
            error = [
                np.nan if mode[key] is None else 100 * (mode[key] / mode["measured_hz"] - 1)
                for mode in modes
            ]
            name = key.removesuffix("_hz") if number == 0 else ""
            marks.append(
                Points(
                    range(len(modes)), error, name, color, symbol, panel=panel, hover="%{y:+.3f} %"
                )
            )
        marks.append(Rule(0, level=True, panel=panel))
    title = "Errors of the frequencies of the initial and the updated model"
    return Figure(title, marks, panels, height=150 + 170 * len(campaigns))
