"""The worker's end of the engine: it fetches what the policy says, and lives through any absence of
the database.

The engine's worker asks its job manager for everything. This one begins the job whose turn it is in
the transaction that fetches its ticket, and leaves the end of a ticket to the transaction that ends
the job. Where the engine's own gives up with the first broken connection, this one tries again.
"""

import asyncio
import time
from collections.abc import Iterable

import structlog
from procrastinate import PsycopgConnector, jobs
from procrastinate.exceptions import ConnectorException
from procrastinate.manager import JobManager, NotificationCallback
from psycopg_pool import AsyncNullConnectionPool
from sqlalchemy.exc import DBAPIError

from service.platform.db.engine import Sessions, psycopg_url
from service.platform.queue import queue_adapter
from service.platform.queue.attempt import passes
from service.platform.queue.background import AGAIN_SECONDS
from service.platform.queue.dispatch import begin_next, recover_stalled, recover_strays
from service.platform.queue.kinds import REQUESTS
from service.platform.queue.tables import Job
from service.platform.settings import Settings

log = structlog.stdlib.get_logger("modalbase.worker")


class Manager(JobManager):
    """The engine's job manager for one worker.

    Attributes:
        running: the begun jobs by ticket; who has ended one removes it.
        abortable: tickets of those whose work has started; the engine hears of no other's abort, as
            it would cancel a task that has not run a line and so could not say that it has ended.
        draining: nothing more is fetched.
        unsure: the database may say that this worker runs what it does not.
    """

    def __init__(self, settings: Settings, sessions: Sessions, worker: str) -> None:
        """Prepare.

        Args:
            settings: with `database_url`.
            sessions: where the rows are.
            worker: name of the worker.
        """
        # No pool for the engine's few needs: one that has tried in vain waits longer and longer
        # before it tries again.
        url = psycopg_url(settings.database_url or "")
        super().__init__(PsycopgConnector(conninfo=url, pool_factory=AsyncNullConnectionPool))
        self._sessions, self._worker = sessions, worker
        self._silence, self._limit = settings.job_lease_seconds, settings.project_job_limit
        self._places = settings.worker_concurrency
        self._recover_at, self._worker_id = 0.0, 0
        self.running: dict[int, Job] = {}
        self.abortable: set[int] = set()
        self.draining = self.unsure = False
        self._notify: NotificationCallback | None = None  # the engine, which looks for tickets then

    async def unregister_worker(self, worker_id: int) -> None:
        """Leave the engine's list, where the database answers."""
        try:
            await super().unregister_worker(worker_id)
        except ConnectorException as error:
            log.warning(
                "the database does not answer; others will miss this worker", error=str(error)
            )

    async def fetch_job(self, queues: Iterable[str] | None, worker_id: int) -> jobs.Job | None:
        """Begin the job whose turn it is, and fetch its ticket."""
        self._worker_id = worker_id
        while not self.draining:
            before = set(self.running)
            try:
                ticket = await asyncio.to_thread(self._fetch, queues, worker_id)
            except DBAPIError as error:
                self._outlive(error)
                return None
            # the engine forgets a notice that comes while it looks, such as of a place
            if ticket is not None or before <= self.running.keys():
                return ticket
        return None

    def _fetch(self, queues: Iterable[str] | None, worker_id: int) -> jobs.Job | None:
        if self.unsure:
            self.unsure = False
            with self._sessions.begin() as session:
                recover_strays(session, worker_id, list(self.running))
        with self._sessions.begin() as session:
            job = begin_next(session, self._open(queues), self._worker, self._limit)
            ticket = None if job is None else queue_adapter.take(session, job, worker_id)
        if job is not None and job.ticket is not None:
            self.running[job.ticket] = job
        return ticket

    def _open(self, queues: Iterable[str] | None) -> Iterable[str] | None:
        """The queues that there is a place for: one place is kept for what requests wait for."""
        if sum(job.queue != REQUESTS for job in self.running.values()) < self._places:
            return queues
        return [REQUESTS] if queues is None or REQUESTS in queues else []

    async def finish_job(self, job: jobs.Job, status: jobs.Status, delete_job: bool) -> None:
        """Look for the next job at once: the engine stopped looking while every place but that of
        requests was taken. The ticket has ended with its job.
        """
        del status, delete_job
        if self._notify is not None and job.id is not None:
            await self._notify(
                channel="", notification=jobs.JobInserted(type="job_inserted", job_id=job.id)
            )

    async def list_jobs_to_abort_async(self, queue: str | None = None) -> Iterable[int]:
        """Tickets of jobs that were cancelled, or that another worker has now."""
        del queue  # the worker's own tickets, whichever their queue
        try:
            return await asyncio.to_thread(self._to_abort)
        except DBAPIError as error:
            self._outlive(error)
            return ()

    def _to_abort(self) -> list[int]:
        with self._sessions.begin() as session:
            return queue_adapter.to_abort(session, self._worker_id, list(self.abortable))

    async def update_heartbeat(self, worker_id: int) -> None:
        """Show that this worker lives, and look for jobs of those that do not."""
        while True:
            try:
                return await asyncio.to_thread(self._beat, worker_id)
            except DBAPIError as error:
                self._outlive(error)
            await asyncio.sleep(AGAIN_SECONDS)

    def _beat(self, worker_id: int) -> None:
        with self._sessions.begin() as session:
            queue_adapter.beat(session, worker_id)
        if time.monotonic() >= self._recover_at:
            with self._sessions.begin() as session:
                recover_stalled(session, self._silence)

    async def listen_for_jobs(
        self, *, on_notification: NotificationCallback, queues: Iterable[str] | None = None
    ) -> None:
        """Listen for tickets and aborts, on another connection when one breaks. An abort that comes
        before the work has started is found by looking.
        """

        async def pass_on(*, channel: str, notification: jobs.Notification) -> None:
            if notification["type"] == "job_inserted" or notification["job_id"] in self.abortable:
                await on_notification(channel=channel, notification=notification)

        self._notify = on_notification
        while True:
            try:
                await super().listen_for_jobs(on_notification=pass_on, queues=queues)
            except ConnectorException as error:
                log.warning(
                    "notices are interrupted; connecting again",
                    error=str(error.__cause__ or error).strip(),
                )
            await asyncio.sleep(AGAIN_SECONDS)

    def _outlive(self, error: DBAPIError) -> None:
        """Let an outage pass. When the database comes back, every worker shows that it lives before
        any is taken for dead.
        """
        if not passes(error):
            raise error
        self.unsure, self._recover_at = True, time.monotonic() + self._silence
        log.warning("the database does not answer; trying again", error=str(error.orig).strip())
