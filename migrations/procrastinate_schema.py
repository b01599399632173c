"""The schema of the queue's engine, Procrastinate, pinned: applied by version, from the scripts
that the library brings.

A script is named `03.04.00_01_pre_....sql`: the version that needs it, and its place within. A
revision of ours that raises `PINNED` applies the scripts in between.
"""

from __future__ import annotations

from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sqlalchemy import Connection

FIRST = "03.04.00"
"""What the first revision applies."""

PINNED = FIRST
"""What the newest revision has applied."""


def apply(connection: Connection, upto: str, after: str = "") -> None:
    """Apply the scripts of the versions after one and up to another."""
    for script in _scripts():
        if after < _version(script) <= upto:
            connection.exec_driver_sql(script.read_text(encoding="utf-8").replace("%", "%%"))


def mismatch() -> str | None:
    """Why the installed library cannot work with what the migrations make, and which command mends
    it; None where it can.
    """
    needed = max(map(_version, _scripts()))
    if needed == PINNED:
        return None
    bound = ("<" if needed > PINNED else ">=") + ".".join(
        str(int(part)) for part in max(needed, PINNED).split(".")
    )
    return (
        f"procrastinate {version('procrastinate')} is installed, which works with its schema"
        f" {needed}, and this version makes {PINNED}; run `pip install 'procrastinate{bound}'`"
    )


def _scripts() -> list[Path]:
    """The library's scripts; found without loading it, as every command asks for them when it
    starts.
    """
    library = find_spec("procrastinate")
    if library is None or library.origin is None:
        raise ModuleNotFoundError("procrastinate")
    return sorted(Path(library.origin).with_name("sql").joinpath("migrations").glob("*.sql"))


def _version(script: Path) -> str:
    return script.name[: len(FIRST)]
