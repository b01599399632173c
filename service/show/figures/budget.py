"""What the variance of every parameter is made of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from service.show.figures.colors import PALETTE
from service.show.figures.marks import Axis, Bars, Figure, Panel, rows_axis

MOST_SOURCES = 9
OTHERS = "other sources"


def budget_figure(parameters: Sequence[Mapping[str, Any]]) -> Figure:
    """A bar for each parameter, divided by the shares of its variance.

    Args:
        parameters: as a result document has them, with `budget`; those without one are left out.
    """
    rows = [row for row in parameters if row["budget"]]
    shares: dict[str, np.ndarray] = {}  # of each source, by parameter
    for place, row in enumerate(rows):
        for entry in row["budget"]:
            shares.setdefault(entry["source"], np.zeros(len(rows)))[place] += 100 * entry["share"]
    sources = sorted(shares, key=lambda source: -shares[source].sum())
    if len(sources) > MOST_SOURCES:
        named = sources[: MOST_SOURCES - 1]
        shares[OTHERS] = sum((shares[source] for source in sources[len(named) :]), np.zeros(len(rows)))
        sources = [*named, OTHERS]
    bars, base = [], np.zeros(len(rows))
    for source, color in zip(sources, PALETTE, strict=False):
        name = source.replace("_", " ")
        hover = f"%{{customdata}}, {name}: %{{x:.1f}} %"
        ids = [row["name"] for row in rows]
        bars.append(Bars(shares[source], range(len(rows)), base, name, color, hover=hover, ids=ids))
        base = base + shares[source]
    return Figure(
        "What the variance of each parameter is made of",
        bars,
        [Panel(Axis("share of the variance [%]", range=(0, 100)), rows_axis([_named(row) for row in rows]))],
        height=230 + 36 * max(len(rows), 3),
        margins={"l": 120, "b": 120},
    )


def _named(row: Mapping[str, Any]) -> str:
    spread = f"{100 * row['standard_deviation'] / abs(row['estimate']):.2g} %" if row["estimate"] else "–"
    return f"{row['name']}  ± {spread}"
