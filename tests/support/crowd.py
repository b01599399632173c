"""Many clients at once, from one process."""

import asyncio
from collections import Counter
from collections.abc import Awaitable, Callable
from typing import TypeVar

import httpx

from service.app.supervisor import LocalService
from tests.support.rest import ONCE
from tests.support.waiting import PATIENCE, completed

Result = TypeVar("Result")


async def with_crowd(
    service: LocalService, key: str, work: Callable[[httpx.AsyncClient], Awaitable[Result]]
) -> Result:
    """Run something with a client that opens as many connections as it has requests."""
    async with httpx.AsyncClient(
        base_url=f"{service.url}/api/v1/",
        headers={"Authorization": f"Bearer {key}"},
        limits=ONCE,
        timeout=PATIENCE,
        trust_env=False,
    ) as client:
        return await work(client)


def at_once(service: LocalService, key: str, path: str, count: int) -> list[httpx.Response]:
    """The answers to that many GET requests, sent at the same moment."""

    async def work(client: httpx.AsyncClient) -> list[httpx.Response]:
        return await asyncio.gather(*[client.get(path) for _ in range(count)])

    return completed(with_crowd(service, key, work))


def statuses(answers: list[httpx.Response]) -> Counter[int]:
    """How often each status."""
    return Counter(answer.status_code for answer in answers)
