"""What benchmarks print: tables, a row as soon as it is known; and estimates beside the truth."""

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fecore.normal import Z_95
from fecore.updating.result import ParameterEstimate, UpdateResult


def load() -> str:
    """The machine's load, for the head of a table."""
    return f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors"


@dataclass(frozen=True)
class _Column:
    head: str
    form: str  # of its numbers; the width of its texts

    def cell(self, value: object) -> str:
        """A value; None is a dash, and a text in a column of numbers stands as it is."""
        if self.form.isdigit():
            return str(value).ljust(int(self.form))
        text = (
            "–" if value is None else value if isinstance(value, str) else format(value, self.form)
        )
        return text.rjust(max(len(self.head), 7))


class Table:
    """A table whose rows are printed as they come."""

    def __init__(self, title: str, *columns: str) -> None:
        """Print its head.

        Args:
            title: a line above it; none where it is empty.
            columns: heading and format of numbers, such as `median ms:.2f`; of texts their width,
                as `case:28`.
        """
        self._columns = [_Column(*column.rpartition(":")[::2]) for column in columns]
        if title:
            print(title)
        self.row(*(column.head for column in self._columns))

    def row(self, *values: object) -> None:
        """Print a row, a value a column."""
        cells = (column.cell(value) for column, value in zip(self._columns, values, strict=True))
        print("  " + "  ".join(cells).rstrip(), flush=True)


class Off(NamedTuple):
    """An estimate beside the truth."""

    name: str  # of the constant
    share: float  # error over the truth
    z: float  # error over the standard deviation
    half: float  # half of the 95 % interval over the truth
    held: bool  # whether the interval holds the truth
    identifiable: bool


def beside(parameters: Iterable[ParameterEstimate], true: Mapping[str, float]) -> dict[str, Off]:
    """Each constant whose truth is known, by name; of a truth of nothing the shares are NaN."""
    found = {}
    for p in (p for p in parameters if p.name in true):
        (low, high), value = p.interval_95, true[p.name]
        error, scale, held = p.estimate - value, value or np.nan, bool(low <= value <= high)
        z = error / p.standard_deviation
        found[p.name] = Off(
            p.name, error / scale, z, (high - low) / 2 / scale, held, p.identifiable
        )
    return found


def print_beside(result: UpdateResult, true: Mapping[str, float]) -> list[Off]:
    """Each constant of an update whose truth is known, and what else it came to."""
    paired = sum(mode.updated_hz is not None for mode in result.modes)
    table = Table("", "constant:14", "true:.4g", "error %:+.2f", "z:+.2f", "95 %:8", "from the:8")
    offs = list(beside(result.parameters, true).values())
    for off in offs:
        held, known = "inside" if off.held else "OUTSIDE", "data" if off.identifiable else "prior"
        table.row(off.name, true[off.name], 100 * off.share, off.z, held, known)
    print(f"  {result.verdict.level}; {paired} of {len(result.modes)} modes paired", flush=True)
    return offs


def print_coverage(title: str, groups: Mapping[str, Sequence[Off]]) -> None:
    """How often intervals of each group hold the truth; `z` is the error over a quarter of the
    interval, 1 at best.
    """
    columns = (
        "n:d",
        "held %:.1f",
        "rms z:.2f",
        "bias %:+.2f",
        "± %:.2f",
        "rms %:.2f",
        "half %, median:.2f",
    )
    table = Table(title, "95 % intervals of:28", *columns)
    for name, rows in groups.items():
        share, half, held = np.array([(off.share, off.half, off.held) for off in rows]).T
        bias, rms = 100 * np.mean(share), 100 * np.sqrt(np.mean(share**2))
        error = 100 * np.std(share) / np.sqrt(len(rows))
        z = np.sqrt(np.mean((Z_95 * share / half) ** 2))
        table.row(name, len(rows), 100 * np.mean(held), z, bias, error, rms, 100 * np.median(half))
