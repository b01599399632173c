"""Waiting for an event, as long as it takes: no test depends on how fast a machine is or on who
else works on it.
"""

import asyncio
import time
from collections.abc import Callable, Coroutine
from concurrent.futures import ThreadPoolExecutor
from functools import wraps
from typing import Any, TypeVar

T = TypeVar("T")

PATIENCE = 300.0
"""Seconds after which something that is waited for is taken for broken; a busy machine needs a
small part of them.
"""

SOON, SHARE, SELDOM = 0.06, 0.35, 0.7
"""Seconds until the next look, share of the time waited so far beside them, and most of both: who
asks a service again and again takes its processor from what is waited for.
"""


def until(
    condition: Callable[[], T],
    what: str,
    now: Callable[[], object] | None = None,
    seldom: float = SELDOM,
) -> T:
    """What `condition` gives, as soon as it is true.

    Args:
        condition: asked again and again.
        what: is waited for; the failure says it.
        now: what there is in its place, for the failure.
        seldom: most seconds between two looks.

    Raises:
        AssertionError: not within `PATIENCE`.
    """
    began = time.monotonic()
    while not (found := condition()):
        waited = time.monotonic() - began
        if waited > PATIENCE:
            raise AssertionError(
                f"not within {PATIENCE:g} s: {what}; now: {now() if now else found}"
            )
        time.sleep(min(SOON + SHARE * waited, seldom))
    return found


def completed(
    work: Coroutine[Any, Any, T], run: Callable[[Coroutine[Any, Any, T]], T] = asyncio.run
) -> T:
    """What a coroutine gives, in a loop and a thread of its own: a browser that is open keeps the
    loop of this one.
    """
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(run, work).result()


def awaited(test: Callable[..., Coroutine[Any, Any, None]]) -> Callable[..., None]:
    """A test that is a coroutine, in a loop of its own."""

    @wraps(test)
    def run(*given: Any, **named: Any) -> None:
        completed(test(*given, **named))

    return run


async def settle() -> None:
    """Let everything that can go on do so."""
    for _ in range(10):
        await asyncio.sleep(0)
