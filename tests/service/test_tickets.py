"""The worker's end of the queue, when it is told to end while it is still connecting."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from procrastinate.job_context import JobContext

from service.jobs.tickets import Tickets
from service.settings import Settings


def test_told_to_end_while_connecting_it_leaves_nothing_behind(new_database: Callable[[], str]) -> None:
    """What a cancelled pool leaves swallows every later cancellation, and the process would wait for it for ever."""
    settings = Settings(database_url=new_database())

    async def no_job(_: JobContext) -> None:
        raise AssertionError("the queue is empty")

    async def end_after(seconds: float) -> None:
        told = asyncio.Event()
        serving = asyncio.create_task(Tickets(settings, "w", None, no_job).serve(told))
        await asyncio.sleep(seconds)
        told.set()
        serving.cancel()
        await asyncio.wait([serving], timeout=10)
        assert serving.done()
        left = asyncio.all_tasks() - {asyncio.current_task()}
        for task in left:  # as asyncio.run does before it waits for them
            task.cancel()
        if left:
            await asyncio.wait(left, timeout=1)
        assert not [task for task in left if not task.done()]

    async def all_moments() -> None:
        for milliseconds in range(0, 60, 2):
            await end_after(milliseconds / 1e3)

    asyncio.run(all_moments())
