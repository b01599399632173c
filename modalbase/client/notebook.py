"""A bar of progress in a notebook, without a library of widgets."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from html import escape
from typing import Any


def notebook_display() -> Any:
    """IPython's `display` where this process is the kernel of a notebook, else None."""
    ipython = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    if shell is None or type(shell).__name__ != "ZMQInteractiveShell":
        return None
    return ipython.display  # type: ignore[union-attr]  # it is there: a shell is


def notebook_bar(display: Any, what: str) -> Callable[[Mapping[str, Any]], None]:
    """A bar below the cell: call it with a job's last state."""
    handle = display.display(display.HTML(_html(what, "", 0.0)), display_id=True)

    def show(job: Mapping[str, Any]) -> None:
        stage, share = str(job["stage"] or job["status"]), float(job["progress"] or 0.0)
        handle.update(display.HTML(_html(what, stage, share)))

    return show


def _html(what: str, stage: str, share: float) -> str:
    return f'<progress max="1" value="{share:.3f}"></progress> {100 * share:.0f} % {escape(what)}: {escape(stage)}'
