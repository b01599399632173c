"""Agreement of measured and predicted FRFs: line by line (CSAC, CSF), and by point on the specimen (SAC, FRAC)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fecore.arrays import FloatArray
from service.show.figures.colors import INITIAL, QUIET, UPDATED
from service.show.figures.marks import Axis, Curve, Figure, Mark, Panel, Points, Region, Rule, Scale

TITLES = {"csac": "CSAC: agreement in shape, line by line", "csf": "CSF: agreement in level, line by line"}


def agreement_figure(
    name: str, hz: FloatArray, initial: FloatArray, updated: FloatArray, modes: Sequence[float]
) -> Figure:
    """CSAC or CSF over frequency, before and after.

    Args:
        name: `csac` or `csf`.
        hz: (L,) lines of the fitted band.
        initial: (L,) from 0 to 1.
        updated: (L,) the same after.
        modes: (n,) measured natural frequencies, Hz, which are marked.
    """
    marks: list[Mark] = [
        Curve(hz, initial, f"initial, mean {np.nanmean(initial):.3f}", INITIAL, "dot", digits=4),
        Curve(hz, updated, f"updated, mean {np.nanmean(updated):.3f}", UPDATED, digits=4),
        *(Rule(mode) for mode in modes if hz[0] <= mode <= hz[-1]),
    ]
    return Figure(TITLES[name], marks, [Panel(Axis("frequency [Hz]"), Axis(name.upper(), range=(0, 1.03)))])


@dataclass(frozen=True)
class PointValues:
    """A criterion by FRF, at the point that distinguishes the FRF from others."""

    labels: Sequence[int]  # of the points
    x: FloatArray  # their places on the specimen, m
    y: FloatArray
    sac: FloatArray  # from 0 to 1; NaN where there is none
    frac: FloatArray
    held_out: Sequence[bool]  # whether the FRF was held out of the fit


def points_figure(values: PointValues, along: tuple[float, float], across: tuple[float, float]) -> Figure:
    """SAC and FRAC at the points of the specimen, seen from above, each point in the colour of its value.

    Args:
        values: by point.
        along: x of the specimen's ends, m.
        across: y of its edges, m.
    """
    lowest = float(np.nanmin([*values.sac, *values.frac, 1.0]))
    floor = float(np.floor(10 * max(lowest, 0.0)) / 10)
    held = np.array(values.held_out, dtype=bool)
    margin, spread = 0.03 * (along[1] - along[0]), across[1] - across[0]
    x = Axis("x [m]", range=(along[0] - margin, along[1] + margin))
    y = Axis("y [m]", range=(across[0] - spread / 4, across[1] + spread / 4))
    marks: list[Mark] = []
    panels = []
    for title, found, up, middle in (("SAC", values.sac, (0.58, 1.0), 0.8), ("FRAC", values.frac, (0.0, 0.42), 0.2)):
        panel = Panel(x, replace(y), up=up, title=title)
        panels.append(panel)
        marks.append(Region(along, QUIET, across, outline=True, panel=panel))
        for rows, symbol, words in ((~held, "circle", "fitted"), (held, "diamond", "held out of the fit")):
            if rows.any():
                scale = Scale(title, floor, 1.0, symbol == "circle", middle, 0.45)
                said: Any = {
                    "ids": np.array(values.labels)[rows].tolist(),
                    "hover": f"point %{{customdata}}: {title} %{{marker.color:.4f}}",
                }
                place = values.x[rows], values.y[rows], words if title == "SAC" else ""
                marks.append(Points(*place, found[rows], symbol, 14, scale=scale, panel=panel, **said))
    return Figure("SAC and FRAC by point on the specimen", marks, panels, height=460, margins={"r": 95, "t": 70})
