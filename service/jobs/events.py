"""A job's states as they change, for who watches (server-sent events).

An event is the job's state and carries its version as id. A client that comes back with `Last-Event-ID` gets the state
of now if it has changed since, and nothing that is overtaken: a state replaces all before it, so none need be kept.
The database tells when to look; while it cannot, and now and then in any case, the stream looks by itself.
"""

from __future__ import annotations

import asyncio
import json
import time
from collections import defaultdict
from collections.abc import AsyncIterator, Iterator
from contextlib import contextmanager, suppress
from types import TracebackType
from typing import Annotated, Any, Self
from uuid import UUID

from fastapi import Depends, Header, Request, Response
from fastapi.encoders import jsonable_encoder
from fastapi.sse import KEEPALIVE_COMMENT, EventSourceResponse, format_sse_event
from sqlalchemy.exc import NoResultFound, OperationalError
from starlette.concurrency import run_in_threadpool

from service.db.engine import Sessions
from service.jobs.notices import Listener
from service.jobs.state import ENDED, job_state
from service.jobs.tables import CHANGED, Job
from service.problems.errors import TooManyRequests

LOOK_SECONDS = 2.0  # while notices come through
POLL_SECONDS = 0.5  # while they do not
PING_SECONDS = 15.0  # of silence, after which a comment shows proxies that the stream lives


STREAM: dict[int | str, dict[str, Any]] = {
    200: {"description": "events of the type `job`", "content": {"text/event-stream": {"schema": {"type": "string"}}}},
    204: {"description": "the job has ended, and the client has seen that"},
}
"""What the route of a stream answers, for the API's description."""


class Changes:
    """Wakes the streams of an API process whose jobs have changed; a context manager of its event loop.

    Attributes:
        closed: the process is about to end, and so are its streams.
    """

    def __init__(self, url: str, limit: int) -> None:
        """Prepare.

        Args:
            url: the database.
            limit: streams at a time.
        """
        self._limit = limit
        self._waiting: dict[str, set[asyncio.Event]] = defaultdict(set)
        self._listener = Listener(url, [CHANGED], self._heard)
        self._loop: asyncio.AbstractEventLoop | None = None
        self.closed = False

    def __enter__(self) -> Self:
        self._loop = asyncio.get_running_loop()
        self._listener.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
        self._listener.__exit__(kind, error, trace)

    @property
    def patience(self) -> float:
        """Seconds after which a stream looks without having been woken."""
        return LOOK_SECONDS if self._listener.connected.is_set() else POLL_SECONDS

    def close(self) -> None:
        """End every stream, so that the server can end."""
        self.closed = True
        for events in self._waiting.values():
            for event in events:
                event.set()

    def admit(self) -> None:
        """Is there room for another stream?

        Raises:
            TooManyRequests: as many as the operator allows are open.
        """
        if sum(map(len, self._waiting.values())) >= self._limit:
            raise TooManyRequests(f"{self._limit} streams of events are open here; poll the job instead")

    @contextmanager
    def of(self, job_id: UUID) -> Iterator[asyncio.Event]:
        """An event that is set whenever the job has changed."""
        event = asyncio.Event()
        self._waiting[str(job_id)].add(event)
        try:
            yield event
        finally:
            self._waiting[str(job_id)].discard(event)
            if not self._waiting[str(job_id)]:
                del self._waiting[str(job_id)]

    def _heard(self, job_id: str) -> None:
        if self._loop is not None and job_id in self._waiting:
            self._loop.call_soon_threadsafe(self._wake, job_id)

    def _wake(self, job_id: str) -> None:
        for event in self._waiting.get(job_id, ()):
            event.set()


def _changes(request: Request) -> Changes:
    changes: Changes = request.app.state.changes
    return changes


def _sessions(request: Request) -> Sessions:
    sessions: Sessions = request.app.state.sessions
    return sessions


LastEventId = Annotated[str | None, Header(max_length=100, description="id of the last event that was received")]


class Events:
    """What a route needs to answer with a stream: `events: Annotated[Events, Depends()]`."""

    def __init__(
        self,
        changes: Annotated[Changes, Depends(_changes)],
        sessions: Annotated[Sessions, Depends(_sessions)],
        last_event_id: LastEventId = None,
    ) -> None:
        self._changes, self._sessions = changes, sessions
        self._last = (
            int(last_event_id)
            if last_event_id is not None and last_event_id.isascii() and last_event_id.isdecimal()
            else None
        )

    def of(self, job: Job) -> Response:
        """The stream of a job's states: the present one at once, the last one when it has ended.

        No content, which tells a browser not to come back, where the client has seen the end already.

        Raises:
            TooManyRequests: as many streams as the operator allows are open.
        """
        if job.state in ENDED and job.version == self._last:
            return Response(status_code=204)
        self._changes.admit()
        headers = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}
        return EventSourceResponse(self._stream(job.id), headers=headers)

    async def _stream(self, job_id: UUID) -> AsyncIterator[bytes]:
        told, spoke = self._last, time.monotonic()
        with self._changes.of(job_id) as changed, suppress(NoResultFound):  # deleted with its project
            while not self._changes.closed:
                changed.clear()
                version, state = await run_in_threadpool(self._read, job_id)
                if version is not None and version != told:
                    told, spoke = version, time.monotonic()
                    yield format_sse_event(data_str=json.dumps(state), event="job", id=str(told))
                    if state["status"] in ENDED:
                        return
                elif time.monotonic() - spoke > PING_SECONDS:
                    spoke = time.monotonic()
                    yield KEEPALIVE_COMMENT
                with suppress(TimeoutError):
                    await asyncio.wait_for(changed.wait(), self._changes.patience)

    def _read(self, job_id: UUID) -> tuple[int | None, Any]:
        """Version and state of a job; nothing while the database is away, for which a stream waits."""
        try:
            with self._sessions() as session:
                job = session.get_one(Job, job_id)
                return job.version, jsonable_encoder(job_state(job))
        except OperationalError:
            return None, None
