"""Something that must run: it is started again when it ends by itself, after growing pauses, and in the end given up."""

from __future__ import annotations

import signal
import subprocess
import time
from collections.abc import Callable, Sequence

PAUSES = (0.5, 1.0, 2.0, 5.0, 10.0, 30.0)
"""Seconds before each start; a part that ends once more after the last is given up."""
STEADY_SECONDS = 60.0
"""What has run for so long has started well: its next end counts as the first."""


class GivenUpError(Exception):
    """A part ended again and again; the message names it and how it ended."""


class NotStartedError(Exception):
    """This start failed; the next one may not."""


class Part:
    """One part of a service.

    Attributes:
        name: how messages call it.
    """

    def __init__(
        self, name: str, start: Callable[[], None], ended: Callable[[], str | None], pauses: Sequence[float] = PAUSES
    ) -> None:
        """Watch a part that runs already.

        Args:
            name: how messages call it.
            start: starts it again; `NotStartedError` of it counts as one more end.
            ended: how it ended, such as `ended with status 1`; None while it runs.
            pauses: seconds before each start.
        """
        self.name, self._start, self._ended, self._pauses = name, start, ended, pauses
        self._began = time.monotonic()
        self._ends = 0
        self._again_at: float | None = None

    @property
    def runs(self) -> bool:
        """Whether it is neither ended nor waiting for its next start."""
        return self._again_at is None and self._ended() is None

    def tend(self) -> str | None:
        """Start it again where it ended and the pause is over; a line for the operator where something happened.

        Raises:
            GivenUpError: it ended once more than there are pauses.
        """
        if self._again_at is not None and time.monotonic() >= self._again_at:
            return self._begin()
        if self._again_at is None and (how := self._ended()) is not None:
            return self._wait(how)
        return None

    def _begin(self) -> str:
        try:
            self._start()
        except NotStartedError as error:
            return self._wait(f"does not start: {error}")
        self._again_at, self._began = None, time.monotonic()
        return f"{self.name} runs again"

    def _wait(self, how: str) -> str:
        now = time.monotonic()
        if self._again_at is None and now - self._began > STEADY_SECONDS:
            self._ends = 0
        if self._ends == len(self._pauses):
            raise GivenUpError(f"{self.name} {how}, {self._ends + 1} times in a row; it is not started again")
        pause = self._pauses[self._ends]
        self._ends += 1
        self._again_at = now + pause
        return f"{self.name} {how}; it is started again in {pause:g} s"


def how_it_ended(process: subprocess.Popen[bytes]) -> str | None:
    """How a process ended, None while it runs."""
    status = process.poll()
    if status is None:
        return None
    if status == -signal.SIGKILL:
        return "was killed, perhaps for lack of memory"
    if status < 0:
        return f"was ended by {signal.Signals(-status).name}"
    return f"ended with status {status}"
