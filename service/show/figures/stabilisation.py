"""The stabilisation diagram: poles by order of the model over the sum of the measured FRFs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from service.show.figures.colors import INITIAL, MEASURED, QUIET, UPDATED
from service.show.figures.marks import Axis, Curve, Figure, Mark, Panel, Points, Rule

KINDS = (
    ("stable in frequency and damping", UPDATED, "circle", 5),
    ("stable in frequency", INITIAL, "diamond-open", 5),
    ("new", QUIET, "cross", 4),
)


def stabilisation_figure(
    diagram: Mapping[str, Any], modes: Sequence[Mapping[str, Any]], doubtful: Sequence[Mapping[str, Any]]
) -> Figure:
    """Poles by order, and the modes that were chosen.

    Args:
        diagram: `stabilisation` of an identification's document: `order`, `frequency_hz`, `damping_ratio`, `frequency_stable`
            and `damping_stable` of the poles, and the `indicator` with its lines.
        modes: that were chosen.
        doubtful: those that were called doubtful.
    """
    order, hz = np.array(diagram["order"]), np.array(diagram["frequency_hz"], dtype=float)
    ratio = 100 * np.array(diagram["damping_ratio"], dtype=float)
    in_frequency = np.array(diagram["frequency_stable"], dtype=bool)
    in_both = in_frequency & np.array(diagram["damping_stable"], dtype=bool)
    lines, rms = diagram["indicator"]["frequency_hz"], np.array(diagram["indicator"]["rms"], dtype=float)
    x = Axis("frequency [Hz]", range=(min(lines), max(lines)))
    above = Panel(x, Axis("", "log", bare=True), over=True)
    size = np.where(rms > 0, rms, np.nan)
    marks: list[Mark] = [Curve(lines, size, "rms of the FRFs", QUIET, digits=5, panel=above, hover=None)]
    for look, rows in zip(KINDS, (in_both, in_frequency & ~in_both, ~in_frequency), strict=True):
        said: Any = {"text": [f"{value:.3g} %" for value in ratio[rows]], "hover": "%{x:.5g} Hz, ζ %{text}, order %{y}"}
        marks.append(Points(hz[rows], order[rows], *look, **said))
    marks += [Rule(mode["frequency_hz"], MEASURED, "solid") for mode in modes]
    marks += [Rule(mode["frequency_hz"], INITIAL) for mode in doubtful]
    title = "Stabilisation diagram, with the identified modes as upright lines"
    return Figure(title, marks, [Panel(x, Axis("order of the model")), above], height=520)
