"""The API: everything under `/api/v1`, health, metrics, and documentation pages that need no
internet.
"""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import structlog
from anyio import CapacityLimiter, fail_after, to_thread
from anyio.to_thread import current_default_thread_limiter
from fastapi import FastAPI, Response
from prometheus_client import CONTENT_TYPE_LATEST, CollectorRegistry, generate_latest
from sqlalchemy import Engine, text
from sqlalchemy.exc import SQLAlchemyError
from starlette.concurrency import run_in_threadpool

from fecore import __version__
from service.app.composition import FINDERS, ROUTERS
from service.nouns.monitors.live import look_at_monitors
from service.nouns.monitors.metrics import MonitorMetrics
from service.pages import PageErrors, add_pages
from service.pages.guide.routes import router as guide
from service.pages.look import files as assets
from service.platform.access.authentication import Authentication, Paths, SessionCookie
from service.platform.db.engine import for_reading, make_engine, make_sessions
from service.platform.db.schema import SchemaError, require_head
from service.platform.errors import Unavailable
from service.platform.queue.events import Changes, look_at_jobs
from service.platform.queue.metrics import JobMetrics
from service.platform.settings import Settings
from service.platform.web.middleware import KnownHosts, RequestMiddleware
from service.platform.web.openapi import RESPONSES, add_documentation, describe_problems
from service.platform.web.problems import add_problem_handlers
from service.platform.web.routing import API, UI, serve
from service.tasks.routes import HEADINGS

log = structlog.stdlib.get_logger("modalbase.http")

# connections that no request holds: one for /readyz and /metrics, one for streams of events
ASIDE = 2
# for blocks of files on their way to or from clients; who has a slot has one of the others
FILE_THREADS = 40
READY_SECONDS = 5.0
DESCRIPTION = """\
Begin with **Authorize** and a key (`modalbase keys create --name NAME`). The main job, each step with the id that the one
before it answers: `POST /projects`; `POST /projects/{id}/structures`; `POST /structures/{id}/campaigns`;
`POST /campaigns/{id}/imports` with a UFF file, until `GET /imports/{id}` has succeeded; `PUT /campaigns/{id}/grid-points` where
the file has none; `POST /campaigns/{id}/update-jobs` with the recipe `{}`, until `GET /update-jobs/{id}` has succeeded;
`GET /update-jobs/{id}/result`; `GET /update-jobs/{id}/report`, the PDF. Each of these has its `curl`.

Units are SI and in the names of fields, times UTC. Lists come in pages: hand `next_cursor` in as `cursor`. What is edited
has an `ETag`, which `If-Match` repeats.
"""


LOOKS = (look_at_jobs, look_at_monitors)
"""What streams of events can watch."""


def create_app(settings: Settings) -> FastAPI:
    """The ASGI application on the database of `settings.database_url`.

    Raises:
        SchemaError: the database's schema is not this version's.
        sqlalchemy.exc.OperationalError: the database does not answer.
    """
    if settings.database_url is None:
        raise ValueError(
            "settings.database_url is not set; `service.platform.db.opening.open_database` gives the"
            " embedded one"
        )
    connections = settings.database_pool + ASIDE
    engine = make_engine(
        settings.database_url, pool_size=connections, overflow=0, name="modalbase api"
    )
    try:
        require_head(engine)
    except BaseException:
        engine.dispose()
        raise

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        current_default_thread_limiter().total_tokens = settings.database_pool + FILE_THREADS
        with app.state.changes:
            yield
        await run_in_threadpool(engine.dispose)

    app = FastAPI(
        title="modalbase",
        summary="Structural test campaigns, and finite element models updated to them",
        description=DESCRIPTION,
        version=__version__,
        lifespan=lifespan,
        responses=RESPONSES,
        openapi_url="/openapi.json" if settings.docs else None,
        openapi_tags=[{"name": name, "description": text} for name, text in HEADINGS],
        docs_url=None,
        redoc_url=None,
    )
    app.state.settings, app.state.engine = settings, engine
    app.state.sessions = make_sessions(engine, project_quota_bytes=settings.project_quota_bytes)
    app.state.reading = make_sessions(
        for_reading(engine), project_quota_bytes=settings.project_quota_bytes
    )
    app.state.changes = Changes(
        settings.database_url, app.state.reading, settings.event_streams, LOOKS
    )
    for router in ROUTERS:
        serve(app, router)
    _add_health(app)

    if settings.docs:
        add_documentation(app)
        serve(app, guide)
    if settings.pages:
        add_pages(app)
    if settings.docs or settings.pages:
        serve(app, assets)
    if settings.metrics:
        _add_metrics(app)
    add_problem_handlers(app)
    describe_problems(app)
    _add_middleware(app, settings)
    return app


def _add_middleware(app: FastAPI, settings: Settings) -> None:
    """What each request passes; the last one added is the first."""
    paths = Paths(app.routes, API, FINDERS)
    prefixes = (API, UI) if settings.pages else (API,)
    app.add_middleware(
        Authentication,
        settings=settings,
        sessions=app.state.sessions,
        paths=paths,
        prefixes=prefixes,
    )
    app.add_middleware(SessionCookie)
    if hosts := settings.known_hosts:
        app.add_middleware(KnownHosts, allowed=hosts)
    app.add_middleware(RequestMiddleware)
    if settings.pages:
        app.add_middleware(PageErrors)


def _add_health(app: FastAPI) -> None:
    @app.get("/healthz", tags=["health"])
    async def healthz() -> dict[str, str]:
        """Is the process up?"""
        return {"status": "ok", "version": __version__}

    own_thread = CapacityLimiter(1)  # neither of these waits for requests, nor they for it

    @app.get("/readyz", tags=["health"])
    async def readyz() -> dict[str, str]:
        """Does the database answer, and is its schema this version's?"""
        try:
            with fail_after(READY_SECONDS):
                await to_thread.run_sync(
                    _ask, app.state.engine, limiter=own_thread, abandon_on_cancel=True
                )
        except SchemaError as error:
            raise Unavailable(str(error)) from error
        # its words name hosts and folders, and anybody may ask
        except (SQLAlchemyError, TimeoutError) as error:
            log.warning("not ready", error=str(error) or f"no answer in {READY_SECONDS:g} s")
            raise Unavailable("the database does not answer") from error
        return {"status": "ok"}


def _add_metrics(app: FastAPI) -> None:
    own_thread = CapacityLimiter(1)
    jobs = CollectorRegistry()
    jobs.register(JobMetrics(app.state.sessions))
    jobs.register(MonitorMetrics(app.state.sessions))

    @app.get("/metrics", include_in_schema=False)
    async def metrics() -> Response:
        """Metrics for Prometheus: of this process, of all jobs, and of monitors."""
        written = generate_latest() + await to_thread.run_sync(
            generate_latest, jobs, limiter=own_thread
        )
        return Response(written, media_type=CONTENT_TYPE_LATEST)


def _ask(engine: Engine) -> None:
    with engine.connect() as connection:
        connection.execute(text("SELECT 1"))
    require_head(engine)
