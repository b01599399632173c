"""What people see: tables on standard output, bars on standard error and only where that is a
terminal, or in a notebook.

rich is loaded by what draws: every command imports this module.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from html import escape
from math import floor, log10
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

    from modalbase.client.connection import Watch

PLAIN_WIDTH = 160  # columns where the output is no terminal, so that no table is cut


def print_json(value: Any) -> None:
    """A JSON value, alone on standard output."""
    typer.echo(json.dumps(value, ensure_ascii=False, indent=2))


class Written(str):
    """A number as it is to be shown."""


def with_digits(value: float | None, sd: float | None) -> tuple[Written | None, Written | None]:
    """A value to the second digit of its standard deviation, and that; to five digits where none is
    known.
    """
    if value is None or sd is None or sd <= 0:
        return (None if value is None else Written(f"{value:.5g}")), None
    places = max(0, 1 - floor(log10(sd)))
    return Written(f"{value:.{places}f}"), Written(f"{sd:.{places}f}")


def print_table(
    title: str,
    columns: Sequence[str],
    rows: Sequence[Sequence[Any]],
    console: Console | None = None,
) -> None:
    """A table, on standard output where no console is given; numbers to the right."""
    from rich.console import Console
    from rich.table import Table

    console = console or Console()
    if not console.is_terminal:
        console = Console(width=PLAIN_WIDTH, file=console.file)
    if title:  # a title of the table's own would be broken to its width
        console.print(title, highlight=False, markup=False)
    table = Table(box=None, pad_edge=False)
    for i, name in enumerate(columns):
        numeric = bool(rows) and all(
            isinstance(row[i], int | float | Written | None) for row in rows
        )
        table.add_column(
            name, justify="right" if numeric else "left", no_wrap=not numeric and name == "id"
        )
    for row in rows:
        table.add_row(*(cell(value).replace("[", r"\[") for value in row))
    console.print(table, highlight=False)
    if not rows:
        console.print("none", highlight=False)


def cell(value: Any) -> str:
    """A value as a table shows it."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, str) and _MOMENT.match(value):
        return f"{value[:10]} {value[11:16]}"  # UTC, as all times
    return f"{value:.6g}" if isinstance(value, float) else str(value)


_MOMENT = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d")


@contextmanager
def transfer(what: str) -> Iterator[Watch]:
    """A bar of bytes while a file travels."""
    from rich.progress import BarColumn, DownloadColumn, TextColumn, TransferSpeedColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        DownloadColumn(),
        TransferSpeedColumn(),
    )
    with _bars(columns) as progress:
        bar = progress.add_task(what, total=None)
        yield lambda done, size: progress.update(bar, completed=done, total=size)


@contextmanager
def stages(what: str) -> Iterator[Any]:
    """A bar of a job: call it with the job's last state."""
    if (display := _notebook()) is not None:
        yield _notebook_bar(display, what)
        return
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
    )
    with _bars(columns) as progress:
        bar = progress.add_task(what, total=1.0)
        yield lambda job: progress.update(
            bar,
            description=f"{what}: {job['stage'] or job['status']}",
            completed=job["progress"] or 0.0,
        )


def _bars(columns: Sequence[Any]) -> Progress:
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True)
    return Progress(*columns, console=console, transient=True, disable=not console.is_terminal)


def _notebook() -> Any:
    """IPython's `display` where this process is the kernel of a notebook, else None."""
    ipython = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    if shell is None or type(shell).__name__ != "ZMQInteractiveShell":
        return None
    return ipython.display  # type: ignore[union-attr]  # it is there: a shell is


def _notebook_bar(display: Any, what: str) -> Callable[[Mapping[str, Any]], None]:
    """A bar below the cell: call it with a job's last state."""
    handle = display.display(display.HTML(_bar_html(what, "", 0.0)), display_id=True)

    def show(job: Mapping[str, Any]) -> None:
        stage, share = str(job["stage"] or job["status"]), float(job["progress"] or 0.0)
        handle.update(display.HTML(_bar_html(what, stage, share)))

    return show


def _bar_html(what: str, stage: str, share: float) -> str:
    return (
        f'<progress max="1" value="{share:.3f}"></progress> {100 * share:.0f} % {escape(what)}:'
        f" {escape(stage)}"
    )
