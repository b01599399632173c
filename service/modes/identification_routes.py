"""Routes of identifications."""

from __future__ import annotations

from uuid import UUID

from fastapi import Response
from sqlalchemy import select

from service.access import CurrentUser, SessionDep
from service.campaigns.operations import campaign_for
from service.errors import Conflict
from service.figures.answers import RESPONSES, Asked, FigureName, require_figure
from service.figures.look import Figure
from service.figures.stabilisation import stabilisation_figure
from service.jobs.state import why_no_result
from service.jobs.tables import Job
from service.modes import identifications
from service.modes.identification_document import up_to_date
from service.modes.identifications import IdentificationIn, IdentificationOut
from service.modes.tables import Identification
from service.web import Cursor, Limit, Page, api_router, paged

router = api_router(tags=["identifications"])


@router.post("/campaigns/{campaign_id}/identifications", status_code=202)
def start_identification(
    campaign_id: UUID, body: IdentificationIn, session: SessionDep, user: CurrentUser, response: Response
) -> IdentificationOut:
    """Queue an identification of modes from the campaign's FRFs; a mode set comes of it. `{}` is a body."""
    row = identifications.start_identification(session, user, campaign_id, body)
    response.headers["Location"] = f"/api/v1/identifications/{row.id}"
    return identifications.describe(session, row)


@router.post("/identifications/{identification_id}/cancel", status_code=202)
def cancel_identification(identification_id: UUID, session: SessionDep, user: CurrentUser) -> IdentificationOut:
    """Ask for an identification's end; one that has ended already stays as it is."""
    row = identifications.identification_for(session, user, identification_id)
    identifications.cancel_identification(session, user, row)
    return identifications.describe(session, row)


@router.get("/campaigns/{campaign_id}/identifications")
def list_identifications(
    campaign_id: UUID, session: SessionDep, user: CurrentUser, cursor: Cursor = None, limit: Limit = 20
) -> Page[IdentificationOut]:
    """Identifications of a campaign, newest first."""
    campaign = campaign_for(session, user, campaign_id)
    query = select(Identification).where(Identification.campaign_id == campaign.id)
    rows, following = paged(session, query, Identification.id, cursor, limit, newest_first=True)
    return Page(items=[identifications.describe(session, row) for row in rows], next_cursor=following)


@router.get("/identifications/{identification_id}")
def get_identification(identification_id: UUID, session: SessionDep, user: CurrentUser) -> IdentificationOut:
    """How far an identification is, which modes it found, and how well the data support them."""
    row = identifications.identification_for(session, user, identification_id)
    return identifications.describe(session, row)


@router.get("/identifications/{identification_id}/figures/{name}", response_class=Response, responses=RESPONSES)
def get_identification_figure(
    identification_id: UUID,
    name: FigureName,
    session: SessionDep,
    user: CurrentUser,
    asked: Asked,
) -> Response:
    """The figure `stabilisation` of an identification; 409 while it has found nothing, or where it failed."""
    row = identifications.identification_for(session, user, identification_id)
    require_figure(name, "stabilisation")
    if row.document is None:
        raise Conflict(why_no_result("identification", session.get_one(Job, row.id, populate_existing=True)))
    found = up_to_date(row.document)

    def draw() -> Figure:
        return stabilisation_figure(found["stabilisation"], found["modes"], found["doubtful"])

    return asked.answer(draw, name, str(row.id))  # what it found never changes
