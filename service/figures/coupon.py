"""The raw curve of a coupon: stress over strain with the chord, its bounds, and what the standard
reads off it.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from fecore.arrays import FloatArray
from fecore.coupons.d3518 import OFFSET
from service.figures.colors import BAND, INITIAL, QUIET, UPDATED
from service.figures.frfs import thinned
from service.figures.marks import Axis, Curve, Figure, Mark, Panel, Points, Region, shortened

_HOVER = "%{x:.4g} %: %{y:.4g} MPa"
_BEYOND = 1.0  # of the chord's length: how far its line is drawn past the upper bound


def coupon_figure(
    title: str, series: Mapping[str, FloatArray], result: Mapping[str, Any], *, shear: bool
) -> Figure:
    """Stress over strain; of a tensile test with a transverse strain that too, whose slope is
    Poisson's ratio.

    Args:
        title: specimen and standard.
        series: (n,) `force` in N, `strain` and where there are any `strain_back` of the other face
            and `transverse_strain`; NaN where a gauge was lost.
        result: what the standard reports, as it is stored.
        shear: whether it is of D3518: γ = ε_x − ε_y and τ = P/2A, else ε and σ = P/A.
    """
    along = (
        (series["strain"] + series["strain_back"]) / 2
        if "strain_back" in series
        else series["strain"]
    )
    transverse = series.get("transverse_strain")
    stress = series["force"] / ((2 if shear else 1) * result["area_m2"])
    strain = along - transverse if shear and transverse is not None else along
    kept, rising = thinned(stress), slice(0, int(np.argmax(stress)) + 1)
    start, stop = result["chord_range"]
    modulus, level = result["modulus_pa"], _at(start, strain[rising], stress[rising])
    ends = np.array([start - level / modulus, stop + _BEYOND * (stop - start)])
    chord = f"chord, {'shear modulus G' if shear else 'modulus E'} = {modulus / 1e9:.2f} GPa"
    bounds = np.array([start, stop])
    name = f"bounds, {1e6 * start:.0f} and {1e6 * stop:.0f} µε"
    marks: list[Mark] = [
        Curve(100 * strain[kept], stress[kept] / 1e6, "measured", hover=_HOVER),
        Curve(
            100 * ends, (level + modulus * (ends - start)) / 1e6, chord, UPDATED, "dash", hover=None
        ),
        Points(
            100 * bounds, (level + modulus * (bounds - start)) / 1e6, name, UPDATED, hover=_HOVER
        ),
        *(_offset(result) if shear else _knee(result, strain[rising], stress[rising])),
        *_top(result, shear=shear),
    ]
    letters = ("γ", "τ") if shear else ("ε", "σ")
    x = Axis(f"strain {letters[0]} [%]")
    panels = [Panel(x, Axis(f"stress {letters[1]} [MPa]"), up=(0.0, 1.0))]
    if not shear and transverse is not None:
        panels = [
            replace(panels[0], up=(0.36, 1.0)),
            Panel(x, Axis("transverse [%]"), up=(0.0, 0.28)),
        ]
        marks += [
            Curve(
                100 * along[kept],
                100 * transverse[kept],
                panel=panels[1],
                hover="%{x:.4g} %: %{y:.4g} %",
            ),
            *_poisson(along, transverse, result, panels[1]),
        ]
    marks += [Region((100 * start, 100 * stop), BAND, panel=panel) for panel in panels]
    return Figure(shortened(title), marks, panels, height=520 if len(panels) == 1 else 620)


def _at(place: float, strain: FloatArray, values: FloatArray) -> float:
    """A series where the strain first comes to a place, linear between points."""
    known = np.isfinite(strain) & np.isfinite(values)
    upward = np.maximum.accumulate(strain[known])
    return float(np.interp(place, upward, values[known]))


def _point(strain: float, stress: float, name: str, color: str, symbol: str) -> Points:
    return Points([100 * strain], [stress / 1e6], name, color, symbol, hover=_HOVER)


def _knee(result: Mapping[str, Any], strain: FloatArray, stress: FloatArray) -> list[Mark]:
    if (at := result["transition_strain"]) is None:
        return []
    return [_point(at, _at(at, strain, stress), "transition", QUIET, "square")]


def _offset(result: Mapping[str, Any]) -> list[Mark]:
    """The line of the 0.2 % offset and where it meets the curve."""
    if (strain := result["offset_strain"]) is None:
        return []
    stress = result["offset_strength_pa"]
    return [
        Curve([100 * OFFSET, 100 * strain], [0.0, stress / 1e6], "", INITIAL, "dot", hover=None),
        _point(strain, stress, f"0.2 % offset, {stress / 1e6:.1f} MPa", INITIAL, "square"),
    ]


def _top(result: Mapping[str, Any], *, shear: bool) -> list[Mark]:
    """Strength at its strain; without a mark where the gauge was lost before."""
    at, stress = (
        ("maximum_stress_strain", "maximum_stress_pa")
        if shear
        else ("ultimate_strain", "strength_pa")
    )
    if result[at] is None:
        return []
    name = (
        f"{'maximum' if shear else 'strength'}, {result[stress] / 1e6:.1f} MPa at"
        f" {100 * result[at]:.3g} %"
    )
    return [_point(result[at], result[stress], name, INITIAL, "diamond")]


def _poisson(
    strain: FloatArray, transverse: FloatArray, result: Mapping[str, Any], panel: Panel
) -> list[Mark]:
    """The line whose slope is −ν."""
    if (ratio := result["poisson_ratio"]) is None:
        return []
    ends = np.array(result["chord_range"])
    slope = _at(ends[0], strain, transverse) - ratio * (ends - ends[0])
    name = f"Poisson's ratio ν = {ratio:.3f}"
    return [Curve(100 * ends, 100 * slope, name, UPDATED, "dash", panel=panel, hover=None)]
