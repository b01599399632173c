"""The raw curve of a coupon: stress over strain with the chord, its bounds, and what the standard reads off it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fecore.arrays import FloatArray
from fecore.coupons.d3518 import OFFSET
from service.show.figures.frf import thinned
from service.show.figures.look import (
    BAND,
    INITIAL,
    MEASURED,
    QUIET,
    UPDATED,
    Figure,
    Trace,
    axis,
    layout,
    line,
    marks,
    numbers,
    shown_name,
)

_BEYOND = 1.0  # of the chord's length: how far its line is drawn past the upper bound


@dataclass(frozen=True)
class CurveShown:
    """A specimen's curve and its reduction.

    Attributes:
        title: specimen and standard.
        shear: whether it is of D3518: γ = ε_x − ε_y and τ = P/2A, else ε and σ = P/A.
        strain: (n,) longitudinal strain, mean of the faces, m/m; NaN where the gauge was lost.
        force: (n,) N.
        transverse: (n,) transverse strain, or None.
        reduction: what the standard reports, as it is stored.
    """

    title: str
    shear: bool
    strain: FloatArray
    force: FloatArray
    transverse: FloatArray | None
    reduction: Mapping[str, Any]


def coupon_figure(curve: CurveShown) -> Figure:
    """Stress over strain; of a tensile test with a transverse strain that too, whose slope is Poisson's ratio."""
    found, shear = curve.reduction, curve.shear
    stress = curve.force / ((2 if shear else 1) * found["area_m2"])
    strain = curve.strain - curve.transverse if shear and curve.transverse is not None else curve.strain
    kept = thinned(stress)
    start, stop = found["chord_range"]
    modulus = found["modulus_pa"]
    rising = slice(0, int(np.argmax(stress)) + 1)
    level = _at(start, strain[rising], stress[rising])
    ends = np.array([start - level / modulus, stop + _BEYOND * (stop - start)])
    name = "shear modulus G" if shear else "modulus E"
    data = [
        line(_percent(strain[kept]), _mega(stress[kept]), "measured", MEASURED, hovertemplate=_hover("MPa")),
        line(
            _percent(ends), _mega(level + modulus * (ends - start)), f"chord, {name} = {modulus / 1e9:.2f} GPa",
            UPDATED, "dash", hoverinfo="skip",
        ),
        marks(
            _percent(np.array([start, stop])), _mega(level + modulus * np.array([0, stop - start])),
            f"bounds, {1e6 * start:.0f} and {1e6 * stop:.0f} µε", UPDATED, "circle", hovertemplate=_hover("MPa"),
        ),
        *(_offset(found) if shear else _knee(found, strain[rising], stress[rising])),
        *_top(found, shear=shear),
    ]  # fmt: skip
    lower = [] if shear or curve.transverse is None else _poisson(curve, kept)
    letters = ("γ", "τ") if shear else ("ε", "σ")
    shown = layout(
        shown_name(curve.title),
        xaxis=axis(f"strain {letters[0]} [%]", anchor="y2" if lower else "y"),
        yaxis=axis(f"stress {letters[1]} [MPa]", domain=[0.36, 1.0] if lower else [0.0, 1.0]),
        shapes=[_between(start, stop, panel) for panel in range(1, 3 if lower else 2)],
        height=620 if lower else 520,
    )
    if lower:
        shown["yaxis2"] = axis("transverse [%]", domain=[0.0, 0.28])
    return {"data": [*data, *lower], "layout": shown}


def _percent(strain: FloatArray) -> list[float | None]:
    return numbers(100 * strain)


def _mega(stress: FloatArray) -> list[float | None]:
    return numbers(stress / 1e6)


def _hover(unit: str) -> str:
    return f"%{{x:.4g}} %: %{{y:.4g}} {unit}<extra></extra>"


def _at(place: float, strain: FloatArray, values: FloatArray) -> float:
    """A series where the strain first comes to a place, linear between points."""
    known = np.isfinite(strain) & np.isfinite(values)
    upward = np.maximum.accumulate(strain[known])
    return float(np.interp(place, upward, values[known]))


def _knee(found: Mapping[str, Any], strain: FloatArray, stress: FloatArray) -> list[Trace]:
    if found["transition_strain"] is None:
        return []
    at = found["transition_strain"]
    height = _mega(np.array([_at(at, strain, stress)]))
    return [marks(_percent(np.array([at])), height, "transition", QUIET, "square", hovertemplate=_hover("MPa"))]


def _offset(found: Mapping[str, Any]) -> list[Trace]:
    """The line of the 0.2 % offset and where it meets the curve."""
    if found["offset_strain"] is None:
        return []
    strain, stress = found["offset_strain"], found["offset_strength_pa"]
    name = f"0.2 % offset, {stress / 1e6:.1f} MPa"
    return [
        line(
            _percent(np.array([OFFSET, strain])), _mega(np.array([0.0, stress])), "", INITIAL, "dot", hoverinfo="skip"
        ),
        marks(_percent(np.array([strain])), _mega(np.array([stress])), name, INITIAL, "square"),
    ]


def _top(found: Mapping[str, Any], *, shear: bool) -> list[Trace]:
    """Strength at its strain; without a mark where the gauge was lost before."""
    at, stress = (
        (found["maximum_stress_strain"], found["maximum_stress_pa"])
        if shear
        else (found["ultimate_strain"], found["strength_pa"])
    )
    if at is None:
        return []
    name = f"{'maximum' if shear else 'strength'}, {stress / 1e6:.1f} MPa at {100 * at:.3g} %"
    return [marks(_percent(np.array([at])), _mega(np.array([stress])), name, INITIAL, "diamond")]


def _poisson(curve: CurveShown, kept: Any) -> list[Trace]:
    """The transverse strain, and the line whose slope is −ν."""
    assert curve.transverse is not None, "asked for where there is one"
    panel: dict[str, Any] = {"yaxis": "y2"}
    drawn = line(
        _percent(curve.strain[kept]), _percent(curve.transverse[kept]), "", MEASURED, hovertemplate=_hover("%"), **panel
    )
    ratio = curve.reduction["poisson_ratio"]
    if ratio is None:
        return [drawn]
    ends = np.array(curve.reduction["chord_range"])
    level = _at(ends[0], curve.strain, curve.transverse)
    name = f"Poisson's ratio ν = {ratio:.3f}"
    slope = line(
        _percent(ends), _percent(level - ratio * (ends - ends[0])), name, UPDATED, "dash", hoverinfo="skip", **panel
    )
    return [drawn, slope]


def _between(start: float, stop: float, panel: int) -> dict[str, Any]:
    """The chord's range, shaded."""
    return {
        "type": "rect", "layer": "below", "xref": "x", "yref": f"y{'' if panel == 1 else panel} domain",
        "x0": 100 * start, "x1": 100 * stop, "y0": 0, "y1": 1, "fillcolor": BAND, "line": {"width": 0, "color": BAND},
    }  # fmt: skip
