"""Living through the database's absence: which errors pass by themselves, and a result that can be stored again."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from sqlalchemy.exc import DBAPIError

from service.jobs.child import Item

KEPT_BYTES = 32 * 1024 * 1024

PASSING = ("08", "40", "53", "57P", "55P03")
"""SQLSTATEs of lost connections, rollbacks that ask for another try, exhausted resources, shutdowns, lock time-outs."""


def passes(error: DBAPIError) -> bool:
    """Is this an error of the moment, which another try later may not meet? A connection refused has no SQLSTATE."""
    state = getattr(error.orig, "sqlstate", None)
    return error.connection_invalidated or (
        state.startswith(PASSING) if state else type(error.orig).__name__ in ("OperationalError", "InterfaceError")
    )


class Replay:
    """Items that can be gone through again from the first one on, as long as they are small.

    Attributes:
        complete: nothing has been dropped; another `iter` gives every item.
    """

    def __init__(self, source: Iterator[Item]) -> None:
        self._source = source
        self._kept: list[Item] = []
        self._bytes = 0
        self.complete = True

    def __iter__(self) -> Iterator[Any]:
        """What the items hold, from the first one on. Only the last iterator may be used."""
        if not self.complete:
            raise RuntimeError("the first items are gone")
        for item in list(self._kept):
            yield item.value
        for item in self._source:
            self._keep(item)
            yield item.value

    def _keep(self, item: Item) -> None:
        if not self.complete:
            return
        self._bytes += item.size
        if self._bytes > KEPT_BYTES:
            self.complete = False
            self._kept.clear()
            return
        self._kept.append(item)
