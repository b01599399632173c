"""Routes of identifications, and the figure of one."""

from collections.abc import Sequence
from typing import Any
from uuid import UUID

from fastapi import Response
from pydantic import Field
from sqlalchemy.orm import Session

from service.compute.identifying import up_to_date
from service.figures.answers import RESPONSES, FigureName, FigureRequestDep, require_figure
from service.figures.modes import stabilisation_figure
from service.nouns.modes.operations import identified_by
from service.platform.access import CurrentUser, SessionDep, api_router
from service.platform.queue.resource import JobOut, require_result
from service.platform.queue.routes import JobRoutes
from service.tasks.identify.task import (
    IDENTIFICATIONS,
    Identification,
    IdentificationIn,
    identification_for,
    start_identification,
)

router = api_router(tags=["identifications"])


class IdentificationOut(JobOut):
    """An identification: how far it is, and what it found."""

    campaign_id: UUID
    options: IdentificationIn
    mode_set: UUID | None = Field(description="the modes that it found")
    result: dict[str, Any] | None = Field(
        description="quality of the modes, what was left out, stabilisation diagram"
    )


def _with_modes(session: Session, rows: Sequence[Identification]) -> list[dict[str, Any]]:
    """Their mode sets and results, where they have succeeded."""
    mode_sets = identified_by(session, [row.id for row in rows])
    return [
        {"mode_set": mode_sets.get(row.id), "result": row.document and up_to_date(row.document)}
        for row in rows
    ]


of_jobs = JobRoutes(router, IDENTIFICATIONS, IdentificationOut, "identification_id", _with_modes)


of_jobs.creating(
    "start_identification",
    "Queue an identification of modes from the campaign's FRFs, or where it has none from the half"
    " spectra of its recordings; a mode set comes of it. `{}` is a body.",
    IdentificationIn,
    start_identification,
    status=202,
)
of_jobs.cancelling(
    "cancel_identification",
    "Ask for an identification's end; one that has ended already stays as it is.",
)
of_jobs.listing("list_identifications", "Identifications of a campaign, newest first.", 20)
of_jobs.getting(
    "get_identification",
    "How far an identification is, which modes it found, and how well the data support them.",
)


@router.get(
    "/identifications/{identification_id}/figures/{name}",
    response_class=Response,
    responses=RESPONSES,
)
def get_identification_figure(
    identification_id: UUID,
    name: FigureName,
    session: SessionDep,
    user: CurrentUser,
    request: FigureRequestDep,
) -> Response:
    """The figure `stabilisation` of an identification; 409 while it has found nothing, or where it
    failed.
    """
    row = identification_for(session, user, identification_id)
    require_figure(name, "stabilisation")
    document = up_to_date(require_result(session, identification_for, row, row.document))
    # what it found never changes
    return request.answer(lambda: stabilisation_figure(document), name, str(row.id))
