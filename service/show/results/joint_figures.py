"""The figures of a joint update by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from service.errors import Conflict
from service.show.figures.budget import budget_figure
from service.show.figures.campaigns import alone_figure, errors_figure
from service.show.figures.look import Figure
from service.show.figures.parameters import parameters_figure
from service.show.figures.posterior import posterior_figure

Document = Mapping[str, Any]


@dataclass(frozen=True)
class JointFigure:
    """A figure of a joint update.

    Attributes:
        title: what it shows, in one line.
        draw: draws it from the result's document.
        lacks: why the document has nothing for it; None where it has.
    """

    title: str
    draw: Callable[[Document], Figure]
    lacks: Callable[[Document], str | None] = lambda _: None


def draw_joint_figure(document: Document, name: str) -> Figure:
    """A figure of a joint update; the name is one of `JOINT_FIGURES`.

    Raises:
        Conflict: the result has nothing to draw; the message says why.
    """
    figure = JOINT_FIGURES[name]
    if (why := figure.lacks(document)) is not None:
        raise Conflict(why)
    return figure.draw(document)


def _parameters(document: Document) -> Figure:
    return parameters_figure(
        document["parameters"], "One material from all campaigns: prior and updated, 95 % intervals"
    )


def _no_budget(document: Document) -> str | None:
    some = any(row["budget"] for row in document["parameters"])
    return None if some else "no parameter of this result has a budget of its variance"


def _budget(document: Document) -> Figure:
    return budget_figure(document["parameters"])


def _posterior(document: Document) -> Figure:
    described = document["posterior"]
    rows = {row["name"]: row for row in document["parameters"]}
    places = [i for i, name in enumerate(described["names"]) if name in rows]
    correlation = np.array(described["correlation"], dtype=float)[np.ix_(places, places)]
    return posterior_figure([rows[described["names"][i]] for i in places], correlation)


def _no_single(document: Document) -> str | None:
    some = any(part["alone"] for part in document["campaigns"])
    return None if some else "no campaign has an estimate of its own"


def _alone(document: Document) -> Figure:
    return alone_figure(document["parameters"], document["campaigns"])


def _frequencies(document: Document) -> Figure:
    return errors_figure(document["campaigns"])


JOINT_FIGURES: dict[str, JointFigure] = {
    "parameters": JointFigure("Parameters of the material: prior and updated", _parameters),
    "campaigns": JointFigure("Each campaign alone, beside all together", _alone, _no_single),
    "frequencies": JointFigure("Errors of the frequencies, campaign by campaign", _frequencies),
    "budget": JointFigure("What the variance of each parameter is made of", _budget, _no_budget),
    "posterior": JointFigure("Posterior: densities and correlations", _posterior),
}
"""Every figure of a joint update, in the order in which its page shows them."""
