"""Work on many things by several threads, its results in order.

Transforms, sums and products of arrays, and the reading of files, let other threads work meanwhile.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

Result = TypeVar("Result")

_AHEAD = 2  # results a thread that wait for the one before them


def abreast(work: Callable[[int], Result], count: int, threads: int) -> Iterator[Result]:
    """work(0), work(1) … work(count - 1), in this order; few of them are worked on, or kept, before they are taken."""
    if threads == 1:
        yield from map(work, range(count))
        return
    with ThreadPoolExecutor(threads) as pool:
        under_way: deque[Future[Result]] = deque()
        for number in range(count):
            under_way.append(pool.submit(work, number))
            if len(under_way) > _AHEAD * threads:
                yield under_way.popleft().result()
        while under_way:
            yield under_way.popleft().result()
