"""Constants and damping over temperature, as tests at several temperatures show them."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import cycle
from typing import Any

import numpy as np

from service.figures.colors import PALETTE
from service.figures.marks import Axis, Curve, Figure, Mark, Panel, Rule


def temperature_figure(curve: Mapping[str, Any], parameters: Sequence[Mapping[str, Any]]) -> Figure:
    """Each constant that the data determine, and each coefficient of the preferred damping law,
    with 95 % intervals.

    Args:
        curve: as a result document has it.
        parameters: of the result; those that the data do not determine have curves of the prior,
            which are left out.
    """
    known = {row["name"] for row in parameters if row["identifiable"]}
    reference, rows = curve["reference_c"], curve["constants"]
    elastic = [row for row in rows if row["law"] is None and row["name"] in known]
    damping = [row for row in rows if row["law"] is not None]
    x, title = Axis("temperature [°C]"), f"share of the value at {reference:g} °C [%]"
    groups = [each for each in (elastic, damping) if each]
    height = 1 / max(len(groups), 1)
    panels = [
        Panel(x, Axis(title), up=(1 - (k + 0.82) * height, 1 - k * height))
        for k in range(len(groups))
    ]
    marks, colors = list[Mark](), cycle(PALETTE)
    for panel, group in zip(panels, groups, strict=True):
        for row, color in zip(group, colors, strict=False):
            marks += _drawn(row, curve["temperature_c"], reference, color, panel)
        marks.append(Rule(reference, panel=panel))
    return Figure(
        "Constants and damping over temperature", marks, panels, height=160 + 270 * len(panels)
    )


def _drawn(
    row: Mapping[str, Any], at: Sequence[float], reference: float, color: str, panel: Panel
) -> Iterator[Mark]:
    """The estimate and, dotted, the ends of its interval."""
    name = row["name"] if row["law"] is None else f"{row['name']} ({row['law']})"
    here = 100 / float(np.interp(reference, at, row["estimate"]))
    look: Any = {"panel": panel, "group": name}
    yield Curve(
        at, here * np.array(row["estimate"]), name, color, hover="%{x:.3g} °C: %{y:.4g} %", **look
    )
    for end in ("low", "high"):
        yield Curve(
            at, here * np.array(row[end]), name, color, "dot", 1.0, listed=False, hover=None, **look
        )
