"""One way to run something in the background: a thread that goes round as long as a `with` block runs."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Self


class Background:
    """Calls a function again and again in a thread of its own while the block runs; a context manager.

    Attributes:
        ending: set when the block ends. A long round looks at it, or waits for it in place of sleeping.
    """

    def __init__(self, name: str, work: Callable[[], float]) -> None:
        """Prepare.

        Args:
            name: of the thread, for the log.
            work: one round; returns the seconds until the next, which `wake` shortens. An error ends the thread, so it
                handles those that pass.
        """
        self.ending = threading.Event()
        self._work, self._woken = work, threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True, name=name)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_error: object) -> None:
        self.ending.set()
        self._woken.set()
        self._thread.join()

    def wake(self) -> None:
        """Begin the next round now, or as soon as the present one is over."""
        self._woken.set()

    def _run(self) -> None:
        while not self.ending.is_set():
            self._woken.clear()
            seconds = self._work()
            if not self.ending.is_set():
                self._woken.wait(seconds)
