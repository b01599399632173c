"""What the variance of every parameter is made of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from service.show.figures.look import Figure, Trace, axis, layout, named_ticks, numbers
from service.show.figures.palette import PALETTE

MOST_SOURCES = 9
OTHERS = "other sources"


def budget_figure(parameters: Sequence[Mapping[str, Any]]) -> Figure:
    """A bar for each parameter, divided by the shares of its variance.

    Args:
        parameters: as a result document has them, with `budget`; those without one are left out.
    """
    rows = [row for row in parameters if row["budget"]]
    weight: dict[str, float] = {}
    for row in rows:
        for entry in row["budget"]:
            weight[entry["source"]] = weight.get(entry["source"], 0.0) + entry["share"]
    sources = sorted(weight, key=lambda source: -weight[source])
    named = sources if len(sources) <= MOST_SOURCES else sources[: MOST_SOURCES - 1]
    shares = [{entry["source"]: 100 * entry["share"] for entry in row["budget"]} for row in rows]
    if len(named) < len(sources):
        shares = [{**of, OTHERS: sum(v for source, v in of.items() if source not in named)} for of in shares]
        named = [*named, OTHERS]
    base = [0.0] * len(rows)
    data: list[Trace] = []
    for k, source in enumerate(named):
        name = source.replace("_", " ")
        values = [of.get(source, 0.0) for of in shares]
        data.append(
            {
                "type": "bar", "orientation": "h", "name": name, "x": numbers(values, 4), "y": list(range(len(rows))),
                "base": numbers(base, 6), "width": 0.7, "marker": {"color": PALETTE[k % len(PALETTE)]},
                "customdata": [row["name"] for row in rows],
                "hovertemplate": f"%{{customdata}}, {name}: %{{x:.1f}} %<extra></extra>",
            }
        )  # fmt: skip
        base = [before + value for before, value in zip(base, values, strict=True)]
    names = [f"{row['name']}  ± {_percent(row)}" for row in rows]
    shown = layout(
        "What the variance of each parameter is made of",
        xaxis=axis("share of the variance [%]", range=[0, 100]),
        yaxis=axis("", range=[len(rows) - 0.4, -0.6], **named_ticks(names)),
        barmode="overlay",
        margin={"l": 120, "b": 120},
        height=230 + 36 * max(len(rows), 3),
    )
    return {"data": data, "layout": shown}


def _percent(row: Mapping[str, Any]) -> str:
    return f"{100 * row['standard_deviation'] / abs(row['estimate']):.2g} %" if row["estimate"] else "–"
