"""What a figure of a result is: its name, how it is drawn, and why a result may have nothing for it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

from service.figures.marks import Figure
from service.platform.errors import Conflict
from service.reports.figure_data import FigureQuery, UpdateFigures

OLDER = (
    "this result was computed by an earlier version, which kept no data for this figure; run the"
    " update again"
)
"""Why an older result may lack a figure."""

Tab = Literal[
    "parameters", "modes", "correlation", "damping", "budget", "convergence", "more", "apart"
]
"""Part of the result's page that shows a figure: `apart` where the page has a place of its own for
it, or the same as a table.
"""


@dataclass(frozen=True)
class NamedFigure:
    """A figure of an update."""

    title: str  # what it shows, in one line
    draw: Callable[[UpdateFigures, FigureQuery], Figure]  # draws it
    # says why the result has nothing for it; nothing where it has
    why_not: Callable[[UpdateFigures], str | None]
    arrays: tuple[str, ...] = ()  # that must be kept, which an earlier version may not have done
    query: tuple[str, ...] = ()  # parameters of the query that it heeds
    # draws it as several figures of which each fits on a page; None where one does
    sheets: Callable[[UpdateFigures], Sequence[Figure]] | None = None
    tab: Tab = "more"  # of the result's page
    # on paper, as a share of the text's width; of two that are high 0.8, so that they fit on a page
    width: float = 0.9

    def lacks(self, data: UpdateFigures) -> str | None:
        """Why the result has nothing for the figure; None where it has."""
        try:
            why = self.why_not(data)
        except Conflict as error:
            return str(error)
        return why or (OLDER if any(name not in data.arrays for name in self.arrays) else None)


def no_mac(data: UpdateFigures) -> str | None:
    """Why there is no MAC; None where there is one."""
    known = data.document["correlation"]["mac_matrix"] is not None
    return None if known else "the measured modes have no shapes, so there is no MAC"
