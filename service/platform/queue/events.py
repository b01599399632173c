"""Jobs' states as they change, for who watches (server-sent events).

An event is a job's state and carries its version as id. A client that comes back with
`Last-Event-ID` gets the state of now if it has changed since, and nothing that is overtaken: a
state replaces all before it, so none need be kept.

All streams of a process share one look at the database: at the jobs that a notice named, and now
and then at all that are watched, since a notice may be lost. A stream itself holds neither a
connection nor a thread.
"""

import asyncio
import json
import time
from collections import Counter
from collections.abc import AsyncIterator, Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import Annotated, Any, Self
from uuid import UUID

import anyio
import structlog
from fastapi import Depends, Header, Request, Response
from fastapi.encoders import jsonable_encoder
from fastapi.sse import KEEPALIVE_COMMENT, EventSourceResponse, format_sse_event
from sqlalchemy import select
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from service.platform.access.dependencies import CurrentKey
from service.platform.db.engine import Sessions
from service.platform.errors import TooManyRequests
from service.platform.queue.background import Listener
from service.platform.queue.resource import ENDED, job_state
from service.platform.queue.tables import CHANGED, Job

LOOK_SECONDS = 2.0  # between two looks at all jobs, while notices come through
POLL_SECONDS = 0.5  # while they do not
PAUSE_SECONDS = 0.05  # between two looks, so that a burst of notices is one look
PING_SECONDS = 15.0  # of silence, after which a comment shows proxies that the stream lives

log = structlog.stdlib.get_logger("modalbase.events")

STREAM: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "events of the type `job`",
        "content": {"text/event-stream": {"schema": {"type": "string"}}},
    },
    204: {"description": "the job has ended, and the client has seen that"},
}
"""What the route of a stream answers, for the API's description."""


@dataclass(frozen=True)
class Shown:
    """A job's state as an event."""

    version: int
    event: bytes
    ended: bool


def shown(job: Job) -> Shown:
    """The event of a job's present state."""
    data = json.dumps(jsonable_encoder(job_state(job)))
    event = format_sse_event(data_str=data, event="job", id=str(job.version))
    return Shown(job.version, event, job.state in ENDED)


Look = Callable[[Session, set[UUID]], Mapping[UUID, Shown]]
"""States of those among these ids that it knows."""


def look_at_jobs(session: Session, ids: set[UUID]) -> dict[UUID, Shown]:
    """States of jobs."""
    return {job.id: shown(job) for job in session.scalars(select(Job).where(Job.id.in_(ids)))}


@dataclass
class _Watched:
    """What streams watch."""

    state: Shown | None  # the last one that was seen; None where it is gone
    # of each stream what is set when it has changed
    streams: set[asyncio.Event] = field(default_factory=set)

    def wake(self) -> None:
        """Have the streams look at the state."""
        for changed in self.streams:
            changed.set()


