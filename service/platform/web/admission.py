"""How many requests are answered at the same time, and who is next (docs/limits.md).

A request that is answered holds a slot. There are as many slots as connections to the database, and
a thread for each, so that whoever has a slot never waits for either. Waiting for a slot happens in
the event loop, where it costs next to nothing; it is bounded in number and in time. Callers take
turns: one that sends a thousand requests delays its own. Who waits already may take another place
while at least as many are free as it has. So one caller has half of them at most, two have two
thirds, and somebody new finds one, also beside a key that is counted under its address until it is
known and then under its name.

Buckets of tokens, in this process's memory, limit how much of something one caller may have in a
time.
"""

import asyncio
import time
from collections import OrderedDict, deque
from collections.abc import AsyncIterator, Callable, MutableMapping
from contextlib import asynccontextmanager
from math import ceil
from typing import Any

from service.platform.errors import TooManyRequests, Unavailable

MOST_CALLERS = 10_000  # that are kept apart; the ones that were silent longest are forgotten


class Buckets:
    """A bucket of tokens for each caller, which fills again as time goes by."""

    def __init__(
        self, size: float, seconds: float, clock: Callable[[], float] = time.monotonic
    ) -> None:
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


SLOT = "modalbase.slot"
"""Where a request's scope has its slot."""


class AdmissionControl:
    """Slots and the queue before them; of one event loop.

    Attributes:
        slots: requests that are answered at the same time.
        answering: those that are.
        waiting: those that wait.
    """

    def __init__(self, slots: int, queue: int, seconds: float) -> None:
        """Start with every slot free.

        Args:
            slots: requests that are answered at the same time.
            queue: requests that may wait.
            seconds: for which one waits at most.
        """
        self.slots, self.answering, self.waiting = slots, 0, 0
        self._queue, self._seconds = queue, seconds
        self._turns: OrderedDict[str, deque[asyncio.Future[None]]] = OrderedDict()
        self._took = 0.05  # seconds that an answer takes: a running mean

    def try_enter(self) -> bool:
        """Take a slot if that needs no waiting: while anybody waits, none is free."""
        if self.answering >= self.slots:
            return False
        self.answering += 1
        return True

    async def enter(self, caller: str) -> None:
        """Take a slot, when it is the caller's turn.

        Raises:
            TooManyRequests: this caller has as many places to wait in as are free, or more.
            Unavailable: all places are taken, or no slot came free in time.
        """
        if self.try_enter():
            return
        mine = self._turns.get(caller)
        if mine is not None and len(mine) >= self._queue - self.waiting:
            raise TooManyRequests(
                f"{len(mine)} requests of this key wait already, the most that one key may have;"
                " send fewer at a time",
                retry_after=self.retry_after(),
            )
        if self.waiting >= self._queue:
            raise self._full(f"as many as may wait ({self._queue})")
        turn = asyncio.get_running_loop().create_future()
        self._turns.setdefault(caller, deque()).append(turn)
        self.waiting += 1
        try:
            async with asyncio.timeout(self._seconds):
                await turn
        except TimeoutError:
            self._withdraw(caller, turn)
            raise self._full(f"this one has waited {self._seconds:g} s") from None
        except asyncio.CancelledError:
            self._withdraw(caller, turn)
            raise

    def leave(self, seconds: float) -> None:
        """Give a slot back, which was held for some seconds."""
        self._took += 0.05 * (seconds - self._took)
        self._pass_on()

    def retry_after(self) -> int:
        """Seconds after which the queue of now will have been answered."""
        return max(1, ceil(self._took * self.waiting / self.slots))

    def _pass_on(self) -> None:
        """The slot goes to the next caller's oldest request, and that caller to the end of the
        row.
        """
        while self._turns:
            caller, mine = self._turns.popitem(last=False)
            turn = mine.popleft()
            if mine:
                self._turns[caller] = mine
            self.waiting -= 1
            if not turn.done():
                turn.set_result(None)
                return
        self.answering -= 1

    def _withdraw(self, caller: str, turn: asyncio.Future[None]) -> None:
        """Stop waiting; a slot that came at this very moment goes on to the next."""
        mine = self._turns.get(caller)
        if mine is not None and turn in mine:
            mine.remove(turn)
            self.waiting -= 1
            if not mine:
                del self._turns[caller]
        elif turn.done() and not turn.cancelled():
            self._pass_on()

    def _full(self, why: str) -> Unavailable:
        return Unavailable(
            f"{self.answering} requests are being answered and {self.waiting} wait, {why}; try"
            " again",
            retry_after=self.retry_after(),
        )


class Slot:
    """A slot that one request holds; released once, when its answer begins or when
    it needs none.
    """

    def __init__(self, admission: AdmissionControl, caller: str) -> None:
        self._admission, self._caller = admission, caller
        self._since: float | None = None

    def try_take(self) -> bool:
        """Take a slot if that needs no waiting."""
        if not self._admission.try_enter():
            return False
        self._since = asyncio.get_running_loop().time()
        return True

    async def take(self) -> None:
        """Take a slot; see `AdmissionControl.enter`."""
        await self._admission.enter(self._caller)
        self._since = asyncio.get_running_loop().time()

    def release(self) -> None:
        """Let the next request in, unless that was done already."""
        if self._since is not None:
            held, self._since = asyncio.get_running_loop().time() - self._since, None
            self._admission.leave(held)


@asynccontextmanager
async def without_slot(scope: MutableMapping[str, Any]) -> AsyncIterator[None]:
    """Give the request's slot back while the block runs, which needs neither thread nor connection
    of a request.
    """
    slot: Slot | None = scope.get(SLOT)
    if slot is not None:
        slot.release()
    yield
    if slot is not None:
        await slot.take()
