"""Routes of identifications."""

from __future__ import annotations

from uuid import UUID

from fastapi import Response
from sqlalchemy import select

from service.access import CurrentUser, SessionDep
from service.store.campaigns.operations import campaign_for
from service.store.modes import identifications
from service.store.modes.identifications import IdentificationIn, IdentificationOut
from service.store.modes.tables import Identification
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
