"""Limits on how much of something one caller may have in a time: buckets of tokens, in this process's memory."""

from __future__ import annotations

import time
from collections import OrderedDict
from collections.abc import Callable
from math import ceil

MOST_CALLERS = 10_000  # that are kept apart; the ones that were silent longest are forgotten


class Buckets:
    """A bucket of tokens for each caller, which fills again as time goes by."""

    def __init__(self, size: float, seconds: float, clock: Callable[[], float] = time.monotonic) -> None:
        """Prepare.

        Args:
            size: tokens of a full bucket.
            seconds: in which an empty bucket is full again.
            clock: seconds of a clock that never goes back.
        """
        self._size, self._rate, self._clock = size, size / seconds, clock
        self._left: OrderedDict[str, tuple[float, float]] = OrderedDict()

    def take(self, caller: str, tokens: float = 1.0) -> int:
        """Take tokens; where there are not enough, none.

        Returns:
            Seconds, at least 1, after which there will be enough; 0 where they were taken.
        """
        left = self.left(caller)
        if tokens > left:
            return max(1, ceil((min(tokens, self._size) - left) / self._rate))
        self._left[caller] = left - tokens, self._clock()
        self._left.move_to_end(caller)
        if len(self._left) > MOST_CALLERS:
            self._left.popitem(last=False)
        return 0

    def left(self, caller: str) -> float:
        """Tokens that a caller has."""
        left, at = self._left.get(caller, (self._size, 0.0))
        return min(self._size, left + self._rate * (self._clock() - at))
