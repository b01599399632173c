"""The worker's end of the queue: tickets come in; a lost connection is made anew while the work goes on."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

import psycopg
import structlog
from procrastinate import App, PsycopgConnector
from procrastinate.app import WorkerOptions
from procrastinate.exceptions import ConnectorException
from procrastinate.jobs import Status

from service.db.engine import psycopg_url
from service.jobs.queue import TASK
from service.settings import Settings

AGAIN_SECONDS = 1.0
POLL_SECONDS = 5.0  # for tickets whose notice was lost with a connection

log = structlog.stdlib.get_logger("modalbase.worker")


class Tickets:
    """Serves the queue for one worker."""

    def __init__(
        self, settings: Settings, worker: str, queues: list[str] | None, job: Callable[..., Awaitable[None]]
    ) -> None:
        """Prepare.

        Args:
            settings: with `database_url`.
            worker: name of the worker.
            queues: which queues; None: all.
            job: called with the context of each ticket and its arguments.
        """
        self._url = psycopg_url(settings.database_url or "")
        self._job, self._queues = job, queues
        self._silence = settings.job_lease_seconds
        self._options = WorkerOptions(
            name=worker,
            concurrency=settings.worker_concurrency,
            fetch_job_polling_interval=POLL_SECONDS,
            shutdown_graceful_timeout=0,  # the worker itself waits for what runs
            update_heartbeat_interval=settings.job_lease_seconds / 3,
            stalled_worker_timeout=settings.job_lease_seconds,
            delete_jobs="always",
            install_signal_handlers=False,
        )
        if queues:
            self._options["queues"] = queues

    async def serve(self, told_to_end: asyncio.Event) -> None:
        """Until cancelled after the event, also when the database goes away and comes back.

        The event, because a library that is cancelled while the database is away raises that error instead.
        """
        while not told_to_end.is_set():
            try:
                await self._reach()
                await self._serve_once()
            except (ConnectorException, psycopg.Error, OSError) as error:
                log.warning("the queue does not answer", error=str(error.__cause__ or error).strip())
            if told_to_end.is_set():
                return
            log.warning("connecting to the queue again", seconds=AGAIN_SECONDS)
            await asyncio.sleep(AGAIN_SECONDS)

    async def _reach(self) -> None:
        """Is the database there? A pool that begins in vain waits longer and longer between its tries."""
        connection = await psycopg.AsyncConnection.connect(self._url, connect_timeout=5)
        await connection.close()

    async def _serve_once(self) -> None:
        connector = PsycopgConnector(conninfo=self._url, min_size=1, max_size=4, timeout=5, reconnect_timeout=5)
        queue = App(connector=connector)
        queue.task(name=TASK, pass_context=True)(self._job)
        opening = asyncio.ensure_future(connector.open_async())
        try:
            await asyncio.shield(opening)
            clearing = asyncio.create_task(self._clear(queue))
            try:
                await queue.run_worker_async(**self._options)
            finally:
                clearing.cancel()
        finally:
            # A pool that is cancelled while it opens leaves tasks behind that swallow every later cancellation.
            await asyncio.wait([opening])
            if opening.exception() is None:
                await connector.close_async()

    async def _clear(self, queue: App) -> None:
        """Remove the tickets that dead workers held: the jobs' rows know better what became of the jobs."""
        while True:
            try:
                for ticket in await queue.job_manager.get_stalled_jobs(seconds_since_heartbeat=self._silence):
                    await queue.job_manager.finish_job(ticket, status=Status.FAILED, delete_job=True)
                    log.info("a dead worker's ticket removed", ticket=ticket.id)
            except ConnectorException as error:
                log.debug("the queue does not answer", error=str(error))
            await asyncio.sleep(self._silence)
