"""The API: everything under `/api/v1`, health, metrics, and documentation pages that need no internet."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import structlog
from fastapi import FastAPI, Response
from fastapi.responses import RedirectResponse
from fastapi_offline import FastAPIOffline
from prometheus_client import CONTENT_TYPE_LATEST, CollectorRegistry, generate_latest
from sqlalchemy import text
from sqlalchemy.exc import SQLAlchemyError
from starlette.concurrency import run_in_threadpool

from fecore import __version__
from service.composition import ROUTERS
from service.db.engine import make_engine, make_sessions
from service.db.schema import SchemaError, require_head
from service.jobs.events import Changes
from service.jobs.metrics import JobMetrics
from service.problems import Unavailable
from service.problems.http import add_problem_handlers
from service.problems.middleware import BodyLimitMiddleware, RequestMiddleware
from service.problems.openapi import RESPONSES, describe_problems
from service.settings import Settings

log = structlog.stdlib.get_logger("modalbase.http")

PREFIX = "/api/v1"
DESCRIPTION = """\
Begin with **Authorize** and a key (`modalbase keys create --name NAME`). The main job, each step with the id that the one
before it answers: `POST /projects`; `POST /projects/{id}/structures`; `POST /structures/{id}/campaigns`;
`POST /campaigns/{id}/imports` with a UFF file, until `GET /imports/{id}` has succeeded; `POST /campaigns/{id}/update-jobs` with
the recipe `{}`, until `GET /update-jobs/{id}` has succeeded; `GET /update-jobs/{id}/result`.

Units are SI and in the names of fields, times UTC. Lists come in pages: hand `next_cursor` in as `cursor`. What is edited
has an `ETag`, which `If-Match` repeats.
"""


def create_app(settings: Settings) -> FastAPI:
    """The ASGI application on the database of `settings.database_url`.

    Raises:
        SchemaError: the database's schema is not this version's.
        sqlalchemy.exc.OperationalError: the database does not answer.
    """
    if settings.database_url is None:
        raise ValueError("settings.database_url is not set; `service.db.opening.open_database` gives the embedded one")
    engine = make_engine(settings.database_url, pool_size=settings.database_pool, name="modalbase api")
    try:
        require_head(engine)
    except BaseException:
        engine.dispose()
        raise

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        with app.state.changes:
            yield
        await run_in_threadpool(engine.dispose)

    app: FastAPI = FastAPIOffline(
        title="modalbase",
        summary="Structural test campaigns, and finite element models updated to them",
        description=DESCRIPTION,
        version=__version__,
        lifespan=lifespan,
        responses=RESPONSES,
    )
    app.state.settings, app.state.engine, app.state.sessions = settings, engine, make_sessions(engine)
    app.state.changes = Changes(settings.database_url, settings.event_streams)
    for router in ROUTERS:
        app.include_router(router, prefix=PREFIX)
    _add_health(app)

    @app.get("/", include_in_schema=False)
    async def root() -> RedirectResponse:
        """A browser that was given the service's bare address."""
        return RedirectResponse("docs")

    add_problem_handlers(app)
    describe_problems(app)
    app.add_middleware(BodyLimitMiddleware, settings=settings)
    app.add_middleware(RequestMiddleware)
    return app


def _add_health(app: FastAPI) -> None:
    @app.get("/healthz", tags=["health"])
    async def healthz() -> dict[str, str]:
        """Is the process up?"""
        return {"status": "ok", "version": __version__}

    @app.get("/readyz", tags=["health"])
    def readyz() -> dict[str, str]:
        """Does the database answer, and is its schema this version's?"""
        try:
            with app.state.engine.connect() as connection:
                connection.execute(text("SELECT 1"))
            require_head(app.state.engine)
        except SchemaError as error:
            raise Unavailable(str(error)) from error
        except SQLAlchemyError as error:  # its words name hosts and folders, and anybody may ask
            log.warning("not ready", error=str(error))
            raise Unavailable("the database does not answer") from error
        return {"status": "ok"}

    jobs = CollectorRegistry()
    jobs.register(JobMetrics(app.state.sessions))

    @app.get("/metrics", include_in_schema=False)
    def metrics() -> Response:
        """Metrics for Prometheus: of this process, and of all jobs."""
        return Response(generate_latest() + generate_latest(jobs), media_type=CONTENT_TYPE_LATEST)
