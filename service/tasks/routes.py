"""Routes that every whole kind of job has: made, listed, read, cancelled; with those of each kind's
own folder.
"""

from collections.abc import Iterator
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from fastapi import APIRouter

from service.platform.access import api_router
from service.platform.queue.routes import JobRoutes
from service.tasks.kinds import TASKS
from service.tasks.task import Task


def _routes_of(task: Task, router: APIRouter) -> JobRoutes[Any, Any]:
    noun, kind, name = task.noun, task.kind, task.kind.replace(" ", "_")
    many = noun.address.replace("-", " ")
    routes = JobRoutes(
        router,
        noun,
        task.answer,
        f"{name}_id",
        lambda _, rows: [{"found": row.document} for row in rows],
    )
    routes.creating(name, task.text, task.request, task.start, status=202, scope="jobs")
    routes.listing(
        f"list_{many.replace(' ', '_')}",
        f"{many.capitalize()} of a {task.owner}, newest first.",
    )
    routes.getting(f"get_{name}", f"How far a {kind} is, and {task.says}.")
    routes.cancelling(
        f"cancel_{name}",
        f"Ask for a {kind}'s end; one that has ended already stays as it is.",
    )
    return routes


ROUTES: dict[Task, JobRoutes[Any, Any]] = {}
"""Of each whole task, for pages."""


def _routers() -> Iterator[APIRouter]:
    # those that state their own routes come first, as the documents have them
    for task in sorted(TASKS, key=lambda task: isinstance(task, Task)):
        if isinstance(task, Task):
            router = api_router(tags=[task.about[0]])
            ROUTES[task] = _routes_of(task, router)
            yield router
        if find_spec(own := f"{task.folder}.routes") is not None:
            yield import_module(own).router


ROUTERS: tuple[APIRouter, ...] = tuple(_routers())
HEADINGS = [task.about for task in ROUTES]
"""Headings of the documentation page, each with its sentence."""
