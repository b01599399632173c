"""Cards of the kinds of job, on the page of what each is of; a job's own address leads there."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any
from uuid import UUID

from fastapi import Path
from fastapi.responses import RedirectResponse, Response

from service.pages.look import Visit, VisitDep
from service.platform.web.routing import UI, page_router
from service.tasks.routes import ROUTES
from service.tasks.task import Task

router = page_router(UI)


@dataclass(frozen=True)
class ShownTask:
    """A kind of job on a page, with its newest job."""

    task: Task
    below: str  # address that a new one is posted to
    newest: Any


def cards_of(visit: Visit, owner: str, key: UUID) -> list[ShownTask]:
    """Kinds of job of a structure or campaign."""
    shown = []
    for task, routes in ROUTES.items():
        if task.owner == owner:
            newest = routes.page(visit.session, visit.user, key, limit=1).items
            below = f"{owner}s/{key}/{task.noun.address}"
            shown.append(ShownTask(task, below, newest[0] if newest else None))
    return shown


def _leading(task: Task) -> Callable[..., Response]:
    row_id = Path(alias=f"{task.kind.replace(' ', '_')}_id")

    def lead(visit: VisitDep, key: UUID = row_id) -> Response:
        row: Any = ROUTES[task].one(visit.session, visit.user, key)
        return RedirectResponse(f"../{task.owner}s/{getattr(row, f'{task.owner}_id')}")

    lead.__doc__ = f"What a {task.kind} is of."
    return lead


for _task in ROUTES:
    router.add_api_route(
        f"/{_task.noun.address}/{{{_task.kind.replace(' ', '_')}_id}}", _leading(_task)
    )
