"""The end of a worker's event loop."""

import asyncio

import pytest

from service.jobs import worker


def test_a_task_that_goes_on_does_not_hold_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker, "LEFT_SECONDS", 0.1)
    seen = []

    async def stubborn() -> None:
        while True:
            try:
                await asyncio.Event().wait()  # which nobody sets
            except asyncio.CancelledError:
                seen.append("cancelled")

    async def work() -> None:
        seen.append(asyncio.create_task(stubborn()).get_name())
        await asyncio.sleep(0)

    worker.run_to_end(work())
    assert seen[1:] == ["cancelled"]