class Changes:
    """Looks at the jobs that the streams of an API process watch; a context manager of its event
    loop.

    Attributes:
        closed: the process is about to end, and so are its streams.
    """

    def __init__(
        self, url: str, sessions: Sessions, limit: int, looks: Sequence[Look] = (look_at_jobs,)
    ) -> None:
        """Prepare.

        Args:
            url: the database, to listen to.
            sessions: of the same database, to look at jobs.
            limit: streams at a time.
            looks: what knows the states of what is watched.
        """
        self._limit, self._sessions, self._looks = limit, sessions, looks
        self._watched: dict[UUID, _Watched] = {}
        self._open = Counter[str]()
        self._due: set[UUID] = set()
        self._wake = asyncio.Event()
        self._looking: asyncio.Task[None] | None = None
        self._thread = anyio.CapacityLimiter(1)
        self._listener = Listener(url, [CHANGED], self._on_notify)
        self._loop: asyncio.AbstractEventLoop | None = None
        self.closed = False

    def __enter__(self) -> Self:
        self._loop = asyncio.get_running_loop()
        self._listener.__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        self.close()
        self._listener.__exit__(*error)

    @property
    def patience(self) -> float:
        """Seconds after which all watched jobs are looked at without a notice."""
        return LOOK_SECONDS if self._listener.connected.is_set() else POLL_SECONDS

    def close(self) -> None:
        """End every stream, so that the server can end."""
        self.closed = True
        self._wake.set()
        for watched in self._watched.values():
            watched.wake()

    def admit(self, caller: str) -> None:
        """Is there room for another stream?

        Args:
            caller: whose it is; one caller may have half of all.

        Raises:
            TooManyRequests: as many as the operator allows are open, or this caller has its share.
        """
        if self._open[caller] >= (share := max(1, self._limit // 2)):
            full = f"{share} streams of events of this key are open"
        elif self._open.total() >= self._limit:
            full = f"{self._limit} streams of events are open here"
        else:
            return
        raise TooManyRequests(f"{full}; poll the job instead", retry_after=10)

    @contextmanager
    def of(
        self, states: Mapping[UUID, Shown], caller: str
    ) -> Iterator[tuple[asyncio.Event, list[_Watched]]]:
        """Watch jobs, whose last states are given and kept up to date; the event is set when one of
        them has changed. The caller has one stream more.
        """
        changed = asyncio.Event()
        self._open[caller] += 1
        all_watched = [
            self._watched.setdefault(key, _Watched(state)) for key, state in states.items()
        ]
        for watched in all_watched:
            watched.streams.add(changed)
        self._due.update(states)  # they may have changed since
        self._wake.set()
        if self._looking is None or self._looking.done():
            self._looking = asyncio.get_running_loop().create_task(self._look())
        try:
            yield changed, all_watched
        finally:
            self._open[caller] -= 1
            self._open += Counter()  # forgets who has none
            for key, watched in zip(states, all_watched, strict=True):
                watched.streams.discard(changed)
                if not watched.streams:
                    self._watched.pop(key, None)

    async def ended(self, job: Shown, job_id: UUID, caller: str, seconds: float) -> bool:
        """Wait until a job has ended, for so many seconds at most, and say whether it has.

        A wait counts as a stream: where there is no room for another, the answer comes at once.
        """
        try:
            self.admit(caller)
        except TooManyRequests:
            return job.ended
        with self.of({job_id: job}, caller) as (changed, (watched,)), suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                while not self.closed and watched.state is not None and not watched.state.ended:
                    await changed.wait()
                    changed.clear()
        return watched.state is None or watched.state.ended

    def _on_notify(self, job_id: str) -> None:
        if self._loop is not None:
            with suppress(RuntimeError):  # the loop has ended
                self._loop.call_soon_threadsafe(self._mark, UUID(job_id))

    def _mark(self, job_id: UUID) -> None:
        if job_id in self._watched:
            self._due.add(job_id)
            self._wake.set()

    async def _look(self) -> None:
        """Look at what is watched, as long as anything is."""
        all_at = time.monotonic() + self.patience
        while self._watched and not self.closed:
            with suppress(TimeoutError):
                async with asyncio.timeout(max(0.0, all_at - time.monotonic())):
                    await self._wake.wait()
            self._wake.clear()
            if everything := time.monotonic() >= all_at:
                all_at = time.monotonic() + self.patience
            due, self._due = set(self._watched if everything else self._due), set()
            for job_id, state in (
                await anyio.to_thread.run_sync(self._read, due, limiter=self._thread)
            ).items():
                watched = self._watched.get(job_id)
                if watched is not None and watched.state != state:
                    watched.state = state
                    watched.wake()
            await asyncio.sleep(PAUSE_SECONDS)

    def _read(self, due: set[UUID]) -> dict[UUID, Shown | None]:
        """States of jobs, None of one that is gone; nothing while the database is away, for which
        streams wait.
        """
        if not due:
            return {}
        try:
            with self._sessions() as session:
                known = [look(session, due) for look in self._looks]
        except SQLAlchemyError as error:
            log.warning(
                "the database does not answer; streams wait", error=str(error).split("\n", 1)[0]
            )
            return {}
        return {key: next((states[key] for states in known if key in states), None) for key in due}


def _changes(request: Request) -> Changes:
    changes: Changes = request.app.state.changes
    return changes


ChangesDep = Annotated[Changes, Depends(_changes)]


LastEventId = Annotated[
    str | None, Header(max_length=100, description="id of the last event that was received")
]


class Events:
    """What a route needs to answer with a stream: `events: Annotated[Events, Depends()]`."""

    def __init__(
        self, changes: ChangesDep, key: CurrentKey, last_event_id: LastEventId = None
    ) -> None:
        self._changes, self._caller = changes, str(key.id)
        known = last_event_id is not None and last_event_id.isascii() and last_event_id.isdecimal()
        self._last = int(last_event_id or 0) if known else None

    def of(self, job: Job) -> Response:
        """The stream of a job's states: the present one at once, the last one when it has ended.

        No content, which keeps a browser from coming back, where the client has seen the end
        already.

        Raises:
            TooManyRequests: as many streams as the operator allows are open.
        """
        if job.state in ENDED and job.version == self._last:
            return Response(status_code=204)
        return self._answer({job.id: shown(job)}, {job.id: self._last})

    def of_all(self, states: Mapping[UUID, Shown]) -> Response:
        """One stream of the states of several: the present ones at once; it ends when all have.

        Raises:
            TooManyRequests: as many streams as the operator allows are open.
        """
        return self._answer(states, {})

    def _answer(self, states: Mapping[UUID, Shown], sent: Mapping[UUID, int | None]) -> Response:
        self._changes.admit(self._caller)
        headers = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}
        return EventSourceResponse(self._stream(states, dict(sent)), headers=headers)

    async def _stream(
        self, states: Mapping[UUID, Shown], sent: dict[UUID, int | None]
    ) -> AsyncIterator[bytes]:
        with self._changes.of(states, self._caller) as (changed, all_watched):
            while not self._changes.closed:
                changed.clear()
                now = {
                    key: one.state
                    for key, one in zip(states, all_watched, strict=True)
                    if one.state is not None
                }
                for key, state in now.items():  # what is not there was deleted with its project
                    if state.version != sent.get(key):
                        sent[key] = state.version
                        yield state.event
                if all(state.ended for state in now.values()):
                    return
                try:
                    async with asyncio.timeout(PING_SECONDS):
                        await changed.wait()
                except TimeoutError:
                    yield KEEPALIVE_COMMENT
