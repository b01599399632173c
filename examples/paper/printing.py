"""Tables on a terminal: our figure beside the paper's, and sentences on where they differ."""

import textwrap
from collections.abc import Mapping, Sequence

import numpy as np

from examples.paper.trials import Trials
from fecore.updating.result import ParameterEstimate


def heading(text: str) -> None:
    """A section's title."""
    print(f"\n{text}\n{'=' * len(text)}")


def note(text: str) -> None:
    """A sentence or two, wrapped."""
    print(textwrap.fill(" ".join(text.split()), 110))


def table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """A plain table with right-aligned columns but for the first."""
    cells = [list(columns), *[list(row) for row in rows]]
    widths = [max(len(row[k]) for row in cells) for k in range(len(columns))]
    print(f"\n{title}")
    for row in cells:
        first, *rest = (
            cell.ljust(w) if k == 0 else cell.rjust(w)
            for k, (cell, w) in enumerate(zip(row, widths, strict=True))
        )
        print("  " + "  ".join([first, *rest]))


def beside(
    title: str,
    names: Sequence[str],
    ours: Sequence[float],
    paper: Sequence[float],
    form: str = ".2f",
) -> None:
    """Our figures beside the paper's with their difference in per cent."""
    rows = [
        [n, f"{a:{form}}", f"{b:{form}}", f"{100 * (a / b - 1):+.2f}"]
        for n, a, b in zip(names, ours, paper, strict=True)
    ]
    table(title, ["", "ours", "paper", "difference %"], rows)


def trials(title: str, result: Trials, paper: np.ndarray) -> None:
    """Starts, ends and SAC of each trial, and the paper's end."""
    rows = [
        [f"trial {k + 1}", *map(_pair, (start, end)), str(steps), f"{before:.4f}", f"{after:.4f}"]
        for k, (start, end, steps, before, after) in enumerate(
            zip(
                result.starts,
                result.found,
                result.iterations,
                result.sac_before,
                result.sac_after,
                strict=True,
            )
        )
    ]
    rows.append(["paper", "", _pair(paper), "", "", ""])
    table(title, ["", "start a0, a1", "end a0, a1", "steps", "SAC before", "after"], rows)
    print(f"  the ends lie within {100 * result.spread:.1e} % of each other")


def constants(
    title: str, rows: Mapping[str, ParameterEstimate], published: Mapping[str, float]
) -> None:
    """Updated constants in GPa, ours beside the paper's."""
    table(
        title,
        ["", "initial", "ours", "± 1 sd", "paper", "difference %", "identified"],
        [
            [
                name,
                f"{rows[name].initial / 1e9:.2f}",
                f"{rows[name].estimate / 1e9:.2f}",
                f"{rows[name].standard_deviation / 1e9:.2f}",
                f"{paper / 1e9:.2f}",
                f"{100 * (rows[name].estimate / paper - 1):+.2f}",
                "by the data" if rows[name].identifiable else "no: the prior",
            ]
            for name, paper in published.items()
        ],
    )


def percent(values: np.ndarray) -> str:
    """Ratios as per cent, in a row."""
    return " ".join(f"{100 * value:.2f}" for value in values)


def _pair(point: np.ndarray) -> str:
    return f"{point[0]:.2f}, {point[1]:.2e}"
